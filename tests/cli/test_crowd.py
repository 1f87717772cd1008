from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from stridecast.cli.main import app
from stridecast.formats import crowd_files
from stridecast.formats.crowd_bodies import BvhBodies
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import save_database
from stridecast.formats.trajectories import load_trajectories

COMMAND = [sys.executable, "-c", "from stridecast.cli.main import main; main()"]

PAIR = """
seed: 4
people:
  - {name: Ann, start: [0, 0], goals: [[0, 5]], height: 1.5}
  - {name: ../ann, start: [0.1, 5], goals: [[0, 0]], begins: 0.5}
"""

ALL_DAY = """
seconds: 3000
people:
  - {name: quick, start: [0, 0], goals: [[0, 0.6]]}
sources:
  - {name: gate, start: [[-20, -2], [-20, 2]], goals: [[[400, 2], [400, -2]]], flow: 1, most: 20}
"""


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
    path = tmp_path_factory.mktemp("database") / "crowd.safetensors"
    save_database(formula_database, path)
    return path


@pytest.fixture
def scene(tmp_path) -> Path:
    path = tmp_path / "pair.yaml"
    path.write_text(PAIR)
    return path


def test_places_of_everybody(scene, database, tmp_path):
    out = tmp_path / "out.csv"
    result = call("crowd", scene, "--database", database, "-o", out)
    assert result.exit_code == 0, result.output
    assert "2 people came, 2 arrived, 0 still there; 2 at once at most, 0 overlaps" in result.stdout
    assert out.read_text().startswith("id,time,x,y,heading,speed\n1,0.033333333,0.00000000,0.00000000,-1.57")
    found = load_trajectories(out)
    assert found.people.tolist() == [1, 2]
    first, second = found.rows(1), found.rows(2)
    assert np.allclose(found.positions[first][-1], (0, 5), atol=0.6)
    assert found.times[second][0] == pytest.approx(0.5, abs=0.04)
    assert found.headings[first][0] == pytest.approx(0.0, abs=1e-5)
    speeds = np.linalg.norm(np.diff(found.positions[first], axis=0), axis=-1) * 30
    assert np.allclose(speeds, found.speeds[first][1:], atol=2e-5)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv", "pair.yaml"]


def test_same_seed_same_file_whatever_the_threads(scene, database, tmp_path):
    files = [tmp_path / f"{k}.csv" for k in range(3)]
    for path, more in zip(files, ([], ["--threads", 2], ["--seed", 9]), strict=True):
        assert call("crowd", scene, "--database", database, "-o", path, "-q", *more).output == ""
    assert files[0].read_bytes() == files[1].read_bytes()
    with files[2].open() as file:
        assert len(file.readlines()) > 100


def test_a_motion_for_each_with_an_index(scene, database, tmp_path):
    out = tmp_path / "out.bvh"
    told = json.loads(call("crowd", scene, "--database", database, "-o", out, "--json").stdout)
    assert (told["came"], told["arrived"], told["there"], told["overlaps"]) == (2, 2, 0, 0)
    assert told["done"] is True
    assert told["motions"] == [str(tmp_path / "out.Ann.bvh"), str(tmp_path / "out.ann.2.bvh")]
    assert told["output"] == [str(tmp_path / "out.csv"), str(tmp_path / "out.people.csv")]
    with (tmp_path / "out.people.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert next((row["id"], row["name"], row["height"]) for row in rows) == ("1", "Ann", "1.500")
    places = load_trajectories(tmp_path / "out.csv")
    for row in rows:
        motion = load_motion(tmp_path / row["file"])
        own = places.rows(int(row["id"]))
        assert motion.frames == int(row["frames"]) == own.stop - own.start
        assert float(row["start"]) == pytest.approx(places.times[own][0], abs=1e-8)
        away = np.linalg.norm(motion.root_positions[:, [0, 2]] - places.positions[own], axis=-1)
        assert away.max() < 0.15
    assert not list(tmp_path.glob("*.part*"))


def test_parquet(scene, database, tmp_path):
    pytest.importorskip("pyarrow")
    for name in ("out.csv", "out.parquet"):
        call("crowd", scene, "--database", database, "-o", tmp_path / name, "-q")
    one, other = load_trajectories(tmp_path / "out.csv"), load_trajectories(tmp_path / "out.parquet")
    for column in ("ids", "times", "positions", "headings", "speeds"):
        assert np.array_equal(getattr(one, column), getattr(other, column))
    assert not list(tmp_path.glob("*.part*"))


def test_options_reach_the_crowd(scene, database, tmp_path):
    out = tmp_path / "out.csv"
    told = json.loads(
        call("crowd", scene, "--database", database, "-o", out, "--json", "--rate", 60, "--seconds", 1).stdout
    )
    assert (told["frame_rate"], told["frames"], told["seconds"], told["there"]) == (60.0, 60, 1.0, 2)
    assert told["done"] is False


def test_a_crowd_that_cannot_be_is_refused(scene, database, tmp_path):
    out = tmp_path / "out.csv"
    bad = tmp_path / "bad.yaml"
    for content, says in [
        ("obstacles: [{name: tree, center: [0, 3], radius: 0.4}]\n", "start: is missing"),
        ("people: [{name: ann, start: [0, 0]}]\n", "nobody in the scene goes anywhere"),
        (
            "walls: [{name: cell, points: [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]}]\n"
            "people: [{name: ann, start: [0, 0], goals: [[0, 9]]}]\n",
            "person 'ann'",
        ),
        (
            "people: [{name: ann, start: [0, 0], goals: [[0, 9]]}, {name: ben, start: [0, 0.1], goals: [[0, 9]]}]\n",
            "ben",
        ),
        ("people: [{name: ann, start: [0, 0], golas: [[0, 9]]}]\n", "bad.yaml:1"),
    ]:
        bad.write_text(content)
        assert says in refused("crowd", bad, "--database", database, "-o", out), content
    for arguments, says in [
        ([tmp_path / "none.yaml", "-o", out], "none.yaml"),
        ([scene, "-o", tmp_path / "out.fbx"], "a crowd is written as *.csv, *.parquet, *.bvh"),
        ([scene, "-o", tmp_path / "none" / "out.csv"], "no such folder"),
        ([scene, "-o", out, "--seconds", 0], "seconds must lie above 0"),
        ([scene, "-o", out, "--rate", 1], "between 10 and 240 Hz"),
        ([scene, "-o", out, "--threads", 0], "at least 1 thread"),
        ([scene, "-o", out, "--seed", -1], "--seed must be"),
    ]:
        assert says in refused("crowd", *arguments, "--database", database), arguments
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.yaml", "pair.yaml"]


def test_names_of_files_are_safe_and_differ(tmp_path):
    files = BvhBodies(tmp_path / "out.bvh")
    names = ("Ann", "ann", "a/b", "..", "people", "", "Ö", "x" * 300, "x" * 300, "ann.2", "con")
    got = [files.place_of(k, name).name for k, name in enumerate(names)]
    assert len({name.casefold() for name in got}) == len(names)
    assert all(len(name) < 120 and "/" not in name and name.startswith("out.") for name in got)


def test_a_full_disk_is_told_and_keeps_what_was_written(scene, database, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(crowd_files.Path, "replace", full)
    result = call("crowd", scene, "--database", database, "-o", tmp_path / "out.csv", "-q")
    assert result.exit_code == 2
    assert "No space left on device" in result.stderr
    assert "what was written so far stays in" in result.stderr
    assert load_trajectories(tmp_path / "out.part.csv").people.tolist() == [1, 2]


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(("sign", "status"), [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_a_bake_that_is_stopped_leaves_what_it_has(database, tmp_path, sign, status):
    scene, out, part = tmp_path / "day.yaml", tmp_path / "out.bvh", tmp_path / "out.part.csv"
    scene.write_text(ALL_DAY)
    (tmp_path / "out.csv").write_text("old\n")
    command = [*COMMAND, "crowd", str(scene), "--database", str(database), "-o", str(out)]
    bake = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 120
    while time.monotonic() < until and not (part.is_file() and part.stat().st_size > 20_000):
        time.sleep(0.1)
        assert bake.poll() is None, bake.communicate()
    bake.send_signal(sign)
    stdout, stderr = bake.communicate(timeout=60)
    assert bake.returncode == status, stderr
    assert stdout == ""
    assert "Traceback" not in stderr
    found = load_trajectories(part)  # whole rows only
    assert len(found) > 200
    assert found.times.max() > 2.0
    assert (tmp_path / "out.csv").read_text() == "old\n"
    quick = load_motion(tmp_path / "out.quick.bvh")  # has left and is whole
    assert quick.frames == found.rows(1).stop
    if sign == signal.SIGINT:
        assert "out.part.csv" in stderr
        assert "out.quick.bvh" in stderr
        with (tmp_path / "out.people.part.csv").open(newline="") as file:
            assert [row["file"] for row in csv.DictReader(file)] == ["out.quick.bvh"]
