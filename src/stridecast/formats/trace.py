"""Every frame of a walk as CSV: what was asked for, what the vehicle did, where the pelvis was, which bounds acted."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stridecast.formats.files import replacing
from stridecast.synthesis.journey import Journey

COLUMNS = (
    *("frame", "time", "motion", "segment", "input_x", "input_z"),
    *("x", "z", "vx", "vz", "ax", "az", "heading"),
    *("pelvis_x", "pelvis_y", "pelvis_z", "pelvis_qw", "pelvis_qx", "pelvis_qy", "pelvis_qz"),
    *("left_planted", "right_planted", "clamped"),
)
"""The columns. Metres, seconds, radians; ``clamped`` joins the names of bounds with ``+``."""


def trace_text(journey: Journey) -> str:
    """Make the whole file; numbers are written so that they read back to the same bits."""
    numbers = np.column_stack(
        (
            journey.inputs,
            journey.positions,
            journey.velocities,
            journey.accelerations,
            journey.headings,
            journey.motion.root_positions,
            journey.motion.rotations[:, 0],
        )
    ).tolist()
    rows = [
        f"{frame},{time!r},{motion},{segment},{','.join(map(repr, row))},{left:d},{right:d},{'+'.join(clamped)}"
        for frame, (time, motion, segment, row, (left, right), clamped) in enumerate(
            zip(
                journey.times.tolist(),
                journey.motions,
                journey.groups,
                numbers,
                journey.planted.tolist(),
                journey.clamped,
                strict=True,
            )
        )
    ]
    return "\n".join([",".join(COLUMNS), *rows, ""])


def write_trace(path: str | Path, journey: Journey) -> None:
    """Write a walk as CSV, beside its place and then renamed.

    Parameters
    ----------
    path
        The file.
    journey
        The walk; one row a frame, columns are ``COLUMNS``.

    Raises
    ------
    FileError
        The file system refuses; what was there is untouched.
    """
    with replacing(path) as file:
        file.write(trace_text(journey).encode())
