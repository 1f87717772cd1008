"""Anybody's trajectories made humanly possible: vehicles that follow them and never leave a person's bounds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import make_interp_spline
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from stridecast.crowd import human_kernels
from stridecast.crowd.bounds import HumanBounds
from stridecast.crowd.smoothing import GRID, Smoother, noise_of, standing_places, without_sway
from stridecast.errors import InputError
from stridecast.geometry import ground
from stridecast.model.pose import VehicleState
from stridecast.model.trajectories import Trajectories

Array = np.ndarray

SLOWEST_SAMPLING = 2.0
"""Samples further apart than this tell no steering, seconds."""

LONGEST_GAP = 1.0
"""Who is gone for longer than this, seconds, and for longer than three samples comes back with another track."""

FINEST_SWAY = 8.0
"""Sway shows in tracks with at least so many samples a second."""

STRIDES, AWAY = 0.4, 0.3
"""Who has at first not this speed (m/s) faces where they will be when they have gone so far (m)."""

NEAR = 0.1
"""Within this distance the source counts as followed, metres."""

COARSE = 0.02
"""What a source does beyond the bounds by less than this is not counted, metres (30 samples a second)."""

SLACK = 1.15
"""Nor what is beyond them by less than this factor: smoothing alone shifts accelerations by as much."""

ROUNDS = 14
"""So often a reference is made stiffer where it asks for too much."""

STIFFEST = 1e5
"""It is made stiffer by no more than this."""

SPARE = 0.93
"""Share of the bounds that a reference should use up."""

BOUNDS = ("speed", "tangential", "lateral", "jerk")
"""What a source can go beyond."""


@dataclass(frozen=True, kw_only=True)
class TrackReport:
    """How a track and its source compare.

    Parameters
    ----------
    mean_distance, largest_distance
        Between the vehicle and the samples of the source (noise and sway included), metres.
    samples
        Samples of the source.
    beyond
        Samples at which the source, its noise and sway taken out, is beyond a bound: ``speed``, ``tangential``,
        ``lateral``, ``jerk``.
    frames_away
        Frames in which the vehicle is further than 10 cm from the source, its noise and sway taken out.
    noise
        Noise of the source that was assumed, metres.
    """

    mean_distance: float
    largest_distance: float
    samples: int
    beyond: dict[str, int]
    frames_away: int
    noise: float


@dataclass(frozen=True, kw_only=True, eq=False)
class HumanTrack:
    """One person from the first moment to the last, frame by frame.

    Parameters
    ----------
    person
        Number in the trajectories.
    start
        Time of the first frame, seconds.
    vehicle
        Position, velocity, acceleration and heading; the leading axis is frames.
    report
        How near to the source it is.
    """

    person: int
    start: float
    vehicle: VehicleState
    report: TrackReport

    def __len__(self) -> int:
        return len(self.vehicle.position)


@dataclass(frozen=True, kw_only=True, eq=False)
class HumanTracks:
    """Everybody's tracks, sorted by person, then by time; who was away for long has several.

    Parameters
    ----------
    frame_rate
        Frames a second.
    tracks
        The tracks.
    """

    frame_rate: float
    tracks: tuple[HumanTrack, ...]


def make_human(
    trajectories: Trajectories, bounds: HumanBounds, frame_rate: float, *, noise: float | None = None
) -> HumanTracks:
    """Tracks as near to trajectories as a person can go.

    A smooth curve is fitted to each person's samples, as near as their noise allows (trackers, hand annotation);
    sway and surge of the steps are taken out of it, and who shifts about on the spot stands. Where the curve asks for
    more than a person can do it is made stiffer, so that corners are cut on both sides and braking begins early. A
    vehicle follows the curve; its acceleration is held to the bounds in every frame, as a walker's is.

    The heading is the direction of motion, kept while standing. Who has to turn on the spot walks round. Headings of
    the trajectories are looked at where nobody moves at first, speeds never.

    Parameters
    ----------
    trajectories
        Where people were, at any rate of samples, even or not. Who is gone for longer than a second (or three samples)
        and comes back gets another track.
    bounds
        What a person can do, ``HumanBounds.of(database)``.
    frame_rate
        Frames a second of the tracks, as of the database.
    noise
        Noise of the positions, metres; without it, each person's is estimated.

    Raises
    ------
    InputError
        Frame rate or noise make no sense, or samples are more than two seconds apart.
    """
    if not (np.isfinite(frame_rate) and 10 <= frame_rate <= 240):
        raise InputError(f"the frame rate must lie between 10 and 240 Hz, not at {frame_rate}")
    if noise is not None and not (np.isfinite(noise) and 0 <= noise <= 1):
        raise InputError(f"noise must lie between 0 and 1 m, not at {noise}")
    present = stretches(trajectories)
    if not present:
        return HumanTracks(frame_rate=frame_rate, tracks=())
    references = [_reference(trajectories, rows, bounds, frame_rate, noise) for _, rows in present]
    starts = np.concatenate(([0], np.cumsum([len(r.points) for r in references])))
    out = np.zeros((int(starts[-1]), 7))
    human_kernels.follow(
        np.concatenate([r.points for r in references]),
        np.concatenate([r.standing for r in references]),
        starts,
        np.array([r.heading for r in references]),
        bounds.jerk,
        bounds.tangential,
        bounds.lateral_per_speed,
        float(bounds.fastest[-1]),
        np.array(bounds.fades),
        1.0 / frame_rate,
        out,
    )
    tracks = [
        _track(trajectories, person, rows, reference, out[first:last], bounds, frame_rate)
        for (person, rows), reference, first, last in zip(present, references, starts[:-1], starts[1:], strict=True)
    ]
    return HumanTracks(frame_rate=frame_rate, tracks=tuple(tracks))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Reference:
    """What to follow: frame by frame, and the gently smoothed source beside it."""

    points: Float[Array, "frames 2"]
    standing: Bool[Array, "frames"]
    heading: float
    gentle: Float[Array, "frames 2"]
    noise: float


def stretches(trajectories: Trajectories) -> list[tuple[int, slice]]:
    """Rows in which a person is there all the time.

    Raises
    ------
    InputError
        Samples are too far apart.
    """
    out = []
    for person, rows in trajectories.each():
        steps = np.diff(trajectories.times[rows])
        usual = float(np.median(steps)) if len(steps) else 0.0
        if usual > SLOWEST_SAMPLING:
            what = f"person {person} is seen every {usual:.3g} s only; {SLOWEST_SAMPLING:g} s are the most"
            raise InputError(f"{what} (are times in seconds?)")
        breaks = np.flatnonzero(steps > max(LONGEST_GAP, 3.0 * usual)) + 1
        edges = rows.start + np.concatenate(([0], breaks, [rows.stop - rows.start]))
        out += [(person, slice(a, b)) for a, b in pairwise(edges.tolist())]
    return out


def _reference(
    trajectories: Trajectories, rows: slice, bounds: HumanBounds, rate: float, noise: float | None
) -> _Reference:
    times = trajectories.times[rows] - trajectories.times[rows.start]
    points = trajectories.positions[rows]
    frames = int(np.ceil(times[-1] * rate - 1e-6)) + 1
    told = noise_of(times, points) if noise is None else max(noise, 1e-4)
    facing = None if trajectories.headings is None else float(trajectories.headings[rows.start])
    gentle = Smoother(times, points, told).curve()
    seconds = float(times[-1])
    if seconds > 0 and (len(times) - 1) / seconds >= FINEST_SWAY:
        gentle = without_sway(gentle)
    still, spots = standing_places(gentle)
    wanted = _possible(spots, still, bounds)
    moments = np.arange(frames) / rate
    at = np.minimum(np.round(moments * GRID).astype(np.int64), len(still) - 1)
    reference = _resampled(wanted, moments)
    return _Reference(
        points=reference,
        standing=still[at],
        heading=_first_heading(reference, rate, facing),
        gentle=_resampled(gentle, moments),
        noise=told,
    )


def _possible(spots: Float[Array, "grid 2"], still: Bool[Array, "grid"], bounds: HumanBounds) -> Float[Array, "grid 2"]:
    """A curve made stiffer where it asks for too much."""
    curve = spots
    stiffer = np.ones(len(spots))
    fit: Smoother | None = None
    for _ in range(ROUNDS):
        excess = _excess(curve, bounds) / SPARE
        over = excess > 1.0
        jumps = fit is None and still.any() and not still.all()
        if not (over.any() or jumps):
            break
        if fit is None:
            fit = Smoother(np.arange(len(spots)) / GRID, spots, 1e-3)
        near = maximum_filter1d(np.where(over, np.minimum(excess, 3.0) ** 3, 1.0), int(0.3 * GRID))
        stiffer = np.minimum(stiffer * gaussian_filter1d(near, 0.1 * GRID, mode="nearest"), STIFFEST)
        curve = fit.curve(stiffer)[: len(spots)]
    return curve


def _asked(curve: Float[Array, "grid 2"]) -> tuple[Array, Array, Array, Array]:
    """Speed, tangential and lateral acceleration, and jerk of a curve."""
    velocity = np.gradient(curve, 1.0 / GRID, axis=0)
    acceleration = np.gradient(velocity, 1.0 / GRID, axis=0)
    jerk = np.hypot(*np.gradient(acceleration, 1.0 / GRID, axis=0).T)
    speed = np.hypot(*velocity.T)
    ahead = velocity / np.maximum(speed, 1e-9)[:, None]
    return speed, np.sum(acceleration * ahead, -1), np.sum(acceleration * ground.left_of(ahead), -1), jerk


def _excess(curve: Float[Array, "grid 2"], bounds: HumanBounds) -> Float[Array, "grid"]:
    """By which factor a curve is beyond the nearest of its bounds; below 1 it is inside."""
    speed, tangential, lateral, jerk = _asked(curve)
    most, low, high, wide = bounds.at(speed)
    return np.maximum.reduce(
        (
            jerk / most,
            tangential / high,
            tangential / low,
            np.abs(lateral) / (wide + 0.3),
            speed / bounds.fastest[-1],
        )
    )


def _resampled(curve: Float[Array, "grid 2"], moments: Float[Array, "frames"]) -> Float[Array, "frames 2"]:
    """A curve of the grid at other moments."""
    return np.asarray(make_interp_spline(np.arange(len(curve)) / GRID, curve, k=3)(moments))


def _first_heading(points: Float[Array, "frames 2"], rate: float, facing: float | None) -> float:
    """Where somebody faces at first: where they go, soon or later, else where they were seen to face."""
    begins = (points[1] - points[0]) * rate if len(points) > 1 else np.zeros(2)
    if np.hypot(*begins) < STRIDES:
        if facing is not None:
            return facing
        way = points - points[0]
        far = np.flatnonzero(np.hypot(*way.T) > AWAY)
        begins = way[far[0]] if len(far) else np.zeros(2)
    return float(np.arctan2(*begins))


def _track(
    trajectories: Trajectories,
    person: int,
    rows: slice,
    reference: _Reference,
    out: Float[Array, "frames 7"],
    bounds: HumanBounds,
    rate: float,
) -> HumanTrack:
    times = trajectories.times[rows] - trajectories.times[rows.start]
    moments = np.arange(len(out)) / rate
    there = np.stack([np.interp(times, moments, out[:, k]) for k in range(2)], axis=-1)
    distances = np.hypot(*(there - trajectories.positions[rows]).T)
    away = np.hypot(*(out[:, :2] - reference.gentle).T)
    vehicle = VehicleState(position=out[:, 0:2], velocity=out[:, 2:4], acceleration=out[:, 4:6], heading=out[:, 6])
    return HumanTrack(
        person=person,
        start=float(trajectories.times[rows.start]),
        vehicle=vehicle,
        report=TrackReport(
            mean_distance=float(distances.mean()),
            largest_distance=float(distances.max()),
            samples=len(times),
            beyond=_beyond(reference, moments, times, bounds),
            frames_away=int(np.sum(away > NEAR)),
            noise=reference.noise,
        ),
    )


def _beyond(
    reference: _Reference, moments: Float[Array, "frames"], times: Float[Array, "samples"], bounds: HumanBounds
) -> dict[str, int]:
    """Samples at which a source is beyond each of its bounds; who shifts about on the spot is inside."""
    grid = np.arange(0.0, moments[-1] + 1e-9, 1.0 / GRID)
    if len(grid) < 5:
        return dict.fromkeys(BOUNDS, 0)
    curve = make_interp_spline(moments, reference.gentle, k=3)(grid)
    curve = Smoother(grid, curve, COARSE).curve()[: len(grid)]
    speed, tangential, lateral, jerk = _asked(curve)
    most, low, high, wide = bounds.at(speed)
    found = (
        speed > bounds.fastest[-1],
        (tangential > SLACK * high) | (tangential < SLACK * low),
        (np.abs(lateral) > SLACK * wide + 0.1) & (speed > STRIDES),  # slower, people turn on the spot
        jerk > SLACK * most,
    )
    at = np.clip(np.round(times * GRID).astype(np.int64), 0, len(grid) - 1)
    frames = np.minimum(np.searchsorted(moments, times), len(moments) - 1)
    walking = ~reference.standing[frames]
    return {name: int(np.sum(one[at] & walking)) for name, one in zip(BOUNDS, found, strict=True)}
