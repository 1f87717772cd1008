"""How fast a take is loaded and understood, and a database made of it: pytest bench --benchmark-only (or make bench).

Recordings are those of CMU where they are at hand (STRIDECAST_MOCAP, or ../shared/mocap), else BVH files of a person
made of formulas. ``frames_per_second`` counts the frames of the recording.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

import stridecast as sc
from stridecast.analysis.take import analyse
from stridecast.body.mirroring import mirror
from stridecast.database.assembly import AnalysedTake, assemble
from stridecast.model.database import Take

HERE = Path(__file__).resolve().parent


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk of about four seconds, 120 frames a second."""
    folder = Path(os.environ.get("STRIDECAST_MOCAP", HERE.parent.parent / "shared" / "mocap"))
    found = sorted(folder.rglob("16_15.amc"))
    if found:
        return found[0]
    sys.path.insert(0, str(HERE.parent / "tests"))
    from synthetic_gait import gait, ramps

    path = tmp_path_factory.mktemp("bench") / "walk.bvh"
    sc.write_bvh(path, gait(ramps((1.0, 0.0), (2.0, 1.3), rate=120.0), rate=120.0).motion)
    return path


def per_second(benchmark, frames: int) -> None:
    if benchmark.stats is not None:  # none where benchmarks are switched off
        benchmark.extra_info["frames_per_second"] = round(frames / benchmark.stats["median"])


def test_load(benchmark, recording):
    motion = benchmark(sc.load_motion, recording)
    per_second(benchmark, motion.frames)


def test_analyse(benchmark, recording):
    motion = sc.load_motion(recording)
    benchmark(analyse, motion)
    per_second(benchmark, motion.frames)


def test_mirror(benchmark, recording):
    motion = sc.load_motion(recording)
    benchmark(mirror, motion)
    per_second(benchmark, motion.frames)


def test_assemble(benchmark, recording):
    motion = sc.load_motion(recording)
    understood = [analyse(motion), analyse(mirror(motion))]
    analysed = [AnalysedTake(analysis=a, take=0, mirrored=bool(i)) for i, a in enumerate(understood)]
    take = Take(
        name=motion.name,
        subject=motion.subject,
        file=recording.name,
        sha256="",
        seconds=motion.seconds,
        covered=motion.seconds,
        segments=0,
    )
    benchmark(assemble, analysed, [take])
    per_second(benchmark, 2 * motion.frames)
