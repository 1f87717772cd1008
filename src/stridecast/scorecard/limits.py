"""Whether people move as a human body can: bounds on speed, acceleration and jerk, and what exceeds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from stridecast.errors import InputError
from stridecast.scorecard.clock import Tracks

Array = np.ndarray

STILL = 0.05
"""Whoever is slower, m/s, has no direction of motion, in which parts of the acceleration could be told apart."""

TOLERANCE = 0.01
"""Bounds may be exceeded by this share of them before it counts."""

RESOLUTION = 1e-6
"""Positions are taken to be rounded to so many metres: what that can add to a difference does not count."""


@runtime_checkable
class Bounds(Protocol):
    """What a body can do at each speed; ``Limits`` is one."""

    @property
    def fastest(self) -> Any:
        """Greatest speed, m/s; of several gaits the last one's counts."""
        ...

    def at(self, speed: Float[Array, "rows"]) -> tuple[Array, Array, Array, Array]:
        """Jerk, least and greatest tangential, and greatest lateral acceleration at a speed."""
        ...


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Bounds that are the same at every speed (KS07 "Speed and Acceleration Bounds").

    Parameters
    ----------
    jerk
        Largest change of acceleration, m/s3.
    tangential
        Least and greatest acceleration along the direction of motion, m/s2.
    lateral_per_speed
        Greatest acceleration across it as a multiple of the speed, 1/s.
    fastest
        Greatest speed, m/s.

    Raises
    ------
    InputError
        Bounds that allow nothing.
    """

    jerk: float
    tangential: tuple[float, float]
    lateral_per_speed: float
    fastest: float

    def __post_init__(self) -> None:
        low, high = self.tangential
        for name in ("jerk", "lateral_per_speed", "fastest"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} must be above 0, not {getattr(self, name)}")
        if not low < 0 < high:
            raise InputError(
                f"tangential bounds must leave room to brake and to speed up, not run from {low} to {high}"
            )

    def at(self, speed: Float[Array, "rows"]) -> tuple[Array, Array, Array, Array]:
        """Jerk, least and greatest tangential, and greatest lateral acceleration at a speed."""
        low, high = self.tangential
        same = np.ones_like(speed)
        return self.jerk * same, low * same, high * same, self.lateral_per_speed * speed


@dataclass(frozen=True, kw_only=True)
class Violation:
    """How often one bound is exceeded.

    Parameters
    ----------
    count, samples
        So many of so many samples that could be judged.
    people
        Of so many people.
    worst
        The greatest value as a multiple of its bound, of those that count; 0 where there are none.
    """

    count: int
    samples: int
    people: int
    worst: float

    @property
    def share(self) -> float:
        """Of all samples that could be judged."""
        return self.count / self.samples if self.samples else 0.0


KINDS = ("speed", "tangential", "lateral", "jerk")
"""Bounds that can be exceeded."""


def as_bounds(given: Bounds | Mapping[str, Any]) -> Bounds:
    """Bounds as given, or of a mapping with the four numbers of ``Limits``.

    Raises
    ------
    InputError
        One is missing or unknown.
    """
    if not isinstance(given, Mapping):
        return given
    names = set(Limits.__dataclass_fields__)
    for words, what in ((names - set(given), "are missing"), (set(given) - names, "are none")):
        if words:
            raise InputError(f"bounds need {', '.join(sorted(names))}; {', '.join(sorted(words))} {what}")
    return Limits(**{**given, "tangential": tuple(given["tangential"])})


def violations(
    tracks: Tracks, bounds: Bounds, *, tolerance: float = TOLERANCE, resolution: float = RESOLUTION
) -> dict[str, Violation]:
    """Samples beyond human bounds, by kind.

    Differences from frame to frame are those of a step ``x += v dt, v += a dt`` (either order): what kept the bounds
    when it was made keeps them here. Acceleration is told apart along the velocity before it; below ``STILL`` only
    its amount is held against the larger tangential bound.

    Parameters
    ----------
    tolerance
        See ``TOLERANCE``.
    resolution
        See ``RESOLUTION``.
    """
    # Rounding to r moves a coordinate by r / 2: a difference by r, the next ones by 2 r and 4 r, the vectors by sqrt 2.
    rounding = np.sqrt(2.0) * resolution / tracks.step ** np.array([1.0, 2.0, 3.0]) * np.array([1.0, 2.0, 4.0])
    v, a, j = tracks.velocities, tracks.accelerations, tracks.jerks
    speed = np.linalg.norm(v, axis=-1)
    known = np.isfinite(a[:, 0])
    pace = np.where(np.isfinite(speed), speed, 0.0)
    jerk, low, high, lateral = bounds.at(pace)
    moving = known & (speed >= STILL)
    along = v / np.maximum(pace, STILL)[:, None]
    total = np.linalg.norm(a, axis=-1)
    tangential = np.sum(a * along, axis=-1)
    across = np.abs(a[:, 0] * along[:, 1] - a[:, 1] * along[:, 0])
    # a direction that is off by an angle mixes the parts by so much
    mixed = rounding[1] + np.where(known, total, 0.0) * rounding[0] / np.maximum(pace, STILL)
    amount = np.hypot(np.maximum(high, -low), lateral)
    bound = np.where(moving, np.where(tangential < 0, -low, high), amount)
    change = np.linalg.norm(j, axis=-1)
    # the change from one acceleration to the next belongs to the velocity at which the next one acts
    jerk = np.append(jerk[1:], jerk[-1:])
    fastest = float(np.max(bounds.fastest))
    values = {
        "speed": (speed, np.full(len(speed), fastest), np.full(len(speed), rounding[0]), np.isfinite(speed)),
        "tangential": (np.where(moving, np.abs(tangential), total), bound, mixed, known),
        "lateral": (across, lateral, mixed, moving),
        "jerk": (change, jerk, np.full(len(change), rounding[2]), np.isfinite(change)),
    }
    return {kind: _count(tracks, *columns, tolerance) for kind, columns in values.items()}


def _count(
    tracks: Tracks,
    value: Float[Array, "rows"],
    bound: Float[Array, "rows"],
    slack: Float[Array, "rows"],
    judged: Bool[Array, "rows"],
    tolerance: float,
) -> Violation:
    with np.errstate(invalid="ignore"):
        beyond = judged & (value > (1 + tolerance) * bound + slack)
    ratio = value[beyond] / np.maximum(bound[beyond], 1e-9)
    return Violation(
        count=int(beyond.sum()),
        samples=int(judged.sum()),
        people=len(np.unique(tracks.owners[beyond])),
        worst=float(ratio.max(initial=0.0)),
    )
