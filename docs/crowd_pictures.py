"""Make the pictures of crowds in the documentation.

    python docs/crowd_pictures.py [FOLDER] [--seed N] [--only situations,meetings,places,avenue]

Everything is walked with the sample database; ``FOLDER`` is docs/pictures if left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import shapely
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from PIL import Image

import stridecast as sc
from stridecast.body import kinematics
from stridecast.crowd.crowd import Crowd
from stridecast.crowd.frame import CrowdFrame
from stridecast.formats.picture import Camera, draw_body
from stridecast.formats.scenes import load_scene
from stridecast.model.scene import Circle, Scene
from stridecast.samples.situations import situation

HERE = Path(__file__).resolve().parent
SCENES = HERE.parent / "examples" / "scenes"

SHOWN = {
    "head_on": (0.45, {}),
    "overtaking": (0.6, {}),
    "crossing": (0.55, {}),
    "four_way": (0.3, {}),
    "antipodal": (0.18, {"people": 24, "radius": 8.0}),
    "two_way": (0.12, {"density": 0.5}),
    "bottleneck": (0.4, {"people": 30}),
    "corner": (0.5, {}),
    "ring": (0.08, {"density": 0.5}),
}
"""When the last moment is, as a part of the scene's time, and arguments of each situation."""

MEETINGS = (("overtaking", "overtaking", 0.9), ("head_on", "face to face", 0.4))
"""Figures 7c and 7d of Baek, Jeong and Lee: situation, words, seconds between two moments."""

PANELS, WIDE, HIGH = 5, 3.6, 3.0
"""Moments of a film strip, and how wide and high each is, metres."""

PEOPLE = ("#2f855a", "#c53030")
"""Colours of two people."""

PLACES = {"plaza": 60.0, "street": 60.0}
"""Scenes seen from above, and when, seconds."""

TAIL = 5.0
"""So long trails are in large scenes, seconds."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=HERE / "pictures")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="situations,meetings,places,avenue")
    wish = parser.parse_args()
    wish.folder.mkdir(parents=True, exist_ok=True)
    drawn = {"situations": situations, "meetings": meetings, "places": places, "avenue": avenue}
    for name in wish.only.split(","):
        drawn[name](wish.folder, wish.seed)


def situations(folder: Path, seed: int) -> None:
    """The situations of the literature from above: trails up to a moment, coloured by where people want to go."""
    figure = Figure(figsize=(15, 15), dpi=80, layout="constrained")
    for axes, (name, (part, arguments)) in zip(figure.subplots(3, 3).ravel(), SHOWN.items(), strict=True):
        scene = situation(name, seed, **arguments)
        crowd = Crowd(sc.sample_database(), scene, bodies=False)
        shown = walk(crowd, part * (scene.seconds or 60.0))
        draw_place(axes, scene)
        draw_people(axes, crowd, shown)
        axes.set_title(f"{name.replace('_', ' ')}, {len(crowd.came)} people, {shown[-1].time:.0f} s", fontsize=11)
    save(figure, folder / "situations.png")


class Panel(Camera):
    """Looks at a place from far away and puts it somewhere on the paper."""

    def __init__(self, target: np.ndarray, distance: float, shift: tuple[float, float]) -> None:
        super().__init__(target, distance, np.radians(65), np.radians(22))
        self.shift = np.array(shift)

    def see(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Picture coordinates and depth."""
        seen, depth = super().see(points)
        return seen + self.shift, depth


def meetings(folder: Path, seed: int) -> None:
    """Film strips of one who overtakes and of two who meet, with their trails below."""
    figure = Figure(figsize=(15, 11), dpi=80)
    high = 1.0 / (2 * len(MEETINGS))
    for row, (name, title, apart) in enumerate(MEETINGS):
        scene = situation(name, seed)
        crowd = Crowd(sc.sample_database(), scene)
        shown = [frame for frame in walk(crowd, scene.seconds or 60.0) if len(frame.ids) == 2]
        places = np.array([frame.positions for frame in shown])
        nearest = int(np.linalg.norm(places[:, 0] - places[:, 1], axis=-1).argmin())
        moments = nearest + round(apart * crowd.frame_rate) * (np.arange(PANELS) - PANELS // 2)
        moments = moments[(moments >= 0) & (moments < len(shown))]
        strip = figure.add_axes((0.0, 1.0 - (2 * row + 1.12) * high, 1.0, 1.1 * high))
        # A body is drawn as thick as it should be if a picture of width one were five per cent wider than the paper.
        whole = 1.0 / 1.05
        distance = WIDE * PANELS / whole
        for k, moment in enumerate(moments):
            middle = places[moment].mean(axis=0)
            panel = Panel(np.array([middle[0], 0.8, middle[1]]), distance, ((k + 0.5) * whole / PANELS, 0.0))
            draw_bodies(strip, panel, crowd, shown[moment])
            strip.text((k + 0.5) * whole / PANELS, 0.53 * HIGH / distance, f"{shown[moment].time:.1f} s", ha="center")
        strip.text(0.01, 0.53 * HIGH / distance, title, fontsize=13)
        strip.set_xlim(0, whole)
        strip.set_ylim(-0.5 * HIGH / distance, 0.62 * HIGH / distance)
        strip.set_axis_off()
        trails = figure.add_axes((0.03, 1.0 - 2 * (row + 1) * high + 0.01, 0.94, 0.82 * high))
        draw_place(trails, scene, lying=True)
        for who in range(2):
            colour = PEOPLE[who]
            trails.plot(*seen_from_above(places[:, who], True).T, color=colour, lw=1.3)
            trails.plot(*seen_from_above(places[moments, who], True).T, "o", color=colour, ms=5)
    save(figure, folder / "meetings.png")


def places(folder: Path, seed: int) -> None:
    """Large scenes from above."""
    for name, seconds in PLACES.items():
        scene = load_scene(SCENES / f"{name}.yaml")
        crowd = Crowd(sc.sample_database(), scene, seed=seed, bodies=False)
        shown = walk(crowd, seconds)
        wide = name == "plaza"
        figure = Figure(figsize=(11, 11) if wide else (15, 4.2), dpi=80, layout="constrained")
        axes = figure.subplots()
        draw_place(axes, scene, lying=not wide)
        draw_people(axes, crowd, shown[-round(TAIL * crowd.frame_rate) :], lying=not wide)
        axes.set_title(f"{name}: {len(shown[-1].ids)} people after {seconds:.0f} s, trails of {TAIL:.0f} s")
        save(figure, folder / f"{name}.png")


def avenue(folder: Path, seed: int) -> None:
    """Figure 7 of Baek, Jeong and Lee: a road with things on it and a few people, the whole of their ways."""
    scene = load_scene(SCENES / "avenue.yaml")
    crowd = Crowd(sc.sample_database(), scene, seed=seed, bodies=False)
    shown = walk(crowd, scene.seconds or 60.0)
    figure = Figure(figsize=(15, 3.9), dpi=80, layout="constrained")
    axes = figure.subplots()
    draw_place(axes, scene, lying=True)
    every = round(5 * crowd.frame_rate)
    for number, person in enumerate(crowd.came, 1):
        seen = [(frame.time, frame.positions[frame.ids == number][0]) for frame in shown if number in frame.ids]
        trail = seen_from_above(np.array([place for _, place in seen]), True)
        colour = f"C{number - 1}"
        axes.plot(*trail.T, color=colour, lw=1.5)
        moments = [k for k, (time, _) in enumerate(seen) if round(time * crowd.frame_rate) % every == 0]
        axes.plot(*trail[moments].T, "o", color=colour, ms=4)
        for k in moments[1:]:
            axes.annotate(f"{seen[k][0]:.0f}", trail[k], (0, 4), textcoords="offset points", color=colour, fontsize=7)
        axes.annotate(person.name, trail[0], (0, -12), textcoords="offset points", color=colour, ha="center")
    axes.set_title("avenue: a dot every five seconds, with the time")
    save(figure, folder / "avenue.png")


def walk(crowd: Crowd, seconds: float) -> list[CrowdFrame]:
    """All frames up to a moment, or until everybody has left."""
    out = [crowd.frame()]
    while out[-1].time < seconds and not crowd.done:
        out.append(crowd.step())
    return out


def seen_from_above(points: np.ndarray, lying: bool) -> np.ndarray:
    """A map has +Z up and +X to the left, as one looks down; lying, +Z goes to the right and +X up."""
    return np.stack((points[..., 1], points[..., 0]) if lying else (-points[..., 0], points[..., 1]), axis=-1)


def draw_place(axes: Axes, scene: Scene, lying: bool = False) -> None:
    """Walls, obstacles and roads from above."""
    for road in scene.roads:
        strip = shapely.LineString(road.points).buffer(road.width / 2)
        axes.fill(*seen_from_above(np.array(strip.exterior.coords), lying).T, color="#edf2f7")
    for wall in scene.walls:
        axes.plot(*seen_from_above(wall.points, lying).T, color="black", lw=1.2)
    for obstacle in scene.obstacles:
        outline = (
            np.array(shapely.Point(obstacle.center).buffer(obstacle.radius).exterior.coords)
            if isinstance(obstacle, Circle)
            else obstacle.points
        )
        axes.fill(*seen_from_above(outline, lying).T, color="#a0aec0")
    axes.set_aspect("equal")
    axes.set_axis_off()


def draw_people(axes: Axes, crowd: Crowd, shown: list[CrowdFrame], lying: bool = False) -> None:
    """Trails, and bodies at the last moment, coloured by the direction from start to goal."""
    who = np.concatenate([frame.ids for frame in shown])
    where = seen_from_above(np.concatenate([frame.positions for frame in shown]), lying)
    order = np.argsort(who, kind="stable")
    people, first = np.unique(who[order], return_index=True)
    trails = np.split(where[order], first[1:])
    colours = {number: colour_of(crowd, number) for number in people.tolist()}
    axes.add_collection(LineCollection(trails, colors=list(colours.values()), linewidths=0.8, alpha=0.8))
    last = shown[-1]
    if len(last.ids):
        axes.add_collection(
            EllipseCollection(
                2 * last.radii,
                2 * last.radii,
                np.zeros(len(last.ids)),
                units="xy",
                offsets=seen_from_above(last.positions, lying),
                transOffset=axes.transData,
                facecolors=[colours[number] for number in last.ids.tolist()],
                edgecolors="black",
                linewidths=0.4,
                zorder=3,
            )
        )
        ahead = np.stack((np.sin(last.headings), np.cos(last.headings)), axis=-1)
        noses = np.stack((last.positions, last.positions + last.radii[:, None] * ahead), axis=1)
        axes.add_collection(
            LineCollection(list(seen_from_above(noses, lying)), colors="black", linewidths=0.8, zorder=4)
        )
    if len(last.movers):
        axes.plot(*seen_from_above(last.movers, lying).T, "s", color="black", ms=7)
    axes.autoscale_view()


def colour_of(crowd: Crowd, number: int) -> tuple[float, float, float, float]:
    """Hue by the direction of the way; grey for those who stand."""
    person = crowd.person(number)
    if not person.stops:
        return (0.6, 0.6, 0.6, 1.0)
    way = person.stops[-1].mean(axis=0) - person.start
    return colormaps["hsv"]((np.arctan2(*way) / (2 * np.pi)) % 1.0)  # type: ignore[no-any-return]


def draw_bodies(axes: Axes, camera: Camera, crowd: Crowd, frame: CrowdFrame) -> None:
    """Everybody's body in one frame, who is further away first, each on a spot of the colour of the trail."""
    if frame.roots is None or frame.rotations is None:
        raise ValueError("the crowd has no bodies")
    around = np.linspace(0.0, 2 * np.pi, 40)
    circle = 0.3 * np.stack((np.sin(around), np.zeros(40), np.cos(around)), axis=-1)
    ground = np.insert(frame.positions, 1, 0.0, axis=-1)
    for layer, k in enumerate(np.argsort(-camera.see(ground)[1])):
        spot, _ = camera.see(ground[k] + circle)
        axes.fill(*spot.T, color=PEOPLE[k % len(PEOPLE)], alpha=0.35, lw=0, zorder=1)
        skeleton = crowd.skeleton(int(frame.ids[k]))
        world = kinematics.forward(skeleton, frame.roots[[k]], frame.rotations[[k]])
        draw_body(axes, camera, skeleton, world.positions[0], kinematics.ends(skeleton, world)[0], 10 + layer)


def save(figure: Figure, path: Path) -> None:
    """Write a picture of 256 colours, which is a third as large."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    drawn = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    drawn.quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
