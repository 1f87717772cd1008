"""A crowd: who comes, who goes where, how they avoid each other, and their bodies, frame by frame (BJL section 5)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
from jaxtyping import Bool, Int

from stridecast.body.character import stature
from stridecast.crowd.bodies import LEVELS, Bodies, body_of, motions_of
from stridecast.crowd.bounds import HumanBounds
from stridecast.crowd.explanation import Explanation, Outlook, explanation_of
from stridecast.crowd.frame import CrowdFrame
from stridecast.crowd.ground import ground_of
from stridecast.crowd.newcomers import chance_of, newcomer_of, obstacle_of, slots_of, walker_of
from stridecast.crowd.population import Due, Population
from stridecast.crowd.routes import Routes
from stridecast.crowd.state import make_limits
from stridecast.crowd.step_kernels import propose
from stridecast.crowd.traffic import ARRIVED, Newcomer, Traffic
from stridecast.errors import InputError, PathError, SceneError
from stridecast.geometry.kernels import is_compiled
from stridecast.model.database import MotionDatabase
from stridecast.model.people import Person
from stridecast.model.pose import VehicleState
from stridecast.model.scene import Circle, Scene
from stridecast.model.skeleton import Skeleton
from stridecast.paths.solids import Solids

Array = np.ndarray
log = logging.getLogger("stridecast")

FIRST_COMERS = 5000
"""Among so many of those to come somebody of each source is looked for, to see whether there is a way."""


class Crowd:
    """The people of a scene, stepping in real time.

    Parameters
    ----------
    database
        Whose bounds they keep and whose motion they show.
    scene
        The place, who is there and who comes.
    agents
        More people.
    seed
        Of all chance; that of the scene if left out. Same scene and seed, same bits; the order of people decides
        nothing.
    bodies
        Whether they have bodies; vehicles alone are several times as fast.
    frame_rate
        Frames a second; the database's if left out.
    threads
        Threads that share the work. The result does not depend on it.
    lod
        Beyond the first of these distances from the ``focus`` of a step bodies are stepped in every second frame,
        beyond the second in every third, metres. The ways of the people do not depend on it.
    progress
        Called with how many of the people who are there at the beginning have found their ways, and how many there are.

    Raises
    ------
    SceneError
        People who overlap, stand in walls or do not fit; nobody in the scene.
    PathError
        Somebody cannot get where they want to go; the person is named.
    DatabaseError
        Nobody walks in the database.
    """

    def __init__(
        self,
        database: MotionDatabase,
        scene: Scene,
        agents: Sequence[Person] = (),
        *,
        seed: int | None = None,
        bodies: bool = True,
        frame_rate: float | None = None,
        threads: int = 1,
        lod: tuple[float, float] | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> None:
        rate = float(database.frame_rate if frame_rate is None else frame_rate)
        if not 10 <= rate <= 240:
            raise InputError(f"the frame rate must lie between 10 and 240 Hz, not at {rate}")
        if lod is not None and not 0 <= lod[0] <= lod[1]:
            raise InputError(f"lod needs two distances from 0, the smaller first, not {lod}")
        if agents:
            scene = replace(scene, people=(*scene.people, *agents))
        if scene.has_walker:
            scene = replace(scene, people=(*scene.people, walker_of(scene)))
        if not (scene.people or scene.sources):
            raise SceneError("the scene has nobody in it: a crowd needs people or sources of people")
        self.database, self.scene, self.frame_rate, self.lod = database, scene, rate, lod
        self.seed = scene.seed if seed is None else seed
        self.bounds = HumanBounds.of(database)
        self._population = Population(scene, seed=self.seed, frame_rate=rate)
        self._coming = iter(self._population)
        self._routes = Routes(scene, self._standing())
        self._traffic = Traffic(
            make_limits(self.bounds), ground_of(scene, self._population.solids), rate, seed=self.seed, threads=threads
        )
        self._bodies = Bodies(database, rate, threads=threads) if bodies else None
        self._people: dict[int, Person] = {}  # by row
        self._ids = np.zeros(0, np.int64)
        self._count = 0
        self.came: list[Person] = []
        self.left: list[tuple[int, float]] = []
        self.turned_away: tuple[Person, ...] = ()
        self._held_back: list[tuple[Due, int]] = []
        self._next: Due | None = next(self._coming, None)
        if not propose.signatures and not is_compiled(propose):
            log.warning("compiling the crowd, once for this machine and version: this takes a minute")
        self._check_sources()
        self._movers = self._traffic.add([obstacle_of(mover) for mover in scene.movers]).tolist()
        self._let_in(progress)

    def _standing(self) -> list[Circle]:
        """People who stand about from the beginning on, as what others' ways go round."""
        stand = [p for due in self._population.until(0.0) for p in due.people if not p.stops]
        return [Circle(name=f"{p.name} who stands", center=p.start, radius=p.behavior.body_radius) for p in stand]

    @property
    def time(self) -> float:
        """Seconds since the beginning."""
        return self._traffic.frame / self.frame_rate

    @property
    def done(self) -> bool:
        """Whether everybody who is to come has come, and left; who stays for good has to stand at the last stop."""
        rows = self._rows
        there = self._settled(rows) | (self._traffic.people.points[rows] < 2)
        return self._next is None and not self._held_back and bool(there.all())

    @property
    def waiting(self) -> int:
        """People who are due but cannot appear yet, as there is no room."""
        return sum(len(due.people) for due, _ in self._held_back)

    @property
    def _rows(self) -> Int[Array, "present"]:
        rows = self._traffic.present
        return rows[~self._traffic.people.scripted[rows]]

    def step(self, *, focus: Sequence[float] | None = None) -> CrowdFrame:
        """Advance by one frame: who is due comes, all step, who has arrived leaves after this frame is shown.

        Parameters
        ----------
        focus
            Ground point from which distances for ``lod`` are measured.
        """
        self._leave()
        self._let_in()
        self._traffic.step()
        if self._bodies is not None:
            self._step_bodies(self._bodies, focus)
        return self.frame()

    def frame(self) -> CrowdFrame:
        """What is to be seen now."""
        rows, m, p, b = self._rows, self._traffic.moving, self._traffic.people, self._bodies
        rows = rows[np.argsort(self._ids[rows])]
        return CrowdFrame(
            time=self.time,
            ids=self._ids[rows],
            positions=m.position[rows],
            velocities=m.velocity[rows],
            accelerations=m.acceleration[rows],
            headings=m.heading[rows],
            radii=p.radius[rows],
            rules=m.rule[rows],
            heights=np.ones(len(rows)) if b is None else b.scales[rows],
            roots=None if b is None else b.roots[rows],
            rotations=None if b is None else b.rotations[rows],
            planted=None if b is None else b.planted[rows],
            movers=m.position[self._movers] if self._movers else np.zeros((0, 2)),
        )

    def at_last_stop(self) -> frozenset[int]:
        """Numbers of those who are there and have arrived, to leave or to stay."""
        rows = self._rows
        stay = rows[self._settled(rows)]
        return frozenset(self._ids[np.concatenate((stay, self._traffic.arrived()))].tolist())

    def change(self, scene: Scene) -> None:
        """Take over the roads, obstacles and walls of another scene while people walk; they find new ways at once.

        Parameters
        ----------
        scene
            The new place. Its people, sources, movers and task do not matter: who is there, and comes, stays the same.

        Raises
        ------
        SceneError
            Something new stands where somebody is, or in the room that they need to stop; they are named. Polygons that
            are none.
        PathError
            Somebody would have no way on; they are named. After any of these nothing has changed.
        """
        place = replace(self.scene, roads=scene.roads, obstacles=scene.obstacles, walls=scene.walls)
        solids = Solids(place)
        rows, m = self._rows, self._traffic.moving
        for row in rows.tolist():
            path = np.concatenate((m.position[row : row + 1], m.path[row, : m.stops[row]]))
            if not solids.are_clear(path, np.full(len(path), self._traffic.people.radius[row])).all():
                raise SceneError(
                    f"something new would stand in the way of {self._people[row].name!r}, who is at "
                    f"({m.position[row, 0]:.2f}, {m.position[row, 1]:.2f}) and cannot stop before it"
                )
        routes = Routes(place, self._standing())
        ways = {row: self._way_on(routes, row) for row in rows.tolist() if self._traffic.people.points[row] >= 2}
        self.scene, self._routes, self._population.solids = place, routes, solids
        self._traffic.ground = ground_of(place, solids)
        for row, way in ways.items():
            self._traffic.send(row, way)

    def _way_on(self, routes: Routes, row: int) -> Array:
        """The way from where somebody is through the stops that are left."""
        person, here = self._people[row], self._traffic.moving.position[row]
        stops = np.concatenate(person.stops)
        left = self._traffic.passed(row, stops)
        try:
            return routes.again(person, here, stops[min(left, len(stops) - 1) :])
        except (SceneError, PathError) as error:
            raise type(error)(f"person {person.name!r} has no way on: {error}") from None

    def _check_sources(self) -> None:
        """Find a way for the first who comes from each source, lest it turns out in mid-shot that there is none."""
        missing = {source.name for source in self.scene.sources if source.routes}
        for due in islice(self._population, FIRST_COMERS):
            if not missing:
                return
            if due.source in missing:
                self._ways(due.people)
                missing.discard(due.source)

    def explain(self, who: int | str) -> Explanation:
        """What somebody is up to, and why.

        Parameters
        ----------
        who
            Number or name.

        Raises
        ------
        InputError
            Nobody of that number or name is there.
        """
        row = self._row_of(who)
        m = self._traffic.moving
        other = int(m.other[row])
        return explanation_of(
            self._people[row].name,
            int(m.rule[row]),
            self._name_of(other),
            float(m.contact[row]),
            float(m.chosen_side[row]),
            bool(m.held[row]),
        )

    def outlook(self, who: int | str) -> Outlook:
        """Where somebody is about to be: the way that is left, and the room that they have reserved.

        Parameters
        ----------
        who
            Number or name.

        Raises
        ------
        InputError
            Nobody of that number or name is there.
        """
        row = self._row_of(who)
        m = self._traffic.moving
        other = int(m.other[row])
        is_person = other >= 0 and not self._traffic.people.scripted[other]
        return Outlook(
            way=self._traffic.way_left(row),
            window=m.path[row, : m.stops[row]].copy(),
            target=m.target[row].copy(),
            other=int(self._ids[other]) if is_person else None,
        )

    def person(self, number: int) -> Person:
        """Who has this number; also those who have left."""
        if not 1 <= number <= self._count:
            raise InputError(f"nobody has the number {number}; {self._count} have come so far")
        return self.came[number - 1]

    def skeleton(self, number: int) -> Skeleton:
        """The skeleton of somebody, of their height."""
        return body_of(self.database, self.person(number).height)

    def height(self, number: int) -> float:
        """Of somebody's body, metres."""
        return stature(self.skeleton(number))

    def _settled(self, rows: Int[Array, "rows"]) -> Bool[Array, "rows"]:
        m, p = self._traffic.moving, self._traffic.people
        to_go = self._traffic.ways.along[p.first[rows] + p.points[rows] - 1] - m.place[rows]
        near = p.stays[rows] & (p.points[rows] >= 2) & (to_go < ARRIVED)
        return near & (m.velocity[rows] == 0.0).all(axis=-1)

    def _name_of(self, row: int) -> str | None:
        if row < 0:
            return None
        if self._traffic.people.scripted[row]:
            return self.scene.movers[self._movers.index(row)].name
        return self._people[row].name

    def _row_of(self, who: int | str) -> int:
        for row in self._rows.tolist():
            if who in (int(self._ids[row]), self._people[row].name):
                return row
        raise InputError(f"nobody called {who!r} is there" if isinstance(who, str) else f"number {who} is not there")

    def _leave(self) -> None:
        rows = self._traffic.arrived()
        for row in rows.tolist():
            self.left.append((int(self._ids[row]), self.time))
            del self._people[row]
        self._traffic.remove(rows)

    def _let_in(self, progress: Callable[[int, int], None] | None = None) -> None:
        """Let in who is due and has room; the others wait outside and come as soon as there is some."""
        now = self._traffic.frame
        due, self._held_back = self._held_back, []
        while self._next is not None and self._next.frame <= now:
            due.append((self._next, 0))
            self._next = next(self._coming, None)
        total = sum(len(d.people) for d, _ in due)
        done = 0
        full: set[str | None] = set()
        for item, attempt in due:
            waits = item.source is not None and item.source in full
            try:
                waits = waits or not self._enter(item, attempt)
            except (SceneError, PathError) as error:
                if self._traffic.frame == 0:
                    raise
                # In mid-shot somebody who has no way stays out; everybody else goes on.
                log.warning("somebody stays out: %s", error)
                self.turned_away += item.people
            if waits:
                full.add(item.source)
                self._held_back.append((item, attempt + 1))
            done += len(item.people)
            if progress is not None:
                progress(done, total)

    def _enter(self, due: Due, attempt: int) -> bool:
        m, p = self._traffic.moving, self._traffic.people
        rows = self._traffic.present
        discs = np.concatenate((m.position[rows], p.radius[rows, None]), axis=1)
        group = self._population.place(due, discs, attempt=attempt)
        if group is None:
            return False
        each = zip(group, self._ways(group), slots_of(group), strict=True)
        news = [newcomer_of(person, way, slot, self.bounds, self.seed) for person, way, slot in each]
        at = self._add_together(news)
        if at is None:
            at = self._add_together([replace(new, speed=0.0) for new in news])
        if at is None:
            return False
        if len(self._ids) < len(self._traffic.moving.here):
            grown = np.zeros(len(self._traffic.moving.here), np.int64)
            grown[: len(self._ids)] = self._ids
            self._ids = grown
        for row, person in zip(at.tolist(), group, strict=True):
            self._count += 1
            self._ids[row] = self._count
            self._people[row] = person
            self.came.append(person)
        if self._bodies is not None:
            self._bodies.place(
                at,
                np.array([person.start for person in group]),
                self._traffic.moving.heading[at],
                phases=np.array([chance_of(person.name, self.seed, "phase") for person in group]),
                heights=np.array([person.height or self._bodies.height for person in group]),
                sizes=[person.behavior.size for person in group],
                styles=np.array([person.behavior.style for person in group]),
            )
        return True

    def _add_together(self, news: Sequence[Newcomer]) -> Int[Array, "rows"] | None:
        """Let people appear if there is room for all of them; their rows."""
        rows: list[int] = []
        for new in news:
            if not self._traffic.has_room(new):
                self._traffic.remove(np.array(rows, np.int64))
                return None
            rows += self._traffic.add([new]).tolist()
        return np.array(rows, np.int64)

    def _ways(self, group: tuple[Person, ...]) -> list[Array]:
        """Who walks together goes the way of the first of them, each with an own beginning."""
        ways: list[Array] = []
        for k, person in enumerate(group):
            try:
                way = self._routes.way_of(person) if k == 0 or not person.stops else ways[0]
            except (SceneError, PathError) as error:
                raise type(error)(f"person {person.name!r}: {error}") from None
            ways.append(way)
        return ways

    def _step_bodies(self, bodies: Bodies, focus: Sequence[float] | None) -> None:
        rows, m = self._rows, self._traffic.moving
        if not len(rows):
            return
        speed = np.linalg.norm(m.velocity[rows], axis=-1)
        aims = (m.target[rows] != 0.0).any(axis=-1)
        motions = motions_of(speed, aims, self._traffic.people.runs[rows])
        levels = None
        if self.lod is not None and focus is not None:
            away = np.linalg.norm(m.position[rows] - np.asarray(focus, np.float64), axis=-1)
            levels = np.minimum(1 + (away > self.lod[0]) + (away > self.lod[1]), LEVELS)
        bodies.step(
            rows,
            VehicleState(
                position=m.position[rows],
                velocity=m.velocity[rows],
                acceleration=m.acceleration[rows],
                heading=m.heading[rows],
            ),
            motions,
            np.where(aims, np.inf, (m.stops[rows] - 1) / self.frame_rate),
            levels,
        )
