"""``stridecast score``: how well a crowd walked, or a body moves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from stridecast.model.scene import Scene
    from stridecast.scorecard.crowds import CrowdScore
    from stridecast.scorecard.limits import Bounds
    from stridecast.scorecard.motion import MotionScore

WORST_SHOWN = 3
"""So many overlaps and deadlocks are named."""


def score(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Trajectories (CSV), BVH or AMC.")],
    scene: Annotated[
        Path | None,
        typer.Option(metavar="SCENE.yaml", help="The place: its walls, obstacles and roads, and who its people are."),
    ] = None,
    radius: Annotated[
        float | None, typer.Option(metavar="M", help="Of all bodies; else that of the scene's people, else 0.25 m.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(metavar="M_PER_S", help="At which all would go alone; else that of the scene.")
    ] = None,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Sample trajectories anew at this rate.")] = None,
    input_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Rate of files that count frames and do not tell it.")
    ] = None,
    bounds: Annotated[
        str | None,
        typer.Option(
            metavar="sample|DB|J,B,P,T,S",
            help="What a body can do: as the people of the sample database or of another one, or five numbers: jerk "
            "(m/s3), braking and speeding up (m/s2), turning (rad/s), speed (m/s).",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False,
) -> None:
    """Measure trajectories of crowds (overlaps, deadlocks, times, ways) or motions of bodies (feet, knees)."""
    from stridecast.cli import screen
    from stridecast.formats.recordings import RECORDINGS, load_motion
    from stridecast.scorecard.motion import score_motion

    for name, value in (("radius", radius), ("speed", speed), ("rate", rate), ("input-rate", input_rate)):
        _check_positive(name, value)
    limits = None if bounds is None else _bounds(bounds)
    place = None
    if scene is not None:
        from stridecast.formats.scenes import load_scene

        place = load_scene(scene)
    found: list[tuple[Path, Any]] = []
    for path in files:
        if path.suffix.lower() in RECORDINGS:
            found.append(
                (
                    path,
                    score_motion(load_motion(path, frame_rate=input_rate if path.suffix.lower() == ".amc" else None)),
                )
            )
        else:
            found.append((path, _score_trajectories(path, place, radius, speed, rate, input_rate, limits)))
    if as_json:
        screen.print_json({"files": [{"file": str(path), **result.as_json()} for path, result in found]})
        return
    from stridecast.scorecard.motion import MotionScore

    for path, result in found:
        table = _motion_table if isinstance(result, MotionScore) else _crowd_table
        screen.out.print(table(path, result))


def _score_trajectories(
    path: Path,
    scene: Scene | None,
    radius: float | None,
    speed: float | None,
    rate: float | None,
    input_rate: float | None,
    bounds: Bounds | None,
) -> CrowdScore:
    from stridecast.formats.crowd_files import moved_as_written
    from stridecast.formats.trajectories import load_trajectories
    from stridecast.scorecard.crowds import USUAL_RADIUS, score_crowd
    from stridecast.scorecard.roster import Roster, roster

    trajectories = load_trajectories(path, frame_rate=input_rate)
    if scene is not None:
        scene = moved_as_written(scene, path)
    known = Roster() if scene is None else roster(scene, trajectories)
    radii = {person: known.radii.get(person, USUAL_RADIUS) for person in trajectories.people.tolist()}
    return score_crowd(
        trajectories,
        radius=radii if radius is None else radius,
        scene=scene,
        bounds=bounds,
        free_speeds=known.free_speeds if speed is None else speed,
        goals=known.goals,
        frame_rate=rate,
    )


def _check_positive(name: str, value: float | None) -> None:
    from stridecast.errors import InputError

    if value is not None and not 0 < value < float("inf"):
        raise InputError(f"--{name} must be above 0, not {value:g}")


def _bounds(text: str) -> Bounds:
    """Five numbers, or what the people of a database can do."""
    from stridecast.errors import InputError
    from stridecast.scorecard.limits import Limits

    if "," in text:
        try:
            jerk, brake, push, turn, fastest = (float(part) for part in text.split(","))
        except ValueError:
            raise InputError(
                "--bounds must be sample, a database, or five numbers such as 60,4,3,1.8,2.2 (jerk, braking, speeding "
                f"up, turning, speed), not {text!r}"
            ) from None
        return Limits(jerk=jerk, tangential=(-brake, push), lateral_per_speed=turn, fastest=fastest)

    from stridecast.cli.databases import open_database
    from stridecast.crowd.bounds import HumanBounds

    return HumanBounds.of(open_database(None if text == "sample" else Path(text)))


def _table(path: Path) -> Table:
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(str(path)), title_justify="left", show_header=False)
    table.add_column("measure")
    table.add_column("value")
    return table


def _crowd_table(path: Path, score: CrowdScore) -> Table:
    from rich.markup import escape

    table = _table(path)
    way = score.travel
    table.add_row(
        "people", f"{score.people} for {score.seconds:.1f} s at {score.frame_rate:.4g} Hz ({score.samples} samples)"
    )
    for name, found in (("overlaps", score.overlaps), ("overlaps with the scene", score.solid_overlaps)):
        text = f"pairs: {found.pairs}, in {found.frames} frames"
        worst = [f"{o.one} and {o.other} {100 * o.depth:.1f} cm at {o.time:.2f} s" for o in found.each[:WORST_SHOWN]]
        table.add_row(name, escape("none" if not found.pairs else f"{text}; deepest {', '.join(worst)}"))
    stuck = [f"{d.person} from {d.first:.1f} to {d.last:.1f} s" for d in score.deadlocks[:WORST_SHOWN]]
    ended = sum(d.resolved for d in score.deadlocks)
    groups = ", some block each other" if score.blocking_groups else ""
    table.add_row(
        "deadlocks",
        f"{len({d.person for d in score.deadlocks})} people, {len(score.deadlocks)} stands ({ended} resolved{groups}): "
        f"{', '.join(stuck)}"
        if stuck
        else "none",
    )
    goals = int(way.has_goal.sum())
    table.add_row("arrived", f"{way.arrived} of {goals}" if goals else "no goals known")
    for name, values in (
        ("time against walking alone", way.against_alone),
        ("time against straight at their own pace", way.against_own_pace),
        ("way against the straight one", way.detours),
    ):
        text = f"median {_median(values)}, 95 % {_percentile(values, 95)} ({len(values)} people)"
        table.add_row(name, text if len(values) else "not known")
    if score.speed_density.bins:
        table.add_row("speed off Weidmann at its density", f"{score.speed_density.deviation:.2f} m/s")
    table.add_row("acceleration, 99 %", f"{score.smoothness.acceleration_99:.2f} m/s²")
    table.add_row("squared jerk, mean", f"{score.smoothness.squared_jerk:.3g} m²/s⁶")
    for kind, beyond in (score.violations or {}).items():
        text = f"{beyond.count} ({100 * beyond.share:.2f} %) of {beyond.people} people, up to {beyond.worst:.2f} times"
        table.add_row(f"beyond the bounds: {kind}", text if beyond.count else "none")
    return table


def _median(values: Any) -> str:
    return _percentile(values, 50)


def _percentile(values: Any, share: float) -> str:
    import numpy as np

    return f"{np.percentile(values, share):.2f}" if len(values) else "-"


def _motion_table(path: Path, score: MotionScore) -> Table:
    table = _table(path)
    skate = score.foot_skate
    table.add_row("motion", f"{score.frames} frames, {score.seconds:.2f} s")
    if skate.contacts:
        table.add_row(
            "planted toes travel",
            f"median {skate.travel:.1f} mm, 95 % {skate.travel_95:.1f} mm, {skate.speed:.2f} cm/s "
            f"({skate.contacts} contacts)",
        )
    else:
        table.add_row("planted toes travel", "no whole contact to judge")
    table.add_row("toes slide, weighted by height", f"{skate.weighted:.2f} cm/s")
    table.add_row("frames in which toes slip", f"{100 * skate.slipping:.2f} %")
    table.add_row("knees bend", f"{score.knees[0]:.1f} to {score.knees[1]:.0f} degrees")
    table.add_row("lowest point", f"{1000 * score.lowest:.0f} mm")
    table.add_row(
        "angular acceleration of joints",
        f"99 % {score.angular_acceleration_99:.0f} rad/s², most {score.angular_acceleration_most:.0f} rad/s²",
    )
    return table
