"""AMASS and other motion of SMPL bodies as ``.npz``: rotation vectors of the joints, and where the body is.

Mahmood et al. 2019, "AMASS: archive of motion capture as surface shapes". Three ways of naming the same things are
read: those of AMASS with SMPL+H (``poses``, ``trans``, ``mocap_framerate``), of AMASS with SMPL-X (``root_orient``,
``pose_body``, ``mocap_frame_rate``) and of the library smplx (``global_orient``, ``body_pose``, ``transl``).
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from jaxtyping import Float

from stridecast.body.rig import RawRecording
from stridecast.errors import FileError
from stridecast.formats.npz import NpzArrays, open_npz
from stridecast.formats.smpl import BODY, MODELS, SmplSkeleton, mean_skeleton, read_body_model
from stridecast.geometry import quaternions as quat

Array = np.ndarray

MOST_FRAMES = 1 << 18
"""So many frames are read: 36 minutes at 120 a second, half a gigabyte of numbers."""

RATES = ("mocap_framerate", "mocap_frame_rate", "mocap_fps", "framerate", "frame_rate", "fps")
"""What the number of frames a second is called."""

PLACES = ("trans", "transl", "smpl_trans")
WHOLE = ("poses", "smpl_poses", "fullpose")
ROOTS = ("root_orient", "global_orient")
BODIES = ("pose_body", "body_pose")

WILDEST = 1e3
"""A rotation vector is some turns long at most, radians; more is no rotation."""

_JOINTS = {3 * len(names): model for model, names in MODELS.items()} | {3 * len(BODY): "SMPL without hands"}


def read_amass(path: str | Path, *, body_model: str | Path | None = None) -> RawRecording:
    """Read motion of an SMPL body.

    Parameters
    ----------
    path
        A ``.npz`` file; pickled objects in it are left alone.
    body_model
        A body model (see ``read_body_model``). With it the skeleton is that of the person, made of ``betas``, and has
        all joints of the model, fingers too. Without it, it is ``mean_skeleton`` of 22 joints, ``betas`` and ``gender``
        are not used, and fingers, jaw and eyes are left out.

    Returns
    -------
    RawRecording
        In metres; its world has the axes of the file (AMASS: z up), its rest pose is a T-pose with y up.

    Raises
    ------
    FileError
        The file is no such motion, is damaged, holds numbers that are not finite, or claims to be larger than any
        recording.
    """
    with open_npz(path) as arrays:
        poses = _poses(path, arrays)
        frames = len(poses)
        places = _rows(path, arrays, _one_of(path, arrays, PLACES, "where the body is"), 3)
        rate = _frame_rate(path, arrays)
        betas = _betas(path, arrays) if body_model is not None else np.zeros(0)
    if len(places) != frames:
        raise FileError(f"has {frames} poses, but {len(places)} places; there should be one a frame", path=path)
    body = mean_skeleton() if body_model is None else read_body_model(body_model, betas)
    return RawRecording(
        names=body.names,
        parents=body.parents,
        offsets=body.offsets,
        end_joints=body.end_joints,
        end_offsets=body.end_offsets,
        # the pelvis is what turns, and the template has it beside the origin that ``trans`` moves
        root_positions=places + body.origin,
        rotations=quat.exp(_on(body, poses)),
        frame_rate=rate,
        unit=1.0,
        notes=_notes(poses, body_model),
    )


def _notes(poses: Float[Array, "frames joints 3"], body_model: str | Path | None) -> tuple[str, ...]:
    if body_model is not None:
        return ()
    said = "the skeleton is a mean one, as no body model is named"
    more = poses.shape[1] - len(BODY)
    return (f"{said}; {more} joints of hands and face are left out" if more else said,)


def _on(body: SmplSkeleton, poses: Float[Array, "frames joints 3"]) -> Float[Array, "frames _ 3"]:
    """Rotations of the joints of a skeleton; those that the file does not have keep still."""
    count = poses.shape[1]
    own = next((names for names in MODELS.values() if len(names) == count), BODY)
    out = np.zeros((len(poses), len(body.names), 3))
    for joint, name in enumerate(body.names):
        if name in own:
            out[:, joint] = poses[:, own.index(name)]
    return out


def _poses(path: str | Path, arrays: NpzArrays) -> Float[Array, "frames joints 3"]:
    """Rotation vectors of all joints of the file."""
    whole = next((name for name in WHOLE if name in arrays), None)
    if whole is not None:
        shape = arrays.shape(whole)
        width = math.prod(shape[1:])
        if len(shape) not in (2, 3) or width not in _JOINTS:
            known = ", ".join(f"{numbers} ({model})" for numbers, model in sorted(_JOINTS.items()))
            raise FileError(f"{whole!r} has shape {shape}; a pose has three numbers a joint, in all {known}", path=path)
        return _rows(path, arrays, whole, width).reshape(-1, width // 3, 3)
    root = _rows(path, arrays, _one_of(path, arrays, ROOTS, "how the body is turned"), 3)
    name = _one_of(path, arrays, BODIES, "the poses of the body")
    width = math.prod(arrays.shape(name)[1:])
    if width not in (63, 69):
        raise FileError(
            f"{name!r} has shape {arrays.shape(name)}; it should have 63 (or, of SMPL, 69) numbers a frame", path=path
        )
    body = _rows(path, arrays, name, width)
    if len(root) != len(body):
        raise FileError(f"has {len(body)} poses of the body, but it is turned in {len(root)} frames", path=path)
    return np.concatenate((root, body), axis=1).reshape(len(root), -1, 3)


def _rows(path: str | Path, arrays: NpzArrays, name: str, width: int) -> Float[Array, "frames _"]:
    """Read one row a frame."""
    shape = arrays.shape(name)
    if len(shape) < 2 or math.prod(shape[1:]) != width:
        raise FileError(f"{name!r} should have {width} numbers a frame, but has shape {shape}", path=path)
    if shape[0] > MOST_FRAMES:
        raise FileError(f"{name!r} has {shape[0]} frames; at most {MOST_FRAMES} are read", path=path)
    values = arrays.numbers(name, MOST_FRAMES * width).reshape(-1, width)
    bad = np.argwhere(~(np.abs(values) < WILDEST))
    if len(bad):
        frame, number = bad[0]
        what = (
            "not finite" if not np.isfinite(values[frame, number]) else f"{values[frame, number]:.3g}, which cannot be"
        )
        raise FileError(f"frame {frame} (counted from 0): number {number} of {name!r} is {what}", path=path)
    return values


def _one_of(path: str | Path, arrays: NpzArrays, names: tuple[str, ...], what: str) -> str:
    found = next((name for name in names if name in arrays), None)
    if found is None:
        have = ", ".join(repr(name[:30]) for name in arrays.names[:12]) or "nothing"
        raise FileError(
            f"is no motion of an SMPL body: {what} is missing ({' or '.join(names)}); it has {have}", path=path
        )
    return found


def _frame_rate(path: str | Path, arrays: NpzArrays) -> float | None:
    name = next((name for name in RATES if name in arrays), None)
    if name is None:
        return None
    rate = arrays.number(name)
    if not 1.0 <= rate <= 10_000.0:
        raise FileError(f"{name!r} should be frames a second, not {rate:g}", path=path)
    return rate


def _betas(path: str | Path, arrays: NpzArrays) -> Float[Array, "shapes"]:
    """The shape of the person; one that changes from frame to frame is taken from the first."""
    if "betas" not in arrays:
        raise FileError("has no 'betas', so a body model cannot make its skeleton; leave the model out", path=path)
    betas = np.atleast_2d(arrays.numbers("betas", MOST_FRAMES * 16))[0]
    if not (np.abs(betas) < WILDEST).all():
        raise FileError("'betas' holds numbers that are no shape", path=path)
    return betas
