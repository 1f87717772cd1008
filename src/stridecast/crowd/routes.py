"""Ways for the people of a crowd: found once, and used again by who starts and goes nearly there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace

import numpy as np
import shapely
from jaxtyping import Float

from stridecast.crowd.population import task_of
from stridecast.errors import PathError, SceneError
from stridecast.model.people import Person
from stridecast.model.scene import Circle, Scene
from stridecast.paths.curve import Curve
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
    """Finds ways through a scene (see ``generate_path``), round those who stand about where that is possible.

    Parameters
    ----------
    scene
        The place.
    standing
        Who stands about.
    """

    def __init__(self, scene: Scene, standing: Sequence[Circle] = ()) -> None:
        self.scene = scene
        self.crowded = replace(scene, obstacles=(*scene.obstacles, *standing)) if standing else scene
        self.solids = Solids(self.crowded)
        self.tell: Callable[[], None] = lambda: None
        """Called now and then while a way is searched for; what it raises ends the search."""
        self._known: dict[tuple[object, ...], Array] = {}
        self._checked: dict[str, Array] = {}

    @contextmanager
    def telling(self, progress: Callable[[int, int], None] | None, total: int) -> Iterator[Callable[..., None]]:
        """Tell how many ways have been found, of how many, also while one is searched for.

        What comes with it is to be called with how many more there are now, 1 where nothing is said.
        """
        done = 0

        def tell() -> None:
            if progress is not None:
                progress(done, total)

        def found(more: int = 1) -> None:
            nonlocal done
            done += more
            tell()

        self.tell = tell
        try:
            yield found
        finally:
            self.tell = lambda: None

    def copy(self) -> Routes:
        """The same ways; what is found from now on, only one of both knows."""
        out = copy(self)
        out._known, out._checked = dict(self._known), dict(self._checked)
        return out

    def way_of(self, person: Person) -> Float[Array, "points 2"]:
        """The way of somebody through all their stops; a single point for who stays where they are.

        Raises
        ------
        SceneError, PathError
            See ``generate_path``.
        """
        if not person.stops:
            return person.start[None].copy()
        key = _kind(person)
        way = self._like(key, person)
        if way is None:
            way = self._checked.pop(person.name, None)
            way = self.find(person) if way is None else way
            self._known.setdefault(key, way)
        return way

    def check(self, person: Person) -> None:
        """Find a way for somebody who is to come later, and leave that of everybody else as it would have been.

        Raises
        ------
        SceneError, PathError
            There is none; the person is named.
        """
        self._checked.pop(person.name, None)
        if person.stops and self._like(_kind(person), person) is None:
            self._checked[person.name] = self.copy().of_group((person,))[0]

    def _like(self, key: tuple[object, ...], person: Person) -> Array | None:
        way = self._known.get(key)
        return None if way is None else self._fitted(way, person)

    def find(self, person: Person) -> Float[Array, "points 2"]:
        """A way of one's own."""
        try:
            curve = self._curve(self.crowded, person)
        except (PathError, SceneError):
            if self.crowded is self.scene:
                raise
            curve = self._curve(self.scene, person)
        count = max(int(np.ceil(curve.length / STEP)), 1) + 1
        return curve.at(np.linspace(0.0, curve.length, count)).point

    def again(self, person: Person, place: Float[Array, "2"], stops: Float[Array, "stops 2"]) -> Array:
        """A way on from somewhere else.

        Raises
        ------
        SceneError, PathError
            There is none; the person is named.
        """
        try:
            return self.find(replace(person, start=place, stops=tuple(stop[None] for stop in stops)))
        except (SceneError, PathError) as error:
            raise type(error)(f"person {person.name!r} has no way on: {error}") from None

    def of_group(self, group: tuple[Person, ...]) -> list[Array]:
        """Who walks together goes the way of the first of them, each with an own beginning.

        Raises
        ------
        SceneError, PathError
            There is none; the person is named.
        """
        ways: list[Array] = []
        for k, person in enumerate(group):
            try:
                way = self.way_of(person) if k == 0 or not person.stops else ways[0]
            except (SceneError, PathError) as error:
                raise type(error)(f"person {person.name!r}: {error}") from None
            ways.append(way)
        return ways

    def _curve(self, scene: Scene, person: Person) -> Curve:
        return generate_path(task_of(scene, person), progress=lambda _: self.tell()).curve

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


def _kind(person: Person) -> tuple[object, ...]:
    """The same for people who can share a way."""
    points = np.concatenate((person.start[None], *person.stops))
    b = person.behavior
    return (
        *np.floor(points / NEARLY).astype(int).ravel().tolist(),
        round(float(np.log(b.body_radius)) / NEAREST),
        round(b.velocity * b.weight / 70.0),
        b.preference,
    )
