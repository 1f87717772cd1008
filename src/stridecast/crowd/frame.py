"""What one frame of a crowd shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

Array = np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class CrowdFrame:
    """Everybody who is there in one frame; arrays have a leading ``people`` axis.

    Parameters
    ----------
    time
        Seconds since the beginning.
    ids
        Numbers of the people, in the order in which they came, from 1.
    positions, velocities, accelerations
        Of the vehicles, ground points: m, m/s, m/s2.
    headings
        Radians.
    radii
        Of the bodies, metres.
    rules
        What each is up to (see ``crowd.rules.RULES``).
    heights
        Of the bodies, as a part of the database's.
    roots, rotations, planted
        Their poses, as of ``Pose``; nothing where the crowd has no bodies.
    movers
        Places of the moving obstacles.
    """

    time: float
    ids: Int[Array, "people"]
    positions: Float[Array, "people 2"]
    velocities: Float[Array, "people 2"]
    accelerations: Float[Array, "people 2"]
    headings: Float[Array, "people"]
    radii: Float[Array, "people"]
    rules: Int[Array, "people"]
    heights: Float[Array, "people"]
    roots: Float[Array, "people 3"] | None
    rotations: Float[Array, "people joints 4"] | None
    planted: Bool[Array, "people 2"] | None
    movers: Float[Array, "movers 2"]
