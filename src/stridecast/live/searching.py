"""The search for people's ways: told about while it lasts, and given up when that is asked for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

from stridecast.crowd.step_kernels import propose
from stridecast.geometry.kernels import is_compiled
from stridecast.live.messages import Part, Progress

TOLD_FIRST, TOLD = 0.3, 0.15
"""A search that lasts so long is told about, and then so often, seconds."""


class Gone(Exception):  # noqa: N818  # nothing is wrong
    """The client has left while something long was being done."""


class GivenUp(Exception):  # noqa: N818  # nothing is wrong
    """The client does not want to wait for it any more."""


class Search:
    """What is told of a search, and whether it is to go on. Entered while there may be one.

    Parameters
    ----------
    tell
        Called with messages for the client.
    gone
        Whether the client has left.
    clock
        Seconds that never go back.
    """

    def __init__(
        self, tell: Callable[[Part], None], gone: Callable[[], bool], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._tell, self._gone, self._clock = tell, gone, clock
        self._given_up = threading.Event()
        self._next = 0.0
        self._told = False

    def __enter__(self) -> Search:
        self._given_up.clear()
        self._next, self._told = self._clock() + TOLD_FIRST, False
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._told:  # whatever became of it, there is nothing to wait for any more
            self._tell(Progress(stage="ways", done=1, total=1))

    def give_up(self) -> None:
        """End what is being searched for now, if anything is; from another thread."""
        self._given_up.set()

    def tell_compiling(self) -> None:
        """Say that the crowd has to be compiled, where that is so."""
        if not propose.signatures and not is_compiled(propose):
            self._tell(Progress(stage="compile", done=0, total=1))

    def tell_ways(self, done: int, total: int) -> None:
        """Say now and then how many ways have been found.

        Raises
        ------
        Gone, GivenUp
            Nobody waits for them any more.
        """
        if self._gone():
            raise Gone
        if self._given_up.is_set():
            raise GivenUp
        now = self._clock()
        if now >= self._next:
            self._next, self._told = now + TOLD, True
            self._tell(Progress(stage="ways", done=done, total=total))
