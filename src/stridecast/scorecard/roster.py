"""Who of a scene made which trajectory: where they wanted to go, how fast, and how wide they are."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float

from stridecast.model.scene import Scene
from stridecast.model.trajectories import Trajectories
from stridecast.scorecard.travel import area

Array = np.ndarray

NEAR = 0.5
"""Somebody appears so near to the start or the area that the scene has for them, metres."""


@dataclass(frozen=True, kw_only=True)
class Roster:
    """What is known of people, by number.

    Parameters
    ----------
    goals
        Stops, one after the other.
    free_speeds
        Wished speeds, m/s.
    radii
        Of the bodies, metres.
    """

    goals: dict[int, tuple[Float[Array, "_ 2"], ...]] = field(default_factory=dict)
    free_speeds: dict[int, float] = field(default_factory=dict)
    radii: dict[int, float] = field(default_factory=dict)


def roster(scene: Scene, trajectories: Trajectories) -> Roster:
    """Tell people of a scene by where they appear.

    The first place of a trajectory is that of the person of the scene who starts nearest, each taken once, or of a
    source in whose area it lies. Of a source's people the stops are known if it has one route, the wished speed and
    the width if all have the same. Whoever cannot be told is left out. The scene's walker counts as a person too.
    """
    out = Roster()
    firsts = {person: trajectories.positions[rows.start] for person, rows in trajectories.each()}
    known: list[tuple[Any, Any, Any]] = [(p.start, p.stops, p.behavior) for p in getattr(scene, "people", ())]
    if scene.start is not None:
        known.append((scene.start, tuple(goal[None] for goal in scene.goals), scene.behavior))
    pairs = sorted(
        (float(np.linalg.norm(first - start)), person, k)
        for person, first in firsts.items()
        for k, (start, _, _) in enumerate(known)
    )
    taken: set[int] = set()
    for away, person, k in pairs:
        if away <= NEAR and person not in out.radii and k not in taken:
            taken.add(k)
            _, stops, behavior = known[k]
            _enter(out, person, stops, behavior.velocity, behavior.body_radius)
    for person, first in firsts.items():
        if person not in out.radii:
            sources = [s for s in getattr(scene, "sources", ()) if area(s.area).distance(shapely.Point(first)) <= NEAR]
            if len(sources) == 1:
                source = sources[0]
                stops = source.routes[0].stops if len(source.routes) == 1 else ()
                _enter(out, person, stops, _same(source.velocity), _same(source.body_radius))
    return out


def _enter(out: Roster, person: int, stops: Any, speed: float | None, radius: float | None) -> None:
    if stops:
        out.goals[person] = tuple(stops)
    if speed is not None:
        out.free_speeds[person] = speed
    if radius is not None:
        out.radii[person] = radius


def _same(spread: Any) -> float | None:
    """What a spread says of everybody, if it says the same of all."""
    return float(spread.mean) if spread.deviation == 0 else None
