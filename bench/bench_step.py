"""How fast a walker steps: pytest bench --benchmark-only (or make bench).

The database is built from CMU recordings where they are at hand (STRIDECAST_MOCAP, or ../shared/mocap), else from
the person made of formulas that the tests use. KS07 reports more than 500 frames a second for one.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

import stridecast as sc
from stridecast.model.pose import VehicleState

HERE = Path(__file__).resolve().parent
TAKES = ("16_15", "16_17", "16_27", "16_31", "16_33", "16_35", "16_41", "16_08", "16_55", "127_04")


@pytest.fixture(scope="session")
def database() -> sc.MotionDatabase:
    folder = Path(os.environ.get("STRIDECAST_MOCAP", HERE.parent.parent / "shared" / "mocap"))
    found = [path for path in sorted(folder.rglob("*.amc")) if path.stem in TAKES] if folder.exists() else []
    if found:
        return sc.build(found)
    sys.path.insert(0, str(HERE.parent / "tests"))
    from databases import formula_database

    return formula_database()


@pytest.mark.parametrize("motion", ["walk", "run"])
def test_step_of_one_character(benchmark, database, motion):
    walker = sc.Walker(database)
    speed = {"walk": 1.3, "run": 3.2}[motion]
    frame = iter(range(10**9))

    def step():
        at = next(frame) * speed / 30
        walker.step((3.0 * np.sin(at / 3.0), at), motion=motion)

    for _ in range(200):
        step()
    benchmark(step)
    benchmark.extra_info["frames_per_second"] = round(1 / benchmark.stats["median"])


@pytest.mark.parametrize(("characters", "threads"), [(100, 1), (1000, 1), (1000, 2)])
def test_step_of_many_characters(benchmark, database, characters, threads):
    rng = np.random.default_rng(0)
    places, speeds = rng.uniform(-20, 20, (characters, 2)), rng.uniform(0.8, 1.7, characters)
    headings = rng.uniform(-np.pi, np.pi, characters)
    ahead = np.stack((np.sin(headings), np.cos(headings)), axis=-1)
    walkers = sc.Walkers(database, places, headings, threads=threads)
    frame = iter(range(10**9))

    def step():
        walkers.step(places + (next(frame) / 30 * speeds)[:, None] * ahead)

    for _ in range(60):
        step()
    benchmark(step)
    benchmark.extra_info["characters_per_second"] = round(characters / benchmark.stats["median"])


@pytest.mark.parametrize("driven_by", ["points", "vehicles"])
def test_step_of_a_batch(benchmark, database, driven_by):
    """Microseconds a character and frame of 256 who walk, turn and change their speed."""
    count = 256
    rng = np.random.default_rng(0)
    places, speeds = rng.uniform(-20, 20, (count, 2)), rng.uniform(0.2, 1.7, count)
    headings, turning = rng.uniform(-np.pi, np.pi, count), rng.uniform(-0.8, 0.8, count)
    walkers = sc.Walkers(database, places, headings)
    walks, zero = np.ones(count, int), np.zeros((count, 2))
    at, frame = places.copy(), iter(range(10**9))

    def step():
        nonlocal at
        now = headings + turning * next(frame) / 30
        velocity = speeds[:, None] * np.stack((np.sin(now), np.cos(now)), axis=-1)
        at = at + velocity / 30
        if driven_by == "points":
            walkers.step(at, motion=walks)
        else:
            vehicles = VehicleState(position=at, velocity=velocity, acceleration=zero, heading=now)
            walkers.step(vehicles=vehicles, motion=walks)

    for _ in range(60):
        step()
    benchmark(step)
    benchmark.extra_info["microseconds_per_character"] = round(1e6 * benchmark.stats["median"] / count, 2)
