"""Time warps: the same events of several motions at the same generic time (BJL figure 4; Park, Shin and Shin 2002)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from stridecast.errors import InputError

Array = np.ndarray


class TimeWarp:
    """A smooth rising map from generic time to a motion's own time, through given pairs of both.

    Parameters
    ----------
    generic, own
        Times of the same events, first and last moment included; both rise. Any unit.

    Raises
    ------
    InputError
        Fewer than two events, or times that do not rise.
    """

    def __init__(self, generic: Float[Array, "keys"], own: Float[Array, "keys"]) -> None:
        for name, times in (("generic", generic), ("own", own)):
            if len(times) < 2 or not (np.diff(times) > 0).all():
                raise InputError(f"{name} times of a time warp must be two or more and rise, not {times.tolist()}")
        if len(generic) != len(own):
            raise InputError(f"{len(generic)} events in generic time and {len(own)} in the motion's: they must agree")
        self.generic, self.own = generic, own
        # Slopes that never let time run back (Fritsch and Carlson 1980); at the ends time goes on as in the first and
        # the last piece, for there the usual slope may be zero, and a motion would freeze.
        slopes = PchipInterpolator(generic, own).derivative()(generic)
        slopes[[0, -1]] = (np.diff(own) / np.diff(generic))[[0, -1]]
        self._curve = CubicHermiteSpline(generic, own, slopes)
        self._slope = self._curve.derivative()

    def to_own(self, generic: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """Own time at generic times; beyond the ends that of the ends."""
        return np.asarray(self._curve(np.clip(generic, self.generic[0], self.generic[-1])))

    def slope(self, generic: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """Own time that passes per generic time."""
        return np.asarray(self._slope(np.clip(generic, self.generic[0], self.generic[-1])))

    def to_generic(self, own: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """Generic time at own times: undoes ``to_own``."""
        return invert(self.to_own, self.generic, self.own, own)


def invert(
    rising: Callable[[Array], Array],
    inputs: Float[Array, "knots"],
    outputs: Float[Array, "knots"],
    wanted: Float[Array, "*shape"],
) -> Float[Array, "*shape"]:
    """Where a rising function takes the values wanted, by bisection between knots at which it is known."""
    k = np.clip(np.searchsorted(outputs, wanted, side="right") - 1, 0, len(outputs) - 2)
    low, high = inputs[k], inputs[k + 1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = rising(middle) < wanted
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))


def mean_keys(keys: Sequence[Float[Array, "keys"]]) -> Float[Array, "keys"]:
    """Generic times of the same events of several motions: 0 to 1, the mean of where each motion has them.

    Raises
    ------
    InputError
        Motions with different numbers of events.
    """
    if len({len(own) for own in keys}) != 1:
        raise InputError(f"motions must have the same number of events, not {[len(own) for own in keys]}")
    return np.mean([(own - own[0]) / (own[-1] - own[0]) for own in keys], axis=0)


def incremental(
    warps: Sequence[TimeWarp], weights: Float[Array, "motions points"], count: int
) -> tuple[Float[Array, "points"], Float[Array, "points"]]:
    """Time that a blend takes: ``dt = sum w_i dt_i``, summed up over generic time (Park, Shin and Shin 2002).

    Parameters
    ----------
    warps
        One a motion, of one generic time.
    weights
        Of each motion at ``count`` points evenly over generic time; they may change on the way.
    count
        Points.

    Returns
    -------
    The points in generic time, and the time of the blend at each.
    """
    points = np.linspace(warps[0].generic[0], warps[0].generic[-1], count)
    steps = np.stack([np.diff(warp.to_own(points)) for warp in warps])
    passed = np.sum(0.5 * (weights[:, 1:] + weights[:, :-1]) * steps, axis=0)
    return points, np.concatenate(([0.0], np.cumsum(passed)))
