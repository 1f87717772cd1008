"""Feet of a whole motion put where they are to be: legs bend to them, the pelvis sinks where legs are too short."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from stridecast.body import kinematics
from stridecast.body.legs import reach
from stridecast.geometry import quaternions as quat
from stridecast.geometry import signals
from stridecast.model.contacts import SIDES
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

FADE = 0.12
"""What a stance does to the movement of a foot is forgotten within this time of the swing, seconds."""

LEAST_REACH = 0.96
"""A leg may be stretched to this part of its length, or as far as the person's own was while it stood ..."""

FARTHEST_REACH = 0.9995
"""... and one that swings to half-way between that and this."""

SINKING = 0.05
"""Sinking is smoothed over this time, seconds."""

TIP = 0.004
"""The tips of the toes stay above this height, metres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Feet:
    """Where feet are: ``toes``, world places of the toe joints (m), ``turns``, world rotations of the feet."""

    toes: Float[Array, "*frames 2 3"]
    turns: Float[Array, "*frames 2 4"]


def feet_of(motion: Motion) -> Feet:
    """Where a motion's feet are; columns are left and right."""
    world = kinematics.pose(motion)
    return Feet(
        toes=world.positions[:, motion.skeleton.chain("left_toe", "right_toe")],
        turns=world.rotations[:, motion.skeleton.chain("left_foot", "right_foot")],
    )


def standing(free: Feet, planted: Bool[Array, "frames 2"]) -> Feet:
    """Feet that stay over the same place while planted, that of the middle half of each stance; heights and turns stay.

    Parameters
    ----------
    free
        Where feet would be.
    planted
        Which foot stands when.
    """
    toes = free.toes.copy()
    for side in range(2):
        for stands, start, stop in signals.runs(planted[:, side]):
            if stands:
                rest = (stop - start) // 4
                toes[start:stop, side, ::2] = free.toes[start + rest : stop - rest, side, ::2].mean(axis=0)
    return replace(free, toes=toes)


def raised(feet: Feet, height: float) -> Feet:
    """Feet whose toe joints are at least so high."""
    return replace(feet, toes=np.maximum(feet.toes, [-np.inf, height, -np.inf]))


def corrected(free: Feet, wanted: Feet, planted: Bool[Array, "frames 2"], rate: float) -> Feet:
    """Feet as wanted while they are planted; in swings, what that changed passes smoothly from stance to stance.

    Parameters
    ----------
    free
        Where feet would be.
    wanted
        Where they are to be while planted; other frames do not matter.
    planted
        Which foot stands when.
    rate
        Frames a second.
    """
    toes, turns = np.empty_like(free.toes), np.empty_like(free.turns)
    for side in range(2):
        turned = quat.log(quat.multiply(wanted.turns[:, side], quat.inverse(free.turns[:, side])))
        change = np.concatenate((wanted.toes[:, side] - free.toes[:, side], turned), axis=-1)
        change = signals.bridge(change, planted[:, side], FADE * rate)
        toes[:, side] = free.toes[:, side] + change[:, :3]
        turns[:, side] = quat.multiply(quat.exp(change[:, 3:]), free.turns[:, side])
    return Feet(toes=toes, turns=turns)


def reach_of(motion: Motion, planted: Bool[Array, "frames 2"]) -> Float[Array, "2 2"]:
    """How far legs are stretched at most, as a part of their length: left and right, while planted and at any time."""
    world, out = kinematics.pose(motion), np.empty((2, 2))
    for side, name in enumerate(SIDES):
        hip, ankle, length = _leg(motion.skeleton, world, name)
        stretched = np.linalg.norm(ankle - hip, axis=-1) / length
        for k, frames in enumerate((planted[:, side], slice(None))):
            out[side, k] = min(max(LEAST_REACH, float(stretched[frames].max(initial=0.0))), 1.0)
    return out


def put_feet(
    motion: Motion, feet: Feet, planted: Bool[Array, "frames 2"], reaches: Float[Array, "2 2"] | None = None
) -> Motion:
    """The same motion with its feet where they are to be.

    Knees keep the plane in which they bend, toes what they do against the foot. The pelvis sinks, smoothly, where a
    planted foot would be out of reach; a swinging one that is comes as near as the leg reaches.

    Parameters
    ----------
    motion
        Whose legs bend.
    feet
        Where the feet are to be.
    planted
        Which foot stands when.
    reaches
        How far legs may be stretched (see ``reach_of``); as far as the motion's own are if left out.

    Raises
    ------
    SkeletonError
        A joint of the legs is missing.
    """
    reaches = reach_of(motion, planted) if reaches is None else reaches
    skeleton, rotations = motion.skeleton, motion.rotations.copy()
    ankles = [
        feet.toes[:, side] - quat.rotate(feet.turns[:, side], skeleton.offsets[skeleton.joint(f"{name}_toe")])
        for side, name in enumerate(SIDES)
    ]
    world = kinematics.pose(motion)
    root = motion.root_positions.copy()
    sinking = _sinking(skeleton, world, ankles, planted, motion.frame_rate, reaches)
    root[:, 1] -= sinking
    for side, name in enumerate(SIDES):
        foot = skeleton.joint(f"{name}_foot")
        above = world.rotations[:, skeleton.parents[foot]]
        rotations[:, foot] = quat.multiply(quat.inverse(above), feet.turns[:, side])
        hip, _, length = _leg(skeleton, world, name)
        hip = hip - sinking[:, None] * [0.0, 1.0, 0.0]
        goal = np.where(
            planted[:, side, None], ankles[side], _in_reach(hip, ankles[side], reaches[side, 1] * length, length)
        )
        rotations = reach(skeleton, root, rotations, name, goal)
    return replace(motion, root_positions=root, rotations=quat.continuous(quat.normalize(rotations)))


def with_toes_up(motion: Motion) -> Motion:
    """The same motion with toes bent up where their tips would go through the floor."""
    skeleton, rotations = motion.skeleton, motion.rotations.copy()
    world = kinematics.pose(motion)
    for toe in skeleton.chain("left_toe", "right_toe"):
        for end in skeleton.end_offsets[skeleton.end_joints == toe][:1]:
            tip = quat.rotate(world.rotations[:, toe], end)
            level = np.maximum(np.hypot(tip[:, 0], tip[:, 2]), 1e-9)
            length = np.maximum(np.linalg.norm(tip, axis=-1), 1e-9)
            want = np.arcsin(np.clip((TIP - world.positions[:, toe, 1]) / length, -1.0, 1.0))
            lift = np.maximum(want - np.arctan2(tip[:, 1], level), 0.0)
            axis = np.stack((-tip[:, 2] / level, np.zeros(len(tip)), tip[:, 0] / level), axis=-1)
            raised = quat.multiply(quat.exp(axis * lift[:, None]), world.rotations[:, toe])
            rotations[:, toe] = quat.multiply(quat.inverse(world.rotations[:, skeleton.parents[toe]]), raised)
    return replace(motion, rotations=rotations)


def _leg(skeleton: Skeleton, world: kinematics.World, name: str) -> tuple[Array, Array, float]:
    """Places of hip and ankle, and the length of the leg."""
    hip, knee, ankle = (world.positions[:, j] for j in skeleton.chain(f"{name}_thigh", f"{name}_shin", f"{name}_foot"))
    return hip, ankle, float(np.linalg.norm(knee[0] - hip[0]) + np.linalg.norm(ankle[0] - knee[0]))


def _in_reach(hip: Array, ankle: Array, most: float, length: float) -> Float[Array, "frames 3"]:
    """Ankles drawn towards the hip, gently, where they are further from it than ``most``."""
    away = np.linalg.norm(ankle - hip, axis=-1, keepdims=True)
    more = 0.5 * max(FARTHEST_REACH * length - most, 1e-6)
    over = np.maximum(away - most, 0.0)
    held = most + more * (1 - np.exp(-over / more))
    return np.where(over > 0, hip + (ankle - hip) * held / np.maximum(away, 1e-9), ankle)


def _sinking(
    skeleton: Skeleton,
    world: kinematics.World,
    ankles: list[Float[Array, "frames 3"]],
    planted: Bool[Array, "frames 2"],
    rate: float,
    reaches: Float[Array, "2 2"],
) -> Float[Array, "frames"]:
    """How far the pelvis must sink so that planted feet are in reach, smooth in time."""
    need = np.zeros(len(planted))
    for side, name in enumerate(SIDES):
        hip, _, length = _leg(skeleton, world, name)
        goal = ankles[side]
        across = np.sum((hip - goal)[:, [0, 2]] ** 2, axis=-1)
        longest = reaches[side, 0] * length
        short = hip[:, 1] - goal[:, 1] - np.sqrt(np.maximum(longest**2 - across, 0.0))
        need = np.maximum(need, np.where(planted[:, side], short, 0.0))
    if need.max(initial=0.0) < 1e-9:
        return np.zeros_like(need)
    width = SINKING * rate
    highest = maximum_filter1d(need, 2 * round(2 * width) + 1, mode="nearest")
    return gaussian_filter1d(highest, width, mode="nearest")
