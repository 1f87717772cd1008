"""Groups of like segments, and which group can follow which (KS05)."""

from __future__ import annotations

from dataclasses import dataclass

from stridecast.model.bounds import SteeringBounds


@dataclass(frozen=True, kw_only=True)
class MotionGroup:
    """All segments with the same string and the same coarse motion.

    Parameters
    ----------
    name
        ``motion/string``, for instance ``walk/LDR``.
    motion, string
        Coarse motion and support states.
    start, stop
        Kinds of boundary it runs between (see ``Boundary``).
    keys
        Where the support state changes in generic time, 0 to 1; one fewer than letters.
    first, count
        Its examples: rows ``first`` to ``first + count`` of the database's tables.
    bounds
        How its people steered.
    """

    name: str
    motion: str
    string: str
    start: str
    stop: str
    keys: tuple[float, ...]
    first: int
    count: int
    bounds: SteeringBounds

    @property
    def comes_from(self) -> str:
        """Motion it begins in."""
        return self.motion.split("-")[0]

    @property
    def leads_to(self) -> str:
        """Motion it ends in."""
        return self.motion.split("-")[-1]

    @property
    def rows(self) -> slice:
        """Its examples in the tables."""
        return slice(self.first, self.first + self.count)
