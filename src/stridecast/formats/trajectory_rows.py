"""Rows of a trajectory file on their way to ``Trajectories``: checked, converted, put in order, culprits named."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from jaxtyping import Float

from stridecast.errors import FileError
from stridecast.formats.files import read_text
from stridecast.formats.points import FARTHEST
from stridecast.geometry import ground
from stridecast.model.trajectories import Trajectories

Array = np.ndarray

LARGEST = 2**30
"""Larger text files are a mistake, bytes."""

MOST_ROWS = 20_000_000
"""More rows are a mistake, in any format."""

MOST_SECONDS = 1e10
"""A moment further from 0 is a mistake in the unit of time."""

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Units of length a file may be in, in metres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """Columns as a file has them: a plan seen from above, angles from +x counter-clockwise.

    ``line`` gives the line of a row in the file; where there are no lines, rows are named by their numbers from 1.
    """

    ids: Float[Array, "rows"]
    times: Float[Array, "rows"]
    x: Float[Array, "rows"]
    y: Float[Array, "rows"]
    headings: Float[Array, "rows"] | None = None
    speeds: Float[Array, "rows"] | None = None
    line: Callable[[int], int] | None = None
    time_name: str = "time"


def assemble(path: str | Path, rows: Rows, metres: float = 1.0) -> Trajectories:
    """Trajectories of rows in any order; ``metres`` is the length of the file's unit.

    Raises
    ------
    FileError
        Values that are not finite, ids that are not whole, points too far away, a person twice at one moment.
    """
    names = {"id": rows.ids, rows.time_name: rows.times, "x": rows.x, "y": rows.y}
    names |= {k: v for k, v in (("heading", rows.headings), ("speed", rows.speeds)) if v is not None}
    if len(rows.ids) == 0:
        raise FileError("holds nobody: there are no rows", path=path)
    for name, column in names.items():
        _refuse(path, rows, name, ~np.isfinite(column), "is not a finite number", column)
    _refuse(path, rows, "id", (rows.ids != np.round(rows.ids)) | (np.abs(rows.ids) > 2**53), "is no whole number")
    far = "lies further than 1e6 m from the origin; give the unit of length"
    for name in ("x", "y"):
        _refuse(path, rows, name, np.abs(names[name]) * metres > FARTHEST, far, names[name])
    _refuse(path, rows, rows.time_name, np.abs(rows.times) > MOST_SECONDS, "is no time in seconds", rows.times)
    order = np.lexsort((rows.times, rows.ids))
    ids, times = rows.ids[order].astype(np.int64), rows.times[order]
    twice = np.flatnonzero((np.diff(ids) == 0) & (np.diff(times) <= 0))
    if len(twice):
        first, second = sorted(order[twice[0] : twice[0] + 2].tolist())
        what = (
            f"person {ids[twice[0]]} is in two places at once, at {times[twice[0]]:.9g} s (first {_named(rows, first)})"
        )
        raise _error(path, rows, second, what)
    z = 0.0 - rows.y[order]  # no negative zeros
    return Trajectories(
        ids=ids,
        times=times,
        positions=metres * np.stack((rows.x[order], z), axis=-1),
        headings=None if rows.headings is None else ground.wrap(rows.headings[order] + 0.5 * np.pi),
        speeds=None if rows.speeds is None else metres * rows.speeds[order],
        name=Path(path).name,
    )


def checked_rate(frame_rate: float | None) -> float | None:
    """The frame rate that was given, if it is one.

    Raises
    ------
    FileError
        It is not positive.
    """
    if frame_rate is not None and not (math.isfinite(frame_rate) and frame_rate > 0):
        raise FileError(f"the frame rate must be a positive number of frames a second, not {frame_rate}")
    return frame_rate


def text_of(path: str | Path) -> bytes:
    """Content of a text file that is not too large.

    Raises
    ------
    FileError
        Not readable, binary, empty or too large.
    """
    try:
        size = Path(path).stat().st_size
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error
    if size > LARGEST:
        raise FileError(f"has {size / 2**20:.0f} MB; at most {LARGEST // 2**20} MB are read", path=path)
    return read_text(path)


_DATA = re.compile(rb"^[ \t]*[^#\s][^\n]*", re.MULTILINE)
"""A line that is neither empty nor a comment."""


def line_of(text: bytes, row: int) -> int:
    """Line (from 1) of the ``row``-th line that is neither empty nor a comment, counted from 0."""
    for number, found in enumerate(_DATA.finditer(text)):
        if number == row:
            return text.count(b"\n", 0, found.start()) + 1
    return text.count(b"\n") + 1


def numbers_of(
    path: str | Path, text: bytes, columns: dict[str, int], *, separator: str | None = None, skip: int = 0
) -> dict[str, Float[Array, "rows"]]:
    """Columns of numbers, by name; ``skip`` lines that are neither empty nor comments come first.

    Raises
    ------
    FileError
        A cell that is no number, or a row that is too short, with line and column; too many rows.
    """
    lines: Iterator[str] = (found[0].decode("utf-8", "replace") for found in _DATA.finditer(text))
    for _ in range(skip):
        next(lines, None)
    places = list(columns.values())
    lines = filter(str.strip, lines)  # separators of files and groups are blank as text, not as bytes
    head = next(lines, None)
    if head is None:
        raise FileError("holds nobody: there are no rows", path=path)
    lines = chain((head,), lines)
    try:
        table = np.loadtxt(
            lines, np.float64, comments=None, delimiter=separator, usecols=places, ndmin=2, quotechar='"',
            max_rows=MOST_ROWS + 1,
        )  # fmt: skip
    except (ValueError, IndexError, OverflowError):
        raise _culprit(path, text, columns, separator, skip) from None
    if len(table) > MOST_ROWS:
        raise FileError(f"has more than {MOST_ROWS} rows", path=path)
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(columns)}


def _culprit(path: str | Path, text: bytes, columns: dict[str, int], separator: str | None, skip: int) -> FileError:
    """The error that names the cell that cannot be read."""
    for row, found in enumerate(_DATA.finditer(text)):
        cells = found[0].decode("utf-8", "replace").split()
        if separator is not None:
            cells = next(csv.reader([found[0].decode("utf-8", "replace")], delimiter=separator))
        for name, place in columns.items() if row >= skip else ():
            line = text.count(b"\n", 0, found.start()) + 1
            if place >= len(cells) or not cells[place].strip():
                return FileError(f"column {name!r}: the number is missing", path=path, line=line)
            cell = cells[place].strip()
            if not _NUMBER.fullmatch(cell):
                hint = "; decimals need a point" if re.fullmatch(r"[+-]?\d+,\d+", cell) else ""
                what = f"column {name!r}: a number should stand here, not {cell[:40]!r}{hint}"
                return FileError(what, path=path, line=line)
    return FileError("holds something that is no table of numbers", path=path)


_NUMBER = re.compile(r"[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|inf|infinity)", re.IGNORECASE)


def _refuse(path: str | Path, rows: Rows, name: str, bad: Array, what: str, column: Array | None = None) -> None:
    """Raise the error about the first bad row, if there is one."""
    found = np.flatnonzero(bad)
    if len(found):
        row = int(found[0])
        value = (rows.ids if column is None else column)[row]
        raise _error(path, rows, row, f"column {name!r}: {value:.9g} {what}")


def _error(path: str | Path, rows: Rows, row: int, what: str) -> FileError:
    if rows.line is not None:
        return FileError(what, path=path, line=rows.line(row))
    return FileError(f"row {row + 1}: {what}", path=path)


def _named(rows: Rows, row: int) -> str:
    return f"row {row + 1}" if rows.line is None else f"line {rows.line(row)}"
