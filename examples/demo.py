"""Recordings in, a character that follows a course out: a database, a walked BVH, its trace and a picture of it.

    python examples/demo.py [RECORDINGS...]

Without recordings of yours it takes some of CMU's, if a folder of them lies where STRIDECAST_MOCAP says or beside this
project in ../shared/mocap. Where there are none, it learns from a person made of formulas: everything works, but nobody
will take that for a human walk.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

import stridecast as sc
from stridecast.formats.picture import write_picture
from stridecast.formats.trace import write_trace
from stridecast.synthesis.journey import PointStream, follow

HERE = Path(__file__).resolve().parent
SUBJECTS = {
    16: (8, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31, 33, 35, 37, 41, 55, 58),
    127: (3, 4, 5, 17),
}
TAKES = [f"{subject}_{take:02d}" for subject, takes in SUBJECTS.items() for take in takes]
OUT = Path("demo")

# What the point does: seconds, speed (m/s), turning (rad/s), motion asked for.
COURSE = (
    (0.6, 0.0, 0.0, "stand"),
    (2.6, 1.3, 0.0, "walk"),
    (1.3, 1.3, 1.2, "walk"),
    (1.5, 1.3, 0.0, "walk"),
    (1.2, 3.2, 0.0, "run"),
    (1.6, 3.2, 1.1, "run"),
    (1.4, 3.2, 0.0, "run"),
    (2.5, 0.0, 0.0, "stand"),
)


def main() -> None:
    OUT.mkdir(exist_ok=True)
    sources = [Path(argument) for argument in sys.argv[1:]] or recordings() or formulas(OUT / "formulas")
    print(f"learning from {len(sources)} file(s) or folder(s), the first is {sources[0]}")
    database = sc.build(sources)
    sc.save_database(database, OUT / "database.safetensors")
    print(f"{len(database.groups)} groups of {len(database.examples.durations)} examples; walking the course")
    journey = follow(database, course())
    sc.write_bvh(OUT / "walk.bvh", journey.motion)
    write_trace(OUT / "trace.csv", journey)
    write_picture(OUT / "walk.png", journey, every=0.6)
    for name in ("database.safetensors", "walk.bvh", "trace.csv", "walk.png"):
        print(f"wrote {OUT / name}")


def course(rate: float = 30.0) -> PointStream:
    """Straight on, round a bend, into a run, round another bend, and to a stop."""
    place, heading = np.zeros(2), 0.0
    points, motions = [], []
    for seconds, speed, turning, motion in COURSE:
        for _ in range(round(seconds * rate)):
            heading += turning / rate
            place = place + speed / rate * np.array([np.sin(heading), np.cos(heading)])
            points.append(place)
            motions.append(motion)
    return PointStream(times=np.arange(len(points)) / rate, points=np.array(points), motions=tuple(motions))


def recordings() -> list[Path]:
    """Some of CMU's recordings, if they are at hand."""
    places = [os.environ.get("STRIDECAST_MOCAP"), HERE.parent.parent / "shared" / "mocap"]
    for place in places:
        found = [p for p in sorted(Path(place).rglob("*.amc")) if p.stem in TAKES] if place else []
        if found:
            return found
    return []


def formulas(folder: Path) -> list[Path]:
    """Recordings of a person made of formulas, as BVH files."""
    sys.path.insert(0, str(HERE.parent / "tests"))
    from synthetic_gait import gait, ramps

    folder.mkdir(parents=True, exist_ok=True)
    takes = {
        f"walk_{speed}_{bend}": gait(np.full(300, speed), curvature=bend)
        for speed in (0.7, 1.0, 1.3, 1.6)
        for bend in (-0.5, 0.0, 0.5)
    }
    takes |= {
        f"run_{speed}_{bend}": gait(np.full(240, speed), curvature=bend)
        for speed in (2.6, 3.2, 3.8)
        for bend in (-0.25, 0.0, 0.25)
    }
    takes["start_and_stop"] = gait(ramps((1.5, 0.0), (3.0, 1.2), (1.5, 0.0)))
    takes["to_run_and_stop"] = gait(ramps((1.5, 0.0), (2.0, 1.4), (3.0, 3.2), (2.0, 1.4), (1.5, 0.0)))
    for name, take in takes.items():
        sc.write_bvh(folder / f"{name}.bvh", take.motion)
    return [folder]


if __name__ == "__main__":
    main()
