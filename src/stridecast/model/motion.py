"""A recording or a synthesised clip: one skeleton, posed at a steady rate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from stridecast.errors import MotionError
from stridecast.model.skeleton import Skeleton


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A skeleton in motion, in the conventions of the package (metres, +Y up, ``w x y z``).

    Parameters
    ----------
    skeleton
        Whose motion it is.
    frame_rate
        Frames a second.
    root_positions
        Place of the root in the world, metres.
    rotations
        Unit quaternions ``w x y z``: joint to parent, the root's in the world; sign-continuous along the frames.
    name, subject, source
        Name of the take, the person in it, and the file it came from.

    Raises
    ------
    MotionError
        Shapes that do not fit, no frames, a frame rate that is not positive, numbers that are not finite (the first
        such frame and joint are named).
    """

    skeleton: Skeleton
    frame_rate: float
    root_positions: Float[np.ndarray, "frames 3"]
    rotations: Float[np.ndarray, "frames joints 4"]
    name: str = ""
    subject: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        for name in ("root_positions", "rotations"):
            array = np.array(getattr(self, name), np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        frames, joints = len(self.root_positions), self.skeleton.joints
        if self.root_positions.shape != (frames, 3) or self.rotations.shape != (frames, joints, 4):
            raise MotionError(
                f"a motion of {joints} joints needs root_positions (frames, 3) and rotations (frames, {joints}, 4), "
                f"not {self.root_positions.shape} and {self.rotations.shape}"
            )
        if frames == 0:
            raise MotionError("a motion needs at least one frame")
        if not (np.isfinite(self.frame_rate) and self.frame_rate > 0):
            raise MotionError(f"the frame rate must be a positive number, not {self.frame_rate}")
        if not np.isfinite(self.root_positions).all():
            frame = int(np.argwhere(~np.isfinite(self.root_positions))[0, 0])
            raise MotionError(f"root position is not finite at frame {frame}")
        if not np.isfinite(self.rotations).all():
            frame, joint = (int(i) for i in np.argwhere(~np.isfinite(self.rotations))[0, :2])
            raise MotionError(f"rotation of joint {self.skeleton.names[joint]!r} is not finite at frame {frame}")

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.root_positions)

    @property
    def seconds(self) -> float:
        """Time from the first frame to the last."""
        return (self.frames - 1) / self.frame_rate

    def clip(self, start: int, stop: int) -> Motion:
        """Frames ``start`` to ``stop`` (exclusive) as a motion of their own."""
        return replace(self, root_positions=self.root_positions[start:stop], rotations=self.rotations[start:stop])
