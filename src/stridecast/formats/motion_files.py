"""One door for motions that are written: the ending of the file tells the format."""

from __future__ import annotations

from pathlib import Path

from stridecast.errors import FileError
from stridecast.formats.bvh import write_bvh
from stridecast.formats.files import check_place
from stridecast.formats.usd import ENDINGS as USD
from stridecast.formats.usd import check_usd, write_usd
from stridecast.model.motion import Motion

ENDINGS = (".bvh", *USD)
"""Endings of files that a motion is written as."""


def check_motion_place(path: str | Path) -> None:
    """Raise the error that ``write_motion`` would raise, before the work whose result is to be written.

    Raises
    ------
    FileError
        Another ending, a library that is missing, or a place where nothing can be written.
    """
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise FileError(f"motion is written as {', '.join(f'*{known}' for known in ENDINGS)}", path=path)
    if ending in USD:
        check_usd(path)
    check_place(path)


def write_motion(path: str | Path, motion: Motion) -> None:
    """Write a motion as BVH or USD; errors are those of ``check_motion_place``."""
    check_motion_place(path)
    if Path(path).suffix.lower() in USD:
        write_usd(path, motion)
    else:
        write_bvh(path, motion)
