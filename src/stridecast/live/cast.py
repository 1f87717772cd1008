"""In whose body everybody walks, where it is that of a character's file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stridecast.body.character import Character, character_of
from stridecast.database.casting import cast_database
from stridecast.formats.glb_bones import Bones, bones_of
from stridecast.formats.recordings import GLB
from stridecast.model.database import MotionDatabase
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton


@dataclass(frozen=True, kw_only=True, eq=False)
class Costume:
    """A character who moves as the people of one database do.

    Parameters
    ----------
    file
        Where it is from.
    character
        Its skeleton and body.
    bones
        How the body poses the file, where that has meshes.
    """

    file: Path
    character: Character
    bones: Bones | None


def cast(
    database: MotionDatabase, file: Path, skeleton: Skeleton, progress: Callable[[int, int], None] | None = None
) -> tuple[MotionDatabase, Costume]:
    """A database as it is walked with in the body of a character, and the character.

    Parameters
    ----------
    database
        What was learned.
    file, skeleton
        The character's file, and the skeleton in it (``load_skeleton``).
    progress
        See ``cast_database``.

    Raises
    ------
    SkeletonError
        A joint of hips or legs is missing.
    FileError
        Its meshes are such that they cannot be carried over (see ``GlbRig``).
    """
    character = character_of(skeleton, database.skeleton)
    bones = bones_of(file, character) if file.suffix.lower() in GLB else None
    return cast_database(database, character.body, progress=progress), Costume(
        file=file, character=character, bones=bones
    )


def worn(costume: Costume | None, motion: Motion) -> Motion:
    """A motion on the character's whole skeleton, if there is one."""
    return motion if costume is None else costume.character.played(motion)


def meshes_of(costume: Costume | None) -> Path | None:
    """The file whose meshes people have, if there is one."""
    return None if costume is None or costume.bones is None else costume.file
