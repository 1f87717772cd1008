from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat

ANGLES = st.floats(-20.0, 20.0)
COORDINATES = st.floats(-50.0, 50.0)
PLACES = st.tuples(COORDINATES, COORDINATES).map(np.array)


@given(ANGLES)
@example(np.pi)
@example(-np.pi)
def test_heading_undoes_direction(angle):
    back = ground.heading(ground.direction(np.array(angle)))
    np.testing.assert_allclose(np.exp(1j * back), np.exp(1j * angle), atol=1e-12)
    assert -np.pi <= back <= np.pi


def test_headings_of_the_compass():
    directions = np.array([[0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]])
    np.testing.assert_allclose(ground.heading(directions), [0.0, np.pi / 2, np.pi, -np.pi / 2])


def test_heading_is_smooth_through_straight_back():
    """Equation 1 of the paper has no value at (0, -1)."""
    angles = np.linspace(np.pi - 0.1, np.pi + 0.1, 41)
    found = np.unwrap(ground.heading(np.stack((np.sin(angles), np.cos(angles)), axis=-1)))
    np.testing.assert_allclose(np.diff(found), 0.005, atol=1e-12)


@given(PLACES, st.floats(-2.0, 2.0))
def test_lift_keeps_the_ground_point_and_sets_the_height(place, height):
    lifted = ground.lift(place, height)
    np.testing.assert_array_equal(ground.project(lifted), place)
    assert lifted[1] == height


def test_lift_takes_one_height_for_each_point():
    lifted = ground.lift(np.zeros((3, 2)), np.array([0.0, 1.0, 2.0]))
    np.testing.assert_array_equal(lifted[:, 1], [0.0, 1.0, 2.0])


@given(ANGLES, PLACES)
def test_turn_is_the_rotation_by_the_heading(angle, place):
    turned = ground.turn(place, np.array(angle))
    world = quat.rotate(quat.about_y(angle), ground.lift(place))
    np.testing.assert_allclose(ground.lift(turned), world, atol=1e-12)


@given(ANGLES)
def test_turn_takes_left_and_forward_to_the_world(angle):
    facing = ground.direction(np.array(angle))
    np.testing.assert_allclose(ground.turn(np.array([0.0, 1.0]), np.array(angle)), facing, atol=1e-12)
    np.testing.assert_allclose(ground.turn(np.array([1.0, 0.0]), np.array(angle)), ground.left_of(facing), atol=1e-12)


@given(ANGLES)
def test_left_is_up_cross_forward(angle):
    facing = ground.direction(np.array(angle))
    up_cross = np.cross([0.0, 1.0, 0.0], ground.lift(facing))
    np.testing.assert_allclose(ground.lift(ground.left_of(facing)), up_cross, atol=1e-15)


@given(ANGLES)
def test_positive_headings_turn_left(angle):
    onward = ground.direction(np.array(angle + 0.1)) - ground.direction(np.array(angle))
    assert onward @ ground.left_of(ground.direction(np.array(angle))) > 0.09


@given(st.floats(-1e3, 1e3))
@example(np.pi)
@example(-np.pi)
def test_wrap_keeps_the_direction_and_stays_in_one_turn(angle):
    wrapped = ground.wrap(np.array(angle))
    assert -np.pi <= wrapped <= np.pi
    turns = (angle - wrapped) / (2 * np.pi)
    assert abs(turns - round(turns)) < 1e-9
