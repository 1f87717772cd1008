"""Laws of vehicles that go their ways among each other: they hold whatever the constants of behaviour are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import crowds
from crowds import beyond, corridor, ground, in_ground, overlap, somebody, traffic_of, walk
from stridecast.crowd import rules, safety_kernels
from stridecast.crowd.ground import make_cells
from stridecast.crowd.ground_kernels import standing_near
from stridecast.crowd.neighbour_kernels import sort_into_cells
from stridecast.crowd.step_kernels import settle, try_target, write
from stridecast.crowd.traffic import BLOCK, Traffic
from stridecast.model.people import Mover

SEEDS = st.integers(0, 2**32 - 1)
HAIR = 1e-9
"""What rounding may take from a distance, metres."""


def random_scene(seed, count=10, rate=30.0, **given):
    rng = np.random.default_rng(seed)
    size = float(rng.uniform(2.5, 7.0))
    place = crowds.random_place(rng, size)
    traffic, _ = traffic_of([], place, rate, seed=seed, **given)
    people = crowds.random_people(rng, count, size, place, traffic)
    return place, traffic, people


def check(walked, place):
    """Nobody touches anybody or anything, and everybody moves as a body can."""
    assert overlap(walked) <= HAIR
    assert in_ground(walked, place) <= HAIR
    excess = {kind: by for kind, by in beyond(walked).items() if by > 1e-6}
    assert not excess


def same(a, b):
    for name in ("position", "velocity", "heading", "rule"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


class TestSafety:
    @settings(max_examples=12)
    @given(SEEDS, st.sampled_from([20.0, 30.0, 60.0]))
    def test_nobody_touches_anybody_and_all_move_as_a_body_can(self, seed, rate):
        place, traffic, people = random_scene(seed, rate=rate)
        assert len(people) > 1
        check(walk(traffic, 5.0, leave=True), place)

    @settings(max_examples=6)
    @given(SEEDS, st.sampled_from([20.0, 60.0]))
    def test_runners_among_walkers(self, seed, rate):
        rng = np.random.default_rng(seed)
        place = corridor(3.0)
        runners = [
            somebody(k, (rng.uniform(-1, 1), -1.5 * k), (rng.uniform(-1, 1), 24.0), runs=True, wish=4.0, rank=0.1 * k)
            for k in range(3)
        ]
        walkers = [
            somebody(k, (rng.uniform(-1, 1), 1.5 * k), (rng.uniform(-1, 1), -4.0), wish=rng.uniform(0.3, 1.6))
            for k in range(3, 9)
        ]
        traffic, _ = traffic_of(runners + walkers, place, rate, seed=seed)
        walked = walk(traffic, 6.0)
        check(walked, place)
        assert np.nanmax(np.linalg.norm(walked.velocity, axis=-1)) > 2.5  # they do run

    @settings(max_examples=8)
    @given(SEEDS)
    def test_everybody_can_stop_at_any_frame(self, seed):
        place, traffic, _ = random_scene(seed)
        least = []

        def watch(now: Traffic) -> None:
            least.append(crowds.left_to_stop(now))
            paths = crowds.commitments(now)
            room = crowds.to_ground(place, paths) - now.people.radius[now.present, None]
            assert room.min(initial=np.inf) >= -HAIR
            if now.frame % 10 == 0:
                for row in now.present:
                    np.testing.assert_array_equal(
                        crowds.braked(now, row), now.moving.path[row, : now.moving.stops[row]]
                    )

        walk(traffic, 4.0, watch)
        assert min(least) >= -HAIR

    @settings(max_examples=6)
    @given(SEEDS, st.integers(5, 120))
    def test_all_brake_at_once_from_any_frame(self, seed, frame):
        """Nothing is granted from then on: everybody is where the commitment of that frame said, bit for bit."""
        place, traffic, _ = random_scene(seed)
        for _ in range(frame):
            traffic.step()
        m, p, rows = traffic.moving, traffic.people, traffic.present
        said = crowds.commitments(traffic)
        nothing = np.zeros(len(m.here), np.bool_)
        for k in range(1, said.shape[1]):
            write(p, m, traffic.ways, traffic.limits, nothing, 1 / traffic.frame_rate, 0, len(m.here))
            np.testing.assert_array_equal(m.position[rows], said[:, k])
        assert (m.velocity[rows] == 0).all()
        assert (m.stops[rows] == 1).all()
        assert (crowds.to_ground(place, said) - p.radius[rows, None]).min(initial=np.inf) >= -HAIR

    def test_of_two_who_want_the_same_room_who_goes_before_gets_it(self):
        for stuck, rank, first in (
            ((0.0, 0.0), (0.2, 0.8), 1),
            ((0.4, 0.0), (0.2, 0.8), 0),
            ((0.0, 0.0), (0.5, 0.5), 0),
        ):
            people = [
                somebody(3, (0.0, 0.0), (0.0, 9.0), rank=rank[0]),
                somebody(5, (0.0, 0.63), (0.0, -9.0), rank=rank[1]),
            ]
            traffic, rows = traffic_of(people)
            m, p = traffic.moving, traffic.people
            m.stuck[rows] = stuck
            ahead = np.array([[0.0, 0.02], [0.0, -0.02]])  # either would leave the other's present place alone
            m.meant[rows, 0], m.meant_stops[rows], m.free[rows] = m.position[rows] + ahead, 1, True
            cells = make_cells(m.position[rows].min(axis=0), m.position[rows].max(axis=0), len(m.here))
            sort_into_cells(m.here, m.position, cells)
            granted = np.zeros(len(m.here), np.bool_)
            settle(p, m, cells, 1.0, 0.3, granted, 0, len(m.here))
            np.testing.assert_array_equal(granted[rows], np.arange(2) == first)

    @settings(max_examples=60)
    @given(SEEDS, st.sampled_from([10.0, 20.0, 30.0, 60.0]))
    def test_a_step_that_is_taken_leaves_room_to_walls(self, seed, rate):
        """Somebody brakes so as to come to stand right before a wall, and on the way tries any other velocity."""
        rng = np.random.default_rng(seed)
        place = ground((-9, 0, 9, 0))
        near = 0.3 + safety_kernels.HAIR
        speed, facing = float(rng.choice([0.2, 1.3])), rng.uniform(-1.2, 1.2)
        person = somebody(0, (0.0, 0.0), (0.0, 5.0), speed=speed, heading=facing)
        traffic, (row,) = traffic_of([person], place, rate)
        stands = crowds.commitments(traffic)[0, -1, 1]
        person = replace(person, position=(0.0, float(-near - stands - rng.choice([1e-9, 1e-3]))))
        traffic, (row,) = traffic_of([person], place, rate)
        m, p, things = traffic.moving, traffic.people, np.zeros(4, np.int64)
        nothing = np.zeros(len(m.here), np.bool_)
        for _ in range(rng.integers(m.stops[row] + 2)):
            write(p, m, traffic.ways, traffic.limits, nothing, 1 / rate, 0, len(m.here))
        cells = make_cells(m.position[[row]].min(axis=0), m.position[[row]].max(axis=0), len(m.here))
        sort_into_cells(m.here, m.position, cells)
        count = standing_near(place, *m.position[row], 5.0, things)
        for wish in rng.uniform(-1.5, 1.5, (10, 2)):
            if try_target(p, m, place, traffic.limits, cells, 1.0, 0.3, things, count, int(row), *wish, 1 / rate):
                assert crowds.to_ground(place, m.meant[row, : m.meant_stops[row]]).min() >= near - 1e-12

    def test_a_gap_narrower_than_the_body_is_never_entered(self):
        place = ground((-4, 0, -0.28, 0), (0.28, 0, 4, 0))
        traffic, (row,) = traffic_of([somebody(3, (0.0, -3.0), (0.0, 4.0), radius=0.3)], place)
        walked = walk(traffic, 12.0)
        check(walked, place)
        assert walked.position[:, row, 1].max() < 0.0
        wide, (row,) = traffic_of([somebody(3, (0.0, -3.0), (0.0, 4.0), radius=0.2)], place)
        assert walk(wide, 12.0).position[-1, row, 1] > 1.0


class TestOrder:
    """Neither rows, nor threads, nor who is far away decide anything."""

    @settings(max_examples=6)
    @given(SEEDS)
    def test_rows_decide_nothing(self, seed):
        place, traffic, people = random_scene(seed)
        order = np.random.default_rng(seed).permutation(len(people))
        other, rows = traffic_of([people[k] for k in order], place, seed=seed)
        a, b = walk(traffic, 5.0), walk(other, 5.0)
        for name in ("position", "velocity", "heading", "rule"):
            np.testing.assert_array_equal(getattr(a, name)[:, order], getattr(b, name)[:, rows], err_msg=name)

    def test_threads_decide_nothing(self):
        people = [
            somebody(k, (0.9 * (k % 10), 0.9 * (k // 10)), (9.0 - 0.9 * (k % 10), 12.0 - 0.9 * (k // 10)), rank=k / 200)
            for k in range(2 * BLOCK + 10)
        ]
        same(*(walk(traffic_of(people, threads=threads)[0], 2.0) for threads in (1, 2)))

    def test_who_is_far_away_decides_nothing(self):
        for seed in range(3):
            place, traffic, people = random_scene(seed)
            stranger = somebody(9999, (200.0, 10.0), (220.0, 10.0), radius=0.6, wish=4.0, runs=True, speed=4.0)
            both, rows = traffic_of([stranger, *people], place, seed=seed)
            a, b = walk(traffic, 4.0), walk(both, 4.0)
            np.testing.assert_array_equal(a.position[:, : len(people)], b.position[:, rows[1:]])

    def test_the_seed_decides_what_chance_does(self):
        def jam(seed: int):
            people = [somebody(k, (0.0, 0.7 * k), (0.0, 20.0), rank=0.05 * k) for k in range(4)]
            people += [somebody(9 + k, (0.0, 5.0 + 0.7 * k), (0.0, -4.0), rank=0.04 * k) for k in range(4)]
            return walk(traffic_of(people, corridor(1.25), seed=seed)[0], 15.0)

        one = jam(1)
        same(one, jam(1))
        assert not np.array_equal(one.position, jam(2).position, equal_nan=True)


def pair(seed, waits=False):
    """Two whose ways cross somewhere, with likings for sides so that nothing is left to default."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-np.pi, np.pi)
    out = []
    for k, turn in enumerate((0.3, 0.3 + angle)):
        way = np.array([np.sin(turn), np.cos(turn)])
        speed = rng.uniform(0.8, 1.6)
        start = -5.0 * speed * way + rng.uniform(-0.4, 0.4, 2)
        out.append(
            somebody(
                7 + k,
                tuple(start),
                tuple(6 * way),
                wish=speed,
                side=rng.choice([-1.0, 1.0]),
                rank=rng.random(),
                waits=waits and k == 0,
            )
        )
    return out


def moved(new, matrix, shift, side=1.0):
    """Somebody in a place that is turned (or mirrored) and shifted."""
    ahead = np.array([np.sin(new.heading), np.cos(new.heading)]) @ matrix.T
    place = np.array(new.position) @ matrix.T + shift
    return replace(
        new,
        position=(float(place[0]), float(place[1])),
        way=new.way @ matrix.T + shift,
        heading=float(np.arctan2(*ahead)),
        side=side * new.side,
    )


class TestSymmetry:
    """Where chance does not decide: two people, who like a side each."""

    @pytest.mark.parametrize("seed", range(6))
    def test_mirrored_people_do_the_mirrored_thing(self, seed):
        people, mirror = pair(seed), np.diag([-1.0, 1.0])
        a = walk(traffic_of(people)[0], 9.0)
        b = walk(traffic_of([moved(p, mirror, np.zeros(2), -1.0) for p in people])[0], 9.0)
        np.testing.assert_allclose(b.position, a.position @ mirror, atol=1e-9)

    @pytest.mark.parametrize("seed", range(6))
    def test_neither_place_nor_direction_matters(self, seed):
        """Loosely: rounding differs, and may tip a choice between two velocities that are worth the same."""
        people, turn = pair(seed), 0.3 + seed
        matrix = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        shift = np.array([31.0, -17.0])
        a = walk(traffic_of(people)[0], 9.0)
        b = walk(traffic_of([moved(p, matrix, shift) for p in people])[0], 9.0)
        np.testing.assert_allclose(b.position, a.position @ matrix.T + shift, atol=1e-6)


def passed_on_the_left(walked, row, other):
    """On which side somebody has another when they are nearest."""
    frame = np.nanargmin(np.linalg.norm(walked.position[:, row] - walked.position[:, other], axis=-1))
    away = walked.position[frame, other] - walked.position[frame, row]
    speed = walked.velocity[frame, row]
    return away[0] * speed[1] - away[1] * speed[0] < 0


class TestRules:
    @pytest.mark.parametrize("side", [-1.0, 1.0])
    def test_head_on_one_yields_to_the_side_liked(self, side):
        people = [
            somebody(0, (0.05, 0.0), (0.0, 12.0), side=side, rank=0.2),
            somebody(1, (-0.05, 12.0), (0.0, 0.0), side=side, rank=0.8),
        ]
        traffic, (junior, senior) = traffic_of(people)
        walked = walk(traffic, 12.0)
        check(walked, crowds.NOTHING)
        assert passed_on_the_left(walked, junior, senior) == (side > 0)
        assert (walked.rule[:, junior] == rules.HEAD_ON).any()
        assert (walked.rule[:, senior] == rules.GO_ON).any()
        assert not (walked.rule[:, junior] == rules.GO_ON).any()
        aside = np.abs(walked.position[..., 0]).max(axis=0)
        assert aside[junior] > aside[senior]
        assert aside[senior] < 0.6
        np.testing.assert_array_less(np.abs(walked.position[-1, [junior, senior], 0]), 0.35)  # back to their ways

    @pytest.mark.parametrize("offset", [-0.7, 0.7])
    def test_overtaking_is_done_where_there_is_more_room(self, offset):
        people = [
            somebody(0, (offset, 2.0), (offset, 24.0), wish=0.6),
            somebody(1, (offset, 0.0), (offset, 24.0), wish=1.5),
        ]
        place = corridor(3.4, -2.0, 26.0)
        traffic, (slow, fast) = traffic_of(people, place)
        walked = walk(traffic, 12.0)
        check(walked, place)
        assert (walked.rule[:, fast] == rules.OVERTAKE).any()
        assert walked.position[-1, fast, 1] > walked.position[-1, slow, 1] + 2.0
        assert passed_on_the_left(walked, fast, slow) == (offset < 0)

    def test_who_cannot_overtake_follows(self):
        people = [somebody(0, (0.0, 2.0), (0.0, 24.0), wish=0.7), somebody(1, (0.0, 0.0), (0.0, 24.0), wish=1.5)]
        place = corridor(1.0)
        traffic, (slow, fast) = traffic_of(people, place)
        walked = walk(traffic, 15.0)
        check(walked, place)
        late = slice(-150, None)
        assert (walked.rule[:, fast] == rules.FOLLOW).any()
        assert not (walked.rule[:, fast] == rules.OVERTAKE).any()
        speeds = np.linalg.norm(walked.velocity[late], axis=-1).mean(axis=0)
        assert speeds[slow] > 0.6
        assert abs(speeds[fast] - speeds[slow]) < 0.15
        assert np.diff(walked.position[-1, [fast, slow], 1])[0] < 2.0

    @pytest.mark.parametrize("waits", [0, 1])
    def test_where_ways_cross_who_rather_waits_passes_behind(self, waits):
        people = [
            somebody(0, (0.0, -6.0), (0.0, 8.0), waits=waits == 0),
            somebody(1, (-6.0, 0.0), (8.0, 0.0), waits=waits == 1),
        ]
        traffic, rows = traffic_of(people)
        walked = walk(traffic, 12.0)
        check(walked, crowds.NOTHING)
        crossed = [int(np.argmax(walked.position[:, rows[k], 1 - k] > 0)) for k in range(2)]
        assert crossed[waits] > crossed[1 - waits] > 0
        assert np.isin(walked.rule[:, rows[waits]], [rules.BEHIND, rules.SLOW_DOWN]).any()
        assert (walked.rule[:, rows[1 - waits]] == rules.GO_FIRST).any()

    @pytest.mark.parametrize("facing", [0.0, np.pi])
    def test_somebody_who_stands_is_passed(self, facing):
        people = [somebody(0, (0.1, 5.0), heading=facing), somebody(1, (0.0, 0.0), (0.0, 10.0))]
        traffic, (stands, goes) = traffic_of(people)
        walked = walk(traffic, 11.0)
        check(walked, crowds.NOTHING)
        np.testing.assert_array_equal(walked.position[:, stands], walked.position[:1, stands].repeat(331, axis=0))
        assert (walked.rule[:, stands] == rules.STAND)[1:].all()
        assert (walked.rule[:, goes] == rules.PASS_ROUND).any()
        about = walked.other[walked.rule[:, goes] == rules.PASS_ROUND, goes]
        assert (about == stands).all()
        assert walked.position[-1, goes, 1] > 9.0
        assert abs(walked.position[-1, goes, 0]) < 0.3

    def test_somebody_far_from_the_way_comes_back_to_it(self):
        traffic, (row,) = traffic_of([replace(somebody(0, (0.0, 0.0), (0.0, 14.0)), position=(1.5, 0.0))])
        walked = walk(traffic, 9.0)
        assert (walked.rule[:, row] == rules.RETURN).any()
        off = walked.position[:, row, 0]
        assert (np.diff(off) < 1e-6).all()  # without swinging
        assert off[-1] < 0.1
        assert abs(walked.heading[-1, row]) < 0.1

    def test_who_walks_together_stays_together(self):
        people = [
            somebody(
                k,
                (0.375 - 0.75 * k, 0.0),
                (0.375 - 0.75 * k, 14.0),
                wish=1.1 + 0.4 * k,
                company=5,
                slot=0.375 - 0.75 * k,
            )
            for k in range(2)
        ]
        people = [replace(p, way=np.stack((np.zeros(57), np.linspace(0, 14, 57)), axis=1)) for p in people]
        oncoming = somebody(7, (0.1, 14.0), (0.0, 0.0))
        traffic, rows = traffic_of([*people, oncoming])
        walked = walk(traffic, 9.0)
        check(walked, crowds.NOTHING)
        apart = np.linalg.norm(walked.position[:, rows[0]] - walked.position[:, rows[1]], axis=-1)
        assert apart.max() < 2.5
        assert np.median(apart) < 1.5
        assert walked.position[-1, rows[:2], 1].min() > 6.0

    @pytest.mark.parametrize("seed", range(3))
    def test_who_stays_stands_at_the_end_of_the_way(self, seed):
        rng = np.random.default_rng(seed)
        end = rng.uniform((-1, 5), (1, 7))
        person = somebody(0, (0.0, 0.0), tuple(end), stays=True, wish=rng.uniform(0.5, 2.0))
        traffic, (row,) = traffic_of([person])
        walked = walk(traffic, 20.0)
        check(walked, crowds.NOTHING)
        assert (walked.velocity[-30:, row] == 0).all()
        assert np.linalg.norm(walked.position[-1, row] - end) < 0.2
        assert len(traffic.arrived()) == 0
        assert (walked.rule[-30:, row] == rules.STAND).all()

    def test_who_leaves_has_arrived_where_the_way_ends(self):
        traffic, rows = traffic_of([somebody(0, (0.0, 0.0), (3.0, 6.0))])
        for _ in range(300):
            if len(traffic.arrived()):
                break
            traffic.step()
        np.testing.assert_array_equal(traffic.arrived(), rows)
        assert np.linalg.norm(traffic.moving.position[rows[0]] - (3.0, 6.0)) < 0.6
        traffic.remove(rows)
        assert len(traffic.present) == 0
        before = traffic.moving.position.copy()
        traffic.step()
        np.testing.assert_array_equal(traffic.moving.position, before)


class TestMovers:
    """What moves by a script."""

    def cart(self, *points, speed=1.0, radius=0.5):
        points = np.array(points, float)
        times = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=-1)) / speed))
        mover = Mover(name="cart", radius=radius, times=times, points=points)
        return replace(somebody(99, tuple(points[0]), radius=radius, rank=2.0), mover=mover), mover

    def test_it_goes_by_its_script_where_nobody_is(self):
        new, mover = self.cart((0, 0), (4, 0), (4, 3))
        traffic, (row,) = traffic_of([new])
        walked = walk(traffic, 8.0)
        times = np.arange(len(walked.position)) / 30
        np.testing.assert_allclose(walked.position[:, row], mover.at(times), atol=1e-9)

    def test_it_waits_where_somebody_stands_and_runs_over_nobody(self):
        new, _ = self.cart((0, 0), (6, 0))
        traffic, (row, stands) = traffic_of([new, somebody(1, (3.0, 0.1))])
        walked = walk(traffic, 9.0)
        assert overlap(walked) <= HAIR
        assert 0.0 <= np.linalg.norm(walked.position[-1, row] - walked.position[-1, stands]) - 0.8 < 0.05
        np.testing.assert_array_equal(walked.position[-1, stands], (3.0, 0.1))
        traffic.remove(np.array([stands]))
        assert walk(traffic, 6.0).position[-1, row, 0] == pytest.approx(6.0)  # and goes on where it was

    @settings(max_examples=6)
    @given(SEEDS)
    def test_people_and_what_moves_keep_apart(self, seed):
        rng = np.random.default_rng(seed)
        new, _ = self.cart(*rng.uniform(-4, 4, (5, 2)), speed=rng.uniform(0.5, 3.0))
        traffic, _ = traffic_of([new], seed=seed)
        crowds.random_people(rng, 8, 5.0, crowds.NOTHING, traffic)
        walked = walk(traffic, 5.0)
        assert overlap(walked) <= HAIR


class TestComing:
    def test_there_is_room_only_where_nobody_needs_it_to_stop(self):
        runner = somebody(0, (0.0, 0.0), (0.0, 30.0), runs=True, wish=4.0, speed=4.0)
        traffic, _ = traffic_of([runner], corridor(3.0, -5.0, 30.0))
        assert not traffic.has_room(somebody(1, (0.0, 0.55)))
        assert not traffic.has_room(somebody(1, (0.0, 1.5)))
        assert traffic.has_room(somebody(1, (0.0, 8.0)))
        assert traffic.has_room(somebody(1, (0.9, 1.5)))
        assert not traffic.has_room(somebody(1, (1.25, 1.5)))  # in the wall
        assert not traffic.has_room(somebody(1, (0.8, 9.0), (20.0, 9.0), wish=2.0, speed=2.0))  # could not stop

    def test_asking_for_room_changes_nothing(self):
        _, traffic, people = random_scene(3)
        _, other, _ = random_scene(3)
        for _ in range(30):
            traffic.has_room(replace(people[0], number=10**6, position=(0.3, 0.2)))
            traffic.step()
            other.step()
        for field, array in traffic.moving._asdict().items():
            np.testing.assert_array_equal(array, getattr(other.moving, field), err_msg=field)

    def test_rows_are_used_again_and_grow(self):
        traffic, rows = traffic_of([somebody(k, (3.0 * k, 0.0), (3.0 * k, 50.0)) for k in range(70)])
        assert len(np.unique(rows)) == 70
        for _ in range(15):
            traffic.step()
        before = traffic.moving.position[rows[1:]].copy()
        traffic.remove(rows[:1])
        (row,) = traffic.add([somebody(500, (-9.0, 0.0), (-9.0, 5.0))])
        assert row == rows[0]
        assert traffic.moving.place[row] == traffic.moving.stuck[row] == 0.0
        np.testing.assert_array_equal(traffic.moving.position[rows[1:]], before)
        assert sorted(traffic.present) == sorted(rows)

    def test_ways_of_who_has_left_are_forgotten_and_nobody_elses(self):
        stays = somebody(0, (0.0, 0.0), (4.0, 3.0), (0.0, 9.0))
        traffic, (row,) = traffic_of([stays])
        longest = 0
        for k in range(1, 60):
            (other,) = traffic.add([somebody(k, (20.0, 0.0), (20.0, 30.0))])
            longest = max(longest, len(traffic.ways.points))
            first, count = traffic.people.first[row], traffic.people.points[row]
            np.testing.assert_array_equal(traffic.ways.points[first : first + count], stays.way)
            assert traffic.ways.along[first] == 0.0
            assert traffic.ways.along[first + count - 1] == pytest.approx(5.0 + np.hypot(4.0, 6.0))
            traffic.remove(np.array([other]))
        assert longest < 10 * 121

    def test_nobody_is_busy_with_who_has_left(self):
        people = [somebody(0, (0.0, 0.0), (0.0, 12.0)), somebody(1, (0.1, 8.0), (0.0, -4.0))]
        traffic, (one, other) = traffic_of(people)
        while traffic.moving.other[one] != other:
            traffic.step()
        traffic.remove(np.array([other]))
        assert traffic.moving.other[one] == -1
        assert traffic.moving.contact[one] == np.inf
