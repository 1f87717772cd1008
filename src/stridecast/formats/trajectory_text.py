"""Trajectories as columns of bare numbers: the text files of Juelich and JuPedSim, and those of ETH and UCY."""

from __future__ import annotations

import logging
import math
import re
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from stridecast.errors import FileError
from stridecast.formats.files import replacing
from stridecast.formats.trajectory_rows import UNITS, Rows, assemble, line_of, numbers_of, text_of
from stridecast.model.trajectories import Trajectories

Array = np.ndarray
log = logging.getLogger("stridecast")

_RATE = re.compile(rb"^[ \t]*#[^\n]*?frame[ _-]?rate[ \t]*[:=]?[ \t]*([^\s]+)", re.MULTILINE | re.IGNORECASE)
_UNIT = re.compile(
    rb"^[ \t]*#[^\n]*?(?:\b[xy]\s*/\s*|\bin\s+|\[\s*(?:in\s+)?)(cm|centimet(?:er|re)s?|mm|m|met(?:er|re)s?)\b",
    re.MULTILINE | re.IGNORECASE,
)

TOO_FAST = 12.0
"""Nobody is so fast, m/s: a file in which people are is in centimetres."""

STEPS = (6, 10)
"""Annotations of ETH and UCY are so many frames apart, at 15 or 25 frames a second: ..."""

SAME_MOMENT = 1e-6
"""Times that are nearer to each other are one moment, seconds."""

STEP = 0.4
"""... so many seconds."""


def tells_frame_rate(text: bytes) -> bool:
    """Whether a comment tells the frame rate, as in Juelich's files."""
    return _RATE.search(text) is not None


def read_juelich(path: str | Path, frame_rate: float | None, unit: str | None) -> Trajectories:
    """Columns ``id frame x y``, more are ignored; comments tell frame rate and, maybe, unit."""
    text = text_of(path)
    found = numbers_of(path, text, {"id": 0, "frame": 1, "x": 2, "y": 3})
    rate = frame_rate or _rate(path, text)
    rows = Rows(
        ids=found["id"],
        times=found["frame"] / rate,
        x=found["x"],
        y=found["y"],
        line=lambda row: line_of(text, row),
        time_name="frame",
    )
    if unit is None:
        unit = _unit(path, text, rows)
    return assemble(path, rows, UNITS[unit])


def write_juelich(path: str | Path, trajectories: Trajectories) -> None:
    """Write Juelich's text, which PedPy and JPSvis read: comments, then ``id frame x y``, in the order of frames.

    Raises
    ------
    FileError
        The moments are not at a steady rate, or the file system refuses.
    """
    rate, frames = _frames_of(path, trajectories.times)
    order = np.lexsort((trajectories.ids, frames))
    columns = (
        trajectories.ids[order].tolist(),
        frames[order].tolist(),
        trajectories.positions[order, 0].tolist(),
        (0.0 - trajectories.positions[order, 1]).tolist(),
    )
    with replacing(path) as file:
        file.write(f"# framerate: {rate:.10g}\n# id frame x/m y/m\n".encode())
        for first in range(0, len(order), 1 << 16):
            part = (column[first : first + (1 << 16)] for column in columns)
            file.write("".join(f"{i} {frame} {x:.6f} {y:.6f}\n" for i, frame, x, y in zip(*part, strict=True)).encode())


def _frames_of(path: str | Path, times: Float[Array, "rows"]) -> tuple[float, Int[Array, "rows"]]:
    """Frame rate and frames of moments that are a whole number of frames apart."""
    moments = np.unique(times)
    steps = np.diff(moments)
    steps = steps[steps > SAME_MOMENT]
    if not len(steps):
        return 1.0, np.round(times).astype(np.int64)
    rate = 1.0 / float(np.median(steps))
    whole = round(rate)
    rate = float(whole) if whole and abs(rate - whole) < 1e-4 * whole else rate
    frames = np.round(times * rate)
    off = np.abs(frames / rate - times)
    if off.max() > 0.02 / rate:
        row = int(np.argmax(off))
        raise FileError(
            f"counts frames, but row {row} is at {times[row]:.6g} s, between two frames at {rate:.6g} a second; write "
            ".csv or .parquet",
            path=path,
        )
    return rate, frames.astype(np.int64)


def read_eth(path: str | Path, frame_rate: float | None, metres: float) -> Trajectories:
    """Columns ``frame id x z y vx vz vy`` (``obsmat.txt``), or ``frame id x y``."""
    text = text_of(path)
    first = _first_row(text)
    if len(first) not in (4, 8):
        what = f"ETH and UCY files have 8 columns (frame id x z y vx vz vy) or 4 (frame id x y), not {len(first)}"
        raise FileError(what, path=path, line=line_of(text, 0))
    found = numbers_of(path, text, {"frame": 0, "id": 1, "x": 2, "y": 4 if len(first) == 8 else 3})
    if frame_rate is None:
        step = frame_step(found["frame"])
        if step not in STEPS:
            raise FileError(
                f"counts frames in steps of {step}, not of 6 or 10 as ETH and UCY do: give the frame rate", path=path
            )
        frame_rate = step / STEP
    rows = Rows(
        ids=found["id"],
        times=found["frame"] / frame_rate,
        x=found["x"],
        y=found["y"],
        line=lambda row: line_of(text, row),
        time_name="frame",
    )
    return assemble(path, rows, metres)


def frame_step(frames: Float[Array, "rows"]) -> int:
    """Greatest common divisor of what frame numbers differ by; 0 for a single frame, 1 where they are not whole."""
    if not np.isfinite(frames).all() or (np.abs(frames) > 2**53).any() or (frames != np.round(frames)).any():
        return 1
    return int(np.gcd.reduce(np.diff(np.unique(frames)).astype(np.int64))) if len(np.unique(frames)) > 1 else 0


def kind_of(path: str | Path, text: bytes) -> str:
    """``eth`` (frame first) or ``juelich`` (person first), for bare numbers.

    Raises
    ------
    FileError
        Nothing tells which: neither a comment with the frame rate, nor as many columns, nor steps as ETH's.
    """
    width = len(_first_row(text))
    if tells_frame_rate(text) or width not in (4, 8):
        return "juelich"
    if width == 8 or frame_step(numbers_of(path, text, {"frame": 0})["frame"]) in STEPS:
        return "eth"
    what = "holds bare numbers: name the format, juelich for 'id frame x y' or eth for 'frame id x y'"
    raise FileError(what, path=path)


def _first_row(text: bytes) -> list[bytes]:
    found = re.search(rb"^[ \t]*[^#\s][^\n]*", text, re.MULTILINE)
    return found[0].split() if found else []


def _rate(path: str | Path, text: bytes) -> float:
    found = _RATE.search(text)
    if found is None:
        raise FileError("tells no frame rate (as '# framerate: 25.00'): give the frame rate", path=path)
    line = text.count(b"\n", 0, found.start(1)) + 1
    number = re.match(rb"\d+(\.\d*)?|\.\d+", found[1])
    rate = float(number[0]) if number else math.nan
    if not 0 < rate < 1e5:
        shown = found[1][:40].decode("utf-8", "replace")
        raise FileError(f"the frame rate should be a positive number, not {shown!r}", path=path, line=line)
    return rate


def _unit(path: str | Path, text: bytes, rows: Rows) -> str:
    """Unit of length as a comment tells it, or as people are not too fast in it."""
    comments = b"\n".join(re.findall(rb"^[ \t]*#[^\n]*", text, re.MULTILINE)[:100])
    found = _UNIT.search(comments)
    if found:
        name = found[1].lower()
        return "cm" if name.startswith((b"cm", b"cent")) else "mm" if name == b"mm" else "m"
    order = np.lexsort((rows.times, rows.ids))
    same = np.diff(rows.ids[order]) == 0
    seconds = np.diff(rows.times[order])[same]
    moved = np.hypot(np.diff(rows.x[order]), np.diff(rows.y[order]))[same]
    speeds = moved[seconds > 0] / seconds[seconds > 0]
    speeds = speeds[np.isfinite(speeds)]
    fast = float(np.percentile(speeds, 75)) if len(speeds) else 0.0
    unit = "cm" if fast > TOO_FAST else "m"
    log.warning("%s tells no unit of length: taken for %s, as people go at %.3g %s/s", path, unit, fast, unit)
    return unit
