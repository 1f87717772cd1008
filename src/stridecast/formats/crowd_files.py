"""Files of a crowd that are written while it walks: a table of everybody's places, and a BVH a person with an index."""

from __future__ import annotations

import csv
import io
import re
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import numpy as np
from jaxtyping import Float, Int

from stridecast.body.mannequin import mannequin
from stridecast.errors import FileError
from stridecast.formats.bvh import write_bvh
from stridecast.formats.bvh_conventions import BvhConvention
from stridecast.formats.files import check_place
from stridecast.formats.glb import GlbCrowd, check_compact
from stridecast.formats.glb_figure import Planted
from stridecast.formats.trajectories import load_trajectories
from stridecast.formats.trajectory_tables import check_parquet, csv_to_parquet
from stridecast.formats.usd import ENDINGS as USD
from stridecast.formats.usd import UsdScene, check_usd
from stridecast.geometry import ground
from stridecast.model.motion import Motion
from stridecast.model.scene import Scene

Array = np.ndarray

SCENES = (".glb", *USD)
"""Endings of files that hold everybody, ..."""

OUTPUTS = (".csv", ".parquet", ".bvh", *SCENES)
"""... and of all that a crowd is written as."""

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
    ``x.glb``, ``x.usd``, ``x.usda``, ``x.usdc``
        ``x.csv``, and everybody in one scene, which is written at the end; what an error leaves is ``x.part.glb``.
    ``x.movers.csv``
        Beside each of these, where the obstacles were that move; they wait for people (see ``moved_as_written``).

    Rows are written as they come, to ``x.part.csv`` and ``x.people.part.csv``, which take their names at the end. Where
    an error ends the context before, they stay as they are, and so does each BVH.

    Parameters
    ----------
    output
        A name as above.
    movers
        So many obstacles move.
    compact
        Write a GLB with rotations of 16 bits (see ``write_glb``).
    convention
        How BVH is written (see ``write_bvh``).

    Raises
    ------
    FileError
        Another ending, or the file system refuses.
    """

    def __init__(
        self,
        output: str | Path,
        *,
        movers: int = 0,
        convention: str | BvhConvention = "plain",
        compact: bool = False,
    ) -> None:
        self.output = Path(output)
        kind = kind_of(self.output)
        check_compact(self.output, compact)
        self.convention = convention
        self.bodies = kind == ".bvh" or kind in SCENES
        self.table = self.output.with_suffix(".csv") if self.bodies else self.output
        self.movers = movers_of(self.output) if movers else None
        self.index = self.output.with_suffix(".people.csv") if kind == ".bvh" else None
        self._scene: UsdScene | GlbCrowd | None = None
        self._in_scene = kind in SCENES
        self._compact = compact
        self.motions: list[Path] = []
        self.kept: list[Path] = []
        self._names: set[str] = set()
        self._parts: list[PartFile] = []

    def __enter__(self) -> CrowdFiles:
        self._parts.append(PartFile(self.table, "id,time,x,y,heading,speed"))
        if self.index is not None:
            self._parts.append(PartFile(self.index, "id,name,start,seconds,frames,height,file"))
        if self.movers is not None:
            self._parts.append(PartFile(self.movers, "id,time,x,y"))
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
            self._keep_scene()
            return
        for part in self._parts:
            part.close()
        if self._in_scene:
            self._scene_of(30.0).save(self.output)
        for part in self._parts:
            if part.path.suffix.lower() == ".parquet":
                csv_to_parquet(part.part, part.path)
                part.part.unlink()
            else:
                part.rename()
            self.kept.remove(part.part)

    def _keep_scene(self) -> None:
        """Write who has left until now beside the scene that is not finished."""
        if self._scene is None:
            return
        ending = self.output.suffix
        names = (self.output.with_suffix(f".part{k if k > 1 else ''}{ending}") for k in count(1))
        part = next(name for name in names if not name.exists())
        with suppress(FileError):
            self._scene.save(part)
            self.kept.append(part)

    def _scene_of(self, frame_rate: float) -> UsdScene | GlbCrowd:
        """The scene, which is begun when there is somebody to be in it."""
        if self._scene is None:
            glb = self.output.suffix.lower() == ".glb"
            self._scene = GlbCrowd(self.output, compact=self._compact) if glb else UsdScene(frame_rate)
        return self._scene

    @property
    def files(self) -> tuple[Path, ...]:
        """Everything that is written, without the motions."""
        scene = self.output if self._in_scene else None
        return tuple(path for path in (scene, self.table, self.index, self.movers) if path is not None)

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

    def add_movers(self, time: float, places: Float[Array, "movers 2"]) -> None:
        """Add where moving obstacles are, ground points, in the order of the scene."""
        rows = [f"{k + 1},{time:.9f},{x:.8f},{0.0 - z:.8f}\n" for k, (x, z) in enumerate(places.tolist())]
        self._parts[-1].add("".join(rows))

    def add_motion(
        self,
        number: int,
        name: str,
        start: float,
        motion: Motion,
        height: float,
        *,
        planted: Planted | None = None,
    ) -> Path:
        """Write somebody's motion and its row of the index.

        Parameters
        ----------
        number, name
            Who it is.
        start
            Time of the first frame, seconds.
        motion, height
            The motion, and how tall they are, metres.
        planted
            Which feet stand at which frame; a GLB tells it.
        """
        if self._in_scene:
            scene = self._scene_of(motion.frame_rate)
            if isinstance(scene, GlbCrowd):
                scene.add(motion, name=name, start=start, planted=planted)
            else:
                scene.add(motion, name=name, start=start, skin=mannequin)
            return self.output
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


def movers_of(path: Path) -> Path:
    """The file beside a table that tells where the moving obstacles of a scene were."""
    return path.with_suffix(".movers.csv")


def moved_as_written(scene: Scene, path: Path) -> Scene:
    """The scene with its moving obstacles as they were while a table was written, if there is a file that tells.

    They wait for people who are in their way, so that they may be later than the scene says.

    Raises
    ------
    FileError
        The file cannot be read, or tells of other obstacles than the scene.
    """
    beside = movers_of(path)
    if not (scene.movers and beside.exists()):
        return scene
    told = load_trajectories(beside)
    if told.people.tolist() != list(range(1, len(scene.movers) + 1)):
        raise FileError(f"tells of {len(told.people)} moving obstacles, the scene of {len(scene.movers)}", path=beside)
    rows = [told.rows(k + 1) for k in range(len(scene.movers))]
    moved = (
        replace(mover, times=told.times[own], points=told.positions[own])
        for mover, own in zip(scene.movers, rows, strict=True)
    )
    return replace(scene, movers=tuple(moved))


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
    if kind in USD:
        check_usd(output)
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
