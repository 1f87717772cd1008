"""The ground plane: points ``(x, z)``, headings ``atan2(x, z)`` (0 faces +Z, positive turns left, towards +X)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

Array = np.ndarray


def project(points: Float[Array, "*shape 3"]) -> Float[Array, "*shape 2"]:
    """World points to ground points."""
    return points[..., [0, 2]]


def lift(points: Float[Array, "*shape 2"], height: Float[Array, "*#shape"] | float = 0.0) -> Float[Array, "*shape 3"]:
    """Ground points to world points at a height."""
    out = np.empty((*points.shape[:-1], 3))
    out[..., 0], out[..., 1], out[..., 2] = points[..., 0], height, points[..., 1]
    return out


def heading(direction: Float[Array, "*shape 2"]) -> Float[Array, "*shape"]:
    """Heading of a direction on the ground, radians; it has a value at (0, -1), where KS07 eq. 1 has none."""
    return np.asarray(np.arctan2(direction[..., 0], direction[..., 1]))


def direction(heading: Float[Array, "*shape"]) -> Float[Array, "*shape 2"]:
    """Unit direction on the ground of a heading."""
    return np.stack((np.sin(heading), np.cos(heading)), axis=-1)


def left_of(direction: Float[Array, "*shape 2"]) -> Float[Array, "*shape 2"]:
    """The direction a quarter turn to the left: ``(0, 1, 0) x direction``, KS07's lateral axis."""
    return np.stack((direction[..., 1], -direction[..., 0]), axis=-1)


def turn(points: Float[Array, "*#shape 2"], heading: Float[Array, "*#shape"]) -> Float[Array, "*_ 2"]:
    """Points of a frame that faces ``heading``, seen from the world: ``points = (left, forward)``."""
    c, s = np.cos(heading), np.sin(heading)
    x, z = points[..., 0], points[..., 1]
    return np.stack((c * x + s * z, -s * x + c * z), axis=-1)


def wrap(angle: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Angles brought into [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
