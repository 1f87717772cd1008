"""What was played, frame by frame, in bounded room: the oldest goes first."""

from __future__ import annotations

from bisect import bisect_right

from stridecast.live.frames import Figures


class Timeline:
    """Frames in the order of time.

    Parameters
    ----------
    room
        Bytes that are kept at most.
    """

    def __init__(self, room: int) -> None:
        self.room = room
        self._times: list[float] = []
        self._frames: list[Figures] = []
        self._size = 0
        self._gone = 0  # places in the lists that are not used any more

    def __len__(self) -> int:
        return len(self._times) - self._gone

    def frames(self) -> list[tuple[float, Figures]]:
        """All that is kept, with its times; what is added later does not come into it."""
        return list(zip(self._times[self._gone :], self._frames[self._gone :], strict=True))

    @property
    def first(self) -> float:
        """Time of the oldest frame that is kept, seconds."""
        return self._times[self._gone] if len(self) else 0.0

    @property
    def last(self) -> float:
        """Time of the newest frame, seconds."""
        return self._times[-1] if len(self) else 0.0

    def add(self, time: float, figures: Figures) -> None:
        """Keep one more frame, later than all others."""
        self._times.append(time)
        self._frames.append(figures)
        self._size += figures.nbytes
        while self._size > self.room and len(self) > 1:
            self._size -= self._frames[self._gone].nbytes
            self._gone += 1
        if self._gone > 1000:
            del self._times[: self._gone], self._frames[: self._gone]
            self._gone = 0

    def at(self, time: float) -> tuple[float, Figures]:
        """The last frame up to a time, or the first of all; and its own time."""
        place = max(self._gone, bisect_right(self._times, time + 1e-9) - 1)
        return self._times[place], self._frames[place]
