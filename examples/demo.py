"""A character walks, turns, runs and stops along a course: a walked BVH, its trace and a picture of it.

    python examples/demo.py [RECORDINGS...]

It moves like the sample person who comes with the package, or like the people of recordings of yours.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import stridecast as sc
from stridecast.cli.screen import progress
from stridecast.formats.picture import write_picture
from stridecast.formats.trace import write_trace
from stridecast.synthesis.journey import PointStream, follow

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
    database = learn([Path(argument) for argument in sys.argv[1:]])
    print(f"{len(database.groups)} groups of {len(database.examples.durations)} examples; walking the course")
    journey = follow(database, course())
    sc.write_bvh(OUT / "walk.bvh", journey.motion)
    write_trace(OUT / "trace.csv", journey)
    write_picture(OUT / "walk.png", journey, every=0.6)
    for name, what in (
        ("walk.png", "look at this first: the way from above, and poses along it"),
        ("walk.bvh", "opens in Blender and engines"),
        ("trace.csv", "every frame as a row"),
    ):
        print(f"wrote {OUT / name} ({what})")


def learn(sources: list[Path]) -> sc.MotionDatabase:
    """The sample database, which is learned once and then kept, or one of somebody's recordings."""
    words = {"make": "making sample takes", "read": "reading takes", "analyse": "analysing takes"}
    with progress(False, words | {"assemble": "learning bounds and groups"}) as tell:
        if not sources:
            print("learning from the sample person (recordings of yours: python examples/demo.py my_mocap/)")
            return sc.sample_database(progress=tell)
        print(f"learning from {', '.join(map(str, sources))}")
        return sc.build(sources, progress=tell)


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


if __name__ == "__main__":
    main()
