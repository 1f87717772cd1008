"""Files of what was played, for the client to keep."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from stridecast.crowd.baking import filmed
from stridecast.crowd.crowd import Crowd
from stridecast.errors import InputError
from stridecast.formats.crowd_files import CrowdFiles
from stridecast.formats.files import replacing
from stridecast.formats.glb import GlbCrowd
from stridecast.formats.glb_figure import Planted
from stridecast.formats.motion_files import write_motion
from stridecast.formats.trace import trace_text
from stridecast.live.cast import Costume, meshes_of, worn
from stridecast.live.frames import Figures, unpack_rotations
from stridecast.model.motion import Motion
from stridecast.synthesis.journey import Journey

Array = np.ndarray

Frames = Sequence[tuple[float, Figures]]
"""Frames of a timeline: time and figures."""

SHORTEST = 2
"""Frames that make a motion."""


def write_walk(path: Path, journey: Journey, what: str, costume: Costume | None) -> None:
    """A walk as ``bvh`` or ``glb``, or as ``csv`` its trace."""
    if what != "csv":
        _write(path, journey.motion, costume, journey.planted)
        return
    with replacing(path) as file:
        file.write(trace_text(journey).encode())


def write_clip(path: Path, motion: Motion, costume: Costume | None) -> None:
    """A clip as BVH or GLB."""
    _write(path, motion, costume, None)


def _write(path: Path, motion: Motion, costume: Costume | None, planted: Planted | None) -> None:
    """A motion, on the character if there is one."""
    character = None if costume is None else costume.file
    write_motion(path, worn(costume, motion), planted=planted, character=character)


def write_ways(path: Path, frames: Frames) -> None:
    """Everybody's places as CSV (see ``crowd_files``).

    Raises
    ------
    InputError
        Nothing has been played.
    """
    _check(frames)
    with CrowdFiles(path) as files:
        _add_rows(files, frames)


def write_motions(
    path: Path,
    frames: Frames,
    crowd: Crowd,
    costume: Costume | None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """A zip of a BVH a person, their index, and everybody's places (see ``crowd_files``).

    Raises
    ------
    InputError
        Nothing has been played.
    """
    _check(frames)
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        with CrowdFiles(Path(folder, "crowd.bvh")) as files:
            _add_rows(files, frames)
            motions = _motions(frames, crowd)
            for done, (number, (start, motion)) in enumerate(motions.items()):
                files.add_motion(number, motion.name, start, worn(costume, motion), crowd.height(number))
                if progress is not None:
                    progress(done, len(motions))
        with zipfile.ZipFile(path, "x", zipfile.ZIP_DEFLATED, compresslevel=3) as archive:
            for written in sorted(Path(folder).iterdir()):
                archive.write(written, written.name)


def write_figures(
    path: Path,
    frames: Frames,
    crowd: Crowd,
    costume: Costume | None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Everybody in motion as one GLB (see ``GlbCrowd``).

    Raises
    ------
    InputError
        Nothing has been played.
    """
    _check(frames)
    scene = GlbCrowd(path, character=meshes_of(costume))
    try:
        motions = _motions(frames, crowd)
        for done, (start, motion) in enumerate(motions.values()):
            scene.add(worn(costume, motion), name=motion.name, start=start)
            if progress is not None:
                progress(done, len(motions))
        scene.save()
    finally:
        scene.close()


def _check(frames: Frames) -> None:
    if len(frames) < SHORTEST:
        raise InputError("nothing has been played yet; play the scene first, then save it")


def _add_rows(files: CrowdFiles, frames: Frames) -> None:
    for time, f in frames:
        places = f.places.astype(np.float64)
        times = np.full(len(f.ids), time)
        files.add_rows(f.ids.astype(np.int64), times, places[:, :2], places[:, 2], f.speeds.astype(np.float64))


def _motions(frames: Frames, crowd: Crowd) -> dict[int, tuple[float, Motion]]:
    """Everybody's motion, and when it begins."""
    starts: dict[int, float] = {}
    rows: dict[int, list[tuple[Array, Array]]] = {}
    for time, figures in frames:
        for k, number in enumerate(figures.ids.tolist()):
            starts.setdefault(number, time)
            rows.setdefault(number, []).append((figures.roots[k], figures.rotations[k]))
    out = {}
    for number, poses in rows.items():
        roots = np.array([root for root, _ in poses], np.float64)
        rotations = unpack_rotations(np.array([packed for _, packed in poses]))
        name = crowd.person(number).name
        out[number] = starts[number], filmed(roots, rotations, crowd.skeleton(number), crowd.frame_rate, name)
    return out
