"""Files from the web: under their name once they are whole and right, never before.

On its way a file grows under a hidden name beside its place. Whatever ends a download, the next one goes on from there
if the server can send the rest, and begins that file again if it cannot.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Lock
from typing import Any
from urllib.parse import urlsplit

import pooch
import requests

from stridecast.errors import DownloadError, FileError
from stridecast.formats.files import looks_like, read_start

AT_ONCE = 4
"""So many files are on their way at once."""

PAUSES = (1.0, 2.0, 4.0)
"""Seconds before the second, third, ... try of a file."""

SILENCE = (10.0, 20.0)
"""Seconds until a server that does not answer, or no longer sends, is given up."""

CHUNK = 1 << 14
"""Bytes that are written at a time: what a cut may lose, and what may come before a stop is noticed."""

PASSING = (408, 416, 425, 429)
"""Answers that another try may change, beside those of a server in trouble (500 and above)."""

Progress = Callable[[str, int, int], None]
"""Called with ``files`` or ``bytes``, how many are here, and how many there are."""

log = logging.getLogger("stridecast")


@dataclass(frozen=True, kw_only=True)
class RemoteFile:
    """A file on the web, and the place it shall have here.

    Parameters
    ----------
    address
        Where it comes from, http or https.
    path
        Where it goes.
    sha256, size
        What it is: hash and number of its bytes.
    """

    address: str
    path: Path
    sha256: str
    size: int

    @property
    def part(self) -> Path:
        """Where it grows; files of another content grow elsewhere."""
        return self.path.with_name(f".{self.path.name}.{self.sha256[:8]}.part")

    def is_here(self) -> bool:
        """Whether it has its place, undamaged.

        Raises
        ------
        FileError
            What is there cannot be read.
        """
        try:
            return self.path.is_file() and self.path.stat().st_size == self.size and _sha256(self.path) == self.sha256
        except OSError as error:
            raise FileError(f"cannot be read: {error.strerror or error}", path=self.path) from error


def download(
    files: Sequence[RemoteFile],
    *,
    at_once: int = AT_ONCE,
    pauses: Sequence[float] = PAUSES,
    progress: Progress | None = None,
) -> int:
    """Bring every file that is not here.

    Parameters
    ----------
    files
        What shall be here in the end. Where there is a file with another content, it is replaced.
    at_once
        So many are on their way at the same time.
    pauses
        Seconds before each further try of a file, so their number is that of the further tries.
    progress
        Called with ``files`` and with ``bytes``, how many are here, and how many there are.

    Returns
    -------
    How many files were brought.

    Raises
    ------
    DownloadError
        Files that did not come, with the address of the first and the reason; all others are here.
    FileError
        The disk is full or refuses; what had come is here.
    """
    absent = [file for file in files if not file.is_here()]
    run = _Run(files, absent, pauses, progress)
    with ThreadPoolExecutor(max_workers=at_once) as pool:
        tasks = [pool.submit(run.bring, file) for file in absent]
        try:
            wait(tasks)
        except BaseException:  # interrupted
            run.halt()
            raise
    errors = [error for task in tasks if (error := task.exception()) and not isinstance(error, _StoppedError)]
    failures = [error for error in errors if isinstance(error, _FailedError)]
    for error in errors:
        if error not in failures:
            raise error
    if failures:
        here = len(files) - sum(task.exception() is not None for task in tasks)
        others = f" (and {len(failures) - 1} more failed)" if len(failures) > 1 else ""
        raise DownloadError(
            f"{failures[0]}{others}; {here} of {len(files)} files are here; fetch again for the rest, or name a mirror"
        ) from failures[0]
    return len(absent)


class _StoppedError(Exception):
    """A download that was ended because of another one."""


class _FailedError(Exception):
    """A try that came to nothing.

    Parameters
    ----------
    file, words
        What failed, and how.
    passing
        Another try may go better.
    server
        Other files will not come from there either.
    """

    def __init__(self, file: RemoteFile, words: str, *, passing: bool = True, server: bool = False) -> None:
        self.passing = passing
        self.server = server
        super().__init__(f"{file.path}: {file.address} {words}")


class _Run:
    """What the downloads of one call share: how far they are, and whether to go on."""

    def __init__(
        self,
        files: Sequence[RemoteFile],
        absent: Sequence[RemoteFile],
        pauses: Sequence[float],
        progress: Progress | None,
    ) -> None:
        self._stop, self._in_vain = Event(), Event()
        self._troubled = False
        self._parts: set[_Part] = set()
        self._pauses = pauses
        self._progress = progress
        self._telling = Lock()
        self._files, self._bytes = len(files), sum(file.size for file in files)
        self._absent = dict.fromkeys(absent, 0)
        self._brought = 0
        self._tell()

    def bring(self, file: RemoteFile) -> None:
        """Have a file here; a reason that concerns all files ends all downloads."""
        try:
            self._try_again(file)
        except BaseException as error:
            if self._stop.is_set():
                raise _StoppedError from error
            if not isinstance(error, _FailedError) or error.server:
                self.halt()
            raise

    def halt(self) -> None:
        """End all downloads at once."""
        self._stop.set()
        for part in list(self._parts):
            part.hang_up()

    def _try_again(self, file: RemoteFile) -> None:
        """Try until a file is here, or there is no hope: where waiting was in vain for one, the others do not wait."""
        for pause in (*self._pauses, None):
            try:
                self._try(file)
            except _FailedError as failure:
                if self._stop.is_set() or not failure.passing:
                    raise
                if pause is None or self._in_vain.is_set():
                    self._in_vain.set()
                    raise
                self._note(f"{failure}; trying again in {pause:g} s")
                self._stop.wait(pause)
            else:
                return

    def _try(self, file: RemoteFile) -> None:
        self._go_on()
        try:
            file.path.parent.mkdir(parents=True, exist_ok=True)
            with self._part_of(file) as part:
                if part.size < file.size:
                    _transfer(file, part)
                part.secure()
            _check(file)
            file.part.replace(file.path)
        except OSError as error:
            raise FileError(
                f"cannot be written: {error.strerror or error}; make room or name another folder, "
                "then fetch again: what has come is kept",
                path=file.path,
            ) from error
        with self._telling:
            self._brought += 1
            self._tell()

    @contextmanager
    def _part_of(self, file: RemoteFile) -> Iterator[_Part]:
        with closing(_Part(file)) as part:
            part.watch(lambda size: self._grown(file, size))
            self._parts.add(part)
            try:
                yield part
            finally:
                self._parts.discard(part)

    def _grown(self, file: RemoteFile, size: int) -> None:
        self._go_on()
        with self._telling:
            self._absent[file] = size
            self._tell()

    def _go_on(self) -> None:
        if self._stop.is_set():
            raise _StoppedError

    def _note(self, trouble: str) -> None:
        with self._telling:
            log.log(logging.INFO if self._troubled else logging.WARNING, trouble)  # one warning is enough
            self._troubled = True

    def _tell(self) -> None:
        if self._progress is not None:
            missing = sum(file.size - size for file, size in self._absent.items())
            self._progress("files", self._files - len(self._absent) + self._brought, self._files)
            self._progress("bytes", self._bytes - missing, self._bytes)


class _Part:
    """A file on its way, open at its end: what ``pooch`` writes to."""

    def __init__(self, file: RemoteFile) -> None:
        self._file = file
        self.answers: list[requests.Response] = []
        self._stream = file.part.open("ab")
        self.size = self._stream.tell()
        if self.size > file.size:
            self._begin_again()

    def watch(self, grown: Callable[[int], None]) -> None:
        """Tell how many bytes there are, now and with every change."""
        self._grown = grown
        grown(self.size)

    def hear(self, answer: requests.Response, **_: Any) -> None:
        """Begin again if the server has something to send, but not the rest that was asked for."""
        self.answers.append(answer)
        rest = answer.status_code == 206 and answer.headers.get("Content-Range", "").startswith(f"bytes {self.size}-")
        if not rest and (200 <= answer.status_code < 300 or answer.status_code == 416):
            self._begin_again()

    def write(self, chunk: bytes) -> None:
        """Add what has come."""
        if self.size + len(chunk) > self._file.size:
            self._begin_again()
            raise _FailedError(self._file, f"sends more than the {self._file.size} bytes of the recording")
        self._stream.write(chunk)
        self.size += len(chunk)
        self._grown(self.size)

    def flush(self) -> None:
        """Hand it to the system."""
        self._stream.flush()

    def secure(self) -> None:
        """Have it on the disk."""
        self._stream.flush()
        os.fsync(self._stream.fileno())

    def hang_up(self) -> None:
        """Let nothing more come, from another thread than the one that waits for it."""
        for answer in list(self.answers):
            with suppress(OSError, RuntimeError, ValueError):  # it has come to its end
                answer.raw.shutdown()

    def close(self) -> None:
        """End it, and the connection; where nothing has come, nothing stays."""
        for answer in self.answers:
            answer.close()
        self._stream.close()
        if not self.size:
            self._file.part.unlink(missing_ok=True)

    def _begin_again(self) -> None:
        if self.size:
            self._stream.truncate(0)
            self.size = 0


def _transfer(file: RemoteFile, part: _Part) -> None:
    """Ask for what is missing of a file, and take it as it comes."""
    begun = part.size
    # compressed, byte numbers would mean something else
    rest = {"Range": f"bytes={begun}-", "Accept-Encoding": "identity"} if begun else {}
    receive = pooch.HTTPDownloader(
        chunk_size=CHUNK, timeout=SILENCE, headers={"User-Agent": "stridecast", **rest}, hooks={"response": part.hear}
    )
    try:
        receive(file.address, part, None)
    except requests.HTTPError as error:
        status, reason = part.answers[-1].status_code, part.answers[-1].reason
        words = f"is not there ({status} {reason})" if status in (404, 410) else f"answers {status} {reason}"
        raise _FailedError(file, words, passing=status in PASSING or status >= 500) from error
    except requests.RequestException as error:
        bottom = _innermost(error)
        why = getattr(bottom, "strerror", None) or str(bottom) or type(bottom).__name__
        if part.answers:
            raise _FailedError(file, f"broke off after {part.size} of {file.size} bytes ({why})") from error
        if isinstance(error, requests.ReadTimeout) or isinstance(bottom, ConnectionResetError | BrokenPipeError):
            raise _FailedError(file, f"is not answered ({why})") from error
        words = f"does not come: {urlsplit(file.address).netloc} cannot be reached ({why}); check the connection"
        raise _FailedError(file, words, server=True) from error
    if not part.size:
        raise _FailedError(file, "sends nothing")


def _check(file: RemoteFile) -> None:
    """Throw away what has come if it is not what it should be."""
    size, sha256 = file.part.stat().st_size, _sha256(file.part)
    if (size, sha256) == (file.size, file.sha256):
        return
    looks = looks_like(read_start(file.part))
    file.part.unlink()
    raise _FailedError(
        file,
        f"sends something else than the recording: {size} bytes{looks and f' that look like {looks}'} "
        f"with sha256 {sha256[:8]}..., not {file.size} with {file.sha256[:8]}...",
    )


def _sha256(path: Path) -> str:
    return str(pooch.file_hash(str(path)))


def _innermost(error: BaseException) -> BaseException:
    while below := error.__cause__ or error.__context__:
        error = below
    return error
