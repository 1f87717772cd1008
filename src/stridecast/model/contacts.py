"""When each foot stands on the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

LEFT, RIGHT = 0, 1
"""Columns of everything that comes in two feet."""

SIDES = ("left", "right")


@dataclass(frozen=True, kw_only=True, eq=False)
class Contacts:
    """Which foot is planted at which frame.

    Parameters
    ----------
    planted
        One row a frame; columns ``LEFT`` and ``RIGHT``.
    standing
        Frames at which the person stands still on both feet.
    floor
        Height of the floor in the recording, metres.
    """

    planted: Bool[np.ndarray, "frames 2"]
    standing: Bool[np.ndarray, "frames"]
    floor: float

    def __post_init__(self) -> None:
        for name in ("planted", "standing"):
            array = np.array(getattr(self, name), bool)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def support(self) -> str:
        """Support state of every frame: S stand, L left, R right, D double, F flight."""
        letters = np.array(list("FLRD"))[self.planted[:, LEFT] + 2 * self.planted[:, RIGHT]]
        return "".join(np.where(self.standing, "S", letters).tolist())
