"""Where a take repeats itself, by the likeness of postures (BJL eq. 4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d

from stridecast.geometry import signals
from stridecast.model.contacts import RIGHT, Contacts
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

RATE = 30.0
"""Postures are compared at about so many frames a second."""

SHORTEST, LONGEST = 0.4, 2.6
"""No cycle is shorter or longer than this, seconds."""

REPEATED = 0.3
"""Postures repeat where they differ by less than this share of what they differ by at other times."""

NEARLY_AS_GOOD = 3.0
"""Of several lengths, nearly as good as the best, the first is the cycle: twice a cycle repeats as well."""

ALIKE = 0.03
"""Postures that differ by less than this share of what they differ by at other times are as good as the same."""

ODD = 0.3
"""Sections whose length is off the usual one by more than this share are accidents."""

BLUR = 0.1
"""Postures are compared with what is so far before and after them, seconds: passing one another is no likeness."""


class Cycle(NamedTuple):
    """The section that repeats best: its length and where it begins, seconds, and how many such sections there are.

    It begins at a right toe-off, where generic time does.
    """

    seconds: float
    start: float
    number: int


def joint_weights(skeleton: Skeleton) -> Float[Array, "joints"]:
    """How much each joint counts in a posture (delta of BJL eq. 4): limbs and trunk fully, the rest hardly; sum 1.

    The root counts nothing: which way somebody faces is no part of a posture.
    """
    counted = {joint for role, joint in skeleton.roles.items() if not role.endswith(("hand", "toe"))}
    weights = np.array([0.0] + [1.0 if joint in counted else 0.05 for joint in range(1, skeleton.joints)])
    return weights / max(weights.sum(), 1e-12)


def posture_distance(
    a: Float[Array, "*shape joints 4"], b: Float[Array, "*shape joints 4"], weights: Float[Array, "joints"]
) -> Float[Array, "*shape"]:
    """Sum over the joints of weight times squared angle between two postures, rad2 (BJL eq. 4)."""
    cosines = np.abs(np.einsum("...jk,...jk->...j", a, b))
    return np.asarray((2.0 * np.arccos(np.minimum(cosines, 1.0))) ** 2 @ weights)


def find_cycle(motion: Motion, contacts: Contacts) -> Cycle | None:
    """Find the section of a take after which its postures come again, or nothing where none do.

    From each right toe-off on, it is as long as the time after which the posture is most like it. Standing is left out:
    it repeats at any time.
    """
    moving = _longest(~contacts.standing)
    step = max(1, round(motion.frame_rate / RATE))
    rate = motion.frame_rate / step
    poses = motion.rotations[moving][::step]
    leaves = np.flatnonzero(contacts.planted[:-1, RIGHT] & ~contacts.planted[1:, RIGHT]) + 1
    leaves = leaves[(leaves >= moving.start) & (leaves < moving.stop)]
    weights = joint_weights(motion.skeleton)
    blur = round(BLUR * rate)
    lags = np.arange(1, min(round(LONGEST * rate), len(poses) - 1) + 1)
    if len(lags) < SHORTEST * rate + 3:
        return None
    apart = np.full((len(lags), len(poses)), np.nan)
    for row, lag in enumerate(lags):
        distances = posture_distance(poses[lag:], poses[:-lag], weights)
        apart[row, : len(distances)] = uniform_filter1d(distances, 2 * blur + 1, mode="nearest")
    found = []
    for leaf in leaves:
        profile = apart[:, (int(leaf) - moving.start) // step]
        hit = _first_return(profile[np.isfinite(profile)], rate)
        if hit is not None:
            found.append((hit[1], hit[0], float(leaf) / motion.frame_rate))
    if not found:
        return None
    usual = float(np.median([seconds for _, seconds, _ in found]))
    found = [hit for hit in found if abs(hit[1] / usual - 1.0) < ODD]
    _, seconds, start = min(found, default=(0.0, usual, float(leaves[0]) / motion.frame_rate))
    return Cycle(seconds, start, len(found))


def _first_return(profile: Float[Array, "lags"], rate: float) -> tuple[float, float] | None:
    """Length of the cycle by the distances of a posture from later ones, and how like it the posture there is."""
    least = round(SHORTEST * rate)
    if len(profile) < least + 3:
        return None
    inner = np.flatnonzero((profile[1:-1] <= profile[:-2]) & (profile[1:-1] < profile[2:])) + 1
    inner = inner[(inner + 1 >= least) & (profile[inner] < REPEATED * profile.max())]
    if len(inner) == 0:
        return None
    enough = NEARLY_AS_GOOD * profile[inner].min() + ALIKE * profile.max()
    at = int(inner[np.flatnonzero(profile[inner] <= enough)[0]])
    before, here, after = profile[at - 1 : at + 2]
    return float(at + 1 + 0.5 * (before - after) / max(before - 2 * here + after, 1e-12)) / rate, float(here)


def _longest(values: Bool[Array, "frames"]) -> slice:
    """Longest stretch of frames for which something is true."""
    found = [(run.stop - run.start, run.start, run.stop) for run in signals.runs(values) if run.value]
    _, start, stop = max(found, default=(0, 0, 0), key=lambda run: run[0])
    return slice(start, stop)
