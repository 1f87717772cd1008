"""The sample database: learned once from the sample takes, then kept as a file in the user's cache folder.

The file is named after a hash of everything that it depends on, so it never goes stale.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from filelock import FileLock, Timeout

from stridecast.building.cache import code_hash, user_folder
from stridecast.errors import FileError
from stridecast.formats.store import load_database, save_database
from stridecast.model.database import MotionDatabase

if TYPE_CHECKING:
    from stridecast.building.bench import Progress

STAGES = ("make", "analyse", "assemble")
"""What ``progress`` is told about, in this order."""

PATIENCE = 600.0
"""So long another process is waited for that makes the sample database, seconds."""

log = logging.getLogger("stridecast")

_known: dict[str, MotionDatabase] = {}
_one_at_a_time = threading.Lock()


def sample_database(*, progress: Progress | None = None) -> MotionDatabase:
    """Motion database that comes with the package, of a person who stands, walks and runs.

    They do so in a neutral, a brisk and a gloomy manner. It is learned from the sample takes when it is first asked
    for, which takes some seconds, and kept as a file in the user's cache folder. Whatever is wrong with that folder
    costs time, and is logged, but it stops nothing.

    Parameters
    ----------
    progress
        Called with a stage of ``STAGES``, how much of it is done, and how much there is, if there is anything to do.

    Returns
    -------
    MotionDatabase
        The same object each time.
    """
    key = code_hash("database", "samples")[:40]
    with _one_at_a_time:
        if key not in _known:
            _known[key] = _load_or_learn(user_folder() / f"samples-{key}.safetensors", progress)
        return _known[key]


def _load_or_learn(path: Path, progress: Progress | None) -> MotionDatabase:
    """Load the database; else learn it, unless another process is at it."""
    with suppress(FileError, OSError):  # it is not there, or damaged, which whoever makes it again will say
        return load_database(path)
    with _alone(path.with_name("samples.lock")):
        return _made_meanwhile(path) or _learn_and_keep(path, progress)


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock, which ends with its holder. Where there is none to be had, the worst is that work is done twice."""
    lock = FileLock(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire(blocking=False)
        except Timeout:
            log.warning("waiting for another process, which is making the sample database")
            lock.acquire(timeout=PATIENCE)
    except Timeout:
        log.warning("the other process has not made the sample database in %g s, so it is made here", PATIENCE)
    except (OSError, NotImplementedError) as error:
        log.info("the sample database is made without a lock: %s", error)
    try:
        yield
    finally:
        lock.release()


def _made_meanwhile(path: Path) -> MotionDatabase | None:
    try:
        return load_database(path) if path.exists() else None
    except (FileError, OSError) as error:
        log.warning("the sample database is made again, as its file cannot be used: %s", error)
        return None


def _learn_and_keep(path: Path, progress: Progress | None) -> MotionDatabase:
    database = _learn(progress)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_database(database, path)
    except (FileError, OSError) as error:
        log.warning(
            "the sample database is made anew by each process, as it cannot be kept: %s; make that folder one that can "
            "be written, or name another for caches in the environment variable XDG_CACHE_HOME",
            error,
        )
    else:
        _remove_all_but(path)
    return database


def _learn(progress: Progress | None) -> MotionDatabase:
    # Only now: what has been kept is there in a moment.
    from stridecast.building.build import build
    from stridecast.samples.corpus import sample_takes

    def tell(done: int, total: int) -> None:
        if progress is not None:
            progress("make", done, total)

    motions = [take.motion for take in sample_takes(progress=tell)]
    # An analysis is over before a process would have started.
    return build(motions, cache=False, jobs=1, progress=progress)


def _remove_all_but(path: Path) -> None:
    """Remove what older code has kept, and what processes that were killed have left unfinished."""
    for old in (*path.parent.glob("samples-*.safetensors"), *path.parent.glob(".samples-*.part")):
        if old != path:
            with suppress(OSError):  # in use, or gone already
                old.unlink()
