"""From a scene to a curve that its walker can follow (BJL section 3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Float

from stridecast.errors import PathError
from stridecast.geometry import ground
from stridecast.model.scene import Scene
from stridecast.paths.blockers import check_reachable
from stridecast.paths.curve import Curve
from stridecast.paths.insertion import Inserted, insert
from stridecast.paths.search import Bend, Corners, Leg, shortest
from stridecast.paths.space import GOAL, HAIR, Space
from stridecast.paths.strings import Taut, pull, widen

Array = np.ndarray

SOFTENING = (0.12, 0.06, 0.03, 0.015, HAIR / 2, HAIR / 4, 0.0)
"""How far a searched curve may be moved to turn gradually, metres: tried in this order, always in the clear."""

NARROWER = (1.0, 0.5, 0.0)
"""Shares of the clearances with which a way is searched for, in this order."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """A curve through a scene and how it was found.

    Parameters
    ----------
    curve
        From the start through all goals, clear of everything by the body's radius.
    polygon
        The line that the curve follows, ``(x, z)``, metres: through the control points, or tight round obstacles.
    inserted
        Control points beside obstacles, in the order of the way.
    rounds
        How often control points were inserted.
    searched
        Whether that led nowhere or round about, and the visibility graph was searched.
    """

    curve: Curve
    polygon: Float[Array, "points 2"]
    inserted: tuple[Inserted, ...]
    rounds: int
    searched: bool


def generate_path(scene: Scene, *, progress: Callable[[float], None] | None = None) -> Path:
    """Find a way from the start through all goals.

    Control points are inserted beside what blocks the curve until it is clear. Where that leads nowhere, to more than a
    tenth of detour or to sharp bends, the shortest way is searched for, pulled tight round the obstacles and then made
    as wide in its turns as there is room.

    Parameters
    ----------
    scene
        The place and the task.
    progress
        Is called now and then with how much is done, from 0 to 1.

    Raises
    ------
    SceneError
        No start and goals for a single walker, a polygon that is none, a start or goal where the body cannot stand, or
        a goal at the start.
    PathError
        There is no way; the message names what is in the way.
    """
    tell = progress or (lambda _: None)
    tell(0.0)
    space = Space(scene)
    found = insert(scene, space, tell)
    if found is not None and _is_good(space, found.curve):
        tell(1.0)
        return Path(
            curve=found.curve, polygon=found.controls, inserted=found.inserted, rounds=found.rounds, searched=False
        )
    tell(0.5)
    check_reachable(space)
    tell(0.6)
    legs = _search(scene, space, tell)
    path = _path(scene, space, legs)
    tell(1.0)
    return path


def _search(scene: Scene, space: Space, tell: Callable[[float], None]) -> list[Leg]:
    """Shortest ways from point to point, with as much clearance as leaves one."""
    legs: list[Leg] = []
    side = scene.behavior.preference.side
    for share in NARROWER:
        if share < 1:
            space.narrowed(share)
        corners = Corners(space)
        legs = []
        for start, goal in zip(space.points, space.points[1:], strict=False):
            part = 0.3 / (len(space.points) - 1)
            leg = shortest(space, corners, start, goal, side, _told(tell, 0.6 + part * len(legs), part))
            if leg is None:
                break
            legs.append(leg)
        else:
            return legs
    one, other = space.point_names[len(legs)], space.point_names[len(legs) + 1]
    raise PathError(f"there is no way from {one} to {other} that leaves the body {HAIR:g} m of room on both sides")


def _told(tell: Callable[[float], None], done: float, part: float) -> Callable[[int], None]:
    """Progress of a search, of which nobody knows how long it takes."""
    return lambda tests: tell(done + part * tests / (tests + 20_000))


def _path(scene: Scene, space: Space, legs: list[Leg]) -> Path:
    """The widest smooth curve along legs that is clear."""
    polygon = np.concatenate([legs[0].points, *(leg.points[1:] for leg in legs[1:])])
    start, goal = space.points[0], legs[-1].points[-1]
    bends: list[Bend] = []
    for k, leg in enumerate(legs):
        bends += leg.bends
        if k + 1 < len(legs):
            bends.append(_goal_bend(scene, leg, legs[k + 1]))
    inserted = _inserted(space, bends, pull(start, bends, goal))
    lines = [pull(start, widen(space, start, bends, goal), goal), pull(start, bends, goal)]
    lines.append(_one_by_one(space, legs))
    lines.append(Taut(polygon, polygon[1:-1]))
    for line in lines:
        if line is None:
            continue
        controls = np.concatenate((start[None], line.apexes, goal[None]))
        for softening in SOFTENING:
            curve = _with_controls(Curve.through(line.points, rounding=softening), controls)
            if _is_good(space, curve):
                return Path(curve=curve, polygon=polygon, inserted=inserted, rounds=0, searched=True)
    raise PathError("the way found is not clear")  # pragma: no cover


def _one_by_one(space: Space, legs: list[Leg]) -> Taut:
    """Strings from point to point, each for itself, with corners where they meet."""
    points, apexes = [legs[0].points[:1]], []
    for leg in legs:
        ends = leg.points[0], leg.points[-1]
        bends = list(leg.bends)
        line = pull(ends[0], widen(space, ends[0], bends, ends[1]), ends[1]) or pull(ends[0], bends, ends[1])
        line = line or Taut(leg.points, leg.points[1:-1])
        points.append(line.points[1:])
        apexes += [line.apexes, leg.points[-1:]]
    return Taut(np.concatenate(points), np.concatenate(apexes[:-1]))


def _goal_bend(scene: Scene, before: Leg, after: Leg) -> Bend:
    """A turn on the spot at a goal between two legs."""
    one, other = np.diff(before.points[-2:], axis=0)[0], np.diff(after.points[:2], axis=0)[0]
    left = one[1] * other[0] - one[0] * other[1]
    side = 1 if left > 0 else -1
    if abs(left) < 1e-3 * np.linalg.norm(one) * np.linalg.norm(other):
        side = -1 if scene.behavior.preference.side == "right" else 1
    return Bend(before.points[-1], 0.0, side, GOAL)


def _inserted(space: Space, bends: list[Bend], taut: Taut | None) -> tuple[Inserted, ...]:
    """Where the string passes obstacles, and which."""
    apexes = taut.apexes if taut is not None and len(taut.apexes) == len(bends) else [b.center for b in bends]
    return tuple(
        Inserted((float(apex[0]), float(apex[1])), space.name(bend.obstacle))
        for bend, apex in zip(bends, apexes, strict=True)
        if bend.obstacle != GOAL
    )


def _is_good(space: Space, curve: Curve) -> bool:
    """Whether a curve is clear by the body's radius and passes all goals in order."""
    if not space.is_clear(shapely.LineString(curve.points)):
        return False
    done = 0.0
    for point in space.points[1:-1]:
        ahead = curve.distances >= done
        away = np.linalg.norm(curve.points[ahead] - point, axis=-1)
        near = np.flatnonzero(away < 0.05)
        if not len(near):
            return False
        done = float(curve.distances[ahead][near[0]])
    return True


def _with_controls(curve: Curve, controls: Array) -> Curve:
    at = curve.at(curve.nearest(controls))
    return Curve(
        controls=controls,
        tangents=ground.direction(at.heading),
        points=curve.points,
        headings=curve.headings,
        curvatures=curve.curvatures,
        distances=curve.distances,
    )
