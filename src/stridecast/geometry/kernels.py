"""Quaternions and small vectors for compiled code: plain tuples, ``(w, x, y, z)`` and ``(x, y, z)``."""

from __future__ import annotations

import math
import re
from functools import cache
from importlib import resources
from typing import Any

from numba import njit

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def kernel(function: Any) -> Any:
    """Compile a kernel: cached on disk, free of the interpreter lock, no exceptions on division (as in NumPy).

    Kernels make no arrays. So references need not be counted, which took two thirds of a step while tuples of a hundred
    arrays were handed from function to function.
    """
    options: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": False, "_nrt": False}
    dispatcher: Any = njit(**options)(function)
    # Numba looks at the kernel's own file only; a cached kernel would keep calling the old code of another file.
    dispatcher._cache._cache_file._source_stamp = _stamp(function.__module__)
    return dispatcher


@cache
def _stamp(module: str) -> tuple[tuple[str, float, int], ...]:
    """Every file of the package that a module is made of, itself and what it imports, with its time and size."""
    files: dict[str, tuple[float, int]] = {}
    todo = [module]
    while todo:
        name = todo.pop()
        path: Any = resources.files("stridecast").joinpath(*name.split(".")[1:-1], f"{name.split('.')[-1]}.py")
        if name in files or not (path.is_file() and hasattr(path, "stat")):
            continue  # seen already, a package, or in an archive
        files[name] = path.stat().st_mtime, path.stat().st_size
        todo += _IMPORT.findall(path.read_text())
    return tuple(sorted((name, *stat) for name, stat in files.items()))


_IMPORT = re.compile(r"^from (stridecast(?:\.\w+)+) import", re.MULTILINE)


def is_compiled(dispatcher: Any) -> bool:
    """Whether compiled code of a kernel lies ready on disk."""
    return bool(dispatcher._cache._cache_file._load_index())


@kernel
def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Rotation ``b`` followed by ``a``."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@kernel
def inverse(q: Quaternion) -> Quaternion:
    """Inverse of a unit quaternion."""
    return (q[0], -q[1], -q[2], -q[3])


@kernel
def rotate(q: Quaternion, v: Vector) -> Vector:
    """Vector ``v`` turned by ``q``."""
    tx = 2.0 * (q[2] * v[2] - q[3] * v[1])
    ty = 2.0 * (q[3] * v[0] - q[1] * v[2])
    tz = 2.0 * (q[1] * v[1] - q[2] * v[0])
    return (
        v[0] + q[0] * tx + q[2] * tz - q[3] * ty,
        v[1] + q[0] * ty + q[3] * tx - q[1] * tz,
        v[2] + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@kernel
def exp(v: Vector) -> Quaternion:
    """Quaternion of a rotation vector."""
    angle2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    if angle2 < 1e-12:
        s = 0.5 - angle2 / 48.0
        return (1.0 - angle2 / 8.0, s * v[0], s * v[1], s * v[2])
    angle = math.sqrt(angle2)
    s = math.sin(0.5 * angle) / angle
    return (math.cos(0.5 * angle), s * v[0], s * v[1], s * v[2])


@kernel
def normalize(q: Quaternion) -> Quaternion:
    """The quaternion scaled to unit length."""
    s = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (s * q[0], s * q[1], s * q[2], s * q[3])


@kernel
def about_y(angle: float) -> Quaternion:
    """Rotation about the vertical."""
    return (math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0)


@kernel
def twist_about_y(q: Quaternion) -> float:
    """Angle of the vertical part of ``q``, in [-pi, pi]."""
    return wrap(2.0 * math.atan2(q[2], q[0]))


@kernel
def wrap(angle: float) -> float:
    """Angle brought into [-pi, pi]."""
    return angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))


@kernel
def add(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def subtract(a: Vector, b: Vector) -> Vector:
    """Difference of two vectors."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scale(a: Vector, s: float) -> Vector:
    """Vector times number."""
    return (a[0] * s, a[1] * s, a[2] * s)


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def norm(a: Vector) -> float:
    """Length of a vector."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@kernel
def between(a: Vector, b: Vector) -> Quaternion:
    """Smallest rotation that turns direction ``a`` into direction ``b``; both are not zero and not opposite."""
    s = norm(a) * norm(b)
    c = cross(a, b)
    w = s + dot(a, b)
    if w < 1e-9 * s:
        return (1.0, 0.0, 0.0, 0.0)
    return normalize((w, c[0], c[1], c[2]))


@kernel
def decay(offset: float, rate: float, half_life: float, dt: float) -> tuple[float, float]:
    """A critically damped spring towards zero, integrated exactly over ``dt``: offset and rate of change after it."""
    y = 2.0 * math.log(2.0) / half_life
    j = rate + offset * y
    e = math.exp(-y * dt)
    return e * (offset + j * dt), e * (rate - j * y * dt)
