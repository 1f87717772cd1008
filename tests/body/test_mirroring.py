from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import humanoid, standing, writhing
from stridecast.body import kinematics
from stridecast.body.mirroring import mirror, mirror_pairs
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

MIRROR = np.array([-1.0, 1.0, 1.0])
SEEDS = st.integers(0, 2**32 - 1)


def crooked(seed: int) -> Skeleton:
    """The humanoid with every bone a little off in direction and length, no two sides alike."""
    body = humanoid()
    noise = np.random.default_rng(seed).normal(0.0, 0.01, body.offsets.shape)
    noise[0] = 0.0
    return replace(body, offsets=body.offsets + noise)


def tree(*rows: tuple[str, str]) -> Skeleton:
    names = tuple(name for name, _ in rows)
    offsets = np.zeros((len(rows), 3))
    offsets[1:] = [0.0, 0.1, 0.0]
    return Skeleton(names=names, parents=np.array([names.index(p) if p else -1 for _, p in rows]), offsets=offsets)


def same_rotations(a: np.ndarray, b: np.ndarray, atol: float = 1e-12) -> None:
    np.testing.assert_allclose(quat.log(quat.multiply(quat.inverse(a), b)), 0.0, atol=atol)


@given(SEEDS)
def test_mirrored_places_are_the_partners_mirror_image(seed):
    motion = writhing(frames=5, seed=seed)
    skeleton, pairs = motion.skeleton, mirror_pairs(motion.skeleton)
    before, after = kinematics.pose(motion), kinematics.pose(mirror(motion))
    np.testing.assert_allclose(after.positions, before.positions[:, pairs] * MIRROR, atol=1e-12)
    ends = {
        tuple(place): k for k, place in enumerate(zip(skeleton.end_joints, skeleton.end_offsets[:, 1], strict=True))
    }
    partner = [ends[pairs[joint], y] for joint, y in ends]
    np.testing.assert_allclose(
        kinematics.ends(skeleton, after), kinematics.ends(skeleton, before)[:, partner] * MIRROR, atol=1e-12
    )


@given(SEEDS, st.booleans())
def test_mirrored_twice_is_the_motion(seed, straight):
    motion = writhing(humanoid() if straight else crooked(seed), frames=5, seed=seed)
    twice = mirror(mirror(motion))
    np.testing.assert_array_equal(twice.root_positions, motion.root_positions)
    np.testing.assert_allclose(twice.rotations, motion.rotations, atol=1e-12)
    assert twice.frame_rate == motion.frame_rate
    assert twice.skeleton is motion.skeleton


@given(SEEDS)
def test_limbs_point_the_mirrored_way_on_a_crooked_body(seed):
    motion = writhing(crooked(seed), frames=4, seed=seed)
    skeleton, pairs = motion.skeleton, mirror_pairs(motion.skeleton)
    before, after = kinematics.pose(motion).positions, kinematics.pose(mirror(motion)).positions
    for side in ("left", "right"):
        for limb in (("thigh", "shin", "foot", "toe"), ("shoulder", "upper_arm", "forearm", "hand")):
            chain = skeleton.chain(*(f"{side}_{part}" for part in limb))
            now = np.diff(after[:, chain], axis=1)
            then = np.diff(before[:, pairs[chain]], axis=1) * MIRROR
            np.testing.assert_allclose(
                now / np.linalg.norm(now, axis=-1, keepdims=True),
                then / np.linalg.norm(then, axis=-1, keepdims=True),
                atol=1e-9,
            )


def test_a_turn_to_the_left_becomes_one_to_the_right(skeleton):
    motion = standing(skeleton, frames=3)
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat.about_y(np.array([0.0, 0.3, 0.6]))
    places = motion.root_positions + np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 1.0], [0.4, 0.0, 2.0]])
    mirrored = mirror(replace(motion, rotations=rotations, root_positions=places, name="16_12"))
    np.testing.assert_allclose(quat.twist_about_y(mirrored.rotations[:, 0]), [0.0, -0.3, -0.6], atol=1e-12)
    np.testing.assert_allclose(mirrored.root_positions[:, 0], [0.0, -0.1, -0.4])
    assert mirrored.name == "16_12 mirrored"


def test_the_rest_pose_is_its_own_image(skeleton):
    motion = standing(skeleton, frames=1)
    np.testing.assert_allclose(mirror(motion).rotations, motion.rotations, atol=1e-15)


@given(SEEDS)
def test_signs_stay_continuous(seed):
    motion = writhing(frames=20, seed=seed)
    rotations = mirror(motion).rotations
    assert (np.sum(rotations[1:] * rotations[:-1], axis=-1) > 0).all()


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("LeftFoot", "RightFoot"),
        ("mixamorig:LeftHandThumb1", "mixamorig:RightHandThumb1"),
        ("foot_left", "foot_right"),
        ("LEFT_FOOT", "RIGHT_FOOT"),
        ("lfoot", "rfoot"),
        ("LThumb", "RThumb"),
        ("lThighBend", "rThighBend"),
        ("l_ball", "r_ball"),
        ("Foot_L", "Foot_R"),
        ("foot.l", "foot.r"),
        ("DEF-thigh.L.001", "DEF-thigh.R.001"),
        ("Bip01 L Foot", "Bip01 R Foot"),
        ("FootL", "FootR"),
        ("lower_leg_l", "lower_leg_r"),
        ("Collar_R_L", "Collar_R_R"),
    ],
)
def test_partners_by_name(left, right):
    body = tree(("root", ""), ("lowerback", "root"), (right, "root"), ("Tail", "lowerback"), (left, "root"))
    np.testing.assert_array_equal(mirror_pairs(body), [0, 1, 4, 3, 2])


def test_roles_come_before_names():
    body = tree(("hips", ""), ("LeftA", "hips"), ("RightA", "hips"), ("LeftB", "hips"), ("RightB", "hips"))
    body = replace(body, roles={"hips": 0, "left_foot": 1, "right_foot": 4})
    np.testing.assert_array_equal(mirror_pairs(body), [0, 4, 2, 3, 1])


@given(SEEDS)
def test_pairs_are_mutual(seed):
    rng = np.random.default_rng(seed)
    parts = ("left", "Left", "l", "r", "R", "_", "x", "foot", "Right", ".")
    names = {"".join(rng.choice(parts, rng.integers(1, 5))) for _ in range(12)}
    pairs = mirror_pairs(tree(("root", ""), *((name, "root") for name in sorted(names))))
    np.testing.assert_array_equal(pairs[pairs], np.arange(len(pairs)))


def test_a_joint_on_one_side_only_keeps_its_turn_against_its_parent():
    """A watch on the left wrist stays there; it does not fly off with the right hand's turn."""
    body = humanoid()
    names = (*body.names, "Watch", "Dial")
    parents = np.array([*body.parents, body.joint("left_hand"), body.joints])
    offsets = np.vstack((body.offsets, [[0.0, 0.02, 0.0], [0.0, 0.01, 0.0]]))
    body = replace(body, names=names, parents=parents, offsets=offsets)
    motion = writhing(body, frames=4, seed=3)
    mirrored = mirror(motion)
    for joint in (-2, -1):
        same_rotations(mirrored.rotations[:, joint], motion.rotations[:, joint] * [1.0, 1.0, -1.0, -1.0])
    same_rotations(mirror(mirrored).rotations, motion.rotations)


def test_sides_of_different_joints_still_mirror():
    """The right forearm has a twist joint more than the left; hands still go where the mirror shows them."""
    body = humanoid()
    hand = body.joint("right_hand")
    order = [*range(hand), body.joints, *range(hand, body.joints)]
    names = [*body.names, "RightForeArmTwist"]
    parents = [*body.parents, body.joint("right_forearm")]
    offsets = [*body.offsets, 0.5 * body.offsets[hand]]
    parents[hand], offsets[hand] = body.joints, 0.5 * body.offsets[hand]
    new = {old: k for k, old in enumerate(order)} | {-1: -1}
    twisted = Skeleton(
        names=tuple(names[k] for k in order),
        parents=np.array([new[int(parents[k])] for k in order]),
        offsets=np.array([offsets[k] for k in order]),
        roles={role: new[joint] for role, joint in body.roles.items()},
    )
    motion = writhing(twisted, frames=4, seed=5)
    pairs = mirror_pairs(twisted)
    assert pairs[twisted.names.index("RightForeArmTwist")] == twisted.names.index("RightForeArmTwist")
    before, after = kinematics.pose(motion), kinematics.pose(mirror(motion))
    both = twisted.chain("left_hand", "right_hand", "left_foot", "right_foot")
    same_rotations(after.rotations[:, both], before.rotations[:, pairs[both]] * [1.0, 1.0, -1.0, -1.0])


def test_a_middle_bone_that_grows_sideways_is_left_alone():
    body = Skeleton(
        names=("root", "flag", "tip"),
        parents=np.array([-1, 0, 1]),
        offsets=np.array([[0, 0, 0], [0, 1, 0], [1.0, 0, 0]]),
    )
    motion = Motion(
        skeleton=body, frame_rate=30.0, root_positions=np.zeros((1, 3)), rotations=np.tile(quat.IDENTITY, (1, 3, 1))
    )
    np.testing.assert_allclose(mirror(motion).rotations, motion.rotations)
