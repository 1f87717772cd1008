"""Curves to walk along, by name: ``line:6``, ``circle:3``, ``eight:2``, ``square:5``."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from stridecast.errors import InputError

Array = np.ndarray

STEP = 0.02
"""Points lie this far apart, metres."""

LONGEST = 10_000.0
"""Sizes beyond this are a mistake, metres."""


def line(length: float) -> Float[Array, "points 2"]:
    """Straight ahead, along +Z."""
    return np.array([[0.0, 0.0], [0.0, length]])


def circle(radius: float) -> Float[Array, "points 2"]:
    """Once round to the left, starting at the origin towards +Z."""
    angle = _angles(2 * math.pi * radius, 2 * math.pi)
    return radius * np.stack((1 - np.cos(angle), np.sin(angle)), axis=-1)


def eight(radius: float) -> Float[Array, "points 2"]:
    """A circle to the left, then one to the right."""
    left = circle(radius)
    return np.concatenate((left, left[1:] * np.array([-1.0, 1.0])))


def square(side: float) -> Float[Array, "points 2"]:
    """Four sides with sharp corners, to the left."""
    return side * np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])


CURVES: dict[str, tuple[Callable[[float], Array], float, str]] = {
    "line": (line, 6.0, "length"),
    "circle": (circle, 3.0, "radius"),
    "eight": (eight, 2.0, "radius"),
    "square": (square, 5.0, "side"),
}
"""Curve, its usual size, and what its size means; all sizes are in metres."""


def named_curve(text: str) -> Float[Array, "points 2"]:
    """The curve of a description such as ``circle:3``; without a number it has its usual size.

    Raises
    ------
    InputError
        An unknown name or a size that is no positive number; the message lists what there is.
    """
    name, _, size = text.partition(":")
    if name not in CURVES:
        known = ", ".join(f"{n}:{usual:g} ({what} in metres)" for n, (_, usual, what) in CURVES.items())
        raise InputError(f"there is no curve {name!r}; there are {known}")
    make, usual, what = CURVES[name]
    try:
        value = float(size) if size else usual
    except ValueError:
        value = math.nan
    if not 0 < value < LONGEST:
        raise InputError(f"the {what} of {name} must be a positive number of metres, not {size!r}")
    return make(value)


def _angles(length: float, turn: float) -> Float[Array, "points"]:
    return np.linspace(0.0, turn, max(16, math.ceil(length / STEP)) + 1)
