"""The bounds as laws: whatever is wished, from whatever state, what comes out keeps them."""

from __future__ import annotations

import inspect
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from stridecast.steering import kernels
from stridecast.steering.kernels import BEHIND, JERK, LATERAL, SPEED, TANGENTIAL

TOLERANCE = 1e-9
RATES = st.sampled_from((30.0, 60.0, 120.0))
WISHES = st.floats(-1e3, 1e3)
SEEDS = st.integers(0, 2**32 - 1)


@dataclass(frozen=True)
class Bounds:
    jerk: float
    low: float
    high: float
    lateral_per_speed: float
    slowest: float
    fastest: float


@st.composite
def any_bounds(draw) -> Bounds:
    slowest = draw(st.sampled_from((0.0, 0.3, 1.0)))
    return Bounds(
        jerk=draw(st.floats(2.0, 60.0)),
        low=-draw(st.floats(0.2, 4.0)),
        high=draw(st.floats(0.2, 4.0)),
        lateral_per_speed=draw(st.floats(0.0, 2.5)),
        slowest=slowest,
        fastest=slowest + draw(st.floats(0.2, 4.0)),
    )


@st.composite
def people(draw) -> Bounds:
    """Bounds that go together: the jerk is twice what the sharpest turn takes at the greatest speed or while braking.

    In a turn at the rate ``w`` an acceleration ``a`` comes round by ``w a`` a second, and braking narrows what is
    allowed across by as much again.
    """
    free = draw(any_bounds())
    sharpest = min(math.sqrt(0.5 * free.jerk / free.fastest), 0.25 * free.jerk / max(free.high, -free.low))
    return replace(free, lateral_per_speed=min(free.lateral_per_speed, sharpest))


def limited(wish: tuple[float, float], had: tuple[float, float], speed: float, b: Bounds, dt: float):
    """``limit`` with names."""
    given = {
        "wish_t": wish[0],
        "wish_l": wish[1],
        "had_t": had[0],
        "had_l": had[1],
        "speed": speed,
        "later_jerk": b.jerk,
        "rising": 0.0,
        "dt": dt,
        **vars(b),
    }
    return kernels.limit(*(given[name] for name in inspect.signature(kernels.limit.py_func).parameters))


@dataclass(frozen=True)
class Driven:
    """What a vehicle did, frame by frame: parts of its acceleration along and across the direction it had."""

    tangential: np.ndarray
    lateral: np.ndarray
    jerk: np.ndarray
    before: np.ndarray
    speed: np.ndarray
    heading: np.ndarray
    acted: np.ndarray


def drive(wishes, bounds, dt: float, speed: float, wish_of=None) -> Driven:
    """Integrate a vehicle; ``bounds`` are fixed or one for each frame, ``wish_of(speed, heading)`` steers by itself."""
    velocity, acceleration, heading, rows = np.array([0.0, speed]), np.zeros(2), 0.0, []
    for frame, wish in enumerate(wishes):
        b = bounds if isinstance(bounds, Bounds) else bounds[frame]
        ahead = np.array([math.sin(heading), math.cos(heading)])
        left = np.array([ahead[1], -ahead[0]])
        before = math.hypot(*velocity) * (-1.0 if velocity @ ahead < 0 else 1.0)
        wished = wish if wish_of is None else wish_of(before, heading)
        t, lateral, *_, acted = limited(wished, (acceleration @ ahead, acceleration @ left), before, b, dt)
        changed = t * ahead + lateral * left
        jerk = math.hypot(*(changed - acceleration)) / dt
        acceleration, velocity = changed, velocity + changed * dt
        now = math.hypot(*velocity)
        if now > 1e-3 and velocity @ ahead > 0:
            heading += math.atan2(velocity @ left, velocity @ ahead)
        rows.append((t, lateral, jerk, abs(before), now, heading, acted))
    return Driven(*np.array(rows).T)


def wild(seed: int, frames: int = 150) -> np.ndarray:
    """Wishes of all kinds: noise, held, to and fro, all one way."""
    rng = np.random.default_rng(seed)
    kind = rng.integers(4)
    if kind == 0:
        return rng.normal(0.0, 6.0, (frames, 2))
    if kind == 1:
        return np.repeat(rng.normal(0.0, 8.0, (frames // 15 + 1, 2)), 15, axis=0)[:frames]
    if kind == 2:
        return np.tile([[30.0, 30.0], [-30.0, -30.0]], (frames // 2, 1))
    return np.tile(rng.choice([-1e3, 1e3], 2), (frames, 1))


# one frame


@given(any_bounds(), WISHES, WISHES, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(0.0, 6.0), RATES)
def test_jerk_is_never_exceeded_from_any_state_but_to_come_to_a_stop(b, t, lateral, had_t, had_l, speed, rate):
    """Rather a jolt than a step backwards."""
    out = limited((t, lateral), (had_t, had_l), speed, b, 1 / rate)
    assert all(math.isfinite(value) for value in out)
    stopped = abs(speed + out[0] / rate) < 1e-12 and out[1] == 0.0
    assert stopped or math.hypot(out[0] - had_t, out[1] - had_l) <= b.jerk / rate + TOLERANCE


@given(any_bounds(), WISHES, WISHES, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(0.0, 6.0), RATES)
def test_nobody_goes_backwards(b, t, lateral, had_t, had_l, speed, rate):
    assert speed + limited((t, lateral), (had_t, had_l), speed, b, 1 / rate)[0] / rate >= -1e-12


@given(any_bounds(), WISHES, WISHES, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(0.0, 6.0), RATES)
def test_bounds_in_force_hold_what_comes_out(b, t, lateral, had_t, had_l, speed, rate):
    got_t, got_l, least, most, widest, _ = limited((t, lateral), (had_t, had_l), speed, b, 1 / rate)
    assert least <= got_t <= most
    assert abs(got_l) <= widest


@given(any_bounds(), WISHES, WISHES, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(0.0, 6.0), RATES)
def test_bounds_give_way_only_as_far_as_the_jerk_forces_them_to(b, t, lateral, had_t, had_l, speed, rate):
    """Whoever is outside goes back as fast as the jerk allows."""
    got_t, got_l, *_ = limited((t, lateral), (had_t, had_l), speed, b, 1 / rate)
    if speed + got_t / rate < 1e-12:
        return  # a stop
    outside = max(got_t - b.high, b.low - got_t, abs(got_l) - b.lateral_per_speed * speed)
    if outside > 1e-6:
        used = math.hypot(got_t - had_t, got_l - had_l) * rate
        assert used >= b.jerk * (1 - 1e-6)
        was = max(had_t - b.high, b.low - had_t, abs(had_l) - b.lateral_per_speed * speed)
        assert was > 0.0, "nobody leaves the bounds"


@given(people(), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.3, 0.7), RATES)
def test_a_wish_within_all_bounds_is_carried_out_to_the_letter(b, t, lateral, share, rate):
    speed = b.slowest + share * (b.fastest - b.slowest)
    room = min(b.fastest - speed, speed - b.slowest)
    reach = 0.5 * b.jerk / rate
    most = min(0.5 * room, reach, b.high, -b.low)
    wide = min(0.9 * b.lateral_per_speed * (speed - most / rate), reach, 0.1)
    wish = (most * t * 0.5, wide * lateral)
    got_t, got_l, *_, acted = limited(wish, (0.0, 0.0), speed, b, 1 / rate)
    assert (got_t, got_l) == pytest.approx(wish, abs=1e-12)
    assert acted == 0


@given(any_bounds(), WISHES, WISHES, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.0, 5.0), RATES)
def test_left_and_right_are_alike(b, t, lateral, had_t, had_l, speed, rate):
    here = limited((t, lateral), (had_t, had_l), speed, b, 1 / rate)
    there = limited((t, -lateral), (had_t, -had_l), speed, b, 1 / rate)
    assert there[0] == pytest.approx(here[0], abs=1e-12)
    assert there[1] == pytest.approx(-here[1], abs=1e-12)
    assert there[2:] == pytest.approx(here[2:], abs=1e-12)


@pytest.mark.parametrize(
    ("wish", "speed", "bit"),
    [((9.0, 0.0), 1.0, TANGENTIAL), ((0.0, 9.0), 1.0, LATERAL), ((0.5, 0.0), 1.999, SPEED), ((0.9, 0.0), 1.0, JERK)],
)
def test_the_bound_that_acted_is_named(wish, speed, bit):
    b = Bounds(jerk=60.0 if bit != JERK else 3.0, low=-1.0, high=1.0, lateral_per_speed=0.5, slowest=0.0, fastest=2.0)
    assert limited(wish, (0.0, 0.0), speed, b, 1 / 30)[-1] & bit


# many frames, bounds that stay


@given(people(), SEEDS, RATES, st.floats(0.0, 1.0))
def test_going_straight_keeps_every_bound_for_ever(b, seed, rate, share):
    wishes = wild(seed) * [1.0, 0.0]
    did = drive(wishes, b, 1 / rate, b.slowest + share * (b.fastest - b.slowest))
    assert did.jerk[did.speed > 1e-3].max(initial=0.0) <= b.jerk + 1e-6
    assert did.tangential.max() <= b.high + TOLERANCE
    assert did.tangential.min() >= b.low - TOLERANCE
    assert did.speed.max() <= b.fastest + TOLERANCE
    assert did.speed.min() >= b.slowest - 1e-6
    assert np.abs(did.lateral).max() <= TOLERANCE


@given(people(), SEEDS, RATES, st.floats(0.0, 1.0))
def test_turning_keeps_jerk_and_tangential_bounds_for_ever(b, seed, rate, share):
    did = drive(wild(seed), b, 1 / rate, b.slowest + share * (b.fastest - b.slowest))
    assert did.jerk[did.speed > 1e-3].max(initial=0.0) <= b.jerk + 1e-6
    assert did.tangential.max() <= b.high + TOLERANCE
    assert did.tangential.min() >= b.low - TOLERANCE


@given(people(), SEEDS, RATES, st.floats(0.0, 1.0))
def test_turning_keeps_the_bounds_on_speed_and_lateral_force(b, seed, rate, share):
    """Who brakes to a stop in a turn cannot take the force across away faster than the jerk allows: last 0.3 m/s."""
    did = drive(wild(seed), b, 1 / rate, b.slowest + share * (b.fastest - b.slowest))
    assert did.speed.max() <= b.fastest + 0.01
    assert did.speed.min() >= b.slowest - 0.01
    moving = did.before > 0.3
    assert (np.abs(did.lateral) - b.lateral_per_speed * did.before)[moving].max(initial=0.0) <= 0.01


@given(people(), SEEDS, RATES)
@settings(max_examples=20)
def test_direction_turns_no_faster_than_the_bound(b, seed, rate):
    did = drive(wild(seed), b, 1 / rate, b.fastest)
    moving = (did.before > 0.3)[1:] & (did.speed > 0.3)[1:]
    turned = np.abs(np.diff(did.heading)) * rate
    assert turned[moving].max(initial=0.0) <= b.lateral_per_speed * 1.1 + 1e-6


# many frames, bounds that change


@given(st.lists(people(), min_size=2, max_size=4), SEEDS, RATES)
@settings(max_examples=20)
def test_jerk_holds_also_where_bounds_change(several, seed, rate):
    each = [b for b in several for _ in range(40)]
    did = drive(wild(seed, len(each)), each, 1 / rate, 0.5 * (several[0].slowest + several[0].fastest))
    assert ((did.jerk <= np.array([b.jerk for b in each]) + 1e-6) | (did.speed < 1e-3)).all()
    assert np.isfinite(did.speed).all()


@given(people(), people(), RATES)
@settings(max_examples=20)
def test_narrower_bounds_are_met_as_soon_as_the_jerk_allows(wide, narrow, rate):
    wide = replace(wide, slowest=0.0, fastest=20.0)
    narrow = replace(narrow, slowest=0.0, fastest=20.0)
    frames, dt = 60, 1 / rate
    did = drive([(1e3, 0.0)] * 300, [wide] * frames + [narrow] * 240, dt, 1.0)
    over = did.tangential[frames - 1] - narrow.high
    late = frames + max(0, math.ceil(over / narrow.jerk * rate)) + 1
    assert did.tangential[late:].max(initial=0.0) <= narrow.high + TOLERANCE


# unwinding


@given(st.floats(0.0, 5.0), st.floats(0.5, 80.0), RATES)
@example(0.0, 10.0, 30.0)
@example(1e-9, 10.0, 30.0)
def test_what_can_be_unwound_never_overshoots_frame_by_frame(error, jerk, rate):
    a, gained = kernels.unwinding(error, jerk, 1 / rate), 0.0
    assert a >= 0.0
    while a > 0.0:
        gained += a / rate
        a -= jerk / rate
    assert gained <= error + TOLERANCE


@given(st.floats(0.1, 5.0), st.floats(2.0, 80.0), RATES)
def test_unwinding_takes_nearly_all_there_is(error, jerk, rate):
    """One step of jerk more would overshoot."""
    a, gained = kernels.unwinding(error, jerk, 1 / rate) + jerk / rate, 0.0
    while a > 0.0:
        gained += a / rate
        a -= jerk / rate
    assert gained > error


@given(st.floats(0.0, 5.0), st.floats(0.0, 1.0), st.floats(2.0, 80.0), RATES)
def test_more_room_never_allows_less(error, more, jerk, rate):
    assert kernels.unwinding(error + more, jerk, 1 / rate) >= kernels.unwinding(error, jerk, 1 / rate)


# the pull of a wished velocity


def pulled(
    along: float, across: float, speed: float, b: Bounds, side: float = 0.0, beta: float = 11.0, dt: float = 1 / 30
):
    return kernels.pull(along, across, speed, b.slowest, b.fastest, beta, b.jerk, side, dt)


@given(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0), st.floats(0.0, 3.0), st.sampled_from((-1.0, 0.0, 1.0)), people())
def test_pull_is_the_same_to_the_left_and_to_the_right(along, across, speed, side, b):
    if abs(across) < 1e-6:
        return  # straight back has to choose a side
    here, there = pulled(along, across, speed, b, side), pulled(along, -across, speed, b, -side)
    assert there == pytest.approx((here[0], -here[1], -here[2]), abs=1e-9)


@given(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0), st.floats(0.0, 3.0), people())
def test_pull_turns_towards_the_wish(along, across, speed, b):
    a, lateral, side = pulled(along, across, speed, b)
    assert lateral * across >= 0.0 or abs(across) < 1e-5  # straight behind there is no side
    assert math.isfinite(a)
    behind = math.hypot(along, across) > 1e-9 and abs(math.atan2(across, along)) > BEHIND
    assert (side != 0.0) == behind


@given(st.floats(-0.8, 0.8), st.sampled_from((-1.0, 1.0)), people())
def test_a_reversal_keeps_its_side_while_it_lasts(off, side, b):
    """Noise about straight back does not make the walker change his mind."""
    *_, kept = pulled(-2.0, off, 1.0, b, side)
    assert kept == side


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), people(), RATES)
@settings(max_examples=30)
def test_no_swinging_past_a_step_in_speed(start, wish, b, rate):
    slow, fast = b.slowest + start * (b.fastest - b.slowest), b.slowest + wish * (b.fastest - b.slowest)

    def wish_of(speed: float, heading: float) -> tuple[float, float]:
        return pulled(fast, 0.0, speed, b, dt=1 / rate)[:2]

    did = drive([None] * int(8 * rate), b, 1 / rate, slow, wish_of)
    past = (did.speed - fast) * (1.0 if fast > slow else -1.0)
    assert past.max() <= 0.02 * abs(fast - slow) + 2e-3
    reached = 1.0 + abs(fast - slow) / min(b.high, -b.low) + 2 * math.sqrt(abs(fast - slow) / b.jerk)
    if reached < 7.0:
        assert did.speed[-1] == pytest.approx(fast, abs=0.02)


@given(st.floats(-1.6, 1.6), people(), RATES)
@settings(max_examples=30)
def test_no_swinging_past_a_step_in_direction(angle, b, rate):
    b = replace(b, lateral_per_speed=max(b.lateral_per_speed, 0.3), slowest=0.0, jerk=max(b.jerk, 10.0))
    speed = min(1.4, b.fastest)

    def wish_of(now: float, heading: float) -> tuple[float, float]:
        off = angle - heading
        return pulled(speed * math.cos(off), speed * math.sin(off), now, b, dt=1 / rate)[:2]

    did = drive([None] * int(8 * rate), b, 1 / rate, speed, wish_of)
    past = (did.heading - angle) * math.copysign(1.0, angle)
    assert past.max() <= 0.06
