"""Motion details: the pelvis seen from its vehicle, and back (KS07 "Motion Details", "Adding Details")."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.vehicle import MotionDetails

Array = np.ndarray


def extract_details(
    pelvis_positions: Float[Array, "frames 3"],
    pelvis_rotations: Float[Array, "frames 4"],
    positions: Float[Array, "frames 2"],
    headings: Float[Array, "frames"],
) -> MotionDetails:
    """What the pelvis does about the vehicle at ``positions`` (ground points) with ``headings`` (radians)."""
    relative = pelvis_positions - ground.lift(positions)
    twist = quat.twist_about_y(pelvis_rotations)
    return MotionDetails(
        displacements=quat.rotate(quat.about_y(-headings), relative),
        yaws=np.unwrap(ground.wrap(twist - headings)),
        offsets=quat.multiply(quat.about_y(-twist), pelvis_rotations),
    )


def add_details(
    positions: Float[Array, "frames 2"], headings: Float[Array, "frames"], details: MotionDetails
) -> tuple[Float[Array, "frames 3"], Float[Array, "frames 4"]]:
    """Pelvis positions and rotations from a vehicle and its details; undoes ``extract_details``."""
    place = ground.lift(positions) + quat.rotate(quat.about_y(headings), details.displacements)
    return place, quat.multiply(quat.about_y(headings + details.yaws), details.offsets)
