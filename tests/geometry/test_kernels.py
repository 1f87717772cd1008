"""What is compiled agrees with plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from stridecast.geometry import kernels
from stridecast.geometry import quaternions as quat

NUMBERS = st.floats(-10.0, 10.0, allow_subnormal=False)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
TINY = st.tuples(*[st.floats(-1e-7, 1e-7, allow_subnormal=False)] * 3)
ANGLES = st.floats(-20.0, 20.0)


def unit(numbers: tuple[float, ...]) -> tuple[float, ...]:
    return tuple((np.array(numbers) / np.linalg.norm(numbers)).tolist())


ROTATIONS = (
    st.tuples(*[st.floats(-1.0, 1.0, allow_subnormal=False)] * 4).filter(lambda q: np.linalg.norm(q) > 1e-3).map(unit)
)
DIRECTIONS = VECTORS.filter(lambda v: np.linalg.norm(v) > 1e-2)


def same(compiled, plain, atol: float = 1e-12) -> None:
    np.testing.assert_allclose(np.array(compiled), plain, atol=atol, rtol=1e-12)


@given(ROTATIONS, ROTATIONS)
def test_multiply(a, b):
    same(kernels.multiply(a, b), quat.multiply(np.array(a), np.array(b)))


@given(ROTATIONS)
def test_inverse(q):
    same(kernels.inverse(q), quat.inverse(np.array(q)))


@given(ROTATIONS, VECTORS)
def test_rotate(q, v):
    same(kernels.rotate(q, v), quat.rotate(np.array(q), np.array(v)))


@given(st.one_of(VECTORS, TINY))
@example((0.0, 0.0, 0.0))
@example((1.1e-6, 0.0, 0.0))
@example((0.9e-6, 0.0, 0.0))
def test_exp(v):
    same(kernels.exp(v), quat.exp(np.array(v)))


@given(DIRECTIONS.flatmap(lambda v: st.tuples(st.just(v), NUMBERS)))
def test_normalize(pair):
    q = (*pair[0], pair[1])
    same(kernels.normalize(q), quat.normalize(np.array(q)))


@given(ANGLES)
def test_about_y(angle):
    same(kernels.about_y(angle), quat.about_y(angle))


@given(ROTATIONS.filter(lambda q: np.hypot(q[0], q[2]) > 1e-3))
def test_twist_about_y(q):
    twist = kernels.twist_about_y(q)
    assert -np.pi - 1e-12 <= twist <= np.pi + 1e-12
    difference = twist - float(quat.twist_about_y(np.array(q)))
    same(np.cos(difference), 1.0)


@given(st.floats(-1e3, 1e3))
@example(np.pi)
@example(-np.pi)
def test_wrap_keeps_the_direction_and_stays_in_one_turn(angle):
    wrapped = kernels.wrap(angle)
    assert -np.pi - 1e-9 <= wrapped <= np.pi + 1e-9
    same(np.exp(1j * wrapped), np.exp(1j * angle), atol=1e-9)


@given(DIRECTIONS, DIRECTIONS)
@settings(max_examples=100)
def test_between(a, b):
    apart = np.array(unit(a)) + np.array(unit(b))
    if np.linalg.norm(apart) > 1e-3:
        same(kernels.between(a, b), quat.between(np.array(a), np.array(b)), atol=1e-8)


def test_between_of_opposites_is_still_a_rotation():
    q = np.array(kernels.between((0.0, 1.0, 0.0), (0.0, -1.0, 0.0)))
    assert np.isfinite(q).all()
    assert np.linalg.norm(q) == pytest.approx(1.0)


@given(VECTORS, VECTORS, NUMBERS)
def test_vectors(a, b, s):
    x, y = np.array(a), np.array(b)
    same(kernels.add(a, b), x + y)
    same(kernels.subtract(a, b), x - y)
    same(kernels.scale(a, s), s * x)
    same(kernels.dot(a, b), x @ y, atol=1e-9)
    same(kernels.cross(a, b), np.cross(x, y), atol=1e-9)
    same(kernels.norm(a), np.linalg.norm(x), atol=1e-9)


# the spring that lets differences fade

OFFSETS, HALF_LIVES = st.floats(-2.0, 2.0), st.floats(0.02, 0.5)


@given(OFFSETS, OFFSETS, HALF_LIVES, st.floats(0.001, 0.1), st.floats(0.001, 0.1))
def test_two_short_decays_are_one_long_one(offset, rate, half_life, first, second):
    once = kernels.decay(offset, rate, half_life, first + second)
    twice = kernels.decay(*kernels.decay(offset, rate, half_life, first), half_life, second)
    np.testing.assert_allclose(twice, once, atol=1e-9)


@given(OFFSETS, HALF_LIVES)
def test_decay_from_rest_never_swings_past_zero_and_fades(offset, half_life):
    values = [offset]
    now = (offset, 0.0)
    for _ in range(400):
        now = kernels.decay(*now, half_life, half_life / 20)
        values.append(now[0])
    values = np.array(values)
    assert (np.sign(values) * np.sign(offset) >= 0).all()
    assert (np.diff(np.abs(values)) <= 1e-12).all()
    assert abs(values[-1]) <= 1e-6


@given(OFFSETS, OFFSETS, HALF_LIVES)
@settings(max_examples=15)
def test_decay_solves_its_differential_equation(offset, rate, half_life):
    """Oracle: a critically damped spring, integrated in small steps."""
    y = 2.0 * np.log(2.0) / half_life
    x, v, dt = offset, rate, 1e-5
    for _ in range(2000):
        v += dt * (-2.0 * y * v - y * y * x)
        x += dt * v
    np.testing.assert_allclose(kernels.decay(offset, rate, half_life, 0.02), (x, v), atol=2e-2 * (1 + abs(rate) * y))
