"""Blending, joining and looping of clips (BJL 4.2): vehicle, body and feet of several recordings made one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from stridecast.analysis.take import TakeAnalysis
from stridecast.errors import InputError, MotionError, TakeError
from stridecast.geometry import blending, ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.geometry.timewarp import TimeWarp, incremental, invert, mean_keys
from stridecast.model.clip import Clip, planted_in
from stridecast.model.contacts import LEFT, RIGHT
from stridecast.model.skeleton import Skeleton
from stridecast.synthesis.course import Course, body_of, course_of

Array = np.ndarray

POINTS_PER_FRAME = 4
"""Generic time is followed in steps so much finer than a frame."""

SLOWEST = 0.4
"""A vehicle slower than this is no reason to play a clip faster or slower, m/s."""

LARGEST_RATIO = 2.2
"""Nor is a difference in speed beyond this."""

LANDING = 0.6
"""A foot that must come down to where the next clip has it standing does so in this part of the transition."""

MATCHING = 0.12
"""How much the speed of joints counts beside their place where clips are joined, seconds."""

UNLIKE = 25.0
"""A foot that stands in one pose and not in the other makes them so much less alike, rad2."""

SHORTEST_CYCLE, LONGEST_CYCLE = 0.45, 2.4
"""Nobody strides faster or slower, seconds."""


def clip_of(take: TakeAnalysis, start: int = 0, stop: int | None = None) -> Clip:
    """Frames ``start`` to ``stop`` (exclusive; the end if left out) of an analysed take."""
    support = "".join(phase.state * (phase.stop - phase.start) for phase in take.gait.phases)
    whole = Clip(motion=take.motion, positions=take.vehicle.positions, headings=take.vehicle.headings, support=support)
    return whole if start == 0 and stop is None else whole.cut(start, take.motion.frames if stop is None else stop)


def blend(
    clips: Sequence[Clip], weights: Sequence[float] | Sequence[Sequence[float]] | Float[Array, "clips *points"]
) -> Clip:
    """Blend clips that show the same support states in the same order.

    They are warped so that their states change at the same generic time; time itself is blended too (incremental time
    warping). Joints are averaged as rotations (BJL eq. 3), the vehicle by what it does from frame to frame, the feet in
    the vehicle's frame; a planted foot moves over the floor as much as it does in the clips, on average. One clip with
    all the weight comes back as it is.

    Parameters
    ----------
    clips
        On one skeleton.
    weights
        At least zero and with sum one: a number a clip, or for each clip values evenly over the way, for weights that
        change on it.

    Returns
    -------
    Clip
        At the highest frame rate among the clips; it begins at the mean of where they begin.

    Raises
    ------
    MotionError
        No clips, different skeletons, or different strings; the message shows them.
    InputError
        Weights that are not one a clip, negative, not finite, or of another sum than one.
    """
    shares = _checked(clips, weights)
    strings = [clip.string for clip in clips]
    if len(set(strings)) > 1:
        shown = ", ".join(f"{clip.motion.name or number}: {clip.string}" for number, clip in enumerate(clips))
        raise MotionError(f"only clips with the same support states in the same order can be blended, not {shown}")
    rate = max(clip.motion.frame_rate for clip in clips)
    changes = [_changes(clip) for clip in clips]
    keys = mean_keys(changes)
    warps = [TimeWarp(keys, own) for own in changes]
    generic = _generic_times(warps, shares, rate, max(clip.motion.frames for clip in clips))
    letters = np.searchsorted(keys[1:-1], generic, side="right")
    support = "".join(strings[0][letter] for letter in letters)
    courses = [
        course_of(clip, warp.to_own(generic) * clip.motion.frame_rate, rate, planted_in(support))
        for clip, warp in zip(clips, warps, strict=True)
    ]
    name = " + ".join(clip.motion.name for clip, share in zip(clips, shares, strict=True) if share.any())
    motion, positions, headings = body_of(_mixed(courses, _at(shares, generic)), name)
    return Clip(motion=motion, positions=positions, headings=headings, support=support)


def _checked(clips: Sequence[Clip], weights: object) -> Float[Array, "clips points"]:
    """Weights as a table, one column if they do not change."""
    if not clips:
        raise MotionError("there is nothing to blend: at least one clip is needed")
    first = clips[0].motion.skeleton
    for clip in clips:
        _check_same_body(first, clip.motion.skeleton)
        if clip.motion.frames < 2:
            raise MotionError(f"clip {clip.motion.name!r} has a single frame; two are the least that can be blended")
    table = np.asarray(weights, np.float64)
    table = table[:, None] if table.ndim == 1 else table
    if table.ndim != 2 or len(table) != len(clips) or table.shape[1] == 0:
        raise InputError(f"weights must be one a clip ({len(clips)} clips), not of shape {table.shape}")
    if not np.isfinite(table).all() or (table < 0).any() or np.abs(table.sum(axis=0) - 1).max() > 1e-6:
        raise InputError(f"weights must be at least zero with sum one, not {np.asarray(weights).tolist()}")
    return table / table.sum(axis=0)


def _check_same_body(one: Skeleton, other: Skeleton) -> None:
    same = one.names == other.names and np.array_equal(one.parents, other.parents)
    if not same or np.abs(one.offsets - other.offsets).max() > 1e-6:
        raise MotionError("clips must be on one skeleton: carry one over to the other's first (body.retargeting)")


def _changes(clip: Clip) -> Float[Array, "keys"]:
    """First moment, changes of support (half-way between frames), last moment; seconds."""
    changes = [n - 0.5 for n in range(1, clip.motion.frames) if clip.support[n] != clip.support[n - 1]]
    return np.array([0.0, *changes, clip.motion.frames - 1.0]) / clip.motion.frame_rate


def _at(shares: Float[Array, "clips points"], generic: Float[Array, "frames"]) -> Float[Array, "clips frames"]:
    """Weights at generic times."""
    if shares.shape[1] == 1:
        return np.repeat(shares, len(generic), axis=1)
    evenly = np.linspace(0, 1, shares.shape[1])
    return np.stack([np.interp(generic, evenly, own) for own in shares])


def _generic_times(
    warps: Sequence[TimeWarp], shares: Float[Array, "clips points"], rate: float, longest: int
) -> Float[Array, "frames"]:
    """Generic time of each frame of a blend."""
    count = max(POINTS_PER_FRAME * longest, 64)
    points, passed = incremental(warps, _at(shares, np.linspace(0, 1, count)), count)
    frames = max(round(float(passed[-1]) * rate), 1) + 1
    moments = np.linspace(0, passed[-1], frames)
    if shares.shape[1] > 1:
        return np.interp(moments, passed, points)

    def time(generic: Array) -> Array:
        return np.tensordot(shares[:, 0], np.stack([warp.to_own(generic) for warp in warps]), axes=1)

    return invert(time, points, passed, moments)


def _mixed(courses: Sequence[Course], weights: Float[Array, "clips frames"]) -> Course:
    """Weighted sum of courses."""
    first = courses[int(np.argmax(weights.mean(axis=1)))]
    between = 0.5 * (weights[:, 1:] + weights[:, :-1])
    vectors = np.stack([course.vectors for course in courses])
    vectors[..., 3] -= 2 * np.pi * np.round((vectors[:, :1, 3] - first.vectors[0, 3]) / (2 * np.pi))
    starts = np.stack([course.start for course in courses])
    starts[:, 2] = first.start[2] + ground.wrap(starts[:, 2] - first.start[2])
    return replace(
        first,
        start=weights[:, 0] @ starts,
        ways=np.einsum("cf,cfk->fk", between, np.stack([course.ways for course in courses])),
        vectors=np.einsum("cf,cfk->fk", weights, vectors),
        turns=blending.blend(np.stack([course.turns for course in courses]), weights),
        heights=np.einsum("cf,cfs->fs", weights, np.stack([course.heights for course in courses])),
        steps=np.einsum("cf,cfsk->fsk", between, np.stack([course.steps for course in courses])),
    )


def transition(a: Clip, b: Clip, seconds: float = 0.5, *, search: float = 1.0) -> Clip:
    """Join two clips: ``a``, and ``b`` from where it is most like the end of ``a``, moved to its place and heading.

    Where poses meet, what ``b`` differs from ``a`` in place and speed, joint by joint, fades within ``seconds``
    (inertialisation, Bollo 2018). About the join both clips are played faster or slower, so that the vehicle passes
    smoothly from one speed to the other without a foot that slides. A foot that stands on both sides stays where it is;
    one that should stand already is brought down first.

    Parameters
    ----------
    a, b
        On one skeleton.
    seconds
        How long what differs takes to fade, and the speed to change.
    search
        The join is looked for in so much of the end of ``a`` and of the beginning of ``b``, seconds: where poses and
        their speeds are most alike (BJL eq. 4) and the same feet stand. Zero joins the very end to the very beginning.

    Returns
    -------
    Clip
        At the higher of the two frame rates. It begins where ``a`` does.

    Raises
    ------
    MotionError
        Clips on different skeletons or of fewer than four frames.
    InputError
        Times that are negative or not finite.
    """
    _check_same_body(a.motion.skeleton, b.motion.skeleton)
    for clip in (a, b):
        if clip.motion.frames < 4:
            raise MotionError(f"clip {clip.motion.name!r} has {clip.motion.frames} frames; a join needs four or more")
    if not (np.isfinite(seconds) and seconds > 0 and np.isfinite(search) and search >= 0):
        raise InputError(f"seconds must be above zero and search at least zero, not {seconds} and {search}")
    rate = max(a.motion.frame_rate, b.motion.frame_rate)
    a, b = (_at_rate(clip, rate) for clip in (a, b))
    leave, enter = _best_join(a, b, round(search * rate))
    half = max(round(0.5 * seconds * rate), 1)
    ratio = _speed_near(b, enter) / _speed_near(a, leave)
    times_a = leave - _played(ratio, half, leave)
    times_b = enter + _played(1 / ratio, half, b.motion.frames - 1 - enter)
    # The first frame of one and the last of the other are whole ones, and so are all that are played as they were.
    times_a, times_b = times_a[::-1] - times_a[-1], times_b + (b.motion.frames - 1 - times_b[-1])
    before, after = _sampled(a, times_a, rate), _sampled(b, times_b, rate)

    u = np.minimum(np.arange(1, after.frames) / (seconds * rate), 1.0)
    planted = np.concatenate((before.planted, _landing(before, after, u)))
    gains = 0.5 * (before.ways[-1] - before.ways[-2] + after.ways[1] - after.ways[0])
    differs = before.ways[-1] + gains - after.ways[0]
    vectors, turns = _inertialised(before, after, u, seconds * rate)
    joined = replace(
        before,
        ways=np.concatenate((before.ways, after.ways + _fading(u)[:, None] * differs)),
        heights=np.concatenate((before.heights, after.heights[1:])),
        steps=np.concatenate((before.steps, after.steps)),
        planted=planted,
        vectors=vectors,
        turns=turns,
    )
    motion, positions, headings = body_of(joined, f"{a.motion.name} > {b.motion.name}", fixed=before.frames)
    rest = _letters(_support_at(b, times_b[1:]), planted[before.frames :])
    return Clip(motion=motion, positions=positions, headings=headings, support=_support_at(a, times_a) + rest)


def _speed_near(clip: Clip, frame: int) -> float:
    """Speed of the vehicle about a frame, m/s; no slower than where time can be stretched."""
    width = round(0.25 * clip.motion.frame_rate)
    near = clip.cut(max(0, frame - width), min(clip.motion.frames, frame + width + 1))
    return max(near.speed, SLOWEST)


def _played(ratio: float, half: int, frames: int) -> Float[Array, "steps"]:
    """Frames that a clip plays on from the join, frame by frame; ``ratio``: the other's speed over its own.

    At the join the vehicle goes at the mean of both speeds, ``half`` frames from there at the clip's own.
    """
    ratio = min(max(ratio, 1 / LARGEST_RATIO), LARGEST_RATIO)
    other = 1 - signals.smooth(0.5 + 0.5 * (np.arange(frames + half) + 0.5) / half)
    played = np.concatenate(([0.0], np.cumsum(1 + other * (ratio - 1))))
    return played[played <= frames + 1e-9]


def _sampled(clip: Clip, times: Float[Array, "frames"], rate: float) -> Course:
    return course_of(clip, times, rate, planted_in(_support_at(clip, times)))


def _support_at(clip: Clip, times: Float[Array, "frames"]) -> str:
    last = clip.motion.frames - 1
    return "".join(clip.support[min(max(round(time), 0), last)] for time in times.tolist())


def _fading(u: Float[Array, "frames"]) -> Float[Array, "frames"]:
    """From 1 to 0, level at the start and smooth to the second derivative at the end."""
    return (1 - u) ** 3 * (1 + 3 * u)


def _inertialised(
    before: Course, after: Course, u: Float[Array, "frames"], span: float
) -> tuple[Float[Array, "all 10"], Float[Array, "all turning 4"]]:
    """Vectors and rotations of ``before``, then of ``after`` with what is left of the difference between them."""
    place, speed = _fading(u), u * (1 - u) ** 3 * span
    vectors = after.vectors.copy()
    vectors[:, 3] += 2 * np.pi * np.round((before.vectors[-1, 3] - vectors[0, 3]) / (2 * np.pi))
    differs = before.vectors[-1] - vectors[0]
    ends, starts = np.diff(before.vectors[-3:], axis=0), np.diff(vectors[:3], axis=0)
    parts = (1.5 * ends[1] - 0.5 * ends[0]) - (1.5 * starts[0] - 0.5 * starts[1])
    vectors = vectors[1:] + place[:, None] * differs + speed[:, None] * parts

    def turned(p: Array, q: Array) -> Array:
        return quat.log(quat.multiply(quat.inverse(p), q))

    twisted = turned(after.turns[0], before.turns[-1])
    ends, starts = turned(before.turns[-3:-1], before.turns[-2:]), turned(after.turns[:2], after.turns[1:3])
    parts = (1.5 * ends[1] - 0.5 * ends[0]) - (1.5 * starts[0] - 0.5 * starts[1])
    left = place[:, None, None] * twisted + speed[:, None, None] * parts
    turns = quat.multiply(after.turns[1:], quat.exp(left))
    return np.concatenate((before.vectors, vectors)), np.concatenate((before.turns, turns))


def _landing(before: Course, after: Course, u: Float[Array, "frames"]) -> Bool[Array, "frames 2"]:
    """Contacts after a join; a foot in the air then takes its time to land."""
    planted = after.planted[1:].copy()
    for side in range(2):
        if not before.planted[-1, side] and planted[0, side]:
            planted[u < LANDING, side] = False
    return planted


def _letters(support: str, planted: Bool[Array, "frames 2"]) -> str:
    """Support states as they were where the same feet stand, else those of the feet."""
    was = planted_in(support)
    return "".join(
        letter if (now == before).all() else "FLRD"[int(now[0]) + 2 * int(now[1])]
        for letter, now, before in zip(support, planted, was, strict=True)
    )


def _whole(clip: Clip) -> Course:
    return course_of(clip, np.arange(clip.motion.frames, dtype=float), clip.motion.frame_rate, clip.planted)


def _at_rate(clip: Clip, rate: float) -> Clip:
    """A clip at another frame rate."""
    if clip.motion.frame_rate == rate:
        return clip
    seconds = clip.motion.seconds
    count = max(round(seconds * rate), 2) + 1
    times = np.linspace(0.0, clip.motion.frames - 1.0, count)
    motion, positions, headings = body_of(_sampled(clip, times, rate), clip.motion.name)
    return Clip(motion=motion, positions=positions, headings=headings, support=_support_at(clip, times))


def _best_join(a: Clip, b: Clip, search: int) -> tuple[int, int]:
    """Frame of ``a`` and frame of ``b`` at which both are most alike."""
    last, most = a.motion.frames - 1, b.motion.frames - 4
    leaving, entering = np.arange(max(3, last - search), last + 1), np.arange(0, min(search, most) + 1)
    cost = unlike(_poses(a), _poses(b), leaving, entering)
    feet = a.planted[leaving][:, None] != b.planted[entering][None]
    lost = (last - leaving)[:, None] + entering
    cost += UNLIKE * feet.sum(axis=-1) + 1e-6 * lost
    k = int(np.argmin(cost))
    return int(leaving[k // len(entering)]), int(entering[k % len(entering)])


def _poses(clip: Clip) -> tuple[Array, Array, Array]:
    """Rotations that make a pose (the pelvis without its yaw), their rates per ``MATCHING``, weights of the joints."""
    skeleton = clip.motion.skeleton
    rotations = clip.motion.rotations.copy()
    rotations[:, 0] = quat.multiply(quat.about_y(-quat.twist_about_y(rotations[:, 0])), rotations[:, 0])
    steps = quat.log(quat.multiply(quat.inverse(rotations[:-1]), rotations[1:])) * clip.motion.frame_rate * MATCHING
    rates = np.concatenate((steps, steps[-1:]))
    counted = {joint for role, joint in skeleton.roles.items() if not role.endswith(("hand", "toe"))}
    weights = np.array([1.0 if joint in counted else 0.05 for joint in range(skeleton.joints)])
    return rotations, rates, weights


def unlike(
    a: tuple[Array, Array, Array], b: tuple[Array, Array, Array], rows: Array, columns: Array
) -> Float[Array, "rows columns"]:
    """How unlike poses and their speeds are (BJL eq. 4), rad2."""
    weights = a[2]
    turned = quat.log(quat.multiply(quat.inverse(a[0][rows][:, None]), b[0][columns][None]))
    rates = a[1][rows][:, None] - b[1][columns][None]
    return np.sum(weights * np.sum(turned**2 + rates**2, axis=-1), axis=-1)


def loop(clip: Clip) -> Clip:
    """Cut the best cycle out of a clip, from toe-off to toe-off, and make it seamless.

    What its end differs from its beginning in place and speed is spread over the whole cycle, half of it on either
    side; feet are then held as in the midst of a long row of cycles.

    Returns
    -------
    Clip
        Its last frame is the first one, moved on by one cycle: leave it out when cycles follow one another, as
        ``repeat`` does.

    Raises
    ------
    TakeError
        No whole cycle in the clip: from lifting a foot to lifting it again, with both feet landing once in between.
    """
    start, stop = _best_cycle(clip)
    course = _whole(clip)
    span = stop - start
    vectors, turns, ways = course.vectors.copy(), course.turns[start : stop + 1], course.ways[start:stop]
    mean = quat.mean(turns)
    tangents = quat.log(quat.multiply(quat.inverse(mean), course.turns))
    vectors = _closed(vectors, start, stop)
    turns = quat.multiply(mean, quat.exp(_closed(tangents, start, stop)))
    at_frames = np.concatenate((course.ways[:1], 0.5 * (course.ways[1:] + course.ways[:-1]), course.ways[-1:]))
    share = (np.arange(span) + 0.5)[:, None] / span
    ways = ways + (0.5 - share) * (at_frames[stop] - at_frames[start])

    def thrice(values: Array) -> Array:
        return np.concatenate((values[:span], values[:span], values[:span], values[:1]))

    planted = thrice(course.planted[start : stop + 1])
    long = replace(
        course,
        ways=np.tile(ways, (3, 1)),
        steps=np.tile(course.steps[start:stop], (3, 1, 1)),
        vectors=thrice(vectors),
        turns=thrice(turns),
        heights=thrice(vectors[:, [5, 8]]),
        planted=planted,
    )
    motion, positions, headings = body_of(long, f"{clip.motion.name} cycle".strip())
    support = clip.support[start:stop] + clip.support[start]
    middle = slice(span, 2 * span + 1)
    once = Clip(
        motion=motion.clip(span, 2 * span + 1), positions=positions[middle], headings=headings[middle], support=support
    )
    return place(once, clip.positions[start], float(clip.headings[start]))


def repeat(cycle: Clip, times: int) -> Clip:
    """Let a cycle that ``loop`` has made follow itself.

    Raises
    ------
    InputError
        Fewer times than one.
    """
    if times < 1:
        raise InputError(f"a cycle is repeated once or more, not {times} times")
    parts = [cycle]
    for _ in range(times - 1):
        before = parts[-1]
        parts.append(place(cycle, before.positions[-1], float(before.headings[-1])))
    kept = [part.cut(0, part.motion.frames - (part is not parts[-1])) for part in parts]
    motion = replace(
        cycle.motion,
        root_positions=np.concatenate([part.motion.root_positions for part in kept]),
        rotations=quat.continuous(np.concatenate([part.motion.rotations for part in kept])),
    )
    return Clip(
        motion=motion,
        positions=np.concatenate([part.positions for part in kept]),
        headings=np.concatenate([part.headings for part in kept]),
        support="".join(part.support for part in kept),
    )


def place(clip: Clip, position: Float[Array, "2"], heading: float) -> Clip:
    """Move a clip on the ground so that its vehicle begins at a ground point with a heading (radians)."""
    turn = heading - float(clip.headings[0])
    around = quat.about_y(turn)
    motion = clip.motion
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat.multiply(around, rotations[:, 0])
    away = motion.root_positions - ground.lift(clip.positions[0])
    return replace(
        clip,
        motion=replace(motion, root_positions=quat.rotate(around, away) + ground.lift(position), rotations=rotations),
        positions=ground.turn(clip.positions - clip.positions[0], np.array(turn)) + position,
        headings=clip.headings + turn,
    )


def _closed(values: Float[Array, "frames *shape"], start: int, stop: int) -> Float[Array, "cycle *shape"]:
    """Values from ``start`` to ``stop`` with the same value and slope at both ends."""
    slopes = np.gradient(values, axis=0, edge_order=2)
    differs, parts = values[stop] - values[start], slopes[stop] - slopes[start]
    span = stop - start
    u = (np.arange(span + 1) / span).reshape(-1, *[1] * (values.ndim - 1))
    # The cubic that is half the difference at the start and minus that at the end, slopes likewise.
    shift = differs * (0.5 - u * u * (3 - 2 * u)) + 0.5 * span * parts * u * (1 - u)
    return values[start : stop + 1] + shift


def _best_cycle(clip: Clip) -> tuple[int, int]:
    """First and last frame of the cycle whose ends are most alike."""
    rate, planted = clip.motion.frame_rate, clip.planted
    changes = np.diff(planted.astype(int), axis=0)
    found = []
    for side in (RIGHT, LEFT):
        offs = np.flatnonzero(changes[:, side] < 0) + 1
        for start, stop in pairwise(offs.tolist()):
            landings = (changes[start:stop] > 0).sum(axis=0)
            seconds = (stop - start) / rate
            if not (SHORTEST_CYCLE <= seconds <= LONGEST_CYCLE) or "S" in clip.support[start:stop]:
                continue
            if (landings == 1).all() and start > 0 and stop < clip.motion.frames - 1:
                found.append((start, stop))
        if found:
            break
    if not found:
        raise TakeError(
            f"no whole cycle in {clip.motion.name or 'the clip'!r}: a foot must leave the floor twice, and both land "
            f"once between; its support states are {clip.string}"
        )
    poses = _poses(clip)
    costs = [float(unlike(poses, poses, np.array([a]), np.array([b]))[0, 0]) for a, b in found]
    return found[int(np.argmin(costs))]
