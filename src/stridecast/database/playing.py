"""Blended clips as motion: joints about the vehicle, cycles closed, feet planted (BJL 4.2, KS07 "Adding Details")."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from stridecast.analysis.take import SOLE
from stridecast.body import kinematics
from stridecast.body.legs import reach
from stridecast.database.clips import FIRST, LAST, Clips, toe_off
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.database import INTERVALS, MotionDatabase
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

RATE = 120.0
"""Feet are planted at about so many frames a second."""

LANDING = 0.12
"""A foot is held ever more firmly for so long after it came down, seconds, ..."""

LANDING_SHARE = 0.25
"""... but for no more than this share of its contact."""

LEAVING = 0.2
"""What it was held back by is made up within this time once it is free, seconds."""

FADE = 0.12
"""What differs in velocity where the parts of a cycle meet fades within this time, seconds."""

INSTANT = 1e-6
"""Times that differ by less are the same, seconds."""

TIP = 0.004
"""The tips of the toes stay above this height, metres."""

LONGEST_LEG = 0.996
"""A leg reaches so far, as a part of its length; the pelvis sinks where that is too short."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Performance:
    """A clip that can be looked at at any time: features and vehicle over time.

    Parameters
    ----------
    skeleton, references
        As in ``MotionDatabase``.
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
        seconds=length,
        repeats=clips.repeats,
        features=spline,
        way=way,
        contacts=_contacts(clips, times, start, length),
        speed=speed,
        turn=turn,
    )
    return _with_planted_feet(free)


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
    out = []
    for side, letters in enumerate(("LDS", "RDS")):
        since: float | None = None
        for at, state in [*edges, (rounds * length, "")]:
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
    rounds = (-1, 2) if free.repeats else (0, 1)
    count = (rounds[1] - rounds[0]) * frames + 1
    times = (np.arange(count) + rounds[0] * frames) * step
    skeleton = free.skeleton
    roots, rotations = free.pose(times)
    world = kinematics.forward(skeleton, roots, rotations)
    ankles, planted = [], np.zeros((count, 2), bool)
    for side, name in enumerate(SIDES):
        foot, toe = skeleton.chain(f"{name}_foot", f"{name}_toe")
        own = _all_contacts(free, side)
        offsets, planted[:, side] = _holding(times, world.positions[:, toe], own, step)
        sole = quat.rotate(world.rotations[:, foot], skeleton.offsets[toe])
        goal = world.positions[:, toe] + offsets
        goal[:, 1] = np.maximum(goal[:, 1], SOLE * skeleton.leg_length)
        ankles.append(goal - sole)
    roots = roots - np.array([0.0, 1.0, 0.0]) * _drop(skeleton, world, ankles, step)[:, None]
    for side, name in enumerate(SIDES):
        rotations = _with_toes_up(skeleton, roots, reach(skeleton, roots, rotations, name, ankles[side]), name)
    positions, headings = free.vehicle(times)
    away = quat.rotate(quat.about_y(-headings), roots - ground.lift(positions))
    tangents = quat.log(quat.multiply(quat.inverse(free.references), rotations[:, 1:])).reshape(count, -1)
    tilt = tangents.shape[1]
    table = np.concatenate((tangents, free.values(times)[:, tilt : tilt + 3], away, free.values(times)[:, -1:]), axis=1)
    if free.repeats:
        table, times = table[frames : 2 * frames + 1], times[frames : 2 * frames + 1]
        table[-1] = table[0]
        features = CubicSpline(times, table, bc_type="periodic")
    else:
        features = CubicSpline(times, table)
    return Performance(
        skeleton=skeleton,
        references=free.references,
        seconds=free.seconds,
        repeats=free.repeats,
        features=features,
        way=free.way,
        contacts=free.contacts,
        speed=free.speed,
        turn=free.turn,
    )


def _with_toes_up(
    skeleton: Skeleton, roots: Float[Array, "frames 3"], rotations: Float[Array, "frames joints 4"], side: str
) -> Float[Array, "frames joints 4"]:
    """Bend the toes up where their tips would go through the floor."""
    joint = skeleton.joint(f"{side}_toe")
    ends = np.flatnonzero(skeleton.end_joints == joint)
    if len(ends) == 0:
        return rotations
    world = kinematics.forward(skeleton, roots, rotations)
    tip = quat.rotate(world.rotations[:, joint], skeleton.end_offsets[ends[0]])
    level = np.maximum(np.hypot(tip[:, 0], tip[:, 2]), 1e-9)
    length = np.maximum(np.linalg.norm(tip, axis=-1), 1e-9)
    want = np.arcsin(np.clip((TIP - world.positions[:, joint, 1]) / length, -1.0, 1.0))
    lift = np.maximum(want - np.arctan2(tip[:, 1], level), 0.0)
    axis = np.stack((-tip[:, 2] / level, np.zeros(len(tip)), tip[:, 0] / level), axis=-1)
    above = world.rotations[:, skeleton.parents[joint]]
    raised = quat.multiply(quat.exp(axis * lift[:, None]), world.rotations[:, joint])
    out = rotations.copy()
    out[:, joint] = quat.multiply(quat.inverse(above), raised)
    return out


def _all_contacts(free: Performance, side: int) -> list[tuple[float, float]]:
    """Contacts of a foot over more than three cycles, or over the clip; what stands at its beginning has stood."""
    own = [(a, b) for s, a, b in free.contacts if s == side]
    if not free.repeats:
        return [(a if a > 0 else -1.0, b) for a, b in own]
    out: list[tuple[float, float]] = []
    for a, b in sorted((a + n * free.seconds, b + n * free.seconds) for a, b in own for n in range(-3, 4)):
        if out and a - out[-1][1] < 1e-6:
            out[-1] = (out[-1][0], b)
        else:
            out.append((a, b))
    return out


def _holding(
    times: Float[Array, "frames"],
    toe: Float[Array, "frames 3"],
    contacts: Sequence[tuple[float, float]],
    step: float,
) -> tuple[Float[Array, "frames 3"], Bool[Array, "frames"]]:
    """How far the toe is moved on the ground so that it stays, and when it is held."""
    offsets, held = np.zeros_like(toe), np.zeros(len(times), bool)
    for start, stop in sorted(contacts):
        inside = np.flatnonzero((times >= start - INSTANT) & (times < stop - INSTANT))
        if len(inside) < 2:
            continue
        length = stop - start
        place = toe[inside[len(inside) // 4 : -(len(inside) // 4) or None]].mean(axis=0)
        u = np.clip((times[inside] - start) / min(LANDING, LANDING_SHARE * length), 0.0, 1.0)
        firm = u * u * (3 - 2 * u)
        if times[inside[0]] - start > step:  # cut by the beginning: it has been held before
            firm[:] = 1.0
        away = (place - toe[inside]) * [1.0, 0.0, 1.0]
        offsets[inside] = away * firm[:, None]
        held[inside] = True
        after = np.arange(inside[-1] + 1, min(inside[-1] + 1 + round(LEAVING / step), len(times)))
        v = ((times[after] - times[inside[-1]]) / LEAVING)[:, None]
        rate = (offsets[inside[-1]] - offsets[inside[-2]]) / step
        offsets[after] = offsets[inside[-1]] * (1 - v) ** 2 * (1 + 2 * v) + rate * LEAVING * v * (1 - v) ** 2
    return offsets, held


def _drop(
    skeleton: Skeleton, world: kinematics.World, ankles: Sequence[Float[Array, "frames 3"]], step: float
) -> Float[Array, "frames"]:
    """How far the pelvis sinks so that both legs reach."""
    need = np.zeros(len(ankles[0]))
    for name, ankle in zip(SIDES, ankles, strict=True):
        shin, foot = skeleton.chain(f"{name}_shin", f"{name}_foot")
        length = LONGEST_LEG * float(np.linalg.norm(skeleton.offsets[[shin, foot]], axis=-1).sum())
        away = world.positions[:, skeleton.joint(f"{name}_thigh")] - ankle
        level = np.minimum(np.hypot(away[:, 0], away[:, 2]), length)
        recorded = np.linalg.norm(
            world.positions[:, skeleton.joint(f"{name}_thigh")] - world.positions[:, foot], axis=-1
        )
        longest = np.maximum(length, recorded)  # a leg that was recorded straight may be straight
        need = np.maximum(need, away[:, 1] - np.sqrt(np.maximum(longest**2 - level**2, 0.0)))
    width = 0.05 / step
    return gaussian_filter1d(maximum_filter1d(np.clip(need, 0.0, 0.05), round(2 * width) + 1), width)
