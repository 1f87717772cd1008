"""What to follow, as CSV: samples of an input device (``time,x,z[,motion]``) and paths on the floor (``x,z``)."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from stridecast.errors import FileError
from stridecast.formats.files import read_text
from stridecast.model.segment import MOTIONS
from stridecast.synthesis.journey import PointStream

LONGEST = 2 * 3600.0
"""A walk longer than this is a mistake in the unit of time, seconds."""

FARTHEST = 1e6
"""A point further from the origin is a mistake in the unit of length, metres."""


def read_points(path: str | Path, motion: str = "walk") -> PointStream:
    """Read samples of an input device.

    Parameters
    ----------
    path
        CSV with a header that names ``time`` (seconds), ``x`` and ``z`` (metres) and, if you like, ``motion``
        (``stand``, ``walk`` or ``run``), in any order; other columns are ignored.
    motion
        Motion of samples that name none.

    Raises
    ------
    FileError
        The file cannot be read, lacks a column, or holds a value that is none; with line and column.
    """
    rows = _rows(path, ("time", "x", "z"), optional=("motion",))
    numbers = np.array([[_number(path, row, name) for name in ("time", "x", "z")] for row in rows])
    times = numbers[:, 0]
    back = np.flatnonzero(np.diff(times) <= 0)
    if len(back):
        i = int(back[0]) + 1
        what = f"column 'time': {times[i]:.12g} s comes after {times[i - 1]:.12g} s; time must run forwards"
        raise FileError(what, path=path, line=rows[i].line)
    if times[-1] - times[0] > LONGEST:
        what = (
            f"column 'time': the stream lasts {times[-1] - times[0]:.6g} s, more than two hours; times are in seconds"
        )
        raise FileError(what, path=path, line=rows[-1].line)
    return PointStream(times=times, points=numbers[:, 1:], motions=tuple(_motion(path, row) or motion for row in rows))


def read_path(path: str | Path) -> Float[np.ndarray, "points 2"]:
    """Read a path on the floor.

    Parameters
    ----------
    path
        CSV with a header that names ``x`` and ``z`` (metres), in any order; other columns are ignored.

    Returns
    -------
    Ground points ``(x, z)``, metres.

    Raises
    ------
    FileError
        The file cannot be read, lacks a column, holds a value that is none (with line and column), or no two different
        points.
    """
    rows = _rows(path, ("x", "z"))
    points = np.array([[_number(path, row, name) for name in ("x", "z")] for row in rows])
    if not np.ptp(points, axis=0).any():
        raise FileError("a path needs at least two different points", path=path)
    return points


class _Row(NamedTuple):
    """A line of the file and its cells by column."""

    line: int
    cells: dict[str, str]


def _rows(path: str | Path, wanted: Sequence[str], optional: Sequence[str] = ()) -> list[_Row]:
    text = read_text(path).decode("utf-8", "replace")
    reader = csv.reader(text.split("\n"), skipinitialspace=True)
    rows: list[_Row] = []
    columns: dict[str, int] = {}
    try:
        for cells in reader:
            if not any(cell.strip() for cell in cells):
                continue
            if not columns:
                columns = _columns(path, reader.line_num, cells, wanted, optional)
                continue
            found = {name: cells[k].strip() for name, k in columns.items() if k < len(cells)}
            rows.append(_Row(reader.line_num, found))
    except csv.Error as error:
        raise FileError(f"is no CSV: {error}", path=path, line=reader.line_num) from None
    if not rows:
        raise FileError(f"holds no rows below its header; columns are {','.join(wanted)}", path=path)
    return rows


def _columns(
    path: str | Path, line: int, header: list[str], wanted: Sequence[str], optional: Sequence[str]
) -> dict[str, int]:
    names = [name.strip().lower() for name in header]
    missing = [name for name in wanted if name not in names]
    if missing:
        have = ", ".join(repr(name[:20]) for name in names[:8])
        hint = "; columns are separated by commas" if len(names) == 1 and any(s in names[0] for s in ";\t ") else ""
        what = f"the header lacks {', '.join(missing)}: it should be {','.join(wanted)}, but names {have}{hint}"
        raise FileError(what, path=path, line=line)
    known = [*wanted, *optional]
    for name in known:
        if names.count(name) > 1:
            raise FileError(f"the header names {name!r} twice", path=path, line=line)
    return {name: names.index(name) for name in known if name in names}


def _number(path: str | Path, row: _Row, column: str) -> float:
    text = row.cells.get(column, "")
    try:
        value = float(text)
    except ValueError:
        said = f"a number should stand here, not {text[:40]!r}" if text else "the number is missing"
        raise FileError(f"column {column!r}: {said}", path=path, line=row.line) from None
    if not math.isfinite(value):
        raise FileError(f"column {column!r}: {text} is not a finite number", path=path, line=row.line)
    if column != "time" and abs(value) > FARTHEST:
        what = f"column {column!r}: {text} lies further than {FARTHEST:.0e} m from the origin; lengths are in metres"
        raise FileError(what, path=path, line=row.line)
    return value


def _motion(path: str | Path, row: _Row) -> str:
    motion = row.cells.get("motion", "").lower()
    if motion and motion not in MOTIONS:
        what = f"column 'motion': there is no motion {motion[:40]!r}; there are {', '.join(MOTIONS)}"
        raise FileError(what, path=path, line=row.line)
    return motion
