"""A minute of everything: whether feet stay, seams show, knees bend the right way and all keep above the floor.

    python bench/quality.py DATABASE [RECORDINGS_FOLDER]

The stream has a standing start, straight walking, a 90-degree turn, a circle, a reversal, a run, a stop and a trembling
hand. It is walked with everybody's examples and held to each person's named below. Recordings, where given, go through
the same measures.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import stridecast as sc
from stridecast.analysis.take import analyse
from stridecast.body import kinematics
from stridecast.scorecard.motion import knee_bends, seam_accelerations, toe_travel
from stridecast.synthesis.journey import Journey, PointStream, follow

SUBJECTS = (None, "16")
RATE = 30.0

# Seconds, speed (m/s), turning (rad/s), sudden turn at the beginning (rad), motion asked for, trembling hand (m).
COURSE = (
    (2.0, 0.0, 0.0, 0.0, "walk", 0.0),
    (6.0, 1.3, 0.0, 0.0, "walk", 0.0),
    (5.0, 1.4, 0.0, np.pi / 2, "walk", 0.0),
    (11.0, 1.3, 0.65, 0.0, "walk", 0.0),
    (6.0, 1.2, 0.0, np.pi, "walk", 0.0),
    (7.0, 3.0, 0.0, 0.0, "run", 0.0),
    (5.0, 3.0, 0.6, 0.0, "run", 0.0),
    (4.0, 0.0, 0.0, 0.0, "stand", 0.0),
    (10.0, 1.2, 0.1, 0.0, "walk", 0.01),
    (4.0, 0.0, 0.0, 0.0, "walk", 0.0),
)


def course() -> PointStream:
    """The minute as samples of a pointing device."""
    rng = np.random.default_rng(1)
    place, heading = np.zeros(2), 0.0
    points, motions = [], []
    for seconds, speed, turning, sudden, motion, tremble in COURSE:
        heading += sudden
        for _ in range(round(seconds * RATE)):
            heading += turning / RATE
            place = place + speed / RATE * np.array([np.sin(heading), np.cos(heading)])
            points.append(place + tremble * rng.normal(size=2))
            motions.append(motion)
    return PointStream(times=np.arange(len(points)) / RATE, points=np.array(points), motions=tuple(motions))


def millimetres(motion: sc.Motion, planted: np.ndarray) -> list[float]:
    """Travel of each planted toe in the middle of its contact."""
    return [way for way, _ in toe_travel(motion, planted)]


def report(journey: Journey) -> None:
    """Print the figures of one walk."""
    motion = journey.motion
    held = millimetres(motion, journey.planted)
    seen = millimetres(motion, analyse(motion).contacts.planted)
    near, elsewhere = seam_accelerations(
        motion, [i for i in range(1, motion.frames) if journey.groups[i] != journey.groups[i - 1]]
    )
    world = kinematics.pose(motion)
    lowest = min(world.positions[..., 1].min(), kinematics.ends(motion.skeleton, world)[..., 1].min())
    print(
        f"  planted toes travel, held contacts:     median {np.median(held):5.1f} mm, "
        f"95 % {np.percentile(held, 95):5.1f} mm ({len(held)})"
    )
    print(
        f"  planted toes travel, contacts as found: median {np.median(seen):5.1f} mm, "
        f"95 % {np.percentile(seen, 95):5.1f} mm ({len(seen)})"
    )
    print(
        f"  angular acceleration, 99 %: {near:.0f} near seams, {elsewhere:.0f} elsewhere, ratio {near / elsewhere:.2f}"
    )
    bends = knee_bends(motion)
    print(
        f"  knees bend {bends.min():.1f} to {bends.max():.0f} degrees; lowest point {1000 * lowest:.0f} mm; "
        f"made up {journey.made_up}"
    )


def main() -> None:
    """Walk the minute and print."""
    database = sc.load_database(sys.argv[1])
    for subject in SUBJECTS:
        if subject is None or subject in database.subjects:
            print(f"walker, {'everybody' if subject is None else 'subject ' + subject}")
            report(follow(database, course(), subject=subject))
    if len(sys.argv) > 2:
        people: dict[str, list[float]] = {"walk": [], "run": []}
        for path in sorted(Path(sys.argv[2]).rglob("*.amc")):
            try:
                take = analyse(sc.load_motion(path))
            except sc.InputError:
                continue
            kind = "run" if any(s.motion == "run" for s in take.gait.segments) else "walk"
            people[kind] += millimetres(take.motion, take.contacts.planted)
        for kind, found in people.items():
            print(
                f"recordings, {kind}: median {np.median(found):.1f} mm, "
                f"95 % {np.percentile(found, 95):.1f} mm ({len(found)})"
            )


if __name__ == "__main__":
    main()
