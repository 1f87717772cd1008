from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, linprog, minimize

from stridecast.database.weights import NEIGHBOURS, convex_weights

SEEDS = st.integers(0, 100_000)


def scattered(seed: int, count: int = 30, values: int = 2) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, values))


def weigh(wish: np.ndarray, have: np.ndarray, shares: np.ndarray | None = None):
    return convex_weights(wish, have, np.linalg.norm(have - wish, axis=-1), shares)


def inside(wish: np.ndarray, have: np.ndarray) -> bool:
    """Whether a wish lies in the hull of what there is, by linear programming."""
    rows = np.vstack((have.T, np.ones(len(have))))
    return linprog(np.zeros(len(have)), A_eq=rows, b_eq=[*wish, 1.0]).status == 0


@given(SEEDS, st.integers(1, 40), st.integers(1, 3), st.floats(0.1, 4.0))
def test_weights_are_a_mean(seed, count, values, reach):
    have = scattered(seed, count, values)
    wish = reach * scattered(seed + 1, 1, values)[0]
    weights, reached = weigh(wish, have)
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(reached, weights @ have, atol=1e-9)
    assert (reached <= have.max(axis=0) + 1e-9).all()
    assert (reached >= have.min(axis=0) - 1e-9).all()


@given(SEEDS, st.integers(1, 3))
def test_what_can_be_shown_is_shown(seed, values):
    have = scattered(seed, 30, values)
    mix = np.random.default_rng(seed).dirichlet(np.ones(30))
    _, reached = weigh(mix @ have, have)
    np.testing.assert_allclose(reached, mix @ have, atol=5e-3)


@given(SEEDS, st.floats(0.5, 3.0))
def test_beyond_what_was_recorded_the_nearest_is_shown(seed, reach):
    have = scattered(seed, 20)
    wish = reach * scattered(seed + 1, 1)[0]
    _, reached = weigh(wish, have)
    found = minimize(
        lambda w: float(np.sum((w @ have - wish) ** 2)),
        np.full(20, 0.05),
        jac=lambda w: 2 * have @ (w @ have - wish),
        bounds=[(0, 1)] * 20,
        constraints=LinearConstraint(np.ones(20), 1, 1),
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert np.linalg.norm(reached - wish) <= np.sqrt(found.fun) + 2e-3
    if not inside(wish, have):
        np.testing.assert_allclose(reached, found.x @ have, atol=2e-2)


@given(SEEDS, st.integers(0, 29))
def test_an_exact_hit_takes_all(seed, which):
    have = scattered(seed)
    weights, reached = weigh(have[which], have)
    assert weights[which] == 1.0
    assert (reached == have[which]).all()


def test_midway_between_two_they_count_alike():
    weights, reached = weigh(np.array([1.4]), np.array([[1.3], [1.5]]))
    np.testing.assert_allclose(weights, 0.5, atol=1e-6)
    np.testing.assert_allclose(reached, 1.4, atol=1e-6)


@given(st.lists(st.floats(0.05, 2.0), min_size=1, max_size=3, unique=True))
def test_neighbours_that_lie_evenly_about_a_wish_get_the_weights_of_bjl(gaps):
    have = np.array([[sign * gap] for gap in gaps for sign in (-1, 1)])
    weights, _ = weigh(np.zeros(1), have)
    squares = 1 / have[:, 0] ** 2
    np.testing.assert_allclose(weights, squares / squares.sum(), atol=1e-4)


@given(SEEDS)
def test_the_order_of_examples_is_of_no_account(seed):
    have, wish = scattered(seed), 0.5 * scattered(seed + 1, 1)[0]
    order = np.random.default_rng(seed).permutation(len(have))
    np.testing.assert_allclose(weigh(wish, have[order]).weights, weigh(wish, have).weights[order], atol=1e-6)


@given(SEEDS)
def test_a_mirrored_wish_is_met_by_mirrored_examples(seed):
    half, wish = scattered(seed, 15), 0.5 * scattered(seed + 1, 1)[0]
    have = np.concatenate((half, half * [1.0, -1.0]))
    swapped = np.roll(np.arange(30), 15)
    one, other = weigh(wish, have).weights, weigh(wish * [1.0, -1.0], have).weights
    np.testing.assert_allclose(one, other[swapped], atol=1e-6)


def test_few_neighbours_are_enough_where_they_surround_the_wish():
    weights, _ = weigh(np.zeros(1), np.linspace(-1, 1, 200)[:, None])
    assert (weights > 0).sum() <= NEIGHBOURS


@given(SEEDS)
def test_a_small_step_of_the_wish_is_a_small_step_of_the_weights(seed):
    have = np.sort(np.random.default_rng(seed).uniform(-1, 1, 60))[:, None]
    wishes = np.linspace(-0.3, 0.3, 400)
    poses = np.sin(3 * have[:, 0])
    shown = np.array([weigh(np.array([wish]), have).weights @ poses for wish in wishes])
    assert np.abs(np.diff(shown)).max() < 0.1


def test_longer_clips_count_more_in_what_is_shown():
    have, seconds = np.array([[0.0], [1.0]]), np.array([1.0, 3.0])
    weights, reached = weigh(np.array([0.5]), have, seconds)
    np.testing.assert_allclose(weights, [0.75, 0.25], atol=1e-4)
    np.testing.assert_allclose(reached, 0.5, atol=1e-4)


def test_without_a_wish_the_nearest_count_most():
    weights, _ = convex_weights(np.zeros(0), np.zeros((3, 0)), np.array([0.1, 0.2, 5.0]))
    assert weights[0] > weights[1] > weights[2] > 0
