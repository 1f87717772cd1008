"""The container of GLB: JSON that tells what there is, and one block of numbers (Khronos, "glTF 2.0", chapter 4).

Numbers are written as they come; only the JSON is kept in memory, as text, and goes before them at the end.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

import numpy as np

from stridecast.errors import FileError
from stridecast.formats.files import replacing

Array = np.ndarray

MAGIC, VERSION = 0x46546C67, 2
JSON_CHUNK, BIN_CHUNK = 0x4E4F534A, 0x004E4942
BLOCK = 1 << 20
LARGEST = 2**32 - 1
"""A GLB counts its bytes in 32 bits."""

COMPONENTS = {
    np.dtype("<i1"): 5120,
    np.dtype("<u1"): 5121,
    np.dtype("<i2"): 5122,
    np.dtype("<u2"): 5123,
    np.dtype("<u4"): 5125,
    np.dtype("<f4"): 5126,
}
"""Codes of number types, as glTF has them from OpenGL."""

TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
VERTICES, INDICES = 34962, 34963
"""What a block is for: attributes of vertices, or triangles."""


class GltfWriter:
    """Builds a GLB piece by piece.

    Parameters
    ----------
    beside
        Where the file is to be: numbers wait in a nameless file in that folder, not in memory. Left out: in memory.

    Raises
    ------
    FileError
        The file system refuses.
    """

    def __init__(self, beside: str | Path | None = None) -> None:
        self._parts: dict[str, list[str]] = {}
        self._blocks: list[Array] = []
        self._size = 0
        self._beside = beside
        self._file: IO[bytes] | None = None
        if beside is not None:
            try:
                self._file = TemporaryFile(dir=Path(beside).absolute().parent)  # noqa: SIM115  # closed by close
            except OSError as error:
                raise FileError(f"cannot be written: {error.strerror or error}", path=beside) from error

    def add(self, part: str, content: Mapping[str, object]) -> int:
        """Add an object to a list of the document (``nodes``, ``meshes``); its index."""
        return self.add_text(part, to_json(content))

    def add_text(self, part: str, text: str) -> int:
        """Add an object that is JSON already."""
        items = self._parts.setdefault(part, [])
        items.append(text)
        return len(items) - 1

    def count(self, part: str) -> int:
        """Objects in a list until now."""
        return len(self._parts.get(part, ()))

    def view(self, array: Array, target: int | None = None) -> int:
        """Add numbers as a buffer view; its index.

        Raises
        ------
        FileError
            The disk is full, or the file would be larger than a GLB can be.
        """
        start = self.put(array)
        use = "" if target is None else f',"target":{target}'
        return self.add_text("bufferViews", f'{{"buffer":0,"byteOffset":{start},"byteLength":{array.nbytes}{use}}}')

    def put(self, array: Array) -> int:
        """Add numbers without a view of them; the byte at which they begin.

        Raises
        ------
        FileError
            As of ``view``.
        """
        start, length = self._size, array.nbytes
        if start + length > LARGEST - (1 << 28):
            raise FileError("would be larger than the 4 GB that a GLB can hold; write fewer people", path=self._beside)
        self._write(np.ascontiguousarray(array))
        self._size += length
        if length % 4:
            self._write(np.zeros(-length % 4, np.uint8))
            self._size += -length % 4
        return start

    def accessor(
        self, array: Array, *, target: int | None = None, bounds: bool = False, normalized: bool = False
    ) -> int:
        """Add numbers with what they are; the last axis are the components where there are more than one."""
        return self.part_of(self.view(array, target), 0, array, bounds=bounds, normalized=normalized)

    def later(self) -> int:
        """An accessor whose numbers come later, by ``come``."""
        return self.add_text("accessors", "")

    def come(self, index: int, array: Array) -> None:
        """Add the numbers of an accessor that has been asked for, with their bounds."""
        self._parts["accessors"][index] = _described(self.view(array), 0, array, bounds=True, normalized=False)

    def part_of(self, view: int, start: int, array: Array, *, bounds: bool = False, normalized: bool = False) -> int:
        """Say what the numbers of a view are from a byte on; ``array`` tells their type, count and bounds."""
        return self.add_text("accessors", _described(view, start, array, bounds=bounds, normalized=normalized))

    def save(self, path: str | Path, head: Mapping[str, object]) -> None:
        """Write the file beside its place and rename it; ``head`` is what is no list (``asset``, ``scene``).

        Raises
        ------
        FileError
            The file system refuses; what was there is untouched.
        """
        with replacing(path) as file:
            for piece in self._pieces(head):
                file.write(piece)

    def to_bytes(self, head: Mapping[str, object]) -> bytes:
        """The file in memory."""
        return b"".join(self._pieces(head))

    def close(self) -> None:
        """Drop the numbers."""
        self._blocks = []
        if self._file is not None:
            self._file.close()

    def _pieces(self, head: Mapping[str, object]) -> Iterator[bytes | memoryview]:
        parts = [f"{to_json(name)}:{to_json(content)}" for name, content in head.items()]
        if self._size:
            parts.append(f'"buffers":[{{"byteLength":{self._size}}}]')
        parts += [f"{to_json(name)}:[{','.join(items)}]" for name, items in self._parts.items()]
        text = ("{" + ",".join(parts) + "}").encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + (8 + self._size if self._size else 0)
        if total > LARGEST:
            raise FileError("would be larger than the 4 GB that a GLB can hold; write fewer people", path=self._beside)
        yield struct.pack("<3I", MAGIC, VERSION, total)
        yield struct.pack("<2I", len(text), JSON_CHUNK) + text
        if self._size:
            yield struct.pack("<2I", self._size, BIN_CHUNK)
        if self._file is None:
            yield from (block.data for block in self._blocks)
            return
        self._file.seek(0)
        while block := self._file.read(BLOCK):
            yield block

    def _write(self, block: Array) -> None:
        if self._file is None:
            self._blocks.append(block)
            return
        try:
            self._file.write(block.data)
        except OSError as error:
            raise FileError(f"cannot be written: {error.strerror or error}", path=self._beside) from error


def _described(view: int, start: int, array: Array, *, bounds: bool, normalized: bool) -> str:
    components = 1 if array.ndim == 1 else array.shape[-1]
    extra = ""
    if bounds:
        flat = array.reshape(-1, components)
        least, most = (to_json([number(x) for x in f(axis=0).tolist()]) for f in (flat.min, flat.max))
        extra = f',"min":{least},"max":{most}'
    if normalized:
        extra += ',"normalized":true'
    return (
        f'{{"bufferView":{view},"byteOffset":{start},"componentType":{COMPONENTS[array.dtype]},'
        f'"count":{array.size // components},"type":"{TYPES[components]}"{extra}}}'
    )


def number(value: float) -> float | int:
    """A number as JSON has it: exactly the float32 or integer that it is."""
    return int(value) if float(value).is_integer() and abs(value) < 2**53 else float(value)


def to_json(content: object) -> str:
    """JSON without blanks."""
    return json.dumps(content, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
