"""What the user sees: results on stdout; progress, notes and errors on stderr."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)

WIDE = 140
"""Width of tables that go to a file or a pipe."""

if not out.is_terminal:
    out.width = max(out.width, WIDE)


def tell_error(message: str) -> None:
    """One line on stderr."""
    err.print("[bold red]error:[/]", end=" ")
    err.print(message, markup=False, soft_wrap=True)


def tell_note(message: str) -> None:
    """Something worth knowing, on stderr."""
    err.print("[yellow]note:[/]", end=" ")
    err.print(message, markup=False, soft_wrap=True)


def tell_kept(parts: Sequence[Path], motions: Sequence[Path]) -> None:
    """Say what is left of something that was not finished."""
    finished = f", and {len(motions)} BVH ({motions[-1].name} is the last)" if motions else ""
    tell_note(f"what was written so far stays in {', '.join(map(str, parts))}{finished}")


def print_json(content: Mapping[str, object]) -> None:
    """One JSON object on stdout."""
    out.print(json.dumps(content, indent=2), markup=False, soft_wrap=True)


@contextmanager
def progress(quiet: bool, words: Mapping[str, str]) -> Iterator[Callable[[str, int, int], None]]:
    """Show a bar for each stage, and what the package logs above it.

    Parameters
    ----------
    quiet
        Show only errors.
    words
        What is said for each stage.

    Yields
    ------
    A function that is called with a stage, how much is done, and how much there is.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bars = Progress(*columns, console=err, disable=quiet or not err.is_terminal)
    tasks = {}

    def show(stage: str, done: int, total: int) -> None:
        if stage not in tasks:
            tasks[stage] = bars.add_task(words[stage], total=total)
        bars.update(tasks[stage], completed=done, total=total)

    handler = _Notes(logging.ERROR if quiet else logging.WARNING)
    log = logging.getLogger("stridecast")
    log.addHandler(handler)
    try:
        with bars:
            yield show
    finally:
        log.removeHandler(handler)


class _Notes(logging.Handler):
    """Shows what the package logs."""

    def emit(self, record: logging.LogRecord) -> None:
        tell_note(record.getMessage())
