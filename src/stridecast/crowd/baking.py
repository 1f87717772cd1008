"""A crowd from beginning to end: frame by frame, with everybody's motion as soon as they have left."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from stridecast.crowd.crowd import Crowd
from stridecast.crowd.frame import CrowdFrame
from stridecast.errors import InputError
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.people import Person
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

LONGEST = 600.0
"""Where nothing else ends it, a crowd is baked for no longer than this, seconds."""

MOST = 24 * 3600.0
"""Nobody bakes for longer than this, seconds."""

TOUCH = 1e-6
"""Bodies that are no deeper in one another touch, metres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Performance:
    """One person from the first frame to the last.

    Parameters
    ----------
    number
        Of the person, in the order in which they came, from 1.
    person
        Who it is.
    start
        Time of the first frame, seconds since the beginning; all people share that clock.
    frames
        So many are there.
    arrived
        They left at their last stop, or stand there for good; else the end came first.
    motion, planted
        Of their body, of its own height, and which foot stands when; nothing where the crowd has no bodies.
    """

    number: int
    person: Person
    start: float
    frames: int
    arrived: bool
    motion: Motion | None
    planted: Bool[Array, "frames 2"] | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Baked:
    """One frame of a bake.

    Parameters
    ----------
    frame
        Everybody who is there.
    finished
        Who was there in an earlier frame for the last time; in the last frame also everybody who is still there.
    last
        Whether this is the last frame.
    """

    frame: CrowdFrame
    finished: tuple[Performance, ...]
    last: bool


@dataclass(kw_only=True)
class Tally:
    """What has been going on so far.

    Parameters
    ----------
    frames
        Frames.
    came, arrived, there, waiting, turned_away
        People who have come, who have left at their last stop or stand there for good, who are still there, who wait
        outside for room, and who stay out as there is no way for them.
    most
        So many were there at once.
    overlaps
        Pairs of people in one another, or people and moving obstacles, counted in every frame; 0 unless something is
        broken.
    deepest
        How deep at most, metres.
    metres
        Walked by all together.
    """

    frames: int = 0
    came: int = 0
    arrived: int = 0
    there: int = 0
    waiting: int = 0
    turned_away: int = 0
    most: int = 0
    overlaps: int = 0
    deepest: float = 0.0
    metres: float = 0.0


class Baking:
    """Steps a crowd to its end. Iterate over it once.

    Poses are kept in single precision, and only of people who are there.

    Parameters
    ----------
    crowd
        A crowd that has not been stepped yet.
    seconds
        How long; else as long as its scene says, else until everybody has left or stands at the last stop, but no
        longer than ``LONGEST``.

    Raises
    ------
    InputError
        ``seconds`` is no time, the crowd has been stepped, or nobody goes anywhere and nothing says for how long.
    """

    def __init__(self, crowd: Crowd, *, seconds: float | None = None) -> None:
        if seconds is not None and not 0 < seconds <= MOST:
            raise InputError(f"seconds must lie above 0 and up to {MOST:g}, not at {seconds}")
        if crowd.time > 0:
            raise InputError(f"this crowd has been stepped to {crowd.time:.3g} s; bake one that is new")
        given = crowd.scene.seconds if seconds is None else seconds
        if given is None and crowd.done:
            raise InputError("nobody in the scene goes anywhere: say for how many seconds they stand")
        self.crowd = crowd
        self.until_done = given is None
        self.frames = max(1, round(min(LONGEST if given is None else given, MOST) * crowd.frame_rate))
        self.tally = Tally()
        self._films: dict[int, _Film] = {}
        self._radii = np.array([mover.radius for mover in crowd.scene.movers])

    def __iter__(self) -> Iterator[Baked]:
        crowd, gone, removed = self.crowd, 0, 0
        for k in range(self.frames):
            frame = crowd.step()
            finished = [self._finish(number, True) for number, _ in crowd.left[gone:]]
            finished += [self._finish(n, False) for n, _ in crowd.removed[removed:] if n in self._films]
            gone, removed = len(crowd.left), len(crowd.removed)
            self._count(frame)
            for row, number in enumerate(frame.ids.tolist()):
                self._film_of(number, frame.time).add(frame, row)
            ends = k + 1 == self.frames or (self.until_done and crowd.done)
            if ends:
                stays = crowd.at_last_stop()
                finished += [self._finish(number, number in stays) for number in frame.ids.tolist()]
            yield Baked(frame=frame, finished=tuple(finished), last=ends)
            if ends:
                return

    def _film_of(self, number: int, time: float) -> _Film:
        if number not in self._films:
            self._films[number] = _Film(start=time)
        return self._films[number]

    def _finish(self, number: int, arrived: bool) -> Performance:
        film = self._films.pop(number)
        person = self.crowd.person(number)
        rate = self.crowd.frame_rate
        bodies = film.rotations is not None
        return Performance(
            number=number,
            person=person,
            start=film.start,
            frames=film.frames,
            arrived=arrived,
            motion=film.motion(self.crowd.skeleton(number), rate, person.name) if bodies else None,
            planted=film.planted[: film.frames] if bodies else None,
        )

    def _count(self, frame: CrowdFrame) -> None:
        crowd, t = self.crowd, self.tally
        t.frames += 1
        t.came, t.there, t.waiting = len(crowd.came), len(frame.ids), crowd.waiting
        t.turned_away = len(crowd.turned_away)
        t.arrived = len(crowd.left) + len(crowd.at_last_stop())
        t.most = max(t.most, t.there)
        t.metres += float(np.linalg.norm(frame.velocities, axis=-1).sum()) / crowd.frame_rate
        depths = overlap_depths(frame, self._radii)
        t.overlaps += len(depths)
        t.deepest = max(t.deepest, float(depths.max(initial=0.0)))


def overlap_depths(frame: CrowdFrame, movers: Float[Array, "movers"]) -> Float[Array, "overlaps"]:
    """How deep bodies are in one another and in moving obstacles of these radii, a number for each overlap, metres."""
    if not len(frame.ids):
        return np.zeros(0)
    centers = np.concatenate((frame.positions, frame.movers))
    radii = np.concatenate((frame.radii, movers))
    one, other = cKDTree(centers).query_pairs(2.0 * float(radii.max()), output_type="ndarray").T
    people = np.minimum(one, other) < len(frame.ids)  # two movers may cross
    depth = radii[one] + radii[other] - np.linalg.norm(centers[one] - centers[other], axis=-1)
    return depth[people & (depth > TOUCH)]


@dataclass(kw_only=True)
class _Film:
    """Poses of one person in room that grows."""

    start: float
    frames: int = 0
    roots: Float[Array, "room 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    rotations: Array | None = None
    planted: Bool[Array, "room 2"] = field(default_factory=lambda: np.zeros((0, 2), np.bool_))

    def add(self, frame: CrowdFrame, row: int) -> None:
        if frame.roots is not None and frame.rotations is not None and frame.planted is not None:
            if self.rotations is None or self.frames == len(self.roots):
                self._grow(frame.rotations.shape[1])
            assert self.rotations is not None
            self.roots[self.frames], self.rotations[self.frames] = frame.roots[row], frame.rotations[row]
            self.planted[self.frames] = frame.planted[row]
        self.frames += 1

    def _grow(self, joints: int) -> None:
        room = max(64, len(self.roots) + len(self.roots) // 2)
        roots, rotations = np.zeros((room, 3)), np.zeros((room, joints, 4), np.float32)
        planted = np.zeros((room, 2), np.bool_)
        if self.rotations is not None:
            roots[: self.frames], rotations[: self.frames] = self.roots, self.rotations
            planted[: self.frames] = self.planted
        self.roots, self.rotations, self.planted = roots, rotations, planted

    def motion(self, skeleton: Skeleton, rate: float, name: str) -> Motion:
        assert self.rotations is not None
        return filmed(self.roots[: self.frames], self.rotations[: self.frames], skeleton, rate, name)


def filmed(roots: Array, rotations: Array, skeleton: Skeleton, rate: float, name: str) -> Motion:
    """A motion of poses that were kept in single precision."""
    exact = quat.continuous(quat.normalize(rotations.astype(np.float64)))
    return Motion(skeleton=skeleton, frame_rate=rate, root_positions=roots, rotations=exact, name=name, subject=name)
