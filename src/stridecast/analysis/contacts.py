"""Foot contacts: a foot is planted while its ankle or toe hardly moves and is near the floor (BJL eq. 2)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from stridecast.body import kinematics
from stridecast.body.kinematics import World
from stridecast.body.mass import center_of_mass
from stridecast.geometry import ground, signals
from stridecast.model.contacts import SIDES, Contacts
from stridecast.model.motion import Motion

ENTER_SPEED = (0.35, 0.18)
"""A foot comes to stand below this speed: m/s for a leg of one metre, plus a share of the walker's own speed (a
runner's soft shoe rolls faster than a walker's)."""

LEAVE_SPEED = (0.5, 0.22)
"""It leaves above this speed, the same way."""

NEAR_FLOOR = 0.075
"""How far above its height when flat an ankle or toe may be, as a part of the leg's length."""

SHORTEST = 0.06
"""Gaps and blips shorter than this are closed, seconds."""

STANDING_SPEED = 0.13
"""Standing is both feet planted with the centre of mass slower than this, m/s, and ..."""

STANDING_RADIUS = 0.05
"""... inside this radius about its mean over the stretch, metres for a leg of one metre, and ..."""

STANDING_TIME = 0.2
"""... for at least this long, seconds."""


def find_contacts(motion: Motion, world: World | None = None) -> Contacts:
    """Contacts and floor height of a take.

    Parameters
    ----------
    motion
        Any rate; thresholds are in metres a second and scale with the leg.
    world
        Its joints in the world, if they are at hand.
    """
    world = kinematics.pose(motion) if world is None else world
    skeleton, rate, leg = motion.skeleton, motion.frame_rate, motion.skeleton.leg_length
    mass = signals.lowpass(center_of_mass(skeleton, world), rate, 6.0)
    speed = np.linalg.norm(signals.rate_of_change(ground.project(mass), rate), axis=-1)
    feet = [signals.lowpass(world.positions[:, skeleton.chain(f"{s}_foot", f"{s}_toe")], rate, 12.0) for s in SIDES]
    floor = _floor(feet)
    planted = np.stack([_planted(foot, speed, rate, leg) for foot in feet], axis=-1)
    return Contacts(planted=planted, standing=_standing(mass, speed, planted, rate, leg), floor=floor)


def _floor(feet: list[Float[np.ndarray, "frames 2 3"]]) -> float:
    """Height on which the toes stand: the lowest both toes come, each taken robustly. Toe joints lie in the sole."""
    return float(min(np.percentile(foot[:, 1, 1], 4) for foot in feet))


def _planted(
    foot: Float[np.ndarray, "frames 2 3"], walker_speed: Float[np.ndarray, "frames"], rate: float, leg: float
) -> Bool[np.ndarray, "frames"]:
    """Contact of one foot from its ankle and toe."""
    speed = np.linalg.norm(signals.rate_of_change(foot, rate), axis=-1)
    flat = np.percentile(foot[..., 1], 4, axis=0)
    near = foot[..., 1] < flat + NEAR_FLOOR * leg
    enter, leave = ((a * leg + b * walker_speed)[:, None] for a, b in (ENTER_SPEED, LEAVE_SPEED))
    on = ((speed < enter) & near).any(axis=-1)
    stay = ((speed < leave) & near).any(axis=-1)
    shortest = round(SHORTEST * rate)
    return signals.close_gaps(signals.switch(on, stay), shortest, shortest)


def _standing(
    mass: Float[np.ndarray, "frames 3"],
    speed: Float[np.ndarray, "frames"],
    planted: Bool[np.ndarray, "frames 2"],
    rate: float,
    leg: float,
) -> Bool[np.ndarray, "frames"]:
    """Stretches in which the centre of mass hardly moves."""
    still = signals.switch(speed < 0.7 * STANDING_SPEED, speed < STANDING_SPEED) & planted.all(axis=-1)
    still = signals.close_gaps(still, round(SHORTEST * rate), 0)
    for value, start, stop in signals.runs(still):
        if not value:
            continue
        place = ground.project(mass[start:stop])
        spread = np.linalg.norm(place - place.mean(axis=0), axis=-1).max()
        if stop - start < STANDING_TIME * rate or spread > 2 * STANDING_RADIUS * leg:
            still[start:stop] = False
    return still
