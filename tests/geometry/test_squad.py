"""Spherical cubic interpolation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, RotationSpline

from stridecast.errors import InputError
from stridecast.geometry import quaternions as quat
from stridecast.geometry.squad import squad

seeds = st.integers(0, 10**6)


def series(seed: int, count: int = 7, step: float = 0.5, even: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Keys of two joints at uneven times."""
    rng = np.random.default_rng(seed)
    times = np.arange(count) * 0.2 if even else np.cumsum(rng.uniform(0.05, 0.4, count))
    keys = [quat.exp(rng.normal(size=(2, 3)))]
    for _ in range(count - 1):
        keys.append(quat.multiply(keys[-1], quat.exp(step * rng.uniform(-1, 1, (2, 3)))))
    return times, np.array(keys)


def angle(a, b):
    return np.linalg.norm(quat.log(quat.multiply(quat.inverse(a), b)), axis=-1)


@given(seeds)
def test_it_passes_through_its_keys(seed):
    times, keys = series(seed)
    assert angle(squad(times, keys, times), keys).max() < 1e-9


@given(seeds)
def test_an_even_turn_is_slerp(seed):
    rng = np.random.default_rng(seed)
    times, start, axis = series(seed)[0], quat.exp(rng.normal(size=3)), rng.normal(size=3)
    at = np.linspace(times[0], times[-1], 50)
    keys = quat.multiply(start, quat.exp(times[:, None] * axis))
    assert angle(squad(times, keys, at), quat.multiply(start, quat.exp(at[:, None] * axis))).max() < 1e-9


@given(seeds)
def test_the_angular_velocity_does_not_jump_at_keys(seed):
    times, keys = series(seed)
    step = 1e-6
    before = angular(squad(times, keys, times[1:-1] - step), squad(times, keys, times[1:-1]), step)
    after = angular(squad(times, keys, times[1:-1]), squad(times, keys, times[1:-1] + step), step)
    np.testing.assert_allclose(before, after, atol=2e-3)


def angular(a, b, step):
    return quat.log(quat.multiply(quat.inverse(a), b)) / step


def test_even_keys_are_interpolated_as_shoemake_does():
    times, keys = series(4, even=True)
    q0, q1, q2, q3 = keys[2:6]

    def control(before, q, after):
        logs = [quat.log(quat.multiply(quat.inverse(q), other)) for other in (before, after)]
        return quat.multiply(q, quat.exp(-(logs[0] + logs[1]) / 4))

    for u in (0.2, 0.5, 0.9):
        inner = quat.slerp(control(q0, q1, q2), control(q1, q2, q3), u)
        expected = quat.slerp(quat.slerp(q1, q2, u), inner, 2 * u * (1 - u))
        assert angle(squad(times, keys, np.array([times[3] + u * 0.2]))[0], expected).max() < 1e-9


def test_a_smooth_series_lies_close_to_the_spline_of_scipy():
    times = np.linspace(0, 2, 15)
    keys = quat.exp(np.stack((np.sin(times), 0.5 * np.cos(2 * times), 0.3 * times), axis=-1))
    at = np.linspace(0, 2, 80)
    spline = RotationSpline(times, Rotation.from_quat(keys, scalar_first=True))(at).as_quat(scalar_first=True)
    assert angle(squad(times, keys, at), spline).max() < 5e-3


def test_ends_are_held_and_one_key_is_enough():
    times, keys = series(0)
    out = squad(times, keys, np.array([times[0] - 1.0, times[-1] + 1.0]))
    assert angle(out, keys[[0, -1]]).max() < 1e-9
    assert angle(squad(times[:1], keys[:1], np.array([0.0, 9.0])), keys[:1]).max() < 1e-12


def test_times_that_do_not_rise_are_refused():
    times, keys = series(0)
    times[3] = times[2]
    with pytest.raises(InputError, match="key 3"):
        squad(times, keys, np.zeros(1))
