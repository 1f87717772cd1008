"""Bounds on speed, acceleration and its change: how a person steers at most (KS07 "Speed and Acceleration Bounds")."""

from __future__ import annotations

from dataclasses import dataclass

from stridecast.errors import DatabaseError

Interval = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class SteeringBounds:
    """Bounds of one group, each at the first and the last frame of its segments; between them they run linearly.

    Parameters
    ----------
    jerk
        Largest change of acceleration, m/s3 (KS07's u_f, told per second so that the frame rate can change).
    tangential
        Least and greatest acceleration along the direction of motion, m/s2, at the first and at the last frame.
    lateral_per_speed
        Greatest acceleration across it as a multiple of the speed, 1/s: the largest turning speed.
    speed
        Least and greatest speed, m/s, at the first and at the last frame.
    assumed
        Names of bounds that are no learned ones, as the recordings show too little: nobody in them turns, for instance.
    """

    jerk: float
    tangential: tuple[Interval, Interval]
    lateral_per_speed: float
    speed: tuple[Interval, Interval]
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, pair in (("tangential", self.tangential), ("speed", self.speed)):
            for low, high in pair:
                if not low <= high:
                    raise DatabaseError(f"{name} bounds must run from low to high, not from {low} to {high}")
        if not (self.jerk > 0 and self.lateral_per_speed >= 0):
            raise DatabaseError("bounds on jerk and turning must be positive")

    @property
    def tangential_hull(self) -> Interval:
        """Least and greatest tangential acceleration anywhere in the segment, m/s2."""
        return min(low for low, _ in self.tangential), max(high for _, high in self.tangential)

    def turning_radius(self, speed: float) -> float:
        """Radius of the tightest turn at a speed, metres."""
        return speed / self.lateral_per_speed if self.lateral_per_speed else float("inf")
