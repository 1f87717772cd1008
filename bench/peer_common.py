"""What the peers' scripts share; runs in their environment, so it imports nothing of the package.

Called as SCRIPT OUT.npz FRAME_RATE [ARGUMENT...] with a situation as JSON on standard input (see peers.py).
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable

import numpy as np
import shapely

REACH = 0.4
"""Somebody has reached the last stop who is so near, metres."""

PASSED = 1.0
"""Stops on the way count as passed from so far, metres: nobody turns round in a door for having missed its middle."""


def solid(situation, thick):
    """Walls of some thickness and obstacles, as one geometry."""
    lines = [
        shapely.LineString(points).buffer(thick / 2, cap_style="flat", join_style="mitre")
        for points in situation["walls"]
    ]
    discs = [shapely.Point(x, z).buffer(r, quad_segs=8) for x, z, r in situation["circles"]]
    return shapely.union_all([*lines, *discs, *(shapely.Polygon(points) for points in situation["polygons"])])


def main(simulate: Callable) -> None:
    """Read a situation, let it be walked, and write who was where at which frame.

    ``simulate(situation, frame_rate, arguments, note)`` calls ``note(frame, people, positions)`` at every frame.
    """
    out, frame_rate, *arguments = sys.argv[1:]
    situation = json.load(sys.stdin)
    noted: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def note(frame, people, positions):
        noted.append((np.array(people), np.full(len(people), frame), np.array(positions).reshape(-1, 2)))

    begun = time.perf_counter()
    simulate(situation, float(frame_rate), arguments, note)
    seconds = time.perf_counter() - begun
    ids, frames, positions = (np.concatenate(columns) for columns in zip(*noted, strict=True))
    np.savez(out, ids=ids, frames=frames, positions=positions, seconds=seconds)
