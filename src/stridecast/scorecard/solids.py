"""What is solid in a scene, for measuring: obstacles, walls, the edges of roads, and obstacles that move."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely
from jaxtyping import Float, Int

from stridecast.model.scene import Circle, Scene

Array = np.ndarray

THIN = 1e-3
"""Walls are as thick where areas are cut along them, metres."""

ROADSIDE = "the edge of the roads"


class Depths(NamedTuple):
    """Which discs reach into which solid thing, and how deep, metres."""

    row: Int[Array, "hits"]
    thing: Int[Array, "hits"]
    depth: Float[Array, "hits"]


class Solids:
    """Obstacles, walls and roads of a scene; without one nothing is solid."""

    def __init__(self, scene: Scene | None) -> None:
        obstacles: Sequence[Any] = () if scene is None else scene.obstacles
        walls: Sequence[Any] = getattr(scene, "walls", ())
        self.movers: Sequence[Any] = getattr(scene, "movers", ())
        roads: Sequence[Any] = () if scene is None else scene.roads
        cores = [shapely.Point(o.center) if isinstance(o, Circle) else shapely.Polygon(o.points) for o in obstacles]
        cores += [shapely.LineString(wall.points) for wall in walls]
        self.cores = np.array(cores, object)
        self.reach = np.array([o.radius if isinstance(o, Circle) else 0.0 for o in obstacles] + [0.0] * len(walls))
        self.tree = shapely.STRtree(self.cores)
        strips = [shapely.LineString(road.points).buffer(road.width / 2) for road in roads]
        self.road = shapely.union_all(strips) if strips else None
        self.names = [thing.name for thing in (*obstacles, *walls)]
        self.names += [ROADSIDE, *(mover.name for mover in self.movers)]

    def depths(
        self,
        points: Float[Array, "rows 2"],
        radii: Float[Array, "rows"],
        times: Float[Array, "rows"],
    ) -> Depths:
        """How deep discs reach into what is solid; ``thing`` is an index into ``names``.

        Of a disc whose centre is inside a polygon or off the roads it is the radius and the way out.
        """
        found = [Depths(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))]
        places = shapely.points(points) if len(self.cores) or self.road is not None else np.zeros(0, object)
        if len(self.cores):
            row, thing = self.tree.query(
                places, predicate="dwithin", distance=radii.max(initial=0.0) + self.reach.max(initial=0.0)
            )
            gap = shapely.distance(places[row], self.cores[thing]) - self.reach[thing]
            inside = (gap == 0) & (shapely.get_dimensions(self.cores[thing]) == 2)
            gap[inside] = -shapely.distance(places[row[inside]], shapely.boundary(self.cores[thing[inside]]))
            found.append(Depths(row, thing, radii[row] - gap))
        if self.road is not None:
            shapely.prepare(self.road)
            edge = shapely.boundary(self.road)
            away = shapely.distance(places, edge)
            gap = np.where(shapely.intersects(self.road, places), away, -away)
            rows = np.arange(len(points))
            found.append(Depths(rows, np.full(len(points), len(self.cores)), radii - gap))
        for k, mover in enumerate(self.movers):
            gap = np.linalg.norm(points - mover.at(times), axis=-1) - mover.radius
            found.append(Depths(np.arange(len(points)), np.full(len(points), len(self.cores) + 1 + k), radii - gap))
        return Depths(*(np.concatenate(columns) for columns in zip(*found, strict=True)))

    @property
    def anything(self) -> bool:
        """Whether there is anything that cuts the ground."""
        return bool(len(self.cores)) or self.road is not None

    def near(self, points: Float[Array, "rows 2"], reach: float) -> Array:
        """Which points have something solid within reach, metres."""
        places = shapely.points(points)
        out = np.zeros(len(points), bool)
        if len(self.cores):
            out[self.tree.query(places, predicate="dwithin", distance=reach + self.reach.max(initial=0.0))[0]] = True
        if self.road is not None:
            out |= ~shapely.contains(self.road, places) | shapely.dwithin(shapely.boundary(self.road), places, reach)
        return out

    def open_parts(self, cells: Array, points: Float[Array, "cells 2"]) -> Array:
        """Of polygons what is open ground and hangs together with a point in each."""
        if self.road is not None:
            cells = shapely.intersection(cells, self.road)
        if len(self.cores):
            cells = shapely.difference(cells, self._blocked)
        parts, of = shapely.get_parts(cells, return_index=True)
        kept = shapely.get_dimensions(parts) == 2
        parts, of = parts[kept], of[kept]
        away = shapely.distance(parts, shapely.points(points)[of])
        order = np.lexsort((away, of))
        first = order[np.concatenate(([True], np.diff(of[order]) > 0))] if len(order) else order
        out = np.full(len(points), shapely.Polygon(), object)
        out[of[first]] = parts[first]
        return out

    @cached_property
    def _blocked(self) -> Any:
        thick = np.where(shapely.get_dimensions(self.cores) == 1, THIN / 2, self.reach)
        return shapely.union_all(shapely.buffer(self.cores, thick, quad_segs=16))
