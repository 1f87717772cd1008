"""Receivers of the VMC protocol to whom a session is played: the walker, or a few people of the crowd, a port each."""

from __future__ import annotations

from types import TracebackType

from stridecast.crowd.crowd import Crowd
from stridecast.formats.vmc import VmcSender
from stridecast.live.frames import Figures, unpack_rotations
from stridecast.model.pose import Pose
from stridecast.model.skeleton import Skeleton

LAST_PORT = 65535


class Receivers:
    """Ports side by side; a context that closes their sockets.

    Parameters
    ----------
    host, port
        The first of them.
    count
        So many characters are played at once at most.

    Raises
    ------
    InputError
        There is no such host, or no such port.
    """

    def __init__(self, host: str, port: int, count: int = 1) -> None:
        self._senders = [VmcSender(host, min(port + k, LAST_PORT)) for k in range(count)]
        self._shown: list[tuple[int, Skeleton] | None] = [None] * count
        self._crowd: Crowd | None = None

    def __enter__(self) -> Receivers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for sender in self._senders:
            sender.close()

    def play_walker(self, skeleton: Skeleton, pose: Pose, time: float) -> None:
        """Send the walker to the first port."""
        self._senders[0].send(skeleton, pose, time)

    def play_crowd(self, crowd: Crowd, figures: Figures, time: float) -> None:
        """Send people of a crowd: who has a port keeps it until they leave; then who came first of the others has it.

        Parameters
        ----------
        crowd
            Whose people they are.
        figures
            Who is there now, with their poses.
        time
            Seconds on the crowd's clock.
        """
        rows = {int(number): row for row, number in enumerate(figures.ids)}
        if crowd is not self._crowd:
            self._crowd, self._shown = crowd, [None] * len(self._senders)
        kept = [None if one is None or one[0] not in rows else one for one in self._shown]
        taken = {one[0] for one in kept if one is not None}
        others = iter(sorted(rows.keys() - taken))
        for k, (one, sender) in enumerate(zip(kept, self._senders, strict=True)):
            if one is None:
                number = next(others, None)
                one = None if number is None else (number, crowd.skeleton(number))
            self._shown[k] = one
            if one is not None:
                row = rows[one[0]]
                sender.send(one[1], (figures.roots[row], unpack_rotations(figures.rotations[row])), time)
