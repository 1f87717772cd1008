"""One door for all recordings: a file of any format that is read here becomes a ``Motion``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from stridecast.body.conventions import to_motion, to_skeleton
from stridecast.body.rig import RawRecording
from stridecast.errors import FileError, InputError, SkeletonError
from stridecast.formats.amass import read_amass
from stridecast.formats.amc import read_amc
from stridecast.formats.asf import read_asf
from stridecast.formats.bvh import read_bvh
from stridecast.formats.c3d import read_c3d
from stridecast.formats.files import looks_like, read_start
from stridecast.formats.glb_motion import read_glb, read_glb_at_rest
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

RECORDINGS = {
    ".bvh": "BVH",
    ".amc": "AMC with its ASF",
    ".npz": "AMASS and other SMPL motion",
    ".c3d": "C3D",
    ".glb": "GLB",
    ".vrma": "VRM animation",
}
"""Suffixes of the recordings that ``load_motion`` reads, and what they are."""

SKELETONS = {".bvh": "BVH", ".asf": "ASF", ".glb": "GLB", ".vrm": "VRM"}
"""Suffixes of the files that ``load_skeleton`` reads, and what they are."""


GLB = (".glb", ".vrm", ".vrma")
"""Suffixes of files that are GLB."""


def load_motion(
    path: str | Path,
    *,
    roles: Mapping[str, str] | None = None,
    scale: float | None = None,
    frame_rate: float | None = None,
    up: str | None = None,
    skeleton_path: str | Path | None = None,
    body_model: str | Path | None = None,
    subject: str | None = None,
) -> Motion:
    """Load a recording.

    Parameters
    ----------
    path
        A BVH, AMC, GLB, VRM animation, AMASS (``.npz``) or C3D file, known by its suffix, else by its first words.
    roles
        Joints of the body whose names are unusual, role to joint name; the others are found by their names.
    scale
        Metres per unit of the file. Left out: what the file says, else a usual unit that makes the legs an adult's.
    frame_rate
        Frames a second. Left out: what the file says, else 120.
    up
        Axis that points up, ``"Y"`` or ``"Z"``. Left out: where the head is.
    skeleton_path
        The ASF of an AMC. Left out: ``07.asf`` beside ``07_01.amc``, else the only ASF in the folder.
    body_model
        A body model of SMPL, SMPL+H or SMPL-X as ``.npz``, which gives persons of AMASS their own skeletons. Left out:
        a mean one.
    subject
        Who moves. Left out: ``07`` for ``07_01.bvh``, else the name of the folder.

    Returns
    -------
    Motion
        In metres, +Y up, its rest pose facing +Z, at the recording's frame rate and with its floor where the recording
        has it.

    Raises
    ------
    FileError
        The file cannot be read, is damaged, or is of no format that is read; with the line.
    SkeletonError
        The joints of the legs are not found or have no length, or ``roles`` names something that does not exist.
    MotionError
        Fewer than two frames, or a root or legs that move as no person's do.
    InputError
        A scale that is not positive, or an unknown axis.
    """
    return load_recording(
        path,
        roles=roles,
        scale=scale,
        frame_rate=frame_rate,
        up=up,
        skeleton_path=skeleton_path,
        body_model=body_model,
        subject=subject,
    )[0]


def load_recording(
    path: str | Path,
    *,
    roles: Mapping[str, str] | None = None,
    scale: float | None = None,
    frame_rate: float | None = None,
    up: str | None = None,
    skeleton_path: str | Path | None = None,
    body_model: str | Path | None = None,
    subject: str | None = None,
    assumed_rate: float | None = None,
) -> tuple[Motion, tuple[str, ...]]:
    """Load a recording as ``load_motion`` does, with notes of what was guessed, turned, dropped or added.

    ``assumed_rate`` is taken where the file does not say its frame rate, while ``frame_rate`` overrides what it says.
    """
    path = Path(path)
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise InputError(f"the scale must be a positive number of metres per unit, not {scale}")
    recording = _read(path, skeleton_path, body_model, scale)
    if _is_c3d(path):
        scale = None  # it has been used: regressions from skin to bone need metres
    if recording.frame_rate is None and frame_rate is None:
        frame_rate = assumed_rate
    try:
        return to_motion(
            recording,
            roles=roles,
            scale=scale,
            frame_rate=frame_rate,
            up=up,
            name=path.stem,
            subject=_subject(path) if subject is None else subject,
            source=str(path),
        )
    except SkeletonError as error:
        raise SkeletonError(f"{path}: {error}") from None


def load_skeleton(path: str | Path, *, roles: Mapping[str, str] | None = None, scale: float | None = None) -> Skeleton:
    """Load only the skeleton of a BVH, ASF, GLB or VRM file; parameters and errors as of ``load_motion``."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SKELETONS:
        raise FileError(f"is no skeleton that can be read; readable are {_listed(SKELETONS)}", path=path)
    if suffix in GLB:
        recording = read_glb_at_rest(path)
    else:
        recording = read_bvh(path) if suffix == ".bvh" else read_asf(path).at_rest()
    try:
        return to_skeleton(recording, roles=roles, scale=scale)[0]
    except SkeletonError as error:
        raise SkeletonError(f"{path}: {error}") from None


def _is_c3d(path: Path) -> bool:
    return path.suffix.lower() == ".c3d"


def _read(
    path: Path, skeleton_path: str | Path | None, body_model: str | Path | None, scale: float | None
) -> RawRecording:
    suffix = path.suffix.lower()
    if _is_c3d(path):
        return read_c3d(path, scale=scale)
    if suffix == ".npz":
        return read_amass(path, body_model=body_model)
    seems = looks_like(read_start(path)) if suffix not in RECORDINGS else ""
    if suffix in GLB or "GLB" in seems:
        return read_glb(path)
    if suffix == ".bvh" or "BVH" in seems:
        return read_bvh(path)
    if suffix == ".amc" or "AMC" in seems:
        return read_amc(path, skeleton_path)
    hint = f"; it looks like {seems}" if seems else ""
    if suffix == ".asf":
        hint = "; an ASF is only a skeleton, the motion is in its AMC files"
    raise FileError(f"is no recording that can be read; readable are {_listed(RECORDINGS)}{hint}", path=path)


def _listed(known: Mapping[str, str]) -> str:
    return ", ".join(f"*{suffix} ({what})" for suffix, what in known.items())


def _subject(path: Path) -> str:
    match = re.fullmatch(r"(\d+)_\d+.*", path.stem)
    return match.group(1) if match else path.absolute().parent.name
