"""Areas in which somebody appears or whereto somebody goes, and free places in them."""

from __future__ import annotations

import math

import numpy as np
import shapely
from jaxtyping import Bool, Float

from stridecast.errors import SceneError
from stridecast.paths.solids import Solids

Array = np.ndarray

SPARE = 0.05
"""Room between people who are put somewhere, metres."""

TRIES = 64
"""Places that are tried at once for somebody who is due."""

BATCH = 256
"""Places that are tried at once where many are put into an area."""

VAIN = 30
"""After so many batches in which nobody fits the area is full."""

ROUND = 16
"""Directions in which one of a group is put beside another."""

_SLIM = 1e-4
"""Areas that fill less of the rectangle about them are no areas to stand in."""


class Area:
    """A point, a line between two points, or a polygon of more.

    Parameters
    ----------
    points
        Ground points ``(x, z)``, metres.
    name
        For messages.

    Raises
    ------
    SceneError
        The polygon crosses itself, or is too slim to stand in.
    """

    def __init__(self, points: Float[Array, "_ 2"], name: str) -> None:
        self.points = points
        self.name = name
        if len(points) < 3:
            return
        self.polygon = shapely.Polygon(points)
        why = shapely.is_valid_reason(self.polygon)
        if why != "Valid Geometry" or self.polygon.area < 1e-9:
            why = why if why != "Valid Geometry" else "it has no area"
            raise SceneError(f"{name} is no polygon: {why}; its corners must go round once, without crossing")
        shapely.prepare(self.polygon)
        corners = shapely.get_coordinates(shapely.oriented_envelope(self.polygon))
        self.corner, self.sides = corners[0], np.stack((corners[1] - corners[0], corners[3] - corners[0]))
        self.share = self.polygon.area / abs(float(np.linalg.det(self.sides)))
        if self.share < _SLIM:
            raise SceneError(f"{name} is too slim a polygon to stand in")

    def draw(self, count: int, rng: np.random.Generator) -> Float[Array, "count 2"]:
        """Points in it, each as likely as the other."""
        if len(self.points) == 1:
            return np.repeat(self.points, count, axis=0)
        if len(self.points) == 2:
            return self.points[0] + rng.random((count, 1)) * (self.points[1] - self.points[0])
        out = np.zeros((0, 2))
        while len(out) < count:
            tries = math.ceil(1.2 * (count - len(out)) / self.share) + 8
            points = self.corner + rng.random((tries, 2)) @ self.sides
            out = np.concatenate((out, points[shapely.contains_xy(self.polygon, points)]))
        return out[:count]

    def holds(self, points: Float[Array, "points 2"]) -> Bool[Array, "points"]:
        """Which points lie in it; any do in a point or a line, beside which a group may stand."""
        if len(self.points) < 3:
            return np.ones(len(points), bool)
        return np.asarray(shapely.contains_xy(self.polygon, points))

    def near(self, point: Float[Array, "2"], away: float) -> Float[Array, "_ 2"]:
        """Points of it at a distance from one of it, metres; nothing where there are none."""
        if len(self.points) == 1:
            return np.zeros((0, 2))
        if len(self.points) == 2:
            way = self.points[1] - self.points[0]
            length = float(np.linalg.norm(way))
            along = float((point - self.points[0]) @ way) / length + away * np.array([1.0, -1.0])
            return self.points[0] + along[(along >= 0) & (along <= length), None] * way / length
        ring = _ring(point, away)
        return ring[self.holds(ring)]


class Discs:
    """Discs on the ground, found by cells as wide as the widest.

    Parameters
    ----------
    widest
        No radius is larger, metres.
    """

    def __init__(self, widest: float) -> None:
        self.width = 2 * widest + SPARE
        self.cells: dict[tuple[int, int], list[tuple[float, float, float]]] = {}

    def add(self, point: Float[Array, "2"], radius: float) -> None:
        """Take a disc in."""
        x, z = float(point[0]), float(point[1])
        self.cells.setdefault(self._cell(x, z), []).append((x, z, radius))

    def leave_room(self, point: Float[Array, "2"], radius: float) -> bool:
        """Whether a disc fits, with some room to spare."""
        x, z = float(point[0]), float(point[1])
        i, j = self._cell(x, z)
        for a in (i - 1, i, i + 1):
            for b in (j - 1, j, j + 1):
                for other_x, other_z, other in self.cells.get((a, b), ()):
                    if (x - other_x) ** 2 + (z - other_z) ** 2 < (radius + other + SPARE) ** 2:
                        return False
        return True

    def _cell(self, x: float, z: float) -> tuple[int, int]:
        return math.floor(x / self.width), math.floor(z / self.width)


def place(
    solids: Solids,
    area: Area,
    rng: np.random.Generator,
    radii: Float[Array, "people"],
    discs: Float[Array, "discs 3"],
) -> Float[Array, "people 2"] | None:
    """Free places for somebody, or for a group side by side; nothing where none was found.

    Parameters
    ----------
    radii
        Of their bodies, metres.
    discs
        Who and what is there already: ``x``, ``z`` and radius, metres.
    """
    found = Discs(max(float(radii.max()), float(discs[:, 2].max(initial=0.0))))
    for disc in discs:
        found.add(disc[:2], float(disc[2]))
    candidates = area.draw(1 if len(area.points) == 1 else TRIES, rng)
    for point in candidates[solids.are_clear(candidates, np.full(len(candidates), radii[0]))]:
        group = _group(solids, area, rng, radii, found, point)
        if group is not None:
            return group
    return None


def pack(
    solids: Solids, area: Area, rng: np.random.Generator, groups: list[Float[Array, "_"]], discs: Discs
) -> list[Float[Array, "_ 2"]]:
    """Free places for many groups (of one, too), as many as fit; they are taken into the discs.

    Parameters
    ----------
    groups
        Radii of the bodies of each group, metres.
    """
    out: list[Array] = []
    vain = 0
    while len(out) < len(groups) and vain < VAIN:
        candidates = area.draw(BATCH, rng)
        # radii differ little: who is narrower than the widest gives nothing away that others would miss
        widest = max(float(radii[0]) for radii in groups[len(out) :])
        clear = candidates[solids.are_clear(candidates, np.full(BATCH, widest))]
        vain += 1
        for point in clear:
            group = _group(solids, area, rng, groups[len(out)], discs, point)
            if group is None:
                continue
            for where, radius in zip(group, groups[len(out)].tolist(), strict=True):
                discs.add(where, radius)
            out.append(group)
            vain = 0
            if len(out) == len(groups):
                break
    return out


def _group(
    solids: Solids, area: Area, rng: np.random.Generator, radii: Array, discs: Discs, point: Array
) -> Array | None:
    """Places side by side for a group whose first one stands at a point that is clear of what is solid."""
    if not discs.leave_room(point, float(radii[0])):
        return None
    out = [point]
    for k in range(1, len(radii)):
        # beside the one before, or beside the first
        rings = [_ring(out[j], radii[j] + radii[k] + 2 * SPARE, rng.random()) for j in dict.fromkeys((k - 1, 0))]
        ring = np.concatenate(rings)
        ring = ring[area.holds(ring)]
        ring = ring[solids.are_clear(ring, np.full(len(ring), radii[k]))]
        apart = np.linalg.norm(ring[:, None] - np.array(out)[None], axis=-1) >= radii[:k] + radii[k] + SPARE
        beside = (p for p in ring[apart.all(axis=1)] if discs.leave_room(p, float(radii[k])))
        found = next(beside, None)
        if found is None:
            return None
        out.append(found)
    return np.array(out)


def _ring(point: Array, away: float, turn: float = 0.0) -> Array:
    """Points round one, metres away; the first in any direction."""
    angles = 2 * np.pi * (np.arange(ROUND) / ROUND + turn)
    return point + away * np.stack((np.sin(angles), np.cos(angles)), axis=-1)
