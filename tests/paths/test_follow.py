"""Walking along curves: the shape is kept, the end is reached, the bounds in force hold."""

from __future__ import annotations

import numpy as np
import pytest

from stridecast.analysis.style import stoop
from stridecast.analysis.take import analyse
from stridecast.errors import TakeError
from stridecast.formats.recordings import load_motion
from stridecast.model.scene import Behavior, Circle, Scene, Station
from stridecast.paths.curve import Curve
from stridecast.paths.follow import PathWalk, walk_along, walk_scene
from stridecast.steering.curves import named_curve

S_BEND = np.stack([1.5 * np.sin(1.2 * np.linspace(0, 6, 300)), 1.5 * np.linspace(0, 6, 300)], axis=-1)
ROUNDED = 0.3


def ways() -> dict[str, Curve]:
    return {
        "line": Curve.through(named_curve("line:7")),
        "circle": Curve.through(named_curve("circle:2")),
        "eight": Curve.through(named_curve("eight:2")),
        "S": Curve.through(S_BEND),
        "square": Curve.through(named_curve("square:5"), rounding=ROUNDED),
    }


def check_bounds(walk: PathWalk) -> None:
    """No frame changes its force, or its speed, by more than a body can."""
    journey = walk.journey
    rate = journey.motion.frame_rate
    speeds = np.linalg.norm(journey.velocities, axis=-1)
    np.testing.assert_allclose(
        journey.velocities[1:], journey.velocities[:-1] + journey.accelerations[1:] / rate, atol=1e-9
    )
    assert speeds.max() < 5.0


@pytest.mark.parametrize("name", list(ways()))
@pytest.mark.parametrize(("status", "velocity"), [("walk", 1.3), ("walk", 0.8), ("run", 3.0)])
def test_the_shape_is_kept_and_the_end_reached(sample_person, name, status, velocity):
    curve = ways()[name]
    walk = walk_along(sample_person, curve, Behavior(velocity=velocity, status=status))
    assert walk.arrived
    assert walk.errors.mean() < 0.03
    assert walk.errors.max() < 0.10
    went = np.linalg.norm(np.diff(walk.journey.positions, axis=0), axis=-1).sum()
    assert went == pytest.approx(curve.length, abs=0.03 * curve.length + 0.1)
    assert np.linalg.norm(walk.journey.positions[-1] - curve.points[-1]) < 0.15
    assert walk.journey.motions[-1] == "stand"
    assert np.linalg.norm(walk.journey.velocities[-1]) < 0.02
    assert walk.journey.made_up == 0
    check_bounds(walk)


@pytest.mark.parametrize("rate", [30.0, 60.0])
def test_the_frame_rate_does_not_matter(sample_person, rate):
    walk = walk_along(sample_person, ways()["S"], frame_rate=rate)
    assert walk.arrived
    assert walk.errors.max() < 0.06
    assert walk.journey.motion.frame_rate == rate


def test_same_way_same_bits(sample_person):
    first, again = (walk_along(sample_person, ways()["S"]) for _ in range(2))
    np.testing.assert_array_equal(first.journey.motion.rotations, again.journey.motion.rotations)


def test_a_way_elsewhere_is_walked_alike(sample_person):
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    here = walk_along(sample_person, Curve.through(S_BEND))
    there = walk_along(sample_person, Curve.through(S_BEND @ turn.T + [50.0, -20.0]))
    assert len(here.journey.times) == len(there.journey.times)
    np.testing.assert_allclose(there.journey.positions, here.journey.positions @ turn.T + [50.0, -20.0], atol=1e-3)


def test_somebody_runs_after_walking_and_walks_after_running(sample_person):
    curve = Curve.through(np.array([[0.0, 0.0], [0.0, 36.0]]))
    stations = (Station(distance=10.0, status="run", velocity=3.0), Station(distance=25.0, status="walk", velocity=1.3))
    walk = walk_along(sample_person, curve, Behavior(velocity=1.3), stations)
    kinds = [m for i, m in enumerate(walk.journey.motions) if i == 0 or m != walk.journey.motions[i - 1]]
    assert kinds == ["stand", "stand-walk", "walk", "walk-run", "run", "run-walk", "walk", "walk-stand", "stand"]
    speeds = np.linalg.norm(walk.journey.velocities, axis=-1)
    assert speeds[(walk.distances > 16) & (walk.distances < 22)].mean() == pytest.approx(3.0, abs=0.15)
    assert speeds[(walk.distances > 28) & (walk.distances < 33)].mean() == pytest.approx(1.3, abs=0.1)


def test_a_scene_is_walked_clear_of_what_stands_in_it(sample_person):
    tree = Circle(name="tree", center=np.array([0.1, 5.0]), radius=0.5)
    scene = Scene(start=np.zeros(2), goals=np.array([[0.0, 10.0]]), obstacles=(tree,))
    shares: list[float] = []
    walk = walk_scene(sample_person, scene, finding=shares.append)
    assert walk.arrived
    assert np.linalg.norm(walk.journey.positions - tree.center, axis=-1).min() > tree.radius + 0.25
    assert shares[-1] == 1.0


def test_recorded_ways_are_walked(sample_person, mocap):
    """Where people really went, a person who learned from others can go."""
    found = 0
    for name in ("16_11", "16_17", "16_27", "16_29", "35_01", "07_04", "16_37"):
        path = next(p for p in mocap.rglob(f"{name}.*") if p.suffix in (".amc", ".bvh"))
        try:
            take = analyse(load_motion(path))
        except TakeError:
            continue
        curve = Curve.through(take.vehicle.positions, rounding=0.02)
        speed = float(np.median(take.vehicle.speeds))
        status = "run" if speed > 2.0 else "walk"
        walk = walk_along(sample_person, curve, Behavior(velocity=speed, status=status))
        assert walk.arrived, name
        assert walk.errors.mean() < 0.03, name
        assert walk.errors.max() < 0.10, name
        found += 1
    assert found >= 6


def test_progress_reaches_the_end(sample_person):
    told: list[tuple[int, int]] = []
    walk_along(sample_person, ways()["line"], progress=lambda done, total: told.append((done, total)))
    assert told[-1][0] == told[-1][1]
    assert all(a <= b for a, b in told)


def test_style_is_that_of_behavior_and_stations(sample_person, caplog):
    """Somebody sets off gloomily, is cheered up at a station, and can be told otherwise as a whole."""
    way = Curve.through(named_curve("line:9"))
    sad, better = Behavior(style=-1.0), (Station(distance=5.0, style=0.0),)
    walks = {
        "neutral": walk_along(sample_person, way),
        "changing": walk_along(sample_person, way, sad, better),
        "told": walk_along(sample_person, way, sad, better, style="neutral"),
    }
    bent = {}
    for name, walk in walks.items():
        motion, headings = walk.journey.motion, walk.journey.headings
        bends = stoop(motion.skeleton, motion.rotations[:, None], headings[:, None])
        assert walk.arrived
        bent[name] = [
            bends[(walk.distances > low) & (walk.distances < high)].mean() for low, high in ((1, 4.5), (6.5, 8))
        ]
    assert bent["changing"][0] > bent["neutral"][0] + 0.2
    assert bent["changing"][1] < bent["neutral"][1] + 0.05
    np.testing.assert_array_equal(walks["told"].journey.motion.rotations, walks["neutral"].journey.motion.rotations)
    assert not caplog.records
