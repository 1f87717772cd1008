"""Size of movement: gains per frequency band over joint curves, feet kept on the floor (Bruderlin and Williams 1995).

What is slowest in a joint's curve is its posture, which stays; steps and their swing lie about one and two hertz; what
is fastest is tremor and the noise of the recording. Each band has its gain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from jaxtyping import Bool, Float

from stridecast.analysis.contacts import find_contacts
from stridecast.body.limits import within_limits
from stridecast.body.planting import Feet, corrected, feet_of, put_feet, reach_of
from stridecast.errors import MotionError
from stridecast.geometry import pyramid
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.motion import Motion
from stridecast.model.scene import SIZES

Array = np.ndarray

FREQUENCIES = (0.4, 0.8, 1.6, 3.2, 6.4)
"""Where one band ends and the next begins, Hz."""

GAINS: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {
        "calm": (1.0, 0.75, 0.65, 0.6, 0.6, 0.6),
        "neutral": (1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
        "lively": (1.0, 1.15, 1.3, 1.3, 1.15, 1.0),
        "exaggerated": (1.0, 1.3, 1.65, 1.6, 1.25, 1.0),
    }
)
"""Gains of the sizes (``SIZES``), the slowest band first; they mean the same at any frame rate."""

GREATEST = 4.0
"""Nobody's gain is greater."""

CLEARANCE = 0.6
"""A swinging foot is lifted at least to this part of the height it had."""

assert set(GAINS) == set(SIZES)


def gains_of(size: str | Sequence[float]) -> tuple[float, ...]:
    """Gains of a size, or gains as they are, checked.

    Raises
    ------
    MotionError
        A size that does not exist, or gains that are no numbers from 0 to 4, one a band; the message lists what there
        is.
    """
    if isinstance(size, str):
        try:
            return GAINS[size]
        except KeyError:
            raise MotionError(f"there is no size {size!r} of movement; there are {', '.join(SIZES)}") from None
    gains = tuple(float(gain) for gain in size)
    bands = len(FREQUENCIES) + 1
    if len(gains) != bands or not all(0 <= gain <= GREATEST for gain in gains):
        limits = ", ".join(f"{f:g}" for f in FREQUENCIES)
        raise MotionError(
            f"gains are {bands} numbers from 0 to {GREATEST:g}, for the bands below, between and above {limits} Hz, "
            f"not {list(gains)}"
        )
    return gains


def resize(
    motion: Motion,
    size: str | Sequence[float],
    *,
    planted: Bool[Array, "frames 2"] | None = None,
    cyclic: bool = False,
) -> Motion:
    """Make a motion's movements larger or smaller; steps stay where they are.

    Joints swing more or less about their posture, and the pelvis bounces, tilts and yaws so. The way over the ground is
    that of the motion, and so is everything a planted foot does; legs bend to it, and the pelvis sinks where a leg
    would not reach. Knees and elbows never bend backwards (see ``body.limits``). With gains of one the motion comes
    back (Bruderlin and Williams 1995, section 2.1).

    Parameters
    ----------
    motion
        Any motion of a body with legs.
    size
        One of ``calm``, ``neutral``, ``lively``, ``exaggerated``, or gains, one a band (see ``FREQUENCIES``), the
        slowest first.
    planted
        Which foot stands when, left and right; found in the motion if left out.
    cyclic
        Whether the motion is a cycle whose last frame is its first one, moved on: then it stays one.

    Raises
    ------
    MotionError
        No such size; contacts of another number of frames.
    SkeletonError
        A joint of the legs is missing.
    """
    gains = gains_of(size)
    if planted is None:
        planted = find_contacts(motion).planted
    if len(planted) != motion.frames:
        raise MotionError(f"contacts of {len(planted)} frames do not fit a motion of {motion.frames} frames")
    if all(gain == 1.0 for gain in gains):
        return motion
    moved = _moved(motion, gains, cyclic)
    before, free = feet_of(motion), feet_of(moved)
    reaches = reach_of(motion, planted)
    if cyclic:
        return _round(moved, before, free, planted, reaches)
    feet = lifted(corrected(free, before, planted, motion.frame_rate), before, planted)
    return put_feet(moved, feet, planted, reaches)


def _moved(motion: Motion, gains: tuple[float, ...], cyclic: bool) -> Motion:
    """Joint curves, the pelvis's turn and its height with their gains; feet go where they will."""
    skeleton, rate = motion.skeleton, motion.frame_rate
    toes = [skeleton.joint(f"{side}_toe") for side in SIDES]

    def scaled(curve: Array, own: tuple[float, ...] = gains) -> Array:
        if not cyclic:
            return pyramid.join(pyramid.split(curve, rate, FREQUENCIES), own)
        drift = np.linspace(0.0, 1.0, len(curve)).reshape(-1, *[1] * (curve.ndim - 1)) * (curve[-1] - curve[0])
        bands = pyramid.split((curve - drift)[:-1], rate, FREQUENCIES, cyclic=True)
        once = pyramid.join(bands, own)
        return np.concatenate((once, once[:1])) + drift

    mean = quat.mean(motion.rotations)
    curves = quat.log(quat.multiply(quat.inverse(mean), motion.rotations))
    rotations = quat.multiply(mean, quat.exp(scaled(curves)))
    rotations[:, toes] = motion.rotations[:, toes]

    # The pelvis: it turns with the way, so its yaw is taken out, and slow turning is steering, which stays.
    yaw = np.unwrap(quat.twist_about_y(motion.rotations[:, 0]))
    tilt = quat.log(quat.multiply(quat.about_y(-yaw), motion.rotations[:, 0]))
    slow = (1.0, 1.0, *gains[2:])
    rotations[:, 0] = quat.multiply(quat.about_y(scaled(yaw, slow)), quat.exp(scaled(tilt)))
    rotations = within_limits(skeleton, rotations, motion.rotations)
    root = motion.root_positions.copy()
    root[:, 1] = scaled(root[:, 1])
    return replace(motion, root_positions=root, rotations=quat.continuous(quat.normalize(rotations)))


def lifted(feet: Feet, before: Feet, planted: Bool[Array, "frames 2"]) -> Feet:
    """Feet that swing at ``CLEARANCE`` of their height before, or higher, so that they do not brush the floor."""
    toes = feet.toes.copy()
    for side in range(2):
        floor = float(before.toes[:, side, 1].min())
        least = floor + CLEARANCE * (before.toes[:, side, 1] - floor)
        low = np.where(planted[:, side], 0.0, least - toes[:, side, 1])
        soft = 0.004
        toes[:, side, 1] += np.where(low > 0, low * low / (low + soft), 0.0)
    return replace(feet, toes=toes)


def _round(
    moved: Motion, before: Feet, free: Feet, planted: Bool[Array, "frames 2"], reaches: Float[Array, "2 2"]
) -> Motion:
    """Put the feet of a cycle: as in the middle one of three."""
    count = moved.frames - 1
    ways = moved.root_positions[-1] - moved.root_positions[0]
    ways[1] = 0.0
    turn = float(quat.twist_about_y(quat.multiply(moved.rotations[-1, 0], quat.inverse(moved.rotations[0, 0]))))
    place = moved.root_positions[0] * [1.0, 0.0, 1.0]

    def thrice(points: Array, rotations: bool) -> Array:
        out = []
        for cycle in (-1, 0, 1):
            turned = quat.about_y(cycle * turn)
            once = points[: count + (cycle == 1)]
            if rotations:
                out.append(quat.multiply(turned, once))
            else:
                there = place + ways if cycle == 1 else place - quat.rotate(turned, ways) if cycle == -1 else place
                out.append(quat.rotate(turned, once - place) + there)
        return np.concatenate(out)

    body = np.concatenate([moved.rotations[: count + (cycle == 1)] for cycle in (-1, 0, 1)])
    body[:, 0] = thrice(moved.rotations[:, 0], True)
    long = replace(moved, root_positions=thrice(moved.root_positions, False), rotations=quat.continuous(body))
    stands = np.concatenate([planted[: count + (cycle == 1)] for cycle in (-1, 0, 1)])
    was, now = (Feet(toes=thrice(feet.toes, False), turns=thrice(feet.turns, True)) for feet in (before, free))
    feet = lifted(corrected(now, was, stands, moved.frame_rate), was, stands)
    return put_feet(long, feet, stands, reaches).clip(count, 2 * count + 1)
