"""Do the sample person, and a walker that learned from it, move as people do at that speed? One measure for all.

    python bench/gait.py RECORDINGS... [--leave-out TAKE...] [--database FILE]

Every stride of the recordings that goes straight ahead at an even speed, the sample person and a walker on straight
lines at even speeds: all are carried over to the skeleton of the sample person and go through the same analysis. What a
database of one's own makes a walker do is seen with ``--database``. Without recordings the figures stand alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

import stridecast as sc
from stridecast.analysis.take import TakeAnalysis, analyse
from stridecast.body import kinematics
from stridecast.building.sources import FileSource, collect
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.samples.adult import adult
from stridecast.samples.performance import perform
from stridecast.synthesis.journey import follow, stream_along

MEASURES = (
    ("cadence", "1/min", "steps a minute"),
    ("step", "m", "length of a step, m"),
    ("width", "mm", "width of a step, mm"),
    ("sway", "mm", "pelvis side to side, mm"),
    ("bounce", "mm", "pelvis up and down, mm"),
    ("yaw", "deg", "pelvis turns, degrees"),
    ("knee", "deg", "knee bends, degrees"),
    ("hip", "deg", "hip bends, degrees"),
    ("arm", "deg", "upper arm swings, degrees"),
    ("duty", "%", "share of time a foot stands, %"),
)
"""Name, unit and title. The pelvis is seen from the vehicle, the thigh from the pelvis; what goes to and fro is told
from peak to peak."""

BINS = {"walk": np.arange(0.6, 2.05, 0.2), "run": np.arange(2.0, 4.55, 0.5)}
"""Edges of the bins of speed, m/s."""

ASKED = {"walk": np.arange(0.6, 2.01, 0.1), "run": np.arange(2.0, 4.51, 0.125)}
"""Speeds that sample person and walker go, m/s."""

STRAIGHT = 0.1
"""A straight stride turns by no more, radians, ..."""

STEADY = 0.1
"""... a steady one changes its speed by no more than this share of it."""

EVEN = 0.06
"""The feet pass the middle of a stride within this share of it; where they do not, an event was missed."""

SECONDS = 16.0
"""So long sample person and walker go at each speed."""

LIKENED = 2
"""Strides of fewer people have no spread."""


@dataclass(frozen=True)
class Stride:
    """From mid-stance to mid-stance of a foot."""

    who: str
    take: str
    motion: str
    speed: float
    values: np.ndarray


def strides(motion: sc.Motion) -> list[Stride]:
    """All straight and steady strides of a motion, and what they measure."""
    analysis = analyse(motion, adult())
    curves = _curves(analysis)
    stances = analysis.gait.mid_stances
    found = []
    for start, middle, stop in zip(stances, stances[1:], stances[2:], strict=False):
        labels = {s.motion for s in analysis.gait.segments if s.start.frame < stop.frame and s.stop.frame > start.frame}
        share = (middle.frame - start.frame) / (stop.frame - start.frame)
        frames = slice(round(start.frame), round(stop.frame) + 1)
        speeds = analysis.vehicle.speeds[frames]
        if (
            start.side == stop.side != middle.side
            and abs(share - 0.5) < EVEN
            and labels in ({"walk"}, {"run"})
            and np.ptp(analysis.vehicle.headings[frames]) < STRAIGHT
            and np.ptp(speeds) < STEADY * speeds.mean()
        ):
            seconds = (stop.frame - start.frame) / motion.frame_rate
            values = _values(analysis, curves, frames, seconds)
            found.append(Stride(motion.subject, motion.name, labels.pop(), float(speeds.mean()), values))
    return found


def _curves(analysis: TakeAnalysis) -> dict[str, np.ndarray]:
    """Angles in degrees and places in millimetres at every frame; a column each side of the body, or one."""
    motion, details = analysis.motion, analysis.details
    world = kinematics.pose(motion)
    way = quat.about_y(-analysis.vehicle.headings)
    pelvis = quat.inverse(world.rotations[:, 0])
    columns: dict[str, list[np.ndarray]] = {name: [] for name in ("knee", "hip", "arm", "ankle")}
    for side in SIDES:
        joints = [f"{side}_{part}" for part in ("thigh", "shin", "foot", "upper_arm", "forearm")]
        hip, knee, ankle, shoulder, elbow = np.moveaxis(world.positions[:, motion.skeleton.chain(*joints)], 1, 0)
        thigh, shin = knee - hip, ankle - knee
        columns["knee"].append(np.arctan2(np.linalg.norm(np.cross(thigh, shin), axis=-1), np.sum(thigh * shin, -1)))
        columns["hip"].append(_forward(quat.rotate(pelvis, thigh)))
        columns["arm"].append(_forward(quat.rotate(way, elbow - shoulder)))
        columns["ankle"].append(quat.rotate(way, ankle - ground.lift(analysis.vehicle.positions))[:, 0])
    out = {name: np.degrees(np.stack(columns[name], axis=-1)) for name in ("knee", "hip", "arm")}
    return out | {
        "ankle": 1000 * np.stack(columns["ankle"], axis=-1),
        "sway": 1000 * details.displacements[:, :1],
        "bounce": 1000 * details.displacements[:, 1:2],
        "yaw": np.degrees(details.yaws)[:, None],
    }


def _forward(limb: np.ndarray) -> np.ndarray:
    """Angle by which a limb that hangs down points forward, radians."""
    return np.arctan2(limb[:, 2], -limb[:, 1])


def _values(analysis: TakeAnalysis, curves: dict[str, np.ndarray], frames: slice, seconds: float) -> np.ndarray:
    """The measures of one stride, in the order of ``MEASURES``."""
    planted = analysis.contacts.planted[frames]
    ranges = {name: float(np.ptp(_level(curve[frames]), axis=0).mean()) for name, curve in curves.items()}
    left, right = (
        curves["ankle"][frames, column][planted[:, column]].mean() if planted[:, column].any() else np.nan
        for column in range(2)
    )
    known = ranges | {
        "cadence": 120 / seconds,
        "step": float(analysis.vehicle.speeds[frames].mean()) * seconds / 2,
        "width": left - right,
        "duty": 100 * float(planted.mean()),
    }
    return np.array([known[name] for name, *_ in MEASURES])


def _level(stride: np.ndarray) -> np.ndarray:
    """A stride without the line from its start to its end: floors slope, and nobody goes quite straight."""
    return stride - np.linspace(stride[0], stride[-1], len(stride))


def recorded(sources: Iterable[str | Path], leave_out: Sequence[str] = ()) -> list[Stride]:
    """Strides of recordings; a take that is there in two formats counts once."""
    paths = {s.path.stem: s.path for s in reversed(collect(sources)) if isinstance(s, FileSource)}
    found = []
    for name in sorted(paths):
        if name not in leave_out:
            try:
                found += strides(sc.load_motion(paths[name]))
            except sc.InputError:  # nobody walks in it
                continue
    return found


def performed(rate: float = 120.0) -> list[Stride]:
    """Strides of the sample person."""
    found = []
    for motion, speeds in ASKED.items():
        for seed, speed in enumerate(speeds):
            frames = round(SECONDS * rate)
            running = np.full(frames, motion == "run")
            name = f"{motion} {speed:.2f}"
            take = perform(np.full(frames, speed), np.zeros(frames), running=running, rate=rate, seed=seed, name=name)
            found += strides(take.motion)
    return found


def walked(database: sc.MotionDatabase) -> list[Stride]:
    """Strides of a walker on straight lines, once it goes evenly."""
    found = []
    for motion, speeds in ASKED.items():
        for speed in speeds:
            line = np.array([[0.0, 0.0], [0.0, (SECONDS + 6) * speed]])
            journey = follow(database, stream_along(line, speed, motion=motion))
            rate = journey.motion.frame_rate
            evenly = journey.motion.clip(round(5 * rate), round((5 + SECONDS) * rate))
            found += strides(replace(evenly, name=f"{motion} {speed:.2f}", subject="walker"))
    return found


def by_take(found: Sequence[Stride]) -> list[Stride]:
    """The mean of each take's strides."""
    takes: dict[tuple[str, str, str], list[Stride]] = {}
    for s in found:
        takes.setdefault((s.who, s.take, s.motion), []).append(s)
    return [
        Stride(*names, float(np.mean([s.speed for s in own])), np.nanmean([s.values for s in own], axis=0))
        for names, own in takes.items()
    ]


def binned(found: Sequence[Stride]) -> dict[tuple[str, int], dict[str, np.ndarray]]:
    """Mean measures by gait and bin of speed, and there by person."""
    out: dict[tuple[str, int], dict[str, np.ndarray]] = {}
    for motion, edges in BINS.items():
        for number, (low, high) in enumerate(pairwise(edges)):
            inside = [s for s in found if s.motion == motion and low <= s.speed < high]
            people = sorted({s.who for s in inside})
            out[motion, number] = {
                who: np.nanmean([s.values for s in inside if s.who == who], axis=0) for who in people
            }
    return out


def outside(value: np.ndarray, people: Sequence[np.ndarray]) -> np.ndarray:
    """Which measures lie below the least or above the most of what people show."""
    return (value < np.min(people, axis=0)) | (value > np.max(people, axis=0))


def table(people: Sequence[Stride], others: dict[str, Sequence[Stride]]) -> None:
    """Print the measures by bins of speed, and count what is outside the spread of the recorded people."""
    theirs = {name: binned(found) for name, found in others.items()}
    counts = {name: np.zeros(2, int) for name in others}
    expected = 0.0
    for words in zip(*((name, unit) for name, unit, _ in MEASURES), strict=True):
        print((" " * 12 + "".join(f"{word:>11s} " for word in words)).rstrip())
    for (motion, number), by_person in binned(people).items():
        low, high = BINS[motion][number : number + 2]
        rows = list(by_person.values())
        judged = len(rows) >= LIKENED
        print(f"{motion} {low:.1f} to {high:.1f} m/s, people: {' '.join(by_person) or 'none'}")
        if rows:
            ends = zip(np.min(rows, axis=0), np.max(rows, axis=0), strict=True)
            print(("  recorded  " + "".join(f"{_span(*pair):>11s} " for pair in ends)).rstrip())
        for name, found in theirs.items():
            for value in found[motion, number].values():
                bad = outside(value, rows) if judged else np.zeros(len(value), bool)
                if judged:
                    counts[name] += (~bad).sum(), bad.sum()
                cells = [f"{_figure(v):>11s}{' !'[int(b)]}" for v, b in zip(value, bad, strict=True)]
                print(f"  {name:10s}" + "".join(cells).rstrip())
        if judged:
            expected += 2 / (len(rows) + 1) * len(MEASURES)
    totals = [f"{name}: {within} inside, {without} outside (!)" for name, (within, without) in counts.items()]
    print("\n" + "; ".join(totals))
    print(
        f"one more recorded person would have {expected:.0f} outside: each is as likely as any other to be an extreme"
    )


def _figure(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 3 else f"{value:.0f}"


def _span(least: float, most: float) -> str:
    return _figure(least) if _figure(least) == _figure(most) else f"{_figure(least)}-{_figure(most)}"


def main() -> None:
    """Print what recorded people, the sample person and a walker show, by speed."""
    parser = argparse.ArgumentParser(description="Measure the gait of people, sample person and walker.")
    parser.add_argument("recordings", nargs="*", type=Path, help="recordings, or folders of them")
    parser.add_argument("--leave-out", nargs="*", default=[], metavar="TAKE", help="names of takes not to compare with")
    parser.add_argument("--database", type=Path, help="what the walker has learned; else the sample database")
    options = parser.parse_args()
    database = sc.load_database(options.database) if options.database else sc.sample_database()
    people = recorded(options.recordings, options.leave_out) if options.recordings else []
    table(people, {"sample": performed(), "walker": walked(database)})


if __name__ == "__main__":
    main()
