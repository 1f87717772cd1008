"""Does the pelvis of a walker sway, bounce and turn as people's do at that speed? One measure for both.

Every recording that goes straight ahead at an even speed, and a walker asked for that speed, go through the same
analysis.

    python bench/naturalness.py DATABASE RECORDINGS_FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import stridecast as sc
from stridecast.analysis.take import TakeAnalysis, analyse
from stridecast.geometry import quaternions as quat
from stridecast.synthesis.journey import follow, stream_along

SPEEDS = {"walk": (0.8, 1.0, 1.2, 1.4, 1.7), "run": (2.5, 3.0, 3.5, 4.0)}
NEAR = 0.15
NAMES = ("speed m/s", "cadence 1/min", "step m", "sway mm", "bounce mm", "yaw deg", "knee range deg")


def measures(analysis: TakeAnalysis) -> np.ndarray | None:
    """Speed, cadence, step length, and peak-to-peak sway, bounce, yaw and knee bend of whole half cycles."""
    halves = [s for s in analysis.gait.segments if s.motion in ("walk", "run")]
    if len(halves) < 3:
        return None
    frames = slice(halves[0].start.frame, halves[-1].stop.frame + 1)
    rate = analysis.motion.frame_rate
    seconds = (frames.stop - 1 - frames.start) / rate
    speed = float(analysis.vehicle.speeds[frames].mean())
    details = analysis.details
    knee = analysis.motion.rotations[frames, analysis.motion.skeleton.joint("left_shin")]
    bend = np.degrees(np.linalg.norm(quat.log(knee), axis=-1))
    sway, bounce = details.displacements[frames, 0], details.displacements[frames, 1]
    yaw = np.degrees(details.yaws[frames])
    # Peak to peak within each full cycle, then the mean: slow drift is no sway.
    edges = [s.start.frame - frames.start for s in halves] + [frames.stop - 1 - frames.start]
    cycles = list(zip(edges[:-2], edges[2:], strict=True))
    spans = [np.mean([np.ptp(x[a : b + 1]) for a, b in cycles]) for x in (sway, bounce, yaw, bend)]
    cadence = len(halves) / seconds
    return np.array([speed, 60 * cadence, speed / cadence, 1000 * spans[0], 1000 * spans[1], spans[2], spans[3]])


def recorded(folder: Path, database: sc.MotionDatabase) -> dict[str, list[np.ndarray]]:
    """Measures of all straight and even recordings, by motion."""
    out: dict[str, list[np.ndarray]] = {"walk": [], "run": []}
    for path in sorted(folder.rglob("*.amc")) + sorted(folder.rglob("*.bvh")):
        try:
            analysis = analyse(sc.load_motion(path), database.skeleton)
        except sc.InputError:
            continue
        vehicle = analysis.vehicle
        if np.ptp(vehicle.headings) > 0.35 or np.ptp(vehicle.speeds) > 0.5 or analysis.contacts.standing.any():
            continue
        found = measures(analysis)
        if found is not None:
            out["run" if any(s.motion == "run" for s in analysis.gait.segments) else "walk"].append(found)
    return out


def walked(database: sc.MotionDatabase, motion: str, speed: float) -> np.ndarray | None:
    """Measures of a walker on a straight line."""
    line = np.array([[0.0, 0.0], [0.0, 16 * speed]])
    journey = follow(database, stream_along(line, speed, motion=motion))
    rate = int(journey.motion.frame_rate)
    return measures(analyse(journey.motion.clip(6 * rate, 15 * rate)))


def main() -> None:
    """Print what recordings and walker show, side by side."""
    database = sc.load_database(sys.argv[1])
    people = recorded(Path(sys.argv[2]), database)
    print(f"{'':22s}" + "".join(f"{name:>16s}" for name in NAMES))
    for motion, speeds in SPEEDS.items():
        for speed in speeds:
            near = [m for m in people[motion] if abs(m[0] - speed) < NEAR]
            if near:
                low, high = np.min(near, axis=0), np.max(near, axis=0)
                print(
                    f"{motion} {speed} recorded ({len(near):2d})"
                    + "".join(f"{a:8.1f}-{b:<7.1f}" for a, b in zip(low, high, strict=True))
                )
            found = walked(database, motion, speed)
            if found is not None:
                print(f"{motion} {speed} walker       " + "".join(f"{v:16.2f}" for v in found))


if __name__ == "__main__":
    main()
