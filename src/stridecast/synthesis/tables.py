"""The database as compiled code wants it: plain arrays in one named tuple, made once for a walker."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool

from stridecast.body import kinematics
from stridecast.database.graph import UNREACHABLE, TransitionGraph, connect
from stridecast.database.poses import poses_of, sole_height
from stridecast.errors import DatabaseError
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.database import MARGIN, MotionDatabase
from stridecast.model.group import MotionGroup
from stridecast.model.segment import MOTIONS, RUN, STAND, WALK
from stridecast.model.skeleton import Skeleton
from stridecast.synthesis.styles import example_styles, style_ranges

Array = np.ndarray

STOP_TOLERANCE = 0.45
"""A stop may begin this much faster than its examples did, m/s: its last step is then taken more slowly."""

MOST_KEYS = 8
"""No string has more changes of support than this."""

FEWEST_RESTS = 6
"""Fewer starts and stops than this do not tell how people stand in a mood."""


class Tables(NamedTuple):
    """Constants of a walker. First letters of shapes: E examples, R rows, D features, G groups, J joints."""

    # examples
    features: Array  # E R D
    beginnings: Array  # E D, features of the first frames, side by side for the choice
    larger: Array  # E R D, what exaggerated movements add, single precision; none while nobody asks for another size
    times: Array  # E R
    parameters: Array  # E 3, speed at the first frame, mean tangential and lateral acceleration
    durations: Array  # E
    allowed: Array  # E, of the chosen subjects
    styles: Array  # E, from gloomy (-1) to brisk (+1)
    # groups
    first: Array  # G
    sizes: Array  # G
    comes_from: Array  # G, index of a motion
    leads_to: Array  # G
    label: Array  # G, equal for groups of one coarse motion
    follows: Array  # G G
    steps: Array  # G 3
    keys: Array  # G MOST_KEYS, padded with 2
    planted: Array  # G MOST_KEYS+1 2
    from_rest: Array  # G, begins in standing
    to_rest: Array  # G, ends in it
    entry_speed: Array  # G 2
    style_range: Array  # G 2, of its allowed examples
    jerk: Array  # G
    later_jerk: Array  # G, of the motion a group leads to if that is less
    tangential: Array  # G 2 2, first and last frame, low and high
    lateral_per_speed: Array  # G
    speed: Array  # G 2 2
    rising: Array  # G, how fast the greatest speed goes on rising after the last frame
    approach: Array  # G 3 2, speeds at which what follows a group on the way to a motion can begin
    # vehicles that move by themselves
    speeds: Array  # E R
    turning: Array  # E, how fast its vehicle turns on average, rad/s
    standing: int  # a group that only stands, -1 if there is none
    halves: Array  # 3 2, group of each motion's half cycles on the left foot and on the right; -1 if there is none
    step_off: Array  # 2, group in which the left (right) foot leaves a double support; -1 if there is none
    step_off_at: Array  # 2, generic time just before it leaves
    swings: Array  # G, share of the segment in which a foot is in the air
    slowest: float  # speed of the slowest walking (or running) that examples begin with
    fastest: float
    run_from: float  # slowest running, m/s
    walk_to: float  # fastest walking
    stances: Array  # 3 D, how gloomy, neutral and brisk people stand
    stance_styles: Array  # 3, how gloomy and brisk they are
    home: Array  # 2 2, toe joints under a standing body, left and ahead of the vehicle
    # pose
    neutral: Array  # D, how people stand who are about to go or have just come
    references: Array  # J-1 4
    feature_weights: Array  # D
    parents: Array  # J
    offsets: Array  # J 3
    legs: Array  # 2 4: thigh, shin, foot, toe
    paths: Array  # 2 P: joints from the root to the toe, padded with -1
    hinges: Array  # 2 3: axis about which the knee bends, in the shin's frame
    bones: Array  # 2 2: lengths of thigh and shin
    tips: Array  # 2 3: tips of the toes in the toes' frame; zero where the skeleton has none
    sole: float  # height of the toe joint of a flat foot


def make_tables(database: MotionDatabase, subject: str | None = None) -> Tables:
    """Tables of a database, held to one person's examples if ``subject`` is given.

    Raises
    ------
    DatabaseError
        Nobody of that name is in the database, or none of their motions can be walked with.
    """
    examples, groups = database.examples, database.groups
    allowed, styles = _allowed(database, subject), example_styles(database)
    usable = np.array([bool(allowed[g.rows].any()) for g in groups])
    graph = connect(groups, usable)
    motions = [m for m in MOTIONS if any(u and g.motion == m for u, g in zip(usable, groups, strict=True))]
    if not motions:
        whose = f" of subject {subject}" if subject else ""
        raise DatabaseError(f"the database holds no standing, walking or running{whose} to synthesise from")
    labels = sorted({g.motion for g in groups})
    skeleton = database.skeleton
    entry = np.array([_entry_speed(g, examples.parameters[g.rows][allowed[g.rows], 0]) for g in groups])
    stances, stance_styles = _stances(database, allowed, styles)
    step_off, step_off_at = _step_off(groups, usable)
    return Tables(
        features=examples.features,
        beginnings=np.ascontiguousarray(examples.features[:, MARGIN]),
        larger=np.zeros((0, *examples.features.shape[1:]), np.float32),
        times=examples.times,
        parameters=_parameters(database),
        durations=examples.durations,
        allowed=allowed,
        styles=styles,
        first=np.array([g.first for g in groups]),
        sizes=np.where(usable, [g.count for g in groups], 0),
        comes_from=np.array([MOTIONS.index(g.comes_from) for g in groups]),
        leads_to=np.array([MOTIONS.index(g.leads_to) for g in groups]),
        label=np.array([labels.index(g.motion) for g in groups]),
        follows=graph.follows,
        steps=graph.steps,
        keys=np.array([list(g.keys) + [2.0] * (MOST_KEYS - len(g.keys)) for g in groups]),
        planted=np.array([_planted(g.string) for g in groups]),
        from_rest=np.array([g.start == "S" for g in groups]),
        to_rest=np.array([g.stop == "S" for g in groups]),
        entry_speed=entry,
        style_range=style_ranges(styles, allowed, [g.rows for g in groups]),
        jerk=np.array([g.bounds.jerk for g in groups]),
        later_jerk=np.array([_later_jerk(g, groups) for g in groups]),
        tangential=np.array([g.bounds.tangential for g in groups]),
        lateral_per_speed=np.array([g.bounds.lateral_per_speed for g in groups]),
        speed=np.array([g.bounds.speed for g in groups]),
        rising=np.array([_rising(g) for g in groups]),
        approach=_approach(groups, entry, graph),
        speeds=np.ascontiguousarray(examples.travelled[:, :, 3]),
        turning=(examples.travelled[:, -1 - MARGIN, 2] - examples.travelled[:, MARGIN, 2]) / examples.durations,
        standing=next((i for i, g in enumerate(groups) if usable[i] and g.motion == STAND), -1),
        halves=_halves(groups, usable),
        step_off=step_off,
        step_off_at=step_off_at,
        swings=np.array([_swings(g) for g in groups]),
        slowest=float(
            min((e[0] for e, g, u in zip(entry, groups, usable, strict=True) if u and _goes(g)), default=0.0)
        ),
        fastest=float(
            max((e[1] for e, g, u in zip(entry, groups, usable, strict=True) if u and _goes(g)), default=np.inf)
        ),
        run_from=min(
            (e[0] for e, g, u in zip(entry, groups, usable, strict=True) if u and g.motion == RUN), default=2.0
        ),
        walk_to=max(
            (e[1] for e, g, u in zip(entry, groups, usable, strict=True) if u and g.motion == WALK), default=2.0
        ),
        stances=stances,
        stance_styles=stance_styles,
        home=_home(database, stances[1]),
        neutral=stances[1],
        references=database.references,
        feature_weights=_feature_weights(skeleton),
        parents=np.array(skeleton.parents),
        offsets=np.array(skeleton.offsets),
        legs=np.array([skeleton.chain(*(f"{s}_{part}" for part in ("thigh", "shin", "foot", "toe"))) for s in SIDES]),
        paths=_paths(skeleton),
        hinges=_hinges(database),
        bones=_bones(skeleton),
        tips=_tips(skeleton),
        sole=sole_height(database),
    )


def _allowed(database: MotionDatabase, subject: str | None) -> Bool[Array, "examples"]:
    if subject is None:
        return np.ones(len(database.examples.durations), bool)
    if subject not in database.subjects:
        raise DatabaseError(
            f"there is no subject {subject!r} in the database; there are {', '.join(database.subjects)}"
        )
    of_take = np.array([take.subject == subject for take in database.takes])
    return of_take[database.examples.takes]


def _parameters(database: MotionDatabase) -> Array:
    """What examples are chosen by: speed at the first frame, and both accelerations as means over the whole segment.

    KS07 takes the accelerations at the first frame too; but a half cycle in which a turn begins starts like a straight
    one, and straight walking would be blended with it.
    """
    examples = database.examples
    first, last = examples.travelled[:, MARGIN], examples.travelled[:, -1 - MARGIN]
    gained, turned = last[:, 3] - first[:, 3], last[:, 2] - first[:, 2]
    speed = examples.parameters[:, 0]
    lateral = turned * 0.5 * (last[:, 3] + first[:, 3]) / examples.durations
    return np.stack((speed, gained / examples.durations, lateral), axis=-1)


def _entry_speed(group: MotionGroup, speeds: Array) -> tuple[float, float]:
    """Speeds at which a group can begin: those of its examples; for a motion that repeats, those of its bounds."""
    if len(speeds) == 0:
        return 0.0, 0.0
    if group.comes_from == group.leads_to:
        return group.bounds.speed[0]
    return float(speeds.min()), float(speeds.max())


def _planted(string: str) -> Array:
    """Which feet stand in each state of a string."""
    out = np.zeros((MOST_KEYS + 1, 2), bool)
    for i, state in enumerate(string):
        out[i] = (state in "LDS", state in "RDS")
    return out


def _later_jerk(group: MotionGroup, groups: tuple[MotionGroup, ...]) -> float:
    return min([group.bounds.jerk] + [g.bounds.jerk for g in groups if g.motion == group.leads_to])


def _rising(group: MotionGroup) -> float:
    """In the midst of a transition to something faster the next segment goes on as this one ends."""
    arrived = group.stop.startswith("F") if group.leads_to == RUN else group.stop in ("L", "R")
    faster = MOTIONS.index(group.leads_to) > MOTIONS.index(group.comes_from)
    return group.bounds.tangential[1][1] if faster and not arrived else 0.0


def _approach(groups: tuple[MotionGroup, ...], entry: Array, graph: TransitionGraph) -> Array:
    """For each group and motion asked for: the speeds at which the next group on the way can begin.

    That is the follower with the fewest steps left whose speeds the group's own bounds allow to be reached.
    """
    out = np.zeros((len(groups), len(MOTIONS), 2))
    out[..., 1] = np.inf
    for i, group in enumerate(groups):
        slowest, fastest = group.bounds.speed[1]
        for m in range(len(MOTIONS)):
            ways = [k for k in np.flatnonzero(graph.follows[i]) if graph.steps[k, m] < UNREACHABLE]
            reachable = [k for k in ways if entry[k, 0] <= fastest + 0.1 and entry[k, 1] >= slowest - 0.1]
            if not reachable:
                continue
            fewest = min(graph.steps[k, m] for k in reachable)
            nearest = [k for k in reachable if graph.steps[k, m] == fewest]
            out[i, m] = entry[nearest, 0].min(), entry[nearest, 1].max() + (STOP_TOLERANCE if m == 0 else 0.0)
    return out


def _stances(database: MotionDatabase, allowed: Array, styles: Array) -> tuple[Array, Array]:
    """Features of gloomy, neutral and brisk people who stand, and their styles.

    They are those of who starts or stops: some of those who only stand do something else. Where few did in a mood,
    people stand in it as usual.
    """
    features = database.examples.features
    usual = allowed & (styles == 0.0)
    usual = usual if usual.any() else allowed
    neutral = _rests(database, usual)
    if len(neutral) == 0:
        neutral = _frames(np.flatnonzero(usual), MARGIN)
    gloomy, brisk = (_rests(database, allowed & mood) for mood in (styles < 0.0, styles > 0.0))
    found = [rests if len(rests) >= FEWEST_RESTS else neutral for rests in (gloomy, neutral, brisk)]
    stances = np.array([features[rests[:, 0], rests[:, 1]].mean(axis=0) for rests in found])
    # Who changes the mood on the spot keeps the feet where they are: all stand above the same place.
    feet = np.array([_home(database, stance).mean(axis=0) for stance in stances])
    root = 3 * (database.skeleton.joints - 1) + 3
    stances[:, [root, root + 2]] += feet[1] - feet
    return stances, np.array([styles[rests[:, 0]].mean() for rests in found])


def _rests(database: MotionDatabase, allowed: Array) -> Array:
    """Examples and rows in which who starts still stands, or who stops has come to stand."""
    last = database.examples.features.shape[1] - 1 - MARGIN
    found = [np.zeros((0, 2), np.int64)]
    for group in database.groups:
        own = np.flatnonzero(allowed[group.rows]) + group.first
        if group.comes_from == STAND != group.leads_to:
            found.append(_frames(own, MARGIN))
        elif group.leads_to == STAND != group.comes_from:
            found.append(_frames(own, last))
    return np.concatenate(found)


def _frames(examples: Array, row: int) -> Array:
    return np.stack((examples, np.full(len(examples), row)), axis=-1)


def _goes(group: MotionGroup) -> bool:
    return group.motion in (WALK, RUN)


def _halves(groups: tuple[MotionGroup, ...], usable: Bool[Array, "groups"]) -> Array:
    """The largest group of each motion's half cycles whose first foot on the floor is the left (the right) one."""
    out = np.full((len(MOTIONS), 2), -1)
    for i in np.argsort([-g.count for g in groups], kind="stable"):
        feet = [state for state in groups[i].string if state in "LR"]
        if usable[i] and _goes(groups[i]) and feet:
            motion, side = MOTIONS.index(groups[i].motion), "LR".index(feet[0])
            out[motion, side] = i if out[motion, side] < 0 else out[motion, side]
    return out


def _step_off(groups: tuple[MotionGroup, ...], usable: Bool[Array, "groups"]) -> tuple[Array, Array]:
    """Groups of walking that end with a foot leaving a double support, and a time shortly before it leaves."""
    chosen, times = np.full(2, -1), np.zeros(2)
    for i in np.argsort([-g.count for g in groups], kind="stable"):
        ends = groups[i].string[-2:]
        if usable[i] and groups[i].motion == WALK and ends in ("DL", "DR"):
            leaves = 1 if ends == "DL" else 0
            keys = (0.0, *groups[i].keys)
            if chosen[leaves] < 0:
                chosen[leaves], times[leaves] = i, 0.25 * keys[-2] + 0.75 * keys[-1]
    return chosen, times


def _swings(group: MotionGroup) -> float:
    """Share of a segment's generic time in which not both feet stand."""
    lengths = np.diff((0.0, *group.keys, 1.0))
    return float(sum(length for length, state in zip(lengths, group.string, strict=True) if state not in "DS"))


def _home(database: MotionDatabase, stance: Array) -> Array:
    """Where the toes are under somebody who stands so: left and ahead of the vehicle."""
    skeleton = database.skeleton
    rotations, root = poses_of(database.references, stance)
    world = kinematics.forward(skeleton, root, rotations)
    return world.positions[[skeleton.joint(f"{side}_toe") for side in SIDES]][:, [0, 2]]


def _feature_weights(skeleton: Skeleton) -> Array:
    """How much each feature counts when two poses are compared, 1/unit2: limbs and trunk fully, fingers hardly."""
    counted = {joint for role, joint in skeleton.roles.items() if not role.endswith(("hand", "toe"))}
    joints = np.array([1.0 if j in counted else 0.05 for j in range(1, skeleton.joints)])
    rest = [2.0, 2.0, 2.0, 60.0, 60.0, 60.0, 2.0]
    weights = np.concatenate((np.repeat(joints, 3), rest))
    return weights / weights[: 3 * (skeleton.joints - 1)].sum()


def _paths(skeleton: Skeleton) -> Array:
    paths = []
    for side in SIDES:
        joint, path = skeleton.joint(f"{side}_toe"), []
        while joint > 0:
            path.append(joint)
            joint = int(skeleton.parents[joint])
        paths.append(path[::-1])
    longest = max(len(p) for p in paths)
    return np.array([p + [-1] * (longest - len(p)) for p in paths])


def _hinges(database: MotionDatabase) -> Array:
    """Axis of each knee in the shin's frame: the mean rotation of a knee is a bend, for it bends one way only."""
    skeleton = database.skeleton
    out = []
    for side in SIDES:
        shin = skeleton.joint(f"{side}_shin")
        tangents = database.examples.features[:, MARGIN, 3 * (shin - 1) : 3 * shin]
        bends = quat.log(quat.multiply(database.references[shin - 1], quat.exp(tangents)))
        axis = bends.mean(axis=0)
        out.append(axis / np.linalg.norm(axis))
    return np.array(out)


def _bones(skeleton: Skeleton) -> Array:
    at = kinematics.rest(skeleton).positions
    legs = [skeleton.chain(*(f"{s}_{part}" for part in ("thigh", "shin", "foot"))) for s in SIDES]
    return np.array([np.linalg.norm(np.diff(at[leg], axis=0), axis=-1) for leg in legs])


def _tips(skeleton: Skeleton) -> Array:
    out = np.zeros((2, 3))
    for i, side in enumerate(SIDES):
        ends = np.flatnonzero(skeleton.end_joints == skeleton.joint(f"{side}_toe"))
        if len(ends):
            out[i] = skeleton.end_offsets[ends[0]]
    return out
