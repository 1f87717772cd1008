"""What is told about examples and takes without anybody having labelled them (BJL 4.1)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float

from stridecast.errors import DatabaseError

Array = np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Annotations:
    """What each example shows, one column a quantity; its status is the motion of its group.

    Parameters
    ----------
    speed, start_speed, end_speed
        Of the vehicle: mean over the example, at its first and at its last frame, m/s.
    turn
        Mean turning of the vehicle, to the left, rad/s.
    cadence
        Steps a second; 0 where it is no half cycle of walking or running.
    spread
        Standard deviation of the joints of the upper body, radians.
    stoop
        How far trunk and head are bent forward, radians.
    style
        From gloomy (-1) to brisk (+1), 0 is usual at this speed; see ``analysis.style``.

    Raises
    ------
    DatabaseError
        Columns of different length, or numbers that are not finite.
    """

    speed: Float[Array, "examples"]
    start_speed: Float[Array, "examples"]
    end_speed: Float[Array, "examples"]
    turn: Float[Array, "examples"]
    cadence: Float[Array, "examples"]
    spread: Float[Array, "examples"]
    stoop: Float[Array, "examples"]
    style: Float[Array, "examples"]

    def __post_init__(self) -> None:
        count = len(self.speed)
        for name in COLUMNS:
            column = np.array(getattr(self, name), np.float64)
            if column.shape != (count,) or not np.isfinite(column).all():
                raise DatabaseError(f"annotation {name!r} is damaged: {count} finite numbers wanted")
            column.setflags(write=False)
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.speed)


COLUMNS = tuple(field.name for field in fields(Annotations))
"""The columns' names."""


@dataclass(frozen=True, kw_only=True)
class TakeAnnotation:
    """What a take shows.

    Parameters
    ----------
    statuses
        Motions and transitions in the order in which they come, each once for as long as it lasts.
    speed, start_speed, end_speed
        Mean over what is used of it, and at its first and last frame, m/s.
    turn
        Mean turning to the left, rad/s.
    style
        Mean over its examples, from gloomy (-1) to brisk (+1).
    cycle
        Length of the section that repeats best, its postures coming again (BJL eq. 4), seconds; 0 where none does or
        that is not known.
    cycle_start
        Where that section begins, seconds: the right foot leaves the floor there, where generic time starts.
    cycles
        How many such sections there are.
    """

    statuses: tuple[str, ...]
    speed: float
    start_speed: float
    end_speed: float
    turn: float
    style: float
    cycle: float = 0.0
    cycle_start: float = 0.0
    cycles: int = 0
