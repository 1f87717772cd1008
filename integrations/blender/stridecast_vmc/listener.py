"""A UDP socket that never waits, and the newest whole pose that came by it. Plain Python, without Blender."""

from __future__ import annotations

import math
import socket

from . import osc

MOST_DATAGRAMS = 512
"""So many are taken at a time: who sends faster is behind."""

MOST_BONES = 128
LARGEST = 1e5
"""No place is further away, metres."""

Pose = dict[str, tuple[float, ...]]
"""By bone: place and rotation ``x y z``, ``x y z w``, as Unity has them, against the bone it hangs from."""


class Listener:
    """Listens on a port.

    Parameters
    ----------
    host, port
        Where to listen; port 0 takes any that is free (see ``port``).

    Raises
    ------
    OSError
        The port is taken.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 39539) -> None:
        self._socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setblocking(False)
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self.port: int = self._socket.getsockname()[1]
        self.frames = 0
        self.refused = 0
        self._coming: Pose = {}
        self._whole: Pose = {}
        self._time = 0.0

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()

    def poll(self) -> tuple[Pose, float] | None:
        """The newest whole pose that has come since the last call, and its time in seconds; none if there is none."""
        before = self.frames
        for _ in range(MOST_DATAGRAMS):
            try:
                data = self._socket.recv(65536)
            except BlockingIOError:
                break
            except OSError:  # of an earlier answer: the next call goes on
                continue
            self._take(data)
        return (self._whole, self._time) if self.frames > before else None

    def _take(self, data: bytes) -> None:
        try:
            for address, arguments in osc.messages(data):
                self._hear(address, arguments)
        except ValueError:
            self.refused += 1

    def _hear(self, address: str, arguments: list) -> None:
        if address == "/VMC/Ext/Bone/Pos":
            if len(arguments) < 8 or not isinstance(arguments[0], str):
                raise ValueError("a bone has a name and seven numbers")
            numbers = tuple(arguments[1:8])
            if not all(isinstance(n, float) and math.isfinite(n) and abs(n) < LARGEST for n in numbers):
                raise ValueError("a bone has numbers that are none")
            if len(self._coming) < MOST_BONES or arguments[0] in self._coming:
                self._coming[arguments[0]] = numbers
        elif address == "/VMC/Ext/T" and self._coming:
            if arguments and isinstance(arguments[0], float) and math.isfinite(arguments[0]):
                self._time = arguments[0]
            self._whole, self._coming = self._coming, {}
            self.frames += 1
