"""The motion database as one file: safetensors, no pickle, written beside its place and renamed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from stridecast.database.annotation import annotate, annotate_takes
from stridecast.errors import DatabaseFileError, InputError
from stridecast.formats.tensors import Tensors, pack_skeleton, read_tensors, unpack_skeleton, write_tensors
from stridecast.model.annotation import COLUMNS, Annotations, TakeAnnotation
from stridecast.model.bounds import SteeringBounds
from stridecast.model.database import Examples, MotionDatabase, Take
from stridecast.model.group import MotionGroup
from stridecast.model.segment import MOTIONS

FORMAT = "stridecast motion database"
VERSION = 2
"""Version of the format; it grows when older code could no longer read what newer code writes.

1. Without annotations; they are made when such a file is read, all but the cycles of takes.
2. With annotations of examples and takes.
"""

_TABLES = {
    "features": np.float32,
    "times": np.float32,
    "parameters": np.float64,
    "travelled": np.float32,
    "durations": np.float64,
    "takes": np.int64,
    "first_frames": np.int64,
    "mirrored": np.bool_,
}
"""How the tables are stored: what is blended is good to a thousandth of a millimetre in half the space."""


def save_database(database: MotionDatabase, path: str | Path) -> None:
    """Write a motion database.

    Parameters
    ----------
    database
        What to write. Features, times and travelled ways are stored in single precision (see ``as_stored``).
    path
        The file, ``*.safetensors`` by custom. What was there stays whole until the new one is complete.

    Raises
    ------
    FileError
        The file system refuses (no such folder, no right, disk full).
    """
    body, tensors = pack_skeleton(database.skeleton)
    header = {
        "format": FORMAT,
        "version": VERSION,
        "frame_rate": database.frame_rate,
        "bounds_method": database.bounds_method,
        "skeleton": body,
        "sole": database.sole,
        "person": database.person,
        "groups": [asdict(group) for group in database.groups],
        "takes": [asdict(take) for take in database.takes],
    }
    tensors["references"] = database.references
    tensors |= {f"examples.{name}": getattr(database.examples, name).astype(kind) for name, kind in _TABLES.items()}
    tensors |= {f"annotations.{name}": getattr(database.annotations, name) for name in COLUMNS}
    write_tensors(path, header, tensors)


def load_database(path: str | Path) -> MotionDatabase:
    """Read a motion database.

    Parameters
    ----------
    path
        A file that ``save_database`` or ``stridecast build`` wrote.

    Raises
    ------
    DatabaseFileError
        No such file, no motion database, damaged, or written by a newer version; the message says which.
    """
    header, tensors = read_tensors(path, FORMAT, VERSION)
    try:
        database = _unpack(header, tensors)
        _check(database)
    except (InputError, KeyError, TypeError, ValueError, AttributeError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise DatabaseFileError(f"is damaged: {what}; build it again", path=path) from error
    return database


def as_stored(database: MotionDatabase) -> MotionDatabase:
    """Round a database's numbers as a file does: what comes back is what ``load_database`` would give."""
    tables = {name: getattr(database.examples, name) for name in _TABLES}
    rounded = {name: table.astype(_TABLES[name]).astype(table.dtype) for name, table in tables.items()}
    return replace(database, examples=Examples(**rounded))


def _unpack(header: Mapping[str, Any], tensors: Tensors) -> MotionDatabase:
    skeleton = unpack_skeleton(header["skeleton"], tensors)
    groups = tuple(_group(row) for row in header["groups"])
    examples = Examples(**{name: _table(tensors, name) for name in _TABLES})
    takes = tuple(_take(row) for row in header["takes"])
    if int(header["version"]) < 2:
        annotations = annotate(skeleton, tensors["references"], groups, examples)
        takes = annotate_takes(takes, groups, examples, annotations, {})
    else:
        annotations = Annotations(**{name: tensors[f"annotations.{name}"] for name in COLUMNS})
    return MotionDatabase(
        skeleton=skeleton,
        frame_rate=float(header["frame_rate"]),
        groups=groups,
        examples=examples,
        references=tensors["references"],
        takes=takes,
        annotations=annotations,
        bounds_method=str(header["bounds_method"]),
        sole=header.get("sole"),
        person=header.get("person"),
    )


def _take(row: Mapping[str, Any]) -> Take:
    told = row.get("annotation")
    annotation = None if told is None else TakeAnnotation(**{**told, "statuses": tuple(told["statuses"])})
    lists = {name: tuple(row[name]) for name in ("left_out", "notes")}
    return Take(**{**row, **lists, "annotation": annotation})


def _table(tensors: Tensors, name: str) -> np.ndarray:
    """Find a table, in the kind of number that code works with."""
    table = tensors[f"examples.{name}"]
    return table.astype(np.float64) if table.dtype.kind == "f" else table


def _group(row: Mapping[str, Any]) -> MotionGroup:
    bounds = dict(row["bounds"])
    for name in ("tangential", "speed"):
        (a, b), (c, d) = bounds[name]
        bounds[name] = (float(a), float(b)), (float(c), float(d))
    bounds["assumed"] = tuple(bounds.get("assumed", ()))
    return MotionGroup(**{**row, "keys": tuple(row["keys"]), "bounds": SteeringBounds(**bounds)})


def _check(database: MotionDatabase) -> None:
    """Refuse what the types let through and a walker would stumble over."""
    database.skeleton.require_roles()
    examples = database.examples
    first = 0
    for group in database.groups:
        if group.first != first or group.count < 1:
            raise ValueError(f"group {group.name!r} should begin at example {first}, not {group.first}")
        first += group.count
        if len(group.keys) != len(group.string) - 1 or not set(group.string) <= set("SLRDF"):
            raise ValueError(f"group {group.name!r} has {len(group.keys)} keys for the string {group.string!r}")
        if not {group.comes_from, group.leads_to} <= set(MOTIONS):
            raise ValueError(f"group {group.name!r} has an unknown motion")
    if len(examples.takes) and not 0 <= examples.takes.min() <= examples.takes.max() < len(database.takes):
        raise ValueError("examples come from takes that are not listed")
    if not (examples.durations > 0).all():
        raise ValueError("examples must last longer than no time")
    if not np.allclose(np.linalg.norm(database.references, axis=-1), 1.0, atol=1e-6):
        raise ValueError("references are no rotations")
