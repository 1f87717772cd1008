from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest, norm, poisson

from places import block, disc, road
from stridecast.crowd.population import population, task_of
from stridecast.errors import SceneError
from stridecast.model.people import Mover, Person, Route, Source, Spread, Wall
from stridecast.model.scene import Behavior, Scene
from stridecast.paths.generate import generate_path
from stridecast.paths.solids import Solids

GATE = np.array([(30.0, 0.0), (30.0, 6.0)])
LINE = np.array([(0.0, 0.0), (0.0, 6.0)])
NOBODY = np.zeros((0, 3))


def square(x0: float, z0: float, x1: float, z1: float) -> np.ndarray:
    return np.array([(x0, z0), (x1, z0), (x1, z1), (x0, z1)], float)


def source(name="west", **how) -> Source:
    usual = {"area": LINE, "routes": (Route(stops=(GATE,)),), "flow": 1.0 if "at_once" not in how else 0.0}
    return Source(name=name, **(usual | how))


def scene(*things, **how) -> Scene:
    people = tuple(t for t in things if isinstance(t, Person))
    return Scene(people=people, sources=tuple(t for t in things if isinstance(t, Source)), **how)


def told(due) -> list:
    """All that is known of who is due, in a form that can be compared."""

    def who(p: Person) -> tuple:
        stops = [stop.tolist() for stop in p.stops]
        return p.name, p.start.tolist(), stops, p.behavior, p.heading, p.height, p.together, p.stays, p.speed, p.begins

    return [(d.time, d.frame, d.source, d.number, [who(p) for p in d.people]) for d in due]


def everybody(due) -> list[Person]:
    return [person for d in due for person in d.people]


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 5), st.tuples(*[st.floats(0.1, 1)] * 4))
def test_the_same_seed_gives_the_same_people_and_another_one_others(seed, flow, together):
    place = scene(
        source(flow=flow, together=together, height=Spread(mean=1.7, deviation=0.1)),
        source("inside", area=square(5, 0, 15, 8), at_once=9, together=together),
    )
    first = told(islice(population(place, seed), 60))
    assert first == told(islice(population(place, seed), 60))
    assert first != told(islice(population(place, seed + 1), 60))
    counted = population(place, seed)
    assert told(islice(counted, 60)) == told(islice(counted, 60)) == first


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_sources_know_nothing_of_each_other(seed, before):
    one = source(together=(2.0, 1.0, 0.0, 0.0), style=Spread(mean=0.0, deviation=0.5))
    other = source("east", area=GATE, routes=(Route(stops=(LINE,)),), flow=3.0)
    alone = population(scene(one), seed).until(40)
    both = population(scene(*((other, one) if before else (one, other))), seed).until(40)
    assert told(d for d in both if d.source == "west") == told(alone)
    times = [d.time for d in both]
    assert times == sorted(times)
    assert len(both) > len(alone)


def test_other_people_change_nothing_of_those_who_arrive():
    ann = Person(name="Ann", start=np.array([9.0, 9.0]), stops=(GATE,))
    alone = population(scene(source())).until(40)
    both = population(scene(source(), ann)).until(40)
    assert told(d for d in both if d.source) == told(alone)
    assert [d.people[0].name for d in both if not d.source] == ["Ann"]


@pytest.mark.parametrize("together", [(1.0, 0.0, 0.0, 0.0), (1.0, 2.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)])
def test_people_arrive_at_the_rate_of_the_flow(together):
    seconds, flow = 4000.0, 0.8
    due = population(scene(source(flow=flow, together=together)), 5).until(seconds)
    sizes = np.array([len(d.people) for d in due])
    shares = np.array(together) / sum(together)
    mean = shares @ np.arange(1, 5)
    low, high = poisson.ppf((1e-4, 1 - 1e-4), flow * seconds / mean)
    assert low <= len(due) <= high
    waits = np.diff([0.0, *(d.time for d in due)])
    assert kstest(waits * flow / mean, "expon").pvalue > 1e-3
    for k, share in enumerate(shares):
        spare = 4 * np.sqrt(share * (1 - share) * len(sizes))
        assert abs((sizes == k + 1).sum() - share * len(sizes)) <= spare


def test_frames_are_the_first_that_are_not_before():
    for d in population(scene(source(flow=3.0)), 1, 25.0).until(60):
        assert (d.frame - 1) / 25 < d.time <= d.frame / 25 + 1e-9


@pytest.mark.parametrize("deviation", [0.05, 0.26, 3.0])
def test_what_is_drawn_follows_the_normal_distribution_inside_its_cuts(deviation):
    spread = Spread(mean=1.34, deviation=deviation, least=0.8, most=1.9)
    place = scene(source(flow=50.0, velocity=spread, most=3000))
    drawn = np.array([p.behavior.velocity for p in everybody(population(place, 2))])
    assert len(drawn) == 3000
    assert drawn.min() >= 0.8
    assert drawn.max() <= 1.9
    whole = norm(1.34, deviation)
    inside = whole.cdf(1.9) - whole.cdf(0.8)
    assert kstest(drawn, lambda x: np.clip((whole.cdf(x) - whole.cdf(0.8)) / inside, 0, 1)).pvalue > 1e-3


def test_shares_of_preferences_and_routes_are_kept():
    routes = (Route(stops=(GATE,), share=3.0), Route(stops=(square(10, 10, 12, 12),), stays=True))
    place = scene(source(flow=50.0, most=4000, routes=routes, sides=(1.0, 0.0, 3.0), patience=(1.0, 1.0)))
    people = everybody(population(place, 4))
    count = len(people)
    for share, wanted in (
        (sum(p.behavior.preference.side == "right" for p in people), 0.75),
        (sum(p.behavior.preference.side == "left" for p in people), 0.0),
        (sum(p.behavior.preference.patience == "wait" for p in people), 0.5),
        (sum(p.behavior.preference.distance == "near" for p in people), 1.0),
        (sum(p.stays for p in people), 0.25),
    ):
        assert abs(share / count - wanted) <= 4 * np.sqrt(wanted * (1 - wanted) / count)
    for p in people:
        (point,) = p.stops[0]
        assert (10 <= point[0] <= 12) if p.stays else point[0] == 30


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 60), st.integers(0, 25))
def test_never_more_come_than_most_nor_after_the_end(seed, most, at_once):
    at_once = min(at_once, most)
    place = scene(
        source(
            area=square(0, 0, 20, 20), flow=2.0, at_once=at_once, most=most, ends=20.0, together=(1.0, 1.0, 1.0, 1.0)
        )
    )
    due = list(population(place, seed))
    people = everybody(due)
    assert len(people) <= most
    assert len(everybody(d for d in due if d.time == 0.0)) == at_once
    assert max((d.time for d in due), default=0.0) < 20
    assert [p.name for p in people] == [f"west {k + 1}" for k in range(len(people))]


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 60), st.tuples(*[st.floats(0.1, 1)] * 4))
def test_those_at_once_overlap_nothing_and_are_inside(seed, count, together):
    area = np.array([(0, 0), (12, 0), (12, 4), (4, 4), (4, 12), (0, 12)], float)
    ann = Person(name="Ann", start=np.array([2.0, 2.0]))
    crowd = source(
        area=area,
        at_once=count,
        together=together,
        body_radius=Spread(mean=0.25, deviation=0.05, least=0.15, most=0.35),
    )
    fence = Wall(name="fence", points=np.array([(0.0, 6.0), (2.5, 6.0)]))
    cart = Mover(name="cart", radius=0.6, times=np.zeros(1), points=np.array([[8.0, 2.0]]))
    place = scene(crowd, ann, walls=(fence,), obstacles=(disc("tree", 10, 2, 0.5),), movers=(cart,))
    people = everybody(population(place, seed).until(0))
    starts, radii = np.array([p.start for p in people]), np.array([p.behavior.body_radius for p in people])
    assert len(people) == count + 1
    away = np.linalg.norm(starts[:, None] - starts[None], axis=-1)
    away[np.diag_indices(len(away))] = np.inf
    assert (away >= radii[:, None] + radii[None]).all()
    assert shapely.contains_xy(shapely.Polygon(area), starts).all()
    for solid, radius in (
        (shapely.LineString(fence.points), 0.0),
        (shapely.Point(10, 2), 0.5),
        (shapely.Point(8, 2), 0.6),
    ):
        assert (shapely.distance(shapely.points(starts), solid) >= radii + radius).all()
    for group in {p.together for p in people} - {None}:
        mine = [p for p in people if p.together == group]
        assert 2 <= len(mine) <= 4
        assert len({p.behavior.velocity for p in mine}) == len({p.behavior.preference for p in mine}) == 1
        where = np.array([p.start for p in mine])
        nearest = np.linalg.norm(where[:, None] - where[None], axis=-1) + 9 * np.eye(len(mine))
        assert (nearest.min(axis=1) < 1.0).all()


def test_ten_thousand_are_put_down():
    place = scene(source(area=square(0, 0, 120, 120), at_once=10_000, body_radius=Spread(mean=0.25)))
    starts = np.array([p.start for p in everybody(population(place).until(0))])
    assert len(starts) == 10_000
    tree = shapely.STRtree(shapely.points(starts))
    one, other = tree.query(shapely.points(starts), predicate="dwithin", distance=0.5)
    assert (one == other).all()


def test_who_stands_in_a_group_looks_at_the_others():
    place = scene(source(area=square(0, 0, 20, 20), routes=(), at_once=20, together=(0.0, 0.0, 1.0, 0.0)))
    due = population(place, 3).until(0)
    for d in due[:-1]:  # the last group may be smaller
        middle = np.mean([p.start for p in d.people], axis=0)
        for p in d.people:
            assert p.speed == 0
            np.testing.assert_allclose(
                [np.sin(p.heading), np.cos(p.heading)], (middle - p.start) / np.linalg.norm(middle - p.start)
            )


def test_people_of_a_group_go_beside_each_other():
    place = scene(source(flow=5.0, together=(0.0, 0.0, 1.0, 0.0)))
    for d in islice(population(place, 1), 40):
        points = np.array([p.stops[0][0] for p in d.people])
        assert (points[:, 0] == 30).all()
        apart = np.abs(np.subtract.outer(points[:, 1], points[:, 1]))[np.triu_indices(3, 1)]
        assert apart.min() >= 0.6
        assert apart.max() <= 2.0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.lists(st.tuples(st.floats(-1, 1), st.floats(0, 6)), max_size=8))
def test_who_is_put_where_there_is_room_touches_nobody(seed, others):
    discs = np.array([(x, z, 0.3) for x, z in others]).reshape(-1, 3)
    place = scene(source(together=(1.0, 1.0, 1.0, 1.0)), walls=(Wall(name="w", points=np.array([(-1.0, 3), (1, 3)])),))
    crowd = population(place, seed)
    solids = Solids(place)
    for due in islice(crowd, 5):
        found = crowd.place(due, discs)
        assert (
            told([replace(due, people=found)]) == told([replace(due, people=crowd.place(due, discs))])
            if found
            else True
        )
        if found is None:
            continue
        starts, radii = np.array([p.start for p in found]), np.array([p.behavior.body_radius for p in found])
        assert solids.are_clear(starts, radii).all()
        assert (np.linalg.norm(starts[:, None] - discs[None, :, :2], axis=-1) >= radii[:, None] + 0.3).all()
        for k in range(1, len(starts)):
            assert (np.linalg.norm(starts[:k] - starts[k], axis=-1) >= radii[:k] + radii[k]).all()
        assert [p.name for p in found] == [p.name for p in due.people]


def test_a_blocked_source_holds_people_back_until_there_is_room():
    crowd = population(scene(source()), 2)
    due = next(iter(crowd))
    queue = np.array([(0.0, z, 0.3) for z in np.arange(0, 6.5, 0.5)])
    assert all(crowd.place(due, queue, attempt=k) is None for k in range(20))
    assert crowd.place(due, queue[:6]) is not None
    assert crowd.place(due, NOBODY) == due.people


def test_somebody_by_name_waits_for_their_own_place():
    crowd = population(scene(Person(name="Ann", start=np.zeros(2), begins=3.0)))
    (due,) = crowd.until(10)
    assert (due.time, due.frame) == (3.0, 90)
    assert crowd.place(due, np.array([(0.2, 0.0, 0.3)])) is None
    assert crowd.place(due, np.array([(2.0, 0.0, 0.3)])) == due.people


def test_somebody_has_a_way_of_their_own():
    ann = Person(name="Ann", start=np.zeros(2), stops=(np.array([[4.0, 0.0]]), GATE), behavior=Behavior(velocity=0.7))
    place = scene(ann, source(), walls=(Wall(name="fence", points=np.array([(6.0, -5.0), (6.0, 5.0)])),))
    found = population(place).until(0)[0].people[0]
    task = task_of(place, found)
    assert task.behavior.velocity == 0.7
    curve = generate_path(task).curve
    np.testing.assert_allclose(curve.points[[0, -1]], [(0, 0), found.stops[1][0]], atol=1e-9)
    with pytest.raises(SceneError, match="person 'Ann' needs stops that are single points"):
        task_of(place, ann)


PEN = {"walls": (Wall(name="pen", points=np.array([(-1.0, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)])),)}


@pytest.mark.parametrize(
    ("things", "how", "says"),
    [
        (
            (("Ann", 1.1, 0),),
            PEN,
            r"the start of person 'Ann' \(1.1, 0\) lies 0.09 m from wall 'pen'; the body needs 0.3",
        ),
        (
            (("Ann", 2, 0),),
            {"obstacles": (block("kiosk", 1, -1, 3, 1),)},
            "person 'Ann' .* lies inside obstacle 'kiosk'",
        ),
        ((("Ann", 0, 9),), {"roads": (road("lane", 2.0, (-5, 0), (5, 0)),)}, "person 'Ann' .* lies off the roads"),
        ((("Ann", 0, 0), ("Ben", 0.5, 0)), {}, "persons 'Ann' and 'Ben' start in the same place; put 0.1 m more"),
        (
            (("Ann", 0, 0),),
            {"movers": (Mover(name="cart", radius=1.0, times=np.zeros(1), points=np.array([[1.0, 0.0]])),)},
            "the start of person 'Ann' is where mover 'cart' is then",
        ),
    ],
)
def test_who_cannot_start_there_is_named(things, how, says):
    people = [Person(name=name, start=np.array([x, z], float)) for name, x, z in things]
    with pytest.raises(SceneError, match=says):
        population(scene(*people, **how))


@pytest.mark.parametrize(
    ("given_source", "says"),
    [
        (source(area=square(0, 0, 2, 2), at_once=50), r"source 'west' should hold 50 people at once, but \d fit"),
        (source(area=LINE[:1], at_once=2), "source 'west' should hold 2 people at once, but 1 fit"),
        (
            source(area=square(0, 0, 2, 2)[[0, 2, 1, 3]], at_once=1),
            "the area of source 'west' is no polygon: Self-inter",
        ),
        (source(area=np.array([(0.0, 0), (1, 1), (2, 2)]), at_once=1), "the area of source 'west' is no polygon"),
        (
            source(at_once=1, routes=(Route(stops=(LINE, np.array([[9.0, 9.0]]))),)),
            r"stop 2 of route 1 of source 'west' \(9, 9\) lies inside obstacle 'tree'",
        ),
        (
            source(at_once=1, routes=(Route(stops=(square(8.9, 8.9, 9.1, 9.1),)),)),
            "stop 1 of route 1 of source 'west' has hardly a place",
        ),
    ],
)
def test_sources_that_cannot_be_are_named(given_source, says):
    with pytest.raises(SceneError, match=says):
        population(scene(given_source, obstacles=(disc("tree", 9, 9, 1),)))


def test_a_frame_rate_must_be_one():
    with pytest.raises(SceneError, match="frame rate must be above 0 Hz, not 0"):
        population(scene(source()), 0, 0.0)
