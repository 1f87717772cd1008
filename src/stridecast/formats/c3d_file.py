"""C3D files: labelled points by the frame, from whatever processor, checked before room is made.

The format is that of www.c3d.org ("The C3D file format user guide", Motion Lab Systems): a header, groups of
parameters, and frames of points and analogue samples as whole numbers or floats of Intel, DEC or SGI machines. Only
points are read.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from stridecast.errors import FileError
from stridecast.formats.files import looks_like

Array = np.ndarray

MOST_BYTES = 1 << 30
"""Larger files are not read."""

MOST_NUMBERS = 1 << 27
"""So many coordinates are read at most: 100 markers for an hour at 120 frames a second."""

_BLOCK = 512
_INTEL, _DEC, _MIPS = 84, 85, 86
_SIZES = {-1: 1, 1: 1, 2: 2, 4: 4}

Value = tuple[str, ...] | tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class C3dPoints:
    """What is used of a C3D file.

    Parameters
    ----------
    labels
        Names of the points.
    points
        Places in the file's unit and axes; NaN where a point was not seen.
    frame_rate
        Frames a second.
    parameters
        All parameters that fit into small tuples, by ``GROUP:NAME`` in capitals.
    """

    labels: tuple[str, ...]
    points: Float[Array, "frames points 3"]
    frame_rate: float
    parameters: Mapping[str, Value]


def read_c3d_points(path: str | Path) -> C3dPoints:
    """Read the labelled points of a C3D file.

    Raises
    ------
    FileError
        It is no C3D file, is cut, contradicts itself or claims to be larger than it is.
    """
    try:
        with Path(path).open("rb") as file:
            if os.fstat(file.fileno()).st_size > MOST_BYTES:
                raise FileError(f"is larger than {MOST_BYTES >> 30} GiB, which no C3D file is", path=path)
            data = file.read()
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error
    if len(data) < 2 * _BLOCK or data[1] != 0x50 or not 2 <= data[0] <= 128:
        seems = looks_like(data)
        hint = f"; it looks like {seems}" if seems and "C3D" not in seems else ""
        raise FileError(f"is no C3D file, or cut{hint}", path=path)
    try:
        return _read(path, data)
    except (struct.error, IndexError) as error:
        raise FileError(f"is cut or damaged: {error}", path=path) from None


def _read(path: str | Path, data: bytes) -> C3dPoints:
    start = (data[0] - 1) * _BLOCK
    kind = data[start + 3]
    if kind not in (_INTEL, _DEC, _MIPS):
        raise FileError(f"is of an unknown processor ({kind}, not 84, 85 or 86), or damaged", path=path)
    order = ">" if kind == _MIPS else "<"
    count, analogue, first, last, _ = struct.unpack_from(order + "5H", data, 2)
    parameters = _parameters(path, data, start, kind)
    scale = _floats(data[12:16], kind)[0]
    rate = _number(parameters, "POINT:RATE", float(_floats(data[20:24], kind)[0]))
    frames = _frames(parameters, first, last)
    begin = (
        int(_number(parameters, "POINT:DATA_START", float(struct.unpack_from(order + "H", data, 16)[0]))) - 1
    ) * _BLOCK
    scale = _number(parameters, "POINT:SCALE", float(scale))
    count = int(_number(parameters, "POINT:USED", count))
    if not (np.isfinite(rate) and 1.0 <= rate <= 10_000.0):
        raise FileError(f"POINT:RATE should be frames a second, not {rate:g}", path=path)
    if not (np.isfinite(scale) and scale != 0) or begin < _BLOCK or not 0 < count < 1 << 15:
        raise FileError(
            f"has {count} points, the scale {scale:g} and data from byte {begin}, which cannot be", path=path
        )
    if 3 * count * frames > MOST_NUMBERS:
        raise FileError(f"claims to have {frames} frames of {count} points, more than are read", path=path)
    width = 4 if scale < 0 else 2
    row = (4 * count + analogue) * width
    if begin + frames * row > len(data):
        whole = max(len(data) - begin, 0) // row
        raise FileError(f"is cut: it promises {frames} frames, {whole} are whole", path=path)
    block = np.frombuffer(data, np.uint8, frames * row, begin).reshape(frames, row)[:, : 4 * count * width]
    values = _floats(block.tobytes(), kind) if scale < 0 else np.frombuffer(block.tobytes(), f"{order}i2")
    values = values.reshape(frames, count, 4).astype(np.float64)
    points = values[..., :3] * (1.0 if scale < 0 else scale)
    unseen = ~(values[..., 3] >= 0) | ~np.isfinite(points).all(axis=-1) | ~points.any(axis=-1)
    points[unseen] = np.nan
    return C3dPoints(labels=_labels(parameters, count), points=points, frame_rate=rate, parameters=parameters)


def _frames(parameters: Mapping[str, Value], first: int, last: int) -> int:
    """Number of frames: 16 bits of the header are not enough for long takes."""
    begin, end = (_long(parameters.get(f"TRIAL:ACTUAL_{which}_FIELD", ())) for which in ("START", "END"))
    if begin is not None and end is not None:
        return max(end - begin + 1, 0)
    if last == 65535:
        return int(_number(parameters, "POINT:LONG_FRAMES", _number(parameters, "POINT:FRAMES", last - first + 1)))
    return max(last - first + 1, 0)


def _long(halves: Value) -> int | None:
    """A number of 32 bits in two of 16, the low one first."""
    if len(halves) != 2 or any(isinstance(half, str) or not np.isfinite(half) for half in halves):
        return None
    low, high = (int(half) % 65536 for half in halves)
    return low + (high << 16)


def _number(parameters: Mapping[str, Value], name: str, default: float) -> float:
    value = parameters.get(name, ())
    return float(value[0]) if len(value) == 1 and not isinstance(value[0], str) and np.isfinite(value[0]) else default


def _labels(parameters: Mapping[str, Value], count: int) -> tuple[str, ...]:
    """Names of the points; more than 255 of them go on in LABELS2, LABELS3, ..."""
    found: list[str] = []
    for k in range(1, 130):
        found += [str(name) for name in parameters.get(f"POINT:LABELS{k if k > 1 else ''}", ())]
    return tuple((found + [""] * count)[:count])


def _parameters(path: str | Path, data: bytes, start: int, kind: int) -> dict[str, Value]:
    """All parameters by group and name."""
    order = ">" if kind == _MIPS else "<"
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Value]] = []
    at = start + 4
    while True:
        length, group = struct.unpack_from("bb", data, at)
        if length == 0 or group == 0:
            break
        name = _text(data[at + 2 : at + 2 + abs(length)]).upper()
        at += 2 + abs(length)
        step = struct.unpack_from(order + "H", data, at)[0]
        if group < 0:
            groups[-group] = name
        else:
            found.append((group, name, _value(path, data, at + 2, kind, name)))
        if step == 0:
            break
        at += step
    return {f"{groups.get(group, group)}:{name}": value for group, name, value in found}


def _value(path: str | Path, data: bytes, at: int, kind: int, name: str) -> Value:
    size, dimensions = struct.unpack_from("bB", data, at)
    if size not in _SIZES or dimensions > 7:
        raise FileError(f"parameter {name[:40]!r} is damaged: type {size}, {dimensions} dimensions", path=path)
    shape = tuple(data[at + 2 : at + 2 + dimensions])
    count = int(np.prod(shape, dtype=np.int64)) if shape else 1
    at += 2 + dimensions
    if at + count * _SIZES[size] > len(data):
        raise FileError(f"parameter {name[:40]!r} is cut", path=path)
    block = data[at : at + count * _SIZES[size]]
    if size == -1:
        wide = shape[0] if shape else 1
        return tuple(_text(block[k : k + wide]) for k in range(0, count, wide)) if wide else ()
    if size == 4:
        return tuple(_floats(block, kind).tolist())
    return tuple(np.frombuffer(block, f"{'>' if kind == _MIPS else '<'}{'i' if size == 2 else 'u'}{size}").tolist())


def _text(block: bytes) -> str:
    return block.decode("utf-8", "replace").strip(" \0")


def _floats(block: bytes, kind: int) -> Float[Array, "_"]:
    """Floats of the file's processor."""
    if kind == _DEC:  # the halves change places, and the exponent counts from two more
        return np.frombuffer(block, "<u2").reshape(-1, 2)[:, ::-1].copy().view("<f4").reshape(-1).astype(np.float64) / 4
    return np.frombuffer(block, ">f4" if kind == _MIPS else "<f4").astype(np.float64)
