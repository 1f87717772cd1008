from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from databases import analysed, database_of, formula_motions, takes_of
from stridecast.database.annotation import annotate, statuses
from stridecast.database.assembly import assemble
from stridecast.errors import DatabaseError
from stridecast.model.annotation import COLUMNS, Annotations
from synthetic_gait import gait, ramps


def column(name: str, database, take: str, mirrored: bool = False) -> np.ndarray:
    number = next(i for i, known in enumerate(database.takes) if known.name == take)
    rows = (database.examples.takes == number) & (database.examples.mirrored == mirrored)
    return getattr(database.annotations, name)[rows]


def test_examples_are_annotated_from_the_tables_alone(learned):
    again = annotate(learned.skeleton, learned.references, learned.groups, learned.examples)
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(again, name), getattr(learned.annotations, name))


def test_velocities_are_those_of_the_walker(learned):
    assert np.abs(column("speed", learned, "run left") - 2.8).max() < 0.05
    assert np.abs(column("turn", learned, "run left") - 2.8 * 0.3).max() < 0.08
    faster = column("end_speed", learned, "faster") - column("start_speed", learned, "faster")
    assert faster.max() > 0.2
    assert faster.min() > -0.1


def test_mirrored_examples_turn_the_other_way_and_are_else_alike(learned):
    for name in COLUMNS:
        own, other = (np.sort(column(name, learned, "left", mirrored)) for mirrored in (False, True))
        expected = np.sort(-other) if name == "turn" else other
        np.testing.assert_allclose(own, expected, atol=0.03, err_msg=name)


def test_only_half_cycles_of_walking_and_running_have_a_cadence(learned):
    status, cadence = statuses(learned.groups), learned.annotations.cadence
    moving = np.isin(status, ("walk", "run"))
    np.testing.assert_allclose(cadence[moving], 1 / learned.examples.durations[moving])
    assert (cadence[~moving] == 0.0).all()


def test_takes_tell_what_comes_in_them(learned):
    told = {take.name: take.annotation for take in learned.takes}
    assert told["stand and walk"].statuses == ("stand", "stand-walk", "walk", "walk-stand", "stand")
    assert told["left"].statuses == ("walk",)
    assert told["stand and walk"].start_speed < 0.1
    assert told["run"].end_speed == pytest.approx(3.6, abs=0.15)
    assert told["left"].turn > 0.5
    assert all(abs(take.style) < 0.5 for take in told.values())


def test_cycles_are_found_where_steps_repeat(learned):
    for take in learned.takes:
        if take.name in ("left", "run left", "faster"):
            cadence = column("cadence", learned, take.name)
            assert 2 / cadence.max() - 0.05 <= take.annotation.cycle <= 2 / cadence.min() + 0.05
            assert take.annotation.cycles >= 1
            assert 0 < take.annotation.cycle_start < take.seconds


def test_a_take_of_which_nothing_is_used_is_annotated_by_itself():
    """Shuffling is no half cycle to learn from, but it can be told that it is slow walking."""
    motions = {name: formula_motions()[name] for name in ("stand and walk", "faster")}
    motions["shuffle"] = gait(ramps((4.0, 0.4))).motion
    database = assemble(analysed(motions), takes_of(motions))
    take = database.takes[-1]
    assert take.segments == 0
    assert take.annotation.statuses == ("walk",)
    assert take.annotation.speed == pytest.approx(0.4, abs=0.05)
    assert -1 < take.annotation.style < 1


def test_one_take_alone_has_no_style():
    database = database_of({"faster": formula_motions()["faster"]})
    assert (database.annotations.style == 0.0).all()


def test_annotations_that_do_not_fit_are_refused(learned, unchecked):
    columns = {name: getattr(learned.annotations, name) for name in COLUMNS}
    with pytest.raises(DatabaseError, match=r"annotation .turn. is damaged: .* finite numbers wanted"):
        Annotations(**{**columns, "turn": columns["turn"][1:]})
    with pytest.raises(DatabaseError, match="annotations and examples differ in number"):
        replace(learned, annotations=Annotations(**{name: values[1:] for name, values in columns.items()}))
