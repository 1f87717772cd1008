"""Density by cells, and Weidmann."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from places import block, disc, road
from stridecast.model.scene import Scene
from stridecast.scorecard.crowds import score_crowd
from stridecast.scorecard.density import BIN, FREE_SPEED, JAM, REACH, cell_areas, weidmann
from stridecast.scorecard.solids import Solids
from tracked import crowd, straight

OPEN = Solids(None)


def lattice(count: int, apart: float) -> np.ndarray:
    return apart * np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("apart", [0.5, 1.0, 2.0])
def test_a_lattice_has_its_density(apart):
    points = lattice(9, apart)
    inner = ((points > 1.5 * apart) & (points < 6.5 * apart)).all(axis=1)
    np.testing.assert_allclose(cell_areas(points, OPEN)[inner], apart**2)


def test_somebody_alone_has_all_within_reach():
    np.testing.assert_allclose(cell_areas(np.array([[3.0, 4.0]]), OPEN), np.pi * REACH**2)


def test_two_share_the_disc_at_their_middle():
    def half(x: float) -> float:
        return 2 * np.sqrt(REACH**2 - x * x)

    expected = quad(half, -REACH, 0.5)[0]
    np.testing.assert_allclose(cell_areas(np.array([[0.0, 0.0], [1.0, 0.0]]), OPEN), expected)


def by_shapely(points: np.ndarray, ground=None) -> np.ndarray:
    """Cells by cutting half planes off a disc."""
    out = []
    for k, p in enumerate(points):
        cell = shapely.Point(p).buffer(REACH, quad_segs=400)
        for j, q in enumerate(points):
            if j != k:
                middle, way = (p + q) / 2, (q - p) / np.linalg.norm(q - p)
                side = np.array([way[1], -way[0]])
                corners = [
                    middle + 9 * side,
                    middle - 9 * side,
                    middle - 9 * side - 9 * way,
                    middle + 9 * side - 9 * way,
                ]
                cell = cell.intersection(shapely.Polygon(corners))
        if ground is not None:
            parts = shapely.get_parts(cell.intersection(ground))
            cell = parts[np.argmin(shapely.distance(parts, shapely.Point(p)))]
        out.append(cell.area)
    return np.array(out)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_cells_are_what_half_planes_leave_of_discs(seed, people):
    points = np.random.default_rng(seed).uniform(0, 4, (people, 2))
    np.testing.assert_allclose(cell_areas(points, OPEN), by_shapely(points), rtol=1e-4)


@given(st.integers(0, 2**32 - 1))
def test_cells_end_at_what_is_solid(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 5, (8, 2))
    points = points[np.linalg.norm(points - 2.5, axis=1) > 1.1]
    points = points[~((points > (3.9, 3.9)) & (points < (4.6, 4.6))).all(axis=1)]
    strip = road("street", 8.0, (-2.0, 2.0), (7.0, 2.0))
    scene = Scene(
        start=np.array([-1.5, 2.0]),
        goals=np.array([[6.0, 2.0]]),
        obstacles=(disc("tree", 2.5, 2.5, 1.0), block("kiosk", 4.0, 4.0, 4.5, 4.5)),
        roads=(strip,),
    )
    if len(points) == 0:
        return
    ground = shapely.LineString(strip.points).buffer(4.0)
    ground = ground.difference(shapely.Point(2.5, 2.5).buffer(1.0, quad_segs=16)).difference(
        shapely.box(4, 4, 4.5, 4.5)
    )
    np.testing.assert_allclose(cell_areas(points, Solids(scene)), by_shapely(points, ground), rtol=1e-3)


def test_nobody_behind_a_wall_counts():
    scene = Scene(start=np.array([-20.0, 0.0]), goals=np.array([[-10.0, 0.0]]))
    wall = SimpleNamespace(name="wall", points=np.array([(0.0, -50.0), (0.0, 50.0)]))
    object.__setattr__(scene, "walls", (wall,))
    points = np.array([[-0.5, 0.0], [0.5, 0.0], [1.5, 0.0]])
    expected = quad(lambda x: 2 * np.sqrt(REACH**2 - x * x), -0.5, REACH)[0]
    assert cell_areas(points, Solids(scene))[0] == pytest.approx(expected, rel=2e-3)


def test_weidmann_runs_from_free_to_jammed():
    density = np.linspace(0.01, 7, 200)
    speed = weidmann(density)
    assert weidmann(np.array(0.0)) == pytest.approx(FREE_SPEED)
    assert (np.diff(speed) <= 0).all()
    assert (speed[density >= JAM] == 0).all()
    assert weidmann(np.array(2.0)) == pytest.approx(1.34 * (1 - np.exp(-1.913 * (1 / 2 - 1 / 5.4))))


@pytest.mark.parametrize("density", [0.6, 1.1, 2.1])
def test_a_crowd_at_weidmanns_speed_does_not_deviate(density):
    """A lattice that moves as one; people at its rim are in a thinner crowd, so that is left out."""
    apart = 1 / np.sqrt(density)
    speed = float(weidmann(np.array(density)))
    ways = [straight(start, (0.0, speed), 4.0) for start in lattice(15, apart)]
    found = score_crowd(crowd(*ways)).speed_density
    inner = np.abs(found.densities - density) < 1e-6
    assert inner.sum() >= 9 * 3
    np.testing.assert_allclose(found.speeds, speed)
    (same,) = [b for b in found.bins if b.density // BIN == density // BIN]
    assert same.samples >= inner.sum()
    assert same.speed == pytest.approx(same.expected, rel=0.15)


def test_who_is_there_takes_room_but_is_not_asked():
    walks, stands = straight((0, 0), (0, 1.0), 10.0), straight((1, 9.9), (0, 0.0), 10.0)
    found = score_crowd(crowd(walks, stands), goals={1: np.array([(1.0, 10.0)])}).speed_density
    np.testing.assert_allclose(found.speeds, 1.0)
    assert found.densities.max() > 1.2 / (np.pi * REACH**2)
