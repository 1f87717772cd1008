from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.spatial.transform import Rotation

from stridecast.geometry import quaternions as quat

ORDERS = ["".join(order) for order in permutations("XYZ")]
HALF_TURN = np.array([0.0, 0.0, 1.0, 0.0])


def vectors(largest: float = 10.0) -> st.SearchStrategy[np.ndarray]:
    return arrays.arrays(np.float64, 3, elements=st.floats(-largest, largest, allow_subnormal=False))


def directions() -> st.SearchStrategy[np.ndarray]:
    return vectors(1.0).filter(lambda v: np.linalg.norm(v) > 1e-3)


def rotations() -> st.SearchStrategy[np.ndarray]:
    """Unit quaternions, the awkward ones too: the identity, half turns, tiny turns, negative real parts."""
    awkward = st.sampled_from([*np.eye(4), *-np.eye(4), [1.0, 1e-9, 0.0, 0.0], [1e-9, 0.0, 1.0, 0.0]])
    free = arrays.arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 1e-3)
    return st.one_of(free, awkward).map(lambda q: np.asarray(q) / np.linalg.norm(q))


def oracle(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


def same(a: np.ndarray, b: np.ndarray, atol: float = 1e-9) -> None:
    """Equal as rotations, whatever their signs."""
    a, b = np.broadcast_arrays(a, b)
    np.testing.assert_allclose(np.abs(np.sum(a * b, axis=-1)), 1.0, atol=atol)
    signs = np.sign(np.sum(a * b, axis=-1, keepdims=True))
    np.testing.assert_allclose(a, b * signs, atol=atol)


# the group


@given(rotations(), rotations(), rotations())
def test_product_is_a_group(a, b, c):
    np.testing.assert_allclose(quat.multiply(quat.multiply(a, b), c), quat.multiply(a, quat.multiply(b, c)), atol=1e-12)
    np.testing.assert_allclose(quat.multiply(quat.IDENTITY, a), a, atol=1e-15)
    np.testing.assert_allclose(quat.multiply(a, quat.IDENTITY), a, atol=1e-15)
    np.testing.assert_allclose(quat.multiply(a, quat.inverse(a)), quat.IDENTITY, atol=1e-12)
    assert np.linalg.norm(quat.multiply(a, b)) == pytest.approx(1.0, abs=1e-12)


@given(rotations(), rotations())
def test_product_agrees_with_scipy(a, b):
    same(quat.multiply(a, b), (oracle(a) * oracle(b)).as_quat(scalar_first=True))


@given(rotations(), rotations(), vectors())
def test_rotation_acts_as_the_group_does(a, b, v):
    np.testing.assert_allclose(quat.rotate(quat.multiply(a, b), v), quat.rotate(a, quat.rotate(b, v)), atol=1e-11)
    np.testing.assert_allclose(quat.rotate(a, v), oracle(a).apply(v), atol=1e-11)
    np.testing.assert_allclose(quat.rotate(-a, v), quat.rotate(a, v), atol=1e-12)
    assert np.linalg.norm(quat.rotate(a, v)) == pytest.approx(np.linalg.norm(v), abs=1e-11)


@given(rotations())
def test_matrix_agrees_with_scipy(q):
    np.testing.assert_allclose(quat.to_matrix(q), oracle(q).as_matrix(), atol=1e-12)


def test_normalize():
    np.testing.assert_allclose(quat.normalize(np.array([0.0, 3.0, 0.0, 4.0])), [0.0, 0.6, 0.0, 0.8])
    np.testing.assert_array_equal(quat.normalize(np.zeros((2, 4))), [quat.IDENTITY] * 2)


# exponential and logarithm


@given(vectors())
@example(np.zeros(3))
@example(np.array([1e-12, 0.0, 0.0]))
@example(np.array([0.0, 1e-160, 0.0]))
@example(np.array([0.0, np.pi, 0.0]))
@example(np.array([0.0, 2 * np.pi, 0.0]))
def test_exponential_agrees_with_scipy(v):
    same(quat.exp(v), Rotation.from_rotvec(v).as_quat(scalar_first=True))


@given(directions(), st.floats(0.0, np.pi - 1e-6))
@example(np.array([0.0, 0.0, 1.0]), 1e-12)
@example(np.array([0.0, 0.0, 1.0]), np.pi - 1e-6)
def test_logarithm_undoes_the_exponential(direction, angle):
    v = angle * direction / np.linalg.norm(direction)
    np.testing.assert_allclose(quat.log(quat.exp(v)), v, atol=1e-9)


@given(rotations())
def test_exponential_undoes_the_logarithm(q):
    v = quat.log(q)
    assert np.linalg.norm(v) <= np.pi + 1e-12
    same(quat.exp(v), q)
    same(quat.exp(quat.log(-q)), q)


def test_logarithm_of_a_half_turn_is_pi_long():
    assert np.linalg.norm(quat.log(HALF_TURN)) == pytest.approx(np.pi)
    np.testing.assert_array_equal(quat.log(quat.IDENTITY), np.zeros(3))
    np.testing.assert_array_equal(quat.log(-quat.IDENTITY), np.zeros(3))


@given(vectors(3.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_turns_about_one_axis_add_up(v, s, t):
    same(quat.multiply(quat.exp(s * v), quat.exp(t * v)), quat.exp((s + t) * v))


# directions


@given(directions(), directions())
@example(np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]))
@example(np.array([1.0, 0.0, 0.0]), np.array([-1.0, 1e-5, 0.0]))
@example(np.array([1.0, 0.0, 0.0]), np.array([-1.0, 3e-8, 0.0]))
@example(np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.5, 0.0]))
def test_between_takes_the_shortest_way(a, b):
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    q = quat.between(3.0 * a, 0.1 * b)
    np.testing.assert_allclose(quat.rotate(q, a), b, atol=1e-6)
    angle = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)
    assert np.linalg.norm(quat.log(q)) == pytest.approx(angle, abs=1e-6)


def test_between_of_nothing_turns_nothing():
    np.testing.assert_array_equal(quat.between(np.zeros(3), np.array([0.0, 1.0, 0.0])), quat.IDENTITY)


# the vertical


@given(st.floats(-np.pi + 1e-9, np.pi), rotations())
def test_twist_splits_a_rotation_about_the_vertical(angle, q):
    """Law: ``q = about_y(twist) * rest`` with no twist in the rest, and a turn of the heading adds to the twist."""
    rest = quat.multiply(quat.about_y(-quat.twist_about_y(q)), q)
    assert abs(rest[2]) < 1e-12 or abs(rest[0]) < 1e-12
    assert abs(quat.twist_about_y(rest)) < 1e-6 or np.hypot(rest[0], rest[2]) < 1e-6
    if np.hypot(q[0], q[2]) > 1e-3:
        turned = quat.twist_about_y(quat.multiply(quat.about_y(angle), q))
        difference = turned - quat.twist_about_y(q) - angle
        assert np.cos(difference) == pytest.approx(1.0, abs=1e-9)


@given(st.floats(-20.0, 20.0))
@example(np.pi)
@example(-np.pi)
def test_twist_of_a_heading_is_the_heading(angle):
    twist = quat.twist_about_y(quat.about_y(angle))
    assert -np.pi < twist <= np.pi
    assert np.cos(twist - angle) == pytest.approx(1.0, abs=1e-12)
    assert quat.twist_about_y(-quat.about_y(angle)) == pytest.approx(twist, abs=1e-9) or abs(twist) > np.pi - 1e-9


def test_heading_turns_forward_towards_x():
    """Heading 0 faces +Z and positive turns go to +X, as ``atan2(x, z)``."""
    np.testing.assert_allclose(
        quat.rotate(quat.about_y(0.3), np.array([0.0, 0.0, 1.0])), [np.sin(0.3), 0.0, np.cos(0.3)]
    )


# Euler angles


@pytest.mark.parametrize("order", ORDERS)
@given(arrays.arrays(np.float64, 3, elements=st.floats(-7.0, 7.0)))
def test_from_euler_agrees_with_scipy(order, angles):
    same(quat.from_euler(angles, order), Rotation.from_euler(order, angles).as_quat(scalar_first=True))


@pytest.mark.parametrize("order", ORDERS)
@given(rotations())
def test_to_euler_is_the_inverse(order, q):
    angles = quat.to_euler(q, order)
    same(quat.from_euler(angles, order), q, atol=1e-8)
    assert abs(angles[1]) <= np.pi / 2 + 1e-12


@pytest.mark.parametrize("order", ORDERS)
@given(st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)))
def test_to_euler_gives_the_angles_back(order, angles):
    np.testing.assert_allclose(quat.to_euler(quat.from_euler(np.array(angles), order), order), angles, atol=1e-8)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4])
def test_to_euler_near_gimbal_lock(order, sign, off):
    q = quat.from_euler(np.array([0.7, sign * (np.pi / 2 - off), -0.4]), order)
    same(quat.from_euler(quat.to_euler(q, order), order), q, atol=1e-8)


def test_one_and_two_channels():
    """Files give joints with one or two degrees of freedom."""
    same(quat.from_euler(np.array([0.5]), "Y"), quat.about_y(0.5))
    both = quat.from_euler(np.array([0.5, -0.2]), "YX")
    same(both, quat.multiply(quat.about_y(0.5), quat.exp(np.array([-0.2, 0.0, 0.0]))))


# series and sets


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_continuous_changes_signs_only(seed, frames):
    rng = np.random.default_rng(seed)
    q = quat.normalize(rng.normal(size=(frames, 3, 4)))
    smooth = quat.continuous(q)
    same(smooth, q)
    np.testing.assert_array_equal(smooth[0], q[0])
    assert (np.sum(smooth[1:] * smooth[:-1], axis=-1) >= 0).all()


@given(rotations(), rotations(), st.floats(0.0, 1.0))
def test_slerp_goes_evenly_the_short_way(a, b, t):
    here = quat.slerp(a, b, t)
    whole = np.linalg.norm(quat.log(quat.multiply(quat.inverse(a), b)))
    assert np.linalg.norm(quat.log(quat.multiply(quat.inverse(a), here))) == pytest.approx(t * whole, abs=1e-8)
    same(quat.slerp(a, b, 0.0), a)
    same(quat.slerp(a, b, 1.0), b)
    same(quat.slerp(a, -b, 1.0), b)


@given(st.integers(0, 2**32 - 1))
def test_mean_agrees_with_scipy(seed):
    rng = np.random.default_rng(seed)
    centre = quat.exp(rng.normal(size=3))
    q = quat.multiply(centre, quat.exp(0.4 * rng.normal(size=(7, 3)))) * rng.choice([-1.0, 1.0], (7, 1))
    weights = rng.uniform(0.1, 1.0, 7)
    same(quat.mean(q, weights), oracle(q).mean(weights=weights).as_quat(scalar_first=True), atol=1e-7)
    same(quat.mean(q), oracle(q).mean().as_quat(scalar_first=True), atol=1e-7)


@given(rotations())
def test_mean_of_one_is_itself_whatever_the_signs(q):
    same(quat.mean(np.stack([q, -q, q])), q)


def test_angular_velocity_of_a_steady_spin():
    spin = np.array([0.3, -1.2, 0.5])
    start = quat.exp(np.array([0.4, 0.2, -0.9]))
    q = quat.multiply(quat.exp(np.arange(5)[:, None] / 30.0 * spin), start)
    np.testing.assert_allclose(quat.angular_velocity(q, 30.0), np.tile(spin, (5, 1)), atol=1e-9)


def test_one_frame_does_not_turn():
    np.testing.assert_array_equal(quat.angular_velocity(quat.IDENTITY[None], 30.0), np.zeros((1, 3)))


# shapes


def test_everything_broadcasts():
    rng = np.random.default_rng(0)
    a, b = quat.normalize(rng.normal(size=(5, 1, 4))), quat.normalize(rng.normal(size=(3, 4)))
    u, v = rng.normal(size=(5, 1, 3)), rng.normal(size=(3, 3))
    for i in range(5):
        for j in range(3):
            np.testing.assert_array_equal(quat.multiply(a, b)[i, j], quat.multiply(a[i, 0], b[j]))
            np.testing.assert_array_equal(quat.rotate(a, v)[i, j], quat.rotate(a[i, 0], v[j]))
            np.testing.assert_array_equal(quat.between(u, v)[i, j], quat.between(u[i, 0], v[j]))
            np.testing.assert_allclose(
                quat.slerp(a, b, np.array(0.3))[i, j], quat.slerp(a[i, 0], b[j], np.array(0.3)), atol=1e-15
            )
    for one in (quat.log, quat.twist_about_y, quat.to_matrix, quat.normalize, lambda q: quat.to_euler(q, "ZXY")):
        np.testing.assert_allclose(one(a)[2, 0], one(a[2, 0]), atol=1e-15)
    assert quat.mean(np.tile(a, (1, 3, 1))).shape == (3, 4)
    assert quat.exp(np.zeros((0, 2, 3))).shape == (0, 2, 4)
