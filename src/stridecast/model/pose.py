"""What one frame shows: the vehicle and the body, of one character or of many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

Array = np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class VehicleState:
    """A person as an oriented particle on the floor (KS07 "Vehicle Model").

    Parameters
    ----------
    position, velocity, acceleration
        Ground points ``(x, z)``: m, m/s, m/s2.
    heading
        ``atan2(x, z)`` of the direction of motion, kept while standing; radians.
    """

    position: Float[Array, "*characters 2"]
    velocity: Float[Array, "*characters 2"]
    acceleration: Float[Array, "*characters 2"]
    heading: Float[Array, "*characters"] | float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class BoundsInForce:
    """The bounds that held in one frame; what the vehicle did lies within them.

    Parameters
    ----------
    jerk
        Greatest change of acceleration, m/s3.
    tangential
        Least and greatest acceleration along the last direction of motion, m/s2.
    lateral
        Greatest acceleration across it, m/s2.
    speed
        Least and greatest speed, m/s.
    """

    jerk: Float[Array, "*characters"] | float
    tangential: Float[Array, "*characters 2"]
    lateral: Float[Array, "*characters"] | float
    speed: Float[Array, "*characters 2"]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Pose:
    """One frame. Leading axes are characters; a single walker has none.

    Parameters
    ----------
    root_position
        Place of the root in the world, metres.
    rotations
        ``w x y z``, joint to parent, the root's in the world.
    vehicle
        Where the person steers.
    planted
        Which feet are held on the floor: left, right.
    motion, group
        Coarse motion (``walk``, ``stand-walk``, ...) and group (``walk/LDR``) of the segment that plays; one name for a
        single walker, a tuple for many.
    clamped
        Names of the bounds that acted (``jerk``, ``tangential``, ``lateral``, ``speed``); likewise.
    bounds
        The bounds in force.
    """

    root_position: Float[Array, "*characters 3"]
    rotations: Float[Array, "*characters joints 4"]
    vehicle: VehicleState
    planted: Bool[Array, "*characters 2"]
    motion: str | tuple[str, ...]
    group: str | tuple[str, ...]
    clamped: tuple[str, ...] | tuple[tuple[str, ...], ...]
    bounds: BoundsInForce
