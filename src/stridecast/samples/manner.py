"""How somebody goes: in what manner, and how one stride differs from the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from stridecast.model.skeleton import Skeleton
from stridecast.samples.gait import DETAILS, FEET, moved_joints

Array = np.ndarray


@dataclass(frozen=True, kw_only=True)
class Manner:
    """A manner of going; what sad and happy walkers do is told by Michalak et al. (2009).

    Parameters
    ----------
    name
        What it is called.
    rhythm
        Strides a second, as a multiple of the usual.
    arms, bounce, sway
        Swing of the arms, rise and fall, side to side: multiples of the usual.
    lean
        Trunk bent forward, radians.
    bow
        Head bent forward, radians.
    """

    name: str
    rhythm: float = 1.0
    arms: float = 1.0
    bounce: float = 1.0
    sway: float = 1.0
    lean: float = 0.0
    bow: float = 0.0

    def gains(self, skeleton: Skeleton) -> Float[Array, "channels"]:
        """Factor of each channel's swing about its mean."""
        joints = moved_joints(skeleton)
        out = np.ones(3 * len(joints) + FEET + DETAILS)
        for place, joint in enumerate(joints):
            if any(joint in skeleton.chain(f"{s}_upper_arm", f"{s}_forearm") for s in ("left", "right")):
                out[3 * place : 3 * place + 3] = self.arms
        out[-DETAILS], out[-DETAILS + 1] = self.sway, self.bounce
        return out

    def offsets(self, skeleton: Skeleton) -> Float[Array, "channels"]:
        """What is added to each channel."""
        joints = moved_joints(skeleton)
        out = np.zeros(3 * len(joints) + FEET + DETAILS)
        for roles, angle in ((("spine", "spine1", "chest"), self.lean), (("neck", "head"), self.bow)):
            for role in roles:
                out[3 * joints.index(skeleton.joint(role))] = angle / len(roles)
        return out


NEUTRAL = Manner(name="neutral")
BRISK = Manner(name="brisk", rhythm=1.07, arms=1.35, bounce=1.15, sway=0.85, lean=-0.03, bow=-0.05)
GLOOMY = Manner(name="gloomy", rhythm=0.92, arms=0.45, bounce=0.75, sway=1.35, lean=0.16, bow=0.38)
MANNERS = {manner.name: manner for manner in (NEUTRAL, BRISK, GLOOMY)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Variation:
    """Chance: strides differ by about two per cent in time and a centimetre or two in place, postures by a degree.

    Same seed, same chance, at any frame rate.
    """

    seed: int
    seconds: float
    amount: float

    RATE = 20.0

    def series(self, purpose: int, count: int, slowness: float, frames: int) -> Float[Array, "frames count"]:
        """Smooth noise of unit variance that keeps its value for about ``slowness`` seconds."""
        ticks = int(np.ceil(self.seconds * self.RATE)) + 2
        noise = np.random.default_rng((self.seed, purpose)).standard_normal((ticks, count))
        width = slowness * self.RATE
        smooth = gaussian_filter1d(noise, width, axis=0, mode="reflect") * np.sqrt(2 * np.sqrt(np.pi) * width)
        at = np.linspace(0.0, self.seconds, frames, endpoint=False) * self.RATE
        return self.amount * np.stack([np.interp(at, np.arange(ticks), column) for column in smooth.T], axis=-1)

    def rhythm(self, frames: int) -> Float[Array, "frames"]:
        """Logarithm of the rhythm over the usual one."""
        return 0.02 * self.series(1, 1, 0.6, frames)[:, 0]

    def places(self, foot: int, count: int) -> Float[Array, "count 2"]:
        """How far each stance of a foot is beside the usual place, left and forward, metres."""
        noise = np.random.default_rng((self.seed, 2, foot)).standard_normal((count, 2))
        return self.amount * np.clip(noise, -2, 2) * [0.010, 0.012]

    def posture(self, channels: int, frames: int) -> Float[Array, "frames channels"]:
        """Slow wandering of the joints, radians; pelvis and feet do not wander."""
        out = 0.012 * self.series(3, channels, 0.8, frames)
        out[:, -DETAILS - FEET :] = 0.0
        return out

    def sway(self, frames: int) -> Float[Array, "frames 2"]:
        """Sway of the pelvis of somebody who stands, left and forward, metres."""
        return self.series(4, 2, 0.7, frames) * [0.006, 0.005]
