"""Kernels of a crowd against plain NumPy, shapely, or a slow way to the same."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.ops import substring

import crowds
from crowds import LIMITS, corridor, ground, somebody, traffic_of
from stridecast.crowd import choice_kernels, neighbour_kernels, rule_kernels, rules, way_kernels
from stridecast.crowd.decision_kernels import cheapest, mixed
from stridecast.crowd.ground import make_cells
from stridecast.crowd.ground_kernels import disc_way, free_way, room, standing_near
from stridecast.crowd.neighbour_kernels import EX, EZ, FELLOW, HX, HZ, PX, PZ, RADIUS, RANK, ROW, VX, VZ
from stridecast.crowd.safety_kernels import apart
from stridecast.crowd.step_kernels import make_scratch
from stridecast.crowd.vehicle_kernels import advance, stop

SEEDS = st.integers(0, 2**32 - 1)


def unit(angle):
    return np.array([np.sin(angle), np.cos(angle)])


def random_state(rng):
    """A vehicle in the middle of something that it can be in: some frames of random wishes."""
    runs, dt = bool(rng.random() < 0.4), 1.0 / rng.choice([20.0, 30.0, 60.0])
    facing = rng.uniform(-np.pi, np.pi)
    speed = rng.choice([0.0, 0.3, 1.3, 4.0 if runs else 2.0])
    state = (*rng.uniform(-1, 1, 2), *speed * unit(facing), 0.0, 0.0, facing, 0.0)
    for _ in range(3):
        wish = rng.uniform(0, 4) * unit(rng.uniform(-np.pi, np.pi))
        for _ in range(rng.integers(12)):
            state = advance(LIMITS, runs, *state, *wish, dt)
    return runs, dt, state


class TestGround:
    @given(SEEDS)
    def test_what_stands_near_is_all_within_reach_or_the_nearest(self, seed):
        rng = np.random.default_rng(seed)
        place = crowds.random_place(rng, 6.0)
        count = len(place.segments) + len(place.circles)
        at, reach = rng.uniform(-8, 8, 2), rng.uniform(0.1, 6.0)
        away = np.array([room(place, thing, *at) for thing in range(count)])
        by_hand = [crowds.to_ground(ground(s), at[None])[0] for s in place.segments]
        by_hand += [crowds.to_ground(ground(circles=[c]), at[None])[0] for c in place.circles]
        np.testing.assert_allclose(away, by_hand, atol=1e-12)
        within = np.flatnonzero(away <= reach)
        out = np.full(30, -1)
        found = standing_near(place, *at, reach, out)
        np.testing.assert_array_equal(out[:found], within)
        few = np.full(3, -1)
        found = standing_near(place, *at, reach, few)
        assert found == min(3, len(within))
        np.testing.assert_allclose(np.sort(away[few[:found]]), np.sort(away[within])[:3])

    @given(SEEDS)
    def test_the_way_that_is_free_is_where_a_disc_first_touches(self, seed):
        rng = np.random.default_rng(seed)
        place = crowds.random_place(rng, 5.0)
        count = len(place.segments) + len(place.circles)
        radius = rng.uniform(0.1, 0.5)
        at, way = rng.uniform(-5, 5, 2), unit(rng.uniform(-np.pi, np.pi))
        if crowds.to_ground(place, at[None])[0] <= radius:
            return
        free = free_way(place, np.arange(count), count, *at, *way, radius, 4.0)
        assert 0.0 <= free <= 4.0
        line = shapely.LineString([at, at + (free - 1e-6) * way]) if free > 1e-5 else shapely.Point(at)
        solid = [shapely.LineString(s.reshape(2, 2)) for s in place.segments]
        solid += [shapely.Point(c[:2]).buffer(c[2], quad_segs=256) for c in place.circles]
        assert min((line.distance(thing) for thing in solid), default=9.0) > radius - 1e-3
        if free < 4.0:
            assert crowds.to_ground(place, (at + free * way)[None])[0] == pytest.approx(radius, abs=1e-6)

    def test_who_is_inside_may_leave_but_not_go_deeper(self):
        assert disc_way(0.0, 0.2, 0.0, 1.0, 0.5, 3.0) == 0.0
        assert disc_way(0.0, 0.2, 0.0, -1.0, 0.5, 3.0) == 3.0


class TestSafety:
    @settings(max_examples=100)
    @given(SEEDS)
    def test_commitments_are_apart_if_they_are_in_every_frame(self, seed):
        """The quick answer agrees with looking at every frame, for all ways in which people brake."""
        rng = np.random.default_rng(seed)
        paths = []
        dt = 1.0 / 30
        for _ in range(2):
            _, _, state = random_state(rng)
            out = np.full((121, 2), np.nan)
            n = stop(LIMITS, *state[:6], dt, out)
            shift = rng.uniform(-1.5, 1.5, 2)
            paths.append((out + shift, n))
        (one, n), (other, m) = paths
        for shift in (0, 1):
            k = np.arange(max(n, m) + 1)
            away = np.linalg.norm(one[np.minimum(k, n - 1)] - other[np.minimum(k + shift, m - 1)], axis=-1)
            for least in (*rng.uniform(0.1, 2.0, 4), away.min() - 1e-9, away.min() + 1e-9):
                assert apart(one, n, other, m, shift, max(least, 0.0)) == (away >= max(least, 0.0)).all()

    @settings(max_examples=60)
    @given(SEEDS)
    def test_a_stop_is_what_braking_does_and_never_turns_back(self, seed):
        runs, dt, state = random_state(np.random.default_rng(seed))
        out = np.full((round(4.0 / dt) + 1, 2), np.nan)
        n = stop(LIMITS, *state[:6], dt, out)
        assert n < len(out)  # nobody needs longer than that
        assert np.isfinite(out[:n]).all()
        assert np.isnan(out[n:]).all()
        step = (*state[:7], 0.0)
        for k in range(n):
            np.testing.assert_array_equal(out[k], step[:2])
            step = advance(LIMITS, runs, *step[:7], 0.0, 0.0, 0.0, dt)
        assert step[2] == step[3] == 0.0
        ways = np.diff(out[:n], axis=0)
        assert (np.sum(ways[1:] * ways[:-1], axis=-1) >= -1e-12).all()
        assert (np.linalg.norm(out[:n] - out[0], axis=-1) <= 1.05 * np.linalg.norm(out[n - 1] - out[0]) + 1e-12).all()

    @settings(max_examples=60)
    @given(SEEDS)
    def test_who_aims_at_a_velocity_comes_to_it(self, seed):
        rng = np.random.default_rng(seed)
        runs, dt, state = random_state(rng)
        fastest = LIMITS.fastest[int(runs)]
        wish = rng.uniform(0.1, 0.95 * fastest) * unit(rng.uniform(-np.pi, np.pi))
        for _ in range(round(8.0 / dt)):
            state = advance(LIMITS, runs, *state, *wish, dt)
        np.testing.assert_allclose(state[2:4], wish, atol=0.02)
        assert state[6] == pytest.approx(np.arctan2(*wish), abs=0.05)


class TestNeighbours:
    @given(SEEDS)
    def test_the_grid_holds_everybody_once_in_their_own_cell(self, seed):
        rng = np.random.default_rng(seed)
        here, position = rng.random(40) < 0.7, rng.uniform(-9, 9, (40, 2))
        cells = make_cells(np.array([-7.0, -6.0]), np.array([8.0, 6.0]), 40)
        neighbour_kernels.sort_into_cells(here, position, cells)
        total = cells.first[-1]
        np.testing.assert_array_equal(np.sort(cells.rows[:total]), np.flatnonzero(here))
        at = np.clip(np.floor((position - cells.corner) / cells.size), 0, cells.shape - 1).astype(int)
        for cell in range(int(cells.shape.prod())):
            inside = cells.rows[cells.first[cell] : cells.first[cell + 1]]
            np.testing.assert_array_equal(at[inside] @ [cells.shape[1], 1], cell)

    @given(SEEDS)
    def test_the_nearest_are_seen_as_they_are(self, seed):
        rng = np.random.default_rng(seed)
        people = [
            somebody(
                int(k),
                (x, z),
                (9.0, 9.0),
                heading=rng.uniform(-3, 3),
                speed=rng.uniform(0, 1.5),
                rank=rng.random(),
                company=int(rng.integers(-1, 2)),
                radius=rng.uniform(0.2, 0.4),
            )
            for k, (x, z) in zip(rng.permutation(60), rng.integers(-4, 5, (40, 2)), strict=False)
        ]
        traffic, rows = traffic_of(people)
        m, p = traffic.moving, traffic.people
        m.acceleration[rows] = rng.uniform(-3, 3, (len(rows), 2))
        cells = make_cells(m.position[rows].min(axis=0), m.position[rows].max(axis=0), len(m.here))
        neighbour_kernels.sort_into_cells(m.here, m.position, cells)
        scratch, reach = make_scratch(), rng.uniform(1.0, 9.0)
        c = int(rng.choice(rows))
        count = neighbour_kernels.look(p, m, cells, c, reach, scratch)

        away = m.position - m.position[c]
        gap = np.linalg.norm(away, axis=-1)
        closing = np.sum((m.velocity[c] - m.velocity) * away, axis=-1) / np.where(gap > 0, gap, 1.0)
        order = np.where(gap > 0, gap / (neighbour_kernels.AT_REST + np.maximum(closing, 0.0)), 0.0)
        known = [j for j in rows.tolist() if j != c and gap[j] <= reach]
        assert count == min(len(known), len(scratch.near))
        np.testing.assert_allclose(np.sort(order[known])[:count], order[scratch.near[:count]], atol=1e-12)
        for out in scratch.seen[:count]:
            j = int(out[ROW])
            np.testing.assert_allclose(out[[PX, PZ]], away[j], atol=1e-12)
            np.testing.assert_array_equal(out[[VX, VZ]], m.velocity[j])
            expected = m.velocity[j] + neighbour_kernels.SETTLING * m.acceleration[j]
            turns_back = expected @ m.velocity[j] <= 0
            np.testing.assert_allclose(out[[EX, EZ]], np.zeros(2) if turns_back else expected, atol=1e-12)
            assert (out[RADIUS], out[RANK]) == (p.radius[j], p.rank[j])
            assert bool(out[FELLOW]) == (p.company[c] >= 0 and p.company[c] == p.company[j])
            np.testing.assert_allclose(out[[HX, HZ]], unit(m.heading[j]), atol=1e-12)


class TestMeeting:
    @given(SEEDS)
    def test_contact_is_the_first_root_of_the_distance(self, seed):
        rng = np.random.default_rng(seed)
        away, approach, radius = rng.uniform(-5, 5, 2), rng.uniform(-3, 3, 2), rng.uniform(0.2, 1.0)
        time = rule_kernels.contact_time(*away, *approach, radius)
        if away @ approach <= 0:
            assert time == np.inf  # they do not approach
        elif np.linalg.norm(away) <= radius:
            assert time == 0.0
        else:
            roots = np.roots([approach @ approach, -2 * away @ approach, away @ away - radius**2])
            first = roots.real.min() if np.isreal(roots).all() else np.inf
            assert time == pytest.approx(first, rel=1e-6)

    @given(SEEDS)
    def test_two_are_where_their_ways_cross_at_these_times(self, seed):
        rng = np.random.default_rng(seed)
        away, mine, theirs = rng.uniform(-5, 5, (3, 2))
        arrives, comes = rule_kernels.crossing_times(*away, *mine, *theirs)
        if abs(mine[0] * theirs[1] - mine[1] * theirs[0]) > 0.1:
            np.testing.assert_allclose(arrives * mine, away + comes * theirs, atol=1e-8)

    @given(st.floats(0, 30), st.floats(0, 30))
    def test_a_danger_that_is_nearer_is_no_smaller(self, one, other):
        near, far = sorted((one, other))
        assert choice_kernels.danger(near) >= choice_kernels.danger(far) >= 0.0
        assert choice_kernels.danger(choice_kernels.FAR) == 0.0

    def answered(self, people, place=crowds.NOTHING, since=0.0, wish=1.3):
        """What the last of them does who wants to go along +z, in an encounter that has lasted so long already."""
        traffic, rows = traffic_of(people, place)
        m, c = traffic.moving, int(rows[-1])
        cells = make_cells(m.position[rows].min(axis=0), m.position[rows].max(axis=0), len(m.here))
        neighbour_kernels.sort_into_cells(m.here, m.position, cells)
        scratch = make_scratch()
        count = neighbour_kernels.look(traffic.people, m, cells, c, 16.0, scratch)
        standing = standing_near(place, *m.position[c], 5.0, scratch.things)
        m.since[c], m.other[c] = since, rows[0]
        return rule_kernels.answer(
            traffic.people, m, place, scratch.things, standing, scratch.seen, count, c, 0.0, 1.0, wish, 0.1
        )

    def test_each_meeting_has_its_rule(self):
        me = {"wish": 1.3, "speed": 1.3}

        def meet(*others, place=crowds.NOTHING, since=0.0, **mine):
            own = somebody(1, (0.0, 0.0), (0.0, 20.0), **{**me, **mine})
            rule, _, time, side, most = self.answered([*others, own], place, since)
            return rules.RULES[rule], time, side, most

        def comes(z=4.0, x=0.0, **how):
            return somebody(9, (x, z), (x, -20.0), **{**me, "rank": 0.5, **how})

        def crosses(x=-4.0, z=4.0, **how):
            return somebody(9, (x, z), (20.0, z), **{**me, "rank": 0.5, **how})

        def goes(z=1.5, x=0.0, **how):
            return somebody(9, (x, z), (x, 20.0), **{"wish": 0.5, "speed": 0.5, **how})

        assert meet()[:2] == ("on the way", np.inf)
        assert meet(comes(x=2.0))[0] == "on the way"
        assert meet(comes(z=9.0))[0] == "pass head-on"
        assert meet(comes(z=9.0), rank=0.9)[0] == "go on"
        for side in (-1.0, 1.0):
            rule, time, passed, _ = meet(comes(), side=side)
            assert (rule, passed) == ("pass head-on", side)
            assert time == pytest.approx((4.0 - 0.6 - rule_kernels.MARGIN) / 2.6)
            near = comes(z=2.0)
            long = rule_kernels.PERSISTS + 0.1
            assert meet(near, since=long, side=side)[::2] == ("other side", -side)
        longer = rule_kernels.PERSISTS_LONGER + 0.1
        assert meet(comes(z=2.0), since=longer, waits=True)[::3] == ("wait", 0.0)
        assert meet(comes(z=2.0), since=longer, waits=False)[0] == "other side"
        assert meet(crosses(), waits=True)[0] == "pass behind"
        assert meet(crosses(), waits=True)[2] == -1.0  # it comes from the right, so its back is there
        assert meet(somebody(9, (4.0, 4.0), (-20.0, 4.0), **me), waits=True)[2] == 1.0
        assert meet(crosses(x=-4.6))[0] == "go first"
        assert meet(crosses(x=-4.6), waits=True)[0] in ("pass behind", "go first")
        assert meet(crosses(x=-1.0, z=1.0), waits=True)[0] == "slow down"
        assert meet(goes())[0] == "overtake"
        rule, _, _, most = meet(goes(), place=corridor(1.0))
        assert rule == "follow"
        assert 0.45 <= most < 1.3  # about as fast as the other
        assert meet(goes(x=-0.5), place=corridor(3.0))[::2] == ("overtake", 1.0)
        assert meet(goes(x=0.5), place=corridor(3.0))[::2] == ("overtake", -1.0)
        stands = {"speed": 0.0, "heading": np.pi}
        assert meet(goes(**stands))[0] == "pass round"
        assert meet(goes(speed=0.0))[0] == "follow"  # a queue

    def test_fellows_are_no_threat(self):
        other = somebody(9, (0.0, 3.0), (0.0, 20.0), wish=0.5, speed=0.5, company=4)
        own = somebody(1, (0.0, 0.0), (0.0, 20.0), wish=1.3, speed=1.3, company=4)
        assert self.answered([other, own])[0] == rules.ON_THE_WAY


class TestWays:
    @given(SEEDS)
    def test_the_place_on_the_way_is_the_nearest_one_ahead(self, seed):
        rng = np.random.default_rng(seed)
        corners = np.cumsum(rng.uniform(0.3, 2.0, (6, 1)) * unit(np.cumsum(rng.uniform(-0.7, 0.7, 6))).T, axis=0)
        person = somebody(0, (0.0, 0.0), *map(tuple, corners))
        traffic, (_, row) = traffic_of([somebody(1, (50.0, 0.0), (60.0, 0.0)), person])
        p, m, ways = traffic.people, traffic.moving, traffic.ways
        line = shapely.LineString(person.way)
        for place in rng.uniform(0, line.length, 8):
            x, z, dx, dz = way_kernels.place_at(p, ways, row, place)
            np.testing.assert_allclose((x, z), shapely.get_coordinates(line.interpolate(place))[0], atol=1e-9)
            assert np.hypot(dx, dz) == pytest.approx(1.0)
            m.place[row], m.position[row] = place, (x + 0.2 * dz, z - 0.2 * dx)
            way_kernels.find_place(p, m, ways, row)
            found = shapely.get_coordinates(line.interpolate(m.place[row]))[0]
            ahead = substring(line, place, min(place + way_kernels.WINDOW, line.length))
            nearest = ahead.distance(shapely.Point(m.position[row]))
            assert np.linalg.norm(found - m.position[row]) <= nearest + 1e-6
            assert m.place[row] >= place

    def test_beyond_its_end_a_way_goes_straight_on(self):
        traffic, (row,) = traffic_of([somebody(0, (0.0, 0.0), (0.0, 4.0))])
        assert way_kernels.place_at(traffic.people, traffic.ways, row, 6.0) == (0.0, 6.0, 0.0, 1.0)
        assert way_kernels.length_of(traffic.people, traffic.ways, row) == pytest.approx(4.0)


class TestChance:
    @given(st.integers(0, 2**56), st.integers(0, 10**6), st.integers(0, 2**31))
    def test_it_is_splitmix(self, a, b, seed):
        whole = 2**64
        v = (a * 0x9E3779B97F4A7C15 + b * 0xBF58476D1CE4E5B9 + seed) % whole
        v = (v ^ (v >> 30)) * 0xBF58476D1CE4E5B9 % whole
        v = (v ^ (v >> 27)) * 0x94D049BB133111EB % whole
        v ^= v >> 31
        assert mixed(a, b, seed) == (v >> 11) / 2**53

    def test_it_is_even(self):
        values = np.array([mixed(person, frame, 1) for person in range(60) for frame in range(60)])
        assert np.histogram(values, 10, (0, 1))[0].min() > 300
        assert abs(values.mean() - 0.5) < 0.02

    def test_the_first_of_the_lowest_is_taken(self):
        assert cheapest(np.array([3.0, 1.0, 2.0, 1.0])) == 1
