"""Time warps between motions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.errors import InputError
from stridecast.geometry.timewarp import TimeWarp, incremental, invert, mean_keys

seeds = st.integers(0, 10**6)


def warps(seed: int, count: int = 3, events: int = 5) -> tuple[list[TimeWarp], list[np.ndarray]]:
    rng = np.random.default_rng(seed)
    own = [np.concatenate(([0.0], np.cumsum(rng.uniform(0.05, 1.0, events)))) for _ in range(count)]
    keys = mean_keys(own)
    return [TimeWarp(keys, times) for times in own], own


@given(seeds)
def test_events_meet_and_time_never_runs_back(seed):
    found, own = warps(seed)
    dense = np.linspace(0, 1, 500)
    for warp, times in zip(found, own, strict=True):
        np.testing.assert_allclose(warp.to_own(warp.generic), times, atol=1e-12)
        assert (np.diff(warp.to_own(dense)) >= 0).all()
        assert (warp.slope(dense) > -1e-9).all()
        assert (warp.slope(np.array([0.0, 1.0])) > 0).all(), "a motion would freeze at its end"


@given(seeds)
def test_the_way_back_undoes_it(seed):
    warp = warps(seed)[0][0]
    own = np.linspace(warp.own[0], warp.own[-1], 60)
    np.testing.assert_allclose(warp.to_own(warp.to_generic(own)), own, atol=1e-9)


@given(seeds)
def test_a_blend_takes_the_mean_of_the_times(seed):
    found, own = warps(seed)
    weights = np.random.default_rng(seed).dirichlet(np.ones(3))
    points, passed = incremental(found, np.repeat(weights[:, None], 200, axis=1), 200)
    np.testing.assert_allclose(
        passed, sum(w * f.to_own(points) for w, f in zip(weights, found, strict=True)), atol=1e-9
    )
    assert passed[-1] == pytest.approx(sum(w * t[-1] for w, t in zip(weights, own, strict=True)))


def test_changing_weights_pass_from_one_pace_to_the_other():
    slow, fast = (
        TimeWarp(np.array([0.0, 1.0]), np.array([0.0, 2.0])),
        TimeWarp(np.array([0.0, 1.0]), np.array([0.0, 1.0])),
    )
    share = np.linspace(0, 1, 101)
    _, passed = incremental([slow, fast], np.stack((1 - share, share)), 101)
    assert passed[-1] == pytest.approx(1.5)
    assert np.diff(passed)[0] > 1.9 * np.diff(passed)[-1]


def test_a_function_is_inverted_between_its_knots():
    knots = np.linspace(0, 2, 5)
    np.testing.assert_allclose(invert(np.square, knots, knots**2, np.array([0.25, 2.0, 4.0])), [0.5, 2**0.5, 2.0])


@pytest.mark.parametrize(
    ("generic", "own", "word"),
    [([0.0, 1.0], [0.0, 0.0], "own"), ([0.5, 0.2], [0.0, 1.0], "generic"), ([0.0, 0.5, 1.0], [0.0, 1.0], "agree")],
)
def test_times_that_do_not_rise_or_fit_are_refused(generic, own, word, unchecked):
    with pytest.raises(InputError, match=word):
        TimeWarp(np.array(generic), np.array(own))


def test_motions_with_different_events_are_refused():
    with pytest.raises(InputError, match="same number"):
        mean_keys([np.array([0.0, 1.0]), np.array([0.0, 0.5, 1.0])])
