"""Weighted means of rotations."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stridecast.geometry import blending
from stridecast.geometry import quaternions as quat

seeds = st.integers(0, 10**6)


def sample(seed: int, spread: float, count: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Rotations of three joints about some middle, and weights."""
    rng = np.random.default_rng(seed)
    middle = quat.exp(rng.normal(size=(3, 3)))
    q = quat.multiply(middle, quat.exp(spread * rng.uniform(-1, 1, (count, 3, 3))))
    weights = rng.dirichlet(np.ones(count))
    return q * rng.choice([-1.0, 1.0], (count, 3, 1)), weights


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.norm(quat.log(quat.multiply(quat.inverse(a), b)), axis=-1)


@given(seeds)
def test_one_sample_with_all_the_weight_comes_back(seed):
    q, _ = sample(seed, 1.0)
    for k in range(len(q)):
        assert angle(blending.blend(q, np.eye(len(q))[k]), q[k]).max() < 1e-12


@given(seeds)
def test_the_mean_is_where_the_weighted_logarithms_vanish(seed):
    q, weights = sample(seed, 0.5)
    mean = blending.blend(q, weights)
    left = np.tensordot(weights, quat.log(quat.multiply(quat.inverse(mean), q)), axes=1)
    assert np.abs(left).max() < 1e-9


@given(seeds)
def test_the_mean_lies_among_its_samples(seed):
    q, weights = sample(seed, 0.5)
    mean = blending.blend(q, weights)
    widest = np.max([angle(a, b) for a in q for b in q], axis=0)
    assert (np.max([angle(mean, a) for a in q], axis=0) <= widest + 1e-9).all()


@given(seeds)
def test_two_samples_are_blended_as_slerp_does(seed):
    q, _ = sample(seed, 0.7, count=2)
    t = np.random.default_rng(seed).uniform()
    assert angle(blending.blend(q, np.array([1 - t, t])), quat.slerp(q[0], q[1], t)).max() < 1e-9


@given(seeds)
def test_the_reference_does_not_matter_for_small_angles(seed):
    """As METHOD has it about one reference: the error is of the third order in the spread."""
    q, weights = sample(seed, 0.05)
    mean = blending.blend(q, weights)
    for reference in q:
        assert angle(blending.about(reference, q, weights), mean).max() < 1e-3
    assert angle(blending.about(mean, q, weights), mean).max() < 1e-9


@given(seeds)
def test_mirrored_samples_have_a_mirrored_mean(seed):
    q, weights = sample(seed, 0.8)
    mirror = np.array([1.0, 1.0, -1.0, -1.0])
    assert angle(blending.blend(q * mirror, weights), blending.blend(q, weights) * mirror).max() < 1e-9


@given(seeds)
def test_order_and_a_turn_of_all_do_not_matter(seed):
    q, weights = sample(seed, 0.8)
    turn = quat.exp(np.random.default_rng(seed).normal(size=3))
    mean = blending.blend(q, weights)
    assert angle(blending.blend(q[::-1], weights[::-1]), mean).max() < 1e-9
    assert angle(blending.blend(quat.multiply(turn, q), weights), quat.multiply(turn, mean)).max() < 1e-9


def test_weights_may_differ_from_frame_to_frame():
    q, _ = sample(3, 0.5)
    table = np.random.default_rng(0).dirichlet(np.ones(4), size=3).T
    together = blending.blend(q, table)
    for k in range(3):
        assert angle(together[k], blending.blend(q[:, k], table[:, k])).max() < 1e-12


def test_close_samples_agree_with_the_chordal_mean_of_scipy():
    q, weights = sample(1, 0.1)
    for joint in range(3):
        chordal = Rotation.from_quat(q[:, joint], scalar_first=True).mean(weights).as_quat(scalar_first=True)
        assert angle(blending.blend(q, weights)[joint], chordal) < 1e-4
