"""A web server with recordings that can be told to misbehave, and sets of what it serves."""

from __future__ import annotations

import csv
import gzip
import hashlib
import re
import socket
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from stridecast.samples.recordings import RecordingSet


class RecordingServer(ThreadingHTTPServer):
    """Serves bytes at paths.

    ``faults`` holds, for a path, what goes wrong with one request after the other: ``("status", 503)``, ``("cut", n)``
    after n bytes, ``("stall", n)`` until ``release`` is set, ``("hang up", 0)`` without an answer.
    """

    daemon_threads = True

    def __init__(self, contents: Mapping[str, bytes]) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.contents = dict(contents)
        self.faults: dict[str, Iterator[tuple[str, int]]] = {}
        self.ranges = True
        self.zips = False
        self.together: threading.Barrier | None = None
        self.release = threading.Event()
        self.requests: list[tuple[str, str | None]] = []

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.server_port}"

    def go_wrong(self, file: str, faults: Iterable[tuple[str, int]]) -> None:
        self.faults[file] = iter(faults)

    def handle_error(self, request, client_address) -> None:
        """Who fetches may leave at any time."""


class _Handler(BaseHTTPRequestHandler):
    server: RecordingServer

    def do_GET(self) -> None:
        file, asked = self.path.lstrip("/"), self.headers.get("Range")
        self.server.requests.append((file, asked))
        if self.server.together:
            self.server.together.wait(5)
        what, amount = next(self.server.faults.get(file, iter(())), ("", 0))
        if what == "hang up":
            self.connection.shutdown(socket.SHUT_RDWR)
            return
        content = self.server.contents.get(file)
        if what == "status" or content is None:
            self.send_error(amount or 404)
            return
        start = int(re.fullmatch(r"bytes=(\d+)-", asked)[1]) if asked and self.server.ranges else 0
        if start and start >= len(content):
            self.send_error(416)
            return
        self.send_response(206 if start else 200)
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(content) - 1}/{len(content)}")
        body = content[start:]
        if self.server.zips and "gzip" in self.headers.get("Accept-Encoding", ""):
            body = gzip.compress(body)
            self.send_header("Content-Encoding", "gzip")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body[:amount] if what else body)
        if what == "stall":
            self.wfile.flush()
            self.server.release.wait(20)

    def log_message(self, *_) -> None:
        """Nobody reads it."""


@contextmanager
def served(contents: Mapping[str, bytes]) -> Iterator[RecordingServer]:
    """Serve contents from another thread."""
    server = RecordingServer(contents)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.release.set()
        server.shutdown()
        thread.join()
        server.server_close()


def recording_set(contents: Mapping[str, bytes], table: Path, name: str = "tiny") -> RecordingSet:
    """Write the table of a set that consists of these files."""
    with table.open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file)
        lines.writerow(["file", "repository", "commit", "path", "sha256", "bytes"])
        for place, content in contents.items():
            sha256 = hashlib.sha256(content).hexdigest()
            lines.writerow([place, "some/one", "0" * 40, f"data/{place}", sha256, len(content)])
    return RecordingSet(name=name, about="a few takes", credit="Thanks to all.", terms="Do no harm.", table=table)
