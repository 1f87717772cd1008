"""Somebody's own character: the skeleton of its file, and the body of it that moves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from stridecast.body import kinematics
from stridecast.body.alignment import aligned, alignment
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Character:
    """A skeleton as its file has it, and a body for synthesis, which stands as a model does; see ``character_of``.

    Parameters
    ----------
    skeleton
        All joints, in the rest pose of the file.
    body
        Joints that have a role, in the rest pose of the model. Bones end where others hang from them in the file
        (fingers, the tips of toes).
    joints
        Which joints of ``skeleton`` those of ``body`` are.
    turns
        World rotation of each joint of ``skeleton`` when it stands as the model (see ``alignment``).
    """

    skeleton: Skeleton
    body: Skeleton
    joints: Int[Array, "joints"]
    turns: Float[Array, "all 4"]

    def played(self, motion: Motion) -> Motion:
        """A motion of the body on the whole skeleton; joints that the body has not keep to their parents.

        Parameters
        ----------
        motion
            Of ``body``, or of one of another size, which the skeleton then takes too.
        """
        scale = _size(motion.skeleton) / _size(self.body)
        skeleton = resized(self.skeleton, scale)
        own = {int(joint): k for k, joint in enumerate(self.joints)}
        moved = kinematics.pose(motion).rotations
        world = np.empty((motion.frames, skeleton.joints, 4))
        for joint in range(skeleton.joints):
            known = own.get(joint)
            world[:, joint] = world[:, skeleton.parents[joint]] if known is None else moved[:, known]
        rotations = kinematics.local(skeleton, quat.multiply(world, self.turns))
        return replace(motion, skeleton=skeleton, rotations=quat.continuous(quat.normalize(rotations)))


def character_of(skeleton: Skeleton, model: Skeleton) -> Character:
    """Find the body of a character that is to move as people of ``model`` do.

    Raises
    ------
    SkeletonError
        A joint of hips or legs is missing in one of them.
    """
    turns = alignment(skeleton, model)
    whole = aligned(skeleton, turns)
    at = kinematics.rest(whole).positions
    joints = np.array(sorted({0, *skeleton.roles.values()}))
    index = {int(joint): k for k, joint in enumerate(joints)}
    carrier = np.zeros(whole.joints, np.int64)  # the joint of the body that each joint moves with
    for joint in range(1, whole.joints):
        carrier[joint] = index.get(joint, carrier[whole.parents[joint]])
    parents = np.array([-1, *carrier[whole.parents[joints[1:]]]])
    places = at - at[joints[carrier]]
    leaves = sorted({*range(whole.joints)} - {int(parent) for parent in whole.parents} - {*index})
    end_joints = np.concatenate((carrier[leaves], carrier[whole.end_joints]))
    end_offsets = np.concatenate((places[leaves], places[whole.end_joints] + whole.end_offsets))
    body = Skeleton(
        names=tuple(whole.names[joint] for joint in joints),
        parents=parents,
        offsets=at[joints] - at[joints[np.maximum(parents, 0)]],
        roles={role: index[joint] for role, joint in whole.roles.items()},
        end_joints=end_joints,
        end_offsets=end_offsets,
    )
    return Character(skeleton=skeleton, body=body, joints=joints, turns=turns)


def resized(skeleton: Skeleton, scale: float) -> Skeleton:
    """A skeleton so many times as large."""
    return replace(skeleton, offsets=scale * skeleton.offsets, end_offsets=scale * skeleton.end_offsets)


def stature(skeleton: Skeleton) -> float:
    """Height of a skeleton that stands in its rest pose, metres."""
    rest = kinematics.rest(skeleton).positions
    ends = rest[skeleton.end_joints] + skeleton.end_offsets
    heights = np.concatenate((rest[:, 1], ends[:, 1])) if len(skeleton.end_joints) else rest[:, 1]
    return float(heights.max() - heights.min())


def _size(skeleton: Skeleton) -> float:
    return float(np.linalg.norm(skeleton.offsets))
