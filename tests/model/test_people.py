from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.errors import SceneError
from stridecast.model.people import Mover, Person, Route, Source, Spread, Wall
from stridecast.model.scene import Circle, Scene

SQUARE = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)])


def person(name="Ann", start=(0.0, 0.0), **how) -> Person:
    return Person(name=name, start=np.array(start), **how)


def source(name="gate", flow=1.0, **how) -> Source:
    return Source(name=name, area=SQUARE, flow=flow, **how)


@given(st.lists(st.floats(0.01, 9), min_size=1, max_size=6), st.data())
def test_a_mover_is_at_its_points_and_straight_between_them(waits, data):
    times = np.cumsum(waits)
    points = np.array(
        data.draw(st.lists(st.tuples(*[st.floats(-50, 50)] * 2), min_size=len(times), max_size=len(times)))
    )
    mover = Mover(name="cart", radius=1.0, times=times, points=points)
    np.testing.assert_allclose(mover.at(times), points, atol=1e-9)
    np.testing.assert_array_equal(mover.at(np.array([times[0] - 1, times[-1] + 1])), points[[0, -1]])
    np.testing.assert_array_equal(mover.velocity_at(np.array([times[0] - 1, times[-1] + 1])), np.zeros((2, 2)))
    middle = (times[1:] + times[:-1]) / 2
    ahead = mover.at(middle) + mover.velocity_at(middle) * (times[1:] - middle)[:, None]
    np.testing.assert_allclose(ahead, points[1:], atol=1e-6)


def test_arrays_cannot_be_changed():
    given_points = SQUARE.copy()
    made = Source(name="gate", area=given_points, flow=1.0, routes=(Route(stops=(given_points,)),))
    given_points += 1.0
    for array in (made.area, made.routes[0].stops[0], person(stops=(SQUARE,)).stops[0], person().start):
        assert not array.flags.writeable
    np.testing.assert_array_equal(made.area, SQUARE)


def test_spreads_are_cut_at_what_a_body_can():
    made = source(velocity=Spread(mean=1.3, deviation=5.0), height=Spread(mean=1.7, deviation=0.1, least=1.5))
    assert (made.velocity.least, made.velocity.most) == (0.1, 12.0)
    assert made.height is not None
    assert (made.height.least, made.height.most) == (1.5, 2.5)


def test_a_scene_of_a_crowd_needs_no_walker():
    scene = Scene(people=(person(),))
    assert not scene.has_walker
    assert scene.goals.shape == (0, 2)
    with pytest.raises(SceneError, match="no start and goals for a single walker"):
        scene.task()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: person(start=(0.0, np.nan)), "person 'Ann', start: point 0 is not finite"),
        (lambda: person(stops=(np.zeros((1, 2)), np.zeros((0, 2)))), "person 'Ann', stop 2: 1 or more points"),
        (lambda: person(begins=-1.0), "begins of person 'Ann' must be a finite number from 0, not -1"),
        (lambda: person(begins=np.nan), "begins of person 'Ann'"),
        (lambda: person(heading=np.inf), "heading of person 'Ann' must be a finite number, not inf"),
        (lambda: person(height=4.0), "height of person 'Ann' must lie between 0.5 and 2.5, not at 4"),
        (lambda: person(speed=-0.5), "speed of person 'Ann'"),
        (lambda: person(together=""), "together of person 'Ann' must be a word"),
        (lambda: Spread(mean=np.nan), "a spread has a finite mean"),
        (lambda: Spread(mean=1.0, deviation=-1.0), "a deviation from 0"),
        (lambda: Spread(mean=1.0, least=2.0), "a spread's mean lies between least 2 and most inf, 1"),
        (lambda: Route(stops=()), "a route needs one or more stops"),
        (lambda: Route(stops=(SQUARE,), share=-1.0), "share of a route must be a finite number from 0, not -1"),
        (lambda: source(flow=-1.0), "flow of source 'gate' must lie between 0 and 1000, not at -1"),
        (lambda: source(flow=np.nan), "flow of source 'gate'"),
        (lambda: source(flow=0.0), "source 'gate' needs flow .* or at_once"),
        (lambda: source(begins=5.0, ends=4.0), "source 'gate' ends at 4 s, before it begins at 5 s"),
        (lambda: source(at_once=-1), "at_once of source 'gate' is a number of people from 0"),
        (lambda: source(at_once=5, most=4), "source 'gate' holds 5 at once, but 4 at most"),
        (
            lambda: source(velocity=Spread(mean=30.0)),
            "velocity of source 'gate' must lie between 0.1 and 12, not at 30",
        ),
        (lambda: source(weight=Spread(mean=70.0, most=900.0)), "weight of source 'gate' .* not at 900"),
        (lambda: source(status="fly"), "status of source 'gate' is walk or run, not 'fly'"),
        (lambda: source(size="huge"), "size of source 'gate' is one of calm"),
        (lambda: source(sides=(0.0, 0.0, 0.0)), "sides of source 'gate': shares of none, left, right are all 0"),
        (lambda: source(distance=(1.0, -1.0)), "distance of source 'gate': the share of far must be .* not -1"),
        (lambda: source(patience=(1.0, np.nan)), "patience of source 'gate': the share of go must be"),
        (lambda: source(together=(0.0, 0.0, 0.0, 0.0)), "together of source 'gate': shares of 1, 2, 3, 4 are all 0"),
        (
            lambda: source(routes=(Route(stops=(SQUARE,), share=0.0),)),
            "shares of the routes of source 'gate' are all 0",
        ),
        (lambda: Wall(name="fence", points=np.zeros((2, 2))), "wall 'fence' has the same point twice in a row"),
        (lambda: Wall(name="fence", points=np.zeros((1, 2))), "wall 'fence': 2 or more points"),
        (
            lambda: Mover(name="cart", radius=1.0, times=np.array([0.0, 3.0, 3.0]), points=SQUARE[:3]),
            "times of mover 'cart' must rise; 3 s comes after 3 s",
        ),
        (
            lambda: Mover(name="cart", radius=1.0, times=np.array([0.0, np.nan]), points=SQUARE[:2]),
            "mover 'cart': time 1 is not finite",
        ),
        (
            lambda: Mover(name="cart", radius=0.0, times=np.zeros(1), points=SQUARE[:1]),
            "mover 'cart' must have a radius",
        ),
        (lambda: Scene(), "nobody is there: start and goals, people or sources are needed"),
        (lambda: Scene(start=np.zeros(2)), "goals: 1 or more points"),
        (lambda: Scene(goals=np.zeros((1, 2)), people=(person(),)), "there are goals but no start"),
        (lambda: Scene(people=(person(),), seconds=0.0), "seconds must be a finite number above 0, not 0"),
        (lambda: Scene(people=(person(),), seed=-1), "seed must be a whole number from 0"),
        (
            lambda: Scene(people=(person(),), obstacles=(Circle(name="Ann", center=np.zeros(2), radius=1.0),)),
            "two things are called 'Ann', obstacle and person; names must differ",
        ),
        (lambda: Scene(people=(person(together="pair"),)), "together 'pair' is the word of 1; 2 to 4 people"),
        (
            lambda: Scene(people=tuple(person(name=f"p{k}", start=(k, 0.0), together="us") for k in range(5))),
            "together 'us' is the word of 5",
        ),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_what_makes_no_sense_is_refused_by_name(make, says):
    with pytest.raises(SceneError, match=says):
        make()


@pytest.mark.usefixtures("unchecked")
def test_numbers_of_shares_and_times_must_fit():
    with pytest.raises(SceneError, match="together of source 'gate': 4 shares are needed, of 1, 2, 3, 4, not 5"):
        source(together=(1.0, 1.0, 1.0, 1.0, 1.0))
    with pytest.raises(SceneError, match="mover 'cart' needs a time for each of its 2 points, not 1"):
        Mover(name="cart", radius=1.0, times=np.zeros(1), points=SQUARE[:2])
