"""Which files a build is made of: named files, and the recordings in named folders."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from stridecast.errors import FileError, InputError
from stridecast.formats.recordings import RECORDINGS


@dataclass(frozen=True, kw_only=True)
class Source:
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
    def shown(self) -> str:
        """The path as users and databases are told: relative where it lies below the working folder."""
        try:
            return self.path.absolute().relative_to(Path.cwd()).as_posix()
        except ValueError:
            return self.path.as_posix()


def collect(sources: Iterable[str | Path]) -> list[Source]:
    """Find every recording in files and folders (searched to the bottom), each once, in the order of their paths.

    Raises
    ------
    InputError
        Nothing is named, a path does not exist or cannot be read, or a folder holds no recording.
    """
    found: dict[Path, Path] = {}
    nothing = True
    for place in map(Path, sources):
        nothing = False
        try:
            for path in _recordings_in(place):
                found.setdefault(path.resolve(), path)
        except OSError as error:
            raise FileError(f"cannot be read: {error.strerror or error}", path=place) from error
    if nothing:
        raise InputError(f"name at least one recording or folder of recordings ({_readable()})")
    companions = cache(_skeletons_beside)
    return [
        Source(path=path, sha256=_sha256(path), companions=companions(path.parent) if _is_amc(path) else "")
        for path in sorted(found.values())
    ]


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


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""  # whoever reads the file will say what is wrong


def _skeletons_beside(folder: Path) -> str:
    """One hash of all ASF files in a folder: an AMC may take any of them."""
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() == ".asf")
    return hashlib.sha256("".join(_sha256(path) for path in files).encode()).hexdigest()
