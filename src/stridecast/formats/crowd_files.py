"""Files of a crowd that are written while it walks: a table of everybody's places, and their motions beside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import TracebackType

import numpy as np
from jaxtyping import Float, Int

from stridecast.errors import FileError, InputError
from stridecast.formats.bvh_conventions import BvhConvention
from stridecast.formats.crowd_bodies import BvhBodies, CrowdBodies, GlbBodies, UsdBodies, Walked
from stridecast.formats.files import check_place
from stridecast.formats.glb import check_compact
from stridecast.formats.glb_figure import Planted
from stridecast.formats.part_file import PartFile
from stridecast.formats.recordings import GLB
from stridecast.formats.trajectories import load_trajectories
from stridecast.formats.trajectory_tables import check_parquet, csv_to_parquet
from stridecast.formats.usd import ENDINGS as USD
from stridecast.formats.usd import check_usd
from stridecast.geometry import ground
from stridecast.model.motion import Motion
from stridecast.model.scene import Scene

Array = np.ndarray

SCENES = (".glb", *USD)
"""Endings of files that hold everybody, ..."""

OUTPUTS = (".csv", ".parquet", ".bvh", *SCENES)
"""... and of all that a crowd is written as."""

ROW = "%d,%.9f,%.8f,%.8f,%.6f,%.6f\n"
"""Of places: fine enough for accelerations and their change to come out of them."""


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
    character
        The file that the skeletons of the motions are from; where both are GLB, everybody has its meshes (see
        ``GlbCrowd``).

    Raises
    ------
    FileError
        Another ending, a character that cannot be carried over, or the file system refuses.
    """

    def __init__(
        self,
        output: str | Path,
        *,
        movers: int = 0,
        convention: str | BvhConvention = "plain",
        compact: bool = False,
        character: str | Path | None = None,
    ) -> None:
        self.output = Path(output)
        kind = kind_of(self.output)
        check_compact(self.output, compact)
        self._bodies = _bodies_of(self.output, kind, convention, compact, character)
        self.bodies = self._bodies is not None
        self.table = self.output.with_suffix(".csv") if self.bodies else self.output
        self.movers = movers_of(self.output) if movers else None
        self.kept: list[Path] = []
        self._parts: list[PartFile] = []

    def __enter__(self) -> CrowdFiles:
        self._parts.append(PartFile(self.table, "id,time,x,y,heading,speed"))
        if self._bodies is not None:
            self._bodies.begin()
            self._parts += self._bodies.parts
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
            self.kept += [] if self._bodies is None else self._bodies.keep()
            return
        for part in self._parts:
            part.close()
        if self._bodies is not None:
            self._bodies.save()
        for part in self._parts:
            if part.path.suffix.lower() == ".parquet":
                csv_to_parquet(part.part, part.path)
                part.part.unlink()
            else:
                part.rename()
            self.kept.remove(part.part)

    @property
    def index(self) -> Path | None:
        """The table of who is who, if there is one."""
        return None if self._bodies is None else self._bodies.index

    @property
    def motions(self) -> list[Path]:
        """Files of single persons that have been written."""
        return [] if self._bodies is None else self._bodies.motions

    @property
    def files(self) -> tuple[Path, ...]:
        """Everything that is written, without the motions."""
        scene = None if self._bodies is None else self._bodies.scene
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
        if self._bodies is None:
            raise InputError(f"a table has no bodies; name an output *.bvh, *.glb or *.usd instead of {self.output}")
        return self._bodies.add(Walked(number, name, start, motion, height, planted))


def _bodies_of(
    output: Path, kind: str, convention: str | BvhConvention, compact: bool, character: Path | str | None
) -> CrowdBodies | None:
    """What writes the motions of a crowd, if any are written."""
    if kind == ".bvh":
        return BvhBodies(output, convention)
    if kind == ".glb":
        own = None if character is None or Path(character).suffix.lower() not in GLB else Path(character)
        return GlbBodies(output, compact=compact, character=own)
    return UsdBodies(output) if kind in USD else None


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
