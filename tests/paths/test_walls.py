from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from places import fits_through, room, scene
from stridecast.errors import PathError, SceneError
from stridecast.model.people import Person, Wall
from stridecast.model.scene import Scene
from stridecast.paths.generate import generate_path
from stridecast.paths.solids import WALL, Solids


def wall(name: str, *points: tuple[float, float]) -> Wall:
    return Wall(name=name, points=np.array(points, float))


def walled(start, goals, *walls: Wall, **how) -> Scene:
    return replace(scene(start, goals, **how), walls=walls)


def random_walls(seed: int) -> Scene:
    """Bent walls between a start and a goal."""
    rng = np.random.default_rng(seed)
    walls = []
    for k in range(rng.integers(1, 12)):
        turns = np.cumsum(rng.uniform(-2.0, 2.0, rng.integers(1, 5))) + rng.uniform(-np.pi, np.pi)
        steps = rng.uniform(0.3, 2.5, (len(turns), 1)) * np.stack((np.sin(turns), np.cos(turns)), axis=-1)
        first = rng.uniform((-4, 1.0), (4, 9))
        points = np.concatenate((first[None], first + np.cumsum(steps, axis=0)))
        if shapely.LineString(points).distance(shapely.MultiPoint([(0, 0), (0, 10)])) > 0.5:
            walls.append(Wall(name=f"wall {k}", points=points))
    return walled((0, 0), [(0, 10)], *walls, body_radius=0.25)


@pytest.mark.parametrize("seed", range(40))
def test_ways_keep_clear_of_walls(seed):
    place = random_walls(seed)
    radius = place.behavior.body_radius
    try:
        line = generate_path(place).curve.points
    except PathError:
        assert not fits_through(place, 0.15)
        return
    assert room(place, line) >= radius + WALL / 2 - 1e-5
    np.testing.assert_allclose(line[[0, -1]], [(0, 0), (0, 10)], atol=1e-9)


def test_a_wall_is_gone_round_at_its_nearer_end_and_named():
    path = generate_path(walled((0, 0), [(0, 10)], wall("fence", (-3, 5), (0, 5), (1, 5))))
    assert {name for _, name in path.inserted} == {"fence"}
    assert path.curve.points[:, 0].max() > 1.3
    assert path.curve.length < 10.6


def test_walls_that_shut_somebody_in_are_named_once():
    pen = wall("pen", (-3, -3), (3, -3), (3, 3), (-3, 3), (-3, -3))
    with pytest.raises(PathError, match=r"no way from the start .*: wall 'pen' is in the way; the body needs gaps of"):
        generate_path(walled((0, 0), [(0, 10)], pen))
    two = [wall("left", (1, 4), (9, 4), (9, -9), (-9, -9)), wall("right", (-9, -9), (-9, 4), (0.6, 4))]
    with pytest.raises(
        PathError, match=r"walls? 'left'.* and wall 'right' are in the way|wall 'left' and wall 'right'"
    ):
        generate_path(walled((0, 0), [(0, 10)], *two))


def test_nobody_stands_in_a_wall():
    with pytest.raises(SceneError, match=r"the goal \(0, 3.1\) lies 0.09 m from wall 'fence'; the body needs 0.3 m"):
        generate_path(walled((0, 0), [(0, 3.1)], wall("fence", (-2, 3), (2, 3))))
    with pytest.raises(SceneError, match=r"the start \(0, 0\) lies inside wall 'fence'"):
        generate_path(walled((0, 0), [(0, 3)], wall("fence", (-2, 0), (2, 0))))


def test_a_scene_without_a_walker_has_no_way():
    crowd = Scene(people=(Person(name="Ann", start=np.zeros(2)),))
    with pytest.raises(SceneError, match="has no start and goals for a single walker, only people and sources"):
        generate_path(crowd)


def test_bodies_are_clear_where_they_touch_nothing():
    place = random_walls(3)
    points = np.random.default_rng(0).uniform((-5, 0), (5, 10), (400, 2))
    radii = np.random.default_rng(1).uniform(0.1, 0.5, 400)
    things = [shapely.LineString(w.points) for w in place.walls]
    away = shapely.distance(shapely.points(points)[:, None], np.array(things)[None]).min(axis=1)
    clear = Solids(place).are_clear(points, radii)
    assert clear[away > radii + WALL].all()
    assert not clear[away < radii].any()
    assert clear.any()
    assert not clear.all()
