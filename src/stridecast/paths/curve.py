"""Curves on the ground to go along: Hermite curves through control points, and what a user draws (BJL section 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import make_interp_spline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from stridecast.errors import PathError
from stridecast.geometry import ground
from stridecast.model.scene import USUAL_WEIGHT, Behavior

Array = np.ndarray

STEP = 0.02
"""Points of a curve lie this far apart, metres, or a little less."""

LONGEST = 50_000.0
"""Curves beyond this are a mistake, metres."""

SHORTEST_TANGENT = 0.6
LONGEST_TANGENT = 1.2
"""Limits of a tangent, in chords of the piece that it belongs to: shorter ones would make a corner of the control
point, longer ones could make a cusp or a loop. Along the chord a tangent never reaches three chords (Fritsch and
Carlson 1980), so every piece runs forwards wherever neither end points back."""

_FINE = 256
"""Places per piece at which its length is measured."""


class Place(NamedTuple):
    """A place on a curve: point ``(x, z)``, unwrapped heading in radians, curvature in 1/m, positive to the left."""

    point: Float[Array, "*shape 2"]
    heading: Float[Array, "*shape"]
    curvature: Float[Array, "*shape"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A way on the ground, known at equal steps of about ``STEP``.

    Parameters
    ----------
    controls
        Control points ``(x, z)``, metres.
    tangents
        Tangents at them, metres per piece; of a drawn curve only their directions mean anything.
    points
        Points ``(x, z)`` at ``distances``, metres.
    headings
        Direction of travel there, radians, unwrapped.
    curvatures
        How fast the heading changes there, radians per metre, positive to the left.
    """

    controls: Float[Array, "controls 2"]
    tangents: Float[Array, "controls 2"]
    points: Float[Array, "points 2"]
    headings: Float[Array, "points"]
    curvatures: Float[Array, "points"]
    distances: Float[Array, "points"]

    def __post_init__(self) -> None:
        for name in ("controls", "tangents", "points", "headings", "curvatures", "distances"):
            array = np.array(getattr(self, name), np.float64)
            if not np.isfinite(array).all():
                raise PathError(f"a curve's {name} must be finite numbers")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if len(self.points) < 2 or not (np.diff(self.distances) > 0).all():
            raise PathError("a curve needs two or more points at growing distances")

    def __repr__(self) -> str:
        return f"Curve({self.length:.2f} m, {len(self.controls)} control points)"

    @property
    def length(self) -> float:
        """From the first point to the last, metres."""
        return float(self.distances[-1])

    @property
    def step(self) -> float:
        """Distance from point to point, metres."""
        return self.length / (len(self.distances) - 1)

    def at(self, distance: Float[Array, "*shape"] | float) -> Place:
        """Places after so many metres; before the start and beyond the end it goes straight on.

        Parameters
        ----------
        distance
            Along the curve, metres, any shape.
        """
        given = np.asarray(distance, np.float64)
        along = np.clip(given, 0.0, self.length)
        place = along / self.step
        first = np.minimum(place.astype(np.int64), len(self.distances) - 2)
        part = place - first
        heading = np.asarray((1 - part) * self.headings[first] + part * self.headings[first + 1])
        point = (1 - part)[..., None] * self.points[first] + part[..., None] * self.points[first + 1]
        point = point + (given - along)[..., None] * ground.direction(heading)
        curvature = (1 - part) * self.curvatures[first] + part * self.curvatures[first + 1]
        return Place(point, heading, np.where(given == along, curvature, 0.0))

    def nearest(self, points: Float[Array, "*shape 2"]) -> Float[Array, "*shape"]:
        """Distance along the curve of the place that is nearest to each point, metres; of equals the first.

        Parameters
        ----------
        points
            Ground points ``(x, z)``, metres.
        """
        points = np.asarray(points, np.float64)
        _, found = self._tree.query(points)
        best = np.zeros(points.shape[:-1])
        least = np.full(points.shape[:-1], np.inf)
        for shift in (-1, 0):  # the two pieces that meet at the nearest point
            first = np.clip(found + shift, 0, len(self.points) - 2)
            ends = self.points[first + 1] - self.points[first]
            square = np.maximum((ends * ends).sum(-1), 1e-300)
            part = np.clip(((points - self.points[first]) * ends).sum(-1) / square, 0.0, 1.0)
            away = np.linalg.norm(points - self.points[first] - part[..., None] * ends, axis=-1)
            closer = away < least
            best = np.where(closer, (first + part) * self.step, best)
            least = np.where(closer, away, least)
        return np.asarray(np.minimum(best, self.length))

    @property
    def _tree(self) -> cKDTree:
        tree = self.__dict__.get("_known_tree")
        if tree is None:
            tree = cKDTree(self.points)
            object.__setattr__(self, "_known_tree", tree)
        return tree

    @classmethod
    def hermite(cls, controls: Float[Array, "controls 2"], behavior: Behavior | None = None) -> Curve:
        """Curve through control points, with BJL's tangents.

        Parameters
        ----------
        controls
            Ground points ``(x, z)``, metres, two or more, neighbours apart from each other.
        behavior
            Whose velocity and weight make the turns wide or narrow.

        Raises
        ------
        PathError
            Fewer than two points, not finite, or the same one twice in a row.
        """
        controls = _checked(controls)
        if (np.linalg.norm(np.diff(controls, axis=0), axis=-1) < 1e-6).any():
            raise PathError("two control points in a row are the same")
        arriving, leaving = limited_tangents(controls, tangents(controls, behavior or Behavior()))
        return _sampled(controls, arriving, leaving)

    @classmethod
    def through(cls, points: Float[Array, "points 2"], *, rounding: float = 0.1) -> Curve:
        """Curve along any line of points, such as a path that a user draws.

        The line is smoothed along its length by a bell curve whose mean width is ``rounding``: since a point moves to
        a mean of points of the line that lie on average so far away, nothing moves further than that, ends not at all.
        Corners become round, straight pieces stay, the trembling of a hand goes.

        Parameters
        ----------
        points
            Ground points ``(x, z)``, metres, at any spacing; repeated ones count once.
        rounding
            How far the curve may be from the line, metres. 0 keeps corners: heading jumps there, within one step.

        Raises
        ------
        PathError
            No two different points, not finite, too long, or a ``rounding`` that is none.
        """
        if not (math.isfinite(rounding) and rounding >= 0):
            raise PathError(f"rounding must be a number of metres from 0, not {rounding}")
        points = _checked(points)
        apart = np.linalg.norm(np.diff(points, axis=0), axis=-1) > 1e-9
        points = points[np.concatenate(([True], apart))]
        if len(points) < 2:
            raise PathError("a curve needs at least two different points")
        dense = _smoothed(points, rounding / math.sqrt(2 / math.pi)) if rounding > 0 else _even(points, STEP)
        keep = points if len(points) <= 64 else points[np.linspace(0, len(points) - 1, 64).astype(int)]
        return _from_points(dense, keep)


def tangents(controls: Float[Array, "controls 2"], behavior: Behavior) -> Float[Array, "controls 2"]:
    """Tangents at control points, metres: BJL eq. 1, ``(norm(C[i+1] - C[i-1]) + norm(C[i] - C[i-1])) v w``.

    ``norm`` makes a direction, ``v`` is the velocity in m/s (tangents last one second), ``w`` the weight in units of
    70 kg. At the ends, where the equation says nothing, the direction is the one that bends the curve least (no second
    derivative). Where the way goes back to the point before, the direction is that of arrival.
    """
    strength = behavior.velocity * behavior.weight / USUAL_WEIGHT
    chords = _units(np.diff(controls, axis=0))
    out = np.empty_like(controls)
    across = controls[2:] - controls[:-2]
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    out[1:-1] = np.where(length > 1e-9, across / np.maximum(length, 1e-9), 0.0) + chords[:-1]
    out[0], out[-1] = 2 * chords[0], 2 * chords[-1]
    if len(controls) > 2:
        out[0] = 2 * _units(3 * chords[0] - _units(out[1]))
        out[-1] = 2 * _units(3 * chords[-1] - _units(out[-2]))
    return out * strength


def limited_tangents(
    controls: Float[Array, "controls 2"], wished: Float[Array, "controls 2"]
) -> tuple[Float[Array, "controls 2"], Float[Array, "controls 2"]]:
    """Tangents as they arrive at and leave each control point: of equal direction, each as long as its piece bears.

    A tangent that is long for its piece is cut to ``LONGEST_TANGENT`` chords, one that is short lengthened to
    ``SHORTEST_TANGENT`` of it. The direction of a tangent that had to be cut also comes nearer to that of a circle
    through the point and its neighbours: BJL's holds on to the direction of arrival, and many points in short distances
    would make it sway.
    """
    chords = np.diff(controls, axis=0)
    lengths = np.linalg.norm(chords, axis=-1)
    size = np.linalg.norm(wished, axis=-1)
    direction = _units(wished)
    if len(controls) > 2:
        ways = _units(chords)
        even = ways[:-1] * lengths[1:, None] + ways[1:] * lengths[:-1, None]
        share = np.minimum(lengths[:-1], lengths[1:]) * LONGEST_TANGENT / np.maximum(size[1:-1], 1e-9)
        share = np.clip(share, 0.0, 1.0)[:, None]
        length = np.linalg.norm(even, axis=-1, keepdims=True)
        mixed = share * direction[1:-1] + (1 - share) * even / np.maximum(length, 1e-9)
        direction[1:-1] = np.where(length > 1e-6 * lengths.min(), _units(mixed), direction[1:-1])
    limits = (SHORTEST_TANGENT * lengths, LONGEST_TANGENT * lengths)
    arriving, leaving = direction * size[:, None], direction * size[:, None]
    leaving[:-1] = direction[:-1] * np.clip(size[:-1], *limits)[:, None]
    arriving[1:] = direction[1:] * np.clip(size[1:], *limits)[:, None]
    return arriving, leaving


def _sampled(controls: Array, arriving: Array, leaving: Array) -> Curve:
    """Points of a Hermite curve at equal steps, headings and curvatures from its derivatives."""
    u = np.linspace(0.0, 1.0, _FINE + 1)
    pieces = len(controls) - 1
    speed = np.linalg.norm(_piece(controls, arriving, leaving, np.arange(pieces)[:, None], u, 1), axis=-1)
    # Simpson's rule over each fine step needs the middle too
    middle = np.linalg.norm(
        _piece(controls, arriving, leaving, np.arange(pieces)[:, None], (u[1:] + u[:-1]) / 2, 1), axis=-1
    )
    lengths = (speed[:, :-1] + 4 * middle + speed[:, 1:]) / (6 * _FINE)
    along = np.concatenate(([0.0], np.cumsum(lengths.ravel())))
    count = _count(along[-1], STEP)
    distances = np.linspace(0.0, along[-1], count)
    place = np.interp(distances, along, np.arange(len(along)) / _FINE)
    piece = np.minimum(place.astype(int), pieces - 1)
    part = place - piece
    points = _piece(controls, arriving, leaving, piece, part, 0)
    points[0], points[-1] = controls[0], controls[-1]
    velocity = _piece(controls, arriving, leaving, piece, part, 1)
    acceleration = _piece(controls, arriving, leaving, piece, part, 2)
    size = np.maximum(np.linalg.norm(velocity, axis=-1), 1e-9)
    curvature = (velocity[:, 1] * acceleration[:, 0] - velocity[:, 0] * acceleration[:, 1]) / size**3
    headings = np.unwrap(ground.heading(velocity))
    sharpest = math.pi / (along[-1] / (count - 1))
    return Curve(
        controls=controls,
        tangents=leaving,
        points=points,
        headings=headings,
        curvatures=np.clip(curvature, -sharpest, sharpest),
        distances=distances,
    )


def _piece(controls: Array, arriving: Array, leaving: Array, piece: Array, u: Array, order: int) -> Array:
    """Value or derivative of Hermite pieces at ``u``."""
    u = np.asarray(u)[..., None]
    a, b, s, e = controls[piece], controls[piece + 1], leaving[piece], arriving[piece + 1]
    if order == 0:
        return a + u * s + u**2 * (3 * (b - a) - 2 * s - e) + u**3 * (2 * (a - b) + s + e)
    if order == 1:
        return s + 2 * u * (3 * (b - a) - 2 * s - e) + 3 * u**2 * (2 * (a - b) + s + e)
    return 2 * (3 * (b - a) - 2 * s - e) + 6 * u * (2 * (a - b) + s + e)


def _from_points(dense: Array, controls: Array) -> Curve:
    """Curve of points at equal steps."""
    steps = np.diff(dense, axis=0)
    lengths = np.linalg.norm(steps, axis=-1)
    turns = np.unwrap(ground.heading(steps))
    headings = np.concatenate((turns[:1], (turns[1:] + turns[:-1]) / 2, turns[-1:]))
    distances = np.linspace(0.0, lengths.sum(), len(dense))
    curvatures = np.zeros(len(dense))
    curvatures[1:-1] = np.diff(turns) / distances[1]
    if len(dense) > 2:
        curvatures[0], curvatures[-1] = curvatures[1], curvatures[-2]
    at = cKDTree(dense).query(controls)[1]
    return Curve(
        controls=controls,
        tangents=ground.direction(headings[at]),
        points=dense,
        headings=headings,
        curvatures=curvatures,
        distances=distances,
    )


def _smoothed(points: Array, width: float) -> Array:
    """Points of a line at equal steps, smoothed by a bell curve of a standard deviation in metres; the ends stay."""
    fine = _even(points, min(STEP, width / 4))
    step = float(np.linalg.norm(np.diff(fine, axis=0), axis=-1).mean())
    pad = min(len(fine) - 1, math.ceil(4 * width / step))
    before = 2 * fine[0] - fine[pad:0:-1]
    after = 2 * fine[-1] - fine[-2 : -pad - 2 : -1]
    longer = np.concatenate((before, fine, after))
    reach = pad * step / width
    out = gaussian_filter1d(longer, width / step, axis=0, mode="nearest", truncate=reach)[pad : pad + len(fine)]
    out[0], out[-1] = fine[0], fine[-1]
    # lines between the points would make each of them a corner: a spline through them has none
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(out, axis=0), axis=-1))))
    moving = np.concatenate(([True], np.diff(along) > 1e-9))
    even = np.linspace(0.0, along[-1], _count(along[-1], STEP))
    out = make_interp_spline(along[moving], out[moving], k=min(3, int(moving.sum()) - 1))(even)
    out[0], out[-1] = fine[0], fine[-1]
    return out


def _even(points: Array, step: float) -> Array:
    """Points of a line at equal steps along it."""
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=-1))))
    even = np.linspace(0.0, along[-1], _count(along[-1], step))
    out = np.stack([np.interp(even, along, points[:, k]) for k in range(2)], axis=-1)
    out[0], out[-1] = points[0], points[-1]
    return out


def _count(length: float, step: float) -> int:
    if length > LONGEST:
        raise PathError(f"a curve of {length:.6g} m is longer than {LONGEST:g} m; lengths are in metres")
    return max(3, math.ceil(length / step) + 1)


def _checked(points: Array) -> Array:
    points = np.array(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
        raise PathError(f"a curve needs two or more points (x, z), not an array of shape {points.shape}")
    if not np.isfinite(points).all():
        raise PathError(f"point {int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])} is not finite")
    return points


def _units(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
