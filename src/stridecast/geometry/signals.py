"""Signals in time: smoothing, two-threshold switches, runs of equal values."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Shaped
from scipy.signal import butter, sosfiltfilt

Array = np.ndarray


class Run(NamedTuple):
    """A stretch of equal values: frames ``start`` to ``stop`` (exclusive)."""

    value: object
    start: int
    stop: int


def lowpass(signal: Float[Array, "frames *shape"], rate: float, cutoff: float) -> Float[Array, "frames *shape"]:
    """Zero-phase Butterworth low-pass of second order; signals too short or slow to filter come back as they are."""
    if cutoff >= 0.45 * rate or len(signal) < 8:
        return signal
    sections = butter(2, cutoff, fs=rate, output="sos")
    pad = min(len(signal) - 1, int(rate / cutoff))
    return sosfiltfilt(sections, signal, axis=0, padlen=pad)


def rate_of_change(signal: Float[Array, "frames *shape"], rate: float) -> Float[Array, "frames *shape"]:
    """Derivative by central differences, per second; zero for a single frame."""
    return np.gradient(signal, 1.0 / rate, axis=0) if len(signal) > 1 else np.zeros_like(signal)


def runs(values: Shaped[Array, "frames"]) -> list[Run]:
    """Stretches of equal values, in order."""
    edges = np.flatnonzero(values[1:] != values[:-1]) + 1
    starts = np.concatenate(([0], edges))
    stops = np.concatenate((edges, [len(values)]))
    return [Run(values[a].item(), int(a), int(b)) for a, b in zip(starts, stops, strict=True)]


def switch(on: Bool[Array, "frames"], stay: Bool[Array, "frames"]) -> Bool[Array, "frames"]:
    """A two-threshold switch: every stretch of ``stay`` that somewhere holds ``on``."""
    out = np.zeros(len(on), bool)
    for value, start, stop in runs(stay | on):
        if value and on[start:stop].any():
            out[start:stop] = True
    return out


def close_gaps(values: Bool[Array, "frames"], shortest_gap: int, shortest_run: int) -> Bool[Array, "frames"]:
    """Gaps inside shorter than ``shortest_gap`` frames filled, then runs inside shorter than ``shortest_run`` removed.

    Stretches cut by the ends of the signal stay: how long they really were is not known.
    """
    out = values.copy()
    for gone, least in ((False, shortest_gap), (True, shortest_run)):
        for value, start, stop in runs(out):
            if value == gone and stop - start < least and start > 0 and stop < len(out):
                out[start:stop] = not gone
    return out


def smooth(u: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """0 below 0, 1 above 1, smooth between (the least jerk, Flash and Hogan 1985)."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u * u * u * (10 - 15 * u + 6 * u * u))


def bridge(
    values: Float[Array, "frames channels"], known: Bool[Array, "frames"], fade: float
) -> Float[Array, "frames channels"]:
    """Values where they are known, smoothly from one known stretch to the next between, constant beyond the ends.

    Slopes at the ends of what is known go on and fade within ``fade`` frames. All zero where nothing is known.
    """
    out = np.zeros_like(values)
    if not known.any():
        return out
    out[known] = values[known]
    for value, start, stop in runs(known):
        if value:
            continue
        left, right = start - 1, stop
        if left < 0 or right >= len(known):
            out[start:stop] = out[right if left < 0 else left]
            continue
        span = float(right - left)
        since = np.arange(1.0, span)[:, None]
        share = smooth(since / span)
        reach = min(fade, span / 2)
        before = values[left] - values[left - 1] if left > 0 and known[left - 1] else np.zeros(values.shape[1])
        beyond = right + 1 < len(known) and known[right + 1]
        after = values[right + 1] - values[right] if beyond else np.zeros(values.shape[1])
        out[start:stop] = (1 - share) * values[left] + share * values[right]
        out[start:stop] += before * since * np.maximum(1 - since / reach, 0.0) ** 2
        out[start:stop] -= after * (span - since) * np.maximum(1 - (span - since) / reach, 0.0) ** 2
    return out
