from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import humanoid, standing, writhing
from characters import with_twist_bones
from stridecast.body import kinematics
from stridecast.body.legs import STRAIGHTEST, reach
from stridecast.geometry import quaternions as quat
from stridecast.model.skeleton import Skeleton

SEEDS = st.integers(0, 2**32 - 1)
SIDES = st.sampled_from(("left", "right"))


def bending(frames: int = 8, seed: int = 0):
    """The humanoid in poses that a leg can have: knees bent forward, everything else anyhow."""
    motion = writhing(frames=frames, seed=seed)
    rng = np.random.default_rng(seed + 1)
    rotations = motion.rotations.copy()
    for side in ("left", "right"):
        knee = rng.uniform(0.1, 2.0, frames)
        rotations[:, motion.skeleton.joint(f"{side}_shin")] = quat.exp(np.stack((knee, 0 * knee, 0 * knee), axis=-1))
    return replace(motion, rotations=rotations)


def leg_of(skeleton: Skeleton, side: str) -> list[int]:
    return skeleton.chain(*(f"{side}_{part}" for part in ("thigh", "shin", "foot", "toe")))


def goals(motion, side: str, seed: int, share=(0.55, 0.99)) -> np.ndarray:
    """Places within reach: a part of the leg's length from the hip, roughly down."""
    rng = np.random.default_rng(seed)
    hip = kinematics.pose(motion).positions[:, motion.skeleton.joint(f"{side}_thigh")]
    way = rng.normal(0.0, 0.5, hip.shape) + np.array([0.0, -1.0, 0.0])
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    return hip + way * motion.skeleton.leg_length * rng.uniform(*share, (len(hip), 1))


def reached(motion, side: str, ankles: np.ndarray) -> kinematics.World:
    rotations = reach(motion.skeleton, motion.root_positions, motion.rotations, side, ankles)
    return kinematics.forward(motion.skeleton, motion.root_positions, rotations)


@given(SEEDS, SIDES)
def test_ankle_arrives(seed, side):
    motion = bending(seed=seed)
    ankles = goals(motion, side, seed)
    found = reached(motion, side, ankles).positions[:, motion.skeleton.joint(f"{side}_foot")]
    np.testing.assert_allclose(found, ankles, atol=1e-9)


@given(SEEDS, SIDES)
def test_foot_keeps_its_rotation_in_the_world(seed, side):
    motion = bending(seed=seed)
    foot, toe = motion.skeleton.chain(f"{side}_foot", f"{side}_toe")
    before, after = kinematics.pose(motion), reached(motion, side, goals(motion, side, seed))
    for joint in (foot, toe):
        turned = quat.multiply(quat.inverse(before.rotations[:, joint]), after.rotations[:, joint])
        np.testing.assert_allclose(quat.log(turned), 0.0, atol=1e-7)


@given(SEEDS, SIDES)
def test_only_the_leg_moves_and_its_bones_keep_their_lengths(seed, side):
    motion = bending(seed=seed)
    skeleton, leg = motion.skeleton, leg_of(motion.skeleton, side)
    rotations = reach(skeleton, motion.root_positions, motion.rotations, side, goals(motion, side, seed))
    others = np.setdiff1d(np.arange(skeleton.joints), leg[:3])
    np.testing.assert_array_equal(rotations[:, others], motion.rotations[:, others])
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=-1), 1.0, atol=1e-9)
    at = kinematics.forward(skeleton, motion.root_positions, rotations).positions
    for joint in leg[1:]:
        bones = np.linalg.norm(at[:, joint] - at[:, skeleton.parents[joint]], axis=-1)
        np.testing.assert_allclose(bones, np.linalg.norm(skeleton.offsets[joint]), atol=1e-12)


@given(SEEDS, SIDES)
def test_knee_stays_a_hinge_that_bends_forward(seed, side):
    motion = bending(seed=seed)
    skeleton, shin = motion.skeleton, motion.skeleton.joint(f"{side}_shin")
    rotations = reach(skeleton, motion.root_positions, motion.rotations, side, goals(motion, side, seed))
    bend = quat.log(rotations[:, shin])
    np.testing.assert_allclose(bend[:, 1:], 0.0, atol=1e-7)
    assert (bend[:, 0] > 0).all()


@given(SEEDS, SIDES)
def test_reaching_for_where_the_ankle_is_changes_nothing(seed, side):
    motion = bending(seed=seed)
    there = kinematics.pose(motion).positions[:, motion.skeleton.joint(f"{side}_foot")]
    rotations = reach(motion.skeleton, motion.root_positions, motion.rotations, side, there)
    np.testing.assert_allclose(quat.log(quat.multiply(quat.inverse(motion.rotations), rotations)), 0.0, atol=1e-7)


@given(SEEDS, SIDES, st.floats(1.0, 3.0))
def test_leg_too_short_points_at_its_goal_as_far_as_it_goes(seed, side, far):
    motion = bending(seed=seed)
    ankles = goals(motion, side, seed, share=(far, far))
    at = reached(motion, side, ankles).positions
    hip, _, ankle, _ = (at[:, joint] for joint in leg_of(motion.skeleton, side))
    length = np.linalg.norm(ankle - hip, axis=-1)
    most = np.linalg.norm(motion.skeleton.offsets[leg_of(motion.skeleton, side)[1:3]], axis=-1).sum()
    np.testing.assert_allclose(length, STRAIGHTEST * most, rtol=1e-6)
    cosine = np.sum((ankle - hip) * (ankles - hip), axis=-1) / length / np.linalg.norm(ankles - hip, axis=-1)
    np.testing.assert_allclose(cosine, 1.0, atol=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
def test_straight_leg_bends_its_knee_forward(side):
    """The rest pose has no plane of its own to bend in."""
    body = humanoid()
    offsets = body.offsets.copy()
    offsets[[body.joint("left_foot"), body.joint("right_foot")], 2] = 0.0
    motion = standing(replace(body, offsets=offsets), frames=2)
    hip, knee, ankle, _ = leg_of(motion.skeleton, side)
    goal = kinematics.pose(motion).positions[:, ankle] + [0.0, 0.1, 0.0]
    at = reached(motion, side, goal).positions
    np.testing.assert_allclose(at[:, ankle], goal, atol=1e-9)
    assert (at[:, knee, 2] > at[:, hip, 2] + 0.1).all()


@given(SEEDS, SIDES, st.floats(-0.15, 0.02))
def test_knee_that_goes_backwards_bends_forward(seed, side, knee):
    """However it got there: mixing poses may do that."""
    motion = bending(seed=seed)
    skeleton, shin = motion.skeleton, motion.skeleton.joint(f"{side}_shin")
    rotations = motion.rotations.copy()
    rotations[:, shin] = quat.exp(np.array([knee, 0.0, 0.0]))
    motion = replace(motion, rotations=rotations)
    ankles = goals(motion, side, seed)
    rotations = reach(skeleton, motion.root_positions, rotations, side, ankles)
    found = kinematics.forward(skeleton, motion.root_positions, rotations).positions[:, skeleton.joint(f"{side}_foot")]
    np.testing.assert_allclose(found, ankles, atol=1e-9)
    bend = quat.log(rotations[:, shin])
    assert (bend[:, 0] > 0).all()
    np.testing.assert_allclose(bend[:, 1:], 0.0, atol=1e-7)


@pytest.mark.parametrize("side", ["left", "right"])
def test_leg_folds_no_further_than_its_bones_allow(side):
    motion = bending(seed=3)
    hip = kinematics.pose(motion).positions[:, motion.skeleton.joint(f"{side}_thigh")]
    at = reached(motion, side, hip + 1e-4).positions
    assert np.isfinite(at).all()
    folded = np.linalg.norm(at[:, motion.skeleton.joint(f"{side}_foot")] - hip, axis=-1)
    np.testing.assert_allclose(folded, 0.01, atol=2e-3)  # thigh 0.43, shin 0.42 and 0.01 back


# bones between the joints that have roles


@given(SEEDS, SIDES)
def test_twist_bones_ride_along_without_turning(seed, side):
    plain, twisted = bending(seed=seed), with_twist_bones()
    rotations = np.tile(quat.IDENTITY, (plain.frames, twisted.joints, 1))
    for joint, name in enumerate(plain.skeleton.names):
        rotations[:, twisted.names.index(name)] = plain.rotations[:, joint]
    motion = replace(plain, skeleton=twisted, rotations=rotations)
    ankles = goals(motion, side, seed)
    after = reach(twisted, motion.root_positions, motion.rotations, side, ankles)
    at = kinematics.forward(twisted, motion.root_positions, after)
    np.testing.assert_allclose(at.positions[:, twisted.joint(f"{side}_foot")], ankles, atol=1e-9)
    between = [j for j, name in enumerate(twisted.names) if name.endswith("Twist")]
    np.testing.assert_array_equal(after[:, between], motion.rotations[:, between])
    same = reached(plain, side, ankles)
    for joint, name in enumerate(plain.skeleton.names):
        np.testing.assert_allclose(at.positions[:, twisted.names.index(name)], same.positions[:, joint], atol=1e-9)
