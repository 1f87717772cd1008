from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bodies import humanoid, standing, writhing
from stridecast.analysis.details import add_details
from stridecast.analysis.take import SOLE, TakeAnalysis, analyse
from stridecast.body import kinematics
from stridecast.errors import SkeletonError, TakeError
from stridecast.formats.recordings import load_motion
from stridecast.geometry import quaternions as quat
from synthetic_gait import gait, ramps


def toe_heights(analysis: TakeAnalysis) -> np.ndarray:
    skeleton = analysis.motion.skeleton
    toes = kinematics.pose(analysis.motion).positions[:, skeleton.chain("left_toe", "right_toe"), 1]
    return toes[analysis.contacts.planted]


@given(st.floats(0.8, 4.0), st.floats(-0.5, 0.5), st.floats(0.0, 6.0))
@settings(max_examples=8)
def test_vehicle_and_details_are_the_take(speed, curvature, phase):
    analysis = analyse(gait(np.full(150, speed), curvature=curvature, phase=phase).motion)
    places, rotations = add_details(analysis.vehicle.positions, analysis.vehicle.headings, analysis.details)
    np.testing.assert_allclose(places, analysis.motion.root_positions, atol=1e-6)
    apart = quat.multiply(quat.inverse(rotations), analysis.motion.rotations[:, 0])
    np.testing.assert_allclose(quat.log(apart), 0.0, atol=1e-6)


@given(st.floats(-0.07, 0.07))
@settings(max_examples=5)
def test_feet_are_put_on_the_floor_wherever_the_recording_had_it(height):
    motion = gait(np.full(120, 1.3)).motion
    lifted = replace(motion, root_positions=motion.root_positions + np.array([0.0, height, 0.0]))
    analysis = analyse(lifted)
    assert np.median(toe_heights(analysis)) == pytest.approx(SOLE * motion.skeleton.leg_length, abs=0.003)
    np.testing.assert_allclose(analysis.motion.root_positions, analyse(motion).motion.root_positions, atol=1e-9)


@given(st.floats(-np.pi, np.pi), st.floats(-30.0, 30.0))
@settings(max_examples=5)
def test_where_and_which_way_a_take_goes_does_not_matter(angle, shift):
    motion = gait(ramps((0.8, 0.0), (2.0, 1.3)), curvature=0.3).motion
    turn, rotations = quat.about_y(angle), motion.rotations.copy()
    rotations[:, 0] = quat.multiply(turn, rotations[:, 0])
    places = quat.rotate(turn, motion.root_positions) + np.array([shift, 0.0, -shift])
    here, there = analyse(motion), analyse(replace(motion, root_positions=places, rotations=rotations))
    assert [s.group for s in here.gait.segments] == [s.group for s in there.gait.segments]
    np.testing.assert_allclose(there.vehicle.speeds, here.vehicle.speeds, atol=1e-6)
    np.testing.assert_allclose(there.vehicle.tangential, here.vehicle.tangential, atol=1e-4)
    np.testing.assert_allclose(there.details.displacements, here.details.displacements, atol=1e-6)


def test_a_take_is_carried_over_to_the_body_asked_for():
    motion, body = gait(np.full(120, 1.3)).motion, humanoid(0.9)
    analysis = analyse(motion, body)
    assert analysis.motion.skeleton is body
    assert analysis.vehicle.speeds.mean() == pytest.approx(0.9 * 1.3, rel=0.02)


def test_steering_of_a_segment_is_that_of_its_frames():
    analysis = analyse(gait(np.full(150, 1.3), curvature=0.4).motion)
    for segment in analysis.gait.segments:
        steering = analysis.steering(segment)
        frames = slice(segment.start.frame, segment.stop.frame + 1)
        np.testing.assert_array_equal(steering.speeds, analysis.vehicle.speeds[frames])
        np.testing.assert_array_equal(steering.lateral, analysis.vehicle.lateral[frames])
        np.testing.assert_array_equal(steering.jerks, np.linalg.norm(analysis.vehicle.jerks[frames], axis=-1))


def test_standing_alone_can_be_learned_from():
    analysis = analyse(standing(frames=90, frame_rate=60.0))
    assert [s.group for s in analysis.gait.segments] == ["stand/S"]
    assert analysis.vehicle.speeds.max() < 1e-3


@given(st.integers(0, 2**32 - 1), st.integers(1, 90))
@settings(max_examples=15)
def test_any_motion_is_understood_or_left_out_with_the_reason(seed, frames):
    motion = writhing(frames=frames, seed=seed)
    try:
        analysis = analyse(motion)
    except TakeError as error:
        reason = str(error)
        assert re.search(r"\d s long|steps", reason)
    else:
        assert np.isfinite(analysis.vehicle.positions).all()


def test_body_without_legs_is_refused():
    body = humanoid()
    legless = replace(body, roles={role: joint for role, joint in body.roles.items() if "thigh" not in role})
    with pytest.raises(SkeletonError, match="thigh"):
        analyse(standing(legless))


@pytest.mark.parametrize("take", ["07_01.bvh", "02_01.bvh", "16_15.amc", "16_31.amc", "16_35.amc", "127_03.amc"])
def test_recorded_feet_stand_on_the_floor(mocap, take):
    """Toes come down to the sole's height once a step, when the foot rolls over them, and no lower."""
    analysis = analyse(load_motion(mocap / "cmu" / take.split("_")[0] / take))
    sole = SOLE * analysis.motion.skeleton.leg_length
    heights = toe_heights(analysis)
    assert np.percentile(heights, 4) == pytest.approx(sole, abs=0.008)
    assert heights.min() > sole - 0.015
