"""Recordings to a gait model: observe each take, bring takes to one phase, fit what is common to all people.

    python -m stridecast.samples.fitting RECORDINGS... -o gait.safetensors --leave-out 08_05 --standing 16 127
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from stridecast.analysis.take import TakeAnalysis
from stridecast.body import kinematics
from stridecast.errors import TakeError
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import LEFT, RIGHT, SIDES
from stridecast.samples.adult import roll_over
from stridecast.samples.gait import DETAILS, FEET, RHYTHM, GaitModel, GaitTable, fourier, moved_joints

Array = np.ndarray

HARMONICS = 5

WALKING = (0.6, 2.0)
RUNNING = (2.0, 4.5)
"""Speeds of the two gaits, m/s: the middle and the unit of their speed features."""

STRONGEST = {"walk": (1.7, 1.2), "run": (1.7, 2.5)}
"""Turn (rad/s) and acceleration (m/s2) up to which there are enough examples."""

PASSING = 0.15
"""Between two moments at which the feet pass, one foot gets at least this far ahead of the other, metres."""

SLOWEST = 0.45
"""What is slower is on its way to standing, m/s."""

LONGEST_STEP = 1.1
"""Seconds from feet passing to feet passing; what is longer is a pause."""

NEARLY_FLAT = np.radians(15)
"""A standing foot pitched less than this tells where the floor is, radians, ..."""

SHORTEST_FLAT = 0.04
"""... if it stays so for this long, seconds."""

STEEPEST = np.radians(55)
"""The heel of a foot that still carries is raised no further, radians."""

SLOWEST_RUN, FASTEST_WALK = 1.55, 2.05
"""Between these speeds the bounce of the pelvis tells running from walking, m/s."""

SIDEWAYS = np.radians(50)
"""Who goes with the pelvis turned further from the way goes sideways or backwards."""

STIFFNESS = np.array([0.0, 0.01, 0.05, 0.01, 0.01, 0.05, 0.02, 0.5, 0.02])
"""How little each feature (see ``GaitTable.features``) is believed, as a share of its weight in the data."""

LIKENESS = 0.05
"""The same for what a person does differently from others."""

ROUGHNESS = 0.05
"""A harmonic is believed less the higher it is, by this times its square."""

TAIL = 2.5
"""A half cycle further off than this many times the median counts less, the more the further it is (Huber)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Observation:
    """What one take shows, frame by frame, of those frames that belong to whole steps or to standing."""

    subject: str
    take: str
    phases: Float[Array, "frames"]
    speeds: Float[Array, "frames"]
    turns: Float[Array, "frames"]
    accelerations: Float[Array, "frames"]
    running: Bool[Array, "frames"]
    steps: Float[Array, "frames"]  # number of the half cycle a frame lies in
    strides: Float[Array, "frames"]  # a second, in that half cycle
    joints: Float[Array, "frames joints 4"]
    rest: Float[Array, "frames channels"]  # feet and details
    stances: Float[Array, "stances 4"]  # speed, phases of coming down and leaving, 1 for running
    standing_joints: Float[Array, "still joints 4"]
    standing_rest: Float[Array, "still channels"]


def observe(analysis: TakeAnalysis, subject: str, take: str) -> Observation:
    """Observe a take on the samples' skeleton.

    Raises
    ------
    TakeError
        Nothing in it is a whole step, and nobody stands in it.
    """
    motion, vehicle = analysis.motion, analysis.vehicle
    rate, skeleton = motion.frame_rate, motion.skeleton
    ahead, passings = _passings(analysis)
    heights = signals.lowpass(motion.root_positions[:, 1], rate, 6.0)
    phases, steps, strides, running = (np.full(motion.frames, np.nan) for _ in range(4))
    for number, ((start, side), (stop, other)) in enumerate(zip(passings, passings[1:], strict=False)):
        frames = np.arange(int(np.ceil(start)), int(np.ceil(stop)))
        if not _is_step(analysis, frames, ahead, (stop - start) / rate) or side == other:
            continue
        phases[frames] = np.pi * (side + (frames - start) / (stop - start))
        steps[frames], strides[frames] = number, rate / (stop - start) / 2
        running[frames] = _is_run(heights[frames], float(vehicle.speeds[frames].mean()))
    known = np.isfinite(phases)
    if not known.any() and not analysis.contacts.standing.any():
        raise TakeError("it shows no whole step and no standing")
    feet = _level_feet(analysis, known)
    floor = _floor(analysis, feet)
    rest = _rest_channels(analysis, feet, floor)
    moved = motion.rotations[:, moved_joints(skeleton)]
    still = analysis.contacts.standing
    return Observation(
        subject=subject,
        take=take,
        phases=phases[known],
        speeds=vehicle.speeds[known],
        turns=(vehicle.lateral / np.maximum(vehicle.speeds, SLOWEST))[known],
        accelerations=vehicle.tangential[known],
        running=running[known] > 0,
        steps=steps[known],
        strides=strides[known],
        joints=moved[known],
        rest=rest[known],
        stances=_stances(analysis, passings, running, floor),
        standing_joints=moved[still],
        standing_rest=rest[still],
    )


def _passings(analysis: TakeAnalysis) -> tuple[Float[Array, "frames"], list[tuple[float, int]]]:
    """How far the left ankle is ahead of the right, and when the feet pass: frame, and the foot that goes back."""
    motion = analysis.motion
    places = ground.project(kinematics.pose(motion).positions)
    left, right = (places[:, motion.skeleton.joint(f"{side}_foot")] for side in SIDES)
    way = ground.direction(analysis.vehicle.headings)
    ahead = signals.lowpass(np.sum((left - right) * way, axis=-1), motion.frame_rate, 6.0)
    at = np.flatnonzero(np.sign(ahead[1:]) != np.sign(ahead[:-1]))
    shares = ahead[at] / (ahead[at] - ahead[at + 1])
    return ahead, [(float(i + s), LEFT if ahead[i] > 0 else RIGHT) for i, s in zip(at, shares, strict=True)]


def _is_step(analysis: TakeAnalysis, frames: Array, ahead: Array, seconds: float) -> bool:
    """Whether the frames between two passings are half a cycle of somebody going forward."""
    if len(frames) < 3 or seconds > LONGEST_STEP or analysis.contacts.standing[frames].any():
        return False
    sideways = np.abs(ground.wrap(analysis.details.yaws[frames])).max() > SIDEWAYS
    slow = analysis.vehicle.speeds[frames].mean() < SLOWEST
    return bool(np.abs(ahead[frames]).max() > PASSING and not sideways and not slow)


def _is_run(heights: Float[Array, "frames"], speed: float) -> bool:
    """Whether a half cycle is one of running: the pelvis is low when the feet pass, where a walker's is high."""
    passing = (heights[0] + heights[-1]) / 2
    between = heights[len(heights) // 3 : -(len(heights) // 3)].mean()
    return speed > SLOWEST_RUN and bool(speed > FASTEST_WALK or passing < between)


def _rest_channels(
    analysis: TakeAnalysis, feet: Float[Array, "frames 2 4"], floor: Float[Array, "frames"]
) -> Float[Array, "frames channels"]:
    """Feet and motion details, the height of the pelvis told from the floor under the feet."""
    details = analysis.details
    displacements = details.displacements - np.array([0.0, 1.0, 0.0]) * floor[:, None]
    yaws = ground.wrap(details.yaws)
    tangents = quat.log(feet).reshape(len(feet), FEET)
    return np.concatenate((tangents, displacements, yaws[:, None], quat.log(details.offsets)), axis=-1)


def _level_feet(analysis: TakeAnalysis, known: Bool[Array, "frames"]) -> Float[Array, "frames 2 4"]:
    """Feet seen from the vehicle; one that stands in the middle of a stance is flat, however it was measured."""
    motion = analysis.motion
    turned = kinematics.pose(motion).rotations
    back = quat.about_y(-analysis.vehicle.headings)
    feet = []
    for column, side in enumerate(SIDES):
        planted, other = analysis.contacts.planted[:, column], analysis.contacts.planted[:, 1 - column]
        foot = quat.multiply(back, turned[:, motion.skeleton.joint(f"{side}_foot")])
        flat = analysis.contacts.standing | (planted & ~other & known)
        flat = flat if flat.any() else planted
        level = np.median(quat.log(foot[flat]), axis=0) if flat.any() else np.zeros(3)
        feet.append(quat.multiply(foot, quat.exp(-level * [1.0, 0.0, 1.0])))
    return np.stack(feet, axis=1)


def _floor(analysis: TakeAnalysis, feet: Float[Array, "frames 2 4"]) -> Float[Array, "frames"]:
    """Height of the floor along the way: recorded floors slope by centimetres a metre, and feet stand on them."""
    motion, planted = analysis.motion, analysis.contacts.planted
    world = kinematics.pose(motion).positions
    at, found = [], []
    for column, side in enumerate(SIDES):
        ankle, toe = motion.skeleton.chain(f"{side}_foot", f"{side}_toe")
        pitches = quat.to_euler(feet[:, column], "YXZ")[:, 1]
        floor = world[:, ankle, 1] - roll_over(pitches, motion.skeleton.offsets[toe])[:, 1]
        for value, start, stop in signals.runs(planted[:, column] & (np.abs(pitches) < NEARLY_FLAT)):
            if value and stop - start >= SHORTEST_FLAT * motion.frame_rate:
                at.append((start + stop - 1) / 2)
                found.append(np.median(floor[start:stop]))
    if not at:
        return np.zeros(motion.frames)
    order = np.argsort(at)
    level = np.interp(np.arange(motion.frames), np.array(at)[order], np.array(found)[order])
    return signals.lowpass(level, motion.frame_rate, 1.0)


def _stances(
    analysis: TakeAnalysis,
    passings: list[tuple[float, int]],
    running: Float[Array, "frames"],
    floor: Float[Array, "frames"],
) -> Float[Array, "stances 4"]:
    """Speed, phases of coming down and leaving, and gait of each whole stance with a passing in it.

    A foot has left when its ankle is higher than it can be while the ball still carries.
    """
    motion, found = analysis.motion, []
    heights = kinematics.pose(motion).positions[..., 1] - floor[:, None]
    for column, name in enumerate(SIDES):
        ankle, toe = motion.skeleton.chain(f"{name}_foot", f"{name}_toe")
        highest = roll_over(np.array([STEEPEST]), motion.skeleton.offsets[toe])[0, 1]
        for (before, _), (here, side), (after, _) in zip(passings, passings[1:], passings[2:], strict=False):
            frame = round(here)
            if side != column or np.isnan(running[[int(here), min(int(here) + 1, len(running) - 1)]]).any():
                continue
            for value, start, stop in signals.runs(analysis.contacts.planted[:, column]):
                if value and start <= frame < stop and start > 0 and stop < len(running):
                    high = np.flatnonzero(heights[frame:stop, ankle] > highest)
                    end = frame + int(high[0]) if len(high) else stop
                    down = np.pi * (start - 0.5 - here) / (here - before)
                    up = np.pi * (end - 0.5 - here) / (after - here)
                    found.append((analysis.vehicle.speeds[frame], down, up, running[frame]))
    return np.array(found).reshape(-1, 4)


def fit(observations: Sequence[Observation], *, standing: Collection[str] = (), provenance: str = "") -> GaitModel:
    """Fit a model to what takes show.

    Parameters
    ----------
    observations
        Of takes and of their mirror images: the model's left and right are alike only if the observations are.
    standing
        Subjects whose standing is plain standing; all if empty.
    provenance
        Words about the recordings.

    Raises
    ------
    TakeError
        Nobody walks, nobody runs, or nobody stands.
    """
    references = quat.mean(np.concatenate([o.joints[::8] for o in observations]))
    tables = {}
    for name, speeds in (("walk", WALKING), ("run", RUNNING)):
        turn, acceleration = STRONGEST[name]
        chosen = [
            _frames(o, references, (o.running == (name == "run")) & (np.abs(o.accelerations) < 1.3 * acceleration))
            for o in observations
        ]
        chosen = [c for c in chosen if len(c.speeds)]
        if not chosen:
            raise TakeError(f"nobody {name}s in these recordings")
        stances = np.concatenate([o.stances for o in observations])
        blank = GaitTable(
            coefficients=np.zeros((0, 0, 0)),
            rhythm=np.zeros(0),
            contacts=np.zeros((2, 2)),
            speeds=speeds,
            turn=turn,
            acceleration=acceleration,
        )
        tables[name] = _fit_gait(blank, chosen, stances[stances[:, 3] == (name == "run")])
    still = [o for o in observations if len(o.standing_rest) and (not standing or o.subject in standing)]
    if not still:
        raise TakeError("nobody stands in these recordings")
    takes = {o.take for o in observations}
    return GaitModel(
        references=references,
        walk=tables["walk"],
        run=tables["run"],
        stand=_stand(still, references),
        provenance={
            "recordings": provenance,
            "takes": sorted(takes),
            "subjects": sorted({o.subject for o in observations}),
        },
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Frames:
    """Frames of one take and gait."""

    subject: str
    phases: Float[Array, "frames"]
    speeds: Float[Array, "frames"]
    turns: Float[Array, "frames"]
    accelerations: Float[Array, "frames"]
    steps: Float[Array, "frames"]
    strides: Float[Array, "frames"]
    channels: Float[Array, "frames channels"]


def _frames(o: Observation, references: Float[Array, "joints 4"], wanted: Bool[Array, "frames"]) -> _Frames:
    return _Frames(
        subject=o.subject,
        phases=o.phases[wanted],
        speeds=o.speeds[wanted],
        turns=o.turns[wanted],
        accelerations=o.accelerations[wanted],
        steps=o.steps[wanted],
        strides=o.strides[wanted],
        channels=_channels(o.joints[wanted], o.rest[wanted], references),
    )


def _channels(joints: Array, rest: Array, references: Float[Array, "joints 4"]) -> Float[Array, "frames channels"]:
    tangents = quat.log(quat.multiply(quat.inverse(references), joints))
    return np.concatenate((tangents.reshape(len(joints), 3 * len(references)), rest), axis=-1)


def _fit_gait(blank: GaitTable, takes: Sequence[_Frames], stances: Float[Array, "stances 4"]) -> GaitTable:
    """Ridge regression; what a person does differently is fitted beside what is common, so that it does not pass for
    an effect of speed.
    """
    zeros = [np.zeros_like(t.speeds) for t in takes]
    usual = np.concatenate([blank.features(t.speeds, t.turns, z, z) for t, z in zip(takes, zeros, strict=True)])
    waves = np.concatenate([fourier(t.phases, HARMONICS) for t in takes])
    wanted = np.concatenate([t.channels for t in takes])
    people = sorted({t.subject for t in takes})
    who = np.concatenate([np.full(len(t.speeds), people.index(t.subject)) for t in takes])
    cycles = _numbered(takes)
    own = np.eye(len(people))[who]

    strides = np.log(np.concatenate([t.strides for t in takes]))
    column = np.concatenate((usual[:, RHYTHM], own), axis=1)
    rhythm = _regress(column, strides, _balanced(usual, cycles), len(RHYTHM))
    accelerations = np.concatenate([t.accelerations for t in takes])
    speeds, turns = (np.concatenate([getattr(t, name) for t in takes]) for name in ("speeds", "turns"))
    given = blank.features(speeds, turns, accelerations, strides - usual[:, RHYTHM] @ rhythm)

    weights = _balanced(given, cycles)
    features, terms = given.shape[1], waves.shape[1]
    columns = np.concatenate((given, own), axis=1)
    design = (columns[:, :, None] * waves[:, None]).reshape(len(given), -1)
    harmonics = (np.arange(terms) + 1) // 2
    stiffness = np.concatenate((STIFFNESS, np.full(len(people), LIKENESS)))
    roughness = 1.0 + ROUGHNESS * harmonics**2
    for _ in range(4):
        weighted = design * weights[:, None]
        size = stiffness * (weights @ columns**2)
        penalty = np.outer(size, roughness).ravel() + 1e-5 * weights.sum()
        solved = np.linalg.solve(weighted.T @ design + np.diag(penalty), weighted.T @ wanted)
        far = _distance(design @ solved - wanted, cycles)
        weights = _balanced(given, cycles) * np.minimum(1.0, TAIL * np.median(far) / far)[cycles]
    solved = solved.reshape(-1, terms, wanted.shape[1])
    coefficients = solved[:features]
    coefficients[0] += np.median(solved[features:], axis=0)  # one odd person must not bend the rest

    low, high = blank.speeds
    u = (np.clip(stances[:, 0], low, high) - (low + high) / 2) / ((high - low) / 2)
    line = np.stack((np.ones_like(u), u), axis=-1)
    contacts = np.stack([_regress(line, stances[:, column], np.ones(len(u)), 2) for column in (1, 2)])
    return GaitTable(
        coefficients=coefficients,
        rhythm=rhythm,
        contacts=contacts,
        speeds=blank.speeds,
        turn=blank.turn,
        acceleration=blank.acceleration,
    )


def _numbered(takes: Sequence[_Frames]) -> Array:
    """A number for each half cycle of all takes."""
    names = np.concatenate([np.stack((np.full(len(t.steps), i), t.steps), axis=-1) for i, t in enumerate(takes)])
    return np.unique(names, axis=0, return_inverse=True)[1].ravel()


def _balanced(given: Float[Array, "frames features"], cycles: Array) -> Float[Array, "frames"]:
    """Weights: every half cycle counts alike, and rare speeds, turns and accelerations more than common ones."""
    length = np.bincount(cycles)
    means = np.stack([np.bincount(cycles, given[:, f]) / length for f in (1, 3, 6)], axis=-1)
    cells = np.round(means / [0.25, 0.3, 0.5]).astype(int)
    _, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    return (1.0 / np.sqrt(counts[cell.ravel()]) / length)[cycles]


def _distance(missed: Float[Array, "frames channels"], cycles: Array) -> Float[Array, "cycles"]:
    """How far each half cycle is from the fit, root mean square over its channels."""
    squares = np.bincount(cycles, np.mean(missed**2, axis=1))
    return np.sqrt(squares / np.bincount(cycles)) + 1e-12


def _regress(design: Array, wanted: Array, weights: Array, count: int) -> Array:
    """Regress robustly, with a whisper of ridge; the first ``count`` coefficients."""
    spread = weights
    for _ in range(10):
        weighted = design * spread[:, None]
        ridge = 1e-3 * spread.sum() * np.eye(design.shape[1])
        ridge[0, 0] = 1e-9
        solved = np.linalg.solve(weighted.T @ design + ridge, weighted.T @ wanted)
        missed = np.abs(design @ solved - wanted)
        spread = weights * np.minimum(1.0, 1.5 * np.median(missed) / np.maximum(missed, 1e-12))
    return solved[:count]


def _stand(observations: Iterable[Observation], references: Float[Array, "joints 4"]) -> Float[Array, "channels"]:
    """Median posture over people; the vehicle stands under the pelvis."""
    people = defaultdict(list)
    for o in observations:
        people[o.subject].append(np.median(_channels(o.standing_joints, o.standing_rest, references), axis=0))
    stand = np.median([np.mean(postures, axis=0) for postures in people.values()], axis=0)
    stand[-DETAILS + 0] = stand[-DETAILS + 2] = stand[-DETAILS + 3] = 0.0
    level = stand[-DETAILS - FEET : -DETAILS].reshape(2, 3)
    level[:, [0, 2]] = 0.0
    return stand
