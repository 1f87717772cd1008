"""What exceeds the bounds of a human body is counted, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.errors import InputError
from stridecast.scorecard.crowds import score_crowd
from stridecast.scorecard.limits import KINDS, Limits
from tracked import crowd, straight

HUMAN = Limits(jerk=60.0, tangential=(-4.0, 3.0), lateral_per_speed=1.8, fastest=2.2)


def lawful(seed: int, rate: float, early: bool, frames: int = 240) -> np.ndarray:
    """Somebody who does all that the bounds allow, and no more: ``v += a dt``, ``x += v dt`` in either order."""
    rng = np.random.default_rng(seed)
    dt = 1 / rate
    x, v, had, heading = rng.uniform(-50, 50, 2), np.zeros(2), np.zeros(2), rng.uniform(-np.pi, np.pi)
    out = []
    for frame in range(frames):
        if frame % 15 == 0:
            # turns that can be given up again in time, lest nothing lawful be left
            pace, heading = rng.uniform(0.9, 1.8), heading + rng.uniform(-0.9, 0.9)
        wish = 5 * (pace * np.array([np.sin(heading), np.cos(heading)]) - v)
        speed = float(np.hypot(*v))
        along = v / speed if speed > 1e-9 else np.array([np.sin(heading), np.cos(heading)])
        across = np.array([along[1], -along[0]])
        for share in np.linspace(1.0, 0.0, 101):
            # from where it was towards the wish, as far as all bounds allow
            a = had + share * (wish - had)
            if np.hypot(*(a - had)) > 60.0 * dt:
                continue
            low = -min(4.0, speed / dt)
            t, side = np.clip(a @ along, low, 3.0), np.clip(a @ across, -1.8 * speed, 1.8 * speed)
            a = t * along + side * across
            if np.hypot(*(a - had)) <= 60.0 * dt and np.hypot(*(v + a * dt)) <= 2.2:
                break
        else:
            return np.array(out)  # nothing is lawful any more; what was, is judged
        out.append(x.copy())
        if early:
            v = v + a * dt
            x = x + v * dt
        else:
            x = x + v * dt
            v = v + a * dt
        had = a
    return np.array(out)


@given(st.integers(0, 2**32 - 1), st.sampled_from([10.0, 30.0, 60.0]), st.booleans())
def test_lawful_movement_counts_nothing_though_files_round_it(seed, rate, early):
    way = lawful(seed, rate, early)
    if len(way) < 5:
        return
    walked = crowd(np.round(way, 6), rate=rate)
    found = score_crowd(walked, bounds=HUMAN).violations
    assert {kind: found[kind].count for kind in KINDS} == dict.fromkeys(KINDS, 0)
    assert found["jerk"].samples == len(way) - 3


def test_lawful_movement_is_long_and_lively():
    ways = [lawful(seed, 30.0, False) for seed in range(10)]
    assert np.median([len(way) for way in ways]) >= 120
    tight = Limits(jerk=40.0, tangential=(-2.5, 2.0), lateral_per_speed=1.2, fastest=1.5)
    found = score_crowd(crowd(*ways), bounds=tight).violations
    assert all(found[kind].count > 0 for kind in KINDS)


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_a_circle_has_the_lateral_acceleration_of_its_speed(factor):
    speed, turn = 1.3, 1.8 * factor
    t = np.arange(120) / 30
    # the discrete circle whose steps turn by just so much
    angle = 2 * np.arcsin(turn / 30 / 2) * np.arange(120)
    way = np.cumsum(speed / 30 * np.stack((np.sin(angle), np.cos(angle)), axis=-1), axis=0)
    score = score_crowd(crowd(way), bounds=Limits(jerk=200.0, tangential=(-4, 3), lateral_per_speed=1.8, fastest=2.2))
    assert score.smoothness.acceleration_99 == pytest.approx(speed * turn, rel=1e-6)
    found = score.violations
    assert found["lateral"].count == (118 if factor > 1 else 0)
    assert found["speed"].count == found["tangential"].count == found["jerk"].count == 0
    if factor > 1:
        assert found["lateral"].worst == pytest.approx(factor, rel=1e-2)
        assert found["lateral"].share == 1.0
    assert len(t) == len(way)


def test_a_jump_is_counted_in_every_difference():
    way = straight((0, 0), (0, 1.2), 4.0)
    way[60:] += (0.0, 3.0)
    found = score_crowd(crowd(way, straight((5, 0), (0, 1.2), 4.0)), bounds=HUMAN).violations
    assert {kind: found[kind].count for kind in KINDS} == {"speed": 1, "tangential": 2, "lateral": 0, "jerk": 3}
    assert all(found[kind].people == 1 for kind in ("speed", "tangential", "jerk"))
    assert found["speed"].samples == 2 * (len(way) - 1)
    assert found["speed"].worst == pytest.approx((1.2 + 90.0) / 2.2)


def test_a_jump_aside_is_lateral():
    way = straight((0, 0), (0, 1.2), 4.0)
    way[60:] += (0.02, 0.0)
    found = score_crowd(crowd(way), bounds=HUMAN).violations
    assert found["lateral"].count >= 1
    assert found["lateral"].people == 1
    assert found["speed"].count == 0


def test_what_is_missing_is_not_judged():
    way = straight((0, 0), (0, 1.2), 4.0)
    walked = crowd(way)
    kept = np.ones(len(way), bool)
    kept[50:60] = False
    walked = type(walked)(ids=walked.ids[kept], times=walked.times[kept], positions=walked.positions[kept])
    found = score_crowd(walked, bounds=HUMAN).violations
    assert all(found[kind].count == 0 for kind in KINDS)
    assert found["speed"].samples == kept.sum() - 2
    assert found["jerk"].samples == kept.sum() - 6


def test_speeding_up_and_braking_have_bounds_of_their_own():
    t = np.arange(0, 0.5, 1 / 30)
    for amount, count in ((2.9, 0), (3.5, len(t) - 2)):
        way = np.stack((np.zeros(len(t)), 0.5 * t + amount / 2 * t * t), axis=-1)
        found = score_crowd(crowd(way), bounds=HUMAN).violations
        assert found["tangential"].count == count
        back = np.stack((np.zeros(len(t)), 2.0 * t - amount / 2 * t * t), axis=-1)
        assert score_crowd(crowd(back), bounds=HUMAN).violations["tangential"].count == 0


def test_plain_numbers_will_do_and_wrong_ones_are_refused():
    walked = crowd(straight((0, 0), (0, 1.2), 1.0))
    numbers = {"jerk": 60, "tangential": [-4, 3], "lateral_per_speed": 1.8, "fastest": 1.0}
    assert score_crowd(walked, bounds=numbers).violations["speed"].count == 30
    with pytest.raises(InputError, match="fastest are missing"):
        score_crowd(walked, bounds={k: v for k, v in numbers.items() if k != "fastest"})
    with pytest.raises(InputError, match="slowest are none"):
        score_crowd(walked, bounds={**numbers, "slowest": 1})
    with pytest.raises(InputError, match="jerk must be above 0"):
        score_crowd(walked, bounds={**numbers, "jerk": 0.0})
    with pytest.raises(InputError, match="room to brake"):
        score_crowd(walked, bounds={**numbers, "tangential": (1, 2)})
    assert score_crowd(walked).violations is None
