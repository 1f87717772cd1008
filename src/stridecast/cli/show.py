"""``stridecast show``: what a motion database has learned."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def show(
    database: Annotated[Path, typer.Argument(metavar="DB", help="A motion database.", show_default=False)],
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False,
) -> None:
    """Show what a motion database has learned: groups, bounds, coverage, people, and what was left out."""
    from stridecast.cli import report, screen
    from stridecast.formats.store import load_database

    content = load_database(database)
    if as_json:
        screen.print_json(report.as_json(content))
    else:
        report.tell(content, screen.out)
