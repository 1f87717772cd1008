"""Input streams of every kind, walks recorded frame by frame, and the laws that each frame keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stridecast.geometry import ground
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import Pose
from stridecast.synthesis.walker import Walkers

KINDS = ("still", "straight", "circle", "reversal", "jumps", "noise", "mouse", "spiral", "zigzag", "stop and go")


def points_of(kind: str, frames: int, rate: float, seed: int) -> np.ndarray:
    """A stream of ground points, as an input device may send it: ``(frames, 2)``."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None] / rate
    facing, speed = rng.uniform(-np.pi, np.pi), rng.choice([0.41, 0.93, 1.31, 1.83, 3.03, 6.1])
    ahead = ground.direction(np.array([facing]))
    if kind == "still":
        return np.tile(rng.choice([0.0, 0.05, 1.0, 20.0]) * ahead, (frames, 1))
    if kind == "straight":
        return speed * t * ahead
    if kind == "circle":
        radius, sense = rng.uniform(0.1, 4.0), rng.choice([-1.0, 1.0])
        angle = sense * speed * t[:, 0] / radius
        return radius * np.stack((sense * (1 - np.cos(angle)), np.sin(angle) * sense), axis=-1)
    if kind == "reversal":
        period = rng.uniform(0.5, 4.0)
        return speed * (np.abs((t + period) % (2 * period) - period) - period) * ahead
    if kind == "jumps":
        places = rng.normal(0.0, 5.0, (frames // int(rate * rng.uniform(0.05, 1.5) + 1) + 1, 2))
        return np.repeat(places, -(-frames // len(places)), axis=0)[:frames]
    if kind == "noise":
        return speed * t * ahead + rng.normal(0.0, rng.choice([0.005, 0.1, 5.0]), (frames, 2))
    if kind == "mouse":
        return np.cumsum(np.cumsum(rng.normal(0.0, 6.0 / rate**1.5, (frames, 2)), axis=0), axis=0)
    if kind == "spiral":
        angle = 2.0 * t[:, 0]
        return (3.0 - 0.1 * t) * np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    if kind == "zigzag":
        return speed * t * ahead + np.sign(np.sin(rng.uniform(1.0, 8.0) * t)) * ground.left_of(ahead)
    return speed * (t - np.sin(rng.uniform(0.5, 3.0) * t)) * ahead


def motions_of(names: Sequence[str], frames: int, rate: float, seed: int) -> list[str]:
    """Motions asked for: switches at random, every tenth to three seconds."""
    rng = np.random.default_rng(seed)
    out: list[str] = []
    while len(out) < frames:
        out += [str(rng.choice(names))] * int(rate * rng.uniform(0.1, 3.0))
    return out[:frames]


@dataclass(frozen=True)
class Walk:
    """Every frame of many characters; arrays have the axes frames, characters."""

    positions: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray
    headings: np.ndarray
    roots: np.ndarray
    rotations: np.ndarray
    planted: np.ndarray
    jerk: np.ndarray
    tangential: np.ndarray
    lateral: np.ndarray
    speed: np.ndarray
    groups: list[tuple[str, ...]]
    motions: list[tuple[str, ...]]
    clamped: list[tuple[tuple[str, ...], ...]]
    rate: float


def recorded(poses: Sequence[Pose], rate: float) -> Walk:
    return Walk(
        positions=np.array([p.vehicle.position for p in poses]),
        velocities=np.array([p.vehicle.velocity for p in poses]),
        accelerations=np.array([p.vehicle.acceleration for p in poses]),
        headings=np.array([p.vehicle.heading for p in poses]),
        roots=np.array([p.root_position for p in poses]),
        rotations=np.array([p.rotations for p in poses]),
        planted=np.array([p.planted for p in poses]),
        jerk=np.array([p.bounds.jerk for p in poses]),
        tangential=np.array([p.bounds.tangential for p in poses]),
        lateral=np.array([p.bounds.lateral for p in poses]),
        speed=np.array([p.bounds.speed for p in poses]),
        groups=[p.group for p in poses],
        motions=[p.motion for p in poses],
        clamped=[p.clamped for p in poses],
        rate=rate,
    )


def walk_through(
    database: MotionDatabase,
    streams: np.ndarray,
    motions: Sequence[Sequence[str]] | str,
    *,
    forces: bool = False,
    headings: np.ndarray | float = 0.0,
    **options,
) -> Walk:
    """Let characters follow streams ``(frames, characters, 2)``, one each; they start at the first points."""
    starts = np.zeros_like(streams[0]) if forces else streams[0]
    walkers = Walkers(database, starts, headings, **options)
    poses = []
    for frame, wish in enumerate(streams):
        wanted = motions if isinstance(motions, str) else [own[frame] for own in motions]
        poses.append(walkers.step(**{"forces" if forces else "points": wish}, motion=wanted))
    return recorded(poses, walkers.frame_rate)


def random_walk(database: MotionDatabase, seed: int, frames: int, rate: float, *, forces: bool = False) -> Walk:
    """One character for each kind of stream, motions switched at random."""
    rng = np.random.default_rng(seed)
    names = database.motions
    if forces:
        held = rng.integers(1, 30, len(KINDS))
        streams = np.stack(
            [np.repeat(rng.normal(0.0, rng.choice([0.5, 3.0, 50.0]), (frames, 2)), h, axis=0)[:frames] for h in held], 1
        )
    else:
        streams = np.stack([points_of(kind, frames, rate, seed + 1000 * i) for i, kind in enumerate(KINDS)], axis=1)
    motions = [motions_of(names, frames, rate, seed + 7 * i) for i in range(len(KINDS))]
    return walk_through(
        database, streams, motions, forces=forces, headings=rng.uniform(-4, 4, len(KINDS)), frame_rate=rate
    )


@dataclass(frozen=True)
class Steering:
    """What the vehicles did in each frame but the first, along and across the direction they had."""

    tangential: np.ndarray
    lateral: np.ndarray
    jerk: np.ndarray
    before: np.ndarray  # speed before the frame
    speed: np.ndarray


def steering_of(walk: Walk) -> Steering:
    ahead = ground.direction(walk.headings[:-1])
    acceleration = walk.accelerations[1:]
    return Steering(
        tangential=np.sum(acceleration * ahead, axis=-1),
        lateral=np.sum(acceleration * ground.left_of(ahead), axis=-1),
        jerk=np.linalg.norm(np.diff(walk.accelerations, axis=0), axis=-1) * walk.rate,
        before=np.linalg.norm(walk.velocities[:-1], axis=-1),
        speed=np.linalg.norm(walk.velocities[1:], axis=-1),
    )


def beyond_published(database: MotionDatabase, walk: Walk) -> dict[str, np.ndarray]:
    """By how much each frame lies beyond the bounds of its group as the database gives them; zero or less is within."""
    did = steering_of(walk)
    bounds = [[database.group(name).bounds for name in row] for row in walk.groups[1:]]

    def each(read) -> np.ndarray:
        return np.array([[read(b) for b in row] for row in bounds])

    low, high = each(lambda b: b.tangential_hull[0]), each(lambda b: b.tangential_hull[1])
    slow, fast = each(lambda b: min(s[0] for s in b.speed)), each(lambda b: max(s[1] for s in b.speed))
    wide = each(lambda b: b.lateral_per_speed) * did.before
    return {
        "jerk": did.jerk - each(lambda b: b.jerk),
        "tangential": np.maximum(did.tangential - high, low - did.tangential),
        "lateral": np.abs(did.lateral) - wide,
        "fast": did.speed - fast,
        "slow": slow - did.speed,
    }
