"""Motion mining: ask a database for motion by status, speed, turn and style (BJL 4.1, 4.2)."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from stridecast.database.clips import Clips, find_clips
from stridecast.database.conditions import fitting
from stridecast.database.playing import Performance, perform
from stridecast.database.weights import convex_weights
from stridecast.errors import DatabaseError, InputError
from stridecast.model.database import MotionDatabase
from stridecast.model.motion import Motion
from stridecast.model.segment import MOTIONS, STAND

Array = np.ndarray
log = logging.getLogger("stridecast")

Interval = tuple[float, float]
Number = float | Interval | Sequence[float]
"""A number, a range ``(low, high)``, or a list of numbers of which any will do."""

STYLES: dict[str, Interval] = {"gloomy": (-1.0, -0.35), "neutral": (-0.2, 0.2), "brisk": (0.35, 1.0)}
"""Words for ranges of style."""

SCALES = {"speed": 0.15, "turn": 0.25, "style": 0.35}
"""Differences that weigh as much as each other: m/s, rad/s, style."""

TOLERANCES = {"speed": 0.02, "turn": 0.04, "style": 0.05}
"""A recorded clip that is off by no more is what was asked for."""

USUAL = {"turn": 0.0, "style": 0.0}
"""What is meant where nothing is asked for: straight on, in the usual manner."""

NEARLY_USUAL = {"turn": 0.1, "style": 0.35}
"""A recorded clip may be off that by so much."""

MOST_GAIN = 0.3
"""A recorded cycle may change its speed by so much, m/s2 ..."""

MOST_GAP = 0.05
"""... and be open by so much (see ``Clips.gap``), to be played as it is, radians."""

HARDEST_GAIN = 0.6
"""Cycles that change their speed faster are left out where there are others, m/s2."""

MOST_WISHES = 64
"""Lists of numbers may make up so many wishes together."""

LONGEST = 3600.0
"""Nobody asks for a longer clip, seconds."""


@dataclass(frozen=True, kw_only=True)
class MinedClip:
    """A recorded clip in a mined motion: how much of it, where it comes from, and what it shows (m/s, rad/s).

    ``first_frame`` is that of the recording, at its own rate.
    """

    weight: float
    take: str
    subject: str
    status: str
    first_frame: int
    seconds: float
    mirrored: bool
    speed: float
    turn: float
    style: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Mined:
    """What a database answers.

    Parameters
    ----------
    motion
        The motion, from a right toe-off at the origin towards +Z; a cycle that is asked for a number of times ends as
        it began, so that it can be repeated without a seam.
    planted
        Which feet stand on the floor: left, right.
    clips
        What it is made of, the heaviest first; weights sum to 1.
    status, speed, turn, style
        What it shows: m/s, rad/s to the left, -1 (gloomy) to 1 (brisk).
    cycle
        Seconds of a cycle; of a transition, 0.
    recorded
        Whether it is a recorded clip, as it is.
    warnings
        What could not be met, and what can be.
    """

    motion: Motion
    planted: Bool[Array, "frames 2"]
    clips: tuple[MinedClip, ...]
    status: str
    speed: float
    turn: float
    style: float
    cycle: float
    recorded: bool
    warnings: tuple[str, ...] = ()


def mine(
    database: MotionDatabase,
    *,
    status: str | Sequence[str] | None = None,
    speed: Number | None = None,
    turn: Number | None = None,
    style: str | Number | None = None,
    where: str | None = None,
    subject: str | None = None,
    cycles: int | None = None,
    seconds: float | None = None,
) -> Mined:
    """Ask a database for motion.

    A recorded cycle that shows what is asked for comes back as it is. Else its neighbours are blended, never beyond
    what was recorded: what nobody showed is answered by the nearest that somebody did, with a warning.

    Parameters
    ----------
    database
        What was learned.
    status
        ``stand``, ``walk``, ``run``, or a transition such as ``stand-walk``; several, of which any will do. Left out:
        whichever of standing, walking and running comes nearest.
    speed
        m/s; of a transition, that of the motion it leads to, or comes from where it leads to standing.
    turn
        Turning to the left, rad/s; straight on if left out.
    style
        From gloomy (-1) to brisk (+1), or ``gloomy``, ``neutral``, ``brisk``; as usual if left out.
    where
        Condition on the recorded clips that may be used, such as ``take != '16_31' and style < 0``; see ``COLUMNS`` of
        ``database.clips`` for what is known about them.
    subject
        Only clips of this person.
    cycles, seconds
        How often the cycle is to be played, once if left out, or for how long instead. A transition is played once.

    Returns
    -------
    Mined
        At the frame rate of the database.

    Raises
    ------
    InputError
        A wish that is none: words that are not known (the known ones are listed), numbers that are not finite, a
        condition that cannot be read.
    DatabaseError
        Nothing of the status, the subject or the condition is in the database; the message tells what is.
    """
    _check_length(cycles, seconds)
    numbers = {"speed": _choices("speed", speed), "turn": _choices("turn", turn), "style": _choices("style", style)}
    wishes = [
        {name: value for name, value in zip(numbers, values, strict=True) if value is not None}
        for values in product(*(value or [None] for value in numbers.values()))
    ]
    if len(wishes) > MOST_WISHES:
        raise InputError(f"lists of speed, turn and style make {len(wishes)} wishes; {MOST_WISHES} are the most")
    known = _of_subject(find_clips(database), database, subject)
    known = _of_status(known, status)
    known = _where(known, where)
    answers = [_answer(clips, wish) for clips in known for wish in wishes]
    best = min(answers, key=lambda answer: answer.cost)
    transition = best.clips.status not in MOTIONS
    if transition and (cycles is not None or seconds is not None):
        raise InputError(f"a transition such as {best.clips.status} is played once; leave out cycles and seconds")
    warnings = tuple(_warnings(best, [clips for clips in known if clips.status == best.clips.status]))
    for warning in warnings:
        log.warning("%s", warning)
    return _played(database, best, warnings, cycles, seconds)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Answer:
    """Clips and weights for one wish, what they show, and how far off that is."""

    clips: Clips
    wish: dict[str, Interval]
    weights: Float[Array, "clips"]
    shown: dict[str, float]
    recorded: bool
    cost: tuple[float, bool, float]


def _check_length(cycles: int | None, seconds: float | None) -> None:
    if cycles is not None and seconds is not None:
        raise InputError("name cycles or seconds, not both")
    if cycles is not None and not 1 <= cycles <= LONGEST:
        raise InputError(f"cycles must lie between 1 and {LONGEST:.0f}, not at {cycles}")
    if seconds is not None and not 0 < seconds <= LONGEST:
        raise InputError(f"seconds must lie above 0 and up to {LONGEST:.0f}, not at {seconds:g}")


def _choices(name: str, wanted: str | Number | None) -> list[Interval | None]:
    """A wish for one quantity as intervals, of which any will do."""
    if wanted is None:
        return []
    if isinstance(wanted, str):
        if name != "style" or wanted not in STYLES:
            words = f"; the words are {', '.join(STYLES)}" if name == "style" else ""
            raise InputError(f"{name} must be a number, not {wanted!r}{words}")
        return [STYLES[wanted]]
    single = isinstance(wanted, int | float | np.number)
    given: Any = [wanted] if single else wanted
    values = [float(value) for value in given]
    if not values or not all(math.isfinite(value) for value in values):
        raise InputError(f"{name} must be finite numbers, not {wanted}")
    if name == "speed" and min(values) < 0:
        raise InputError(f"speed must not be negative, not {min(values):g} m/s")
    if isinstance(wanted, tuple) and len(values) == 2:
        if values[0] > values[1]:
            raise InputError(f"the range of {name} must go from low to high, not from {values[0]:g} to {values[1]:g}")
        return [(values[0], values[1])]
    return [(value, value) for value in values]


def _of_subject(known: list[Clips], database: MotionDatabase, subject: str | None) -> list[Clips]:
    if subject is None:
        return known
    if subject not in database.subjects:
        raise DatabaseError(
            f"there is no subject {subject!r} in the database; there are {', '.join(database.subjects)}"
        )
    return _chosen(known, [clips.values["subject"] == subject for clips in known])


def _of_status(known: list[Clips], status: str | Sequence[str] | None) -> list[Clips]:
    have = list(dict.fromkeys(clips.status for clips in known))
    have.sort(key=lambda name: (name not in MOTIONS, MOTIONS.index(name) if name in MOTIONS else 0, name))
    names = [status] if isinstance(status, str) else list(status) if status is not None else None
    if names is None:
        names = [name for name in have if name in MOTIONS] or have
    for name in names:
        ends = name.split("-")
        if not (1 <= len(ends) <= 2 and set(ends) <= set(MOTIONS)):
            raise InputError(f"there is no status {name!r}; there are {', '.join(MOTIONS)} and transitions: stand-walk")
    found = [clips for clips in known if clips.status in names]
    if not found:
        raise DatabaseError(f"nothing recorded shows {' or '.join(names)}; there are {', '.join(have) or 'no clips'}")
    return found


def _where(known: list[Clips], where: str | None) -> list[Clips]:
    if where is None:
        return known
    found = _chosen(known, [fitting(where, clips.values) for clips in known])
    if not found:
        count = sum(len(clips) for clips in known)
        told = ", ".join(f"{name} {_span(name, known)}" for name in ("speed", "turn", "style"))
        raise DatabaseError(f"none of {count} recorded clips is one where {where}; they show {told}")
    return found


def _chosen(known: list[Clips], which: Sequence[Array]) -> list[Clips]:
    return [clips.chosen(rows) for clips, rows in zip(known, which, strict=True) if rows.any()]


def _answer(clips: Clips, wish: dict[str, Interval]) -> _Answer:
    """Answer a wish by clips that can be blended with each other: by one that fits as it is, else by a blend."""
    if clips.repeats:
        steady = np.abs(clips.gain) <= HARDEST_GAIN
        clips = clips.chosen(steady) if steady.any() else clips
    values = clips.values
    off = {name: _outside(values[name], interval) for name, interval in wish.items()}
    unasked = {name: np.abs(values[name] - usual) for name, usual in USUAL.items() if name not in wish}
    fits = np.ones(len(clips), bool)
    faults = 0.25 * _squares(unasked, len(clips))
    for name, excess in off.items():
        fits &= excess <= TOLERANCES[name]
    if clips.repeats:
        for name, excess in unasked.items():
            fits &= excess <= NEARLY_USUAL[name]
        fits &= (np.abs(clips.gain) <= MOST_GAIN) & (clips.gap <= MOST_GAP)
        faults += 0.1 * (clips.gain / MOST_GAIN) ** 2 + 0.1 * (clips.gap / MOST_GAP) ** 2
    middles = {name: (low + high) / 2 for name, (low, high) in wish.items()}
    apart = faults + _squares({name: values[name] - middle for name, middle in middles.items()}, len(clips))
    if not fits.any():
        return _blend(clips, wish, middles, np.sqrt(apart))
    # The nearest to what is asked for; of those that are equally near, the most usual and the best closed.
    best = int(np.lexsort((apart, np.where(fits, _squares(off, len(clips)), np.inf)))[0])
    return _Answer(
        clips=clips,
        wish=wish,
        weights=np.eye(len(clips))[best],
        shown={name: float(values[name][best]) for name in SCALES},
        recorded=True,
        cost=(0.0, False, float(faults[best])),
    )


def _squares(differences: dict[str, Array], count: int) -> Float[Array, "clips"]:
    """Sum of squared differences, in scales."""
    return sum(((difference / SCALES[name]) ** 2 for name, difference in differences.items()), np.zeros(count))


def _blend(
    clips: Clips, wish: dict[str, Interval], middles: dict[str, float], distances: Float[Array, "clips"]
) -> _Answer:
    """Blend the neighbours of a wish; straight on where no turn is asked for, as far as that can be done."""
    values = clips.values
    aims = dict(middles)
    if clips.repeats and clips.status != STAND:
        aims.setdefault("turn", float(np.clip(USUAL["turn"], values["turn"].min(), values["turn"].max())))
    have = np.stack([values[name] / SCALES[name] for name in aims], axis=-1) if aims else np.zeros((len(clips), 0))
    aim = np.array([aims[name] / SCALES[name] for name in aims])
    weights, _ = convex_weights(aim, have, distances, values["seconds"])
    parts = weights * values["seconds"]
    shown = {name: float(parts @ values[name] / parts.sum()) for name in SCALES}
    missed = _squares({name: _outside(np.array([shown[name]]), interval) for name, interval in wish.items()}, 1)
    return _Answer(
        clips=clips,
        wish=wish,
        weights=weights,
        shown=shown,
        recorded=bool((weights == 1.0).any()),
        cost=(round(float(missed[0]), 4), True, float(distances.min())),
    )


def _outside(values: Float[Array, "values"], interval: Interval) -> Float[Array, "values"]:
    """How far values lie outside an interval."""
    return np.maximum(np.maximum(interval[0] - values, values - interval[1]), 0.0)


def _warnings(answer: _Answer, known: list[Clips]) -> list[str]:
    """Say what could not be met."""
    missed = {
        name: interval
        for name, interval in answer.wish.items()
        if _outside(np.array([answer.shown[name]]), interval)[0] > TOLERANCES[name]
    }
    out = []
    for name, interval in missed.items():
        low = min(float(clips.values[name].min()) for clips in known)
        high = max(float(clips.values[name].max()) for clips in known)
        asked = _told(name, interval[0]) if interval[0] == interval[1] else _told_range(name, interval)
        what = f"{name} {asked} is out of reach of {answer.clips.status}"
        if interval[0] <= high and low <= interval[1]:
            others = [other for other in answer.wish if other != name]
            what += f" with this {' and '.join(others)}" if others else " by clips that blend"
        out.append(f"{what}; recorded is {_told_range(name, (low, high))}, given is {_told(name, answer.shown[name])}")
    return out


_UNITS = {"speed": " m/s", "turn": " rad/s", "style": ""}


def _told(name: str, value: float) -> str:
    return f"{value + 0.0:.2f}{_UNITS[name]}"


def _told_range(name: str, interval: Interval) -> str:
    return f"{interval[0] + 0.0:.2f} to {interval[1] + 0.0:.2f}{_UNITS[name]}"


def _span(name: str, known: list[Clips]) -> str:
    values = np.concatenate([clips.values[name] for clips in known])
    return _told_range(name, (float(values.min()), float(values.max())))


def _played(
    database: MotionDatabase, answer: _Answer, warnings: tuple[str, ...], cycles: int | None, seconds: float | None
) -> Mined:
    """Make the motion."""
    clips, shown = answer.clips, dict(answer.shown)
    if clips.status == STAND:
        shown["speed"] = shown["turn"] = 0.0
    elif "turn" not in answer.wish and abs(shown["turn"]) <= NEARLY_USUAL["turn"]:
        shown["turn"] = 0.0
    played = perform(database, clips, answer.weights, speed=shown["speed"], turn=shown["turn"])
    times, rate = _times(played, database.frame_rate, cycles, seconds)
    used = _used(database, answer)
    subjects = sorted({clip.subject for clip in used})
    return Mined(
        motion=played.motion(times, rate, clips.status, "+".join(subjects)),
        planted=played.planted(times),
        clips=used,
        status=clips.status,
        speed=shown["speed"],
        turn=shown["turn"],
        style=shown["style"],
        cycle=played.seconds if clips.repeats else 0.0,
        recorded=answer.recorded,
        warnings=warnings,
    )


def _times(
    played: Performance, rate: float, cycles: int | None, seconds: float | None
) -> tuple[Float[Array, "frames"], float]:
    """Times of the frames. Whole cycles take whole frames: time runs faster or slower by half a frame at most."""
    if not played.repeats:
        return np.arange(int(played.seconds * rate + 1e-6) + 1) / rate, rate
    if seconds is not None:
        return np.arange(round(seconds * rate) + 1) / rate, rate
    length = (cycles or 1) * played.seconds
    return np.linspace(0.0, length, max(1, round(length * rate)) + 1), rate


def _used(database: MotionDatabase, answer: _Answer) -> tuple[MinedClip, ...]:
    clips, values = answer.clips, answer.clips.values
    order = np.lexsort((np.arange(len(clips)), -answer.weights.round(6)))  # of equals, the first comes first
    out = []
    for i in order[answer.weights[order] > 0]:
        rows = clips.rows[i]
        told: dict[str, Any] = {name: float(values[name][i]) for name in ("seconds", "speed", "turn", "style")}
        told |= {name: str(values[name][i]) for name in ("take", "subject", "status")}
        out.append(
            MinedClip(
                weight=float(answer.weights[i]),
                first_frame=int(database.examples.first_frames[rows].min()),
                mirrored=bool(values["mirrored"][i]),
                **told,
            )
        )
    return tuple(out)
