"""Size of movement at run time: what a large size adds to each example, made once, so that blending stays a sum.

A walker's pose is a weighted sum of examples; so is what must be added to it for larger movements. For each example
that is worked out once: its swing about the mean posture of its motion at its speed, by frequency band (Bruderlin and
Williams 1995), with the feet put back to where they stand. A character then takes a part of it: all for exaggerated
movements, less for lively ones, a negative one for calm ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from threading import Lock
from types import MappingProxyType
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from stridecast.body import kinematics
from stridecast.body.legs import reach
from stridecast.body.limits import within_limits
from stridecast.body.planting import Feet
from stridecast.database.poses import GENERIC, planted_rows, poses_of, tangents_of
from stridecast.geometry import pyramid, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.database import INTERVALS, MARGIN, ROWS, MotionDatabase
from stridecast.model.group import MotionGroup
from stridecast.model.segment import RUN, STAND, WALK
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

AMOUNTS: Mapping[str, float] = MappingProxyType({"calm": -0.55, "neutral": 0.0, "lively": 0.45, "exaggerated": 1.0})
"""How much of what is added for exaggerated movements a size takes."""

FREQUENCIES = (3.2, 6.4)
GAINS = (1.65, 1.25, 1.0)
"""Gains of exaggerated movements below, between and above these frequencies (Hz): those of ``multiresolution``. A half
cycle is too short to tell its slower bands apart; what is slower than all of them is the mean posture."""

DEGREE = 2
"""Mean posture depends on speed by a polynomial of this degree."""

LEGS = 0.65
"""Legs take this part of it: a foot in the air is lifted by all joints of its leg together."""

FADE = 0.15
"""What a stance does to the movement of a foot is forgotten within this part of a half cycle."""

_LOCK = Lock()
_KEPT: WeakKeyDictionary[MotionDatabase, Array] = WeakKeyDictionary()


def kept_enlargement(database: MotionDatabase) -> Float[Array, "examples rows features"]:
    """``enlargement`` in single precision, worked out once for all walkers of a database: it takes a second or more.

    Walkers share it, and nobody writes into it.
    """
    with _LOCK:
        if database not in _KEPT:
            _KEPT[database] = enlargement(database).astype(np.float32)
        return _KEPT[database]


def enlargement(database: MotionDatabase) -> Float[Array, "examples rows features"]:
    """What exaggerated movements add to the features of each example (see ``Examples``).

    Standing, where feet stand and the way over the ground stay as they are. Knees and elbows never bend backwards.
    """
    examples = database.examples
    joints = database.skeleton.joints
    tilt = 3 * (joints - 1)
    still = [3 * (database.skeleton.joint(f"{side}_toe") - 1) + k for side in SIDES for k in range(3)]
    legs = [
        3 * (database.skeleton.joint(f"{side}_{part}") - 1) + k
        for side in SIDES
        for part in ("thigh", "shin", "foot")
        for k in range(3)
    ]
    still += [tilt + 3, tilt + 5]  # the pelvis left and forward
    out = np.zeros_like(examples.features)
    postures = {motion: _Posture(database, motion) for motion in (WALK, RUN)}
    for group in database.groups:
        if group.motion == STAND:
            continue
        own = examples.features[group.rows]
        base = _base(database, group, postures)
        seconds = float(examples.durations[group.rows].mean())
        swing = np.moveaxis(own - base, 1, 0)
        larger = pyramid.join(pyramid.split(swing, INTERVALS / seconds, FREQUENCIES), GAINS)
        more = np.moveaxis(larger - swing, 0, 1)
        more[..., legs] *= LEGS
        more[..., still] = 0.0
        out[group.rows] = _planted(database, group, own, own + more) - own
    return out


class _Posture:
    """Mean posture of a motion as a function of speed: both halves of the cycle count alike."""

    def __init__(self, database: MotionDatabase, motion: str) -> None:
        self.fits: dict[str, Array] = {}
        for group in database.groups:
            if group.motion == motion:
                speeds = database.examples.parameters[group.rows, 0]
                means = _mean(database.examples.features[group.rows])
                degree = min(DEGREE, len(np.unique(speeds.round(1))) - 1)
                powers = np.vander(speeds, degree + 1)
                fit = np.linalg.lstsq(powers, means, rcond=None)[0]
                self.fits[group.name] = np.concatenate((np.zeros((DEGREE - degree, means.shape[1])), fit))
                self.range = (float(speeds.min()), float(speeds.max()))

    def __call__(self, speeds: Float[Array, "examples"], group: str | None = None) -> Float[Array, "examples features"]:
        powers = np.vander(np.clip(speeds, *self.range), DEGREE + 1)
        fits = [self.fits[group]] if group else list(self.fits.values())
        return powers @ np.mean(fits, axis=0)


def _mean(features: Float[Array, "examples rows features"]) -> Float[Array, "examples features"]:
    """Mean over a segment, without its margins; both ends count half, as the next segment begins with one."""
    weights = np.ones(ROWS - 2 * MARGIN)
    weights[[0, -1]] = 0.5
    return np.tensordot(features[:, MARGIN : ROWS - MARGIN], weights / weights.sum(), axes=(1, 0))


def _base(
    database: MotionDatabase, group: MotionGroup, postures: Mapping[str, _Posture]
) -> Float[Array, "examples rows features"]:
    """Posture about which an example swings: that of its motion, with what is this example's own manner.

    In a transition it passes from one to the other; of standing it is that of the example.
    """
    features, travelled = database.examples.features[group.rows], database.examples.travelled[group.rows]
    own = postures.get(group.motion)
    if own is not None and own.fits:
        speeds = database.examples.parameters[group.rows, 0]
        mean = _mean(features) - own(speeds, group.name) + own(speeds)
        return np.broadcast_to(mean[:, None], features.shape)  # repeating would keep other threads waiting
    ends = []
    for kind, row in ((group.start, MARGIN), (group.stop, ROWS - 1 - MARGIN)):
        posture = None if kind == "S" else postures[RUN if kind.startswith("F") else WALK]
        known = posture is not None and posture.fits
        ends.append(posture(travelled[:, row, 3]) if posture is not None and known else features[:, row])
    share = signals.smooth(GENERIC)[None, :, None]
    return (1 - share) * ends[0][:, None] + share * ends[1][:, None]


def _planted(
    database: MotionDatabase,
    group: MotionGroup,
    own: Float[Array, "examples rows features"],
    larger: Float[Array, "examples rows features"],
) -> Float[Array, "examples rows features"]:
    """The larger poses with their feet where they stand; half-way through a swing they are where they will."""
    skeleton, references = database.skeleton, database.references
    count = len(own)
    was, root = poses_of(references, own.reshape(-1, own.shape[-1]))
    turned, _ = poses_of(references, larger.reshape(-1, own.shape[-1]))
    above = root + [0.0, 1.0, 0.0] * (larger - own)[..., -3:-2].reshape(-1, 1)
    turned = within_limits(skeleton, turned, was)
    before = kinematics.forward(skeleton, root, was)
    planted = planted_rows(group)
    feet, toes = skeleton.chain("left_foot", "right_foot"), skeleton.chain("left_toe", "right_toe")
    after = kinematics.forward(skeleton, above, turned)
    shape = (count, ROWS, 2)
    wanted = Feet(toes=before.positions[:, toes].reshape(*shape, 3), turns=before.rotations[:, feet].reshape(*shape, 4))
    free = Feet(toes=after.positions[:, toes].reshape(*shape, 3), turns=after.rotations[:, feet].reshape(*shape, 4))
    goals = _bridged(free, wanted, group)
    ankles = [
        goals.toes[..., side, :] - quat.rotate(goals.turns[..., side, :], skeleton.offsets[toe])
        for side, toe in enumerate(toes)
    ]
    above[:, 1] -= _sinking(skeleton, before, after, ankles, planted)
    for side, name in enumerate(SIDES):
        over = after.rotations[:, skeleton.parents[feet[side]]]
        turned[:, feet[side]] = quat.multiply(quat.inverse(over), goals.turns[..., side, :].reshape(-1, 4))
        turned = reach(skeleton, above, turned, name, ankles[side].reshape(-1, 3))
    out = larger.copy()
    out[..., : 3 * (skeleton.joints - 1)] = tangents_of(references, turned).reshape(count, ROWS, -1)
    out[..., -3] = above[:, 1].reshape(count, ROWS)
    return out


def _bridged(free: Feet, wanted: Feet, group: MotionGroup) -> Feet:
    """Feet of each example as wanted while they stand, and smoothly back to what they would do in swings.

    Segments must meet: at a boundary a swinging foot does what it would, but in mid-flight the one that is about to
    land is as wanted.
    """
    toes, turns, planted = free.toes.copy(), free.turns.copy(), planted_rows(group)
    for side in range(2):
        turned = quat.log(quat.multiply(wanted.turns[:, :, side], quat.inverse(free.turns[:, :, side])))
        change = np.concatenate((wanted.toes[:, :, side] - free.toes[:, :, side], turned), axis=-1)
        known = planted[:, side].copy()
        for kind, rows in ((group.start, slice(0, MARGIN + 1)), (group.stop, slice(ROWS - MARGIN - 1, ROWS))):
            if not known[rows].any():
                known[rows] = True
                change[:, rows] *= kind == ("FL", "FR")[side]
        columns = np.moveaxis(change, 1, 0).reshape(ROWS, -1)
        change = np.moveaxis(signals.bridge(columns, known, FADE * INTERVALS).reshape(ROWS, -1, 6), 0, 1)
        toes[:, :, side] += change[..., :3]
        turns[:, :, side] = quat.multiply(quat.exp(change[..., 3:]), free.turns[:, :, side])
    return Feet(toes=toes, turns=turns)


def _sinking(
    skeleton: Skeleton,
    before: kinematics.World,
    after: kinematics.World,
    ankles: list[Float[Array, "examples rows 3"]],
    planted: Bool[Array, "rows 2"],
) -> Float[Array, "poses"]:
    """How far the pelvis sinks so that no planted leg is stretched further than it was, smooth along the rows."""
    need = np.zeros(ankles[0].shape[:2])
    for side, name in enumerate(SIDES):
        thigh, foot = skeleton.chain(f"{name}_thigh", f"{name}_foot")
        was = np.linalg.norm(before.positions[:, foot] - before.positions[:, thigh], axis=-1).reshape(need.shape)
        most = np.where(planted[:, side], was, 0.0).max(axis=1, keepdims=True)
        hip = after.positions[:, thigh].reshape(*need.shape, 3)
        across = np.sum((hip - ankles[side])[..., [0, 2]] ** 2, axis=-1)
        short = hip[..., 1] - ankles[side][..., 1] - np.sqrt(np.maximum(most**2 - across, 0.0))
        need = np.maximum(need, np.where(planted[:, side], short, 0.0))
    highest = maximum_filter1d(need, 5, axis=1, mode="nearest")
    return gaussian_filter1d(highest, 1.5, axis=1, mode="nearest").reshape(-1)
