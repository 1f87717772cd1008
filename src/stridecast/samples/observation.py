"""What a take shows of walking and running: gait phase, speed, rhythm and every channel of the body, by frames."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from stridecast.analysis.take import TakeAnalysis, analyse
from stridecast.body import kinematics
from stridecast.body.mirroring import mirror_planted
from stridecast.errors import TakeError
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import LEFT, RIGHT, SIDES
from stridecast.model.motion import Motion
from stridecast.samples.adult import STEEPEST, adult, roll_over
from stridecast.samples.gait import FEET, moved_joints

Array = np.ndarray

PASSING = 0.15
"""Between two moments at which the feet pass, one foot gets at least this far ahead of the other, metres."""

SLOWEST = 0.45
"""What is slower is on its way to standing, m/s."""

LONGEST_STEP = 1.1
"""Seconds from feet passing to feet passing; what is longer is a pause."""

NEARLY_FLAT = np.radians(15)
"""A standing foot pitched less than this tells where the floor is, radians, ..."""

SHORTEST_FLAT = 0.04
"""... if it stays so for this long, seconds."""

SLOWEST_RUN, FASTEST_WALK = 1.55, 2.05
"""Between these speeds the bounce of the pelvis tells running from walking, m/s."""

SIDEWAYS = np.radians(50)
"""Who goes with the pelvis turned further from the way goes sideways or backwards."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Observation:
    """What one take shows, frame by frame, of those frames that belong to whole steps or to standing."""

    subject: str
    take: str
    phases: Float[Array, "frames"]
    speeds: Float[Array, "frames"]
    turns: Float[Array, "frames"]
    accelerations: Float[Array, "frames"]
    running: Bool[Array, "frames"]
    steps: Float[Array, "frames"]  # number of the half cycle a frame lies in
    strides: Float[Array, "frames"]  # a second, in that half cycle
    joints: Float[Array, "frames joints 4"]
    rest: Float[Array, "frames channels"]  # feet and details
    stances: Float[Array, "stances 4"]  # speed, phases of coming down and leaving, 1 for running
    standing_joints: Float[Array, "still joints 4"]
    standing_rest: Float[Array, "still channels"]


def observe_both(motion: Motion, take: str) -> list[Observation]:
    """Observe a take on the samples' skeleton, and its mirror image.

    Raises
    ------
    TakeError, SkeletonError
        Nothing in it to learn from, or no body of a person.
    """
    analysis = analyse(motion, adult())
    mirrored = analyse(mirror_planted(analysis.motion))
    return [observe(each, motion.subject, take) for each in (analysis, mirrored)]


def observe(analysis: TakeAnalysis, subject: str, take: str) -> Observation:
    """Observe a take on the samples' skeleton.

    Raises
    ------
    TakeError
        Nothing in it is a whole step, and nobody stands in it.
    """
    motion, vehicle = analysis.motion, analysis.vehicle
    rate, skeleton = motion.frame_rate, motion.skeleton
    ahead, passings = _passings(analysis)
    heights = signals.lowpass(motion.root_positions[:, 1], rate, 6.0)
    phases, steps, strides, running = (np.full(motion.frames, np.nan) for _ in range(4))
    for number, ((start, side), (stop, other)) in enumerate(pairwise(passings)):
        frames = np.arange(int(np.ceil(start)), int(np.ceil(stop)))
        if not _is_step(analysis, frames, ahead, (stop - start) / rate) or side == other:
            continue
        phases[frames] = np.pi * (side + (frames - start) / (stop - start))
        steps[frames], strides[frames] = number, rate / (stop - start) / 2
        running[frames] = _is_run(heights[frames], float(vehicle.speeds[frames].mean()))
    known = np.isfinite(phases)
    if not known.any() and not analysis.contacts.standing.any():
        raise TakeError("it shows no whole step and no standing")
    feet = _level_feet(analysis, known)
    floor = _floor(analysis, feet)
    rest = _rest_channels(analysis, feet, floor)
    moved = motion.rotations[:, moved_joints(skeleton)]
    still = analysis.contacts.standing
    return Observation(
        subject=subject,
        take=take,
        phases=phases[known],
        speeds=vehicle.speeds[known],
        turns=(vehicle.lateral / np.maximum(vehicle.speeds, SLOWEST))[known],
        accelerations=vehicle.tangential[known],
        running=running[known] > 0,
        steps=steps[known],
        strides=strides[known],
        joints=moved[known],
        rest=rest[known],
        stances=_stances(analysis, passings, running, floor),
        standing_joints=moved[still],
        standing_rest=rest[still],
    )


def _passings(analysis: TakeAnalysis) -> tuple[Float[Array, "frames"], list[tuple[float, int]]]:
    """How far the left ankle is ahead of the right, and when the feet pass: frame, and the foot that goes back."""
    motion = analysis.motion
    places = ground.project(kinematics.pose(motion).positions)
    left, right = (places[:, motion.skeleton.joint(f"{side}_foot")] for side in SIDES)
    way = ground.direction(analysis.vehicle.headings)
    ahead = signals.lowpass(np.sum((left - right) * way, axis=-1), motion.frame_rate, 6.0)
    at = np.flatnonzero(np.sign(ahead[1:]) != np.sign(ahead[:-1]))
    shares = ahead[at] / (ahead[at] - ahead[at + 1])
    return ahead, [(float(i + s), LEFT if ahead[i] > 0 else RIGHT) for i, s in zip(at, shares, strict=True)]


def _is_step(analysis: TakeAnalysis, frames: Array, ahead: Array, seconds: float) -> bool:
    """Whether the frames between two passings are half a cycle of somebody going forward."""
    if len(frames) < 3 or seconds > LONGEST_STEP or analysis.contacts.standing[frames].any():
        return False
    sideways = np.abs(ground.wrap(analysis.details.yaws[frames])).max() > SIDEWAYS
    slow = analysis.vehicle.speeds[frames].mean() < SLOWEST
    return bool(np.abs(ahead[frames]).max() > PASSING and not sideways and not slow)


def _is_run(heights: Float[Array, "frames"], speed: float) -> bool:
    """Whether a half cycle is one of running: the pelvis is low when the feet pass, where a walker's is high."""
    passing = (heights[0] + heights[-1]) / 2
    between = heights[len(heights) // 3 : -(len(heights) // 3)].mean()
    return speed > SLOWEST_RUN and bool(speed > FASTEST_WALK or passing < between)


def _rest_channels(
    analysis: TakeAnalysis, feet: Float[Array, "frames 2 4"], floor: Float[Array, "frames"]
) -> Float[Array, "frames channels"]:
    """Feet and motion details, the height of the pelvis told from the floor under the feet."""
    details = analysis.details
    displacements = details.displacements - np.array([0.0, 1.0, 0.0]) * floor[:, None]
    yaws = ground.wrap(details.yaws)
    tangents = quat.log(feet).reshape(len(feet), FEET)
    return np.concatenate((tangents, displacements, yaws[:, None], quat.log(details.offsets)), axis=-1)


def _level_feet(analysis: TakeAnalysis, known: Bool[Array, "frames"]) -> Float[Array, "frames 2 4"]:
    """Feet seen from the vehicle; one that stands in the middle of a stance is flat, however it was measured."""
    motion = analysis.motion
    turned = kinematics.pose(motion).rotations
    back = quat.about_y(-analysis.vehicle.headings)
    feet = []
    for column, side in enumerate(SIDES):
        planted, other = analysis.contacts.planted[:, column], analysis.contacts.planted[:, 1 - column]
        foot = quat.multiply(back, turned[:, motion.skeleton.joint(f"{side}_foot")])
        flat = analysis.contacts.standing | (planted & ~other & known)
        flat = flat if flat.any() else planted
        level = np.median(quat.log(foot[flat]), axis=0) if flat.any() else np.zeros(3)
        feet.append(quat.multiply(foot, quat.exp(-level * [1.0, 0.0, 1.0])))
    return np.stack(feet, axis=1)


def _floor(analysis: TakeAnalysis, feet: Float[Array, "frames 2 4"]) -> Float[Array, "frames"]:
    """Height of the floor along the way: recorded floors slope by centimetres a metre, and feet stand on them."""
    motion, planted = analysis.motion, analysis.contacts.planted
    world = kinematics.pose(motion).positions
    at, found = [], []
    for column, side in enumerate(SIDES):
        ankle, toe = motion.skeleton.chain(f"{side}_foot", f"{side}_toe")
        pitches = quat.to_euler(feet[:, column], "YXZ")[:, 1]
        floor = world[:, ankle, 1] - roll_over(pitches, motion.skeleton.offsets[toe])[:, 1]
        for value, start, stop in signals.runs(planted[:, column] & (np.abs(pitches) < NEARLY_FLAT)):
            if value and stop - start >= SHORTEST_FLAT * motion.frame_rate:
                at.append((start + stop - 1) / 2)
                found.append(np.median(floor[start:stop]))
    if not at:
        return np.zeros(motion.frames)
    order = np.argsort(at)
    level = np.interp(np.arange(motion.frames), np.array(at)[order], np.array(found)[order])
    return signals.lowpass(level, motion.frame_rate, 1.0)


def _stances(
    analysis: TakeAnalysis,
    passings: list[tuple[float, int]],
    running: Float[Array, "frames"],
    floor: Float[Array, "frames"],
) -> Float[Array, "stances 4"]:
    """Speed, phases of coming down and leaving, and gait of each whole stance with a passing in it.

    A foot has left when its ankle is higher than it can be while the ball still carries.
    """
    motion, found = analysis.motion, []
    heights = kinematics.pose(motion).positions[..., 1] - floor[:, None]
    for column, name in enumerate(SIDES):
        ankle, toe = motion.skeleton.chain(f"{name}_foot", f"{name}_toe")
        highest = roll_over(np.array([STEEPEST]), motion.skeleton.offsets[toe])[0, 1]
        for (before, _), (here, side), (after, _) in zip(passings, passings[1:], passings[2:], strict=False):
            frame = round(here)
            if side != column or np.isnan(running[[int(here), min(int(here) + 1, len(running) - 1)]]).any():
                continue
            for value, start, stop in signals.runs(analysis.contacts.planted[:, column]):
                if value and start <= frame < stop and start > 0 and stop < len(running):
                    high = np.flatnonzero(heights[frame:stop, ankle] > highest)
                    end = frame + int(high[0]) if len(high) else stop
                    down = np.pi * (start - 0.5 - here) / (here - before)
                    up = np.pi * (end - 0.5 - here) / (after - here)
                    found.append((analysis.vehicle.speeds[frame], down, up, running[frame]))
    return np.array(found).reshape(-1, 4)
