"""The thread of a session: takes what the client says, plays the mode that is on, at an even rate."""

from __future__ import annotations

import logging
import queue
import threading
import time
from typing import TYPE_CHECKING, Any

from stridecast import __version__
from stridecast.crowd.rules import RULES
from stridecast.errors import InputError
from stridecast.live.layout import CLAMPED
from stridecast.live.messages import (
    PROTOCOL,
    ErrorMessage,
    Health,
    ModeMessage,
    Part,
    PlaceMessage,
    SettingsMessage,
    Welcome,
    WishMessage,
)
from stridecast.live.outbox import Outbox
from stridecast.live.pacing import Pacer
from stridecast.live.telling import database_part, skeleton_part
from stridecast.live.walking import Walking
from stridecast.model.database import MotionDatabase

if TYPE_CHECKING:
    from stridecast.live.hall import Hall

log = logging.getLogger("stridecast")

WAITING = 1000
"""So many messages wait at most."""

IDLE = 0.25
"""Where nothing plays, messages are looked for at least so often, seconds."""


class Stage(threading.Thread):
    """Plays for one client.

    Parameters
    ----------
    hall
        What is shared.
    outbox
        What is told and shown goes here.
    name
        Of the session.
    """

    def __init__(self, hall: Hall, outbox: Outbox, name: str) -> None:
        super().__init__(name=f"stage {name[:8]}", daemon=True)
        self.hall, self.outbox, self.session = hall, outbox, name
        self._inbox: queue.Queue[Part | None] = queue.Queue(WAITING)
        self._stopped = threading.Event()
        self.mode = "walk"
        self.database: MotionDatabase = hall.database
        self._times: list[float] = []

    def put(self, message: Part) -> bool:
        """Hand over a message; False where too many wait."""
        try:
            self._inbox.put_nowait(message)
        except queue.Full:
            return False
        return True

    def stop(self) -> None:
        """End, as soon as what is being done is done."""
        self._stopped.set()
        with_room = self._inbox.qsize() < WAITING
        if with_room:
            self._inbox.put_nowait(None)

    def run(self) -> None:
        """Play until stopped."""
        self._use(self.database, self.hall.name, built=False)
        self._pacer = Pacer(self.database.frame_rate)
        self._pacer.start(time.monotonic())
        told = time.monotonic()
        while not self._stopped.is_set():
            for message in self._come(self._wait()):
                self._take(message)
            now = time.monotonic()
            for _ in range(self._pacer.due(now)):
                self._play()
            if now - told >= 1.0:
                told = now
                self._tell_health()

    def _use(self, database: MotionDatabase, name: str, *, built: bool) -> None:
        """Begin anew with a database."""
        self.database = database
        self.walking = Walking(database, self.outbox.tell)
        self.outbox.tell(
            Welcome(
                protocol=PROTOCOL,
                version=__version__,
                session=self.session,
                database=database_part(database, name, built),
                skeleton=skeleton_part(database.skeleton),
                settings=self.walking.settings,
                rules=list(RULES),
                bounds=list(CLAMPED),
                scene=dict(self.hall.scene),
                limits=self.hall.limits,
                glb=False,
            )
        )

    def _wait(self) -> float:
        return min(self._pacer.wait(time.monotonic()), IDLE)

    def _come(self, seconds: float) -> list[Part]:
        """Messages that have come, waiting for the first of them for a while."""
        found: list[Part | None] = []
        try:
            found.append(self._inbox.get(timeout=seconds) if seconds > 0 else self._inbox.get_nowait())
            while True:
                found.append(self._inbox.get_nowait())
        except queue.Empty:
            return [message for message in found if message is not None]

    def _take(self, message: Any) -> None:
        """Do what a message says; what goes wrong is told."""
        code = "internal"
        try:
            match message:
                case ModeMessage():
                    self.mode = message.mode
                case WishMessage() | SettingsMessage() | PlaceMessage():
                    code = "wish"
                    self.walking.take(message)
        except InputError as error:
            self._tell_error(code, str(error), message)
        except Exception:
            log.exception("in the session's stage")
            what = "the server met something that it did not expect; its log says more. Please report this"
            self._tell_error("internal", what, message)

    def _tell_error(self, code: Any, what: str, message: Any) -> None:
        self.outbox.tell(ErrorMessage(code=code, message=what, request=getattr(message, "request", 0)))

    def _play(self) -> None:
        began = time.perf_counter()
        try:
            if self.mode == "walk":
                self.outbox.show(self.walking.step())
        except InputError as error:
            self._tell_error("wish", str(error), None)
        self._times.append(time.perf_counter() - began)

    def _tell_health(self) -> None:
        times = self._times or [0.0]
        self.outbox.tell(
            Health(
                mode=self.mode,  # type: ignore[arg-type]
                step_ms=1e3 * sum(times) / len(times),
                worst_ms=1e3 * max(times),
                late=self._pacer.late,
                dropped=self.outbox.dropped,
                sessions=len(self.hall.guests),
            )
        )
        self._times = []
