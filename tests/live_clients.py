"""A client of the live server, for tests."""

from __future__ import annotations

import json
import socket
import time
from typing import Any

from websockets.sync.client import ClientConnection, connect

from stridecast.live.frames import Frame, decode
from stridecast.live.messages import PROTOCOL, SERVER_READER
from stridecast.live.serve import LiveServer

PATIENCE = 30.0
"""A test waits no longer for anything, seconds."""


def open_socket(server: LiveServer, *, protocols: tuple[str, ...] = (PROTOCOL,), query: str = "", **options: Any):
    """Connect as ``websockets`` does it."""
    return connect(
        f"ws://127.0.0.1:{server.port}/ws{query}",
        subprotocols=list(protocols) or None,
        compression=None,
        max_size=None,
        proxy=None,
        close_timeout=1,
        **options,
    )


def open_narrow_socket(server: LiveServer, room: int = 16_384, **options: Any):
    """Connect so that the system keeps little for a client that does not read."""
    narrow = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
    narrow.connect(("127.0.0.1", server.port))
    return open_socket(server, sock=narrow, **options)


class Client:
    """Says messages, and waits for answers. Every message of the server is checked by the schema."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.frames: list[Frame] = []
        self.said: list[Any] = []

    def say(self, type: str, **fields: Any) -> None:
        self.socket.send(json.dumps({"type": type, **fields}))

    def receive(self) -> Any:
        """The next message or frame."""
        data = self.socket.recv(timeout=PATIENCE)
        if isinstance(data, bytes):
            self.frames.append(decode(data))
            return self.frames[-1]
        self.said.append(SERVER_READER.validate_json(data))
        return self.said[-1]

    def until(self, *types: str) -> Any:
        """The next message of one of these types."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            got = self.receive()
            if not isinstance(got, Frame) and got.type in types:
                return got
        raise AssertionError(f"no {' or '.join(types)} came")

    def until_frame(self, kind: int, fits=lambda frame: True) -> Frame:
        """The next frame of a kind that fits."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            got = self.receive()
            if isinstance(got, Frame) and got.kind == kind and fits(got):
                return got
        raise AssertionError("no such frame came")
