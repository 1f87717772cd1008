"""Clips of a database: whole cycles of walking, running and standing, and whole transitions (BJL 4.2).

A cycle is two half cycles of one take that follow each other; it begins with the one in which the right foot leaves the
floor. A transition is every example of it from where it begins to where it has arrived.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from stridecast.model.database import INTERVALS, MARGIN, MotionDatabase
from stridecast.model.group import MotionGroup
from stridecast.model.segment import MOTIONS, RUN, STAND

Array = np.ndarray

FIRST, LAST = MARGIN, MARGIN + INTERVALS
"""Rows of an example's first and last frame."""

SAME_FRAME = 1e-3
"""Examples follow each other where features at the end of one and at the beginning of the other differ by no more."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Clips:
    """Clips of one status and one row of groups, which can be blended: equal groups have equal key times.

    Parameters
    ----------
    status
        Their motion or transition.
    groups
        Groups of their examples, in the order in which they are played.
    rows
        Their examples, in that order.
    values
        What each shows, by name: numbers as in ``Annotations`` (means over the clip), ``seconds``, and text (``take``,
        ``subject``, ``status``). ``speed`` of a transition is that of the motion that it leads to or comes from.
    gain
        Change of speed, m/s2.
    gap
        How far a cycle's end is from its beginning, root mean square over the joints, radians.
    """

    status: str
    groups: tuple[MotionGroup, ...]
    rows: Int[Array, "clips examples"]
    values: dict[str, Array]
    gain: Float[Array, "clips"]
    gap: Float[Array, "clips"]

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def repeats(self) -> bool:
        """Whether they are cycles."""
        return self.status in MOTIONS

    def chosen(self, which: Bool[Array, "clips"]) -> Clips:
        """Some of them."""
        return Clips(
            status=self.status,
            groups=self.groups,
            rows=self.rows[which],
            values={name: column[which] for name, column in self.values.items()},
            gain=self.gain[which],
            gap=self.gap[which],
        )


STEADY = 0.35
"""Half cycles beside a transition whose speed changes faster than this are part of its clip, m/s2 ..."""

STEPS = (0.8, 4.6)
"""Nobody takes fewer or more steps a second: such half cycles have been cut wrongly."""

MOST_MORE = 4
"""... so many of them at most."""

COLUMNS = (
    *("take", "subject", "status", "speed", "start_speed", "end_speed", "turn", "style"),
    *("cadence", "spread", "stoop", "seconds", "mirrored"),
)
"""What is known about each clip."""


def find_clips(database: MotionDatabase) -> list[Clips]:
    """All clips of a database, by status and groups."""
    group_of = np.repeat(np.arange(len(database.groups)), [group.count for group in database.groups])
    found: dict[tuple[int, ...], list[tuple[int, ...]]] = {}
    for rows in _cycles(database, group_of) + _transitions(database, group_of):
        found.setdefault(tuple(int(group_of[row]) for row in rows), []).append(rows)
    return [_described(database, groups, np.array(rows)) for groups, rows in sorted(found.items())]


def toe_off(group: MotionGroup) -> int | None:
    """Which of a group's keys is the right foot's toe-off, if it has one."""
    stands = [state in "SRD" for state in group.string]
    return next((k for k, (now, then) in enumerate(pairwise(stands)) if now and not then), None)


def followers(database: MotionDatabase) -> dict[int, int]:
    """Which example follows which in its take."""
    examples = database.examples
    order = np.lexsort((examples.first_frames, examples.mirrored, examples.takes))
    before, after = order[:-1], order[1:]
    same = (examples.takes[before] == examples.takes[after]) & (examples.mirrored[before] == examples.mirrored[after])
    yaw = examples.features.shape[2] - 1  # it may differ by whole turns
    gaps = np.abs(examples.features[before, LAST, :yaw] - examples.features[after, FIRST, :yaw]).max(axis=1)
    met = same & (gaps < SAME_FRAME)
    return dict(zip(before[met].tolist(), after[met].tolist(), strict=True))


def _cycles(database: MotionDatabase, group_of: Int[Array, "examples"]) -> list[tuple[int, ...]]:
    """Pairs of half cycles, the one with the right toe-off first; pieces of standing by themselves."""
    groups, follows = database.groups, followers(database)
    cadence = database.annotations.cadence
    human = (cadence >= STEPS[0]) & (cadence <= STEPS[1])
    out: list[tuple[int, ...]] = []
    paired = set(np.flatnonzero(~human).tolist())
    for row, number in enumerate(group_of):
        group = groups[number]
        if group.motion == STAND:
            out.append((row,))
        elif group.motion in MOTIONS and row in follows and human[row] and human[follows[row]]:
            other = follows[row]
            if groups[group_of[other]].motion == group.motion and number != group_of[other]:
                pair = (row, other) if toe_off(group) is not None else (other, row)
                if toe_off(groups[group_of[pair[0]]]) is not None:
                    out.append(pair)
                    paired |= {row, other}
    return out + _with_mirror_images(database, group_of, paired)


def _with_mirror_images(
    database: MotionDatabase, group_of: Int[Array, "examples"], paired: set[int]
) -> list[tuple[int, ...]]:
    """Half cycles that have no neighbour, each with its mirror image for the other half."""
    examples, groups = database.examples, database.groups
    out: list[tuple[int, ...]] = []
    for row in np.flatnonzero(~examples.mirrored):
        group = groups[group_of[row]]
        if row in paired or group.motion not in MOTIONS or group.motion == STAND:
            continue
        same = (examples.takes == examples.takes[row]) & examples.mirrored
        same &= (group_of != group_of[row]) & np.isin(group_of, _of_motion(groups, group.motion))
        same &= np.abs(examples.durations - examples.durations[row]) < 0.1 * examples.durations[row]
        images = np.flatnonzero(same)
        if len(images):
            image = int(images[np.argmin(np.abs(examples.first_frames[images] - examples.first_frames[row]))])
            pair = (int(row), image) if toe_off(group) is not None else (image, int(row))
            if toe_off(groups[group_of[pair[0]]]) is not None:
                out.append(pair)
    return out


def _of_motion(groups: Sequence[MotionGroup], motion: str) -> list[int]:
    return [i for i, group in enumerate(groups) if group.motion == motion]


def _transitions(database: MotionDatabase, group_of: Int[Array, "examples"]) -> list[tuple[int, ...]]:
    """Rows of examples of one transition; those cut by the end of a take only where none is whole."""
    groups, follows = database.groups, followers(database)
    precedes = {after: before for before, after in follows.items()}
    motions = [groups[number].motion for number in group_of]
    told = database.annotations
    gains = (told.end_speed - told.start_speed) / database.examples.durations

    def on(row: int, ways: dict[int, int], motion: str, sign: float) -> list[int]:
        """Half cycles beside a transition in which its speed is still changing."""
        out: list[int] = []
        while len(out) < MOST_MORE and row in ways:
            row = ways[row]
            if motions[row] != motion or sign * gains[row] < STEADY:
                break
            out.append(row)
        return out

    whole: dict[str, list[tuple[int, ...]]] = {}
    parts: dict[str, list[tuple[int, ...]]] = {}
    for row, motion in enumerate(motions):
        if motion in MOTIONS or (row in precedes and motions[precedes[row]] == motion):
            continue
        chain = [row]
        while chain[-1] in follows and motions[follows[chain[-1]]] == motion:
            chain.append(follows[chain[-1]])
        first, last = groups[group_of[chain[0]]], groups[group_of[chain[-1]]]
        complete = _is_at(first.start, first.comes_from) and _is_at(last.stop, last.leads_to)
        faster = 1.0 if MOTIONS.index(last.leads_to) > MOTIONS.index(first.comes_from) else -1.0
        if first.comes_from != STAND:
            chain = on(chain[0], precedes, first.comes_from, faster)[::-1] + chain
        if last.leads_to != STAND:
            chain += on(chain[-1], follows, last.leads_to, faster)
        (whole if complete else parts).setdefault(motion, []).append(tuple(chain))
    return [chain for motion in sorted({*whole, *parts}) for chain in whole.get(motion) or parts[motion]]


def _is_at(kind: str, motion: str) -> bool:
    """Whether a boundary lies in a motion."""
    return kind == "S" if motion == STAND else kind.startswith("F") if motion == RUN else kind in ("L", "R")


def _described(database: MotionDatabase, numbers: tuple[int, ...], rows: Int[Array, "clips examples"]) -> Clips:
    """Clips with what they show."""
    examples, told = database.examples, database.annotations
    groups = tuple(database.groups[number] for number in numbers)
    seconds = examples.durations[rows]
    total = seconds.sum(axis=1)
    status = next((group.motion for group in groups if group.motion not in MOTIONS), groups[0].motion)
    # The earlier half of a cycle may stand second.
    order = (
        np.argsort(examples.first_frames[rows], axis=1) if status in MOTIONS else np.argsort(rows * 0, kind="stable")
    )
    begins, ends = (np.take_along_axis(rows, order[:, [at]], axis=1)[:, 0] for at in (0, -1))

    def mean(column: Array) -> Array:
        return (column[rows] * seconds).sum(axis=1) / total

    start, end = told.start_speed[begins], told.end_speed[ends]
    speed = mean(told.speed)
    if status not in MOTIONS:
        speed = start if status.endswith(f"-{STAND}") else end
    takes = [database.takes[take] for take in examples.takes[rows[:, 0]]]
    values = {
        "take": np.array([take.name for take in takes]),
        "subject": np.array([take.subject for take in takes]),
        "status": np.full(len(rows), status),
        "speed": speed,
        "start_speed": start,
        "end_speed": end,
        "turn": mean(told.turn),
        "style": mean(told.style),
        "cadence": mean(told.cadence),
        "spread": mean(told.spread),
        "stoop": mean(told.stoop),
        "seconds": total,
        "mirrored": examples.mirrored[rows[:, 0]].astype(float),
    }
    features = examples.features
    joints = 3 * len(database.references)
    apart = np.maximum.reduce(
        [
            np.sqrt(((features[a, LAST, :joints] - features[b, FIRST, :joints]) ** 2).mean(axis=1))
            for a, b in zip(rows.T, np.roll(rows, -1, axis=1).T, strict=True)
        ]
    )
    return Clips(
        status=status,
        groups=groups,
        rows=rows,
        values={name: values[name] for name in COLUMNS},
        gain=(end - start) / total,
        gap=apart if status in MOTIONS else np.zeros(len(rows)),
    )
