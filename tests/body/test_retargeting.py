from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bodies import humanoid, writhing
from characters import posed_at_rest
from stridecast.analysis.contacts import find_contacts
from stridecast.body import kinematics
from stridecast.body.retargeting import retarget, same_skeleton
from stridecast.errors import SkeletonError
from stridecast.formats.recordings import load_motion, load_skeleton
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import ARMS, LEGS, Skeleton
from synthetic_gait import gait

SEEDS = st.integers(0, 2**32 - 1)
BONES = [
    (f"{side}_{inner}", f"{side}_{outer}")
    for side in ("left", "right")
    for limb in (LEGS, ARMS)
    for inner, outer in pairwise(limb)
]


def walking(frames: int = 40, seed: int = 0, skeleton: Skeleton | None = None) -> Motion:
    """A walk in which head, spine and hands do something too."""
    motion = gait(np.full(frames, 1.2), curvature=0.3, facing=float(seed % 6), skeleton=skeleton).motion
    wild, rotations = writhing(motion.skeleton, frames=frames, seed=seed).rotations, motion.rotations.copy()
    for role in ("chest", "neck", "head", "left_forearm", "right_hand"):
        rotations[:, motion.skeleton.joint(role)] = wild[:, motion.skeleton.joint(role)]
    return replace(motion, rotations=rotations)


ARMS_DOWN = posed_at_rest(humanoid(), {"left_upper_arm": (0.0, 0.0, -1.4), "right_upper_arm": (0.0, 0.0, 1.4)})
LEGS_SPLAYED = posed_at_rest(humanoid(), {"left_thigh": (0.0, 0.0, 0.3), "right_thigh": (0.1, 0.0, -0.25)})


def directions(motion: Motion) -> np.ndarray:
    at = kinematics.pose(motion).positions
    bones = np.stack([at[:, motion.skeleton.joint(b)] - at[:, motion.skeleton.joint(a)] for a, b in BONES], axis=1)
    return bones / np.linalg.norm(bones, axis=-1, keepdims=True)


def toes(motion: Motion) -> np.ndarray:
    return kinematics.pose(motion).positions[:, motion.skeleton.chain("left_toe", "right_toe")]


@given(SEEDS)
def test_same_skeleton_gives_the_same_motion(seed):
    motion = writhing(frames=4, seed=seed)
    out = retarget(motion, humanoid())
    np.testing.assert_array_equal(out.rotations, motion.rotations)
    np.testing.assert_array_equal(out.root_positions, motion.root_positions)


def test_skeletons_are_the_same_by_names_tree_and_offsets():
    body = humanoid()
    assert same_skeleton(body, replace(body))
    assert not same_skeleton(body, humanoid(1.01))
    assert not same_skeleton(body, replace(body, names=tuple(name.upper() for name in body.names)))


@given(SEEDS, st.one_of(st.floats(0.6, 0.99), st.floats(1.01, 1.5)))
@settings(max_examples=15)
def test_scaled_body_makes_the_scaled_motion(seed, scale):
    motion = walking(frames=12, seed=seed)
    out = retarget(motion, humanoid(scale))
    there, here = kinematics.pose(out), kinematics.pose(motion)
    np.testing.assert_allclose(there.positions, scale * here.positions, atol=1e-6)
    turned = quat.multiply(quat.inverse(here.rotations), there.rotations)
    np.testing.assert_allclose(quat.log(turned), 0.0, atol=1e-5)


@pytest.mark.parametrize("rest", [ARMS_DOWN, LEGS_SPLAYED], ids=["arms down", "legs splayed"])
@pytest.mark.parametrize("back", [False, True], ids=["there", "back"])
def test_other_rest_pose_points_its_bones_the_same_way(rest, back):
    source, target = (rest, humanoid()) if back else (humanoid(), rest)
    motion = walking(seed=1)
    if back:
        motion = retarget(motion, rest)
    out = retarget(motion, target)
    np.testing.assert_allclose(directions(out), directions(motion), atol=1e-6)
    np.testing.assert_allclose(toes(out), toes(motion), atol=1e-6)
    assert out.skeleton is target
    assert not same_skeleton(source, target)


def test_there_and_back_is_the_same_motion():
    motion = walking(seed=2)
    back = retarget(retarget(motion, ARMS_DOWN), motion.skeleton)
    np.testing.assert_allclose(kinematics.pose(back).positions, kinematics.pose(motion).positions, atol=1e-6)


def other_build(names: bool = True) -> Skeleton:
    """Long thighs, short shins, wide hips, a root above the hips, other joint names."""
    body = humanoid()
    offsets = body.offsets.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        thigh, shin, foot = body.chain(f"{side}_thigh", f"{side}_shin", f"{side}_foot")
        offsets[thigh] = [sign * 0.12, -0.10, 0.02]
        offsets[shin] *= 1.15
        offsets[foot] *= 0.9
    return replace(body, offsets=offsets, names=tuple(f"Bip01 {name}" for name in body.names) if names else body.names)


def test_toes_stand_where_the_scaled_recording_had_them():
    motion, body = walking(seed=3), other_build()
    scale = body.leg_length / motion.skeleton.leg_length
    missed = np.linalg.norm(toes(retarget(motion, body)) - scale * toes(motion), axis=-1)
    assert np.median(missed) < 1e-9
    assert missed.max() < 0.005


def test_middle_of_the_hips_is_the_scaled_one_wherever_the_root_is():
    motion, body = walking(seed=4), other_build()
    scale = body.leg_length / motion.skeleton.leg_length
    middles = [
        kinematics.pose(m).positions[:, m.skeleton.chain("left_thigh", "right_thigh")].mean(axis=1)
        for m in (motion, retarget(motion, body))
    ]
    np.testing.assert_allclose(middles[1], scale * middles[0], atol=1e-9)


def test_joints_without_a_role_keep_still_in_their_parents_frames():
    motion = writhing(frames=6, seed=5)
    thumb = motion.skeleton.names.index("LeftHandThumb")
    assert np.abs(quat.log(motion.rotations[:, thumb])).max() > 0.1
    out = retarget(motion, other_build())
    np.testing.assert_allclose(quat.log(out.rotations[:, thumb]), 0.0, atol=1e-9)


def test_result_is_a_proper_motion():
    motion = replace(walking(seed=6), name="take", subject="07", source="07_01.bvh")
    out = retarget(motion, other_build())
    assert (out.name, out.subject, out.source) == ("take", "07", "07_01.bvh")
    assert out.frame_rate == motion.frame_rate
    np.testing.assert_allclose(np.linalg.norm(out.rotations, axis=-1), 1.0, atol=1e-12)
    assert (np.sum(out.rotations[1:] * out.rotations[:-1], axis=-1) > 0).all()


@pytest.mark.parametrize("lacking", ["source", "target"])
def test_missing_leg_is_named(lacking):
    body = humanoid()
    legless = replace(body, roles={role: joint for role, joint in body.roles.items() if role != "right_shin"})
    motion = writhing(legless if lacking == "source" else body, frames=3)
    with pytest.raises(SkeletonError, match="right_shin"):
        retarget(motion, body if lacking == "source" else legless)


@pytest.mark.parametrize("take", ["07_01", "07_07"])
def test_recorded_walk_keeps_its_planted_toes_on_another_persons_body(mocap, take):
    motion = load_motion(mocap / "cmu" / "07" / f"{take}.bvh")
    body = load_skeleton(mocap / "cmu" / "16" / "16.asf")
    out = retarget(motion, body)
    scale = body.leg_length / motion.skeleton.leg_length
    planted = find_contacts(motion).planted
    before, after = (ground.project(toes(m)) for m in (motion, out))
    assert np.linalg.norm(after - scale * before, axis=-1)[planted].max() < 0.004
    for foot in (0, 1):
        both = planted[1:, foot] & planted[:-1, foot]
        travel = [np.linalg.norm(np.diff(t[:, foot], axis=0), axis=-1)[both].sum() for t in (scale * before, after)]
        contacts = 1 + int((np.diff(planted[:, foot].astype(int)) == 1).sum())
        assert travel[1] - travel[0] < 0.004 * contacts
