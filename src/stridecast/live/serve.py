"""The server: a socket on this machine, the application behind it, until somebody stops it."""

from __future__ import annotations

import contextlib
import gc
import ipaddress
import secrets
import socket
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import uvicorn

from stridecast.errors import InputError
from stridecast.formats.vmc import VmcSender
from stridecast.live.app import make_app
from stridecast.live.cast import Costume
from stridecast.live.hall import EMPTY, MOST_SESSIONS, Hall
from stridecast.live.limits import usual_limits
from stridecast.live.messages import LARGEST_MESSAGE, LimitsPart
from stridecast.live.security import Rules
from stridecast.model.database import MotionDatabase
from stridecast.synthesis.sizes import kept_enlargement
from stridecast.synthesis.walker import Walker

OWN = "127.0.0.1"
"""Where a server listens unless another place is named: only this machine can come."""

PORT = 8047
"""The usual port; where it is taken, the system gives another."""

MOST_CONNECTIONS = 100
"""So many are open at once, of all kinds; more are answered with status 503."""

MOST_RECEIVED = 16
"""So many people of a scene are played to receivers at most; for crowds there is the websocket."""

SEND_BUFFER = 256 * 1024
"""What a slow client has not taken waits in the system up to so many bytes; else frames of seconds would."""


class LiveServer:
    """A server for pages and other clients.

    Parameters
    ----------
    database, name
        What is walked with, and how it is called.
    costume
        The character in whose body ``database`` is (see ``cast``).
    scene
        The scene that sessions begin with, as its file says it; none if left out.
    host
        Where it listens; others than ``OWN`` can be reached from elsewhere, and then a token is needed.
    port
        Which port; ``PORT``, or any that is free, if left out.
    limits
        What is taken of each client.
    most_sessions
        So many clients are served at once.
    receiver
        Host and port to which the first client is played by the VMC protocol; the next client's port is after those of
        the first.
    received
        So many people of a scene are played to receivers, a port each; a walker is to the first of them.

    Raises
    ------
    InputError
        It cannot listen there, or there is no such receiver.
    """

    def __init__(
        self,
        database: MotionDatabase,
        name: str = "sample database",
        *,
        costume: Costume | None = None,
        scene: Mapping[str, Any] | None = None,
        host: str | None = None,
        port: int | None = None,
        limits: LimitsPart | None = None,
        most_sessions: int | None = None,
        receiver: tuple[str, int] | None = None,
        received: int = 1,
    ) -> None:
        if not 1 <= received <= MOST_RECEIVED:
            raise InputError(f"1 to {MOST_RECEIVED} people can be played to receivers, not {received}")
        if receiver is not None:
            VmcSender(*receiver).close()  # says what is wrong with it
        self.host = host or OWN
        self._socket = _listen(self.host, port)
        self.port: int = self._socket.getsockname()[1]
        self.token = None if _is_own(self.host) else secrets.token_urlsafe(24)
        rules = Rules(
            port=self.port,
            names=() if _is_address(self.host) else (self.host.lower(),),
            token=self.token,
            addresses=self.token is not None,
        )
        self.hall = Hall(
            database=database,
            name=name,
            costume=costume,
            scene=EMPTY if scene is None else dict(scene),
            limits=limits or usual_limits(),
            most_sessions=MOST_SESSIONS if most_sessions is None else most_sessions,
            receiver=receiver,
            received=received,
        )
        config = uvicorn.Config(
            make_app(self.hall, rules),
            log_level="error",
            access_log=False,
            ws="websockets-sansio",
            ws_max_size=LARGEST_MESSAGE,
            ws_per_message_deflate=False,
            proxy_headers=False,
            server_header=False,
            h11_max_incomplete_event_size=64 * 1024,
            timeout_keep_alive=15,
            limit_concurrency=MOST_CONNECTIONS,
            timeout_graceful_shutdown=3,
        )
        self._server = uvicorn.Server(config)

    @property
    def address(self) -> str:
        """What is opened in a browser, with the token where one is needed."""
        name = _shown(self.host)
        query = "" if self.token is None else f"?token={self.token}"
        return f"http://{name}:{self.port}/{query}"

    def run(self, ready: Callable[[], None] | None = None) -> None:
        """Serve until interrupted.

        Parameters
        ----------
        ready
            Called once clients can come.
        """
        Walker(self.hall.database).step(
            (0.0, 0.0), motion=self.hall.database.motions[0]
        )  # compiled before anybody waits
        gc.collect()
        gc.freeze()  # to go through all that is there by now would take as long as several frames
        threading.Thread(target=kept_enlargement, args=(self.hall.database,), daemon=True).start()
        if ready is not None:
            threading.Thread(target=self._when_started, args=(ready,), daemon=True).start()
        try:
            self._server.run(sockets=[self._socket])
        finally:
            gc.unfreeze()
            self.hall.close()

    def stop(self) -> None:
        """End; from any thread."""
        self._server.should_exit = True

    def close(self) -> None:
        """Give up the place of a server that has not been run."""
        self._socket.close()
        self.hall.close()

    @contextlib.contextmanager
    def running(self) -> Any:
        """Serve in a thread for as long as the context lasts."""
        thread = threading.Thread(target=self.run, daemon=True)
        thread.start()
        try:
            self._wait()
            yield self
        finally:
            self.stop()
            thread.join(10.0)

    def _when_started(self, ready: Callable[[], None]) -> None:
        self._wait()
        if self._server.started:
            ready()

    def _wait(self) -> None:
        while not (self._server.started or self._server.should_exit):
            time.sleep(0.01)


def _listen(host: str, port: int | None) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    wanted = [port] if port is not None else [PORT, 0]
    for number in wanted:
        out = socket.socket(family, socket.SOCK_STREAM)
        try:
            out.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            out.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            out.bind((host, number))
            out.listen(64)
        except (OSError, OverflowError) as error:
            out.close()
            if number == wanted[-1]:
                said = getattr(error, "strerror", None) or error
                raise InputError(
                    f"cannot listen at {host}, port {number}: {said}; name another --host or --port"
                ) from None
        else:
            return out
    raise AssertionError


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def _is_own(host: str) -> bool:
    """Whether only this machine can come there."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _shown(host: str) -> str:
    """A name under which a browser on this machine finds the server."""
    if host in ("0.0.0.0", "::"):
        return "127.0.0.1" if host == "0.0.0.0" else "[::1]"
    return f"[{host}]" if ":" in host else host
