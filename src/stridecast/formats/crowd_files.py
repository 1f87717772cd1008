"""Files of a crowd that are written while it walks: a table of everybody's places, and a BVH a person with an index."""

from __future__ import annotations

import csv
import io
import re
import time
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import numpy as np
from jaxtyping import Float, Int

from stridecast.errors import FileError
from stridecast.formats.bvh import write_bvh
from stridecast.formats.bvh_conventions import BvhConvention
from stridecast.formats.files import check_place
from stridecast.formats.trajectory_tables import check_parquet, csv_to_parquet
from stridecast.geometry import ground
from stridecast.model.motion import Motion

Array = np.ndarray

OUTPUTS = (".csv", ".parquet", ".bvh")
"""Endings of what a crowd is written as."""

FLUSH = 1.0
"""Rows reach the disk at least so often, seconds, ..."""

FULL = 1 << 20
"""... or when there are so many bytes."""

ROW = "%d,%.9f,%.8f,%.8f,%.6f,%.6f\n"
"""Of places: fine enough for accelerations and their change to come out of them."""

LONGEST_NAME = 80
"""Characters of a person's name in the name of a file."""


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


class CrowdFiles:
    """What a crowd is written to, as a context.

    ``x.csv``, ``x.parquet``
        Everybody's places: ``id,time,x,y,heading,speed``.
    ``x.bvh``
        ``x.csv``, and for each person ``x.NAME.bvh``; ``x.people.csv`` tells whose is which, and when each begins.

    Rows are written as they come, to ``x.part.csv`` and ``x.people.part.csv``, which take their names at the end. Where
    an error ends the context before, they stay as they are, and so does each BVH.

    Parameters
    ----------
    output
        A name as above.
    convention
        How BVH is written (see ``write_bvh``).

    Raises
    ------
    FileError
        Another ending, or the file system refuses.
    """

    def __init__(self, output: str | Path, convention: str | BvhConvention = "plain") -> None:
        self.output = Path(output)
        self.convention = convention
        self.bodies = kind_of(self.output) == ".bvh"
        self.table = self.output.with_suffix(".csv") if self.bodies else self.output
        self.index = self.output.with_suffix(".people.csv") if self.bodies else None
        self.motions: list[Path] = []
        self.kept: list[Path] = []
        self._names: set[str] = set()
        self._parts: list[PartFile] = []

    def __enter__(self) -> CrowdFiles:
        self._parts.append(PartFile(self.table, "id,time,x,y,heading,speed"))
        if self.index is not None:
            self._parts.append(PartFile(self.index, "id,name,start,seconds,frames,height,file"))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kept = [part.part for part in self._parts]
        if kind is not None:
            for part in self._parts:
                try:
                    part.close()
                except FileError:  # the disk is full, say: what ended it all is more to the point
                    continue
            return
        for part in self._parts:
            part.close()
        for part in self._parts:
            if part.path.suffix.lower() == ".parquet":
                csv_to_parquet(part.part, part.path)
                part.part.unlink()
            else:
                part.rename()
            self.kept.remove(part.part)

    @property
    def files(self) -> tuple[Path, ...]:
        """Everything that is written, without the motions."""
        return tuple(path for path in (self.table, self.index) if path is not None)

    def add_rows(
        self,
        ids: Int[Array, "rows"],
        times: Float[Array, "rows"],
        positions: Float[Array, "rows 2"],
        headings: Float[Array, "rows"],
        speeds: Float[Array, "rows"],
    ) -> None:
        """Add places, ground points and radians as everywhere; in the file ``y`` is ``-z``, angles are from ``+x``."""
        angles = ground.wrap(headings - 0.5 * np.pi)
        x, y = positions[:, 0] + 0.0, 0.0 - positions[:, 1]
        columns = (ids.tolist(), times.tolist(), x.tolist(), y.tolist(), angles.tolist(), speeds.tolist())
        self._parts[0].add("".join([ROW % row for row in zip(*columns, strict=True)]))

    def add_motion(self, number: int, name: str, start: float, motion: Motion, height: float) -> Path:
        """Write somebody's motion and its row of the index; ``start`` in seconds, ``height`` in metres."""
        path = self._place_of(number, name)
        write_bvh(path, motion, convention=self.convention)
        self.motions.append(path)
        row = (number, name, f"{start:.9f}", f"{motion.seconds:.9f}", motion.frames, f"{height:.3f}", path.name)
        self._parts[1].add(_csv_row(row))
        return path

    def _place_of(self, number: int, name: str) -> Path:
        """A name that every file system takes, and that nobody else has; small and capital letters are the same."""
        safe = re.sub(r"[^\w-]+", "_", name, flags=re.ASCII).strip("_")[:LONGEST_NAME] or str(number)
        words = (safe, f"{safe}.{number}", *(f"{safe}.{number}.{k}" for k in range(2, len(self._names) + 3)))
        word = next(word for word in words if word.casefold() not in self._names)
        self._names.add(word.casefold())
        return self.output.with_suffix(f".{word}.bvh")


def kind_of(output: str | Path) -> str:
    """Ending of a file that a crowd can be written as.

    Raises
    ------
    FileError
        Another ending, Parquet without its library, or the file cannot be written there.
    """
    output = Path(output)
    kind = output.suffix.lower()
    if kind not in OUTPUTS:
        raise FileError(f"a crowd is written as {', '.join(f'*{ending}' for ending in OUTPUTS)}", path=output)
    if kind == ".parquet":
        check_parquet(output)
    check_place(output)
    return kind


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


def _csv_row(row: Sequence[object]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerow(row)
    return out.getvalue()
