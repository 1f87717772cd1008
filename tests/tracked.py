"""Crowds of plain numbers."""

from __future__ import annotations

import numpy as np

from stridecast.model.trajectories import Trajectories

RATE = 30.0


def crowd(*ways: np.ndarray, rate: float = RATE, starts: tuple[float, ...] = (), ids=None) -> Trajectories:
    """Everybody's places ``(frames, 2)`` at a rate, some of whom begin later (seconds)."""
    ids = list(range(len(ways))) if ids is None else ids
    begins = [*starts, *[0.0] * (len(ways) - len(starts))]
    order = np.argsort(ids)
    return Trajectories(
        ids=np.concatenate([np.full(len(ways[k]), ids[k]) for k in order]),
        times=np.concatenate([begins[k] + np.arange(len(ways[k])) / rate for k in order]),
        positions=np.concatenate([ways[k] for k in order]),
    )


def straight(start, velocity, seconds: float, rate: float = RATE) -> np.ndarray:
    """Even movement."""
    t = np.arange(round(seconds * rate) + 1)[:, None] / rate
    return np.asarray(start, float) + t * np.asarray(velocity, float)


def still(place, seconds: float, rate: float = RATE) -> np.ndarray:
    return straight(place, (0.0, 0.0), seconds, rate)


def wandering(rng: np.random.Generator, people: int, seconds: float, size: float, rate: float = RATE) -> Trajectories:
    """People who sway about straight ways."""
    t = np.arange(round(seconds * rate) + 1)[:, None] / rate
    ways = []
    for _ in range(people):
        even = rng.uniform(0, size, 2) + t * rng.normal(0, 0.8, 2)
        ways.append(even + 0.3 * np.sin(t * rng.uniform(0.5, 3, 2) + rng.uniform(0, 6, 2)))
    return crowd(*ways)
