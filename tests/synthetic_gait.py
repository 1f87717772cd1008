"""A walker made of formulas: where it steers, when its feet stand and how its pelvis sways are known exactly."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bodies import HIP_HEIGHT, humanoid
from stridecast.body import kinematics
from stridecast.body.legs import reach
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

WALKING_DUTY, RUNNING_DUTY = 0.62, 0.35
TOE_AHEAD = 0.12
"""The toe joint stands so far before the hips when the foot stands under them, metres."""


@dataclass(frozen=True)
class Gait:
    """A motion and the truth about it, frame by frame."""

    motion: Motion
    positions: np.ndarray  # of the vehicle
    headings: np.ndarray
    speeds: np.ndarray
    planted: np.ndarray
    phase: np.ndarray  # a multiple of 2 pi at left mid-stance, pi later at right

    def clip(self, start: int, stop: int) -> Gait:
        cut = slice(start, stop)
        return Gait(
            self.motion.clip(start, stop),
            self.positions[cut],
            self.headings[cut],
            self.speeds[cut],
            self.planted[cut],
            self.phase[cut],
        )


def smooth(u):
    """0 below 0, 1 above 1, smooth between."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10 - 15 * u + 6 * u * u)


def ramps(*pieces: tuple[float, float], rate: float = 60.0, change: float = 0.9) -> np.ndarray:
    """Speeds frame by frame: each piece is seconds and the speed held in them, with a smooth change before the next."""
    out = [np.full(round(pieces[0][0] * rate), pieces[0][1])]
    for (_, before), (seconds, after) in pairwise(pieces):
        u = np.arange(1, round(change * rate)) / (change * rate)
        out += [before + (after - before) * smooth(u), np.full(round(seconds * rate), after)]
    return np.concatenate(out)


def running_share(speeds):
    """0 for the speeds of walking, 1 for those of running."""
    return smooth((np.asarray(speeds) - 1.75) / 0.6)


def strides_per_second(speeds):
    run = running_share(speeds)
    return (1 - run) * (0.7 + 0.3 * speeds) + run * (1.1 + 0.12 * speeds)


def gait(
    speeds: np.ndarray,
    *,
    curvature: float = 0.0,
    rate: float = 60.0,
    phase: float = 0.4,
    skeleton: Skeleton | None = None,
    sway: float = 0.02,
    surge: float = 0.008,
    facing: float = 0.0,
    name: str = "gait",
) -> Gait:
    """A person who goes along a line or circle.

    Parameters
    ----------
    speeds
        m/s, frame by frame; zero is standing still.
    curvature
        One over the radius, 1/m; positive turns left.
    phase
        Gait phase of the first frame, of a take that does not begin with standing.
    sway, surge
        How far the pelvis moves to the side and forward about the vehicle, metres.
    facing
        Heading of the first frame.
    """
    skeleton = skeleton or humanoid()
    frames = len(speeds)
    size = skeleton.leg_length / 0.85
    positions, headings = _along(speeds / rate, curvature, facing)
    phases = _phases(speeds, rate, phase)
    run, go = running_share(speeds), smooth(speeds / 0.5)

    height = (
        HIP_HEIGHT * size
        - 0.03
        - 0.025 * np.minimum(speeds, 1.9)
        - 0.02 * run
        - 0.16 * run * (1 - run)
        + go * (0.018 * (1 - run) - 0.03 * run) * np.cos(2 * phases)
    )
    body = np.stack((go * sway * np.cos(phases), height, go * surge * np.sin(2 * phases)), axis=-1)
    root = ground.lift(positions) + quat.rotate(quat.about_y(headings), body)
    rotations = np.tile(quat.IDENTITY, (frames, skeleton.joints, 1))
    rotations[:, 0] = quat.multiply(quat.about_y(headings + go * 0.07 * np.sin(phases)), quat.exp(_lean(phases, go)))
    for sign, side in ((1.0, "left"), (-1.0, "right")):  # arms hang, and swing against the legs
        swing = sign * go * 0.4 * np.sin(phases)
        hang = np.tile([0.0, 0.0, -sign * 1.3], (frames, 1))
        turn = quat.multiply(quat.exp(np.stack((swing, 0 * swing, 0 * swing), axis=-1)), quat.exp(hang))
        rotations[:, skeleton.joint(f"{side}_upper_arm")] = turn

    planted = np.zeros((frames, 2), bool)
    for foot, side in enumerate(SIDES):
        toes, turns, pitch, planted[:, foot] = _foot(foot, phases, positions, headings, speeds, run, go)
        thigh, ankle, toe = skeleton.chain(f"{side}_thigh", f"{side}_foot", f"{side}_toe")
        toes[:, 1] += 0.01 * size
        level, heel_up = quat.about_y(turns), quat.exp(np.stack((pitch, 0 * pitch, 0 * pitch), axis=-1))
        world = quat.multiply(level, heel_up)
        rotations[:, ankle] = quat.multiply(quat.inverse(rotations[:, 0]), world)
        rotations[:, toe] = quat.inverse(heel_up)
        goal = toes - quat.rotate(world, skeleton.offsets[toe])
        rotations = reach(skeleton, root, rotations, side, goal)
        there = kinematics.forward(skeleton, root, rotations).positions[:, ankle]
        missed = np.linalg.norm(there - goal, axis=-1)[planted[:, foot]]
        assert missed.max(initial=0.0) < 1e-6, f"a planted foot is {missed.max():.3f} m out of reach: a wrong formula"
        assert thigh > 0
    motion = Motion(
        skeleton=skeleton,
        frame_rate=rate,
        root_positions=root,
        rotations=quat.continuous(rotations),
        name=name,
        subject="formula",
    )
    return Gait(motion, positions, headings, speeds, planted, phases)


def _lean(phases, go):
    return np.stack((0.05 * go, np.zeros_like(phases), 0.03 * go * np.cos(phases)), axis=-1)


def _along(steps, curvature, facing):
    way = np.concatenate(([0.0], np.cumsum(0.5 * (steps[1:] + steps[:-1]))))
    if abs(curvature) < 1e-9:
        points = np.stack((np.zeros_like(way), way), axis=-1)
    else:
        points = np.stack((1 - np.cos(curvature * way), np.sin(curvature * way)), axis=-1) / curvature
    return ground.turn(points, np.full(len(way), facing)), facing + curvature * way


def _phases(speeds, rate, first):
    """Phase runs with the steps, rests while standing, and meets standing in the middle of a double support."""
    moving = speeds > 1e-6
    turns = 2 * np.pi * strides_per_second(speeds) / rate * moving
    edges = np.flatnonzero(np.diff(moving)) + 1
    out = np.concatenate(([0.0], np.cumsum(0.5 * (turns[1:] + turns[:-1]))))
    if len(edges) == 0:
        return out + (np.pi / 2 if not moving[0] else first)
    # each stretch of moving between two of standing takes a whole number of steps; open ends are anchored at standing
    for start, stop in pairwise(edges):
        if moving[start]:
            taken = out[stop] - out[start - 1]
            stretch = np.pi * round(taken / np.pi) / taken
            out[stop:] += (stretch - 1) * taken
            out[start:stop] = out[start - 1] + stretch * (out[start:stop] - out[start - 1])
    anchor = edges[0] - 1 if not moving[0] else edges[0]
    return out - out[anchor] + np.pi / 2


def _foot(foot, phases, positions, headings, speeds, run, go):
    """Toe joint, its heading, pitch of the foot and contact, frame by frame."""
    frames = len(phases)
    grid = np.arange(frames)
    own = np.pi * foot
    first = int(np.floor((phases[0] - own) / (2 * np.pi))) - 1
    last = int(np.ceil((phases[-1] - own) / (2 * np.pi))) + 1
    stances = []
    for n in range(first, last + 1):
        middle = own + 2 * np.pi * n
        at = _frame_of(middle, phases)
        slow = run[int(np.clip(round(at), 0, frames - 1))]
        duty = (1 - slow) * WALKING_DUTY + slow * RUNNING_DUTY
        start, stop = (_frame_of(middle + sign * np.pi * duty, phases) for sign in (-1, 1))
        still = np.flatnonzero((speeds < 1e-6) & (grid > start - 1) & (grid < stop + 1))
        if len(still):  # stands beside the other foot
            at = float(still[0])
        place = _beyond(positions, headings, speeds, at)
        side = (1 - 2 * foot) * (0.085 - 0.03 * slow)
        ahead = TOE_AHEAD - (0.0 if len(still) else 0.07 + 0.03 * slow)
        toe = place[:2] + ground.turn(np.array([side, ahead]), np.array(place[2]))
        stances.append((start, stop, toe, place[2]))
    toes, turns, pitch, planted = np.zeros((frames, 3)), np.zeros(frames), np.zeros(frames), np.zeros(frames, bool)
    most = 0.75 + 0.15 * run
    for k, (start, stop, toe, turn) in enumerate(stances):
        on = (grid >= start) & (grid <= stop)
        planted |= on
        toes[on, 0], toes[on, 2], turns[on] = toe[0], toe[1], turn
        u = (grid[on] - start) / max(stop - start, 1e-9)
        still = speeds[min(max(round(stop), 0), frames - 1)] < 1e-6
        pitch[on] = 0.0 if still else most[on] * smooth((u - 0.5) / 0.5) * (u > 0.5)
        if k + 1 < len(stances):
            begin, _, then, turned = stances[k + 1]
            off = (grid > stop) & (grid < begin)
            u = (grid[off] - stop) / max(begin - stop, 1e-9)
            way = u - 0.8 * np.sin(2 * np.pi * u) / (2 * np.pi)
            toes[off, 0], toes[off, 2] = (toe[i] + (then[i] - toe[i]) * way for i in (0, 1))
            toes[off, 1] = (0.07 + 0.10 * run[off]) * np.sin(np.pi * u)
            turns[off] = turn + (turned - turn) * way
            pitch[off] = most[off] * (1 - smooth(u / 0.6))
    return toes, turns, pitch, planted


def _frame_of(phase, phases):
    """Frame at which a phase is reached; straight on beyond the ends."""
    rising = np.concatenate(([True], np.diff(phases) > 0))
    at, values = np.flatnonzero(rising).astype(float), phases[rising]
    if phase < values[0] or phase > values[-1] or len(values) < 2:
        end = 0 if phase < values[0] else -1
        edge = 0 if end == 0 else len(phases) - 1
        step = np.abs(phases[end] - phases[1 if end == 0 else -2])
        return edge + (phase - phases[end]) / step if step > 1e-9 else (-1e9 if end == 0 else 1e9)
    return float(np.interp(phase, values, at))


def _beyond(positions, headings, speeds, at):
    """Vehicle ``(x, z, heading)`` at a fractional frame; round the same curve beyond the ends."""
    table = np.column_stack((positions, headings))
    inside = float(np.clip(at, 0, len(table) - 1))
    value = np.array([np.interp(inside, np.arange(len(table)), column) for column in table.T])
    if at != inside:
        end = slice(0, 2) if at < inside else slice(-2, None)
        step = np.diff(table[end], axis=0)[0] * np.clip(at - inside, -200, 200)
        chord = np.linalg.norm(step[:2]) * np.sign(at - inside)
        bend = value[2] + step[2] / 2
        value = value + np.array([chord * np.sin(bend), chord * np.cos(bend), step[2]])
    return value
