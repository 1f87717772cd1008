"""How somebody goes through a scene (BJL section 3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from stridecast.errors import SceneError
from stridecast.model.segment import RUN, WALK

Array = np.ndarray

SIDES_OF_WAY = ("none", "left", "right")
DISTANCES = ("near", "far")
PATIENCE = ("wait", "go")
SIZES = ("calm", "neutral", "lively", "exaggerated")
"""Size of movement: gains per frequency band over the joint curves (BJL's status; Bruderlin and Williams 1995)."""

USUAL_WEIGHT = 70.0
"""Of whom turns are as wide as their speed asks for, kilograms."""


@dataclass(frozen=True, kw_only=True)
class Preference:
    """What somebody does where there is a choice.

    Parameters
    ----------
    side
        Passes obstacles and people on the ``left`` or ``right``; ``none``: whichever is shorter.
    distance
        Keeps ``near`` to what is passed, or ``far``.
    patience
        Would rather ``wait`` for what moves, or ``go`` first.
    """

    side: str = "none"
    distance: str = "near"
    patience: str = "go"

    def __post_init__(self) -> None:
        for name, known in (("side", SIDES_OF_WAY), ("distance", DISTANCES), ("patience", PATIENCE)):
            value = getattr(self, name)
            if value not in known:
                raise SceneError(f"preference.{name} is one of {', '.join(known)}, not {value!r}")


@dataclass(frozen=True, kw_only=True)
class Behavior:
    """How somebody goes (BJL's behavior parameters).

    Parameters
    ----------
    velocity
        Wished speed, m/s.
    weight
        Kilograms: the heavier and faster, the wider the turns (BJL eq. 1).
    status
        ``walk`` or ``run``.
    size
        How large movements are: one of ``SIZES``.
    style
        From gloomy (-1) to brisk (1); 0 is neutral. Walkers show it as far as their database does.
    preference
        What is done where there is a choice.
    body_radius
        Half the width that is kept free, metres.
    """

    velocity: float = 1.3
    weight: float = USUAL_WEIGHT
    status: str = WALK
    size: str = "neutral"
    style: float = 0.0
    preference: Preference = field(default_factory=Preference)
    body_radius: float = 0.3

    def __post_init__(self) -> None:
        for name, low, high in (
            ("velocity", 0.1, 12.0),
            ("weight", 20.0, 300.0),
            ("style", -1.0, 1.0),
            ("body_radius", 0.05, 2.0),
        ):
            value = getattr(self, name)
            if not (np.isfinite(value) and low <= value <= high):
                raise SceneError(f"{name} must lie between {low:g} and {high:g}, not at {value}")
        if self.status not in (WALK, RUN):
            raise SceneError(f"status is {WALK} or {RUN}, not {self.status!r}")
        if self.size not in SIZES:
            raise SceneError(f"size is one of {', '.join(SIZES)}, not {self.size!r}")


def ground_points(values: object, what: str, least: int) -> Float[Array, "points 2"]:
    """Ground points as an array that cannot be changed; ``least`` so many of them, and ``what`` names them.

    Raises
    ------
    SceneError
        They are no pairs of finite numbers, or too few.
    """
    try:
        out = np.array(values, np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{what}: points are pairs of numbers (x, z)") from None
    if out.ndim != 2 or out.shape[1] != 2 or len(out) < least:
        raise SceneError(f"{what}: {least} or more points (x, z) are needed, not an array of shape {out.shape}")
    if not np.isfinite(out).all():
        raise SceneError(f"{what}: point {int(np.flatnonzero(~np.isfinite(out).all(axis=1))[0])} is not finite")
    out.setflags(write=False)
    return out
