"""Measures of bodies on motions with known faults."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from bodies import standing, writhing
from stridecast.body import kinematics
from stridecast.errors import TakeError
from stridecast.formats.recordings import load_motion
from stridecast.geometry import quaternions as quat
from stridecast.scorecard.motion import (
    angular_accelerations,
    foot_skate,
    knee_bends,
    score_motion,
    seam_accelerations,
    toe_travel,
)


def sliding(speed: float, frames: int = 90, rate: float = 30.0):
    """A stiff person who slides forwards."""
    motion = standing(frames=frames, frame_rate=rate)
    way = np.zeros((frames, 3))
    way[:, 2] = speed * np.arange(frames) / rate
    return replace(motion, root_positions=motion.root_positions + way)


def planted(frames: int, *spans: tuple[int, int]) -> np.ndarray:
    out = np.zeros((frames, 2), bool)
    for side, (start, stop) in enumerate(spans):
        out[start:stop, side] = True
    return out


def test_a_slide_is_as_long_as_its_middle():
    contacts = planted(90, (10, 30), (40, 70))
    each = toe_travel(sliding(0.3), contacts)
    assert [way for way, _ in each] == pytest.approx([0.3 * 11 / 30 * 1000, 0.3 * 17 / 30 * 1000])
    skate = foot_skate(sliding(0.3), contacts)
    assert skate.contacts == 2
    assert skate.speed == pytest.approx(30.0)
    assert skate.slipping == 0.0
    assert foot_skate(sliding(0.6), contacts).slipping == 1.0


def test_lifted_toes_weigh_less():
    motion = sliding(0.3)
    flat = kinematics.pose(motion).positions[0, motion.skeleton.joint("left_toe"), 1]
    sole = 0.022 * motion.skeleton.leg_length
    lifts = (0.0, 0.0125, 0.026)
    expected = (30.0, 30.0 * (2 - 2**0.5), np.nan)
    for lift, weighted in zip(lifts, expected, strict=True):
        at = replace(motion, root_positions=motion.root_positions + np.array([0.0, sole + lift - flat, 0.0]))
        skate = foot_skate(at, planted(90, (10, 30), (40, 70)))
        assert skate.weighted == pytest.approx(weighted, rel=1e-6, nan_ok=True)


def test_contacts_that_are_cut_or_short_do_not_count():
    assert not toe_travel(sliding(0.3), planted(90, (0, 30), (60, 90)))
    assert not toe_travel(sliding(0.3), planted(90, (10, 13), (10, 80)))


def test_a_knee_that_bends_backwards_shows():
    motion = standing(frames=60)
    rotations = motion.rotations.copy()
    turns = np.radians(np.concatenate((np.linspace(10, 60, 50), np.full(10, -8.0))))
    for side in ("left", "right"):
        shin = motion.skeleton.joint(f"{side}_shin")
        rotations[:, shin] = quat.exp(turns[:, None] * np.array([1.0, 0.0, 0.0]))
    bends = knee_bends(replace(motion, rotations=rotations))
    rest = np.degrees(np.arctan2(0.01, 0.42))  # the ankle lies a little behind the knee
    np.testing.assert_allclose(bends, np.broadcast_to(np.degrees(turns) + rest, (2, 60)), atol=1e-6)


def test_a_pop_shows_at_its_seam_only():
    motion = writhing(frames=120)
    smooth = seam_accelerations(motion, [60])
    rotations = motion.rotations.copy()
    arm = motion.skeleton.joint("left_upper_arm")
    rotations[60:, arm] = quat.multiply(quat.exp(np.array([0.0, 0.0, 0.5])), rotations[60:, arm])
    near, elsewhere = seam_accelerations(replace(motion, rotations=rotations), [60])
    assert near > 2 * smooth[0]
    assert elsewhere == pytest.approx(smooth[1], rel=0.2)
    assert angular_accelerations(standing(frames=30)).max() == 0


def test_recordings_are_scored(mocap):
    score = score_motion(load_motion(mocap / "cmu" / "16" / "16_35.amc"))
    assert score.foot_skate.contacts >= 2
    assert 0 < score.foot_skate.travel < 60
    assert score.knees[0] > -1
    assert score.knees[1] < 130
    assert abs(score.lowest) < 0.03
    json.dumps(score.as_json(), allow_nan=False)


def test_who_does_not_walk_is_refused():
    with pytest.raises(TakeError):
        score_motion(standing(frames=5))
