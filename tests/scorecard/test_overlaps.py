"""Bodies in one another and in what is solid."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from places import block, disc, road
from stridecast.model.scene import Scene
from stridecast.scorecard.crowds import score_crowd
from tracked import RATE, crowd, still, straight, wandering


def scene_of(*obstacles, roads=()) -> Scene:
    return Scene(start=np.array([-50.0, 0.0]), goals=np.array([[-40.0, 0.0]]), obstacles=obstacles, roads=roads)


def test_two_discs_overlap_by_three_centimetres_for_ten_frames():
    away = np.full(30, 0.6)
    away[10:20] = 0.47
    away[14] = 0.46
    other = np.stack((away, np.zeros(30)), axis=-1)
    found = score_crowd(crowd(np.zeros((30, 2)), other, still((5.0, 0.0), 1.0))).overlaps
    assert (found.pairs, found.frames, found.pair_frames) == (1, 10, 10)
    (one,) = found.each
    assert (one.one, one.other, one.frames) == (0, 1, 10)
    assert one.depth == pytest.approx(0.04)
    assert (one.first, one.last, one.time) == pytest.approx((10 / RATE, 19 / RATE, 14 / RATE))


def test_who_touches_does_not_overlap():
    assert score_crowd(crowd(still((0, 0), 1.0), still((0.5, 0), 1.0))).overlaps.pairs == 0
    assert score_crowd(crowd(still((0, 0), 1.0), still((0.4985, 0), 1.0))).overlaps.pairs == 1


def test_each_has_a_width_of_their_own():
    walked = crowd(still((0, 0), 1.0), still((0.55, 0), 1.0), still((1.05, 0), 1.0))
    found = score_crowd(walked, radius={0: 0.4, 1: 0.2, 2: 0.2}).overlaps
    assert [(o.one, o.other) for o in found.each] == [(0, 1)]
    assert found.depth == pytest.approx(0.05)


@given(st.integers(0, 2**32 - 1))
def test_pairs_are_those_of_a_slow_loop(seed):
    rng = np.random.default_rng(seed)
    walked = wandering(rng, 6, 2.0, 2.0)
    radii = dict(enumerate(rng.uniform(0.1, 0.4, 6)))
    slow: dict[tuple[int, int], list[float]] = {}
    for a, rows_a in walked.each():
        for b, rows_b in walked.each():
            for p, q in zip(walked.positions[rows_a], walked.positions[rows_b], strict=True):
                depth = radii[a] + radii[b] - float(np.hypot(*(p - q)))
                if a < b and depth > 1e-3:
                    slow.setdefault((a, b), []).append(depth)
    found = score_crowd(walked, radius=radii).overlaps
    assert {(o.one, o.other): o.frames for o in found.each} == {pair: len(each) for pair, each in slow.items()}
    for overlap in found.each:
        assert overlap.depth == pytest.approx(max(slow[overlap.one, overlap.other]))
    assert [o.depth for o in found.each] == sorted((o.depth for o in found.each), reverse=True)


def test_only_who_is_there_at_the_same_time_overlaps():
    assert score_crowd(crowd(still((0, 0), 1.0), still((0, 0), 1.0), starts=(0.0, 2.0))).overlaps.pairs == 0


def test_obstacles_of_all_kinds_are_touched():
    place = scene_of(disc("tree", 0.0, 0.0, 0.5), block("kiosk", 4.0, -1.0, 6.0, 1.0))
    walked = crowd(still((0.7, 0.0), 1.0), still((3.85, 0.0), 1.0), still((4.2, 0.0), 1.0), still((2.0, 0.0), 1.0))
    found = {o.one: o for o in score_crowd(walked, scene=place).solid_overlaps.each}
    assert {one: (o.other, o.frames) for one, o in found.items()} == {
        0: ("tree", 31),
        1: ("kiosk", 31),
        2: ("kiosk", 31),
    }
    assert found[0].depth == pytest.approx(0.05)
    assert found[1].depth == pytest.approx(0.10)
    assert found[2].depth == pytest.approx(0.25 + 0.2)  # out again by the nearest side


def test_leaving_the_road_is_an_overlap_with_its_edge():
    place = scene_of(roads=(road("street", 2.0, (-60.0, 0.0), (60.0, 0.0)),))
    walked = crowd(still((0, 0.7), 1.0), still((0, 0.9), 1.0), still((0, -1.3), 1.0))
    found = {o.one: o.depth for o in score_crowd(walked, scene=place).solid_overlaps.each}
    assert found == {1: pytest.approx(0.15), 2: pytest.approx(0.55)}


@dataclass
class Cart:
    name: str
    radius: float

    def at(self, times):
        return np.stack((times, np.zeros_like(times)), axis=-1)


def test_walls_and_what_moves_are_touched():
    place = scene_of()
    object.__setattr__(place, "walls", (SimpleNamespace(name="fence", points=np.array([(0.0, 1.0), (10.0, 1.0)])),))
    object.__setattr__(place, "movers", (Cart("cart", 0.5),))
    walked = crowd(straight((0.0, 0.8), (1.0, 0.0), 2.0), straight((0.0, -0.7), (1.0, 0.0), 2.0))
    found = {(o.one, o.other): o.depth for o in score_crowd(walked, scene=place).solid_overlaps.each}
    assert found == {(0, "fence"): pytest.approx(0.05), (1, "cart"): pytest.approx(0.05)}
