"""Nobody runs into anybody: the room in which each person can still stop is theirs alone.

Everybody has a *commitment*: where they are, frame by frame, if they brake from now on. No two commitments come nearer
to each other than the bodies are wide, at any frame, and none touches what stands. A step is taken only if the
commitment that follows it keeps that up against everybody else's old one, and against the new one of those who go
before; otherwise the person brakes, which the old commitment allows. So, by induction, bodies never overlap.
"""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.ground_kernels import room
from stridecast.crowd.state import Ground
from stridecast.geometry.kernels import kernel

HAIR = 0.002
"""What bodies keep from each other and from walls at least, metres."""


@kernel
def apart(one: np.ndarray, n: int, other: np.ndarray, m: int, shift: int, least: float) -> bool:
    """Whether two commitments stay ``least`` apart frame by frame; ``other`` is known from ``shift`` frames later."""
    least2 = least * least
    # Quick answer: the ways of both lie in circles about the middle of their ends, as nobody who brakes turns round.
    ox, oz = other[min(shift, m - 1), 0], other[min(shift, m - 1), 1]
    ex, ez = other[m - 1, 0], other[m - 1, 1]
    reach = 0.5 * (math.hypot(one[n - 1, 0] - one[0, 0], one[n - 1, 1] - one[0, 1]) + math.hypot(ex - ox, ez - oz))
    gap = math.hypot(0.5 * (one[0, 0] + one[n - 1, 0] - ox - ex), 0.5 * (one[0, 1] + one[n - 1, 1] - oz - ez))
    if gap > 1.05 * reach + least:
        return True
    for k in range(max(n, m - shift)):
        a, b = min(k, n - 1), min(k + shift, m - 1)
        dx, dz = one[a, 0] - other[b, 0], one[a, 1] - other[b, 1]
        if dx * dx + dz * dz < least2:
            return False
    return True


@kernel
def clear_of_ground(
    ground: Ground, things: np.ndarray, count: int, x: float, z: float, path: np.ndarray, n: int, radius: float
) -> bool:
    """Whether a commitment keeps clear of what stands; who is too near now, at ``(x, z)``, comes no nearer."""
    far = 1.05 * math.hypot(path[n - 1, 0] - path[0, 0], path[n - 1, 1] - path[0, 1])
    far += math.hypot(path[0, 0] - x, path[0, 1] - z)
    for m in range(count):
        now = room(ground, things[m], x, z)
        if now > far + radius + HAIR:
            continue
        least = min(radius + HAIR, now)
        for k in range(n):
            if room(ground, things[m], path[k, 0], path[k, 1]) < least:
                return False
    return True
