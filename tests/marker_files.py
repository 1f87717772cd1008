"""C3D files for tests: markers on the skin of a body in motion, put there by the inverse of what finds the joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stridecast.body import kinematics
from stridecast.body.joint_centres import ANKLE_WIDTH, ELBOW_WIDTH, KNEE_WIDTH, MARKER_RADIUS, SHOULDER_DROP, TOE_DROP
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion

X, Y, Z = np.eye(3)
DEPTH = 0.16
"""Of the pelvis, metres."""

UP = quat.exp(np.array([np.pi / 2, 0.0, 0.0]))
"""From +Y up to +Z up, as laboratories have it."""


def marker_places(motion: Motion, inner: bool = False) -> dict[str, np.ndarray]:
    """Plug-in Gait's markers, frame by frame, metres; with the inner ones of knees and ankles if wanted."""
    world, skeleton = kinematics.pose(motion), motion.skeleton

    def at(role: str, place: np.ndarray | None = None) -> np.ndarray:
        joint = skeleton.joint(role)
        where = world.positions[:, joint]
        return where if place is None else where + quat.rotate(world.rotations[:, joint], place)

    def on(role: str, direction: np.ndarray) -> np.ndarray:
        return quat.rotate(world.rotations[:, skeleton.joint(role)], direction)

    hips = 0.5 * (at("left_thigh") + at("right_thigh"))
    half = 0.5 * np.linalg.norm(at("left_thigh")[0] - at("right_thigh")[0])
    width = (half - 0.0073) / 0.33
    front = hips + (0.24 * DEPTH + 0.0099) * on("hips", Z) + (0.30 * width + 0.0109) * on("hips", Y)
    out: dict[str, np.ndarray] = {}
    for side, sign, l in (("left", 1.0, "L"), ("right", -1.0, "R")):  # noqa: E741
        out[f"{l}ASI"] = front + sign * 0.5 * width * on("hips", X)
        out[f"{l}PSI"] = front - DEPTH * on("hips", Z) + sign * 0.04 * on("hips", X)
        for name, role, wide in (("KNE", "shin", KNEE_WIDTH), ("ANK", "foot", ANKLE_WIDTH)):
            away = sign * (0.5 * wide + MARKER_RADIUS) * on(f"{side}_shin", X)
            out[l + name] = at(f"{side}_{role}") + away
            if inner:
                out[f"{l}{name}M"] = at(f"{side}_{role}") - away
        up = (TOE_DROP + MARKER_RADIUS) * on(f"{side}_foot", Y)
        out[f"{l}TOE"] = at(f"{side}_toe") + up
        offset = skeleton.offsets[skeleton.joint(f"{side}_toe")]
        out[f"{l}HEE"] = at(f"{side}_foot", np.array([offset[0], offset[1], -0.05])) + up
        out[f"{l}SHO"] = at(f"{side}_upper_arm") + (SHOULDER_DROP + MARKER_RADIUS) * on("chest", Y)
        out[f"{l}ELB"] = at(f"{side}_forearm") + sign * (0.5 * ELBOW_WIDTH + MARKER_RADIUS) * on("chest", X)
        out[f"{l}WRA"] = at(f"{side}_hand") + 0.03 * on(f"{side}_hand", Z)
        out[f"{l}WRB"] = at(f"{side}_hand") - 0.03 * on(f"{side}_hand", Z)
        out[f"{l}FHD"] = at("head", np.array([sign * 0.06, 0.09, 0.10]))
        out[f"{l}BHD"] = at("head", np.array([sign * 0.06, 0.09, -0.09]))
    neck = at("neck")
    out["C7"], out["CLAV"] = neck - 0.05 * on("chest", Z), neck + 0.09 * on("chest", Z)
    out["T10"], out["STRN"] = at("chest") - 0.06 * on("chest", Z), at("chest") + 0.14 * on("chest", Z)
    return out


def centre_places(motion: Motion, *, upper: bool = True) -> dict[str, np.ndarray]:
    """Joint centres as a laboratory names them."""
    world, skeleton = kinematics.pose(motion), motion.skeleton
    words = {"thigh": "HJC", "shin": "KJC", "foot": "AJC", "toe": "TOE"}
    if upper:
        words |= {"upper_arm": "SJC", "forearm": "EJC", "hand": "WJC"}
    out = {
        side[0].upper() + word: world.positions[:, skeleton.joint(f"{side}_{part}")]
        for side in ("left", "right")
        for part, word in words.items()
    }
    if upper:
        out |= {"Neck": world.positions[:, skeleton.joint("neck")], "Head": world.positions[:, skeleton.joint("head")]}
    return out


def write_c3d(
    path: Path,
    places: dict[str, np.ndarray],
    rate: float,
    *,
    unit: str = "mm",
    subject: str = "",
    turned: bool = True,
    parameters: dict[str, dict[str, list[float]]] | None = None,
) -> Path:
    """Write places with ezc3d, z up, NaN where a marker is not seen."""
    import ezc3d

    metres = {"mm": 0.001, "cm": 0.01, "m": 1.0}[unit]
    points = np.stack(list(places.values()), axis=1) / metres
    if turned:
        points = quat.rotate(UP, points)
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    names = tuple(f"{subject}:{name}" if subject else name for name in places)
    file["parameters"]["POINT"]["LABELS"]["value"] = names
    for group, values in (parameters or {}).items():
        for name, value in values.items():
            file.add_parameter(group, name, value)
    data = np.ones((4, len(names), len(points)))
    data[:3] = points.transpose(2, 1, 0)
    file["data"]["points"] = data
    file.write(str(path))
    return path
