"""Scenes by chance, and by another way than the package's whether a body fits through them."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.ndimage import label

from stridecast.model.scene import Behavior, Circle, Polygon, Preference, Road, Scene

CELL = 0.1
"""Width of a cell of the grid, metres."""

MARGIN = CELL / np.sqrt(2)
"""Nothing on the way from cell to cell is further than this from the middle of one."""


def block(name: str, x0: float, z0: float, x1: float, z1: float) -> Polygon:
    """A rectangle."""
    return Polygon(name=name, points=np.array([(x0, z0), (x1, z0), (x1, z1), (x0, z1)], float))


def polygon(name: str, *points: tuple[float, float]) -> Polygon:
    return Polygon(name=name, points=np.array(points, float))


def disc(name: str, x: float, z: float, radius: float) -> Circle:
    return Circle(name=name, center=np.array([x, z], float), radius=radius)


def road(name: str, width: float, *points: tuple[float, float]) -> Road:
    return Road(name=name, points=np.array(points, float), width=width)


def scene(start, goals, obstacles=(), roads=(), side="none", distance="near", **behavior) -> Scene:
    return Scene(
        start=np.array(start, float),
        goals=np.array(goals, float),
        obstacles=tuple(obstacles),
        roads=tuple(roads),
        behavior=Behavior(preference=Preference(side=side, distance=distance), **behavior),
    )


def solids(place: Scene) -> list[shapely.Geometry]:
    """Obstacles, circles as polygons that are no more than a thousandth too small, and walls as thin as they are."""
    return [
        shapely.Point(o.center).buffer(o.radius, quad_segs=64) if isinstance(o, Circle) else shapely.Polygon(o.points)
        for o in place.obstacles
    ] + [shapely.LineString(wall.points) for wall in place.walls]


def ground(place: Scene) -> shapely.Geometry | None:
    """Where there are roads, if there are any."""
    if not place.roads:
        return None
    return shapely.union_all([shapely.LineString(r.points).buffer(r.width / 2) for r in place.roads])


def room(place: Scene, line: np.ndarray) -> float:
    """Distance of the nearest thing or edge from a line, metres; -1 where the line leaves the roads."""
    drawn = shapely.LineString(line)
    away = [drawn.distance(solid) for solid in solids(place)]
    if (region := ground(place)) is not None:
        away.append(drawn.distance(region.boundary) if region.covers(drawn) else -1.0)
    return min(away, default=np.inf)


def fits_through(place: Scene, margin: float) -> bool:
    """Whether a disc of the body's radius and a margin gets from the start to every goal, cell by cell."""
    things, region = solids(place), ground(place)
    points = np.concatenate((place.start[None], place.goals))
    low_x, low_z, high_x, high_z = shapely.total_bounds([shapely.MultiPoint(points), *things])
    x = np.arange(low_x - 2, high_x + 2, CELL)
    z = np.arange(low_z - 2, high_z + 2, CELL)
    cells = shapely.points(*(axis.ravel() for axis in np.meshgrid(x, z, indexing="ij")))
    radius = place.behavior.body_radius + margin
    free = np.ones(len(cells), bool)
    for thing in things:
        shapely.prepare(thing)
        free &= ~shapely.dwithin(thing, cells, radius)
    if region is not None:
        shapely.prepare(region)
        edge = region.boundary
        shapely.prepare(edge)
        free &= shapely.covers(region, cells) & ~shapely.dwithin(edge, cells, radius)
    rooms, _ = label(free.reshape(len(x), len(z)), np.ones((3, 3)))
    at = np.rint((points - [x[0], z[0]]) / CELL).astype(int)
    found = rooms[at[:, 0], at[:, 1]]
    return bool(found[0] > 0 and (found == found[0]).all())


def random_scene(seed: int) -> Scene:
    """Discs, polygons, walls, a maze, or roads with and without crossings, and somebody among them."""
    rng = np.random.default_rng(seed)
    kinds = (_discs, _polygons, _walls, _maze, _street, _crossing)
    kind = kinds[rng.integers(len(kinds))]
    goals, obstacles, roads, start = kind(rng)
    if not roads and kind is not _maze and rng.random() < 0.3:
        goals = [*goals, rng.uniform((-5, 1), (5, 9))]
    return scene(
        start,
        goals,
        obstacles,
        roads,
        side=str(rng.choice(["none", "left", "right"])),
        distance=str(rng.choice(["near", "far"])),
        velocity=float(rng.choice([0.8, 1.3, 3.0])),
        weight=float(rng.choice([50, 70, 100])),
        body_radius=float(rng.choice([0.2, 0.3, 0.4])),
    )


def _goal(rng: np.random.Generator) -> list[np.ndarray]:
    return [rng.uniform((-3, 6), (3, 10))]


def _discs(rng):
    places = rng.uniform((-5, 0.5), (5, 9), (rng.integers(25), 2))
    return _goal(rng), [disc(f"c{k}", *p, rng.uniform(0.1, 1.0)) for k, p in enumerate(places)], [], (0, 0)


def _polygons(rng):
    out = []
    for k, center in enumerate(rng.uniform((-5, 0.5), (5, 9), (rng.integers(25), 2))):
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 8)))
        reach = rng.uniform(0.2, 1.3) * rng.uniform(0.4, 1.0, len(angles))
        points = center + reach[:, None] * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
        if shapely.Polygon(points).is_valid and shapely.Polygon(points).area > 1e-3:
            out.append(Polygon(name=f"p{k}", points=points))
    return _goal(rng), out, [], (0, 0)


def _walls(rng):
    out = []
    for k, center in enumerate(rng.uniform((-5, 0.5), (5, 9), (rng.integers(25), 2))):
        angle = rng.uniform(0, np.pi)
        along = np.array([np.cos(angle), np.sin(angle)]) * rng.uniform(0.5, 3)
        across = np.array([-np.sin(angle), np.cos(angle)]) * 0.1
        corners = (center - along - across, center + along - across, center + along + across, center - along + across)
        out.append(Polygon(name=f"w{k}", points=np.array(corners)))
    return _goal(rng), out, [], (0, 0)


def _maze(rng, size=4):
    """Rooms with exactly one way from each to each; corridors that may be too narrow."""
    open_doors, seen, stack = set(), {(0, 0)}, [(0, 0)]
    while stack:
        i, j = stack[-1]
        near = [(i + a, j + b) for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        near = [c for c in near if min(c) >= 0 and max(c) < size and c not in seen]
        if not near:
            stack.pop()
            continue
        chosen = near[rng.integers(len(near))]
        open_doors.add(frozenset(((i, j), chosen)))
        seen.add(chosen)
        stack.append(chosen)
    wide = rng.uniform(0.75, 2.0)
    walls = []
    for i in range(size + 1):
        for j in range(size):
            for side in (0, 1):
                cells = [(i - 1, j), (i, j)] if side == 0 else [(j, i - 1), (j, i)]
                if 0 < i < size and frozenset(cells) in open_doors:
                    continue
                ends = np.array([(i, j), (i, j + 1)] if side == 0 else [(j, i), (j + 1, i)]) * wide
                walls.append(block(f"wall {len(walls)}", *(ends[0] - 0.05), *(ends[1] + 0.05)))
    return [np.full(2, (size - 0.5) * wide)], walls, [], np.full(2, 0.5 * wide)


def _street(rng):
    points, heading = [np.zeros(2)], 0.0
    for _ in range(rng.integers(1, 5)):
        heading += rng.uniform(-1.4, 1.4)
        points.append(points[-1] + rng.uniform(2, 5) * np.array([np.sin(heading), np.cos(heading)]))
    roads = [Road(name="street", points=np.array(points), width=rng.uniform(0.8, 4))]
    obstacles = []
    for k in range(rng.integers(6)):
        i, part = rng.integers(len(points) - 1), rng.random()
        middle = (1 - part) * points[i] + part * points[i + 1]
        obstacles.append(disc(f"c{k}", *(middle + rng.normal(0, 0.8, 2)), rng.uniform(0.1, 0.6)))
    return [points[-1]], obstacles, roads, (0, 0)


def _crossing(rng):
    goals, obstacles, roads, start = _street(rng)
    points = roads[0].points
    cross, way = points[len(points) // 2], rng.uniform(-4, 4, 2)
    ends = np.array([cross - 1.5 * way, cross + way])
    roads = [*roads, Road(name="lane", points=ends, width=rng.uniform(0.8, 3))]
    goals = [ends[1]] if rng.random() < 0.5 else [ends[0], *goals]
    if rng.random() < 0.2:
        roads = [*roads, road("island", 2.0, (30, 0), (34, 0))]
        goals = [*goals, np.array([31.0, 0.0])]
    return goals, obstacles, roads, start
