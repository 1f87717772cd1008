"""Feet that stand where they stand: each stance rolls over heel and ball, each swing leads from one to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from stridecast.body import kinematics
from stridecast.body.legs import reach
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.skeleton import Skeleton
from stridecast.samples.adult import HEEL, SOLE, roll_over
from stridecast.samples.manner import Variation

Array = np.ndarray

FLAT = 0.22
"""A foot pitched less than this in a stance is pressed flat on the floor, the more the less it is pitched, radians."""

STRAIGHTEST = np.radians(7)
"""A knee is bent at least this far: a leg pulled quite straight snaps."""

CLEARANCE = 0.012
"""A swinging foot keeps so far off the floor, metres."""

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
            place = place + ground.turn(beside, headings[middle[len(middle) // 2]])
        pitches = _pitch_in_stance(pitches, ankles[at, 1], ball, at, stance, rate)
        level = quat.about_y(yaw)
        standing = quat.multiply(level, quat.exp(pitches[:, None] * _LEFTWARD))
        corrections[at, :3] = quat.log(quat.multiply(standing, quat.inverse(turned[at])))
        corrections[at, 3:] = ground.lift(place) + quat.rotate(level, roll_over(pitches, ball)) - ankles[at]
        known[at] = True
    _bridge(corrections, known, FADE * rate)
    turned = quat.multiply(quat.exp(corrections[:, :3]), turned)
    ankles = _clear(ankles + corrections[:, 3:], turned, ball, known)
    heel_up = np.arcsin(np.clip(-_elevation(turned), 0.0, 1.0))
    return _Foot(ankles=ankles, rotations=turned, toes=quat.exp(-(heel_up * _toes_flat(known))[:, None] * _LEFTWARD))


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
    """Fill unknown stretches smoothly, constant beyond the ends; slopes of known ones fade within ``fade`` frames."""
    for value, start, stop in signals.runs(known):
        if value:
            continue
        left, right = start - 1, stop
        if left < 0 or right >= len(known):
            corrections[start:stop] = corrections[right if left < 0 else left] if known.any() else 0.0
            continue
        span = float(right - left)
        slopes = [
            (corrections[left] - corrections[left - 1]) if left > 0 and known[left - 1] else np.zeros(6),
            (corrections[right + 1] - corrections[right])
            if right + 1 < len(known) and known[right + 1]
            else np.zeros(6),
        ]
        since = (np.arange(start, stop) - left)[:, None].astype(float)
        blend = smooth(since / span)
        corrections[start:stop] = (
            (1 - blend) * corrections[left]
            + blend * corrections[right]
            + slopes[0] * _fading(since, min(fade, span / 2))
            - slopes[1] * _fading(span - since, min(fade, span / 2))
        )


def _fading(since: Array, fade: float) -> Array:
    """A slope of one at the start that is gone after ``fade`` frames."""
    return since * np.maximum(1 - since / fade, 0.0) ** 2


def _clear(ankles: Array, turned: Array, ball: Array, known: Array) -> Float[Array, "frames 3"]:
    """A swinging foot lifted where its heel or ball would brush the floor."""
    heel, sole = (quat.rotate(turned, point)[:, 1] for point in (HEEL, ball))
    missing = np.maximum(CLEARANCE - (ankles[:, 1] + np.minimum(heel, sole - SOLE)), 0.0)
    for value, start, stop in signals.runs(known):
        if not value and start > 0 and stop < len(known):
            u = (np.arange(start, stop) - start + 1) / (stop - start + 1)
            need = float((missing[start:stop] * np.minimum(1.0, 3 * np.sin(np.pi * u))).max())
            ankles[start:stop, 1] += need * np.sin(np.pi * u) ** 2
    return ankles


def _toes_flat(known: Array) -> Float[Array, "frames"]:
    """Toes lie on the floor while the foot stands, and follow the foot in the swing."""
    out = np.ones(len(known))
    usual = max(1.0, float(np.median([r.stop - r.start for r in signals.runs(known) if not r.value] or [1])))
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
