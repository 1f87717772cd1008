"""A plan of speeds along a curve that a person can keep: looked ahead, so that the curve keeps its shape.

KS07 "Discussion" asks for it: who follows a moving point cuts corners; who knows the way slows down before them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from stridecast.errors import DatabaseError, PathError
from stridecast.geometry import signals
from stridecast.model.bounds import SteeringBounds
from stridecast.model.database import MotionDatabase
from stridecast.model.scene import Behavior, Station
from stridecast.model.segment import RUN, STAND, WALK
from stridecast.paths.curve import Curve

Array = np.ndarray

TURNING = 0.9
"""Share of the bound on turning that a plan uses up; the rest is for keeping to the curve."""

GATHERING = 0.75
"""The same for speeding up and braking, which have to build up and be taken back."""

CHANGING = 0.6
"""The same for the change of the force across, where a bend begins and ends."""

EASING = 0.15
"""Changes of speed are rounded over this time, seconds."""

ROUNDING = 0.25
"""From speeding up to braking it takes so long, seconds."""

BLUR = 0.12
"""Curvature is looked at over this length, metres: a kink in a curve is no bend to brake for."""

SLOWER = 0.05
"""A plan that goes slower than asked for by more than this says so, m/s."""

HALF_CYCLE = 0.5
"""So long it may take until what is asked for begins, seconds."""

BRAKING_WAY = 0.5
"""Before and after a bend that cannot be run people walk for so long, metres."""

SHORTEST_RUN = 4.0
"""Nobody breaks into a run for less, metres."""

FASTEST_CHANGE = 2.2
"""A run becomes a walk at this speed or below, m/s."""


@dataclass(frozen=True, kw_only=True)
class Slowed:
    """A stretch of the way on which the plan is slower than asked for.

    Parameters
    ----------
    start, stop
        Metres along the way.
    wished, planned
        The speed asked for and the lowest planned one, m/s.
    why
        ``bend``: nobody in the database turns so sharply so fast; ``motion``: nobody walks or runs so fast.
    """

    start: float
    stop: float
    wished: float
    planned: float
    why: str


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedPlan:
    """How fast to go where along a curve, from standing to standing.

    Parameters
    ----------
    distances
        Metres along the curve.
    speeds, accelerations
        Planned speed (m/s) and tangential acceleration (m/s2) there.
    rests_in
        Seconds from there to the end.
    motions
        ``walk``, ``run`` or, before the end, ``stand``: what to ask for there.
    behaviors
        Behavior from each of ``changes`` (metres along the curve) on.
    slowed
        Where the plan is slower than asked for.
    """

    distances: Float[Array, "samples"]
    speeds: Float[Array, "samples"]
    accelerations: Float[Array, "samples"]
    rests_in: Float[Array, "samples"]
    motions: tuple[str, ...]
    changes: tuple[float, ...]
    behaviors: tuple[Behavior, ...]
    slowed: tuple[Slowed, ...]

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return float(self.rests_in[0])

    def behavior_at(self, distance: float) -> Behavior:
        """Behavior asked for so far along the curve."""
        return self.behaviors[int(np.searchsorted(self.changes, distance + 1e-9, side="right")) - 1]


def plan_speeds(
    curve: Curve, database: MotionDatabase, behavior: Behavior | None = None, stations: Sequence[Station] = ()
) -> SpeedPlan:
    """Plan the speed along a curve inside the learned bounds (METHOD: forward-backward pass over curvature).

    Parameters
    ----------
    curve
        The way.
    database
        Whose bounds are kept.
    behavior, stations
        How to go, and where that changes.

    Raises
    ------
    PathError
        A station lies beyond the end of the way.
    DatabaseError
        The database cannot walk, or run, as is asked for.
    """
    changes, behaviors = _along(curve, behavior or Behavior(), stations)
    s = curve.distances
    part = np.searchsorted(changes, s + 1e-9, side="right") - 1
    wished = np.array([b.velocity for b in behaviors])[part]
    asked = np.array([b.status == RUN for b in behaviors])[part]
    own = {status: bounds_of(database, status) for status in {b.status for b in behaviors}}
    if RUN in own and WALK not in own:
        own[WALK] = next((g.bounds for g in database.groups if g.motion == WALK), own[RUN])

    # 1. Where running is asked for but a bend is too sharp for it, people walk.
    most = {status: _most(curve, bounds, wished) for status, bounds in own.items()}
    running = _runs(s, asked, most[RUN], slowest(own[RUN])) if RUN in own else asked
    status = [RUN if run else WALK for run in running]
    allowed = np.where(running, most.get(RUN, wished), most.get(WALK, wished))
    # Nobody walks more slowly than anybody in the database: such a bend will be cut.
    allowed = np.maximum(allowed, min(slowest(b) for b in own.values()))
    each = [own[name] for name in status]

    # 2. Speeds that can be gathered and lost in time.
    up = GATHERING * np.array([b.tangential_hull[1] for b in each])
    down = GATHERING * np.array([-b.tangential_hull[0] for b in each])
    jerk = np.array([b.jerk for b in each])
    # In a bend the force across comes round all the time, which takes a share of the jerk.
    spare = np.maximum(1.0 - np.abs(allowed**3 * _bend(curve) ** 2) / jerk, 0.3)
    up, down, jerk = spare * up, spare * down, spare * jerk
    walk = own.get(WALK, each[-1])
    gently = -GATHERING * walk.tangential_hull[0] * spare
    speeds = _reachable(s, _eased(s, allowed), up, down, jerk, greatest(walk), gently)
    rests_in = _time_left(s, speeds)
    possible = np.minimum(wished, np.array([greatest(b) for b in each]))
    return SpeedPlan(
        distances=s,
        speeds=speeds,
        accelerations=np.gradient(0.5 * speeds**2, s),
        rests_in=rests_in,
        motions=_asked_for(speeds, rests_in, status, slowest(walk)),
        changes=tuple(changes.tolist()),
        behaviors=tuple(behaviors),
        slowed=_slowed(s, wished, allowed, possible),
    )


def slowest(bounds: SteeringBounds) -> float:
    """The least speed at which a motion may be at any time, m/s."""
    return max(low for low, _ in bounds.speed)


def greatest(bounds: SteeringBounds) -> float:
    """The greatest one."""
    return 0.97 * min(high for _, high in bounds.speed)


def bounds_of(database: MotionDatabase, status: str) -> SteeringBounds:
    """Bounds of walking or running.

    Raises
    ------
    DatabaseError
        Nobody does so in the database.
    """
    for group in database.groups:
        if group.motion == status:
            return group.bounds
    known = sorted({group.motion for group in database.groups} & {WALK, RUN})
    raise DatabaseError(f"nobody {status}s in this database; its people {' and '.join(known) or 'only stand'}")


def _along(
    curve: Curve, behavior: Behavior, stations: Sequence[Station]
) -> tuple[Float[Array, "parts"], list[Behavior]]:
    """Where behavior changes, in order along the curve, and to what."""
    places = []
    for station in stations:
        if station.near is not None:
            at = float(curve.nearest(np.array([station.near]))[0])
        else:
            at = float(station.distance or 0.0)
            if at > curve.length:
                raise PathError(f"a station lies at {at:g} m, but the way is only {curve.length:.2f} m long")
        places.append((at, station))
    changes, behaviors = [0.0], [behavior]
    for at, station in sorted(places, key=lambda place: place[0]):
        changes.append(at)
        behaviors.append(station.after(behaviors[-1]))
    return np.array(changes), behaviors


def _most(curve: Curve, bounds: SteeringBounds, wished: Float[Array, "samples"]) -> Float[Array, "samples"]:
    """Greatest speed, up to the wished one, at which every bend can be taken.

    It depends on the force across, how it comes round, and how it builds up.
    """
    bend = _bend(curve)
    sharp = np.maximum(np.abs(bend), 1e-6)
    change = np.maximum(np.abs(np.gradient(bend, curve.distances)), 1e-6)
    return np.minimum.reduce(
        [
            np.minimum(wished, greatest(bounds)),
            TURNING * bounds.lateral_per_speed / sharp,
            np.cbrt(CHANGING * bounds.jerk / sharp**2),
            np.cbrt(CHANGING * bounds.jerk / change),
        ]
    )


def _bend(curve: Curve) -> Float[Array, "samples"]:
    """Curvature without its kinks, 1/m."""
    step = float(np.median(np.diff(curve.distances)))
    return gaussian_filter1d(curve.curvatures, BLUR / step, mode="nearest")


def _runs(
    s: Float[Array, "samples"], asked: Bool[Array, "samples"], most: Float[Array, "samples"], least: float
) -> Bool[Array, "samples"]:
    """Where running is asked for, possible, and long enough to be worth it."""
    step = float(np.median(np.diff(s)))
    possible = most > 1.05 * least
    possible = minimum_filter1d(possible.astype(int), 2 * round(BRAKING_WAY / step) + 1, mode="nearest") > 0
    out = asked & possible
    for value, start, stop in signals.runs(out):
        if value and s[stop - 1] - s[start] < SHORTEST_RUN and not (start == 0 and stop == len(s)):
            out[start:stop] = False
    return out


def _eased(s: Float[Array, "samples"], allowed: Float[Array, "samples"]) -> Float[Array, "samples"]:
    """The same speeds, never more, with changes rounded."""
    step = float(np.median(np.diff(s)))
    width = max(EASING * float(np.median(allowed)) / step, 0.5)
    low = minimum_filter1d(allowed, 2 * round(2 * width) + 1, mode="nearest")
    return np.minimum(gaussian_filter1d(low, width, mode="nearest"), allowed)


def _reachable(
    s: Float[Array, "samples"],
    allowed: Float[Array, "samples"],
    up: Float[Array, "samples"],
    down: Float[Array, "samples"],
    jerk: Float[Array, "samples"],
    walking: float,
    gently: Float[Array, "samples"],
) -> Float[Array, "samples"]:
    """Speeds that can be gathered and lost again in time, from standing to standing.

    A runner who stops ends walking: below the speed ``walking`` the braking is ``gently`` that of walking.
    """
    out = allowed.copy()
    out[0] = out[-1] = 0.0
    steps = np.diff(s)
    for i in range(len(steps)):  # forward: as fast as one can have become
        out[i + 1] = min(out[i + 1], np.sqrt(out[i] ** 2 + 2 * up[i] * steps[i]))
    for i in range(len(steps) - 1, -1, -1):  # backward: as fast as one can still brake
        brake = down[i + 1] if out[i + 1] > walking else min(down[i + 1], gently[i + 1])
        out[i] = min(out[i], np.sqrt(out[i + 1] ** 2 + 2 * brake * steps[i]))
    # Beside standing the force builds up and fades: v ~ t^2, so s ~ t^3.
    soft = 0.5 * 6 ** (2 / 3) * np.cbrt(GATHERING * jerk)
    out = np.minimum(out, np.minimum(soft * s ** (2 / 3), soft * (s[-1] - s) ** (2 / 3)))
    # Nobody brakes at the moment in which they cease to speed up: peaks are rounded.
    width = max(ROUNDING * float(np.median(out)) / float(np.median(steps)), 0.5)
    return np.minimum(out, gaussian_filter1d(out, width, mode="nearest"))


def _time_left(s: Float[Array, "samples"], speeds: Float[Array, "samples"]) -> Float[Array, "samples"]:
    mean = np.maximum(0.5 * (speeds[1:] + speeds[:-1]), 1e-3)
    times = np.diff(s) / mean
    # In the first and the last piece v ~ s^(2/3): three times as long as at the greater speed.
    for end, other in ((0, 1), (-1, -2)):
        times[end] = 3 * abs(s[end] - s[other]) / max(speeds[other], 1e-3)
    return np.concatenate((np.cumsum(times[::-1])[::-1], [0.0]))


def _asked_for(
    speeds: Float[Array, "samples"],
    rests_in: Float[Array, "samples"],
    status: Sequence[str],
    walking: float,
) -> tuple[str, ...]:
    """Motion to ask for: it is carried out at the next half cycle, so a stop is asked for ahead of time.

    A run becomes a walk once it is slow enough, also before the end: whoever stops on a spot walks the last step.
    """
    out = list(status)
    for i in range(len(out) - 2, -1, -1):
        stops = i + 1 < len(out) and rests_in[i] < rests_in[0] and out[i + 1] == WALK
        if out[i] == RUN and (stops or i == len(out) - 2) and speeds[i] < FASTEST_CHANGE:
            out[i] = out[i + 1] = WALK
    falling = len(out)
    low = min(1.1 * walking, 0.85 * float(speeds.max()))
    while falling > 0 and speeds[falling - 1] < low:
        falling -= 1  # from here on it is too slow for walking
    ahead = rests_in[min(falling, len(out) - 1)] + HALF_CYCLE
    return tuple(STAND if left < ahead else motion for left, motion in zip(rests_in, out, strict=True))


def _slowed(
    s: Float[Array, "samples"],
    wished: Float[Array, "samples"],
    allowed: Float[Array, "samples"],
    possible: Float[Array, "samples"],
) -> tuple[Slowed, ...]:
    """Stretches on which the plan is slower than asked for, but for starting and stopping."""
    out = []
    short = allowed < wished - SLOWER
    edges = np.flatnonzero(np.diff(np.concatenate(([False], short, [False])).astype(int)))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        worst = start + int(np.argmin(allowed[start:stop]))
        out.append(
            Slowed(
                start=float(s[start]),
                stop=float(s[stop - 1]),
                wished=float(wished[worst]),
                planned=float(allowed[worst]),
                why="bend" if allowed[worst] < possible[worst] - 1e-6 else "motion",
            )
        )
    return tuple(out)
