"""When the next frame is due. No clock is read here: times are handed in, so that it can be tested."""

from __future__ import annotations

MOST_AT_ONCE = 3
"""After a pause at most so many frames are made up for; the rest is left out."""


class Pacer:
    """Frames at an even rate, without drift.

    Parameters
    ----------
    rate
        Frames a second.
    """

    def __init__(self, rate: float) -> None:
        self.period = 1.0 / rate
        self.late = 0
        self._next = 0.0

    def start(self, now: float) -> None:
        """Let the next frame be due now, seconds on a clock that never goes back."""
        self._next = now

    def wait(self, now: float) -> float:
        """Seconds until a frame is due."""
        return max(0.0, self._next - now)

    def due(self, now: float) -> int:
        """How many frames are due, and have to be made now."""
        if now < self._next:
            return 0
        count = 1 + int((now - self._next) / self.period)
        self._next += count * self.period
        self.late += max(0, count - MOST_AT_ONCE)
        return min(count, MOST_AT_ONCE)


class Credit:
    """How many steps of a clock that runs faster or slower belong to each frame."""

    def __init__(self) -> None:
        self._left = 0.0

    def take(self, pace: float) -> int:
        """Steps in this frame."""
        self._left += pace
        steps = int(self._left + 1e-9)
        self._left -= steps
        return steps


class Bucket:
    """Bounds how many messages come in.

    Parameters
    ----------
    rate
        So many a second may come for ever, ...
    burst
        ... and so many at once.
    """

    def __init__(self, rate: float, burst: float) -> None:
        self.rate, self.burst = rate, burst
        self._level, self._then = burst, 0.0

    def take(self, now: float) -> bool:
        """Whether one more may come, seconds on a clock that never goes back."""
        self._level = min(self.burst, self._level + self.rate * max(0.0, now - self._then))
        self._then = now
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True
