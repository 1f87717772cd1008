"""What a build is made of: named files, the recordings in named folders, and motions in memory."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from stridecast.errors import FileError, InputError
from stridecast.formats.recordings import RECORDINGS
from stridecast.formats.tensors import pack_skeleton
from stridecast.model.motion import Motion


@dataclass(frozen=True, kw_only=True)
class FileSource:
    """A file to learn from.

    Parameters
    ----------
    path
        Where it is.
    sha256
        Hash of its content.
    companions
        Hash of the skeleton files that belong to it, "" if it carries its own skeleton.
    """

    path: Path
    sha256: str
    companions: str = ""

    @property
    def name(self) -> str:
        """What its take is called where it cannot be read."""
        return self.path.stem

    @property
    def suffix(self) -> str:
        """What its format is known by, in lower case."""
        return self.path.suffix.lower()

    @property
    def place(self) -> tuple[str, ...]:
        """What results depend on beside the content: file and folder tell format, name and person."""
        return self.path.absolute().parts[-2:]

    @property
    def shown(self) -> str:
        """The path as users and databases are told: relative where it lies below the working folder."""
        try:
            return self.path.absolute().relative_to(Path.cwd()).as_posix()
        except ValueError:
            return self.path.as_posix()


@dataclass(frozen=True, kw_only=True)
class MotionSource:
    """A motion in memory to learn from; what a ``FileSource`` tells, it tells as well.

    Parameters
    ----------
    motion
        The motion, with a name.
    sha256
        Hash of what is moved and how, by whatever name.
    """

    motion: Motion
    sha256: str
    companions: str = ""
    suffix: str = ""

    @property
    def name(self) -> str:
        """What its take is called."""
        return self.motion.name

    @property
    def place(self) -> tuple[str, ...]:
        """What results depend on beside the content."""
        return self.motion.name, self.motion.subject, self.motion.source

    @property
    def shown(self) -> str:
        """What users and databases are told in place of a path: the name."""
        return self.motion.name


Source = FileSource | MotionSource
"""What a build learns from."""


def collect(sources: Iterable[str | Path | Motion]) -> list[Source]:
    """Find every recording in files and folders (searched to the bottom), each once, in the order of their paths.

    Motions in memory come after them, in the order in which they are given; one that has no name is called after its
    place among them, as "motion 0".

    Raises
    ------
    InputError
        Nothing is named, a path does not exist or cannot be read, or a folder holds no recording.
    """
    found: dict[Path, Path] = {}
    motions: list[Motion] = []
    for source in sources:
        if isinstance(source, Motion):
            motions.append(source if source.name else replace(source, name=f"motion {len(motions)}"))
            continue
        place = Path(source)
        try:
            for path in _recordings_in(place):
                found.setdefault(path.resolve(), path)
        except OSError as error:
            raise FileError(f"cannot be read: {error.strerror or error}", path=place) from error
    if not (found or motions):
        raise InputError(f"name at least one recording or folder of recordings ({_readable()})")
    companions = cache(_skeletons_beside)
    files = [
        FileSource(path=path, sha256=sha256_of_file(path), companions=companions(path.parent) if _is_amc(path) else "")
        for path in sorted(found.values())
    ]
    return [*files, *(MotionSource(motion=motion, sha256=_sha256_of(motion)) for motion in motions)]


def _is_amc(path: Path) -> bool:
    return path.suffix.lower() == ".amc"


def _recordings_in(place: Path) -> list[Path]:
    if place.is_file():
        return [place]
    if not place.exists():
        raise FileError(f"there is no such file or folder; readable are {_readable()}", path=place)
    files = [
        Path(folder, name)
        for folder, _, names in os.walk(place)
        for name in names
        if Path(name).suffix.lower() in RECORDINGS and not name.startswith(".")
    ]
    if not files:
        raise FileError(f"the folder holds no recording; readable are {_readable()}", path=place)
    return files


def _readable() -> str:
    return ", ".join(f"*{suffix} ({what})" for suffix, what in RECORDINGS.items())


def sha256_of_file(path: Path) -> str:
    """Hash the content of a file; "" if it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""  # whoever reads the file will say what is wrong


def _sha256_of(motion: Motion) -> str:
    header, arrays = pack_skeleton(motion.skeleton)
    told = json.dumps([header, float(motion.frame_rate), motion.frames], sort_keys=True)
    digest = hashlib.sha256(told.encode())
    for array in (*arrays.values(), motion.root_positions, motion.rotations):
        digest.update(array.tobytes())
    return digest.hexdigest()


def _skeletons_beside(folder: Path) -> str:
    """One hash of all ASF files in a folder: an AMC may take any of them."""
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() == ".asf")
    return hashlib.sha256("".join(sha256_of_file(path) for path in files).encode()).hexdigest()
