from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.geometry import signals

FLAGS = st.lists(st.booleans(), min_size=1, max_size=60).map(lambda values: np.array(values, bool))
RATE = 120.0


def two_flags(draw_length=60):
    return st.integers(1, draw_length).flatmap(
        lambda n: st.tuples(*[st.lists(st.booleans(), min_size=n, max_size=n).map(np.array)] * 2)
    )


# runs


@given(st.lists(st.sampled_from("LRDF"), min_size=1, max_size=40))
def test_runs_tell_the_whole_signal_in_order(letters):
    found = signals.runs(np.array(letters))
    assert [value for value, start, stop in found for _ in range(start, stop)] == letters
    assert all(a.stop == b.start and a.value != b.value for a, b in pairwise(found))


# switches


@given(two_flags())
def test_switch_is_on_where_it_is_told_and_off_where_it_may_not_stay(pair):
    on, stay = pair
    out = signals.switch(on, stay)
    assert out[on].all()
    assert not out[~on & ~stay].any()


@given(two_flags())
def test_switch_holds_each_stretch_whole_or_not_at_all(pair):
    on, stay = pair
    out, may = signals.switch(on, stay), on | stay
    np.testing.assert_array_equal(out[1:][may[1:] & may[:-1]], out[:-1][may[1:] & may[:-1]])
    for value, start, stop in signals.runs(out):
        assert not value or on[start:stop].any()


@given(two_flags())
def test_switch_agrees_with_a_walk_both_ways(pair):
    """Oracle: spread from each frame that is on, forwards and backwards, while it may stay."""
    on, stay = pair
    slow = on.copy()
    for order in (range(1, len(on)), range(len(on) - 2, -1, -1)):
        for i in order:
            back = i - 1 if order.step > 0 else i + 1
            slow[i] |= bool(slow[back] and (stay[i] or on[i]))
    np.testing.assert_array_equal(signals.switch(on, stay), slow)


# gaps and blips


@given(FLAGS, st.integers(0, 8))
def test_closing_leaves_no_short_gap_inside(values, shortest):
    out = signals.close_gaps(values, shortest, 0)
    assert (out | ~values).all(), "closing gaps takes nothing away"
    inside = [r for r in signals.runs(out) if not r.value and r.start > 0 and r.stop < len(out)]
    assert all(stop - start >= shortest for _, start, stop in inside)


@given(FLAGS, st.integers(0, 8))
def test_removing_blips_leaves_no_short_run_inside(values, shortest):
    out = signals.close_gaps(values, 0, shortest)
    assert (values | ~out).all(), "removing blips adds nothing"
    inside = [r for r in signals.runs(out) if r.value and r.start > 0 and r.stop < len(out)]
    assert all(stop - start >= shortest for _, start, stop in inside)


def test_stretches_cut_by_the_ends_stay():
    values = np.array([True, False, True, True, True, True, False])
    np.testing.assert_array_equal(signals.close_gaps(values, 3, 3), [True] * 6 + [False])
    np.testing.assert_array_equal(signals.close_gaps(~values, 2, 2), [False] * 6 + [True])


def test_closing_does_not_write_into_its_input():
    values = np.array([True, False, True])
    signals.close_gaps(values, 5, 5)
    np.testing.assert_array_equal(values, [True, False, True])


# smoothing and derivatives


@given(st.floats(-5.0, 5.0), st.integers(1, 200), st.floats(1.0, 20.0))
def test_lowpass_leaves_what_does_not_change_alone(level, frames, cutoff):
    np.testing.assert_allclose(signals.lowpass(np.full(frames, level), RATE, cutoff), level, atol=1e-9)


@given(st.floats(-5.0, 5.0), st.integers(8, 200))
def test_lowpass_leaves_straight_lines_alone_nearly_to_the_ends(slope, frames):
    line = slope * np.arange(frames) / RATE
    out = signals.lowpass(line, RATE, 6.0)
    assert np.abs(out - line).max() <= 0.01 * abs(slope) + 1e-300
    np.testing.assert_allclose(out[60:-60], line[60:-60], atol=1e-4 * abs(slope) + 1e-300)


@pytest.mark.parametrize(("frequency", "least", "most"), [(0.5, 0.99, 1.0), (6.0, 0.4, 0.6), (30.0, 0.0, 0.005)])
def test_lowpass_keeps_slow_and_drops_fast_without_delay(frequency, least, most):
    t = np.arange(600) / RATE
    wave = np.sin(2 * np.pi * frequency * t)
    out = signals.lowpass(wave, RATE, 6.0)[120:-120]
    gain = out @ wave[120:-120] / (wave[120:-120] @ wave[120:-120])
    late = out @ np.cos(2 * np.pi * frequency * t)[120:-120] / len(out)
    assert least <= gain <= most
    assert abs(late) < 1e-3


@given(st.integers(1, 12), st.floats(3.0, 60.0))
def test_lowpass_takes_signals_of_any_length_and_any_cutoff(frames, cutoff):
    signal = np.random.default_rng(frames).normal(size=(frames, 2, 3))
    out = signals.lowpass(signal, RATE, cutoff)
    assert out.shape == signal.shape
    assert np.isfinite(out).all()


def test_lowpass_filters_each_channel_by_itself():
    both = np.random.default_rng(0).normal(size=(50, 2))
    np.testing.assert_allclose(
        signals.lowpass(both, RATE, 6.0)[:, 1], signals.lowpass(both[:, 1].copy(), RATE, 6.0), atol=1e-12
    )


@given(st.floats(-3.0, 3.0), st.integers(1, 30))
def test_rate_of_change_of_a_line_is_its_slope(slope, frames):
    line = slope * np.arange(frames) / RATE
    np.testing.assert_allclose(signals.rate_of_change(line, RATE), slope if frames > 1 else 0.0, atol=1e-9)


def test_rate_of_change_of_a_wave_is_its_derivative():
    t = np.arange(240) / RATE
    np.testing.assert_allclose(signals.rate_of_change(np.sin(t), RATE)[1:-1], np.cos(t)[1:-1], atol=1e-4)
