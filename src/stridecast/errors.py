"""Everything that can go wrong, as one tree.

::

    StridecastError                  whatever this package raises on purpose
    └── InputError (ValueError)      something handed in is wrong; the command ends with status 2
        ├── FileError                a file: where it is, which line, what would be right
        │   └── DatabaseFileError    a motion database that is damaged, missing or too new
        ├── SkeletonError            a skeleton that is no usable body (joints missing, no length)
        ├── MotionError              a motion that no person made (broken numbers, jumps)
        ├── TakeError                a take that cannot be learned from, with the reason
        ├── DatabaseError            a request that the database cannot answer
        ├── SceneError               a scene or behavior that makes no sense, with the place in it
        ├── PathError                no way through a scene, with what is in the way
        ├── DownloadError            a file on the web that does not come, with its address
        └── WishError                a point, force or motion name the walker rejects; its state is untouched

Messages say what was wrong, where, and what would be right.
"""

from __future__ import annotations


class StridecastError(Exception):
    """Base of every error this package raises on purpose."""


class InputError(StridecastError, ValueError):
    """Something handed in is wrong."""


class FileError(InputError):
    """A file that cannot be read or written.

    Parameters
    ----------
    message
        What was wrong and what would be right.
    path
        The file.
    line
        Line in it, counted from 1, where that is known.
    """

    def __init__(self, message: str, *, path: object = None, line: int | None = None) -> None:
        self.path = None if path is None else str(path)
        self.line = line
        where = "" if path is None else f"{path}: " if line is None else f"{path}:{line}: "
        super().__init__(where + message)


class DatabaseFileError(FileError):
    """A motion database file that is damaged, missing or written by a newer version."""


class SkeletonError(InputError):
    """A skeleton that is no usable body."""


class MotionError(InputError):
    """A motion that no person made: numbers that are not finite, jumps, wrong shapes."""


class TakeError(InputError):
    """A take that cannot be learned from."""


class DatabaseError(InputError):
    """A request that the motion database cannot answer."""


class DownloadError(InputError):
    """A file on the web that does not come, or comes with another content."""


class SceneError(InputError):
    """A scene or behavior that makes no sense: the message names the part of it."""


class PathError(InputError):
    """There is no way through a scene: the message names what is in the way."""


class WishError(InputError):
    """A wish (point, force, motion name, time) that is rejected; nothing has changed."""
