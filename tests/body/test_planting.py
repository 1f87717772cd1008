from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stridecast.body import kinematics
from stridecast.body.planting import TIP, Feet, corrected, feet_of, put_feet, raised, standing, with_toes_up
from stridecast.geometry import quaternions as quat
from stridecast.geometry import signals
from stridecast.model.motion import Motion
from synthetic_gait import Gait, gait, ramps

RATE = 60.0


@pytest.fixture(scope="module")
def walker() -> Gait:
    return gait(ramps((1.6, 1.3), rate=RATE), rate=RATE)


def sliding(walker: Gait, seed: int) -> Motion:
    """The walker on a floor that sways under it by some centimetres."""
    rng = np.random.default_rng(seed)
    t = np.arange(walker.motion.frames)[:, None] / RATE
    sway = 0.03 * np.sin(2 * np.pi * (rng.uniform(0.3, 1.0, 3) * t + rng.random(3))) * [1.0, 0.3, 1.0]
    return replace(walker.motion, root_positions=walker.motion.root_positions + sway)


def planted_again(motion: Motion, planted: np.ndarray) -> tuple[Feet, Motion]:
    free = feet_of(motion)
    feet = corrected(free, standing(free, planted), planted, RATE)
    return feet, put_feet(motion, feet, planted)


SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(max_examples=10)


@FEW
@given(SEEDS)
def test_planted_feet_stand_still_and_knees_bend_forward(walker, seed):
    motion = sliding(walker, seed)
    _, after = planted_again(motion, walker.planted)
    toes = feet_of(after).toes
    for side, name in enumerate(("left", "right")):
        for stands, start, stop in signals.runs(walker.planted[:, side]):
            if stands:
                np.testing.assert_allclose(np.ptp(toes[start:stop, side, ::2], axis=0), 0.0, atol=1e-9)
        assert quat.log(after.rotations[:, motion.skeleton.joint(f"{name}_shin")])[:, 0].min() > 0
    # ... at heights and turned as they were
    np.testing.assert_allclose(toes[..., 1][walker.planted], feet_of(motion).toes[..., 1][walker.planted], atol=1e-9)
    turned = quat.multiply(quat.inverse(feet_of(motion).turns), feet_of(after).turns)
    np.testing.assert_allclose(quat.log(turned), 0.0, atol=1e-7)


@FEW
@given(SEEDS)
def test_what_stands_already_stays_as_it_is(walker, seed):
    _, once = planted_again(sliding(walker, seed), walker.planted)
    feet, twice = planted_again(once, walker.planted)
    np.testing.assert_allclose(feet.toes, feet_of(once).toes, atol=1e-9)
    np.testing.assert_allclose(kinematics.pose(twice).positions, kinematics.pose(once).positions, atol=2e-3)


def test_where_nothing_stands_nothing_is_changed(walker):
    nowhere = np.zeros_like(walker.planted)
    free = feet_of(walker.motion)
    assert np.array_equal(standing(free, nowhere).toes, free.toes)
    np.testing.assert_allclose(corrected(free, free, nowhere, RATE).toes, free.toes)


@given(st.floats(-0.1, 0.3))
def test_feet_are_raised_no_further_than_need_be(walker, height):
    free = feet_of(walker.motion)
    feet = raised(free, height)
    np.testing.assert_array_equal(feet.toes[..., 1], np.maximum(free.toes[..., 1], height))
    np.testing.assert_array_equal(feet.toes[..., ::2], free.toes[..., ::2])


@FEW
@given(st.floats(0.0, 0.1))
def test_tips_of_toes_stay_above_the_floor(walker, lower):
    """As far as the toe joint itself is above it."""
    motion = walker.motion
    motion = replace(motion, root_positions=motion.root_positions - [0.0, lower, 0.0])
    after = with_toes_up(motion)
    toes = motion.skeleton.chain("left_toe", "right_toe")
    before_tips, tips = (tips_of(m)[..., 1] for m in (motion, after))
    lengths = np.linalg.norm(motion.skeleton.end_offsets[np.isin(motion.skeleton.end_joints, toes)], axis=-1)
    in_reach = kinematics.pose(motion).positions[:, toes, 1] + lengths > TIP
    assert tips[in_reach].min(initial=TIP) > TIP - 1e-9
    np.testing.assert_allclose(tips[before_tips > TIP], before_tips[before_tips > TIP], atol=1e-9)
    others = np.setdiff1d(np.arange(motion.skeleton.joints), toes)
    np.testing.assert_array_equal(after.rotations[:, others], motion.rotations[:, others])


def tips_of(motion: Motion) -> np.ndarray:
    toes = motion.skeleton.chain("left_toe", "right_toe")
    return kinematics.ends(motion.skeleton, kinematics.pose(motion))[:, np.isin(motion.skeleton.end_joints, toes)]
