"""Trajectories as tables, ``id,time,x,y[,heading,speed]``: CSV, Parquet, and data frames of PedPy."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from stridecast.errors import FileError, InputError
from stridecast.formats.files import replacing
from stridecast.formats.trajectory_rows import MOST_ROWS, Rows, assemble, line_of, numbers_of, text_of
from stridecast.geometry import ground
from stridecast.model.trajectories import Trajectories

Array = np.ndarray

COLUMNS = ("id", "time", "x", "y", "heading", "speed")
NEEDED = "id, time (or frame), x, y"


def read_csv(path: str | Path, frame_rate: float | None, metres: float) -> Trajectories:
    """Read CSV; see ``load_trajectories``."""
    text = text_of(path)
    header = re.search(rb"^[ \t]*[^#\s][^\n]*", text, re.MULTILINE)
    line = text.count(b"\n", 0, header.start()) + 1 if header else 1
    top = header[0].decode("utf-8", "replace") if header else ""
    separator = max(",;\t", key=top.count)
    names = [name.strip().lower() for name in next(csv.reader([top], delimiter=separator), [])]
    columns = {name: names.index(name) for name in _columns(path, names, frame_rate, line)}
    found = numbers_of(path, text, columns, separator=separator, skip=1)
    return _assembled(path, found, frame_rate, metres, text)


def read_parquet(path: str | Path, frame_rate: float | None, metres: float) -> Trajectories:
    """Read Parquet; see ``load_trajectories``."""
    parquet = _pyarrow(path)
    import pyarrow as pa

    try:
        with parquet.ParquetFile(path) as file:
            if file.metadata.num_rows > MOST_ROWS:
                raise FileError(f"has {file.metadata.num_rows} rows; at most {MOST_ROWS} are read", path=path)
            own = {name.strip().lower(): name for name in file.schema_arrow.names}
            wanted = _columns(path, list(own), frame_rate, None)
            table = file.read(columns=[own[name] for name in wanted])
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error
    except (pa.ArrowException, ValueError, MemoryError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"is damaged, or no Parquet file: {str(error).splitlines()[0]}", path=path) from None
    found = {}
    for name in wanted:
        column = table.column(own[name])
        if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
            raise FileError(f"column {name!r}: numbers should stand here, not {column.type}", path=path)
        values = column.to_numpy()
        found[name] = np.asarray(values, np.float64)
    return _assembled(path, found, frame_rate, metres)


def write_csv(path: str | Path, trajectories: Trajectories) -> None:
    """Write CSV that is read to the last bit."""
    columns = _written(trajectories)
    with replacing(path) as file:
        file.write((",".join(columns) + "\n").encode())
        for first in range(0, len(trajectories), 1 << 16):
            part = [column[first : first + (1 << 16)].tolist() for column in columns.values()]
            out = io.StringIO()
            csv.writer(out, lineterminator="\n").writerows(zip(*part, strict=True))
            file.write(out.getvalue().encode())


def write_parquet(path: str | Path, trajectories: Trajectories) -> None:
    """Write Parquet, columns as in CSV."""
    parquet = _pyarrow(path)
    import pyarrow as pa

    table = pa.table({name: pa.array(column) for name, column in _written(trajectories).items()})
    with replacing(path) as file:
        parquet.write_table(table, file)


def csv_to_parquet(source: str | Path, path: str | Path) -> None:
    """Write a table of trajectories as Parquet, block by block, so that it may be larger than the memory."""
    parquet = _pyarrow(path)
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    kinds = {name: pa.int64() if name == "id" else pa.float64() for name in COLUMNS}
    with (
        arrow_csv.open_csv(source, convert_options=arrow_csv.ConvertOptions(column_types=kinds)) as table,
        replacing(path) as file,
        parquet.ParquetWriter(file, table.schema) as out,
    ):
        for block in table:
            out.write_batch(block)


def check_parquet(path: str | Path) -> None:
    """Raise the error that writing Parquet would raise where its library is missing.

    Raises
    ------
    FileError
        It is missing.
    """
    _pyarrow(path)


def trajectories_of(data: Any, name: str = "") -> Trajectories:
    """Trajectories of an object such as PedPy's ``TrajectoryData``.

    Parameters
    ----------
    data
        Has ``frame_rate`` (Hz) and ``data``, a table whose columns ``id``, ``frame``, ``x``, ``y`` (metres) can be
        taken by name: a data frame of pandas, or a dictionary of arrays.
    name
        Where it comes from, for messages.

    Raises
    ------
    InputError
        An attribute or a column is missing, or holds what is no number; a person twice at one moment.
    """
    table, rate = getattr(data, "data", None), getattr(data, "frame_rate", None)
    if table is None or rate is None:
        raise InputError("trajectories need the attributes data (id, frame, x, y) and frame_rate, as in PedPy")
    try:
        rate = float(rate)
        found = {column: np.array(table[column], np.float64) for column in ("id", "frame", "x", "y")}
    except KeyError as error:
        raise InputError(f"the table of trajectories lacks the column {error}; it needs id, frame, x, y") from None
    except (TypeError, ValueError) as error:
        raise InputError(f"the table of trajectories holds something that is no number: {error}") from None
    if not (np.isfinite(rate) and rate > 0):
        raise InputError(f"frame_rate must be a positive number of frames a second, not {rate}")
    return _assembled(name or "trajectories", found, rate, 1.0)


def _columns(path: str | Path, names: Sequence[str], frame_rate: float | None, line: int | None) -> list[str]:
    """Columns to read, in the order of ``COLUMNS``."""
    moment = "time" if "time" in names or "frame" not in names else "frame"
    wanted = ["id", moment, "x", "y"]
    missing = [name for name in wanted if name not in names]
    if missing:
        have = ", ".join(repr(name[:20]) for name in list(names)[:8])
        what = f"the header lacks {', '.join(missing)}: it should name {NEEDED}, but names {have}"
        raise FileError(what, path=path, line=line)
    if moment == "frame" and frame_rate is None:
        raise FileError("counts frames, not seconds: give the frame rate", path=path, line=line)
    wanted += [name for name in COLUMNS[4:] if name in names]
    for name in wanted:
        if list(names).count(name) > 1:
            raise FileError(f"the header names {name!r} twice", path=path, line=line)
    return wanted


def _assembled(
    path: str | Path,
    found: dict[str, Float[Array, "rows"]],
    frame_rate: float | None,
    metres: float,
    text: bytes | None = None,
) -> Trajectories:
    moment = "time" if "time" in found else "frame"
    rows = Rows(
        ids=found["id"],
        times=found["time"] if moment == "time" else found["frame"] / (frame_rate or 1.0),
        x=found["x"],
        y=found["y"],
        headings=found.get("heading"),
        speeds=found.get("speed"),
        line=None if text is None else lambda row: line_of(text, row + 1),
        time_name=moment,
    )
    return assemble(path, rows, metres)


def _written(trajectories: Trajectories) -> dict[str, Array]:
    """Columns of a file."""
    columns = {
        "id": trajectories.ids,
        "time": trajectories.times,
        "x": trajectories.positions[:, 0],
        "y": 0.0 - trajectories.positions[:, 1],
    }
    if trajectories.headings is not None:
        columns["heading"] = ground.wrap(trajectories.headings - 0.5 * np.pi)
    if trajectories.speeds is not None:
        columns["speed"] = trajectories.speeds
    return columns


def _pyarrow(path: str | Path) -> Any:
    """The library for Parquet, imported where it is needed."""
    if find_spec("pyarrow") is None:
        raise FileError("is Parquet, which needs pyarrow: pip install 'stridecast[parquet]'", path=path)
    from pyarrow import parquet

    return parquet
