from __future__ import annotations

import numpy as np
import pytest

from stridecast.crowd.population import population, task_of
from stridecast.errors import SceneError
from stridecast.formats.scenes import load_scene, save_scene
from stridecast.paths.generate import generate_path
from stridecast.samples.situations import SITUATIONS, SPEEDS, situation

FEW = {"ring": {"laps": 1}}
"""Arguments that keep the test short."""

COUNTS = {
    "head_on": 2,
    "overtaking": 2,
    "crossing": 2,
    "four_way": 24,
    "antipodal": 100,
    "two_way": 100,
    "bottleneck": 60,
    "corner": 20,
    "ring": 123,
}


def people(name, seed):
    scene = situation(name, seed, **FEW.get(name, {}))
    return scene, [p for due in population(scene).until(0) for p in due.people]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", SITUATIONS)
def test_everybody_is_there_and_nobody_overlaps(name, seed):
    _, found = people(name, seed)
    assert len(found) == COUNTS[name]
    starts = np.array([p.start for p in found])
    away = np.linalg.norm(starts[:, None] - starts[None], axis=-1) + 9 * np.eye(len(found))
    assert away.min() > 0.5
    speeds = np.array([p.behavior.velocity for p in found])
    assert speeds.min() >= SPEEDS.least
    assert speeds.max() <= SPEEDS.most


@pytest.mark.parametrize("name", SITUATIONS)
def test_every_goal_can_be_reached_alone(name):
    scene, found = people(name, 1)
    for person in found[:: max(1, len(found) // 6)]:
        curve = generate_path(task_of(scene, person)).curve
        np.testing.assert_allclose(curve.points[[0, -1]], [person.start, person.stops[-1][0]], atol=1e-9)


@pytest.mark.parametrize("name", SITUATIONS)
def test_seeds_vary_them_and_repeat_them(name):
    one, again, other = (people(name, seed)[1] for seed in (1, 1, 2))
    for a, b in zip(one, again, strict=True):
        np.testing.assert_array_equal(a.start, b.start)
        assert a.behavior == b.behavior
    assert not np.array_equal([p.start for p in one], [p.start for p in other])


def test_they_meet_overtake_and_cross():
    one, other = situation("head_on").people
    assert (one.stops[0][0] - one.start)[1] * (other.stops[0][0] - other.start)[1] < 0
    slow, fast = situation("overtaking", 3).people
    assert (slow.behavior.velocity, fast.behavior.velocity) == (0.8, 1.4)
    assert fast.start[1] < slow.start[1]
    for seed in range(10):  # without the other, each would be at the crossing at about the same time
        times = [np.linalg.norm(p.start) / p.behavior.velocity for p in situation("crossing", seed).people]
        assert abs(times[0] - times[1]) < 1.3


@pytest.mark.parametrize("density", [0.2, 1.0, 2.0, 3.0])
def test_a_ring_has_any_density(density):
    scene = situation("ring", 1, density=density, laps=1)
    assert len(scene.people) == pytest.approx(density * np.pi * (8**2 - 5**2), abs=1)
    population(scene)
    for person in scene.people[::40]:
        way = np.concatenate([person.start[None], *person.stops])
        turn = np.unwrap(np.arctan2(way[:, 0], way[:, 1]))
        assert turn[-1] - turn[0] == pytest.approx(2 * np.pi)
        assert np.linalg.norm(way, axis=-1).min() > 5.25


def test_they_can_be_written_and_read(tmp_path):
    for name in SITUATIONS:
        scene = situation(name, 1, **FEW.get(name, {}))
        save_scene(tmp_path / "scene.yaml", scene)
        read = load_scene(tmp_path / "scene.yaml")
        assert [p.name for p in read.people] == [p.name for p in scene.people]
        assert [s.at_once for s in read.sources] == [s.at_once for s in scene.sources]


def test_what_is_unknown_or_too_full_is_refused():
    with pytest.raises(SceneError, match="there is no situation 'party'; there are head_on, overtaking"):
        situation("party")
    with pytest.raises(SceneError, match="490 people do not fit into the ring"):
        situation("ring", density=4.0)
    with pytest.raises(SceneError, match="nobody is in a ring with 0 people"):
        situation("ring", density=0.0)
    with pytest.raises(SceneError, match="400 people do not fit on a circle of 20 m"):
        situation("antipodal", people=400)
