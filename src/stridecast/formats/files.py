"""Text files: read whole with plain words for what is wrong with them, written so that a crash leaves the old one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from secrets import token_hex
from typing import BinaryIO

from stridecast.errors import FileError

_START = 4096
"""Bytes in which the signs of a format are looked for."""

_SIGNS = (
    (b"hierarchy", "a BVH recording"),
    (b"#!oml:asf", "an AMC recording"),
    (b":fully-specified", "an AMC recording"),
    (b":degrees", "an AMC recording"),
    (b":bonedata", "an ASF skeleton"),
    (b":version", "an ASF skeleton"),
    (b"version https://git-lfs", "a Git LFS pointer: the recording itself was never fetched"),
    (b"<!doctype", "a web page"),
    (b"<html", "a web page"),
    (b"; fbx", "an FBX file"),
)
_BINARY_SIGNS = (
    (b"Kaydara FBX", "an FBX file"),
    (b"glTF", "a GLB file"),
    (b"PK\x03\x04", "a ZIP archive (or an .npz file)"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"\x93NUMPY", "a NumPy array"),
    (b"PXR-USDC", "a USD file"),
    (b"\xff\xfe", "text in UTF-16; it must be saved as UTF-8"),
    (b"\xfe\xff", "text in UTF-16; it must be saved as UTF-8"),
)


def looks_like(data: bytes) -> str:
    """Name what a file holds from its first bytes, as "a BVH recording" or "an FBX file"; "" where nothing tells."""
    for sign, name in _BINARY_SIGNS:
        if data.startswith(sign):
            return name
    if len(data) > 1 and data[1] == 0x50 and b"\0" in data[:512]:
        return "a C3D file"
    if b"\0" in data:
        return "binary data"
    head = data[:_START].lower()
    found = [(head.find(sign), name) for sign, name in _SIGNS if sign in head]
    return min(found)[1] if found else ""


def read_start(path: str | Path) -> bytes:
    """First bytes of a file, enough for ``looks_like``.

    Raises
    ------
    FileError
        No such file, or not readable.
    """
    try:
        with Path(path).open("rb") as file:
            return file.read(_START)
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error


def read_text(path: str | Path) -> bytes:
    r"""Whole content of a text file, without byte order mark, every line end as ``\n``.

    Raises
    ------
    FileError
        No such file, not readable, empty, or binary (with what it looks like).
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error
    if b"\0" in data:
        raise FileError(f"should be text, but looks like {looks_like(data)}", path=path)
    data = data.removeprefix(b"\xef\xbb\xbf")
    if not data.strip():
        raise FileError("is empty", path=path)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data


def check_place(path: str | Path) -> None:
    """Raise the error that ``replacing`` would raise, before the work whose result is to be written.

    Raises
    ------
    FileError
        There is no such folder, no right to write in it, or a folder of that name.
    """
    path = Path(path)
    if path.is_dir():
        raise FileError("cannot be written: it is a folder; name a file in it", path=path)
    if not path.parent.is_dir():
        raise FileError("cannot be written: there is no such folder", path=path)
    temporary = _beside(path)
    try:
        temporary.touch(exist_ok=False)
        temporary.unlink()
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror or error}", path=path) from error


@contextmanager
def replacing(path: str | Path) -> Iterator[BinaryIO]:
    """Open a new file beside ``path`` for writing; it takes that name only once it is whole.

    Raises
    ------
    FileError
        The file system refuses (no such folder, no right, disk full). What was at ``path`` is untouched.
    """
    path = Path(path)
    temporary = _beside(path)
    try:
        try:
            with temporary.open("xb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror or error}", path=path) from error


@contextmanager
def replacing_path(path: str | Path) -> Iterator[Path]:
    """Name a new file beside ``path``, of the same ending, for libraries that write by name; then as ``replacing``.

    Raises
    ------
    FileError
        The file system refuses (no such folder, no right, disk full). What was at ``path`` is untouched.
    """
    path = Path(path)
    check_place(path)
    temporary = path.with_name(f".{path.stem}.{token_hex(4)}.part{path.suffix}")
    try:
        try:
            yield temporary
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror or error}", path=path) from error


def _beside(path: Path) -> Path:
    """Name of an unfinished file."""
    return path.with_name(f".{path.name}.{token_hex(4)}.part")
