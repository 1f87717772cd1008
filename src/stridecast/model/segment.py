"""A segment of a take: half a cycle, from one centre-of-mass height peak to the next (KS05)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class Phase(NamedTuple):
    """A support phase: its letter (S, L, R, D or F) and frames ``start`` to ``stop`` (exclusive)."""

    state: str
    start: int
    stop: int


class MidStance(NamedTuple):
    """The middle frame of a foot's support phase; ``side`` is ``LEFT`` or ``RIGHT``."""

    frame: float
    side: int


class Boundary(NamedTuple):
    """Where a stream is cut: a frame and what kind of moment it is.

    ``kind`` is S (end or beginning of standing), L or R (mid-stance on that foot) or FL or FR (mid-flight, that foot
    lands next).
    """

    frame: int
    kind: str


STAND, WALK, RUN = "stand", "walk", "run"
MOTIONS = (STAND, WALK, RUN)
"""The motion types a user can ask for."""


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A stretch of a take between two boundaries.

    Parameters
    ----------
    start, stop
        The boundaries it lies between.
    string
        Its support states in order, ``LDR`` for instance.
    keys
        Frames at which the support state changes; one fewer than letters.
    motion
        ``stand``, ``walk``, ``run``, or a transition such as ``walk-run``.
    """

    start: Boundary
    stop: Boundary
    string: str
    keys: tuple[int, ...]
    motion: str

    @property
    def frames(self) -> int:
        """Frames from boundary to boundary."""
        return self.stop.frame - self.start.frame

    @property
    def group(self) -> str:
        """Name of the group it belongs to: segments of one group can be warped onto each other without search."""
        return f"{self.motion}/{self.string}"
