"""Recast a motion: somebody else's body plays it, over the same ground.

Unlike ``retargeting``, which makes what a body of another size would have done, this keeps the way: hips go along the
same path, and every step is where it was, as crowds and scenes need. Legs of another length bear it by height: hips are
as high as their length asks for, sink where a step is long for them, and feet are planted by inverse kinematics.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d

from stridecast.body import kinematics
from stridecast.body.alignment import aligned, alignment, flattening, unaligned
from stridecast.body.kinematics import World
from stridecast.body.planting import LEAST_REACH, Feet, corrected, feet_of, put_feet, reach_of, with_toes_up
from stridecast.body.retargeting import same_skeleton
from stridecast.errors import MotionError
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

SOLE = 4.0
"""Percentile of the heights of planted toes at which they stand flat."""

FEET = (0.5, 2.0)
"""A foot that rolls lifts its ball higher or less as it is longer or shorter, within these limits ..."""

ROLLING = 0.06
"""... up to about here above the floor, metres; further up it is the leg that lifts it, less if it is shorter."""

BEARING = 0.3
"""Hips find the height that suits the steps over this time, seconds."""

HIGHEST = 0.1
"""Hips rise by no more than this part of the leg where steps are short for it."""

DEEPEST = 0.25
"""Hips sink by no more than this part of the leg; a foot that needs more leaves the ground before, or comes later."""


def recast(motion: Motion, skeleton: Skeleton, planted: Bool[Array, "frames 2"]) -> Motion:
    """Play a motion on another skeleton, step by step over the same ground.

    Joints are matched by their roles; how they turn is carried over from the one rest pose to the other (see
    ``alignment``). Joints that only ``skeleton`` has keep their rest rotation. Hips go along the same path, at a height
    scaled by the length of the legs. A planted foot stands where it stood and as still; only its distance to the
    middle follows the width of the hips, and its ball the length of the foot. Where legs are too short for a
    step, hips sink; a step that is too long even so is shortened. Knees bend forward and are never stretched further
    than they were.

    Parameters
    ----------
    motion
        What to play, on a floor at height 0.
    skeleton
        Who plays it: any names, proportions and rest pose.
    planted
        Which foot stands when, left and right: as ``Journey``, ``Mined`` and ``analysis.contacts`` tell.

    Returns
    -------
    Motion
        On ``skeleton``, at the same frame rate.

    Raises
    ------
    SkeletonError
        A joint of hips or legs is missing in one of the skeletons.
    MotionError
        ``planted`` is not of as many frames.
    """
    if planted.shape != (motion.frames, 2):
        raise MotionError(f"{motion.frames} frames need planted of shape ({motion.frames}, 2), not {planted.shape}")
    turns = alignment(skeleton, motion.skeleton)
    if same_skeleton(motion.skeleton, skeleton):
        return replace(motion, skeleton=skeleton)
    body = aligned(skeleton, turns)
    world = kinematics.pose(motion)
    heights = world.positions[:, motion.skeleton.chain("left_toe", "right_toe"), 1]
    sole = np.array([np.percentile(heights[planted[:, k] if planted[:, k].any() else ..., k], SOLE) for k in range(2)])
    sole_there = soles(body, motion.skeleton, sole)
    posed = turned_alike(body, motion, world, sole, sole_there)
    free, shift = feet_alike(body, motion, world, sole, sole_there)
    feet = _standing(free, shift, planted, motion.frame_rate)
    posed = _borne(posed, feet, motion, planted)
    planted = planted & _bearable(posed, feet)
    moved = put_feet(posed, feet, planted, reach_of(motion, planted))
    return unaligned(with_toes_up(moved), skeleton, turns)


def soles(body: Skeleton, source: Skeleton, sole: Float[Array, "2"]) -> Float[Array, "2"]:
    """Heights of the toe joints over the floor when feet are flat, where those of the source's are ``sole``, metres."""
    rest = kinematics.rest(body)
    ends = kinematics.ends(body, rest)
    below = []
    for toe in body.chain("left_toe", "right_toe"):
        lowest = ends[body.end_joints == toe, 1].min(initial=rest.positions[toe, 1])
        below.append(rest.positions[toe, 1] - lowest)
    return np.maximum(sole * _foot_ratio(body, source), below)


def _foot_ratio(body: Skeleton, source: Skeleton) -> Float[Array, "2"]:
    """How much longer the feet of the one are, ankle to toe."""
    lengths = [np.linalg.norm(one.offsets[one.chain("left_toe", "right_toe")], axis=-1) for one in (body, source)]
    return np.clip(lengths[0] / np.maximum(lengths[1], 1e-6), *FEET)


def _legs(skeleton: Skeleton) -> Float[Array, "2"]:
    """Thigh plus shin of both legs, whatever joints lie between, metres."""
    at = kinematics.rest(skeleton).positions
    legs = np.array([skeleton.chain(*(f"{name}_{part}" for part in ("thigh", "shin", "foot"))) for name in SIDES])
    return np.asarray(np.linalg.norm(np.diff(at[legs], axis=1), axis=-1).sum(axis=1))


def turned_alike(
    body: Skeleton, motion: Motion, world: World, sole: Float[Array, "2"], sole_there: Float[Array, "2"]
) -> Motion:
    """The body with its joints turned as in the motion, hips over the same ground, at their own height."""
    source = motion.skeleton
    turned = np.empty((motion.frames, body.joints, 4))
    role_of = {joint: role for role, joint in body.roles.items()}
    for joint in range(body.joints):
        role = role_of.get(joint)
        known = role is not None and role in source.roles
        turned[:, joint] = world.rotations[:, source.roles[role or ""]] if known else turned[:, body.parents[joint]]
    ankles = [
        float((height - one.offsets[one.chain("left_toe", "right_toe"), 1]).mean())
        for one, height in ((source, sole), (body, sole_there))
    ]
    hips = world.positions[:, source.chain("left_thigh", "right_thigh")].mean(axis=1)
    hips[:, 1] = ankles[1] + (hips[:, 1] - ankles[0]) * _legs(body).mean() / _legs(source).mean()
    middle = kinematics.rest(body).positions[body.chain("left_thigh", "right_thigh")].mean(axis=0)
    return replace(
        motion,
        skeleton=body,
        root_positions=hips - quat.rotate(turned[:, 0], middle),
        rotations=quat.continuous(quat.normalize(kinematics.local(body, turned))),
    )


def feet_alike(
    body: Skeleton, motion: Motion, world: World, sole: Float[Array, "2"], sole_there: Float[Array, "2"]
) -> tuple[Feet, Float[Array, "frames 2 2"]]:
    """Where feet would be over the same ground, and how far over it that is from the motion's own.

    They are further apart where hips are wider, and further ahead where feet are longer.
    """
    source = motion.skeleton
    here = feet_of(motion)
    toes = here.toes.copy()
    lift, legs = toes[..., 1] - sole, np.minimum(_legs(body) / _legs(source), 1.0)
    rolls = np.exp(-np.maximum(lift, 0.0) / ROLLING)
    toes[..., 1] = sole_there + lift * (legs + (_foot_ratio(body, source) - legs) * rolls)
    shift = np.empty((motion.frames, 2, 2))
    rest, like = kinematics.rest(body).positions, kinematics.rest(source).positions
    facing = quat.twist_about_y(world.rotations[:, 0])
    for side, name in enumerate(SIDES):
        wide = [at[one.joint(f"{name}_thigh"), 0] for one, at in ((body, rest), (source, like))]
        long = [
            at[one.joint(f"{name}_toe"), 2] - at[one.joint(f"{name}_foot"), 2]
            for one, at in ((body, rest), (source, like))
        ]
        aside = np.array([wide[0] - wide[1], 0.0])
        ahead = np.array([0.0, 0.5 * (long[0] - long[1])])
        flat = quat.multiply(here.turns[:, side], quat.inverse(flattening(source, name)))
        shift[:, side] = ground.turn(aside, facing) + ground.turn(ahead, quat.twist_about_y(flat))
    toes[..., ::2] += shift
    return Feet(toes=toes, turns=here.turns), shift


def _standing(free: Feet, shift: Float[Array, "frames 2 2"], planted: Bool[Array, "frames 2"], rate: float) -> Feet:
    """The feet over one place in each stance."""
    wanted = free.toes.copy()
    for side in range(2):
        for stands, start, stop in signals.runs(planted[:, side]):
            if stands:
                own = shift[start:stop, side]
                wanted[start:stop, side, ::2] += own.mean(axis=0) - own
    return corrected(free, Feet(toes=wanted, turns=free.turns), planted, rate)


def _borne(posed: Motion, feet: Feet, motion: Motion, planted: Bool[Array, "frames 2"]) -> Motion:
    """Hips at a height, slowly changing, at which planted legs are stretched as they are in the motion."""
    if not planted.any():
        return posed
    rise = rises(posed, feet, motion, planted)
    known = np.flatnonzero(planted.any(axis=1))
    rise = np.interp(np.arange(posed.frames), known, rise[known])
    return risen(posed, gaussian_filter1d(rise, BEARING * posed.frame_rate, mode="nearest"))


def rises(posed: Motion, feet: Feet, motion: Motion, planted: Bool[Array, "frames 2"]) -> Float[Array, "frames"]:
    """How much higher hips would be if planted legs were stretched as they are in the motion; 0 where none stands."""
    rise = np.zeros(posed.frames)
    lengths, source_lengths = _legs(posed.skeleton), _legs(motion.skeleton)
    for side in range(2):
        stretched = np.linalg.norm(_from_ankle(motion, feet_of(motion), side), axis=-1) / source_lengths[side]
        away, length = _from_ankle(posed, feet, side), lengths[side]
        height = np.sqrt(np.maximum((stretched * length) ** 2 - np.sum(away[:, ::2] ** 2, axis=-1), 0.0))
        rise += np.where(planted[:, side], np.clip(height - away[:, 1], -DEEPEST * length, HIGHEST * length), 0.0)
    return rise / np.maximum(planted.sum(axis=1), 1)


def risen(motion: Motion, rise: Float[Array, "frames"]) -> Motion:
    """The same motion, so much higher."""
    return replace(motion, root_positions=motion.root_positions + rise[:, None] * [0.0, 1.0, 0.0])


def _from_ankle(motion: Motion, feet: Feet, side: int) -> Float[Array, "frames 3"]:
    """From where an ankle is to be to the hip joint."""
    hip, toe = motion.skeleton.chain(f"{SIDES[side]}_thigh", f"{SIDES[side]}_toe")
    ankle = feet.toes[:, side] - quat.rotate(feet.turns[:, side], motion.skeleton.offsets[toe])
    return np.asarray(kinematics.pose(motion).positions[:, hip] - ankle)


def _bearable(posed: Motion, feet: Feet) -> Bool[Array, "frames 2"]:
    """Which feet can be where they are to be without the hips going too low."""
    out = np.empty((posed.frames, 2), np.bool_)
    for side, length in enumerate(_legs(posed.skeleton).tolist()):
        away = _from_ankle(posed, feet, side)
        away[:, 1] = np.maximum(away[:, 1] - DEEPEST * length, 0.0)
        out[:, side] = np.linalg.norm(away, axis=-1) < LEAST_REACH * length
    return out
