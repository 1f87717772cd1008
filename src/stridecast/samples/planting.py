"""Feet that stand where they stand: each stance rolls over heel and ball, each swing leads from one to the next."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from stridecast.body import kinematics
from stridecast.body.legs import reach
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.skeleton import Skeleton
from stridecast.samples.adult import HEEL, SOLE, STEEPEST, roll_over
from stridecast.samples.manner import Variation

Array = np.ndarray

FLAT = 0.22
"""A foot pitched less than this in a stance is pressed flat on the floor, the more the less it is pitched, radians."""

STRAIGHTEST = np.radians(7)
"""A knee is bent at least this far: a leg pulled quite straight snaps."""

CLEARANCE = 0.012
"""A swinging foot keeps so far off the floor, metres."""

RISE = 0.2
"""A foot that is lifted for that is lifted within this share of the swing, and let down within as much."""

FADE = 0.1
"""What a stance does to a foot's movement is forgotten within this time of the swing, seconds."""

STANCE_WIDTH = 0.5
"""Share of a stance, about its middle, whose mean place becomes the place where the foot stands."""


@dataclass(frozen=True, kw_only=True)
class Stance:
    """A foot on the floor: from when to when, when the feet pass, and when steps rest if they do (all in frames)."""

    start: float
    stop: float
    passing: float
    phase: float
    rest: tuple[int, int, int] | None  # first and last frame of rest, and one at which the vehicle stands still


def smooth(u: Array) -> Array:
    """0 below 0, 1 above 1, smooth between."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10 - 15 * u + 6 * u * u)


def lift_off(
    skeleton: Skeleton,
    root: Float[Array, "frames 3"],
    rotations: Float[Array, "frames joints 4"],
    stances: tuple[list[Stance], list[Stance]],
) -> tuple[list[Stance], list[Stance]]:
    """The same stances, over once the posture has the heel higher than a foot can that stands on its ball.

    A foot held on the floor beyond that would pull the leg straight, and the knee would snap.
    """
    world = kinematics.forward(skeleton, root, rotations)
    found: tuple[list[Stance], list[Stance]] = ([], [])
    for column, side in enumerate(SIDES):
        ankle, toe = skeleton.chain(f"{side}_foot", f"{side}_toe")
        heights = world.positions[:, ankle, 1]
        highest = float(roll_over(np.array([STEEPEST]), skeleton.offsets[toe])[0, 1])
        found[column].extend(_lifted(stance, heights, highest) for stance in stances[column])
    return found


def _lifted(stance: Stance, heights: Float[Array, "frames"], highest: float) -> Stance:
    rested = 0 if stance.rest is None else stance.rest[1]
    first = max(rested, int(np.ceil(max(stance.start, stance.passing, 0.0))))
    high = first + np.flatnonzero(heights[first : max(first, int(np.floor(stance.stop)) + 1)] > highest)
    if not len(high):
        return stance
    at = int(high[0])
    if at == first:
        return replace(stance, stop=at - 0.5)
    share = (highest - heights[at - 1]) / (heights[at] - heights[at - 1])
    return replace(stance, stop=at - 1 + float(share))


def plant(
    skeleton: Skeleton,
    root: Float[Array, "frames 3"],
    rotations: Float[Array, "frames joints 4"],
    stances: tuple[list[Stance], list[Stance]],
    headings: Float[Array, "frames"],
    rate: float,
    chance: Variation,
) -> tuple[Float[Array, "frames 3"], Float[Array, "frames joints 4"]]:
    """The same motion with feet that stand where they stand; the pelvis sinks where a leg would not reach."""
    world = kinematics.forward(skeleton, root, rotations)
    feet = [_foot(skeleton, world, side, stances[column], headings, rate, chance) for column, side in enumerate(SIDES)]
    root = root - np.array([0.0, 1.0, 0.0]) * _sinking(skeleton, world, [foot.ankles for foot in feet], rate)[:, None]
    for side, foot in zip(SIDES, feet, strict=True):
        ankle, toe = skeleton.chain(f"{side}_foot", f"{side}_toe")
        above = kinematics.forward(skeleton, root, rotations).rotations[:, skeleton.parents[ankle]]
        rotations[:, ankle] = quat.multiply(quat.inverse(above), foot.rotations)
        rotations = reach(skeleton, root, rotations, side, foot.ankles)
        rotations[:, toe] = foot.toes
    return root, quat.continuous(quat.normalize(rotations))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Foot:
    """Where a foot goes: ankles and rotations in the world, toes against the foot."""

    ankles: Float[Array, "frames 3"]
    rotations: Float[Array, "frames 4"]
    toes: Float[Array, "frames 4"]


def _foot(
    skeleton: Skeleton,
    world: kinematics.World,
    side: str,
    stances: list[Stance],
    headings: Float[Array, "frames"],
    rate: float,
    chance: Variation,
) -> _Foot:
    """One foot: in a stance it rolls over heel and toe, in a swing it goes from one stance to the next."""
    ankle, toe = skeleton.chain(f"{side}_foot", f"{side}_toe")
    ball = skeleton.offsets[toe]
    ankles, turned = world.positions[:, ankle], world.rotations[:, ankle]
    balls = ground.project(ankles + quat.rotate(turned, ball))
    frames = len(ankles)
    places = chance.places(SIDES.index(side), len(stances))
    # Corrections to rotation (vectors in the world) and ankle: known in stances, smooth between.
    corrections, known = np.zeros((frames, 6)), np.zeros(frames, bool)
    for stance, beside in zip(stances, places, strict=True):
        at = np.arange(max(0, int(np.ceil(stance.start))), min(frames - 1, int(np.floor(stance.stop))) + 1)
        if len(at) == 0:
            continue
        middle = _middle(stance, at)
        yaws, pitches = quat.to_euler(turned[at], "YXZ")[:, :2].T
        yaw = float(np.unwrap(yaws)[middle - at[0]].mean())
        place = balls[middle].mean(axis=0)
        if stance.rest is None:
            place = place + ground.turn(beside, np.asarray(headings[middle[len(middle) // 2]]))
        pitches = _pitch_in_stance(pitches, ankles[at, 1], ball, at, stance, rate)
        level = quat.about_y(yaw)
        standing = quat.multiply(level, quat.exp(pitches[:, None] * _LEFTWARD))
        corrections[at, :3] = quat.log(quat.multiply(standing, quat.inverse(turned[at])))
        corrections[at, 3:] = ground.lift(place) + quat.rotate(level, roll_over(pitches, ball)) - ankles[at]
        known[at] = True
    _bridge(corrections, known, FADE * rate)
    turned = quat.multiply(quat.exp(corrections[:, :3]), turned)
    ankles = _clear(ankles + corrections[:, 3:], turned, ball, known)
    tip = skeleton.end_offsets[list(skeleton.end_joints).index(toe)]
    bend = _toe_bend(turned, ankles[:, 1] + quat.rotate(turned, ball)[:, 1], tip, known)
    return _Foot(ankles=ankles, rotations=turned, toes=quat.exp(-bend[:, None] * _LEFTWARD))


_LEFTWARD = np.array([1.0, 0.0, 0.0])


def _elevation(turned: Float[Array, "frames 4"]) -> Float[Array, "frames"]:
    """Sine of the angle by which feet point upward."""
    return quat.rotate(turned, np.array([0.0, 0.0, 1.0]))[:, 1]


def _middle(stance: Stance, at: Array) -> Array:
    """Frames whose mean place is where the foot stands."""
    if stance.rest is not None:
        return np.array([stance.rest[2]])
    half = STANCE_WIDTH * (stance.stop - stance.start) / 2
    centre = np.clip((stance.start + stance.stop) / 2, at[0], at[-1])
    return at[np.abs(at - centre) <= max(half, 1.0)]


def _pitch_in_stance(pitches: Array, heights: Array, ball: Array, at: Array, stance: Stance, rate: float) -> Array:
    """Pitch of a standing foot.

    At first it is what the posture says, a small one pressed flat; later what the height of the ankle asks for; at rest
    the foot is flat.
    """
    long, level = np.hypot(ball[1], ball[2]), np.arctan2(-ball[1], ball[2])
    lifted = np.arcsin(np.clip((heights - SOLE) / long, np.sin(level), 0.98)) - level
    early = 0.6 * stance.start + 0.4 * stance.passing
    late = smooth((at - early) / (0.6 * (stance.stop - early)))
    out = (1 - late) * pitches * smooth(np.abs(pitches) / FLAT) + late * lifted
    if stance.rest is not None:
        first, last, _ = stance.rest
        since = stance.passing if stance.passing <= first else stance.start + 0.03 * rate
        before = 1 - smooth((at - since) / (0.15 * rate))
        after = smooth((at - last) / (0.2 * rate))
        out = out * np.maximum(before if stance.start > 0 else 0.0, after)
    return out


def _bridge(corrections: Float[Array, "frames 6"], known: Bool[Array, "frames"], fade: float) -> None:
    """Fill unknown stretches smoothly; slopes of known ones fade within ``fade`` frames.

    Where the take cuts a swing, it leads from or to the foot of the posture, beside which only its place stays.
    """
    usual = _usual_swing(known)
    for value, start, stop in signals.runs(known):
        if value or not known.any():
            continue
        left, right = start - 1, stop
        ends = [
            corrections[left] if left >= 0 else corrections[right] * _PLACE,
            corrections[right] if right < len(known) else corrections[left] * _PLACE,
        ]
        slopes = [
            (corrections[left] - corrections[left - 1]) if left > 0 and known[left - 1] else np.zeros(6),
            (corrections[right + 1] - corrections[right])
            if right + 1 < len(known) and known[right + 1]
            else np.zeros(6),
        ]
        first = left if left >= 0 else min(left, right - usual)
        last = right if right < len(known) else max(right, left + usual)
        span = last - first
        since = (np.arange(start, stop) - first)[:, None].astype(float)
        blend = smooth(since / span)
        corrections[start:stop] = (
            (1 - blend) * ends[0]
            + blend * ends[1]
            + slopes[0] * _fading(since, min(fade, span / 2))
            - slopes[1] * _fading(span - since, min(fade, span / 2))
        )


_PLACE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 1.0])
"""What of a correction is the place on the floor."""


def _usual_swing(known: Bool[Array, "frames"]) -> float:
    """Frames that a swing takes."""
    return max(1.0, float(np.median([run.stop - run.start for run in signals.runs(known) if not run.value] or [1])))


def _fading(since: Array, fade: float) -> Array:
    """A slope of one at the start that is gone after ``fade`` frames."""
    return since * np.maximum(1 - since / fade, 0.0) ** 2


def _clear(
    ankles: Float[Array, "frames 3"],
    turned: Float[Array, "frames 4"],
    ball: Float[Array, "3"],
    known: Bool[Array, "frames"],
) -> Float[Array, "frames 3"]:
    """A swinging foot lifted where its heel or ball would brush the floor."""
    heel, sole = (quat.rotate(turned, point)[:, 1] for point in (HEEL, ball))
    missing = np.maximum(CLEARANCE - (ankles[:, 1] + np.minimum(heel, sole - SOLE)), 0.0)
    under = np.maximum(missing - CLEARANCE, 0.0)
    usual = _usual_swing(known)
    for value, start, stop in signals.runs(known):
        if value:
            continue
        whole = stop - start if start > 0 and stop < len(known) else max(usual, stop - start)
        frames = np.arange(start, stop)
        since = (frames - start + 1) / (whole + 1) if start > 0 else np.ones(len(frames))
        left = (stop - frames) / (whole + 1) if stop < len(known) else np.ones(len(frames))
        lifted = smooth(since / RISE) * smooth(left / RISE)
        need = np.maximum(missing[start:stop] * lifted, under[start:stop] / np.maximum(lifted, 0.2))
        ankles[start:stop, 1] += need.max() * lifted
    return ankles


def _toe_bend(
    turned: Float[Array, "frames 4"],
    balls: Float[Array, "frames"],
    tip: Float[Array, "3"],
    known: Bool[Array, "frames"],
) -> Float[Array, "frames"]:
    """How far toes are bent up against the foot: as flat as they lie, and so far that they keep above the floor."""
    heel_up = np.arcsin(np.clip(-_elevation(turned), 0.0, 1.0))
    long, low = np.hypot(tip[1], tip[2]), np.arctan2(-tip[1], tip[2])
    steepest = np.arcsin(np.clip((balls - SOLE - tip[1]) / long, -1.0, 1.0)) - low
    return np.maximum(heel_up * _toes_flat(known), heel_up - steepest)


def _toes_flat(known: Bool[Array, "frames"]) -> Float[Array, "frames"]:
    """Toes lie on the floor while the foot stands, and follow the foot in the swing."""
    out = np.ones(len(known))
    usual = _usual_swing(known)
    for value, start, stop in signals.runs(known):
        if not value:
            frames, whole = np.arange(start, stop), max(usual, stop - start)
            left = smooth((frames - start + 1) / (0.35 * whole)) if start > 0 else 1.0
            lands = smooth((stop - frames) / (0.25 * whole)) if stop < len(known) else 1.0
            out[start:stop] = 1 - left * lands
    return out


def _sinking(
    skeleton: Skeleton, world: kinematics.World, ankles: list[Float[Array, "frames 3"]], rate: float
) -> Float[Array, "frames"]:
    """How far the pelvis must sink so that both legs reach with a bent knee, smooth in time."""
    need = np.zeros(len(ankles[0]))
    for side, goal in zip(SIDES, ankles, strict=True):
        thigh, shin, foot = skeleton.chain(f"{side}_thigh", f"{side}_shin", f"{side}_foot")
        upper, lower = (float(np.linalg.norm(skeleton.offsets[joint])) for joint in (shin, foot))
        longest = np.sqrt(upper**2 + lower**2 + 2 * upper * lower * np.cos(STRAIGHTEST))
        hip = world.positions[:, thigh]
        across = np.sum((hip - goal)[:, [0, 2]] ** 2, axis=-1)
        reach_up = np.sqrt(np.maximum(longest**2 - across, 0.0))
        need = np.maximum(need, hip[:, 1] - goal[:, 1] - reach_up)
    width = 0.05 * rate
    return gaussian_filter1d(maximum_filter1d(need, 2 * round(2 * width) + 1, mode="nearest"), width, mode="nearest")
