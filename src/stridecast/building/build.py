"""Recordings to a motion database, in one column of stages."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from stridecast.analysis.bounds import METHODS
from stridecast.building import entries
from stridecast.building.bench import Bench, Progress
from stridecast.building.cache import TakeCache, key_of
from stridecast.building.processes import Failure, Workers, attempt
from stridecast.building.selection import body_of_most_seconds, said_twice
from stridecast.building.sources import FileSource, MotionSource, Source, collect, sha256_of_file
from stridecast.building.stages import (
    AnalysisTask,
    Reading,
    ReadTask,
    Recording,
    Understood,
    read,
    take_up,
    understand,
)
from stridecast.database.assembly import AnalysedTake, assemble
from stridecast.errors import InputError, TakeError
from stridecast.formats.recordings import load_skeleton
from stridecast.formats.smpl import read_body_model
from stridecast.formats.store import as_stored
from stridecast.formats.tensors import pack_skeleton
from stridecast.model.database import MotionDatabase, Take
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Result = TypeVar("Result")

STAGES = ("read", "analyse", "assemble")
"""What ``progress`` is told about, in this order."""

REASONS_SHOWN = 5
"""So many reasons are told when no take can be used."""


def build(
    sources: str | Path | Motion | Iterable[str | Path | Motion],
    *,
    skeleton: Skeleton | str | Path | None = None,
    frame_rate: float = 30.0,
    mirror: bool = True,
    bounds: str = "balanced",
    jobs: int | None = None,
    roles: Mapping[str, str] | None = None,
    scale: float | None = None,
    input_rate: float | None = None,
    body_model: str | Path | None = None,
    cache: bool = True,
    progress: Progress | None = None,
) -> MotionDatabase:
    """Learn a motion database from recordings.

    Parameters
    ----------
    sources
        Files and folders (searched to the bottom): BVH, AMC with its ASF, AMASS, C3D. Motions in memory go the same
        way; in the database and in messages their names stand in place of a file.
    skeleton
        Body that all motion is carried over to: a skeleton, or a BVH or ASF file. Left out: the body of the person with
        the most seconds.
    frame_rate
        Frames a second of what will be synthesised, 10 to 240.
    mirror
        Learn from every take's mirror image too.
    bounds
        How bounds are learned, ``balanced`` or ``paper`` (the plain percentile of KS07).
    jobs
        Processes at work, one a core if left out; 1 works in this process. The result does not depend on it.
    roles, scale
        As of ``load_motion``, for all files; a motion in memory is as it is.
    input_rate
        Frames a second of files that do not say (AMC), 120 if left out.
    body_model
        As of ``load_motion``, for all AMASS files.
    cache
        Remember what was found out about each take, so that the next build is faster.
    progress
        Called with a stage of ``STAGES``, how much of it is done, and how much there is; not for a stage with nothing
        to do.

    Returns
    -------
    MotionDatabase
        Exactly as it comes back once it is saved and loaded. It lists the takes that could not be used with the reason.

    Raises
    ------
    InputError
        No source, a source that does not exist or holds no recording, or an option that is none.
    FileError, SkeletonError
        A ``skeleton`` that cannot be read or lacks joints of the legs, or a ``body_model`` that is none.
    TakeError
        No take could be used; the message gives the first reasons.
    """
    _check_options(frame_rate, bounds, jobs, scale, input_rate)
    body = _load_body(skeleton, roles, scale)
    if body_model is not None:
        read_body_model(body_model, np.zeros(0))  # said once, not with every take
    reading = Reading(
        roles=None if roles is None else dict(roles),
        scale=scale,
        input_rate=input_rate,
        body_model=None if body_model is None else Path(body_model),
    )
    offered = collect([sources] if isinstance(sources, str | Path | Motion) else sources)
    with Workers(jobs or os.cpu_count() or 1) as workers:
        bench = Bench(workers=workers, cache=TakeCache.of_user() if cache else TakeCache(None), progress=progress)
        recordings, left_out = _parted(_read_all(bench, offered, reading))
        left_out |= said_twice(offered, recordings)
        used = {i: recording for i, recording in recordings.items() if i not in left_out}
        body = body or (body_of_most_seconds(list(used.values())) if used else None)
        if body is None:
            raise TakeError(_nothing(offered, left_out))
        understood, refused = _parted(_understand_all(bench, offered, used, reading, body, mirror))
        left_out |= refused
        if not understood:
            raise TakeError(_nothing(offered, left_out))
    bench.tell("assemble", 0, 1)
    takes = [
        _account(source, recordings.get(i), understood.get(i), left_out.get(i)) for i, source in enumerate(offered)
    ]
    with threadpool_limits(1):
        database = assemble(_both(understood), takes, frame_rate=float(frame_rate), bounds_method=bounds)
    bench.cache.trim()
    bench.tell("assemble", 1, 1)
    return as_stored(replace(database, skeleton=body))


def _check_options(
    frame_rate: float, bounds: str, jobs: int | None, scale: float | None, input_rate: float | None
) -> None:
    if not 10 <= frame_rate <= 240:
        raise InputError(f"the frame rate must lie between 10 and 240 Hz, not at {frame_rate}")
    if bounds not in METHODS:
        raise InputError(f"there is no way {bounds!r} to learn bounds; there are {', '.join(METHODS)}")
    if jobs is not None and jobs < 1:
        raise InputError(f"there must be at least 1 job, not {jobs}")
    for name, value in (("scale", scale), ("input rate", input_rate)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"the {name} must be a positive number, not {value}")


def _load_body(
    skeleton: Skeleton | str | Path | None, roles: Mapping[str, str] | None, scale: float | None
) -> Skeleton | None:
    if skeleton is None:
        return None
    body = skeleton if isinstance(skeleton, Skeleton) else load_skeleton(skeleton, roles=roles, scale=scale)
    body.require_roles()
    return body


def _read_all(bench: Bench, sources: Sequence[Source], reading: Reading) -> dict[int, Recording | Failure]:
    """Read every file, and take up the motions in memory, which come after them."""
    files = [source for source in sources if isinstance(source, FileSource)]
    tasks = [ReadTask(path=file.path, reading=reading) for file in files]
    keys = [_key("read", file, reading) for file in files]
    results = bench.do("read", read, tasks, keys, entries.pack_recording, entries.unpack_recording)
    results += [attempt(take_up, source.motion) for source in sources if isinstance(source, MotionSource)]
    return dict(enumerate(results))


def _understand_all(
    bench: Bench,
    sources: Sequence[Source],
    used: Mapping[int, Recording],
    reading: Reading,
    body: Skeleton,
    mirror: bool,
) -> dict[int, Understood | Failure]:
    """Analyse every take that is used on the database's body, and its mirror image."""
    tasks = [
        AnalysisTask(motion=_motion_of(sources[i], recording, reading), skeleton=body, mirror=mirror)
        for i, recording in used.items()
    ]
    header, arrays = pack_skeleton(body)
    shape = json.dumps([header, {name: array.tolist() for name, array in arrays.items()}], sort_keys=True)
    keys = [_key("analyse", sources[i], reading, body=shape, mirror=mirror) for i in used]
    results = bench.do(
        "analyse",
        understand,
        tasks,
        keys,
        entries.pack_understood,
        lambda entry: entries.unpack_understood(entry, body),
    )
    return dict(zip(used, results, strict=True))


def _motion_of(source: Source, recording: Recording, reading: Reading) -> Motion | ReadTask:
    """Find the motion of a take, or how to read it."""
    if isinstance(source, MotionSource):
        return source.motion
    return recording.motion or ReadTask(path=source.path, reading=reading)


def _key(stage: str, source: Source, reading: Reading, **more: object) -> str:
    """Name under which a result is remembered."""
    options: dict[str, object] = {"roles": reading.roles, "scale": reading.scale, "input_rate": reading.input_rate}
    options["body_model"] = "" if reading.body_model is None else sha256_of_file(reading.body_model)
    told = {"sha256": source.sha256, "companions": source.companions, "place": source.place}
    return key_of(stage=stage, **told, **options, **more)


def _parted(results: Mapping[int, Result | Failure]) -> tuple[dict[int, Result], dict[int, str]]:
    """Part results from the reasons of failures."""
    good = {i: result for i, result in results.items() if not isinstance(result, Failure)}
    return good, {i: result.reason for i, result in results.items() if isinstance(result, Failure)}


def _both(understood: Mapping[int, Understood]) -> list[AnalysedTake]:
    """List all analyses, each take's followed by that of its mirror image."""
    out = []
    for i, take in sorted(understood.items()):
        out.append(AnalysedTake(analysis=take.analysis, take=i))
        if take.mirrored is not None:
            out.append(AnalysedTake(analysis=take.mirrored, take=i, mirrored=True))
    return out


def _account(source: Source, recording: Recording | None, understood: Understood | None, reason: str | None) -> Take:
    """Say what became of a take; how many segments were used is filled in by ``assemble``."""
    covered = 0.0
    if understood is not None:
        covered = (len(understood.analysis.vehicle.positions) - 1) / understood.analysis.motion.frame_rate
    return Take(
        name=recording.name if recording else source.name,
        subject=recording.subject if recording else "",
        file=source.shown,
        sha256=source.sha256,
        seconds=recording.seconds if recording else 0.0,
        covered=covered,
        segments=0,
        left_out=() if reason is None else (reason,),
        notes=(recording.notes if recording else ()) + (understood.notes if understood else ()),
    )


def _nothing(sources: Sequence[Source], left_out: Mapping[int, str]) -> str:
    reasons = [f"{sources[i].shown}: {reason}" for i, reason in sorted(left_out.items())]
    more = [f"and {len(reasons) - REASONS_SHOWN} more"] if len(reasons) > REASONS_SHOWN else []
    return "\n  ".join(["no take could be used:", *reasons[:REASONS_SHOWN], *more])
