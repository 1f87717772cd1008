"""``stridecast samples``: the sample takes as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from stridecast.samples.performance import SampleTake


def samples(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write them to.", show_default=False)
    ],
    style: Annotated[
        str | None, typer.Option(metavar="NAME", help="Only takes of this style, such as neutral; else all.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing unless something is wrong.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was written as JSON.")] = False,
) -> None:
    """Write the sample takes: each as BVH, and what is true of its frames as CSV."""
    from stridecast.cli import screen
    from stridecast.samples.corpus import sample_takes

    _check_folder(output)
    with screen.progress(quiet, {"make": "making sample takes", "write": "writing them"}) as progress:
        takes = _of_style(sample_takes(progress=lambda done, total: progress("make", done, total)), style)
        _make_folder(output)
        written: list[dict[str, object]] = []
        for take in takes:
            progress("write", len(written), len(takes))
            written.append(_write(take, output))
        progress("write", len(written), len(takes))
    if as_json:
        screen.print_json({"output": str(output), "takes": written})
    elif not quiet:
        seconds = sum(take.motion.seconds for take in takes)
        screen.out.print(
            f"{len(takes)} takes ({seconds:.0f} s) as BVH, each with what is true of it: [bold]{output}[/]"
        )


def _check_folder(path: Path) -> None:
    """Raise the error that writing to a folder would raise, before the work; the folder need not be there yet."""
    from tempfile import TemporaryFile

    from stridecast.errors import FileError

    there = path
    try:
        there = next(place for place in (path, *path.absolute().parents) if place.exists())
        if not there.is_dir():
            raise FileError("is a file; name a folder to write the takes to", path=there)
        with TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise FileError(f"no take can be written there: {error.strerror or error}", path=there) from error


def _make_folder(path: Path) -> None:
    from stridecast.errors import FileError

    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"the folder cannot be made: {error.strerror or error}", path=path) from error


def _of_style(takes: list[SampleTake], style: str | None) -> list[SampleTake]:
    from stridecast.errors import InputError

    styles = sorted({take.style for take in takes})
    if style is not None and style not in styles:
        raise InputError(f"there is no style {style!r}; there are {', '.join(styles)}")
    return [take for take in takes if style in (None, take.style)]


def _write(take: SampleTake, folder: Path) -> dict[str, object]:
    """Write a take and what is true of it, both or neither; tell what was written."""
    from stridecast.formats.bvh import write_bvh
    from stridecast.formats.files import replacing
    from stridecast.samples.truth import truth_text

    motion = take.motion
    bvh, truth = (folder / f"{motion.name}{suffix}" for suffix in (".bvh", ".truth.csv"))
    with replacing(truth) as file:  # takes its place only once the motion has been written too
        file.write(truth_text(take).encode())
        write_bvh(bvh, motion)
    told = {"name": motion.name, "style": take.style, "frames": motion.frames, "seconds": motion.seconds}
    return {**told, "bvh": str(bvh), "truth": str(truth)}
