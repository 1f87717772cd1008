"""The page in a real browser: headless Chromium with software WebGL, and a server with the sample database."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from playwright.sync_api import Browser, sync_playwright

from browsers import Visitor
from stridecast.crowd.crowd import Crowd
from stridecast.live.serve import LiveServer
from stridecast.model.database import MotionDatabase
from stridecast.model.scene import Scene
from stridecast.samples.library import sample_database

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)


@pytest.fixture(scope="session")
def learned() -> MotionDatabase:
    """The sample database."""
    return sample_database()


@pytest.fixture(scope="session")
def server(learned: MotionDatabase) -> Iterator[LiveServer]:
    """A server on a free port; what it runs is compiled before anybody waits for it."""
    Crowd(learned, Scene(start=np.zeros(2), goals=np.array([[0.0, 3.0]]))).step()
    with LiveServer(learned, port=0).running() as running:
        yield running


@pytest.fixture(scope="session")
def browser(chromium: Path) -> Iterator[Browser]:
    """Chromium, without a screen."""
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield running
        running.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Callable[[str], Visitor]]:
    """Makes visitors, and sees to it that they asked nobody else and that the browser had nothing to complain of."""
    visitors: list[Visitor] = []

    def come(address: str) -> Visitor:
        context = browser.new_context(viewport={"width": 1000, "height": 600}, accept_downloads=True)
        visitors.append(Visitor(context.new_page(), address))
        return visitors[-1]

    yield come
    for visitor in visitors:
        visitor.page.context.close()
    for visitor in visitors:
        own = urlsplit(visitor.address).netloc
        foreign = [url for url in visitor.asked if urlsplit(url).netloc != own and not url.startswith("blob:")]
        assert not foreign, f"the page asked somebody else: {foreign}"
        complaints = [
            said for said in visitor.complaints if not any(word in said for word in ("GPU stall", *visitor.forgiven))
        ]
        assert not complaints, complaints


@pytest.fixture
def visitor(visit: Callable[[str], Visitor], server: LiveServer) -> Visitor:
    """Somebody who is about to open the page."""
    return visit(server.address)
