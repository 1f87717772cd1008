"""Bodies and movements for tests, made of plain numbers."""

from __future__ import annotations

import numpy as np

from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

# name, parent, place in the parent's frame for a person of 1.75 m (metres), role
MIDDLE = (
    ("Hips", "", (0.0, 0.0, 0.0), "hips"),
    ("Spine", "Hips", (0.0, 0.09, -0.01), "spine"),
    ("Spine1", "Spine", (0.0, 0.11, 0.0), "spine1"),
    ("Chest", "Spine1", (0.0, 0.12, 0.0), "chest"),
    ("Neck", "Chest", (0.0, 0.20, 0.01), "neck"),
    ("Head", "Neck", (0.0, 0.09, 0.02), "head"),
)
SIDE = (  # of the left, +X
    ("UpLeg", "Hips", (0.09, -0.06, 0.0), "thigh"),
    ("Leg", "LeftUpLeg", (0.0, -0.43, 0.0), "shin"),
    ("Foot", "LeftLeg", (0.0, -0.42, -0.01), "foot"),
    ("ToeBase", "LeftFoot", (0.0, -0.06, 0.13), "toe"),
    ("Shoulder", "Chest", (0.03, 0.14, 0.0), "shoulder"),
    ("Arm", "LeftShoulder", (0.15, 0.0, 0.0), "upper_arm"),
    ("ForeArm", "LeftArm", (0.28, 0.0, 0.0), "forearm"),
    ("Hand", "LeftForeArm", (0.25, 0.0, 0.0), "hand"),
    ("HandThumb", "LeftHand", (0.04, -0.01, 0.04), ""),
)
ENDS = (
    ("Head", (0.0, 0.19, 0.0)),
    ("LeftToeBase", (0.0, -0.01, 0.07)),
    ("RightToeBase", (0.0, -0.01, 0.07)),
    ("LeftHand", (0.18, 0.0, 0.0)),
    ("RightHand", (-0.18, 0.0, 0.0)),
)
HIP_HEIGHT = 0.98
"""Height of the root when the humanoid stands in its rest pose with the toe tips on the floor, metres."""


def humanoid(scale: float = 1.0) -> Skeleton:
    """A person of 24 joints in a T-pose, facing +Z, left and right alike, with all roles."""
    rows = list(MIDDLE)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        for name, parent, (x, y, z), part in SIDE:
            role = f"{side.lower()}_{part}" if part else ""
            rows.append((side + name, parent.replace("Left", side), (sign * x, y, z), role))
    names = tuple(row[0] for row in rows)
    return Skeleton(
        names=names,
        parents=np.array([names.index(parent) if parent else -1 for _, parent, _, _ in rows]),
        offsets=scale * np.array([offset for _, _, offset, _ in rows]),
        roles={role: joint for joint, (_, _, _, role) in enumerate(rows) if role},
        end_joints=np.array([names.index(name) for name, _ in ENDS]),
        end_offsets=scale * np.array([offset for _, offset in ENDS]),
    )


def standing(skeleton: Skeleton | None = None, frames: int = 60, frame_rate: float = 30.0) -> Motion:
    """The rest pose, held; the humanoid's toe tips touch the floor."""
    skeleton = skeleton or humanoid()
    return Motion(
        skeleton=skeleton,
        frame_rate=frame_rate,
        root_positions=np.tile([0.0, HIP_HEIGHT * skeleton.leg_length / humanoid().leg_length, 0.0], (frames, 1)),
        rotations=np.tile(quat.IDENTITY, (frames, skeleton.joints, 1)),
        name="standing",
    )


def writhing(skeleton: Skeleton | None = None, frames: int = 60, frame_rate: float = 30.0, seed: int = 0) -> Motion:
    """Smooth, lawless movement: every joint swings about an axis of its own, the root drifts and faces anywhere."""
    skeleton = skeleton or humanoid()
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None, None] / frame_rate
    frequency, phase = rng.uniform(0.2, 1.0, (2, skeleton.joints, 3))
    vectors = rng.normal(0.0, 0.6, (skeleton.joints, 3)) * np.sin(2 * np.pi * (frequency * t + phase))
    rotations = quat.exp(vectors)
    rotations[:, 0] = quat.multiply(quat.about_y(rng.uniform(-np.pi, np.pi)), rotations[:, 0])
    drift = rng.normal(0.0, 1.0, 3) * [1.0, 0.0, 1.0]
    return Motion(
        skeleton=skeleton,
        frame_rate=frame_rate,
        root_positions=[0.0, 1.0, 0.0] + t[:, 0] * drift + 0.05 * np.sin(3.0 * t[:, 0] + rng.normal(size=3)),
        rotations=quat.continuous(rotations),
        name="writhing",
    )
