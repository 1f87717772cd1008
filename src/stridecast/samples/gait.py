"""A statistical model of human gait: what joints and pelvis do at a phase, a speed, a turn and an acceleration.

Each channel of the body is a Fourier series in gait phase whose coefficients depend on speed, turn, acceleration and
hurry. One table holds walking, one running; standing is a posture.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from stridecast.errors import DatabaseFileError
from stridecast.formats.tensors import read_tensors, write_tensors
from stridecast.geometry import quaternions as quat
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

FORMAT, VERSION = "stridecast gait model", 1

FIXED = ("hips", "left_foot", "left_toe", "right_foot", "right_toe")
"""Joints that are no channels by their own rotation: the root is told by details, feet by how they stand."""

DETAILS = 7
"""Channels of the pelvis about its vehicle: displacement (3), yaw (1), offset (3)."""

FEET = 6
"""Channels of the feet: rotation vectors from the vehicle's frame, left then right."""


RHYTHM = (0, 1, 2, 5, 9)
"""Features that the usual rhythm depends on: speed, its square, how sharp the turn is, how hard the change of speed."""

HURRY = 0.3
"""Further from the usual rhythm nobody strides."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Posture:
    """A body seen from its vehicle, frame by frame.

    Parameters
    ----------
    joints
        Rotations of the moved joints (see ``moved_joints``), joint to parent.
    feet
        Rotations of the feet in the vehicle's frame, left then right.
    displacements, yaws, offsets
        Motion details (see ``MotionDetails``).
    """

    joints: Float[Array, "frames joints 4"]
    feet: Float[Array, "frames 2 4"]
    displacements: Float[Array, "frames 3"]
    yaws: Float[Array, "frames"]
    offsets: Float[Array, "frames 4"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GaitTable:
    """One gait.

    Parameters
    ----------
    coefficients
        Of each feature (see ``features``), each term of the series (mean, then cosine and sine of each harmonic) and
        each channel.
    rhythm
        Logarithm of strides a second: one number a feature of rhythm.
    contacts
        Phase, from the moment at which the feet pass, at which a foot comes down and at which it leaves, each a line in
        speed: rows come down, leave; columns at the middle of the speeds, slope.
    speeds
        Slowest and fastest speed it was learned from, m/s.
    turn, acceleration
        The strongest turn (rad/s) and acceleration (m/s2) it is asked for; beyond them it stays there.
    """

    coefficients: Float[Array, "features terms channels"]
    rhythm: Float[Array, "rhythm"]
    contacts: Float[Array, "2 2"]
    speeds: tuple[float, float]
    turn: float
    acceleration: float

    def features(
        self,
        speeds: Float[Array, "frames"],
        turns: Float[Array, "frames"],
        accelerations: Float[Array, "frames"],
        hurries: Float[Array, "frames"],
    ) -> Float[Array, "frames features"]:
        """What coefficients depend on: speed, turn, lateral and tangential acceleration, hurry, and how hard it is.

        Steps are quick and flat in sharp turns to either side, and in braking as in speeding up; what is steady and
        straight must not take part of that.
        """
        low, high = self.speeds
        v = np.clip(speeds, low, high)
        u = (v - (low + high) / 2) / ((high - low) / 2)
        w = np.clip(turns, -self.turn, self.turn)
        a = np.clip(accelerations, -self.acceleration, self.acceleration)
        h = np.clip(hurries, -HURRY, HURRY)
        c = 0.4 * w * v
        sharp, hard = np.hypot(c, 0.1) - 0.1, np.hypot(a, 0.3) - 0.3
        return np.stack((np.ones_like(v), u, u * u, w, c, sharp, a, a * u, h, hard), axis=-1)

    def channels(
        self,
        phases: Float[Array, "frames"],
        speeds: Float[Array, "frames"],
        turns: Float[Array, "frames"],
        accelerations: Float[Array, "frames"],
        hurries: Float[Array, "frames"],
    ) -> Float[Array, "frames channels"]:
        """Every channel at every frame.

        Parameters
        ----------
        phases
            A multiple of 2 pi when the feet pass and the left one stands.
        speeds, turns, accelerations
            Of the vehicle: m/s, rad/s to the left, m/s2 along the way.
        hurries
            Logarithm of the rhythm over the usual one at that speed.
        """
        given = self.features(speeds, turns, accelerations, hurries)
        waves = fourier(phases, (self.coefficients.shape[1] - 1) // 2)
        design = (given[:, :, None] * waves[:, None]).reshape(len(phases), -1)
        return design @ self.coefficients.reshape(design.shape[1], -1)

    def middles(
        self,
        speeds: Float[Array, "frames"],
        turns: Float[Array, "frames"],
        accelerations: Float[Array, "frames"],
        hurries: Float[Array, "frames"],
    ) -> Float[Array, "frames channels"]:
        """What every channel swings about."""
        return self.features(speeds, turns, accelerations, hurries) @ self.coefficients[:, 0]

    def strides(
        self,
        speeds: Float[Array, "frames"],
        turns: Float[Array, "frames"],
        accelerations: Float[Array, "frames"] | None = None,
    ) -> Float[Array, "frames"]:
        """Strides a second, usually; at an even speed where no accelerations are given."""
        none = np.zeros_like(speeds)
        given = self.features(speeds, turns, none if accelerations is None else accelerations, none)
        return np.exp(given[:, RHYTHM] @ self.rhythm)

    def stance(self, speed: float) -> tuple[float, float]:
        """Phases, from the moment at which the feet pass, at which a foot comes down and leaves."""
        low, high = self.speeds
        u = (min(max(speed, low), high) - (low + high) / 2) / ((high - low) / 2)
        down, up = self.contacts @ np.array([1.0, u])
        return float(down), float(up)


@dataclass(frozen=True, kw_only=True, eq=False)
class GaitModel:
    """How people stand, walk and run.

    Parameters
    ----------
    references
        Rotation about which each moved joint's channels are told.
    walk, run
        The two gaits.
    stand
        Channels of standing.
    provenance
        Where it was learned: words, and figures about the fit.
    """

    references: Float[Array, "joints 4"]
    walk: GaitTable
    run: GaitTable
    stand: Float[Array, "channels"]
    provenance: dict[str, Any]

    def posture(self, channels: Float[Array, "frames channels"]) -> Posture:
        """Channels to rotations and details."""
        frames, joints = len(channels), len(self.references)
        edges = np.cumsum((3 * joints, FEET, 3, 1))
        moved, feet, displacements, yaws, offsets = np.split(channels, edges, axis=1)
        return Posture(
            joints=quat.multiply(self.references, quat.exp(moved.reshape(frames, joints, 3))),
            feet=quat.exp(feet.reshape(frames, 2, 3)),
            displacements=displacements,
            yaws=yaws[:, 0],
            offsets=quat.exp(offsets),
        )


def moved_joints(skeleton: Skeleton) -> list[int]:
    """Joints that are channels: those with a role, but for the root, the feet and the toes."""
    return sorted(joint for role, joint in skeleton.roles.items() if role not in FIXED)


def fourier(phases: Float[Array, "frames"], harmonics: int) -> Float[Array, "frames terms"]:
    """One, then cosine and sine of each harmonic."""
    angles = np.arange(1, harmonics + 1) * phases[:, None]
    waves = np.stack((np.cos(angles), np.sin(angles)), axis=-1).reshape(len(phases), -1)
    return np.concatenate((np.ones((len(phases), 1)), waves), axis=1)


def save_gait(path: str | Path, model: GaitModel) -> None:
    """Write a model; single precision is plenty.

    Raises
    ------
    FileError
        The file system refuses.
    """
    tensors = {"references": model.references, "stand": model.stand}
    header: dict[str, Any] = {"format": FORMAT, "version": VERSION, "provenance": model.provenance}
    for name, table in (("walk", model.walk), ("run", model.run)):
        tensors |= {f"{name}.{part}": getattr(table, part) for part in ("coefficients", "rhythm", "contacts")}
        header[name] = {"speeds": table.speeds, "turn": table.turn, "acceleration": table.acceleration}
    write_tensors(path, header, {name: array.astype(np.float32) for name, array in tensors.items()})


def load_gait(path: str | Path) -> GaitModel:
    """Read a model.

    Raises
    ------
    DatabaseFileError
        No such file, damaged, or something else.
    """
    header, tensors = read_tensors(path, FORMAT, VERSION)
    exact = {name: array.astype(np.float64) for name, array in tensors.items()}
    try:
        tables = {
            name: GaitTable(
                **{part: exact[f"{name}.{part}"] for part in ("coefficients", "rhythm", "contacts")},
                speeds=(header[name]["speeds"][0], header[name]["speeds"][1]),
                turn=header[name]["turn"],
                acceleration=header[name]["acceleration"],
            )
            for name in ("walk", "run")
        }
        return GaitModel(
            references=quat.normalize(exact["references"]),
            stand=exact["stand"],
            provenance=header["provenance"],
            **tables,
        )
    except (KeyError, IndexError, TypeError) as error:
        raise DatabaseFileError(f"is damaged: {error} is missing or wrong; fit it again", path=path) from None


@cache
def gait_model() -> GaitModel:
    """The model that comes with the package."""
    with resources.as_file(resources.files("stridecast.samples").joinpath("gait.safetensors")) as path:
        return load_gait(path)
