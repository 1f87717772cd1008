"""The vehicle trajectory of a take: where the person steers, once sway and surge of the steps are taken out (KS07).

KS07 draws a spline through the pelvis at the mid-stances of the left foot, another for the right, and takes their mean.
That covers a take from its second to its last but one step, which leaves little of a recording of two seconds. So a
smooth vehicle and a phase-periodic detail are first fitted together to the whole take; the L- and R-trajectories are
that fit seen from each foot's mid-stance, corrected so that they run exactly through the pelvis there. Their mean is
the vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import BSpline
from scipy.sparse import csc_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from stridecast.errors import TakeError
from stridecast.geometry import ground, signals
from stridecast.model.contacts import LEFT, RIGHT
from stridecast.model.segment import MidStance
from stridecast.model.vehicle import VehicleTrajectory

Array = np.ndarray

CUTOFF = 0.9
"""What is slower than this many times the stride frequency is steering, what is faster is detail of the steps."""

DEGREE = 5
"""Degree of the vehicle's spline: its third derivative is still smooth."""

SETTLE = 0.35
"""Sway and surge fade in and out within this time beside standing, seconds."""

HEADING_SPEED = 0.25
"""Below this speed the direction of motion is noise and the heading is kept, m/s."""

STILLNESS = 0.3
"""Weight of standing still against lying on the pelvis, seconds: the vehicle rests while the pelvis sways."""

USUAL_STRIDE = 1.1
"""Where nobody strides twice, that is what a stride would take, seconds."""

LONGEST_STRIDE = 3.2
"""Nobody strides slower, seconds."""


def fit_vehicle(
    pelvis: Float[Array, "frames 2"],
    mid_stances: tuple[MidStance, ...],
    standing: Bool[Array, "frames"],
    rate: float,
) -> VehicleTrajectory:
    """Vehicle trajectory of a whole take.

    Parameters
    ----------
    pelvis
        Ground projection of the pelvis, metres.
    mid_stances
        Middle frames of the support phases of each foot.
    standing
        Frames at which the person stands still.
    rate
        Frames a second.

    Raises
    ------
    TakeError
        Too short, or not a single step in it and no standing either.
    """
    frames = len(pelvis)
    if frames < 0.3 * rate:
        raise TakeError(f"only {frames / rate:.2f} s long; 0.3 s are the least a vehicle can be found in")
    stride = _stride_time(mid_stances, standing, rate)
    phase = _phase(mid_stances, frames, stride * rate)
    share = _moving_share(standing, rate)
    basis = _SplineBasis.over(frames, rate, stride)
    detail = _detail_basis(phase) * share[:, None, None]

    # The detail lies in the vehicle's frame, which the fit itself finds: start from the smoothed path, three rounds do.
    headings = _headings(signals.rate_of_change(signals.lowpass(pelvis, rate, 0.7 / stride), rate))
    for _ in range(3):
        smooth, amplitudes = _fit(basis, detail, headings, pelvis, standing)
        headings = _headings(basis.velocity @ smooth)

    curves = [basis.values(smooth) for _ in (LEFT, RIGHT)]
    offsets = [ground.turn((_detail_basis(np.array([angle])) @ amplitudes)[0], headings) for angle in (0.0, np.pi)]
    for side in (LEFT, RIGHT):
        seen = curves[side][0] + offsets[side] * share[:, None]
        for order, extra in enumerate(_through_knots(seen, pelvis, mid_stances, side, standing, rate, stride)):
            curves[side][order] = curves[side][order] + extra
    mean = [(a + b) / 2 for a, b in zip(*curves, strict=True)]
    return VehicleTrajectory(
        positions=mean[0],
        velocities=mean[1],
        accelerations=mean[2],
        jerks=mean[3],
        headings=_headings(mean[1]),
        left=curves[LEFT][0] + offsets[LEFT] * share[:, None],
        right=curves[RIGHT][0] + offsets[RIGHT] * share[:, None],
    )


@dataclass(frozen=True, kw_only=True)
class _SplineBasis:
    """Sparse design matrices of a spline and its derivatives at the frames of a take, and the penalty on its jerk."""

    position: csr_array
    velocity: csr_array
    acceleration: csr_array
    jerk: csr_array
    penalty: csr_array

    @classmethod
    def over(cls, frames: int, rate: float, stride: float) -> _SplineBasis:
        end = (frames - 1) / rate
        pieces = max(2, round(end / (0.2 * stride)))
        knots = np.concatenate((np.zeros(DEGREE), np.linspace(0, end, pieces + 1), np.full(DEGREE, end)))
        times = np.arange(frames) / rate
        orders = [BSpline.design_matrix(times, knots, DEGREE)]
        differences: Any = eye_array(len(knots) - DEGREE - 1)
        for order in range(1, 4):
            # The derivative of a spline is one of a degree less; its coefficients are scaled differences.
            degree = DEGREE - order + 1
            span = knots[degree + 1 : -1] - knots[1 : -degree - 1]
            step = diags_array([-degree / span, degree / span], offsets=[0, 1], shape=(len(span), len(span) + 1))
            differences = step @ differences
            knots = knots[1:-1]
            orders.append(BSpline.design_matrix(times, knots, degree - 1) @ differences)
        weight = (2 * np.pi * CUTOFF / stride) ** -3.0
        position, velocity, acceleration, jerk = (csr_array(m) for m in orders)
        return cls(position=position, velocity=velocity, acceleration=acceleration, jerk=jerk, penalty=weight * jerk)

    def values(self, coefficients: Float[Array, "coefficients 2"]) -> list[Float[Array, "frames 2"]]:
        """Place and first three derivatives at every frame."""
        return [m @ coefficients for m in (self.position, self.velocity, self.acceleration, self.jerk)]


def _stride_time(mid_stances: tuple[MidStance, ...], standing: Bool[Array, "frames"], rate: float) -> float:
    """Seconds from a mid-stance to the next of the same foot, median; twice the step where each foot has but one."""
    steps = []
    for before, after in pairwise(mid_stances):
        if standing[int(before.frame) : int(after.frame) + 1].any():
            continue
        steps.append((after.frame - before.frame) / rate * (2 if before.side != after.side else 1))
    steps = [s for s in steps if s < LONGEST_STRIDE]
    if steps:
        return float(np.median(steps))
    if standing.any():  # a start or a stop, with no room for more
        return USUAL_STRIDE
    raise TakeError("no two steps follow each other in it, so its rhythm cannot be found")


def _phase(mid_stances: tuple[MidStance, ...], frames: int, stride: float) -> Float[Array, "frames"]:
    """Gait phase: a multiple of 2 pi at left mid-stance, pi more at right; evenly on beyond the ends."""
    at: list[float] = []
    angle: list[float] = []
    for m in mid_stances:
        own = np.pi if m.side == RIGHT else 0.0
        if not angle:
            value = own
        else:
            # Roughly as many turns as time has passed, and the foot says which half.
            guess = angle[-1] + 2 * np.pi * (m.frame - at[-1]) / stride
            value = own + 2 * np.pi * round((guess - own) / (2 * np.pi))
            value = max(value, angle[-1] + np.pi)
        at.append(m.frame)
        angle.append(value)
    if not at:
        return 2 * np.pi * np.arange(frames) / stride
    at = [at[0] - frames, *at, at[-1] + frames]
    turn = 2 * np.pi * frames / stride
    angle = [angle[0] - turn, *angle, angle[-1] + turn]
    return np.interp(np.arange(frames), at, angle)


def _moving_share(standing: Bool[Array, "frames"], rate: float) -> Float[Array, "frames"]:
    """0 while standing, 1 while moving, smooth between."""
    if not standing.any():
        return np.ones(len(standing))
    at = np.flatnonzero(standing)
    frames = np.arange(len(standing))
    after = np.searchsorted(at, frames)
    distance = np.minimum(
        np.abs(frames - at[np.minimum(after, len(at) - 1)]), np.abs(frames - at[np.maximum(after - 1, 0)])
    )
    u = np.clip(distance / (SETTLE * rate), 0, 1)
    return u * u * (3 - 2 * u)


def _detail_basis(phase: Float[Array, "frames"]) -> Float[Array, "frames 2 terms"]:
    """Sway (left) in odd harmonics of the stride, surge (forward) in even ones: a step is half a stride, mirrored."""
    sway = [f(n * phase) for n in (1, 3) for f in (np.cos, np.sin)]
    surge = [wave for n in (2, 4) for wave in (np.cos(n * phase) - 1.0, np.sin(n * phase))]  # none at mid-stance
    out = np.zeros((len(phase), 2, 8))
    out[:, 0, :4] = np.stack(sway, axis=-1)
    out[:, 1, 4:] = np.stack(surge, axis=-1)
    return out


def _fit(
    basis: _SplineBasis,
    detail: Float[Array, "frames 2 terms"],
    headings: Float[Array, "frames"],
    pelvis: Float[Array, "frames 2"],
    standing: Bool[Array, "frames"],
) -> tuple[Float[Array, "coefficients 2"], Float[Array, "terms"]]:
    """Spline coefficients and detail amplitudes that explain the pelvis best: little jerk, still while standing."""
    terms = detail.shape[-1]
    turned = ground.turn(np.moveaxis(detail, 1, 2), headings[:, None])
    still = STILLNESS * basis.velocity[np.flatnonzero(standing)]
    # Normal equations: the spline's part is the same narrow band for x and z, joined by the few detail amplitudes.
    band = basis.position.T @ basis.position + basis.penalty.T @ basis.penalty + still.T @ still
    cross = [basis.position.T @ turned[..., axis] for axis in (0, 1)]
    # A whisper against large amplitudes: half a stride must not trade sway for steering.
    own = sum(turned[..., axis].T @ turned[..., axis] for axis in (0, 1)) + 0.0025 * len(pelvis) * np.eye(terms)
    solver = splu(csc_array(band))
    reduced = [solver.solve(c) for c in cross]
    free = [solver.solve(basis.position.T @ pelvis[:, axis]) for axis in (0, 1)]
    amplitudes = np.linalg.solve(
        own - sum(c.T @ r for c, r in zip(cross, reduced, strict=True)),
        sum(turned[..., axis].T @ pelvis[:, axis] - cross[axis].T @ free[axis] for axis in (0, 1)),
    )
    smooth = np.stack([f - r @ amplitudes for f, r in zip(free, reduced, strict=True)], axis=-1)
    return smooth, amplitudes


def _headings(velocities: Float[Array, "frames 2"]) -> Float[Array, "frames"]:
    """Direction of motion; where it is slow, that of the nearest frame that is not."""
    speeds = np.linalg.norm(velocities, axis=-1)
    moving = np.flatnonzero(speeds > min(HEADING_SPEED, 0.5 * float(speeds.max())))
    if len(moving) == 0:
        return np.zeros(len(velocities))
    angles = np.unwrap(ground.heading(velocities[moving]))
    return np.interp(np.arange(len(velocities)), moving, angles)


def _through_knots(
    curve: Float[Array, "frames 2"],
    pelvis: Float[Array, "frames 2"],
    mid_stances: tuple[MidStance, ...],
    side: int,
    standing: Bool[Array, "frames"],
    rate: float,
    stride: float,
) -> list[Float[Array, "frames 2"]]:
    """What must be added to a curve (and its derivatives) so that it runs through the pelvis at the foot's mid-stances.

    Both curves share knots at the ends of standing (KS07). Between knots and beyond them the correction is a sum of
    Gaussians a stride wide, so nothing is bent where nothing is known.
    """
    frames = len(curve)
    knots = [m.frame for m in mid_stances if m.side == side]
    shared = [float(r.start if end else r.stop - 1) for r in signals.runs(standing) if r.value for end in (0, 1)]
    for knot in shared:
        if all(abs(knot - k) > 0.3 * stride * rate for k in knots):
            knots.append(knot)
    if not knots:
        return [np.zeros((frames, 2))] * 4
    at = np.array(knots)
    grid = np.arange(frames)
    missing = np.stack([np.interp(at, grid, (pelvis - curve)[:, axis]) for axis in (0, 1)], axis=-1)
    width = 0.6 * stride
    between = (at[:, None] - at) / rate / width
    weights = np.linalg.solve(np.exp(-0.5 * between**2) + 1e-9 * np.eye(len(at)), missing)
    u = (grid[:, None] - at) / rate / width
    bell = np.exp(-0.5 * u**2)
    orders = [bell, -u * bell / width, (u**2 - 1) * bell / width**2, (3 * u - u**3) * bell / width**3]
    return [m @ weights for m in orders]
