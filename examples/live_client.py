"""A client of the live server: leads a walker once round a circle, and prints and draws the way that it walked.

python examples/live_client.py [ws://127.0.0.1:8047/ws]

The address is that of a running ``stridecast live``; without one, a server with the sample database is started for it.
docs/protocol.md tells what is said. The picture needs the extra ``plot``.
"""

from __future__ import annotations

import json
import math
import sys
from contextlib import ExitStack

from websockets.sync.client import connect

import stridecast as sc
from stridecast.live.frames import decode
from stridecast.live.layout import STEERING
from stridecast.live.serve import LiveServer

RADIUS, SPEED, SECONDS = 1.5, 1.2, 9.0


def main() -> None:
    with ExitStack() as stack:
        if len(sys.argv) > 1:
            address = sys.argv[1]
        else:
            server = stack.enter_context(LiveServer(sc.sample_database(), port=0).running())
            address = f"ws://127.0.0.1:{server.port}/ws"
        socket = stack.enter_context(connect(address, subprotocols=["stridecast.1"], max_size=None, compression=None))
        walked, led = [], []
        while True:
            data = socket.recv()
            if isinstance(data, str):
                told = json.loads(data)
                if told["type"] == "welcome":
                    print(f"{told['database']['name']}: {', '.join(told['database']['motions'])}")
                elif told["type"] == "error":
                    sys.exit(told["message"])
                continue
            frame = decode(data)
            if frame.time > SECONDS:
                break
            angle = SPEED * frame.time / RADIUS
            point = [RADIUS - RADIUS * math.cos(angle), RADIUS * math.sin(angle)]
            socket.send(json.dumps({"type": "wish", "wish": {"kind": "point", "point": point}, "at": frame.time}))
            x, z, _ = frame.arrays["places"][0]
            walked.append((x, z))
            led.append(point)
            if frame.frame % 30 == 0:
                steering = dict(zip(STEERING, frame.arrays["steering"][0], strict=True))
                turning = f"across {steering['lateral']:5.2f} of {steering['most_lateral']:.2f} m/s2"
                print(f"{frame.time:4.1f} s at ({x:5.2f}, {z:5.2f}), {frame.arrays['speeds'][0]:.2f} m/s, {turning}")
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return
    figure = Figure(figsize=(5, 5))
    axes = figure.add_subplot(aspect="equal")
    axes.plot(*zip(*led, strict=True), "r", *zip(*walked, strict=True), "k", linewidth=1)
    figure.savefig("live_client.png")


if __name__ == "__main__":
    main()
