"""Where a body may be: roads, obstacles, how far away from them it keeps, found through an index."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from jaxtyping import Float, Int
from shapely import STRtree

from stridecast.errors import SceneError
from stridecast.model.scene import Scene
from stridecast.paths.solids import EDGE, PIECE, Hit, Solids, widened

Array = np.ndarray

HAIR = 0.01
"""Room a way has at least to either side beyond the body, metres: thinner gaps are no gaps."""

CLEARANCES = {"near": 0.1, "far": 0.6}
"""What is kept beyond the body's radius where there is room, metres."""

GOAL = -2
"""Stands for a goal, or the start, among the indices of obstacles."""


class Space(Solids):
    """The free room of a scene for a body of its radius.

    Attributes
    ----------
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
        start, goals = scene.task()
        super().__init__(scene)
        self.radius = scene.behavior.body_radius
        for road in scene.roads:
            if road.width / 2 < self.radius:
                raise SceneError(f"road {road.name!r} is {road.width:g} m wide; the body needs {2 * self.radius:g} m")
        points = np.concatenate((start[None], goals))
        away = np.linalg.norm(np.diff(points, axis=0), axis=-1) > 1e-6  # a goal where one is already is reached
        if not away.any():
            raise SceneError("the goal lies at the start; there is no way to go")
        self.points = points[np.concatenate(([True], away))]
        names = ["the goal"] if len(goals) == 1 else [f"goal {k + 1}" for k in range(len(goals))]
        self.point_names = ["the start", *(name for name, far in zip(names, away, strict=True) if far)]
        self.check_points(self.points, np.full(len(self.points), self.radius), self.point_names)
        self.wish = CLEARANCES[scene.behavior.preference.distance]
        self.clearance, self.edge_clearance = self._clearances()
        self._sight_tree: STRtree | None = None
        self._inner: Any = None

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
        done, ahead = 0.0, PIECE
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

    def _clearances(self) -> tuple[Array, float]:
        """What can be kept from each obstacle such that no gap closes that is wide enough for the body."""
        count = len(self.cores)
        room = np.full(count, self.wish)
        edge = self.wish
        least = 2 * (self.radius + 2 * HAIR)
        reach = 2 * (self.radius + self.wish) + 2 * HAIR
        if count:
            one, other = self.tree.query(shapely.box(*widened(self.boxes, reach).T))
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
