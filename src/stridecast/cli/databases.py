"""The database that a command works with: the one that is named, else the sample database."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from stridecast.model.database import MotionDatabase

Database = Annotated[
    Path | None,
    typer.Argument(metavar="DB", help="A motion database; the sample database if left out.", show_default=False),
]
"""The argument that names it."""

DatabaseOption = Annotated[
    Path | None,
    typer.Option("--database", metavar="DB", help="A motion database; the sample database if left out."),
]
"""The same as an option."""


def open_database(path: Path | None, *, quiet: bool = False) -> MotionDatabase:
    """Load the database that is named, else the sample database, which may have to be made first.

    Parameters
    ----------
    path
        As named.
    quiet
        Show no progress.

    Raises
    ------
    DatabaseFileError
        As of ``load_database``.
    """
    if path is not None:
        from stridecast.formats.store import load_database

        return load_database(path)

    from stridecast.cli import screen
    from stridecast.samples.library import sample_database

    words = {
        "make": "making sample takes",
        "analyse": "analysing sample takes",
        "assemble": "learning bounds and groups",
    }
    with screen.progress(quiet, words) as progress:
        return sample_database(progress=progress)
