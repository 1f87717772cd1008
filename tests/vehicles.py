"""Vehicles that move by themselves, as those of a crowd do, and what their bodies show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from stridecast.body import kinematics
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import Pose, VehicleState
from stridecast.model.skeleton import Skeleton
from stridecast.synthesis.walker import Walkers

BRAKES = 1.5
"""Crowds change speed by no more than this, m/s2."""


@dataclass(frozen=True)
class Track:
    """What a vehicle does, frame by frame."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    heading: np.ndarray
    motion: np.ndarray
    rests_in: np.ndarray

    def __len__(self) -> int:
        return len(self.heading)


def track(speed: np.ndarray, turning: np.ndarray, rate: float) -> Track:
    """A lawful vehicle that does about what two series say: speed (m/s) and turning (rad/s), a value a frame."""
    limited = np.empty(len(speed))
    limited[0] = speed[0]
    for i in range(1, len(speed)):
        limited[i] = limited[i - 1] + np.clip(speed[i] - limited[i - 1], -BRAKES / rate, BRAKES / rate)
    v = gaussian_filter1d(limited, 0.08 * rate, mode="nearest")
    v[v < 2e-3] = 0.0
    w = gaussian_filter1d(np.asarray(turning, float), 0.12 * rate, mode="nearest")
    heading = np.concatenate(([0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) / rate)))
    velocity = v[:, None] * ground.direction(heading)
    position = np.concatenate((np.zeros((1, 2)), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) / rate, axis=0)))
    rests = np.full(len(v), np.inf)
    stop = -1
    for i in range(len(v) - 1, -1, -1):  # backwards: while it only slows down, it is on its way to rest
        if v[i] == 0.0:
            stop = i
        elif stop > 0 and v[i] > v[i + 1]:
            rests[i] = (stop - i) / rate
        else:
            stop = -1
    motion = np.where((v == 0.0) | np.isfinite(rests), 0, np.where(v > 2.1, 2, 1))
    acceleration = np.gradient(velocity, 1 / rate, axis=0)
    return Track(position, velocity, acceleration, heading, motion, rests)


def _steps(rate: float, *parts: tuple[float, float]) -> np.ndarray:
    return np.concatenate([np.full(round(seconds * rate), value) for seconds, value in parts])


def tracks(rate: float, seconds: float = 12.0) -> dict[str, Track]:
    """Crowd-like vehicles: what they do is in their names."""
    n = round(seconds * rate)
    rng = np.random.default_rng(3)
    t = np.arange(n) / rate
    still = np.zeros(n)

    def wild(mean: float, spread: float, least: float, most: float, every: float) -> np.ndarray:
        knots = np.arange(0.0, seconds + every, every)
        return np.interp(t, knots, np.clip(rng.normal(mean, spread, len(knots)), least, most))

    given = {
        "stop and go": (_steps(rate, (0.5, 0.0), *[(1.3, 1.2), (1.0, 0.0)] * 4, (2.3, 0.0)), still),
        "stutter": (_steps(rate, *[(0.5, 0.8), (0.5, 0.0)] * 9, (3.0, 0.0)), still),
        "shuffle": (_steps(rate, (3.0, 0.05), (3.0, 0.15), (3.0, 0.3), (3.0, 0.5)), still),
        "turns on the spot": (still, _steps(rate, (1, 0), (3, 1.4), (1, 0), (2, -1.0), (1, 0), (2, 0.4), (2, 0))),
        "sharp turns": (still + 1.2, _steps(rate, (2, 0), (1, 1.8), (2, 0), (1, -1.8), (2, 0), (1.5, 1.8), (2.5, 0))),
        "slow turns": (still + 0.35, _steps(rate, (1, 0), (3, 1.8), (1, 0), (3, -1.2), (4, 0.5))),
        "surges": (wild(0.9, 0.6, 0.0, 1.7, 0.7), wild(0.0, 0.9, -1.8, 1.8, 0.8)),
        "in a dense crowd": (wild(0.35, 0.35, 0.0, 1.0, 0.7), wild(0.0, 0.9, -1.8, 1.8, 0.8)),
        "to a run and back": (_steps(rate, (1, 0.0), (4, 4.0), (7, 0.0)), still),
    }
    return {name: track(speed[:n], turning[:n], rate) for name, (speed, turning) in given.items()}


def at(given: list[Track], frame: int) -> dict:
    """Arguments of a step: every track at a frame, the last one where it has ended."""

    def each(name: str) -> np.ndarray:
        return np.array([getattr(one, name)[min(frame, len(one) - 1)] for one in given])

    return {
        "vehicles": VehicleState(
            position=each("position"),
            velocity=each("velocity"),
            acceleration=each("acceleration"),
            heading=each("heading"),
        ),
        "motion": each("motion"),
        "rests_in": each("rests_in"),
    }


def bodies_of(database: MotionDatabase, given: list[Track], rate: float, **options) -> list[Pose]:
    """Bodies of vehicles from the first frame to the last."""
    walkers = Walkers(database, np.array([one.position[0] for one in given]), frame_rate=rate, **options)
    return [walkers.step(**at(given, frame)) for frame in range(max(len(one) for one in given))]


@dataclass(frozen=True)
class Body:
    """One body over time."""

    toes: np.ndarray  # frames 2 3
    tips: np.ndarray
    bends: np.ndarray  # frames 2, of the knees, radians; negative is backwards
    reach: np.ndarray  # frames 2, hip to ankle as a part of the leg's length
    planted: np.ndarray
    lowest: np.ndarray
    turning: np.ndarray  # frames joints, rad/s

    def slides(self, rate: float, settled: float = 0.1) -> np.ndarray:
        """Way of each planted foot over the floor once it has come to stand: toe or tip, whichever moves less."""
        steps = np.minimum(
            *(np.linalg.norm(np.diff(ground.project(p), axis=0), axis=-1) for p in (self.toes, self.tips))
        )
        out = []
        for foot in range(2):
            for value, start, stop in signals.runs(self.planted[:, foot]):
                first = start + int(settled * rate) + 1
                if value and stop - first > 2:
                    out.append(steps[first : stop - 1, foot].sum())
        return np.array(out)


def body_of(skeleton: Skeleton, poses: list[Pose], row: int, rate: float, hinges: np.ndarray) -> Body:
    """What the body in a row shows; ``hinges`` are the knees' axes in the shins' frames."""
    roots = np.array([pose.root_position[row] for pose in poses])
    rotations = quat.continuous(np.array([pose.rotations[row] for pose in poses]))
    world = kinematics.forward(skeleton, roots, rotations)
    ends = kinematics.ends(skeleton, world)
    toes = [skeleton.joint(f"{side}_toe") for side in SIDES]
    bends, reach = [], []
    for side, hinge in zip(SIDES, hinges, strict=True):
        thigh, shin, foot = skeleton.chain(f"{side}_thigh", f"{side}_shin", f"{side}_foot")
        down = world.positions[:, shin] - world.positions[:, thigh]
        on = world.positions[:, foot] - world.positions[:, shin]
        cross = np.cross(down, on)
        sign = np.sign(np.sum(cross * quat.rotate(world.rotations[:, shin], hinge), axis=-1))
        bends.append(np.arctan2(sign * np.linalg.norm(cross, axis=-1), np.sum(down * on, axis=-1)))
        length = np.linalg.norm(down, axis=-1) + np.linalg.norm(on, axis=-1)
        reach.append(np.linalg.norm(down + on, axis=-1) / length)
    tips = [np.flatnonzero(skeleton.end_joints == toe)[0] for toe in toes]
    return Body(
        toes=world.positions[:, toes],
        tips=ends[:, tips],
        bends=np.array(bends).T,
        reach=np.array(reach).T,
        planted=np.array([pose.planted[row] for pose in poses]),
        lowest=np.minimum(world.positions[..., 1].min(axis=1), ends[..., 1].min(axis=1)),
        turning=np.linalg.norm(quat.angular_velocity(rotations, rate), axis=-1)[:, list(skeleton.roles.values())],
    )
