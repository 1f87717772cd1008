"""How well clips are mined, told by recordings that are left out.

    python bench/mining.py RECORDINGS_FOLDER | DATABASE.safetensors

First, ways of weighing examples: every clip is asked for by its speed and turn (then also its style) while its whole
take is left out, and the blend is compared with it. Then the whole of mining: each take is asked for by its status,
speed and turn, without itself, and the clip that comes back is measured beside it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.optimize import linprog

import stridecast as sc
from stridecast.body import kinematics
from stridecast.database.clips import FIRST, LAST, Clips, find_clips
from stridecast.database.mining import SCALES, mine
from stridecast.database.weights import convex_weights
from stridecast.model.contacts import SIDES

Weigh = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
MOST_QUERIES = 150
STEADY = 0.4
"""Clips that change their speed faster are no cycles to compare with, m/s2."""


def nearest_alone(_wish: np.ndarray, _have: np.ndarray, apart: np.ndarray, _seconds: np.ndarray) -> np.ndarray:
    """All for the nearest clip."""
    return (np.arange(len(apart)) == np.argmin(apart)).astype(float)


def inverse_square(_wish: np.ndarray, _have: np.ndarray, apart: np.ndarray, _seconds: np.ndarray) -> np.ndarray:
    """1/d2 over all clips (BJL; for one value exactly theirs)."""
    return 1.0 / np.maximum(apart, 1e-9) ** 2


def nearest(count: int) -> Weigh:
    """1/d2 of the nearest less that of the first left out."""

    def weigh(_wish: np.ndarray, _have: np.ndarray, apart: np.ndarray, _seconds: np.ndarray) -> np.ndarray:
        order = np.argsort(apart)
        worth = 1.0 / np.maximum(apart, 1e-9) ** 2
        return np.maximum(worth - (worth[order[count]] if count < len(order) else 0.0), 0.0)

    return weigh


def gaussian(rank: int) -> Weigh:
    """Normalised Gaussian radial basis functions as wide as the distance to the neighbour of a rank."""

    def weigh(_wish: np.ndarray, _have: np.ndarray, apart: np.ndarray, _seconds: np.ndarray) -> np.ndarray:
        width = max(np.sort(apart)[min(rank, len(apart) - 1)], 1e-6)
        return np.exp(-0.5 * (apart / width) ** 2)

    return weigh


def convex(wish: np.ndarray, have: np.ndarray, apart: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """What mining uses: squares of weights, values met, none negative."""
    return convex_weights(wish, have, apart, seconds).weights


def simplex(wish: np.ndarray, have: np.ndarray, apart: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """The same with weights times squared distance, not their squares: the corners of one simplex."""
    aim = convex_weights(wish, have, apart, seconds).reached
    rows = np.vstack((np.ones(len(have)), ((have - aim) * seconds[:, None]).T))
    slack = np.eye(len(rows))
    found = linprog(
        np.concatenate((apart**2, np.full(2 * len(rows), 1e4))),
        A_eq=np.hstack((rows, slack, -slack)),
        b_eq=np.concatenate(([1.0], np.zeros(len(aim)))),
    )
    return np.maximum(found.x[: len(have)], 0.0)


WAYS: dict[str, Weigh] = {
    "nearest clip alone": nearest_alone,
    "inverse square, all": inverse_square,
    "inverse square, 4 nearest": nearest(4),
    "inverse square, 8 nearest": nearest(8),
    "Gaussian, 2nd neighbour": gaussian(1),
    "Gaussian, 5th neighbour": gaussian(4),
    "convex, squares": convex,
    "convex, simplex": simplex,
}


def compare_ways(database: sc.MotionDatabase, names: tuple[str, ...]) -> None:
    """Leave each take out, weigh the others, and compare the blend with it."""
    features, bones = database.examples.features, 3 * len(database.references)
    counted = {joint for role, joint in database.skeleton.roles.items() if not role.endswith(("hand", "toe"))} - {0}
    channels = [3 * (joint - 1) + axis for joint in sorted(counted) for axis in range(3)]
    assert max(channels) < bones
    for clips in find_clips(database):
        if clips.status not in ("walk", "run"):
            continue
        steady = clips.chosen(np.abs(clips.gain) < STEADY)
        have = np.stack([steady.values[name] / SCALES[name] for name in names], axis=-1)
        poses = features[:, FIRST : LAST + 1][..., channels][steady.rows].reshape(len(steady), -1)
        rng = np.random.default_rng(0)
        queries = rng.permutation(np.flatnonzero(steady.values["mirrored"] == 0))[:MOST_QUERIES]
        print(f"{clips.status} by {' and '.join(names)}: {len(queries)} of {len(steady)} clips asked for")
        print(f"  {'':28}{'speed':>8}{'turn':>8}{'style':>8}{'joints':>8}{'cadence':>9}{'step':>8}{'clips':>7}")
        for name, weigh in WAYS.items():
            errors = [_error(steady, have, poses, weigh, int(query)) for query in queries]
            speed, turn, style, joints, cadence, step, count = np.sqrt(np.mean(np.square(errors), axis=0))
            print(
                f"  {name:28}{speed:8.3f}{turn:8.3f}{style:8.3f}{np.degrees(joints):8.2f}"
                f"{100 * cadence:8.1f}%{100 * step:7.1f}%{count:7.1f}"
            )


def _error(clips: Clips, have: np.ndarray, poses: np.ndarray, weigh: Weigh, query: int) -> list[float]:
    values = clips.values
    others = np.flatnonzero(values["take"] != values["take"][query])
    apart = np.linalg.norm(have[others] - have[query], axis=-1)
    weights = weigh(have[query], have[others], apart, values["seconds"][others])
    weights = weights / weights.sum()
    shares = weights * values["seconds"][others]
    shares /= shares.sum()
    seconds = float(weights @ values["seconds"][others])
    got = {name: float(shares @ values[name][others]) for name in SCALES}
    apart_by = {name: got[name] - values[name][query] for name in SCALES}
    joints = float(np.sqrt(np.mean((weights @ poses[others] - poses[query]) ** 2)))
    step = got["speed"] * seconds / (values["speed"][query] * values["seconds"][query]) - 1
    return [*apart_by.values(), joints, values["seconds"][query] / seconds - 1, step, 1 / float(weights @ weights)]


def step_length(mined: sc.Mined) -> float:
    """Mean distance of the toe joint from one stance to the next of the other foot, along the way, metres."""
    positions = kinematics.pose(mined.motion).positions
    toes = [positions[:, mined.motion.skeleton.joint(f"{side}_toe")][:, [0, 2]] for side in SIDES]
    landed = []
    for side in (0, 1):
        on = mined.planted[:, side]
        starts = np.flatnonzero(on[1:] & ~on[:-1]) + 1
        landed += [(start, toes[side][start + 2 : start + 5].mean(axis=0)) for start in starts if start + 5 <= len(on)]
    landed.sort(key=lambda item: item[0])
    steps = [np.linalg.norm(b[1] - a[1]) for a, b in pairwise(landed)]
    return float(np.mean(steps)) if steps else np.nan


def truth_check(database: sc.MotionDatabase, *, same_person: bool) -> None:
    """Ask for each take without it, and measure both."""
    whose = "of the same person" if same_person else "of everybody"
    print(f"\ntakes asked for by status, speed and turn, of the other takes {whose} (mined / recorded)")
    print(f"  {'take':26}{'status':6}{'speed':>7}{'turn':>7}{'steps a second':>17}{'step, m':>15}{'joints':>8}")
    sums: dict[str, list[list[float]]] = {}
    for take in database.takes:
        told = take.annotation
        if told is None:
            continue
        quoted = f"'{take.name}'"
        for status in ("walk", "run"):
            try:
                turn = told.turn if told.statuses == (status,) else None
                own = mine(database, status=status, turn=turn, where=f"take = {quoted} and mirrored = 0", cycles=4)
                wish = {"speed": own.speed, "turn": own.turn, "subject": take.subject if same_person else None}
                other = mine(database, status=status, where=f"take != {quoted}", cycles=4, **wish)
            except sc.InputError:
                continue
            cadence = [2 / clip.cycle for clip in (other, own)]
            steps = [step_length(clip) for clip in (other, own)]
            joints = joint_difference(other, own)
            beyond = "  out of reach" if other.warnings else ""
            print(
                f"  {take.name:26}{status:6}{own.speed:7.2f}{own.turn:7.2f}{cadence[0]:9.2f} / {cadence[1]:.2f}"
                f"{steps[0]:9.2f} / {steps[1]:.2f}{np.degrees(joints):8.1f}{beyond}"
            )
            if not beyond:
                sums.setdefault(status, []).append([cadence[0] / cadence[1] - 1, steps[0] / steps[1] - 1, joints])
    for status, rows in sums.items():
        cadence, step, joints = np.nanmedian(np.abs(np.array(rows)), axis=0)
        print(
            f"{status}, {whose}: {len(rows)} takes in reach, median error of cadence {100 * cadence:.1f} %, of step "
            f"length {100 * step:.1f} %, of joints {np.degrees(joints):.1f} degrees"
        )


def joint_difference(a: sc.Mined, b: sc.Mined) -> float:
    """Angle between postures at the same share of the cycle, root mean square over joints and time, radians."""
    roles = a.motion.skeleton.roles
    joints = [joint for role, joint in roles.items() if joint and not role.endswith(("hand", "toe"))]
    share = np.linspace(0, 1, 49)
    rows = [np.round(share * (clip.motion.frames - 1) / 4).astype(int) for clip in (a, b)]
    first, second = (clip.motion.rotations[at][:, joints] for clip, at in zip((a, b), rows, strict=True))
    cosines = np.abs(np.sum(first * second, axis=-1)).clip(0, 1)
    return float(np.sqrt(np.mean((2 * np.arccos(cosines)) ** 2)))


def main() -> None:
    """Learn or load, compare and print."""
    source = Path(sys.argv[1])
    database = sc.load_database(source) if source.suffix == ".safetensors" else sc.build(source)
    compare_ways(database, ("speed",))
    compare_ways(database, ("speed", "turn"))
    compare_ways(database, ("speed", "turn", "style"))
    for same_person in (False, True):
        truth_check(database, same_person=same_person)


if __name__ == "__main__":
    main()
