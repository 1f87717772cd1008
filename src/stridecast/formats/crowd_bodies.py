"""Where motions of a crowd go while it walks: a BVH a person with an index, or one scene of all as GLB or USD."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

from stridecast.body.mannequin import mannequin
from stridecast.errors import FileError
from stridecast.formats.bvh import write_bvh
from stridecast.formats.bvh_conventions import BvhConvention
from stridecast.formats.glb import GlbCrowd
from stridecast.formats.glb_figure import Planted
from stridecast.formats.glb_rig_figure import RigFigure
from stridecast.formats.part_file import PartFile
from stridecast.formats.usd import UsdScene
from stridecast.model.motion import Motion

RATE_OF_NOBODY = 30.0
"""Frames a second of a USD scene without people."""

LONGEST_NAME = 80
"""Characters of a person's name in the name of a file."""


class Walked(NamedTuple):
    """Somebody's motion from when they come to when they leave: who, from when on (seconds), and how tall (metres)."""

    number: int
    name: str
    start: float
    motion: Motion
    height: float
    planted: Planted | None = None


@runtime_checkable
class CrowdBodies(Protocol):
    """A writer of motions, one after the other, none of which is kept in memory if the format lets it."""

    scene: Path | None
    """The one file of everybody, ..."""

    index: Path | None
    """... or the table that tells whose file is which."""

    parts: list[PartFile]
    """Tables that are being written."""

    motions: list[Path]
    """Files of single persons that are whole."""

    def begin(self) -> None:
        """Open what is written from the beginning on."""

    def add(self, walked: Walked) -> Path:
        """Write somebody down; the file that has them."""

    def save(self) -> None:
        """Write what is written at the end."""

    def keep(self) -> list[Path]:
        """Write who has been added until an error, beside the place; what has been written."""


class BvhBodies:
    """``x.NAME.bvh`` for each person, and ``x.people.csv``, which grows with them."""

    scene: Path | None = None

    def __init__(self, output: Path, convention: str | BvhConvention = "plain") -> None:
        self.index: Path | None = output.with_suffix(".people.csv")
        self.parts: list[PartFile] = []
        self.motions: list[Path] = []
        self._output, self._convention = output, convention
        self._names: set[str] = set()

    def begin(self) -> None:
        """Open the index."""
        index = self._output.with_suffix(".people.csv")
        self.parts = [PartFile(index, "id,name,start,seconds,frames,height,file")]

    def add(self, walked: Walked) -> Path:
        """Write a BVH, and then its row of the index."""
        number, name, start, motion, height, _ = walked
        path = self.place_of(number, name)
        write_bvh(path, motion, convention=self._convention)
        self.motions.append(path)
        row = (number, name, f"{start:.9f}", f"{motion.seconds:.9f}", motion.frames, f"{height:.3f}", path.name)
        self.parts[0].add(_csv_row(row))
        return path

    def save(self) -> None:
        """Nothing waits for the end."""

    def keep(self) -> list[Path]:
        """Everything is written already."""
        return []

    def place_of(self, number: int, name: str) -> Path:
        """A name that every file system takes, and that nobody else has; small and capital letters are the same."""
        safe = re.sub(r"[^\w-]+", "_", name, flags=re.ASCII).strip("_")[:LONGEST_NAME] or str(number)
        words = (safe, f"{safe}.{number}", *(f"{safe}.{number}.{k}" for k in range(2, len(self._names) + 3)))
        word = next(word for word in words if word.casefold() not in self._names)
        self._names.add(word.casefold())
        return self._output.with_suffix(f".{word}.bvh")


class GlbBodies:
    """``x.glb`` (see ``GlbCrowd``); what an error leaves is ``x.part.glb``."""

    index: Path | None = None

    def __init__(self, output: Path, *, compact: bool = False, character: Path | None = None) -> None:
        self.scene: Path | None = output
        self.parts: list[PartFile] = []
        self.motions: list[Path] = []
        figure = None if character is None else RigFigure(character)
        self._begin: Callable[[], GlbCrowd] = lambda: GlbCrowd(output, compact=compact, character=figure)
        self._output = output
        self._crowd: GlbCrowd | None = None

    def begin(self) -> None:
        """The scene begins with the first person."""

    def add(self, walked: Walked) -> Path:
        """Add somebody, with their foot plants."""
        if self._crowd is None:
            self._crowd = self._begin()
        self._crowd.add(walked.motion, name=walked.name, start=walked.start, planted=walked.planted)
        return self._output

    def save(self) -> None:
        """Write the scene, also one of nobody."""
        (self._crowd or self._begin()).save()

    def keep(self) -> list[Path]:
        """Write the scene beside its place."""
        return [] if self._crowd is None else _kept(self._crowd, self._output)


class UsdBodies:
    """``x.usd``, ``x.usda``, ``x.usdc`` (see ``UsdScene``) with mannequins; what an error leaves is ``x.part.usd``."""

    index: Path | None = None

    def __init__(self, output: Path) -> None:
        self.scene: Path | None = output
        self.parts: list[PartFile] = []
        self.motions: list[Path] = []
        self._output = output
        self._usd: UsdScene | None = None

    def begin(self) -> None:
        """The scene begins with the first person, whose frame rate it has."""

    def add(self, walked: Walked) -> Path:
        """Add somebody."""
        if self._usd is None:
            self._usd = UsdScene(walked.motion.frame_rate)
        self._usd.add(walked.motion, name=walked.name, start=walked.start, skin=mannequin)
        return self._output

    def save(self) -> None:
        """Write the scene, also one of nobody."""
        (self._usd or UsdScene(RATE_OF_NOBODY)).save(self._output)

    def keep(self) -> list[Path]:
        """Write the scene beside its place."""
        return [] if self._usd is None else _kept(self._usd, self._output)


def _kept(scene: GlbCrowd | UsdScene, output: Path) -> list[Path]:
    """Write who has left until now beside the scene that is not finished."""
    names = (output.with_suffix(f".part{k if k > 1 else ''}{output.suffix}") for k in count(1))
    part = next(name for name in names if not name.exists())
    with suppress(FileError):
        scene.save(part)
        return [part]
    return []


def _csv_row(row: Sequence[object]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerow(row)
    return out.getvalue()
