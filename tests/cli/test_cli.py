from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from stridecast import __version__
from stridecast.cli.main import app
from stridecast.formats import files
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import load_database, save_database

COMMAND = [sys.executable, "-c", "from stridecast.cli.main import main; main()"]
POSIX = pytest.mark.skipif(os.name != "posix", reason="signals and limits of POSIX")


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
    assert result.stderr.endswith("\n")
    assert "Traceback" not in result.stderr
    return result.stderr.removeprefix("error: ").strip()


@pytest.fixture
def database(formula_database, tmp_path) -> Path:
    path = tmp_path / "walk.safetensors"
    save_database(formula_database, path)
    return path


@pytest.fixture
def points(tmp_path) -> Path:
    path = tmp_path / "points.csv"
    rows = [f"{0.1 * n:.1f},0,{0.12 * max(n - 5, 0):.2f},{'stand' if n < 5 else 'walk'}" for n in range(30)]
    path.write_text("time,x,z,motion\n" + "\n".join(rows) + "\n")
    return path


# help


def test_help_and_version():
    for arguments in ([], ["--help"], ["build", "-h"], ["show", "--help"], ["walk", "--help"]):
        assert "Usage" in call(*arguments).output
    assert call("--version").output == f"stridecast {__version__}\n"
    for option in (
        "--rate",
        "--skeleton",
        "--scale",
        "--input-rate",
        "--no-mirror",
        "--bounds",
        "--jobs",
        "--no-cache",
    ):
        assert option in call("build", "--help").output


def test_help_comes_at_once_and_loads_nothing_heavy():
    code = (
        "import sys\n"
        "from stridecast.cli.main import app\n"
        "app(['--help'], standalone_mode=False)\n"
        "print(sorted({'numpy', 'scipy', 'numba', 'safetensors'} & set(sys.modules)), file=sys.stderr)\n"
    )
    began = time.monotonic()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=30)
    assert time.monotonic() - began < 2.0
    assert done.stderr == "[]\n"
    assert "walk" in done.stdout


@pytest.mark.parametrize("arguments", [["fly"], ["build"], ["walk", "x"], ["build", "x", "--rate", "fast"], ["--loud"]])
def test_wrong_use_ends_with_status_2(arguments):
    assert call(*arguments).exit_code == 2


# build


def test_recordings_become_a_file(formula_takes, formula_database, tmp_path):
    path = tmp_path / "new.safetensors"
    result = call("build", formula_takes, "-o", path, "--jobs", 1, "--no-cache")
    assert result.exit_code == 0
    assert "3 takes used" in result.stdout
    assert load_database(path).groups == formula_database.groups


def test_options_reach_the_build(formula_takes, tmp_path):
    path = tmp_path / "new.safetensors"
    options = ["--rate", 60, "--no-mirror", "--bounds", "paper", "--jobs", 1, "--no-cache", "--quiet"]
    result = call("build", formula_takes / "01_02.bvh", "-o", path, *options)
    assert (result.exit_code, result.output) == (0, "")
    database = load_database(path)
    assert (database.frame_rate, database.bounds_method) == (60.0, "paper")
    assert not database.examples.mirrored.any()


def test_the_summary_of_a_build_is_json_if_asked(formula_takes, tmp_path):
    shutil.copy(formula_takes / "01_02.bvh", tmp_path)
    (tmp_path / "bad.bvh").write_text("rubbish")
    path = tmp_path / "new.safetensors"
    result = call("build", tmp_path, "-o", path, "--jobs", 1, "--no-cache", "--json")
    content = json.loads(result.stdout)
    assert content["output"] == str(path)
    assert content["takes"] == 1
    assert content["left_out"] == [{"file": str(tmp_path / "bad.bvh"), "reason": content["left_out"][0]["reason"]}]
    assert "is no BVH" in content["left_out"][0]["reason"]


def test_a_build_that_cannot_be_is_refused(formula_takes, tmp_path):
    new = tmp_path / "new.safetensors"
    assert "none: there is no such file or folder" in refused("build", tmp_path / "none", "-o", new)
    assert "holds no recording" in refused("build", tmp_path, "-o", new)
    assert "a motion database is a *.safetensors file" in refused("build", formula_takes, "-o", tmp_path / "new.bvh")
    assert "no such folder" in refused("build", formula_takes, "-o", tmp_path / "none" / "new.safetensors")
    assert "'tight'" in refused("build", formula_takes, "-o", new, "--bounds", "tight")
    assert "at least 1 job" in refused("build", formula_takes, "-o", new, "--jobs", 0)
    assert "cannot be read" in refused("build", formula_takes, "-o", new, "--skeleton", tmp_path / "none.asf")
    (tmp_path / "bad.bvh").write_text("rubbish")
    assert "bad.bvh: is no BVH" in refused("build", tmp_path, "-o", new, "--jobs", 1, "--no-cache")
    assert [path.name for path in tmp_path.iterdir()] == ["bad.bvh"]


def test_a_place_that_cannot_be_written_is_refused_before_the_work(formula_takes, tmp_path, monkeypatch):
    def forbidden(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "touch", forbidden)
    said = refused("build", formula_takes, "-o", tmp_path / "new.safetensors")
    assert said.endswith("new.safetensors: cannot be written: Permission denied")


# show


def test_everything_about_a_database_is_shown(formula_database, database):
    text = call("show", database).stdout
    for group in formula_database.groups:
        assert group.name in text
    for subject in formula_database.subjects:
        assert f"│ {subject} " in text
    assert "radius" in text
    assert "m/s" in text
    assert "RDL at" in text  # left out of a take that is used


def test_json_keeps_its_promise(formula_database, database):
    content = json.loads(call("show", database, "--json").stdout)
    assert list(content)[:5] == ["frame_rate", "takes", "seconds", "groups", "left_out"]
    assert content["frame_rate"] == 30.0
    assert content["takes"] == 3
    assert content["seconds"] == pytest.approx(sum(take.seconds for take in formula_database.takes))
    for shown, group in zip(content["groups"], formula_database.groups, strict=True):
        assert list(shown) == ["name", "string", "motion", "segments", "bounds"]
        assert list(shown["bounds"]) == ["jerk", "tangential", "lateral_per_speed", "speed"]
        assert (shown["name"], shown["string"], shown["motion"]) == (group.name, group.string, group.motion)
        assert shown["segments"] == group.count
        assert shown["bounds"]["tangential"] == list(group.bounds.tangential_hull)
        assert shown["bounds"]["speed"] == [list(pair) for pair in group.bounds.speed]
    assert all(list(row) == ["file", "reason"] for row in content["left_out"])
    moving = sum(group.count for group in formula_database.groups if group.motion != "stand")
    assert np.sum(content["coverage"]["examples"]) == moving


def test_files_that_are_no_database_are_refused(database, tmp_path):
    assert "no such file" in refused("show", tmp_path / "none.safetensors")
    database.write_bytes(database.read_bytes()[:5000])
    assert "damaged or cut" in refused("show", database)
    (tmp_path / "x.bvh").write_text("HIERARCHY\n")
    assert "looks like a BVH recording" in refused("show", tmp_path / "x.bvh")


# walk


def test_points_are_followed(database, points, tmp_path):
    out, trace = tmp_path / "out.bvh", tmp_path / "trace.csv"
    result = call("walk", database, "--input", points, "-o", out, "--trace", trace)
    assert result.exit_code == 0
    assert "88 frames, 2.9 s" in result.stdout
    motion = load_motion(out)
    with trace.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == motion.frames == 88
    assert rows[0]["motion"] == "stand"
    assert float(rows[-1]["z"]) > 0.2
    assert np.allclose(motion.root_positions[:, 2], [float(row["pelvis_z"]) for row in rows], atol=1e-6)


def test_curves_are_followed(database, tmp_path):
    out = tmp_path / "out.bvh"
    result = call(
        "walk", database, "--curve", "line:2", "-o", out, "--json", "--speed", 1.0, "--rate", 60, "--half-life", 0.3
    )
    told = json.loads(result.stdout)
    assert told["frame_rate"] == 60
    assert 0.5 < told["metres"] < 3.2  # the point stops at once, a body does not
    assert told["output"] == str(out)
    assert told["trace"] is None
    assert "way" not in told


def test_paths_are_planned_and_kept(tmp_path):
    out, path = tmp_path / "out.bvh", tmp_path / "path.csv"
    path.write_text("x,z\n0,0\n0,4\n")
    told = json.loads(call("walk", "--path", path, "-o", out, "--json", "--speed", 1.0).stdout)
    assert told["way"] == pytest.approx(4.0)
    assert told["error_max"] < 0.05
    assert told["arrived"] is True
    assert told["slowed"] == []
    assert "4.0 m of way, kept within 0" in call("walk", "--path", path, "-o", out).stdout


def test_scenes_are_walked(tmp_path):
    out, scene = tmp_path / "out.bvh", tmp_path / "scene.yaml"
    scene.write_text("start: [0, 0]\ngoals: [[0, 6]]\nobstacles: [{name: tree, center: [0.1, 3], radius: 0.4}]\n")
    told = json.loads(call("walk", "--scene", scene, "-o", out, "--json", "--size", "lively").stdout)
    assert told["way"] > 6.05
    assert told["error_max"] < 0.1
    scene.write_text("start: [0, 3]\ngoals: [[0, 6]]\nobstacles: [{name: tree, center: [0.1, 3], radius: 0.4}]\n")
    assert "tree" in refused("walk", "--scene", scene, "-o", out)
    scene.write_text("start: [0, 0]\ngoals: [[0, 6]]\nobstacles: [{name: tree, center: [0.1, 3], radius: -1}]\n")
    assert "scene.yaml" in refused("walk", "--scene", scene, "-o", out)


def test_a_walk_has_a_style(tmp_path):
    path = tmp_path / "path.csv"
    path.write_text("x,z\n0,0\n0,3\n")
    written = {}
    for way in (("--curve", "line:3"), ("--path", path)):
        for style in ("gloomy", "-1", "0", "neutral", None):
            out = tmp_path / f"{style}.bvh"
            call("walk", *way, "-o", out, "-q", *(() if style is None else ("--style", style)))
            written[way[0], style] = out.read_text()
        own = {style: text for (kind, style), text in written.items() if kind == way[0]}
        assert own["gloomy"] == own["-1"] != own["0"]
        assert own["0"] == own["neutral"] == own[None]


def test_usual_speeds_belong_to_the_motion(database, tmp_path):
    for motion, seconds in (("walk", 2 + 6 / 1.3), ("run", 2 + 6 / 3.0)):
        result = call("walk", database, "--curve", "line", "--motion", motion, "-o", tmp_path / "out.bvh", "--json")
        assert json.loads(result.stdout)["seconds"] == pytest.approx(seconds, abs=0.1)


def test_a_person_can_be_chosen(database, tmp_path):
    out = tmp_path / "out.bvh"
    assert call("walk", database, "--curve", "line:1", "--subject", "01", "-o", out, "-q").output == ""
    assert "no subject '99' in the database; there are 01, 02" in refused(
        "walk", database, "--curve", "line:1", "--subject", "99", "-o", out
    )


def test_a_walk_that_cannot_be_is_refused(database, points, tmp_path):
    out = tmp_path / "out.bvh"
    bad = tmp_path / "bad.csv"
    for arguments, says in [
        ([], "exactly one of --input, --curve, --path and --scene"),
        (["--scene", points, "--speed", 1], "the scene's behavior says how to go"),
        (["--path", points, "--half-life", 0.2], "what is planned needs no spring"),
        (["--path", points, "--motion", "stand"], "nobody stands along a path"),
        (["--curve", "line", "--size", "huge"], "no size 'huge' of movement; there are calm, neutral"),
        (
            ["--curve", "line", "--style", "merry"],
            "a style is gloomy, neutral, brisk or a number from -1 (gloomy) to 1",
        ),
        (["--path", points, "--style", "1.2"], "to 1 (brisk), not 1.2"),
        (["--curve", "line", "--input", points], "exactly one of"),
        (["--input", points, "--speed", 1], "--speed goes with --curve and --path"),
        (["--curve", "spiral:3"], "no curve 'spiral'; there are line:6"),
        (["--curve", "line:-1"], "must be a positive number of metres"),
        (["--curve", "line", "--motion", "hop"], "no motion 'hop'; there are stand, walk, run"),
        (["--curve", "line", "--speed", 0], "must be positive"),
        (["--curve", "line", "--speed", "nan"], "must be positive"),
        (["--curve", "line", "--speed", 1e-5], "more than two hours"),
        (["--curve", "line", "--rate", 1e6], "between 10 and 240 Hz"),
        (["--curve", "line", "--half-life", -1], "half_life must be a positive number"),
        (["--curve", "line", "--damping-ratio", "inf"], "damping_ratio must be a positive number"),
        (["--input", tmp_path / "none.csv"], "none.csv: cannot be read"),
        (["--path", points, "--trace", points], "would overwrite"),
        (["--curve", "line", "--trace", tmp_path / "none" / "trace.csv"], "no such folder"),
    ]:
        assert says in refused("walk", database, *arguments, "-o", out), arguments
    for content, says in [
        ("time,x,z\n0,0,nan\n", "bad.csv:2: column 'z': nan is not a finite number"),
        ("time,x,z\n0,0,0\n1,0,0\n0.5,0,0\n", "bad.csv:4: column 'time'"),
    ]:
        bad.write_text(content)
        assert says in refused("walk", database, "--input", bad, "-o", out)
    assert "motion is written as *.bvh" in refused("walk", database, "--curve", "line", "-o", tmp_path / "out.fbx")
    assert "no such folder" in refused("walk", database, "--curve", "line", "-o", tmp_path / "none" / "out.bvh")
    assert "no such file" in refused("walk", tmp_path / "none", "--curve", "line", "-o", out)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.csv", "points.csv", "walk.safetensors"]


def test_motion_and_trace_are_written_both_or_neither(database, tmp_path, monkeypatch):
    out, trace = tmp_path / "out.bvh", tmp_path / "trace.csv"
    out.write_text("old motion")
    trace.write_text("old trace")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    assert "No space left" in refused("walk", database, "--curve", "line:1", "-o", out, "--trace", trace)
    assert (out.read_text(), trace.read_text()) == ("old motion", "old trace")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.bvh", "trace.csv", "walk.safetensors"]


# as a process of its own


def test_errors_are_one_line_on_stderr(tmp_path):
    command = [*COMMAND, "build", str(tmp_path / "none"), "-o", str(tmp_path / "new.safetensors")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"error: {tmp_path / 'none'}: there is no such file or folder")
    assert done.stderr.count("\n") == 1


@POSIX
def test_a_full_disk_leaves_the_old_database(formula_takes, database):
    import resource

    old = database.read_bytes()
    command = [*COMMAND, "build", str(formula_takes), "-o", str(database), "--no-cache", "--jobs", "1"]
    most = len(old) // 2
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
    )
    assert done.returncode == 2, done.stderr
    assert "cannot be written: File too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert database.read_bytes() == old
    assert [path.name for path in database.parent.iterdir()] == [database.name]


@POSIX
@pytest.mark.parametrize(("sign", "status"), [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_a_build_that_is_stopped_leaves_the_old_database(formula_takes, database, sign, status):
    old = database.read_bytes()
    command = [*COMMAND, "build", str(formula_takes), "-o", str(database), "--no-cache", "--jobs", "2"]
    build = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    time.sleep(1.2)  # workers are starting or at work
    assert build.poll() is None
    os.killpg(build.pid, sign) if sign == signal.SIGINT else build.send_signal(sign)
    stdout, stderr = build.communicate(timeout=60)
    assert build.returncode == status, stderr
    assert "Traceback" not in stderr
    assert stdout == ""
    assert database.read_bytes() == old
    assert [path.name for path in database.parent.iterdir()] == [database.name]


def test_real_recordings_can_be_built_shown_and_walked_with(mocap, tmp_path):
    takes = [mocap / "cmu" / "16" / f"{take}.amc" for take in ("16_15", "16_31", "16_33")]
    path, out = tmp_path / "real.safetensors", tmp_path / "out.bvh"
    assert call("build", *takes, "-o", path, "--jobs", 1, "--no-cache").exit_code == 0
    shown = json.loads(call("show", path, "--json").stdout)
    assert (shown["takes"], shown["subjects"]) == (3, ["16"])
    assert shown["turning_radius_at_1_3"] > 0.5
    summary = json.loads(call("walk", path, "--curve", "line:4", "-o", out, "--json").stdout)
    assert summary["metres"] == pytest.approx(4.0, abs=1.0)
    assert load_motion(out).frames == summary["frames"]
