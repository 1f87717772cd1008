from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.errors import FileError
from stridecast.formats.points import read_path, read_points

NUMBER = st.floats(-1e5, 1e5)


@pytest.fixture
def csv(tmp_path):
    def write(content: str | bytes):
        path = tmp_path / "points.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def test_samples_are_read(csv):
    stream = read_points(csv("time,x,z,motion\n0,1,2,walk\n0.5,3,-4.5e0,run\n1, 5 ,6,\n"), motion="stand")
    assert stream.times.tolist() == [0, 0.5, 1]
    assert stream.points.tolist() == [[1, 2], [3, -4.5], [5, 6]]
    assert stream.motions == ("walk", "run", "stand")


def test_motion_may_be_left_out(csv):
    assert read_points(csv("time,x,z\n0,0,0\n"), motion="run").motions == ("run",)


def test_columns_stand_in_any_order_and_others_are_ignored(csv):
    stream = read_points(csv('button,Z, X ,note,time\nup,2,1,"a, b",0\n\ndown,4,3,"c ""d""",1\n'))
    assert stream.points.tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends_and_byte_order_mark_do_not_matter(csv, end):
    stream = read_points(csv(b"\xef\xbb\xbf" + f"time,x,z{end}0,1,2{end}1,3,4".encode()))
    assert stream.points.tolist() == [[1, 2], [3, 4]]


@given(st.lists(st.tuples(NUMBER, NUMBER), min_size=2, max_size=20, unique=True))
def test_numbers_are_read_to_the_last_bit(tmp_path_factory, points):
    path = tmp_path_factory.mktemp("path") / "path.csv"
    path.write_text("x,z\n" + "".join(f"{x!r},{z!r}\n" for x, z in points))
    assert np.array_equal(read_path(path), np.array(points))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "is empty"),
        ("time,x,z\n", "no rows below its header"),
        ("\n\ntime,x\n0,1\n", r"csv:3: the header lacks z: it should be time,x,z, but names 'time', 'x'"),
        ("time;x;z\n0;1;2\n", "separated by commas"),
        ("0,1,2\n1,2,3\n", "lacks time, x, z"),
        ("time,x,z,x\n0,1,2,3\n", "names 'x' twice"),
        ("time,x,z\n0,1,2\n1,one,2\n", "csv:3: column 'x': a number should stand here, not 'one'"),
        ("time,x,z\n0,1\n", "csv:2: column 'z': the number is missing"),
        ("time,x,z\n0,1,nan\n", "csv:2: column 'z': nan is not a finite number"),
        ("time,x,z\n0,-inf,0\n", "csv:2: column 'x': -inf is not a finite number"),
        ("time,x,z\ninf,0,0\n", "csv:2: column 'time'"),
        ("time,x,z\n0,2e6,0\n", "csv:2: column 'x': 2e6 lies further"),
        ("time,x,z\n0,1,2\n0.5,1,2\n0.25,1,2\n", "csv:4: column 'time': 0.25 s comes after 0.5 s"),
        ("time,x,z\n0,1,2\n0,1,2\n", "csv:3: column 'time'.* must run forwards"),
        ("time,x,z\n0,1,2\n50000,1,2\n", "more than two hours; times are in seconds"),
        ("time,x,z,motion\n0,1,2,walk\n1,1,2,hop\n", "csv:3: column 'motion': .*'hop'; there are stand, walk, run"),
        (b"time,x,z\n0,\x00,2\n", "should be text"),
        ("\ufefftime,x,z\n0,1,2\u00b0\n", "csv:2: column 'z'"),
        (b"\xff\xfet\x00i\x00", "UTF-16"),
    ],
)
def test_what_is_wrong_is_named_with_line_and_column(csv, content, says):
    with pytest.raises(FileError, match=says):
        read_points(csv(content))


def test_lines_are_counted_through_quoted_line_ends(csv):
    with pytest.raises(FileError, match="csv:4: column 'x'"):
        read_points(csv('time,x,z,note\n0,1,2,"two\nlines"\n1,?,2,\n'))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileError, match=r"none\.csv: cannot be read"):
        read_points(tmp_path / "none.csv")


def test_a_path_is_read(csv):
    assert read_path(csv("z,x\n0,1\n2,3\n")).tolist() == [[1, 0], [3, 2]]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("x,z\n1,1\n1,1\n", "two different points"),
        ("x,z\n1,1\n", "two different points"),
        ("x,y\n1,1\n", "lacks z"),
        ("x,z\n0,0\n1,oops\n", "csv:3: column 'z'"),
    ],
)
def test_a_path_that_is_none_is_refused(csv, content, says):
    with pytest.raises(FileError, match=says):
        read_path(csv(content))
