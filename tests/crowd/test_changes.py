"""A scene that changes while people walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

import stridecast as sc
from stridecast.crowd.crowd import Crowd
from stridecast.errors import InputError, PathError, SceneError
from stridecast.model.behavior import Behavior
from stridecast.model.people import Person, Wall
from stridecast.model.scene import Circle, Polygon, Scene

CLOSED = Wall(name="round the goal", points=np.array([(-2, 10.0), (2, 10), (2, 14), (-2, 14), (-2, 10)]))


@pytest.fixture(scope="module")
def database():
    return sc.sample_database()


def _scene(**more):
    start, goal, other = np.array([0.0, 0.0]), np.array([[0.0, 12.0]]), np.array([[4.0, 6.0]])
    people = (
        Person(name="Ann", start=start, stops=(goal,), behavior=Behavior(body_radius=0.25)),
        Person(name="Bob", start=np.add(start, (4.0, 0.0)), stops=(other, goal), behavior=Behavior(body_radius=0.25)),
    )
    return Scene(start=None, goals=np.zeros((0, 2)), people=people, **more)


def _walked(database, frames):
    crowd = Crowd(database, _scene(), bodies=False)
    for _ in range(frames):
        crowd.step()
    return crowd


def _state(crowd):
    frame = crowd.frame()
    return np.concatenate((frame.positions, frame.velocities, frame.headings[:, None]), axis=1)


def test_people_go_round_what_is_put_in_their_way(database):
    crowd = _walked(database, 60)
    trunk = Circle(name="tree", center=np.array([0.0, 7.0]), radius=0.6)
    crowd.change(replace(crowd.scene, obstacles=(trunk,)))
    track = []
    while not crowd.done and crowd.time < 40:
        frame = crowd.step()
        track += [frame.positions[k] for k in range(len(frame.ids)) if frame.ids[k] == 1]
    away = np.linalg.norm(np.array(track) - trunk.center, axis=-1)
    assert crowd.done
    assert away.min() >= 0.6 + 0.25
    assert away.min() < 1.5  # and not by a wide berth, which would be some other way


def test_stops_that_are_behind_are_not_visited_again(database):
    crowd = _walked(database, 30 * 7)
    bob = np.flatnonzero(crowd.frame().ids == 2)[0]
    assert crowd.frame().positions[bob, 1] > 6.0  # past the first stop
    crowd.change(replace(crowd.scene, walls=(Wall(name="far away", points=np.array([(90.0, 0), (90, 9)])),)))
    heights = []
    while not crowd.done and crowd.time < 40:
        frame = crowd.step()
        heights += [frame.positions[k, 1] for k in range(len(frame.ids)) if frame.ids[k] == 2]
    assert crowd.done
    assert (np.diff(heights) > -0.01).all()


@pytest.mark.parametrize(
    ("change", "error", "says"),
    [
        ({"obstacles": ("onto",)}, SceneError, "'Ann'.*cannot stop before it"),
        ({"obstacles": ("before",)}, SceneError, "'Ann'.*cannot stop before it"),
        ({"walls": (CLOSED,)}, PathError, "'Ann'.*no way on"),
        ({"obstacles": (Polygon(name="bow", points=np.array([(8.0, 0), (9, 1), (9, 0), (8, 1)])),)}, SceneError, "bow"),
    ],
)
def test_what_cannot_be_changed_changes_nothing(database, change, error, says):
    crowd, twin = _walked(database, 75), _walked(database, 75)
    ann = crowd.frame().positions[0]
    places = {"onto": ann, "before": np.add(ann, (0.0, 0.75))}  # the second one nearer than she can stop
    change = {
        kind: tuple(Circle(name=str(t), center=places[t], radius=0.2) if isinstance(t, str) else t for t in things)
        for kind, things in change.items()
    }
    with pytest.raises(error, match=says):
        crowd.change(replace(crowd.scene, **change))
    for _ in range(90):
        crowd.step()
        twin.step()
        assert np.array_equal(_state(crowd), _state(twin))


def test_walls_are_kept_off_from_the_next_frame_on(database):
    crowd = _walked(database, 45)
    wall = Wall(name="fence", points=np.array([(-1.0, 8.0), (1.0, 8.0)]))
    crowd.change(replace(crowd.scene, walls=(wall,)))
    line = shapely.LineString(wall.points)
    while not crowd.done and crowd.time < 40:
        frame = crowd.step()
        assert (shapely.distance(shapely.points(frame.positions), line) >= frame.radii - 1e-9).all()
    assert crowd.done


def test_the_outlook_is_the_way_that_is_left_and_the_room_to_stop(database):
    crowd = _walked(database, 60)
    row = crowd.frame().ids.tolist().index(1)
    ahead, here = crowd.outlook("Ann"), crowd.frame().positions[row]
    assert np.allclose(ahead.way[0], here)
    assert np.allclose(ahead.way[-1], [0.0, 12.0])
    assert np.all(np.diff(ahead.way[:, 1]) >= 0)
    steps = np.linalg.norm(np.diff(ahead.window, axis=0), axis=-1) * crowd.frame_rate
    assert steps[0] == pytest.approx(np.linalg.norm(crowd.frame().velocities[row]), abs=0.2)
    assert steps[-1] < 0.3
    assert crowd.outlook(1).way.shape == ahead.way.shape
    with pytest.raises(InputError, match="'Eve'"):
        crowd.outlook("Eve")


def test_who_comes_far_away_has_a_pose_at_once(database):
    """Bodies beyond the levels of detail are stepped less often, but never shown as who was in their row before."""
    crowd = Crowd(database, _scene(), lod=(1.0, 2.0))
    frame = crowd.step(focus=(500.0, 500.0))
    assert np.allclose(np.linalg.norm(frame.rotations, axis=-1), 1.0)
    assert np.abs(frame.roots[:, [0, 2]] - frame.positions).max() < 0.3
