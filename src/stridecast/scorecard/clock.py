"""The common clock of trajectories, and what differences along it tell: velocity, acceleration, jerk."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import CubicSpline

from stridecast.errors import InputError
from stridecast.model.trajectories import Trajectories

Array = np.ndarray

SAME_MOMENT = 1e-4
"""Times that differ by less are one moment, seconds."""

UNSTEADY = 0.3
"""Times may be so far off the clock, as a share of its step: files round them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tracks:
    """Trajectories on a clock with a steady step.

    Parameters
    ----------
    trajectories
        Whose rows they are.
    step
        Seconds from frame to frame.
    start
        Time of frame 0, seconds.
    frames
        Frame of each row.
    """

    trajectories: Trajectories
    step: float
    start: float
    frames: Int[Array, "rows"]

    @cached_property
    def owners(self) -> Int[Array, "rows"]:
        """Index of each row's person among ``trajectories.people``."""
        return np.searchsorted(self.trajectories.people, self.trajectories.ids)

    @cached_property
    def by_frame(self) -> tuple[Int[Array, "rows"], Int[Array, "edges"]]:
        """Rows in order of frames, and where each frame begins among them, with one edge beyond the last."""
        order = np.argsort(self.frames, kind="stable")
        edges = np.searchsorted(self.frames[order], np.arange(self.frames.max(initial=-1) + 2))
        return order, edges

    @cached_property
    def velocities(self) -> Float[Array, "rows 2"]:
        """From each row to the same person's next frame, m/s; not a number where that is missing."""
        follows = (np.diff(self.trajectories.ids) == 0) & (np.diff(self.frames) == 1)
        return self._differences(self.trajectories.positions, follows)

    @cached_property
    def accelerations(self) -> Float[Array, "rows 2"]:
        """From the velocity at each row to the next one, m/s2: what an explicit step took from row to row."""
        return self._differences(self.velocities)

    @cached_property
    def jerks(self) -> Float[Array, "rows 2"]:
        """From the acceleration at each row to the next one, m/s3."""
        return self._differences(self.accelerations)

    def times(self, frames: Int[Array, "*shape"]) -> Float[Array, "*shape"]:
        """When frames are, seconds."""
        return self.start + self.step * frames

    def _differences(self, values: Array, follows: Array | None = None) -> Array:
        # the last row of a person has no velocity, so nothing is carried from one person to the next
        out = np.full(values.shape, np.nan)
        out[:-1] = np.diff(values, axis=0) / self.step
        if follows is not None:
            out[:-1][~follows] = np.nan
        return out


def tracks(trajectories: Trajectories, frame_rate: float | None = None) -> Tracks:
    """Put trajectories on their common clock, or on one of another rate.

    Parameters
    ----------
    trajectories
        All people sampled at the same moments, some of which may be missing.
    frame_rate
        If given, everybody is sampled anew at this rate, Hz, by a cubic spline (straight from two samples).

    Raises
    ------
    InputError
        Nobody has two rows; times that fit no steady clock; a frame rate that is not positive.
    """
    if frame_rate is not None:
        trajectories = resampled(trajectories, frame_rate)
    name = f"{trajectories.name}: " if trajectories.name else ""
    moments = np.sort(trajectories.times)
    moments = moments[np.concatenate(([True], np.diff(moments) > SAME_MOMENT))] if len(moments) else moments
    own = np.diff(trajectories.times)[np.diff(trajectories.ids) == 0]
    if not len(own):
        raise InputError(f"{name}nobody is there at two moments, so nobody can be seen to move")
    gaps = np.diff(moments)
    step = float(own[own < 1.5 * np.median(own)].mean())
    last = int(np.rint(gaps / step).sum())
    step = float(moments[-1] - moments[0]) / max(last, 1)
    start = float(moments[0])
    frames = np.rint((trajectories.times - start) / step).astype(np.int64)
    off = np.abs(trajectories.times - start - step * frames)
    twice = (np.diff(trajectories.ids) == 0) & (np.diff(frames) == 0)
    if off.max() > UNSTEADY * step or twice.any():
        row = int(np.argmax(off)) if off.max() > UNSTEADY * step else int(np.flatnonzero(twice)[0]) + 1
        raise InputError(
            f"{name}person {int(trajectories.ids[row])} at {trajectories.times[row]:g} s is off the common clock of "
            f"{1 / step:.4g} Hz; name a frame rate to sample everybody anew"
        )
    return Tracks(trajectories=trajectories, step=step, start=start, frames=frames)


def resampled(trajectories: Trajectories, frame_rate: float) -> Trajectories:
    """Everybody sampled anew at a steady rate, by a cubic spline through their positions.

    Raises
    ------
    InputError
        A frame rate that is not positive.
    """
    if not (np.isfinite(frame_rate) and frame_rate > 0):
        raise InputError(f"the frame rate must be above 0 Hz, not {frame_rate}")
    ids, times, positions = [], [], []
    for person, rows in trajectories.each():
        own, places = trajectories.times[rows], trajectories.positions[rows]
        first = int(np.ceil(own[0] * frame_rate - 1e-6))
        moments = np.arange(first, int(np.floor(own[-1] * frame_rate + 1e-6)) + 1) / frame_rate
        within = np.clip(moments, own[0], own[-1])
        if len(own) > 2:
            places = CubicSpline(own, places)(within)
        else:
            places = np.stack([np.interp(within, own, places[:, axis]) for axis in (0, 1)], axis=-1)
        ids.append(np.full(len(moments), person))
        times.append(moments)
        positions.append(places)
    return Trajectories(
        ids=np.concatenate(ids) if ids else np.zeros(0, np.int64),
        times=np.concatenate(times) if times else np.zeros(0),
        positions=np.concatenate(positions) if positions else np.zeros((0, 2)),
        name=trajectories.name,
    )
