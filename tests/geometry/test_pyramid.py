"""Frequency bands."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.geometry import pyramid

LIMITS = (0.4, 0.8, 1.6, 3.2, 6.4)


@given(st.integers(0, 10**6), st.integers(1, 300), st.sampled_from([24.0, 30.0, 60.0, 120.0]), st.booleans())
def test_bands_add_up_to_the_signal(seed, frames, rate, cyclic):
    signal = np.random.default_rng(seed).normal(size=(frames, 2, 3))
    bands = pyramid.split(signal, rate, LIMITS, cyclic)
    assert len(bands) == len(LIMITS) + 1
    np.testing.assert_allclose(pyramid.join(bands, (1.0,) * 6), signal, atol=1e-9)


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 120.0, 240.0])
def test_bands_mean_the_same_at_any_rate(rate):
    """A wave of 1 Hz falls into the same bands by the same shares."""
    time = np.arange(0, 10, 1 / rate)
    bands = pyramid.split(np.sin(2 * np.pi * time), rate, LIMITS, cyclic=True)
    shares = [float(np.abs(band).max()) for band in bands]
    closed = np.diff([0.0, *(0.5 ** (1.0 / f**2) for f in LIMITS), 1.0])
    np.testing.assert_allclose(shares, closed, atol=0.03)


def test_half_of_a_frequency_passes_its_limit():
    time = np.arange(0, 20, 1 / 60)
    low = pyramid.lowest(np.sin(2 * np.pi * 1.6 * time), 60.0, 1.6, cyclic=True)
    assert np.abs(low).max() == pytest.approx(0.5, abs=0.01)


def test_ends_and_straight_lines_stay():
    line = np.linspace(0.0, 3.0, 200)
    np.testing.assert_allclose(pyramid.lowest(line, 60.0, 0.4), line, atol=1e-9)
    bumpy = line + np.sin(np.arange(200) / 5.0)
    low = pyramid.lowest(bumpy, 60.0, 0.4)
    assert low[[0, -1]] == pytest.approx(bumpy[[0, -1]], abs=1e-9)


def test_a_cycle_stays_one_wherever_it_begins():
    wave = np.random.default_rng(0).normal(size=64)
    once = pyramid.lowest(wave, 60.0, 1.6, cyclic=True)
    moved = pyramid.lowest(np.roll(wave, 17), 60.0, 1.6, cyclic=True)
    np.testing.assert_allclose(moved, np.roll(once, 17), atol=1e-12)
