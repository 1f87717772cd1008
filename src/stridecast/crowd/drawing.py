"""What a source draws: when groups arrive, who they are, and where they go."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr, ndtri

from stridecast.crowd.areas import SPARE, Area
from stridecast.errors import SceneError
from stridecast.model.people import Person, Route, Source, Spread
from stridecast.model.scene import DISTANCES, PATIENCE, SIDES_OF_WAY, Behavior, Preference
from stridecast.paths.solids import Solids

Array = np.ndarray

BLOCK = 64
"""So many groups of a source are drawn at once."""

ROUNDS = 40
"""So often a point is drawn anew that is not clear."""


class Drawn:
    """What a source draws, block by block: depends on the seed and its name only.

    Raises
    ------
    SceneError
        The source's area or a stop is no polygon.
    """

    def __init__(self, source: Source, solids: Solids, seed: int) -> None:
        self.source = source
        self.solids = solids
        self.seed = seed
        self.area = Area(source.area, f"the area of source {source.name!r}")
        self.routes = [
            [Area(stop, f"stop {k + 1} of route {r + 1} of source {source.name!r}") for k, stop in enumerate(way.stops)]
            for r, way in enumerate(source.routes)
        ]
        self.sizes = _chances(source.together)
        self.mean_size = float(self.sizes @ np.arange(1, len(self.sizes) + 1))

    def at_once(self) -> list[tuple[Person, ...]]:
        """Groups that are there when the source begins; their starts are not yet found."""
        rng = chance(self.seed, f"at once {self.source.name}")
        sizes: list[int] = []
        while (missing := self.source.at_once - sum(sizes)) > 0:
            sizes += _fitting(self._group_sizes(BLOCK, rng), missing)
        return self._groups(np.array(sizes, np.int64), rng, 1)

    def arrivals(self, there: int) -> Iterator[tuple[float, tuple[Person, ...]]]:
        """Those who come one after the other, when so many are there already."""
        source = self.source
        left = np.inf if source.most is None else source.most - there
        if not source.flow:
            return
        rng = chance(self.seed, f"arrivals {source.name}")
        time, number = source.begins, there + 1
        while left > 0:
            waits = rng.exponential(self.mean_size / source.flow, BLOCK)
            sizes = self._group_sizes(BLOCK, rng)
            times = time + np.cumsum(waits)
            kept = _fitting(sizes, left)
            groups = self._groups(np.array(kept, np.int64), rng, number)
            for moment, group in zip(times.tolist(), groups, strict=False):
                if moment >= source.ends:
                    return
                yield moment, tuple(replace(person, begins=moment) for person in group)
            time, number, left = float(times[-1]), number + sum(kept), left - sum(kept)

    def _group_sizes(self, count: int, rng: np.random.Generator) -> Array:
        return 1 + rng.choice(len(self.sizes), count, p=self.sizes)

    def _groups(self, sizes: Array, rng: np.random.Generator, number: int) -> list[tuple[Person, ...]]:
        """People of groups of some sizes: who walk together have the same speed, route and preference."""
        source, count, people = self.source, len(sizes), int(sizes.sum())
        if not count:
            return []
        of = np.repeat(np.arange(count), sizes)
        velocity = _draw(source.velocity, count, rng)
        words = [
            [names[k] for k in rng.choice(len(names), count, p=_chances(shares))]
            for names, shares in (
                (SIDES_OF_WAY, source.sides),
                (DISTANCES, source.distance),
                (PATIENCE, source.patience),
            )
        ]
        preferences = [Preference(side=a, distance=b, patience=c) for a, b, c in zip(*words, strict=True)]
        weight, style, radius = (
            _draw(spread, people, rng) for spread in (source.weight, source.style, source.body_radius)
        )
        height = None if source.height is None else _draw(source.height, people, rng)
        look = rng.uniform(-np.pi, np.pi, people) if source.heading is None else _draw(source.heading, people, rng)
        starts = self.area.draw(count, rng)[of]
        ways = self._ways(sizes, radius, rng)
        out: list[tuple[Person, ...]] = []
        first = 0
        for group, size in enumerate(sizes.tolist()):
            members = []
            for k in range(first, first + size):
                behavior = Behavior(
                    velocity=float(velocity[group]),
                    weight=float(weight[k]),
                    status=source.status,
                    size=source.size,
                    style=float(style[k]),
                    preference=preferences[group],
                    body_radius=float(radius[k]),
                )
                stops, route = ways[k]
                person = Person(
                    name=f"{source.name} {number + k}",
                    start=starts[k],
                    stops=stops,
                    behavior=behavior,
                    heading=None if stops else float(look[k]),
                    begins=source.begins,
                    height=None if height is None else float(height[k]),
                    together=None if size == 1 else f"{source.name} {number + first}",
                    stays=route is not None and route.stays,
                    speed=behavior.velocity if stops and source.moving else 0.0,
                )
                members.append(person)
            first += size
            out.append(tuple(members))
        return out

    def _ways(
        self, sizes: Array, radius: Array, rng: np.random.Generator
    ) -> list[tuple[tuple[Array, ...], Route | None]]:
        """Stops of everybody, and of what route; one of a group goes beside the other where there is room."""
        source, of = self.source, np.repeat(np.arange(len(sizes)), sizes)
        out: list[tuple[tuple[Array, ...], Route | None]] = [((), None)] * len(of)
        if not source.routes:
            return out
        taken = rng.choice(len(source.routes), len(sizes), p=_chances([route.share for route in source.routes]))
        first = np.cumsum(sizes) - sizes
        for r, (route, areas) in enumerate(zip(source.routes, self.routes, strict=True)):
            takers = np.flatnonzero(taken == r)
            if not len(takers):
                continue
            stops: list[list[Array]] = [[] for _ in of]
            for area in areas:
                leading = clear_points(self.solids, area, radius[first[takers]], rng)
                for k, size, point in zip(first[takers].tolist(), sizes[takers].tolist(), leading, strict=True):
                    widest = float(radius[k : k + size].max())
                    there = [point]
                    while len(there) < size:
                        there.append(_beside(self.solids, area, there, widest))
                    for member, at in enumerate(there):
                        stops[k + member].append(at[None])
            for k in np.flatnonzero(np.isin(of, takers)).tolist():
                out[k] = (tuple(stops[k]), route)
        return out


def clear_points(
    solids: Solids, area: Area, radii: Float[Array, "people"], rng: np.random.Generator
) -> Float[Array, "people 2"]:
    """Points of an area where bodies of some radii, metres, can stand, one each.

    Raises
    ------
    SceneError
        There is none, or hardly one; the message names the area.
    """
    points = area.draw(len(radii), rng)
    bad = np.flatnonzero(~solids.are_clear(points, radii))
    if len(area.points) == 1:
        solids.check_points(points[:1], radii.max(keepdims=True), [area.name])
    for _ in range(ROUNDS):
        if not len(bad):
            return points
        points[bad] = area.draw(len(bad), rng)
        bad = bad[~solids.are_clear(points[bad], radii[bad])]
    if len(bad):
        raise SceneError(f"{area.name} has hardly a place where the body can stand; put it into the open")
    return points


def _beside(solids: Solids, area: Area, there: list[Array], radius: float) -> Array:
    """A place in an area beside others, or the last one's where there is none."""
    for other in reversed(there):
        near = area.near(other, 2 * radius + SPARE)
        near = near[solids.are_clear(near, np.full(len(near), radius))]
        apart = np.linalg.norm(near[:, None] - np.array(there)[None], axis=-1).min(axis=1, initial=np.inf)
        free = near[apart > 2 * radius]
        if len(free):
            return np.asarray(free[0])
    return there[-1]


def _draw(spread: Spread, count: int, rng: np.random.Generator) -> Array:
    """Numbers of a spread, by the inverse of its distribution function."""
    share = rng.random(count)
    if not spread.deviation:
        return np.full(count, float(spread.mean))
    low, high = ((end - spread.mean) / spread.deviation for end in (spread.least, spread.most))
    drawn = spread.mean + spread.deviation * ndtri(ndtr(low) + share * (ndtr(high) - ndtr(low)))
    return np.clip(drawn, spread.least, spread.most)


def _fitting(sizes: Array, left: float) -> list[int]:
    """Sizes of the first groups, the last one smaller, until so many people are reached."""
    before = np.cumsum(sizes) - sizes
    kept = before < left
    return [int(size) for size in np.minimum(sizes[kept], left - before[kept])]


def _chances(shares: tuple[float, ...] | list[float]) -> Array:
    return np.array(shares, np.float64) / sum(shares)


def chance(seed: int, *about: str | int) -> np.random.Generator:
    """Chance that depends on the seed and on what it is about only."""
    words = [seed]
    for part in about:
        words += [part] if isinstance(part, int) else [len(part), *part.encode("utf-8", "surrogatepass")]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))
