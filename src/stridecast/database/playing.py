"""Blended clips as motion: joints about the vehicle, cycles closed, feet planted (BJL 4.2, KS07 "Adding Details")."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from stridecast.body.planting import corrected, feet_of, put_feet, raised, standing, with_toes_up
from stridecast.database.clips import FIRST, LAST, Clips, toe_off
from stridecast.database.poses import sole_height, tangents_of
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.database import INTERVALS, MotionDatabase
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

RATE = 120.0
"""Feet are planted at about so many frames a second."""

FADE = 0.12
"""What differs in velocity where the parts of a cycle meet fades within this time, seconds."""

LAG = 0.05
"""The pelvis follows what is done to both feet within about this time, seconds."""

INSTANT = 1e-6
"""Times that differ by less are the same, seconds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Performance:
    """A clip that can be looked at at any time: features and vehicle over time.

    Parameters
    ----------
    skeleton, references
        As in ``MotionDatabase``.
    sole
        Height of the toe joints of flat feet, metres.
    seconds
        Length of the cycle or of the clip.
    repeats
        Whether it goes on for ever.
    features
        Features over time (see ``Examples``); of a cycle, periodic.
    way
        Vehicle over time: left, forward (m), heading (rad). Of a cycle, an arc at ``speed`` and ``turn``.
    contacts
        When each foot is planted: side, from, to, seconds.
    speed, turn
        Of a cycle's vehicle, m/s and rad/s.
    """

    skeleton: Skeleton
    references: Float[Array, "bones 4"]
    sole: float
    seconds: float
    repeats: bool
    features: CubicSpline
    way: CubicSpline | None
    contacts: tuple[tuple[int, float, float], ...]
    speed: float
    turn: float

    def vehicle(self, times: Float[Array, "frames"]) -> tuple[Float[Array, "frames 2"], Float[Array, "frames"]]:
        """Place and heading of the vehicle."""
        if self.way is not None:
            way = self.way(times)
            return way[:, :2], way[:, 2]
        headings = self.turn * times
        # The chord of an arc: as long as the arc times sin(a) / a of half its angle.
        chord = self.speed * times * np.sinc(headings / 2 / np.pi)
        return chord[:, None] * ground.direction(headings / 2), headings

    def values(self, times: Float[Array, "frames"]) -> Float[Array, "frames features"]:
        """Features at times; a cycle comes again."""
        return self.features(np.mod(times, self.seconds) if self.repeats else times)

    def pose(self, times: Float[Array, "frames"]) -> tuple[Float[Array, "frames 3"], Float[Array, "frames joints 4"]]:
        """Root positions and rotations at times."""
        positions, headings = self.vehicle(times)
        values = self.values(times)
        tilt = 3 * len(self.references)
        joints = values[:, :tilt].reshape(len(times), -1, 3)
        rotations = np.empty((len(times), len(self.references) + 1, 4))
        rotations[:, 1:] = quat.multiply(self.references, quat.exp(joints))
        rotations[:, 0] = quat.multiply(quat.about_y(headings + values[:, -1]), quat.exp(values[:, tilt : tilt + 3]))
        away = quat.rotate(quat.about_y(headings), values[:, tilt + 3 : tilt + 6])
        return ground.lift(positions) + away, rotations

    def planted(self, times: Float[Array, "frames"]) -> Bool[Array, "frames 2"]:
        """Which feet are planted at times."""
        out = np.zeros((len(times), 2), bool)
        for side, start, stop in self.contacts:
            for shift in (-self.seconds, 0.0, self.seconds) if self.repeats else (0.0,):
                at = np.mod(times, self.seconds) if self.repeats else times
                out[:, side] |= (at >= start + shift - INSTANT) & (at < stop + shift - INSTANT)
        return out

    def motion(self, times: Float[Array, "frames"], rate: float, name: str, subject: str) -> Motion:
        """The motion at times, which are a frame apart."""
        positions, rotations = self.pose(times)
        return Motion(
            skeleton=self.skeleton,
            frame_rate=rate,
            root_positions=positions,
            rotations=quat.continuous(quat.normalize(rotations)),
            name=name,
            subject=subject,
        )


def perform(
    database: MotionDatabase, clips: Clips, weights: Float[Array, "clips"], *, speed: float, turn: float
) -> Performance:
    """Blend clips, close their cycle, and plant the feet.

    Parameters
    ----------
    clips
        Clips of the database that can be blended.
    weights
        Of each, sum 1.
    speed, turn
        At which a cycle is played, m/s and rad/s; a transition goes the way that was recorded.
    """
    chosen = np.flatnonzero(weights > 0)
    rows, weights = clips.rows[chosen], weights[chosen]
    times, features, ways = _blended(database, rows, weights)
    if clips.repeats:
        features = _closed(times, features)
        start = _start(clips, times)
    else:
        start = 0.0
    length = float(sum(t[LAST] - t[FIRST] for t in times))
    begins = np.concatenate(([0.0], np.cumsum([t[LAST] - t[FIRST] for t in times])))
    knots = np.concatenate([b + t[FIRST:LAST] for b, t in zip(begins, times, strict=False)] + [[length]])
    table = np.concatenate([f[FIRST:LAST] for f in features] + [features[-1][LAST : LAST + 1]])
    if clips.repeats:
        table[-1] = table[0]
        spline = CubicSpline(knots, table, bc_type="periodic")
        again = np.linspace(0.0, length, len(knots) * 2)
        table = spline(np.mod(again + start, length))
        table[-1] = table[0]
        spline = CubicSpline(again, table, bc_type="periodic")
        way = None
    else:
        spline = CubicSpline(knots, table)
        way = CubicSpline(knots, _joined(ways))
    free = Performance(
        skeleton=database.skeleton,
        references=database.references,
        sole=sole_height(database),
        seconds=length,
        repeats=clips.repeats,
        features=spline,
        way=way,
        contacts=_contacts(clips, times, start, length),
        speed=speed,
        turn=turn,
    )
    return _with_planted_feet(free)


def recorded(database: MotionDatabase, rows: Sequence[int]) -> Performance:
    """Examples of one take, one after the other, as they were recorded: nothing closed, no foot put.

    Parameters
    ----------
    rows
        Places of the examples in the tables, each the next in its take.
    """
    columns, one = np.array(rows, np.int64)[None], np.ones(1)
    times, features, ways = _blended(database, columns, one)
    begins = np.concatenate(([0.0], np.cumsum([t[LAST] - t[FIRST] for t in times])))
    knots = np.concatenate([b + t[FIRST:LAST] for b, t in zip(begins, times, strict=False)] + [begins[-1:]])
    table = np.concatenate([f[FIRST:LAST] for f in features] + [features[-1][LAST : LAST + 1]])
    table[:, -1] = np.unwrap(table[:, -1])
    return Performance(
        skeleton=database.skeleton,
        references=database.references,
        sole=sole_height(database),
        seconds=float(begins[-1]),
        repeats=False,
        features=CubicSpline(knots, table),
        way=CubicSpline(knots, _joined(ways)),
        contacts=(),
        speed=0.0,
        turn=0.0,
    )


def _blended(
    database: MotionDatabase, rows: Int[Array, "clips examples"], weights: Float[Array, "clips"]
) -> tuple[list[Array], list[Array], list[Array]]:
    """Times, features and ways of each example of a clip, blended at equal generic times."""
    examples = database.examples
    columns = rows.T
    times = [np.tensordot(weights, examples.times[column], axes=1) for column in columns]
    features = [np.tensordot(weights, examples.features[column], axes=1) for column in columns]
    ways = [np.tensordot(weights, examples.travelled[column], axes=1) for column in columns]
    return times, features, ways


def _closed(times: Sequence[Array], features: Sequence[Array]) -> list[Array]:
    """Features of a cycle whose parts meet: half of what differs in pose is spread over either part.

    Half of what differs in velocity fades within ``FADE``: over a whole part, it would swing a limb beyond what was
    recorded.
    """
    ends: list[tuple[Array, Array]] = []
    starts: list[tuple[Array, Array]] = []
    for t, f in zip(times, features, strict=True):
        for found, row in ((starts, FIRST), (ends, LAST)):
            slope = (f[row + 1] - f[row - 1]) / (t[row + 1] - t[row - 1])
            found.append((f[row], slope))
    out = []
    for i, (t, f) in enumerate(zip(times, features, strict=True)):
        before, after = ends[i - 1], starts[(i + 1) % len(starts)]
        span = t[LAST] - t[FIRST]
        since, left = (t - t[FIRST])[:, None], (t[LAST] - t)[:, None]
        u, fade = since / span, min(FADE, span)
        at_start = [(there - here) / 2 for there, here in zip(before, starts[i], strict=True)]
        at_end = [(there - here) / 2 for there, here in zip(after, ends[i], strict=True)]
        out.append(
            f
            + at_start[0] * (1 - u) ** 2 * (1 + 2 * u)
            + at_end[0] * u**2 * (3 - 2 * u)
            + at_start[1] * since * np.maximum(1 - since / fade, 0.0) ** 2
            - at_end[1] * left * np.maximum(1 - left / fade, 0.0) ** 2
        )
    return out


def _joined(ways: Sequence[Array]) -> Float[Array, "knots 3"]:
    """Left, forward and heading of the vehicle through all parts of a clip."""
    place, heading = np.zeros(2), 0.0
    out = []
    for way in ways:
        out.append(np.column_stack((place + ground.turn(way[:, :2], np.array(heading)), heading + way[:, 2]))[FIRST:])
        place, heading = out[-1][LAST - FIRST, :2], float(out[-1][LAST - FIRST, 2])
    return np.concatenate([part[: LAST - FIRST] for part in out] + [out[-1][LAST - FIRST : LAST - FIRST + 1]])


def _key_times(clips: Clips, times: Sequence[Array]) -> list[list[float]]:
    """When the support changes in each part of a clip, seconds from the part's beginning."""
    generic = np.arange(INTERVALS + 1) / INTERVALS
    return [
        [float(np.interp(key, generic, t[FIRST : LAST + 1])) for key in group.keys]
        for group, t in zip(clips.groups, times, strict=True)
    ]


def _start(clips: Clips, times: Sequence[Array]) -> float:
    """Right toe-off, at which a cycle begins, seconds from the beginning of its first part."""
    key = toe_off(clips.groups[0])
    return 0.0 if key is None else _key_times(clips, times)[0][key]


def _contacts(
    clips: Clips, times: Sequence[Array], start: float, length: float
) -> tuple[tuple[int, float, float], ...]:
    """When each foot is on the floor; a contact of a cycle may reach over its end."""
    edges: list[tuple[float, str]] = []
    begin = 0.0
    for group, t, keys in zip(clips.groups, times, _key_times(clips, times), strict=True):
        edges += [(begin + at, state) for at, state in zip([0.0, *keys], group.string, strict=True)]
        begin += float(t[LAST] - t[FIRST])
    rounds = 3 if clips.repeats else 1
    edges = [(at + turn * length, state) for turn in range(rounds) for at, state in edges]
    edges.append((rounds * length if clips.repeats else np.inf, ""))  # what stands when a clip ends stays
    out = []
    for side, letters in enumerate(("LDS", "RDS")):
        since: float | None = None
        for at, state in edges:
            if state and state in letters:
                since = at if since is None else since
            elif since is not None:
                out.append((side, since, at))
                since = None
    if clips.repeats:  # those that begin in the second of three rounds are whole
        whole = [(side, a - start, b - start) for side, a, b in out if b - a < 1.5 * length]
        out = [(side, a - length, b - length) for side, a, b in whole if length <= a < 2 * length]
        held = {side for side, a, b in whole}
        out += [(side, 0.0, length) for side in (0, 1) if side not in held and _stands(clips, side)]
    return tuple(out)


def _stands(clips: Clips, side: int) -> bool:
    """Whether a foot never leaves the floor."""
    return all(state in ("LDS", "RDS")[side] for group in clips.groups for state in group.string)


def _with_planted_feet(free: Performance) -> Performance:
    """The same performance with feet that stay where they stand."""
    frames = max(24, round(free.seconds * RATE))
    step = free.seconds / frames
    rounds = 3 if free.repeats else 1  # of a cycle, the middle one: all that plants its feet is periodic there
    times = (np.arange(rounds * frames + 1) - rounds // 2 * frames) * step
    motion, planted = free.motion(times, 1 / step, "", ""), free.planted(times)
    own, sole = feet_of(motion), free.sole
    feet = raised(corrected(own, raised(standing(own, planted), sole), planted, 1 / step), sole)
    # Of a cycle the vehicle goes evenly, the recorded one did not: the pelvis follows what is done to both feet.
    lag = gaussian_filter1d((feet.toes - own.toes).mean(axis=1), LAG / step, axis=0, mode="nearest")
    motion = with_toes_up(put_feet(replace(motion, root_positions=motion.root_positions + lag), feet, planted))
    positions, headings = free.vehicle(times)
    away = quat.rotate(quat.about_y(-headings), motion.root_positions - ground.lift(positions))
    joints = tangents_of(free.references, motion.rotations)
    table = free.values(times)
    table[:, : joints.shape[1]], table[:, -4:-1] = joints, away
    if free.repeats:
        table, times = table[frames : 2 * frames + 1], times[frames : 2 * frames + 1]
        table[-1] = table[0]
    features = CubicSpline(times, table, bc_type="periodic" if free.repeats else "not-a-knot")
    return replace(free, features=features)
