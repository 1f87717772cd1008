"""The layout of binary frames, from which the encoder, the decoder and the page's constants are made.

A frame is a header and then arrays, one after the other, little endian, each padded with zeros to a multiple of
``ALIGNMENT`` bytes, in the order of ``ARRAYS``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

ALIGNMENT = 4
"""Every array begins at a multiple of so many bytes from the beginning."""

WALK, SCENE, CLIPS = 1, 2, 3
"""Kinds of frames: the walker of walk mode, the people of scene mode, the figures of database mode."""

REPLAYED = 1
"""Flag: recorded earlier, shown again (scrubbed or replayed)."""

HEADER = np.dtype(
    [
        ("kind", "u1"),
        ("flags", "u1"),
        ("count", "<u2"),
        ("frame", "<u4"),
        ("time", "<f8"),
        ("echo", "<f8"),
        ("full", "<u2"),
        ("joints", "<u2"),
        ("movers", "<u2"),
        ("reserved", "<u2"),
    ]
)
"""``count`` figures, the first ``full`` of them with poses of ``joints`` joints; ``movers`` moving obstacles.

``time`` in seconds of the mode's own clock; ``echo`` the ``at`` of the newest input that this frame has used, 0 before
the first.
"""


class Column(NamedTuple):
    """An array of a frame: ``rows`` (1, or a number in the header) of ``width`` numbers, times ``joints`` or not."""

    name: str
    kind: str
    rows: str
    width: int
    joints: bool = False


STEERING = (
    *("input_x", "input_z", "velocity_x", "velocity_z", "acceleration_x", "acceleration_z"),
    *("tangential", "lateral", "jerk"),
    *("most_jerk", "least_tangential", "most_tangential", "most_lateral", "least_speed", "most_speed"),
    "generic",
)
"""Of walk frames: the point followed (NaN where there is none, m), the vehicle (m/s, m/s2), its acceleration along and
across its direction (m/s2) and how that changed (m/s3), the bounds in force for these, and generic time, 0 to 1."""

PLAYING = ("clamped", "group", "segment", "made_up")
"""Of walk frames: bits of the bounds that acted (see ``CLAMPED``), the group that plays, how many segments have begun,
and how many transitions had to be made up."""

CLAMPED = ("jerk", "tangential", "lateral", "speed")
"""Bit ``k`` of ``clamped`` stands for ``CLAMPED[k]``."""

ARRAYS = (
    Column("ids", "<u4", "count", 1),
    Column("places", "<f4", "count", 3),  # x, z, heading
    Column("speeds", "<f4", "count", 1),
    Column("rules", "u1", "count", 1),
    Column("roots", "<f4", "full", 3),
    Column("rotations", "<u2", "full", 3, joints=True),
    Column("planted", "u1", "full", 1),  # bit 0 left, bit 1 right
    Column("movers", "<f4", "movers", 2),
)
"""Arrays of every frame; walk frames go on with ``WALK_ARRAYS``."""

WALK_ARRAYS = (
    Column("steering", "<f4", "1", len(STEERING)),
    Column("playing", "<u4", "1", len(PLAYING)),
)

LEVELS = 16383
"""Of a rotation's three numbers: whole numbers from 0 to ``2 * LEVELS``, the middle being 0."""
