from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bodies import humanoid
from stridecast.analysis.style import UPPER_BODY, joint_spread, score, stoop
from stridecast.geometry import quaternions as quat

SEEDS = st.integers(0, 10_000)


def still(frames: int = 30) -> np.ndarray:
    """Nobody moves: every joint as in the rest pose."""
    return np.tile(quat.IDENTITY, (frames, humanoid().joints, 1))


def swinging(amount: float, roles: tuple[str, ...], frames: int = 40) -> np.ndarray:
    """Whole periods of a swing about the x axis, in joints of some roles."""
    rotations = still(frames)
    angle = amount * np.sin(2 * np.pi * np.arange(frames) / frames)
    for role in roles:
        rotations[:, humanoid().joint(role)] = quat.exp(angle[:, None] * np.array([1.0, 0.0, 0.0]))
    return rotations


def people(seed: int = 0, takes: int = 12, each: int = 8) -> dict[str, np.ndarray]:
    """Examples of walkers whose signs follow their speed, but for chance."""
    rng = np.random.default_rng(seed)
    speeds = np.repeat(rng.uniform(0.7, 1.9, takes), each) + 0.02 * rng.standard_normal(takes * each)
    noise = rng.standard_normal((3, takes * each))
    return {
        "kinds": np.zeros(takes * each, int),
        "takes": np.repeat(np.arange(takes), each),
        "speeds": speeds,
        "spreads": 0.08 * speeds * np.exp(0.05 * noise[0]),
        "cadences": 1.4 * np.sqrt(speeds) * np.exp(0.01 * noise[1]),
        "stoops": 0.15 + 0.01 * noise[2],
    }


# signs


def test_nobody_who_is_still_spreads():
    assert joint_spread(humanoid(), still()) == pytest.approx(0.0, abs=1e-9)


@given(st.floats(0.01, 1.2))
def test_spread_is_the_standard_deviation_of_the_joints(amount):
    arms = ("left_upper_arm", "right_upper_arm")
    present = [role for role in UPPER_BODY if role in humanoid().roles]
    own = np.std(amount * np.sin(2 * np.pi * np.arange(40) / 40))
    expected = own * np.sqrt(len(arms) / len(present))
    assert joint_spread(humanoid(), swinging(amount, arms)) == pytest.approx(expected, rel=1e-6)


def test_legs_do_not_count_in_the_spread():
    assert joint_spread(humanoid(), swinging(0.5, ("left_thigh", "right_shin"))) == pytest.approx(0.0, abs=1e-9)


@given(st.floats(-0.6, 1.0), st.floats(-3.0, 3.0))
def test_who_bows_as_a_whole_stoops_by_that_angle_whichever_way_they_go(bow, heading):
    rotations = still(5)
    rotations[:, 0] = quat.multiply(quat.about_y(heading), quat.exp(np.array([bow, 0.0, 0.0])))
    upright = float(stoop(humanoid(), still(5), np.zeros(5)))
    assert stoop(humanoid(), rotations, np.full(5, heading)) == pytest.approx(bow + upright, abs=1e-9)


def test_stoop_agrees_with_matrices():
    rng = np.random.default_rng(3)
    body = humanoid()
    turned = Rotation.from_rotvec(0.2 * rng.standard_normal((body.joints, 3)))
    rotations = turned.as_quat(scalar_first=True)[None]
    world, places = [None] * body.joints, [None] * body.joints
    for joint, parent in enumerate(body.parents):
        own = turned[joint].as_matrix()
        world[joint] = own if parent < 0 else world[parent] @ own
        places[joint] = np.zeros(3) if parent < 0 else places[parent] + world[parent] @ body.offsets[joint]
    crown = world[body.joint("head")] @ [0.0, 1.0, 0.0]
    trunk = places[body.joint("neck")]
    expected = np.mean([np.arctan2(way[2], way[1]) for way in (trunk, crown)])
    assert stoop(body, rotations, np.zeros(1)) == pytest.approx(expected, abs=1e-9)


# score


@given(SEEDS)
def test_scores_lie_between_gloomy_and_brisk(seed):
    rng = np.random.default_rng(seed)
    wild = {name: column * rng.uniform(0.1, 5.0) for name, column in people(seed).items() if column.dtype.kind == "f"}
    scores = score(**{**people(seed), **wild})
    assert np.isfinite(scores).all()
    assert (np.abs(scores) < 1.0).all()


@given(SEEDS)
def test_usual_walkers_are_near_the_middle(seed):
    assert np.abs(np.median(score(**people(seed)))) < 0.15


@pytest.mark.parametrize(
    ("sign", "factor", "brisk"),
    [("spreads", 1.6, True), ("spreads", 0.5, False), ("cadences", 1.1, True), ("cadences", 0.9, False)],
)
def test_each_sign_tells_its_way(sign, factor, brisk):
    examples = people()
    own = examples["takes"] == 4
    before = score(**examples)[own]
    examples[sign] = np.where(own, factor, 1.0) * examples[sign]
    after = score(**examples)[own]
    assert (after > before).all() if brisk else (after < before).all()


def test_who_stoops_is_gloomy():
    examples = people()
    own = examples["takes"] == 4
    examples["stoops"] = examples["stoops"] + 0.4 * own
    assert (score(**examples)[own] < -0.5).all()


@given(SEEDS)
def test_going_faster_is_not_being_brisker(seed):
    """The signs grow with speed in everybody, which is no style."""
    examples = people(seed, takes=20)
    scores = score(**examples)
    fast = examples["speeds"] > np.median(examples["speeds"])
    assert abs(scores[fast].mean() - scores[~fast].mean()) < 0.2


@given(SEEDS)
def test_order_of_examples_is_of_no_account(seed):
    examples = people(seed)
    order = np.random.default_rng(seed).permutation(len(examples["takes"]))
    mixed = score(**{name: column[order] for name, column in examples.items()})
    np.testing.assert_allclose(mixed, score(**examples)[order], atol=1e-9)


def test_a_take_is_not_held_against_itself():
    examples = people()
    once = score(**examples)
    own = examples["takes"] == 2
    twice = {name: np.concatenate((column, column[own])) for name, column in examples.items()}
    np.testing.assert_allclose(score(**twice)[: len(once)][own], once[own], atol=1e-9)


def test_only_like_is_held_against_like():
    examples = people()
    runners = {name: column.copy() for name, column in examples.items()}
    runners["kinds"] = runners["kinds"] + 1
    runners["takes"] = runners["takes"] + 100
    runners["spreads"] = 5 * runners["spreads"]
    both = {name: np.concatenate((column, runners[name])) for name, column in examples.items()}
    np.testing.assert_allclose(score(**both)[: len(examples["takes"])], score(**examples), atol=1e-12)


def test_without_others_nothing_is_told():
    examples = people(takes=1)
    assert (score(**examples) == 0.0).all()


def test_few_gloomy_takes_do_not_move_what_is_usual():
    examples = people(takes=15)
    gloomy = examples["takes"] < 3
    before = score(**examples)
    examples["stoops"] = examples["stoops"] + 0.5 * gloomy
    after = score(**examples)
    assert (after[gloomy] < -0.5).all()
    assert np.abs(after[~gloomy] - before[~gloomy]).max() < 0.25


# sample takes: nobody told the score which is which


@pytest.fixture(scope="module")
def styled() -> dict[str, dict[str, float]]:
    """Style of takes of a kind of their own beside neutral ones, judged together."""
    from dataclasses import replace

    from stridecast.building.build import build
    from stridecast.samples.corpus import Leg, Recipe, sample_take

    walk = Recipe(name="walk", speed=0.8, legs=(Leg(seconds=7.0, speed=1.8),))
    turns = Recipe(name="turns", speed=1.2, legs=(Leg(seconds=3.5, rate=0.5), Leg(seconds=3.5, rate=-0.5)))
    takes = [
        sample_take(replace(recipe, style=style, name=f"{style} {recipe.name} {seed}"), seed=seed).motion
        for style, seeds in (("neutral", (1, 2, 3)), ("gloomy", (4,)), ("brisk", (5,)))
        for recipe in (walk, turns)
        for seed in seeds
    ]
    database = build(takes, jobs=1, cache=False, mirror=False)
    out: dict[str, dict[str, float]] = {}
    for take in database.takes:
        out.setdefault(take.name.split()[0], {})[take.name] = take.annotation.style
    return out


def test_moods_of_sample_takes_are_told_apart(styled):
    assert max(styled["gloomy"].values()) < -0.5
    assert min(styled["brisk"].values()) > 0.3
    assert max(abs(value) for value in styled["neutral"].values()) < 0.3
