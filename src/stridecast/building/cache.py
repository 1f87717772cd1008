"""What earlier builds found out about takes, kept in the user's cache folder: what has not changed costs nothing.

An entry's name is a hash of everything it depends on: the file, its skeleton file, the options, and this code. So
entries never go stale; those of old code are never asked for again, and the oldest go when there is too much.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
import scipy

from stridecast.errors import InputError
from stridecast.formats.tensors import Tensors, read_tensors, write_tensors

FORMAT = "stridecast take"
VERSION = 1
MOST_BYTES = 1 << 30
"""What the folder may hold."""

LAYERS = ("geometry", "model", "body", "analysis", "formats", "building")
"""What a take's analysis depends on beside the take."""

log = logging.getLogger("stridecast")

Entry = tuple[dict[str, Any], Tensors]


class TakeCache:
    """A folder of entries; without one (``None``) nothing is remembered.

    Whatever goes wrong with the folder or an entry costs time, never the build.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self.writable = folder is not None
        if folder is not None:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                self._give_up(error)

    @classmethod
    def of_user(cls) -> TakeCache:
        """Open the cache in the user's cache folder."""
        return cls(user_folder() / "takes")

    def get(self, key: str) -> Entry | None:
        """Find an entry, or none; a damaged one is thrown away."""
        path = self._path(key)
        if path is None:
            return None
        try:
            if not path.is_file():
                return None
            entry = read_tensors(path, FORMAT, VERSION)
            path.touch()
        except (InputError, OSError) as error:
            log.info("a remembered take is damaged and is analysed again: %s", error)
            self.drop(key)
            return None
        return entry

    def put(self, key: str, header: Mapping[str, Any], tensors: Mapping[str, np.ndarray]) -> None:
        """Keep an entry."""
        path = self._path(key)
        if path is None or not self.writable:
            return
        try:
            write_tensors(path, {"format": FORMAT, "version": VERSION, **header}, tensors)
        except (InputError, OSError) as error:
            self._give_up(error)

    def drop(self, key: str) -> None:
        """Forget an entry."""
        path = self._path(key)
        if path is not None:
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                self._give_up(error)

    def trim(self, most_bytes: int = MOST_BYTES) -> None:
        """Remove what was used longest ago until the rest is small enough, and what broken writes have left."""
        if self.folder is None:
            return
        try:
            stats = [(path, path.stat()) for path in self.folder.iterdir() if path.is_file()]
            size = sum(stat.st_size for _, stat in stats)
            for path, stat in sorted(stats, key=lambda item: item[1].st_mtime):
                if size <= most_bytes:
                    return
                path.unlink(missing_ok=True)
                size -= stat.st_size
        except OSError as error:
            log.info("the cache of takes cannot be tidied: %s", error)

    def _path(self, key: str) -> Path | None:
        return None if self.folder is None else self.folder / f"{key}.safetensors"

    def _give_up(self, error: Exception) -> None:
        self.writable = False
        log.info("takes are not remembered for the next build: %s", error)


def user_folder() -> Path:
    """Folder of the package among the user's caches, for what can be made again; it may not be there yet."""
    return Path(platformdirs.user_cache_dir("stridecast", appauthor=False))


def key_of(**parts: object) -> str:
    """Name an entry by a hash of what it depends on (plain values that JSON can say) and of the code."""
    text = json.dumps({"code": code_hash(), **parts}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:40]


@cache
def code_hash(*more: str) -> str:
    """Hash the code of ``LAYERS`` and of more layers, with the tables that lie beside it."""
    digest = hashlib.sha256(f"numpy {np.__version__} scipy {scipy.__version__}".encode())
    package = resources.files("stridecast")
    for layer in (*LAYERS, *more):
        for name, file in _files(package.joinpath(layer), layer):
            digest.update(f"{name}\n".encode() + file.read_bytes())
    return digest.hexdigest()


def _files(folder: Traversable, name: str) -> Iterator[tuple[str, Traversable]]:
    """Find the files in a folder of the package (to its bottom) with their names, all but what Python leaves there."""
    for item in sorted(folder.iterdir(), key=lambda item: item.name):
        if item.name.startswith((".", "__pycache__")):
            continue
        if item.is_dir():
            yield from _files(item, f"{name}/{item.name}")
        else:
            yield f"{name}/{item.name}", item
