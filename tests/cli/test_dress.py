from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from stridecast.cli.main import app
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import save_database
from stridecast.formats.trajectories import load_trajectories
from stridecast.geometry import ground


def call(*arguments: object):
    """Run the command in this process; nothing but ``typer.Exit`` may come out of it."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exc_info
    return result


def refused(*arguments: object) -> str:
    """Run the command, and return the one line that says what is wrong."""
    result = call(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert result.stderr.startswith("error: ")
    return result.stderr.removeprefix("error: ").strip()


@pytest.fixture(scope="module")
def database(formula_database, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("database") / "dress.safetensors"
    save_database(formula_database, path)
    return path


@pytest.fixture
def walks(tmp_path) -> Path:
    """Ten people who walk in a wide arc, as a plan; 30 rows each."""
    path = tmp_path / "walks.csv"
    rows = [
        f"{k},{2 + 0.2 * n:.1f},{8 * np.sin(0.03 * n) + 2 * k:.4f},{8 * np.cos(0.03 * n):.4f}"
        for k in range(10)
        for n in range(30)
    ]
    path.write_text("id,time,x,y\n" + "\n".join(rows) + "\n")
    return path


def test_bodies_for_a_file(walks, database, tmp_path):
    out = tmp_path / "out.bvh"
    result = call("dress", walks, "--database", database, "-o", out, "--height", 1.6)
    assert result.exit_code == 0, result.output
    assert "10 people, 58.3 s of them: 10 BVH" in result.stdout
    assert "cm from the source on average" in result.stdout
    source, tracks = load_trajectories(walks), load_trajectories(tmp_path / "out.csv")
    with (tmp_path / "out.people.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["id"] for row in rows] == [str(k) for k in range(10)]
    for row in rows:
        motion = load_motion(tmp_path / row["file"])
        assert (row["start"], row["height"], motion.frames) == ("2.000000000", "1.600", int(row["frames"]))
        own, given = tracks.rows(int(row["id"])), source.rows(int(row["id"]))
        pelvis = motion.root_positions[:, [0, 2]]
        assert np.linalg.norm(pelvis - tracks.positions[own], axis=-1).max() < 0.15
        at = np.stack([np.interp(source.times[given], tracks.times[own], pelvis[:, k]) for k in (0, 1)], axis=-1)
        assert np.linalg.norm(at - source.positions[given], axis=-1).mean() < 0.1
        ahead = ground.heading(np.diff(source.positions[given], axis=0)[10])
        assert tracks.headings[own][66] == pytest.approx(float(ahead), abs=0.2)


def test_tracks_alone_and_the_report(walks, database, tmp_path):
    out = tmp_path / "out.csv"
    told = json.loads(call("dress", walks, "--database", database, "-o", out, "--json").stdout)
    assert told["people"] == len(told["each"]) == 10
    assert (told["samples"], told["frames"]) == (300, 10 * 175)
    assert told["mean_distance"] == pytest.approx(np.mean([one["mean_distance"] for one in told["each"]]))
    assert list(told["beyond"]) == ["speed", "tangential", "lateral", "jerk"]
    assert [one["file"] for one in told["each"]] == [None] * 10
    assert len(load_trajectories(out)) == told["frames"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv", "walks.csv"]


def test_options_reach_the_reader(database, tmp_path):
    path, out = tmp_path / "walk.txt", tmp_path / "out.csv"
    path.write_text("".join(f"{n} 4 {12 * n} 0\n" for n in range(40)))  # frame id x y, centimetres
    more = ["--format", "eth", "--input-rate", 10, "--unit", "cm", "--rate", 60, "--noise", 0.01]
    told = json.loads(call("dress", path, "--database", database, "-o", out, "--json", *more).stdout)
    assert (told["frame_rate"], told["frames"], told["noise"]) == (60.0, 235, 0.01)
    found = load_trajectories(out)
    assert found.positions[-1] == pytest.approx((0.12 * 39, 0.0), abs=0.1)


def test_what_is_impossible_is_named(database, tmp_path):
    path, out = tmp_path / "jump.csv", tmp_path / "out.csv"
    path.write_text("id,time,x,y\n" + "".join(f"5,{0.1 * n:.1f},{0.12 * n + 3 * (n > 30):.2f},0\n" for n in range(60)))
    said = call("dress", path, "--database", database, "-o", out).stdout
    assert "at which no person could do what the source does" in said
    assert "most of person 5 (" in said


def test_bad_requests_are_refused(walks, database, tmp_path):
    out, bad = tmp_path / "out.bvh", tmp_path / "bad.csv"
    for content, says in [
        ("id,time,x,y\n1,0,0,0\n1,0.1,zero,0\n", "bad.csv:3: column 'x'"),
        ("id,time,x,y\n1,0,0,0\n1,0,1,0\n", "bad.csv:3: person 1 is in two places at once"),
        ("id,time,x\n1,0,0\n", "the header lacks y"),
        ("id,time,x,y\n1,0,0,0\n1,9,1,0\n", "seen every 9 s only"),
        ("HIERARCHY\n", "a BVH recording"),
    ]:
        bad.write_text(content)
        assert says in refused("dress", bad, "--database", database, "-o", out), content
    for arguments, says in [
        ([tmp_path / "none.csv", "-o", out], "none.csv: cannot be read"),
        ([walks, "-o", tmp_path / "out.fbx"], "a crowd is written as"),
        ([walks, "-o", tmp_path / "none" / "out.bvh"], "no such folder"),
        ([walks, "-o", walks], "would be overwritten"),
        ([walks, "-o", tmp_path / "walks.bvh"], "would be overwritten"),
        ([walks, "-o", out, "--format", "fbx"], "no format 'fbx'"),
        ([walks, "-o", out, "--unit", "inch"], "no unit 'inch'"),
        ([walks, "-o", out, "--height", 20], "0.5 to 2.5 m tall"),
        ([walks, "-o", out, "--noise", -1], "noise must lie"),
        ([walks, "-o", out, "--rate", 1000], "between 10 and 240 Hz"),
        ([walks, "-o", out, "--threads", 0], "at least 1 thread"),
    ]:
        assert says in refused("dress", *arguments, "--database", database), arguments
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.csv", "walks.csv"]
