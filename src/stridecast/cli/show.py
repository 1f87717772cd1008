"""``stridecast show``: what a motion database has learned."""

from __future__ import annotations

from typing import Annotated

import typer

from stridecast.cli.databases import Database, open_database


def show(
    database: Database = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False,
) -> None:
    """Show what a motion database has learned: groups, bounds, coverage, people, and what was left out."""
    from stridecast.cli import report, screen

    content = open_database(database)
    if as_json:
        screen.print_json(report.as_json(content))
    else:
        report.tell(content, screen.out)
