"""Where a body may be: roads, obstacles, how far away from them it keeps, found through an index."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import shapely
from jaxtyping import Float, Int
from shapely import STRtree

from stridecast.errors import SceneError
from stridecast.model.people import Wall
from stridecast.model.scene import Circle, Scene

Array = np.ndarray

HAIR = 0.01
"""Room a way has at least to either side beyond the body, metres: thinner gaps are no gaps."""

CLEARANCES = {"near": 0.1, "far": 0.6}
"""What is kept beyond the body's radius where there is room, metres."""

WALL = 0.02
"""How thick walls are, metres."""

_PIECE = 4.0
"""Long lines are looked up in pieces of this length, metres, lest their boxes hold everything."""

EDGE = -1
"""Stands for the edge of the roads among the indices of obstacles."""

GOAL = -2
"""Stands for a goal, or the start, among the indices of obstacles."""


class Hit(NamedTuple):
    """Something too near: which line, which obstacle (``EDGE``: the roads' edge), and how far away, metres."""

    line: Int[Array, "hits"]
    obstacle: Int[Array, "hits"]
    gap: Float[Array, "hits"]


class Space:
    """The free room of a scene for a body of its radius.

    Obstacles are those of the scene and, after them, the segments of its walls.

    Attributes
    ----------
    names, labels
        Of each obstacle: how it is called, and what it is too, for messages.
    clearance
        What is kept from each obstacle beyond the body's radius: less than the preference where the gap to the next
        obstacle, to the road's edge or to the start or a goal is narrow, metres.
    edge_clearance
        The same of the road's edge.

    Raises
    ------
    SceneError
        No start and goals, a polygon that is none, a road too narrow for the body, a start or goal that is in an
        obstacle, off the roads or too near to their edges for the body, or no goal but at the start.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.radius = scene.behavior.body_radius
        start, goals = scene.task()
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
        points = np.concatenate((start[None], goals))
        away = np.linalg.norm(np.diff(points, axis=0), axis=-1) > 1e-6  # a goal where one is already is reached
        if not away.any():
            raise SceneError("the goal lies at the start; there is no way to go")
        self.points = points[np.concatenate(([True], away))]
        names = ["the goal"] if len(goals) == 1 else [f"goal {k + 1}" for k in range(len(goals))]
        self.point_names = ["the start", *(name for name, far in zip(names, away, strict=True) if far)]
        self._check_points()
        self.wish = CLEARANCES[scene.behavior.preference.distance]
        self.clearance, self.edge_clearance = self._clearances()
        self._sight_tree: STRtree | None = None
        self._inner: Any = None

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
            pieces = shapely.segmentize(lines, _PIECE)
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

    def hits(self, lines: Any, share: float = 1.0) -> Hit:
        """What lies nearer to lines or points than the body's radius and a share of the clearance."""
        found = self.distances(lines, self.radius + max(self.wish, HAIR) + 1e-6)
        least = self.radius + share * self.clearance_of(found.obstacle) - 1e-6
        keep = found.gap < least
        return Hit(*(column[keep] for column in found))

    def blocking(self, start: Float[Array, "2"], stop: Float[Array, "2"]) -> list[int]:
        """What first blocks the line of sight between two points, as ``hits`` with the whole clearance, only faster.

        Grown obstacles are polygons here, nowhere more than half a hair too small.
        """
        tree = self._sight
        length = float(np.hypot(stop[0] - start[0], stop[1] - start[1]))
        done, ahead = 0.0, _PIECE
        while done < length:  # piece by piece, for the box of a long slanting line holds too much
            upto = length if length < 1.5 * ahead else ahead
            ends = start + (stop - start) * (np.array([[done], [upto]]) / length)
            line = shapely.linestrings(ends)
            found: list[int] = tree.query(line, predicate="intersects").tolist()
            if self._inner is not None and not shapely.covers(self._inner, line):
                found.append(EDGE)
            if found:
                return found
            done, ahead = upto, 2 * upto
        return []

    @property
    def _sight(self) -> STRtree:
        if self._sight_tree is None:
            by = self.reach + self.radius + self.clearance - 1e-6
            segments = np.pi / 4 / np.arccos(1 - np.minimum(HAIR / 2 / by, 1.0))
            doubled = 2 ** np.ceil(np.log2(np.maximum(segments, 2.0))).astype(np.int64)
            solids = np.empty(len(by), object)
            for count in np.unique(doubled):
                here = doubled == count
                solids[here] = shapely.buffer(self.cores[here], by[here], quad_segs=int(count))
            self._sight_tree = STRtree(solids)
            if self.road is not None:
                keep = self.radius + self.edge_clearance - 1e-6
                count = max(8, int(np.ceil(np.pi / 4 / np.arccos(1 - min(HAIR / 2 / keep, 1.0)))))
                self._inner = self.road.buffer(-keep, quad_segs=count)
                shapely.prepare(self._inner)
        return self._sight_tree

    def clearance_of(self, obstacle: Int[Array, "hits"]) -> Float[Array, "hits"]:
        """Clearance by obstacle, metres."""
        both = np.append(self.clearance, self.edge_clearance)
        return both[obstacle]

    def is_clear(self, line: Any, share: float = 0.0) -> bool:
        """Whether the body can go along a line without touching anything."""
        return len(self.hits(line, share).gap) == 0

    def narrowed(self, factor: float) -> None:
        """Keep only so much of each clearance, but a hair's breadth."""
        self.clearance = np.minimum(self.clearance, np.maximum(self.clearance * factor, HAIR))
        self.edge_clearance = min(self.edge_clearance, max(self.edge_clearance * factor, HAIR))
        self._sight_tree = self._inner = None

    def name(self, obstacle: int) -> str:
        """What is called so in messages."""
        return self.names[obstacle] if obstacle != EDGE else "the edge of the roads"

    def around(self, start: Array, stop: Array, within: float) -> set[int]:
        """Obstacles within metres of a line."""
        line = shapely.LineString((start, stop))
        return set(self.tree.query(line, predicate="dwithin", distance=within).tolist()) if len(self.cores) else set()

    def grown(self, indices: Array, by: float) -> Array:
        """Obstacles grown by metres, as polygons, from outside no more than a thousandth too small."""
        return shapely.buffer(self.cores[indices], self.reach[indices] + by, quad_segs=24)

    def _check_points(self) -> None:
        found = self.distances(shapely.points(self.points), self.radius)
        if len(found.gap):
            k = int(np.argmin(found.gap))
            who, gap = self.point_names[int(found.line[k])], float(found.gap[k])
            obstacle = int(found.obstacle[k])
            x, z = self.points[int(found.line[k])]
            at = f"{who} ({x:g}, {z:g})"
            if obstacle == EDGE:
                road = self.nearest_road(self.points[int(found.line[k])])
                if gap < 0:
                    raise SceneError(
                        f"{at} lies off the roads, {-gap:.3g} m from the edge of road {road!r}; put it on a road"
                    )
                what = f"the edge of road {road!r}"
            else:
                what = self.labels[obstacle]
                if gap <= 0:
                    raise SceneError(f"{at} lies inside {what}; put it into the open")
            raise SceneError(f"{at} lies {gap:.3g} m from {what}; the body needs {self.radius:g} m")

    def nearest_road(self, point: Array) -> str:
        """Name of the road whose edge is nearest to a point."""
        strips = [shapely.LineString(road.points).buffer(road.width / 2) for road in self.scene.roads]
        away = shapely.distance(shapely.boundary(strips), shapely.Point(point))
        return self.scene.roads[int(np.argmin(away))].name

    def _clearances(self) -> tuple[Array, float]:
        """What can be kept from each obstacle such that no gap closes that is wide enough for the body."""
        count = len(self.cores)
        room = np.full(count, self.wish)
        edge = self.wish
        least = 2 * (self.radius + 2 * HAIR)
        reach = 2 * (self.radius + self.wish) + 2 * HAIR
        if count:
            one, other = self.tree.query(shapely.box(*_widened(self.boxes, reach).T))
            one, other = one[one < other], other[one < other]
            # of two circles or polygons with circles the distance of the cores, less both radii
            gap = shapely.distance(self.cores[one], self.cores[other]) - self.reach[one] - self.reach[other]
            passable = (gap >= least) & (gap < reach)
            limit = gap[passable] / 2 - self.radius - HAIR
            np.minimum.at(room, one[passable], limit)
            np.minimum.at(room, other[passable], limit)
        if self.road is not None:
            widths = min(road.width for road in self.scene.roads)
            edge = min(edge, max(HAIR, 0.25 * (widths / 2 - self.radius)))
            if count:
                gap = shapely.distance(self.cores, self.edge) - self.reach
                passable = (gap >= least) & (gap < reach)
                limit = gap[passable] / 2 - self.radius - HAIR
                room[passable] = np.minimum(room[passable], limit)
                edge = min(edge, float(limit.min(initial=edge)))
        near = self.distances(shapely.points(self.points), self.radius + self.wish)
        for obstacle, gap in zip(near.obstacle.tolist(), near.gap.tolist(), strict=True):
            if obstacle == EDGE:
                edge = min(edge, max(0.0, gap - self.radius))
            else:
                room[obstacle] = min(room[obstacle], max(0.0, gap - self.radius))
        return room, edge


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
    for road in scene.roads:
        if road.width / 2 < scene.behavior.body_radius:
            raise SceneError(
                f"road {road.name!r} is {road.width:g} m wide; the body needs {2 * scene.behavior.body_radius:g} m"
            )
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
    block = np.floor(along[:-1] / _PIECE).astype(np.int64)
    starts = np.flatnonzero(same & np.concatenate(([True], (block[1:] != block[:-1]) | ~same[:-1])))
    ends_of_lines = np.flatnonzero(np.concatenate((~same, [True])))
    stops = np.minimum(np.append(starts[1:], len(points) - 1), ends_of_lines[of[starts]])
    sizes = stops - starts + 1
    part = np.repeat(np.arange(len(starts)), sizes)
    inside = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return shapely.linestrings(points[starts[part] + inside], indices=part), of[starts]


def _grown_boxes(parts: Array, by: float) -> Array:
    return shapely.box(*_widened(parts, by).T)


def _widened(geometries: Array, by: float) -> Array:
    return shapely.bounds(geometries).reshape(-1, 4) + by * np.array([-1.0, -1.0, 1.0, 1.0])
