from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import writhing
from stridecast.analysis.details import add_details, extract_details
from stridecast.analysis.take import analyse
from stridecast.formats.recordings import load_motion
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from synthetic_gait import gait

SEEDS = st.integers(0, 2**32 - 1)
TAKES = ["16_15", "16_27", "16_31", "16_08", "127_04", "09_12"]


def vehicle(frames: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Any path with any headings, several turns round too."""
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(0.0, 0.05, (frames, 2)), axis=0), np.cumsum(rng.normal(0.0, 0.3, frames)) + rng.uniform(
        -9, 9
    )


def same_rotations(a: np.ndarray, b: np.ndarray, atol: float = 1e-6) -> None:
    np.testing.assert_allclose(quat.log(quat.multiply(quat.inverse(a), b)), 0.0, atol=atol)


@given(SEEDS)
def test_vehicle_and_details_give_the_pelvis_back(seed):
    motion = writhing(frames=40, seed=seed)
    path = vehicle(40, seed)
    details = extract_details(motion.root_positions, motion.rotations[:, 0], *path)
    places, rotations = add_details(*path, details)
    np.testing.assert_allclose(places, motion.root_positions, atol=1e-9)
    same_rotations(rotations, motion.rotations[:, 0])


@given(SEEDS)
def test_offsets_hold_no_turn_about_the_vertical(seed):
    motion = writhing(frames=20, seed=seed)
    details = extract_details(motion.root_positions, motion.rotations[:, 0], *vehicle(20, seed))
    upright = np.abs(details.offsets[:, 0]) > 0.05  # upside down the vertical part has no meaning
    np.testing.assert_allclose(quat.twist_about_y(details.offsets[upright]), 0.0, atol=1e-9)


@given(SEEDS, st.floats(-9.0, 9.0), st.floats(-50.0, 50.0))
def test_details_do_not_depend_on_where_and_which_way(seed, angle, shift):
    motion = writhing(frames=20, seed=seed)
    places, headings = vehicle(20, seed)
    here = extract_details(motion.root_positions, motion.rotations[:, 0], places, headings)
    turn, move = quat.about_y(angle), np.array([shift, 0.0, -shift])
    there = extract_details(
        quat.rotate(turn, motion.root_positions) + move,
        quat.multiply(turn, motion.rotations[:, 0]),
        ground.turn(places, np.array(angle)) + move[[0, 2]],
        headings + angle,
    )
    np.testing.assert_allclose(there.displacements, here.displacements, atol=1e-9)
    np.testing.assert_allclose(ground.wrap(there.yaws - here.yaws), 0.0, atol=1e-6)
    same_rotations(there.offsets, here.offsets)


@given(SEEDS)
def test_displacements_are_left_up_and_forward(seed):
    rng = np.random.default_rng(seed)
    heading, place = rng.uniform(-np.pi, np.pi), rng.normal(size=2)
    left, up, forward = rng.normal(size=3)
    ahead = ground.direction(np.array([heading]))
    pelvis = ground.lift(place[None] + left * ground.left_of(ahead) + forward * ahead, up)
    details = extract_details(pelvis, quat.IDENTITY[None], place[None], np.array([heading]))
    np.testing.assert_allclose(details.displacements[0], [left, up, forward], atol=1e-12)
    np.testing.assert_allclose(ground.wrap(details.yaws + heading), 0.0, atol=1e-9)


def test_yaws_never_jump():
    motion = gait(np.full(600, 1.4), curvature=0.5).motion  # more than once round
    assert np.abs(np.diff(analyse(motion).details.yaws)).max() < 0.1


def test_sway_of_a_formula_is_found_in_the_details():
    walk = gait(np.full(240, 1.3), sway=0.025, surge=0.0)
    sway = analyse(walk.motion).details.displacements[:, 0]
    np.testing.assert_allclose(sway, 0.025 * np.cos(walk.phase), atol=0.004)


@pytest.mark.parametrize("take", TAKES)
def test_recorded_pelvis_comes_back(mocap, take):
    analysis = analyse(load_motion(mocap / "cmu" / take.split("_")[0] / f"{take}.amc"))
    found = analysis.vehicle
    places, rotations = add_details(found.positions, found.headings, analysis.details)
    np.testing.assert_allclose(places, analysis.motion.root_positions, atol=1e-6)
    same_rotations(rotations, analysis.motion.rotations[:, 0])


@pytest.mark.parametrize("take", TAKES[:-1])
def test_recorded_pelvis_stays_near_its_vehicle(mocap, take):
    analysis = analyse(load_motion(mocap / "cmu" / take.split("_")[0] / f"{take}.amc"))
    away = analysis.details.displacements[:, [0, 2]]
    assert np.linalg.norm(away, axis=-1).mean() < 0.05
    assert np.abs(away).max() < 0.15
