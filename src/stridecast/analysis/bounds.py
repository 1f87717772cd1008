"""Learn bounds from the vehicles of many segments (KS07 "Speed and Acceleration Bounds").

Most recordings run straight ahead. The plain 90 % of KS07 over all their frames then forbids the turns that the same
people make in the others. So samples are weighted until each cell of speed and of the quantity in question counts alike
(``balanced``); ``paper`` keeps the plain percentile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from stridecast.errors import InputError
from stridecast.model.bounds import Interval, SteeringBounds

Array = np.ndarray

METHODS = ("balanced", "paper")
SHARE = 0.9
"""So much of the samples lies within the bounds (KS07)."""

SPEED_CELL = 0.25
"""Width of a cell, m/s."""

SLOWEST = 0.6
"""Slower than this, a turn is no part of walking on, m/s."""

LEAST_JERK = 1.0
"""Even a recording of somebody as still as a statue gives a body that can be moved, m/s3."""

END_SHARE = 0.25
"""At each end of a transition, so much of the segment tells the bounds there."""


@dataclass(frozen=True, kw_only=True)
class LeastAbility:
    """What anybody can do: no recording falls below it by showing too little (units as in ``SteeringBounds``)."""

    jerk: float
    tangential: float
    lateral_per_speed: float


LEAST = {
    "stand": LeastAbility(jerk=3.0, tangential=0.5, lateral_per_speed=0.0),
    "walk": LeastAbility(jerk=3.0, tangential=0.8, lateral_per_speed=1.0),
    "run": LeastAbility(jerk=10.0, tangential=2.0, lateral_per_speed=1.0),
}
"""By motion. Most recordings go straight ahead at an even speed; a character who has seen no other could never turn."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SteeringSamples:
    """What the vehicle did in one segment, frame by frame: speed, both parts of the acceleration, and its change."""

    speeds: Float[Array, "frames"]
    tangential: Float[Array, "frames"]
    lateral: Float[Array, "frames"]
    jerks: Float[Array, "frames"]


def learn_cyclic(
    segments: Sequence[SteeringSamples], method: str = "balanced", least: LeastAbility | None = None
) -> SteeringBounds:
    """Bounds of a motion that repeats (walking, running, standing), the same at both ends.

    Parameters
    ----------
    segments
        What was recorded.
    method
        ``balanced`` or ``paper``.
    least
        What people can do at least, where the recordings show less; the bounds tell which of them were assumed so.

    Raises
    ------
    InputError
        An unknown method, or no segment.
    """
    if method not in METHODS:
        raise InputError(f"there is no way {method!r} to learn bounds; there are {', '.join(METHODS)}")
    if not segments:
        raise InputError("bounds cannot be learned from no segment")
    speeds = np.concatenate([s.speeds for s in segments])
    tangential = np.concatenate([s.tangential for s in segments])
    lateral = np.concatenate([s.lateral for s in segments])
    moving = speeds > SLOWEST
    turning = np.abs(lateral[moving]) / speeds[moving]
    middle, half = _tangential(speeds, tangential, method)
    jerk = max(LEAST_JERK, *(float(s.jerks.max()) for s in segments))
    across = _quantile(turning, _weights(speeds[moving], turning, SPEED_CELL, method))
    low, high = middle - half, middle + half
    assumed = []
    if least is not None:
        if jerk < least.jerk:
            assumed.append("jerk")
        if low > -least.tangential or high < least.tangential:
            assumed.append("tangential")
        if across < least.lateral_per_speed:
            assumed.append("lateral_per_speed")
        jerk, across = max(jerk, least.jerk), max(across, least.lateral_per_speed)
        low, high = min(low, -least.tangential), max(high, least.tangential)
    return SteeringBounds(
        jerk=jerk,
        tangential=((low, high),) * 2,
        lateral_per_speed=across,
        speed=(_range([s.speeds[0] for s in segments]), _range([s.speeds[-1] for s in segments])),
        assumed=tuple(assumed),
    )


def learn_transition(
    segments: Sequence[SteeringSamples],
    before: SteeringBounds | None,
    after: SteeringBounds | None,
    *,
    jerk: float = 0.0,
    arrives: bool = False,
) -> SteeringBounds:
    """Bounds of a transition: those at its two ends, each widened to the motion it joins there.

    A transition has a few examples at most, so at each end everything they did counts, and so does what the motion it
    comes from (or leads to) allows there: a walker who may begin it must be able to.

    Parameters
    ----------
    segments
        What its examples did.
    before, after
        Bounds of the motions at its first and last frame, where there are any.
    jerk
        It may change its force at least as fast as this, m/s3: as the motions between which it leads.
    arrives
        Whether the motion it leads to begins at its last frame; the tangential bounds there are then that motion's.
    """
    if not segments:
        raise InputError("bounds cannot be learned from no segment")
    tangential, speed = [], []
    for first, neighbour in ((True, before), (False, after)):
        ends = [_end(s, first) for s in segments]
        low, high = min(float(s.tangential.min()) for s in ends), max(float(s.tangential.max()) for s in ends)
        slow, fast = _range([s.speeds[0 if first else -1] for s in segments])
        if neighbour is not None and arrives and not first:
            low, high = neighbour.tangential_hull
        elif neighbour is not None:
            low, high = min(low, neighbour.tangential_hull[0]), max(high, neighbour.tangential_hull[1])
        if neighbour is not None:
            side = neighbour.speed[1 if first else 0]
            slow, fast = min(slow, side[0]), max(fast, side[1])
        tangential.append((min(low, 0.0), max(high, 0.0)))
        speed.append((slow, fast))
    # Who begins faster than the examples ends faster by as much, where they speed up.
    begun, ended = (max(float(s.speeds[end]) for s in segments) for end in (0, -1))
    if ended > begun:
        speed[1] = (speed[1][0], max(speed[1][1], ended + speed[0][1] - begun))
    neighbours = [n for n in (before, after) if n is not None]
    own = [float((np.abs(s.lateral) / np.maximum(s.speeds, SLOWEST)).max()) for s in segments]
    return SteeringBounds(
        jerk=max([jerk] + [float(s.jerks.max()) for s in segments] + [n.jerk for n in neighbours]),
        tangential=(tangential[0], tangential[1]),
        lateral_per_speed=max([n.lateral_per_speed for n in neighbours] or own),
        speed=(speed[0], speed[1]),
    )


def _tangential(speeds: Float[Array, "samples"], tangential: Float[Array, "samples"], method: str) -> Interval:
    """Mean of the tangential acceleration and the half width that holds ``SHARE`` of it."""
    weights = _weights(speeds, tangential, 2 * SPEED_CELL, method)
    middle = float(np.average(tangential, weights=weights))
    return middle, _quantile(np.abs(tangential - middle), weights)


def _end(samples: SteeringSamples, first: bool) -> SteeringSamples:
    """The first or last part of a segment."""
    count = max(1, round(END_SHARE * len(samples.speeds)))
    part = slice(0, count) if first else slice(-count, None)
    return SteeringSamples(
        speeds=samples.speeds[part],
        tangential=samples.tangential[part],
        lateral=samples.lateral[part],
        jerks=samples.jerks[part],
    )


def _weights(
    speeds: Float[Array, "samples"], values: Float[Array, "samples"], width: float, method: str
) -> Float[Array, "samples"]:
    """One over the number of samples in the same cell of speed and value; all one for the paper's plain percentile."""
    if method == "paper":
        return np.ones(len(speeds))
    cells = np.stack((np.floor(speeds / SPEED_CELL), np.floor(values / width)))
    _, which, counts = np.unique(cells, axis=1, return_inverse=True, return_counts=True)
    return 1.0 / counts[which.reshape(-1)]


def _quantile(values: Float[Array, "samples"], weights: Float[Array, "samples"]) -> float:
    """The value under which ``SHARE`` of the weight lies."""
    if len(values) == 0:
        return 0.0
    order = np.argsort(values)
    passed = np.cumsum(weights[order]) / weights.sum()
    return float(values[order][min(int(np.searchsorted(passed, SHARE)), len(values) - 1)])


def _range(values: Sequence[float]) -> Interval:
    return float(min(values)), float(max(values))
