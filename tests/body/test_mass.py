from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import humanoid, standing, writhing
from stridecast.body import kinematics, mass
from stridecast.errors import SkeletonError
from stridecast.geometry import quaternions as quat
from stridecast.model.skeleton import ARMS, REQUIRED_ROLES, ROLES, Skeleton

OPTIONAL = sorted(set(ROLES) - set(REQUIRED_ROLES))


def without(skeleton: Skeleton, roles: set[str]) -> Skeleton:
    return replace(skeleton, roles={role: joint for role, joint in skeleton.roles.items() if role not in roles})


def com(skeleton: Skeleton, positions: np.ndarray) -> np.ndarray:
    return mass.center_of_mass(skeleton, kinematics.World(positions, np.zeros((*positions.shape[:-1], 4))))


def test_the_parts_make_up_one_body():
    parts = mass.HEAD.mass + sum(mass.TRUNK_MASSES) + 2 * sum(limb.mass for limb in mass.SIDES)
    assert parts == pytest.approx(1.0, abs=1e-4)


def test_standing_it_is_at_hip_height_between_the_legs(skeleton):
    still = standing(skeleton, frames=2)
    centre = mass.center_of_mass(skeleton, kinematics.pose(still))
    assert centre.shape == (2, 3)
    np.testing.assert_allclose(centre[:, 0], 0.0, atol=1e-12)
    # 55 to 58 % of stature in adults (arms down; the T-pose adds about 2 %)
    stature = kinematics.ends(skeleton, kinematics.pose(still))[0, 0, 1]
    assert 0.55 < centre[0, 1] / stature < 0.60


def test_height_is_the_sum_of_the_parts_by_hand(skeleton):
    """The T-pose added up from the published figures: mass times height of each centre, floor at 0."""
    hips, neck, head, arm = 0.92, 1.50, 1.59, 1.44
    trunk = 0.1182 * 0.122 + 0.1549 * 0.458 + 0.15705 * 0.805
    parts = 0.43015 * hips + trunk * (neck - hips) + 0.0681 * head
    parts += 2 * (0.1447 * (0.92 - 0.385 * 0.43) + 0.0457 * (0.49 - 0.444 * 0.42) + 0.0133 * (0.07 - 0.4 * 0.06))
    parts += 2 * (0.0263 + 0.0150 + 0.00585) * arm
    centre = mass.center_of_mass(skeleton, kinematics.pose(standing(skeleton, frames=1)))
    assert centre[0, 1] == pytest.approx(parts / 0.99995, abs=1e-4)


def test_without_a_neck_the_trunk_is_measured_by_the_shoulders(skeleton):
    """The shoulder joints are 83 % of the way from the hip joints to the neck; put there, they tell the same."""
    offsets = skeleton.offsets.copy()
    for side in ("left", "right"):
        offsets[skeleton.joint(f"{side}_shoulder"), 1] = 0.92 + 0.83 * (1.50 - 0.92) - 1.30
    body = replace(skeleton, offsets=offsets)
    still = kinematics.pose(standing(body, frames=1))
    whole, part = (mass.center_of_mass(body, still) for body in (body, without(body, {"neck"})))
    np.testing.assert_allclose(part, whole, atol=1e-3)


def test_a_part_moves_it_by_its_mass(skeleton):
    """Independent of the tables' layout: bend one elbow and the forearm's mass moves by the arc of its own centre."""
    still, bent = standing(skeleton, frames=1), quat.from_euler(np.array([np.pi / 2]), "Z")
    rotations = still.rotations.copy()
    rotations[:, skeleton.joint("left_forearm")] = bent
    moved = replace(still, rotations=rotations)
    shift = mass.center_of_mass(skeleton, kinematics.pose(moved)) - mass.center_of_mass(
        skeleton, kinematics.pose(still)
    )
    reach = 0.0150 * 0.457 * 0.25 + 0.00585 * 0.25  # forearm and hand, on a forearm of 0.25 m
    np.testing.assert_allclose(shift[0], [-reach, reach, 0.0], rtol=1e-3, atol=1e-9)


@given(st.sets(st.sampled_from(OPTIONAL)))
def test_missing_roles_leave_a_whole_body(missing):
    skeleton = without(humanoid(), missing)
    weights = mass.joint_weights(skeleton)
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert (weights >= 0).all()
    still = kinematics.pose(standing(skeleton, frames=1))
    centre = mass.center_of_mass(skeleton, still)[0]
    limbs = still.positions[0]
    assert (limbs.min(axis=0) <= centre).all()
    assert (centre <= limbs.max(axis=0)).all()


@pytest.mark.parametrize("missing", [{"spine1"}, {"neck"}, {"head"}, {"left_hand", "right_hand"}])
def test_one_missing_role_moves_it_little(skeleton, missing):
    still = kinematics.pose(standing(skeleton, frames=1))
    whole, part = (mass.center_of_mass(body, still) for body in (skeleton, without(skeleton, missing)))
    assert np.abs(whole - part).max() < 0.025


def test_clavicles_carry_nothing_while_there_are_arms(skeleton):
    clavicles = {f"{side}_{ARMS[0]}" for side in ("left", "right")}
    np.testing.assert_array_equal(mass.joint_weights(skeleton), mass.joint_weights(without(skeleton, clavicles)))


@given(st.integers(0, 2**32 - 1))
def test_it_moves_and_turns_with_the_body(seed):
    rng = np.random.default_rng(seed)
    body = writhing(frames=3, seed=seed)
    positions = kinematics.pose(body).positions
    turn, shift = quat.exp(rng.normal(size=3)), rng.normal(size=3)
    expected = quat.rotate(turn, com(body.skeleton, positions)) + shift
    np.testing.assert_allclose(com(body.skeleton, quat.rotate(turn, positions) + shift), expected, atol=1e-12)


def test_any_leading_shape(skeleton):
    world = kinematics.pose(writhing(skeleton, frames=6))
    flat = mass.center_of_mass(skeleton, world)
    folded = mass.center_of_mass(
        skeleton, kinematics.World(*(array.reshape(2, 3, *array.shape[1:]) for array in world))
    )
    np.testing.assert_array_equal(folded.reshape(6, 3), flat)
    np.testing.assert_allclose(mass.center_of_mass(skeleton, kinematics.World(world[0][4], world[1][4])), flat[4])


def test_a_body_without_legs_is_refused_by_name(skeleton):
    with pytest.raises(SkeletonError, match="right_shin, right_foot"):
        mass.joint_weights(without(skeleton, {"right_shin", "right_foot"}))
