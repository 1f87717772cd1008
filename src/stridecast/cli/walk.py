"""``stridecast walk``: let a character follow points or a curve, or go along a path or through a scene."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stridecast.cli.bodies import (
    BvhOptions,
    CharacterOption,
    CompactOption,
    open_character,
    played,
    with_bvh_options,
)
from stridecast.cli.databases import Database, open_database

if TYPE_CHECKING:
    from stridecast.formats.vmc import VmcSender
    from stridecast.model.database import MotionDatabase
    from stridecast.model.motion import Motion
    from stridecast.model.scene import Scene
    from stridecast.paths.follow import PathWalk
    from stridecast.steering.force import SteeringGains
    from stridecast.synthesis.journey import Journey, PointStream

    Tell = Callable[[str, int, int], None]

SPEEDS = {"stand": 1.3, "walk": 1.3, "run": 3.0}
"""Usual speed along curves and paths, m/s."""

SLOWED_SHOWN = 5
"""So many places are told at which a plan is slower than asked for."""


@with_bvh_options
def walk(
    *,
    database: Database = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="OUT.bvh|.glb|.usd[a|c]", help="The motion to write.", show_default=False
        ),
    ] = None,
    points: Annotated[
        Path | None, typer.Option("--input", metavar="POINTS.csv", help="Samples to follow: time,x,z[,motion].")
    ] = None,
    curve: Annotated[
        str | None,
        typer.Option(metavar="NAME:SIZE", help="Curve to follow: line:6, circle:3, eight:2 or square:5 (metres)."),
    ] = None,
    path: Annotated[Path | None, typer.Option(metavar="PATH.csv", help="Path to go along, planned ahead: x,z.")] = None,
    scene: Annotated[
        Path | None, typer.Option(metavar="SCENE.yaml", help="Scene to go through: roads, obstacles, start, goals.")
    ] = None,
    trace: Annotated[
        Path | None, typer.Option(metavar="TRACE.csv", help="Also write what happened in every frame.")
    ] = None,
    motion: Annotated[
        str | None, typer.Option(metavar="stand|walk|run", help="Motion where the input does not name one; else walk.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(metavar="M_PER_S", help="Along a curve or path; else 1.3 to walk, 3 to run.")
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(metavar="calm|neutral|lively|exaggerated", help="Size of movement; else that of the scene."),
    ] = None,
    style: Annotated[
        str | None,
        typer.Option(metavar="gloomy|neutral|brisk|NUMBER", help="Mood, -1 to 1; else that of the scene, or neutral."),
    ] = None,
    subject: Annotated[str | None, typer.Option(help="Move in the manner of this person of the database.")] = None,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Frames a second; else the database's.")] = None,
    half_life: Annotated[
        float | None, typer.Option(metavar="S", help="How fast it closes in on the point; else 0.22.")
    ] = None,
    damping_ratio: Annotated[
        float | None, typer.Option(help="1 comes to rest at the point, less swings past it; else 1.")
    ] = None,
    vmc: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Play it in real time to a receiver of the VMC protocol.")
    ] = None,
    compact: CompactOption = False,
    skeleton: CharacterOption = None,
    bvh: BvhOptions,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing unless something is wrong.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Let a character follow points or a curve, or go along a path or through a scene, and write or play its motion.

    Name one of --input, --curve, --path and --scene. Points and curves are followed as if by hand; the speed along a
    path or through a scene is planned ahead, so that its shape is kept.
    """
    from stridecast.errors import FileError, InputError

    if output is None and vmc is None:
        raise InputError("name a file to write with --output, or a receiver with --vmc")
    _check(points, curve, path, scene, motion, speed, half_life, damping_ratio)
    ways = (output, points, path, scene, database, skeleton)
    if trace is not None and trace.absolute() in {p.absolute() for p in ways if p}:
        raise FileError("the trace would overwrite another file of this walk", path=trace)

    from stridecast.cli import screen
    from stridecast.formats.files import check_place, replacing
    from stridecast.formats.motion_files import check_motion_place, write_motion
    from stridecast.formats.trace import trace_text

    if output is not None:
        check_motion_place(output, compact=compact)
    if trace is not None:
        check_place(trace)
    sender = None if vmc is None else _sender(vmc)
    convention = bvh.convention(output)
    character = open_character(skeleton, output)
    how: dict[str, Any] = {"subject": subject, "frame_rate": rate, "size": size}
    if style is not None:
        how["style"] = _style(style)
    walked: PathWalk | None = None
    words = {"way": "finding a way", "walk": "walking"}
    if path is not None or scene is not None:
        task = _scene(scene) if scene is not None else _task(path, motion, speed)
        learned = open_database(database, quiet=quiet)
        with screen.progress(quiet, words) as progress:
            walked = _planned(learned, task, path, how, progress)
        journey = walked.journey
    else:
        gains = _gains(half_life, damping_ratio)
        stream = _stream(points, curve, motion or "walk", speed)
        learned = open_database(database, quiet=quiet)
        with screen.progress(quiet, words) as progress:
            journey = _followed(learned, stream, gains, how, progress)
    journey = replace(journey, motion=played(journey.motion, character, journey.planted))
    with replacing(trace) if trace is not None else nullcontext() as file:
        if file is not None:  # takes its place only once the motion has been written too
            file.write(trace_text(journey).encode())
        if output is not None:
            write_motion(
                output,
                journey.motion,
                planted=journey.planted,
                compact=compact,
                convention=convention,
                character=skeleton,
            )
    if sender is not None:
        with sender, screen.progress(quiet, {"play": "playing"}) as progress:
            _play(sender, journey.motion, progress)
    summary = _summary(journey, walked, output, trace)
    if as_json:
        screen.print_json(summary)
    elif not quiet:
        said = "{frames} frames, {seconds:.1f} s, {metres:.1f} m, at most {fastest:.2f} m/s".format_map(summary)
        made_up = f", {journey.made_up} transitions made up" if journey.made_up else ""
        where = [f"[bold]{output}[/]"] if output else []
        where += [str(trace)] if trace else []
        where += [f"played to {vmc}"] if vmc else []
        screen.out.print(f"{said}{made_up}: {', '.join(where)}")
        if walked is not None:
            _tell_plan(walked)


def _sender(address: str) -> VmcSender:
    from stridecast.formats.vmc import VmcSender, parsed_address

    return VmcSender(*parsed_address(address))


def _play(sender: VmcSender, motion: Motion, progress: Tell) -> None:
    """Send every frame when its time has come; one that is late is sent at once, none is left out."""
    from time import monotonic, sleep

    began = monotonic()
    for n, pose in enumerate(zip(motion.root_positions, motion.rotations, strict=True)):
        due = n / motion.frame_rate
        sleep(max(0.0, due - (monotonic() - began)))
        sender.send(motion.skeleton, pose, due)
        progress("play", n + 1, motion.frames)


def _check(
    points: Path | None,
    curve: str | None,
    path: Path | None,
    scene: Path | None,
    motion: str | None,
    speed: float | None,
    half_life: float | None,
    damping_ratio: float | None,
) -> None:
    """Refuse options that do not go together."""
    from stridecast.errors import InputError

    if sum(given is not None for given in (points, curve, path, scene)) != 1:
        raise InputError("name exactly one of --input, --curve, --path and --scene")
    if points is not None and speed is not None:
        raise InputError("--speed goes with --curve and --path; the points of --input carry their own times")
    if scene is not None and (speed is not None or motion is not None):
        raise InputError("--speed and --motion do not go with --scene; the scene's behavior says how to go")
    if (path or scene) and (half_life is not None or damping_ratio is not None):
        raise InputError("--half-life and --damping-ratio go with --input and --curve; what is planned needs no spring")
    if motion is not None and motion not in SPEEDS:
        raise InputError(f"there is no motion {motion!r}; there are {', '.join(SPEEDS)}")
    if path is not None and motion == "stand":
        raise InputError("nobody stands along a path; --motion is walk or run there")


def _gains(half_life: float | None, damping_ratio: float | None) -> SteeringGains:
    from stridecast.steering.force import SteeringGains

    given = {"half_life": half_life, "damping_ratio": damping_ratio}
    return SteeringGains(**{name: value for name, value in given.items() if value is not None})


def _style(text: str) -> float:
    from stridecast.synthesis.styles import style_numbers

    try:
        value: float | str = float(text)
    except ValueError:
        value = text
    return float(style_numbers(value, 1)[0])


def _followed(
    database: MotionDatabase, stream: PointStream, gains: SteeringGains, how: dict[str, Any], progress: Tell
) -> Journey:
    from stridecast.synthesis.journey import follow

    return follow(database, stream, gains=gains, progress=lambda done, total: progress("walk", done, total), **how)


def _scene(path: Path) -> Scene:
    from stridecast.formats.scenes import load_scene

    return load_scene(path)


def _task(path: Path | None, motion: str | None, speed: float | None) -> Scene:
    """Make a scene of a path: nothing but a start, a goal and a behavior."""
    from stridecast.errors import FileError, SceneError
    from stridecast.formats.points import read_path
    from stridecast.model.scene import Behavior, Scene

    way = read_path(path or "")
    status = motion or "walk"
    try:
        behavior = Behavior(velocity=SPEEDS[status] if speed is None else speed, status=status)
    except SceneError as error:
        raise FileError(str(error), path=path) from None
    return Scene(start=way[0], goals=way[-1:], behavior=behavior)


def _planned(database: MotionDatabase, task: Scene, path: Path | None, how: dict[str, Any], progress: Tell) -> PathWalk:
    """Go along a path, or find a way through a scene and go it."""
    from stridecast.formats.points import read_path
    from stridecast.paths.curve import Curve
    from stridecast.paths.follow import walk_along, walk_scene

    def walking(done: int, total: int) -> None:
        progress("walk", done, total)

    if path is not None:
        curve = Curve.through(read_path(path))
        return walk_along(database, curve, behavior=task.behavior, progress=walking, **how)
    finding = lambda share: progress("way", round(100 * share), 100)  # noqa: E731
    return walk_scene(database, task, finding=finding, progress=walking, **how)


def _tell_plan(walked: PathWalk) -> None:
    """Say how well the way was kept, and where it had to be slower than asked for."""
    from stridecast.cli import screen

    mean, most = 100 * walked.errors.mean(), 100 * walked.errors.max()
    screen.out.print(f"{walked.curve.length:.1f} m of way, kept within {mean:.1f} cm on average, {most:.1f} cm at most")
    for slow in walked.plan.slowed[:SLOWED_SHOWN]:
        why = "for the bend" if slow.why == "bend" else "as nobody in the database is faster"
        screen.out.print(
            f"  {slow.start:.1f} to {slow.stop:.1f} m: {slow.planned:.2f} instead of {slow.wished:.2f} m/s {why}"
        )
    if len(walked.plan.slowed) > SLOWED_SHOWN:
        screen.out.print(f"  and slower at {len(walked.plan.slowed) - SLOWED_SHOWN} more places")
    if not walked.arrived:
        screen.out.print("[yellow]it did not come to rest at the end[/]")


def _stream(points: Path | None, curve: str | None, motion: str, speed: float | None) -> PointStream:
    """Make a stream of points of whatever was given."""
    import numpy as np

    from stridecast.errors import InputError
    from stridecast.formats.points import LONGEST, read_points
    from stridecast.steering.curves import named_curve
    from stridecast.synthesis.journey import stream_along

    if points is not None:
        return read_points(points, motion)
    pace = SPEEDS[motion] if speed is None else speed
    way = named_curve(curve or "")
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=-1).sum())
    if pace > 0 and length / pace > LONGEST:
        raise InputError(f"{length:.6g} m at {pace:g} m/s take more than two hours; go faster, or less far")
    return stream_along(way, pace, motion=motion)


def _summary(journey: Journey, walked: PathWalk | None, output: Path | None, trace: Path | None) -> dict[str, object]:
    import numpy as np

    steps = np.linalg.norm(np.diff(journey.positions, axis=0), axis=-1)
    summary: dict[str, object] = {
        "output": None if output is None else str(output),
        "trace": None if trace is None else str(trace),
        "frame_rate": journey.motion.frame_rate,
        "frames": journey.motion.frames,
        "seconds": journey.motion.seconds,
        "metres": float(steps.sum()),
        "fastest": float(np.linalg.norm(journey.velocities, axis=-1).max()),
        "made_up": journey.made_up,
    }
    if walked is not None:
        summary |= {
            "way": walked.curve.length,
            "error_mean": float(walked.errors.mean()),
            "error_max": float(walked.errors.max()),
            "arrived": walked.arrived,
            "slowed": [asdict(slow) for slow in walked.plan.slowed],
        }
    return summary
