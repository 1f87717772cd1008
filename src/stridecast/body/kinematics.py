"""Forward kinematics: joint rotations to places in the world."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton


class World(NamedTuple):
    """Where joints are: ``positions`` (..., joints, 3), metres, and ``rotations`` (..., joints, 4), joint to world."""

    positions: np.ndarray
    rotations: np.ndarray


def forward(
    skeleton: Skeleton, root_positions: Float[np.ndarray, "*shape 3"], rotations: Float[np.ndarray, "*shape joints 4"]
) -> World:
    """Pose a skeleton: local rotations (the root's in the world) to world positions and rotations of all joints."""
    positions = np.empty((*rotations.shape[:-1], 3))
    turned = np.empty(rotations.shape)
    positions[..., 0, :] = root_positions
    turned[..., 0, :] = rotations[..., 0, :]
    for joint in range(1, skeleton.joints):
        parent = skeleton.parents[joint]
        turned[..., joint, :] = quat.multiply(turned[..., parent, :], rotations[..., joint, :])
        positions[..., joint, :] = positions[..., parent, :] + quat.rotate(
            turned[..., parent, :], skeleton.offsets[joint]
        )
    return World(positions, turned)


def pose(motion: Motion) -> World:
    """World positions and rotations of a motion's joints at every frame."""
    return forward(motion.skeleton, motion.root_positions, motion.rotations)


def rest(skeleton: Skeleton) -> World:
    """World positions and rotations of the rest pose, root at the origin."""
    return forward(skeleton, np.zeros(3), np.tile(quat.IDENTITY, (skeleton.joints, 1)))


def ends(skeleton: Skeleton, world: World) -> Float[np.ndarray, "*shape ends 3"]:
    """World positions of the ends of the last bones (toe tips, crown, finger tips)."""
    hang = skeleton.end_joints
    return world.positions[..., hang, :] + quat.rotate(world.rotations[..., hang, :], skeleton.end_offsets)


def local(
    skeleton: Skeleton, world_rotations: Float[np.ndarray, "*shape joints 4"]
) -> Float[np.ndarray, "*shape joints 4"]:
    """Local rotations of joint rotations in the world; inverse of what ``forward`` does to rotations."""
    out = world_rotations.copy()
    out[..., 1:, :] = quat.multiply(
        quat.inverse(world_rotations[..., skeleton.parents[1:], :]), world_rotations[..., 1:, :]
    )
    return out
