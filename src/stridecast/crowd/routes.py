"""Ways for the people of a crowd: found once, and used again by who starts and goes nearly there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from jaxtyping import Float

from stridecast.crowd.population import task_of
from stridecast.errors import PathError, SceneError
from stridecast.model.people import Person
from stridecast.model.scene import Circle, Scene
from stridecast.paths.generate import generate_path
from stridecast.paths.solids import Solids

Array = np.ndarray

NEARLY = 1.0
"""Starts and stops this near to each other share a way, metres, ..."""

STEP = 0.25
"""Points of a way lie this far apart, metres."""

NEAREST = 0.3
"""Bodies that differ in width by less than this part share a way."""


class Routes:
    """Finds ways through a scene (see ``generate_path``), round those who stand about where that is possible."""

    def __init__(self, scene: Scene, standing: Sequence[Circle] = ()) -> None:
        self.scene = scene
        self.crowded = replace(scene, obstacles=(*scene.obstacles, *standing)) if standing else scene
        self.solids = Solids(self.crowded)
        self._known: dict[tuple[object, ...], Array] = {}

    def way_of(self, person: Person) -> Float[Array, "points 2"]:
        """The way of somebody through all their stops; a single point for who stays where they are.

        Raises
        ------
        SceneError, PathError
            See ``generate_path``.
        """
        if not person.stops:
            return person.start[None].copy()
        points = np.concatenate((person.start[None], *person.stops))
        b = person.behavior
        key = (
            *np.floor(points / NEARLY).astype(int).ravel().tolist(),
            round(float(np.log(b.body_radius)) / NEAREST),
            round(b.velocity * b.weight / 70.0),
            b.preference,
        )
        way = self._known.get(key)
        if way is not None:
            way = self._fitted(way, person)
        if way is None:
            way = self.find(person)
            self._known.setdefault(key, way)
        return way

    def find(self, person: Person) -> Float[Array, "points 2"]:
        """A way of one's own."""
        try:
            curve = generate_path(task_of(self.crowded, person)).curve
        except (PathError, SceneError):
            if self.crowded is self.scene:
                raise
            curve = generate_path(task_of(self.scene, person)).curve
        count = max(int(np.ceil(curve.length / STEP)), 1) + 1
        return curve.at(np.linspace(0.0, curve.length, count)).point

    def again(self, person: Person, place: Float[Array, "2"], stops: Float[Array, "stops 2"]) -> Array:
        """A way on from somewhere else."""
        return self.find(replace(person, start=place, stops=tuple(stop[None] for stop in stops)))

    def _fitted(self, way: Float[Array, "points 2"], person: Person) -> Array | None:
        """Somebody else's way with one's own start and end, if that is in the clear."""
        out = way.copy()
        out[0], out[-1] = person.start, person.stops[-1][-1]
        if len(out) < 6:
            return None if not self._clear(out, person) else out
        out = np.concatenate((out[:1], out[3:-3], out[-1:]))
        return out if self._clear(out, person) else None

    def _clear(self, way: Float[Array, "points 2"], person: Person) -> bool:
        hit = self.solids.distances(shapely.LineString(way), person.behavior.body_radius)
        return len(hit.gap) == 0 and bool((np.linalg.norm(np.diff(way, axis=0), axis=-1) > 1e-6).all())
