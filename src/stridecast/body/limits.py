"""Soft joint limits: knees and elbows bend one way, and no joint turns further than people can."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from stridecast.geometry import quaternions as quat
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

FARTHEST = {
    "spine": 45.0,
    "spine1": 45.0,
    "chest": 45.0,
    "neck": 60.0,
    "head": 60.0,
    "shoulder": 40.0,
    "upper_arm": 150.0,
    "forearm": 150.0,
    "hand": 85.0,
    "thigh": 125.0,
    "shin": 150.0,
    "foot": 60.0,
    "toe": 70.0,
}
"""How far a joint may turn from the rest pose, degrees; further if the person recorded did."""

HINGES = {"shin": "foot", "forearm": "hand"}
"""Joints that bend one way, and the joint at the far end of their bone."""

STRAIGHT = np.radians(3.0)
"""Knees and elbows stay bent at least so far, or as far as the person's own were when straightest."""

SOFT = np.radians(12.0)
"""So far before a limit a joint begins to yield."""


def within_limits(
    skeleton: Skeleton, rotations: Float[Array, "frames joints 4"], recorded: Float[Array, "samples joints 4"]
) -> Float[Array, "frames joints 4"]:
    """The same pose, each joint held softly within what it can do; what is well within stays as it is.

    Parameters
    ----------
    skeleton
        Whose joints; those without a role are free.
    rotations
        Poses to hold, joint to parent.
    recorded
        What the person really did: the axes of knees and elbows are learned from it, and it is within the limits.
    """
    out = rotations.copy()
    for role, joint in skeleton.roles.items():
        part = role.removeprefix("left_").removeprefix("right_")
        if joint == 0 or part not in FARTHEST:
            continue
        if part in HINGES:
            side = role.removesuffix(part)
            bone = (
                skeleton.offsets[skeleton.roles[side + HINGES[part]]] if side + HINGES[part] in skeleton.roles else None
            )
            if bone is not None and np.linalg.norm(bone) > 1e-6:
                out[:, joint] = _bent_one_way(out[:, joint], recorded[:, joint], bone / np.linalg.norm(bone))
        turned, own = quat.log(out[:, joint]), np.linalg.norm(quat.log(recorded[:, joint]), axis=-1)
        angle = np.linalg.norm(turned, axis=-1, keepdims=True)
        most = max(np.radians(FARTHEST[part]), float(own.max()) + SOFT)
        held = _at_most(angle, most)
        out[:, joint] = np.where(held < angle, quat.exp(turned * held / np.maximum(angle, 1e-9)), out[:, joint])
    return out


def bends(q: Float[Array, "frames 4"], bone: Float[Array, "3"]) -> Float[Array, "frames 3"]:
    """How a bone (a unit vector in the joint's frame) is bent away from its rest: rotation vectors across it."""
    there = quat.rotate(q, bone)
    across = np.cross(bone, there)
    sine, cosine = np.linalg.norm(across, axis=-1, keepdims=True), np.sum(bone * there, axis=-1, keepdims=True)
    return np.arctan2(sine, cosine) * across / np.maximum(sine, 1e-12)


def _bent_one_way(
    q: Float[Array, "frames 4"], recorded: Float[Array, "samples 4"], bone: Float[Array, "3"]
) -> Float[Array, "frames 4"]:
    """A hinge that does not bend backwards. Its axis is that of the mean bend: it bends one way only."""
    own = bends(recorded, bone)
    axis = own.mean(axis=0)
    if np.linalg.norm(axis) < STRAIGHT:
        return q
    axis = axis / np.linalg.norm(axis)
    least = min(STRAIGHT, float((own @ axis).min()))
    bent = bends(q, bone)
    along = bent @ axis
    reserve = max(0.0, min(SOFT, float((own @ axis).min()) - least))  # the person's own poses stay as they are
    held = -_at_most(-along, -least, reserve)
    twist = quat.multiply(quat.inverse(quat.exp(bent)), q)
    moved = quat.multiply(quat.exp(bent + (held - along)[:, None] * axis), twist)
    return np.where((held > along)[:, None], moved, q)


def _at_most(value: Array, limit: float, soft: float = SOFT) -> Array:
    """Values that come to a limit gently: the last ``soft`` before it takes all that lies beyond."""
    if soft <= 0:
        return np.minimum(value, limit)
    excess = np.maximum(value - (limit - soft), 0.0)
    return np.where(excess > 0, limit - soft * np.exp(-excess / soft), value)
