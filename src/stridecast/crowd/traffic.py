"""The vehicles of a crowd: who comes, how all take a step, who leaves."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from stridecast.crowd.ground import make_cells
from stridecast.crowd.neighbour_kernels import sort_into_cells
from stridecast.crowd.state import Ground, Limits, Moving, People, Ways, make_moving, make_people
from stridecast.crowd.step_kernels import STANDING, fits, make_scratch, propose, settle, write
from stridecast.crowd.vehicle_kernels import stop
from stridecast.model.people import Mover

Array = np.ndarray

LONGEST_STOP = 4.0
"""Nobody needs longer to stop, seconds."""

BLOCK = 64
"""People a thread takes at a time."""

ARRIVED, ABREAST = 0.45, 0.1
"""People have arrived who are so near to the end of their way, or as far along it and beside it, metres."""

ROOM = 64
"""Rows to begin with."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Newcomer:
    """Somebody who is about to appear; see ``People`` for the meaning."""

    number: int
    position: tuple[float, float]
    heading: float
    way: Float[Array, "points 2"]
    speed: float = 0.0
    wish: float = 1.3
    radius: float = 0.3
    runs: bool = False
    side: float = 0.0
    keep: float = 0.1
    waits: bool = False
    rank: float = 0.0
    company: int = -1
    slot: float = 0.0
    stays: bool = False
    mover: Mover | None = None


class Traffic:
    """Vehicles that go their ways and avoid each other.

    Parameters
    ----------
    limits
        Human bounds.
    ground
        What stands.
    frame_rate
        Frames a second.
    seed
        What chance decides is decided by this.
    threads
        Threads that share the people; the result does not depend on it.
    """

    def __init__(self, limits: Limits, ground: Ground, frame_rate: float, *, seed: int = 0, threads: int = 1) -> None:
        self.limits, self.ground, self.frame_rate, self.seed = limits, ground, frame_rate, seed
        self.people: People = make_people(ROOM)
        self.moving: Moving = make_moving(ROOM, self._frames)
        self.ways = Ways(points=np.zeros((0, 2)), along=np.zeros(0))
        self.frame = 0
        self._scripts: dict[int, tuple[Mover, float]] = {}
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    @property
    def _frames(self) -> int:
        return int(LONGEST_STOP * self.frame_rate) + 1

    @property
    def present(self) -> Int[Array, "present"]:
        """Rows in use."""
        return np.flatnonzero(self.moving.here)

    def add(self, newcomers: Iterable[Newcomer]) -> Int[Array, "newcomers"]:
        """Let people appear; their rows."""
        news = list(newcomers)
        rows = np.flatnonzero(~self.moving.here)[: len(news)]
        if len(rows) < len(news):
            self._grow(len(self.moving.here) + len(news) - len(rows))
            rows = np.flatnonzero(~self.moving.here)[: len(news)]
        self._forget_ways()
        points, along = [self.ways.points], [self.ways.along]
        begin = len(self.ways.points)
        for row, new in zip(rows.tolist(), news, strict=True):
            for name in ("number", "radius", "wish", "runs", "side", "keep", "waits", "rank"):
                getattr(self.people, name)[row] = getattr(new, name)
            for name in ("company", "slot", "stays"):
                getattr(self.people, name)[row] = getattr(new, name)
            self.people.scripted[row] = new.mover is not None
            self.people.first[row], self.people.points[row] = begin, len(new.way)
            points.append(new.way)
            along.append(
                np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(new.way, axis=0), axis=-1))))[: len(new.way)]
            )
            begin += len(new.way)
            self._place(row, new)
        self.ways = Ways(points=np.concatenate(points), along=np.concatenate(along))
        return rows

    def _place(self, row: int, new: Newcomer) -> None:
        for name, array in self.moving._asdict().items():
            array[row] = {"other": -1, "contact": np.inf, "here": True, "stops": 1, "meant_stops": 1}.get(name, 0)
        m = self.moving
        ahead = np.array([np.sin(new.heading), np.cos(new.heading)])
        m.position[row], m.heading[row], m.velocity[row] = new.position, new.heading, new.speed * ahead
        m.target[row] = m.velocity[row]
        if len(new.way) > 1:
            m.bound[row] = ahead
        state = (*m.position[row], *m.velocity[row], 0.0, 0.0)
        m.stops[row] = stop(self.limits, *map(float, state), 1.0 / self.frame_rate, m.path[row])
        if new.mover is not None:
            self._scripts[row] = (new.mover, float(new.mover.times[0]) if self.frame else 0.0)

    def remove(self, rows: Int[Array, "leaving"]) -> None:
        """Let people leave; nobody is busy with them any more."""
        m = self.moving
        m.here[rows] = False
        about = np.isin(m.other, rows)
        m.other[about], m.contact[about], m.since[about] = -1, np.inf, 0.0

    def alter(self, row: int, new: Newcomer) -> None:
        """Let somebody who is there go on with another speed, other preferences and company."""
        for name in ("wish", "runs", "side", "keep", "waits", "company", "slot", "stays"):
            getattr(self.people, name)[row] = getattr(new, name)

    def send(self, row: int, way: Float[Array, "points 2"]) -> None:
        """Send somebody another way from where they are."""
        along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=-1))))
        self.people.first[row], self.people.points[row] = len(self.ways.points), len(way)
        self.moving.place[row] = 0.0
        self.ways = Ways(points=np.concatenate((self.ways.points, way)), along=np.concatenate((self.ways.along, along)))

    def way_left(self, row: int) -> Float[Array, "points 2"]:
        """The way from where somebody is to its end."""
        first, count = int(self.people.first[row]), int(self.people.points[row])
        ahead = self.ways.along[first : first + count] > self.moving.place[row]
        return np.concatenate((self.moving.position[row : row + 1], self.ways.points[first : first + count][ahead]))

    def passed(self, row: int, stops: Float[Array, "stops 2"]) -> int:
        """How many of the stops on somebody's way lie behind them."""
        first, count = int(self.people.first[row]), int(self.people.points[row])
        points, along = self.ways.points[first : first + count], self.ways.along[first : first + count]
        done, k = 0, 0
        for point in stops:  # one after the other, as a way may cross itself
            k += int(np.argmin(np.linalg.norm(points[k:] - point, axis=-1)))
            done += int(along[k] < self.moving.place[row])
        return done

    def _forget_ways(self) -> None:
        """Drop the ways of those who have left, once they are more than the others'."""
        rows = self.present
        first, points = self.people.first[rows], self.people.points[rows]
        if 2 * int(points.sum()) + ROOM >= len(self.ways.points):
            return
        kept = np.repeat(first - np.concatenate(([0], np.cumsum(points)[:-1])), points) + np.arange(points.sum())
        self.people.first[rows] = np.concatenate(([0], np.cumsum(points)[:-1]))
        self.ways = Ways(points=self.ways.points[kept], along=self.ways.along[kept])

    def _grow(self, least: int) -> None:
        count = max(2 * len(self.moving.here), least)
        old = len(self.moving.here)
        for name, made in (("people", make_people(count)), ("moving", make_moving(count, self._frames))):
            for field, array in made._asdict().items():
                array[:old] = getattr(getattr(self, name), field)
            setattr(self, name, made)

    def step(self) -> None:
        """Take one step: all read, all write."""
        m, p, dt = self.moving, self.people, 1.0 / self.frame_rate
        rows = self.present
        if len(rows):
            low, high = m.position[rows].min(axis=0), m.position[rows].max(axis=0)
            cells = make_cells(low, high, len(m.here))
            sort_into_cells(m.here, m.position, cells)
            last = m.path[rows, m.stops[rows] - 1]
            farthest = float(np.linalg.norm(last - m.position[rows], axis=-1).max())
            widest = float(p.radius[rows].max())
            granted = np.zeros(len(m.here), np.bool_)
            self._propose_scripts(dt)
            end = int(rows[-1]) + 1
            self._each(
                end,
                lambda a, b: propose(
                    p,
                    m,
                    self.ways,
                    self.ground,
                    self.limits,
                    cells,
                    make_scratch(),
                    farthest,
                    widest,
                    self.frame,
                    self.seed,
                    dt,
                    a,
                    b,
                ),
            )
            self._each(end, lambda a, b: settle(p, m, cells, farthest, widest, granted, a, b))
            self._each(end, lambda a, b: write(p, m, self.ways, self.limits, granted, dt, a, b))
            for row, (mover, clock) in self._scripts.items():
                if granted[row]:  # else the script waits until people are gone
                    self._scripts[row] = (mover, clock + dt)
        self.frame += 1

    def _propose_scripts(self, dt: float) -> None:
        """What moves by a script goes on by one frame, if nobody is in its way; it can stop at once."""
        m = self.moving
        for row, (mover, clock) in self._scripts.items():
            place = mover.at(np.array(clock + dt))
            m.meant[row, 0], m.meant_stops[row] = place, 1
            velocity = (place - m.position[row]) / dt
            m.next[row] = (*place, *velocity, 0.0, 0.0, m.heading[row])

    def has_room(self, new: Newcomer) -> bool:
        """Whether somebody can appear so that everybody keeps the room to stop."""
        ahead = (float(np.sin(new.heading)), float(np.cos(new.heading)))
        state = (*new.position, new.speed * ahead[0], new.speed * ahead[1], 0.0, 0.0)
        return bool(
            fits(
                self.people,
                self.moving,
                self.ground,
                self.limits,
                np.array(state, np.float64),
                new.radius,
                np.zeros(STANDING, np.int64),
                np.zeros((self._frames, 2)),
                1.0 / self.frame_rate,
            )
        )

    def _each(self, end: int, kernel) -> None:  # type: ignore[no-untyped-def]
        blocks = [(a, min(a + BLOCK, end)) for a in range(0, end, BLOCK)]
        if self._pool is None or len(blocks) == 1:
            kernel(0, end)
        else:
            list(self._pool.map(lambda block: kernel(*block), blocks))

    def arrived(self) -> Int[Array, "arrived"]:
        """Rows of those who are at the end of their way and leave there."""
        rows = self.present
        rows = rows[(self.people.points[rows] >= 2) & ~self.people.stays[rows] & ~self.people.scripted[rows]]
        last = self.people.first[rows] + self.people.points[rows] - 1
        left = self.ways.along[last] - self.moving.place[rows]
        away = np.linalg.norm(self.ways.points[last] - self.moving.position[rows], axis=-1)
        return rows[(left < ABREAST) | ((left < 2 * ARRIVED) & (away < ARRIVED))]
