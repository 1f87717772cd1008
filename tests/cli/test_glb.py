"""Every command that writes motion writes it as GLB too."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from bodies import standing
from glbs import Glb, complaints
from stridecast.cli.main import app
from stridecast.formats.crowd_files import CrowdFiles
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import save_database
from stridecast.formats.trajectories import load_trajectories

PAIR = """
seed: 4
people:
  - {name: Ann, start: [0, 0], goals: [[0, 5]], height: 1.5}
  - {name: ../ann, start: [0.1, 5], goals: [[0, 0]], begins: 0.5}
"""


def call(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.output if code else result.stdout


@pytest.fixture(scope="module")
def database(formula_database, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("database") / "glb.safetensors"
    save_database(formula_database, path)
    return path


def roots(glb: Glb) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """By person: times and places of the root in the world."""
    above = {child: node for node in glb["nodes"] for child in node.get("children", ())}
    (animation,) = glb["animations"]
    out = {}
    for channel in animation["channels"]:
        if channel["target"]["path"] == "translation":
            sampler = animation["samplers"][channel["sampler"]]
            person = above[channel["target"]["node"]]
            scale = person.get("scale", [1.0])[0]
            out[person["name"]] = glb.array(sampler["input"]), scale * glb.array(sampler["output"])
    return out


@pytest.mark.parametrize("compact", [False, True])
def test_walks_and_clips(database, tmp_path, compact):
    for words in (("walk", database, "--curve", "line:2"), ("mine", database, "--status", "walk")):
        call(*words, "-o", tmp_path / "out.bvh", "-q")
        call(*words, "-o", tmp_path / "out.glb", "-q", *["--compact"] * compact)
        glb = Glb((tmp_path / "out.glb").read_bytes())
        ((times, places),) = roots(glb).values()
        np.testing.assert_allclose(places, load_motion(tmp_path / "out.bvh").root_positions, atol=2e-5)
        np.testing.assert_allclose(times, np.arange(len(times)) / 30, atol=1e-5)
        told = glb["animations"][0]["extras"]["stridecast"]
        assert {plant["foot"] for plant in told["foot_plants"]} == {"left", "right"}


def test_a_crowd(database, tmp_path):
    scene, out = tmp_path / "scene.yaml", tmp_path / "out.glb"
    scene.write_text(PAIR)
    told = json.loads(call("crowd", scene, "--database", database, "-o", out, "--json"))
    assert told["output"] == [str(out), str(tmp_path / "out.csv")]
    places, found = load_trajectories(tmp_path / "out.csv"), roots(Glb(out.read_bytes()))
    assert sorted(found) == ["../ann", "Ann"]
    for number, name in enumerate(("Ann", "../ann"), start=1):
        times, own = found[name]
        rows = places.rows(number)
        np.testing.assert_allclose(times, places.times[rows], atol=1e-5)
        assert np.linalg.norm(own[:, [0, 2]] - places.positions[rows], axis=-1).max() < 0.15
    assert found["Ann"][1][:, 1].mean() < 0.9 * found["../ann"][1][:, 1].mean()
    assert len(Glb(out.read_bytes())["meshes"]) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv", "out.glb", "scene.yaml"]
    said = call("crowd", scene, "--database", database, "-o", tmp_path / "out.bvh", "--compact", code=2)
    assert "only *.glb is written compactly" in said


def test_dressed_trajectories_pass_khronos(database, tmp_path, khronos):
    source, out = tmp_path / "walks.csv", tmp_path / "out.glb"
    rows = [f"{k},{2 + 0.2 * n:.1f},{0.26 * n:.3f},{k}" for k in (3, 7) for n in range(30)]
    source.write_text("id,time,x,y\n" + "\n".join(rows) + "\n")
    call("dress", source, "--database", database, "-o", out)
    tracks, glb = load_trajectories(tmp_path / "out.csv"), Glb(out.read_bytes())
    found = roots(glb)
    assert list(found) == ["3", "7"]
    for name, (times, own) in found.items():
        rows = tracks.rows(int(name))
        np.testing.assert_allclose(times, tracks.times[rows], atol=1e-5)
        assert np.linalg.norm(own[:, [0, 2]] - tracks.positions[rows], axis=-1).max() < 0.15
    told = next(node for node in glb["nodes"] if node["name"] == "3")["extras"]["stridecast"]
    assert told["start"] == 2.0
    assert {plant["foot"] for plant in told["foot_plants"]} == {"left", "right"}
    assert complaints(khronos, out) == []


def stopped(files: CrowdFiles) -> None:
    with files:
        files.add_motion(1, "Ann", 0.5, standing(), 1.7)
        raise KeyboardInterrupt


def test_who_had_left_is_kept(tmp_path):
    out = tmp_path / "out.glb"
    out.write_text("old")
    for name in ("out.part.glb", "out.part2.glb"):
        files = CrowdFiles(out)
        with pytest.raises(KeyboardInterrupt):
            stopped(files)
        assert [path.name for path in files.kept][-1] == name
        assert list(roots(Glb((tmp_path / name).read_bytes()))) == ["Ann"]
    assert out.read_text() == "old"
    empty = CrowdFiles(tmp_path / "none.glb")
    with empty:
        pass
    assert not Glb((tmp_path / "none.glb").read_bytes())["nodes"]
