"""Arrivals, times and ways; people who get stuck."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.scorecard.crowds import score_crowd
from stridecast.scorecard.travel import REACH, START
from tracked import RATE, crowd, still, straight

GATE = np.array([(-2.0, 10.0), (2.0, 10.0)])


def joined(*parts: np.ndarray) -> np.ndarray:
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


def test_who_walks_straight_at_the_wished_speed_takes_as_long_as_alone():
    way = straight((0, 0), (0, 1.25), 8.0)
    found = score_crowd(crowd(way), goals={0: GATE}, free_speeds=1.25).travel
    assert found.arrived == 1
    assert found.arrivals[0] == pytest.approx((10 - REACH) / 1.25, abs=1 / RATE)
    assert found.against_alone[0] == pytest.approx(1.0, abs=0.01)
    assert found.against_own_pace[0] == pytest.approx(1.0, abs=0.01)
    assert found.detours[0] == pytest.approx(1.0, abs=0.01)


def test_standing_before_costs_a_start_and_a_wait():
    way = joined(still((0, 0), 3.0), straight((0, 0), (0, 1.25), 8.0))
    found = score_crowd(crowd(way), goals={0: GATE}, free_speeds={0: 1.25}).travel
    assert found.alone[0] == pytest.approx((10 - REACH) / 1.25 + START)
    assert found.seconds[0] == pytest.approx(3.0 + (10 - REACH) / 1.25, abs=1 / RATE)


def test_a_detour_is_measured_against_straight_or_the_planned_way():
    way = joined(straight((0, 0), (1, 0), 3.0), straight((3, 0), (0, 1), 4.0))
    goal = np.array([(3.0, 4.0)])
    straight_on = score_crowd(crowd(way), goals={0: goal}).travel
    assert straight_on.detours[0] == pytest.approx((7 - REACH) / (5 - REACH), rel=0.01)
    planned = score_crowd(crowd(way), goals={0: goal}, ways={0: 7 - REACH}).travel
    assert planned.detours[0] == pytest.approx(1.0, rel=0.01)
    unknown = score_crowd(crowd(way)).travel
    assert unknown.detours[0] == pytest.approx(7 / 5)
    assert not unknown.has_goal.any()
    assert unknown.arrived == 0


def test_stops_are_reached_in_turn():
    forth, back = straight((0, 0), (0, 1), 10.0), straight((0, 10), (0, -1), 10.0)
    stops = [np.array([(0.0, 10.0)]), np.array([(0.0, 0.0)])]
    assert score_crowd(crowd(forth), goals={0: stops}).travel.arrived == 0  # the last stop is only where it began
    both = score_crowd(crowd(joined(forth, back)), goals={0: stops}).travel
    assert both.arrivals[0] == pytest.approx(20 - REACH, abs=1 / RATE)


def test_a_polygon_is_reached_at_its_side():
    square = np.array([(-1.0, 4.0), (1.0, 4.0), (1.0, 6.0), (-1.0, 6.0)])
    found = score_crowd(crowd(straight((0, 0), (0, 1), 6.0)), goals=square).travel
    assert found.arrivals[0] == pytest.approx(4 - REACH, abs=1 / RATE)


def test_who_stands_on_the_way_is_in_a_deadlock_until_they_go_on():
    stuck = joined(straight((0, 0), (0, 1.2), 4.0), still((0, 4.8), 15.0), straight((0, 4.8), (0, 1.2), 5.0))
    brief = joined(straight((5, 0), (0, 1.2), 4.0), still((5, 4.8), 9.0), straight((5, 4.8), (0, 1.2), 5.0))
    there = joined(straight((9, 0), (0, 1.2), 8.0), still((9, 9.6), 15.0))
    wide = np.array([(-2.0, 10.0), (12.0, 10.0)])
    found = score_crowd(crowd(stuck, brief, there), goals=wide).deadlocks
    (one,) = found
    assert (one.person, one.resolved, one.with_people) == (0, True, ())
    assert one.first == pytest.approx(4.0, abs=0.1)
    assert one.last == pytest.approx(19.0, abs=0.1)


def test_two_who_block_each_other_to_the_end():
    one = joined(straight((0, 0), (0, 1.2), 4.0), still((0, 4.8), 15.0))
    other = joined(straight((0, 10.2), (0, -1.2), 4.0), still((0, 5.4), 15.0))
    alone = joined(straight((8, 0), (0, 1.2), 4.0), still((8, 4.8), 15.0))
    goals = {0: np.array([(0.0, 12.0)]), 1: np.array([(0.0, 0.0)]), 2: np.array([(8.0, 12.0)])}
    score = score_crowd(crowd(one, other, alone), goals=goals)
    assert [(d.person, d.resolved, d.with_people) for d in score.deadlocks] == [
        (0, False, (1,)),
        (1, False, (0,)),
        (2, False, ()),
    ]
    assert score.blocking_groups == ((0, 1),)


def test_treading_on_the_spot_is_standing():
    t = np.arange(0, 20, 1 / RATE)
    sway = np.stack((0.1 * np.sin(5 * t), 0.1 * np.cos(3 * t)), axis=-1)
    found = score_crowd(crowd(sway), goals={0: np.array([(0.0, 9.0)])}).deadlocks
    assert [d.person for d in found] == [0]
    assert found[0].last - found[0].first > 15


def test_who_creeps_is_no_deadlock():
    assert not score_crowd(crowd(straight((0, 0), (0, 0.06), 60.0)), goals={0: GATE}).deadlocks
    slower = score_crowd(crowd(straight((0, 0), (0, 0.04), 60.0)), goals={0: GATE}).deadlocks
    assert [(d.first, d.last) for d in slower] == [pytest.approx((0.0, 60.0), abs=0.1)]


def test_without_a_goal_only_who_goes_on_meant_to_go():
    stays = joined(straight((0, 0), (0, 1.2), 4.0), still((0, 4.8), 15.0))
    goes = joined(stays, straight((0, 4.8), (0, 1.2), 4.0))
    assert not score_crowd(crowd(stays)).deadlocks
    assert [d.resolved for d in score_crowd(crowd(goes)).deadlocks] == [True]


@given(st.floats(10.5, 40.0), st.floats(0.3, 2.0))
def test_the_time_of_standing_is_that_of_the_stand(seconds, speed):
    way = joined(
        straight((0, 0), (0, speed), 5.0), still((0, 5 * speed), seconds), straight((0, 5 * speed), (0, speed), 5.0)
    )
    (found,) = score_crowd(crowd(way), goals={0: np.array([(0.0, 99.0)])}).deadlocks
    assert found.last - found.first == pytest.approx(seconds, abs=0.4)
