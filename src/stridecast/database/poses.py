"""Examples as poses and back: what ``Examples.features`` says of joints, hips and feet."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from stridecast.analysis.take import SOLE
from stridecast.geometry import quaternions as quat
from stridecast.model.database import INTERVALS, MARGIN, MotionDatabase
from stridecast.model.group import MotionGroup

Array = np.ndarray

GENERIC = np.clip(np.arange(-MARGIN, INTERVALS + MARGIN + 1) / INTERVALS, 0.0, 1.0)
"""Generic time of each row; margins lie at the ends."""


def poses_of(
    references: Float[Array, "bones 4"], features: Float[Array, "*shape features"]
) -> tuple[Float[Array, "*shape joints 4"], Float[Array, "*shape 3"]]:
    """Rotations and root positions of features, the vehicle at the origin and facing ahead."""
    tilt = 3 * len(references)
    rotations = np.empty((*features.shape[:-1], len(references) + 1, 4))
    rotations[..., 0, :] = quat.multiply(quat.about_y(features[..., -1]), quat.exp(features[..., tilt : tilt + 3]))
    tangents = features[..., :tilt].reshape(*features.shape[:-1], -1, 3)
    rotations[..., 1:, :] = quat.multiply(references, quat.exp(tangents))
    return rotations, features[..., tilt + 3 : tilt + 6].copy()


def tangents_of(
    references: Float[Array, "bones 4"], rotations: Float[Array, "*shape joints 4"]
) -> Float[Array, "*shape tangents"]:
    """Features of all joints but the root: rotation vectors about the references, side by side."""
    vectors = quat.log(quat.multiply(quat.inverse(references), rotations[..., 1:, :]))
    return np.asarray(vectors).reshape(*rotations.shape[:-2], -1)


def planted_rows(group: MotionGroup) -> Bool[Array, "rows 2"]:
    """Which foot stands at each row of a group's examples, left and right."""
    states = [group.string[k] for k in np.searchsorted(np.array(group.keys), GENERIC, side="right")]
    return np.array([(state in "LDS", state in "RDS") for state in states])


def sole_height(database: MotionDatabase) -> float:
    """Height of the toe joints of feet that stand flat, metres."""
    return SOLE * database.skeleton.leg_length if database.sole is None else database.sole
