"""How quick the live server is: from a hand's move to the frame that shows it, and how large a crowd it plays.

The server runs in a process of its own, as ``stridecast live`` does; a client moves the point 45 times a second, as a
mouse does, and takes the time until the first frame that has used a move arrives.

    python bench/live.py [SECONDS]
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from stridecast.live.frames import decode
from stridecast.live.layout import WALK

MOUSE = 45.0
"""Moves a second."""

PEOPLE = 1000

OPTIONS: dict[str, Any] = {"subprotocols": ["stridecast.1"], "compression": None, "max_size": None, "close_timeout": 1}

COMMAND = "from stridecast.cli.main import main; main()"


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    arguments = ["live", "--no-browser", "--quiet", "--port", "0"]
    server = subprocess.Popen([sys.executable, "-c", COMMAND, *arguments], stdout=subprocess.PIPE, text=True)
    try:
        assert server.stdout is not None
        address = server.stdout.readline().strip().replace("http:", "ws:") + "ws"
        with connect(
            address, subprotocols=["stridecast.1"], compression=None, max_size=None, close_timeout=1
        ) as socket:
            walk(socket, seconds)
        with connect(
            address, subprotocols=["stridecast.1"], compression=None, max_size=None, close_timeout=1
        ) as socket:
            crowd(socket, seconds)
    finally:
        server.terminate()
        server.wait()


def walk(socket: ClientConnection, seconds: float) -> None:
    """Latency of moves, and how even the frames come."""
    threading.Thread(target=_move, args=(socket, seconds), daemon=True).start()
    seen, came = {}, []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        data = socket.recv()
        if isinstance(data, bytes) and (frame := decode(data)).kind == WALK:
            came.append(time.perf_counter())
            if frame.echo:
                seen.setdefault(frame.echo, came[-1] - frame.echo)
    late, gaps = 1e3 * np.array(list(seen.values())), 1e3 * np.diff(came)
    print(f"moves to frames: {_spread(late)} ms, of {len(late)} moves; two frames of 30 Hz last 67 ms")
    print(f"between frames: {_spread(gaps)} ms; {len(came) / seconds:.1f} a second of {len(data)} bytes")


def _move(socket: ClientConnection, seconds: float) -> None:
    """Lead the point round a circle."""
    end = time.perf_counter() + seconds - 0.2
    try:
        while (now := time.perf_counter()) < end:
            angle = 0.7 * now
            point = [2 * math.sin(angle), 2 * math.cos(angle)]
            socket.send(json.dumps({"type": "wish", "wish": {"kind": "point", "point": point}, "at": now}))
            time.sleep(1 / MOUSE)
    except ConnectionClosed:
        return


def crowd(socket: ClientConnection, seconds: float) -> None:
    """Frames a second of a thousand people, a hundred of them near enough for poses."""
    sources = []
    for k in range(10):
        low, high = 12.0 * k - 60, 12.0 * k - 49
        area = [[-60.0, low], [60.0, low], [60.0, high], [-60.0, high]]
        goals = [[[-200.0, 200.0], [200.0, 200.0]]]
        sources.append({"name": f"row {k}", "start": area, "goals": goals, "at_once": PEOPLE // 10, "moving": False})
    socket.send(json.dumps({"type": "mode", "mode": "scene"}))
    socket.send(json.dumps({"type": "scene", "scene": {"sources": sources}}))
    _until(socket, "scene_checked")
    socket.send(json.dumps({"type": "view", "center": [0, 0], "radius": 60, "full": 100}))
    socket.send(json.dumps({"type": "playback", "action": "play"}))
    for _ in range(60):
        socket.recv()
    came, clock, steps, size = [], [], [], 0
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        data = socket.recv()
        if isinstance(data, bytes):
            came.append(time.perf_counter())
            clock.append(decode(data).time)
            size = len(data)
        elif (told := json.loads(data))["type"] == "health":
            steps.append(told["step_ms"])
    pace = (clock[-1] - clock[0]) / (came[-1] - came[0])
    print(
        f"{PEOPLE} people: {len(came) / seconds:.1f} frames a second of {size} bytes, the clock at {pace:.2f} of real "
        f"time, {np.mean(steps):.1f} ms a step with its frame"
    )


def _until(socket: ClientConnection, kind: str) -> None:
    while True:
        data = socket.recv()
        if isinstance(data, str) and json.loads(data)["type"] == kind:
            return


def _spread(values: np.ndarray) -> str:
    low, high = np.percentile(values, (50, 99))
    return f"median {low:.1f}, 99 % below {high:.1f}, most {values.max():.1f}"


if __name__ == "__main__":
    main()
