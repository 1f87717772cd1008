"""A table that is written while it grows, and is whole whatever happens to the process."""

from __future__ import annotations

import time
from itertools import count
from pathlib import Path
from typing import BinaryIO

from stridecast.errors import FileError

FLUSH = 1.0
"""Rows reach the disk at least so often, seconds, ..."""

FULL = 1 << 20
"""... or when there are so many bytes."""


class PartFile:
    """A table under a name of its own, ``x.part.csv``, which becomes ``x.csv`` at the end.

    Whole rows are written at a time, so that it can be read whatever happens to the process.

    Parameters
    ----------
    path
        The table to be.
    header
        Names of the columns.

    Raises
    ------
    FileError
        The file system refuses.
    """

    def __init__(self, path: Path, header: str) -> None:
        self.path = path
        self.part, self._file = _open_beside(path)
        self._rows = [header + "\n"]
        self._size = len(header)
        self._written = time.monotonic()
        self.flush()

    def add(self, rows: str) -> None:
        """Take whole rows, each with its line end."""
        self._rows.append(rows)
        self._size += len(rows)
        if self._size > FULL or time.monotonic() - self._written > FLUSH:
            self.flush()

    def flush(self) -> None:
        """Write all that there is."""
        data = memoryview("".join(self._rows).encode())
        try:
            while data:
                data = data[self._file.write(data) :]
        except OSError as error:
            raise FileError(f"cannot be written: {error.strerror or error}", path=self.part) from error
        self._rows, self._size, self._written = [], 0, time.monotonic()

    def close(self) -> None:
        """Write the rest and leave the file under the name that it has."""
        try:
            self.flush()
        finally:
            self._file.close()

    def rename(self) -> None:
        """Put it where it belongs."""
        try:
            self.part.replace(self.path)
        except OSError as error:
            raise FileError(f"cannot be written: {error.strerror or error}", path=self.path) from error


def _open_beside(path: Path) -> tuple[Path, BinaryIO]:
    """A new file beside another one; what is left of earlier ones stays."""
    for k in count(1):
        part = path.with_suffix(f".part{k if k > 1 else ''}.csv")
        try:
            return part, part.open("xb", buffering=0)
        except FileExistsError:
            continue
        except OSError as error:
            raise FileError(f"cannot be written: {error.strerror or error}", path=path) from error
    raise AssertionError
