from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from stridecast.errors import PathError
from stridecast.geometry import ground
from stridecast.live.ways import RADIUS, Run, way_of

coordinates = st.floats(-20, 20)
points = st.tuples(coordinates, coordinates)


@given(points, st.floats(-np.pi, np.pi), st.lists(points, min_size=2, max_size=20))
def test_a_way_begins_at_the_walker_ahead_and_ends_where_it_was_drawn(position, heading, drawn):
    here = np.array(position)
    far = [drawn[0]]
    for point in drawn[1:]:
        if np.hypot(*np.subtract(point, far[-1])) >= 0.1:
            far.append(point)
    assume(np.hypot(*(np.array(far[-1]) - here)) > 2 * RADIUS + 0.2 and np.hypot(*np.subtract(far[0], here)) > 0.31)
    way = way_of(here, heading, drawn)
    assert np.array_equal(way[0], here)
    assert np.allclose(way[-1], far[-1])
    assert np.isfinite(way).all()
    if np.hypot(*(np.array(far[0]) - here)) > 2 * RADIUS + 0.3:
        first = way[1] - way[0]
        assert abs(ground.wrap(np.asarray(ground.heading(first) - heading))) < 0.25  # no turn on the spot
        until_the_line = np.diff(way[: len(way) - len(far) + 1], axis=0)
        turns = np.diff(np.unwrap(ground.heading(until_the_line)))
        assert np.abs(turns).max(initial=0.0) < 0.3
        assert len({bool(turn > 0) for turn in turns if abs(turn) > 1e-6}) <= 1  # one way round


@pytest.mark.parametrize("drawn", [[(0.0, 0.0), (0.0, 0.05)], [(0.1, 0.0), (0.0, 0.1)]])
def test_a_line_on_the_spot_is_refused(drawn):
    with pytest.raises(PathError, match=r"draw at least 0\.3 m"):
        way_of(np.zeros(2), 0.0, drawn)


def test_an_endless_line_is_refused():
    with pytest.raises(PathError, match="1000 m are the most"):
        way_of(np.zeros(2), 0.0, [(0.0, 0.0), (0.0, 9000.0)])


@settings(max_examples=10)
@given(st.lists(points, min_size=2, max_size=12), st.floats(0.3, 4), st.floats(0.1, 1))
def test_the_point_runs_to_the_end_and_waits_for_who_is_behind(line, speed, lag):
    way = np.array(line)
    assume(np.hypot(*np.diff(way, axis=0).T).sum() > 0.5)
    run = Run(way)
    here = run.at(0.0)
    for _ in range(int(run.length / speed * 30) + 60):
        before = run.place
        point = run.advance(here, speed, lag, 1 / 30)
        assert 0 <= run.place - before <= speed / 30 + 1e-9
        here = point  # who follows at once
    assert run.place == run.length
    assert np.allclose(point, way[-1])
    waiting = Run(np.array([[0.0, 0.0], [0.0, 50.0]]))
    for _ in range(200):
        point = waiting.advance(np.zeros(2), speed, lag, 1 / 30)
    assert np.hypot(*point) < speed * lag + 0.8 + speed / 30 + 1e-9
