"""The vehicle: a person as an oriented particle on the floor (KS07 "Vehicle Model"), and the pelvis about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Array = np.ndarray


def _freeze(thing: object, *names: str) -> None:
    for name in names:
        array = np.array(getattr(thing, name), np.float64)
        array.setflags(write=False)
        object.__setattr__(thing, name, array)


@dataclass(frozen=True, kw_only=True, eq=False)
class VehicleTrajectory:
    """The path of a vehicle through a take, with the two curves it is the mean of (KS07 figure 3).

    Parameters
    ----------
    positions, velocities, accelerations, jerks
        Ground points ``(x, z)`` and their derivatives, metres and seconds, at the rate of the take.
    headings
        Direction of motion, radians, kept where the speed is close to zero; continuous, not wrapped.
    left, right
        The L-trajectory and the R-trajectory: smooth curves through the pelvis at the mid-stances of that foot.
    """

    positions: Float[Array, "frames 2"]
    velocities: Float[Array, "frames 2"]
    accelerations: Float[Array, "frames 2"]
    jerks: Float[Array, "frames 2"]
    headings: Float[Array, "frames"]
    left: Float[Array, "frames 2"]
    right: Float[Array, "frames 2"]

    def __post_init__(self) -> None:
        _freeze(self, "positions", "velocities", "accelerations", "jerks", "headings", "left", "right")

    @property
    def speeds(self) -> Float[Array, "frames"]:
        """Speed, m/s."""
        return np.linalg.norm(self.velocities, axis=-1)

    @property
    def tangential(self) -> Float[Array, "frames"]:
        """Acceleration along the heading, m/s2 (KS07 eq. 2, a_z)."""
        return self.accelerations[:, 0] * np.sin(self.headings) + self.accelerations[:, 1] * np.cos(self.headings)

    @property
    def lateral(self) -> Float[Array, "frames"]:
        """Acceleration to the left, m/s2 (KS07 eq. 2, a_x)."""
        return self.accelerations[:, 0] * np.cos(self.headings) - self.accelerations[:, 1] * np.sin(self.headings)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionDetails:
    """What the pelvis does about its vehicle (KS07 "Motion Details").

    Parameters
    ----------
    displacements
        Pelvis minus vehicle in the vehicle's frame (left, up, forward), metres.
    yaws
        Rotation of the pelvis about the vertical against the heading, radians.
    offsets
        What is left of the pelvis's rotation once its vertical part is taken out, ``w x y z``.
    """

    displacements: Float[Array, "frames 3"]
    yaws: Float[Array, "frames"]
    offsets: Float[Array, "frames 4"]

    def __post_init__(self) -> None:
        _freeze(self, "displacements", "yaws", "offsets")
