"""``stridecast walk``: let a character follow points, a curve or a path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stridecast.cli.databases import Database, open_database

if TYPE_CHECKING:
    from stridecast.synthesis.journey import Journey, PointStream

SPEEDS = {"stand": 1.3, "walk": 1.3, "run": 3.0}
"""Usual speed along curves and paths, m/s."""

OUTPUTS = (".bvh",)


def walk(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="OUT.bvh", help="The motion to write.", show_default=False)
    ],
    database: Database = None,
    points: Annotated[
        Path | None, typer.Option("--input", metavar="POINTS.csv", help="Samples to follow: time,x,z[,motion].")
    ] = None,
    curve: Annotated[
        str | None,
        typer.Option(metavar="NAME:SIZE", help="Curve to follow: line:6, circle:3, eight:2 or square:5 (metres)."),
    ] = None,
    path: Annotated[Path | None, typer.Option(metavar="PATH.csv", help="Path to follow: x,z.")] = None,
    trace: Annotated[
        Path | None, typer.Option(metavar="TRACE.csv", help="Also write what happened in every frame.")
    ] = None,
    motion: Annotated[
        str, typer.Option(metavar="stand|walk|run", help="Motion where the input does not name one.")
    ] = "walk",
    speed: Annotated[
        float | None, typer.Option(metavar="M_PER_S", help="Along a curve or path; else 1.3 to walk, 3 to run.")
    ] = None,
    subject: Annotated[str | None, typer.Option(help="Move in the manner of this person of the database.")] = None,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Frames a second; else the database's.")] = None,
    half_life: Annotated[
        float | None, typer.Option(metavar="S", help="How fast it closes in on the point; else 0.22.")
    ] = None,
    damping_ratio: Annotated[
        float | None, typer.Option(help="1 comes to rest at the point, less swings past it; else 1.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing unless something is wrong.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Let a character follow points, a curve or a path, and write its motion.

    Name one of --input, --curve and --path.
    """
    from stridecast.errors import FileError, InputError

    if sum(given is not None for given in (points, curve, path)) != 1:
        raise InputError("name exactly one of --input, --curve and --path")
    if points is not None and speed is not None:
        raise InputError("--speed goes with --curve and --path; the points of --input carry their own times")
    if motion not in SPEEDS:
        raise InputError(f"there is no motion {motion!r}; there are {', '.join(SPEEDS)}")
    if trace is not None and trace.absolute() in {p.absolute() for p in (output, points, path, database) if p}:
        raise FileError("the trace would overwrite another file of this walk", path=trace)

    from stridecast.cli import screen
    from stridecast.formats.bvh import write_bvh
    from stridecast.formats.files import check_place, replacing
    from stridecast.formats.trace import trace_text
    from stridecast.steering.force import SteeringGains
    from stridecast.synthesis.journey import follow

    if output.suffix.lower() not in OUTPUTS:
        raise FileError(f"motion is written as {', '.join(f'*{s}' for s in OUTPUTS)}", path=output)
    for place in (output, trace):
        if place is not None:
            check_place(place)
    gains = SteeringGains(
        **{
            name: value
            for name, value in (("half_life", half_life), ("damping_ratio", damping_ratio))
            if value is not None
        }
    )
    stream = _stream(points, curve, path, motion, SPEEDS[motion] if speed is None else speed)
    learned = open_database(database, quiet=quiet)
    with screen.progress(quiet, {"walk": f"{motion}ing" if motion != "run" else "running"}) as progress:
        journey = follow(
            learned,
            stream,
            subject=subject,
            gains=gains,
            frame_rate=rate,
            progress=lambda done, total: progress("walk", done, total),
        )
    if trace is None:
        write_bvh(output, journey.motion)
    else:
        with replacing(trace) as file:  # takes its place only once the motion has been written too
            file.write(trace_text(journey).encode())
            write_bvh(output, journey.motion)
    summary = _summary(journey, output, trace)
    if as_json:
        screen.print_json(summary)
    elif not quiet:
        said = "{frames} frames, {seconds:.1f} s, {metres:.1f} m, at most {fastest:.2f} m/s".format_map(summary)
        made_up = f", {journey.made_up} transitions made up" if journey.made_up else ""
        screen.out.print(f"{said}{made_up}: [bold]{output}[/]" + (f", {trace}" if trace else ""))


def _stream(points: Path | None, curve: str | None, path: Path | None, motion: str, speed: float) -> PointStream:
    """Make a stream of points of whatever was given."""
    import numpy as np

    from stridecast.errors import InputError
    from stridecast.formats.points import LONGEST, read_path, read_points
    from stridecast.steering.curves import named_curve
    from stridecast.synthesis.journey import stream_along

    if points is not None:
        return read_points(points, motion)
    way = read_path(path) if path is not None else named_curve(curve or "")
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=-1).sum())
    if speed > 0 and length / speed > LONGEST:
        raise InputError(f"{length:.6g} m at {speed:g} m/s take more than two hours; go faster, or less far")
    return stream_along(way, speed, motion=motion)


def _summary(journey: Journey, output: Path, trace: Path | None) -> dict[str, object]:
    import numpy as np

    steps = np.linalg.norm(np.diff(journey.positions, axis=0), axis=-1)
    return {
        "output": str(output),
        "trace": None if trace is None else str(trace),
        "frame_rate": journey.motion.frame_rate,
        "frames": journey.motion.frames,
        "seconds": journey.motion.seconds,
        "metres": float(steps.sum()),
        "fastest": float(np.linalg.norm(journey.velocities, axis=-1).max()),
        "made_up": journey.made_up,
    }
