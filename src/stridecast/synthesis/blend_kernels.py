"""Blended features at generic time, the time warp, and seams (BJL 4.2, KS05)."""

from __future__ import annotations

import math

import numpy as np

from stridecast.geometry.kernels import decay, kernel, wrap
from stridecast.model.database import MARGIN
from stridecast.synthesis.state import NEIGHBOURS, State
from stridecast.synthesis.tables import Tables

SIZE_HALF_LIFE = 0.15
"""Half of a change of size is done after about this, seconds."""

SEAM_HALF_LIFE = 0.12
"""Half of the difference at a boundary is gone after this, seconds."""


@kernel
def spline_weights(u: float) -> tuple[float, float, float, float]:
    """Catmull-Rom weights of four neighbouring samples, ``u`` of the way from the second to the third."""
    u2, u3 = u * u, u * u * u
    return (
        0.5 * (-u3 + 2.0 * u2 - u),
        0.5 * (3.0 * u3 - 5.0 * u2 + 2.0),
        0.5 * (-3.0 * u3 + 4.0 * u2 + u),
        0.5 * (u3 - u2),
    )


@kernel
def row_of(generic: float, rows: int) -> tuple[int, float]:
    """Sample at or before a generic time, and how far on from it."""
    at = MARGIN + generic * (rows - 1 - 2 * MARGIN)
    i = min(max(math.floor(at), 1), rows - 3)
    return i, at - i


@kernel
def seconds_per_generic(tables: Tables, state: State, c: int) -> float:
    """Slope of the blended time warp where the character is (incremental time warping, Park et al. 2002)."""
    rows = tables.times.shape[1]
    i, u = row_of(state.generic[c], rows)
    slope = 0.0
    u2 = u * u
    d0, d1 = 0.5 * (-3.0 * u2 + 4.0 * u - 1.0), 0.5 * (9.0 * u2 - 10.0 * u)
    d2, d3 = 0.5 * (-9.0 * u2 + 8.0 * u + 1.0), 0.5 * (3.0 * u2 - 2.0 * u)
    for n in range(NEIGHBOURS):
        w = state.weights[c, n]
        if w > 0.0:
            t = tables.times[state.chosen[c, n]]
            slope += w * (d0 * t[i - 1] + d1 * t[i] + d2 * t[i + 1] + d3 * t[i + 2])
    return max(slope * (rows - 1 - 2 * MARGIN), 0.02)


@kernel
def blended(tables: Tables, state: State, c: int, generic: float, out: np.ndarray) -> None:
    """Weighted sum of the chosen examples' features at a generic time, and of what their size adds."""
    rows = tables.features.shape[1]
    i, u = row_of(generic, rows)
    b = spline_weights(u)
    out[:] = 0.0
    for n in range(NEIGHBOURS):
        w = state.weights[c, n]
        if w > 0.0:
            f = tables.features[state.chosen[c, n]]
            w0, w1, w2, w3 = w * b[0], w * b[1], w * b[2], w * b[3]
            for k in range(len(out)):
                out[k] += w0 * f[i - 1, k] + w1 * f[i, k] + w2 * f[i + 1, k] + w3 * f[i + 2, k]
    if state.size[c, 0] != 0.0:
        enlarge(tables.larger, state.chosen[c], state.weights[c], state.size[c, 0], i, b, out)
    scale = state.scale[c]
    if scale != 1.0:
        for k in range(len(out)):
            out[k] = state.stance[c, k] + scale * (out[k] - state.stance[c, k])


@kernel
def enlarge(larger, chosen, weights, size, i, b, out):  # type: ignore[no-untyped-def]
    """Add what a size adds to the chosen examples; single arrays, as handing over all tables would cost more."""
    for n in range(NEIGHBOURS):
        w = weights[n] * size
        if w != 0.0:
            more = larger[chosen[n]]
            w0, w1, w2, w3 = w * b[0], w * b[1], w * b[2], w * b[3]
            for k in range(len(out)):
                out[k] += w0 * more[i - 1, k] + w1 * more[i, k] + w2 * more[i + 1, k] + w3 * more[i + 2, k]


@kernel
def change_size(size, fresh, dt):  # type: ignore[no-untyped-def]
    """Let a size of movement come nearer to the one wanted, smoothly; somebody nobody has seen has it at once."""
    gap, rate = decay(size[0] - size[2], size[1], SIZE_HALF_LIFE, dt)
    if fresh or (abs(gap) < 1e-4 and abs(rate) < 1e-3):
        gap, rate = 0.0, 0.0
    size[0], size[1] = size[2] + gap, rate


@kernel
def open_seam(tables: Tables, state: State, c: int, meant: np.ndarray, dt: float) -> None:
    """Take down by how much a new segment differs from where the last frames were heading (inertialization)."""
    ahead = state.ahead[c]
    du = dt / seconds_per_generic(tables, state, c)
    blended(tables, state, c, state.generic[c] + du, ahead)
    yaw = len(meant) - 1
    turns = 2.0 * math.pi * round((state.features[c, yaw] - meant[yaw]) / (2.0 * math.pi))
    state.features[c, yaw] -= turns
    state.before[c, yaw] -= turns
    for k in range(len(meant)):
        rate = (state.features[c, k] - state.before[c, k]) / state.elapsed[c]
        state.seam[c, k] = state.features[c, k] + rate * dt - meant[k]
        state.seam_rate[c, k] = rate - (ahead[k] - meant[k]) / dt


@kernel
def show_features(state: State, c: int, meant: np.ndarray) -> None:
    """Features of this frame: the blend plus what is left of the seam."""
    for k in range(len(meant)):
        state.before[c, k] = state.features[c, k]
        state.features[c, k] = meant[k] + state.seam[c, k]
    yaw = len(meant) - 1
    if abs(state.features[c, yaw]) > math.pi:
        inside = wrap(state.features[c, yaw])
        state.before[c, yaw] += inside - state.features[c, yaw]
        state.features[c, yaw] = inside
    if state.fresh[c]:  # nobody knows where the first pose comes from: it is at rest
        for k in range(len(meant)):
            state.before[c, k] = state.features[c, k]


@kernel
def close_seam(state: State, c: int, dt: float) -> None:
    """Let the seam fade by one frame."""
    # As ``decay`` of each feature, its exponential worked out once.
    seam, rate = state.seam[c], state.seam_rate[c]
    y = 2.0 * math.log(2.0) / SEAM_HALF_LIFE
    e = math.exp(-y * dt)
    for k in range(len(seam)):
        j = rate[k] + seam[k] * y
        seam[k], rate[k] = e * (seam[k] + j * dt), e * (rate[k] - j * y * dt)
