from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.errors import InputError
from stridecast.geometry import ground
from stridecast.steering.curves import CURVES, STEP, named_curve

SIZES = st.floats(0.1, 50.0)
NAMES = sorted(CURVES)


def length(curve: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(curve, axis=0), axis=-1).sum())


def turned(curve: np.ndarray) -> np.ndarray:
    """Change of direction from piece to piece, positive to the left."""
    return ground.wrap(np.diff(ground.heading(np.diff(curve, axis=0))))


@pytest.mark.parametrize("name", NAMES)
@given(size=SIZES)
def test_every_curve_begins_at_the_origin_straight_ahead(name, size):
    curve = named_curve(f"{name}:{size}")
    np.testing.assert_array_equal(curve[0], 0.0)
    assert abs(ground.heading(curve[1])) < 0.2
    assert np.isfinite(curve).all()


@given(SIZES)
def test_line_is_as_long_as_it_says(size):
    assert length(named_curve(f"line:{size}")) == pytest.approx(size)


@given(SIZES)
def test_circle_keeps_its_radius_turns_left_and_closes(radius):
    curve = named_curve(f"circle:{radius}")
    np.testing.assert_allclose(np.linalg.norm(curve - [radius, 0.0], axis=-1), radius, rtol=1e-9)
    np.testing.assert_allclose(curve[-1], curve[0], atol=1e-9 * radius)
    assert (turned(curve) > 0).all()
    assert length(curve) == pytest.approx(2 * np.pi * radius, rel=0.01)


@given(SIZES)
def test_eight_goes_round_to_the_left_then_to_the_right(radius):
    curve = named_curve(f"eight:{radius}")
    half = len(curve) // 2
    assert (turned(curve[: half + 1]) > 0).all()
    assert (turned(curve[half:]) < 0).all()
    np.testing.assert_allclose(curve[[half, -1]], 0.0, atol=1e-9 * radius)
    assert np.abs(turned(curve)).max() < 0.5, "no corner in the middle"


@given(SIZES)
def test_square_has_four_sides_and_corners_to_the_left(side):
    curve = named_curve(f"square:{side}")
    assert length(curve) == pytest.approx(4 * side)
    np.testing.assert_allclose(turned(curve), np.pi / 2)
    np.testing.assert_array_equal(curve[-1], curve[0])


@pytest.mark.parametrize("name", ["circle", "eight"])
@given(size=st.floats(0.5, 50.0))
def test_round_curves_have_points_no_further_apart_than_promised(name, size):
    assert np.linalg.norm(np.diff(named_curve(f"{name}:{size}"), axis=0), axis=-1).max() <= STEP * (1 + 1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_without_a_number_a_curve_has_its_usual_size(name):
    np.testing.assert_array_equal(named_curve(name), named_curve(f"{name}:{CURVES[name][1]}"))


@pytest.mark.parametrize("text", ["spiral", "spiral:3", "", "Circle:3"])
def test_unknown_curves_are_refused_with_those_there_are(text):
    with pytest.raises(InputError, match=r"circle:3.*eight:2") as refused:
        named_curve(text)
    assert all(name in str(refused.value) for name in NAMES)


@pytest.mark.parametrize("size", ["0", "-1", "nan", "inf", "wide", "1e9"])
def test_sizes_that_are_none_are_refused(size):
    with pytest.raises(InputError, match=r"radius of circle.*positive"):
        named_curve(f"circle:{size}")
