"""``stridecast mine``: ask a motion database for a clip."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    from rich.table import Table

    from stridecast.database.mining import Mined, Number

CLIPS_SHOWN = 12
"""So many clips of a blend are shown."""


@with_bvh_options
def mine(
    *,
    database: Database = None,
    status: Annotated[
        str | None,
        typer.Option(
            metavar="NAME[,NAME]", help="stand, walk, run or a transition such as stand-walk; any if left out."
        ),
    ] = None,
    speed: Annotated[
        str | None, typer.Option(metavar="M_PER_S", help="A number, a range such as 1.2:1.5, or a list 1.2,1.4.")
    ] = None,
    turn: Annotated[
        str | None, typer.Option(metavar="RAD_PER_S", help="Turning to the left, likewise; straight on if left out.")
    ] = None,
    style: Annotated[
        str | None, typer.Option(help="gloomy, neutral, brisk, or from -1 to 1, likewise; as usual if left out.")
    ] = None,
    where: Annotated[
        str | None,
        typer.Option(metavar="CONDITION", help="Only clips that fit, such as \"take != '16_31' and cadence > 1.8\"."),
    ] = None,
    subject: Annotated[str | None, typer.Option(help="Only clips of this person.")] = None,
    cycles: Annotated[int | None, typer.Option(metavar="N", help="So many cycles; one if left out.")] = None,
    seconds: Annotated[float | None, typer.Option(metavar="S", help="So long, instead.")] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="OUT.bvh|.glb|.usd[a|c]", help="The motion to write.", show_default=False
        ),
    ] = None,
    compact: CompactOption = False,
    skeleton: CharacterOption = None,
    bvh: BvhOptions,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing unless something is wrong.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON.")] = False,
) -> None:
    """Ask for motion by status, speed, turn and style.

    A recorded clip that fits comes back as it is, else the nearest are blended. What nobody showed is answered by the
    nearest that somebody did.
    """
    from stridecast.cli import screen
    from stridecast.database.mining import mine as find
    from stridecast.formats.motion_files import check_motion_place, write_motion

    if output is not None:
        check_motion_place(output, compact=compact)
    convention = bvh.convention(output)
    character = open_character(skeleton, output)
    wish = {name: _number(name, text) for name, text in (("speed", speed), ("turn", turn), ("style", style))}
    learned = open_database(database, quiet=quiet)
    with screen.progress(quiet, {}):
        mined = find(
            learned,
            status=None if status is None else [name.strip() for name in status.split(",")],
            speed=wish["speed"],  # type: ignore[arg-type]  # words belong to style, and are refused elsewhere
            turn=wish["turn"],  # type: ignore[arg-type]
            style=wish["style"],
            where=where,
            subject=subject,
            cycles=cycles,
            seconds=seconds,
        )
    if output is not None:
        motion = played(mined.motion, character, mined.planted)
        write_motion(output, motion, planted=mined.planted, compact=compact, convention=convention, character=skeleton)
    if as_json:
        screen.print_json(_as_json(mined, output))
    elif not quiet:
        screen.out.print(_table(mined))
        screen.out.print(_sum(mined) + (f": [bold]{output}[/]" if output is not None else ""))


def _number(name: str, text: str | None) -> str | Number | None:
    """Read a number, a range or a list; words are left to be judged."""
    from stridecast.errors import InputError

    if text is None:
        return None
    low, is_range, high = text.partition(":")
    try:
        if is_range:
            return float(low), float(high)
        values = [float(part) for part in text.split(",")]
    except ValueError:
        if name == "style" and text.strip().isalpha():
            return text.strip()
        words = ", or gloomy, neutral, brisk" if name == "style" else ""
        raise InputError(
            f"--{name} must be a number, a range such as 1.2:1.5 or a list such as 1.2,1.4{words}, not {text!r}"
        ) from None
    return values[0] if len(values) == 1 else values


def _table(mined: Mined) -> Table:
    from rich.markup import escape
    from rich.table import Table

    table = Table("weight", "take", "person", "status")
    for name in ("speed, m/s", "turn, rad/s", "style", "seconds"):
        table.add_column(name, justify="right")
    for clip in mined.clips[:CLIPS_SHOWN]:
        table.add_row(
            f"{100 * clip.weight:.1f} %",
            escape(clip.take) + (" mirrored" if clip.mirrored else ""),
            escape(clip.subject),
            clip.status,
            *[f"{value + 0.0:.2f}" for value in (clip.speed, clip.turn, clip.style, clip.seconds)],
        )
    more = mined.clips[CLIPS_SHOWN:]
    if more:
        table.add_row(f"{100 * sum(clip.weight for clip in more):.1f} %", f"{len(more)} more")
    return table


def _sum(mined: Mined) -> str:
    how = "as recorded" if mined.recorded else f"blended of {len(mined.clips)} clips"
    cycle = f", cycle {mined.cycle:.2f} s" if mined.cycle else ""
    return (
        f"{mined.status} at {mined.speed:.2f} m/s, turning {mined.turn + 0.0:.2f} rad/s, style {mined.style:+.2f}"
        f"{cycle}, {how}; {mined.motion.frames} frames, {mined.motion.seconds:.2f} s"
    )


def _as_json(mined: Mined, output: Path | None) -> dict[str, object]:
    from dataclasses import asdict

    return {
        "output": None if output is None else str(output),
        "status": mined.status,
        "speed": mined.speed,
        "turn": mined.turn,
        "style": mined.style,
        "cycle": mined.cycle,
        "recorded": mined.recorded,
        "frame_rate": mined.motion.frame_rate,
        "frames": mined.motion.frames,
        "seconds": mined.motion.seconds,
        "clips": [asdict(clip) for clip in mined.clips],
        "warnings": list(mined.warnings),
    }
