"""Squad: spherical cubic interpolation of a series of rotations (Shoemake 1987; BJL's ``Qsquad``)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from stridecast.errors import InputError
from stridecast.geometry import quaternions as quat

Array = np.ndarray


def squad(
    times: Float[Array, "keys"], keys: Float[Array, "keys *shape 4"], at: Float[Array, "samples"]
) -> Float[Array, "samples *shape 4"]:
    """Rotations between keys: through every key, with a continuous angular velocity; slerp where that is even.

    Shoemake's control points assume keys at equal distances. Here each key has one for either side, so that the angular
    velocity is the same on both for any times: that of the parabola through the key and its neighbours, and at the ends
    that of the last chord. For keys at equal distances both are Shoemake's.

    Parameters
    ----------
    times
        Of the keys, rising.
    keys
        Unit quaternions ``w x y z``; neighbours less than half a turn apart.
    at
        When rotations are wanted; before the first key and after the last one these are held.

    Raises
    ------
    InputError
        No keys, or times that do not rise; the message says where.
    """
    if len(keys) == 0 or len(times) != len(keys):
        raise InputError(f"squad needs as many times as keys and at least one, not {len(times)} and {len(keys)}")
    steps = np.diff(times)
    if (steps <= 0).any():
        where = int(np.flatnonzero(steps <= 0)[0])
        raise InputError(f"times of keys must rise: {times[where + 1]} comes after {times[where]} (key {where + 1})")
    if len(keys) == 1:
        return np.repeat(keys, len(at), axis=0)
    h = steps.reshape(-1, *[1] * (keys.ndim - 1))
    chords = quat.log(quat.multiply(quat.inverse(keys[:-1]), keys[1:]))
    velocities = _velocities(chords, h)
    leave = quat.multiply(keys[:-1], quat.exp(0.5 * (h * velocities[:-1] - chords)))
    arrive = quat.multiply(keys[1:], quat.exp(0.5 * (chords - h * velocities[1:])))

    inside = np.clip(at, times[0], times[-1])
    k = np.clip(np.searchsorted(times, inside, side="right") - 1, 0, len(times) - 2)
    u = ((inside - times[k]) / steps[k]).reshape(-1, *[1] * (keys.ndim - 2))
    u = np.broadcast_to(u, (len(at), *keys.shape[1:-1]))
    along = quat.multiply(keys[k], quat.exp(u[..., None] * chords[k]))
    return quat.normalize(quat.slerp(along, quat.slerp(leave[k], arrive[k], u), 2 * u * (1 - u)))


def _velocities(chords: Float[Array, "pieces *shape 3"], h: Array) -> Float[Array, "keys *shape 3"]:
    """Angular velocity at each key, in the frame of the key."""
    rates = chords / h
    before, after = h[:-1], h[1:]
    inner = (after * rates[:-1] + before * rates[1:]) / (before + after)
    return np.concatenate((rates[:1], inner, rates[-1:]))
