"""A motion database in tables and in JSON."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from itertools import pairwise

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from stridecast.database.graph import made_up
from stridecast.geometry import ground
from stridecast.model.database import INTERVALS, MARGIN, MotionDatabase
from stridecast.model.group import MotionGroup
from stridecast.model.segment import STAND, WALK

WALKING_SPEED = 1.3
"""Speed at which turning radii are told, m/s."""

SPEEDS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0)
"""Edges of the bins of speed, m/s."""

TURNS = (-180, -90, -45, -15, 15, 45, 90, 180)
"""Edges of the bins of turning speed, degrees a second, to the left."""

REASONS_SHOWN = 4
"""So many reasons are told of one take."""


def as_json(database: MotionDatabase) -> dict[str, object]:
    """Describe a database in plain values; the first five entries are a promise, those after them may grow."""
    used = [take for take in database.takes if take.segments]
    grid = coverage(database)
    return {
        "frame_rate": database.frame_rate,
        "takes": len(used),
        "seconds": sum(take.seconds for take in used),
        "groups": [
            {
                "name": group.name,
                "string": group.string,
                "motion": group.motion,
                "segments": group.count,
                "bounds": {
                    "jerk": group.bounds.jerk,
                    "tangential": list(group.bounds.tangential_hull),
                    "lateral_per_speed": group.bounds.lateral_per_speed,
                    "speed": [list(pair) for pair in group.bounds.speed],
                },
            }
            for group in database.groups
        ],
        "left_out": [{"file": take.file, "reason": reason} for take in database.takes for reason in take.left_out],
        "covered": sum(take.covered for take in used),
        "bounds_method": database.bounds_method,
        "turning_radius_at_1_3": _turning_radius(database),
        "subjects": list(database.subjects),
        "made_up": made_up(database.groups),
        "assumed": {group.name: list(group.bounds.assumed) for group in database.groups if group.bounds.assumed},
        "coverage": {"speed": list(SPEEDS), "turn_deg_per_s": list(TURNS), "examples": grid.tolist()},
        "styles": {
            name: _style_counts(database, name) for name in dict.fromkeys(group.motion for group in database.groups)
        },
        "annotations": [{"take": take.name, **asdict(take.annotation)} for take in database.takes if take.annotation],
    }


def coverage(database: MotionDatabase) -> np.ndarray:
    """Count the moving examples in each bin of mean speed (rows) and mean turning speed (columns)."""
    examples = database.examples
    moving = np.repeat([group.motion != STAND for group in database.groups], [g.count for g in database.groups])
    rows = np.flatnonzero(moving)
    first, last = MARGIN, MARGIN + INTERVALS
    travelled, durations = examples.travelled[rows], examples.durations[rows]
    turns = np.degrees(ground.wrap(travelled[:, last, 2] - travelled[:, first, 2])) / durations
    speeds = travelled[:, first : last + 1, 3].mean(axis=1)
    turns = np.clip(turns, TURNS[0], TURNS[-1])
    speeds = np.clip(speeds, SPEEDS[0], SPEEDS[-1])
    return np.histogram2d(speeds, turns, bins=(SPEEDS, TURNS))[0].astype(int)


def tell(database: MotionDatabase, console: Console) -> None:
    """Show everything, in tables."""
    tell_sum(database, console)
    console.print(_groups(database))
    strings = Counter[str]()
    for group in database.groups:
        strings[group.string] += group.count
    console.print("strings: " + ", ".join(f"{string} {count}" for string, count in strings.most_common()))
    console.print(_coverage(database))
    console.print(_people(database))
    console.print(_styles(database))
    cycles = [take.annotation.cycle for take in database.takes if take.annotation and take.annotation.cycle]
    if cycles:
        number = sum(take.annotation.cycles for take in database.takes if take.annotation)
        console.print(f"{number} cycles in {len(cycles)} takes, of {min(cycles):.2f} to {max(cycles):.2f} s")
    radius = _turning_radius(database)
    if radius is not None:
        console.print(f"tightest turn walking at {WALKING_SPEED} m/s: radius {radius:.2f} m")
    missing = made_up(database.groups)
    if missing:
        console.print(f"[yellow]made up, as no example shows it:[/] {', '.join(missing)}")
    tell_left_out(database, console)


def tell_sum(database: MotionDatabase, console: Console) -> None:
    """Show how much there is of what."""
    used = [take for take in database.takes if take.segments]
    unused = len(database.takes) - len(used)
    mirrored = int(database.examples.mirrored.sum())
    console.print(
        f"[bold]{len(used)}[/] takes used ({sum(t.seconds for t in used):.0f} s, "
        f"{sum(t.covered for t in used):.0f} s of it under a vehicle), [bold]{unused}[/] left out; "
        f"[bold]{len(database.groups)}[/] groups, [bold]{len(database.examples.durations)}[/] examples "
        f"({mirrored} of them mirrored) at {database.frame_rate:g} Hz, bounds {database.bounds_method}"
    )


def tell_left_out(database: MotionDatabase, console: Console) -> None:
    """Show takes that were left out, and parts of takes, with the reasons."""
    table = Table("left out", "used segments", "why", title_justify="left")
    for take in database.takes:
        if take.left_out:
            more = len(take.left_out) - REASONS_SHOWN
            lines = [*take.left_out[:REASONS_SHOWN], *([f"and {more} more"] if more > 0 else [])]
            table.add_row(escape(take.file), str(take.segments or "none"), escape("\n".join(lines)))
    if table.row_count:
        console.print(table)


def _groups(database: MotionDatabase) -> Table:
    table = Table("group", "string", "motion")
    for name in (
        "examples",
        "seconds",
        "speed at start",
        "at end, m/s",
        "along, m/s²",
        "across, 1/s",
        "jerk, m/s³",
    ):
        table.add_column(name, justify="right")
    for group in database.groups:
        durations, bounds = database.examples.durations[group.rows], group.bounds
        table.add_row(
            group.name,
            group.string,
            group.motion,
            str(group.count),
            _range((float(durations.min()), float(durations.max()))),
            *[_range(pair) for pair in bounds.speed],
            _range(bounds.tangential_hull),
            f"{bounds.lateral_per_speed:.2f}",
            f"{bounds.jerk:.0f}",
        )
    return table


def _coverage(database: MotionDatabase) -> Table:
    table = Table("examples", title="at a speed, turning at degrees a second (left is positive)", title_justify="left")
    for right, left in pairwise(TURNS):
        table.add_column(f"{right} to {left}", justify="right")
    for (slow, fast), counts in zip(pairwise(SPEEDS), coverage(database).tolist(), strict=True):
        table.add_row(f"{slow:g} to {fast:g} m/s", *[str(count) if count else "·" for count in counts])
    return table


def _people(database: MotionDatabase) -> Table:
    table = Table("person", "takes", "seconds", "segments")
    for subject in database.subjects:
        takes = [take for take in database.takes if take.subject == subject and take.segments]
        figures = len(takes), f"{sum(t.seconds for t in takes):.0f}", sum(t.segments for t in takes)
        table.add_row(escape(subject), *map(str, figures))
    return table


def _styles(database: MotionDatabase) -> Table:
    """Takes and what they show."""
    table = Table("style of examples", *_STYLES, title_justify="left")
    for column in table.columns[1:]:
        column.justify = "right"
    for motion in dict.fromkeys(group.motion for group in database.groups):
        table.add_row(motion, *[str(count) if count else "·" for count in _style_counts(database, motion).values()])
    return table


_STYLES = {"gloomy": (-1.0, -0.35), "neutral": (-0.35, 0.35), "brisk": (0.35, 1.0)}
"""Words for styles, and the scores between which they are used."""


def _style_counts(database: MotionDatabase, motion: str) -> dict[str, int]:
    """Count the examples of a motion in each style."""
    rows = np.repeat([group.motion == motion for group in database.groups], [g.count for g in database.groups])
    scores = database.annotations.style[rows]
    return {name: int(((scores >= low) & (scores < high)).sum()) for name, (low, high) in _STYLES.items()}


def _turning_radius(database: MotionDatabase) -> float | None:
    """Radius of the tightest turn when walking at 1.3 m/s, metres."""
    walking: list[MotionGroup] = [group for group in database.groups if group.motion == WALK]
    if not walking or not walking[0].bounds.lateral_per_speed:
        return None
    return walking[0].bounds.turning_radius(WALKING_SPEED)


def _range(pair: tuple[float, float]) -> str:
    return f"{pair[0]:.2f} to {pair[1]:.2f}"
