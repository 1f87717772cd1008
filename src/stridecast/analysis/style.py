"""Style of a motion from gloomy to brisk, judged by the body alone (BJL 4.1, "motion style").

BJL presume the style from the standard deviation of joint values. That deviation grows with speed, so it is held
against what others show in the same motion at the same speed; and two more signs that sad and happy walkers differ in
are scored beside it, cadence and stoop (Michalak et al. 2009, "Embodiment of sadness and depression"). The legs are
left out of the deviation: their swing is the length of the step, which cadence and speed tell already.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from stridecast.body import kinematics
from stridecast.geometry import quaternions as quat
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

UPPER_BODY = (
    *("spine", "spine1", "chest", "neck", "head"),
    *(f"{side}_{part}" for side in ("left", "right") for part in ("upper_arm", "forearm")),
)
"""Roles whose joints are looked at; clavicles and hands are seldom captured well."""

SPREAD_SCALE = 0.35
"""People of one mood differ by so much: logarithm of the spread of joint values, ..."""

CADENCE_SCALE = 0.07
"""... logarithm of the cadence, ..."""

STOOP_SCALE = 0.12
"""... and bend of trunk and head, radians."""

STILL = 0.01
"""Spread of somebody who stands quite still, radians: below it nothing is told apart."""

ROUNDS = 12
"""Rounds of reweighting until a trend runs through the middle of its examples."""

FOLDS = 60
"""Takes are judged one by one against the others; where there are more than this, in so many portions."""


def joint_spread(skeleton: Skeleton, rotations: Float[Array, "*shape frames joints 4"]) -> Float[Array, "*shape"]:
    """Standard deviation of the joints of the upper body over the frames, root mean square over the joints, radians.

    Parameters
    ----------
    rotations
        Joint to parent. A skeleton without upper body is judged by all its joints but the root.
    """
    joints = [skeleton.roles[role] for role in UPPER_BODY if role in skeleton.roles] or list(range(1, skeleton.joints))
    chosen = rotations[..., joints, :]
    middle = chosen[..., chosen.shape[-3] // 2, :, :][..., None, :, :]
    values = quat.log(quat.multiply(quat.inverse(middle), chosen))
    variance = values.var(axis=-3).sum(axis=-1)
    return np.asarray(np.sqrt(variance.mean(axis=-1)))


def stoop(
    skeleton: Skeleton, rotations: Float[Array, "*shape frames joints 4"], headings: Float[Array, "*shape frames"]
) -> Float[Array, "*shape"]:
    """How far trunk and head are bent forward, mean over the frames and over both, radians.

    Parameters
    ----------
    rotations
        Joint to parent, the root's in the world.
    headings
        Direction in which the person goes, radians.
    """
    above = next((role for role in ("neck", "head", "chest", "spine1", "spine") if role in skeleton.roles), None)
    if above is None:
        return np.zeros(rotations.shape[:-3])
    world = kinematics.forward(skeleton, np.zeros((*rotations.shape[:-2], 3)), rotations)
    back = quat.about_y(-headings)
    upright = [quat.rotate(back, world.positions[..., skeleton.joint(above), :])]
    if "head" in skeleton.roles:
        crown = quat.rotate(world.rotations[..., skeleton.joint("head"), :], np.array([0.0, 1.0, 0.0]))
        upright.append(quat.rotate(back, crown))
    bends = [np.arctan2(way[..., 2], way[..., 1]).mean(axis=-1) for way in upright]
    return np.asarray(np.mean(bends, axis=0))


def score(
    kinds: Int[Array, "examples"],
    takes: Int[Array, "examples"],
    speeds: Float[Array, "examples"],
    spreads: Float[Array, "examples"],
    cadences: Float[Array, "examples"],
    stoops: Float[Array, "examples"],
    known: Bool[Array, "examples"] | None = None,
) -> Float[Array, "examples"]:
    """Score each example against the others of like status and speed, from gloomy (-1) to brisk (+1).

    What is usual is the trend of each sign over speed, drawn by median regression through the examples of all other
    takes, every take counting alike. An example's signs are how far it is off, in units of what people of one mood
    differ by; their mean goes through a hyperbolic tangent. The fewer other takes there are, the nearer to 0 it stays.

    Parameters
    ----------
    kinds
        Status of each example; only like is held against like.
    takes
        Where it comes from; an example and its mirror image come from one take.
    speeds, cadences
        m/s and steps a second; a cadence of 0 is none.
    spreads, stoops
        As of ``joint_spread`` and ``stoop``, radians.
    known
        Examples that others are held against; all, if left out.
    """
    known = np.ones(len(kinds), bool) if known is None else known
    out = np.zeros(len(kinds))
    signs = np.stack(
        (
            np.log(np.maximum(spreads, 0.0) + STILL) / SPREAD_SCALE,
            np.log(np.maximum(cadences, 1e-6)) / CADENCE_SCALE,
            -stoops / STOOP_SCALE,
        ),
        axis=-1,
    )
    for kind in np.unique(kinds):
        rows = np.flatnonzero(kinds == kind)
        present = np.unique(takes[rows])
        for portion in np.array_split(present, min(len(present), FOLDS)):
            own = np.isin(takes[rows], portion)
            others = rows[~own & known[rows]]
            count = len(np.unique(takes[others]))
            if count == 0:
                continue
            mine = rows[own]
            counted = np.array([0, 1, 2] if (cadences[mine] > 0).all() and (cadences[others] > 0).all() else [0, 2])
            usual = _usual(speeds[others], signs[np.ix_(others, counted)], takes[others], speeds[mine])
            off = (signs[np.ix_(mine, counted)] - usual).mean(axis=-1)
            out[mine] = np.tanh(off) * count / (count + 1)
    return out


def _usual(
    speeds: Float[Array, "rows"], signs: Float[Array, "rows signs"], takes: Int[Array, "rows"], at: Float[Array, "own"]
) -> Float[Array, "own signs"]:
    """What these examples show at other speeds."""
    _, which, counts = np.unique(takes, return_inverse=True, return_counts=True)
    alike = 1.0 / counts[which]
    low, high = speeds.min(), speeds.max()
    degree = min(2, max(0, (len(counts) - 1) // 3)) if high - low > 0.3 else 0
    middle, half = (low + high) / 2, max((high - low) / 2, 1e-6)

    def basis(speeds: Array) -> Array:
        u = (np.clip(speeds, low, high) - middle) / half  # beyond what the others do, the trend goes level
        return np.vander(u, degree + 1, increasing=True)

    known = basis(speeds)
    columns = []
    for sign in signs.T:
        weights = alike
        for _ in range(ROUNDS):
            weighted = known.T * weights
            line = np.linalg.solve(weighted @ known + 1e-9 * np.eye(degree + 1), weighted @ sign)
            weights = alike / np.maximum(np.abs(sign - known @ line), 0.02)
        columns.append(basis(at) @ line)
    return np.stack(columns, axis=-1)
