"""Bodies for anybody's trajectories: made humanly possible first, then shown by people of the database."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from jaxtyping import Bool, Float, Int

from stridecast.crowd.baking import filmed
from stridecast.crowd.bodies import Bodies, body_of, motions_of
from stridecast.crowd.bounds import HumanBounds
from stridecast.crowd.human import BOUNDS, HumanTrack, TrackReport, make_human, stretches
from stridecast.errors import InputError
from stridecast.model.database import MotionDatabase
from stridecast.model.motion import Motion
from stridecast.model.people import HEIGHTS
from stridecast.model.pose import VehicleState
from stridecast.model.trajectories import Trajectories

Array = np.ndarray

AT_A_TIME = 128
"""So many people are dressed at a time."""

LOOKS_AHEAD = 0.25
"""So long before somebody moves off the body knows of it, and so long braking must go on to count, seconds."""

BRAKES = 0.2
"""Who loses less than this brakes for nothing, m/s2."""

REGAINS = 0.02
"""Who is about to rest gains no more than this on the way there, m/s."""

LONGEST_BRAKING = 3.0
"""Nobody is about to rest for longer than this, seconds."""

STAYS_IN_GAIT = 0.15
"""A gait is left only so far beyond the speed at which it changes, m/s."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DressedPerson:
    """One person from the first moment to the last.

    Parameters
    ----------
    person
        Number in the trajectories; who is gone for long and comes back is there several times.
    start
        Time of the first frame on the clock of the trajectories, seconds.
    motion, planted
        Of the body, and which foot stands when; nothing where only tracks were asked for.
    vehicle
        What the body follows, frame by frame.
    report
        How near to the source it is.
    """

    person: int
    start: float
    motion: Motion | None
    planted: Bool[Array, "frames 2"] | None
    vehicle: VehicleState
    report: TrackReport

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.vehicle.position)


@dataclass(frozen=True, kw_only=True, eq=False)
class Dressed:
    """Everybody, sorted by person, then by time.

    Parameters
    ----------
    frame_rate
        Frames a second.
    people
        Everybody.
    """

    frame_rate: float
    people: tuple[DressedPerson, ...]

    @property
    def mean_distance(self) -> float:
        """Between vehicles and samples of the source, metres."""
        return summed([one.report for one in self.people]).mean_distance

    @property
    def beyond(self) -> dict[str, int]:
        """Samples at which the source is beyond each bound (see ``TrackReport``)."""
        return summed([one.report for one in self.people]).beyond


def summed(reports: list[TrackReport]) -> TrackReport:
    """One report of many; the mean is that of all samples, the noise the middle one."""
    samples = sum(report.samples for report in reports)
    return TrackReport(
        mean_distance=sum(r.mean_distance * r.samples for r in reports) / max(samples, 1),
        largest_distance=max((r.largest_distance for r in reports), default=0.0),
        samples=samples,
        beyond={name: sum(r.beyond[name] for r in reports) for name in BOUNDS},
        frames_away=sum(r.frames_away for r in reports),
        noise=float(np.median([r.noise for r in reports])) if reports else 0.0,
    )


def dress(
    database: MotionDatabase,
    trajectories: Trajectories,
    *,
    frame_rate: float | None = None,
    noise: float | None = None,
    heights: Mapping[int, float] | float | None = None,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Dressed:
    """Full bodies on trajectories of a simulator or a tracker.

    Each trajectory becomes a track that a person could walk and that is as near to it as that allows (``make_human``);
    a body of the database follows it. Everybody is kept in memory, 25 kB for each second of a person;
    ``dress_each`` gives one after the other.

    Parameters
    ----------
    database
        Whose motion they show, and whose bounds hold.
    trajectories
        Where people were.
    frame_rate
        Frames a second of the motions; the database's if left out.
    noise
        Of the positions, metres; each person's is estimated if left out.
    heights
        Of people by number, or of all, metres; that of the database where nothing is said.
    threads
        Threads that share the bodies. The result does not depend on it.
    progress
        Called with how many rows of the trajectories are dressed, and how many there are.

    Raises
    ------
    InputError
        Samples more than two seconds apart, a frame rate outside 10 to 240 Hz, noise or heights that make no sense.
    DatabaseError
        Nobody walks in the database.
    """
    each = dress_each(
        database,
        trajectories,
        frame_rate=frame_rate,
        noise=noise,
        heights=heights,
        threads=threads,
        progress=progress,
    )
    return Dressed(frame_rate=float(database.frame_rate if frame_rate is None else frame_rate), people=tuple(each))


def dress_each(
    database: MotionDatabase,
    trajectories: Trajectories,
    *,
    frame_rate: float | None = None,
    noise: float | None = None,
    heights: Mapping[int, float] | float | None = None,
    threads: int = 1,
    bodies: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[DressedPerson]:
    """Like ``dress``, one person after the other, so that it does not matter how many there are.

    ``bodies`` tells whether they have bodies; tracks alone are several times as fast. What is wrong is told before
    anybody is dressed.
    """
    rate = float(database.frame_rate if frame_rate is None else frame_rate)
    nobody = Trajectories(ids=np.zeros(0, np.int64), times=np.zeros(0), positions=np.zeros((0, 2)))
    bounds = HumanBounds.of(database)
    make_human(nobody, bounds, rate, noise=noise)  # looks at rate and noise
    stretches(trajectories)
    tall = _heights(trajectories, heights)
    wardrobe = Bodies(database, rate, threads=threads) if bodies else None
    return _dressed(database, trajectories, bounds, rate, noise, tall, wardrobe, progress)


def _dressed(
    database: MotionDatabase,
    trajectories: Trajectories,
    bounds: HumanBounds,
    rate: float,
    noise: float | None,
    heights: Mapping[int, float],
    bodies: Bodies | None,
    progress: Callable[[int, int], None] | None,
) -> Iterator[DressedPerson]:
    for part in _parts(trajectories):
        tracks = make_human(_some(trajectories, part), bounds, rate, noise=noise).tracks
        for first in range(0, len(tracks), AT_A_TIME):
            few = tracks[first : first + AT_A_TIME]
            nothing: Iterator[tuple[None, None]] = repeat((None, None))
            motions = nothing if bodies is None else _motions(database, few, bounds, rate, heights, bodies)
            for track, (motion, planted) in zip(few, motions, strict=False):
                yield DressedPerson(
                    person=track.person,
                    start=track.start,
                    motion=motion,
                    planted=planted,
                    vehicle=track.vehicle,
                    report=track.report,
                )
        if progress is not None:
            progress(part.stop, len(trajectories))


def _parts(trajectories: Trajectories) -> Iterator[slice]:
    """Rows of as many people as are dressed at a time."""
    rows = [rows for _, rows in trajectories.each()]
    for first in range(0, len(rows), AT_A_TIME):
        some = rows[first : first + AT_A_TIME]
        yield slice(some[0].start, some[-1].stop)


def _some(trajectories: Trajectories, rows: slice) -> Trajectories:
    return Trajectories(
        ids=trajectories.ids[rows],
        times=trajectories.times[rows],
        positions=trajectories.positions[rows],
        headings=None if trajectories.headings is None else trajectories.headings[rows],
        speeds=None if trajectories.speeds is None else trajectories.speeds[rows],
        name=trajectories.name,
    )


def _heights(trajectories: Trajectories, heights: Mapping[int, float] | float | None) -> dict[int, float]:
    people = trajectories.people.tolist()
    if heights is None:
        return {}
    given = heights if isinstance(heights, Mapping) else dict.fromkeys(people, heights)
    unknown = sorted(set(given) - set(people))
    if unknown:
        raise InputError(f"there is a height of person {unknown[0]}, who is not in the trajectories")
    for person, height in given.items():
        if not HEIGHTS[0] <= height <= HEIGHTS[1]:
            raise InputError(f"person {person} should be {HEIGHTS[0]:g} to {HEIGHTS[1]:g} m tall, not {height}")
    return {int(person): float(height) for person, height in given.items()}


def _motions(
    database: MotionDatabase,
    tracks: tuple[HumanTrack, ...],
    bounds: HumanBounds,
    rate: float,
    heights: Mapping[int, float],
    bodies: Bodies,
) -> Iterator[tuple[Motion, Bool[Array, "frames 2"]]]:
    """Bodies for some tracks, and which of their feet stand; all begin in the same step, whatever their clocks say."""
    lengths = np.array([len(track) for track in tracks])
    count, longest, joints = len(tracks), int(lengths.max()), database.skeleton.joints
    vehicles = np.zeros((longest, count, 7))
    motions, rests = np.zeros((longest, count), np.int64), np.zeros((longest, count))
    for k, track in enumerate(tracks):
        v, end = track.vehicle, len(track)
        vehicles[:end, k] = np.column_stack((v.position, v.velocity, v.acceleration, np.asarray(v.heading)))
        speeds = np.hypot(*v.velocity.T)
        rests[:end, k] = rests_of(speeds, rate)
        motions[:end, k] = motions_of(speeds, np.isinf(rests[:end, k]), _running(speeds, bounds))
    bodies.place(
        np.arange(count),
        vehicles[0, :, :2],
        vehicles[0, :, 6],
        phases=np.array([_phase(track.person) for track in tracks]),
        heights=np.array([heights.get(track.person, bodies.height) for track in tracks]),
        sizes=["neutral"] * count,
        styles=np.zeros(count),
    )
    roots = np.zeros((count, longest, 3))
    rotations = np.zeros((count, longest, joints, 4), np.float32)
    planted = np.zeros((count, longest, 2), np.bool_)
    for k in range(longest):
        rows = np.flatnonzero(lengths > k)
        now = vehicles[k, rows]
        bodies.step(
            rows,
            VehicleState(position=now[:, 0:2], velocity=now[:, 2:4], acceleration=now[:, 4:6], heading=now[:, 6]),
            motions[k, rows],
            rests[k, rows],
        )
        roots[rows, k], rotations[rows, k] = bodies.roots[rows], bodies.rotations[rows]
        planted[rows, k] = bodies.planted[rows]
    for k, (track, end) in enumerate(zip(tracks, lengths.tolist(), strict=True)):
        skeleton = body_of(database, heights.get(track.person))
        yield filmed(roots[k, :end], rotations[k, :end], skeleton, rate, str(track.person)), planted[k, :end]


def rests_of(speeds: Float[Array, "frames"], rate: float) -> Float[Array, "frames"]:
    """Time until a vehicle comes to rest, seconds; infinite for those who do not brake for it.

    Who rests has 0, unless they are about to move off.
    """
    frames = len(speeds)
    ahead = max(1, round(LOOKS_AHEAD * rate))
    padded = np.concatenate((speeds, np.full(ahead, speeds[-1])))
    resting = speeds == 0.0
    soon = padded[1 : frames + 1]
    out = np.where(resting & (soon == 0.0), 0.0, np.inf)
    rest, most = -1, 0.0  # next frame at rest, and the highest speed from here to there
    for k in range(frames - 1, -1, -1):
        if resting[k]:
            rest, most = k, 0.0
            continue
        most = max(most, speeds[k])
        if rest < 0 or most > speeds[k] + REGAINS or rest - k > LONGEST_BRAKING * rate:
            continue
        later = min(ahead, rest - k)
        if speeds[k] - padded[k + later] >= BRAKES * later / rate:
            out[k] = (rest - k) / rate
    return out


def _running(speeds: Float[Array, "frames"], bounds: HumanBounds) -> Bool[Array, "frames"]:
    """Who runs: faster than where gaits change; each gait is kept for a while beyond that."""
    if len(bounds.jerk) == 1:
        return np.zeros(len(speeds), np.bool_)
    middle = 0.5 * sum(bounds.fades)
    sure: Int[Array, "frames"] = np.where(
        speeds > middle + STAYS_IN_GAIT, 1, np.where(speeds < middle - STAYS_IN_GAIT, 0, -1)
    )
    last = np.maximum.accumulate(np.where(sure >= 0, np.arange(len(speeds)), -1))
    return np.where(last >= 0, sure[last] == 1, speeds > middle)


def _phase(person: int) -> float:
    """Where in the gait somebody appears: spread evenly over people, and only dependent on the number."""
    return (person % 99991) * 0.6180339887498949 % 1.0
