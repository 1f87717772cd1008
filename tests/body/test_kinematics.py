from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bodies import humanoid, standing, writhing
from stridecast.body import kinematics
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion

SEEDS = st.integers(0, 2**32 - 1)


def transforms(motion: Motion, frame: int) -> np.ndarray:
    """Joint-to-world matrices (joints, 4, 4) of one frame, written again with nothing but 4 by 4 products."""
    skeleton = motion.skeleton
    matrices = []
    for joint in range(skeleton.joints):
        own = np.eye(4)
        own[:3, :3] = Rotation.from_quat(motion.rotations[frame, joint], scalar_first=True).as_matrix()
        own[:3, 3] = skeleton.offsets[joint] if joint else motion.root_positions[frame]
        parent = skeleton.parents[joint]
        matrices.append(own if parent < 0 else matrices[parent] @ own)
    return np.stack(matrices)


@given(SEEDS)
def test_pose_agrees_with_matrices(seed):
    motion = writhing(frames=2, seed=seed)
    skeleton, world = motion.skeleton, kinematics.pose(motion)
    for frame in range(motion.frames):
        expected = transforms(motion, frame)
        np.testing.assert_allclose(world.positions[frame], expected[:, :3, 3], atol=1e-12)
        np.testing.assert_allclose(quat.to_matrix(world.rotations[frame]), expected[:, :3, :3], atol=1e-12)
        tips = np.einsum("nij,nj->ni", expected[skeleton.end_joints], np.c_[skeleton.end_offsets, np.ones(5)])
        np.testing.assert_allclose(kinematics.ends(skeleton, world)[frame], tips[:, :3], atol=1e-12)


@given(SEEDS)
def test_local_undoes_forward(seed):
    motion = writhing(frames=3, seed=seed)
    world = kinematics.pose(motion)
    back = kinematics.local(motion.skeleton, world.rotations)
    np.testing.assert_allclose(back, motion.rotations, atol=1e-12)
    again = kinematics.forward(motion.skeleton, motion.root_positions, back)
    np.testing.assert_allclose(again.positions, world.positions, atol=1e-12)


def test_local_leaves_its_input_alone():
    turned = kinematics.pose(writhing(frames=2)).rotations
    before = turned.copy()
    kinematics.local(humanoid(), turned)
    np.testing.assert_array_equal(turned, before)


@given(SEEDS)
def test_bones_keep_their_lengths(seed):
    motion = writhing(frames=4, seed=seed)
    skeleton, positions = motion.skeleton, kinematics.pose(motion).positions
    bones = np.linalg.norm(positions[:, 1:] - positions[:, skeleton.parents[1:]], axis=-1)
    np.testing.assert_allclose(bones, np.tile(np.linalg.norm(skeleton.offsets[1:], axis=-1), (4, 1)), atol=1e-12)


@given(SEEDS)
def test_turning_the_root_turns_the_body(seed):
    rng = np.random.default_rng(seed)
    motion = writhing(frames=2, seed=seed)
    turn, shift = quat.exp(rng.normal(size=3)), rng.normal(size=3)
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat.multiply(turn, rotations[:, 0])
    moved = kinematics.forward(motion.skeleton, quat.rotate(turn, motion.root_positions) + shift, rotations)
    before = kinematics.pose(motion)
    np.testing.assert_allclose(moved.positions, quat.rotate(turn, before.positions) + shift, atol=1e-12)


def test_rest_pose_adds_up_the_offsets(skeleton):
    rest = kinematics.rest(skeleton)
    still = kinematics.pose(standing(skeleton, frames=1))
    np.testing.assert_allclose(rest.positions + still.positions[0, 0], still.positions[0], atol=1e-12)
    foot = skeleton.chain("left_thigh", "left_shin", "left_foot")
    np.testing.assert_allclose(rest.positions[foot[-1]], skeleton.offsets[foot].sum(axis=0), atol=1e-12)


@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (0,)])
def test_any_leading_shape(skeleton, shape):
    rng = np.random.default_rng(1)
    places = rng.normal(size=(*shape, 3))
    rotations = quat.normalize(rng.normal(size=(*shape, skeleton.joints, 4)))
    world = kinematics.forward(skeleton, places, rotations)
    assert world.positions.shape == (*shape, skeleton.joints, 3)
    assert world.rotations.shape == (*shape, skeleton.joints, 4)
    assert kinematics.ends(skeleton, world).shape == (*shape, 5, 3)
    for place in np.ndindex(shape):
        one = kinematics.forward(skeleton, places[place], rotations[place])
        np.testing.assert_array_equal(world.positions[place], one.positions)
