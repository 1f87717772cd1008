"""A visitor of the page: what a hand does, and what server and browser say meanwhile."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from playwright.sync_api import Page, WebSocket

from stridecast.live.frames import decode
from stridecast.live.layout import REPLAYED, STEERING, WALK

PATIENCE = 60.0
"""Seconds until what is waited for counts as missing."""


class Frame:
    """What one binary frame of the server said."""

    def __init__(self, data: bytes) -> None:
        frame = decode(data)
        self.kind, self.number, self.time, self.echo = frame.kind, frame.frame, frame.time, frame.echo
        self.replayed = bool(frame.flags & REPLAYED)
        self.ids, self.places, self.speeds = (frame.arrays[name] for name in ("ids", "places", "speeds"))
        steering = frame.arrays["steering"].ravel() if frame.kind == WALK else ()
        self.steering = dict(zip(STEERING, map(float, steering), strict=False))


class Visitor:
    """One page of one browser, with everything that came over its websocket.

    Parameters
    ----------
    page
        A page that has gone nowhere yet.
    address
        Of the server.
    """

    def __init__(self, page: Page, address: str) -> None:
        self.page, self.address = page, address
        self.frames: list[Frame] = []
        self.messages: list[dict[str, Any]] = []
        self.asked: list[str] = []
        self.complaints: list[str] = []
        self.forgiven: tuple[str, ...] = ()
        page.on("request", lambda request: self.asked.append(request.url))
        page.on("console", lambda said: said.type in ("error", "warning") and self.complaints.append(said.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("websocket", self._listen)

    def go(self, mode: str = "walk") -> None:
        """Open the page and wait until the curtain is up."""
        self.page.goto(f"{self.address}?ratio=0.3&shadows=0&pictures=8#{mode}")
        self.page.wait_for_selector(".curtain.lifted", state="attached", timeout=PATIENCE * 1000)

    def _listen(self, socket: WebSocket) -> None:
        self.asked.append(socket.url)

        def hear(payload: str | bytes) -> None:
            if isinstance(payload, bytes):
                self.frames.append(Frame(payload))
            else:
                self.messages.append(json.loads(payload))

        socket.on("framereceived", hear)

    def wait(self, seconds: float) -> None:
        """Let the browser go on."""
        self.page.wait_for_timeout(seconds * 1000)

    def until(self, true: Callable[[], Any], what: str) -> Any:
        """What ``true`` gives as soon as that is something."""
        ends = time.monotonic() + PATIENCE
        while not (found := true()):
            assert time.monotonic() < ends, f"waited in vain for {what}; the page says {self.said()!r}"
            self.wait(0.03)
        return found

    def said(self) -> str:
        """Messages that the page shows now."""
        return self.page.locator(".messages, .problem").all_inner_texts().__str__()

    def last(self, kind: str, **having: Any) -> dict[str, Any] | None:
        """The newest message of a type, with these values."""
        fits = (m for m in reversed(self.messages) if m["type"] == kind and all(m[k] == v for k, v in having.items()))
        return next(fits, None)

    @contextmanager
    def recording(self) -> Iterator[list[Frame]]:
        """The frames that come meanwhile."""
        frames: list[Frame] = []
        begin = len(self.frames)
        yield frames
        frames.extend(self.frames[begin:])

    # what a hand does

    def seen(self, x: float, z: float) -> tuple[float, float]:
        """Where a ground point is seen, in pixels of the window."""
        at = self.page.evaluate("([x, z]) => window.stridecast.seenAt(x, 0, z)", [x, z])
        assert at["front"], f"({x}, {z}) is behind the camera"
        return at["left"], at["top"]

    def settle(self) -> None:
        """Wait until the camera rests."""
        before = (0.0, 0.0)
        while (now := self.seen(0, 0)) != before:
            before = now
            self.wait(0.15)

    def click(self, x: float, z: float) -> None:
        """Click a ground point."""
        self.page.mouse.click(*self.seen(x, z))

    def drag(self, *points: tuple[float, float]) -> None:
        """Press at the first ground point, move over the others, let go at the last."""
        mouse = self.page.mouse
        places = [self.seen(*point) for point in points]
        mouse.move(*places[0])
        mouse.down()
        for place in places[1:]:
            mouse.move(*place, steps=3)
        mouse.up()

    def slide(self, label: str, value: float) -> None:
        """Set a slider."""
        self.page.get_by_label(label, exact=True).first.fill(str(value))

    def press(self, *keys: str) -> None:
        """Press keys, one after the other."""
        for key in keys:
            self.page.keyboard.press(key)

    def button(self, name: str) -> None:
        """Press the button with this name."""
        self.page.get_by_role("button", name=name, exact=True).first.click()

    def drop(self, files: Sequence[tuple[str, str]]) -> None:
        """Drop files, name and text, on the page."""
        self.page.evaluate(
            """files => {
                const data = new DataTransfer();
                for (const [name, text] of files) data.items.add(new File([text], name));
                document.querySelector(".drop").dispatchEvent(
                    new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true })
                );
            }""",
            [list(file) for file in files],
        )
