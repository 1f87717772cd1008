"""``stridecast samples``, and the commands that take the sample database where none is named."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from corpora import PIECES, FakeCorpus
from stridecast.cli.main import app
from stridecast.formats import files
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import load_database, save_database
from stridecast.samples import library
from stridecast.samples.truth import COLUMNS


def call(*arguments: object):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exc_info
    return result


def refused(*arguments: object) -> str:
    result = call(*arguments)
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    assert result.stderr.startswith("error: ")
    return result.stderr.removeprefix("error: ").strip()


@pytest.fixture(autouse=True)
def corpus(monkeypatch, tmp_path) -> FakeCorpus:
    """The small corpus, and no database kept of it."""
    corpus = FakeCorpus()
    monkeypatch.setitem(sys.modules, corpus.__name__, corpus)
    monkeypatch.setattr(library, "_known", {})
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return corpus


@pytest.fixture
def out(tmp_path) -> Path:
    return tmp_path / "deeper" / "takes"


# samples


def test_takes_are_written_each_with_what_is_true_of_it(corpus, out):
    result = call("samples", "-o", out)
    assert result.exit_code == 0
    assert result.stdout.replace("\n", "").endswith(f"3 takes (6 s) as BVH, each with what is true of it: {out}")
    assert sorted(path.name for path in out.iterdir()) == sorted(
        f"{name}{suffix}" for name in PIECES for suffix in (".bvh", ".truth.csv")
    )
    for take in corpus.sample_takes():
        motion = load_motion(out / f"{take.motion.name}.bvh")
        assert motion.frame_rate == pytest.approx(60.0)
        assert np.allclose(motion.root_positions, take.motion.root_positions, atol=1e-6)
        with (out / f"{take.motion.name}.truth.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == motion.frames
        assert tuple(rows[0]) == COLUMNS
        table = {name: np.array([float(row[name]) for row in rows]) for name in COLUMNS}
        assert np.array_equal(table["frame"], np.arange(motion.frames))
        assert np.array_equal(table["time"], np.arange(motion.frames) / 60.0)
        assert np.array_equal(np.column_stack((table["x"], table["z"])), take.positions)
        for column, truth in (("heading", take.headings), ("speed", take.speeds), ("phase", take.phases)):
            assert np.array_equal(table[column], truth)
        assert np.array_equal(np.column_stack((table["left_planted"], table["right_planted"])), take.planted)


def test_what_is_written_can_be_built_from(out, tmp_path):
    assert call("samples", "-o", out, "--style", "neutral", "-q").output == ""
    path = tmp_path / "new.safetensors"
    assert call("build", out, "-o", path, "--jobs", 1, "--no-cache", "-q").exit_code == 0
    assert sorted(take.name for take in load_database(path).takes if take.segments) == ["start", "walk"]


def test_one_style_can_be_asked_for_and_json(out):
    content = json.loads(call("samples", "-o", out, "--style", "gloomy", "--json").stdout)
    assert content["output"] == str(out)
    (take,) = content["takes"]
    assert (take["name"], take["style"]) == ("trudge", "gloomy")
    assert take["seconds"] == pytest.approx((take["frames"] - 1) / 60)
    assert {Path(take["bvh"]), Path(take["truth"])} == set(out.iterdir())


def test_a_style_that_is_none_is_refused_and_nothing_made(out):
    assert refused("samples", "-o", out, "--style", "merry") == "there is no style 'merry'; there are gloomy, neutral"
    assert not out.parent.exists()


def test_a_folder_that_is_there_keeps_what_else_it_holds(out):
    out.mkdir(parents=True)
    (out / "mine.txt").write_text("mine")
    (out / "walk.bvh").write_text("old")
    assert call("samples", "-o", out).exit_code == 0
    assert (out / "mine.txt").read_text() == "mine"
    assert load_motion(out / "walk.bvh").frames > 60


def test_places_that_are_no_folder_are_refused_before_the_work(corpus, out, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file" / "deeper"):
        assert refused("samples", "-o", place) == f"{tmp_path / 'file'}: is a file; name a folder to write the takes to"

    def forbidden(*_, **__):
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patched:
        patched.setattr("tempfile.TemporaryFile", forbidden)
        said = refused("samples", "-o", out)
        assert said == f"{tmp_path}: no take can be written there: Permission denied"
    with monkeypatch.context() as patched:
        patched.setattr(Path, "exists", forbidden)
        assert refused("samples", "-o", out) == f"{out}: no take can be written there: Permission denied"
    assert corpus.made == 0
    monkeypatch.setattr(Path, "mkdir", forbidden)
    assert refused("samples", "-o", out) == f"{out}: the folder cannot be made: Permission denied"


def test_take_and_truth_are_written_both_or_neither(out, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    assert refused("samples", "-o", out).endswith("walk.bvh: cannot be written: No space left on device")
    assert list(out.iterdir()) == []


# the sample database in other commands


def test_the_sample_database_is_shown_where_none_is_named(corpus):
    content = json.loads(call("show", "--json").stdout)
    assert (content["takes"], content["subjects"]) == (3, ["sample"])
    assert "3 takes used" in call("show").stdout
    assert corpus.made == 1


def test_the_sample_database_walks_where_none_is_named(formula_database, tmp_path, monkeypatch):
    monkeypatch.setattr(library, "_learn", lambda progress: formula_database)
    path, out = tmp_path / "named.safetensors", tmp_path / "out.bvh"
    save_database(formula_database, path)
    left_out = call("walk", "--curve", "line:1", "-o", out, "--json")
    named = call("walk", path, "--curve", "line:1", "-o", out, "--json")
    assert left_out.exit_code == named.exit_code == 0
    assert left_out.stdout == named.stdout
    assert call("walk", "--curve", "line:1", "-o", out, "-q").output == ""


def test_a_wrong_walk_is_refused_before_the_sample_database_is_made(corpus, tmp_path):
    assert "no motion 'hop'" in refused("walk", "--curve", "line", "--motion", "hop", "-o", tmp_path / "out.bvh")
    assert "no such folder" in refused("walk", "--curve", "line", "-o", tmp_path / "none" / "out.bvh")
    assert corpus.made == 0


def test_what_is_wrong_with_the_cache_is_a_note(tmp_path):
    (tmp_path / "home").write_text("a file, not a folder")
    result = call("show", "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["takes"] == 3
    assert result.stderr.startswith("note: the sample database is made anew by each process, as it cannot be kept: ")


def test_help_says_what_is_taken_where_no_database_is_named():
    for command in ("show", "walk"):
        text = call(command, "--help").output
        assert "[DB]" in text
        assert "the sample database if left out" in text
    assert "--style" in call("samples", "--help").output


def test_help_of_samples_loads_nothing_heavy():
    code = (
        "import sys\n"
        "from stridecast.cli.main import app\n"
        "app(['samples', '--help'], standalone_mode=False)\n"
        "print(sorted({'numpy', 'scipy', 'numba', 'safetensors', 'filelock'} & set(sys.modules)), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=30)
    assert done.stderr == "[]\n"
