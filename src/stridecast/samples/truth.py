"""What is true of every frame of a sample take, as CSV: for judging what an analysis finds in its motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from stridecast.samples.performance import SampleTake

COLUMNS = ("frame", "time", "x", "z", "heading", "speed", "phase", "left_planted", "right_planted")
"""The columns. Metres, seconds, radians, metres a second; 1 where a foot is planted, else 0."""


def truth_text(take: SampleTake) -> str:
    """Make the whole file; numbers are written so that they read back to the same bits."""
    times = np.arange(take.motion.frames) / take.motion.frame_rate
    numbers = np.column_stack((times, take.positions, take.headings, take.speeds, take.phases)).tolist()
    rows = [
        f"{frame},{','.join(map(repr, row))},{left:d},{right:d}"
        for frame, (row, (left, right)) in enumerate(zip(numbers, take.planted.tolist(), strict=True))
    ]
    return "\n".join([",".join(COLUMNS), *rows, ""])
