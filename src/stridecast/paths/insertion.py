"""Control points inserted beside what blocks a curve, until nothing does (BJL section 3, figure 3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import shapely
from jaxtyping import Float

from stridecast.geometry import ground
from stridecast.model.scene import Scene
from stridecast.paths.curve import Curve
from stridecast.paths.solids import EDGE
from stridecast.paths.space import GOAL, Space

Array = np.ndarray

ROUNDS = 30
"""After so many rounds obstacles are searched through instead."""

PUSHES = 5
"""How often a control point is moved further away from its obstacle."""

DETOUR = 1.1
"""Ways longer than this, as a ratio to the line straight through the goals, are searched for instead."""

WRONG_SIDE = 10.0
"""Passing an obstacle on the preferred side is worth a detour of so many metres, but not of more than half the way."""

KEPT = 0.7
"""The share of the clearance that a curve keeps between control points."""

SHARPEST = 1.2
"""Curves that bend more than this are searched for instead, 1/m."""


class Inserted(NamedTuple):
    """A control point ``(x, z)``, metres, and the name of the obstacle it goes round."""

    point: tuple[float, float]
    obstacle: str


class Insertion(NamedTuple):
    """A curve that is clear, how it came about, and after how many rounds."""

    curve: Curve
    controls: Float[Array, "controls 2"]
    inserted: tuple[Inserted, ...]
    rounds: int


def insert(scene: Scene, space: Space, progress: Callable[[float], None]) -> Insertion | None:
    """Insert control points from a straight line on; nothing where that leads nowhere or round about."""
    stops = space.points
    straight = float(np.linalg.norm(np.diff(stops, axis=0), axis=-1).sum())
    controls = list(stops)
    owners = [GOAL] * len(stops)
    sides = [0] * len(stops)
    pushes: dict[int, int] = {}
    count = 0
    for done in range(ROUNDS):
        curve = Curve.hermite(np.array(controls), scene.behavior)
        blocked = _blocking(space, curve, np.array(controls))
        if blocked is None:
            return None
        if not blocked:
            if curve.length > DETOUR * straight + 0.1 or _sways(curve, np.array(controls)):
                return None
            inserted = tuple(
                Inserted((float(p[0]), float(p[1])), space.name(o))
                for p, o in zip(controls, owners, strict=True)
                if o >= 0
            )
            return Insertion(curve, np.array(controls), inserted, done)
        progress(min(0.5, done / ROUNDS))
        for span, obstacle in reversed(blocked):  # from behind, so that places before stay
            at = next((k for k in (span, span + 1) if owners[k] == obstacle), None)
            if at is not None:
                pushes[obstacle] = pushes.get(obstacle, 0) + 1
                if pushes[obstacle] > PUSHES:
                    return None
                extra = 0.15 * pushes[obstacle] * (space.radius + float(space.clearance[obstacle]))
                place = _beside(space, obstacle, controls[at - 1], controls[at + 1], sides[at], extra)
                if place is None:
                    return None
                controls[at] = place
                continue
            found = _choose(scene, space, obstacle, controls[span], controls[span + 1])
            if found is None:
                return None
            controls.insert(span + 1, found[0])
            owners.insert(span + 1, obstacle)
            sides.insert(span + 1, found[1])
            count += 1
    return None


def _blocking(space: Space, curve: Curve, controls: Array) -> list[tuple[int, int]] | None:
    """The first obstacle in each span between control points; None where the curve leaves the roads."""
    ends = np.rint(curve.nearest(controls[1:-1]) / curve.step).astype(int) if len(controls) > 2 else np.zeros(0, int)
    cuts = np.concatenate(([0], np.maximum.accumulate(ends), [len(curve.points) - 1]))
    spans = [k for k in range(len(cuts) - 1) if cuts[k + 1] > cuts[k]]
    lines = [shapely.LineString(curve.points[cuts[k] : cuts[k + 1] + 1]) for k in spans]
    hit = space.hits(lines, KEPT)
    if (hit.obstacle == EDGE).any():
        return None
    out = []
    for place, k in enumerate(spans):
        found = np.unique(hit.obstacle[hit.line == place])
        if len(found):
            first = shapely.line_locate_point(lines[place], shapely.centroid(space.cores[found]))
            out.append((k, int(found[int(np.argmin(first))])))
    return out


def _choose(scene: Scene, space: Space, obstacle: int, start: Array, stop: Array) -> tuple[Array, int] | None:
    """Point beside an obstacle, on the side that is preferred or shorter, and that side (1: left)."""
    best: tuple[float, Array, int] | None = None
    for side, name in ((1, "left"), (-1, "right")):
        place = _beside(space, obstacle, start, stop, side, 0.0)
        if place is None:
            continue
        cost = float(np.linalg.norm(place - start) + np.linalg.norm(stop - place))
        if scene.behavior.preference.side not in ("none", name):
            cost += min(WRONG_SIDE, 0.5 * float(np.linalg.norm(stop - start)))
        if best is None or cost < best[0] - 1e-9:
            best = (cost, place, side)
    return None if best is None else best[1:]


def _beside(space: Space, obstacle: int, start: Array, stop: Array, side: int, extra: float) -> Array | None:
    """Point at an obstacle's left (1) or right (-1), seen along a line; None where there is no room for it."""
    way = stop - start
    length = np.linalg.norm(way)
    if length < 1e-6:
        return None
    normal = side * ground.left_of(way / length)
    outline = shapely.get_coordinates(space.cores[obstacle])
    extent = outline @ normal
    corners = outline[extent > extent.max() - 1e-6]
    keep = space.reach[obstacle] + space.radius + space.clearance[obstacle] + extra
    place = corners.mean(axis=0) + keep * normal
    along = float((place - start) @ way) / length
    if not 0.05 * length < along < 0.95 * length or len(space.hits(shapely.Point(place), KEPT).gap):
        return None
    return place


def _sways(curve: Curve, controls: Array) -> bool:
    """Whether a curve bends sharply, or in sum much more than the line through its control points."""
    legs = ground.heading(np.diff(controls, axis=0))
    turns = np.abs(ground.wrap(np.diff(legs)))
    if turns.max(initial=0.0) > np.pi / 2 or np.abs(curve.curvatures).max() > SHARPEST:
        return True
    return bool(np.abs(np.diff(curve.headings)).sum() > 2.0 * turns.sum() + 0.1)
