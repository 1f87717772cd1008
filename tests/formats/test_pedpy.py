"""PedPy and JuPedSim have the people where we have them; Juelich's text is written and read."""

from __future__ import annotations

import json
import subprocess

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.errors import FileError
from stridecast.formats.trajectories import load_trajectories, save_trajectories
from stridecast.model.trajectories import Trajectories


def people(rate: float = 30.0, frames: int = 40, first: int = 0) -> Trajectories:
    """Three people who appear one after the other."""
    rows = [
        (k, (first + 7 * k + n) / rate, 0.04 * n + k, 2.0 * k - 0.01 * n) for k in (2, 5, 11) for n in range(frames)
    ]
    table = np.array(rows)
    return Trajectories(ids=table[:, 0].astype(np.int64), times=table[:, 1], positions=table[:, 2:])


@given(st.sampled_from([1.0, 16.0, 25.0, 29.97, 30.0, 60.0, 120.0]), st.integers(0, 100_000))
def test_text_comes_back(tmp_path_factory, rate, first):
    path = tmp_path_factory.getbasetemp() / "people.txt"
    ours = people(rate, first=first)
    save_trajectories(path, ours)
    back = load_trajectories(path)
    np.testing.assert_array_equal(back.ids, ours.ids)
    np.testing.assert_allclose(back.times, ours.times, atol=0.02 / rate)
    np.testing.assert_allclose(back.positions, ours.positions, atol=1e-6)


def test_moments_between_frames_are_refused(tmp_path):
    times = np.array([0.0, 0.1, 0.25, 0.3])
    ours = Trajectories(ids=np.zeros(4, np.int64), times=times, positions=np.zeros((4, 2)))
    with pytest.raises(FileError, match=r"row 2 is at 0.25 s, between two frames at 10 a second"):
        save_trajectories(tmp_path / "people.txt", ours)
    assert not list(tmp_path.iterdir())


def test_one_moment_is_one_frame(tmp_path):
    ours = Trajectories(ids=np.arange(3), times=np.full(3, 2.0), positions=np.eye(3, 2))
    save_trajectories(tmp_path / "people.txt", ours)
    np.testing.assert_allclose(load_trajectories(tmp_path / "people.txt").positions, ours.positions)


SCRIPT = """
import json, pathlib, sys
import pandas, pedpy
folder = pathlib.Path(sys.argv[1])
found = {"txt": pedpy.load_trajectory_from_txt(trajectory_file=folder / "people.txt")}
for name, read in (("csv", pandas.read_csv),):
    if (folder / f"people.{name}").exists():
        table = read(folder / f"people.{name}")
        table["frame"] = (table["time"] * 30).round().astype(int)
        found[name] = pedpy.TrajectoryData(table[["id", "frame", "x", "y"]], frame_rate=30)
said = {}
for name, it in found.items():
    speeds = pedpy.compute_individual_speed(traj_data=it, frame_step=5)
    rows = it.data.sort_values(["id", "frame"])
    said[name] = {"rate": it.frame_rate, "rows": rows[["id", "frame", "x", "y"]].to_numpy().tolist(),
                  "speed": float(speeds.speed.median())}
json.dump(said, open(sys.argv[2], "w"))
"""


def test_pedpy_has_everybody_where_we_have_them(tmp_path, pedpy):
    ours = people()
    for ending in ("csv", "txt"):
        save_trajectories(tmp_path / f"people.{ending}", ours)
    script, out = tmp_path / "script.py", tmp_path / "said.json"
    script.write_text(SCRIPT)
    command = [pedpy, str(script), str(tmp_path), str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    said = json.loads(out.read_text())
    assert sorted(said) == ["csv", "txt"]
    for name, it in said.items():
        assert it["rate"] == 30, name
        rows = np.array(it["rows"])
        np.testing.assert_array_equal(rows[:, 0], ours.ids)
        np.testing.assert_allclose(rows[:, 1] / 30, ours.times, atol=1e-9)
        np.testing.assert_allclose(rows[:, 2:], ours.positions * [1, -1], atol=1e-6)
        assert it["speed"] == pytest.approx(30 * float(np.hypot(0.04, 0.01)), rel=1e-3)
