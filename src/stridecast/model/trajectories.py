"""Where people were on the ground: the common form of what simulators and trackers write and what a crowd walks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from stridecast.errors import InputError

Array = np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectories:
    """One row a person and moment, sorted by person, then by time.

    Parameters
    ----------
    ids
        Whose row it is, any whole numbers.
    times
        Seconds; rising within a person.
    positions
        Ground points ``(x, z)``, metres, in the frame of the package (a plan's ``y`` is ``-z``).
    headings
        Where they face, radians, or nothing where that is not known.
    speeds
        m/s, or nothing.
    name
        Where it comes from, for messages.

    Raises
    ------
    InputError
        Columns of different length, numbers that are not finite, rows out of order (the row is named).
    """

    ids: Int[Array, "rows"]
    times: Float[Array, "rows"]
    positions: Float[Array, "rows 2"]
    headings: Float[Array, "rows"] | None = None
    speeds: Float[Array, "rows"] | None = None
    name: str = ""

    def __post_init__(self) -> None:
        rows = len(self.ids)
        for name, shape in (("ids", ()), ("times", ()), ("positions", (2,)), ("headings", ()), ("speeds", ())):
            given = getattr(self, name)
            if given is None:
                continue
            column = np.array(given, np.int64 if name == "ids" else np.float64)
            if column.shape != (rows, *shape):
                raise InputError(f"{name} must have shape {(rows, *shape)}, not {column.shape}")
            bad = np.flatnonzero(~np.isfinite(column).reshape(rows, column.size // max(rows, 1)).all(axis=1))
            if len(bad):
                raise InputError(f"{name} of row {int(bad[0])} is not a finite number")
            column.setflags(write=False)
            object.__setattr__(self, name, column)
        step = np.diff(self.ids)
        wrong = np.flatnonzero((step < 0) | ((step == 0) & (np.diff(self.times) <= 0)))
        if len(wrong):
            row = int(wrong[0]) + 1
            raise InputError(f"row {row} is out of order: rows are sorted by person, then by time, each moment once")

    def __len__(self) -> int:
        return len(self.ids)

    @cached_property
    def people(self) -> Int[Array, "people"]:
        """Everybody once, in rising order."""
        return np.unique(self.ids)

    def rows(self, person: int) -> slice:
        """Rows of one person.

        Raises
        ------
        InputError
            Nobody has this number.
        """
        first, last = np.searchsorted(self.ids, (person, person + 1))
        if first == last:
            raise InputError(f"there is nobody with the number {person}")
        return slice(int(first), int(last))

    def each(self) -> Iterator[tuple[int, slice]]:
        """Everybody's number and rows."""
        edges = [*np.searchsorted(self.ids, self.people).tolist(), len(self)]
        for person, (first, last) in zip(self.people.tolist(), pairwise(edges), strict=True):
            yield person, slice(first, last)
