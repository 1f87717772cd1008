"""Plans of speeds: never faster than asked for or than bounds allow, slower only where they must be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.errors import DatabaseError, PathError
from stridecast.model.scene import Behavior, Station
from stridecast.paths.curve import Curve
from stridecast.paths.plan import bounds_of, greatest, plan_speeds, slowest
from stridecast.steering.curves import named_curve

CURVES = ("line:9", "circle:1", "circle:3", "eight:2", "square:5")


@st.composite
def ways(draw):
    """Bent lines as a hand draws them."""
    count = draw(st.integers(2, 7))
    steps = draw(st.lists(st.floats(0.8, 4.0), min_size=count, max_size=count))
    turns = draw(st.lists(st.floats(-1.8, 1.8), min_size=count, max_size=count))
    heading = np.cumsum(turns)
    points = np.cumsum(np.array(steps)[:, None] * np.stack((np.sin(heading), np.cos(heading)), axis=-1), axis=0)
    return Curve.through(np.concatenate((np.zeros((1, 2)), points)), rounding=draw(st.floats(0.05, 0.3)))


BEHAVIORS = st.builds(Behavior, velocity=st.floats(0.4, 5.0), status=st.sampled_from(("walk", "run")))


@given(ways(), BEHAVIORS)
def test_a_plan_keeps_what_it_is_held_to(sample_person, curve, behavior):
    plan = plan_speeds(curve, sample_person, behavior)
    walk, run = bounds_of(sample_person, "walk"), bounds_of(sample_person, "run")
    own = [run if behavior.status == "run" else walk, walk]
    assert plan.speeds[0] == plan.speeds[-1] == 0.0
    assert (plan.speeds >= 0).all()
    assert (plan.speeds <= max(behavior.velocity, *(slowest(b) for b in own)) + 1e-9).all()  # nobody is slower
    assert plan.speeds.max() <= max(greatest(b) for b in own) + 1e-9
    braking = max(-b.tangential_hull[0] for b in own)
    gathering = max(b.tangential_hull[1] for b in own)
    gained = np.diff(0.5 * plan.speeds**2) / np.diff(plan.distances)
    assert gained.max() <= gathering + 1e-6
    assert gained.min() >= -braking - 1e-6
    assert (np.diff(plan.rests_in) < 0).all()
    assert plan.rests_in[-1] == 0.0
    assert plan.motions[-1] == "stand"
    assert set(plan.motions) <= {"walk", "run", "stand"}
    if behavior.status == "walk":
        assert "run" not in plan.motions


@given(ways(), st.floats(0.6, 1.4))
def test_bends_are_taken_no_faster_than_people_turn(sample_person, curve, speed):
    plan = plan_speeds(curve, sample_person, Behavior(velocity=speed))
    turning = plan.speeds * np.abs(curve.curvatures)
    # kinks of a hand are blurred over a tenth of a metre
    blurred = np.convolve(turning, np.ones(25) / 25, mode="valid")
    least = slowest(bounds_of(sample_person, "walk"))
    slow = np.convolve(plan.speeds, np.ones(25) / 25, mode="valid") <= 1.05 * least
    assert (blurred[~slow] <= bounds_of(sample_person, "walk").lateral_per_speed).all()


@pytest.mark.parametrize("name", CURVES)
def test_the_time_is_that_of_going_so_fast(sample_person, name):
    plan = plan_speeds(Curve.through(named_curve(name)), sample_person)
    place, seconds = 1e-4, 0.0
    while place < plan.distances[-1] - 1e-3 and seconds < 120:
        place += max(float(np.interp(place, plan.distances, plan.speeds)), 0.01) * 0.001
        seconds += 0.001
    assert plan.seconds == pytest.approx(seconds, rel=0.05, abs=0.3)


def test_slower_places_are_told(sample_person):
    free = plan_speeds(Curve.through(named_curve("line:9")), sample_person, Behavior(velocity=1.3))
    assert free.slowed == ()
    tight = plan_speeds(Curve.through(np.array([[0, 0], [0, 4], [4, 4.0]])), sample_person, Behavior(velocity=1.3))
    assert len(tight.slowed) == 1
    slow = tight.slowed[0]
    assert slow.why == "bend"
    assert 3.0 < slow.start < 4.0 < slow.stop < 5.0
    assert slow.planned < slow.wished == 1.3
    rushed = plan_speeds(Curve.through(named_curve("line:9")), sample_person, Behavior(velocity=4.0))
    assert [slow.why for slow in rushed.slowed] == ["motion"]


def test_stations_change_how_to_go(sample_person):
    curve = Curve.through(np.array([[0, 0], [0, 30.0]]))
    stations = (
        Station(near=(0.5, 10.0), status="run", velocity=3.0),
        Station(distance=20.0, status="walk", velocity=1.0),
    )
    plan = plan_speeds(curve, sample_person, Behavior(velocity=1.4), stations)
    at = lambda s: float(np.interp(s, plan.distances, plan.speeds))  # noqa: E731
    assert at(6.0) == pytest.approx(1.4, abs=0.05)
    assert at(15.5) == pytest.approx(3.0, abs=0.1)
    assert at(24.0) == pytest.approx(1.0, abs=0.05)
    motion = lambda s: plan.motions[int(np.searchsorted(plan.distances, s))]  # noqa: E731
    assert [motion(s) for s in (6.0, 15.0, 24.0)] == ["walk", "run", "walk"]
    assert plan.behavior_at(12.0).status == "run"
    assert plan.behavior_at(25.0).velocity == 1.0
    assert plan_speeds(curve, sample_person, Behavior(velocity=1.4), stations[::-1]).motions == plan.motions


def test_a_bend_too_sharp_to_run_is_walked(sample_person):
    curve = Curve.through(np.array([[0, 0], [0, 12], [12, 12.0]]), rounding=0.2)
    plan = plan_speeds(curve, sample_person, Behavior(velocity=3.0, status="run"))
    motion = lambda s: plan.motions[int(np.searchsorted(plan.distances, s))]  # noqa: E731
    assert [motion(s) for s in (6.0, 11.8, 17.0)] == ["run", "walk", "run"]


def test_what_cannot_be_planned_is_refused(sample_person, small_database):
    curve = Curve.through(np.array([[0, 0], [0, 5.0]]))
    with pytest.raises(PathError, match=r"a station lies at 9 m, but the way is only 5.00 m long"):
        plan_speeds(curve, sample_person, stations=(Station(distance=9.0, velocity=1.0),))
    if not any(group.motion == "run" for group in small_database.groups):
        with pytest.raises(DatabaseError, match="nobody runs in this database"):
            plan_speeds(curve, small_database, Behavior(status="run", velocity=3.0))
