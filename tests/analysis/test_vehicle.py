from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stridecast.analysis.take import TakeAnalysis, analyse
from stridecast.analysis.vehicle import fit_vehicle
from stridecast.errors import TakeError
from stridecast.formats.recordings import load_motion
from stridecast.geometry import ground
from stridecast.model.contacts import LEFT, RIGHT
from stridecast.model.segment import MidStance
from stridecast.model.vehicle import VehicleTrajectory
from synthetic_gait import Gait, gait, ramps

RATE = 60.0
WALKING, RUNNING = st.floats(0.8, 1.8), st.floats(2.5, 4.0)
CURVATURES, PHASES = st.floats(-0.5, 0.5), st.floats(0.0, 2 * np.pi)
FACING = st.floats(-np.pi, np.pi)
TAKES = ["16_15", "16_27", "16_31", "16_08", "16_55", "127_04"]


def pelvis_of(analysis: TakeAnalysis) -> np.ndarray:
    return ground.project(analysis.motion.root_positions)


def off_the_path(found: VehicleTrajectory, truth: Gait) -> np.ndarray:
    """Distance to the side of the true vehicle, frame by frame."""
    left = ground.left_of(ground.direction(truth.headings))
    return np.abs(np.sum((found.positions - truth.positions) * left, axis=-1))


def at(series: np.ndarray, frame: float) -> np.ndarray:
    return np.array([np.interp(frame, np.arange(len(series)), column) for column in series.T])


# the true vehicle is found


@given(WALKING, CURVATURES, PHASES, FACING, st.integers(0, 240))
@settings(max_examples=12)
def test_vehicle_of_a_walker_is_found_wherever_the_take_is_cut(speed, curvature, phase, facing, cut):
    walk = gait(np.full(360, speed), curvature=curvature, phase=phase, facing=facing).clip(cut, cut + 120)
    found = analyse(walk.motion).vehicle
    assert off_the_path(found, walk).mean() < 0.010
    assert np.abs(found.speeds / speed - 1).mean() < 0.03
    assert np.abs(ground.wrap(found.headings - walk.headings)).max() < 0.06


@given(RUNNING, CURVATURES, PHASES, FACING, st.integers(0, 240))
@settings(max_examples=12)
def test_vehicle_of_a_runner_is_found_wherever_the_take_is_cut(speed, curvature, phase, facing, cut):
    run = gait(np.full(360, speed), curvature=curvature, phase=phase, facing=facing).clip(cut, cut + 120)
    found = analyse(run.motion).vehicle
    assert off_the_path(found, run).mean() < 0.010
    assert np.abs(found.speeds / speed - 1).mean() < 0.03
    assert np.abs(ground.wrap(found.headings - run.headings)).max() < 0.06


@given(st.floats(0.0, 0.035), st.floats(-0.02, 0.02))
@settings(max_examples=6)
def test_sway_and_surge_of_the_pelvis_do_not_reach_the_vehicle(sway, surge):
    walk = gait(np.full(240, 1.3), sway=sway, surge=surge)
    found = analyse(walk.motion).vehicle
    assert off_the_path(found, walk).max() < 0.010
    assert np.abs(found.speeds - 1.3).max() < 0.05
    assert np.abs(found.lateral).max() < 0.3


def test_starting_and_stopping_are_as_quick_as_they_were():
    take = gait(ramps((1.0, 0.0), (2.5, 1.3), (1.0, 0.0), change=1.0))
    found = analyse(take.motion).vehicle
    assert off_the_path(found, take).max() < 0.010
    assert np.abs(found.speeds - take.speeds).max() < 0.15
    assert found.speeds[take.speeds < 1e-6].max() < 0.08
    truth = np.gradient(take.speeds, 1 / RATE)
    assert found.tangential.max() == pytest.approx(truth.max(), rel=0.3)
    assert found.tangential.min() == pytest.approx(truth.min(), rel=0.3)


# what KS07 asks of it


def check_both_feet(analysis: TakeAnalysis) -> None:
    """L- and R-trajectory run through the pelvis at the mid-stances of their foot; the vehicle is their mean."""
    found, pelvis = analysis.vehicle, pelvis_of(analysis)
    np.testing.assert_allclose(found.positions, (found.left + found.right) / 2, atol=1e-9)
    assert analysis.gait.mid_stances
    for m in analysis.gait.mid_stances:
        curve = found.left if m.side == LEFT else found.right
        np.testing.assert_allclose(at(curve, m.frame), at(pelvis, m.frame), atol=1e-6)


def check_smooth(found: VehicleTrajectory, rate: float) -> None:
    """Each derivative is that of the one before (C2), compared with central differences."""
    for series, derivative in (
        (found.positions, found.velocities),
        (found.velocities, found.accelerations),
        (found.accelerations, found.jerks),
    ):
        slope = (series[2:] - series[:-2]) * rate / 2
        curved = np.abs(np.diff(series, 3, axis=0)).max() * rate
        np.testing.assert_allclose(slope, derivative[1:-1], atol=1e-6 + 0.5 * curved)


@given(st.one_of(WALKING, RUNNING), CURVATURES, PHASES)
@settings(max_examples=6)
def test_both_curves_run_through_the_pelvis_and_the_vehicle_is_their_mean(speed, curvature, phase):
    check_both_feet(analyse(gait(np.full(150, speed), curvature=curvature, phase=phase).motion))


@pytest.mark.parametrize("take", TAKES)
def test_both_curves_of_recordings_run_through_the_pelvis_and_the_vehicle_is_their_mean(mocap, take):
    check_both_feet(analyse(load_motion(mocap / "cmu" / take.split("_")[0] / f"{take}.amc")))


def test_derivatives_belong_together():
    check_smooth(analyse(gait(ramps((1.0, 0.0), (2.0, 1.3), (1.0, 0.0)), curvature=0.3).motion).vehicle, RATE)


@pytest.mark.parametrize("take", TAKES)
def test_derivatives_of_recordings_belong_together(mocap, take):
    motion = load_motion(mocap / "cmu" / take.split("_")[0] / f"{take}.amc")
    check_smooth(analyse(motion).vehicle, motion.frame_rate)


def test_curves_share_the_pelvis_at_the_ends_of_standing():
    analysis = analyse(gait(ramps((1.0, 0.0), (2.0, 1.3), (1.0, 0.0))).motion)
    pelvis, standing = pelvis_of(analysis), np.flatnonzero(analysis.contacts.standing)
    for frame in (standing[0], standing[-1]):
        np.testing.assert_allclose(analysis.vehicle.left[frame], pelvis[frame], atol=1e-6)
        np.testing.assert_allclose(analysis.vehicle.right[frame], pelvis[frame], atol=1e-6)


def test_parts_of_the_acceleration_are_those_along_and_to_the_left_of_the_heading():
    found = analyse(gait(np.full(150, 1.5), curvature=0.4).motion).vehicle
    ahead = ground.direction(found.headings)
    np.testing.assert_allclose(found.tangential, np.sum(found.accelerations * ahead, axis=-1), atol=1e-12)
    np.testing.assert_allclose(found.lateral, np.sum(found.accelerations * ground.left_of(ahead), axis=-1), atol=1e-12)
    assert found.lateral.mean() == pytest.approx(1.5**2 * 0.4, rel=0.05), "a turn to the left pulls to the left"


# headings


def test_heading_is_continuous_while_walking_round_a_circle_through_every_direction():
    found = analyse(gait(np.full(600, 1.4), curvature=1 / 2.0).motion).vehicle
    turned = 1.4 / 2.0 / RATE
    np.testing.assert_allclose(np.diff(found.headings), turned, atol=0.3 * turned)
    assert found.headings[-1] - found.headings[0] > 2 * np.pi


@given(st.floats(-0.01, 0.01))
@settings(max_examples=6)
def test_walking_straight_back_has_a_heading(off):
    """Equation 1 of the paper has no value for the direction (0, -1)."""
    found = analyse(gait(np.full(120, 1.3), facing=np.pi + off).motion).vehicle
    assert np.abs(ground.wrap(found.headings - np.pi)).max() < 0.05
    assert np.abs(np.diff(found.headings)).max() < 0.01


def test_heading_is_kept_while_standing():
    take = gait(ramps((1.0, 0.0), (2.0, 1.3), (1.5, 0.0)), facing=2.0, curvature=0.2)
    found = analyse(take.motion).vehicle
    still = np.flatnonzero(take.speeds < 1e-6)
    before, after = still[still < 120], still[still > 120]
    assert np.ptp(found.headings[before]) < 0.02
    assert np.ptp(found.headings[after]) < 0.02
    assert np.abs(ground.wrap(found.headings[before] - 2.0)).max() < 0.1


def test_standing_all_the_time_has_a_vehicle_at_rest():
    take = gait(np.zeros(90), facing=0.7)
    found = analyse(take.motion).vehicle
    assert found.speeds.max() < 0.02
    assert np.isfinite(found.headings).all()


# symmetries


@given(FACING, st.floats(-20.0, 20.0))
@settings(max_examples=6)
def test_turning_and_shifting_the_pelvis_turns_and_shifts_the_vehicle(angle, shift):
    walk = gait(np.full(150, 1.3), curvature=0.3)
    marks = analyse(walk.motion).gait.mid_stances
    pelvis, none = ground.project(walk.motion.root_positions), np.zeros(150, bool)
    here = fit_vehicle(pelvis, marks, none, RATE)
    move = np.array([shift, -shift])
    moved = ground.turn(pelvis, np.array(angle)) + move
    there = fit_vehicle(moved, marks, none, RATE)
    np.testing.assert_allclose(there.positions, ground.turn(here.positions, np.array(angle)) + move, atol=1e-6)
    np.testing.assert_allclose(there.jerks, ground.turn(here.jerks, np.array(angle)), atol=1e-3)
    np.testing.assert_allclose(ground.wrap(there.headings - here.headings - angle), 0.0, atol=1e-6)


def test_exchanging_the_feet_mirrors_the_vehicle():
    walk = gait(np.full(150, 1.3), curvature=0.3)
    marks = analyse(walk.motion).gait.mid_stances
    pelvis, none = ground.project(walk.motion.root_positions), np.zeros(150, bool)
    here = fit_vehicle(pelvis, marks, none, RATE)
    other = tuple(MidStance(m.frame, RIGHT if m.side == LEFT else LEFT) for m in marks)
    there = fit_vehicle(pelvis * [-1.0, 1.0], other, none, RATE)
    np.testing.assert_allclose(there.positions, here.positions * [-1.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(there.left, here.right * [-1.0, 1.0], atol=1e-6)


def test_everything_is_finite_and_read_only():
    found = analyse(gait(np.full(90, 1.1)).motion).vehicle
    for field in fields(found):
        array = getattr(found, field.name)
        assert np.isfinite(array).all()
        assert not array.flags.writeable


# refusals


def test_too_short_a_take_is_refused_with_its_length():
    walk = gait(np.full(12, 1.3))
    with pytest.raises(TakeError, match=r"0\.20 s"):
        fit_vehicle(ground.project(walk.motion.root_positions), (), np.zeros(12, bool), RATE)


def test_a_take_without_two_steps_is_refused():
    walk = gait(np.full(60, 1.3))
    with pytest.raises(TakeError, match="step"):
        fit_vehicle(ground.project(walk.motion.root_positions), (MidStance(30.0, LEFT),), np.zeros(60, bool), RATE)
