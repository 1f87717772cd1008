"""A clip: a stretch of movement with its way over the ground and its contacts, ready to be blended and joined."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np
from jaxtyping import Bool, Float

from stridecast.errors import MotionError
from stridecast.model.motion import Motion

Array = np.ndarray

LETTERS = "SLRDF"
"""Support states: stand, left, right, double, flight."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Clip:
    """A motion that is understood.

    Parameters
    ----------
    motion
        On the floor, which is at height 0.
    positions, headings
        Of the vehicle at every frame: ground points ``(x, z)`` (m), radians (not wrapped).
    support
        Support state of every frame, a letter each.

    Raises
    ------
    MotionError
        Parts that differ in length, numbers that are not finite, letters that are no support state.
    """

    motion: Motion
    positions: Float[Array, "frames 2"]
    headings: Float[Array, "frames"]
    support: str

    def __post_init__(self) -> None:
        frames = self.motion.frames
        for name, shape in (("positions", (frames, 2)), ("headings", (frames,))):
            array = np.array(getattr(self, name), np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise MotionError(f"{name} of a clip of {frames} frames must be finite, of shape {shape}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if len(self.support) != frames:
            raise MotionError(f"a clip of {frames} frames needs as many support states, not {len(self.support)}")
        if wrong := set(self.support) - set(LETTERS):
            raise MotionError(f"there is no support state {min(wrong)!r}; there are {', '.join(LETTERS)}")

    @property
    def planted(self) -> Bool[Array, "frames 2"]:
        """Which foot stands at every frame, left and right."""
        return planted_in(self.support)

    @property
    def string(self) -> str:
        """Support states in order, each stretch once."""
        return "".join(state for state, _ in groupby(self.support))

    @property
    def speed(self) -> float:
        """Mean speed of the vehicle, m/s."""
        way = float(np.linalg.norm(np.diff(self.positions, axis=0), axis=-1).sum())
        return way / self.motion.seconds if self.motion.frames > 1 else 0.0

    def cut(self, start: int, stop: int) -> Clip:
        """Frames ``start`` to ``stop`` (exclusive) as a clip of their own."""
        return Clip(
            motion=self.motion.clip(start, stop),
            positions=self.positions[start:stop],
            headings=self.headings[start:stop],
            support=self.support[start:stop],
        )


def planted_in(support: str) -> Bool[Array, "frames 2"]:
    """Which foot stands in each of these support states, left and right."""
    return np.array([(state in "LDS", state in "RDS") for state in support], bool).reshape(-1, 2)
