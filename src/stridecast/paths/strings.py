"""A string pulled tight round circles: straight where it can be, and as wide in its turns as there is room."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from jaxtyping import Float

from stridecast.geometry import ground
from stridecast.model.scene import USUAL_WEIGHT, Behavior
from stridecast.paths.curve import STEP
from stridecast.paths.search import Bend
from stridecast.paths.space import GOAL, Space

Array = np.ndarray

TURNING_TIME = 0.9
"""Turns are so many seconds of way in radius where there is room: at 1.3 m/s and 70 kg 1.2 m. That is nearly half of
BJL's tangents, which are two directions long."""

TRIES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.08)
"""Shares of that radius that are tried."""

TURNS_BACK = 1.6
"""Differences of directions above this are turning back, by more than a hundred degrees."""

BACK = 0.4
"""How much smaller the radius of turning back is."""

TILTS = (0.0, 0.8, -0.8, 1.5, -1.5)
"""Where the circle of turning back lies, radians from straight before its goal."""

LONGEST_TURN = 1.25 * math.pi
"""What seems to turn by more turns the other way, radians."""

TIGHTEST = 0.05
"""Smallest radius of a turn on an open place, metres."""


class Taut(NamedTuple):
    """A string: its points every step or so, and the middle of each bend."""

    points: Float[Array, "points 2"]
    apexes: Float[Array, "bends 2"]


def wide_radius(behavior: Behavior) -> float:
    """Radius of turns somebody takes where there is room, metres: grows with velocity and weight."""
    return TURNING_TIME * behavior.velocity * behavior.weight / USUAL_WEIGHT


def pull(start: Array, bends: list[Bend], goal: Array) -> Taut | None:
    """The string from start to goal round bends, or nothing where it would have to turn the wrong way.

    Bends that the string does not touch are left out, but never a goal.
    """
    bends = _touched(start, bends, goal)
    headings = _headings([Bend(start, 0.0, 1, GOAL), *bends, Bend(goal, 0.0, 1, GOAL)])
    if headings is None or _overturns(turns := _turns(bends, headings)):
        return None
    points, apexes = [start[None]], []
    for bend, heading, turn in zip(bends, headings, turns, strict=False):
        points.append(_turn(bend, heading, turn, STEP))
        angle = 0.0 if turn > 2 * math.pi - 1e-6 else turn
        apexes.append(_on(bend, np.array([heading + bend.side * angle / 2]))[0])
    points.append(goal[None])
    return Taut(np.concatenate(points), np.array(apexes).reshape(-1, 2))


def widen(space: Space, start: Array, bends: list[Bend], goal: Array) -> list[Bend]:
    """Make turns as wide as somebody takes them where there is room, one after the other; others stay.

    A wider circle touches the old one from outside the turn, in its middle: the way passes there as before, and begins
    to turn earlier. Two bends in a row to one side, as round the end of a wall, first try to become one. What is new of
    the way must keep the same clearance.
    """
    bends = list(bends)
    for k in range(len(bends) - 2, -1, -1):
        if k + 1 < len(bends):
            bends = _joined(space, start, bends, goal, k)
    k = 0
    while k < len(bends):
        before = len(bends)
        bends = _widened(space, start, bends, goal, k)
        k += 1 if len(bends) == before else 0
    return bends


def _joined(space: Space, start: Array, bends: list[Bend], goal: Array, k: int) -> list[Bend]:
    """Bends of which one and the next became one that is as wide as somebody takes turns, if it can be."""
    one, other = bends[k], bends[k + 1]
    wish = wide_radius(space.scene.behavior)
    apart = math.dist(one.center, other.center)
    inner = max(one.radius, other.radius)
    if one.side != other.side or min(one.obstacle, other.obstacle) == GOAL or not 0 < apart / 2 < wish - inner:
        return bends
    # the circle of that radius that both touch from inside, its centre on the inner side of the turn
    along = (other.center - one.center) / apart
    middle = (one.center + other.center) / 2
    inward = one.side * ground.left_of(along)
    for share in TRIES:
        if (room := wish * share - inner) <= apart / 2:
            break
        center = middle + math.sqrt(room**2 - apart**2 / 4) * inward
        wide = Bend(center, wish * share, one.side, one.obstacle)
        tried = [*bends[:k], wide, *bends[k + 2 :]]
        if _is_better(space, start, bends, tried, goal, k):
            return _touched(start, tried, goal)
    return bends


def _widened(space: Space, start: Array, bends: list[Bend], goal: Array, k: int) -> list[Bend]:
    """Bends of which one became as wide as there is room; those that the string no longer touches are left out."""
    headings = _headings([Bend(start, 0.0, 1, GOAL), *bends, Bend(goal, 0.0, 1, GOAL)])
    if headings is None:
        return bends
    normal = _direction(headings[k]) - _direction(headings[k + 1])
    size = float(np.linalg.norm(normal))
    if size < 1e-3:
        return bends
    normal = normal / size
    apex = bends[k].center + bends[k].radius * normal
    # turning back at a goal has more than one form: to either side, round its place or beside it
    back = bends[k].obstacle == GOAL and size > TURNS_BACK
    forms = [(side * bends[k].side, tilt) for tilt in TILTS for side in (1, -1)] if back else [(bends[k].side, 0.0)]
    wish = wide_radius(space.scene.behavior) * (BACK if back else 1.0)
    for radius in (max(wish * share, TIGHTEST) for share in TRIES):
        if radius <= bends[k].radius:
            break
        wider: list[tuple[float, int, list[Bend]]] = []
        for side, tilt in forms:
            center = apex - radius * ground.turn(normal, np.array(tilt))
            tried = [*bends]
            tried[k] = bends[k]._replace(center=center, radius=radius, side=side)
            if longer := _is_better(space, start, bends, tried, goal, k):
                wider.append((longer, len(wider), tried))
        if wider:
            return _touched(start, min(wider)[2], goal)
    return bends


def _is_better(space: Space, start: Array, bends: list[Bend], tried: list[Bend], goal: Array, k: int) -> float:
    """Length of the string round bends about the changed one, metres; 0 if it is none, not clear or goes far round."""
    reach = 2
    low = max(0, k - reach)
    old = _part(start, bends, goal, low, min(len(bends), k + reach + 1 + len(bends) - len(tried)))
    new = _part(start, tried, goal, low, min(len(tried), k + reach + 1))
    if old is None or new is None or _length(new) > _length(old) + 2 * tried[k].radius:
        return 0.0
    return _length(new) if space.is_clear(shapely.LineString(new), share=0.95) else 0.0


def _part(start: Array, bends: list[Bend], goal: Array, low: int, high: int) -> Array | None:
    """The string from a bend before some to one behind them, where it exists and touches those two and all goals."""
    inner = bends[low:high]
    first = bends[low - 1] if low > 0 else Bend(start, 0.0, 1, GOAL)
    last = bends[high] if high < len(bends) else Bend(goal, 0.0, 1, GOAL)
    while True:
        headings = _headings([first, *inner, last])
        if headings is None:
            return None
        turns = _turns(inner, headings)
        if not (slack := _slack(inner, turns)):
            break
        del inner[slack[0]]
    if _overturns(turns):
        return None
    points = [_on(first, np.array([headings[0]]))]
    for bend, heading, turn in zip(inner, headings, turns, strict=False):
        points.append(_turn(bend, heading, turn, 0.05))
    points.append(_on(last, np.array([headings[-1]])))
    return np.concatenate(points)


def _touched(start: Array, bends: list[Bend], goal: Array) -> list[Bend]:
    """Bends that the string from start to goal touches, and goals."""
    bends = list(bends)
    while True:
        headings = _headings([Bend(start, 0.0, 1, GOAL), *bends, Bend(goal, 0.0, 1, GOAL)])
        if headings is None or not (slack := _slack(bends, _turns(bends, headings))):
            return bends
        del bends[slack[0]]


def _turns(bends: list[Bend], headings: list[float]) -> list[float]:
    """How far each bend turns to its side, radians; nearly a whole turn is a little to the other side."""
    return [b.side * (headings[k + 1] - headings[k]) % (2 * math.pi) for k, b in enumerate(bends)]


def _slack(bends: list[Bend], turns: list[float]) -> list[int]:
    """Bends that the string does not touch, goals apart."""
    return [k for k, turn in enumerate(turns) if turn > 2 * math.pi - 0.5 and bends[k].obstacle != GOAL]


def _overturns(turns: list[float]) -> bool:
    """Whether the string would have to turn the wrong way somewhere."""
    return any(LONGEST_TURN < turn < 2 * math.pi - 1e-6 for turn in turns)


def _turn(bend: Bend, heading: float, turn: float, step: float) -> Array:
    """Points of a bend from a heading on; a hair's turn to the wrong side is none."""
    angle = 0.0 if turn > 2 * math.pi - 1e-6 else turn
    count = max(1, math.ceil(max(angle * bend.radius / step, angle / 0.05)))
    return _on(bend, heading + bend.side * np.linspace(0.0, angle, count + 1))


def _length(points: Array) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=-1).sum())


def _headings(chain: list[Bend]) -> list[float] | None:
    """Headings of the lines between bends, or nothing where two overlap such that none touches both."""
    out = []
    for one, other in pairwise(chain):
        way = other.center - one.center
        distance = math.hypot(*way)
        shift = other.side * other.radius - one.side * one.radius  # how much further left the other centre lies
        if distance < 1e-9 or abs(shift) > distance + 1e-6:  # a start or goal may lie on a circle
            return None
        out.append(math.atan2(way[0], way[1]) - math.asin(min(1.0, max(-1.0, shift / distance))))
    return out


def _on(bend: Bend, heading: Array) -> Array:
    """Points of a bend where one passes with a heading."""
    left = np.stack((np.cos(heading), -np.sin(heading)), axis=-1)
    return bend.center - bend.side * bend.radius * left


def _direction(heading: float) -> Array:
    return np.array([math.sin(heading), math.cos(heading)])
