"""What all sessions of a server share: the database, the first scene, and who is there."""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from types import MappingProxyType
from typing import Any

from stridecast.live.cast import Costume
from stridecast.live.downloads import Download, Downloads
from stridecast.live.messages import LimitsPart
from stridecast.live.uploads import Uploads
from stridecast.model.database import MotionDatabase
from stridecast.model.skeleton import Skeleton

MOST_SESSIONS = 8
"""So many clients are served at once."""

EMPTY: Mapping[str, Any] = MappingProxyType({"version": 1})
"""A scene with nothing in it."""

BUNDLE = Path(__file__).parent / "static"
"""Where the page lies."""


@dataclass(eq=False)
class Guest:
    """What a session keeps in files, and whom it shows.

    ``skeleton`` is theirs, ``character`` the file that has their meshes, ``seat`` the session's number among those who
    are there.
    """

    folder: Path
    uploads: Uploads
    downloads: Downloads
    skeleton: Skeleton
    seat: int
    character: Path | None = None


@dataclass(kw_only=True, eq=False)
class Hall:
    """What is shared.

    Parameters
    ----------
    database, name
        What walkers have learned, and how it is called.
    costume
        In whose body they walk, where it is that of a file; ``database`` is cast for it.
    scene
        The scene that sessions begin with, as its file says it.
    limits
        What is taken of each client.
    most_sessions
        So many clients are served at once.
    threads
        Threads that share the people of a crowd.
    bundle
        Folder of the page.
    receiver
        Host and port to which the first seat is played by the VMC protocol (see ``Receivers``).
    received
        So many ports each seat has, side by side.
    """

    database: MotionDatabase
    name: str = "sample database"
    costume: Costume | None = None
    scene: Mapping[str, Any] = field(default_factory=lambda: EMPTY)
    limits: LimitsPart
    most_sessions: int = MOST_SESSIONS
    threads: int = field(default_factory=lambda: max(1, min(4, (os.cpu_count() or 1))))
    bundle: Path = BUNDLE
    receiver: tuple[str, int] | None = None
    received: int = 1
    guests: dict[str, Guest] = field(default_factory=dict)
    _folder: tempfile.TemporaryDirectory[str] | None = None

    @property
    def full(self) -> bool:
        """Whether nobody more is let in."""
        return len(self.guests) >= self.most_sessions

    def enter(self) -> str:
        """Let somebody in; the word by which the session is known, and which nobody can guess."""
        if self._folder is None:  # readable for its owner only
            self._folder = tempfile.TemporaryDirectory(prefix="stridecast-live-")
        folder = Path(self._folder.name, secrets.token_hex(8))
        word = secrets.token_urlsafe(24)
        taken = {guest.seat for guest in self.guests.values()}
        seat = next(number for number in count() if number not in taken)
        self.guests[word] = Guest(
            folder, Uploads(folder / "files", self.limits), Downloads(folder / "made"), self.database.skeleton, seat
        )
        return word

    def leave(self, word: str) -> None:
        """Remove what a session leaves behind."""
        guest = self.guests.pop(word)
        shutil.rmtree(guest.folder, ignore_errors=True)

    def find(self, word: str) -> Download | None:
        """A file that was made for somebody who is there."""
        found = (guest.downloads.find(word) for guest in self.guests.values())
        return next((file for file in found if file is not None), None)

    def close(self) -> None:
        """Remove all that was made."""
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
