"""SMPL bodies and AMASS files for tests: the movement of any motion on them, and small body models."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stridecast.body.retargeting import retarget
from stridecast.body.roles import find_roles
from stridecast.formats.smpl import MODELS, SmplSkeleton, joint_parents, mean_skeleton
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

UP = quat.exp(np.array([np.pi / 2, 0.0, 0.0]))
"""From +Y up, as here, to +Z up, as in AMASS."""


def smpl_body(scale: float = 1.0, body: SmplSkeleton | None = None) -> Skeleton:
    body = body or mean_skeleton()
    return Skeleton(
        names=body.names,
        parents=body.parents,
        offsets=body.offsets * scale * (body.parents >= 0)[:, None],
        roles=find_roles(body.names, body.parents.tolist()),
        end_joints=body.end_joints,
        end_offsets=body.end_offsets * scale,
    )


def on_smpl(motion: Motion, scale: float = 1.0) -> Motion:
    return retarget(motion, smpl_body(scale))


def amass_arrays(motion: Motion, model: str = "SMPL+H", origin: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """What AMASS would hold of a motion of an SMPL body, z up."""
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat.multiply(UP, rotations[:, 0])
    poses = np.zeros((motion.frames, len(MODELS[model]), 3))
    poses[:, : motion.skeleton.joints] = quat.log(rotations)
    origin = mean_skeleton().origin if origin is None else origin
    return {
        "poses": poses.reshape(motion.frames, -1),
        "trans": quat.rotate(UP, motion.root_positions) - origin,
        "mocap_framerate": np.array(motion.frame_rate),
        "gender": np.array("female"),
        "betas": np.zeros(16),
        "dmpls": np.zeros((motion.frames, 8)),
    }


def write_amass(path: Path, motion: Motion, **changes: np.ndarray | None) -> Path:
    arrays = amass_arrays(motion) | changes
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    return path


def body_model(path: Path, scale: float = 1.0, model: str = "SMPL+H", shapes: int = 3, **changes: np.ndarray) -> Path:
    """A body model of one vertex a joint; each unit of the first beta makes it a tenth larger."""
    names = MODELS[model]
    mean = mean_skeleton()
    parents = joint_parents(names)
    at = np.zeros((len(names), 3))
    at[0] = mean.origin
    for joint in range(1, len(names)):
        offset = mean.offsets[joint] if joint < len(mean.names) else np.array([0.03, 0.0, 0.01])
        at[joint] = at[parents[joint]] + offset
    at *= scale
    directions = np.zeros((*at.shape, shapes))
    directions[..., 0] = 0.1 * at
    arrays = {"v_template": at, "shapedirs": directions, "J_regressor": np.eye(len(names))} | changes
    np.savez(path, **arrays)
    return path
