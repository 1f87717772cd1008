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
