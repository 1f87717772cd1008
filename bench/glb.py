"""How large and how slow GLB is against the bare numbers of the same motion, in one run.

    python bench/glb.py

The bare numbers are the places of the root and all rotations in single precision, written beside their place and
renamed as everything is. Both are written in turn, many times; told are the medians of their ratios. Limits: 1.1 times
the size, 5 times the time.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import stridecast as sc
from stridecast.formats.files import replacing
from stridecast.formats.glb import GlbCrowd, write_glb
from stridecast.synthesis.journey import follow, stream_along

LARGEST, SLOWEST = 1.1, 5.0
PEOPLE, ROUNDS = 100, 15


def main() -> None:
    """Write, compare, print; status 1 beyond a limit."""
    database = sc.sample_database()
    angles = np.linspace(0.0, 40 * np.pi, 2000)
    circles = 4.0 * np.column_stack((np.sin(angles), np.cos(angles)))
    walk = follow(database, stream_along(circles, 1.4)).motion
    steps = [walk.clip(10 * k, 10 * k + 900) for k in range(PEOPLE)]
    fine = True
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for name, motions, write in (
            ("one", [walk], lambda path: write_glb(path, walk)),
            ("compact", [walk], lambda path: write_glb(path, walk, compact=True)),
            ("crowd", steps, lambda path: _crowd(path, steps, compact=False)),
            ("compact crowd", steps, lambda path: _crowd(path, steps, compact=True)),
        ):
            sizes, times = _compare(place, lambda path, motions=motions: _bare(path, motions), write)
            frames = sum(motion.frames for motion in motions)
            print(f"{name:14} {frames:6} frames: {sizes:.3f} times the size, {times:.2f} times the time")
            fine = fine and sizes <= LARGEST and times <= SLOWEST
    sys.exit(0 if fine else 1)


def _compare(place: Path, bare: Callable[[Path], None], write: Callable[[Path], None]) -> tuple[float, float]:
    ratios = []
    for _ in range(ROUNDS):
        spent = []
        for name, work in (("bare", bare), ("glb", write)):
            began = time.perf_counter()
            work(place / name)
            spent.append(time.perf_counter() - began)
        ratios.append(spent[1] / spent[0])
    return (place / "glb").stat().st_size / (place / "bare").stat().st_size, float(np.median(ratios))


def _bare(path: Path, motions: list[sc.Motion]) -> None:
    with replacing(path) as file:
        for motion in motions:
            file.write(motion.root_positions.astype(np.float32).data)
            file.write(motion.rotations.astype(np.float32).data)


def _crowd(path: Path, motions: list[sc.Motion], *, compact: bool) -> None:
    scene = GlbCrowd(path, compact=compact)
    for number, motion in enumerate(motions):
        scene.add(motion, name=f"Person {number + 1}", start=0.1 * number)
    scene.save()


if __name__ == "__main__":
    main()
