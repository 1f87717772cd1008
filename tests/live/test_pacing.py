from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.live.pacing import MOST_AT_ONCE, Bucket, Credit, Pacer


@given(st.floats(10, 240), st.lists(st.floats(0, 0.3), min_size=1, max_size=200), st.floats(0, 1e6))
def test_no_frame_is_lost_or_made_twice(rate, waits, start):
    """Frames made and frames left out are together those that a perfect clock would show: there is no drift."""
    pacer = Pacer(rate)
    pacer.start(start)
    now, made = start, pacer.due(start)
    for wait in waits:
        now += wait
        count = pacer.due(now)
        assert 0 <= count <= MOST_AT_ONCE
        made += count
    assert abs(made + pacer.late - (1 + (now - start) * rate)) < 1.001


@given(st.floats(10, 240), st.floats(0, 100))
def test_after_the_wait_a_frame_is_due(rate, now):
    pacer = Pacer(rate)
    pacer.start(now)
    assert pacer.due(now) == 1
    assert pacer.due(now) == 0
    assert 0 < pacer.wait(now) <= 1 / rate + 1e-9
    assert pacer.due(now + pacer.wait(now) + 1e-6) == 1


@given(st.lists(st.floats(0.25, 8), min_size=1, max_size=300))
def test_steps_add_up(paces):
    credit = Credit()
    assert sum(credit.take(pace) for pace in paces) == pytest.approx(sum(paces), abs=1.0)


@given(st.floats(1, 500), st.floats(1, 500), st.lists(st.floats(0, 1), max_size=500))
def test_no_more_come_than_are_let(rate, burst, waits):
    bucket, now, taken = Bucket(rate, burst), 0.0, 0
    for wait in waits:
        now += wait
        taken += bucket.take(now)
    assert taken <= burst + rate * now + 1e-6


def test_who_waits_is_let_in_again():
    bucket = Bucket(10, 2)
    assert [bucket.take(0.0) for _ in range(3)] == [True, True, False]
    assert bucket.take(0.11)
