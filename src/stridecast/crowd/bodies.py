"""Bodies for the vehicles of a crowd: a pool of walkers that grows with it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from stridecast.body.character import resized, stature
from stridecast.model.behavior import SIZES
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import VehicleState
from stridecast.model.segment import MOTIONS, RUN, STAND, WALK
from stridecast.model.skeleton import Skeleton
from stridecast.synthesis.walker import Walkers

Array = np.ndarray

POOL = 256
"""Bodies that are made and stepped at a time."""

LEVELS = 3
"""Who is far away is stepped at a half, or at a third of the frame rate."""

RUNS_FROM = 1.8
"""Slower than this also a runner walks, m/s."""


def motions_of(
    speeds: Float[Array, "*shape"], aims: Bool[Array, "*shape"], runs: Bool[Array, "*shape"]
) -> Int[Array, "*shape"]:
    """What bodies do, as numbers in ``MOTIONS``: who rests and does not aim at moving stands.

    Parameters
    ----------
    speeds
        Of their vehicles, m/s.
    aims
        Who is about to move, or moves and is not about to rest.
    runs
        Who runs where that is fast enough for it.
    """
    moving = np.where(runs & (speeds > RUNS_FROM), MOTIONS.index(RUN), MOTIONS.index(WALK))
    return np.where((speeds == 0.0) & ~aims, MOTIONS.index(STAND), moving)


class Bodies:
    """Bodies in numbered rows.

    Parameters
    ----------
    database
        Whose motion they show.
    frame_rate
        Frames a second.
    threads
        See ``Walkers``.
    """

    def __init__(self, database: MotionDatabase, frame_rate: float, *, threads: int = 1) -> None:
        self.database, self.frame_rate, self.threads = database, frame_rate, threads
        self.height = person_height(database)
        self.roots = np.zeros((0, 3))
        self.rotations = np.zeros((0, database.skeleton.joints, 4))
        self.planted = np.zeros((0, 2), np.bool_)
        self.scales = np.ones(0)
        self._pools: list[Walkers] = []
        self._waited = np.zeros(0, np.int64)
        self._new = np.zeros(0, np.bool_)
        self._offsets = np.zeros((0, 2))
        self._styles, self._sizes = np.zeros(0), np.zeros(0, np.int64)
        self._altered: set[int] = set()  # pools in which somebody has become another

    def place(
        self,
        rows: Int[Array, "rows"],
        positions: Float[Array, "rows 2"],
        headings: Float[Array, "rows"],
        *,
        phases: Float[Array, "rows"],
        heights: Float[Array, "rows"],
        sizes: list[str],
        styles: Float[Array, "rows"],
    ) -> None:
        """Put new people into rows, ``heights`` in metres; the rest as in ``Walkers.place``."""
        while len(rows) and rows.max() >= len(self.roots):
            self._grow()
        self.scales[rows] = heights / self.height
        self._waited[rows], self._new[rows] = 0, True
        self._styles[rows], self._sizes[rows] = styles, [SIZES.index(size) for size in sizes]
        for pool, inside in self._split(rows):
            own = rows[inside] - pool * POOL
            scaled = positions[inside] / self.scales[rows[inside], None]
            chosen = [sizes[k] for k in np.flatnonzero(inside)]
            self._pools[pool].place(
                own, scaled, headings[inside], phase=phases[inside], size=chosen, style=styles[inside]
            )

    def alter(self, row: int, *, size: str, style: float) -> None:
        """Let somebody who is there move otherwise from their next step on."""
        self._styles[row], self._sizes[row] = style, SIZES.index(size)
        self._altered.add(row // POOL)

    def step(
        self,
        rows: Int[Array, "rows"],
        vehicles: VehicleState,
        motions: Int[Array, "rows"],
        rests_in: Float[Array, "rows"],
        levels: Int[Array, "rows"] | None = None,
    ) -> None:
        """Step the bodies in rows; ``vehicles`` and the rest have a row each.

        ``levels`` tell of each body in how many frames it is stepped once, 1 to ``LEVELS``; in between it moves with
        its vehicle as it is. Who is new is stepped at once, as there is no pose to be kept.
        """
        self._waited[rows] += 1
        due = np.ones(len(rows), np.bool_) if levels is None else (self._waited[rows] >= levels) | self._new[rows]
        late = rows[~due]
        for pool, inside in self._split(rows):
            own = rows[inside] - pool * POOL
            count = len(self._pools[pool])
            active = np.zeros(count, np.bool_)
            active[own[due[inside]]] = True
            scale = self.scales[pool * POOL : pool * POOL + count]

            def spread(values: Array, own: Array = own, inside: Array = inside, count: int = count) -> Array:
                out = np.zeros((count, *values.shape[1:]))
                out[own] = values[inside]
                return out

            there = slice(pool * POOL, pool * POOL + count)
            altered = pool in self._altered
            pose = self._pools[pool].step(
                size=[SIZES[k] for k in self._sizes[there].tolist()] if altered else None,
                style=self._styles[there] if altered else None,
                vehicles=VehicleState(
                    position=spread(vehicles.position) / scale[:, None],
                    velocity=spread(vehicles.velocity) / scale[:, None],
                    acceleration=spread(vehicles.acceleration) / scale[:, None],
                    heading=spread(np.asarray(vehicles.heading)),
                ),
                motion=spread(motions).astype(np.int64),
                rests_in=spread(rests_in),
                active=active,
                dt=np.maximum(self._waited[pool * POOL : pool * POOL + count], 1) / self.frame_rate,
            )
            fresh = own[due[inside]]
            to = fresh + pool * POOL
            self.roots[to] = pose.root_position[fresh] * self.scales[to, None]
            self.rotations[to] = pose.rotations[fresh]
            self.planted[to] = pose.planted[fresh]
        done = rows[due]
        self._waited[done], self._new[done] = 0, False
        self._offsets[done] = self.roots[done][:, [0, 2]] - vehicles.position[due]
        if len(late):
            moved = vehicles.position[~due] + self._offsets[late]
            self.roots[late, 0], self.roots[late, 2] = moved[:, 0], moved[:, 1]

    def _split(self, rows: Int[Array, "rows"]) -> list[tuple[int, Bool[Array, "rows"]]]:
        pools = rows // POOL
        return [(int(pool), pools == pool) for pool in np.unique(pools)]

    def _grow(self) -> None:
        self._pools.append(
            Walkers(self.database, np.zeros((POOL, 2)), frame_rate=self.frame_rate, threads=self.threads)
        )
        more = POOL * len(self._pools)
        for name in ("roots", "rotations", "planted", "scales", "_waited", "_new", "_offsets", "_styles", "_sizes"):
            old = getattr(self, name)
            new = np.zeros((more, *old.shape[1:]), old.dtype)
            new[: len(old)] = old
            setattr(self, name, new)
        self.scales[more - POOL :] = 1.0
        self._sizes[more - POOL :] = SIZES.index("neutral")


def person_height(database: MotionDatabase) -> float:
    """Height of a person who is as large as the skeleton of a database, metres."""
    return stature(database.skeleton) if database.person is None else database.person


def body_of(database: MotionDatabase, height: float | None) -> Skeleton:
    """The skeleton of a person of some height, metres; that of the database where nothing is said."""
    return database.skeleton if height is None else resized(database.skeleton, height / person_height(database))
