"""``stridecast dress``: bodies for trajectories of simulators and trackers."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stridecast.cli.bodies import (
    BvhOptions,
    CharacterOption,
    CompactOption,
    height_of,
    open_character,
    played,
    with_bvh_options,
)
from stridecast.cli.databases import DatabaseOption, open_database

if TYPE_CHECKING:
    from stridecast.crowd.dressing import DressedPerson
    from stridecast.crowd.human import TrackReport
    from stridecast.formats.crowd_files import CrowdFiles
    from stridecast.model.skeleton import Skeleton

WORST_SHOWN = 3
"""So many people are named whose trajectories no person could have walked."""


@with_bvh_options
def dress(
    *,
    trajectories: Annotated[
        Path, typer.Argument(metavar="TRAJECTORIES", help="CSV, Parquet, JuPedSim's SQLite, Juelich's or ETH's text.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT.bvh|.glb|.usd[a|c]|.csv|.parquet",
            help="A BVH for each person (OUT.ID.bvh, OUT.people.csv), or one USD scene; or only where they were.",
            show_default=False,
        ),
    ],
    database: DatabaseOption = None,
    format: Annotated[
        str | None,
        typer.Option(metavar="csv|parquet|jupedsim|juelich|eth", help="Format; else what the file looks like."),
    ] = None,
    input_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Rate of a file that counts frames; instead of what it tells.")
    ] = None,
    unit: Annotated[str | None, typer.Option(metavar="m|cm|mm", help="Unit of length of the file.")] = None,
    noise: Annotated[
        float | None, typer.Option(metavar="M", help="Noise of the positions; else each person's is estimated.")
    ] = None,
    height: Annotated[float | None, typer.Option(metavar="M", help="Of all bodies; else that of the database.")] = None,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Frames a second; else the database's.")] = None,
    threads: Annotated[int, typer.Option(metavar="N", help="Threads; the result does not depend on it.")] = 1,
    compact: CompactOption = False,
    skeleton: CharacterOption = None,
    bvh: BvhOptions,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing unless something is wrong.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a report as JSON.")] = False,
) -> None:
    """Put full bodies on trajectories, as near to them as a person can walk, and write their motions as BVH or USD.

    Noise, sway and what no person can do are taken out; the report tells how far that leads away from the source.
    """
    from stridecast.cli import screen
    from stridecast.crowd.bodies import person_height
    from stridecast.crowd.dressing import dress_each, summed
    from stridecast.errors import FileError, InputError
    from stridecast.formats.crowd_files import CrowdFiles
    from stridecast.formats.trajectories import load_trajectories

    if threads < 1:
        raise InputError(f"at least 1 thread is needed, not {threads}")
    convention = bvh.convention(output)
    character = open_character(skeleton, output)
    files = CrowdFiles(output, convention=convention, compact=compact, character=skeleton)
    if trajectories.absolute() in {path.absolute() for path in files.files}:
        raise FileError("would be overwritten by the result; name another output", path=trajectories)
    with screen.progress(quiet, {}):  # for what the package has to say about the file
        source = load_trajectories(trajectories, frame_rate=input_rate, unit=unit, format=format)
    learned = open_database(database, quiet=quiet)
    size = 1.0 if height is None else height / person_height(learned)
    tall = size * height_of(learned.skeleton if character is None else character, learned.skeleton)
    people: list[dict[str, Any]] = []
    reports: list[TrackReport] = []
    with screen.progress(quiet, {"dress": "dressing rows"}) as progress:
        each = dress_each(
            learned,
            source,
            frame_rate=rate,
            noise=noise,
            heights=height,
            threads=threads,
            bodies=files.bodies,
            progress=lambda done, total: progress("dress", done, total),
        )
        try:
            with files:
                for one in each:
                    reports.append(one.report)
                    people.append(_write(files, one, character, size, tall, rate or learned.frame_rate))
        finally:
            if files.kept:
                screen.tell_kept(files.kept, files.motions)
    report = _report(people, summed(reports), files, rate or learned.frame_rate)
    if as_json:
        screen.print_json(report)
    elif not quiet:
        _tell(report, files)


def _write(
    files: CrowdFiles, one: DressedPerson, character: Skeleton | None, size: float, height: float, rate: float
) -> dict[str, Any]:
    """Write somebody down; what there is to say of them."""
    import numpy as np

    v = one.vehicle
    times = one.start + np.arange(one.frames) / rate
    ids = np.full(one.frames, one.person)
    files.add_rows(ids, times, v.position, np.asarray(v.heading), np.linalg.norm(v.velocity, axis=-1))
    file = None
    if one.motion is not None and one.planted is not None:
        motion = played(one.motion, character, one.planted, size=size)
        file = str(files.add_motion(one.person, str(one.person), one.start, motion, height, planted=one.planted))
    return {"person": one.person, "start": one.start, "frames": one.frames, "file": file, **asdict(one.report)}


def _report(people: list[dict[str, Any]], total: TrackReport, files: CrowdFiles, rate: float) -> dict[str, Any]:
    return {
        "output": [str(path) for path in files.files],
        "frame_rate": rate,
        "people": len({one["person"] for one in people}),
        "frames": sum(one["frames"] for one in people),
        **asdict(total),
        "each": people,
    }


def _tell(report: dict[str, Any], files: CrowdFiles) -> None:
    from rich.markup import escape

    from stridecast.cli import screen

    each, mean, most = report["each"], 100 * report["mean_distance"], 100 * report["largest_distance"]
    seconds = report["frames"] / report["frame_rate"]
    motions = f"{len(files.motions)} BVH, " if files.motions else ""
    names = ", ".join(str(path) for path in files.files)
    screen.out.print(f"{report['people']} people, {seconds:.1f} s of them: {motions}[bold]{escape(names)}[/]")
    screen.out.print(
        f"{mean:.1f} cm from the source on average, {most:.1f} cm at most (noise of about "
        f"{100 * report['noise']:.1f} cm taken out)"
    )
    beyond = ", ".join(f"{name} {count}" for name, count in report["beyond"].items() if count)
    if beyond:
        screen.out.print(f"samples of {report['samples']} at which no person could do what the source does: {beyond}")
    if report["frames_away"]:
        worst = sorted((one for one in each if one["frames_away"]), key=lambda one: -one["frames_away"])
        named = ", ".join(f"{one['person']} ({one['frames_away']})" for one in worst[:WORST_SHOWN])
        screen.out.print(
            f"frames of {report['frames']} more than 10 cm away, as it was not humanly possible: "
            f"{report['frames_away']}, most of person {named}"
        )
