from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bodies import humanoid, standing
from stridecast.analysis.contacts import find_contacts
from stridecast.analysis.cycles import find_cycle, joint_weights, posture_distance
from stridecast.analysis.take import analyse
from stridecast.model.contacts import RIGHT
from synthetic_gait import gait, ramps


def postures(seed: int) -> np.ndarray:
    vectors = np.random.default_rng(seed).standard_normal((humanoid().joints, 3))
    return Rotation.from_rotvec(vectors).as_quat(scalar_first=True)


@given(st.integers(0, 1000), st.integers(0, 1000))
def test_distance_of_postures_is_the_sum_of_squared_angles(a, b):
    one, other, weights = postures(a), postures(b), joint_weights(humanoid())
    angles = [
        (Rotation.from_quat(p, scalar_first=True).inv() * Rotation.from_quat(q, scalar_first=True)).magnitude()
        for p, q in zip(one, other, strict=True)
    ]
    assert posture_distance(one, other, weights) == pytest.approx(weights @ np.square(angles), abs=1e-9)
    assert posture_distance(one, -one, weights) == pytest.approx(0.0, abs=1e-6)


def test_weights_sum_to_one_and_leave_the_way_one_faces_out():
    weights = joint_weights(humanoid())
    assert weights.sum() == pytest.approx(1.0)
    assert weights[0] == 0.0
    assert weights[humanoid().joint("left_thigh")] > 5 * weights[humanoid().joint("left_toe")]


@pytest.mark.parametrize(("speed", "curvature"), [(0.9, 0.0), (1.4, 0.0), (1.3, 0.5), (3.0, 0.0)])
def test_cycle_is_as_long_as_a_stride(speed, curvature):
    take = analyse(gait(ramps((5.0, speed)), curvature=curvature).motion)
    cycle = find_cycle(take.motion, take.contacts)
    same = [m.frame for m in take.gait.mid_stances if m.side == RIGHT]
    stride = float(np.median(np.diff(same))) / take.motion.frame_rate
    assert cycle is not None
    assert cycle.seconds == pytest.approx(stride, rel=0.03)
    assert 1 <= cycle.number <= 5.0 / stride


def test_a_cycle_begins_where_the_right_foot_leaves():
    take = analyse(gait(ramps((4.0, 1.3))).motion)
    cycle = find_cycle(take.motion, take.contacts)
    frame = round(cycle.start * take.motion.frame_rate)
    right = take.contacts.planted[:, RIGHT]
    assert right[frame - 1]
    assert not right[frame]


def test_who_stands_repeats_nothing():
    motion = standing(frames=90)
    assert find_cycle(motion, find_contacts(motion)) is None
