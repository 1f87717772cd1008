"""What stands in a scene, as arrays in a grid: walls, edges of obstacles and roads, circles."""

from __future__ import annotations

import numpy as np
import shapely
from jaxtyping import Float

from stridecast.crowd.state import Cells, Ground
from stridecast.model.scene import Circle, Scene
from stridecast.paths.solids import Solids

Array = np.ndarray

CELL = 2.0
"""Width of a cell, metres."""

MOST_CELLS = 4_000_000
"""Larger scenes have wider cells."""


def ground_of(scene: Scene, solids: Solids) -> Ground:
    """What stands in a scene: walls, outlines of polygons, edges of the roads, circles."""
    circles = [(*o.center, o.radius) for o in scene.obstacles if isinstance(o, Circle)]
    lines = [wall.points for wall in scene.walls]
    lines += [np.concatenate((o.points, o.points[:1])) for o in scene.obstacles if not isinstance(o, Circle)]
    if solids.edge is not None:
        lines += [shapely.get_coordinates(part) for part in shapely.get_parts(solids.edge)]
    pieces = [np.concatenate((line[:-1], line[1:]), axis=-1) for line in lines]
    return make_ground(np.concatenate(pieces) if pieces else np.zeros((0, 4)), np.array(circles).reshape(-1, 3))


def make_ground(segments: Float[Array, "segments 4"], circles: Float[Array, "circles 3"]) -> Ground:
    """Sort segments (``x, z, x, z``) and circles (``x, z, radius``) into the cells that they touch."""
    reach = circles[:, 2:] if len(circles) else np.zeros((0, 1))
    low = np.concatenate((np.minimum(segments[:, :2], segments[:, 2:]), circles[:, :2] - reach))
    high = np.concatenate((np.maximum(segments[:, :2], segments[:, 2:]), circles[:, :2] + reach))
    corner, cell, shape = _grid(low, high, CELL)
    owners: list[Array] = []
    things: list[Array] = []
    begin = np.floor((low - corner) / cell).astype(np.int64)
    end = np.floor((high - corner) / cell).astype(np.int64)
    for thing in range(len(low)):
        i, k = np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(begin[thing], end[thing], strict=True)), indexing="ij")
        i, k = i.ravel(), k.ravel()
        if thing < len(segments) and len(i) > 4:  # a slanting line does not touch all cells of its box
            near = _touches(segments[thing], corner + (np.stack((i, k), axis=-1) + 0.5) * cell, cell)
            i, k = i[near], k[near]
        owners.append(i * shape[1] + k)
        things.append(np.full(len(i), thing))
    owner = np.concatenate(owners) if owners else np.zeros(0, np.int64)
    order = np.argsort(owner, kind="stable")
    first = np.concatenate(([0], np.cumsum(np.bincount(owner, minlength=int(shape.prod())))))
    entries = np.concatenate(things)[order] if things else np.zeros(0, np.int64)
    return Ground(
        segments=np.ascontiguousarray(segments, np.float64),
        circles=np.ascontiguousarray(circles, np.float64),
        corner=corner,
        cell=cell,
        shape=shape,
        first=first.astype(np.int64),
        entries=entries.astype(np.int64),
    )


def make_cells(low: Float[Array, "2"], high: Float[Array, "2"], people: int, cell: float = CELL) -> Cells:
    """An empty grid for so many people between two corners."""
    corner, cell, shape = _grid(low[None], high[None], cell)
    return Cells(
        corner=corner,
        size=cell,
        shape=shape,
        first=np.zeros(int(shape.prod()) + 1, np.int64),
        rows=np.zeros(people, np.int64),
    )


def _grid(low: Array, high: Array, cell: float) -> tuple[Array, float, Array]:
    corner = low.min(axis=0) if len(low) else np.zeros(2)
    size = (high.max(axis=0) if len(high) else np.ones(2)) - corner
    cell = max(cell, float(np.sqrt(np.prod(size + cell) / MOST_CELLS)))
    return np.asarray(corner, np.float64), cell, np.floor(size / cell).astype(np.int64) + 1


def _touches(segment: Array, centers: Float[Array, "cells 2"], cell: float) -> Array:
    """Whether a segment comes near enough to the centres of cells to touch them."""
    a, way = segment[:2], segment[2:] - segment[:2]
    u = np.clip(((centers - a) @ way) / max(float(way @ way), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(centers - a - u[:, None] * way, axis=-1) <= 0.7072 * cell)
