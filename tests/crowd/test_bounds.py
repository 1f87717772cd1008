from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stridecast.crowd.bounds import HumanBounds
from stridecast.errors import DatabaseError

BOUNDS = {
    "jerk": np.array([13.0, 10.0]),
    "tangential": np.array([[-2.0, 1.8], [-3.2, 2.6]]),
    "lateral_per_speed": np.array([1.8, 1.4]),
    "fastest": np.array([2.3, 4.5]),
}


def test_bounds_of_a_database_hold_all_its_walking(formula_database):
    found = HumanBounds.of(formula_database)
    for group in formula_database.groups:
        if {group.comes_from, group.leads_to} <= {"stand", "walk"}:
            jerk, low, high, _ = found.at(np.array([0.5]))
            assert jerk[0] >= group.bounds.jerk
            assert low[0] <= group.bounds.tangential_hull[0]
            assert high[0] >= group.bounds.tangential_hull[1]
        if group.motion == "run":
            jerk, low, high, wide = found.at(np.array([found.fades[1] + 0.1]))
            assert jerk[0] >= group.bounds.jerk
            assert wide[0] >= group.bounds.lateral_per_speed * (found.fades[1] + 0.1) - 1e-9
            assert found.fastest[-1] >= max(high for _, high in group.bounds.speed)


def test_without_running_there_is_one_gait(formula_database):
    walks = HumanBounds.of(
        replace(
            formula_database,
            **_without(formula_database, lambda group: "run" not in (group.comes_from, group.leads_to)),
        )
    )
    assert len(walks.jerk) == 1
    assert np.array_equal(walks.running(np.array([0.0, 9.0])), [0.0, 0.0])


def test_a_database_without_walking_is_refused(formula_database):
    stands = replace(formula_database, **_without(formula_database, lambda group: group.motion == "stand"))
    with pytest.raises(DatabaseError, match="nobody walks"):
        HumanBounds.of(stands)


def _without(database, keep) -> dict:
    """Groups that are kept, and their examples."""
    groups, rows = [], []
    for group in database.groups:
        if keep(group):
            groups.append(replace(group, first=len(rows)))
            rows += list(range(group.rows.start, group.rows.stop))
    tables = {name: getattr(database.examples, name)[rows] for name in vars(database.examples)}
    notes = {name: getattr(database.annotations, name)[rows] for name in vars(database.annotations)}
    return {
        "groups": tuple(groups),
        "examples": type(database.examples)(**tables),
        "annotations": type(database.annotations)(**notes),
    }


def test_bounds_run_from_gait_to_gait():
    bounds = HumanBounds(**BOUNDS, fades=(2.0, 3.0))
    jerk, low, high, wide = bounds.at(np.array([0.0, 2.0, 2.5, 3.0, 4.0]))
    assert np.allclose(jerk, [13, 13, 11.5, 10, 10])
    assert np.allclose(low, [-2, -2, -2.6, -3.2, -3.2])
    assert np.allclose(high, [1.8, 1.8, 2.2, 2.6, 2.6])
    assert np.allclose(wide, [0, 3.6, 4.0, 4.2, 5.6])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"jerk": np.array([13.0, np.nan])}, "jerk needs"),
        ({"jerk": np.array([0.0, 1.0])}, "leave room"),
        ({"tangential": np.array([[0.0, 1.0], [-1.0, 1.0]])}, "leave room"),
        ({"lateral_per_speed": np.array([0.0, 1.0])}, "leave room"),
        ({"fastest": np.array([4.5, 2.3])}, "the faster one"),
        ({"fades": (2.0, 2.0)}, "the faster one"),
    ],
)
def test_bounds_that_make_no_sense_are_refused(change, says):
    with pytest.raises(DatabaseError, match=says):
        HumanBounds(**(BOUNDS | change))


def test_bounds_of_different_length_are_refused(unchecked):
    with pytest.raises(DatabaseError, match="tangential needs"):
        HumanBounds(**(BOUNDS | {"jerk": np.array([13.0])}))
    nothing = {name: value[:0] for name, value in BOUNDS.items()}
    with pytest.raises(DatabaseError, match="one gait or for two, not for 0"):
        HumanBounds(**nothing)
