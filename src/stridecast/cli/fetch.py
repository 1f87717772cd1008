"""``stridecast fetch``: real recordings from the web, and a motion database of them."""

from __future__ import annotations

import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from stridecast.model.database import MotionDatabase
    from stridecast.samples.recordings import RecordingSet


def fetch(
    name: Annotated[
        str | None,
        typer.Argument(metavar="SET", help="What to fetch, such as cmu; left out, all there is is listed."),
    ] = None,
    folder: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where to put it; else the user's data folder.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DB.safetensors", help="The database to write; else one in the folder."),
    ] = None,
    build: Annotated[bool, typer.Option("--build/--no-build", help="Learn a motion database of it.")] = True,
    mirror: Annotated[
        str | None, typer.Option(metavar="URL", help="Fetch from a copy of the folder at this address.")
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(metavar="N", help="Downloads at once, then processes at work; else 4, then one a core."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing unless something is wrong.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Download real recordings, and learn a motion database of them.

    What is there already is not downloaded again, and a download that was cut goes on where it stopped.
    """
    from stridecast.cli import report, screen
    from stridecast.errors import FileError, InputError
    from stridecast.formats.files import check_place
    from stridecast.samples.recordings import SETS, find_set

    if name is None:
        _list(list(SETS.values()), as_json)
        return
    chosen = find_set(name)
    place = folder or chosen.home
    if output is not None:
        if not build:
            raise InputError("--output is the place of the database, and --no-build asks for none; leave out one")
        if output.suffix.lower() != ".safetensors":
            raise FileError("a motion database is a *.safetensors file", path=output)
        check_place(output)
    tell = not (quiet or as_json)
    downloaded = _download(chosen, place, mirror, jobs, quiet)
    if tell:
        _tell_download(chosen, place, downloaded)
    database = None
    if build:
        output = output or place / f"{name}.safetensors"
        check_place(output)
        database = _build(chosen, place, output, jobs, quiet, tell)
    if as_json:
        summary = {
            "set": name,
            "folder": str(place),
            "files": len(chosen.files),
            "bytes": chosen.size,
            "downloaded": downloaded,
            "credit": chosen.credit,
            "terms": chosen.terms,
            "output": None if output is None else str(output),
        }
        screen.print_json(summary if database is None else {**summary, **report.as_json(database)})
    elif tell:
        step = ["build", place, "-o", f"{name}.safetensors"] if output is None else ["walk", output, *EIGHT]
        screen.out.print(f"next: stridecast {shlex.join(map(str, step))}", markup=False, soft_wrap=True)


EIGHT = ("--curve", "eight:2", "-o", "eight.bvh")
"""A walk to begin with."""


def _list(sets: list[RecordingSet], as_json: bool) -> None:
    """Show what can be fetched."""
    from stridecast.cli import screen

    if as_json:
        listed = [{"set": s.name, "files": len(s.files), "bytes": s.size, "about": s.about} for s in sets]
        screen.print_json({"sets": listed})
        return
    for each in sets:
        size = f"{len(each.files)} files, {each.size / 1e6:.1f} MB"
        screen.out.print(f"[bold]{each.name}[/]  {each.about}; {size}", soft_wrap=True)


def _download(chosen: RecordingSet, place: Path, mirror: str | None, jobs: int | None, quiet: bool) -> int:
    from stridecast.cli import screen
    from stridecast.samples.download import AT_ONCE
    from stridecast.samples.recordings import bring

    units = {"files": 1, "bytes": 1000}
    with screen.progress(quiet, {"files": "files", "bytes": "kilobytes"}) as progress:
        return bring(
            chosen,
            place,
            mirror=mirror,
            jobs=AT_ONCE if jobs is None else jobs,
            progress=lambda stage, done, total: progress(stage, done // units[stage], total // units[stage]),
        )


def _tell_download(chosen: RecordingSet, place: Path, downloaded: int) -> None:
    from rich.markup import escape

    from stridecast.cli import screen

    files, where = len(chosen.files), f"[bold]{escape(str(place))}[/]"
    if downloaded == 0:
        said = f"all {files} files are there already, nothing was downloaded: {where}"
    else:
        kept = f", {files - downloaded} were there already" if downloaded < files else ""
        said = f"{downloaded} files downloaded{kept} ({chosen.size / 1e6:.1f} MB in all): {where}"
    for line in (said, f"[bold]{escape(chosen.credit)}[/]", escape(chosen.terms)):
        screen.out.print(line, soft_wrap=True)


def _build(
    chosen: RecordingSet, place: Path, output: Path, jobs: int | None, quiet: bool, tell: bool
) -> MotionDatabase:
    from rich.markup import escape

    from stridecast.building.build import build
    from stridecast.cli import report, screen
    from stridecast.formats.store import save_database

    began = time.monotonic()
    words = {"read": "reading takes", "analyse": "analysing takes", "assemble": "learning bounds and groups"}
    with screen.progress(quiet, words) as progress:
        database = build(chosen.takes_in(place), jobs=jobs, progress=progress)
        save_database(database, output)
    if tell:
        report.tell_sum(database, screen.out)
        seconds, size = time.monotonic() - began, output.stat().st_size / 1e6
        said = f"written to [bold]{escape(str(output))}[/] ({size:.1f} MB) in {seconds:.1f} s"
        screen.out.print(said, soft_wrap=True)
    return database
