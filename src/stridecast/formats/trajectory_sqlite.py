"""Trajectories as JuPedSim writes them: an SQLite file with the tables ``trajectory_data`` and ``metadata``."""

from __future__ import annotations

import logging
import math
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

from stridecast.errors import FileError
from stridecast.formats.trajectory_rows import MOST_ROWS, Rows, assemble
from stridecast.model.trajectories import Trajectories

log = logging.getLogger("stridecast")

KNOWN_VERSION = 2
"""Newest version of the tables that was looked at; newer ones are read where the columns are there."""

CHUNK = 1 << 16
"""Rows fetched at a time."""


def read_jupedsim(path: str | Path, frame_rate: float | None, metres: float) -> Trajectories:
    """Read JuPedSim's SQLite output; nothing is ever written to it.

    Raises
    ------
    FileError
        Tables or columns missing, values that are no numbers, no frame rate, or the simulation is still writing.
    """
    path = Path(path)
    for ending in ("-wal", "-journal"):
        beside = path.with_name(path.name + ending)
        if beside.is_file() and beside.stat().st_size:
            raise FileError(f"is not finished: {beside.name} lies beside it; close the simulation first", path=path)
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
            base.execute("PRAGMA trusted_schema = OFF")
            base.text_factory = bytes  # a name in a wrong encoding is no reason to fail
            return _read(path, base, frame_rate, metres)
    except sqlite3.Error as error:
        raise FileError(f"cannot be read as SQLite: {error}", path=path) from None


def _read(path: Path, base: sqlite3.Connection, frame_rate: float | None, metres: float) -> Trajectories:
    tables = dict(base.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table' LIMIT 1000"))
    sql = tables.get(b"trajectory_data")
    if sql is None or b"VIRTUAL" in sql[:20].upper():
        shown = ", ".join(name.decode("utf-8", "replace")[:30] for name in list(tables)[:6]) or "none"
        raise FileError(f"is no output of JuPedSim: there is no table trajectory_data (tables: {shown})", path=path)
    columns = {row[1].lower() for row in base.execute("PRAGMA table_xinfo(trajectory_data)") if row[6] == 0}
    lacking = [name for name in (b"frame", b"id", b"pos_x", b"pos_y") if name not in columns]
    if lacking:
        raise FileError(f"the table trajectory_data lacks {b', '.join(lacking).decode()}", path=path)
    count = base.execute("SELECT count(*) FROM trajectory_data").fetchone()[0]
    if count > MOST_ROWS:
        raise FileError(f"has {count} rows; at most {MOST_ROWS} are read", path=path)
    told = _metadata(base, tables)
    rate = frame_rate or _rate(path, told)
    version = told.get("version", "")
    if version.isdigit() and int(version) > KNOWN_VERSION:
        log.warning(
            "%s is of version %s of JuPedSim's tables, newer than any known; read as version %d",
            path,
            version,
            KNOWN_VERSION,
        )
    turned = {b"ori_x", b"ori_y"} <= columns
    names = ["id", "frame", "pos_x", "pos_y", *(["ori_x", "ori_y"] if turned else [])]
    # the types in SQLite belong to values, not to columns
    strange = " OR ".join(f"typeof({name}) NOT IN ('integer', 'real')" for name in names)
    wrong = base.execute(f"SELECT rowid, {', '.join(names)} FROM trajectory_data WHERE {strange} LIMIT 1").fetchone()
    if wrong:
        name, value = next((n, v) for n, v in zip(names, wrong[1:], strict=True) if not isinstance(v, (int, float)))
        shown = "nothing" if value is None else repr(value[:40])
        raise FileError(f"row {wrong[0]}: column {name!r}: a number should stand here, not {shown}", path=path)
    parts = []
    cursor = base.execute(f"SELECT {', '.join(names)} FROM trajectory_data")
    while part := cursor.fetchmany(CHUNK):
        parts.append(np.array(part, np.float64))
    table = np.concatenate(parts) if parts else np.zeros((0, len(names)))
    facing = table[:, 4:] if turned else np.zeros((len(table), 2))
    known = turned and bool((np.hypot(facing[:, 0], facing[:, 1]) > 1e-9).all())
    rows = Rows(
        ids=table[:, 0],
        times=table[:, 1] / rate,
        x=table[:, 2],
        y=table[:, 3],
        headings=np.arctan2(facing[:, 1], facing[:, 0]) if known else None,
        time_name="frame",
    )
    return assemble(path, rows, metres)


def _metadata(base: sqlite3.Connection, tables: dict[bytes, bytes]) -> dict[str, str]:
    """What the table ``metadata`` says, as text."""
    if b"metadata" not in tables:
        return {}
    rows = base.execute("SELECT CAST(key AS TEXT), CAST(value AS TEXT) FROM metadata LIMIT 1000").fetchall()
    return {(k or b"").decode("utf-8", "replace"): (v or b"")[:4096].decode("utf-8", "replace") for k, v in rows}


def _rate(path: Path, told: dict[str, str]) -> float:
    if "fps" not in told:
        raise FileError("tells no fps in its table metadata: give the frame rate", path=path)
    try:
        rate = float(told["fps"])
    except ValueError:
        rate = math.nan
    if not 0 < rate < 1e5:
        raise FileError(f"fps in its table metadata should be a positive number, not {told['fps'][:40]!r}", path=path)
    return rate
