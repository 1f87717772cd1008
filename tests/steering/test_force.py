from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.errors import InputError
from stridecast.steering.force import SteeringGains

HALF_LIVES = st.floats(0.05, 2.0)


def followed(gains: SteeringGains, speed: float, seconds: float, dt: float = 1e-3) -> np.ndarray:
    """How far the point is ahead, frame by frame: it starts one metre away and moves evenly; nothing is clamped."""
    x, v, out = 0.0, 0.0, []
    for frame in range(round(seconds / dt)):
        point = 1.0 + speed * frame * dt
        out.append(point - x)
        v += dt * (gains.alpha * (point - x) - gains.beta * v)
        x += dt * v
    return np.array(out)


@given(HALF_LIVES)
def test_half_of_the_distance_is_made_up_in_a_half_life(half_life):
    left = followed(SteeringGains(half_life=half_life), 0.0, half_life, dt=half_life / 1000)
    assert left[-1] == pytest.approx(0.5, abs=0.01)


@given(HALF_LIVES)
def test_nothing_swings_past_the_point_with_a_damping_ratio_of_one(half_life):
    left = followed(SteeringGains(half_life=half_life), 0.0, 12 * half_life, dt=half_life / 200)
    assert (left > -1e-3).all()
    assert (np.diff(left) <= 1e-12).all()
    assert left[-1] < 0.01


def test_less_damping_swings():
    assert followed(SteeringGains(damping_ratio=0.3), 0.0, 3.0).min() < -0.1


@given(HALF_LIVES, st.floats(-3.0, 3.0), st.floats(0.5, 1.5))
def test_lag_is_how_long_the_vehicle_stays_behind_a_point_that_moves_evenly(half_life, speed, ratio):
    gains = SteeringGains(half_life=half_life, damping_ratio=ratio)
    left = followed(gains, speed, 30 * half_life, dt=half_life / 200)
    assert left[-1] == pytest.approx(gains.lag * speed, abs=0.02 * (1 + abs(speed)))


@pytest.mark.parametrize("name", ["half_life", "damping_ratio"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_gains_that_make_no_spring_are_refused_by_name(name, value):
    with pytest.raises(InputError, match=name):
        SteeringGains(**{name: value})
