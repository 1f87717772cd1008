"""Who comes into a scene and when: people by name, people at once, and arrivals of sources as Poisson processes."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import chain, takewhile

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from stridecast.crowd.areas import Area, Discs, pack, place
from stridecast.crowd.drawing import Drawn, chance, clear_points
from stridecast.errors import SceneError
from stridecast.model.people import Mover, Person, Source
from stridecast.model.scene import Scene
from stridecast.paths.solids import Solids

Array = np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Due:
    """Somebody, or a group who walk together, and when they should appear.

    Parameters
    ----------
    time, frame
        Seconds, and the first frame that is not before.
    people
        One, or 2 to 4 side by side. Their stops are single points, whatever can be drawn is drawn, and their starts are
        where they appear if there is room.
    source
        Where they come from; nothing for those whom the scene has by name.
    number
        Counts those who are due from a source, or by name, from 0.
    """

    time: float
    frame: int
    people: tuple[Person, ...]
    source: str | None
    number: int


class Population:
    """Everybody who ever comes into a scene, in the order of time; iterate over it as often as you like.

    What a source draws depends on the seed and its name only. Other people and sources change nothing of it, but that
    those at once keep clear of who is there before.

    Parameters
    ----------
    scene
        The place and who is in it.
    seed
        Of all chance; that of the scene where nothing is said.
    frame_rate
        Hz.

    Raises
    ------
    SceneError
        Somebody starts, or has to go, where the body cannot stand; two start in the same place; more should be in an
        area at once than fit.
    """

    def __init__(self, scene: Scene, *, seed: int | None = None, frame_rate: float = 30.0) -> None:
        if not (np.isfinite(frame_rate) and frame_rate > 0):
            raise SceneError(f"the frame rate must be above 0 Hz, not {frame_rate}")
        self.scene = scene
        self.seed = scene.seed if seed is None else seed
        self.frame_rate = frame_rate
        self.solids = Solids(scene)
        self._named = self._drawn(scene, self.solids, scene.people)
        self._sources = {source.name: Drawn(source, self.solids, self.seed) for source in scene.sources}
        self._at_once = self._put_down()
        self._sent: dict[str, int] = {}

    def __iter__(self) -> Iterator[Due]:
        streams = (self.stream(name) for name in self._sources)
        return heapq.merge(self.named(), *streams, key=lambda due: due.time)

    @property
    def sources(self) -> list[str]:
        """Names of the sources."""
        return list(self._sources)

    def named(self, names: Collection[str] | None = None, begins: float = 0.0) -> list[Due]:
        """When people by name are due, all or some, in the order of time; nobody before ``begins``, seconds."""
        people = [p for p in self._named if names is None or p.name in names]
        people.sort(key=lambda p: p.begins)
        return list(self._due(None, ((max(p.begins, begins), (p,)) for p in people)))

    def stream(self, source: str) -> Iterator[Due]:
        """Who comes from a source and when, in the order of time."""
        drawn, there = self._sources[source], self._sent.get(source, 0)
        groups = self._at_once[source]
        now = ((drawn.source.begins, group) for group in groups)
        return self._due(source, chain(now, drawn.arrivals(there + sum(map(len, groups)))), there)

    def person(self, name: str) -> Person:
        """Somebody of the scene by name, their stops drawn."""
        return next(person for person in self._named if person.name == name)

    def until(self, seconds: float) -> list[Due]:
        """Who is due up to a time."""
        return list(takewhile(lambda due: due.time <= seconds, self))

    def place(self, due: Due, discs: Float[Array, "discs 3"], *, attempt: int = 0) -> tuple[Person, ...] | None:
        """Put somebody who is due where there is room: at their starts, else elsewhere in the area of their source.

        Parameters
        ----------
        discs
            Who and what is there already and moves: ``x``, ``z`` and radius, metres.
        attempt
            Another number tries other places.

        Returns
        -------
        people
            With starts that are clear of everything, or nothing where there is no room now.
        """
        radii = np.array([p.behavior.body_radius for p in due.people])
        starts = np.array([p.start for p in due.people])
        if _are_apart(starts, radii, discs) and self.solids.are_clear(starts, radii).all():
            return due.people
        if due.source is None:
            return None
        rng = chance(self.seed, f"place {due.source}", due.number, attempt)
        found = place(self.solids, self._sources[due.source].area, rng, radii, discs)
        return None if found is None else _at(due.people, found)

    def changed(
        self,
        scene: Scene,
        solids: Solids,
        people: Collection[str],
        sources: Mapping[str, Source],
        sent: Mapping[str, int],
    ) -> Population:
        """Everybody who comes into a scene that becomes another one in mid-play.

        Parameters
        ----------
        scene, solids
            The scene from now on.
        people
            Names of those who are new, or not what they were; the others stay as they were drawn.
        sources
            Those which are new, or not what they were, beginning now at the earliest.
        sent
            How many have come so far from those which are not new. New ones alone put people into their areas at once;
            who has no room there waits for it.

        Raises
        ------
        SceneError
            As a new population would, about these people and sources.
        """
        out = copy(self)
        drawn = {p.name: p for p in self._named} | {
            p.name: p for p in self._drawn(scene, solids, tuple(p for p in scene.people if p.name in people))
        }
        out.scene, out.solids = scene, solids
        out._named = [drawn[person.name] for person in scene.people]
        fresh = {name: Drawn(source, solids, self.seed) for name, source in sources.items()}
        out._sources = {source.name: fresh.get(source.name) or self._sources[source.name] for source in scene.sources}
        out._at_once = self._at_once | {name: [] if name in sent else s.at_once() for name, s in fresh.items()}
        out._sent = {**self._sent, **sent}
        return out

    def stand_among(self, solids: Solids) -> None:
        """From now on draw stops and places that are clear of these."""
        self.solids = solids
        for drawn in self._sources.values():
            drawn.solids = solids

    def _due(
        self, source: str | None, groups: Iterator[tuple[float, tuple[Person, ...]]], first: int = 0
    ) -> Iterator[Due]:
        for number, (time, people) in enumerate(groups, first):
            frame = int(np.ceil(time * self.frame_rate - 1e-9))
            yield Due(time=time, frame=frame, people=people, source=source, number=number)

    def _drawn(self, scene: Scene, solids: Solids, among: Sequence[Person]) -> list[Person]:
        """Some of those whom a scene has by name, their stops drawn, clear of everything and of all the others."""
        radii = np.array([p.behavior.body_radius for p in among])
        starts = np.array([p.start for p in among]).reshape(-1, 2)
        solids.check_points(starts, radii, [f"the start of person {p.name!r}" for p in among])
        names = {person.name for person in among}
        people = scene.people
        starts = np.array([p.start for p in people]).reshape(-1, 2)
        radii = np.array([p.behavior.body_radius for p in people])
        if len(among):
            reach = 2 * float(radii.max())
            for one, other in sorted(cKDTree(starts).query_pairs(reach)):
                a, b = people[one], people[other]
                gap = float(np.linalg.norm(a.start - b.start)) - radii[one] - radii[other]
                if a.begins == b.begins and gap < 0 and names & {a.name, b.name}:
                    raise SceneError(
                        f"persons {a.name!r} and {b.name!r} start in the same place; put {-gap:.3g} m more between them"
                    )
        for person in among:
            for mover in scene.movers:
                if _touches(person, mover):
                    raise SceneError(f"the start of person {person.name!r} is where mover {mover.name!r} is then")
        return [self._with_points(person, solids) for person in among]

    def _with_points(self, person: Person, solids: Solids) -> Person:
        if not person.stops:
            return person
        rng = chance(self.seed, person.name)
        areas = [Area(stop, f"stop {k + 1} of person {person.name!r}") for k, stop in enumerate(person.stops)]
        radius = np.array([person.behavior.body_radius])
        return replace(person, stops=tuple(clear_points(solids, area, radius, rng) for area in areas))

    def _put_down(self) -> dict[str, list[tuple[Person, ...]]]:
        """Those who are in the areas of sources at once, clear of each other, of people by name and of movers."""
        widest = max(
            [p.behavior.body_radius for p in self._named]
            + [m.radius for m in self.scene.movers]
            + [s.body_radius.ends[1] for s in self.scene.sources],
            default=0.3,
        )
        discs = Discs(widest)
        for person in self._named:
            discs.add(person.start, person.behavior.body_radius)
        for mover in self.scene.movers:
            discs.add(mover.at(np.zeros(())), mover.radius)
        out = {}
        for name, source in self._sources.items():
            groups = source.at_once()
            radii = [np.array([p.behavior.body_radius for p in group]) for group in groups]
            places = pack(self.solids, source.area, chance(self.seed, f"pack {name}"), radii, discs)
            if len(places) < len(groups):
                fit = sum(map(len, places))
                raise SceneError(
                    f"source {name!r} should hold {source.source.at_once} people at once, but {fit} fit into its area"
                )
            out[name] = [_at(group, where) for group, where in zip(groups, places, strict=True)]
        return out


def population(scene: Scene, seed: int | None = None, frame_rate: float = 30.0) -> Population:
    """Everybody who ever comes into a scene; see ``Population``."""
    return Population(scene, seed=seed, frame_rate=frame_rate)


def task_of(scene: Scene, person: Person) -> Scene:
    """The scene as that of one person alone, for ``generate_path``; each stop must be a single point.

    Raises
    ------
    SceneError
        The person goes nowhere, or anywhere in an area.
    """
    if not person.stops or any(len(stop) != 1 for stop in person.stops):
        raise SceneError(f"person {person.name!r} needs stops that are single points")
    alone = {"people": (), "sources": (), "stations": (), "movers": ()}
    goals = np.concatenate(person.stops)
    return replace(scene, start=person.start, goals=goals, behavior=person.behavior, **alone)  # type: ignore[arg-type]


def _at(group: tuple[Person, ...], places: Array) -> tuple[Person, ...]:
    """A group at its places; who stands there with others looks at them."""
    out = []
    middle = places.mean(axis=0)
    for person, start in zip(group, places, strict=True):
        heading = person.heading
        if len(group) > 1 and not person.stops:
            heading = float(np.arctan2(*(middle - start)))
        out.append(replace(person, start=start, heading=heading))
    return tuple(out)


def _are_apart(points: Array, radii: Array, discs: Array) -> bool:
    """Whether bodies touch neither each other nor discs."""
    if len(discs):
        away = np.linalg.norm(points[:, None] - discs[None, :, :2], axis=-1)
        if (away < radii[:, None] + discs[None, :, 2]).any():
            return False
    one, other = np.triu_indices(len(points), 1)
    return bool((np.linalg.norm(points[one] - points[other], axis=-1) >= radii[one] + radii[other]).all())


def _touches(person: Person, mover: Mover) -> bool:
    away = person.start - mover.at(np.array(person.begins))
    return bool(np.linalg.norm(away) < mover.radius + person.behavior.body_radius)
