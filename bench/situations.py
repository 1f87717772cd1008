"""Our crowds in the situations of the literature, over many seeds: who arrives, who is stuck, who touches whom.

    python bench/situations.py [--situations head_on,ring] [--seeds 200] [--jobs N] [--database DB] [--json OUT.json]

Vehicles without bodies. A run ends when everybody has left, or at 180 s, and who is then still there is counted. The
ring is walked for 60 s at densities from 0.25 to 2 people per square metre; its mean speed stands beside Weidmann's.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import stridecast as sc
from crowd import way
from stridecast.crowd.crowd import Crowd
from stridecast.errors import StridecastError
from stridecast.model.database import MotionDatabase
from stridecast.model.trajectories import Trajectories
from stridecast.samples.situations import SITUATIONS, situation
from stridecast.scorecard.crowds import score_crowd
from stridecast.scorecard.density import weidmann

LONGEST = 180.0
"""A run ends then, seconds."""

RING_SECONDS, RING_SETTLES = 60.0, 15.0
"""The ring is walked for so long, and its speed measured after so long, seconds."""

DENSITIES = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
"""Of the ring, people per square metre."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """One run."""

    name: str
    seed: int
    density: float | None = None

    @property
    def title(self) -> str:
        """The situation, and its density where it has one."""
        return self.name if self.density is None else f"{self.name} {self.density:g}"


def run(task: Task, database: MotionDatabase) -> Row:
    """Walk a situation once, and judge it."""
    scene = situation(task.name, task.seed, **({} if task.density is None else {"density": task.density}))
    begun = time.perf_counter()
    crowd = Crowd(database, scene, bodies=False)
    ids, times, places, speeds = [], [], [], []
    longest = LONGEST if task.density is None else RING_SECONDS
    frame = crowd.frame()
    while True:
        ids.append(frame.ids)
        times.append(np.full(len(frame.ids), frame.time))
        places.append(frame.positions)
        if frame.time >= RING_SETTLES:
            speeds.append(np.linalg.norm(frame.velocities, axis=-1))
        if crowd.done or frame.time >= longest - 1e-9:
            break
        frame = crowd.step()
    took = time.perf_counter() - begun
    who, when, where = np.concatenate(ids), np.concatenate(times), np.concatenate(places)
    order = np.lexsort((when, who))
    people = dict(enumerate(crowd.came, start=1))
    judged_ways = task.density is None
    ways = {k: way(scene, person) for k, person in people.items()} if judged_ways else {}
    score = score_crowd(
        Trajectories(ids=who[order], times=when[order], positions=where[order], name=task.title),
        radius={k: person.behavior.body_radius for k, person in people.items()},
        scene=scene,
        bounds=crowd.bounds,
        free_speeds={k: person.behavior.velocity for k, person in people.items()},
        goals={k: person.stops for k, person in people.items()} if judged_ways else None,
        ways={k: length for k, length in ways.items() if length},
    )
    moved = score.travel.walked.sum() / max(score.travel.seconds.sum(), 1e-9)
    if task.density is not None:
        moved = float(np.concatenate(speeds).mean())
    beyond = score.violations or {}
    return {
        "situation": task.title,
        "seed": task.seed,
        "people": len(people),
        "arrived": len(crowd.left),
        "left_over": len(people) - len(crowd.left) + crowd.waiting
        if judged_ways
        else 0,  # nobody has to leave the ring
        "deadlocks": len(score.deadlocks),
        "overlaps": score.overlaps.pairs,
        "overlap_depth": score.overlaps.depth,
        "solid_overlaps": score.solid_overlaps.pairs,
        "violations": {kind: found.count for kind, found in beyond.items()},
        "against_alone": score.travel.against_alone.tolist() if judged_ways else [],
        "detour": score.travel.detours.tolist() if judged_ways else [],
        "mean_speed": float(moved),
        "weidmann": None if task.density is None else float(weidmann(np.array(task.density))),
        "acceleration_99": score.smoothness.acceleration_99,
        "seconds": frame.time,
        "took": took,
    }


def tasks(names: list[str], seeds: int) -> list[Task]:
    """All runs, those of one situation after the other."""
    return [
        Task(name, seed, density)
        for name in names
        for density in (DENSITIES if name == "ring" else (None,))
        for seed in range(seeds)
    ]


def together(rows: list[Row]) -> Row:
    """What all runs of one situation come to."""

    def spread(key: str, share: float) -> float | None:
        values = np.concatenate([row[key] for row in rows])
        return float(np.percentile(values, share)) if len(values) else None

    went = [row for row in rows if "error" not in row]
    failed = [row for row in rows if "error" in row]
    if not went:
        return {"situation": rows[0]["situation"], "runs": len(rows), "failed": len(failed)}
    rows = went
    out: Row = {
        "situation": rows[0]["situation"],
        "runs": len(went) + len(failed),
        "failed": len(failed),
        "worst_seeds": [row["seed"] for row in sorted(rows, key=lambda r: -r["left_over"]) if row["left_over"]][:5],
    }
    for key in ("people", "arrived", "left_over", "deadlocks", "overlaps", "solid_overlaps"):
        out[key] = sum(row[key] for row in rows)
    out["runs_not_done"] = sum(row["left_over"] > 0 for row in rows)
    out["overlap_depth"] = max(row["overlap_depth"] for row in rows)
    out["violations"] = {kind: sum(row["violations"][kind] for row in rows) for kind in rows[0]["violations"]}
    out["against_alone"], out["against_alone_95"] = spread("against_alone", 50), spread("against_alone", 95)
    out["detour"] = spread("detour", 50)
    for key in ("mean_speed", "acceleration_99", "seconds", "took"):
        out[key] = float(np.mean([row[key] for row in rows]))
    out["weidmann"] = rows[0]["weidmann"]
    return out


def _number(key: str, digits: int = 2) -> Callable[[Row], str]:
    return lambda row: "-" if row.get(key) is None else f"{row[key]:.{digits}f}"


COLUMNS: dict[str, Callable[[Row], str]] = {
    "runs": lambda r: f"{r['runs']}" + (f" ({r['failed']} fail)" if r["failed"] else ""),
    "people": lambda r: f"{r['people']}",
    "arrived": lambda r: f"{r['arrived']}",
    "left": lambda r: f"{r['left_over']}",
    "in runs": lambda r: f"{r['runs_not_done']}",
    "stuck": lambda r: f"{r['deadlocks']}",
    "overlaps": lambda r: f"{r['overlaps']}",
    "walls": lambda r: f"{r['solid_overlaps']}",
    "beyond": lambda r: f"{sum(r['violations'].values())}",
    "time": _number("against_alone"),
    "95 %": _number("against_alone_95"),
    "way": _number("detour"),
    "a 99 %": _number("acceleration_99", 1),
    "m/s": _number("mean_speed"),
    "Weidm.": _number("weidmann"),
    "ends, s": _number("seconds", 0),
    "took, s": _number("took"),
}
"""Of all runs of a situation: who is left in how many runs; deadlocks; pairs in each other and in walls; samples beyond
human bounds; median and 95 % of the time against alone; way against straight; 99 % of accelerations; mean speed."""


def lines(all_rows: list[Row]) -> list[str]:
    """The table."""
    out = [f"{'':14s}{''.join(f'{name:>9s}' for name in COLUMNS)}"]
    for row in all_rows:
        cells = "".join(f"{column(row):>9s}" for column in COLUMNS.values()) if "people" in row else "  all fail"
        out.append(f"{row['situation']:14s}{cells}")
    return out


_database: list[MotionDatabase] = []


def _prepare(path: str | None) -> None:
    """Let a process know the database."""
    _database[:] = [sc.load_database(path) if path else sc.sample_database()]


def _run(task: Task) -> Row:
    try:
        return run(task, _database[0])
    except StridecastError as error:  # one run that cannot be is told, and the others go on
        return {"situation": task.title, "seed": task.seed, "error": f"{type(error).__name__}: {error}"}


def main() -> int:
    """Run everything in parallel, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--situations", default=",".join(SITUATIONS), help="which of them")
    parser.add_argument("--seeds", type=int, default=200, help="so many of each")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--database", help="whose bounds; the sample database if left out")
    parser.add_argument("--json", type=Path, help="writes all measures")
    wish = parser.parse_args()
    names = wish.situations.split(",")
    unknown = [name for name in names if name not in SITUATIONS]
    if unknown:
        parser.error(f"there is no situation {unknown[0]!r}; there are {', '.join(SITUATIONS)}")
    _prepare(wish.database)  # made once, not once a process
    todo = tasks(names, wish.seeds)
    rows: dict[Task, Row] = {}
    begun = time.perf_counter()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(wish.jobs, mp_context=context, initializer=_prepare, initargs=(wish.database,)) as pool:
        waiting = {pool.submit(_run, task): task for task in todo}
        for done in as_completed(waiting):
            task, row = waiting[done], done.result()
            rows[task] = row
            left = (time.perf_counter() - begun) / len(rows) * (len(todo) - len(rows))
            told = row.get("error") or (f"{row['left_over']} left" if row["left_over"] else "")
            if told or sys.stderr.isatty() or len(rows) % max(len(todo) // 20, 1) == 0:
                what = f"{task.title}, seed {task.seed}: {told or 'done'}"
                print(f"{len(rows)} of {len(todo)}, about {left:.0f} s more; {what}", file=sys.stderr, flush=True)
    sums = [
        together([rows[t] for t in todo if t.title == title]) for title in dict.fromkeys(task.title for task in todo)
    ]
    print("\n".join(lines(sums)))
    if wish.json:
        wish.json.write_text(json.dumps({"situations": sums, "runs": [rows[task] for task in todo]}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
