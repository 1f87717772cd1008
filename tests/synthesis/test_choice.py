"""Kernels of choice and seams against plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from stridecast.geometry.kernels import decay
from stridecast.synthesis.blend_kernels import SEAM_HALF_LIFE, close_seam
from stridecast.synthesis.choice_kernels import (
    AHEAD,
    LATERAL_SCALE,
    POSE_SCALE,
    SPEED_SCALE,
    STYLE_MOST,
    STYLE_SCALE,
    TANGENTIAL_SCALE,
    choose,
    describe_vehicle,
    nearest,
    unlike,
)
from stridecast.synthesis.state import NEIGHBOURS
from stridecast.synthesis.walker import Walkers
from walks import KINDS, points_of


@pytest.fixture(scope="module")
def busy(request: pytest.FixtureRequest) -> Walkers:
    """Characters in the midst of something, in all moods."""
    moods = np.linspace(-1.0, 1.0, len(KINDS))
    walkers = Walkers(request.getfixturevalue("formulas"), np.zeros((len(KINDS), 2)), style=moods)
    styles = np.random.default_rng(4).uniform(-0.8, 0.8, len(walkers._tables.styles))
    wide = [(styles[f : f + n].min(), styles[f : f + n].max()) if n else (0.0, 0.0) for f, n in groups_of(walkers)]
    walkers._tables = walkers._tables._replace(styles=styles, style_range=np.array(wide))
    streams = np.stack([points_of(kind, 50, 30.0, i) for i, kind in enumerate(KINDS)], axis=1)
    for points in streams:
        walkers.step(points)
    return walkers


def groups_of(walkers: Walkers) -> list[tuple[int, int]]:
    """First example and number of examples of every group."""
    t = walkers._tables
    return list(zip(t.first.tolist(), t.sizes.tolist(), strict=True))


def distances(walkers: Walkers, c: int, group: int) -> np.ndarray:
    """Squared distances of a group's examples, without a short cut."""
    t, s = walkers._tables, walkers._state
    rows = slice(t.first[group], t.first[group] + t.sizes[group])
    sine, cosine = np.sin(s.heading[c]), np.cos(s.heading[c])
    ax, az = s.acceleration[c]
    more = ax * sine + az * cosine - t.parameters[rows, 1]
    vehicle = ((np.hypot(*s.velocity[c]) - t.parameters[rows, 0] + AHEAD * more) / SPEED_SCALE) ** 2
    vehicle += (more / TANGENTIAL_SCALE) ** 2 + ((ax * cosine - az * sine - t.parameters[rows, 2]) / LATERAL_SCALE) ** 2
    style = np.clip(s.style[c], t.styles[rows].min(), t.styles[rows].max())
    off = ((t.styles[rows] - style) / STYLE_SCALE) ** 2
    vehicle += off / (1.0 + off / STYLE_MOST)
    pose = np.sum(t.feature_weights * (t.features[rows, 2] - s.features[c]) ** 2, axis=-1)
    return vehicle + 3.0 * pose / POSE_SCALE**2


def test_the_nearest_are_found_although_most_are_not_looked_at_to_the_end(busy):
    tables, state = busy._tables, busy._state
    for c in range(len(busy)):
        describe_vehicle(tables, state, c)
        for group in np.flatnonzero(tables.sizes):
            true = np.sort(distances(busy, c, group))
            assert nearest(tables, state, c, group, 1e18) == pytest.approx(true[0], rel=1e-9)
            assert nearest(tables, state, c, group, 5.0) == pytest.approx(min(true[0], 5.0), rel=1e-9)
            style = float(np.clip(state.style[c], *tables.style_range[group]))
            choose(tables, state, c, group, style, -2.0, 2.0, 0, NEIGHBOURS)
            found = state.found[c, : min(len(true), NEIGHBOURS + 1)]
            np.testing.assert_allclose(found, true[: len(found)] + 1e-9, rtol=1e-9)
            assert state.weights[c].sum() == pytest.approx(1.0)


def test_only_examples_of_the_styles_allowed_are_chosen(busy):
    tables, state = busy._tables, busy._state
    for c in range(len(busy)):
        describe_vehicle(tables, state, c)
        for group in np.flatnonzero(tables.sizes):
            styles = tables.styles[tables.first[group] : tables.first[group] + tables.sizes[group]]
            low, high = np.sort(np.random.default_rng(c).uniform(styles.min(), styles.max(), 2))
            true = np.sort(distances(busy, c, group)[(low <= styles) & (styles <= high)])[:4]
            if len(true) == 0:
                continue
            before = state.weights[c, :3].copy()
            style = float(np.clip(state.style[c], *tables.style_range[group]))
            choose(tables, state, c, group, style, low, high, 3, 3)
            np.testing.assert_allclose(state.found[c, : len(true)], true + 1e-9, rtol=1e-9)
            np.testing.assert_array_equal(state.weights[c, :3], before)
            used = state.chosen[c, 3:][state.weights[c, 3:] > 0.0]
            assert ((tables.styles[used] >= low) & (tables.styles[used] <= high)).all()
            assert state.weights[c, 3:].sum() == pytest.approx(1.0)


@pytest.mark.parametrize("width", [1, 3, 4, 7, 76])
def test_four_sums_at_a_time_are_one_sum(width):
    a, b, weights = np.random.default_rng(width).normal(size=(3, width))
    assert unlike(a, b, weights) == pytest.approx(np.sum(weights * (a - b) ** 2), rel=1e-12)


def test_a_seam_fades_as_each_of_its_features_would_alone(busy):
    state = busy._state
    for c in range(len(busy)):
        state.seam[c], state.seam_rate[c] = np.random.default_rng(c).normal(size=(2, state.seam.shape[1]))
        pairs = zip(state.seam[c].tolist(), state.seam_rate[c].tolist(), strict=True)
        expected = [decay(offset, rate, SEAM_HALF_LIFE, 1 / 30) for offset, rate in pairs]
        close_seam(state, c, 1 / 30)
        np.testing.assert_allclose(np.stack((state.seam[c], state.seam_rate[c]), axis=-1), expected, rtol=1e-12)
