"""People and sources that come into a scene, leave it, or become others, while everybody else walks."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import stridecast as sc
from stridecast.crowd.baking import overlap_depths
from stridecast.crowd.changing import Changes, alike
from stridecast.crowd.crowd import Crowd
from stridecast.errors import InputError, PathError, SceneError
from stridecast.model.behavior import Behavior, Preference
from stridecast.model.people import Mover, Person, Route, Source, Wall
from stridecast.model.scene import Circle, Scene


@cache
def sample():
    return sc.sample_database()


@pytest.fixture
def database():
    return sample()


def person(name, start, *stops, radius=0.25, velocity=1.3, style=0.0, **more):
    behavior = Behavior(body_radius=radius, velocity=velocity, style=style)
    return Person(
        name=name,
        start=np.array(start, float),
        stops=tuple(np.array([stop], float) for stop in stops),
        behavior=behavior,
        **more,
    )


ANN, BOB = person("Ann", (0, 0), (0, 14)), person("Bob", (0.4, 14), (0.4, 0))
EVE = person("Eve", (-4, 7), (4, 7))
DOOR = Source(
    name="door", area=np.array([(6.0, 0.0), (9, 0)]), routes=(Route(stops=(np.array([(7.0, 12.0)]),)),), flow=1
)


def scene(*people, **more):
    return Scene(people=people, **more)


def walked(database, frames, *people, **more):
    crowd = Crowd(database, scene(*people, **more), bodies=False)
    for _ in range(frames):
        crowd.step()
    return crowd


def state(crowd):
    """Everything about everybody, by name."""
    f = crowd.frame()
    rows = zip(f.positions, f.velocities, f.accelerations, f.headings, f.rules, strict=True)
    return {crowd.person(n).name: np.hstack(row).tolist() for n, row in zip(f.ids.tolist(), rows, strict=True)}


def touching(crowd):
    return overlap_depths(crowd.frame(), np.array([m.radius for m in crowd.scene.movers])).tolist()


# laws


@settings(max_examples=4, deadline=None)
@given(
    after=st.integers(0, 90),
    start=st.tuples(st.floats(-5, 5), st.floats(2, 12)),
    stop=st.tuples(st.floats(-6, 6), st.floats(20, 24)),
    radius=st.floats(0.2, 0.4),
)
def test_who_is_added_comes_as_if_the_scene_had_said_so_from_the_beginning(after, start, stop, radius):
    """The same bits for everybody: the added one, those who were there, and those who come later."""
    database = sample()
    crowd = walked(database, after, ANN, BOB, sources=(DOOR,))
    late = person("late", start, stop, radius=radius)
    crowd.add(late)
    twin = Crowd(
        database, scene(ANN, BOB, replace(late, begins=after / crowd.frame_rate), sources=(DOOR,)), bodies=False
    )
    for _ in range(after):
        twin.step()
    for k in range(60):
        crowd.step()
        twin.step()
        if k % 12 == 0:
            assert state(crowd) == state(twin)
            assert not touching(crowd)


@settings(max_examples=4, deadline=None)
@given(after=st.integers(0, 90), by_number=st.booleans(), first=st.booleans())
def test_others_go_on_as_if_who_is_removed_had_never_been_there(after, by_number, first):
    """Somebody far away, whom nobody has met."""
    database = sample()
    far = person("far", (200, 200), (200, 260))
    crowd = walked(database, after, *((far, ANN, BOB) if first else (ANN, BOB, far)))
    twin = walked(database, after, ANN, BOB)
    number = next(n for n in (1, 2, 3) if crowd.person(n).name == "far")
    assert crowd.remove(number if by_number else "far") == Changes(removed=(number,))
    for k in range(48):
        if k % 12 == 0:
            assert state(crowd) == state(twin)
        crowd.step()
        twin.step()
    assert crowd.removed == [(number, pytest.approx(after / crowd.frame_rate))]
    assert "far" not in {p.name for p in crowd.scene.people}


@settings(max_examples=4, deadline=None)
@given(after=st.integers(0, 120), seed=st.integers(0, 99))
def test_nobody_is_ever_put_into_somebody(after, seed):
    """Many people are added in the middle of others, moving obstacles too: who has no room waits outside."""
    database = sample()
    mover = Mover(name="cart", radius=0.5, points=np.array([(-8.0, 7), (8, 7)]), times=np.array([0.0, 16.0]))
    crowd = walked(database, after, ANN, BOB, sources=(DOOR,), movers=(mover,))
    rng = np.random.default_rng(seed)
    more = [person(f"more {k}", rng.uniform((-3, 0), (3, 14)), rng.uniform((-8, 20), (8, 30))) for k in range(30)]
    added = 0
    for one in more:
        with contextlib.suppress(SceneError):  # they start where others do
            crowd.add(one)
            added += 1
    assert added > 5
    for _ in range(150):
        crowd.step()
        assert not touching(crowd)
    assert crowd.waiting + len(crowd.came) >= 2 + added


def test_who_comes_into_somebody_who_stands_waits_until_they_are_gone(database):
    crowd = walked(database, 60, person("post", (3, 3), begins=0.5), ANN)
    crowd.add(person("late", (3.2, 3), (3, 12)))
    for _ in range(30):
        crowd.step()
    assert (crowd.waiting, [p.name for p in crowd.came]) == (1, ["Ann", "post"])
    crowd.remove("post")
    crowd.step()
    assert (crowd.waiting, [p.name for p in crowd.came]) == (0, ["Ann", "post", "late"])


@settings(max_examples=4, deadline=None)
@given(after=st.integers(1, 90))
def test_the_same_scene_changes_nothing(after):
    database = sample()
    crowd, twin = (walked(database, after, ANN, BOB, sources=(DOOR,)) for _ in range(2))
    assert crowd.change(scene(BOB, ANN, sources=(replace(DOOR),))) == Changes()
    for _ in range(60):
        crowd.step()
        twin.step()
        assert state(crowd) == state(twin)


BOX = Wall(name="box", points=np.array([(-9.0, 20), (-5, 20), (-5, 24), (-9, 24), (-9, 20)]))


@pytest.mark.parametrize(
    ("more", "error", "says"),
    [
        ((person("in a wall", (-5, 22), (0, 0)),), SceneError, "'in a wall'"),
        ((person("to a wall", (3, 3), (-5, 22)),), SceneError, "to a wall"),
        ((person("locked in", (-7, 22), (0, 0)),), PathError, "'locked in'"),
        ((person("onto", (0.1, 0), (5, 5)),), SceneError, "'Ann' and 'onto' start in the same place"),
        ((person("Bob", (3, 3)),), SceneError, "'Bob'"),
        ((person("fine", (3, 3), (5, 5)), person("locked in", (-7, 22), (0, 0))), PathError, "'locked in'"),
        ((person("pair", (3, 3), (5, 5), together="us"),), SceneError, "'us'"),
    ],
)
def test_who_cannot_come_leaves_everything_as_it_was(database, more, error, says):
    crowd, twin = (walked(database, 75, ANN, BOB, sources=(DOOR,), walls=(BOX,)) for _ in range(2))
    before = crowd.scene
    with pytest.raises(error, match=says):
        crowd.add(*more)
    assert crowd.scene is before
    for _ in range(60):
        crowd.step()
        twin.step()
        assert state(crowd) == state(twin)


def test_what_progress_raises_ends_a_change_that_has_changed_nothing(database):
    crowd, twin = (walked(database, 75, ANN, BOB) for _ in range(2))

    class Enough(Exception):  # noqa: N818
        pass

    told = []
    tree = Circle(name="tree", center=np.array([0.0, 7]), radius=0.5)

    def progress(done, total):
        told.append((done, total))
        if len(told) > 3:
            raise Enough

    with pytest.raises(Enough):
        crowd.change(scene(ANN, BOB, EVE, obstacles=(tree,)), progress=progress)
    assert {total for _, total in told} == {3}
    for _ in range(60):
        crowd.step()
        twin.step()
        assert state(crowd) == state(twin)


# what can change of somebody


def test_whose_goal_is_moved_turns_and_goes_there(database):
    crowd = walked(database, 75, ANN, BOB)
    here = state(crowd)["Ann"]
    changes = crowd.change(scene(person("Ann", (0, 0), (8, 6)), BOB))
    assert (changes.altered, changes.anew, changes.removed) == ((1,), (), ())
    crowd.step()
    assert np.allclose(state(crowd)["Ann"][:2], here[:2], atol=0.1)
    while not crowd.done and crowd.time < 30:
        frame = crowd.step()
        if 1 in frame.ids:
            last = frame.positions[frame.ids.tolist().index(1)]
        assert not touching(crowd)
    assert crowd.done
    assert np.linalg.norm(last - (8, 6)) < 0.6


def test_stops_that_are_behind_are_not_gone_to_again(database):
    before = person("Ann", (0, 0), (0, 5), (0, 14))
    crowd = walked(database, 30 * 6, before)
    crowd.change(scene(person("Ann", (0, 0), (0, 5), (5, 14))))
    heights = []
    while not crowd.done and crowd.time < 30:
        heights += crowd.step().positions[:, 1].tolist()
    assert crowd.done
    assert heights[0] > 5
    assert min(heights) >= heights[0] - 0.01


def test_speed_and_preferences_change_on_the_way(database):
    crowd = walked(database, 60, ANN)
    slow = Behavior(body_radius=0.25, velocity=0.6, preference=Preference(side="left", patience="wait"))
    crowd.change(scene(replace(ANN, behavior=slow)))
    for _ in range(90):
        frame = crowd.step()
    assert np.linalg.norm(frame.velocities[0]) == pytest.approx(0.6, abs=0.1)
    assert crowd.person(1).behavior is slow


def test_mood_changes_on_the_way_and_nobody_elses(database):
    """Vehicles go as they would have, other bodies move as they would have, and theirs by and by otherwise."""
    crowds = [Crowd(database, scene(ANN, BOB)) for _ in range(3)]
    for crowd in crowds:
        for _ in range(60):
            crowd.step()
    _, kept, gloomy = crowds
    kept.change(scene(replace(ANN, behavior=replace(ANN.behavior, weight=71.0)), BOB))
    other = replace(ANN.behavior, style=-1.0)
    assert gloomy.change(scene(replace(ANN, behavior=other), BOB)).altered == (1,)
    poses = [[], []]
    for _ in range(60):
        a, b, c = (crowd.step() for crowd in crowds)
        assert np.array_equal(a.positions, b.positions)
        assert np.array_equal(a.positions, c.positions)
        assert np.array_equal(a.rotations, b.rotations)
        assert np.array_equal(a.rotations[1], c.rotations[1])
        poses[0].append(a.rotations[0])
        poses[1].append(c.rotations[0])
    usual, changed = np.array(poses)
    assert np.abs(changed[0] - usual[0]).max() < 0.1
    assert np.abs(changed - usual).max() > 0.1
    assert np.abs(np.diff(changed, axis=0)).max() < 1.5 * np.abs(np.diff(usual, axis=0)).max()  # nothing pops


def test_who_walks_comes_to_stand_and_who_stands_begins_to_walk(database):
    crowd = walked(database, 60, ANN, person("Eve", (3, 3)))
    crowd.change(scene(replace(ANN, stops=()), person("Eve", (3, 3), (3, 9))))
    for _ in range(120):
        frame = crowd.step()
    assert np.allclose(frame.velocities[0], 0.0)
    assert state(crowd)["Eve"][1] > 4.0


def test_whose_start_or_body_is_another_comes_anew_with_a_new_number(database):
    crowd = walked(database, 90, ANN, BOB)
    changes = crowd.change(scene(replace(ANN, start=np.array([-3.0, 0.0])), BOB))
    assert (changes.anew, changes.removed) == (("Ann",), (1,))
    assert np.allclose(crowd.step().positions[-1], (-3, 0), atol=0.05)
    assert crowd.frame().ids.tolist() == [2, 3]
    assert not crowd.left


def test_who_has_yet_to_come_comes_as_what_they_are_then(database):
    late = person("late", (5, 0), (5, 9), begins=3.0)
    crowd = walked(database, 30, ANN, late, person("never", (9, 0), (9, 9), begins=3.0))
    moved = replace(late, start=np.array([-5.0, 0.0]), begins=2.0)
    assert crowd.change(scene(ANN, moved)) == Changes()
    for _ in range(90):
        crowd.step()
    assert [p.name for p in crowd.came] == ["Ann", "late"]
    assert state(crowd)["late"][0] < 0
    assert state(crowd)["late"][1] > 1.0


def test_who_has_left_stays_away(database):
    crowd = walked(database, 120, person("short", (3, 0), (3, 2)), ANN)
    assert [n for n, _ in crowd.left] == [1]
    crowd.change(scene(person("short", (3, 0), (3, 9)), ANN))
    for _ in range(60):
        crowd.step()
    assert len(crowd.came) == 2


def test_who_stayed_out_comes_once_there_is_a_way(database):
    crowd = walked(database, 60, ANN, person("caught", (-7, 22), (0, 22), begins=1.0), walls=(BOX,))
    assert [p.name for p in crowd.turned_away] == ["caught"]
    crowd.change(scene(ANN, person("caught", (-7, 22), (-7, 21), begins=1.0), walls=(BOX,)))
    crowd.step()
    assert "caught" in state(crowd)


def test_the_one_walker_of_a_scene_changes_as_the_others_do(database):
    given = Scene(start=np.array([0.0, 0.0]), goals=np.array([[0.0, 9.0]]))
    crowd = Crowd(database, given, bodies=False)
    for _ in range(60):
        crowd.step()
    assert crowd.change(replace(given, goals=np.array([[5.0, 5.0]]))).altered == (1,)
    assert crowd.change(replace(given, goals=np.array([[5.0, 5.0]]))) == Changes()


# sources


def test_a_source_sends_from_now_on_what_it_says_now(database):
    crowd = walked(database, 150, ANN, sources=(DOOR,))
    before = sum(p.name.startswith("door") for p in crowd.came)
    assert before > 1
    crowd.change(scene(ANN))
    for _ in range(150):
        crowd.step()
    assert sum(p.name.startswith("door") for p in crowd.came) == before
    crowd.change(scene(ANN, sources=(replace(DOOR, flow=3.0, at_once=4),)))
    for _ in range(150):
        crowd.step()
        assert not touching(crowd)
    names = [p.name for p in crowd.came if p.name.startswith("door")]
    assert len(names) > before + 4
    crowd.change(scene(ANN, sources=(replace(DOOR, flow=0.5),)))
    for _ in range(150):
        crowd.step()
    names = [p.name for p in crowd.came]
    assert len(set(names)) == len(names)


def test_nobody_comes_twice_by_one_name_from_a_source_that_is_taken_out_and_put_back(database):
    crowd = walked(database, 150, ANN, sources=(DOOR,))
    crowd.change(scene(ANN))
    crowd.change(scene(ANN, sources=(DOOR,)))
    for _ in range(150):
        crowd.step()
    names = [p.name for p in crowd.came]
    assert len(set(names)) == len(names)


def test_a_source_without_a_way_is_refused(database):
    crowd = walked(database, 30, ANN, walls=(BOX,))
    shut = replace(DOOR, area=np.array([(-7.0, 22.0)]))
    with pytest.raises(PathError, match="door"):
        crowd.change(scene(ANN, sources=(shut,), walls=(BOX,)))
    assert not crowd.scene.sources


# refusals


def test_who_is_not_there_cannot_be_removed(database):
    crowd = walked(database, 10, ANN, BOB)
    with pytest.raises(InputError, match="'nobody'"):
        crowd.remove("Ann", "nobody")
    with pytest.raises(InputError, match="number 7"):
        crowd.remove(7)
    with pytest.raises(SceneError, match="nobody is there"):
        crowd.remove("Ann", "Bob")
    assert [p.name for p in crowd.scene.people] == ["Ann", "Bob"]


def test_one_of_a_pair_walks_on_alone(database):
    pair = [person(n, (k, 0), (k, 14), together="us") for k, n in enumerate(("one", "two"))]
    crowd = walked(database, 60, *pair)
    changes = crowd.remove("one")
    assert (changes.removed, changes.altered) == ((1,), (2,))
    assert crowd.person(2).together is None


def test_somebody_whom_a_source_sent_is_removed_alone(database):
    crowd = walked(database, 150, ANN, sources=(DOOR,))
    number = next(n for n, p in enumerate(crowd.came, 1) if p.name == "door 1")
    assert crowd.remove(number).removed == (number,)
    assert "door 1" not in state(crowd)
    assert crowd.scene.sources


def test_alike_looks_through_everything():
    assert alike(ANN, person("Ann", (0, 0), (0, 14)))
    assert not alike(ANN, person("Ann", (0, 0), (0, 14.01)))
    assert not alike(ANN, replace(ANN, stops=()))
    assert not alike(1, 1.0)
    assert alike(scene(ANN, sources=(DOOR,)), scene(ANN, sources=(replace(DOOR),)))
