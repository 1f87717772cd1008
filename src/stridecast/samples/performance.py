"""A person of the gait model goes where they are told: exact vehicle, exact contacts, feet exactly planted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from stridecast.body import kinematics
from stridecast.body.legs import reach
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import LEFT, RIGHT, SIDES
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton
from stridecast.samples.adult import HEEL, SOLE, adult, roll_over
from stridecast.samples.gait import GaitModel, Posture, gait_model, moved_joints
from stridecast.samples.manner import NEUTRAL, Manner, Variation

Array = np.ndarray

SETS_OFF, COMES_TO_REST = 0.10, 0.26
"""Steps begin once the vehicle is faster than the first, and end when it is slower than the second, m/s."""

EASE = 0.12
"""The rhythm of steps comes and goes within this time, seconds."""

FULL_GAIT = 0.55
"""From this speed on the body walks; below it walking fades into standing, m/s."""

CHANGE = 0.16
"""Walking becomes running within about twice this time, seconds."""

SLOWEST_RUN = (1.1, 1.9)
"""Who gathers speed for a run, or brakes from one, walks below the first speed and runs above the second, m/s."""

FLAT = 0.22
"""A foot pitched less than this in a stance is pressed flat on the floor, the more the less it is pitched, radians."""

STRAIGHTEST = np.radians(7)
"""A knee is bent at least this far: a leg pulled quite straight snaps."""

CLEARANCE = 0.012
"""A swinging foot keeps so far off the floor, metres."""

FADE = 0.1
"""What a stance does to a foot's movement is forgotten within this time of the swing, seconds."""

STANCE_WIDTH = 0.5
"""Share of a stance, about its middle, whose mean place becomes the place where the foot stands."""


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

    def clip(self, start: int, stop: int) -> SampleTake:
        """Frames ``start`` to ``stop`` (exclusive) as a take of their own."""
        names = ("positions", "headings", "speeds", "phases", "planted", "running")
        return replace(
            self, motion=self.motion.clip(start, stop), **{name: getattr(self, name)[start:stop] for name in names}
        )


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
        Of the vehicle, m/s; zero is standing. Smooth: what it does, the body must follow.
    turns
        Turning of the vehicle to the left, rad/s.
    running
        Where to run; left out, above 2.05 m/s.
    rate
        Frames a second.
    manner
        The style.
    seed, variation
        No stride is like another: by chance, and how much (0 for none).
    model
        The gait model; left out, the one that comes with the package.
    """
    model = model or gait_model()
    skeleton = adult()
    running = np.asarray(speeds > 2.05) if running is None else running
    chance = Variation(seed=seed, seconds=len(speeds) / rate, amount=variation)
    positions, headings = _route(speeds, turns, rate)
    run = gaussian_filter1d(running.astype(float), CHANGE * rate / 2, mode="nearest")
    run = run * _smooth((speeds - SLOWEST_RUN[0]) / (SLOWEST_RUN[1] - SLOWEST_RUN[0]))
    phases, hurries, still = _rhythm(model, speeds, turns, run, rate, manner, chance)
    posture = _posture(model, phases, speeds, turns, run, hurries, rate, manner, chance)
    stances = _stances(model, phases, speeds, run, still)
    planted = np.stack([_on_floor(own, len(speeds)) for own in stances], axis=-1)
    root, rotations = _body(skeleton, posture, positions, headings)
    root, rotations = _planted(skeleton, root, rotations, stances, headings, rate, chance)
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


@dataclass(frozen=True, kw_only=True)
class _Stance:
    """A foot on the floor: from when to when, when the feet pass, and when steps rest if they do (all in frames)."""

    start: float
    stop: float
    passing: float
    phase: float
    rest: tuple[int, int, int] | None  # first and last frame of rest, and one at which the vehicle stands still


def _smooth(u: Array) -> Array:
    """0 below 0, 1 above 1, smooth between."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10 - 15 * u + 6 * u * u)


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
    strides = (1 - run) * model.walk.strides(speeds, turns) + run * model.run.strides(speeds, turns)
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
            ease *= _smooth((grid - begin) / (EASE * rate))
        if last < frames:
            ease *= _smooth((end - grid) / (EASE * rate))
        pace[begin:end] *= ease[begin:end]
    pace[still] = 0.0
    phases = _sum(pace, rate)
    anchor = np.pi / 2 + np.pi * (chance.seed % 2)
    if not still.any():
        return phases + 2 * np.pi * np.random.default_rng((chance.seed, 5)).uniform(), hurries, still
    for begin, end in stretches:
        if begin > 0 and end < frames:
            taken = phases[end] - phases[begin - 1]
            scale = np.pi * max(1, round(taken / np.pi)) / taken
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
    go = _smooth(speeds / FULL_GAIT)[:, None]
    channels = model.stand + go * (moving - model.stand) + manner.offsets(skeleton)
    channels += chance.posture(channels.shape[1], frames)
    place = len(channels[0]) - 7
    channels[:, [place, place + 2]] += (1 - go) * chance.sway(frames)
    return model.posture(channels)


def _stances(
    model: GaitModel, phases: Array, speeds: Array, run: Array, still: Bool[Array, "frames"]
) -> tuple[list[_Stance], list[_Stance]]:
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

    found: tuple[list[_Stance], list[_Stance]] = ([], [])
    for foot in (LEFT, RIGHT):
        own = np.pi * foot
        first = int(np.floor((phases[0] - own) / (2 * np.pi))) - 1
        last = int(np.ceil((phases[-1] - own) / (2 * np.pi))) + 1
        for n in range(first, last + 1):
            phase = own + 2 * np.pi * n
            passing = when(phase)
            frame = int(np.clip(round(passing), 0, frames - 1))
            share, speed = run[frame], float(speeds[frame])
            walking, running = np.array(model.walk.stance(speed)), np.array(model.run.stance(speed))
            down, up = (1 - share) * walking + share * running
            start, stop = when(phase + down), when(phase + up)
            if stop < 0 or start > frames - 1:
                continue
            low, high = max(0, int(np.ceil(start))), int(np.floor(min(stop, frames - 1))) + 1
            rests = low + np.flatnonzero(still[low:high])
            rest = (int(rests[0]), int(rests[-1]), int(rests[np.argmin(speeds[rests])])) if len(rests) else None
            found[foot].append(_Stance(start=start, stop=stop, passing=passing, phase=phase, rest=rest))
    return found


def _on_floor(stances: list[_Stance], frames: int) -> Bool[Array, "frames"]:
    grid = np.arange(frames)
    return np.any([(grid >= s.start) & (grid <= s.stop) for s in stances], axis=0)


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


def _planted(
    skeleton: Skeleton,
    root: Float[Array, "frames 3"],
    rotations: Float[Array, "frames joints 4"],
    stances: tuple[list[_Stance], list[_Stance]],
    headings: Float[Array, "frames"],
    rate: float,
    chance: Variation,
) -> tuple[Float[Array, "frames 3"], Float[Array, "frames joints 4"]]:
    """The same motion with feet that stand where they stand; the pelvis sinks where a leg would not reach."""
    world = kinematics.forward(skeleton, root, rotations)
    feet = [
        _foot(skeleton, world, side, stances[column], headings, rate, chance) for column, side in enumerate(SIDES)
    ]
    root = root - np.array([0.0, 1.0, 0.0]) * _sinking(skeleton, world, [foot.ankles for foot in feet], rate)[:, None]
    for side, foot in zip(SIDES, feet, strict=True):
        ankle, toe = skeleton.chain(f"{side}_foot", f"{side}_toe")
        above = kinematics.forward(skeleton, root, rotations).rotations[:, skeleton.parents[ankle]]
        rotations[:, ankle] = quat.multiply(quat.inverse(above), foot.rotations)
        rotations = reach(skeleton, root, rotations, side, foot.ankles)
        rotations[:, toe] = foot.toes
    return root, quat.continuous(quat.normalize(rotations))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Foot:
    """Where a foot goes: ankles and rotations in the world, toes against the foot."""

    ankles: Float[Array, "frames 3"]
    rotations: Float[Array, "frames 4"]
    toes: Float[Array, "frames 4"]


def _foot(
    skeleton: Skeleton,
    world: kinematics.World,
    side: str,
    stances: list[_Stance],
    headings: Float[Array, "frames"],
    rate: float,
    chance: Variation,
) -> _Foot:
    """One foot: in a stance it rolls over heel and toe, in a swing it goes from one stance to the next."""
    ankle, toe = skeleton.chain(f"{side}_foot", f"{side}_toe")
    ball = skeleton.offsets[toe]
    angles = np.unwrap(quat.to_euler(world.rotations[:, ankle], "YXZ"), axis=0)
    ankles = world.positions[:, ankle]
    balls = ground.project(ankles + quat.rotate(world.rotations[:, ankle], ball))
    frames = len(ankles)
    places = chance.places(SIDES.index(side), len(stances))
    # Corrections to yaw, pitch, roll and ankle: known in stances, smooth between.
    corrections, known = np.zeros((frames, 6)), np.zeros(frames, bool)
    for stance, beside in zip(stances, places, strict=True):
        at = np.arange(max(0, int(np.ceil(stance.start))), min(frames - 1, int(np.floor(stance.stop))) + 1)
        if len(at) == 0:
            continue
        if stance.rest is not None:
            middle = np.array([stance.rest[2]])
        else:
            half = STANCE_WIDTH * (stance.stop - stance.start) / 2
            centre = np.clip((stance.start + stance.stop) / 2, at[0], at[-1])
            middle = at[np.abs(at - centre) <= max(half, 1.0)]
        yaw = float(angles[middle, 0].mean())
        place = balls[middle].mean(axis=0)
        if stance.rest is None:
            place = place + ground.turn(beside, headings[middle[len(middle) // 2]])
        pitches = _pitch_in_stance(angles[at, 1], ankles[at, 1], ball, at, stance, rate)
        target = ground.lift(place) + quat.rotate(quat.about_y(yaw), roll_over(pitches, ball))
        corrections[at, 0] = yaw - angles[at, 0]
        corrections[at, 1] = pitches - angles[at, 1]
        corrections[at, 2] = -angles[at, 2]
        corrections[at, 3:] = target - ankles[at]
        known[at] = True
    _bridge(corrections, known, FADE * rate)
    angles = angles + corrections[:, :3]
    turned = quat.from_euler(angles, "YXZ")
    ankles = _clear(ankles + corrections[:, 3:], turned, ball, skeleton, toe, known, rate)
    bent = np.maximum(angles[:, 1], 0.0) * _toes_flat(known, rate)
    return _Foot(ankles=ankles, rotations=turned, toes=quat.exp(-bent[:, None] * np.array([1.0, 0.0, 0.0])))


def _pitch_in_stance(pitches: Array, heights: Array, ball: Array, at: Array, stance: _Stance, rate: float) -> Array:
    """Pitch of a standing foot: first as the posture says, small ones pressed flat; later what the height of
    the ankle asks for; flat at rest.
    """
    long, level = np.hypot(ball[1], ball[2]), np.arctan2(-ball[1], ball[2])
    lifted = np.arcsin(np.clip((heights - SOLE) / long, np.sin(level), 0.98)) - level
    early = 0.6 * stance.start + 0.4 * stance.passing
    late = _smooth((at - early) / (0.6 * (stance.stop - early)))
    out = (1 - late) * pitches * _smooth(np.abs(pitches) / FLAT) + late * lifted
    if stance.rest is not None:
        first, last, _ = stance.rest
        since = stance.passing if stance.passing <= first else stance.start + 0.03 * rate
        before = 1 - _smooth((at - since) / (0.15 * rate))
        after = _smooth((at - last) / (0.2 * rate))
        out = out * np.maximum(before if stance.start > 0 else 0.0, after)
    return out


def _bridge(corrections: Float[Array, "frames 6"], known: Bool[Array, "frames"], fade: float) -> None:
    """Fill unknown stretches smoothly; slopes of the known ones fade within ``fade`` frames; constant beyond the ends."""
    for value, start, stop in signals.runs(known):
        if value:
            continue
        left, right = start - 1, stop
        if left < 0 or right >= len(known):
            corrections[start:stop] = corrections[right if left < 0 else left] if known.any() else 0.0
            continue
        span = float(right - left)
        slopes = [
            (corrections[left] - corrections[left - 1]) if left > 0 and known[left - 1] else np.zeros(6),
            (corrections[right + 1] - corrections[right])
            if right + 1 < len(known) and known[right + 1]
            else np.zeros(6),
        ]
        since = (np.arange(start, stop) - left)[:, None].astype(float)
        blend = _smooth(since / span)
        corrections[start:stop] = (
            (1 - blend) * corrections[left]
            + blend * corrections[right]
            + slopes[0] * _fading(since, min(fade, span / 2))
            - slopes[1] * _fading(span - since, min(fade, span / 2))
        )


def _fading(since: Array, fade: float) -> Array:
    """A slope of one at the start that is gone after ``fade`` frames."""
    return since * np.maximum(1 - since / fade, 0.0) ** 2


def _clear(
    ankles: Array, turned: Array, ball: Array, skeleton: Skeleton, toe: int, known: Array, rate: float
) -> Float[Array, "frames 3"]:
    """A swinging foot lifted where its heel, ball or toes would brush the floor."""
    lows = [
        ankles[:, 1] + quat.rotate(turned, HEEL)[:, 1],
        ankles[:, 1] + quat.rotate(turned, ball)[:, 1] - SOLE,
    ]
    missing = np.where(known, 0.0, np.maximum(CLEARANCE - np.minimum(*lows), 0.0))
    for value, start, stop in signals.runs(known):
        if not value and start > 0 and stop < len(known):
            u = (np.arange(start, stop) - start + 1) / (stop - start + 1)
            gate = np.sin(np.pi * u)
            need = float((missing[start:stop] * np.minimum(1.0, 3 * gate)).max())
            ankles[start:stop, 1] += need * np.sin(np.pi * u) ** 2
    return ankles


def _toes_flat(known: Array, rate: float) -> Float[Array, "frames"]:
    """Toes lie on the floor while the foot stands, and follow the foot in the swing."""
    out = np.ones(len(known))
    for value, start, stop in signals.runs(known):
        if not value:
            u = (np.arange(start, stop) - start + 1) / (stop - start + 1)
            out[start:stop] = 1 - _smooth(u / 0.35) * (1 - _smooth((u - 0.75) / 0.25))
    return out


def _sinking(
    skeleton: Skeleton, world: kinematics.World, ankles: list[Float[Array, "frames 3"]], rate: float
) -> Float[Array, "frames"]:
    """How far the pelvis must sink so that both legs reach with a bent knee, smooth in time."""
    need = np.zeros(len(ankles[0]))
    for side, goal in zip(SIDES, ankles, strict=True):
        thigh, shin, foot = skeleton.chain(f"{side}_thigh", f"{side}_shin", f"{side}_foot")
        upper, lower = (float(np.linalg.norm(skeleton.offsets[joint])) for joint in (shin, foot))
        longest = np.sqrt(upper**2 + lower**2 + 2 * upper * lower * np.cos(STRAIGHTEST))
        hip = world.positions[:, thigh]
        across = np.sum((hip - goal)[:, [0, 2]] ** 2, axis=-1)
        reach_up = np.sqrt(np.maximum(longest**2 - across, 0.0))
        need = np.maximum(need, hip[:, 1] - goal[:, 1] - reach_up)
    width = 0.05 * rate
    return gaussian_filter1d(maximum_filter1d(need, 2 * round(2 * width) + 1, mode="nearest"), width, mode="nearest")


def _from_mid_stances(phases: Array, stances: tuple[list[_Stance], list[_Stance]]) -> Float[Array, "frames"]:
    """Phase counted from the middles of stances instead of the moments at which the feet pass."""
    grid = np.arange(len(phases))
    known = sorted(
        ((s.start + s.stop) / 2, s.phase) for foot in stances for s in foot if s.rest is None and s.stop > s.start
    )
    if not known:
        return phases
    at, angles = np.array(known).T
    late = angles - np.interp(at, grid, phases)
    return phases + np.interp(grid, at, late)
