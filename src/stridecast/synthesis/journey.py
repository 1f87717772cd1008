"""A whole walk at once: a stream of points in, every frame of the walk out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from stridecast.errors import WishError
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.database import MotionDatabase
from stridecast.model.motion import Motion
from stridecast.model.pose import Pose
from stridecast.steering.force import SteeringGains
from stridecast.synthesis.styles import Style
from stridecast.synthesis.walker import Walker

Array = np.ndarray

LOOK = 0.1
"""A walker first looks to where the stream is once it has gone so far, metres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PointStream:
    """Samples of an input device: when, where, and which motion was asked for.

    Parameters
    ----------
    times
        Seconds, increasing.
    points
        Ground points ``(x, z)``, metres.
    motions
        ``stand``, ``walk`` or ``run``, one a sample.

    Raises
    ------
    WishError
        No sample, lengths that differ, numbers that are not finite, time that does not run forwards (the sample is
        named).
    """

    times: Float[Array, "samples"]
    points: Float[Array, "samples 2"]
    motions: tuple[str, ...]

    def __post_init__(self) -> None:
        times, points = np.array(self.times, np.float64), np.array(self.points, np.float64)
        if len(times) == 0:
            raise WishError("the stream has no sample")
        if points.shape != (len(times), 2) or len(self.motions) != len(times):
            raise WishError(
                f"{len(times)} times, points of shape {points.shape} and {len(self.motions)} motions differ"
            )
        for name, bad in (
            ("time", ~np.isfinite(times)),
            ("point", ~np.isfinite(points).all(axis=1)),
        ):
            if bad.any():
                raise WishError(f"{name} of sample {int(np.flatnonzero(bad)[0])} is not a finite number")
        back = np.flatnonzero(np.diff(times) <= 0)
        if len(back):
            i = int(back[0]) + 1
            raise WishError(f"time does not run forwards at sample {i}: {times[i]:g} s after {times[i - 1]:g} s")
        for name, array in (("times", times), ("points", points)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def at(self, times: Float[Array, "frames"]) -> tuple[Float[Array, "frames 2"], list[str]]:
        """Points (linear between samples) and motions (of the last sample) at other times."""
        points = np.stack([np.interp(times, self.times, self.points[:, axis]) for axis in (0, 1)], axis=-1)
        last = np.searchsorted(self.times, times + 1e-9, side="right") - 1
        return points, [self.motions[i] for i in np.clip(last, 0, len(self.motions) - 1)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Journey:
    """Every frame of a walk; arrays have a leading ``frames`` axis (see ``Pose`` for units)."""

    motion: Motion
    times: Float[Array, "frames"]
    inputs: Float[Array, "frames 2"]
    positions: Float[Array, "frames 2"]
    velocities: Float[Array, "frames 2"]
    accelerations: Float[Array, "frames 2"]
    headings: Float[Array, "frames"]
    planted: Bool[Array, "frames 2"]
    motions: tuple[str, ...]
    groups: tuple[str, ...]
    clamped: tuple[tuple[str, ...], ...]
    made_up: int


def follow(
    database: MotionDatabase,
    stream: PointStream,
    *,
    subject: str | None = None,
    gains: SteeringGains | None = None,
    frame_rate: float | None = None,
    heading: float | None = None,
    size: str | None = None,
    style: Style = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> Journey:
    """Let a character walk after a stream of points, frame by frame as it would on-line.

    It starts standing at the first point and looks to where the stream first leads.

    Parameters
    ----------
    database, subject, gains, frame_rate
        See ``Walker``.
    stream
        Where to go.
    heading
        Where it looks at first, radians, if that is to be something else.
    size, style
        Size of movement and style (see ``Walkers``).
    progress
        Called with frames done and frames in all, about once a second of the walk.
    """
    first = stream.points[0]
    if heading is None:
        way = stream.points - first
        leading = np.flatnonzero(np.linalg.norm(way, axis=-1) > LOOK)
        heading = float(ground.heading(way[leading[0]])) if len(leading) else 0.0
    walker = Walker(
        database,
        first,
        heading,
        subject=subject,
        gains=gains,
        frame_rate=frame_rate,
        size=size or "neutral",
        style=style,
    )
    rate = walker.frame_rate
    times = stream.times[0] + np.arange(int((stream.times[-1] - stream.times[0]) * rate + 1e-6) + 1) / rate
    points, wanted = stream.at(times)
    poses = []
    for i, (point, motion) in enumerate(zip(points, wanted, strict=True)):
        try:
            poses.append(walker.step(point, motion=motion))
        except WishError as error:
            raise WishError(f"at {times[i]:.3f} s: {error}") from None
        if progress is not None and (i % int(rate) == 0 or i + 1 == len(times)):
            progress(i + 1, len(times))
    return journey_of(walker, times, points, poses, subject=subject)


def journey_of(
    walker: Walker, times: Float[Array, "frames"], inputs: Array, poses: Sequence[Pose], *, subject: str | None = None
) -> Journey:
    """Put the poses of a walker together; ``inputs`` are the ground points it was meant to be at."""
    return Journey(
        motion=Motion(
            skeleton=walker.database.skeleton,
            frame_rate=walker.frame_rate,
            root_positions=np.array([p.root_position for p in poses]),
            rotations=quat.continuous(np.array([p.rotations for p in poses])),
            name="walk",
            subject=subject or "",
        ),
        times=times,
        inputs=inputs,
        positions=np.array([p.vehicle.position for p in poses]),
        velocities=np.array([p.vehicle.velocity for p in poses]),
        accelerations=np.array([p.vehicle.acceleration for p in poses]),
        headings=np.array([p.vehicle.heading for p in poses]),
        planted=np.array([p.planted for p in poses]),
        motions=tuple(str(p.motion) for p in poses),
        groups=tuple(str(p.group) for p in poses),
        clamped=tuple(p.clamped for p in poses),  # type: ignore[misc]
        made_up=walker.made_up,
    )


def stream_along(
    curve: Float[Array, "points 2"], speed: float, *, motion: str = "walk", rate: float = 30.0, pause: float = 1.0
) -> PointStream:
    """A point that runs along a curve at an even speed and rests at both ends (KS07: a curve becomes a point stream).

    Parameters
    ----------
    curve
        Ground points, joined by straight lines, metres.
    speed
        m/s.
    motion
        Motion asked for all the way.
    rate
        Samples a second.
    pause
        How long it rests at each end, seconds.

    Raises
    ------
    WishError
        Fewer than two different points, a speed that is not positive.
    """
    if not (np.isfinite(speed) and speed > 0):
        raise WishError(f"the speed along a curve must be positive, not {speed}")
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=-1)
    travelled = np.concatenate(([0.0], np.cumsum(steps)))
    if not (np.isfinite(travelled[-1]) and travelled[-1] > 0):
        raise WishError("a curve needs at least two different points")
    length = travelled[-1]
    times = np.arange(int((length / speed + 2 * pause) * rate) + 2) / rate
    way = np.clip((times - pause) * speed, 0, length)
    points = np.stack([np.interp(way, travelled, curve[:, axis]) for axis in (0, 1)], axis=-1)
    return PointStream(times=times, points=points, motions=(motion,) * len(times))
