"""Trajectory files as other programs write them; made here, so that what should come out is known."""

from __future__ import annotations

import math
import sqlite3
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from stridecast.errors import FileError, InputError
from stridecast.formats.trajectories import FORMATS, load_trajectories, save_trajectories, trajectories_of
from stridecast.model.trajectories import Trajectories

# Two people, in the plan: one to the right, one up the page; frame by frame.
PLAN = {7: [(0, 1.0, 2.0), (1, 1.1, 2.0), (2, 1.2, 2.0)], 3: [(1, 5.0, -1.0), (2, 5.0, -0.9)]}
RATE = 16.0


def assert_plan(found: Trajectories, rate: float = RATE, step: int = 1) -> None:
    """What ``PLAN`` is in the frame of the package."""
    want = [(i, f * step / rate, x, -y) for i in sorted(PLAN) for f, x, y in PLAN[i]]
    have = np.column_stack((found.ids, found.times, found.positions))
    assert np.allclose(have, want, rtol=0, atol=1e-12), have


def by_frame() -> list[tuple[int, int, float, float]]:
    """Rows ``id frame x y`` as a tracker writes them."""
    return sorted(((i, f, x, y) for i, own in PLAN.items() for f, x, y in own), key=lambda row: (row[1], row[0]))


def written(folder, content: str | bytes, name: str = "people.txt"):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def jupedsim(path, rows=None, *, fps="16.0", version="2", tables: str | None = None):
    base = sqlite3.connect(path)
    base.execute(
        tables
        or "CREATE TABLE trajectory_data (frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL, "
        "pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL)"
    )
    base.execute("CREATE TABLE metadata (key TEXT NOT NULL UNIQUE, value TEXT NOT NULL)")
    told = {"fps": fps, "version": version}
    base.executemany("INSERT INTO metadata VALUES (?, ?)", [(k, v) for k, v in told.items() if v is not None])
    if tables is None:
        rows = [(f, i, x, y, 0.0, 1.0) for i, f, x, y in by_frame()] if rows is None else rows
        base.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?, ?, ?)", rows)
    base.commit()
    base.close()
    return path


# the common form


@st.composite
def any_trajectories(draw) -> Trajectories:
    count = draw(st.integers(1, 12))
    number = st.floats(-1e5, 1e5)
    column = st.lists(number, min_size=count, max_size=count)
    keys = draw(st.lists(st.tuples(st.integers(-(2**40), 2**40), number), min_size=count, max_size=count, unique=True))
    keys.sort()
    angles = draw(st.none() | st.lists(st.floats(-3.14, 3.14), min_size=count, max_size=count))
    speeds = draw(st.none() | column)
    return Trajectories(
        ids=np.array([k[0] for k in keys]),
        times=np.array([k[1] for k in keys]),
        positions=np.array([draw(column), draw(column)]).T,
        headings=None if angles is None else np.array(angles),
        speeds=None if speeds is None else np.array(speeds),
    )


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@given(given=any_trajectories())
def test_what_is_saved_comes_back(tmp_path_factory, ending, given):
    if ending == "parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path_factory.mktemp("there") / f"people.{ending}"
    save_trajectories(path, given)
    back = load_trajectories(path)
    for name in ("ids", "times", "positions", "speeds"):
        assert np.array_equal(getattr(back, name), getattr(given, name)), name
    assert (back.headings is None) == (given.headings is None)
    if given.headings is not None:
        assert np.allclose(np.exp(1j * back.headings), np.exp(1j * given.headings), rtol=0, atol=1e-12)


def test_a_plan_is_not_mirrored(tmp_path):
    """To the right of the page is +X, up the page is -Z, and angles count from the right, counter-clockwise."""
    found = load_trajectories(written(tmp_path, f"id,time,x,y,heading\n1,0,1,2,0\n1,1,1,3,{math.pi / 2}\n", "a.csv"))
    assert found.positions.tolist() == [[1, -2], [1, -3]]
    ahead = np.stack((np.sin(found.headings), np.cos(found.headings)), axis=-1)
    assert np.allclose(ahead, [[1, 0], [0, -1]], atol=1e-12)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_csv_in_any_order_with_other_columns(tmp_path, separator, end):
    rows = [("note", "Y", " x", "frame", "id"), *((f'"a{separator} b"', y, x, f, i) for i, f, x, y in by_frame())]
    text = "# made up" + end + end.join(separator.join(map(str, row)) for row in rows)
    assert_plan(load_trajectories(written(tmp_path, "\ufeff" + text), frame_rate=RATE))


def test_time_counts_where_frames_stand_beside_it(tmp_path):
    assert load_trajectories(written(tmp_path, "id,frame,time,x,y\n1,8,0.5,0,0\n")).times.tolist() == [0.5]


def test_units_of_length(tmp_path):
    path = written(tmp_path, "id,time,x,y,speed\n1,0,100,200,130\n")
    found = load_trajectories(path, unit="cm")
    assert np.allclose(found.positions, [[1, -2]])
    assert np.allclose(found.speeds, [1.3])


def test_parquet_of_others(tmp_path):
    pa = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    i, f, x, y = (list(column) for column in zip(*by_frame(), strict=True))
    table = pa.table(
        {"x": pa.array(x, pa.float32()), "y": y, "id": pa.array(i, pa.uint16()), "frame": f, "who": ["?"] * 5}
    )
    parquet.write_table(table, tmp_path / "people.data")
    found = load_trajectories(tmp_path / "people.data", frame_rate=RATE)
    assert np.allclose(found.positions[:, 0], [5, 5, 1, 1.1, 1.2], atol=1e-6)
    parquet.write_table(pa.table({"id": ["a"], "time": [0.0], "x": [1.0], "y": [1.0]}), tmp_path / "text")
    with pytest.raises(FileError, match="column 'id': numbers should stand here, not string"):
        load_trajectories(tmp_path / "text")
    parquet.write_table(
        pa.table({"id": [1, 2], "time": [0.0, None], "x": [1.0, 1.0], "y": [1.0, 1.0]}), tmp_path / "none"
    )
    with pytest.raises(FileError, match="row 2: column 'time': nan is not a finite"):
        load_trajectories(tmp_path / "none")
    whole = (tmp_path / "people.data").read_bytes()
    with pytest.raises(FileError, match="damaged, or no Parquet"):
        load_trajectories(written(tmp_path, whole[: len(whole) // 2]))


def test_parquet_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr("stridecast.formats.trajectory_tables.find_spec", lambda name: None)
    with pytest.raises(FileError, match=r"pip install 'stridecast\[parquet\]'"):
        load_trajectories(written(tmp_path, b"PAR1" + bytes(100)))


# JuPedSim


@pytest.mark.parametrize("version", ["1", "2", "9", None])
def test_jupedsim(tmp_path, version, caplog):
    found = load_trajectories(jupedsim(tmp_path / "out.whatever", version=version))
    assert_plan(found)
    assert np.allclose(np.cos(found.headings), -1)  # up the page
    assert ("newer than any known" in caplog.text) == (version == "9")


def test_jupedsim_without_orientations(tmp_path):
    columns = "CREATE TABLE trajectory_data (frame INTEGER, id INTEGER, pos_x REAL, pos_y REAL)"
    path = jupedsim(tmp_path / "out", tables=columns)
    with sqlite3.connect(path) as base:
        base.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?)", [(f, i, x, y) for i, f, x, y in by_frame()])
    base.close()
    found = load_trajectories(path)
    assert_plan(found)
    assert found.headings is None
    assert load_trajectories(path, frame_rate=8.0).times[-1] == 0.25


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ({"fps": None}, "tells no fps"),
        ({"fps": "fast"}, "positive number, not 'fast'"),
        ({"fps": "0"}, "positive number, not '0'"),
        ({"rows": []}, "holds nobody"),
        ({"rows": [(0, 1, 0.0, "here", 0.0, 1.0)]}, "row 1: column 'pos_y': a number should stand here, not b'here'"),
        ({"rows": [(0, 1, 0.0, float("inf"), 0.0, 1.0)]}, "row 1: column 'y': inf is not a finite number"),
        ({"rows": [(0, 1, 0.0, 0.0, 0.0, 1.0), (0, 1, 1.0, 0.0, 0.0, 1.0)]}, "row 2: person 1 is in two places"),
        ({"tables": "CREATE TABLE agents (id INTEGER)"}, r"no table trajectory_data \(tables: agents, metadata\)"),
        ({"tables": "CREATE TABLE trajectory_data (frame INTEGER, pos_y REAL)"}, "lacks id, pos_x"),
        (
            {
                "tables": "CREATE VIEW trajectory_data AS WITH RECURSIVE n(k) AS "
                "(SELECT 1 UNION ALL SELECT k + 1 FROM n) SELECT k AS frame, 1 AS id, 0.0 AS pos_x, 0.0 AS pos_y FROM n"
            },
            "no table trajectory_data",
        ),
    ],
)
def test_what_is_wrong_with_jupedsims_tables_is_said(tmp_path, how, says):
    with pytest.raises(FileError, match=says):
        load_trajectories(jupedsim(tmp_path / "out.sqlite", **how))


def test_a_damaged_or_unfinished_database_is_refused(tmp_path):
    whole = jupedsim(tmp_path / "out.sqlite").read_bytes()
    with pytest.raises(FileError, match="cannot be read as SQLite"):
        load_trajectories(written(tmp_path, whole[:1000], "cut"))
    (tmp_path / "out.sqlite-wal").write_bytes(b"half a simulation")
    with pytest.raises(FileError, match="is not finished"):
        load_trajectories(tmp_path / "out.sqlite")


# Juelich


@pytest.mark.parametrize(
    "rate_line", ["# framerate: 16.00 fps", "#framerate:16", "# FrameRate = 16.0", "# frame rate 16 Hz"]
)
@pytest.mark.parametrize(
    ("header", "factor"),
    [("# id frame x/cm y/cm z/cm", 100), ("# id\tframe\tx [in m]\ty [in m]", 1), ("#X,Y,Z: the agents (in metres)", 1)],
)
def test_juelich(tmp_path, rate_line, header, factor):
    lines = [f"{i} {f} {x * factor} {y * factor} 170.0" for i, f, x, y in sorted(by_frame())]
    path = written(tmp_path, "\n".join(["# description: a corridor", rate_line, header, "", *lines]))
    assert_plan(load_trajectories(path))


@pytest.mark.parametrize("factor", [1, 100])
def test_the_unit_is_guessed_from_how_fast_people_are_and_said(tmp_path, factor, caplog):
    lines = [f"{i} {f} {x * factor} {y * factor}" for i, f, x, y in sorted(by_frame())]
    path = written(tmp_path, "\n".join(["# framerate: 16", *lines]))
    assert_plan(load_trajectories(path))
    assert f"taken for {'cm' if factor == 100 else 'm'}" in caplog.text
    assert np.allclose(load_trajectories(path, unit="m").positions[0], [5 * factor, factor])


def test_juelich_without_a_frame_rate(tmp_path):
    path = written(tmp_path, "\n".join("{} {} {} {}".format(*row) for row in sorted(by_frame())))
    with pytest.raises(FileError, match="name the format, juelich for 'id frame x y' or eth"):
        load_trajectories(path, frame_rate=RATE)
    with pytest.raises(FileError, match="give the frame rate"):
        load_trajectories(path, unit="m", format="juelich")
    assert_plan(load_trajectories(path, frame_rate=RATE, unit="m", format="juelich"))


# ETH and UCY


@pytest.mark.parametrize("step", [6, 10])
@pytest.mark.parametrize("wide", [True, False])
def test_eth(tmp_path, step, wide):
    rows = [
        f"   {f * step:.7e}   {i:.7e} {x} 0.0 {y} 1.6 0 0" if wide else f"{f * step}.0\t{i}.0\t{x}\t{y}"
        for i, f, x, y in by_frame()
    ]
    path = written(tmp_path, "\n".join(rows))
    assert_plan(load_trajectories(path), 2.5)
    assert_plan(load_trajectories(path, frame_rate=25.0), 25.0, step)


def test_other_steps_ask_for_the_frame_rate(tmp_path):
    path = written(tmp_path, "0 1 0 0\n12 1 1 0\n24 1 2 0\n")
    with pytest.raises(FileError, match="steps of 12, not of 6 or 10"):
        load_trajectories(path, format="eth")
    assert load_trajectories(path, format="eth", frame_rate=30).times.tolist() == [0, 0.4, 0.8]


# PedPy


def test_objects_of_pedpy():
    i, f, x, y = (np.array(column) for column in zip(*by_frame(), strict=True))
    assert_plan(trajectories_of(SimpleNamespace(frame_rate=RATE, data={"id": i, "frame": f, "x": x, "y": y})))


def test_pedpy_itself():
    pedpy, pandas = pytest.importorskip("pedpy"), pytest.importorskip("pandas")
    data = pandas.DataFrame(by_frame(), columns=["id", "frame", "x", "y"])
    assert_plan(trajectories_of(pedpy.TrajectoryData(data=data, frame_rate=RATE)))


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (SimpleNamespace(frame_rate=1.0), "attributes data"),
        (SimpleNamespace(data={}, frame_rate=1.0), "lacks the column 'id'"),
        (SimpleNamespace(data={k: ["?"] for k in ("id", "frame", "x", "y")}, frame_rate=1.0), "no number"),
        (SimpleNamespace(data={k: [1] for k in ("id", "frame", "x", "y")}, frame_rate=0.0), "positive number"),
        (SimpleNamespace(data={k: [1, 1] for k in ("id", "frame", "x", "y")}, frame_rate=1.0), "two places at once"),
    ],
)
def test_other_objects_are_refused(data, says):
    with pytest.raises(InputError, match=says):
        trajectories_of(data)


# refusals


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty"),
        (b"# only\n# comments\n", "nothing but comments"),
        (b"id,time,x,y\n", "holds nobody"),
        (b"id,x,y\n1,2,3\n", "txt:1: the header lacks time: it should name id, time"),
        (b"id,frame,x,y\n1,2,3,4\n", "give the frame rate"),
        (b"id,time,x,y,x\n1,2,3,4,5\n", "names 'x' twice"),
        (b"\n# c\nid,time,x,y\n1,0,0,0\n\n1,one,0,0\n", "txt:6: column 'time': a number should stand here, not 'one'"),
        (b'id,time,n,x,y\n1,0,"a, b",0,?\n', "txt:2: column 'y': a number should stand here, not '\\?'"),
        (b"id,time,x,y\n1,0,0\n", "txt:2: column 'y': the number is missing"),
        (b"id,time,x,y\n1,0,0,0\n1,1,nan,0\n", "txt:3: column 'x': nan is not a finite"),
        (b"id,time,x,y\n1,0,0,0\n1,1,1e999,0\n", "txt:3: column 'x': inf is not a finite"),
        (b"id,time,x,y\n1.5,0,0,0\n", "txt:2: column 'id': 1.5 is no whole number"),
        (b"id,time,x,y\n1e300,0,0,0\n", "txt:2: column 'id': 1e.300 is no whole number"),
        (b"id,time,x,y\n1,1e300,0,0\n", "txt:2: column 'time': 1e.300 is no time"),
        (b"id,time,x,y\n1,0,0,2e6\n", "txt:2: column 'y': 2000000 lies further"),
        (b"id,time,x,y\n1,1,0,0\n2,1,0,0\n1,1,0,1\n", "txt:4: person 1 is in two places at once, .*first line 2"),
        (b"id time x y\n1 0 0 0\n", "the header lacks id"),
        (b"# framerate: fast\n1 0 0 0\n", "txt:1: the frame rate should be a positive number, not 'fast'"),
        (b"# framerate: 0 fps\n1 0 0 0\n", "txt:1: the frame rate should be"),
        (b"# framerate: 16\n1 0 0\n", "txt:2: column 'y': the number is missing"),
        (b"1 2 3,5 4\n", "lacks id"),
        (b"0 1 2 3 4 5 6 7\n10 1 2 3 x 5 6 7\n", "txt:2: column 'y': a number should stand here, not 'x'"),
        (b"id,time,x,y\n1,0,\xff\xfe,0\n", "txt:2: column 'x'"),
        (b"\x7fELF\0\0\0", "binary data"),
        (b"PK\x03\x04 rest", "ZIP archive"),
        (b"HIERARCHY\nROOT hips\n", "a BVH recording"),
        (b"SQLite format 3\0", "cannot be read as SQLite"),
        (b"\0" * 5000, "binary data"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_place(tmp_path, content, says):
    if content.startswith(b"PAR1"):
        pytest.importorskip("pyarrow")
    with pytest.raises(FileError, match=says):
        load_trajectories(written(tmp_path, content))


@given(st.binary(max_size=300) | st.text("0123456789 .,;\n#ideframxyt-", max_size=200).map(str.encode))
@example(b"\x1c")
def test_any_bytes_are_read_or_refused_in_words(tmp_path_factory, content):
    path = written(tmp_path_factory.mktemp("any"), content)
    for kind in (None, *(f for f in FORMATS if f != "parquet")):
        try:
            load_trajectories(path, format=kind, frame_rate=25)
        except FileError as error:
            assert str(path) in str(error)  # noqa: PT017


def test_files_too_large_are_refused_unread(tmp_path, monkeypatch):
    monkeypatch.setattr("stridecast.formats.trajectory_rows.LARGEST", 10)
    with pytest.raises(FileError, match="has 0 MB; at most"):
        load_trajectories(written(tmp_path, "id,time,x,y\n1,0,0,0\n"))
    monkeypatch.undo()
    monkeypatch.setattr("stridecast.formats.trajectory_rows.MOST_ROWS", 2)
    with pytest.raises(FileError, match="more than 2 rows"):
        load_trajectories(written(tmp_path, "id,time,x,y\n1,0,0,0\n1,1,0,0\n1,2,0,0\n"))
    monkeypatch.setattr("stridecast.formats.trajectory_sqlite.MOST_ROWS", 2)
    with pytest.raises(FileError, match="has 5 rows"):
        load_trajectories(jupedsim(tmp_path / "out.sqlite"))


def test_wrong_options_are_refused(tmp_path):
    path = written(tmp_path, "id,time,x,y\n1,0,0,0\n")
    with pytest.raises(InputError, match="no unit 'feet'; there are m, cm, mm"):
        load_trajectories(path, unit="feet")
    with pytest.raises(InputError, match="no format 'xml'"):
        load_trajectories(path, format="xml")
    with pytest.raises(InputError, match="must be a positive number"):
        load_trajectories(path, frame_rate=math.nan)
    with pytest.raises(FileError, match="cannot be read"):
        load_trajectories(tmp_path / "nowhere.csv")
    with pytest.raises(FileError, match=r"as \.csv, \.parquet or \.txt, not as \.xml"):
        save_trajectories(tmp_path / "people.xml", load_trajectories(path))
