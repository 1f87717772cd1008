from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from typer.testing import CliRunner

from stridecast.cli.main import app
from stridecast.errors import FileError
from stridecast.model.trajectories import Trajectories
from tracked import crowd, straight

SCENE = """
start: [0, 0]
goals: [[0, 4.8]]
obstacles:
  - {name: tree, center: [1.5, 2.4], radius: 0.4}
behavior: {velocity: 1.2, body_radius: 0.2}
"""


def call(*arguments: object):
    """Run the command in this process; nothing but ``typer.Exit`` may come out of it."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exc_info
    return result


def refused(*arguments: object) -> str:
    result = call(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    return result.stderr.removeprefix("error: ").strip()


@pytest.fixture
def walked(monkeypatch) -> Trajectories:
    """What any CSV holds: one who goes through a tree's side and two who overlap."""
    content = crowd(
        straight((0, 0), (0, 1.2), 4.0), straight((0.98, 0), (0, 1.2), 4.0), straight((1.4, 0.0), (0, 1.2), 4.0)
    )

    def load(path, *, frame_rate=None, unit=None, format=None):
        if not Path(path).exists():
            raise FileError("there is no such file", path=path)
        return content

    door = ModuleType("stridecast.formats.trajectories")
    door.load_trajectories = load
    monkeypatch.setitem(sys.modules, "stridecast.formats.trajectories", door)
    return content


@pytest.fixture
def file(tmp_path) -> Path:
    path = tmp_path / "walked.csv"
    path.write_text("id,time,x,y\n")
    return path


def test_a_table_tells_of_a_crowd(walked, file):
    text = call("score", file, "--bounds", "60,4,3,1.8,1.0").stdout
    for words in (
        "3 for 4.0 s at 30 Hz (363 samples)",
        "pairs: 1, in 121 frames; deepest 1 and 2 8.0 cm at",
        "no goals known",
        "beyond the bounds: speed",
        "360 (100.00 %) of 3 people, up to 1.20 times",
    ):
        assert words in text


def test_a_scene_has_walls_and_people(walked, file, tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE)
    (content,) = json.loads(call("score", file, "--scene", scene, "--json").stdout)["files"]
    assert content["file"] == str(file)
    assert (content["goals_known"], content["arrived"]) == (1, 1)
    assert content["time_against_alone"]["people"] == 1
    assert {o["other"] for o in content["solid_overlaps"]["each"]} == {"tree"}
    assert content["violations"] is None
    wide = json.loads(call("score", file, "--radius", "0.6", "--json").stdout)["files"][0]
    assert wide["overlaps"]["pairs"] == 2


def test_sampled_anew(walked, file):
    (content,) = json.loads(call("score", file, "--rate", "10", "--speed", "1.2", "--json").stdout)["files"]
    assert content["frame_rate"] == pytest.approx(10)
    assert content["time_against_alone"]["median"] == pytest.approx(1.0)


def test_motions_and_trajectories_in_one_call(walked, file, mocap):
    take = mocap / "cmu" / "16" / "16_35.amc"
    one, other = json.loads(call("score", file, take, "--json").stdout)["files"]
    assert one["people"] == 3
    assert other["file"] == str(take)
    assert other["foot_skate"]["contacts"] >= 2
    assert np.isfinite(other["foot_skate"]["weighted"])
    text = call("score", take).stdout
    for words in ("planted toes travel", "knees bend", "angular acceleration of joints"):
        assert words in text


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--radius", "0"), "--radius must be above 0, not 0"),
        (("--speed", "-1"), "--speed must be above 0, not -1"),
        (("--rate", "inf"), "--rate must be above 0, not inf"),
        (("--input-rate", "nan"), "--input-rate must be above 0, not nan"),
        (("--bounds", "1,2,3"), "--bounds must be sample, a database, or five numbers"),
        (("--bounds", "1,2,3,4,fast"), "--bounds must be sample, a database, or five numbers"),
        (("--bounds", "0,4,3,1,2"), "jerk must be above 0"),
        (("--scene", "nowhere.yaml"), "nowhere.yaml"),
    ],
)
def test_wrong_wishes_are_refused(walked, file, arguments, says):
    assert says in refused("score", file, *arguments)


def test_files_that_are_none_are_refused(walked, file, tmp_path):
    assert "absent.csv" in refused("score", file, tmp_path / "absent.csv")
    broken = tmp_path / "broken.bvh"
    broken.write_text("HIERARCHY\nROOT\n")
    assert "broken.bvh" in refused("score", broken)
    assert call("score").exit_code == 2
