"""Bodies go where the source goes, as far as a person can, and begin and rest with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stridecast.analysis.take import analyse
from stridecast.body import kinematics
from stridecast.body.character import stature
from stridecast.crowd.baking import Baking
from stridecast.crowd.crowd import Crowd
from stridecast.crowd.dressing import dress, dress_each, rests_of
from stridecast.errors import InputError
from stridecast.formats.recordings import load_motion
from stridecast.geometry import ground
from stridecast.model.people import Person
from stridecast.model.scene import Scene
from stridecast.model.trajectories import Trajectories


def trajectories(times: np.ndarray, *paths: np.ndarray, first: int = 0, **more) -> Trajectories:
    return Trajectories(
        ids=np.repeat(np.arange(first, first + len(paths)), len(times)),
        times=np.tile(times, len(paths)),
        positions=np.concatenate(paths),
        **more,
    )


def stroll(heading: float, seconds: float, rate: float, speed: float = 1.1) -> tuple[np.ndarray, np.ndarray]:
    """From rest to a stroll and back to rest, straight."""
    fine = np.linspace(0.0, seconds, round(seconds * 240) + 1)
    ramp = np.clip(np.minimum(fine - 1.0, seconds - 1.0 - fine) / 2.0, 0.0, 1.0)
    way = np.concatenate(([0.0], np.cumsum(speed * ramp**2 * (3 - 2 * ramp))[:-1] * (fine[1] - fine[0])))
    times = np.arange(0, round(seconds * rate) + 1) / rate
    return times, np.interp(times, fine, way)[:, None] * ground.direction(np.array(heading))


def gap(one, source: Trajectories, rate: float) -> np.ndarray:
    """From the pelvis to the source, at the samples."""
    rows = source.rows(one.person)
    at = one.start + np.arange(one.frames) / rate
    pelvis = one.motion.root_positions[:, [0, 2]]
    there = np.stack([np.interp(source.times[rows], at, pelvis[:, k]) for k in (0, 1)], axis=-1)
    return np.linalg.norm(there - source.positions[rows], axis=-1)


def test_bodies_follow_and_stand_at_both_ends(formula_database):
    times, path = stroll(0.7, 8.0, 10.0)
    source = trajectories(times + 3.5, path, path + 4.0, first=7)
    found = dress(formula_database, source, heights={8: 1.5})
    assert [one.person for one in found.people] == [7, 8]
    assert found.mean_distance < 0.02
    for one in found.people:
        assert one.start == 3.5
        assert one.frames == one.motion.frames == 241
        assert gap(one, source, 30.0).mean() < 0.1
        toes = kinematics.pose(one.motion).positions[..., 1].min(axis=1)
        assert toes.min() > -0.03
        assert toes.max() < 0.15
        for still in (one.motion.root_positions[:20], one.motion.root_positions[-8:]):
            assert np.ptp(still, axis=0).max() < 0.03
    assert stature(found.people[1].motion.skeleton) == pytest.approx(1.5)
    assert found.beyond == dict.fromkeys(("speed", "tangential", "lateral", "jerk"), 0)


def test_our_own_crowd_comes_back(formula_database):
    starts = [(0, 0), (0.2, 7), (4, 3), (-4, 3.4)]
    ends = [(0, 7), (0, 0), (-4, 3), (4, 3.5)]
    people = tuple(
        Person(name=f"p{k}", start=np.array(a, float), stops=(np.array([b], float),))
        for k, (a, b) in enumerate(zip(starts, ends, strict=True))
    )
    frames = [item.frame for item in Baking(Crowd(formula_database, Scene(people=people), bodies=False))]
    ids = np.concatenate([f.ids for f in frames])
    times = np.concatenate([np.full(len(f.ids), f.time) for f in frames])
    places = np.concatenate([f.positions for f in frames])
    order = np.lexsort((times, ids))
    source = Trajectories(ids=ids[order], times=times[order], positions=places[order])
    found = dress(formula_database, source)
    assert found.mean_distance < 0.03
    for one in found.people:
        assert len(source.positions[source.rows(one.person)]) == one.frames
        assert gap(one, source, 30.0).mean() < 0.1


def test_annotations_by_hand_at_a_low_rate(formula_database):
    times, path = stroll(-2.0, 16.0, 2.5)
    rng = np.random.default_rng(5)
    source = trajectories(times, *(path + rng.normal(0, 0.05, path.shape) for _ in range(3)))
    found = dress(formula_database, source)
    for one in found.people:
        assert 0.02 < one.report.noise < 0.1
        assert gap(one, source, 30.0).mean() < 0.1
        pelvis = one.motion.root_positions[:, [0, 2]]
        truth = np.stack([np.interp(np.arange(one.frames) / 30, times, path[:, k]) for k in (0, 1)], axis=-1)
        assert np.linalg.norm(pelvis - truth, axis=-1).mean() < 0.08


def test_recorded_vehicles_are_followed(small_database, mocap):
    """Also where they do not belong to the database; as near as its people could."""
    for take in ("16/16_15", "16/16_31", "35/35_01"):
        understood = analyse(load_motion(mocap / "cmu" / f"{take}.amc"))
        path = understood.vehicle.positions
        source = trajectories(np.arange(len(path)) / understood.motion.frame_rate, path)
        (one,) = dress(small_database, source).people
        assert gap(one, source, small_database.frame_rate).mean() < 0.1, take


def test_what_nobody_could_walk_is_told(formula_database):
    times = np.arange(0, 6.01, 0.1)
    path = np.stack((np.where(times < 3, 0.0, 3.0), 1.2 * times), axis=-1)  # a jump of three metres
    found = dress(formula_database, trajectories(times, path))
    assert sum(found.beyond.values()) > 0
    (one,) = found.people
    assert one.report.frames_away > 0
    speeds = np.linalg.norm(np.diff(one.motion.root_positions[:, [0, 2]], axis=0), axis=-1) * 30
    assert speeds.max() < 6.0


def test_number_of_people_and_threads_decide_nothing(formula_database):
    times, path = stroll(0.0, 3.0, 10.0)
    some = trajectories(times, *(path + 3.0 * k for k in range(70)))
    apart = dress(formula_database, trajectories(times, path + 3.0 * 69, first=69)).people[0]
    together = dress(formula_database, some, threads=2).people[69]
    assert np.array_equal(apart.motion.root_positions, together.motion.root_positions)
    assert np.array_equal(apart.motion.rotations, together.motion.rotations)


def test_tracks_alone(formula_database):
    times, path = stroll(0.0, 4.0, 10.0)
    source = trajectories(times, path)
    (bare,) = dress_each(formula_database, source, bodies=False)
    (whole,) = dress(formula_database, source).people
    assert bare.motion is None
    assert np.array_equal(bare.vehicle.position, whole.vehicle.position)


@given(
    st.lists(st.floats(0.0, 3.0), min_size=1, max_size=6),
    st.lists(st.integers(1, 40), min_size=6, max_size=6),
)
@settings(max_examples=60)
def test_times_to_rest_are_true(levels, lengths):
    knots = np.concatenate(([0], np.cumsum(lengths[: len(levels)])))
    speeds = np.interp(np.arange(knots[-1] + 1), knots, [*levels, 0.0])
    rests = rests_of(speeds, 30.0)
    for k in np.flatnonzero(np.isfinite(rests)):
        ahead = round(rests[k] * 30)
        assert rests[k] * 30 == pytest.approx(ahead)
        assert speeds[k + ahead] == 0.0
        assert (speeds[k : k + ahead] > 0).all()
        assert speeds[k : k + ahead + 1].max() <= speeds[k] + 0.021
    assert rests[-1] == 0.0


def test_who_brakes_to_rest_knows_it_and_who_moves_off_knows_it_too():
    brakes = np.concatenate((np.full(30, 1.2), np.linspace(1.2, 0.0, 31), np.zeros(20)))
    rests = rests_of(brakes, 30.0)
    assert np.isinf(rests[:20]).all()
    assert np.allclose(rests[32:60], (60 - np.arange(32, 60)) / 30)
    assert (rests[60:] == 0).all()
    rests = rests_of(brakes[::-1].copy(), 30.0)
    assert (rests[:15] == 0).all()
    assert np.isinf(rests[20:]).all()
    assert np.isinf(rests_of(np.full(10, 1.0), 30.0)).all()


def test_bad_requests_are_refused_before_the_work(formula_database):
    times, path = stroll(0.0, 4.0, 10.0)
    source = trajectories(times, path)
    for options, says in [
        ({"frame_rate": 5}, "between 10 and 240 Hz"),
        ({"noise": -1.0}, "noise must lie between"),
        ({"heights": 9.0}, "person 0 should be 0.5 to 2.5 m tall"),
        ({"heights": {3: 1.7}}, "height of person 3, who is not in"),
    ]:
        with pytest.raises(InputError, match=says):
            dress_each(formula_database, source, **options)
    with pytest.raises(InputError, match="seen every 4 s only"):
        dress_each(formula_database, replace(source, times=source.times * 40))
