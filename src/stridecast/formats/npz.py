"""NumPy's ``.npz``: named arrays in a ZIP archive, read one by one, nothing in them executed, and within bounds.

What an array claims to be is checked against what the archive holds before room for it is made.
"""

from __future__ import annotations

import io
import math
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np

from stridecast.errors import FileError

MOST_MEMBERS = 10_000
"""So many arrays an archive may hold."""

MOST_HEADER = 1 << 14
"""Bytes of an array's header."""

SMALL_TEXT = 1024
"""Longest string that is read, characters."""

_END = b"PK\x05\x06"
_END_LENGTH, _MOST_COMMENT = 22, 1 << 16
_PIECE = 1 << 20
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


class _Header(NamedTuple):
    """What an array claims to be; its numbers begin at byte ``start`` of the member."""

    shape: tuple[int, ...]
    in_columns: bool
    dtype: np.dtype
    start: int

    @property
    def bytes(self) -> int:
        return math.prod(self.shape) * self.dtype.itemsize


class NpzArrays:
    """The arrays of an open ``.npz`` file; see ``open_npz``."""

    def __init__(self, path: str | Path, archive: zipfile.ZipFile) -> None:
        self.path = path
        self._archive = archive
        self._members = {item.filename.removesuffix(".npy"): item for item in archive.infolist()}
        self._headers: dict[str, _Header] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arrays, in the order of the file."""
        return tuple(self._members)

    def __contains__(self, name: object) -> bool:
        return name in self._members

    def shape(self, name: str) -> tuple[int, ...]:
        """What shape an array claims to have.

        Raises
        ------
        FileError
            It is no array.
        """
        return self._header(name).shape

    def numbers(self, name: str, most: int) -> np.ndarray:
        """Read an array of numbers as float64.

        Parameters
        ----------
        name
            One of ``names``.
        most
            So many numbers it may have.

        Raises
        ------
        FileError
            It holds something else, more than that, or is damaged; no room was made for it.
        """
        header = self._header(name)
        if header.dtype.kind not in "fiu":
            raise FileError(f"{name!r} should be an array of numbers, not of {_kind(header.dtype)}", path=self.path)
        if math.prod(header.shape) > most:
            raise FileError(
                f"{name!r} has shape {header.shape}; at most {most} numbers are read, so the file is broken or no "
                "recording",
                path=self.path,
            )
        return self._array(name, header).astype(np.float64)

    def number(self, name: str) -> float:
        """Read a single number.

        Raises
        ------
        FileError
            It is no single number.
        """
        values = self.numbers(name, 1 << 10)
        if values.size != 1:
            raise FileError(f"{name!r} should be one number, but has shape {values.shape}", path=self.path)
        return float(values.reshape(-1)[0])

    def word(self, name: str) -> str:
        """Read a single string, or bytes that hold one; "" if it is something else.

        Raises
        ------
        FileError
            It is damaged.
        """
        header = self._header(name)
        if header.dtype.kind not in "US" or math.prod(header.shape) != 1 or header.bytes > 4 * SMALL_TEXT:
            return ""
        value = self._array(name, header).reshape(-1)[0]
        return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)

    def _header(self, name: str) -> _Header:
        if name not in self._headers:
            self._headers[name] = self._read_header(name)
        return self._headers[name]

    def _read_header(self, name: str) -> _Header:
        item = self._members[name]
        if item.compress_type not in _METHODS:
            raise FileError(f"{name!r} is packed as NumPy packs nothing; save it with numpy.savez", path=self.path)
        with self._open(name) as member:
            start = io.BytesIO(member.read(MOST_HEADER))
        try:
            version = np.lib.format.read_magic(start)
            if version == (1, 0):
                shape, in_columns, dtype = np.lib.format.read_array_header_1_0(start)
            elif version == (2, 0):
                shape, in_columns, dtype = np.lib.format.read_array_header_2_0(start)
            else:
                raise ValueError(f"format {version[0]}.{version[1]} is not read")
        except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError, EOFError) as error:
            what = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
            raise FileError(f"{name!r} is no NumPy array: {what}", path=self.path) from None
        if any(count < 0 for count in shape) or math.prod(shape) > 1 << 48:
            raise FileError(f"{name!r} claims to have shape {shape}, which is none", path=self.path)
        header = _Header(tuple(int(count) for count in shape), in_columns, dtype, start.tell())
        if not dtype.hasobject and header.start + header.bytes != item.file_size:
            raise FileError(
                f"{name!r} is cut: its shape {header.shape} needs {header.start + header.bytes} bytes, and there are "
                f"{item.file_size}",
                path=self.path,
            )
        return header

    def _array(self, name: str, header: _Header) -> np.ndarray:
        data = bytearray()
        with self._open(name) as member:
            member.read(header.start)
            while len(data) < header.bytes:  # the archive may promise more than it has: grow with what comes
                piece = member.read(min(_PIECE, header.bytes - len(data)))
                if not piece:
                    raise FileError(f"{name!r} is cut after {len(data)} of {header.bytes} bytes", path=self.path)
                data += piece
            member.read(1)  # makes it check the sum
        return np.frombuffer(data, header.dtype).reshape(header.shape, order="F" if header.in_columns else "C")

    @contextmanager
    def _open(self, name: str) -> Iterator[IO[bytes]]:
        """Open a member, telling what is wrong with it in plain words."""
        try:
            with self._archive.open(self._members[name]) as member:
                yield member
        except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError, struct.error) as error:
            raise FileError(f"{name!r} is damaged: {error or 'it ends too early'}", path=self.path) from None
        except OSError as error:
            raise FileError(f"cannot be read: {error.strerror or error}", path=self.path) from error


@contextmanager
def open_npz(path: str | Path) -> Iterator[NpzArrays]:
    """Open a ``.npz`` file for reading its arrays one by one, without pickles.

    Raises
    ------
    FileError
        It cannot be read, or is no ZIP archive of arrays.
    """
    try:
        with Path(path).open("rb") as file:
            _check_directory(path, file)
            try:
                archive = zipfile.ZipFile(file)
            except (zipfile.BadZipFile, ValueError, NotImplementedError, struct.error, OverflowError) as error:
                raise FileError(f"is damaged, or no .npz file: {error}", path=path) from None
            with archive:
                yield NpzArrays(path, archive)
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error


def _check_directory(path: str | Path, file: IO[bytes]) -> None:
    """Refuse a table of contents that is larger than that of any archive of arrays, before it is read."""
    size = file.seek(0, io.SEEK_END)
    file.seek(max(size - _MOST_COMMENT - _END_LENGTH, 0))
    tail = file.read()
    at = tail.rfind(_END)
    if at < 0 or len(tail) < at + _END_LENGTH:
        raise FileError("is no .npz file, or cut: it has no table of contents at its end", path=path)
    entries, length = struct.unpack("<HI", tail[at + 10 : at + 16])
    # ZIP64 would hide the true numbers; no recording is so long
    if tail[max(at - 20, 0) : at].startswith(b"PK\x06\x07") or entries > MOST_MEMBERS or length > 100 * MOST_MEMBERS:
        raise FileError(f"claims to hold more than {MOST_MEMBERS} arrays, which no recording does", path=path)
    file.seek(0)


def _kind(dtype: np.dtype) -> str:
    if dtype.hasobject:
        return "Python objects, which are not read as they could run code"
    return {"U": "text", "S": "bytes", "b": "yes and no", "c": "complex numbers"}.get(dtype.kind, str(dtype))
