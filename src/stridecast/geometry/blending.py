"""Weighted means of rotations (BJL eq. 3)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from stridecast.geometry import quaternions as quat

Array = np.ndarray

ROUNDS = 12
"""So often the reference moves to the mean at most; rotations less than a right angle apart need four or five."""


def about(
    reference: Float[Array, "*shape 4"], q: Float[Array, "samples *shape 4"], weights: Float[Array, "samples *leading"]
) -> Float[Array, "*shape 4"]:
    """Blend rotations in the tangent space of one: ``reference * exp(sum w_i log(reference^-1 q_i))`` (BJL eq. 3).

    BJL print the logarithm the other way round and leave the reference out; this is what they mean. It is the mean that
    ``blend`` finds as far as the rotations lie close to the reference.

    Parameters
    ----------
    reference
        About which logarithms are taken.
    q
        What is blended, along the first axis.
    weights
        At least zero, with sum one along the first axis; for all rotations of a sample alike, or one for each along
        leading axes of its shape (frames, for instance).
    """
    w = weights.reshape(weights.shape + (1,) * (q.ndim - weights.ndim))
    tangents = quat.log(quat.multiply(quat.inverse(reference), q))
    return quat.normalize(quat.multiply(reference, quat.exp(np.sum(w * tangents, axis=0))))


def blend(q: Float[Array, "samples *shape 4"], weights: Float[Array, "samples *leading"]) -> Float[Array, "*shape 4"]:
    """Weighted mean of rotations: ``about`` with its reference moved to the result until it rests there.

    Where the weighted sum of logarithms about a rotation vanishes, that rotation is the mean (Buss and Fillmore 2001):
    it does not depend on where the search begins, and who exchanges or mirrors the samples exchanges or mirrors the
    mean. One sample with all the weight is given back as it is.

    Parameters are those of ``about``.
    """
    w = np.broadcast_to(weights.reshape(weights.shape + (1,) * (q.ndim - 1 - weights.ndim)), q.shape[:-1])
    heaviest = np.argmax(w, axis=0)
    mean = np.take_along_axis(q, heaviest[None, ..., None], axis=0)[0]
    for _ in range(ROUNDS):
        step = np.sum(w[..., None] * quat.log(quat.multiply(quat.inverse(mean), q)), axis=0)
        mean = quat.multiply(mean, quat.exp(step))
        if np.abs(step).max(initial=0.0) < 1e-12:
            break
    return quat.normalize(mean)
