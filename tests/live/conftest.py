"""A live server with the sample database, and clients of it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from live_clients import Client, open_socket
from stridecast.live.serve import LiveServer
from stridecast.model.database import MotionDatabase
from stridecast.samples.library import sample_database


@pytest.fixture(scope="session")
def learned() -> MotionDatabase:
    """The sample database."""
    return sample_database()


@pytest.fixture(scope="module")
def server(learned: MotionDatabase) -> Iterator[LiveServer]:
    """A server on a free port."""
    with LiveServer(learned, port=0, most_sessions=4).running() as running:
        yield running


@pytest.fixture
def client(server: LiveServer) -> Iterator[Client]:
    """A client that has been welcomed."""
    with open_socket(server) as socket:
        found = Client(socket)
        found.welcome = found.until("welcome")
        yield found
