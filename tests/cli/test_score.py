from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from stridecast.cli.main import app
from stridecast.formats.trajectories import save_trajectories
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
def file(tmp_path) -> Path:
    """One who goes through a tree's side and two who overlap."""
    path = tmp_path / "walked.csv"
    content = crowd(
        straight((0, 0), (0, 1.2), 4.0), straight((0.98, 0), (0, 1.2), 4.0), straight((1.4, 0.0), (0, 1.2), 4.0)
    )
    save_trajectories(path, content)
    return path


def test_a_table_tells_of_a_crowd(file):
    text = call("score", file, "--bounds", "60,4,3,1.8,1.0").stdout
    for words in (
        "3 for 4.0 s at 30 Hz (363 samples)",
        "pairs: 1, in 121 frames; deepest 1 and 2 8.0 cm at",
        "no goals known",
        "beyond the bounds: speed",
        "360 (100.00 %) of 3 people, up to 1.20 times",
    ):
        assert words in text


def test_a_scene_has_walls_and_people(file, tmp_path):
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


def test_moving_obstacles_are_where_they_were(tmp_path):
    scene = tmp_path / "cart.yaml"
    scene.write_text("""
people: [{name: Ann, start: [3, 0]}]
movers:
  - {name: cart, radius: 0.5, times: [0, 3, 9], points: [[0, 0], [3, 0], [9, 0]]}
seconds: 6
""")
    out = tmp_path / "out.csv"
    call("crowd", scene, "-o", out, "--quiet")
    (content,) = json.loads(call("score", out, "--scene", scene, "--json").stdout)["files"]
    assert content["solid_overlaps"]["pairs"] == 0  # it waits before her
    beside = tmp_path / "out.movers.csv"
    lines = beside.read_text().splitlines()
    assert lines[0] == "id,time,x,y"
    assert float(lines[-1].split(",")[2]) < 3.0 - 0.5 - 0.2
    beside.write_text("\n".join([*lines, "2,0.0,0.0,0.0"]))
    assert "tells of 2 moving obstacles, the scene of 1" in refused("score", out, "--scene", scene)
    beside.unlink()
    (content,) = json.loads(call("score", out, "--scene", scene, "--json").stdout)["files"]
    assert {o["other"] for o in content["solid_overlaps"]["each"]} == {"cart"}  # by the scene it runs over her


def test_sampled_anew(file):
    (content,) = json.loads(call("score", file, "--rate", "10", "--speed", "1.2", "--json").stdout)["files"]
    assert content["frame_rate"] == pytest.approx(10)
    assert content["time_against_alone"]["median"] == pytest.approx(1.0)


def test_motions_and_trajectories_in_one_call(file, mocap):
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
def test_wrong_wishes_are_refused(file, arguments, says):
    assert says in refused("score", file, *arguments)


def test_files_that_are_none_are_refused(file, tmp_path):
    assert "absent.csv" in refused("score", file, tmp_path / "absent.csv")
    broken = tmp_path / "broken.bvh"
    broken.write_text("HIERARCHY\nROOT\n")
    assert "broken.bvh" in refused("score", broken)
    assert call("score").exit_code == 2
