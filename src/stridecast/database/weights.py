"""How much of each example a wish is blended of: never more than was recorded (BJL 4.2).

BJL weigh examples by one over the square of the difference, which is what makes the sum of squared weight times squared
difference smallest. Here the same sum is made smallest under two more conditions: no weight is negative, and the blend
shows exactly what is wished for. In ``bench/mining.py`` that did better than BJL's weights as they stand, than those of
the nearest few, and than radial basis functions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

Array = np.ndarray

NEIGHBOURS = 8
"""Examples that a wish is blended of, if they surround it; else twice as many, and so on."""

MET = 1e-4
"""A wish is met to within this, in scales."""

FIRM = 1e4
"""How firmly the conditions hold against the choice of neighbours."""


class Blend(NamedTuple):
    """Weights (sum 1, none negative), and what they show."""

    weights: Array
    reached: Array


def convex_weights(
    wish: Float[Array, "values"],
    values: Float[Array, "examples values"],
    distances: Float[Array, "examples"],
    shares: Float[Array, "examples"] | None = None,
) -> Blend:
    """Weigh examples so that they show a wish, or what is nearest to it.

    Parameters
    ----------
    wish
        What is wished for, in scales.
    values
        What each example shows of that, in scales.
    distances
        How far each example is from what is wanted, in that and other respects.
    shares
        Weight of an example's values in the mean that must meet the wish (its seconds); all alike if left out.
    """
    shares = np.ones(len(values)) if shares is None else shares / shares.mean()
    hits = np.flatnonzero(distances == 0.0)
    if len(hits):
        return _blend(np.eye(len(values))[hits[0]], values, shares)
    aim = _nearest_reachable(wish, values)
    order = np.argsort(distances, kind="stable")
    count = min(NEIGHBOURS, len(order))
    while True:
        near = order[:count]
        outside = distances[order[count]] if count < len(order) else np.inf
        weights = np.zeros(len(values))
        weights[near] = _least(aim, values[near], shares[near], distances[near], outside)
        blend = _blend(weights, values, shares)
        if count == len(order) or np.abs(blend.reached - aim).max(initial=0.0) < 10 * MET:
            return blend
        count = min(2 * count, len(order))


def _blend(weights: Array, values: Array, shares: Array) -> Blend:
    weights = weights / weights.sum()
    parts = weights * shares
    return Blend(weights, parts @ values / parts.sum())


def _nearest_reachable(wish: Array, values: Array) -> Array:
    """What a blend of the examples can show that is nearest to the wish: a point of their convex hull."""
    if values.shape[1] == 0:
        return wish
    middle = values.mean(axis=0)
    system = np.vstack(((values - wish).T, np.full(len(values), 1e3 * (1 + np.abs(values - middle).max()))))
    right = np.zeros(len(system))
    right[-1] = system[-1, 0]
    parts, _ = nnls(system, right)  # parts of the sum in which every example counts alike
    reached = parts @ values / parts.sum()
    return wish if np.abs(reached - wish).max() < MET else reached


def _least(aim: Array, values: Array, shares: Array, distances: Array, outside: float) -> Array:
    """Weights that show the aim and make the sum of squared weight times squared distance smallest.

    The square of the distance is one over (1/d2 less what the first example left out would get), so that weights fall
    to nothing where an example drops out of the neighbourhood.
    """
    worth = np.maximum(1.0 / distances**2 - 1.0 / outside**2, 1e-9 / distances**2)
    conditions = FIRM * np.vstack((np.ones(len(values)), ((values - aim) * shares[:, None]).T))
    cost = np.diag(np.sqrt(worth.max() / worth))
    right = np.zeros(len(conditions) + len(cost))
    right[0] = FIRM
    weights, _ = nnls(np.vstack((conditions, cost)), right)
    return weights if weights.sum() > 0 else worth
