"""One connection: what comes in is checked and handed to the stage, what the stage makes is sent out."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from typing import TYPE_CHECKING

from pydantic import ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from stridecast.live.limits import BURST, FLOOD, MESSAGES, PATIENCE
from stridecast.live.messages import PROTOCOL, READER, ErrorMessage, PingMessage, Pong
from stridecast.live.outbox import Outbox
from stridecast.live.pacing import Bucket
from stridecast.live.stage import Stage

if TYPE_CHECKING:
    from stridecast.live.hall import Hall

log = logging.getLogger("stridecast")

BINARY, LET_GO, LATER, WRONG_PROTOCOL = 1003, 1008, 1013, 4400
"""Codes with which connections are closed."""


class Session:
    """A client that is connected.

    Parameters
    ----------
    socket
        Its websocket, not accepted yet.
    hall
        What is shared.
    name
        The word by which the hall knows it.
    """

    def __init__(self, socket: WebSocket, hall: Hall, name: str) -> None:
        self.socket, self.hall, self.name = socket, hall, name
        self.outbox = Outbox(asyncio.get_running_loop())
        self.stage = Stage(hall, self.outbox, name)

    async def run(self) -> None:
        """Serve until one side ends the connection."""
        await self.socket.accept(subprotocol=PROTOCOL)
        self.stage.start()
        sending = asyncio.create_task(self._send())
        try:
            code = await self._receive()
            if code is not None:
                await self.socket.close(*code)
        except (WebSocketDisconnect, OSError):
            pass
        finally:
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await sending
            self.stage.stop()

    async def _send(self) -> None:
        """Send what there is. Each sending waits until the one before has left, so that frames cannot pile up."""
        try:
            while not self.outbox.overflown:
                messages, frame = await self.outbox.next()
                for text in messages:
                    await self.socket.send_text(text)
                if frame is not None:
                    await self.socket.send_bytes(frame)
            await self.socket.close(LET_GO, "messages are not read")
        except (WebSocketDisconnect, OSError):
            return

    async def _receive(self) -> tuple[int, str] | None:
        """Read messages; the code and reason to close with, nothing where the client has gone."""
        bucket, wrong, told = Bucket(MESSAGES, BURST), 0, -1.0
        flood = Bucket(FLOOD, FLOOD)
        while True:
            message = await self.socket.receive()
            if message["type"] == "websocket.disconnect":
                return None
            now = time.monotonic()
            text = message.get("text")
            if text is None:
                return BINARY, "messages are text: a JSON object each"
            if not flood.take(now):
                return LET_GO, f"more than {FLOOD} messages a second"
            if not bucket.take(now):
                if now - told > 1.0:
                    told = now
                    what = f"more than {MESSAGES} messages a second; some were left out. Send the newest input only"
                    self.outbox.tell(ErrorMessage(code="rate", message=what))
                await asyncio.sleep(0)
                continue
            try:
                parsed = READER.validate_json(text)
            except ValidationError as error:
                wrong += 1
                self.outbox.tell(_told(error))
                if wrong >= PATIENCE:
                    return LET_GO, f"{wrong} messages in a row that are none"
                continue
            wrong = 0
            if isinstance(parsed, PingMessage):
                self.outbox.tell(Pong(at=parsed.at))
            elif not self.stage.put(parsed):
                what = "the server is still busy with earlier messages; wait for their answers"
                self.outbox.tell(ErrorMessage(code="busy", message=what, request=getattr(parsed, "request", 0)))


def _told(error: ValidationError) -> ErrorMessage:
    """What is wrong with a message, and where."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    place, what = ".".join(str(part) for part in first["loc"]), first["msg"]
    if first["type"] == "json_invalid":
        said = what.removeprefix("Invalid JSON: ")
        return ErrorMessage(code="message", message=f"this is no JSON: {said}; a message is one object")
    more = error.error_count() - 1
    rest = f" ({more} more)" if more else ""
    said = f"{place or 'message'}: {what}{rest}; see docs/protocol.md"
    return ErrorMessage(code="message", message=said[:500], place=place[:200])
