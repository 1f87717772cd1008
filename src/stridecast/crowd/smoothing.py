"""What a tracked point says about where a person steers: noise, sway of the steps and swaying on the spot taken out."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.linalg import solveh_banded
from scipy.ndimage import gaussian_filter1d, label, maximum_filter1d, uniform_filter1d

from stridecast.geometry import ground

Array = np.ndarray

GRID = 30.0
"""Curves are fitted at so many places a second."""

JERK, ACCELERATION, MEMORY = 4.0, 3.0, 0.2
"""Usual jerk (m/s3) and acceleration (m/s2) of people, and for how long they last (s)."""

QUIETEST, LOUDEST, UNTOLD = 3e-4, 0.1, 0.02
"""Least and greatest noise that is believed, and that of tracks too short to tell, metres."""

SWAYING = (0.6, 1.3)
"""Frequencies of strides, Hz: the body sways once and surges twice in each."""

WINDOW, EXPLAINED, WIDEST = 4.0, 0.8, 0.08
"""Sway is looked for so long (s), must explain so much of what is left across, and is no wider than this (m)."""

STEERED = 0.35
"""What is slower than this is steering, Hz."""

STRIDING = 0.4
"""Nobody strides at a lower speed, m/s."""

SPOT, PAUSE = 0.1, 1.2
"""Who stays within this distance (m) for so long (s) stands."""


def noise_of(times: Float[Array, "samples"], points: Float[Array, "samples 2"]) -> float:
    """Noise of a tracker, metres: third differences of what people do are small, those of noise are not."""
    if len(times) < 8:
        return UNTOLD
    step = float(np.median(np.diff(times)))
    # neighbours that are a step apart only: a gap is no noise
    even = np.abs(np.diff(times) - step) < 0.3 * step
    whole = even[:-2] & even[1:-1] & even[2:]
    change = np.diff(points, 3, axis=0)[whole]
    if len(change) < 4:
        return UNTOLD
    # the median length of two normal numbers, and what third differences make of noise
    spread = float(np.median(np.hypot(*change.T))) / 1.1774 / np.sqrt(20.0)
    return float(np.clip(spread, QUIETEST, LOUDEST))


class Smoother:
    """The curve through samples whose jerk is least, as far as the noise allows (Whittaker; Eilers 2003).

    Parameters
    ----------
    times
        Of the samples, seconds from 0.
    points
        The samples.
    noise
        Their noise, metres.
    """

    def __init__(self, times: Float[Array, "samples"], points: Float[Array, "samples 2"], noise: float) -> None:
        self.count = max(int(np.ceil(times[-1] * GRID - 1e-9)) + 1, 4)
        place = times * GRID
        first = np.clip(np.floor(place).astype(np.int64) - 1, 0, self.count - 4)
        u = place - first
        # cubic through four places of the grid
        shares = np.stack(
            (
                -(u - 1) * (u - 2) * (u - 3) / 6,
                u * (u - 2) * (u - 3) / 2,
                -u * (u - 1) * (u - 3) / 2,
                u * (u - 1) * (u - 2) / 6,
            ),
            axis=-1,
        )
        self.times, self.first, self.shares = times, first, shares
        self.stiffness = noise**2 / (MEMORY * GRID)
        self.data = np.zeros((4, self.count))
        for i in range(4):
            for j in range(i, 4):
                np.add.at(self.data[3 - (j - i)], first + j, shares[:, i] * shares[:, j])
        self.origin = points.mean(axis=0)
        self.right = np.zeros((self.count, 2))
        for i in range(4):
            np.add.at(self.right, first + i, shares[:, i, None] * (points - self.origin))

    def curve(self, stiffer: Float[Array, "grid"] | None = None) -> Float[Array, "grid 2"]:
        """The curve at the places of the grid; ``stiffer`` multiplies the penalty on jerk there."""
        factor = np.ones(self.count) if stiffer is None else stiffer
        bands = self.data.copy()
        _penalise(bands, 3, self.stiffness * GRID**6 / JERK**2 * factor)
        _penalise(bands, 2, self.stiffness * GRID**4 / ACCELERATION**2 * np.ones(self.count))
        _penalise(bands, 1, 1e-9 * np.ones(self.count))
        bands[3] += 1e-12
        return solveh_banded(bands, self.right, check_finite=False) + self.origin

    def at_samples(self, curve: Float[Array, "grid 2"]) -> Float[Array, "samples 2"]:
        """Values of a curve at the samples."""
        return np.einsum("sk,skc->sc", self.shares, curve[self.first[:, None] + np.arange(4)])


def _penalise(bands: Float[Array, "4 grid"], order: int, weights: Float[Array, "grid"]) -> None:
    """Add the squares of differences to the bands of a symmetric matrix (upper form, diagonal last)."""
    stencil = np.array({1: (-1, 1), 2: (1, -2, 1), 3: (-1, 3, -3, 1)}[order], np.float64)
    rows = bands.shape[1] - order
    own = weights[order // 2 : order // 2 + rows]
    for i in range(order + 1):
        for j in range(i, order + 1):
            bands[3 - (j - i), j : j + rows] += own * stencil[i] * stencil[j]


def without_sway(curve: Float[Array, "grid 2"]) -> Float[Array, "grid 2"]:
    """A curve without the sway and surge of strides, where there is any; turns are no sway, as they do not recur.

    In windows of a few seconds the sine that explains most of what is left across the way steered is looked for; with
    its frequency, what recurs twice as often along the way.
    """
    window = min(int(WINDOW * GRID), len(curve)) // 2 * 2
    if window < 2.5 * GRID:
        return curve
    slow = gaussian_filter1d(curve, GRID / (2 * np.pi * STEERED), axis=0, mode="nearest")
    slow = _straightened(curve, slow)
    velocity = np.gradient(slow, 1.0 / GRID, axis=0)
    speed = np.hypot(*velocity.T)
    ahead = velocity / np.maximum(speed, 1e-9)[:, None]
    left = ground.left_of(ahead)
    rest = curve - slow
    across, along = np.sum(rest * left, axis=-1), np.sum(rest * ahead, axis=-1)
    hop = window // 4
    starts = np.unique(np.append(np.arange(0, len(curve) - window, hop), len(curve) - window))
    rows = starts[:, None] + np.arange(window)
    bell = np.hanning(window + 2)[1:-1]
    moving = np.median(speed[rows], axis=1) > STRIDING
    clock = (np.arange(window) - window / 2) / GRID
    best = np.zeros(len(starts))
    sway, surge = np.zeros((2, len(starts), window))
    for frequency in np.linspace(*SWAYING, 25):
        fit, share = _recurring(across[rows], clock, frequency, bell)
        better = moving & (share > np.maximum(best, EXPLAINED)) & (np.abs(fit).max(axis=1) < WIDEST)
        best[better] = share[better]
        sway[better] = fit[better]
        twice, _ = _recurring(along[rows[better]], clock, 2 * frequency, bell)
        surge[better] = twice
    weight, off_across, off_along = np.zeros((3, len(curve)))
    for k, row in enumerate(rows):
        weight[row] += bell
        off_across[row] += bell * sway[k]
        off_along[row] += bell * surge[k]
    off = (off_across[:, None] * left + off_along[:, None] * ahead) / np.maximum(weight, 1e-9)[:, None]
    return curve - off


def _straightened(curve: Float[Array, "grid 2"], slow: Float[Array, "grid 2"]) -> Float[Array, "grid 2"]:
    """The slow part once more from what it left out, so that turns and speeds lose less in it."""
    return slow + gaussian_filter1d(curve - slow, GRID / (2 * np.pi * STEERED), axis=0, mode="nearest")


def _recurring(
    values: Float[Array, "windows places"],
    clock: Float[Array, "places"],
    frequency: float,
    bell: Float[Array, "places"],
) -> tuple[Float[Array, "windows places"], Float[Array, "windows"]]:
    """The sine of a frequency nearest to each window, and how much of the window it explains."""
    angle = 2 * np.pi * frequency * clock
    basis = np.stack((np.cos(angle), np.sin(angle), np.ones_like(clock), clock), axis=-1)
    root = np.sqrt(bell)[:, None]
    solve = np.linalg.pinv(root * basis) * root.T
    found = values @ solve.T
    sine = found[:, :2] @ basis[:, :2].T
    level = found[:, 2:] @ basis[:, 2:].T
    before = np.sum(bell * (values - level) ** 2, axis=1)
    after = np.sum(bell * (values - level - sine) ** 2, axis=1)
    return sine, 1.0 - after / np.maximum(before, 1e-12)


def standing_places(curve: Float[Array, "grid 2"]) -> tuple[Bool[Array, "grid"], Float[Array, "grid 2"]]:
    """Where somebody stands, and the curve with one place for each stand.

    A stand is left when it is left by more than ``SPOT``: who shifts about on the spot does not walk.
    """
    wide = min(int(PAUSE * GRID), len(curve)) // 2 * 2 - 1
    middle = curve.mean(axis=0)
    mean = uniform_filter1d(curve - middle, wide, axis=0, mode="nearest")
    square = uniform_filter1d(np.sum((curve - middle) ** 2, axis=-1), wide, mode="nearest")
    spread = np.sqrt(np.maximum(square - np.sum(mean**2, axis=-1), 0.0))
    # the whole window around a quiet moment belongs to the stand
    still = maximum_filter1d((spread < 0.5 * SPOT).astype(np.int8), wide, mode="constant").astype(bool)
    still &= np.hypot(*np.gradient(curve, 1.0 / GRID, axis=0).T) < STRIDING
    out = curve.copy()
    runs, count = label(still)
    for number in range(1, count + 1):
        rows = np.flatnonzero(runs == number)
        for first, last in _spots(curve[rows]):
            out[rows[first:last]] = np.mean(curve[rows[first:last]], axis=0)
    return still, out


def _spots(points: Float[Array, "places 2"]) -> list[tuple[int, int]]:
    """Stretches of points that stay within ``SPOT`` of where they began to, one after the other."""
    pieces: list[tuple[int, int]] = []
    first = 0
    while first < len(points):
        away: Int[Array, "far"] = np.flatnonzero(np.hypot(*(points[first:] - points[first]).T) > 1.5 * SPOT)
        last = first + int(away[0]) if len(away) else len(points)
        pieces.append((first, last))
        first = last
    return pieces
