"""Files that were made for a client, under addresses that nobody else can guess."""

from __future__ import annotations

import secrets
from pathlib import Path
from typing import NamedTuple

MOST = 8
"""So many are kept, the newest."""


class Download(NamedTuple):
    """A file, and the name under which it is to be saved."""

    path: Path
    name: str


class Downloads:
    """Files of one client.

    Parameters
    ----------
    folder
        Where they are made; made itself when it is needed.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files: dict[str, Download] = {}

    def place(self, name: str) -> Path:
        """Where a file may be made that is to be saved as ``name``."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return self.folder / f"{secrets.token_hex(8)}{Path(name).suffix}"

    def offer(self, path: Path, name: str) -> str:
        """Let a file that was made be fetched; its address."""
        word = secrets.token_urlsafe(24)
        self._files = {**self._files, word: Download(path, name)}
        while len(self._files) > MOST:
            oldest = next(iter(self._files))
            self._files.pop(oldest).path.unlink(missing_ok=True)
        return f"/download/{word}"

    def find(self, word: str) -> Download | None:
        """The file at an address."""
        return self._files.get(word)
