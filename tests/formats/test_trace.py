from __future__ import annotations

import csv

import numpy as np
import pytest

from stridecast.errors import FileError
from stridecast.formats.trace import COLUMNS, write_trace
from stridecast.steering.curves import circle
from stridecast.synthesis.journey import Journey, follow, stream_along

HEADER = (
    "frame,time,motion,segment,input_x,input_z,x,z,vx,vz,ax,az,heading,pelvis_x,pelvis_y,pelvis_z,"
    "pelvis_qw,pelvis_qx,pelvis_qy,pelvis_qz,left_planted,right_planted,clamped"
)


@pytest.fixture(scope="module")
def journey(formula_database) -> Journey:
    return follow(formula_database, stream_along(circle(1.0), 1.3))


@pytest.fixture(scope="module")
def rows(journey, tmp_path_factory) -> list[dict[str, str]]:
    path = tmp_path_factory.mktemp("trace") / "trace.csv"
    write_trace(path, journey)
    assert path.read_text().splitlines()[0] == HEADER == ",".join(COLUMNS)
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def column(rows, *names):
    return np.array([[float(row[name]) for name in names] for row in rows])


def test_there_is_a_row_a_frame(journey, rows):
    assert [int(row["frame"]) for row in rows] == list(range(journey.motion.frames))
    assert not any(None in row or None in row.values() for row in rows)


def test_numbers_read_back_to_the_same_bits(journey, rows):
    assert np.array_equal(column(rows, "time")[:, 0], journey.times)
    assert np.array_equal(column(rows, "input_x", "input_z"), journey.inputs)
    assert np.array_equal(column(rows, "x", "z"), journey.positions)
    assert np.array_equal(column(rows, "vx", "vz"), journey.velocities)
    assert np.array_equal(column(rows, "ax", "az"), journey.accelerations)
    assert np.array_equal(column(rows, "heading")[:, 0], journey.headings)
    assert np.array_equal(column(rows, "pelvis_x", "pelvis_y", "pelvis_z"), journey.motion.root_positions)
    assert np.array_equal(column(rows, *(f"pelvis_q{axis}" for axis in "wxyz")), journey.motion.rotations[:, 0])
    assert np.array_equal(column(rows, "left_planted", "right_planted"), journey.planted)


def test_names_are_those_of_groups_and_bounds(journey, rows):
    assert tuple(row["motion"] for row in rows) == journey.motions
    assert tuple(row["segment"] for row in rows) == journey.groups
    assert tuple(tuple(row["clamped"].split("+")) if row["clamped"] else () for row in rows) == journey.clamped
    assert any(row["clamped"] for row in rows)


def test_a_trace_that_cannot_be_written_leaves_the_old_one(journey, tmp_path):
    with pytest.raises(FileError, match="cannot be written"):
        write_trace(tmp_path / "none" / "trace.csv", journey)
    (tmp_path / "trace.csv").mkdir()
    with pytest.raises(FileError, match="cannot be written"):
        write_trace(tmp_path / "trace.csv", journey)
    assert [path.name for path in tmp_path.iterdir()] == ["trace.csv"]
