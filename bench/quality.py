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
from stridecast.geometry import quaternions as quat
from stridecast.geometry import signals
from stridecast.model.contacts import SIDES
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


def toe_travel(motion: sc.Motion, planted: np.ndarray) -> list[float]:
    """Millimetres that each planted toe travels on the ground in the middle 60 % of its contact."""
    positions = kinematics.pose(motion).positions
    out = []
    for side, name in enumerate(SIDES):
        toe = positions[:, motion.skeleton.joint(f"{name}_toe")][:, [0, 2]]
        for value, start, stop in signals.runs(planted[:, side]):
            length = stop - start
            if value and 0.12 < length / motion.frame_rate < 2.0 and start > 0 and stop < motion.frames:
                middle = toe[start + round(0.2 * length) : stop - round(0.2 * length)]
                out.append(1000 * float(np.linalg.norm(np.diff(middle, axis=0), axis=-1).sum()))
    return out


def seams(journey: Journey) -> tuple[float, float]:
    """99th percentile of the joints' angular acceleration within 0.1 s of seams and elsewhere, rad/s2."""
    motion = journey.motion
    turning = quat.angular_velocity(motion.rotations, motion.frame_rate)
    acceleration = np.linalg.norm(np.gradient(turning, 1 / motion.frame_rate, axis=0), axis=-1)
    acceleration = acceleration[:, list(motion.skeleton.roles.values())]
    changes = [i for i in range(1, motion.frames) if journey.groups[i] != journey.groups[i - 1]]
    near = np.zeros(motion.frames, bool)
    reach = round(0.1 * motion.frame_rate)
    for i in changes:
        near[max(0, i - reach) : i + reach + 1] = True
    return float(np.percentile(acceleration[near], 99)), float(np.percentile(acceleration[~near], 99))


def knee_bends(motion: sc.Motion) -> np.ndarray:
    """Signed bend of both knees at every frame, degrees: the leg's plane seen along the knee's mean axis."""
    positions = kinematics.pose(motion).positions
    turned = kinematics.pose(motion).rotations
    out = []
    for side in SIDES:
        thigh, shin, foot = motion.skeleton.chain(f"{side}_thigh", f"{side}_shin", f"{side}_foot")
        down, on = positions[:, shin] - positions[:, thigh], positions[:, foot] - positions[:, shin]
        axis = quat.log(motion.rotations[:, shin]).mean(axis=0)
        hinge = quat.rotate(turned[:, shin], axis / np.linalg.norm(axis))
        cross = np.cross(down, on)
        sine = np.linalg.norm(cross, axis=-1) * np.sign(np.sum(cross * hinge, axis=-1))
        out.append(np.degrees(np.arctan2(sine, np.sum(down * on, axis=-1))))
    return np.array(out)


def report(journey: Journey) -> None:
    """Print the figures of one walk."""
    motion = journey.motion
    held = toe_travel(motion, journey.planted)
    seen = toe_travel(motion, analyse(motion).contacts.planted)
    near, elsewhere = seams(journey)
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
            people[kind] += toe_travel(take.motion, take.contacts.planted)
        for kind, found in people.items():
            print(
                f"recordings, {kind}: median {np.median(found):.1f} mm, "
                f"95 % {np.percentile(found, 95):.1f} mm ({len(found)})"
            )


if __name__ == "__main__":
    main()
