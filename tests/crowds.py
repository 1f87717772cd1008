"""Crowds of vehicles by chance, what they did frame by frame, and by plain NumPy what they must not do."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stridecast.crowd.bounds import HumanBounds
from stridecast.crowd.ground import make_ground
from stridecast.crowd.state import Ground, make_limits
from stridecast.crowd.traffic import Newcomer, Traffic
from stridecast.crowd.vehicle_kernels import advance

BOUNDS = HumanBounds(
    jerk=np.array([13.0, 10.0]),
    tangential=np.array([[-2.0, 1.8], [-3.2, 2.6]]),
    lateral_per_speed=np.array([1.8, 1.4]),
    fastest=np.array([2.3, 4.5]),
    fades=(1.7, 2.3),
)
"""About those of the sample person."""

LIMITS = make_limits(BOUNDS)

NOTHING = make_ground(np.zeros((0, 4)), np.zeros((0, 3)))
"""Open ground."""


@dataclass(frozen=True)
class Walked:
    """What people did: arrays of frames and rows, NaN where somebody is not there."""

    rate: float
    position: np.ndarray
    velocity: np.ndarray
    heading: np.ndarray
    rule: np.ndarray
    other: np.ndarray
    side: np.ndarray
    radius: np.ndarray
    runs: np.ndarray


def ground(*walls: tuple[float, float, float, float], circles: Iterable[tuple[float, float, float]] = ()) -> Ground:
    """Walls as ``x, z, x, z`` and circles as ``x, z, radius``."""
    return make_ground(np.array(walls, float).reshape(-1, 4), np.array(list(circles), float).reshape(-1, 3))


def corridor(width: float, first: float = -5.0, last: float = 25.0) -> Ground:
    """Walls on both sides along +z."""
    return ground(*((x, first, x, last) for x in (0.5 * width, -0.5 * width)))


def somebody(number: int, start: tuple[float, float], *stops: tuple[float, float], **given: object) -> Newcomer:
    """Who goes straight from stop to stop; looks at the first one unless told otherwise."""
    corners = np.array([start, *stops], float)
    pieces = [
        np.linspace(a, b, max(int(np.ceil(np.linalg.norm(b - a) / 0.25)), 1) + 1)[1:] for a, b in pairwise(corners)
    ]
    way = np.concatenate([corners[:1], *pieces])
    ahead = way[min(1, len(way) - 1)] - way[0]
    facing = float(np.arctan2(*ahead)) if len(way) > 1 else 0.0
    return replace(
        Newcomer(number=number, position=(float(start[0]), float(start[1])), heading=facing, way=way),
        **given,  # type: ignore[arg-type]
    )


def traffic_of(
    people: Iterable[Newcomer], place: Ground = NOTHING, rate: float = 30.0, **given: object
) -> tuple[Traffic, np.ndarray]:
    """Everybody in a place, and their rows."""
    traffic = Traffic(LIMITS, place, rate, **given)  # type: ignore[arg-type]
    return traffic, traffic.add(people)


def walk(
    traffic: Traffic, seconds: float, watch: Callable[[Traffic], None] | None = None, leave: bool = False
) -> Walked:
    """Let them walk; ``watch`` sees every frame."""
    names = ("position", "velocity", "heading", "rule", "other", "chosen_side")
    frames: list[list[np.ndarray]] = []
    for _ in range(round(seconds * traffic.frame_rate) + 1):
        m = traffic.moving
        absent = ~m.here
        frame = []
        for name in names:
            values = np.array(getattr(m, name), float)
            values[absent] = np.nan
            frame.append(values)
        frames.append(frame)
        if watch is not None:
            watch(traffic)
        if leave:
            traffic.remove(traffic.arrived())
        traffic.step()
    rows = min(len(frame[0]) for frame in frames)
    columns = [np.stack([frame[k][:rows] for frame in frames]) for k in range(len(names))]
    p = traffic.people
    return Walked(traffic.frame_rate, *columns, p.radius[:rows].copy(), p.runs[:rows].copy())


def random_people(rng: np.random.Generator, count: int, size: float, place: Ground, traffic: Traffic) -> list[Newcomer]:
    """People anywhere in a square, some in motion, some slow and some at a run, with ways that lead to and fro."""
    found: list[Newcomer] = []
    for number in rng.permutation(10 * count)[: 20 * count].tolist():
        if len(found) == count:
            break
        start = rng.uniform(-size, size, 2)
        stops = rng.uniform(-size, size, (rng.integers(0, 4), 2))
        if len(stops) and np.linalg.norm(np.diff([start, *stops], axis=0), axis=-1).min() < 0.5:
            continue
        runs = bool(rng.random() < 0.3)
        wish = float(rng.uniform(1.5, 4.2) if runs else rng.uniform(0.2, 2.2))
        new = somebody(
            number,
            tuple(start),
            *map(tuple, stops),
            runs=runs,
            wish=wish,
            speed=float(rng.choice([0.0, wish if len(stops) else 0.0])),
            heading=float(rng.uniform(-np.pi, np.pi)),
            radius=float(rng.uniform(0.2, 0.4)),
            side=float(rng.choice([0.0, 1.0, -1.0])),
            keep=float(rng.choice([0.1, 0.35])),
            waits=bool(rng.random() < 0.5),
            rank=float(rng.random()),
            stays=bool(rng.random() < 0.5),
        )
        if not traffic.has_room(new):
            new = replace(new, speed=0.0)
        if traffic.has_room(new):
            traffic.add([new])
            found.append(new)
    return found


def random_place(rng: np.random.Generator, size: float) -> Ground:
    """Open ground, a corridor, circles, walls at all angles, or rooms with doors."""
    kind = rng.integers(5)
    if kind == 0:
        return NOTHING
    if kind == 1:
        return corridor(float(rng.uniform(1.5, 4.0)), -size, size)
    if kind == 2:
        circles = [(*rng.uniform(-size, size, 2), rng.uniform(0.1, 1.0)) for _ in range(rng.integers(1, 20))]
        return ground(circles=circles)
    if kind == 3:
        middles = rng.uniform(-size, size, (rng.integers(1, 12), 2))
        ways = rng.uniform(-3, 3, middles.shape)
        return ground(*np.concatenate((middles - ways, middles + ways), axis=1))
    door = rng.uniform(0.5, 1.2)
    return ground((-size, 0.0, -door, 0.0), (door, 0.0, size, 0.0), (0.0, 1.0, 0.0, size))


def overlap(walked: Walked) -> float:
    """How deep bodies are in each other at most, metres; negative: what is kept between them."""
    x = walked.position
    away = np.linalg.norm(x[:, :, None] - x[:, None, :], axis=-1)
    depth = walked.radius[:, None] + walked.radius[None, :] - away
    depth[:, np.arange(x.shape[1]), np.arange(x.shape[1])] = -np.inf
    return float(np.nanmax(np.where(np.isnan(depth), -np.inf, depth)))


def to_ground(place: Ground, points: np.ndarray) -> np.ndarray:
    """Distance of points from everything that stands, metres."""
    out = np.full(points.shape[:-1], np.inf)
    for s in place.segments:
        way = s[2:] - s[:2]
        u = np.clip(((points - s[:2]) @ way) / max(float(way @ way), 1e-300), 0.0, 1.0)
        out = np.minimum(out, np.linalg.norm(points - s[:2] - u[..., None] * way, axis=-1))
    for c in place.circles:
        out = np.minimum(out, np.linalg.norm(points - c[:2], axis=-1) - c[2])
    return out


def in_ground(walked: Walked, place: Ground) -> float:
    """How deep bodies are in what stands at most, metres."""
    depth = walked.radius - to_ground(place, walked.position)
    return float(np.max(np.where(np.isnan(depth), -np.inf, depth), initial=-np.inf))


def beyond(walked: Walked, bounds: HumanBounds = BOUNDS) -> dict[str, float]:
    """By how much what people did exceeds the bounds at most, from finite differences of their places only."""
    dt = 1.0 / walked.rate
    v = np.diff(walked.position, axis=0) / dt
    a = np.diff(v, axis=0) / dt
    j = np.diff(a, axis=0) / dt
    speed = np.linalg.norm(v, axis=-1)
    jerk, low, high, lateral = bounds.at(np.where(np.isfinite(speed), speed, 0.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        along = v / speed[..., None]
    # Who was at rest has the direction in which they set off.
    along = np.where((speed[:-1] > 1e-7)[..., None], along[:-1], along[1:])
    tangential = np.sum(a * along, axis=-1)
    across = np.abs(a[..., 0] * along[..., 1] - a[..., 1] * along[..., 0])
    moving = (speed[:-1] > 1e-7) | (speed[1:] > 1e-7)
    most = np.where(walked.runs, bounds.fastest[-1], bounds.fastest[0])

    def worst(excess: np.ndarray, judged: np.ndarray | bool = True) -> float:
        return float(np.max(np.where(np.isfinite(excess) & judged, excess, -np.inf), initial=-np.inf))

    return {
        "speed": worst(speed - most),
        "speeding up": worst(tangential - high[:-1], moving),
        "braking": worst(low[:-1] - tangential, moving),
        "lateral": worst(across - lateral[:-1], moving),
        "jerk": worst(np.linalg.norm(j, axis=-1) - jerk[1:-1]),
    }


def braked(traffic: Traffic, row: int) -> np.ndarray:
    """Where somebody is frame by frame who brakes from now on, by the vehicle's own steps."""
    m, p = traffic.moving, traffic.people
    state = (*m.position[row], *m.velocity[row], *m.acceleration[row], m.heading[row])
    out = [state[:2]]
    while state[2] != 0.0 or state[3] != 0.0:
        state = advance(traffic.limits, p.runs[row], *state, 0.0, 0.0, 0.0, 1.0 / traffic.frame_rate)[:7]
        out.append(state[:2])
    return np.array(out)


def commitments(traffic: Traffic) -> np.ndarray:
    """Of everybody who is there, filled up with the last place, to the longest of all: people, frames, 2."""
    m, rows = traffic.moving, traffic.present
    longest = int(m.stops[rows].max(initial=1))
    at = np.minimum(np.arange(longest)[None, :], m.stops[rows, None] - 1)
    return m.path[rows[:, None], at]


def left_to_stop(traffic: Traffic) -> float:
    """What remains between bodies, at least, if everybody brakes from now on, metres."""
    paths, radius = commitments(traffic), traffic.people.radius[traffic.present]
    away = np.linalg.norm(paths[:, None] - paths[None, :], axis=-1).min(axis=-1)
    gap = away - radius[:, None] - radius[None, :]
    np.fill_diagonal(gap, np.inf)
    return float(gap.min(initial=np.inf))
