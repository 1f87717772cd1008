"""A crowd: who comes, who goes where, how they avoid each other, and their bodies, frame by frame (BJL section 5)."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from itertools import islice, takewhile

import numpy as np
from jaxtyping import Bool, Int

from stridecast.body.character import stature
from stridecast.crowd.arrivals import Arrivals
from stridecast.crowd.bodies import LEVELS, Bodies, body_of, motions_of
from stridecast.crowd.bounds import HumanBounds
from stridecast.crowd.changing import Changes, alike, difference, has_to_begin_anew, of_crowd
from stridecast.crowd.explanation import Explanation, Outlook, explanation_of
from stridecast.crowd.frame import CrowdFrame
from stridecast.crowd.ground import ground_of
from stridecast.crowd.newcomers import chance_of, newcomer_of, obstacle_of, slots_of
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
        Called with how many of the people who are there at the beginning have found their ways, and how many there are;
        now and then while one is searched for, too. What it raises ends it.

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
        scene = of_crowd(scene)
        if not (scene.people or scene.sources):
            raise SceneError("the scene has nobody in it: a crowd needs people or sources of people")
        self.database, self.scene, self.frame_rate, self.lod = database, scene, rate, lod
        self.seed = scene.seed if seed is None else seed
        self.bounds = HumanBounds.of(database)
        self._population = Population(scene, seed=self.seed, frame_rate=rate)
        self._coming = Arrivals(self._population)
        self._standing = self._who_stand(p for due in self._population.until(0.0) for p in due.people)
        self._routes = Routes(scene, list(self._standing.values()))
        self._traffic = Traffic(
            make_limits(self.bounds), ground_of(scene, self._population.solids), rate, seed=self.seed, threads=threads
        )
        self._bodies = Bodies(database, rate, threads=threads) if bodies else None
        self._people: dict[int, Person] = {}  # by row
        self._ids = np.zeros(0, np.int64)
        self._count = 0
        self.came: list[Person] = []
        self.left: list[tuple[int, float]] = []
        self.removed: list[tuple[int, float]] = []
        self.turned_away: tuple[Person, ...] = ()
        if not propose.signatures and not is_compiled(propose):
            log.warning("compiling the crowd, once for this machine and version: this takes a minute")
        self._check_sources()
        self._movers = self._traffic.add([obstacle_of(mover) for mover in scene.movers]).tolist()
        self._let_in(progress)

    @staticmethod
    def _who_stand(people: Iterable[Person]) -> dict[str, Circle]:
        """Those who stand about, by name, as what others' ways go round."""
        return {
            p.name: Circle(name=f"{p.name} who stands", center=p.start, radius=p.behavior.body_radius)
            for p in people
            if not p.stops
        }

    @property
    def time(self) -> float:
        """Seconds since the beginning."""
        return self._traffic.frame / self.frame_rate

    @property
    def done(self) -> bool:
        """Whether everybody who is to come has come, and left; who stays for good has to stand at the last stop."""
        rows = self._rows
        there = self._settled(rows) | (self._traffic.people.points[rows] < 2)
        return self._coming.over and bool(there.all())

    @property
    def waiting(self) -> int:
        """People who are due but cannot appear yet, as there is no room."""
        return self._coming.waiting

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

    def add(self, *people: Person) -> Changes:
        """Let people come into the scene while others walk: now, or when they begin, as soon as there is room.

        Raises
        ------
        SceneError, PathError
            As ``change``; nothing has changed then.
        """
        return self.change(replace(self.scene, people=(*self.scene.people, *people)))

    def remove(self, *who: int | str) -> Changes:
        """Take people out of the scene, by number or name; who has yet to come, by name. The others go on.

        Raises
        ------
        InputError
            Nobody of that number or name is there or to come.
        SceneError
            As ``change``: the last one of a scene without sources cannot be taken out. Nothing has changed then.
        """
        known = {person.name for person in self.scene.people}
        rows = {one: self._row_of(one) for one in who if one not in known}
        names = {self._people[row].name for row in rows.values()} | {one for one in who if isinstance(one, str)}
        people = tuple(person for person in self.scene.people if person.name not in names)
        groups = Counter(person.together for person in people)
        alone = [replace(p, together=None) if groups[p.together] == 1 else p for p in people]
        changes = self.change(replace(self.scene, people=tuple(alone)))
        others = [row for row in rows.values() if row in self._people]  # those of sources
        if any(self._standing.pop(self._people[row].name, None) for row in others):
            self._routes = Routes(self.scene, list(self._standing.values()))
        return replace(changes, removed=(*changes.removed, *self._take_away(others)))

    def change(self, scene: Scene, *, progress: Callable[[int, int], None] | None = None) -> Changes:
        """Take over another scene while people walk: everybody who is in both goes on.

        Where roads, obstacles or walls differ, all find new ways at once. Whose stops, behavior or company differ
        goes on in the new way, through the stops that are left; whose start, heading, height or radius differ comes
        anew. Who is not in the scene any more vanishes, who is new comes as soon as there is room. Sources send what
        they say now; what they have sent stays. Who has arrived and left stays away.

        Parameters
        ----------
        scene
            The new scene. Its movers and seed do not matter: these stay what they were.
        progress
            Called with how many new ways have been found, and how many there are; now and then while one is searched
            for, too. What it raises ends it, and nothing has changed.

        Raises
        ------
        SceneError
            Something new stands where somebody is, or in the room that they need to stop; they are named. Polygons that
            are none. Somebody new starts, or has to go, where the body cannot stand, or where somebody else starts.
        PathError
            Somebody would have no way on; they are named. After any of these nothing has changed.
        """
        scene = replace(of_crowd(scene), movers=self.scene.movers, seed=self.seed)
        differ = difference(self.scene, scene)
        solids = Solids(scene) if differ.place else self._population.solids
        here = {self._people[row].name: row for row in self._rows.tolist()}
        coming = self._coming.names
        have_left = {self.came[number - 1].name for number, _ in self.left} - here.keys() - coming
        before = {person.name: person for person in self.scene.people}
        others = {name: p for name, p in differ.other_people.items() if name not in have_left}
        anew = [name for name, p in others.items() if name in here and has_to_begin_anew(before[name], p)]
        altered = [name for name in others if name in here and name not in anew]
        to_come = {*differ.new_people, *(name for name in others if name not in altered)}
        vanish = [here[name] for name in (*(n for n in here if n in differ.gone_people), *anew)]
        if differ.place:
            self._check_room(solids, [row for row in self._rows.tolist() if row not in vanish])
        sources = {
            source.name: replace(source, begins=max(source.begins, self.time), ends=max(source.ends, self.time))
            for source in (*differ.new_sources.values(), *differ.other_sources.values())
        }
        sent = {n: self._coming.sent(n) for n in sources if n in differ.other_sources or self._coming.sent(n)}
        population = self._population.changed(scene, solids, {*differ.new_people, *others}, sources, sent)

        fresh = [population.person(name) for name in (*differ.new_people, *others)]
        gone = differ.gone_people | {person.name for person in fresh}
        standing = {name: circle for name, circle in self._standing.items() if name not in gone}
        standing |= self._who_stand(
            replace(p, start=self._traffic.moving.position[here[p.name]]) if p.name in altered else p for p in fresh
        )
        again = differ.place or standing.keys() != self._standing.keys() or bool(standing.keys() & others.keys())
        routes = Routes(scene, list(standing.values())) if again else self._routes.copy()
        people = {row: self._people[row] for row in self._rows.tolist() if row not in vanish}
        people |= {here[name]: population.person(name) for name in altered}
        ways = self._new_ways(routes, people, differ.place, [p for p in fresh if p.name in to_come], progress)
        streams = {name: population.stream(name) for name in sources}
        self._check_streams(routes, population, sources.keys())

        self.scene, self._routes, self._population, self._standing = scene, routes, population, standing
        if differ.place:
            population.stand_among(solids)
            self._traffic.ground = ground_of(scene, solids)
        removed = self._take_away(vanish)
        for row in (here[name] for name in altered):
            self._alter(row, people[row])
        for row, way in ways.items():
            self._traffic.send(row, way)
        self._coming.take_out({*differ.gone_people, *to_come}, {*differ.gone_sources, *sources})
        self._coming.put_in(population.named(to_come, self.time), streams)
        return Changes(
            added=tuple(differ.new_people),
            anew=tuple(anew),
            altered=tuple(int(self._ids[here[name]]) for name in altered),
            removed=removed,
        )

    def _check_room(self, solids: Solids, rows: list[int]) -> None:
        """Whether nothing that stands is where people are, or will be until they could stop."""
        m = self._traffic.moving
        for row in rows:
            path = np.concatenate((m.position[row : row + 1], m.path[row, : m.stops[row]]))
            if not solids.are_clear(path, np.full(len(path), self._traffic.people.radius[row])).all():
                raise SceneError(
                    f"something new would stand in the way of {self._people[row].name!r}, who is at "
                    f"({m.position[row, 0]:.2f}, {m.position[row, 1]:.2f}) and cannot stop before it"
                )

    def _new_ways(
        self,
        routes: Routes,
        people: dict[int, Person],
        everybody: bool,
        to_come: list[Person],
        progress: Callable[[int, int], None] | None,
    ) -> dict[int, Array]:
        """Ways on, by row, of those whose place or stops are others; and whether those to come have ways."""
        rows = [r for r, p in people.items() if (everybody and p.stops) or not alike(p.stops, self._people[r].stops)]
        total = len(rows) + len(to_come)
        ways: dict[int, Array] = {}
        with routes.telling(progress, total) as found:
            for row in rows:
                ways[row] = self._way_on(routes, row, people[row])
                found()
            for person in to_come:
                routes.check(person)
                found()
        return ways

    def _way_on(self, routes: Routes, row: int, person: Person) -> Array:
        """The way from where somebody is through the stops that are left."""
        here = self._traffic.moving.position[row]
        if not person.stops:
            return here[None].copy()
        stops, known = np.concatenate(person.stops), self._people[row].stops
        passed = self._traffic.passed(row, np.concatenate(known)) if known else 0
        same = len(list(takewhile(lambda pair: np.array_equal(*pair), zip(person.stops, known, strict=False))))
        return routes.again(person, here, stops[min(passed, same, len(stops) - 1) :])

    def _alter(self, row: int, person: Person) -> None:
        """Let somebody who is there be somebody else who goes on in their place."""
        way = np.zeros((1, 2))
        slot = float(self._traffic.people.slot[row])
        self._traffic.alter(row, newcomer_of(person, way, slot, self.bounds, self.seed))
        if self._bodies is not None:
            self._bodies.alter(row, size=person.behavior.size, style=person.behavior.style)
        self._people[row] = self.came[int(self._ids[row]) - 1] = person

    def _take_away(self, rows: list[int]) -> tuple[int, ...]:
        """Let people vanish; their numbers."""
        numbers = tuple(int(self._ids[row]) for row in rows)
        self.removed += [(number, self.time) for number in numbers]
        for row in rows:
            del self._people[row]
        self._traffic.remove(np.array(rows, np.int64))
        return numbers

    @staticmethod
    def _check_streams(routes: Routes, population: Population, names: Collection[str]) -> None:
        """Find a way for the first who come from sources, lest it turns out in mid-shot that there is none."""
        for name in names:
            for due in islice(population.stream(name), 1):
                routes.copy().of_group(due.people)

    def _check_sources(self) -> None:
        """Find a way for the first who comes from each source, lest it turns out in mid-shot that there is none."""
        missing = {source.name for source in self.scene.sources if source.routes}
        for due in islice(self._population, FIRST_COMERS):
            if not missing:
                return
            if due.source in missing:
                self._routes.of_group(due.people)
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
        due = self._coming.due(self._traffic.frame)
        total = sum(len(d.people) for d, _ in due)
        full: set[str | None] = set()
        with self._routes.telling(progress, total) as found:
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
                    self._coming.hold_back(item, attempt + 1)
                found(len(item.people))

    def _enter(self, due: Due, attempt: int) -> bool:
        m, p = self._traffic.moving, self._traffic.people
        rows = self._traffic.present
        discs = np.concatenate((m.position[rows], p.radius[rows, None]), axis=1)
        group = self._population.place(due, discs, attempt=attempt)
        if group is None:
            return False
        each = zip(group, self._routes.of_group(group), slots_of(group), strict=True)
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
