"""Blocks of decimal numbers, from text to arrays.

A recording is a few lines of names and then a million numbers, so reading a take means reading numbers. The digits are
gathered by one compiled loop; what is to be said about a word that is no number is said here, in Python.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from stridecast.errors import FileError
from stridecast.formats import number_kernels

_NOT_FINITE = re.compile(rb"[+-]?(nan(\([^)\s]*\))?|inf|infinity|1\.?#(inf|ind|qnan|snan)\d*)", re.IGNORECASE)
"""How C, Python, and Microsoft's runtime of old spell numbers that are none."""


class Numbers(NamedTuple):
    """Numbers of a block and the rows (lines of the block, counted from 0) they stand in."""

    values: Float[np.ndarray, "numbers"]
    rows: Int[np.ndarray, "numbers"]


def parse_numbers(block: bytes, *, path: str | Path, lines: Sequence[int]) -> Numbers:
    r"""Read a block of numbers separated by blanks, tabs and line ends.

    Parameters
    ----------
    block
        Text with line ends ``\n``. Decimals are read as Python's ``float`` reads them, to a relative 1e-15; spellings
        of infinity and of "not a number" give ``nan``, for the caller to place.
    path
        The file, for the error.
    lines
        Line of the file that each row of the block stands in, for the error.

    Raises
    ------
    FileError
        A word that is no number, with its line.
    """
    text = np.frombuffer(block, np.uint8)
    count = number_kernels.count_tokens(text)
    values, rows = np.empty(count), np.empty(count, np.int64)
    done, place, row = number_kernels.read(text, 0, 0, values, rows, 0)
    while done < count:
        word = block[place : place + 1000].split(None, 1)[0]
        if not _NOT_FINITE.fullmatch(word):
            shown = word[:40].decode("utf-8", "replace")
            hint = "; decimals need a point, not a comma" if re.fullmatch(rb"[+-]?\d+,\d+", word) else ""
            raise FileError(f"a number should stand here, not {shown!r}{hint}", path=path, line=lines[row])
        values[done], rows[done] = np.nan, row
        done, place, row = number_kernels.read(text, place + len(word), row, values, rows, done + 1)
    return Numbers(values, rows)
