"""Many analysed takes to one database: groups by string, warped examples, bounds (KS05, KS07)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline, PchipInterpolator

from stridecast.analysis.bounds import LEAST, SteeringSamples, learn_cyclic, learn_transition
from stridecast.analysis.events import HARD
from stridecast.analysis.take import TakeAnalysis
from stridecast.database.annotation import annotate, annotate_takes
from stridecast.errors import TakeError
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.bounds import SteeringBounds
from stridecast.model.database import INTERVALS, MARGIN, Examples, MotionDatabase, Take
from stridecast.model.group import MotionGroup
from stridecast.model.segment import MOTIONS, RUN, STAND, WALK, Boundary, Segment

Array = np.ndarray

SIDEWAYS = np.radians(50)
"""Who walks with the pelvis turned further from the way walks sideways or backwards."""

SLOWEST_STEP = 0.5
"""A half cycle slower than this on average is shuffling on the spot, m/s."""

LONGEST_STAND = 1.0
"""Standing is cut into pieces of at most this, seconds."""

GENERIC = np.arange(-MARGIN, INTERVALS + MARGIN + 1) / INTERVALS
"""Generic time of each sample."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AnalysedTake:
    """A take with its analysis; ``mirrored``: whether left and right are exchanged, ``take``: its place in the list."""

    analysis: TakeAnalysis
    take: int
    mirrored: bool = False


def assemble(
    analysed: Sequence[AnalysedTake],
    takes: Sequence[Take],
    *,
    frame_rate: float = 30.0,
    bounds_method: str = "balanced",
) -> MotionDatabase:
    """Make a database.

    Parameters
    ----------
    analysed
        Takes on one skeleton, each with its analysis.
    takes
        All takes that were offered; the result's list says how many segments of each were used and why others were not.
    frame_rate
        Frames a second of what is synthesised.
    bounds_method
        ``balanced`` or ``paper`` (see ``analysis.bounds``).

    Raises
    ------
    TakeError
        Not a single segment to learn from.
    """
    usable, reasons = _usable_segments(analysed)
    if not usable:
        raise TakeError("no take shows a single step or stretch of standing to learn from")
    by_group: dict[str, list[tuple[AnalysedTake, Segment]]] = defaultdict(list)
    for item in usable:
        by_group[item[1].group].append(item)
    names = sorted(by_group, key=_group_order)
    references = _references(analysed)
    bounds = _learn_bounds(by_group, bounds_method)

    groups, tables = [], defaultdict(list)
    first = 0
    for name in names:
        members = by_group[name]
        segment = members[0][1]
        keys = _mean_keys([s for _, s in members])
        groups.append(
            MotionGroup(
                name=name,
                motion=segment.motion,
                string=segment.string,
                start=segment.start.kind,
                stop=segment.stop.kind,
                keys=tuple(keys.tolist()),
                first=first,
                count=len(members),
                bounds=bounds[name],
            )
        )
        first += len(members)
        for source, member in members:
            for table, row in _example(source, member, keys, references).items():
                tables[table].append(row)
    examples = Examples(**{table: np.array(rows) for table, rows in tables.items()})
    skeleton = analysed[0].analysis.motion.skeleton
    annotations = annotate(skeleton, references, groups, examples)
    analyses = {a.take: a.analysis for a in analysed if not a.mirrored}
    accounted = _account(takes, usable, reasons)
    return MotionDatabase(
        skeleton=skeleton,
        frame_rate=frame_rate,
        groups=tuple(groups),
        examples=examples,
        references=references,
        takes=annotate_takes(accounted, groups, examples, annotations, analyses),
        annotations=annotations,
        bounds_method=bounds_method,
    )


def _usable_segments(
    analysed: Sequence[AnalysedTake],
) -> tuple[list[tuple[AnalysedTake, Segment]], dict[int, list[str]]]:
    """Segments to learn from, and for each take what was wrong with others."""
    usable: list[tuple[AnalysedTake, Segment]] = []
    reasons: dict[int, list[str]] = defaultdict(list)
    for source in analysed:
        rate = source.analysis.motion.frame_rate
        for segment in source.analysis.gait.segments:
            reason = _unusable(source.analysis, segment)
            if reason is None:
                usable += [(source, piece) for piece in _pieces(segment, rate)]
            elif not source.mirrored:
                reasons[source.take].append(
                    f"{segment.string} at {segment.start.frame / rate:.2f} s left out: {reason}"
                )
    return usable, reasons


def _unusable(analysis: TakeAnalysis, segment: Segment) -> str | None:
    """Why a segment is no example of going forward, if it is none."""
    if segment.motion == STAND:
        return None
    frames = slice(segment.start.frame, segment.stop.frame + 1)
    speeds = analysis.vehicle.speeds[frames]
    moving = speeds > 0.5 * SLOWEST_STEP
    turned = float(np.mean(ground.wrap(analysis.details.yaws[frames][moving]))) if moving.any() else 0.0
    if abs(turned) > SIDEWAYS:
        return "backwards" if abs(turned) > np.pi - SIDEWAYS else "sideways"
    if segment.motion == WALK and float(speeds.mean()) < SLOWEST_STEP:
        return f"shuffling at {speeds.mean():.2f} m/s"
    hard = float(np.mean(analysis.vehicle.tangential[frames]))
    if segment.motion == WALK and abs(hard) > HARD:
        return f"speed changes by {hard:.1f} m/s2, and nothing before or after says to what"
    if segment.string not in _LAWFUL.get(segment.motion, (segment.string,)):
        return f"{segment.string} is no half cycle of {segment.motion}"
    return None


_LAWFUL = {WALK: ("LDR", "RDL"), RUN: ("FLF", "FRF")}


def _pieces(segment: Segment, rate: float) -> list[Segment]:
    """Standing cut into pieces of about a second; anything else as it is."""
    if segment.motion != STAND:
        return [segment]
    count = max(1, round(segment.frames / rate / LONGEST_STAND))
    edges = np.linspace(segment.start.frame, segment.stop.frame, count + 1).round().astype(int)
    return [replace(segment, start=Boundary(int(a), "S"), stop=Boundary(int(b), "S")) for a, b in pairwise(edges)]


def _group_order(name: str) -> tuple[int, str]:
    motion = name.split("/")[0]
    return (MOTIONS.index(motion) if motion in MOTIONS else len(MOTIONS)), name


def _references(analysed: Sequence[AnalysedTake]) -> Float[Array, "bones 4"]:
    """Mean rotation of each joint over everything, every take counting alike."""
    sample = np.concatenate(
        [
            a.analysis.motion.rotations[np.linspace(0, a.analysis.motion.frames - 1, 32).astype(int), 1:]
            for a in analysed
        ]
    )
    return quat.mean(sample)


def _mean_keys(segments: Sequence[Segment]) -> Float[Array, "keys"]:
    """Generic time at which the support state changes: the mean over the group, at least two samples apart."""
    shares = np.mean([[(k - s.start.frame) / s.frames for k in s.keys] for s in segments], axis=0)
    least = 1.0 / INTERVALS
    lows = least * np.arange(1, len(shares) + 1)
    return np.minimum(np.maximum(shares, lows), 1 - lows[::-1])


def _learn_bounds(by_group: dict[str, list[tuple[AnalysedTake, Segment]]], method: str) -> dict[str, SteeringBounds]:
    """Bounds of each group; left and right halves of a cycle steer alike and share theirs."""
    samples = {name: [a.analysis.steering(s) for a, s in members] for name, members in by_group.items()}
    pooled: dict[str, list[SteeringSamples]] = defaultdict(list)
    for name, own in samples.items():
        pooled[name.split("/")[0]] += own
    cyclic = {m: learn_cyclic(pooled[m], method, LEAST[m]) for m in MOTIONS if m in pooled}
    if STAND in cyclic:  # however still people stood, standing quite still is standing
        fastest = [high for _, high in cyclic[STAND].speed]
        cyclic[STAND] = replace(cyclic[STAND], speed=((0.0, fastest[0]), (0.0, fastest[1])))
    out = {}
    for name, own in samples.items():
        motion = name.split("/")[0]
        if motion in cyclic:
            out[name] = cyclic[motion]
            continue
        segment = by_group[name][0][1]
        before, after = (cyclic.get(_motion_at(kind)) for kind in (segment.start.kind, segment.stop.kind))
        jerk = max((cyclic[end].jerk for end in motion.split("-") if end in cyclic), default=0.0)
        # Walking changes its force slowly: who comes to it must have done with braking hard.
        arrives = _motion_at(segment.stop.kind) == motion.split("-")[-1] == WALK
        out[name] = learn_transition(own, before, after, jerk=jerk, arrives=arrives)
    return out


def _motion_at(kind: str) -> str:
    return STAND if kind == "S" else RUN if kind.startswith("F") else WALK


def _example(
    source: AnalysedTake, segment: Segment, keys: Float[Array, "keys"], references: Float[Array, "bones 4"]
) -> dict[str, object]:
    """One example's rows of every table."""
    analysis = source.analysis
    motion, vehicle, details = analysis.motion, analysis.vehicle, analysis.details
    rate = motion.frame_rate
    start, length = segment.start.frame, segment.frames

    # Generic time to frames: keys onto keys, evenly between, and straight on beyond both ends.
    frames = warp(keys, np.array([k - start for k in segment.keys], float), float(length)) + start
    low, high = max(0, int(frames.min()) - 2), min(motion.frames, int(frames.max()) + 4)
    inside = np.arange(low, high, dtype=float)

    tangents = quat.log(quat.multiply(quat.inverse(references), motion.rotations[low:high, 1:]))
    series = np.concatenate(
        (
            tangents.reshape(len(inside), -1),
            quat.log(details.offsets[low:high]),
            details.displacements[low:high],
            details.yaws[low:high, None] - 2 * np.pi * np.round(details.yaws[start] / (2 * np.pi)),
        ),
        axis=-1,
    )
    heading = vehicle.headings[start]
    travelled = np.concatenate(
        (
            ground.turn(vehicle.positions[low:high] - vehicle.positions[start], np.array(-heading)),
            vehicle.headings[low:high, None] - heading,
            vehicle.speeds[low:high, None],
        ),
        axis=-1,
    )
    return {
        "features": _sample(inside, series, frames),
        "times": (frames - start) / rate,
        "parameters": np.array([vehicle.speeds[start], vehicle.tangential[start], vehicle.lateral[start]]),
        "travelled": _sample(inside, travelled, frames),
        "durations": length / rate,
        "takes": source.take,
        "first_frames": start,
        "mirrored": source.mirrored,
    }


def warp(keys: Float[Array, "keys"], own: Float[Array, "keys"], length: float) -> Float[Array, "rows"]:
    """Own time of an example at every generic sample: monotone, smooth, its keys on the group's keys."""
    own = np.clip(own, length * 0.02 * np.arange(1, len(own) + 1), length * (1 - 0.02 * np.arange(len(own), 0, -1)))
    curve = PchipInterpolator(np.concatenate(([0.0], keys, [1.0])), np.concatenate(([0.0], own, [length])))
    inside = curve(np.clip(GENERIC, 0, 1))
    slopes = np.maximum(curve.derivative()(np.array([0.0, 1.0])), 0.3 * length)
    return inside + np.minimum(GENERIC, 0) * slopes[0] + np.maximum(GENERIC - 1, 0) * slopes[1]


def _sample(
    frames: Float[Array, "frames"], series: Float[Array, "frames channels"], at: Float[Array, "rows"]
) -> Float[Array, "rows channels"]:
    """A series at fractional frames; beyond the recording it goes straight on."""
    curve = CubicSpline(frames, series)
    inside = np.clip(at, frames[0], frames[-1])
    return curve(inside) + (at - inside)[:, None] * curve(inside, 1)


def _account(
    takes: Sequence[Take], usable: Sequence[tuple[AnalysedTake, Segment]], reasons: dict[int, list[str]]
) -> tuple[Take, ...]:
    counts = np.bincount([a.take for a, _ in usable if not a.mirrored], minlength=len(takes))
    out = []
    for i, take in enumerate(takes):
        left_out = take.left_out + tuple(reasons.get(i, ()))
        if counts[i] == 0 and not left_out:
            left_out = ("no whole half cycle and no standing in it",)
        out.append(replace(take, segments=int(counts[i]), left_out=left_out))
    return tuple(out)
