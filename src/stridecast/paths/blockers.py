"""Whether there is a way at all, and what is in the way if not."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from stridecast.errors import PathError
from stridecast.paths.space import HAIR, Space

Array = np.ndarray

NAMED = 6
"""So many obstacles are named in a message; of more, how many."""

WEIGHED = 120
"""Of so many obstacles those are found that really separate; of more, all round the closed room are named."""


def check_reachable(space: Space) -> None:
    """Make sure that the body fits through from each point to the next.

    Raises
    ------
    PathError
        It does not; the message names the fewest obstacles that were found to lie between (without any one of them
        there would be a way), and the road's edge where that is a part of it.
    """
    by = space.radius + 2 * HAIR
    near = np.arange(len(space.cores))
    rooms = _rooms(space, near, by)
    for k in range(len(space.points) - 1):
        start, goal = space.points[k], space.points[k + 1]
        if _joined(rooms, start, goal):
            continue
        who = f"from {space.point_names[k]} {_at(start)} to {space.point_names[k + 1]} {_at(goal)}"
        needs = f"the body needs gaps of {2 * by:.3g} m"
        blockers = _separating(space, rooms, start, goal, by)
        if not len(blockers):
            one, other = space.nearest_road(start), space.nearest_road(goal)
            edges = (
                f"road {one!r} does not lead to road {other!r}"
                if one != other
                else f"the edge of road {one!r} lies between"
            )
            raise PathError(f"there is no way {who}: {edges}; {needs}")
        labels = list(dict.fromkeys(space.labels[b] for b in blockers))  # segments of a wall share its name
        names = labels[:NAMED]
        if len(labels) > NAMED:
            names.append(f"{len(labels) - NAMED} more")
        if space.has_roads and _joined(_rooms(space, blockers, by, roads=False), start, goal):
            middle = space.cores[blockers[0]].centroid
            road = space.nearest_road(np.array([middle.x, middle.y]))
            names.append(f"the edge of road {road!r}")
        listed = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
        raise PathError(f"there is no way {who}: {listed} {'is' if len(names) == 1 else 'are'} in the way; {needs}")


def _rooms(space: Space, obstacles: Array, by: float, roads: bool = True) -> Array:
    """Connected parts of where the body's centre may be, without some of the obstacles."""
    region = _ground(space, by, roads)
    if len(obstacles):
        grown = shapely.union_all(_solid(space, obstacles, by))
        region = shapely.difference(region, grown)
    parts = shapely.get_parts(region)
    return parts[shapely.area(parts) > 0]


def _ground(space: Space, by: float, roads: bool) -> Any:
    """Where the body's centre may be without any obstacle: on the roads, or far beyond everything."""
    # a start or goal may stand at less than a hair's breadth: discs let it out
    if space.road is not None and roads:
        discs = shapely.buffer(shapely.points(space.points), 2 * HAIR)
        inner = space.road.buffer(-by)
        return shapely.union_all([inner, *shapely.intersection(discs, space.road.buffer(-space.radius + 1e-9))])
    bounds = [shapely.total_bounds(space.boxes)] if len(space.boxes) else []
    bounds.append(shapely.total_bounds(shapely.points(space.points)))
    stacked = np.array(bounds)
    beyond = 4 * by + 1.0
    return shapely.box(*(stacked[:, :2].min(axis=0) - beyond), *(stacked[:, 2:].max(axis=0) + beyond))


def _solid(space: Space, obstacles: Array, by: float) -> Array:
    """Grown obstacles, less what lets a start or goal out that stands too near to one by less than a hair."""
    grown = space.grown(obstacles, by)
    points = shapely.points(space.points)
    hit = shapely.STRtree(grown).query(points, predicate="intersects")
    for point, k in hit.T:
        tight = space.grown(obstacles[k : k + 1], space.radius - 1e-3)[0]
        grown[k] = shapely.difference(grown[k], shapely.difference(shapely.buffer(points[point], 3 * HAIR), tight))
    return grown


def _joined(rooms: Array, start: Array, goal: Array) -> bool:
    """Whether two points lie in the same room."""
    one = shapely.dwithin(rooms, shapely.Point(start), 1e-6)
    other = shapely.dwithin(rooms, shapely.Point(goal), 1e-6)
    return bool((one & other).any())


def _separating(space: Space, rooms: Array, start: Array, goal: Array, by: float) -> Array:
    """Obstacles of which none can be left out without a way coming free, in the order of their indices."""
    touching: list[Array] = []
    for one, other in ((start, goal), (goal, start)):
        away = shapely.distance(rooms, shapely.Point(one))
        if not len(rooms):
            return np.arange(len(space.cores))
        room = rooms[int(np.argmin(away))]
        faced = shapely.get_parts(shapely.boundary(room))
        holes = [ring for ring in faced if shapely.Polygon(ring).covers(shapely.Point(other))]
        ring = holes[-1] if holes and not room.covers(shapely.Point(other)) else room.exterior
        found = space.distances(shapely.LineString(ring.coords), by + 0.05)
        touching.append(np.unique(found.obstacle[found.obstacle >= 0]))
    candidates = min((t for t in touching if not _way_without_others(space, t, start, goal, by)), key=len, default=None)
    kept = np.arange(len(space.cores)) if candidates is None else candidates
    if len(kept) > WEIGHED:
        return kept
    size = max(1, len(kept) // 2)
    while size >= 1:  # leave out by halves, then quarters, and so on
        first = 0
        while first < len(kept):
            fewer = np.delete(kept, np.arange(first, min(first + size, len(kept))))
            if _way_without_others(space, fewer, start, goal, by):
                first += size
            else:
                kept = fewer
        size //= 2
    return kept


def _way_without_others(space: Space, obstacles: Array, start: Array, goal: Array, by: float) -> bool:
    return _joined(_rooms(space, obstacles, by), start, goal)


def _at(point: Array) -> str:
    return f"({point[0]:g}, {point[1]:g})"
