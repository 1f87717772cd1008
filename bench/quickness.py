"""How quick are people, and how quick is a walker? One measure for both.

A recording and a walk go through the same analysis: contacts, gait, vehicle. Of the vehicle's speed or heading, the
time from 10 to 90 % of the change is taken.

    python bench/quickness.py DATABASE RECORDINGS_FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import stridecast as sc
from stridecast.analysis.take import analyse
from stridecast.synthesis.journey import PointStream, follow

RATE = 30.0

# What: takes that show it, quantity, from, to, and the stream that asks a walker for the same.
TASKS: dict[str, tuple[tuple[str, ...], str, float, float]] = {
    "turn 90 degrees at 1.4 m/s": (("16_27", "16_29"), "heading", 1.4, 90.0),
    "turn 90 degrees at 0.8 m/s": (("16_17", "16_19"), "heading", 0.8, 90.0),
    "standing to 1.0 m/s": (("16_31",), "speed", 0.0, 1.0),
    "1.0 m/s to standing": (("16_33",), "speed", 1.0, 0.0),
    "run 2.9 to 0.4 m/s": (("16_08",), "speed", 2.9, 0.4),
    "standing to 3.5 m/s": (("127_03",), "speed", 0.0, 3.5),
    "1.3 to 3.6 m/s": (("127_04", "16_55"), "speed", 1.3, 3.6),
}


def crossing_time(times: np.ndarray, values: np.ndarray, start: float, goal: float) -> float:
    """Seconds from the last moment below 10 % of the change to the first after it beyond 90 %."""
    share = (values - start) / (goal - start)
    beyond = np.flatnonzero(share >= 0.9)
    if len(beyond) == 0:
        return float("nan")
    last = int(beyond[0])
    below = np.flatnonzero(share[:last] <= 0.1)
    if len(below) == 0:
        return float("nan")
    first = int(below[-1])

    def cross(i: int, level: float) -> float:
        return float(np.interp(level, share[i : i + 2], times[i : i + 2]))

    return cross(last - 1, 0.9) - cross(first, 0.1)


def measure(motion: sc.Motion, quantity: str, start: float, goal: float) -> float:
    """Time of a change, from a motion of either kind."""
    vehicle = analyse(motion).vehicle
    times = np.arange(motion.frames) / motion.frame_rate
    if quantity == "speed":
        return crossing_time(times, vehicle.speeds, start, goal)
    # A turn goes from the heading it begins with to the one it ends with.
    part = max(3, motion.frames // 10)
    before, after = (float(np.median(h)) for h in (vehicle.headings[:part], vehicle.headings[-part:]))
    return crossing_time(times, vehicle.headings, before, after)


def stream_for(quantity: str, start: float, goal: float) -> tuple[PointStream, float]:
    """Points that ask for a change after four seconds, and when that is."""
    times = np.arange(0, 8, 1 / RATE)
    settled = 4.0
    late = times > settled

    def kind(speed: float) -> str:
        return "stand" if speed < 0.45 else "walk" if speed < 2.1 else "run"

    if quantity == "heading":
        speed = np.full(len(times), start)
        heading = np.where(late, np.radians(goal), 0.0)
        motions = ["walk"] * len(times)
    else:
        speed = np.where(late, goal, start)
        heading = np.zeros(len(times))
        motions = [kind(goal if x else start) for x in late]
    step = speed[:, None] * np.stack((np.sin(heading), np.cos(heading)), axis=-1) / RATE
    return PointStream(times=times, points=np.cumsum(step, axis=0), motions=tuple(motions)), settled


def main() -> int:
    """Print both times for each task; status 1 if the walker takes more than 1.3 times as long."""
    database = sc.load_database(sys.argv[1])
    files = {path.stem: path for path in sorted(Path(sys.argv[2]).rglob("*.amc"))}
    worst = 0.0
    print(f"{'change':30s} {'recorded':>16s} {'walker':>8s} {'ratio':>6s}")
    for name, (takes, quantity, start, goal) in TASKS.items():
        recorded = [measure(sc.load_motion(files[t]), quantity, start, goal) for t in takes if t in files]
        walked = walker_time(database, quantity, start, goal)
        ratio = walked / np.nanmax(recorded) if recorded else float("nan")
        worst = max(worst, ratio if np.isfinite(ratio) else np.inf)
        shown = ", ".join(f"{r:.2f}" for r in recorded)
        print(f"{name:30s} {shown:>14s} s {walked:6.2f} s {ratio:6.2f}")
    return int(worst > 1.3)


def walker_time(database: sc.MotionDatabase, quantity: str, start: float, goal: float) -> float:
    """The same measure on a walk; from a second before the change is asked for."""
    stream, settled = stream_for(quantity, start, goal)
    motion = follow(database, stream, heading=0.0).motion
    return measure(motion.clip(int((settled - 1.0) * RATE), motion.frames), quantity, start, goal)


if __name__ == "__main__":
    sys.exit(main())
