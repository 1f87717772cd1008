"""Annotate examples and takes: status, velocity, turn, style and cycle, without any label (BJL 4.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np
from jaxtyping import Float, Int

from stridecast.analysis.cycles import find_cycle
from stridecast.analysis.style import joint_spread, score, stoop
from stridecast.analysis.take import TakeAnalysis
from stridecast.database.poses import poses_of
from stridecast.model.annotation import Annotations, TakeAnnotation
from stridecast.model.database import INTERVALS, MARGIN, Examples, Take
from stridecast.model.group import MotionGroup
from stridecast.model.segment import RUN, STAND, WALK
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

FIRST, LAST = MARGIN, MARGIN + INTERVALS
"""Rows of an example's first and last frame."""

EVERY = 3
"""Trunk and head are looked at in every third row."""


def annotate(
    skeleton: Skeleton,
    references: Float[Array, "bones 4"],
    groups: Sequence[MotionGroup],
    examples: Examples,
) -> Annotations:
    """Annotate the examples of a database from its tables."""
    rows = slice(FIRST, LAST + 1)
    times, travelled, features = examples.times[:, rows], examples.travelled[:, rows], examples.features[:, rows]
    speeds = travelled[..., 3]
    mean_speed = np.trapezoid(speeds, times, axis=1) / examples.durations
    status = statuses(groups)
    cadence = np.where(np.isin(status, (WALK, RUN)), 1.0 / examples.durations, 0.0)
    spread, bent = _posture(skeleton, references, features)
    # Who stands has no direction of motion: what turns is the body.
    facing = travelled[..., 2] + np.where(status == STAND, 1.0, 0.0)[:, None] * features[..., -1]
    return Annotations(
        speed=mean_speed,
        start_speed=speeds[:, 0],
        end_speed=speeds[:, -1],
        turn=(facing[:, -1] - facing[:, 0]) / examples.durations,
        cadence=cadence,
        spread=spread,
        stoop=bent,
        style=score(_numbered(status), examples.takes, mean_speed, spread, cadence, bent),
    )


def annotate_takes(
    takes: Sequence[Take],
    groups: Sequence[MotionGroup],
    examples: Examples,
    annotations: Annotations,
    analyses: Mapping[int, TakeAnalysis],
) -> tuple[Take, ...]:
    """Annotate the takes of a database by their examples; one that gave none, by all of it.

    ``analyses`` are those of the recordings, where they are at hand: cycles are found in them.
    """
    status = statuses(groups)
    out = []
    for number, take in enumerate(takes):
        own = np.flatnonzero((examples.takes == number) & ~examples.mirrored)
        analysis = analyses.get(number)
        annotation = None
        if len(own):
            own = own[np.argsort(examples.first_frames[own], kind="stable")]
            annotation = _by_examples(status[own].tolist(), own, examples, annotations)
        elif analysis is not None:
            annotation = _by_itself(analysis, number, status, examples, annotations)
        cycle = None if analysis is None else find_cycle(analysis.motion, analysis.contacts)
        if annotation is not None and cycle is not None:
            annotation = replace(annotation, cycle=cycle.seconds, cycle_start=cycle.start, cycles=cycle.number)
        out.append(replace(take, annotation=annotation))
    return tuple(out)


def statuses(groups: Sequence[MotionGroup]) -> Array:
    """Status of every example, as text: the motion of its group."""
    return np.repeat([group.motion for group in groups], [group.count for group in groups])


def _numbered(status: Array) -> Int[Array, "examples"]:
    return np.unique(status, return_inverse=True)[1]


def _by_examples(
    status: list[str], own: Int[Array, "rows"], examples: Examples, annotations: Annotations
) -> TakeAnnotation:
    seconds = examples.durations[own]

    def mean(values: Array) -> float:
        return float(np.average(values[own], weights=seconds))

    return TakeAnnotation(
        statuses=tuple(name for name, _ in groupby(status)),
        speed=mean(annotations.speed),
        start_speed=float(annotations.start_speed[own[0]]),
        end_speed=float(annotations.end_speed[own[-1]]),
        turn=mean(annotations.turn),
        style=mean(annotations.style),
    )


def _by_itself(
    analysis: TakeAnalysis, number: int, status: Array, examples: Examples, annotations: Annotations
) -> TakeAnnotation:
    """Annotate a take of which nothing could be used, stealthy walking for instance, by all of it.

    Both feet on the floor at once is walking, none is running (BJL 4.1).
    """
    vehicle, skeleton, support = analysis.vehicle, analysis.motion.skeleton, analysis.contacts.support()
    own = STAND if set(support) == {"S"} else RUN if "F" in support and "D" not in support else WALK
    seconds = max(analysis.motion.seconds, 1e-6)
    speed = float(vehicle.speeds.mean())
    rotations = analysis.motion.rotations[:: max(1, round(analysis.motion.frame_rate / 30))]
    headings = vehicle.headings[:: max(1, round(analysis.motion.frame_rate / 30))]
    like = np.flatnonzero((status == own) & ~examples.mirrored)
    kinds = np.zeros(len(like) + 1, np.int64)
    columns = [
        np.append(column[like], value)
        for column, value in (
            (examples.takes, number),
            (annotations.speed, speed),
            (annotations.spread, joint_spread(skeleton, rotations)),
            (annotations.cadence, 0.0),
            (annotations.stoop, stoop(skeleton, rotations, headings)),
        )
    ]
    return TakeAnnotation(
        statuses=(own,),
        speed=speed,
        start_speed=float(vehicle.speeds[0]),
        end_speed=float(vehicle.speeds[-1]),
        turn=float(vehicle.headings[-1] - vehicle.headings[0]) / seconds,
        style=float(score(kinds, *columns)[-1]),
    )


def _posture(
    skeleton: Skeleton, references: Float[Array, "bones 4"], features: Float[Array, "examples rows features"]
) -> tuple[Float[Array, "examples"], Float[Array, "examples"]]:
    """Spread and stoop of each example."""
    spread, bent = np.empty(len(features)), np.empty(len(features))
    for start in range(0, len(features), 256):  # not all at once: a large database would not fit
        some = slice(start, start + 256)
        whole, _ = poses_of(references, features[some])
        spread[some] = joint_spread(skeleton, whole)
        bent[some] = stoop(skeleton, whole[:, ::EVERY], np.zeros(whole[:, ::EVERY].shape[:2]))
    return spread, bent
