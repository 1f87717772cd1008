"""Two-bone leg inverse kinematics for whole motions: the knee is a hinge, found by the law of cosines."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.geometry import quaternions as quat
from stridecast.geometry import signals
from stridecast.model.skeleton import Skeleton

STRAIGHTEST = 0.9995
"""Largest reach of a leg, as a part of its length: a leg pulled quite straight snaps when the hip moves on."""

BENT = 0.05
"""A knee that is bent forward by less than this (its sine) has no plane to keep."""


def reach(
    skeleton: Skeleton,
    root_positions: Float[np.ndarray, "frames 3"],
    rotations: Float[np.ndarray, "frames joints 4"],
    side: str,
    ankles: Float[np.ndarray, "frames 3"],
) -> Float[np.ndarray, "frames joints 4"]:
    """Bend one leg so that its ankle comes to ``ankles``; the foot keeps its world rotation.

    The knee keeps the plane it has; one that is straight, or goes backwards, bends about its hinge, forwards. A leg
    that is too short reaches as far as it can.

    Parameters
    ----------
    root_positions, rotations
        The pose to change, frame by frame.
    side
        ``left`` or ``right``.
    ankles
        Where the ankle is to be, metres in the world.
    """
    thigh, shin, foot = skeleton.chain(f"{side}_thigh", f"{side}_shin", f"{side}_foot")
    world = kinematics.forward(skeleton, root_positions, rotations)
    hip, knee, ankle = (world.positions[:, joint] for joint in (thigh, shin, foot))
    upper = float(np.linalg.norm(knee[0] - hip[0]))
    lower = float(np.linalg.norm(ankle[0] - knee[0]))

    # 1. Bend the knee until the distance from hip to ankle is right.
    want = np.linalg.norm(ankles - hip, axis=-1)
    want = np.clip(want, abs(upper - lower) * 1.001, (upper + lower) * STRAIGHTEST)
    thigh_way, shin_way = (knee - hip) / upper, (ankle - knee) / lower
    axis = np.cross(thigh_way, shin_way)
    hinge = quat.rotate(world.rotations[:, shin], np.array([1.0, 0.0, 0.0]))
    forward = signals.smooth(np.sum(axis * hinge, axis=-1, keepdims=True) / BENT)
    hinge -= np.sum(hinge * thigh_way, axis=-1, keepdims=True) * thigh_way
    axis = forward * axis + (1 - forward) * BENT * hinge
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    bend = quat.exp(axis * (np.pi - _inner_angle(upper, lower, want))[:, None])
    bend = quat.multiply(bend, quat.between(shin_way, thigh_way))
    ankle = knee + quat.rotate(bend, ankle - knee)

    # 2. Swing the whole leg so that the ankle points at its place. Bones between the three joints follow rigidly.
    swing = quat.between(ankle - hip, ankles - hip)
    whole = quat.multiply(swing, bend)

    out = rotations.copy()
    for joint, inner, outer in (
        (thigh, None, swing),
        (shin, swing, whole),
        (foot, whole, None),
    ):
        above = world.rotations[:, skeleton.parents[joint]]
        above = above if inner is None else quat.multiply(inner, above)
        turned = world.rotations[:, joint]
        turned = turned if outer is None else quat.multiply(outer, turned)
        out[:, joint] = quat.multiply(quat.inverse(above), turned)
    return out


def _inner_angle(upper: float, lower: float, distance: Float[np.ndarray, "frames"]) -> Float[np.ndarray, "frames"]:
    """Angle at the knee inside the triangle, pi for a straight leg."""
    cosine = (upper**2 + lower**2 - distance**2) / (2 * upper * lower)
    return np.arccos(np.clip(cosine, -1.0, 1.0))
