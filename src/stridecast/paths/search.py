"""The shortest way among obstacles: a visibility graph that grows with what is met, searched from start to goal."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import shapely
from jaxtyping import Float
from scipy.spatial import cKDTree

from stridecast.paths.insertion import WRONG_SIDE
from stridecast.paths.solids import EDGE
from stridecast.paths.space import HAIR, Space

Array = np.ndarray

EXACT = 60
"""While no more obstacles matter than these, the way found is the shortest; among more it may be a little longer."""

HURRIED = 1.05
"""How much longer, as a ratio."""

HURRIED_BY_SIDE = 1.2
"""The same for who prefers a side; there a side is worth a thirtieth only, for it cannot always be had."""

NEAREST = 400
"""Among many obstacles a line of sight leads to so many nearest corners at most, unless that leaves no way."""

CORRIDOR = 0.15
"""Among many obstacles those are known at once that are within so much of the way's length from the straight line."""

ENOUGH = 20
"""A search that meets so many new obstacles, and a quarter of those known, begins anew with them."""

OFTEN = 64
"""After so many steps of a search its progress is told, which also lets it be given up."""

_ALONG = 1e-7
"""Sines of angles below this count as straight."""


class Bend(NamedTuple):
    """A way's turn round a place.

    Parameters
    ----------
    center
        What it turns round ``(x, z)``, metres.
    radius
        How far from it, metres; 0 where it turns on the spot.
    side
        1 where the centre lies on the left, -1 on the right.
    obstacle
        Index of the obstacle; ``EDGE`` for the roads' edge, ``GOAL`` for a goal.
    """

    center: Float[Array, "2"]
    radius: float
    side: int
    obstacle: int


class Leg(NamedTuple):
    """The shortest way from point to point: a line, and what it bends round."""

    points: Float[Array, "points 2"]
    bends: tuple[Bend, ...]


class Corners:
    """Places at which a shortest way may bend: tangent polygons round grown corners and circles.

    Only those of obstacles that are known. Places inside another one that is known are not free; those inside others
    seem free, and whoever wants to go there gets to know the others.
    """

    def __init__(self, space: Space) -> None:
        self.space = space
        self.known: set[int] = set()
        self.positions = np.zeros((0, 2))
        self.before = np.zeros((0, 2))
        self.after = np.zeros((0, 2))
        self.centers = np.zeros((0, 2))
        self.radii = np.zeros(0)
        self.owners = np.zeros(0, np.int64)
        self.free = np.zeros(0, bool)
        self._inside: dict[int, list[int]] = {}
        if space.has_roads:
            self.known.add(EDGE)
            self._add([EDGE], [_road_arcs(space)])

    def learn(self, obstacles: set[int]) -> None:
        """Take obstacles into the graph."""
        new = sorted(obstacles - self.known)
        self.known |= obstacles
        for obstacle in new:
            self.free[self._inside.pop(obstacle, [])] = False
        self._add(new, [_arcs(self.space, obstacle) for obstacle in new])

    def _add(self, obstacles: list[int], arcs: list[list[tuple[Array, float, float, float]]]) -> None:
        columns: list[list[Array]] = [[], [], [], [], [], []]
        for owner, group in zip(obstacles, arcs, strict=True):
            for center, radius, first, last in group:
                widest = 2 * math.acos(radius / (radius + HAIR / 2))
                count = max(1, math.ceil((last - first) / widest))
                half = (last - first) / (2 * count)
                angle = first + half * (2 * np.arange(count) + 1)
                columns[0].append(center + radius / math.cos(half) * _at(angle))
                columns[1].append(_at(angle - half - math.pi / 2))
                columns[2].append(_at(angle + half + math.pi / 2))
                columns[3].append(np.repeat(center[None], count, axis=0))
                columns[4].append(np.full(count, radius))
                columns[5].append(np.full(count, owner))
        if not columns[0]:
            return
        before = len(self.owners)
        for name, column in zip(("positions", "before", "after", "centers", "radii", "owners"), columns, strict=True):
            setattr(self, name, np.concatenate((getattr(self, name), *column)))
        hit = self.space.hits(shapely.points(self.positions[before:]))
        self.free = np.concatenate((self.free, np.ones(len(self.owners) - before, bool)))
        for place, obstacle in zip((hit.line + before).tolist(), hit.obstacle.tolist(), strict=True):
            if obstacle in self.known:
                self.free[place] = False
            else:
                self._inside.setdefault(obstacle, []).append(place)


def shortest(
    space: Space, corners: Corners, start: Array, goal: Array, side: str, progress: Callable[[int], None]
) -> Leg | None:
    """The shortest way that keeps the clearances, or nothing.

    Only obstacles that block a line of sight are known to the graph; once a search meets no new ones its way is the
    shortest among all. Passing an obstacle on the side that is not preferred costs ``WRONG_SIDE`` metres,
    or half the distance from start to goal.

    Parameters
    ----------
    side
        ``left``, ``right`` or ``none``.
    """
    seen: dict[tuple[int, int], list[int]] = {}
    tests = 0
    nearest, wide = 0, CORRIDOR
    while True:
        many = len(corners.known) > EXACT
        if many and not nearest:
            nearest = NEAREST
            corners.learn(space.around(start, goal, max(10.0, wide * math.dist(start, goal))))
        leg, met, tests = _search(space, corners, start, goal, side, seen, tests, nearest if many else 0, progress)
        new = met - corners.known
        if leg is not None and (many or not new):
            return leg
        if new:
            corners.learn(new)
        elif nearest and wide < 4:
            wide, nearest = 2 * wide, 0
        elif nearest:
            many, nearest = False, 0
            leg, met, tests = _search(space, corners, start, goal, side, seen, tests, 0, progress)
            return leg
        else:
            return None


def _search(
    space: Space,
    corners: Corners,
    start: Array,
    goal: Array,
    side: str,
    seen: dict[tuple[int, int], list[int]],
    tests: int,
    nearest: int,
    progress: Callable[[int], None],
) -> tuple[Leg | None, set[int], int]:
    """A* over corners and sides; lines of sight are tested only when the search takes them."""
    positions, before, after, owners = corners.positions, corners.before, corners.after, corners.owners
    usable = np.flatnonzero(corners.free)
    tree = cKDTree(positions[usable]) if 0 < nearest < len(usable) else None
    to_goal = np.linalg.norm(positions - goal, axis=-1)
    weight = 1.0 if not nearest else HURRIED if side == "none" else HURRIED_BY_SIDE
    worth = WRONG_SIDE / 30 if nearest else min(WRONG_SIDE, 0.5 * math.dist(start, goal))
    enough = ENOUGH + len(corners.known) // 4
    by_start, by_goal = _close(corners, start), _close(corners, goal)
    met: set[int] = set()
    came: dict[tuple[int, int], tuple[int, int] | None] = {}
    cost: dict[tuple[int, int], float] = {}
    origin, aim = (-1, 0), (-2, 0)  # the start and the goal stand for no corner
    queue: list[tuple[float, float, int, int, int, int]] = [(0.0, 0.0, -1, 0, -1, 0)]
    while queue:
        _, so_far, node, turn, source, source_turn = heapq.heappop(queue)
        state, parent = (node, turn), (source, source_turn)
        if state in came:
            continue
        if state != origin:
            key = (source, node)
            if key not in seen:
                tests += 1
                a = start if source == -1 else positions[source]
                b = goal if node == -2 else positions[node]
                seen[key] = space.blocking(a, b)
            if seen[key]:
                met.update(seen[key])
                if len(met) > enough and len(met - corners.known) > enough:
                    return None, met, tests
                continue
        came[state] = None if state == origin else parent
        cost[state] = so_far
        if state == aim:
            break
        if len(cost) % OFTEN == 0:
            progress(tests)
        here = start if node == -1 else positions[node]
        length = math.dist(goal, here)
        if node == -1 or by_goal[node] or _leaves((goal - here) / max(length, 1e-12), before[node], after[node], turn):
            heapq.heappush(queue, (so_far + length, so_far + length, -2, 0, node, turn))
        if not len(usable):
            continue
        there = usable if tree is None else usable[tree.query(here, nearest)[1]]
        ways = positions[there] - here
        lengths = np.maximum(np.sqrt((ways * ways).sum(axis=-1)), 1e-12)
        ways = ways / lengths[:, None]
        first, second = _cross(ways, before[there]), _cross(ways, after[there])
        apart = lengths > 1e-9
        if node != -1:
            apart &= (turn * _cross(ways, before[node]) >= -_ALONG) & (turn * _cross(ways, after[node]) >= -_ALONG)
        # counterclockwise from x to z is to the right of who goes there: 1 has the obstacle on the right
        for sign in (1, -1):
            tangent = (sign * first >= -_ALONG) & (sign * second >= -_ALONG)
            if node == -1:  # between a corner's arc and its tangents no place beside seems tangent
                tangent |= by_start[there]
            fits = np.flatnonzero(apart & tangent)
            places = there[fits]
            total = so_far + lengths[fits]
            if side != "none":
                wanted = 1 if side == "left" else -1
                other = True if node == -1 else (owners[places] != owners[node]) | (sign != turn)
                total = total + worth * ((sign != wanted) & other & (owners[places] != EDGE))
            ahead = total + weight * to_goal[places]
            for k, g, f in zip(places.tolist(), total.tolist(), ahead.tolist(), strict=True):
                if (k, sign) not in came:
                    heapq.heappush(queue, (f, g, k, sign, node, turn))
    if aim not in came:
        return None, met, tests
    states = [aim]
    while (previous := came[states[-1]]) is not None:
        states.append(previous)
    states = states[::-1][1:-1]
    points = np.array([start, *(positions[k] for k, _ in states), goal])
    bends: list[Bend] = []
    for k, sign in states:
        bend = Bend(corners.centers[k], float(corners.radii[k]), -sign, int(owners[k]))
        same = bends and bends[-1].side == bend.side and np.array_equal(bends[-1].center, bend.center)
        if not same:
            bends.append(bend)
    return Leg(points, tuple(bends)), met, tests


def _close(corners: Corners, point: Array) -> Array:
    """Corners so near that a point may lie between their arc and its tangents, where no line to them is a tangent."""
    return np.linalg.norm(corners.positions - point, axis=-1) < 2.5 * np.sqrt((corners.radii + HAIR) * HAIR)


def _leaves(way: Array, before: Array, after: Array, turn: int) -> bool:
    """Whether a direction leads away from a corner along its tangent."""
    return bool(turn * _cross(way, before) >= -_ALONG and turn * _cross(way, after) >= -_ALONG)


def _arcs(space: Space, obstacle: int) -> list[tuple[Array, float, float, float]]:
    """Arcs round which a way may bend, as centre, radius, first and last angle on the page, counterclockwise."""
    keep = space.radius + float(space.clearance[obstacle])
    core = space.cores[obstacle]
    if space.reach[obstacle] > 0:
        return [(shapely.get_coordinates(core)[0], float(space.reach[obstacle]) + keep, 0.0, 2 * math.pi)]
    return _corner_arcs(shapely.get_coordinates(core)[:-1], keep)


def _road_arcs(space: Space) -> list[tuple[Array, float, float, float]]:
    """Arcs round the inner corners of the roads."""
    keep = space.radius + space.edge_clearance
    out = []
    for part in shapely.get_parts(space.road):
        polygon = shapely.geometry.polygon.orient(part)
        for ring in (polygon.exterior, *polygon.interiors):
            out += _corner_arcs(shapely.get_coordinates(ring)[:-1][::-1], keep)
    return out


def _corner_arcs(ring: Array, keep: float) -> list[tuple[Array, float, float, float]]:
    """Arcs round the convex corners of a ring that goes counterclockwise round what is solid."""
    ring = ring[np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=-1) > 1e-9]
    arriving = ring - np.roll(ring, 1, axis=0)
    first = np.arctan2(arriving[:, 1], arriving[:, 0]) - math.pi / 2
    turn = np.roll(first, -1) - first
    turn = (turn + math.pi) % (2 * math.pi) - math.pi
    return [(ring[k], keep, float(first[k]), float(first[k] + turn[k])) for k in np.flatnonzero(turn > 1e-9)]


def _at(angle: Array) -> Array:
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
