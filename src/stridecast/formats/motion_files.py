"""One door for motions that are written: the ending of the file tells the format."""

from __future__ import annotations

from pathlib import Path

from stridecast.body.mannequin import mannequin
from stridecast.errors import FileError
from stridecast.formats.bvh import write_bvh
from stridecast.formats.bvh_conventions import BvhConvention
from stridecast.formats.files import check_place
from stridecast.formats.glb import check_compact, write_glb
from stridecast.formats.glb_character import write_character
from stridecast.formats.glb_figure import Planted
from stridecast.formats.recordings import GLB
from stridecast.formats.usd import ENDINGS as USD
from stridecast.formats.usd import check_usd, write_usd
from stridecast.model.motion import Motion

ENDINGS = (".bvh", ".glb", *USD)
"""Endings of files that a motion is written as."""


def check_motion_place(path: str | Path, *, compact: bool = False) -> None:
    """Raise the error that ``write_motion`` would raise, before the work whose result is to be written.

    Raises
    ------
    FileError
        Another ending, a library that is missing, a place where nothing can be written, or ``compact`` for what is no
        GLB.
    """
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise FileError(f"motion is written as {', '.join(f'*{known}' for known in ENDINGS)}", path=path)
    if ending in USD:
        check_usd(path)
    check_compact(path, compact)
    check_place(path)


def write_motion(
    path: str | Path,
    motion: Motion,
    *,
    planted: Planted | None = None,
    compact: bool = False,
    convention: str | BvhConvention = "plain",
    character: str | Path | None = None,
) -> None:
    """Write a motion as BVH, GLB or USD; errors are those of ``check_motion_place``.

    Parameters
    ----------
    path
        The file; its ending tells the format.
    motion
        The motion.
    planted
        Which feet stand at which frame; a GLB tells it.
    compact
        A GLB with rotations of 16 bits (see ``write_glb``).
    convention
        How BVH is written (see ``write_bvh``).
    character
        The file that the motion's skeleton is from; where both are GLB, its meshes are kept (see ``write_character``).
    """
    check_motion_place(path, compact=compact)
    ending = Path(path).suffix.lower()
    if ending in USD:
        write_usd(path, motion, skin=mannequin)
    elif ending == ".glb" and character is not None and Path(character).suffix.lower() in GLB:
        write_character(path, motion, character, compact=compact, planted=planted)
    elif ending == ".glb":
        write_glb(path, motion, planted=planted, compact=compact)
    else:
        write_bvh(path, motion, convention=convention)
