"""A person of the gait model goes where they are told: exact vehicle, exact contacts, feet exactly planted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d

from stridecast.body import kinematics
from stridecast.errors import InputError
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import LEFT, RIGHT, SIDES
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton
from stridecast.samples.adult import adult
from stridecast.samples.gait import GaitModel, Posture, gait_model, moved_joints
from stridecast.samples.manner import NEUTRAL, Manner, Variation
from stridecast.samples.planting import Stance, lift_off, plant, smooth

Array = np.ndarray

SETS_OFF, COMES_TO_REST = 0.10, 0.15
"""Steps begin once the vehicle is faster than the first, and end when it is slower than the second, m/s."""

EASE = 0.12
"""The rhythm of steps comes and goes within this time, seconds."""

FULL_GAIT = 0.55
"""From this speed on the body walks; below it walking fades into standing, m/s."""

CHANGE = 0.16
"""Walking becomes running within about twice this time, seconds."""

FASTEST_WALK, FASTEST_RUN = 2.4, 5.0
"""Nobody is asked to go faster, m/s: somewhat beyond what the model has learned, the steps no longer reach."""

RATES = (10.0, 1000.0)
"""Least and greatest frame rate, frames a second."""

SLOWEST_RUN = (1.1, 1.9)
"""Who gathers speed for a run, or brakes from one, walks below the first speed and runs above the second, m/s."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleTake:
    """A motion and the truth about it, frame by frame.

    Parameters
    ----------
    motion
        What a camera would have recorded.
    positions, headings, speeds
        Of the vehicle: ground points, radians (not wrapped), m/s.
    phases
        Gait phase: a multiple of 2 pi at left mid-stance, pi more at right; it rests while standing.
    planted
        Which foot stands, left and right.
    running
        Whether the gait is running.
    style
        ``neutral``, ``brisk`` or ``gloomy``.
    """

    motion: Motion
    positions: Float[Array, "frames 2"]
    headings: Float[Array, "frames"]
    speeds: Float[Array, "frames"]
    phases: Float[Array, "frames"]
    planted: Bool[Array, "frames 2"]
    running: Bool[Array, "frames"]
    style: str = "neutral"

    def __post_init__(self) -> None:
        for name, kind in _TRUTH.items():
            array: np.ndarray = np.array(getattr(self, name), kind)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def clip(self, start: int, stop: int) -> SampleTake:
        """Frames ``start`` to ``stop`` (exclusive) as a take of their own."""
        return replace(
            self, motion=self.motion.clip(start, stop), **{name: getattr(self, name)[start:stop] for name in _TRUTH}
        )


_TRUTH = {
    "positions": np.float64,
    "headings": np.float64,
    "speeds": np.float64,
    "phases": np.float64,
    "planted": np.bool_,
    "running": np.bool_,
}


def perform(
    speeds: Float[Array, "frames"],
    turns: Float[Array, "frames"],
    *,
    running: Bool[Array, "frames"] | None = None,
    rate: float = 60.0,
    manner: Manner = NEUTRAL,
    seed: int = 0,
    variation: float = 1.0,
    name: str = "sample",
    model: GaitModel | None = None,
) -> SampleTake:
    """Walk, run and stand along a way.

    Parameters
    ----------
    speeds
        Of the vehicle, m/s; zero is standing, up to 2.4 is walked and up to 5 run. Smooth: what it does, the body must
        follow.
    turns
        Turning of the vehicle to the left, rad/s.
    running
        Where to run; left out, above 2.05 m/s.
    rate
        Frames a second, 10 to 1000.
    manner
        The style.
    seed, variation
        No stride is like another: by chance, and how much (0 for none).
    model
        The gait model; left out, the one that comes with the package.

    Raises
    ------
    InputError
        Fewer than two frames, shapes that differ, a number that is not finite, a speed that nobody walks or runs (the
        first such frame is named), or a rate, seed or variation that is out of bounds.
    """
    model = model or gait_model()
    skeleton = adult()
    running = np.asarray(speeds > 2.05) if running is None else running
    _check(speeds, turns, running, rate, seed, variation)
    chance = Variation(seed=seed, seconds=len(speeds) / rate, amount=variation)
    positions, headings = _route(speeds, turns, rate)
    run = gaussian_filter1d(running.astype(float), CHANGE * rate / 2, mode="nearest")
    run = run * smooth((speeds - SLOWEST_RUN[0]) / (SLOWEST_RUN[1] - SLOWEST_RUN[0]))
    phases, hurries, still = _rhythm(model, speeds, turns, run, rate, manner, chance)
    posture = _posture(model, phases, speeds, turns, run, hurries, rate, manner, chance)
    stances = _stances(model, phases, speeds, run, still)
    root, rotations = _body(skeleton, posture, positions, headings)
    stances = lift_off(skeleton, root, rotations, stances)
    planted = np.stack([_on_floor(own, len(speeds)) for own in stances], axis=-1)
    root, rotations = plant(skeleton, root, rotations, stances, headings, rate, chance)
    return SampleTake(
        motion=Motion(
            skeleton=skeleton, frame_rate=rate, root_positions=root, rotations=rotations, name=name, subject="sample"
        ),
        positions=positions,
        headings=headings,
        speeds=speeds,
        phases=_from_mid_stances(phases, stances),
        planted=planted,
        running=run > 0.5,
        style=manner.name,
    )


def _check(speeds: Array, turns: Array, running: Array, rate: float, seed: int, variation: float) -> None:
    shapes = [np.shape(series) for series in (speeds, turns, running)]
    if len(shapes[0]) != 1 or len(set(shapes)) > 1 or shapes[0][0] < 2:
        raise InputError(
            "speeds, turns and running need one number each for each frame, of two frames at least; their shapes are "
            + ", ".join(map(str, shapes))
        )
    for name, series in (("speed", speeds), ("turning", turns)):
        if not np.isfinite(series).all():
            raise InputError(f"{name} is not finite at frame {int(np.argmin(np.isfinite(series)))}")
    fastest = np.where(running, FASTEST_RUN, FASTEST_WALK)
    wrong = np.flatnonzero((speeds < 0) | (speeds > fastest))
    if len(wrong):
        at = int(wrong[0])
        gait, most = ("run", FASTEST_RUN) if running[at] else ("walked", FASTEST_WALK)
        raise InputError(f"{speeds[at]:g} m/s at frame {at} cannot be {gait}: speeds are 0 to {most:g} m/s there")
    if not RATES[0] <= rate <= RATES[1]:
        raise InputError(f"the frame rate must be {RATES[0]:g} to {RATES[1]:g} frames a second, not {rate}")
    if not (np.isfinite(variation) and variation >= 0):
        raise InputError(f"the variation must be a number from 0 on, not {variation}")
    if seed < 0:
        raise InputError(f"the seed must be a whole number from 0 on, not {seed}")


def _sum(values: Array, rate: float) -> Array:
    """Integral by trapezoids, zero at the first frame."""
    steps = 0.5 * (values[1:] + values[:-1]) / rate
    return np.concatenate((np.zeros_like(values[:1]), np.cumsum(steps, axis=0)))


def _route(speeds: Array, turns: Array, rate: float) -> tuple[Float[Array, "frames 2"], Float[Array, "frames"]]:
    headings = _sum(turns, rate)
    return _sum(speeds[:, None] * ground.direction(headings), rate), headings


def _rhythm(
    model: GaitModel, speeds: Array, turns: Array, run: Array, rate: float, manner: Manner, chance: Variation
) -> tuple[Float[Array, "frames"], Float[Array, "frames"], Bool[Array, "frames"]]:
    """Phase since the feet passed, hurry, and where the steps rest.

    Steps rest in the middle of a double support: each stretch of steps between two rests is a whole number of half
    cycles.
    """
    frames = len(speeds)
    hurries = chance.rhythm(frames) + np.log(manner.rhythm)
    given = speeds, turns, signals.lowpass(signals.rate_of_change(speeds, rate), rate, 3.0)
    strides = (1 - run) * model.walk.strides(*given) + run * model.run.strides(*given)
    pace = 2 * np.pi * strides * np.exp(hurries)
    still = np.zeros(frames, bool)
    stretches = []
    for moving, first, last in signals.runs(speeds > 1e-3):
        if not moving:
            still[first:last] = True
            continue
        fast = np.flatnonzero(speeds[first:last] > SETS_OFF)
        begin = first + int(fast[0]) if first > 0 and len(fast) else first
        quick = np.flatnonzero(speeds[first:last] > COMES_TO_REST)
        end = first + int(quick[-1]) + 1 if last < frames and len(quick) else last
        still[first:begin] = still[end:last] = True
        stretches.append((begin, end))
        grid = np.arange(frames)
        ease = np.ones(frames)
        if first > 0:
            ease *= smooth((grid - begin) / (EASE * rate))
        if last < frames:
            ease *= smooth((end - grid) / (EASE * rate))
        pace[begin:end] *= ease[begin:end]
    pace[still] = 0.0
    phases = _sum(pace, rate)
    anchor = np.pi / 2 + np.pi * (chance.seed % 2)
    if not still.any():
        return phases + 2 * np.pi * np.random.default_rng((chance.seed, 5)).uniform(), hurries, still
    for begin, end in stretches:
        if begin > 0 and end < frames:
            taken = phases[end] - phases[begin - 1]
            scale = np.pi * max(1, np.ceil(taken / np.pi - 0.05)) / taken  # rather a short step more than a lunge
            base = phases[begin - 1]
            phases[end:] += (scale - 1) * taken
            phases[begin:end] = base + scale * (phases[begin:end] - base)
    at = int(np.flatnonzero(still)[0])
    return phases - phases[at] + anchor, hurries, still


def _posture(
    model: GaitModel,
    phases: Array,
    speeds: Array,
    turns: Array,
    run: Array,
    hurries: Array,
    rate: float,
    manner: Manner,
    chance: Variation,
) -> Posture:
    """Walking and running mixed, fading into standing, in the manner asked for."""
    skeleton = adult()
    frames = len(phases)
    accelerations = signals.lowpass(signals.rate_of_change(speeds, rate), rate, 3.0)
    given = speeds, turns, accelerations, hurries
    walk, both = (1 - run)[:, None], run[:, None]
    swinging = walk * model.walk.channels(phases, *given) + both * model.run.channels(phases, *given)
    middle = walk * model.walk.middles(*given) + both * model.run.middles(*given)
    moving = middle + manner.gains(skeleton) * (swinging - middle)
    go = smooth(speeds / FULL_GAIT)[:, None]
    channels = model.stand + go * (moving - model.stand) + manner.offsets(skeleton)
    channels += chance.posture(channels.shape[1], frames)
    place = len(channels[0]) - 7
    channels[:, [place, place + 2]] += (1 - go) * chance.sway(frames)
    return model.posture(channels)


def _stances(
    model: GaitModel, phases: Array, speeds: Array, run: Array, still: Bool[Array, "frames"]
) -> tuple[list[Stance], list[Stance]]:
    """Every stance of each foot, also those cut by the ends of the take."""
    frames = len(phases)
    grid = np.arange(frames)
    rising = phases + 1e-9 * grid
    pace = [max(rising[1] - rising[0], 1e-3), max(rising[-1] - rising[-2], 1e-3)]

    def when(phase: float) -> float:
        if phase < rising[0]:
            return float((phase - rising[0]) / pace[0])
        if phase > rising[-1]:
            return float(frames - 1 + (phase - rising[-1]) / pace[1])
        return float(np.interp(phase, rising, grid))

    def contact(passing: float, phase: float, end: int) -> float:
        """When a foot comes down (0) or leaves (1), as in the gait at that moment."""
        moment = passing
        for _ in range(6):  # each comes several times closer
            share, speed = (float(np.interp(moment, grid, series)) for series in (run, speeds))
            walking, running = model.walk.stance(speed)[end], model.run.stance(speed)[end]
            moment = when(phase + (1 - share) * walking + share * running)
        return moment

    found: tuple[list[Stance], list[Stance]] = ([], [])
    for foot in (LEFT, RIGHT):
        own = np.pi * foot
        first = int(np.floor((phases[0] - own) / (2 * np.pi))) - 1
        last = int(np.ceil((phases[-1] - own) / (2 * np.pi))) + 1
        for n in range(first, last + 1):
            phase = own + 2 * np.pi * n
            passing = when(phase)
            start, stop = (contact(passing, phase, end) for end in (0, 1))
            if stop < 0 or start > frames - 1:
                continue
            low, high = max(0, int(np.ceil(start))), int(np.floor(min(stop, frames - 1))) + 1
            rests = low + np.flatnonzero(still[low:high])
            rest = (int(rests[0]), int(rests[-1]), int(rests[np.argmin(speeds[rests])])) if len(rests) else None
            found[foot].append(Stance(start=start, stop=stop, passing=passing, phase=phase, rest=rest))
    return found


def _on_floor(stances: list[Stance], frames: int) -> Bool[Array, "frames"]:
    grid, found = np.arange(frames), np.zeros(frames, bool)
    for stance in stances:
        found |= (grid >= stance.start) & (grid <= stance.stop)
    return found


def _body(
    skeleton: Skeleton, posture: Posture, positions: Array, headings: Array
) -> tuple[Float[Array, "frames 3"], Float[Array, "frames joints 4"]]:
    """The posture carried along the way; feet turned as the posture says."""
    turn = quat.about_y(headings)
    root = ground.lift(positions) + quat.rotate(turn, posture.displacements)
    rotations = np.tile(quat.IDENTITY, (len(root), skeleton.joints, 1))
    rotations[:, 0] = quat.multiply(quat.about_y(headings + posture.yaws), posture.offsets)
    rotations[:, moved_joints(skeleton)] = posture.joints
    world = kinematics.forward(skeleton, root, rotations).rotations
    for column, side in enumerate(SIDES):
        foot = skeleton.joint(f"{side}_foot")
        above = world[:, skeleton.parents[foot]]
        rotations[:, foot] = quat.multiply(quat.inverse(above), quat.multiply(turn, posture.feet[:, column]))
    return root, rotations


def _from_mid_stances(phases: Array, stances: tuple[list[Stance], list[Stance]]) -> Float[Array, "frames"]:
    """Phase counted from the middles of stances instead of the moments at which the feet pass."""
    grid = np.arange(len(phases))
    known = sorted(
        ((s.start + s.stop) / 2, s.phase) for foot in stances for s in foot if s.rest is None and s.stop > s.start
    )
    if not known:
        return phases
    at, angles = np.array(known).T
    ends = phases[1] - phases[0], phases[-1] - phases[-2]
    passed = np.interp(at, grid, phases) + ends[0] * np.minimum(at, 0.0) + ends[1] * np.maximum(at - grid[-1], 0.0)
    return phases + np.interp(phases, passed, angles - passed)  # along the phase: where it rests, it still does
