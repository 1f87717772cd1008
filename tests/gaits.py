"""Clips of walkers made of formulas, and what must hold of any clip."""

from __future__ import annotations

import numpy as np

from stridecast.body import kinematics
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.clip import Clip
from stridecast.model.motion import Motion
from synthetic_gait import Gait, gait, ramps


def clip(speed: float, seconds: float = 4.0, **options) -> Clip:
    """Steady walking or running with its exact contacts."""
    return known(gait(ramps((seconds, speed)), name=f"{speed:g} m/s", **options))


def known(truth: Gait) -> Clip:
    letters = np.array(list("FLRD"))[truth.planted[:, 0] + 2 * truth.planted[:, 1]]
    letters = np.where(truth.speeds < 1e-6, "S", letters)
    return Clip(
        motion=truth.motion, positions=truth.positions, headings=truth.headings, support="".join(letters.tolist())
    )


def steps(whole: Clip, states: int, first: str = "L") -> Clip:
    """So many support states of a clip from a whole one on."""
    changes = [n for n in range(1, whole.motion.frames) if whole.support[n] != whole.support[n - 1]]
    start = next(k for k, n in enumerate(changes) if whole.support[n] == first)
    return whole.cut(changes[start], changes[start + states])


def angles(a: Motion, b: Motion) -> np.ndarray:
    """How far joints are turned against each other, radians."""
    return np.linalg.norm(quat.log(quat.multiply(quat.inverse(a.rotations), b.rotations)), axis=-1)


def travel(motion: Motion, planted: np.ndarray, settle: float = 0.03) -> float:
    """Greatest way of a toe joint over the floor within one contact, without its very beginning and end, metres."""
    world, far = kinematics.pose(motion), 0.0
    edge = round(settle * motion.frame_rate)
    for side, name in enumerate(("left", "right")):
        toes = ground.project(world.positions[:, motion.skeleton.joint(f"{name}_toe")])
        for stands, start, stop in signals.runs(planted[:, side]):
            if stands and stop - start > 2 * edge + 2:
                inside = toes[start + edge : stop - edge]
                far = max(far, float(np.linalg.norm(inside - inside[0], axis=-1).max()))
    return far


def knee_bends(motion: Motion) -> np.ndarray:
    """Bend of both knees, forward positive, radians."""
    world, out = kinematics.pose(motion), []
    for side in ("left", "right"):
        hip, knee, ankle = motion.skeleton.chain(f"{side}_thigh", f"{side}_shin", f"{side}_foot")
        down = world.positions[:, knee] - world.positions[:, hip]
        on = world.positions[:, ankle] - world.positions[:, knee]
        left = quat.rotate(world.rotations[:, knee], np.array([1.0, 0.0, 0.0]))
        out.append(np.arctan2(np.sum(np.cross(down, on) * left, axis=-1), np.sum(down * on, axis=-1)))
    return np.array(out)


def accelerations(motion: Motion) -> np.ndarray:
    """Greatest angular acceleration of a joint at each inner frame, rad/s2."""
    turned = quat.log(quat.multiply(quat.inverse(motion.rotations[:-1]), motion.rotations[1:]))
    return np.linalg.norm(np.diff(turned, axis=0), axis=-1).max(axis=-1) * motion.frame_rate**2
