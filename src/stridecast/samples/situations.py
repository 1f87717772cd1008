"""The situations in which crowds are judged in the literature, as scenes.

RiMEA, *Guideline for Microscopic Evacuation Analysis* (test 6: the corner); van den Berg et al., *Reciprocal n-body
collision avoidance*, 2011 (antipodal); Seyfried et al., *The fundamental diagram of pedestrian movement revisited*,
2005 (ring). Speeds are those of Weidmann, *Transporttechnik der Fussgänger*, 1993: 1.34 m/s, 0.26 either way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from stridecast.errors import SceneError
from stridecast.model.people import Person, Route, Source, Spread, Wall
from stridecast.model.scene import DISTANCES, PATIENCE, SIDES_OF_WAY, Behavior, Preference, Scene

Array = np.ndarray

SPEEDS = Spread(mean=1.34, deviation=0.26, least=0.8, most=1.9)
"""Of people who are in no hurry, m/s."""

RADIUS = 0.25
"""Of their bodies, metres."""

SIDES = (0.5, 0.25, 0.25)
WORDS = ((SIDES_OF_WAY, SIDES), (DISTANCES, (0.7, 0.3)), (PATIENCE, (0.5, 0.5)))
"""Preferences, and shares of who has them."""

BEYOND = 3.0
"""People leave so far beyond the end of a corridor, metres, lest they block it."""

ELBOW = 0.05
"""Room between people at the beginning at least, metres."""


def situation(name: str, seed: int = 0, **arguments: Any) -> Scene:
    """A situation of the literature.

    Parameters
    ----------
    name
        One of ``SITUATIONS``.
    seed
        Varies starts, speeds and preferences.
    arguments
        Of the situation, such as ``density`` of the ring.

    Raises
    ------
    SceneError
        There is none of this name.
    """
    if name not in SITUATIONS:
        raise SceneError(f"there is no situation {name!r}; there are {', '.join(SITUATIONS)}")
    return SITUATIONS[name](seed, **arguments)


def head_on(seed: int = 0) -> Scene:
    """Two people meet in a corridor 3 m wide."""
    rng = np.random.default_rng(seed)
    people = (
        _person("one", rng, (rng.uniform(-0.4, 0.4), rng.uniform(0.5, 2.0)), _gate(3.0, 20.0 + BEYOND)),
        _person("other", rng, (rng.uniform(-0.4, 0.4), rng.uniform(18.0, 19.5)), _gate(3.0, -BEYOND)),
    )
    return Scene(walls=_corridor(3.0, 0.0, 20.0), people=people, seed=seed, seconds=60.0)


def overtaking(seed: int = 0) -> Scene:
    """Somebody at 1.4 m/s comes up behind somebody at 0.8 m/s in a corridor 3 m wide."""
    rng = np.random.default_rng(seed)
    goal = _gate(3.0, 30.0 + BEYOND)
    people = (
        _person("slow", rng, (rng.uniform(-0.3, 0.3), rng.uniform(4.0, 5.0)), goal, velocity=0.8),
        _person("fast", rng, (rng.uniform(-0.3, 0.3), rng.uniform(0.5, 1.5)), goal, velocity=1.4),
    )
    return Scene(walls=_corridor(3.0, 0.0, 30.0), people=people, seed=seed, seconds=90.0)


def crossing(seed: int = 0) -> Scene:
    """The ways of two people cross at a right angle; they would be there at about the same time."""
    rng = np.random.default_rng(seed)
    speeds = [_speed(rng), _speed(rng)]
    away = 6.0 / np.mean(speeds) * np.array(speeds) + rng.uniform(-0.5, 0.5, 2)
    people = (
        _person("one", rng, (rng.uniform(-0.3, 0.3), -away[0]), _gate(2.0, 8.0), velocity=speeds[0]),
        _person("other", rng, (-away[1], rng.uniform(-0.3, 0.3)), _gate(2.0, 8.0)[:, ::-1], velocity=speeds[1]),
    )
    return Scene(people=people, seed=seed, seconds=60.0)


def four_way(seed: int = 0, people: int = 6) -> Scene:
    """Four streams, each of so many people, cross at a square between corridors 4 m wide."""
    half, end = 2.0, 14.0
    walls, sources = [], []
    for k, name in enumerate(("south", "west", "north", "east")):
        turn = _turned(k)
        corner = np.array([(half, -end), (half, -half), (end, -half)])
        walls.append(Wall(name=f"{name} corner", points=corner @ turn))
        area = np.array([(-half, -end), (half, -end), (half, -4.0), (-half, -4.0)]) @ turn
        goal = _gate(2 * half, end + BEYOND) @ turn
        sources.append(_source(name, area, (goal,), people))
    return Scene(walls=tuple(walls), sources=tuple(sources), seed=seed, seconds=90.0)


def antipodal(seed: int = 0, people: int = 100, radius: float = 20.0) -> Scene:
    """People on a circle, each on the way to the opposite point."""
    rng = np.random.default_rng(seed)
    apart = 2 * radius * np.sin(np.pi / people)
    offset = min(0.2, (apart - 2 * RADIUS - ELBOW) / 2)
    if offset < 0:
        raise SceneError(f"{people} people do not fit on a circle of {radius:g} m; {apart:.2g} m are between two")
    angles = 2 * np.pi * np.arange(people) / people
    places = radius * np.stack((np.sin(angles), np.cos(angles)), axis=-1)
    shift = offset * np.sqrt(rng.random((people, 1))) * _unit(rng.uniform(-np.pi, np.pi, people))
    crowd = tuple(
        _person(f"person {k + 1}", rng, start, (-place)[None])
        for k, (start, place) in enumerate(zip(places + shift, places, strict=True))
    )
    return Scene(people=crowd, seed=seed, seconds=120.0)


def two_way(seed: int = 0, density: float = 1.0) -> Scene:
    """A corridor 4 m wide and 25 m long, full of people, of whom half go each way."""
    half, length = 2.0, 25.0
    area = np.array([(-half, 0.0), (half, 0.0), (half, length), (-half, length)])
    count = round(density * 2 * half * length)
    sources = (
        _source("forth", area, (_gate(2 * half, length + BEYOND),), count // 2),
        _source("back", area, (_gate(2 * half, -BEYOND),), count - count // 2),
    )
    return Scene(walls=_corridor(2 * half, 0.0, length), sources=sources, seed=seed, seconds=120.0)


def bottleneck(seed: int = 0, people: int = 60, width: float = 1.2) -> Scene:
    """People leave a room through a door."""
    half, deep = 4.0, 8.0
    walls = (
        Wall(name="left of the door", points=np.array([(half, -deep), (half, 0.0), (width / 2, 0.0)])),
        Wall(name="right of the door", points=np.array([(-half, -deep), (-half, 0.0), (-width / 2, 0.0)])),
        Wall(name="back wall", points=np.array([(half, -deep), (-half, -deep)])),
    )
    area = np.array([(-half, -deep), (half, -deep), (half, -1.0), (-half, -1.0)])
    sources = (_source("room", area, (_gate(2 * half, 2 * BEYOND),), people),)
    return Scene(walls=walls, sources=sources, seed=seed, seconds=120.0)


def corner(seed: int = 0, people: int = 20) -> Scene:
    """People go round a corner to the left between walls 2 m apart, each leg 12 m long (RiMEA test 6)."""
    walls = (
        Wall(name="outer wall", points=np.array([(1.0, 0.0), (-1.0, 0.0), (-1.0, 12.0), (11.0, 12.0)])),
        Wall(name="inner wall", points=np.array([(1.0, 0.0), (1.0, 10.0), (11.0, 10.0)])),
    )
    area = np.array([(-1.0, 0.0), (1.0, 0.0), (1.0, 9.0), (-1.0, 9.0)])
    goal = np.array([(11.0 + BEYOND, 10.5), (11.0 + BEYOND, 11.5)])
    return Scene(walls=walls, sources=(_source("leg", area, (goal,), people),), seed=seed, seconds=60.0)


def ring(seed: int = 0, density: float = 1.0, laps: int = 3) -> Scene:
    """Everybody goes round and round to the left in a corridor between circles of 5 and 8 m.

    Parameters
    ----------
    density
        People per square metre.
    laps
        How often they go round before they leave.

    Raises
    ------
    SceneError
        So many do not fit.
    """
    inner, outer, gates = 5.0, 8.0, 24
    rng = np.random.default_rng(seed)
    angles = np.linspace(0.0, 2 * np.pi, 97)
    walls = tuple(Wall(name=n, points=r * _unit(angles)) for n, r in (("inner wall", inner), ("outer wall", outer)))
    count = round(density * np.pi * (outer**2 - inner**2))
    if count < 1:
        raise SceneError(f"nobody is in a ring with {density:g} people per square metre")
    margin = RADIUS + 0.2
    radii, turns, apart = _lanes(count, inner + margin, outer - margin)
    if apart < 2 * RADIUS:
        raise SceneError(f"{count} people do not fit into the ring: {density:g} per square metre are too many")
    free = max(0.0, (apart - 2 * RADIUS - ELBOW) / 2)
    shift = free * np.sqrt(rng.random((count, 1))) * _unit(rng.uniform(-np.pi, np.pi, count))
    starts = radii[:, None] * _unit(turns) + shift
    away = np.linalg.norm(starts, axis=-1)
    starts *= (np.clip(away, inner + margin, outer - margin) / away)[:, None]
    people = []
    for k, start in enumerate(starts):
        # to the left: headings rise, so angles on the ground do as well
        angle = np.arctan2(*start) + 2 * np.pi / gates * np.arange(1, gates * laps + 1)
        stops = tuple(np.linalg.norm(start) * _unit(angle)[:, None])
        people.append(_person(f"person {k + 1}", rng, start, *stops))
    return Scene(walls=walls, people=tuple(people), seed=seed, seconds=60.0 * laps)


SITUATIONS: dict[str, Callable[..., Scene]] = {
    "head_on": head_on,
    "overtaking": overtaking,
    "crossing": crossing,
    "four_way": four_way,
    "antipodal": antipodal,
    "two_way": two_way,
    "bottleneck": bottleneck,
    "corner": corner,
    "ring": ring,
}
"""What ``situation`` knows."""


def _person(name: str, rng: np.random.Generator, start: Any, *stops: Array, velocity: float | None = None) -> Person:
    words = [str(rng.choice(words, p=shares)) for words, shares in WORDS]
    behavior = Behavior(
        velocity=_speed(rng) if velocity is None else velocity,
        preference=Preference(side=words[0], distance=words[1], patience=words[2]),
        body_radius=RADIUS,
    )
    return Person(name=name, start=np.array(start), stops=stops, behavior=behavior)


def _source(name: str, area: Array, stops: tuple[Array, ...], people: int) -> Source:
    return Source(
        name=name,
        area=area,
        routes=(Route(stops=stops),),
        at_once=people,
        velocity=SPEEDS,
        body_radius=Spread(mean=RADIUS),
        sides=SIDES,
        distance=(0.7, 0.3),
        patience=(0.5, 0.5),
        moving=False,
    )


def _speed(rng: np.random.Generator) -> float:
    while True:
        speed = float(rng.normal(SPEEDS.mean, SPEEDS.deviation))
        if SPEEDS.least <= speed <= SPEEDS.most:
            return speed


def _corridor(width: float, first: float, last: float) -> tuple[Wall, ...]:
    """Walls on both sides along +z."""
    return tuple(
        Wall(name=f"{name} wall", points=np.array([(x, first), (x, last)]))
        for name, x in (("left", width / 2), ("right", -width / 2))
    )


def _gate(width: float, z: float) -> Array:
    """A line across a corridor along z, an arm's length narrower at either side."""
    half = width / 2 - RADIUS - 0.25
    return np.array([(half, z), (-half, z)])


def _turned(quarters: int) -> Array:
    """Matrix that turns points, as rows, by right angles."""
    return np.linalg.matrix_power(np.array([(0.0, 1.0), (-1.0, 0.0)]), quarters)


def _unit(angles: Array) -> Array:
    return np.stack((np.sin(angles), np.cos(angles)), axis=-1)


def _lanes(count: int, inner: float, outer: float) -> tuple[Array, Array, float]:
    """Radii and angles of people on circles, as far apart as can be, and how far that is, metres."""
    best: tuple[Array, Array, float] = (np.zeros(0), np.zeros(0), 0.0)
    for lanes in range(1, 8):
        circles = np.linspace(inner, outer, lanes) if lanes > 1 else np.array([(inner + outer) / 2])
        edges = np.rint(np.cumsum(np.concatenate(([0.0], circles))) / circles.sum() * count).astype(int)
        on = np.diff(edges)
        between = [2 * r * np.sin(np.pi / max(n, 2)) for r, n in zip(circles, on, strict=True)]
        apart = float(min([*between, np.inf if lanes == 1 else circles[1] - circles[0]]))
        if apart > best[2]:
            radii = np.repeat(circles, on)
            turns = np.concatenate([2 * np.pi * (np.arange(n) + 0.5 * (k % 2)) / max(n, 1) for k, n in enumerate(on)])
            best = (radii, turns, apart)
    return best
