"""Measures of a body in motion: whether feet stay, knees bend the right way, joints turn smoothly.

Foot skate weighted by height: Zhang et al., *Mode-adaptive neural networks for quadruped motion control*, 2018.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from stridecast.analysis.take import SOLE, analyse
from stridecast.body import kinematics
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.motion import Motion

Array = np.ndarray

LOW = 0.025
"""Toes that are lifted higher weigh nothing in the weighted foot skate, metres."""

SLIP_SPEED, SLIP_HEIGHT = 0.5, 0.05
"""A toe slips that is faster, m/s, while lifted less, metres."""

CONTACT = (0.12, 2.0)
"""Contacts that are shorter or longer, seconds, do not count: blips, and standing."""

ROLL = 0.2
"""Share of a contact at either end in which a foot may roll."""

NEAR_SEAM = 0.1
"""Seconds about a seam that are near to it."""


@dataclass(frozen=True, kw_only=True)
class FootSkate:
    """How much planted feet slide.

    Parameters
    ----------
    contacts
        So many are judged.
    travel, travel_95
        Millimetres that a toe travels in the middle of a contact: median, and 95 % of contacts do not exceed.
    speed
        Of toes in the middle of contacts, cm/s, mean.
    weighted
        Mean of ``v (2 - 2^(h / 2.5 cm))`` over toes lifted by ``h`` below 2.5 cm, cm/s.
    slipping
        Share of frames, of both feet, in which a toe is faster than 0.5 m/s while lifted less than 5 cm.
    """

    contacts: int
    travel: float
    travel_95: float
    speed: float
    weighted: float
    slipping: float


@dataclass(frozen=True, kw_only=True)
class MotionScore:
    """How well a body moves.

    Parameters
    ----------
    frames, seconds
        So long.
    foot_skate
        See there.
    knees
        Least and greatest bend, degrees; below 0 is backwards.
    lowest
        Height of the lowest point over the floor, metres.
    angular_acceleration_99, angular_acceleration_most
        Of the joints, rad/s2: 99 % are no larger, and the largest. A pop shows in the second.
    """

    frames: int
    seconds: float
    foot_skate: FootSkate
    knees: tuple[float, float]
    lowest: float
    angular_acceleration_99: float
    angular_acceleration_most: float

    def as_json(self) -> dict[str, Any]:
        """All measures as plain values; what cannot be said is null."""

        def plain(value: Any) -> Any:
            if isinstance(value, dict):
                return {key: plain(inner) for key, inner in value.items()}
            return None if isinstance(value, float) and not np.isfinite(value) else value

        return {key: list(v) if isinstance(v, tuple) else plain(v) for key, v in asdict(self).items()}


def score_motion(motion: Motion) -> MotionScore:
    """Judge a motion: a recording, or what was synthesised.

    Raises
    ------
    SkeletonError, TakeError
        A body that cannot be mapped; a take that shows no gait.
    """
    take = analyse(motion)
    on_floor = take.motion
    world = kinematics.pose(on_floor)
    bends = knee_bends(on_floor)
    amount = angular_accelerations(on_floor)
    heights = [world.positions[..., 1].min(), kinematics.ends(on_floor.skeleton, world)[..., 1].min(initial=np.inf)]
    return MotionScore(
        frames=motion.frames,
        seconds=motion.seconds,
        foot_skate=foot_skate(on_floor, take.contacts.planted),
        knees=(float(bends.min()), float(bends.max())),
        lowest=float(min(heights)),
        angular_acceleration_99=float(np.percentile(amount, 99)),
        angular_acceleration_most=float(amount.max()),
    )


def foot_skate(motion: Motion, planted: Bool[Array, "frames 2"]) -> FootSkate:
    """How much planted toes slide.

    Parameters
    ----------
    motion
        Its flat feet stand on height 0.
    planted
        When each foot is, left and right.
    """
    toes = toe_positions(motion)
    each = toe_travel(motion, planted)
    travel = np.array([way for way, _ in each])
    seconds = sum(length for _, length in each)
    speeds = np.linalg.norm(np.diff(ground.project(toes), axis=0), axis=-1) * motion.frame_rate
    lifted = np.maximum(toes[1:, :, 1] - SOLE * motion.skeleton.leg_length, 0.0)
    low = lifted < LOW
    weighted = (speeds * (2 - 2 ** (lifted / LOW)))[low]
    slipping = (speeds > SLIP_SPEED) & (lifted < SLIP_HEIGHT)
    nothing = float("nan")
    return FootSkate(
        contacts=len(each),
        travel=float(np.median(travel)) if len(each) else nothing,
        travel_95=float(np.percentile(travel, 95)) if len(each) else nothing,
        speed=float(travel.sum() / 10 / seconds) if len(each) else nothing,
        weighted=float(100 * weighted.mean()) if low.any() else nothing,
        slipping=float(slipping.mean()),
    )


def toe_positions(motion: Motion) -> Float[Array, "frames 2 3"]:
    """Where both toe joints are, left and right, metres."""
    positions = kinematics.pose(motion).positions
    return positions[:, [motion.skeleton.joint(f"{side}_toe") for side in SIDES]]


def toe_travel(motion: Motion, planted: Bool[Array, "frames 2"]) -> list[tuple[float, float]]:
    """Millimetres that each planted toe travels on the ground in the middle of its contact, and in how many seconds."""
    toes = ground.project(toe_positions(motion))
    shortest, longest = CONTACT
    out = []
    for side in range(len(SIDES)):
        for value, start, stop in signals.runs(planted[:, side]):
            length = stop - start
            if value and shortest < length / motion.frame_rate < longest and start > 0 and stop < motion.frames:
                middle = toes[start + round(ROLL * length) : stop - round(ROLL * length), side]
                way = 1000 * float(np.linalg.norm(np.diff(middle, axis=0), axis=-1).sum())
                out.append((way, (len(middle) - 1) / motion.frame_rate))
    return out


def angular_accelerations(motion: Motion) -> Float[Array, "frames joints"]:
    """Amount of the angular acceleration of the joints with roles, rad/s2."""
    turning = quat.angular_velocity(motion.rotations, motion.frame_rate)
    acceleration = np.linalg.norm(signals.rate_of_change(turning, motion.frame_rate), axis=-1)
    return acceleration[:, list(motion.skeleton.roles.values())]


def seam_accelerations(motion: Motion, seams: Sequence[int]) -> tuple[float, float]:
    """99 % of the joints' angular accelerations within ``NEAR_SEAM`` of seams and elsewhere, rad/s2.

    Parameters
    ----------
    seams
        Frames; the first of what comes after each.
    """
    amount = angular_accelerations(motion)
    near = np.zeros(motion.frames, bool)
    reach = round(NEAR_SEAM * motion.frame_rate)
    for frame in seams:
        near[max(0, frame - reach) : frame + reach + 1] = True
    return float(np.percentile(amount[near], 99)), float(np.percentile(amount[~near], 99))


def knee_bends(motion: Motion) -> Float[Array, "2 frames"]:
    """Signed bend of both knees, degrees: the leg's plane seen along the knee's mean axis; below 0 is backwards."""
    world = kinematics.pose(motion)
    out = []
    for side in SIDES:
        thigh, shin, foot = motion.skeleton.chain(f"{side}_thigh", f"{side}_shin", f"{side}_foot")
        down = world.positions[:, shin] - world.positions[:, thigh]
        on = world.positions[:, foot] - world.positions[:, shin]
        axis = quat.log(motion.rotations[:, shin]).mean(axis=0)
        hinge = quat.rotate(world.rotations[:, shin], axis / max(np.linalg.norm(axis), 1e-12))
        cross = np.cross(down, on)
        sine = np.linalg.norm(cross, axis=-1) * np.sign(np.sum(cross * hinge, axis=-1))
        out.append(np.degrees(np.arctan2(sine, np.sum(down * on, axis=-1))))
    return np.array(out)
