"""Make the pictures of the documentation.

    python docs/pictures.py RECORDINGS_FOLDER [DATABASE]

``RECORDINGS_FOLDER`` holds CMU takes by subject (``16/16_27.amc`` and so on); the database is built from it if left
out.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import stridecast as sc
from stridecast.analysis.take import TakeAnalysis, analyse
from stridecast.body import kinematics
from stridecast.formats.picture import INPUT, LEFT, PELVIS, RIGHT, VEHICLE, Camera, draw_body, write_picture
from stridecast.formats.scenes import load_scene
from stridecast.geometry import signals
from stridecast.model.scene import Circle, Scene
from stridecast.paths.curve import Curve
from stridecast.paths.follow import walk_scene
from stridecast.paths.generate import generate_path
from stridecast.samples.adult import adult
from stridecast.samples.corpus import Leg, Recipe, sample_take
from stridecast.samples.performance import SampleTake, perform
from stridecast.steering.curves import named_curve
from stridecast.synthesis.journey import Journey, PointStream, follow, stream_along

HERE = Path(__file__).resolve().parent
OUT = HERE / "pictures"
sys.path[:0] = [str(HERE.parent / "examples"), str(HERE.parent / "bench")]

ODD = ("08_05", "08_11", "09_12", "17_03", "127_13", "14_04", "14_37")
"""Takes in which nobody goes plainly."""

BESIDE = ((0.8, "16_17"), (1.4, "16_47"), (1.9, "08_08"), (2.5, "02_03"), (4.0, "16_45"))
"""Speeds (m/s) and takes in which somebody goes about as fast."""


def main() -> None:
    folder = Path(sys.argv[1])
    database = sc.load_database(sys.argv[2]) if len(sys.argv) > 2 else sc.build([folder])
    OUT.mkdir(exist_ok=True)
    from demo import course

    write_picture(OUT / "walk.png", follow(sc.sample_database(), course()), every=0.6)
    walked()
    trajectories(database)
    vehicle([analyse(sc.load_motion(path)) for path in take_files(folder, "16_27", "16_29", "16_37", "16_31")])
    bounds(folder, database)
    contacts([analyse(sc.load_motion(path)) for path in take_files(folder, "16_31", "16_33", "16_55", "127_04")])
    gait(folder)
    sample(folder)
    styles()
    scene()


def take_files(folder: Path, *names: str) -> list[Path]:
    return [next(path for end in ("amc", "bvh") for path in folder.rglob(f"{name}.{end}")) for name in names]


def save(figure: Figure, name: str, colours: int | None = None) -> None:
    """Write a picture; one of few colours is a third as large."""
    if colours is None:
        figure.savefig(OUT / name, format="png")
    else:
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        drawn = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        drawn.quantize(colours, dither=Image.Dither.NONE).save(OUT / name, optimize=True)
    print(f"wrote {OUT / name}")


def walked() -> None:
    """Figures 5, 7a and 7b of Baek, Jeong and Lee: ways through scenes, and the footprints of who walked them."""
    figure = Figure(figsize=(13, 6.4), dpi=80, layout="constrained")
    for axes, name in zip(figure.subplots(1, 2), ("road", "square"), strict=True):
        scene = load_scene(HERE.parent / "examples" / "scenes" / f"{name}.yaml")
        walk = walk_scene(sc.sample_database(), scene)
        draw_scene(axes, scene)
        axes.plot(*walk.curve.points.T, color=INPUT, lw=1)
        axes.plot(*walk.journey.positions.T, color=VEHICLE, lw=0.8)
        axes.plot(*walk.curve.controls.T, "o", color=INPUT, ms=4)
        footprints(axes, walk.journey)
        most = 100 * walk.errors.max()
        axes.set_title(f"{name}: {walk.curve.length:.1f} m, at most {most:.1f} cm off the curve")
    save(figure, "walked.png")


def footprints(axes: Axes, journey: Journey) -> None:
    """A stroke from ankle to toe in the middle of each contact."""
    places = kinematics.pose(journey.motion).positions[..., [0, 2]]
    for column, (side, colour) in enumerate((("left", LEFT), ("right", RIGHT))):
        ankle, toe = (journey.motion.skeleton.joint(f"{side}_{part}") for part in ("foot", "toe"))
        for value, start, stop in signals.runs(journey.planted[:, column]):
            if value:
                axes.plot(*places[(start + stop) // 2, [ankle, toe]].T, color=colour, lw=3)


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
    return kinematics.pose(motion).positions


def gait(folder: Path) -> None:
    """What people, the sample person and a walker measure, against speed."""
    from gait import MEASURES, by_take, performed, recorded, walked

    people = by_take(recorded([folder], ODD))
    lines = (("sample person", by_take(performed()), "-"), ("walker", by_take(walked(sc.sample_database())), "--"))
    subjects = sorted({s.who for s in people}, key=lambda who: (len(who), who))
    figure = Figure(figsize=(13, 5.6), dpi=80, layout="constrained")
    grid = figure.subplots(2, (len(MEASURES) + 1) // 2, sharex=True).ravel()
    for number, (axes, (_, _, title)) in enumerate(zip(grid, MEASURES, strict=False)):
        for place, who in enumerate(subjects):
            at = [(s.speed, s.values[number]) for s in people if s.who == who]
            axes.plot(*np.transpose(at), "o", markersize=4, alpha=0.7, color=f"C{place}", label=f"subject {who}")
        for label, found, style in lines:
            for motion in ("walk", "run"):
                at = sorted((s.speed, s.values[number]) for s in found if s.motion == motion)
                shown = label if motion == "walk" else None
                axes.plot(*np.transpose(at), style, color="black", linewidth=1.5, label=shown)
        axes.set_title(title, fontsize=10)
        axes.set_ylim(bottom=0)
    for axes in grid[-(len(grid) // 2) :]:
        axes.set_xlabel("speed, m/s")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=9, frameon=False)
    save(figure, "gait.png")


class Stage(Camera):
    """Looks level at one body from far away and puts it somewhere on the paper (metres)."""

    def __init__(self, body: np.ndarray, paper: tuple[float, float], distance: float, azimuth: float, tilt: float):
        super().__init__(np.array([body[0], 0.0, body[2]]), distance, azimuth, tilt)
        self.shift = np.array(paper) / distance

    def see(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Picture coordinates and depth."""
        seen, depth = super().see(points)
        return seen + self.shift, depth


class Paper:
    """A picture of bodies, laid out in metres from its lower left corner."""

    def __init__(self, width: float, height: float, inches: float = 13.0) -> None:
        self.figure = Figure(figsize=(inches, inches * height / width), dpi=100)
        self.axes = self.figure.add_axes((0, 0, 1, 1))
        # A body is drawn as thick as it should be if a picture of width one were seven per cent wider than the paper.
        self.distance = 1.05 * width
        self.axes.set_xlim(0, width / self.distance)
        self.axes.set_ylim(0, height / self.distance)
        self.axes.axis("off")
        self.layer = 10

    def body(
        self, motion: sc.Motion, frame: int, place: tuple[float, float], azimuth: float, tilt: float = 0.04
    ) -> None:
        """Draw one pose above a place on the paper, seen from a side (0 is from +Z) and a little from above."""
        world = kinematics.forward(motion.skeleton, motion.root_positions[[frame]], motion.rotations[[frame]])
        ends = kinematics.ends(motion.skeleton, world)[0]
        camera = Stage(world.positions[0, 0], place, self.distance, azimuth, tilt)
        draw_body(self.axes, camera, motion.skeleton, world.positions[0], ends, self.layer)
        self.layer += 1

    def floor(self, left: float, right: float, height: float) -> None:
        """Draw a line to stand on."""
        at = np.array([left, right]) / self.distance
        self.axes.plot(at, [height / self.distance] * 2, color="#cbd5e0", linewidth=1, zorder=0)

    def write(self, place: tuple[float, float], text: str, size: float = 10.0) -> None:
        """Write left-aligned text."""
        self.axes.text(place[0] / self.distance, place[1] / self.distance, text, fontsize=size, va="center")


FROM_RIGHT = -np.pi / 2
"""Azimuth of a camera that sees a body that faces +Z go to the right."""


def sample(folder: Path) -> None:
    """The sample person beside recorded people, pose by pose through a stride, and turning, starting and stopping."""
    width, row, label, sides, fronts = 18.4, 2.0, 1.7, 9, 6
    strips = sample_strips()
    height = row * (2 * len(BESIDE) + len(strips)) + 0.3
    paper = Paper(width, height)
    level = height - 0.2
    for speed, name in BESIDE:
        (path,) = take_files(folder, name)
        people = analyse(sc.load_motion(path), adult())
        side, frames = stride_near(people, speed)
        pace = float(people.vehicle.speeds[frames].mean())
        running = np.full(720, any(s.motion == "run" for s in people.gait.segments))
        made = analyse(perform(np.full(720, pace), np.zeros(720), running=running, rate=120.0, seed=1).motion)
        for take, shown, words in (
            (made, stride_near(made, pace, side)[1], "sample person"),
            (people, frames, f"subject {people.motion.subject}"),
        ):
            level -= row
            paper.floor(label, width - 0.2, level)
            paper.write((0.15, level + 1.15), f"{pace:.2f} m/s\n{words}")
            for count, x0, step, azimuth in (
                (sides, label + 0.6, 1.2, FROM_RIGHT),
                (fronts, label + 11.6, 0.9, 0.0),
            ):
                for k, frame in enumerate(shown[np.arange(count) * len(shown) // count]):
                    facing = float(take.vehicle.headings[frame])
                    paper.body(take.motion, frame, (x0 + k * step, level), facing + azimuth)
    for words, take, (begin, stop, every), azimuth, tilt in strips:
        level -= row
        paper.write((0.15, level + 1.15), words)
        paper.floor(label, width - 0.2, level)
        at = np.arange(begin, stop, every) * take.motion.frame_rate
        step = (width - label - 1.2) / (len(at) - 1)
        for k, frame in enumerate(at):
            paper.body(take.motion, round(frame), (label + 0.5 + k * step, level), azimuth, tilt)
    save(paper.figure, "sample.png", colours=32)


def stride_near(take: TakeAnalysis, speed: float, side: int | None = None) -> tuple[int, np.ndarray]:
    """Foot (any, or the one asked for) and frames of the stride, mid-stance to mid-stance, whose speed is nearest."""
    stances = take.gait.mid_stances
    found = [
        (a.side, np.arange(round(a.frame), round(b.frame)))
        for a, b in zip(stances, stances[2:], strict=False)
        if a.side == b.side and side in (None, a.side)
    ]
    return min(found, key=lambda stride: abs(float(take.vehicle.speeds[stride[1]].mean()) - speed))


def sample_strips() -> Sequence[tuple[str, SampleTake, tuple[float, float, float], float, float]]:
    """What it is, a take, from when to when how often (seconds), and seen from where."""

    def turning(side: int) -> SampleTake:
        return sample_take(
            Recipe(
                name="turn",
                speed=1.3,
                legs=(Leg(seconds=1.5), Leg(seconds=1.6, turn=side * np.pi / 2), Leg(seconds=1.5)),
            ),
            seed=1,
        )

    start = sample_take(
        Recipe(name="start", legs=(Leg(seconds=1.0), Leg(seconds=1.9, speed=1.3), Leg(seconds=1.5))), seed=1
    )
    stop = sample_take(
        Recipe(name="stop", speed=1.3, legs=(Leg(seconds=1.5), Leg(seconds=2.2, speed=0.0), Leg(seconds=1.0))), seed=1
    )
    run = sample_take(
        Recipe(
            name="run", speed=1.4, legs=(Leg(seconds=1.0), Leg(seconds=1.1, speed=3.5, running=True), Leg(seconds=1.0))
        ),
        seed=1,
    )
    return (
        ("turn left\n1.3 m/s", turning(1), (1.0, 3.6, 0.2), FROM_RIGHT / 2, 0.2),
        ("turn right\n1.3 m/s", turning(-1), (1.0, 3.6, 0.2), -FROM_RIGHT / 2, 0.2),
        ("start", start, (0.9, 3.0, 0.15), FROM_RIGHT, 0.04),
        ("stop", stop, (1.9, 4.0, 0.15), FROM_RIGHT, 0.04),
        ("walk to run\n1.4 to 3.5 m/s", run, (0.9, 2.6, 0.1), FROM_RIGHT, 0.04),
    )


def styles() -> None:
    """A gloomy, a neutral and a brisk stride of a walker, from the side and from the front, at the same speed."""
    speed, row, width, label, sides, fronts = 1.3, 2.0, 18.4, 1.7, 9, 6
    paper = Paper(width, 3 * row + 0.3)
    database = sc.sample_database()
    for level, style in zip((2 * row, row, 0.0), ("gloomy", "neutral", "brisk"), strict=True):
        level += 0.1
        journey = follow(database, stream_along(np.array([[0.0, 0.0], [0.0, 14.0]]), speed), style=style)
        take = analyse(journey.motion)
        stride = stride_near(take, speed, 0)[1]
        steps = 2 * journey.motion.frame_rate / len(stride)
        paper.floor(label, width - 0.2, level)
        paper.write((0.15, level + 1.15), f"{style}\n{steps:.2f} steps/s")
        for count, x0, step, azimuth in ((sides, label + 0.6, 1.2, FROM_RIGHT), (fronts, label + 11.6, 0.9, 0.0)):
            for k, frame in enumerate(stride[np.arange(count) * len(stride) // count]):
                paper.body(journey.motion, frame, (x0 + k * step, level), float(take.vehicle.headings[frame]) + azimuth)
    save(paper.figure, "styles.png", colours=32)


def scene() -> None:
    """Figures 2 and 3 of Baek, Jeong and Lee: a scene, control points inserted one after the other, curves."""
    figure = Figure(figsize=(13, 4.2), dpi=80, layout="constrained")
    axes = figure.subplots(1, 4)
    road, square = (load_scene(HERE.parent / "examples" / "scenes" / f"{name}.yaml") for name in ("road", "square"))
    found = generate_path(road)
    points = np.array([road.start, *(point for point, _ in found.inserted), road.goals[-1]])
    first = Curve.hermite(points[[0, -1]], road.behavior), Curve.hermite(points[[0, 1, 2, -1]], road.behavior)
    titles = ("a straight line", "two control points", "clear", "searched: goals in order")
    curves = (*first, found.curve, generate_path(square).curve)
    for panel, title, curve in zip(axes, titles, curves, strict=True):
        draw_scene(panel, square if panel is axes[-1] else road)
        panel.plot(*curve.points.T, color=VEHICLE, linewidth=1.5)
        panel.plot(*curve.controls[1:-1].T, "o", color=INPUT, markersize=4)
        panel.set_title(title)
    save(figure, "scene.png")


def draw_scene(axes: Axes, place: Scene) -> None:
    """Roads and obstacles seen from above, start and goals."""
    for road in place.roads:
        strip = shapely.LineString(road.points).buffer(road.width / 2)
        axes.fill(*strip.exterior.xy, color="#e2e8f0")
    for obstacle in place.obstacles:
        if isinstance(obstacle, Circle):
            outline = np.array(shapely.Point(obstacle.center).buffer(obstacle.radius).exterior.coords)
        else:
            outline = obstacle.points
        axes.fill(*outline.T, color="#a0aec0")
    axes.plot(*place.start, "o", color="#2f855a", markersize=7)
    axes.plot(*place.goals.T, "*", color="#c05621", markersize=10)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, m")
    axes.invert_xaxis()  # seen from above, +X is left of +Z


if __name__ == "__main__":
    main()
