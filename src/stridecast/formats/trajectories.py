"""Trajectories of simulators and trackers: told apart by what is in the file, read into one form, written back."""

from __future__ import annotations

import re
from pathlib import Path

from stridecast.errors import FileError, InputError
from stridecast.formats.files import looks_like, read_start
from stridecast.formats.trajectory_rows import UNITS, checked_rate, text_of
from stridecast.formats.trajectory_sqlite import read_jupedsim
from stridecast.formats.trajectory_tables import read_csv, read_parquet, trajectories_of, write_csv, write_parquet
from stridecast.formats.trajectory_text import kind_of, read_eth, read_juelich, write_juelich
from stridecast.model.trajectories import Trajectories

__all__ = ["FORMATS", "load_trajectories", "save_trajectories", "trajectories_of"]

FORMATS = ("csv", "parquet", "jupedsim", "juelich", "eth")
"""Formats that ``load_trajectories`` reads."""


def load_trajectories(
    path: str | Path, *, frame_rate: float | None = None, unit: str | None = None, format: str | None = None
) -> Trajectories:
    """Read where people were.

    All formats hold a plan seen from above, ``y`` up the page; here it becomes ``(x, z)`` with ``z = -y``.

    ``csv``, ``parquet``
        Columns ``id``, ``time`` (seconds; or ``frame``, with ``frame_rate``), ``x``, ``y`` and, if you like,
        ``heading`` (radians from +x, counter-clockwise) and ``speed``, in any order; others are ignored. CSV has a
        header, and commas, semicolons or tabs. Parquet needs the extra ``parquet``.
    ``jupedsim``
        SQLite output of JuPedSim.
    ``juelich``
        Text of the pedestrian dynamics data archive and of older JuPedSim: comments (``# framerate: 16.00``), then
        ``id frame x y`` and maybe more. Where no comment tells the unit it is guessed from how fast people are, and
        said in a warning.
    ``eth``
        ETH's and UCY's text: ``frame id x z y vx vz vy`` (``obsmat.txt``) or ``frame id x y``; frames in steps of 6
        or 10 are 0.4 s apart. Other four columns of bare numbers are read only where ``format`` tells who wrote them.

    Parameters
    ----------
    path
        The file.
    frame_rate
        Frames a second, where the file counts frames; instead of what it tells.
    unit
        Unit of length, ``m``, ``cm`` or ``mm``, instead of metres or of what the file tells.
    format
        One of ``FORMATS``, instead of what the content looks like.

    Raises
    ------
    FileError
        The file cannot be read, is something else, or holds what makes no trajectories; with line (or row) and column.
    InputError
        There is no such format or unit.
    """
    checked_rate(frame_rate)
    if unit is not None and unit not in UNITS:
        raise InputError(f"there is no unit {unit!r}; there are {', '.join(UNITS)}")
    if format is not None and format not in FORMATS:
        raise InputError(f"there is no format {format!r}; there are {', '.join(FORMATS)}")
    metres = UNITS[unit or "m"]
    kind = format or _kind(path)
    if kind == "csv":
        return read_csv(path, frame_rate, metres)
    if kind == "parquet":
        return read_parquet(path, frame_rate, metres)
    if kind == "jupedsim":
        return read_jupedsim(path, frame_rate, metres)
    if kind == "juelich":
        return read_juelich(path, frame_rate, unit)
    return read_eth(path, frame_rate, metres)


def save_trajectories(path: str | Path, trajectories: Trajectories) -> None:
    """Write trajectories as ``.csv`` or ``.parquet``, columns ``id,time,x,y[,heading,speed]``, or Juelich's ``.txt``.

    The text has ``id frame x y`` and the frame rate; PedPy's ``load_trajectory_from_txt`` reads it.

    Raises
    ------
    FileError
        Another ending, text of moments that are not at a steady rate, or the file cannot be written; what was there is
        untouched.
    """
    ending = Path(path).suffix.lower()
    if ending == ".csv":
        write_csv(path, trajectories)
    elif ending == ".parquet":
        write_parquet(path, trajectories)
    elif ending == ".txt":
        write_juelich(path, trajectories)
    else:
        raise FileError(
            f"trajectories are written as .csv, .parquet or .txt, not as {ending or 'a file without ending'}",
            path=path,
        )


def _kind(path: str | Path) -> str:
    """Format of a file by its content."""
    start = read_start(path)
    if start.startswith(b"SQLite format 3\0"):
        return "jupedsim"
    if start.startswith(b"PAR1"):
        return "parquet"
    if name := looks_like(start):
        raise FileError(f"holds no trajectories but {name}", path=path)
    text = text_of(path)
    first = re.search(rb"^[ \t]*[^#\s][^\n]*", text, re.MULTILINE)
    if first is None:
        raise FileError("holds nothing but comments", path=path)
    if re.search(rb"[A-Za-z_]", re.sub(rb"(?i)nan|inf|[0-9.]e", b"", first[0])) or re.search(rb"[,;]", first[0]):
        return "csv"
    return kind_of(path, text)
