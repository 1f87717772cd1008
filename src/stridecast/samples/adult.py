"""The body of the sample takes: a plain adult of 24 joints, left and right alike."""

from __future__ import annotations

from functools import cache

import numpy as np
from jaxtyping import Float

from stridecast.geometry import quaternions as quat
from stridecast.model.skeleton import Skeleton

# name, parent, place in the parent's frame in the rest pose (metres), role
_MIDDLE = (
    ("Hips", "", (0.0, 0.0, 0.0), "hips"),
    ("Spine", "Hips", (0.0, 0.095, -0.01), "spine"),
    ("Spine1", "Spine", (0.0, 0.115, 0.0), "spine1"),
    ("Spine2", "Spine1", (0.0, 0.12, 0.005), "chest"),
    ("Neck", "Spine2", (0.0, 0.19, 0.0), "neck"),
    ("Head", "Neck", (0.0, 0.095, 0.02), "head"),
)
_LEFT = (  # and mirrored, +X is left
    ("LeftUpLeg", "Hips", (0.09, -0.045, 0.0), "left_thigh"),
    ("LeftLeg", "LeftUpLeg", (0.0, -0.435, 0.0), "left_shin"),
    ("LeftFoot", "LeftLeg", (0.0, -0.425, 0.0), "left_foot"),
    ("LeftToeBase", "LeftFoot", (0.0, -0.042, 0.124), "left_toe"),
    ("LeftShoulder", "Spine2", (0.025, 0.14, 0.0), "left_shoulder"),
    ("LeftArm", "LeftShoulder", (0.15, 0.0, 0.0), "left_upper_arm"),
    ("LeftForeArm", "LeftArm", (0.285, 0.0, 0.0), "left_forearm"),
    ("LeftHand", "LeftForeArm", (0.255, 0.0, 0.0), "left_hand"),
    ("LeftHandThumb1", "LeftHand", (0.035, -0.01, 0.03), ""),
)
_ENDS = (
    ("Head", (0.0, 0.20, 0.0)),
    ("LeftToeBase", (0.0, -0.006, 0.07)),
    ("RightToeBase", (0.0, -0.006, 0.07)),
    ("LeftHand", (0.18, 0.0, 0.0)),
    ("RightHand", (-0.18, 0.0, 0.0)),
)

SOLE = 0.019
"""Height of the toe joint when the foot is flat, metres."""

HEEL = np.array([0.0, -(0.042 + SOLE), -0.05])
"""Where the heel touches the floor, in the frame of the ankle, metres."""

STEEPEST = np.radians(55)
"""The heel of a foot that still carries is raised no further, radians."""


@cache
def adult() -> Skeleton:
    """Skeleton of a person of 1.78 m in a T-pose, facing +Z, with all roles. Proportions after Winter (2009)."""
    rows = list(_MIDDLE)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        for name, parent, (x, y, z), role in _LEFT:
            swap = [text.replace("Left", side).replace("left", side.lower()) for text in (name, parent, role)]
            rows.append((swap[0], swap[1], (sign * x, y, z), swap[2]))
    names = [name for name, *_ in rows]
    return Skeleton(
        names=tuple(names),
        parents=np.array([names.index(parent) if parent else -1 for _, parent, _, _ in rows]),
        offsets=np.array([offset for _, _, offset, _ in rows]),
        roles={role: joint for joint, (_, _, _, role) in enumerate(rows) if role},
        end_joints=np.array([names.index(name) for name, _ in _ENDS]),
        end_offsets=np.array([offset for _, offset in _ENDS]),
    )


def standing_height(bend: float = np.radians(9)) -> float:
    """Height of the root over the floor when both feet are flat under the hips and the knees bent, metres."""
    at = dict(zip(adult().names, adult().offsets, strict=True))
    upper, lower = -at["LeftLeg"][1], -at["LeftFoot"][1]
    leg = np.sqrt(upper**2 + lower**2 + 2 * upper * lower * np.cos(bend))
    return float(leg - at["LeftUpLeg"][1] - at["LeftToeBase"][1] + SOLE)


def roll_over(pitches: Float[np.ndarray, "frames"], ball: Float[np.ndarray, "3"]) -> Float[np.ndarray, "frames 3"]:
    """Ankle of a foot on the floor that faces +Z, seen from the point below its ball when flat.

    It turns about the heel while the toes are up (negative pitch), about the ball when the heel is up.

    Parameters
    ----------
    pitches
        Rotation about the axis to the left, heel up is positive, radians.
    ball
        Toe joint in the frame of the ankle.
    """
    tip = quat.exp(pitches[:, None] * np.array([1.0, 0.0, 0.0]))
    over_ball = np.array([0.0, SOLE, 0.0]) - quat.rotate(tip, ball)
    heel = np.array([0.0, SOLE, 0.0]) + HEEL - ball
    return np.where(pitches[:, None] > 0, over_ball, heel - quat.rotate(tip, HEEL))
