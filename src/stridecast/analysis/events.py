"""Gait events: support phases, mid-stances, and the boundaries at which a stream is cut into half cycles (KS05)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from stridecast.geometry import signals
from stridecast.model.contacts import LEFT, RIGHT, Contacts
from stridecast.model.segment import RUN, STAND, WALK, Boundary, MidStance, Phase, Segment

SHORTEST_STATE = 0.06
"""A state shorter than this between two equal states is a blip, seconds."""

RUNNING_SPEED = 2.1
"""A step from foot to foot that shows neither double support nor flight: the walker's speed decides, m/s."""

FASTEST_WALK = 2.6
"""Nobody walks faster, m/s."""

SLOWEST_FLIGHT = 1.7
"""Nobody flies from step to step slower than this: such a gap between contacts is a double support missed, m/s ..."""

SHORTEST_FLIGHT = 0.06
"""... and up to running speed, so is a gap shorter than this, seconds."""

LONGEST_BRUSH = 0.1
"""Both feet on the floor for less than this in a run is a step with no air under it, as in sharp turns, seconds."""

NEAR_STANCES = 3
"""So many whole stances tell how long one is beside them that the take cuts short."""

LONGEST = 1.7
"""A moving segment longer than this is no half cycle, seconds."""

LONGEST_DOUBLE = 0.55
"""Walking with both feet on the floor for longer than this is a pause, seconds."""

HARD = 1.4
"""A half cycle of walking whose speed changes faster than this belongs to a transition, m/s2."""

MAX_WALKED_THROUGH = 3
"""So many walking half cycles between running and standing still are part of one transition."""


@dataclass(frozen=True, kw_only=True)
class Gait:
    """What the feet did in a take."""

    phases: tuple[Phase, ...]
    mid_stances: tuple[MidStance, ...]
    boundaries: tuple[Boundary, ...]
    segments: tuple[Segment, ...]


def find_gait(
    contacts: Contacts, heights: Float[np.ndarray, "frames"], speeds: Float[np.ndarray, "frames"], rate: float
) -> Gait:
    """Phases, mid-stances, boundaries and segments of a take.

    Parameters
    ----------
    contacts
        Which foot stands when.
    heights, speeds
        Height (m) and ground speed (m/s) of the centre of mass, smoothed.
    rate
        Frames a second.
    """
    phases = support_phases(contacts.support(), speeds, rate, heights)
    boundaries = find_boundaries(phases, heights, len(heights))
    return Gait(
        phases=tuple(phases),
        mid_stances=tuple(find_mid_stances(phases, len(heights))),
        boundaries=tuple(boundaries),
        segments=tuple(cut_segments(phases, boundaries, rate)),
    )


def support_phases(
    support: str,
    speeds: Float[np.ndarray, "frames"],
    rate: float,
    heights: Float[np.ndarray, "frames"] | None = None,
) -> list[Phase]:
    """Support states as phases that a gait can have.

    Blips between equal states go; double support next to standing is standing; a step from foot to foot with nothing in
    between gets one frame of double support or flight. Contacts are hard to find where one foot follows close upon the
    other: between walking and running there the bounce of the body decides, and its speed where heights are not known.
    """
    letters = np.array(list(support))
    # Double support and flight back to back: the shorter is noise. Then blips, shortest first.
    while True:
        phases = [Phase(str(v), a, b) for v, a, b in signals.runs(letters)]
        bad = [(p.stop - p.start, i) for i, p in enumerate(phases) if _is_noise(phases, i, rate)]
        if not bad:
            break
        i = min(bad)[1]
        letters[phases[i].start : phases[i].stop] = _replacement(phases, i)
    for i, here in enumerate(phases):
        running = _is_running(phases, i, speeds, heights)
        if i and {phases[i - 1].state, here.state} == {"L", "R"}:
            letters[here.start] = "F" if running else "D"
        elif here.state == "F" and _is_missed_double(here, float(speeds[here.start]), running, rate, len(letters)):
            letters[here.start : here.stop] = "D"
        elif here.state == "D" and running and here.stop - here.start < LONGEST_BRUSH * rate:
            letters[here.start : here.stop] = "F"
    return [Phase(str(v), a, b) for v, a, b in signals.runs(letters)]


def _is_noise(phases: list[Phase], i: int, rate: float) -> bool:
    here = phases[i]
    if i == 0 or i == len(phases) - 1:
        return False
    before, after = phases[i - 1], phases[i + 1]
    if here.state == "S":
        return False
    if before.state == after.state:
        return here.stop - here.start < SHORTEST_STATE * rate
    if here.state in "DF" and after.state in "DF":
        return True
    return here.state in "DF" and before.state in "DF"


def _is_running(
    phases: list[Phase], i: int, speeds: Float[np.ndarray, "frames"], heights: Float[np.ndarray, "frames"] | None
) -> bool:
    """Whether a change from foot to foot is one of running: a runner's body is high then, a walker's low.

    Where the take is cut too short to tell, the change beside it tells.
    """
    speed = speeds[phases[i].start]
    if heights is not None and SLOWEST_FLIGHT < speed < FASTEST_WALK:
        for beside in (0, -1, 1, -2, 2):
            high = _is_high(phases, i + beside, heights) if 0 <= i + beside < len(phases) else None
            if high is not None:
                return high
    return bool(speed > RUNNING_SPEED)


def _is_high(phases: list[Phase], i: int, heights: Float[np.ndarray, "frames"]) -> bool | None:
    """Whether the body is higher in a change from foot to foot than on the feet; None where that cannot be seen."""
    here = phases[i]
    before, after = phases[max(i - 1, 0)], phases[min(i + 1, len(phases) - 1)]
    if here.state in "LR":  # no state between the feet: they change at its first frame
        changes, around, middle = {before.state, here.state} == {"L", "R"}, (before, here), here.start
    else:
        changes, around = before.state in "LR" and after.state in "LR", (before, after)
        middle = (here.start + here.stop - 1) // 2
    whole = [p for p in around if p.state in "LR" and p.start > 0 and p.stop < len(heights)]
    if not whole or not changes:
        return None
    return bool(heights[middle] > np.mean([heights[(p.start + p.stop - 1) // 2] for p in whole]))


def _is_missed_double(flight: Phase, speed: float, running: bool, rate: float, frames: int) -> bool:
    """Whether a gap between contacts is none; one cut by the end of the take is not believed below running speed."""
    seen = flight.start > 0 and flight.stop < frames
    short = flight.stop - flight.start < SHORTEST_FLIGHT * rate
    return speed < SLOWEST_FLIGHT or (not running and (short or not seen))


def _replacement(phases: list[Phase], i: int) -> str:
    before, after = phases[i - 1].state, phases[i + 1].state
    return before if before == after or before in "DF" else after


def find_mid_stances(phases: list[Phase], frames: int) -> list[MidStance]:
    """Middle frame of the support phase of each foot (heel strike to toe-off, double supports included).

    A support phase that the take cuts short counts when at least two thirds of it are there, judged by the whole ones
    next to it; its middle is taken from the end that can be seen.
    """
    carried = [(p.start, p.stop, side) for side, letter in ((LEFT, "L"), (RIGHT, "R")) for p in _merged(phases, letter)]
    whole = sorted((a, b - a) for a, b, _ in carried if a > 0 and b < frames)
    found: list[MidStance] = []
    for a, b, side in carried:
        near = whole[:NEAR_STANCES] if a == 0 else whole[-NEAR_STANCES:]
        usual = float(np.median([length for _, length in near])) if near else np.inf
        if a > 0 and b < frames:
            found.append(MidStance((a + b - 1) / 2, side))
        elif b - a >= usual * 2 / 3 and (a > 0 or b < frames):
            found.append(MidStance(a + (usual - 1) / 2 if a > 0 else b - (usual + 1) / 2, side))
    return sorted(m for m in found if 0 <= m.frame <= frames - 1)


def _merged(phases: list[Phase], letter: str) -> list[Phase]:
    """Stretches in which one foot carries, its double supports included; standing ends a stretch."""
    out: list[Phase] = []
    for p in phases:
        if p.state not in (letter, "D"):
            continue
        if out and out[-1].stop == p.start:
            out[-1] = Phase(letter, out[-1].start, p.stop)
        else:
            out.append(Phase(letter, p.start, p.stop))
    single = [p for p in phases if p.state == letter]
    return [p for p in out if any(p.start <= s.start < p.stop for s in single)]


def find_boundaries(phases: list[Phase], heights: Float[np.ndarray, "frames"], frames: int) -> list[Boundary]:
    """One boundary for each single support of walking and each flight of running, and the ends of each standing.

    The place is the peak of the centre of mass's height inside the phase; the gait events guard it, so that a peak
    which is none, or one that is missing, makes no false segment. A phase cut by the take counts if its peak can be
    seen.
    """
    found: list[Boundary] = []
    for i, p in enumerate(phases):
        if p.state == "S":
            found += [Boundary(p.start, "S"), Boundary(p.stop - 1, "S")]
            continue
        before = phases[i - 1].state if i else ""
        after = phases[i + 1].state if i + 1 < len(phases) else ""
        if p.state == "F":
            landing = after if after in ("L", "R") else {"L": "R", "R": "L"}.get(before, "")
            kind = f"F{landing}" if landing else ""
        elif p.state in "LR" and (before or after):
            kind = "" if (before or "F") == "F" and (after or "F") == "F" else p.state
        else:
            kind = ""
        if kind:
            peak, inside = _peak(heights, p)
            if inside or (p.start > 0 and p.stop < frames):
                found.append(Boundary(peak, kind))
    return found


def _peak(heights: Float[np.ndarray, "frames"], phase: Phase) -> tuple[int, bool]:
    """Frame of the highest point inside a phase, or its middle where the height only rises or falls."""
    at = phase.start + int(np.argmax(heights[phase.start : phase.stop]))
    margin = max(1, (phase.stop - phase.start) // 8)
    if phase.start + margin <= at < phase.stop - margin:
        return at, True
    return (phase.start + phase.stop - 1) // 2, False


def cut_segments(phases: list[Phase], boundaries: list[Boundary], rate: float) -> list[Segment]:
    """Segments between neighbouring boundaries; longer ones than a half cycle can be are dropped."""
    out = []
    for start, stop in pairwise(boundaries):
        inside = [p for p in phases if p.start <= stop.frame and p.stop > start.frame]
        if stop.frame <= start.frame or _is_pause(start, stop, inside, rate):
            continue
        # Both feet stand: next to standing, double support is the same state.
        merged: list[Phase] = []
        for i, p in enumerate(inside):
            neighbours = {q.state for q in inside[max(i - 1, 0) : i + 2]}
            state = "S" if p.state == "D" and "S" in neighbours else p.state
            if merged and merged[-1].state == state:
                merged[-1] = Phase(state, merged[-1].start, p.stop)
            else:
                merged.append(Phase(state, p.start, p.stop))
        out.append(
            Segment(
                start=start,
                stop=stop,
                string="".join(p.state for p in merged),
                keys=tuple(p.start for p in merged[1:]),
                motion=_kind_of(start.kind, stop.kind),
            )
        )
    return out


def _is_pause(start: Boundary, stop: Boundary, inside: list[Phase], rate: float) -> bool:
    """Whether a stretch is neither standing nor a half cycle."""
    if start.kind == stop.kind == "S" and len(inside) == 1:
        return False
    long_double = any(p.state == "D" and p.stop - p.start > LONGEST_DOUBLE * rate for p in inside)
    between_steps = "S" not in (start.kind, stop.kind)
    return stop.frame - start.frame > LONGEST * rate or (between_steps and long_double)


def _kind_of(start: str, stop: str) -> str:
    ends = [STAND if kind == "S" else RUN if kind.startswith("F") else WALK for kind in (start, stop)]
    return ends[0] if ends[0] == ends[1] else f"{ends[0]}-{ends[1]}"


def label_motions(segments: Sequence[Segment], accelerations: Sequence[float]) -> list[Segment]:
    """Coarse motion of each segment, seen in its context.

    A few walking half cycles on the way from standing to running, or from running to standing, are part of that
    transition; between running and running they are part of the run (a foot brushed the floor in a sharp turn), as one
    flight between walking and walking is part of the walk (a heel strike was missed). So are those
    next to running in which the walker speeds up or brakes harder than walking does.

    Parameters
    ----------
    segments
        Of one take, in order.
    accelerations
        Mean tangential acceleration of the vehicle in each, m/s2.
    """
    labels = [s.motion for s in segments]
    follows = [False] + [a.stop == b.start for a, b in pairwise(segments)]
    for first, through, last, whole, most in (
        (f"{STAND}-{WALK}", WALK, f"{WALK}-{RUN}", f"{STAND}-{RUN}", MAX_WALKED_THROUGH),
        (f"{RUN}-{WALK}", WALK, f"{WALK}-{STAND}", f"{RUN}-{STAND}", MAX_WALKED_THROUGH),
        (f"{RUN}-{WALK}", WALK, f"{WALK}-{RUN}", RUN, MAX_WALKED_THROUGH),
        (f"{WALK}-{RUN}", RUN, f"{RUN}-{WALK}", WALK, 1),
    ):
        for i, label in enumerate(labels):
            if label != first:
                continue
            j = i + 1
            while j < len(segments) and labels[j] == through and follows[j]:
                j += 1
            if j < len(segments) and labels[j] == last and follows[j] and j - i - 1 <= most:
                labels[i : j + 1] = [whole] * (j + 1 - i)
    hard = [label == WALK and abs(a) > HARD for label, a in zip(labels, accelerations, strict=True)]
    for i in reversed(range(len(labels) - 1)):
        if hard[i] and follows[i + 1] and labels[i + 1].endswith(f"-{RUN}"):
            labels[i] = labels[i + 1]
    for i in range(1, len(labels)):
        if hard[i] and follows[i] and labels[i - 1].startswith(f"{RUN}-"):
            labels[i] = labels[i - 1]
    return [s if s.motion == label else replace(s, motion=label) for s, label in zip(segments, labels, strict=True)]
