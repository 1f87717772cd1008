"""What is solid in a scene: obstacles, walls and the edge of the roads, found through an index."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int
from shapely import STRtree

from stridecast.errors import SceneError
from stridecast.model.people import Wall
from stridecast.model.scene import Circle, Scene

Array = np.ndarray

WALL = 0.02
"""How thick walls are, metres."""

PIECE = 4.0
"""Long lines are looked up in pieces of this length, metres, lest their boxes hold everything."""

EDGE = -1
"""Stands for the edge of the roads among the indices of obstacles."""


class Hit(NamedTuple):
    """Something too near: which line, which obstacle (``EDGE``: the roads' edge), and how far away, metres."""

    line: Int[Array, "hits"]
    obstacle: Int[Array, "hits"]
    gap: Float[Array, "hits"]


class Solids:
    """What is solid in a scene.

    Obstacles are those of the scene and, after them, the segments of its walls.

    Attributes
    ----------
    names, labels
        Of each obstacle: how it is called, and what it is too, for messages.
    cores, reach
        Each obstacle is what lies within its reach, metres, of its core: a circle's centre, or a polygon.

    Raises
    ------
    SceneError
        A polygon that is none.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        pieces = [(wall, piece) for wall in scene.walls for piece in _pieces(wall)]
        self.names = [obstacle.name for obstacle in scene.obstacles] + [wall.name for wall, _ in pieces]
        self.labels = [f"obstacle {o.name!r}" for o in scene.obstacles] + [f"wall {wall.name!r}" for wall, _ in pieces]
        cores = [_core(obstacle) for obstacle in scene.obstacles] + [piece for _, piece in pieces]
        self.cores = np.array(cores, object)
        reach = [o.radius if isinstance(o, Circle) else 0.0 for o in scene.obstacles] + [0.0] * len(pieces)
        self.reach = np.array(reach, np.float64)
        boxes = shapely.bounds(self.cores).reshape(-1, 4) + self.reach[:, None] * np.array([-1.0, -1.0, 1.0, 1.0])
        self.boxes = shapely.box(*boxes.T)
        self.tree = STRtree(self.boxes)
        self.road, self.edge = _roads(scene)

    @property
    def has_roads(self) -> bool:
        """Whether one may go on roads only."""
        return self.road is not None

    def distances(self, lines: Any, within: float) -> Hit:
        """Distances of lines or points to all obstacles and to the road's edge that are below ``within``, metres.

        A line is 0 m away from what it touches; one that is off the road lies below zero of its edge.
        """
        lines = np.atleast_1d(np.asarray(lines, object))
        owner, obstacle, gap = (np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
        if len(self.cores):
            pieces = shapely.segmentize(lines, PIECE)
            parts, of = _parts(pieces)
            found = self.tree.query(_grown_boxes(parts, within))
            owner, obstacle = of[found[0]], found[1]
            gap = shapely.distance(parts[found[0]], self.cores[obstacle]) - self.reach[obstacle]
            keep = gap < within
            owner, obstacle, gap = owner[keep], obstacle[keep], gap[keep]
        if self.road is not None:
            away = shapely.distance(lines, self.edge)
            away = np.where(shapely.covers(self.road, lines), away, -away - 1e-9)
            near = np.flatnonzero(away < within)
            owner = np.concatenate((owner, near))
            obstacle = np.concatenate((obstacle, np.full(len(near), EDGE)))
            gap = np.concatenate((gap, away[near]))
        return Hit(owner, obstacle, gap)

    def are_clear(self, points: Float[Array, "points 2"], radii: Float[Array, "points"]) -> Bool[Array, "points"]:
        """Where bodies of some radii, metres, touch nothing and stand on the roads, if there are any."""
        out = np.ones(len(points), bool)
        if len(points):
            hit = self.distances(shapely.points(points), float(radii.max()))
            out[hit.line[hit.gap < radii[hit.line]]] = False
        return out

    def check_points(
        self, points: Float[Array, "points 2"], radii: Float[Array, "points"], names: Sequence[str]
    ) -> None:
        """Make sure that bodies of some radii, metres, can stand at points.

        Raises
        ------
        SceneError
            One cannot; the message has its name and that of what is in the way.
        """
        if not len(points):
            return
        found = self.distances(shapely.points(points), float(radii.max()))
        short = found.gap - radii[found.line]
        if not len(short) or short.min() >= 0:
            return
        k = int(np.argmin(short))
        who, gap, obstacle = int(found.line[k]), float(found.gap[k]), int(found.obstacle[k])
        at = f"{names[who]} ({points[who, 0]:g}, {points[who, 1]:g})"
        if obstacle == EDGE:
            road = self.nearest_road(points[who])
            if gap < 0:
                raise SceneError(
                    f"{at} lies off the roads, {-gap:.3g} m from the edge of road {road!r}; put it on a road"
                )
            what = f"the edge of road {road!r}"
        else:
            what = self.labels[obstacle]
            if gap <= 0:
                raise SceneError(f"{at} lies inside {what}; put it into the open")
        raise SceneError(f"{at} lies {gap:.3g} m from {what}; the body needs {radii[who]:g} m")

    def nearest_road(self, point: Array) -> str:
        """Name of the road whose edge is nearest to a point."""
        strips = [shapely.LineString(road.points).buffer(road.width / 2) for road in self.scene.roads]
        away = shapely.distance(shapely.boundary(strips), shapely.Point(point))
        return self.scene.roads[int(np.argmin(away))].name


def _core(obstacle: Any) -> Any:
    """A circle's centre, or a polygon."""
    if isinstance(obstacle, Circle):
        return shapely.Point(obstacle.center)
    polygon = shapely.Polygon(obstacle.points)
    if not polygon.is_valid or polygon.area < 1e-9:
        why = shapely.is_valid_reason(polygon) if not polygon.is_valid else "it has no area"
        raise SceneError(
            f"obstacle {obstacle.name!r} is no polygon: {why}; its corners must go round once, without crossing"
        )
    return shapely.geometry.polygon.orient(polygon)


def _pieces(wall: Wall) -> list[Any]:
    """Each segment of a wall as a thin rectangle."""
    lines = shapely.linestrings(np.stack((wall.points[:-1], wall.points[1:]), axis=1))
    return [shapely.geometry.polygon.orient(p) for p in shapely.buffer(lines, WALL / 2, cap_style="flat")]


def _roads(scene: Scene) -> tuple[Any, Any]:
    """The union of the roads' strips and its edge; nothing where there are no roads.

    A strip ends in half a disc, so that one can stand at a road's first and last point.
    """
    if not scene.roads:
        return None, None
    region = shapely.union_all([shapely.LineString(road.points).buffer(road.width / 2) for road in scene.roads])
    shapely.prepare(region)
    edge = shapely.boundary(region)
    shapely.prepare(edge)
    return region, edge


def _parts(lines: Array) -> tuple[Array, Array]:
    """Lines cut at every tenth vertex at most into parts no longer than some metres, and which line each comes from."""
    points, of = shapely.get_coordinates(lines, return_index=True)
    if len(points) == len(lines):
        return lines, np.arange(len(lines))
    # pairs of neighbours of one line; runs of pairs make a part
    same = of[1:] == of[:-1]
    length = np.where(same, np.linalg.norm(np.diff(points, axis=0), axis=-1), 0.0)
    along = np.concatenate(([0.0], np.cumsum(length)))
    block = np.floor(along[:-1] / PIECE).astype(np.int64)
    starts = np.flatnonzero(same & np.concatenate(([True], (block[1:] != block[:-1]) | ~same[:-1])))
    ends_of_lines = np.flatnonzero(np.concatenate((~same, [True])))
    stops = np.minimum(np.append(starts[1:], len(points) - 1), ends_of_lines[of[starts]])
    sizes = stops - starts + 1
    part = np.repeat(np.arange(len(starts)), sizes)
    inside = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return shapely.linestrings(points[starts[part] + inside], indices=part), of[starts]


def _grown_boxes(parts: Array, by: float) -> Array:
    return shapely.box(*widened(parts, by).T)


def widened(geometries: Array, by: float) -> Array:
    """Bounds of geometries, grown on all sides: least x, least z, most x, most z."""
    return shapely.bounds(geometries).reshape(-1, 4) + by * np.array([-1.0, -1.0, 1.0, 1.0])
