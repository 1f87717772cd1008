"""The whole score: what it must not depend on, and what is refused."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from places import block, disc
from stridecast.errors import InputError
from stridecast.model.scene import Scene
from stridecast.model.trajectories import Trajectories
from stridecast.scorecard.clock import resampled, tracks
from stridecast.scorecard.crowds import score_crowd
from stridecast.scorecard.limits import Limits
from stridecast.scorecard.roster import roster
from tracked import RATE, crowd, straight, wandering

TIGHT = Limits(jerk=4.0, tangential=(-0.6, 0.6), lateral_per_speed=0.5, fastest=1.2)


def plain(score) -> dict:
    """Everything that names nobody."""
    content = score.as_json()
    deadlocks = sorted((d["first"], d["last"], d["resolved"]) for d in content.pop("deadlocks"))
    depths = [
        [(o["frames"], o["first"], o["depth"]) for o in content[k].pop("each")] for k in ("overlaps", "solid_overlaps")
    ]
    groups = sorted(len(group) for group in content.pop("blocking_groups"))
    return {**content, "stuck": deadlocks, "deep": depths, "groups": groups}


def flat(value, path=""):
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from flat(inner, f"{path}.{key}")
    elif isinstance(value, list | tuple):
        yield f"{path}.len", len(value)
        for k, inner in enumerate(value):
            yield from flat(inner, f"{path}[{k}]")
    else:
        yield path, value


def alike(one, other) -> None:
    one, other = dict(flat(one)), dict(flat(other))
    assert set(one) == set(other)
    for path, value in one.items():
        expected = value if value is None else pytest.approx(value, rel=1e-6, abs=1e-7)
        assert other[path] == expected, path


@given(st.integers(0, 2**32 - 1), st.floats(-np.pi, np.pi), st.floats(-200, 200), st.floats(0, 500), st.booleans())
def test_neither_place_nor_direction_nor_time_nor_names_matter(seed, turn, shift, later, mirrored):
    rng = np.random.default_rng(seed)
    walked = wandering(rng, 6, 3.0, 3.0)
    goals = {k: rng.uniform(0, 5, (1, 2)) for k in range(4)}
    score = score_crowd(walked, bounds=TIGHT, free_speeds=1.2, goals=goals, resolution=1e-5)
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ np.diag(
        [1, -1 if mirrored else 1]
    )
    names = rng.permutation(1000)[:6] - 500

    def moved(points):
        return points @ matrix.T + (shift, -shift / 3)

    ways = [moved(walked.positions[rows]) for _, rows in walked.each()]
    other = score_crowd(
        crowd(*ways, starts=(later,) * 6, ids=names.tolist()),
        bounds=TIGHT,
        free_speeds=1.2,
        goals={int(names[k]): moved(goal) for k, goal in goals.items()},
        resolution=1e-5,
    )
    one, two = plain(score), plain(other)
    for found, begun in ((one, 0.0), (two, later)):
        found["deep"] = [[(n, t - begun, d) for n, t, d in each] for each in found["deep"]]
        found["stuck"] = [(a - begun, b - begun, r) for a, b, r in found["stuck"]]
    alike(one, two)


def test_json_holds_plain_values():
    score = score_crowd(wandering(np.random.default_rng(0), 5, 4.0, 3.0), bounds=TIGHT)
    assert json.loads(json.dumps(score.as_json(), allow_nan=False)) == score.as_json()


def test_two_rows_are_judged_as_far_as_they_go():
    score = score_crowd(crowd(straight((0, 0), (0, 1), 1 / RATE)), bounds=TIGHT)
    assert (score.people, score.samples) == (1, 2)
    assert score.violations["speed"].samples == 1
    assert score.violations["jerk"].samples == 0
    assert score.as_json()["squared_jerk"] is None


def test_hundreds_of_people_take_a_second_or_two():
    rng = np.random.default_rng(1)
    t = np.arange(600)[:, None] / RATE
    ways = [np.abs((rng.uniform(0, 60, 2) + t * rng.normal(0, 0.8, 2)) % 80 - 40) for _ in range(500)]
    walked = crowd(*ways)
    begun = time.perf_counter()
    score_crowd(walked, bounds=TIGHT)
    assert time.perf_counter() - begun < 15  # below 1 s where nothing else runs


@pytest.mark.parametrize("decimals", [2, 3, 6])
@pytest.mark.parametrize("rate", [10.0, 30.0, 60.0])
def test_the_clock_is_found_though_times_are_rounded(decimals, rate):
    walked = crowd(straight((0, 0), (0, 1.2), 5.0, rate), straight((1, 0), (0, 1.2), 5.0, rate), rate=rate)
    times = np.round(walked.times, decimals)
    found = tracks(Trajectories(ids=walked.ids, times=times, positions=walked.positions))
    assert 1 / found.step == pytest.approx(rate, rel=1e-3)
    np.testing.assert_array_equal(found.frames, np.rint(walked.times * rate))


def test_a_gap_of_all_does_not_stretch_the_clock():
    walked = crowd(straight((0, 0), (0, 1.2), 5.0))
    kept = (walked.times < 1) | (walked.times > 3)
    found = tracks(Trajectories(ids=walked.ids[kept], times=walked.times[kept], positions=walked.positions[kept]))
    assert found.frames[-1] == 150


def test_people_on_clocks_of_their_own_are_refused_or_sampled_anew():
    walked = crowd(straight((0, 0), (0, 1.2), 5.0), straight((1, 0), (0, 1.2), 5.0), starts=(0.0, 0.4 / RATE))
    with pytest.raises(InputError, match=r"person \d at .* is off the common clock .*name a frame rate"):
        score_crowd(walked)
    score = score_crowd(walked, frame_rate=20.0)
    assert score.frame_rate == pytest.approx(20.0)
    assert score.smoothness.acceleration_99 == pytest.approx(0.0, abs=1e-6)


@given(st.integers(0, 2**32 - 1))
def test_sampling_anew_keeps_cubic_ways(seed):
    rng = np.random.default_rng(seed)
    terms = rng.normal(size=(4, 2))
    t = np.arange(31) / 10
    walked = crowd(np.stack([t**k for k in range(4)], axis=-1) @ terms, rate=10.0)
    anew = resampled(walked, 25.0)
    expected = np.stack([anew.times**k for k in range(4)], axis=-1) @ terms
    np.testing.assert_allclose(anew.positions, expected, atol=1e-9)
    assert len(anew) == 76


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"radius": 0.0}, "radius of person 0 must be above 0"),
        ({"radius": {0: 0.3}}, "no radius of person 1"),
        ({"radius": {0: 0.3, 1: 0.3, 7: 0.3}}, "radius of person 7"),
        ({"free_speeds": -1.0}, "free speed of person 0 must be above 0"),
        ({"goals": {9: np.zeros((1, 2))}}, "goal of person 9"),
        ({"goals": {0: [np.array([[np.nan, 0.0]])]}}, "goal of person 0: stops are arrays"),
        ({"ways": {0: np.nan}}, "way of person 0"),
        ({"frame_rate": 0.0}, "frame rate must be above 0"),
        ({"long": 0.0}, "long must be above 0"),
        ({"tolerance": -0.1}, "tolerance must not be below 0"),
        ({"resolution": np.nan}, "resolution must be above 0"),
    ],
)
def test_what_makes_no_sense_is_refused(wrong, says):
    with pytest.raises(InputError, match=says):
        score_crowd(crowd(straight((0, 0), (0, 1), 1.0), straight((1, 0), (0, 1), 1.0)), **wrong)


def test_one_moment_is_no_movement():
    with pytest.raises(InputError, match="nobody is there at two moments"):
        score_crowd(crowd(np.zeros((1, 2)), np.ones((1, 2))))


def test_people_of_a_scene_are_told_by_where_they_appear():
    scene = Scene(
        start=np.array([0.0, 0.0]),
        goals=np.array([[0.0, 5.0], [0.0, 9.0]]),
        obstacles=(disc("tree", 3.0, 3.0, 0.5), block("kiosk", 6.0, 6.0, 7.0, 7.0)),
    )
    walked = crowd(straight((5, 5), (0, 1), 1.0), straight((0.2, 0.1), (0, 1), 1.0), straight((0.1, 0), (0, 1), 1.0))
    found = roster(scene, walked)
    assert set(found.goals) == set(found.free_speeds) == set(found.radii) == {2}  # the nearest, once
    assert [stop.tolist() for stop in found.goals[2]] == [[[0.0, 5.0]], [[0.0, 9.0]]]
    assert found.radii[2] == scene.behavior.body_radius
