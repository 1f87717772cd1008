from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from bodies import humanoid
from stridecast.errors import InputError, SkeletonError
from stridecast.model.skeleton import REQUIRED_ROLES, ROLES, Skeleton


def tail(**changes: object) -> Skeleton:
    """Three joints in a row, with something changed."""
    fields = {
        "names": ("root", "middle", "tip"),
        "parents": np.array([-1, 0, 1]),
        "offsets": np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.5, 0.0]]),
    }
    return Skeleton(**(fields | changes))


def test_a_skeleton_keeps_its_own_frozen_arrays():
    offsets = np.zeros((3, 3))
    body = tail(offsets=offsets)
    offsets[1] = 7.0
    assert body.offsets[1, 0] == 0.0
    for array in (body.parents, body.offsets, body.end_joints, body.end_offsets):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(TypeError):
        body.roles["hips"] = 1
    with pytest.raises(FrozenInstanceError):
        body.names = ()


@pytest.mark.usefixtures("unchecked")
def test_plain_lists_will_do():
    body = tail(names=["root", "middle", "tip"], parents=[-1, 0, 0], end_joints=[2], end_offsets=[[0, 1, 0]])
    assert body.names == ("root", "middle", "tip")
    assert body.joints == 3
    assert body.end_offsets.dtype == np.float64


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"names": (), "parents": np.zeros(0, int), "offsets": np.zeros((0, 3))}, "at least one joint"),
        ({"parents": np.array([-1, 0])}, r"3 joint names need parents of shape \(3,\).*not \(2,\)"),
        ({"offsets": np.zeros((3, 2))}, r"offsets of shape \(3, 3\).*\(3, 2\)"),
        ({"names": ("root", "tip", "tip")}, "twice: tip"),
        ({"parents": np.array([0, 0, 1])}, "first joint must be the root"),
        ({"parents": np.array([-1, 2, 0])}, "'middle' must come after its parent"),
        ({"parents": np.array([-1, 0, 2])}, "'tip' must come after its parent"),
        ({"parents": np.array([-1, 0, -1])}, "'tip' must come after its parent"),
        ({"offsets": np.full((3, 3), np.nan)}, "finite"),
        ({"end_joints": np.array([2]), "end_offsets": np.array([[0.0, np.inf, 0.0]])}, "finite"),
        ({"end_joints": np.array([2, 1]), "end_offsets": np.zeros((1, 3))}, "end_joints and end_offsets"),
        ({"roles": {"knee": 1}}, "no role 'knee'; there are hips, spine"),
        ({"roles": {"hips": 3}}, "role 'hips' points at joint 3 of 3"),
        ({"roles": {"hips": -1}}, "role 'hips' points at joint -1"),
    ],
)
def test_what_is_no_skeleton_is_refused_by_name(changes, says):
    with pytest.raises(SkeletonError, match=says) as refused:
        tail(**changes)
    assert isinstance(refused.value, InputError)


def test_end_joints_outside_the_skeleton_are_refused():
    with pytest.raises(SkeletonError, match="end"):
        tail(end_joints=np.array([3]), end_offsets=np.zeros((1, 3)))


def test_joints_by_role():
    body = humanoid()
    assert set(body.roles) == set(ROLES)
    assert body.names[body.joint("left_foot")] == "LeftFoot"
    assert [body.names[j] for j in body.chain("right_thigh", "right_shin")] == ["RightUpLeg", "RightLeg"]
    body.require_roles(ROLES)


def test_a_role_that_no_joint_has_is_named():
    with pytest.raises(SkeletonError, match="no joint for 'left_toe'; it has hips"):
        tail(roles={"hips": 0}).joint("left_toe")
    with pytest.raises(SkeletonError, match="no roles at all"):
        tail().joint("hips")


def test_every_missing_role_is_named_at_once():
    with pytest.raises(SkeletonError) as refused:
        tail(roles={"hips": 0}).require_roles()
    for role in REQUIRED_ROLES[1:]:
        assert role in str(refused.value)
    assert "root, middle, tip" in str(refused.value)


def test_leg_length_is_thigh_and_shin():
    body = humanoid()
    assert body.leg_length == pytest.approx(0.43 + np.hypot(0.42, 0.01))
    offsets = body.offsets.copy()
    offsets[body.joint("left_shin")] *= 1.1
    assert replace(body, offsets=offsets).leg_length == pytest.approx(body.leg_length + 0.0215)
    assert humanoid(2.0).leg_length == pytest.approx(2 * body.leg_length)
