"""Every command that writes motion writes it as USD too."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from bodies import standing
from stridecast.cli.main import app
from stridecast.formats.crowd_files import CrowdFiles
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import save_database
from stridecast.formats.trajectories import load_trajectories

pytest.importorskip("pxr", reason="no usd-core (pip install 'stridecast[usd]')")

PAIR = """
seed: 4
people:
  - {name: Ann, start: [0, 0], goals: [[0, 5]], height: 1.5}
  - {name: ../ann, start: [0.1, 5], goals: [[0, 0]], begins: 0.5}
"""


def call(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture(scope="module")
def database(formula_database, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("database") / "usd.safetensors"
    save_database(formula_database, path)
    return path


def roots(path: Path) -> dict[str, np.ndarray]:
    """By person: time codes and places of the root in the world, rows of 4."""
    from pxr import Usd, UsdGeom, UsdSkel

    stage, out = Usd.Stage.Open(str(path)), {}
    for prim in stage.Traverse():
        if prim.IsA(UsdSkel.Animation):
            attribute = UsdSkel.Animation(prim).GetTranslationsAttr()
            world = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim.GetParent()))
            codes = attribute.GetTimeSamples()
            places = np.array([attribute.Get(code)[0] for code in codes]) @ world[:3, :3] + world[3, :3]
            out[prim.GetParent().GetName()] = np.concatenate((np.array(codes)[:, None], places), axis=1)
    return out


def test_walks_and_clips(database, tmp_path):
    for words in (("walk", database, "--curve", "line:2"), ("mine", database, "--status", "walk")):
        for ending in ("bvh", "usda"):
            call(*words, "-o", tmp_path / f"out.{ending}", "-q")
        (there,) = roots(tmp_path / "out.usda").values()
        np.testing.assert_allclose(there[:, 1:], load_motion(tmp_path / "out.bvh").root_positions, atol=2e-5)
        assert there[:, 0].tolist() == list(range(len(there)))


def test_a_crowd(database, tmp_path):
    scene, out = tmp_path / "scene.yaml", tmp_path / "out.usdc"
    scene.write_text(PAIR)
    told = json.loads(call("crowd", scene, "--database", database, "-o", out, "--json"))
    assert told["output"] == [str(out), str(tmp_path / "out.csv")]
    assert told["motions"] == []
    places, found = load_trajectories(tmp_path / "out.csv"), roots(out)
    assert list(found) == ["Ann", "ann_2"]
    for number, own in enumerate(found.values(), start=1):
        rows = places.rows(number)
        np.testing.assert_allclose(own[:, 0] / 30.0, places.times[rows], atol=1e-6)
        assert np.linalg.norm(own[:, [1, 3]] - places.positions[rows], axis=-1).max() < 0.15
    assert found["Ann"][:, 2].mean() < 0.9 * found["ann_2"][:, 2].mean()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv", "out.usdc", "scene.yaml"]
    assert "2 people came" in call("crowd", scene, "--database", database, "-o", out)


def test_dressed_trajectories(database, tmp_path):
    source, out = tmp_path / "walks.csv", tmp_path / "out.usd"
    rows = [f"{k},{2 + 0.2 * n:.1f},{0.26 * n:.3f},{k}" for k in (3, 7) for n in range(30)]
    source.write_text("id,time,x,y\n" + "\n".join(rows) + "\n")
    call("dress", source, "--database", database, "-o", out)
    tracks, found = load_trajectories(tmp_path / "out.csv"), roots(out)
    assert list(found) == ["_3", "_7"]
    for name, own in found.items():
        rows = tracks.rows(int(name[1:]))
        np.testing.assert_allclose(own[:, 0] / 30.0, tracks.times[rows], atol=1e-6)
        assert np.linalg.norm(own[:, [1, 3]] - tracks.positions[rows], axis=-1).max() < 0.15


def stopped(files: CrowdFiles) -> None:
    with files:
        files.add_motion(1, "Ann", 0.5, standing(), 1.7)
        raise KeyboardInterrupt


def test_who_had_left_is_kept(tmp_path):
    out = tmp_path / "out.usda"
    out.write_text("old")
    for name in ("out.part.usda", "out.part2.usda"):
        files = CrowdFiles(out)
        with pytest.raises(KeyboardInterrupt):
            stopped(files)
        assert [path.name for path in files.kept][-1] == name
        assert list(roots(tmp_path / name)) == ["Ann"]
    assert out.read_text() == "old"
    empty = CrowdFiles(tmp_path / "none.usda")
    with empty:
        pass
    assert roots(tmp_path / "none.usda") == {}
