"""``stridecast build``: recordings to a motion database."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer


def build(
    sources: Annotated[
        list[Path],
        typer.Argument(help="Recordings (BVH, AMC with its ASF, AMASS, C3D) and folders of them.", show_default=False),
    ],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="DB.safetensors", help="The database to write.", show_default=False),
    ],
    rate: Annotated[float, typer.Option(metavar="HZ", help="Frames a second of what will be synthesised.")] = 30.0,
    skeleton: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="BVH or ASF file whose body plays all motion; else that of the most recorded person."
        ),
    ] = None,
    scale: Annotated[
        float | None, typer.Option(metavar="M_PER_UNIT", help="Metres per unit of the files; else found out for each.")
    ] = None,
    input_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Frames a second of files that do not say (AMC); else 120.")
    ] = None,
    body_model: Annotated[
        Path | None,
        typer.Option(metavar="MODEL.npz", help="Body model of SMPL for AMASS files; else they get a mean skeleton."),
    ] = None,
    mirror: Annotated[bool, typer.Option("--mirror/--no-mirror", help="Learn from mirror images too.")] = True,
    bounds: Annotated[
        str,
        typer.Option(metavar="balanced|paper", help="Bounds from balanced samples, or the paper's plain percentile."),
    ] = "balanced",
    jobs: Annotated[int | None, typer.Option(metavar="N", help="Processes at work; else one a core.")] = None,
    cache: Annotated[
        bool, typer.Option("--cache/--no-cache", help="Remember what is found out about each take for the next build.")
    ] = True,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing unless something is wrong.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
) -> None:
    """Learn a motion database from recordings."""
    from stridecast.building.build import build as build_database
    from stridecast.cli import report, screen
    from stridecast.errors import FileError
    from stridecast.formats.files import check_place
    from stridecast.formats.store import save_database

    if output.suffix.lower() != ".safetensors":
        raise FileError("a motion database is a *.safetensors file", path=output)
    check_place(output)
    began = time.monotonic()
    words = {"read": "reading takes", "analyse": "analysing takes", "assemble": "learning bounds and groups"}
    with screen.progress(quiet, words) as progress:
        database = build_database(
            sources,
            skeleton=skeleton,
            frame_rate=rate,
            mirror=mirror,
            bounds=bounds,
            jobs=jobs,
            scale=scale,
            input_rate=input_rate,
            body_model=body_model,
            cache=cache,
            progress=progress,
        )
        save_database(database, output)
    seconds = time.monotonic() - began
    if as_json:
        screen.print_json({"output": str(output), **report.as_json(database)})
    elif not quiet:
        report.tell_left_out(database, screen.out)
        report.tell_sum(database, screen.out)
        screen.out.print(f"written to [bold]{output}[/] ({output.stat().st_size / 1e6:.1f} MB) in {seconds:.1f} s")
