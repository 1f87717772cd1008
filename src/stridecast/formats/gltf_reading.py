"""Read the container of GLB with distrust: whatever a file says of counts, places and indices is checked first.

Only numbers inside the file are read, and only those that are asked for; no other file is opened.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np
from jaxtyping import Float, Int

from stridecast.errors import FileError
from stridecast.formats.files import looks_like
from stridecast.formats.gltf import BIN_CHUNK, JSON_CHUNK, MAGIC, VERSION

Array = np.ndarray

LARGEST_JSON = 1 << 27
"""Bytes of JSON that are read at most."""

MOST_NODES = 1 << 17
MOST_NUMBERS, MOST_IN_ALL = 1 << 22, 1 << 26
"""Numbers of one accessor, and of all, that are read at most: a file may point at the same ones again and again."""

TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDE = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


class GltfReader:
    """A GLB that is open for reading.

    Parameters
    ----------
    path, file
        The file, and the same opened for reading bytes.

    Raises
    ------
    FileError
        It is no GLB of version 2, is cut, or its JSON is none.
    """

    def __init__(self, path: str | Path, file: IO[bytes]) -> None:
        self.path = path
        self._file = file
        self._start, self._size = 0, 0
        self._read = 0
        self._lists: dict[str, list[dict[str, Any]]] = {}  # of the document, once they are looked through
        self.document = self._open()
        self.parents = self._parents()

    def wrong(self, what: str) -> NoReturn:
        """Refuse the file.

        Raises
        ------
        FileError
            Always.
        """
        raise FileError(what, path=self.path)

    def objects(self, part: str, within: Mapping[str, Any] | None = None, where: str = "") -> list[dict[str, Any]]:
        """A list of objects of the document, empty where there is none."""
        if within is None and part in self._lists:
            return self._lists[part]
        found = (self.document if within is None else within).get(part, [])
        if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
            self.wrong(f"{where}{part} must be a list of objects")
        if within is None:
            self._lists[part] = found
        return found

    def one(self, part: str, index: object, where: str) -> dict[str, Any]:
        """An object of a list of the document, by its index."""
        items = self.objects(part)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(items):
            self.wrong(f"{where} points at {part} {index!r}, and there are {len(items)}")
        return items[index]

    def whole(self, thing: Mapping[str, Any], key: str, where: str, usual: int | None = None) -> int:
        """A whole number that is not negative."""
        value = thing.get(key, usual)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            self.wrong(f"{key} of {where} must be a whole number from 0, not {value!r}")
        return value

    def numbers(self, thing: Mapping[str, Any], key: str, usual: Sequence[float], where: str) -> Float[Array, "_"]:
        """Some finite numbers, as many as usual."""
        value = thing.get(key, usual)
        good = isinstance(value, (list, tuple)) and len(value) == len(usual)
        if not good or not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in value):
            self.wrong(f"{key} of {where} must be {len(usual)} numbers")
        try:
            out = np.array(value, np.float64)
        except OverflowError:
            out = np.full(len(usual), np.inf)
        if not np.isfinite(out).all():
            self.wrong(f"{key} of {where} must be finite numbers")
        return out

    def accessor(self, index: object, where: str, kinds: Sequence[str]) -> Float[Array, "count components"]:
        """Numbers of an accessor; whole ones that are normalised become fractions.

        Raises
        ------
        FileError
            It is not there, of another type, outside of the file, too large, sparse, packed, or not finite.
        """
        told = self.one("accessors", index, where)
        name = f"accessor {index} ({where})"
        kind, code = str(told.get("type")), told.get("componentType")
        if kind not in kinds or not isinstance(code, int) or code not in TYPES:
            self.wrong(f"{name} must be {' or '.join(kinds)} of a known number type, not {kind!r} of {code!r}")
        if "sparse" in told or "bufferView" not in told:
            self.wrong(f"{name} is sparse, which is not read; export the animation with all of its keys")
        count, start = self.whole(told, "count", name), self.whole(told, "byteOffset", name, 0)
        view = self.one("bufferViews", told["bufferView"], name)
        if "EXT_meshopt_compression" in view.get("extensions", {}):
            self.wrong("is compressed by meshopt, which is not read; export it without compression")
        buffer = self.one("buffers", view.get("buffer"), f"buffer view {told['bufferView']}")
        if "uri" in buffer or view.get("buffer") != 0:
            self.wrong("has its numbers in another file, which is not opened; export it as one GLB")
        dtype, wide = np.dtype(TYPES[code]), WIDE[kind]
        first = self.whole(view, "byteOffset", name, 0)
        length = self.whole(view, "byteLength", name)
        tight = dtype.itemsize * wide
        stride = self.whole(view, "byteStride", name, tight)
        if count == 0:
            self.wrong(f"{name} is empty")
        if count * wide > MOST_NUMBERS:
            self.wrong(f"{name} claims {count} entries; at most {MOST_NUMBERS // wide} are read")
        self._read += count * wide
        if self._read > MOST_IN_ALL:
            self.wrong(f"has more than {MOST_IN_ALL} numbers in what would be read")
        if stride < tight or start + (count - 1) * stride + tight > length or first + length > self._size:
            self.wrong(f"{name} reaches beyond the numbers that the file has")
        self._file.seek(self._start + first + start)
        data = self._file.read((count - 1) * stride + tight)
        if len(data) < (count - 1) * stride + tight:
            self.wrong("is cut: it ends before its numbers do")
        raw = np.ndarray((count, wide), dtype, data, 0, (stride, dtype.itemsize))
        out = raw.astype(np.float64)
        if told.get("normalized") is True and dtype.kind != "f":
            out = np.maximum(out / np.iinfo(dtype).max, -1.0)
        if not np.isfinite(out).all():
            self.wrong(f"{name} has a number that is not finite, at entry {int(np.argwhere(~np.isfinite(out))[0, 0])}")
        return out

    def binary(self) -> bytes:
        """All numbers that the file carries; large ones take as much memory."""
        self._file.seek(self._start)
        return self._file.read(self._size)

    def _open(self) -> dict[str, Any]:
        head = self._file.read(20)
        if len(head) < 4 or struct.unpack("<I", head[:4])[0] != MAGIC:
            seems = looks_like(head + self._file.read(4096))
            self.wrong("is no GLB" + (f"; it looks like {seems}" if seems else ""))
        if len(head) < 20:
            self.wrong("is cut: it ends in its header")
        _, version, total, length, kind = struct.unpack("<5I", head)
        if version != VERSION:
            self.wrong(f"is a GLB of version {version}; version {VERSION} is read")
        size = self._file.seek(0, 2)
        if size < total or 20 + length > size:
            self.wrong(f"is cut: it should have {max(total, 20 + length)} bytes and has {size}")
        if kind != JSON_CHUNK or length > LARGEST_JSON:
            self.wrong(f"must begin with its JSON, of at most {LARGEST_JSON} bytes")
        self._file.seek(20)
        text = self._file.read(length)
        rest = self._file.read(8)
        if len(rest) == 8:
            block, kind = struct.unpack("<2I", rest)
            if 28 + length + block > size:
                self.wrong(f"is cut: it should have {28 + length + block} bytes and has {size}")
            if kind == BIN_CHUNK:
                self._start, self._size = 28 + length, block
        return self._parsed(text)

    def _parsed(self, text: bytes) -> dict[str, Any]:
        def constant(word: str) -> NoReturn:
            raise ValueError(f"{word} is no number of JSON")

        try:
            document = json.loads(text, parse_constant=constant)
        except (ValueError, RecursionError) as error:
            why = "nested too deeply" if isinstance(error, RecursionError) else str(error)
            raise FileError(f"has JSON that cannot be read: {why}", path=self.path) from None
        if not isinstance(document, dict):
            self.wrong("has JSON that is no object")
        return document

    def _parents(self) -> Int[Array, "nodes"]:
        """Parent of each node, -1 for those that have none; every node hangs from one of these."""
        self.document.setdefault("nodes", [])
        nodes = self.objects("nodes")
        if len(nodes) > MOST_NODES:
            self.wrong(f"has {len(nodes)} nodes; at most {MOST_NODES} are read")
        parents = np.full(len(nodes), -1, np.int64)
        for k, node in enumerate(nodes):
            children = node.get("children", [])
            if not isinstance(children, list):
                self.wrong(f"children of node {k} must be a list")
            for child in children:
                self.one("nodes", child, f"node {k}")
                if parents[child] >= 0:
                    self.wrong(f"node {child} hangs from node {parents[child]} and from node {k}")
                parents[child] = k
        reached = np.flatnonzero(parents < 0).tolist()
        for k in reached:  # grows while it is walked over
            reached += nodes[k].get("children", [])
        if len(reached) < len(nodes):
            left = sorted(set(range(len(nodes))) - set(reached))
            self.wrong(f"has nodes that hang from themselves, such as node {left[0]}")
        return parents
