from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.analysis.bounds import METHODS, SLOWEST, SteeringSamples, learn_cyclic, learn_transition
from stridecast.analysis.take import analyse
from stridecast.errors import InputError
from stridecast.model.bounds import SteeringBounds
from synthetic_gait import gait

SEEDS = st.integers(0, 2**32 - 1)
SHARE = 0.9  # KS07


def samples(speeds, tangential, lateral, jerks=1.0) -> SteeringSamples:
    rows = np.broadcast_arrays(*(np.asarray(v, float) for v in (speeds, tangential, lateral, jerks)))
    return SteeringSamples(speeds=rows[0], tangential=rows[1], lateral=rows[2], jerks=rows[3])


def some(seed: int, frames: int = 40, segments: int = 8) -> list[SteeringSamples]:
    rng = np.random.default_rng(seed)
    return [
        samples(
            rng.uniform(0.0, 2.0, frames),
            rng.normal(0.2, 0.5, frames),
            rng.normal(0.0, 0.6, frames),
            rng.exponential(5.0, frames) + 0.01,
        )
        for _ in range(segments)
    ]


def pooled(segments: list[SteeringSamples], name: str) -> np.ndarray:
    return np.concatenate([getattr(s, name) for s in segments])


def turning(segments: list[SteeringSamples]) -> np.ndarray:
    speeds = pooled(segments, "speeds")
    moving = speeds > SLOWEST
    return np.abs(pooled(segments, "lateral")[moving]) / speeds[moving]


# the paper's 90 %


@given(SEEDS)
def test_paper_bounds_hold_nine_tenths_of_the_samples_and_no_more_than_needed(seed):
    segments = some(seed)
    bounds = learn_cyclic(segments, "paper")
    tangential = pooled(segments, "tangential")
    low, high = bounds.tangential[0]
    assert (low + high) / 2 == pytest.approx(tangential.mean())
    for values, bound in (
        (np.abs(tangential - tangential.mean()), (high - low) / 2),
        (turning(segments), bounds.lateral_per_speed),
    ):
        assert (values <= bound + 1e-12).mean() >= SHARE - 1e-9
        assert (values < bound - 1e-12).mean() < SHARE


@given(SEEDS, st.sampled_from(METHODS))
def test_jerk_and_speeds_hold_every_sample(seed, method):
    segments = some(seed)
    bounds = learn_cyclic(segments, method)
    assert bounds.jerk == pooled(segments, "jerks").max()
    for end, (low, high) in zip((0, -1), bounds.speed, strict=True):
        ends = [s.speeds[end] for s in segments]
        assert (low, high) == (min(ends), max(ends))


@given(SEEDS, st.sampled_from(METHODS))
def test_cyclic_bounds_are_the_same_at_both_ends_and_do_not_depend_on_order(seed, method):
    segments = some(seed)
    bounds, other = learn_cyclic(segments, method), learn_cyclic(segments[::-1], method)
    assert bounds.tangential[0] == bounds.tangential[1]
    assert bounds.lateral_per_speed == pytest.approx(other.lateral_per_speed)
    np.testing.assert_allclose(bounds.tangential, other.tangential)


@given(SEEDS, st.sampled_from(METHODS))
def test_left_and_right_turns_count_alike(seed, method):
    segments = some(seed)
    mirrored = [samples(s.speeds, s.tangential, -s.lateral, s.jerks) for s in segments]
    assert learn_cyclic(mirrored, method) == learn_cyclic(segments, method)


@given(st.integers(1, 20), st.sampled_from(METHODS))
def test_more_of_the_same_changes_nothing(times, method):
    once = some(7)
    np.testing.assert_allclose(
        learn_cyclic(once * times, method).tangential, learn_cyclic(once, method).tangential, rtol=0.05
    )
    assert learn_cyclic(once * times, method).lateral_per_speed == pytest.approx(
        learn_cyclic(once, method).lateral_per_speed, rel=0.05
    )  # a share of exactly nine tenths may fall on the next sample


# the balanced way


def mostly_straight(share_of_turns: float) -> list[SteeringSamples]:
    """A thousand frames of walking at 1.3 m/s, few of them in turns of up to 1.5 rad/s."""
    rng = np.random.default_rng(0)
    count = round(1000 * share_of_turns)
    rates = np.concatenate((rng.uniform(0.0, 0.1, 1000 - count), rng.uniform(0.1, 1.5, count)))
    return [samples(np.full(1000, 1.3), rng.normal(0.0, 0.1, 1000), 1.3 * rates)]


@pytest.mark.parametrize("share", [0.02, 0.05])
def test_balanced_bounds_let_the_recorded_turns_through_where_the_plain_share_forbids_them(share):
    segments = mostly_straight(share)
    assert learn_cyclic(segments, "paper").lateral_per_speed < 0.12
    assert learn_cyclic(segments, "balanced").lateral_per_speed > 1.0


def test_balanced_bounds_hardly_depend_on_how_often_people_turned():
    found = [learn_cyclic(mostly_straight(share)).lateral_per_speed for share in (0.02, 0.1, 0.4)]
    assert max(found) - min(found) < 0.25


@given(SEEDS)
def test_balanced_bounds_stay_within_what_was_recorded(seed):
    segments = some(seed)
    bounds = learn_cyclic(segments, "balanced")
    assert bounds.lateral_per_speed <= turning(segments).max()
    low, high = bounds.tangential[0]
    assert high - low <= 2 * np.ptp(pooled(segments, "tangential"))


def test_turning_on_the_spot_is_no_part_of_walking_on():
    walking = samples(np.full(100, 1.3), 0.0, np.full(100, 0.1))
    shuffling = samples(np.full(100, 0.5 * SLOWEST), 0.0, np.full(100, 3.0))
    assert learn_cyclic([walking, shuffling]).lateral_per_speed == learn_cyclic([walking]).lateral_per_speed


def test_turning_radius_follows_from_the_bound():
    bounds = learn_cyclic(mostly_straight(0.05))
    assert bounds.turning_radius(1.3) == pytest.approx(1.3 / bounds.lateral_per_speed)


def test_circle_that_was_walked_may_be_walked_again():
    steering = []
    for curvature in (0.0, 0.0, 0.0, 0.5, -0.5):
        analysis = analyse(gait(np.full(150, 1.3), curvature=curvature).motion)
        steering += [analysis.steering(segment) for segment in analysis.gait.segments]
    assert learn_cyclic(steering).turning_radius(1.3) < 2.2
    assert learn_cyclic(steering, "paper").turning_radius(1.3) < 2.2  # two fifths of the samples are turns


# transitions


def starting(frames: int = 30) -> SteeringSamples:
    u = np.linspace(0.0, 1.0, frames)
    return samples(1.2 * u * u, 0.5 + 2.0 * u, 0.1 * u, np.full(frames, 20.0))


STANDING = learn_cyclic([samples(np.linspace(0.0, 0.05, 30), 0.01, 0.0, 0.5)])
WALKING = learn_cyclic([samples(np.linspace(0.9, 1.6, 40), np.linspace(-0.6, 0.6, 40), 0.8, 30.0)])


def test_transition_tells_each_end_by_itself():
    bounds = learn_transition([starting()], None, None)
    first, last = bounds.tangential
    assert first[1] < last[1]
    assert last[1] == pytest.approx(2.5)
    assert bounds.speed == ((0.0, 0.0), (pytest.approx(1.2), pytest.approx(1.2)))
    assert bounds.jerk == 20.0


def test_transition_may_begin_and_end_as_the_motions_it_joins():
    bounds = learn_transition([starting()], STANDING, WALKING)
    assert bounds.jerk >= max(STANDING.jerk, WALKING.jerk)
    assert bounds.lateral_per_speed >= WALKING.lateral_per_speed
    for own, neighbour in ((bounds.tangential[0], STANDING), (bounds.tangential[1], WALKING)):
        low, high = neighbour.tangential_hull
        assert own[0] <= low
        assert own[1] >= high
    for own, theirs in ((bounds.speed[0], STANDING.speed[1]), (bounds.speed[1], WALKING.speed[0])):
        assert own[0] <= theirs[0]
        assert own[1] >= theirs[1]


@given(SEEDS)
def test_transition_bounds_hold_what_its_ends_did_and_rest(seed):
    segments = some(seed, segments=3)
    bounds = learn_transition(segments, None, None)
    for low, high in bounds.tangential:
        assert low <= 0.0 <= high
    for s in segments:
        assert bounds.tangential[0][0] <= s.tangential[0] <= bounds.tangential[0][1]
        assert bounds.tangential[1][0] <= s.tangential[-1] <= bounds.tangential[1][1]
        assert s.jerks.max() <= bounds.jerk


def test_transition_is_as_quick_as_it_is_told():
    assert learn_transition([starting()], None, None, jerk=55.0).jerk == 55.0


# refusals


@pytest.mark.parametrize("learn", [learn_cyclic, lambda none: learn_transition(none, None, None)])
def test_no_segment_teaches_nothing(learn):
    with pytest.raises(InputError, match="no segment"):
        learn([])


def test_unknown_method_is_named_with_those_there_are():
    with pytest.raises(InputError, match=r"fair.*balanced, paper"):
        learn_cyclic(some(0), "fair")


def test_bounds_know_their_hull():
    bounds = SteeringBounds(
        jerk=1.0, tangential=((-1.0, 0.5), (-0.2, 2.0)), lateral_per_speed=0.0, speed=((0.0, 0.0), (1.0, 1.0))
    )
    assert bounds.tangential_hull == (-1.0, 2.0)
    assert bounds.turning_radius(1.0) == float("inf")
