"""Whatever a source does, its track is a person's; and a person's track comes back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stridecast.crowd import human_kernels
from stridecast.crowd.bounds import HumanBounds
from stridecast.crowd.human import HumanTrack, make_human
from stridecast.errors import InputError
from stridecast.geometry import ground
from stridecast.model.trajectories import Trajectories
from walks import KINDS, points_of

RATE = 60.0
SEEDS = st.integers(0, 2**32 - 1)

# about those of the sample person
BOUNDS = HumanBounds(
    jerk=np.array([13.0, 10.0]),
    tangential=np.array([[-2.0, 1.8], [-3.2, 2.6]]),
    lateral_per_speed=np.array([1.8, 1.4]),
    fastest=np.array([2.3, 4.5]),
    fades=(1.7, 2.3),
)
WALKER = HumanBounds(
    jerk=np.array([9.0]),
    tangential=np.array([[-1.1, 0.9]]),
    lateral_per_speed=np.array([1.2]),
    fastest=np.array([1.9]),
)


def trajectories(times: np.ndarray, *paths: np.ndarray, **more) -> Trajectories:
    """One person for each path, all at the same times."""
    return Trajectories(
        ids=np.repeat(np.arange(len(paths)), len(times)),
        times=np.tile(times, len(paths)),
        positions=np.concatenate(paths),
        **more,
    )


def wild(seed: int, rate: float, seconds: float = 8.0) -> tuple[np.ndarray, list[np.ndarray]]:
    """Sources of every kind, human and not."""
    frames = int(seconds * rate)
    return np.arange(frames) / rate, [points_of(kind, frames, rate, seed + i) for i, kind in enumerate(KINDS)]


def assert_lawful(track: HumanTrack, bounds: HumanBounds, rate: float = RATE) -> None:
    """Inside the bounds in every frame, by what was told and by finite differences alone."""
    v = track.vehicle
    for array in (v.position, v.velocity, v.acceleration, v.heading):
        assert np.isfinite(array).all()
    velocity = np.diff(v.position, axis=0) * rate
    assert np.allclose(velocity, v.velocity[1:], rtol=0, atol=1e-6)
    acceleration = np.diff(v.velocity, axis=0) * rate
    assert np.allclose(acceleration, v.acceleration[1:], rtol=0, atol=1e-6)
    ahead = ground.direction(v.heading[:-1])
    before = np.hypot(*v.velocity[:-1].T)
    jerk, low, high, wide = bounds.at(before)
    tangential = np.sum(acceleration * ahead, axis=-1)
    lateral = np.sum(acceleration * ground.left_of(ahead), axis=-1)
    assert (tangential <= high + 1e-6).all()
    assert (tangential >= low - 1e-6).all()
    assert (np.abs(lateral) <= wide + 1e-6).all()
    assert (np.hypot(*np.diff(v.acceleration, axis=0).T) * rate <= jerk + 1e-6).all()
    assert (np.hypot(*v.velocity.T) <= bounds.fastest[-1] + 1e-6).all()
    # the heading is the direction of motion, and nobody spins who does not walk
    moving = before > 0.01
    assert np.allclose(v.velocity[:-1][moving], before[moving, None] * ahead[moving], atol=1e-6)
    assert (np.abs(ground.wrap(np.diff(v.heading)))[~moving] < 0.3).all()


# laws


@given(SEEDS, st.sampled_from([2.5, 8.0, 16.0, 60.0]), st.sampled_from([BOUNDS, WALKER]))
@settings(max_examples=12)
def test_whatever_the_source_does_the_track_is_a_persons(seed, rate, bounds):
    times, paths = wild(seed, rate)
    source = trajectories(times, *paths)
    found = make_human(source, bounds, RATE)
    for track, path in zip(found.tracks, paths, strict=True):
        assert_lawful(track, bounds)
        assert abs(len(track) - 1 - times[-1] * RATE) < 1
        assert np.allclose(track.vehicle.position[0], path[0], atol=1.0) or track.report.largest_distance > 1.0


@given(SEEDS)
@settings(max_examples=8)
def test_what_is_human_comes_back(seed):
    """Tracks made human once change little; where they seem to sway, by no more than people sway."""
    times, paths = wild(seed, 10.0)
    once = make_human(trajectories(times, *paths), WALKER, RATE)
    again = trajectories(np.arange(len(once.tracks[0])) / RATE, *(t.vehicle.position for t in once.tracks))
    reports = [track.report for track in make_human(again, BOUNDS, RATE).tracks]
    assert np.median([r.mean_distance for r in reports]) < 0.005
    assert max(r.mean_distance for r in reports) < 0.06
    assert max(r.largest_distance for r in reports) < 0.25


@pytest.mark.parametrize("rate", [16.0, 60.0])
def test_smooth_human_ways_come_back_within_millimetres(rate):
    times = np.arange(0, 12, 1 / rate)
    speed, bend = 1.3 + 0.3 * np.sin(0.8 * times), 0.6 * np.sin(0.7 * times)
    heading = np.cumsum(speed * bend) / rate
    path = np.cumsum(speed[:, None] * ground.direction(heading), axis=0) / rate
    (track,) = make_human(trajectories(times, path), BOUNDS, RATE).tracks
    assert track.report.mean_distance < 0.002
    assert track.report.largest_distance < 0.01
    assert track.report.beyond == dict.fromkeys(("speed", "tangential", "lateral", "jerk"), 0)
    assert track.report.frames_away == 0


@given(SEEDS, st.floats(-np.pi, np.pi))
@settings(max_examples=6)
def test_the_track_turns_and_mirrors_with_the_source(seed, angle):
    # nothing that hangs on a hair: no noise, nothing straight behind
    rng = np.random.default_rng(seed)
    times = np.arange(0, 10, 0.1)
    knots = rng.normal(0.0, 1.0, (6, 2)) + np.arange(6)[:, None]
    path = np.stack([np.interp(times, np.linspace(0, 10, 6), 1.6 * knots[:, k]) for k in range(2)], axis=-1)
    turned = ground.turn(path, np.full(len(path), angle)) + np.array([3.0, -7.0])
    mirrored = path * np.array([-1.0, 1.0])
    plain, other, mirror = make_human(trajectories(times, path, turned, mirrored), BOUNDS, RATE).tracks
    back = ground.turn(other.vehicle.position - np.array([3.0, -7.0]), np.full(len(plain), -angle))
    assert np.allclose(back, plain.vehicle.position, atol=1e-4)
    assert np.allclose(mirror.vehicle.position * np.array([-1.0, 1.0]), plain.vehicle.position, atol=1e-4)
    assert np.allclose(np.sin(mirror.vehicle.heading), -np.sin(plain.vehicle.heading), atol=1e-3)


def test_others_do_not_matter_nor_does_their_order():
    times, paths = wild(5, 16.0)
    together = make_human(trajectories(times, *paths), BOUNDS, RATE).tracks
    reversed_ = make_human(trajectories(times, *paths[::-1]), BOUNDS, RATE).tracks[::-1]
    alone = [make_human(trajectories(times + 100.0, path), BOUNDS, RATE).tracks[0] for path in paths]
    for one, two, three in zip(together, reversed_, alone, strict=True):
        assert np.array_equal(one.vehicle.position, two.vehicle.position)
        assert np.allclose(one.vehicle.position, three.vehicle.position, atol=1e-6)
        assert three.start == 100.0


@given(SEEDS)
@settings(max_examples=8)
def test_who_is_seen_to_shift_about_stands(seed):
    rng = np.random.default_rng(seed)
    times = np.arange(0, 20, 1 / 16)
    head = 0.03 * np.stack((np.sin(1.9 * times), np.cos(1.3 * times)), axis=-1) + rng.normal(0, 0.003, (len(times), 2))
    facing = np.full(len(times), 1.0)
    (track,) = make_human(trajectories(times, head, headings=facing), BOUNDS, RATE).tracks
    assert np.ptp(track.vehicle.position, axis=0).max() == 0.0
    assert (track.vehicle.heading == 1.0).all()


@given(SEEDS)
@settings(max_examples=8)
def test_sway_of_the_head_is_taken_out(seed):
    rng = np.random.default_rng(seed)
    stride, wide, speed = rng.uniform(0.75, 1.1), rng.uniform(0.02, 0.05), rng.uniform(1.0, 1.6)
    times = np.arange(0, 15, 1 / 16)
    heading = rng.uniform(-3, 3) + 0.1 * times
    true = np.cumsum(speed * ground.direction(heading), axis=0) / 16
    sway = (
        wide
        * np.sin(2 * np.pi * stride * times + rng.uniform(0, 6))[:, None]
        * ground.left_of(ground.direction(heading))
    )
    head = true + sway + rng.normal(0, 0.003, true.shape)
    (track,) = make_human(trajectories(times, head), BOUNDS, RATE).tracks
    there = np.stack([np.interp(times, np.arange(len(track)) / RATE, track.vehicle.position[:, k]) for k in (0, 1)], -1)
    assert np.hypot(*(there - true).T).mean() < 0.008 < 0.5 * np.hypot(*sway.T).mean() + 0.003


def test_annotation_by_hand_at_two_and_a_half_hertz():
    times = np.arange(0, 30, 0.4)
    true = 6 * np.stack((np.sin(1.3 * times / 6), 1 - np.cos(1.3 * times / 6)), axis=-1)
    noise = np.random.default_rng(3).normal(0, 0.1, true.shape)
    (track,) = make_human(trajectories(times, true + noise), BOUNDS, RATE).tracks
    there = np.stack([np.interp(times, np.arange(len(track)) / RATE, track.vehicle.position[:, k]) for k in (0, 1)], -1)
    assert np.hypot(*(there - true).T).mean() < 0.7 * np.hypot(*noise.T).mean()
    speed = np.hypot(*track.vehicle.velocity.T)
    assert 0.9 < speed.min() < speed.max() < 1.8


def test_stop_and_go_stops_and_goes():
    times = np.arange(0, 20, 0.1)
    speed = np.where(np.sin(0.7 * times) > 0, 1.4, 0.0)
    path = np.stack((np.cumsum(speed) / 10, 0 * times), axis=-1)
    (track,) = make_human(trajectories(times, path), BOUNDS, RATE).tracks
    assert_lawful(track, BOUNDS)
    assert track.report.largest_distance < 0.25
    assert track.report.beyond["tangential"] > 0
    now = np.hypot(*track.vehicle.velocity.T)
    assert (now[int(6 * RATE) : int(8 * RATE)] == 0).all()
    assert np.ptp(track.vehicle.heading) < 0.05


def test_a_teleport_is_followed_as_well_as_a_person_can_and_told():
    times = np.arange(0, 30, 0.1)
    path = np.stack((1.2 * times, 0 * times), axis=-1)
    path[100:] += [5.0, 7.0]
    (track,) = make_human(trajectories(times, path), BOUNDS, RATE).tracks
    assert_lawful(track, BOUNDS)
    assert track.report.beyond["speed"] > 0
    assert track.report.frames_away > RATE
    assert track.report.largest_distance > 2
    assert np.hypot(*(track.vehicle.position[-1] - path[-1])) < 0.02


# recordings


@pytest.mark.parametrize("take", ["16_15", "16_21", "16_11", "08_01", "07_01", "09_01", "127_13"])
def test_recorded_people_come_back(mocap, take):
    from stridecast.analysis.take import analyse
    from stridecast.formats.recordings import load_motion

    (path,) = [*(mocap / "cmu").rglob(f"{take}.amc"), *(mocap / "cmu").rglob(f"{take}.bvh")][:1]
    motion = load_motion(path)
    vehicle, pelvis = analyse(motion).vehicle.positions, ground.project(motion.root_positions)
    times = np.arange(len(vehicle)) / motion.frame_rate
    first, second = make_human(trajectories(times, vehicle, pelvis), BOUNDS, RATE).tracks
    assert first.report.mean_distance < 0.01
    assert second.report.mean_distance < 0.04
    moments = np.minimum(np.arange(len(second)) / RATE, times[-1])
    true = np.stack([np.interp(moments, times, vehicle[:, k]) for k in (0, 1)], axis=-1)
    assert np.hypot(*(second.vehicle.position - true).T).mean() < 0.025
    assert_lawful(first, BOUNDS)
    assert_lawful(second, BOUNDS)


# the rest


def test_who_was_away_for_long_comes_back_with_another_track():
    times = np.array([0.0, 0.1, 0.2, 0.3, 0.9, 1.0, 3.0, 3.1, 3.2])
    tracks = make_human(trajectories(times, np.stack((times, 0 * times), -1)), BOUNDS, RATE).tracks
    assert [(t.person, t.start, t.report.samples) for t in tracks] == [(0, 0.0, 6), (0, 3.0, 3)]
    assert [len(t) for t in tracks] == [61, 13]


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_few_samples_are_enough(count):
    times = 0.4 * np.arange(count)
    (track,) = make_human(trajectories(times, np.stack((1.2 * times, 0 * times), -1)), BOUNDS, RATE).tracks
    assert len(track) == round(times[-1] * RATE) + 1
    assert_lawful(track, BOUNDS)
    assert track.report.mean_distance < 0.05


def test_nobody_makes_no_tracks():
    nobody = Trajectories(ids=np.zeros(0, np.int64), times=np.zeros(0), positions=np.zeros((0, 2)))
    assert make_human(nobody, BOUNDS, RATE).tracks == ()


def test_what_makes_no_sense_is_refused():
    times = np.array([0.0, 1000.0, 2000.0])
    source = trajectories(times, np.zeros((3, 2)))
    with pytest.raises(InputError, match=r"person 0 is seen every 1e\+03 s only"):
        make_human(source, BOUNDS, RATE)
    with pytest.raises(InputError, match="frame rate must lie between"):
        make_human(source, BOUNDS, 0.0)
    with pytest.raises(InputError, match="noise must lie between"):
        make_human(source, BOUNDS, RATE, noise=-1.0)


def test_the_kernel_does_as_python_does():
    times, paths = wild(1, 60.0, 2.0)
    reference = np.concatenate(paths)
    starts = np.arange(len(paths) + 1) * len(times)
    standing = np.arange(len(reference)) % 100 < 30
    outs = []
    for follow in (human_kernels.follow, human_kernels.follow.py_func):
        out = np.zeros((len(reference), 7))
        follow(
            reference,
            standing,
            starts,
            np.linspace(-3, 3, len(paths)),
            BOUNDS.jerk,
            BOUNDS.tangential,
            BOUNDS.lateral_per_speed,
            4.5,
            np.array(BOUNDS.fades),
            1 / RATE,
            out,
        )
        outs.append(out)
    assert np.allclose(*outs, rtol=0, atol=1e-6)
