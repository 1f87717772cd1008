"""Make the pictures of the documentation.

    python docs/pictures.py RECORDINGS_FOLDER [DATABASE]

``RECORDINGS_FOLDER`` holds CMU takes by subject (``16/16_27.amc`` and so on); the database is built from it if left
out.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stridecast as sc
from stridecast.analysis.take import TakeAnalysis, analyse
from stridecast.formats.picture import INPUT, PELVIS, VEHICLE, write_picture
from stridecast.steering.curves import named_curve
from stridecast.synthesis.journey import Journey, PointStream, follow, stream_along

HERE = Path(__file__).resolve().parent
OUT = HERE / "pictures"
sys.path.insert(0, str(HERE.parent / "examples"))


def main() -> None:
    folder = Path(sys.argv[1])
    database = sc.load_database(sys.argv[2]) if len(sys.argv) > 2 else sc.build([folder])
    OUT.mkdir(exist_ok=True)
    from demo import course

    write_picture(OUT / "walk.png", follow(database, course()), every=0.6)
    trajectories(database)
    vehicle([analyse(sc.load_motion(path)) for path in take_files(folder, "16_27", "16_29", "16_37", "16_31")])
    bounds(folder, database)
    contacts([analyse(sc.load_motion(path)) for path in take_files(folder, "16_31", "16_33", "16_55", "127_04")])


def take_files(folder: Path, *names: str) -> list[Path]:
    return [next(folder.rglob(f"{name}.amc")) for name in names]


def save(figure: Figure, name: str) -> None:
    figure.savefig(OUT / name, format="png")
    print(f"wrote {OUT / name}")


def trajectories(database: sc.MotionDatabase) -> None:
    """Figures 1 and 5 of Kwon & Shin 2007: input red, vehicle black, pelvis green."""
    figure = Figure(figsize=(13, 7.5), dpi=80, layout="constrained")
    grid = figure.subplots(2, 3)
    quarter = named_curve("circle:3")[:240]
    panels = (
        ("straight walking", stream_along(np.array([[0.0, 0.0], [0.0, 7.0]]), 1.3)),
        ("curved walking", stream_along(quarter, 1.3)),
        ("mouse, walking", mouse(1.2, "walk")),
        ("straight running", stream_along(np.array([[0.0, 0.0], [0.0, 14.0]]), 3.2, motion="run")),
        ("curved running", stream_along(2.2 * quarter, 3.0, motion="run")),
        ("mouse, running", mouse(2.8, "run")),
    )
    for axes, (title, stream) in zip(grid.ravel(), panels, strict=True):
        draw_trails(axes, follow(database, stream))
        axes.set_title(title)
    grid[0, 0].legend(loc="lower right", frameon=False)
    save(figure, "trajectories.png")


def mouse(speed: float, motion: str) -> PointStream:
    """A hand that draws: uneven, trembling, with a sharp corner."""
    rng = np.random.default_rng(4)
    seconds = np.arange(0, 10, 1 / 30)
    pace = speed * (1 + 0.25 * np.sin(1.3 * seconds))
    heading = 0.9 * np.sin(0.7 * seconds) + np.where(seconds > 6, 1.4, 0.0)
    points = np.cumsum(pace[:, None] / 30 * np.stack((np.sin(heading), np.cos(heading)), axis=-1), axis=0)
    points += 0.012 * speed * rng.normal(size=points.shape)
    return PointStream(times=seconds, points=points, motions=(motion,) * len(seconds))


def draw_trails(axes: Axes, journey: Journey) -> None:
    pelvis = journey.motion.root_positions[:, [0, 2]]
    axes.plot(*journey.inputs.T, color=INPUT, linewidth=0.9, label="input")
    axes.plot(*journey.positions.T, color=VEHICLE, linewidth=1.4, label="vehicle")
    axes.plot(*pelvis.T, color=PELVIS, linewidth=1.1, label="pelvis")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, m")
    axes.set_ylabel("z, m")
    axes.invert_xaxis()  # seen from above, +X is left of +Z


def vehicle(takes: list[TakeAnalysis]) -> None:
    """Figure 3: pelvis, L-trajectory, R-trajectory and their mean."""
    figure = Figure(figsize=(13, 4.2), dpi=80, layout="constrained")
    for axes, take in zip(figure.subplots(1, len(takes)), takes, strict=True):
        found = take.vehicle
        axes.plot(*take.motion.root_positions[:, [0, 2]].T, color=PELVIS, linewidth=1.2, label="pelvis")
        axes.plot(*found.left.T, color="#c53030", linewidth=0.9, label="L-trajectory")
        axes.plot(*found.right.T, color="#2b6cb0", linewidth=0.9, label="R-trajectory")
        axes.plot(*found.positions.T, color=VEHICLE, linewidth=1.6, label="vehicle")
        for stance in take.gait.mid_stances:
            place = take.motion.root_positions[round(stance.frame), [0, 2]]
            axes.plot(*place, "o", markersize=4, color=("#c53030", "#2b6cb0")[stance.side])
        axes.set_aspect("equal", adjustable="datalim")
        axes.invert_xaxis()
        axes.set_title(take.motion.name)
    figure.axes[0].legend(frameon=False)
    save(figure, "vehicle.png")


def bounds(folder: Path, database: sc.MotionDatabase) -> None:
    """Figure 4: acceleration against speed, and the bounds learned from it."""
    samples: dict[str, list[np.ndarray]] = {"walk": [], "run": []}
    for path in sorted(folder.rglob("*.amc")):
        try:
            take = analyse(sc.load_motion(path), database.skeleton)
        except sc.InputError:
            continue
        for segment in take.gait.segments:
            if segment.motion in samples:
                s = take.steering(segment)
                samples[segment.motion].append(np.stack((s.speeds, s.tangential, s.lateral)))
    figure = Figure(figsize=(13, 6.5), dpi=80, layout="constrained")
    for row, (motion, found) in zip(figure.subplots(2, 2), samples.items(), strict=True):
        speed, tangential, lateral = np.concatenate(found, axis=1)
        learned = next(g.bounds for g in database.groups if g.motion == motion)
        ends = np.array([0.0, speed.max() * 1.05])
        for axes, values, name in ((row[0], tangential, "tangential"), (row[1], lateral, "lateral")):
            axes.plot(speed, values, ".", markersize=2, alpha=0.35, color="#4a5568")
            axes.set_xlabel("speed, m/s")
            axes.set_ylabel(f"{name} acceleration, m/s²")
            axes.set_title(motion)
            axes.set_xlim(*ends)
        for edge in learned.tangential[0]:
            row[0].axhline(edge, color=INPUT)
        for sign in (-1, 1):
            row[1].plot(ends, sign * learned.lateral_per_speed * ends, color=INPUT)
    save(figure, "bounds.png")


def contacts(takes: list[TakeAnalysis]) -> None:
    """Toe heights and contacts of takes, with strings and boundaries."""
    figure = Figure(figsize=(13, 2.4 * len(takes)), dpi=80, layout="constrained")
    for axes, take in zip(figure.subplots(len(takes), 1), takes, strict=True):
        world = sc_world(take.motion)
        seconds = np.arange(take.motion.frames) / take.motion.frame_rate
        for side, colour in ((0, "#2b6cb0"), (1, "#dd6b20")):
            toe = take.motion.skeleton.joint(("left_toe", "right_toe")[side])
            axes.plot(seconds, world[:, toe, 1], color=colour, linewidth=1.1, label=("left toe", "right toe")[side])
            low = -0.05 - 0.03 * side
            axes.fill_between(
                seconds, low, low + 0.022, where=take.contacts.planted[:, side], color=colour, linewidth=0
            )
        axes.fill_between(seconds, -0.11, -0.088, where=take.contacts.standing, color="black", linewidth=0)
        for segment in take.gait.segments:
            middle = (segment.start.frame + segment.stop.frame) / 2 / take.motion.frame_rate
            axes.text(middle, 0.33, f"{segment.motion}\n{segment.string}", ha="center", va="top", fontsize=7)
        for boundary in take.gait.boundaries:
            axes.axvline(boundary.frame / take.motion.frame_rate, color="#a0aec0", linewidth=0.7)
        axes.set_ylim(-0.13, 0.36)
        axes.set_ylabel("height, m")
        axes.set_title(take.motion.name, fontsize=9)
    figure.axes[0].legend(loc="center left", frameon=False, fontsize=8)
    figure.axes[-1].set_xlabel("s")
    save(figure, "contacts.png")


def sc_world(motion: sc.Motion) -> np.ndarray:
    from stridecast.body import kinematics

    return kinematics.pose(motion).positions


if __name__ == "__main__":
    main()
