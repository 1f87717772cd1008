"""Recordings that a client sends: bounded, in a folder of their own, under names that the server makes."""

from __future__ import annotations

import re
import threading
from collections.abc import AsyncIterator
from pathlib import Path

from stridecast.errors import InputError
from stridecast.live.messages import LimitsPart

LONGEST_NAME = 60
"""Characters that are kept of a name."""


class UploadRefusedError(InputError):
    """A file that is not taken; ``status`` is that of the answer."""

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


class Uploads:
    """What a client has sent so far.

    Parameters
    ----------
    folder
        Where it lies; made when it is needed.
    limits
        How much is taken.
    """

    def __init__(self, folder: Path, limits: LimitsPart) -> None:
        self.folder, self.limits = folder, limits
        self._sizes: dict[str, int] = {}
        self._lock = threading.Lock()

    @property
    def files(self) -> list[str]:
        """Names, in the order of the alphabet."""
        return sorted(self._sizes)

    @property
    def size(self) -> int:
        """Size of all together."""
        return sum(self._sizes.values())

    @property
    def paths(self) -> list[Path]:
        """Where they lie."""
        return [self.folder / name for name in self.files]

    async def save(self, name: str, chunks: AsyncIterator[bytes]) -> str:
        """Take a file.

        Parameters
        ----------
        name
            What the client calls it. Only letters and digits of it are kept, as files tell by them whose takes they
            are; of two with the same name the later one stays.
        chunks
            Its content, as it comes.

        Returns
        -------
        The name it has now.

        Raises
        ------
        UploadRefusedError
            Another kind of file, too large, or too many. Nothing is kept of it then.
        """
        kept = safe_name(name, self.limits.file_kinds)
        with self._lock:
            others = {other: size for other, size in self._sizes.items() if other != kept}
            if len(others) >= self.limits.files:
                raise UploadRefusedError(f"{self.limits.files} files are the most; forget some first", 413)
            room = self.limits.files_bytes - sum(others.values())
        self.folder.mkdir(parents=True, exist_ok=True)
        part, size = self.folder / f".{kept}.part", 0
        try:
            with part.open("wb") as file:
                async for chunk in chunks:
                    size += len(chunk)
                    if size > self.limits.file_bytes:
                        most = self.limits.file_bytes / 2**20
                        raise UploadRefusedError(f"{kept} is larger than {most:g} MB, the most for a file", 413)
                    if size > room:
                        most = self.limits.files_bytes / 2**20
                        raise UploadRefusedError(f"{most:g} MB are the most for all files together", 413)
                    file.write(chunk)
            if size == 0:
                raise UploadRefusedError(f"{kept} is empty", 400)
            part.replace(self.folder / kept)
        except OSError as error:
            raise UploadRefusedError(f"{kept} cannot be stored: {error.strerror or error}", 507) from error
        finally:
            part.unlink(missing_ok=True)
        with self._lock:
            self._sizes[kept] = size
        return kept

    def forget(self) -> None:
        """Throw everything away."""
        with self._lock:
            for path in self.paths:
                path.unlink(missing_ok=True)
            self._sizes.clear()


def safe_name(name: str, kinds: list[str]) -> str:
    """A file name of letters, digits, ``_`` and ``-``, and an ending that is taken.

    Raises
    ------
    UploadRefusedError
        Another ending.
    """
    stem, dot, ending = name.replace("\\", "/").rsplit("/", 1)[-1].rpartition(".")
    kind = f".{ending.lower()}"
    if not dot or kind not in kinds:
        raise UploadRefusedError(f"recordings are {', '.join(f'*{kind}' for kind in kinds)}, not {name[:80]!r}", 415)
    safe = re.sub(r"[^\w-]+", "_", stem, flags=re.ASCII).strip("_")[:LONGEST_NAME]
    return f"{safe or 'take'}{kind}"
