from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.body import kinematics
from stridecast.errors import WishError
from stridecast.geometry import ground
from stridecast.steering.curves import named_curve
from stridecast.synthesis.journey import PointStream, follow, stream_along
from stridecast.synthesis.walker import Walker

CURVES = st.sampled_from(("line:3", "circle:1.5", "square:2", "eight:1"))
SPEEDS = st.floats(0.3, 4.0)


def stream(times, points, motion: str = "walk") -> PointStream:
    times, points = np.asarray(times, float), np.asarray(points, float)
    return PointStream(times=times, points=points, motions=(motion,) * len(times))


# a point along a curve


@given(CURVES, SPEEDS, st.sampled_from((30.0, 60.0, 120.0)), st.floats(0.0, 2.0))
def test_the_point_runs_from_end_to_end_and_rests_at_both(name, speed, rate, pause):
    curve = named_curve(name)
    found = stream_along(curve, speed, rate=rate, pause=pause)
    np.testing.assert_array_equal(found.points[0], curve[0])
    np.testing.assert_allclose(found.points[-1], curve[-1], atol=1e-9)
    length = np.linalg.norm(np.diff(curve, axis=0), axis=-1).sum()
    assert found.times[-1] == pytest.approx(length / speed + 2 * pause, abs=2 / rate)
    early, late = found.times <= pause, found.times >= pause + length / speed
    np.testing.assert_allclose(found.points[early], np.tile(curve[0], (early.sum(), 1)), atol=1e-9)
    np.testing.assert_allclose(found.points[late], np.tile(curve[-1], (late.sum(), 1)), atol=1e-9)


@given(CURVES, SPEEDS)
def test_the_point_is_never_faster_than_told_and_seldom_slower(name, speed):
    found = stream_along(named_curve(name), speed, pause=0.5)
    speeds = np.linalg.norm(np.diff(found.points, axis=0), axis=-1) * 30.0
    assert speeds.max() <= speed * (1 + 1e-6)
    assert np.median(speeds[speeds > 1e-9]) == pytest.approx(speed, rel=0.02)


def test_the_motion_is_asked_for_all_the_way():
    assert set(stream_along(named_curve("line:2"), 3.0, motion="run").motions) == {"run"}


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_speeds_that_are_none_are_refused(speed):
    with pytest.raises(WishError, match="speed along a curve"):
        stream_along(named_curve("line"), speed)


@pytest.mark.parametrize("curve", [np.zeros((1, 2)), np.ones((5, 2)), np.array([[0.0, 0.0], [np.nan, 1.0]])])
def test_curves_that_lead_nowhere_are_refused(curve):
    with pytest.raises(WishError, match="two different points"):
        stream_along(curve, 1.0)


# samples of a device


@given(st.lists(st.floats(0.001, 0.2), min_size=1, max_size=30), st.integers(0, 1000))
def test_streams_are_linear_between_samples_whatever_the_device_jitters(gaps, seed):
    times = np.cumsum(gaps)
    points = np.random.default_rng(seed).normal(size=(len(times), 2))
    found, _ = stream(times, points).at(times)
    np.testing.assert_allclose(found, points, atol=1e-9)
    middles = (times[1:] + times[:-1]) / 2
    if len(middles):
        np.testing.assert_allclose(stream(times, points).at(middles)[0], (points[1:] + points[:-1]) / 2, atol=1e-9)


def test_a_motion_holds_from_its_sample_until_the_next():
    device = PointStream(times=np.array([0.0, 1.0, 2.0]), points=np.zeros((3, 2)), motions=("stand", "walk", "run"))
    assert device.at(np.array([0.0, 0.99, 1.0, 1.5, 2.0, 9.0]))[1] == ["stand", "stand", "walk", "walk", "run", "run"]


def test_streams_cannot_be_written_to():
    device = stream([0.0, 1.0], np.zeros((2, 2)))
    with pytest.raises(ValueError, match="read-only"):
        device.points[0] = 1.0


@pytest.mark.parametrize(
    ("times", "points", "motions", "culprit"),
    [
        ([], np.zeros((0, 2)), (), "no sample"),
        ([0.0, 1.0], np.zeros((3, 2)), ("walk",) * 2, "differ"),
        ([0.0, 1.0], np.zeros((2, 3)), ("walk",) * 2, "differ"),
        ([0.0, 1.0], np.zeros((2, 2)), ("walk",), "differ"),
        ([0.0, np.nan], np.zeros((2, 2)), ("walk",) * 2, "time of sample 1"),
        ([0.0, 1.0, 2.0], np.array([[0.0, 0.0], [0.0, np.inf], [np.nan, 0.0]]), ("walk",) * 3, "point of sample 1"),
        ([0.0, 1.0, 1.0], np.zeros((3, 2)), ("walk",) * 3, "sample 2: 1 s after 1 s"),
        ([0.0, 1.0, 0.5], np.zeros((3, 2)), ("walk",) * 3, "sample 2"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_streams_that_are_none_are_refused_with_the_sample(times, points, motions, culprit):
    with pytest.raises(WishError, match=culprit):
        PointStream(times=np.array(times, float), points=points, motions=motions)


# the whole walk


def test_a_journey_is_the_walk_frame_by_frame(database):
    device = stream_along(named_curve("eight:1.5"), 1.2)
    journey = follow(database, device)
    points, wanted = device.at(journey.times)
    walker = Walker(database, points[0], journey.headings[0])
    for frame in range(60):
        pose = walker.step(points[frame], motion=wanted[frame])
        np.testing.assert_array_equal(journey.motion.root_positions[frame], pose.root_position)
        np.testing.assert_array_equal(journey.positions[frame], pose.vehicle.position)
        assert (journey.motions[frame], journey.groups[frame]) == (pose.motion, pose.group)
        assert journey.clamped[frame] == pose.clamped


def test_everything_has_one_row_a_frame(formulas):
    journey = follow(formulas, stream_along(named_curve("line:2"), 1.0), frame_rate=60.0)
    frames = journey.motion.frames
    assert journey.motion.frame_rate == 60.0
    assert journey.motion.skeleton is formulas.skeleton
    np.testing.assert_allclose(np.diff(journey.times), 1 / 60, atol=1e-9)
    for field in fields(journey):
        if field.name not in ("motion", "made_up"):
            assert len(getattr(journey, field.name)) == frames, field.name
    assert journey.made_up == 0


def test_rotations_of_the_motion_never_flip_their_signs(database):
    rotations = follow(database, stream_along(named_curve("circle:1"), 1.2)).motion.rotations
    assert (np.sum(rotations[1:] * rotations[:-1], axis=-1) > 0).all()


@pytest.mark.parametrize("angle", [0.0, 1.0, np.pi, -2.0])
def test_it_looks_at_first_to_where_the_stream_leads(formulas, angle):
    curve = ground.turn(named_curve("line:2"), np.array(angle))
    journey = follow(formulas, stream_along(curve, 1.0))
    assert abs(ground.wrap(np.asarray(journey.headings[0] - angle))) < 1e-9
    assert np.abs(ground.wrap(journey.headings - angle)).max() < 0.05


def test_it_looks_where_it_is_told(formulas):
    journey = follow(formulas, stream_along(named_curve("line:2"), 1.0), heading=1.0)
    assert journey.headings[0] == pytest.approx(1.0)


def test_a_stream_of_one_sample_is_one_frame(formulas):
    journey = follow(formulas, stream([2.0], [[1.0, 1.0]]))
    assert journey.motion.frames == 1
    assert journey.times.tolist() == [2.0]


def test_progress_ends_with_all_frames(formulas):
    told: list[tuple[int, int]] = []
    journey = follow(formulas, stream_along(named_curve("line:2"), 1.0), progress=lambda *how: told.append(how))
    assert told[-1] == (journey.motion.frames, journey.motion.frames)
    assert [done for done, _ in told] == sorted({done for done, _ in told})
    assert len(told) == -(-journey.motion.frames // 30) + (journey.motion.frames % 30 != 1)


def test_a_motion_nobody_knows_is_refused_with_its_time(formulas):
    device = PointStream(times=np.array([0.0, 0.5, 1.0]), points=np.zeros((3, 2)), motions=("walk", "hop", "walk"))
    with pytest.raises(WishError, match=r"at 0\.500 s: .*'hop'"):
        follow(formulas, device)


@pytest.mark.parametrize(
    ("name", "speed", "most"), [("line:5", 1.3, 0.05), ("circle:3", 1.2, 0.35), ("eight:2", 1.0, 0.4)]
)
def test_curves_are_followed(database, name, speed, most):
    """From when it has got going: as far off the curve as the lag behind the point and the turning circle make it."""
    curve = named_curve(name)
    journey = follow(database, stream_along(curve, speed))
    dense = stream_along(curve, 0.01 * 30, pause=0.0).points
    on_the_way = journey.positions[60:-30]
    off = np.linalg.norm(on_the_way[:, None] - dense, axis=-1).min(axis=1)
    assert off.max() < most


def test_it_ends_standing_beside_the_last_point(database):
    journey = follow(database, stream_along(named_curve("line:5"), 1.2, pause=4.0))
    assert journey.motions[-1] == "stand"
    assert np.linalg.norm(journey.velocities[-1]) < 1e-2
    assert np.linalg.norm(journey.positions[-1] - [0.0, 5.0]) < 1.0
    assert journey.planted[-1].all()
    feet = kinematics.pose(journey.motion.clip(journey.motion.frames - 15, journey.motion.frames)).positions
    toes = feet[:, journey.motion.skeleton.chain("left_toe", "right_toe")]
    assert np.ptp(toes, axis=0).max() < 0.005
