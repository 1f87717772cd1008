"""Carry a motion to another skeleton: by role, rest poses aligned, root scaled by leg length, feet replanted."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.body.legs import reach
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import ARMS, LEGS, Skeleton

_NEXT_IN_LIMB = {
    f"{side}_{near}": f"{side}_{far}"
    for side in ("left", "right")
    for limb in (LEGS, ARMS)
    for near, far in pairwise(limb)
}
_NEXT_IN_TRUNK = {"spine": "chest", "spine1": "chest", "chest": "neck", "neck": "head"}


def same_skeleton(a: Skeleton, b: Skeleton) -> bool:
    """Whether two skeletons have the same joints, to a hundredth of a millimetre."""
    return (
        a.names == b.names
        and np.array_equal(a.parents, b.parents)
        and np.allclose(a.offsets, b.offsets, atol=1e-5, rtol=0)
    )


def retarget(motion: Motion, skeleton: Skeleton) -> Motion:
    """Play ``motion`` on ``skeleton``.

    Each joint with a role takes the world rotation of the joint with that role, corrected so that the bones point the
    same way although the rest poses differ; other joints keep still in their parents' frames. Places are scaled by the
    ratio of leg lengths; then the legs are bent so that toes stand where the scaled recording had them.

    Parameters
    ----------
    motion
        What to play; its skeleton needs the roles of hips and legs.
    skeleton
        The body that plays it; the same.

    Raises
    ------
    SkeletonError
        A joint that is needed is missing.
    """
    source = motion.skeleton
    source.require_roles()
    skeleton.require_roles()
    if same_skeleton(source, skeleton):
        return replace(motion, skeleton=skeleton)
    scale = skeleton.leg_length / source.leg_length
    world = kinematics.pose(motion)
    turned = _world_rotations(skeleton, source, world.rotations)
    rotations = kinematics.local(skeleton, turned)
    hips = _hip_middle(source, world.positions) * scale
    root = hips - _hip_middle(skeleton, kinematics.forward(skeleton, np.zeros_like(hips), rotations).positions)
    for side in ("left", "right"):
        toe = world.positions[:, source.joint(f"{side}_toe")] * scale
        foot, toe_joint = skeleton.chain(f"{side}_foot", f"{side}_toe")
        ankle = toe - quat.rotate(turned[:, foot], skeleton.offsets[toe_joint])
        rotations = reach(skeleton, root, rotations, side, ankle)
    return replace(motion, skeleton=skeleton, root_positions=root, rotations=quat.continuous(quat.normalize(rotations)))


def _world_rotations(
    skeleton: Skeleton, source: Skeleton, source_rotations: Float[np.ndarray, "frames _ 4"]
) -> Float[np.ndarray, "frames joints 4"]:
    """World rotation of every joint of ``skeleton``; parents come before children, so each can follow its parent."""
    out = np.empty((len(source_rotations), skeleton.joints, 4))
    role_of = {joint: role for role, joint in skeleton.roles.items()}
    for joint in range(skeleton.joints):
        role = role_of.get(joint)
        if role is not None and role in source.roles:
            out[:, joint] = quat.multiply(source_rotations[:, source.roles[role]], _alignment(skeleton, source, role))
        elif joint > 0:
            out[:, joint] = out[:, skeleton.parents[joint]]
        else:  # a root over the hips: they carry the whole movement
            out[:, joint] = quat.IDENTITY
    return out


def _alignment(skeleton: Skeleton, source: Skeleton, role: str) -> Float[np.ndarray, "4"]:
    """Rotation of the joint of ``skeleton`` that makes its bone point where the source's does in the rest pose."""
    after = _NEXT_IN_LIMB.get(role) or _NEXT_IN_TRUNK.get(role)
    if after is None or after not in skeleton.roles or after not in source.roles:
        return quat.IDENTITY
    return quat.between(_bone(skeleton, role, after), _bone(source, role, after))


def _bone(skeleton: Skeleton, role: str, after: str) -> Float[np.ndarray, "3"]:
    """Vector from one joint to another further out, in the rest pose."""
    at = kinematics.rest(skeleton).positions
    return at[skeleton.joint(after)] - at[skeleton.joint(role)]


def _hip_middle(skeleton: Skeleton, positions: Float[np.ndarray, "frames joints 3"]) -> Float[np.ndarray, "frames 3"]:
    """Middle between the hip joints: the same spot in any body, wherever a skeleton puts its root."""
    return positions[:, skeleton.chain("left_thigh", "right_thigh")].mean(axis=1)
