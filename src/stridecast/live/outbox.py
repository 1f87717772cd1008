"""What waits to be sent to a client: messages in their order, and the newest frame alone."""

from __future__ import annotations

import asyncio
import threading
from collections import deque

from stridecast.live.messages import Part

MOST_WAITING = 5_000
"""So many messages wait at most; a client that reads none is let go."""


class Outbox:
    """Filled by the thread that plays, emptied by the loop that sends.

    Parameters
    ----------
    loop
        The loop that sends.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._filled = asyncio.Event()
        self._lock = threading.Lock()
        self._messages: deque[str] = deque()
        self._frame: bytes | None = None
        self.dropped = 0
        self.overflown = False

    def tell(self, message: Part) -> None:
        """Send a message when its turn comes."""
        text = message.model_dump_json()
        with self._lock:
            self.overflown |= len(self._messages) >= MOST_WAITING
            if not self.overflown:
                self._messages.append(text)
        self._wake()

    def show(self, frame: bytes) -> None:
        """Send a frame unless a newer one comes before."""
        with self._lock:
            self.dropped += self._frame is not None
            self._frame = frame
        self._wake()

    async def next(self) -> tuple[list[str], bytes | None]:
        """Wait until there is something, and take all of it."""
        await self._filled.wait()
        self._filled.clear()
        with self._lock:
            messages, frame = list(self._messages), self._frame
            self._messages.clear()
            self._frame = None
        return messages, frame

    def _wake(self) -> None:
        try:
            self._loop.call_soon_threadsafe(self._filled.set)
        except RuntimeError:  # the loop has ended, and nobody is to be told any more
            return
