"""Walkers in a mood: they show it, keep it from step to step, change it without a pop, and keep every law."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import groupby, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stridecast.analysis.style import joint_spread, score, stoop
from stridecast.database.annotation import statuses
from stridecast.errors import WishError
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.database import MARGIN, MotionDatabase
from stridecast.model.pose import Pose
from stridecast.synthesis.choice_kernels import (
    AHEAD,
    FAR,
    LATERAL_SCALE,
    NEARBY,
    POSE_SCALE,
    SPEED_SCALE,
    STYLE_MOST,
    STYLE_SCALE,
    STYLE_TOLERANCE,
    TANGENTIAL_SCALE,
    blend_nearest,
    describe_vehicle,
)
from stridecast.synthesis.state import NEIGHBOURS, State, make_state
from stridecast.synthesis.styles import WORDS, example_styles, style_numbers
from stridecast.synthesis.tables import Tables, make_tables
from stridecast.synthesis.walker import Walker, Walkers
from walks import KINDS, motions_of, points_of, recorded, steering_of

RATE = 30.0
STYLES = (-1.0, -0.5, 0.0, 0.3, 1.0)

COURSES = {
    "strolling": ("walk", 1.07, 0.0),
    "walking": ("walk", 1.52, 0.0),
    "in a circle": ("walk", 1.2, 0.6),
    "in a small circle": ("walk", 1.1, -1.0),
    "running": ("run", 2.65, 0.0),
    "running in a circle": ("run", 3.2, 0.35),
}
"""Motion, speed (m/s) and turning (rad/s): what no sample take shows just so."""


def course(speed: float, turn: float, seconds: float) -> np.ndarray:
    """A point that stands for half a second and then goes on."""
    ahead = np.maximum(np.arange(round(seconds * RATE)) / RATE - 0.5, 0.0)
    steps = np.diff(ahead, prepend=0.0)[:, None] * speed * ground.direction(turn * ahead)
    return np.cumsum(steps, axis=0)


@cache
def walked(database: MotionDatabase, name: str) -> list[Pose]:
    """The course by one walker of each style."""
    motion, speed, turn = COURSES[name]
    walkers = Walkers(database, np.zeros((len(STYLES), 2)), style=np.array(STYLES))
    return [walkers.step(np.tile(point, (len(STYLES), 1)), motion=motion) for point in course(speed, turn, 9.0)]


def half_cycles(database: MotionDatabase, poses: list[Pose], character: int, start: int) -> dict[str, np.ndarray]:
    """Signs of style of every half cycle from a frame on."""
    groups = [pose.group[character] for pose in poses]
    cuts = [i for i in range(start, len(groups)) if groups[i] != groups[i - 1]]
    rotations = np.array([pose.rotations[character] for pose in poses])
    headings = np.array([pose.vehicle.heading[character] for pose in poses])
    speeds = np.linalg.norm([pose.vehicle.velocity[character] for pose in poses], axis=-1)
    parts = [slice(a, b + 1) for a, b in pairwise(cuts)]
    return {
        "cadence": np.array([RATE / (part.stop - 1 - part.start) for part in parts]),
        "spread": np.array([joint_spread(database.skeleton, rotations[part]) for part in parts]),
        "stoop": np.array([stoop(database.skeleton, rotations[part], headings[part]) for part in parts]),
        "speed": np.array([speeds[part].mean() for part in parts]),
    }


def bends(database: MotionDatabase, poses: list[Pose]) -> np.ndarray:
    """Stoop of every frame and character."""
    rotations = np.array([pose.rotations for pose in poses])[:, :, None]
    headings = np.array([pose.vehicle.heading for pose in poses])[:, :, None]
    return stoop(database.skeleton, rotations, headings)


def scores(database: MotionDatabase, motion: str, signs: dict[str, np.ndarray]) -> np.ndarray:
    """Style of half cycles against the neutral takes of the database, by the same measure as the database's own."""
    told, takes = database.annotations, database.examples.takes
    neutral = np.array([not take.name.startswith(("brisk", "gloomy")) for take in database.takes])
    rows = np.flatnonzero((statuses(database.groups) == motion) & neutral[takes])
    count = len(signs["cadence"])
    cadence = np.full(count, np.median(signs["cadence"]))  # whole frames tell that of a single half cycle too coarsely
    return score(
        np.zeros(len(rows) + count, int),
        np.concatenate((takes[rows], np.full(count, len(database.takes)))),
        *(
            np.concatenate((known[rows], own))
            for known, own in (
                (told.speed, signs["speed"]),
                (told.spread, signs["spread"]),
                (told.cadence, cadence),
                (told.stoop, signs["stoop"]),
            )
        ),
        known=np.arange(len(rows) + count) < len(rows),
    )[len(rows) :]


# a mood is seen, and stays


@pytest.mark.parametrize("name", list(COURSES))
def test_moods_show_in_cadence_stoop_and_spread(sample_person, name):
    poses = walked(sample_person, name)
    signs = [half_cycles(sample_person, poses, k, 110) for k in range(len(STYLES))]
    speeds = [own["speed"].mean() for own in signs]
    assert np.ptp(speeds) < 0.02 * speeds[2]  # the way is the same, what is compared is how it is gone
    gloomy, half, neutral, some, brisk = ({key: values.mean() for key, values in own.items()} for own in signs)
    assert gloomy["cadence"] < half["cadence"] < neutral["cadence"] < some["cadence"] < brisk["cadence"]
    assert gloomy["cadence"] < 0.98 * neutral["cadence"] < 0.98**2 * brisk["cadence"]
    assert gloomy["stoop"] - 0.08 > half["stoop"] > neutral["stoop"] + 0.08
    assert brisk["stoop"] < neutral["stoop"] - 0.01
    assert gloomy["spread"] < 0.7 * neutral["spread"] < 0.6 * brisk["spread"]


@pytest.mark.parametrize("name", list(COURSES))
def test_a_mood_is_kept_from_step_to_step(sample_person, name):
    poses = walked(sample_person, name)
    gloomy, half, neutral, some, brisk = (
        scores(sample_person, COURSES[name][0], half_cycles(sample_person, poses, k, 110)) for k in range(len(STYLES))
    )
    assert len(gloomy) > 6
    assert gloomy.max() < -0.75
    assert -0.9 < half.mean() < -0.4
    assert half.max() < neutral.min() < neutral.max() < brisk.min()
    assert abs(neutral.mean()) < 0.35
    assert neutral.mean() < some.mean() < brisk.mean()
    assert brisk.min() > 0.3


def test_who_stands_starts_and_stops_keeps_the_mood(sample_person):
    walkers = Walkers(sample_person, np.zeros((2, 2)), style=["gloomy", "neutral"])
    poses = [walkers.step(np.tile(point, (2, 1))) for point in np.minimum(course(1.3, 0.0, 9.0), 5.0)]
    motions = [pose.motion[0] for pose in poses]
    assert [name for name, _ in groupby(motions)] == ["stand", "stand-walk", "walk", "walk-stand", "stand"]
    gloomy, neutral = bends(sample_person, poses).T
    assert (gloomy - neutral).min() > 0.15


# changes on the way


@pytest.mark.parametrize(("before", "after"), [(0.0, -1.0), (-1.0, 1.0), (1.0, 0.0), (-0.5, 0.0)])
@pytest.mark.parametrize(("motion", "speed"), [("walk", 1.3), ("run", 2.9), ("stand", 0.0)])
def test_a_change_acts_from_the_next_half_cycle_on_without_a_pop(sample_person, motion, speed, before, after):
    change = 150
    walkers = Walkers(sample_person, np.zeros((3, 2)), style=[before, before, after])
    poses = [
        walkers.step(np.tile(point, (3, 1)), motion=motion, style=[before, before if frame < change else after, after])
        for frame, point in enumerate(course(speed, 0.0, 8.0))
    ]
    turned = np.array([pose.rotations for pose in poses])
    speeds = np.array([pose.vehicle.velocity for pose in poses])
    np.testing.assert_array_equal(turned[:change, 0], turned[:change, 1])
    stays, changed, ever = bends(sample_person, poses[change + 45 :]).mean(axis=0)
    assert abs(changed - ever) < 0.35 * abs(stays - ever)
    np.testing.assert_allclose(speeds[:, 1], speeds[:, 0], atol=0.15)
    # No joint is thrown harder than the walk throws it anyway.
    turning = quat.angular_velocity(np.ascontiguousarray(np.moveaxis(turned, 1, 0)[1]), RATE)
    jolt = np.linalg.norm(np.gradient(turning, 1 / RATE, axis=0), axis=-1)[
        :, list(sample_person.skeleton.roles.values())
    ]
    assert jolt[change - 1 : change + 45].max() < max(1.35 * jolt[60 : change - 1].max(), 60.0)


# choice


tables_of = cache(make_tables)


def doing(tables: Tables, group: int, rng: np.random.Generator, style: float) -> State:
    """Somebody who does nearly what an example of a group does, in any mood."""
    state = make_state(1, tables)
    e = tables.first[group] + rng.integers(tables.sizes[group])
    heading = rng.uniform(-3.0, 3.0)
    speed, tangential, lateral = tables.parameters[e] + rng.normal(0.0, [0.1, 0.3, 0.4])
    ahead = ground.direction(np.array(heading))
    state.heading[0] = heading
    state.velocity[0] = abs(speed) * ahead
    state.acceleration[0] = tangential * ahead + lateral * ground.left_of(ahead)
    state.features[0] = tables.features[e, MARGIN] + rng.normal(0.0, 0.03, tables.features.shape[2])
    state.style[0] = style
    state.group[0] = group
    describe_vehicle(tables, state, 0)
    return state


def twin(tables: Tables, state: State, group: int) -> np.ndarray:
    """Weight of every example of a group, by another way than the kernel's."""
    rows = slice(tables.first[group], tables.first[group] + tables.sizes[group])
    styles, parameters = tables.styles[rows], tables.parameters[rows]
    style = np.clip(state.style[0], styles.min(), styles.max())
    ahead = ground.direction(np.array(state.heading[0]))
    more = state.acceleration[0] @ ahead - parameters[:, 1]
    across = state.acceleration[0] @ ground.left_of(ahead) - parameters[:, 2]
    off = np.linalg.norm(state.velocity[0]) - parameters[:, 0] + AHEAD * more
    gaps = tables.features[rows, MARGIN] - state.features[0]
    alike = (off / SPEED_SCALE) ** 2 + (more / TANGENTIAL_SCALE) ** 2 + (across / LATERAL_SCALE) ** 2
    alike += 3.0 * (gaps**2 @ tables.feature_weights) / POSE_SCALE**2
    off = ((styles - style) / STYLE_SCALE) ** 2
    apart = alike + off / (1 + off / STYLE_MOST) + 1e-9

    def weights(which: np.ndarray, count: int) -> np.ndarray:
        order = which[np.argsort(apart[which], kind="stable")]
        out = np.zeros(len(styles))
        limit = 1.0 / apart[order[count]] if len(order) > count else 0.0
        out[order[:count]] = 1.0 / apart[order[:count]] - limit
        out[order[0]] = max(out[order[0]], 1e-12)
        return out / out.sum()

    everybody = np.arange(len(styles))
    first = weights(everybody, NEIGHBOURS)
    if abs(first @ styles - style) <= STYLE_TOLERANCE:
        return first
    half = NEIGHBOURS // 2
    kept = everybody[np.argsort(apart, kind="stable")][:half]
    own = np.zeros(len(styles))
    own[kept] = first[kept] / first[kept].sum()
    shown = own @ styles
    side = everybody[styles >= style - 1e-9] if shown < style else everybody[styles <= style + 1e-9]
    other = weights(side, NEIGHBOURS - half)
    missing = other @ styles - shown
    share = np.clip((style - shown) / missing, 0.0, 1.0) if missing else 0.0
    nearest = side[np.argmin(apart[side])]
    share *= np.clip((FAR - (alike[nearest] - alike[kept[0]])) / (FAR - NEARBY), 0.0, 1.0)
    return (1 - share) * own + share * other


@pytest.mark.parametrize("name", ["walk/LDR", "run/FLF", "stand/S", "stand-walk/SL"])
def test_the_choice_agrees_with_its_twin(sample_person, name):
    tables = tables_of(sample_person)
    group = list(sample_person.by_name).index(name)
    rng = np.random.default_rng(3)
    for style in np.linspace(-1.0, 1.0, 41):
        state = doing(tables, group, rng, style)
        blend_nearest(tables, state, 0, group)
        found = np.zeros(tables.sizes[group])
        np.add.at(found, np.where(state.weights[0] > 0, state.chosen[0] - tables.first[group], 0), state.weights[0])
        np.testing.assert_allclose(found, twin(tables, state, group), atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.floats(-1.0, 1.0), st.integers(0, 10**6))
def test_weights_are_a_blend_and_show_the_style_wanted_where_it_is_at_hand(sample_person, style, seed):
    tables = tables_of(sample_person)
    rng = np.random.default_rng(seed)
    group = int(rng.choice(np.flatnonzero(tables.sizes)))
    state = doing(tables, group, rng, style)
    blend_nearest(tables, state, 0, group)
    weights, chosen = state.weights[0], state.chosen[0]
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(1.0)
    own = slice(tables.first[group], tables.first[group] + tables.sizes[group])
    assert ((chosen >= own.start) & (chosen < own.stop))[weights > 0].all()
    low, high = tables.style_range[group]
    assert low - 1e-9 <= weights @ tables.styles[chosen] <= high + 1e-9


def test_between_two_moods_both_are_blended(sample_person):
    tables = tables_of(sample_person)
    group = list(sample_person.by_name).index("walk/LDR")
    for style in (-0.6, -0.3, 0.3):
        off = []
        for seed in range(20):
            state = doing(tables, group, np.random.default_rng(seed), style)
            blend_nearest(tables, state, 0, group)
            off.append(abs(state.weights[0] @ tables.styles[state.chosen[0]] - style))
        assert np.median(off) < STYLE_TOLERANCE


def without_turns(database: MotionDatabase) -> Tables:
    """As if brisk people had been seen going straight ahead only."""
    tables = tables_of(database)
    straight = np.abs(tables.parameters[:, 2]) < 0.25
    brisk = np.array([take.name.startswith("brisk") for take in database.takes])[database.examples.takes]
    assert (brisk & ~straight).any()
    return tables._replace(allowed=straight | ~brisk)


def test_what_nobody_did_in_a_mood_is_done_as_others_do_it(sample_person):
    tables = without_turns(sample_person)
    group = list(sample_person.by_name).index("walk/LDR")
    for lateral in (-2.0, 0.0, 2.0):
        found = {}
        for style in (0.0, 1.0):
            state = make_state(1, tables)
            state.velocity[0, 1], state.acceleration[0, 0], state.style[0] = 1.3, lateral, style
            describe_vehicle(tables, state, 0)
            blend_nearest(tables, state, 0, group)
            weights, chosen = state.weights[0], state.chosen[0]
            found[style] = (*(weights @ tables.parameters[chosen]), weights @ tables.styles[chosen])
        assert found[1.0][0] == pytest.approx(found[0.0][0], abs=0.15)
        assert found[1.0][2] == pytest.approx(found[0.0][2], abs=0.4)
        assert (found[1.0][3] > 0.4) == (lateral == 0.0)


def test_without_moods_a_style_changes_nothing(formulas):
    plain = replace(formulas, annotations=replace(formulas.annotations, style=np.zeros(len(formulas.annotations))))
    cases = ((plain, 0.0), (plain, -1.0), (plain, 1.0), (formulas, 0.0))
    batches = [Walkers(database, np.zeros((1, 2)), style=style) for database, style in cases]
    for frame in range(120):
        poses = [walkers.step(np.array([[0.0, 0.05 * frame]])) for walkers in batches]
        for pose in poses[1:]:
            np.testing.assert_array_equal(pose.rotations, poses[0].rotations)


def test_a_take_has_one_style_mirrored_too(sample_person):
    styles, takes = example_styles(sample_person), sample_person.examples.takes
    assert (np.abs(styles) <= 1).all()
    for number, take in enumerate(sample_person.takes):
        own = styles[takes == number]
        assert np.ptp(own) == 0.0
        mood = take.name.split("_")[0]
        low, high = {"gloomy": (-1.0, -0.6), "brisk": (0.2, 1.0)}.get(mood, (-0.1, 0.1))
        assert low <= own[0] <= high, take.name


# laws, with all moods in one batch


def mixed(database: MotionDatabase, seed: int, frames: int, order: np.ndarray | None = None):
    """Ten characters of ten styles behind streams of all kinds; the styles wanted change, too."""
    rng = np.random.default_rng(seed)
    streams = np.stack([points_of(kind, frames, RATE, seed + 1000 * i) for i, kind in enumerate(KINDS)], axis=1)
    motions = [motions_of(database.motions, frames, RATE, seed + 7 * i) for i in range(len(KINDS))]
    styles = np.repeat(rng.uniform(-1, 1, (frames // 40 + 1, len(KINDS))), 40, axis=0)
    headings = rng.uniform(-4, 4, len(KINDS))
    order = np.arange(len(KINDS)) if order is None else order
    walkers = Walkers(database, streams[0, order], headings[order], style=styles[0, order])
    poses = [
        walkers.step(streams[f, order], motion=[motions[i][f] for i in order], style=styles[f, order])
        for f in range(frames)
    ]
    return recorded(poses, RATE)


def test_bounds_hold_in_every_mood(sample_person):
    walk = mixed(sample_person, 0, 240)
    did = steering_of(walk)
    assert (did.jerk <= walk.jerk[1:] + 1e-9 * RATE).all()
    assert (did.tangential >= walk.tangential[1:, :, 0] - 1e-9).all()
    assert (did.tangential <= walk.tangential[1:, :, 1] + 1e-9).all()
    assert (np.abs(did.lateral) <= walk.lateral[1:] + 1e-9).all()
    assert (did.speed <= walk.speed[1:, :, 1] + 1e-9).all()
    assert np.isfinite(walk.rotations).all()


def test_same_bits_again_and_in_any_order(sample_person):
    once, again = mixed(sample_person, 1, 120), mixed(sample_person, 1, 120)
    np.testing.assert_array_equal(once.rotations, again.rotations)
    order = np.random.default_rng(2).permutation(len(KINDS))
    there = mixed(sample_person, 1, 120, order)
    np.testing.assert_array_equal(there.rotations, once.rotations[:, order])
    np.testing.assert_array_equal(there.roots, once.roots[:, order])


def test_a_batch_of_moods_walks_as_each_would_alone(sample_person):
    together = Walkers(sample_person, np.zeros((4, 2)), style=["gloomy", 0.4, "neutral", "brisk"])
    alone = [Walker(sample_person, style=style) for style in (-1.0, 0.4, 0.0, 1)]
    for frame, point in enumerate(course(1.3, 0.4, 4.0)):
        changed = "brisk" if frame > 70 else None
        pose = together.step(np.tile(point, (4, 1)), style=changed)
        for k, walker in enumerate(alone):
            single = walker.step(point, style=changed)
            np.testing.assert_array_equal(pose.rotations[k], single.rotations)
            np.testing.assert_array_equal(pose.root_position[k], single.root_position)


def test_a_style_delays_nothing(sample_person):
    """A wish acts in its frame, whatever else is asked for in it."""
    batches = [Walkers(sample_person, np.zeros((1, 2))) for _ in range(2)]
    for point in course(1.3, 0.0, 4.0):
        for walkers in batches:
            walkers.step(point[None])
    here = batches[0].step(point[None], style="gloomy").vehicle.acceleration
    there = batches[1].step(point[None] + [[0.5, 0.0]], style="gloomy").vehicle.acceleration
    assert np.abs(here - there).max() > 0.1


# refusals


@pytest.mark.parametrize(
    "style", [1.5, -1.01, float("nan"), float("inf"), "merry", "", True, None, [0.0], ["brisk"] * 3]
)
@pytest.mark.usefixtures("unchecked")
def test_styles_that_are_none_are_refused_and_nothing_changes(formulas, style):
    says = "styles for 2 characters" if isinstance(style, list) else r"gloomy, neutral, brisk or a number from -1"
    with pytest.raises(WishError, match=says):
        Walkers(formulas, np.zeros((2, 2)), style=style)
    if style is None:
        return
    asked, spared = (Walkers(formulas, np.zeros((2, 2)), style=[0.2, -0.7]) for _ in range(2))
    for frame in range(60):
        points = np.full((2, 2), 0.04 * frame)
        if frame % 20 == 7:
            with pytest.raises(WishError, match=says):
                asked.step(np.full((2, 2), 100.0), motion="run", style=style)
            with pytest.raises(WishError, match="finite"):
                asked.step(np.full((2, 2), np.nan), style=1.0)
        np.testing.assert_array_equal(asked.step(points).rotations, spared.step(points).rotations)


def test_words_are_numbers():
    assert style_numbers(["gloomy", "brisk", "neutral", 0.25], 4).tolist() == [-1.0, 1.0, 0.0, 0.25]
    for word, number in WORDS.items():
        assert (style_numbers(word, 3) == number).all()
