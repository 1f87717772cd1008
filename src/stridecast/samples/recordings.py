"""Sets of real recordings on the web: which there are, where their files come from, what is asked in return."""

from __future__ import annotations

import csv
import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from urllib.parse import quote, urlsplit

import platformdirs
from filelock import FileLock, Timeout

from stridecast.errors import FileError, InputError
from stridecast.formats.files import replacing
from stridecast.samples.download import AT_ONCE, PAUSES, Progress, RemoteFile, download

RAW = "https://raw.githubusercontent.com"
CREDIT_FILE = "CREDIT.txt"
"""In the folder of a set: whom to thank, and what may be done with the recordings."""

log = logging.getLogger("stridecast")


@dataclass(frozen=True, kw_only=True)
class Original:
    """One file of a set, as it lies at its source.

    Parameters
    ----------
    file
        Its place in the folder of the set, with ``/``.
    repository, commit, path
        Where it comes from on GitHub: ``owner/name``, hash of the commit, path in the repository.
    sha256, size
        Hash and number of its bytes.
    """

    file: str
    repository: str
    commit: str
    path: str
    sha256: str
    size: int

    def address(self, mirror: str | None = None) -> str:
        """Where it is on the web: at its source, or below the address of a mirror."""
        if mirror is None:
            return f"{RAW}/{quote(self.repository)}/{self.commit}/{quote(self.path)}"
        return f"{mirror.rstrip('/')}/{quote(self.file)}"


@dataclass(frozen=True, kw_only=True)
class RecordingSet:
    """Recordings that belong together.

    Parameters
    ----------
    name
        What it is asked for by.
    about
        What is recorded.
    credit
        The line that those who made the recordings ask for.
    terms
        What may be done with them.
    table
        CSV file with a line for each file, see ``Original``.
    """

    name: str
    about: str
    credit: str
    terms: str
    table: Traversable

    @cached_property
    def files(self) -> tuple[Original, ...]:
        """All files, those of skeletons too."""
        rows = csv.DictReader(self.table.read_text(encoding="utf-8").splitlines())
        return tuple(Original(size=int(row.pop("bytes")), **row) for row in rows)

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(recording.size for recording in self.files)

    @property
    def home(self) -> Path:
        """Where it lies if nobody says otherwise: in the user's data folder."""
        return Path(platformdirs.user_data_dir("stridecast", appauthor=False)) / self.name

    def takes_in(self, folder: Path) -> list[Path]:
        """List the files to learn from (all but skeletons), where the set lies in a folder."""
        return [folder / recording.file for recording in self.files if not recording.file.endswith(".asf")]

    def credit_text(self) -> str:
        """Write out what goes into ``CREDIT_FILE``."""
        sources = sorted({f"https://github.com/{r.repository} at {r.commit}" for r in self.files})
        return "\n".join([self.credit, "", self.terms, "", "The files were taken from", *sources, ""])


SETS = {
    "cmu": RecordingSet(
        name="cmu",
        about="walking, running, turning, starting, stopping and standing of ten people",
        credit=(
            "The data used in this project was obtained from mocap.cs.cmu.edu. "
            "The database was created with funding from NSF EIA-0196217."
        ),
        terms=(
            "The recordings are part of the Carnegie Mellon University Graphics Lab Motion Capture Database. "
            "They may be used, changed and passed on, also inside products that are sold. "
            "The recordings themselves may not be sold, whatever format they are converted to. "
            "The BVH files are conversions by Bruce Hahne (cgspeed.com), who adds no terms."
        ),
        table=resources.files("stridecast.samples") / "cmu.csv",
    )
}
"""What there is to fetch."""


def find_set(name: str) -> RecordingSet:
    """Look up a set.

    Raises
    ------
    InputError
        There is none of that name.
    """
    if name not in SETS:
        raise InputError(f"there is no set of recordings {name!r}; there are {', '.join(SETS)}")
    return SETS[name]


def fetch(
    name: str = "cmu",
    *,
    folder: str | Path | None = None,
    mirror: str | None = None,
    jobs: int = AT_ONCE,
    pauses: Sequence[float] = PAUSES,
    progress: Progress | None = None,
) -> Path:
    """Have a set of recordings on this computer. What is there already is not downloaded again.

    Parameters
    ----------
    name
        One of ``SETS``: ``cmu``.
    folder
        Where it shall lie; else a folder of that name in the user's data folder.
    mirror
        Address (http or https) of a copy of such a folder, to fetch from there.
    jobs
        So many files are on their way at once.
    pauses
        Seconds before each further try of a file that did not come.
    progress
        Called with ``files`` and with ``bytes``, how many are here, and how many there are.

    Returns
    -------
    Path
        The folder, for ``build``. ``CREDIT.txt`` in it says whom to thank and what may be done with the recordings.

    Raises
    ------
    InputError
        No such set, an address that is none, or not at least one job.
    DownloadError
        Files that did not come (no connection, not found, another content), with the first one's address. All others
        are here, and the next call goes on from there.
    FileError
        The folder cannot be written, or the disk is full.
    """
    chosen = find_set(name)
    place = chosen.home if folder is None else Path(folder)
    bring(chosen, place, mirror=mirror, jobs=jobs, pauses=pauses, progress=progress)
    return place


def bring(
    chosen: RecordingSet,
    folder: Path,
    *,
    mirror: str | None = None,
    jobs: int = AT_ONCE,
    pauses: Sequence[float] = PAUSES,
    progress: Progress | None = None,
) -> int:
    """Do what ``fetch`` does for a set that is at hand, and return how many files were downloaded."""
    if mirror is not None and not _is_address(mirror):
        raise InputError(f"a mirror is an address like https://host/folder, not {mirror!r}")
    if jobs < 1:
        raise InputError(f"there must be at least 1 job, not {jobs}")
    remote = [
        RemoteFile(address=r.address(mirror), path=folder / r.file, sha256=r.sha256, size=r.size) for r in chosen.files
    ]
    if (folder / CREDIT_FILE).is_file() and all(file.is_here() for file in remote):
        return download(remote, progress=progress)  # needs neither a connection nor the right to write
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _alone_in(folder):
            with replacing(folder / CREDIT_FILE) as file:
                file.write(chosen.credit_text().encode())
            return download(remote, at_once=jobs, pauses=pauses, progress=progress)
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror or error}; name another folder", path=folder) from error


def _is_address(text: str) -> bool:
    try:
        parts = urlsplit(text)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and bool(parts.hostname)


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Wait until no other fetch is at work in a folder, and keep others waiting meanwhile."""
    lock = FileLock(folder / ".lock")
    try:
        lock.acquire(blocking=False)
    except Timeout:
        log.warning("another fetch is at work in %s; waiting until it ends", folder)
        lock.acquire()
    except NotImplementedError as error:  # the file system knows no locks
        log.info("fetches into one folder cannot wait for each other here: %s", error)
    try:
        yield
    finally:
        lock.release()
