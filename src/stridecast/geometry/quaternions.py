"""Unit quaternions ``w x y z`` over any leading shape.

The product ``multiply(a, b)`` applies ``b`` first. A *rotation vector* is axis times angle, in radians: the tangent
vector whose exponential is the rotation. Every function broadcasts.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

Array = np.ndarray
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
_TINY = 1e-12


def multiply(a: Float[Array, "*#shape 4"], b: Float[Array, "*#shape 4"]) -> Float[Array, "*_ 4"]:
    """Hamilton product: the rotation ``b`` followed by ``a``."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        axis=-1,
    )


def inverse(q: Float[Array, "*shape 4"]) -> Float[Array, "*shape 4"]:
    """Inverse of unit quaternions (their conjugate)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: Float[Array, "*#shape 4"], v: Float[Array, "*#shape 3"]) -> Float[Array, "*_ 3"]:
    """Vectors ``v`` turned by ``q``."""
    w, u = q[..., :1], q[..., 1:]
    t = 2.0 * np.cross(u, v)
    return v + w * t + np.cross(u, t)


def normalize(q: Float[Array, "*shape 4"]) -> Float[Array, "*shape 4"]:
    """Quaternions scaled to unit length; a zero quaternion becomes the identity."""
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(length > _TINY, q / np.maximum(length, _TINY), IDENTITY)


def exp(v: Float[Array, "*shape 3"]) -> Float[Array, "*shape 4"]:
    """Quaternions of rotation vectors."""
    half = 0.5 * np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate((np.cos(half), 0.5 * np.sinc(half / np.pi) * v), axis=-1)


def log(q: Float[Array, "*shape 4"]) -> Float[Array, "*shape 3"]:
    """Rotation vectors of unit quaternions, the short way round (length at most pi)."""
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    small = sine < 1e-9
    return np.where(small, 2.0, angle / np.where(small, 1.0, sine)) * q[..., 1:]


def between(a: Float[Array, "*#shape 3"], b: Float[Array, "*#shape 3"]) -> Float[Array, "*_ 4"]:
    """Smallest rotation that turns direction ``a`` into direction ``b`` (any axis across, if they are opposite)."""
    a, b = np.broadcast_arrays(a, b)
    a = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), _TINY)
    b = b / np.maximum(np.linalg.norm(b, axis=-1, keepdims=True), _TINY)
    dot = np.sum(a * b, axis=-1, keepdims=True)
    q = np.concatenate((1.0 + dot, np.cross(a, b)), axis=-1)
    least = np.eye(3)[np.argmin(np.abs(a), axis=-1)]
    across = np.concatenate((np.zeros_like(dot), np.cross(a, least)), axis=-1)
    return normalize(np.where(dot < -1.0 + 1e-14, across, q))


def about_y(angle: Float[Array, "*shape"] | float) -> Float[Array, "*_ 4"]:
    """Rotation about the vertical, radians; the heading's rotation."""
    half = 0.5 * np.asarray(angle, np.float64)
    zero = np.zeros_like(half)
    return np.stack((np.cos(half), zero, np.sin(half), zero), axis=-1)


def twist_about_y(q: Float[Array, "*shape 4"]) -> Float[Array, "*shape"]:
    """Angle of the vertical part of ``q = about_y(angle) * rest``, in (-pi, pi] (KS07 "Motion Details")."""
    angle = 2.0 * np.arctan2(np.where(q[..., 0] < 0, -q[..., 2], q[..., 2]), np.abs(q[..., 0]))
    return np.where(angle > -np.pi, angle, np.pi)


def continuous(q: Float[Array, "frames *shape 4"]) -> Float[Array, "frames *shape 4"]:
    """Choose signs so that neighbours along the first axis lie on one side; the rotations stay the same."""
    flips = np.sum(q[1:] * q[:-1], axis=-1) < 0
    flipped = np.cumsum(flips, axis=0) % 2 == 1
    return np.concatenate((q[:1], np.where(flipped[..., None], -q[1:], q[1:])))


def slerp(
    a: Float[Array, "*#shape 4"], b: Float[Array, "*#shape 4"], t: Float[Array, "*#shape"] | float
) -> Float[Array, "*_ 4"]:
    """Shortest spherical interpolation from ``a`` (``t = 0``) to ``b`` (``t = 1``)."""
    return multiply(a, exp(np.asarray(t)[..., None] * log(multiply(inverse(a), b))))


def mean(
    q: Float[Array, "samples *shape 4"], weights: Float[Array, "samples"] | None = None
) -> Float[Array, "*shape 4"]:
    """Average rotation along the first axis: the largest eigenvector of the sum of outer products (Markley 2007)."""
    w = np.ones(len(q)) if weights is None else weights
    moment = np.einsum("n,n...i,n...j->...ij", w, q, q)
    best = np.linalg.eigh(moment)[1][..., -1]
    return np.where(best[..., :1] < 0, -best, best)


def from_euler(angles: Float[Array, "*shape axes"], order: str) -> Float[Array, "*shape 4"]:
    """Product of rotations about single axes, left to right as written in ``order`` (letters of ``XYZ``), radians.

    ``order="ZYX"`` is ``Rz * Ry * Rx``, as BVH channels are read.
    """
    q = np.broadcast_to(IDENTITY, (*angles.shape[:-1], 4))
    for k, axis in enumerate(order):
        half = 0.5 * angles[..., k]
        turn = np.zeros((*half.shape, 4))
        turn[..., 0] = np.cos(half)
        turn[..., 1 + "XYZ".index(axis)] = np.sin(half)
        q = multiply(q, turn)
    return q


def to_euler(q: Float[Array, "*shape 4"], order: str) -> Float[Array, "*shape 3"]:
    """Angles (radians) about the three axes of ``order``, all different: ``from_euler(angles, order)`` is ``q``."""
    i, j, k = ("XYZ".index(axis) for axis in order)
    m = to_matrix(q)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    sine = np.clip(sign * m[..., i, k], -1.0, 1.0)
    cosine = np.hypot(m[..., i, i], m[..., i, j])
    # where the first and third axes fall together only their sum is given: the third takes all of it
    first = np.where(cosine < 1e-9, 0.0, np.arctan2(-sign * m[..., j, k], m[..., k, k]))
    c, s = np.cos(first), sign * np.sin(first)
    third = np.arctan2(sign * (c * m[..., j, i] + s * m[..., k, i]), c * m[..., j, j] + s * m[..., k, j])
    return np.stack((first, np.arctan2(sine, cosine), third), axis=-1)


def to_matrix(q: Float[Array, "*shape 4"]) -> Float[Array, "*shape 3 3"]:
    """Rotation matrices (they act on column vectors)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angular_velocity(q: Float[Array, "frames *shape 4"], rate: float) -> Float[Array, "frames *shape 3"]:
    """Angular velocity in the outer frame, rad/s: central differences, one-sided at the ends, zero for one frame."""
    if len(q) < 2:
        return np.zeros((*q.shape[:-1], 3))
    step = log(multiply(q[1:], inverse(q[:-1]))) * rate
    return np.concatenate((step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]))
