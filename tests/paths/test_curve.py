from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from stridecast.errors import PathError
from stridecast.geometry import ground
from stridecast.model.scene import Behavior
from stridecast.paths.curve import LONGEST_TANGENT, STEP, Curve, limited_tangents, tangents
from stridecast.steering.curves import named_curve

AROUND = np.array([[0.0, 0.0], [-1.0, 5.0], [0.0, 10.0]])
"""Control points beside one obstacle."""


def zigzag(turns: np.ndarray, legs: np.ndarray) -> np.ndarray:
    headings = np.concatenate(([0.0], np.cumsum(turns)))[: len(legs)]
    return np.concatenate((np.zeros((1, 2)), np.cumsum(legs[:, None] * ground.direction(headings), axis=0)))


@st.composite
def controls(draw, sharpest: float = 1.2):
    count = draw(st.integers(1, 6))
    legs = draw(arrays(float, count, elements=st.floats(0.3, 12.0)))
    turns = draw(arrays(float, count, elements=st.floats(-sharpest, sharpest)))
    return zigzag(turns, legs)


def crosses_itself(points: np.ndarray) -> bool:
    import shapely

    return not shapely.LineString(points[::5]).is_simple


def test_two_points_make_a_straight_line():
    curve = Curve.hermite(np.array([[1.0, 2.0], [4.0, 6.0]]))
    assert curve.length == pytest.approx(5.0)
    np.testing.assert_allclose(curve.headings, np.arctan2(3, 4), atol=1e-12)
    np.testing.assert_allclose(curve.curvatures, 0.0, atol=1e-9)


@given(controls(), st.floats(0.3, 4.0), st.floats(40, 120))
def test_a_curve_passes_its_control_points_at_even_steps(points, velocity, weight):
    curve = Curve.hermite(points, Behavior(velocity=velocity, weight=weight))
    along = curve.nearest(points)
    np.testing.assert_allclose(curve.at(along).point, points, atol=2e-3)
    np.testing.assert_array_equal(curve.points[[0, -1]], points[[0, -1]])
    assert (np.diff(along) > 0).all()
    steps = np.linalg.norm(np.diff(curve.points, axis=0), axis=-1)
    assert steps.max() <= STEP * 1.01
    assert steps.sum() == pytest.approx(curve.length, rel=2e-3)


@given(controls(), st.floats(0.3, 4.0), st.floats(40, 120))
def test_headings_and_curvatures_are_those_of_the_points(points, velocity, weight):
    curve = Curve.hermite(points, Behavior(velocity=velocity, weight=weight))
    middle = (curve.headings[1:] + curve.headings[:-1]) / 2
    drawn = np.unwrap(ground.heading(np.diff(curve.points, axis=0)))
    gentle = np.abs(curve.curvatures) < 5  # a step of 2 cm does not show what is sharper
    assert np.abs(ground.wrap(middle - drawn))[gentle[1:] & gentle[:-1]].max(initial=0) < 0.02
    turned = np.sum((curve.curvatures[1:] + curve.curvatures[:-1]) / 2) * curve.step
    if gentle.all():
        assert turned == pytest.approx(curve.headings[-1] - curve.headings[0], abs=0.05)


@given(controls(sharpest=1.0), st.floats(0.3, 12.0), st.floats(20, 300))
def test_no_tangent_makes_a_loop(points, velocity, weight):
    curve = Curve.hermite(points, Behavior(velocity=velocity, weight=weight))
    legs = ground.heading(np.diff(points, axis=0))
    spread = np.abs(np.unwrap(legs) - legs[0]).max()
    if spread < 1.5:  # the line itself goes one way
        assert not crosses_itself(curve.points)
    _, leaving = limited_tangents(points, tangents(points, Behavior(velocity=velocity, weight=weight)))
    chords = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    assert (np.linalg.norm(leaving[:-1], axis=-1) <= LONGEST_TANGENT * chords * (1 + 1e-9)).all()


def test_tangents_are_those_of_the_paper():
    points = np.array([[0.0, 0.0], [1.0, 4.0], [3.0, 8.0], [8.0, 9.0]])
    found = tangents(points, Behavior(velocity=1.5, weight=84.0))
    for i in (1, 2):
        across, before = points[i + 1] - points[i - 1], points[i] - points[i - 1]
        expected = (across / np.linalg.norm(across) + before / np.linalg.norm(before)) * 1.5 * 84 / 70
        np.testing.assert_allclose(found[i], expected)


@pytest.mark.parametrize("corner", [0.3, 0.7, 1.2])
def test_the_faster_and_heavier_the_wider_the_turn(corner):
    points = zigzag(np.array([corner]), np.array([4.0, 4.0]))
    for name, values in (("velocity", [0.8, 1.3, 1.8, 2.5, 3.5]), ("weight", [40.0, 60.0, 80.0, 100.0])):
        sharpest = [np.abs(Curve.hermite(points, Behavior(**{name: v})).curvatures).max() for v in values]
        assert (np.diff(sharpest) <= 1e-9).all()
        assert sharpest[-1] < 0.75 * sharpest[0]


@given(st.floats(-5, 60), st.floats(-5, 60))
def test_along_and_nearest_are_inverse(one, other):
    curve = Curve.hermite(AROUND)
    given = np.array([[one, other]])
    place = curve.at(given)
    assert place.point.shape == (1, 2, 2)
    np.testing.assert_allclose(curve.nearest(place.point), np.clip(given, 0, curve.length), atol=1e-6)


def test_beyond_its_ends_a_curve_goes_straight_on():
    curve = Curve.hermite(AROUND)
    before, after = curve.at(np.array([-2.0, curve.length + 3.0])).point
    np.testing.assert_allclose(before, curve.points[0] - 2 * ground.direction(curve.headings[:1])[0])
    np.testing.assert_allclose(after, curve.points[-1] + 3 * ground.direction(curve.headings[-1:])[0])


def test_left_is_positive():
    curve = Curve.through(named_curve("circle:3"), rounding=0.0)
    assert np.median(curve.curvatures) == pytest.approx(1 / 3, rel=1e-3)
    assert curve.headings[-1] - curve.headings[0] == pytest.approx(2 * np.pi, abs=0.02)


@pytest.mark.parametrize("name", ["circle:3", "eight:2", "square:5", "line:6"])
@pytest.mark.parametrize("rounding", [0.0, 0.05, 0.2])
def test_a_drawn_line_is_kept_to_its_rounding(name, rounding):
    points = named_curve(name)
    curve = Curve.through(points, rounding=rounding)
    line = Curve.through(points, rounding=0.0)
    away = np.linalg.norm(line.at(line.nearest(curve.points)).point - curve.points, axis=-1)
    assert away.max() <= rounding + 1e-3
    np.testing.assert_allclose(curve.points[[0, -1]], points[[0, -1]], atol=1e-9)


@given(controls(sharpest=3.0), st.floats(0.02, 0.5))
def test_nothing_of_a_drawn_line_moves_further_than_its_rounding(points, rounding):
    curve = Curve.through(points, rounding=rounding)
    line = Curve.through(points, rounding=0.0)
    for a, b in ((curve, line), (line, curve)):
        assert np.linalg.norm(a.at(a.nearest(b.points)).point - b.points, axis=-1).max() <= rounding + STEP


def test_corners_are_rounded_without_a_jump():
    curve = Curve.through(named_curve("square:5"), rounding=0.1)
    assert 3 < curve.curvatures.max() < 12
    assert np.abs(np.diff(curve.curvatures)).max() < 2.0
    kept = Curve.through(named_curve("square:5"), rounding=0.0)
    assert kept.curvatures.max() > 20


def test_a_trembling_hand_is_smoothed():
    rng = np.random.default_rng(1)
    points = np.stack((np.zeros(400), np.linspace(0, 8, 400)), axis=-1) + rng.normal(0, 0.004, (400, 2))
    assert np.abs(Curve.through(points, rounding=0.1).curvatures).max() < 2.0


def test_repeated_points_count_once():
    points = np.array([[0.0, 0], [0, 0], [0, 3], [0, 3], [0, 3], [3, 3]])
    np.testing.assert_array_equal(Curve.through(points).points, Curve.through(points[[0, 2, 5]]).points)


def test_a_curve_cannot_be_changed():
    curve = Curve.hermite(AROUND)
    for name in ("points", "headings", "curvatures", "distances", "controls", "tangents"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(curve, name)[0] = 0


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("points", "says"),
    [
        (np.zeros((1, 2)), "two or more points"),
        (np.zeros((3, 3)), "shape"),
        (np.array([[0.0, 0], [np.nan, 1]]), "point 1 is not finite"),
        (np.zeros((4, 2)), "two different points|are the same"),
        (np.array([[0.0, 0], [1e9, 0]]), "longer than"),
    ],
)
def test_what_is_no_line_is_refused(points, says):
    for make in (Curve.through, Curve.hermite):
        with pytest.raises(PathError, match=says):
            make(points)


@pytest.mark.parametrize("rounding", [-0.1, float("nan"), float("inf")])
def test_a_rounding_that_is_none_is_refused(rounding):
    with pytest.raises(PathError, match="rounding must be"):
        Curve.through(AROUND, rounding=rounding)
