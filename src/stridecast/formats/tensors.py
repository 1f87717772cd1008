"""Named arrays with a header, in one safetensors file: what databases and cached takes are stored in.

The header is JSON under one key of the file's metadata, so the same content gives the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from stridecast.errors import DatabaseFileError
from stridecast.formats.files import looks_like, read_start, replacing
from stridecast.model.skeleton import Skeleton

_KEY = "stridecast"

Tensors = dict[str, np.ndarray]


def write_tensors(path: str | Path, header: Mapping[str, Any], tensors: Mapping[str, np.ndarray]) -> None:
    """Write arrays and a header (anything JSON can say), beside their place and then renamed.

    Raises
    ------
    FileError
        The file system refuses; what was at ``path`` is untouched.
    """
    text = json.dumps(header, allow_nan=False, separators=(",", ":"))
    data = save({name: np.ascontiguousarray(array) for name, array in tensors.items()}, {_KEY: text})
    with replacing(path) as file:
        file.write(data)


def read_tensors(path: str | Path, kind: str, version: int) -> tuple[dict[str, Any], Tensors]:
    """Read what ``write_tensors`` wrote with ``format`` and ``version`` in its header.

    Raises
    ------
    DatabaseFileError
        No such file, not readable, damaged, something else, or of a newer version.
    """
    if not Path(path).is_file():
        what = "is a folder, not a file" if Path(path).is_dir() else "there is no such file"
        raise DatabaseFileError(f"cannot be read: {what}", path=path)
    start = read_start(path)
    try:
        with safe_open(str(path), framework="numpy") as file:
            text = (file.metadata() or {}).get(_KEY)
            names = list(file.keys())
            header = None if text is None else _header(path, kind, version, text)
            tensors = {name: file.get_tensor(name) for name in names} if header is not None else {}
    except OSError as error:
        raise DatabaseFileError(f"cannot be read: {error.strerror or error}", path=path) from error
    except SafetensorError as error:
        if not start:
            raise DatabaseFileError("is empty", path=path) from None
        if _is_cut(start):
            raise DatabaseFileError(f"is damaged or cut ({error}); build it again", path=path) from None
        seems = looks_like(start)
        hint = f"; it looks like {seems}" if seems else ""
        raise DatabaseFileError(f"is no {kind}: not a safetensors file{hint}", path=path) from None
    if header is None:
        shown = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")
        raise DatabaseFileError(f"is no {kind}: a safetensors file of something else (it holds {shown})", path=path)
    return header, tensors


def _is_cut(start: bytes) -> bool:
    """Tell whether a file that cannot be read begins as a safetensors file: a length, then JSON."""
    return start[8:9] == b"{" and int.from_bytes(start[:8], "little") < 1 << 30


def _header(path: str | Path, kind: str, version: int, text: str) -> dict[str, Any]:
    try:
        header = json.loads(text)
        found, written = str(header["format"]), int(header["version"])
    except (ValueError, KeyError, TypeError):
        raise DatabaseFileError("is damaged: its header cannot be read; build it again", path=path) from None
    if found != kind:
        raise DatabaseFileError(f"is no {kind}, but a {found}", path=path)
    if written > version:
        raise DatabaseFileError(
            f"is a {kind} of version {written}; this stridecast reads up to version {version}: upgrade stridecast",
            path=path,
        )
    return dict(header)


def pack_skeleton(skeleton: Skeleton) -> tuple[dict[str, Any], Tensors]:
    """Take a skeleton apart into a header and arrays; ``unpack_skeleton`` makes the same one of them."""
    header = {"names": list(skeleton.names), "roles": dict(skeleton.roles)}
    return header, {f"skeleton.{name}": getattr(skeleton, name) for name in _SKELETON}


def unpack_skeleton(header: Mapping[str, Any], tensors: Mapping[str, np.ndarray]) -> Skeleton:
    """Make a skeleton of its header and arrays; errors of ``Skeleton``, a ``KeyError`` where something is missing."""
    arrays = {name: tensors[f"skeleton.{name}"] for name in _SKELETON}
    return Skeleton(names=tuple(header["names"]), roles=dict(header["roles"]), **arrays)


_SKELETON = ("parents", "offsets", "end_joints", "end_offsets")
