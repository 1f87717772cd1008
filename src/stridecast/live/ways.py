"""Lines drawn by hand: joined to where the walker is, and run along by a point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from stridecast.errors import PathError
from stridecast.geometry import ground
from stridecast.model.pose import Pose

Array = np.ndarray

SPACING = 0.1
"""Points of a drawn line that lie closer together tell nothing, metres."""

JOINED = 0.3
"""A line that begins nearer to the walker than this begins at the walker, metres."""

RADIUS = 0.5
"""Of the turn by which a line is reached that does not begin straight ahead, metres."""

AHEAD = 0.8
"""The point waits when it is further ahead than the walker is used to keep behind, and this, metres."""

SHORTEST, LONGEST = 0.3, 1000.0
"""A shorter line is no way, and a longer one is a mistake, metres."""


def way_of(
    position: Float[Array, "2"], heading: float, drawn: Sequence[tuple[float, float]]
) -> Float[Array, "points 2"]:
    """A drawn line from where the walker is.

    Parameters
    ----------
    position, heading
        Of the walker, metres and radians.
    drawn
        Points as they were drawn, metres.

    Raises
    ------
    PathError
        It is too short or too long.
    """
    points = np.array(drawn, np.float64)
    kept = [points[0]]
    for point in points[1:]:
        if np.hypot(*(point - kept[-1])) >= SPACING:
            kept.append(point)
    line = np.array(kept)
    if np.hypot(*(line[0] - position)) < JOINED and len(line) > 1:
        line = line[1:]
    length = float(np.linalg.norm(np.diff(np.concatenate((position[None], line)), axis=0), axis=-1).sum())
    if length < SHORTEST:
        raise PathError(f"the line is {length:.2f} m long from where the walker is; draw at least {SHORTEST} m")
    if length > LONGEST:
        raise PathError(f"the line is {length:.0f} m long; {LONGEST:.0f} m are the most")
    arc = _arc(position, heading, line[0])
    outside = np.hypot(*(line - arc[-1]).T) > SPACING
    first = int(np.argmax(outside)) if outside.any() else len(line) - 1
    return np.concatenate((arc, line[first:]))


def _arc(position: Float[Array, "2"], heading: float, goal: Float[Array, "2"]) -> Float[Array, "points 2"]:
    """From a place round to where a goal lies straight ahead, on a circle of ``RADIUS`` to its side."""
    away = ground.turn(goal - position, np.array(-heading))  # left, forward
    side = 1.0 if away[0] >= 0 else -1.0
    x, z = side * float(away[0]) - RADIUS, float(away[1])  # from the centre of the circle
    far = float(np.hypot(x, z))
    # The tangent from the goal leaves the circle where radius and goal enclose this angle.
    opens = np.arccos(RADIUS / far) if far > RADIUS else 0.0
    angle = float(np.mod(np.arctan2(z, -x) - opens, 2 * np.pi))
    if angle > np.radians(350) or angle < np.radians(3):
        return position[None]
    turned = np.linspace(0.0, angle, max(2, int(angle * RADIUS / SPACING) + 1))
    local = np.stack((side * RADIUS * (1 - np.cos(turned)), RADIUS * np.sin(turned)), axis=-1)
    return position + ground.turn(local, np.array(heading))


class Run:
    """A point that runs along a line, and waits for who follows it (KS07: a curve becomes a point stream).

    Parameters
    ----------
    points
        Ground points, joined by straight lines, metres.
    """

    def __init__(self, points: Float[Array, "points 2"]) -> None:
        steps = np.linalg.norm(np.diff(points, axis=0), axis=-1)
        keep = np.concatenate(([True], steps > 1e-9))
        self.points = points[keep]
        self._along = np.concatenate(([0.0], np.cumsum(steps[keep[1:]])))
        self.length = float(self._along[-1])
        self.place = 0.0

    def at(self, place: float) -> Float[Array, "2"]:
        """The point of the line so far along it, metres."""
        return np.array([np.interp(place, self._along, self.points[:, axis]) for axis in (0, 1)])

    def advance(self, position: Float[Array, "2"], speed: float, lag: float, dt: float) -> Float[Array, "2"]:
        """Run on for a while unless the walker is too far behind; where the point is then."""
        point = self.at(self.place)
        if np.hypot(*(point - position)) < speed * lag + AHEAD:
            self.place = min(self.length, self.place + speed * dt)
        return self.at(self.place)

    def see(self, pose: Pose) -> bool:
        """Whether the point is at the end, and the walker stands beside it."""
        at_rest = pose.motion == "stand" and float(np.hypot(*pose.vehicle.velocity)) < 0.02
        return self.place >= self.length and at_rest
