from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from stridecast.cli.main import app
from stridecast.database.mining import mine
from stridecast.formats import files
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import save_database


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
    assert result.stderr.startswith("error: ")
    return result.stderr.removeprefix("error: ").strip()


@pytest.fixture(scope="module")
def database(formula_database, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("mining") / "walk.safetensors"
    save_database(formula_database, path)
    return path


def test_a_table_tells_what_a_clip_is_made_of(formula_database, database):
    text = call("mine", database, "--status", "walk", "--speed", "1.25", "--turn", "0.2").stdout
    mined = mine(formula_database, status="walk", speed=1.25, turn=0.2)
    for word in ("weight", "take", "person", "speed, m/s", "turn, rad/s", "style", mined.clips[0].take):
        assert word in text
    assert f"{100 * mined.clips[0].weight:.1f} %" in text
    assert f"walk at {mined.speed:.2f} m/s" in text


def test_the_clip_is_written(formula_database, database, tmp_path):
    out = tmp_path / "clip.bvh"
    result = call("mine", database, "--status", "walk", "--speed", "1.25", "--cycles", 3, "-o", out)
    assert result.exit_code == 0
    assert str(out) in result.stdout.replace("\n", "")
    written, mined = load_motion(out), mine(formula_database, status="walk", speed=1.25, cycles=3)
    assert written.frames == mined.motion.frames
    np.testing.assert_allclose(written.root_positions, mined.motion.root_positions, atol=1e-5)


def test_json_tells_all(formula_database, database, tmp_path):
    out = tmp_path / "clip.bvh"
    wish = ["--status", "walk", "--speed", "1.0:1.4", "--where", "mirrored = 0", "--seconds", 2]
    content = json.loads(call("mine", database, *wish, "-o", out, "--json").stdout)
    mined = mine(formula_database, status="walk", speed=(1.0, 1.4), where="mirrored = 0", seconds=2.0)
    assert content["status"] == "walk"
    assert content["speed"] == mined.speed
    assert content["seconds"] == pytest.approx(2.0)
    assert content["output"] == str(out)
    assert content["warnings"] == []
    assert sum(clip["weight"] for clip in content["clips"]) == pytest.approx(1.0)
    assert not any(clip["mirrored"] for clip in content["clips"])
    assert {"take", "subject", "status", "speed", "turn", "style", "weight"} <= set(content["clips"][0])


def test_numbers_ranges_lists_and_words(database):
    def told(*wish: object) -> dict[str, object]:
        return json.loads(call("mine", database, *wish, "--json").stdout)

    assert told("--speed", "3.0")["status"] == "run"
    assert told("--speed", "0")["status"] == "stand"
    assert told("--status", "run,walk", "--speed", "1.2")["status"] == "walk"
    assert told("--status", "walk", "--speed", "9,1.3")["speed"] == pytest.approx(1.3, abs=0.05)
    assert told("--status", "walk", "--style", "neutral")["recorded"]
    assert told("--status", "walk", "--style", "-0.1:0.1")["status"] == "walk"
    assert told("--subject", "02", "--status", "run")["clips"][0]["subject"] == "02"
    assert told("--status", "stand-walk")["cycle"] == 0.0


def test_what_nobody_showed_is_told(database):
    result = call("mine", database, "--status", "walk", "--speed", 4)
    assert result.exit_code == 0
    assert result.stderr.startswith("note: speed 4.00 m/s is out of reach of walk; recorded is")
    content = json.loads(call("mine", database, "--status", "walk", "--speed", 4, "--json", "--quiet").stdout)
    assert "speed 4.00 m/s is out of reach" in content["warnings"][0]
    assert call("mine", database, "--status", "walk", "--speed", 4, "--quiet").output == ""


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--status", "hop"], "no status 'hop'; there are stand, walk, run"),
        (
            ["--speed", "fast"],
            "--speed must be a number, a range such as 1.2:1.5 or a list such as 1.2,1.4, not 'fast'",
        ),
        (["--speed", "1:x"], "--speed must be a number"),
        (["--speed", "nan"], "speed must be finite numbers"),
        (["--style", "merry"], "the words are gloomy, neutral, brisk"),
        (["--style", "1;2"], "or gloomy, neutral, brisk, not '1;2'"),
        (["--where", "pace > 1"], "no column 'pace'; there are take, subject"),
        (["--where", "__import__('os')"], "condition \"__import__('os')\", letter 1: there is no column"),
        (["--subject", "99"], "no subject '99' in the database; there are 01, 02"),
        (["--cycles", 2, "--seconds", 3], "cycles or seconds, not both"),
        (["--cycles", 0], "cycles must lie between 1 and"),
        (["-o", "clip.fbx"], "clip.fbx: motion is written as *.bvh"),
        (["-o", "none/clip.bvh"], "no such folder"),
    ],
)
def test_wrong_wishes_end_with_status_2(database, arguments, says):
    assert says in refused("mine", database, *arguments)


def test_a_file_that_is_no_database_is_refused(tmp_path):
    assert "no such file" in refused("mine", tmp_path / "none.safetensors", "--speed", 1)


def test_a_full_disk_leaves_the_old_clip(database, tmp_path, monkeypatch):
    out = tmp_path / "clip.bvh"
    out.write_text("old")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    assert "No space left" in refused("mine", database, "--speed", 1.2, "-o", out)
    assert out.read_text() == "old"


def test_show_tells_styles_and_cycles(formula_database, database):
    text = call("show", database).stdout
    assert "style of examples" in text
    assert "cycles in" in text
    content = json.loads(call("show", database, "--json").stdout)
    assert list(content)[:5] == ["frame_rate", "takes", "seconds", "groups", "left_out"]
    for motion, counts in content["styles"].items():
        assert list(counts) == ["gloomy", "neutral", "brisk"]
        known = sum(group.count for group in formula_database.groups if group.motion == motion)
        assert sum(counts.values()) == known
    assert [row["take"] for row in content["annotations"]] == [take.name for take in formula_database.takes]
    assert content["annotations"][0]["statuses"][0] == "stand"
    assert content["annotations"][1]["cycle"] > 0.5
