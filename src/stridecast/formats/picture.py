"""Pictures of a walk: poses along the way seen in perspective, and the trails on the ground (KS07 figures 1 and 5)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.errors import FileError, InputError
from stridecast.formats.files import replacing
from stridecast.model.skeleton import Skeleton
from stridecast.synthesis.journey import Journey

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = np.ndarray

INPUT, VEHICLE, PELVIS = "#d62728", "black", "#2ca02c"
"""Colours of the trails, as in the paper: input red, vehicle black, pelvis green."""

LEFT, RIGHT, MIDDLE = "#2b6cb0", "#dd6b20", "#4a5568"
"""Colours of the body's sides."""

THICKNESS = {
    "thigh": 0.15,
    "shin": 0.11,
    "foot": 0.08,
    "toe": 0.08,
    "shoulder": 0.14,
    "upper_arm": 0.09,
    "forearm": 0.08,
    "hand": 0.06,
    "hips": 0.17,
    "spine": 0.23,
    "spine1": 0.25,
    "chest": 0.2,
    "neck": 0.12,
    "head": 0.2,
}
"""How thick a bone is drawn by the role of the joint it begins at, metres."""


def plotting() -> Any:
    """Matplotlib's figure module.

    Raises
    ------
    InputError
        Matplotlib is not installed.
    """
    try:
        from matplotlib import figure
    except ImportError:
        raise InputError("pictures need matplotlib: pip install 'stridecast[plot]'") from None
    return figure


def write_picture(
    path: str | Path, journey: Journey, *, every: float = 0.45, size: tuple[float, float] = (13, 6.2)
) -> None:
    """Draw a walk as a PNG: a body every so many seconds, the trails of input, vehicle and pelvis, and the footprints.

    Parameters
    ----------
    path
        The PNG to write.
    journey
        The walk.
    every
        Seconds between bodies.
    size
        Inches; a hundred pixels each.

    Raises
    ------
    InputError, FileError
        No matplotlib; another suffix than ``.png``; a file that cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise FileError("a picture is written as .png", path=path)
    figure = plotting().Figure(figsize=size, dpi=100, layout="constrained")
    axes = figure.subplots()
    draw_scene(axes, journey, np.arange(0, journey.motion.frames, max(1, round(every * journey.motion.frame_rate))))
    with replacing(path) as new:
        figure.savefig(new, format="png")


class Camera:
    """A pinhole camera that looks at a place on the ground from a height and a side.

    Parameters
    ----------
    target
        Point looked at, metres.
    distance
        From the target, metres.
    azimuth, elevation
        Where the camera stands, radians: 0 azimuth is +Z of the target, turning towards +X.
    """

    def __init__(self, target: Float[Array, "3"], distance: float, azimuth: float, elevation: float) -> None:
        away = np.array([np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)])
        self.place = target + distance * away
        self.right = np.cross([0.0, 1.0, 0.0], away)
        self.right /= np.linalg.norm(self.right)
        self.up = np.cross(away, self.right)
        self.ahead = -away

    def see(self, points: Float[Array, "*shape 3"]) -> tuple[Float[Array, "*shape 2"], Float[Array, "*shape"]]:
        """Picture coordinates and depth."""
        relative = points - self.place
        depth = relative @ self.ahead
        return np.stack((relative @ self.right, relative @ self.up), axis=-1) / depth[..., None], depth


def draw_scene(axes: Axes, journey: Journey, frames: Float[Array, "bodies"] | Array) -> None:
    """Draw bodies at some frames of a walk, its trails and its footprints, in perspective."""
    world = kinematics.pose(journey.motion)
    ends = kinematics.ends(journey.motion.skeleton, world)
    trail = journey.positions
    middle = (trail.min(axis=0) + trail.max(axis=0)) / 2
    extent = float(np.ptp(trail, axis=0).max()) + 2.0
    camera = Camera(np.array([middle[0], 0.5, middle[1]]), 2.2 * extent, np.radians(35), np.radians(28))

    _draw_grid(axes, camera, trail.min(axis=0) - 1.0, trail.max(axis=0) + 1.0)
    for points, colour, width in (
        (journey.inputs, INPUT, 1.0),
        (trail, VEHICLE, 1.6),
        (world.positions[:, 0][:, [0, 2]], PELVIS, 1.2),
    ):
        seen, _ = camera.see(np.stack((points[:, 0], np.zeros(len(points)), points[:, 1]), axis=-1))
        axes.plot(*seen.T, color=colour, linewidth=width, zorder=2, solid_capstyle="round")
    _draw_footprints(axes, camera, journey, world.positions)
    near = np.linalg.norm(trail[frames] - camera.place[[0, 2]], axis=-1)
    for order, frame in enumerate(frames[np.argsort(-near)]):
        draw_body(axes, camera, journey.motion.skeleton, world.positions[frame], ends[frame], 10 + order)
    axes.set_aspect("equal")
    axes.margins(0.02)
    axes.axis("off")


def draw_body(
    axes: Axes,
    camera: Camera,
    skeleton: Skeleton,
    positions: Float[Array, "joints 3"],
    ends: Float[Array, "ends 3"],
    layer: int,
) -> None:
    """Draw one body as rounded limbs, the far ones first."""
    from matplotlib.collections import LineCollection

    role_of = {joint: role for role, joint in skeleton.roles.items()}
    side_of = _sides(skeleton)
    bones = [(skeleton.parents[j], positions[j]) for j in range(1, skeleton.joints)]
    bones += list(zip(skeleton.end_joints, ends, strict=True))
    starts = np.array([positions[joint] for joint, _ in bones])
    stops = np.array([place for _, place in bones])
    seen_a, depth_a = camera.see(starts)
    seen_b, depth_b = camera.see(stops)
    order = np.argsort(-(depth_a + depth_b))
    scale = axes.figure.figure.get_figwidth() * 72 * 1.05  # points across a picture of width one at depth one
    lines, widths, colours = [], [], []
    for k in order:
        joint = int(bones[k][0])
        part = role_of.get(joint, "").removeprefix("left_").removeprefix("right_")
        lines.append((seen_a[k], seen_b[k]))
        widths.append(THICKNESS.get(part, 0.06 if side_of[joint] else 0.15) * scale / depth_a[k])
        colours.append({"left": LEFT, "right": RIGHT}.get(side_of[joint], MIDDLE))
    axes.add_collection(
        LineCollection(lines, linewidths=widths, colors=colours, capstyle="round", zorder=layer), autolim=True
    )


def _sides(skeleton: Skeleton) -> list[str]:
    """Which side of the body each joint is on: that of its nearest ancestor with a role."""
    role_of = {joint: role for role, joint in skeleton.roles.items()}
    out: list[str] = []
    for joint in range(skeleton.joints):
        role = role_of.get(joint)
        above = out[skeleton.parents[joint]] if joint else ""
        out.append(role.split("_")[0] if role else above)
    return [side if side in ("left", "right") else "" for side in out]


def _draw_grid(axes: Axes, camera: Camera, low: Float[Array, "2"], high: Float[Array, "2"]) -> None:
    """Lines on the ground, a metre apart (more where the walk is long)."""
    step = max(1.0, 2.0 ** np.ceil(np.log2(float((high - low).max()) / 20)))
    low, high = np.floor(low / step) * step, np.ceil(high / step) * step
    for axis in (0, 1):
        for at in np.arange(low[axis], high[axis] + step / 2, step):
            line = np.zeros((2, 3))
            line[:, 2 * axis] = at
            line[:, 2 - 2 * axis] = low[1 - axis], high[1 - axis]
            seen, _ = camera.see(line)
            axes.plot(*seen.T, color="#d9dde3", linewidth=0.6, zorder=0)


def _draw_footprints(axes: Axes, camera: Camera, journey: Journey, positions: Float[Array, "frames joints 3"]) -> None:
    """Where each foot stood: ankle to toe at the middle of each contact."""
    skeleton = journey.motion.skeleton
    for side, (name, colour) in enumerate((("left", LEFT), ("right", RIGHT))):
        planted = np.concatenate(([False], journey.planted[:, side], [False]))
        begins, stops = (
            np.flatnonzero(np.diff(planted.astype(int)) > 0),
            np.flatnonzero(np.diff(planted.astype(int)) < 0),
        )
        for frame in (begins + stops) // 2:
            foot = positions[frame, skeleton.chain(f"{name}_foot", f"{name}_toe")] * np.array([1.0, 0.0, 1.0])
            seen, depth = camera.see(foot)
            axes.plot(*seen.T, color=colour, linewidth=60 / depth[0], alpha=0.35, solid_capstyle="round", zorder=1)
