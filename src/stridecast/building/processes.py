"""Work on many takes at once: one process a core, results that do not depend on how many there are.

A worker is a fresh interpreter (``spawn``): safe beside threads, and the same on every system. It never runs the
caller's script again, so that needs no ``if __name__ == "__main__"``. Linear algebra is held to one thread: more would
only fight over the cores, and sums would come out in another order.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

from threadpoolctl import threadpool_limits

from stridecast.errors import InputError

Task = TypeVar("Task")
Result = TypeVar("Result")

MOST_JOBS = 61
"""More processes than this cannot be waited for at once on Windows."""

log = logging.getLogger("stridecast")


@dataclass(frozen=True, kw_only=True)
class Failure:
    """Why there is no result. ``lasting`` says that the input is at fault, so that another try would end the same."""

    reason: str
    lasting: bool


class Workers:
    """Processes that work on tasks; a context manager.

    Parameters
    ----------
    jobs
        How many; with 1 everything is done in the caller's process.
    """

    def __init__(self, jobs: int) -> None:
        self.jobs = min(jobs, MOST_JOBS)
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # After Ctrl-C nobody waits; otherwise a pool left behind would complain when the interpreter ends.
        self._close(wait=kind is None or issubclass(kind, Exception))

    def spread(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | Failure]]:
        """Call a function for each task; yield task numbers with results in the order in which they are ready.

        Parameters
        ----------
        function
            A function at the top of a module. What it raises becomes a ``Failure``, as does the death of its process.
        tasks
            Its arguments.
        """
        if self.jobs == 1 or not tasks:
            for number, task in enumerate(tasks):
                yield number, attempt(function, task)
            return
        lost = yield from self._in_pool(function, dict(enumerate(tasks)), self.jobs)
        if lost:
            log.warning("a worker process died; what it leaves undone is done again, one at a time")
        for number in lost:
            if (yield from self._in_pool(function, {number: tasks[number]}, 1)):
                reason = "the process that worked on it died, twice; is there enough memory?"
                yield number, Failure(reason=reason, lasting=False)
        if lost:
            self._close()

    def _in_pool(
        self, function: Callable[[Task], Result], tasks: Mapping[int, Task], jobs: int
    ) -> Generator[tuple[int, Result | Failure], None, list[int]]:
        """Do tasks in the pool, and return the numbers of those that were lost with a worker."""
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_start_worker)
        lost, futures = [], {}
        with _quiet_start():
            for number, task in tasks.items():
                try:
                    futures[self._pool.submit(attempt, function, task)] = number
                except BrokenProcessPool:
                    lost.append(number)
        for future in as_completed(futures):
            try:
                yield futures[future], future.result()
            except BrokenProcessPool:
                lost.append(futures[future])
        if lost:
            self._close()
        return sorted(lost)

    def _close(self, *, wait: bool = False) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=wait, cancel_futures=True)
            self._pool = None


def attempt(function: Callable[[Task], Result], task: Task) -> Result | Failure:
    """Call a function; whatever it raises becomes a ``Failure``."""
    try:
        with threadpool_limits(1):
            return function(task)
    except InputError as error:
        return Failure(reason=str(error), lasting=not _blames_system(error))
    except Exception as error:
        log.debug("unexpected", exc_info=True)
        return Failure(reason=f"unexpected {type(error).__name__}: {error}; please report this", lasting=False)


def _blames_system(error: BaseException | None) -> bool:
    """Whether an error comes from the file system: then another try may end otherwise."""
    return error is not None and (isinstance(error, OSError) or _blames_system(error.__cause__))


@contextmanager
def _quiet_start() -> Iterator[None]:
    """Start workers that do not run the caller's script, and that Ctrl-C cannot reach before they are ready for it."""
    script = sys.modules["__main__"].__dict__
    hidden: dict[str, object] = {name: script[name] for name in ("__file__", "__spec__") if name in script}
    script.update((name, None) for name in hidden)
    before = _block_interrupts()
    try:
        yield
    finally:
        if before is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        script.update(hidden)


def _block_interrupts() -> set[int] | None:
    """Let Ctrl-C wait, here and in processes started; return what waited before (none where that cannot be)."""
    return signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if sys.platform != "win32" else None


def _start_worker() -> None:
    """Let a worker die of Ctrl-C without a word, and with its parent, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_follow_parent, daemon=True).start()


def _follow_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
