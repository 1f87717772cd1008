"""``stridecast crowd``: let everybody in a scene walk, and write where they were, or their motions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    from stridecast.crowd.baking import Baking
    from stridecast.crowd.frame import CrowdFrame
    from stridecast.formats.crowd_files import CrowdFiles


@with_bvh_options
def crowd(
    *,
    scene: Annotated[Path, typer.Argument(metavar="SCENE.yaml", help="The place, who is there and who comes.")],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT.csv|.parquet|.bvh|.glb|.usd[a|c]",
            help="Where everybody was; with a BVH for each (OUT.NAME.bvh, OUT.people.csv), or one USD scene of all.",
            show_default=False,
        ),
    ],
    database: DatabaseOption = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            metavar="S", help="How long; else as the scene says, else until all have left (10 minutes at most)."
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Of all chance; else that of the scene.")] = None,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Frames a second; else the database's.")] = None,
    threads: Annotated[int, typer.Option(metavar="N", help="Threads; the result does not depend on it.")] = 1,
    compact: CompactOption = False,
    skeleton: CharacterOption = None,
    bvh: BvhOptions,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing unless something is wrong.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Let everybody in a scene walk and avoid each other, and write where they were, or their motions as BVH or USD.

    What is written is written as it comes: if it is interrupted, OUT.part.csv and the BVH of all who have left stay.
    """
    from stridecast.cli import screen
    from stridecast.crowd.baking import Baking
    from stridecast.crowd.bodies import person_height
    from stridecast.crowd.crowd import Crowd
    from stridecast.errors import InputError
    from stridecast.formats.crowd_files import CrowdFiles
    from stridecast.formats.scenes import load_scene

    if threads < 1:
        raise InputError(f"at least 1 thread is needed, not {threads}")
    if seed is not None and not 0 <= seed < 2**32:
        raise InputError(f"--seed must be a whole number from 0 to {2**32 - 1}, not {seed}")
    place = load_scene(scene)
    convention = bvh.convention(output)
    character = open_character(skeleton, output)
    files = CrowdFiles(output, movers=len(place.movers), convention=convention, compact=compact, character=skeleton)
    learned = open_database(database, quiet=quiet)
    usual = person_height(learned)
    tall = usual if character is None else height_of(character, learned.skeleton)
    with screen.progress(quiet, {"ways": "finding ways", "bake": "walking"}) as progress:
        people = Crowd(
            learned,
            place,
            seed=seed,
            bodies=files.bodies,
            frame_rate=rate,
            threads=threads,
            progress=lambda done, total: progress("ways", done, total),
        )
        baking = Baking(people, seconds=seconds)
        try:
            with files:
                for baked in baking:
                    _write_frame(files, baked.frame)
                    for one in baked.finished:
                        if one.motion is None or one.planted is None:
                            continue
                        size = people.height(one.number) / usual
                        motion = played(one.motion, character, one.planted, size=size)
                        files.add_motion(
                            one.number, one.person.name, one.start, motion, size * tall, planted=one.planted
                        )
                    done = baking.tally.frames
                    progress("bake", done, done if baked.last else baking.frames)
        finally:
            if files.kept:
                screen.tell_kept(files.kept, files.motions)
    tally = baking.tally
    if as_json:
        screen.print_json(_summary(baking, files))
    elif not quiet:
        _tell(baking, files)
    if tally.overlaps:
        screen.tell_note(
            f"bodies overlapped {tally.overlaps} times, by up to {100 * tally.deepest:.2g} cm: this should never be"
        )


def _write_frame(files: CrowdFiles, frame: CrowdFrame) -> None:
    import numpy as np

    speeds = np.linalg.norm(frame.velocities, axis=-1)
    files.add_rows(frame.ids, np.full(len(frame.ids), frame.time), frame.positions, frame.headings, speeds)
    if len(frame.movers):
        files.add_movers(frame.time, frame.movers)


def _tell(baking: Baking, files: CrowdFiles) -> None:
    from rich.markup import escape

    from stridecast.cli import screen

    tally, rate = baking.tally, baking.crowd.frame_rate
    waiting = f", {tally.waiting} waiting outside for room" if tally.waiting else ""
    if tally.turned_away:
        waiting += f", {tally.turned_away} stayed out as there is no way for them"
    screen.out.print(
        f"{tally.came} people came, {tally.arrived} arrived, {tally.there} still there{waiting}; "
        f"{tally.most} at once at most, {tally.overlaps} overlaps"
    )
    motions = f"{len(files.motions)} BVH, " if files.motions else ""
    names = ", ".join(str(path) for path in files.files)
    said = f"{tally.frames} frames, {tally.frames / rate:.1f} s, {tally.metres:.1f} m walked"
    screen.out.print(f"{said}: {motions}[bold]{escape(names)}[/]")
    if baking.until_done and not baking.crowd.done:
        screen.out.print("[yellow]it ended with people still on their way: more --seconds let them arrive[/]")


def _summary(baking: Baking, files: CrowdFiles) -> dict[str, object]:
    tally, rate = baking.tally, baking.crowd.frame_rate
    return {
        "output": [str(path) for path in files.files],
        "motions": [str(path) for path in files.motions],
        "frame_rate": rate,
        "frames": tally.frames,
        "seconds": tally.frames / rate,
        "seed": baking.crowd.seed,
        "done": baking.crowd.done,
        "came": tally.came,
        "arrived": tally.arrived,
        "there": tally.there,
        "waiting": tally.waiting,
        "turned_away": tally.turned_away,
        "most_at_once": tally.most,
        "overlaps": tally.overlaps,
        "deepest_overlap": tally.deepest,
        "metres": tally.metres,
    }
