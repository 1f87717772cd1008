"""``--skeleton`` and ``--bvh-...`` of all commands that write motion."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from bodies import humanoid
from characters import bandai_like, mixamo_like
from glb_rigs import artists_rig
from glbs import Glb, complaints, packed
from stridecast.body import kinematics
from stridecast.cli.main import app
from stridecast.crowd.bodies import stature
from stridecast.formats.bvh import read_bvh
from stridecast.formats.glb import body_glb
from stridecast.formats.recordings import load_motion, load_skeleton
from stridecast.formats.store import load_database, save_database
from stridecast.model.motion import Motion

SCENE = """
seed: 4
people:
  - {name: Ann, start: [0, 0], goals: [[0, 4]], height: 1.5}
  - {name: Ben, start: [1, 4], goals: [[1, 0]]}
"""

ROWS = "id,time,x,y\n" + "".join(f"7,{k / 10:.1f},{0.13 * k:.3f},0\n" for k in range(40))


def call(*arguments: object):
    """Run the command in this process; nothing but ``typer.Exit`` may come out of it."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exc_info
    return result


def refused(*arguments: object) -> str:
    """Run the command, and return the one line that says what is wrong."""
    result = call(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("error: ")
    return result.stderr.removeprefix("error: ").strip()


@pytest.fixture(scope="module")
def database(formula_database, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("database") / "walk.safetensors"
    save_database(formula_database, path)
    return path


@pytest.fixture(scope="module")
def character(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("character")
    mixamo_like(folder)
    return folder / "character.bvh"


def index(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def middles(motion: Motion) -> np.ndarray:
    """Middle of the hips over the ground."""
    at = kinematics.pose(motion).positions
    return at[:, motion.skeleton.chain("left_thigh", "right_thigh")].mean(axis=1)[:, [0, 2]]


def check_same_way(path: Path, plain: Path, character: Path, scale: float = 1.0, size: float = 1.0) -> None:
    mine, other = load_motion(path, scale=scale), load_motion(plain, scale=1.0)
    wanted = load_skeleton(character, scale=0.01)
    assert sorted(mine.skeleton.names) == sorted(wanted.names)
    assert mine.skeleton.leg_length == pytest.approx(size * wanted.leg_length, abs=1e-6)
    assert mine.frames == other.frames
    np.testing.assert_allclose(middles(mine), middles(other), atol=1e-5)


def test_walk_of_a_character_for_a_program(database, character, tmp_path):
    way = ("walk", database, "--curve", "line:4", "--quiet")
    call(*way, "-o", tmp_path / "plain.bvh")
    done = call(*way, "-o", tmp_path / "a.bvh", "--skeleton", character, "--bvh-for", "motionbuilder")
    assert done.exit_code == 0, done.output
    check_same_way(tmp_path / "a.bvh", tmp_path / "plain.bvh", character, scale=0.01)
    raw = read_bvh(tmp_path / "a.bvh")
    assert raw.offsets[0, 1] > 80
    assert not raw.rotations[0, :, 1:].any()


def test_single_options_overrule_the_program(database, tmp_path):
    out = tmp_path / "a.bvh"
    options = ("--bvh-for", "unreal", "--bvh-unit", "mm", "--bvh-order", "xyz", "--bvh-up", "z", "--bvh-rest")
    assert call("mine", database, "--status", "walk", "-o", out, *options, "--quiet").exit_code == 0
    raw = read_bvh(out)
    assert raw.names[0] == "root"
    assert raw.offsets[1, 2] > 800
    assert "Xrotation Yrotation Zrotation" in out.read_text()
    assert not raw.rotations[0, :, 1:].any()
    assert call("mine", database, "--status", "walk", "-o", out, *options, "--bvh-root", "zero").exit_code == 0
    assert read_bvh(out).names[0] != "root"


def test_a_mined_clip_on_a_character(database, character, tmp_path):
    clip = ("mine", database, "--status", "walk", "--speed", "1.2", "--cycles", 2, "--quiet")
    call(*clip, "-o", tmp_path / "plain.bvh")
    assert call(*clip, "-o", tmp_path / "a.bvh", "--skeleton", character).exit_code == 0
    check_same_way(tmp_path / "a.bvh", tmp_path / "plain.bvh", character)


def test_a_crowd_of_one_character(database, character, tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE)
    crowd = ("crowd", scene, "--database", database, "--quiet")
    call(*crowd, "-o", tmp_path / "plain.bvh")
    out = tmp_path / "out.bvh"
    done = call(*crowd, "-o", out, "--skeleton", character, "--bvh-for", "blender")
    assert done.exit_code == 0, done.output
    usual = stature(load_database(database).skeleton)
    for name, size in (("Ann", 1.5 / usual), ("Ben", 1.0)):
        check_same_way(tmp_path / f"out.{name}.bvh", tmp_path / f"plain.{name}.bvh", character, size=size)
        assert read_bvh(tmp_path / f"out.{name}.bvh").offsets[0, 1] > 0.8 * size
    heights = {row["name"]: float(row["height"]) for row in index(tmp_path / "out.people.csv")}
    assert 1.7 < heights["Ben"] < 2.0
    assert heights["Ann"] == pytest.approx(heights["Ben"] * 1.5 / usual, abs=1e-3)
    assert (tmp_path / "out.csv").read_text() == (tmp_path / "plain.csv").read_text()


def test_trajectories_dressed_as_a_character(database, tmp_path):
    bandai_like(tmp_path)
    rows = tmp_path / "rows.csv"
    rows.write_text(ROWS)
    dress = ("dress", rows, "--database", database, "--quiet")
    call(*dress, "-o", tmp_path / "plain.bvh")
    done = call(*dress, "-o", tmp_path / "out.bvh", "--skeleton", tmp_path / "character.bvh", "--bvh-unit", "0.01")
    assert done.exit_code == 0, done.output
    check_same_way(tmp_path / "out.7.bvh", tmp_path / "plain.7.bvh", tmp_path / "character.bvh", scale=0.01)
    (row,) = index(tmp_path / "out.people.csv")
    assert 1.4 < float(row["height"]) < 1.8
    small = call(*dress, "-o", tmp_path / "small.bvh", "--skeleton", tmp_path / "character.bvh", "--height", 1.2)
    assert small.exit_code == 0, small.output
    size = 1.2 / stature(load_database(database).skeleton)
    (smaller,) = index(tmp_path / "small.people.csv")
    assert float(smaller["height"]) == pytest.approx(size * float(row["height"]), abs=1e-3)
    legs = load_skeleton(tmp_path / "small.7.bvh", scale=1.0).leg_length
    assert legs == pytest.approx(size * load_skeleton(tmp_path / "character.bvh", scale=0.01).leg_length, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-o", "{}/a.bvh", "--bvh-for", "maya"), "maya.*blender"),
        (("-o", "{}/a.bvh", "--bvh-unit", "inch"), "--bvh-unit.*inch"),
        (("-o", "{}/a.bvh", "--bvh-unit", "-1"), "scale"),
        (("-o", "{}/a.bvh", "--bvh-order", "XX"), "order"),
        (("-o", "{}/a.bvh", "--bvh-up", "X"), "up"),
        (("-o", "{}/a.bvh", "--bvh-root", "floor"), "root"),
        (("-o", "{}/a.bvh", "--skeleton", "{}/no.bvh"), r"no\.bvh"),
        (("-o", "{}/a.bvh", "--skeleton", "{}/a.fbx"), "skeleton"),
        (("-o", "{}/a.bvh", "--skeleton", "{}/a.bvh"), "overwritten"),
        (("--skeleton", "{}/no.bvh"), "--skeleton"),
        (("--bvh-for", "blender"), "--bvh-for"),
    ],
)
def test_options_that_are_none(database, tmp_path, options, message):
    said = refused("mine", database, "--status", "walk", *(option.format(tmp_path) for option in options))
    assert re.search(message, said.replace("\n", " ")), said
    assert not list(tmp_path.iterdir())


def test_tables_have_no_bodies(database, tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE)
    for option in (("--skeleton", "a.bvh"), ("--bvh-for", "blender")):
        said = refused("crowd", scene, "--database", database, "-o", tmp_path / "out.csv", *option)
        assert option[0] in said
    assert [path.name for path in tmp_path.iterdir()] == ["scene.yaml"]


def test_a_rigged_character_comes_back_with_its_meshes(database, character, tmp_path):
    rig = tmp_path / "rig.glb"
    skeleton = load_skeleton(character, scale=0.01)
    rig.write_bytes(body_glb(skeleton))
    points = tmp_path / "points.csv"
    points.write_text("time,x,z\n0,0,0\n1,0,1\n")
    made = call("walk", database, "--input", points, "--skeleton", rig, "-o", tmp_path / "walk.glb", "--quiet")
    assert made.exit_code == 0, made.output
    before, after = (Glb(path.read_bytes()) for path in (rig, tmp_path / "walk.glb"))
    assert after["meshes"] == before["meshes"]
    assert after.numbers.startswith(before.numbers)
    walked = load_motion(tmp_path / "walk.glb")
    assert walked.skeleton.leg_length == pytest.approx(skeleton.leg_length, abs=1e-5)
    assert np.hypot(*(middles(walked)[-1] - middles(walked)[0])) > 0.2


def test_crowds_wear_the_meshes_of_a_rig_in_many_sizes(database, tmp_path, khronos):
    rig, rows = tmp_path / "rig.glb", tmp_path / "rows.csv"
    artists_rig(rig, humanoid(), seed=4, unit=0.01)
    (tmp_path / "scene.yaml").write_text(SCENE)
    rows.write_text(ROWS)
    crowd = ("crowd", tmp_path / "scene.yaml", "--database", database, "-q", "--skeleton", rig)
    dress = ("dress", rows, "--database", database, "-q", "--skeleton", rig, "--height", 1.4)
    assert call(*crowd, "-o", tmp_path / "crowd.glb", "--compact").exit_code == 0
    assert call(*dress, "-o", tmp_path / "dress.glb").exit_code == 0
    assert complaints(khronos, tmp_path / "crowd.glb", tmp_path / "dress.glb") == []
    before = Glb(rig.read_bytes())
    usual = stature(load_database(database).skeleton)
    for name, sizes in (("crowd", (1.5 / usual, 1.0)), ("dress", (1.4 / usual,))):
        glb = Glb((tmp_path / f"{name}.glb").read_bytes())
        assert glb["meshes"] == before["meshes"]
        people = [node for node in glb["nodes"] if "start" in node.get("extras", {}).get("stridecast", {})]
        scales = [person["scale"][0] for person in people]  # the file is in centimetres
        np.testing.assert_allclose(sorted(scales), np.sort(sizes) * 0.01, rtol=1e-4)
        worlds = glb.world(0, 1.0)
        for node in (k for k, told in enumerate(glb["nodes"]) if told.get("name") == "Legs"):
            assert abs(glb.seen(node, worlds)[:, 1].min()) < 0.06  # on the floor


def test_a_rig_that_cannot_be_carried_over_is_refused_before_the_work(database, tmp_path):
    rig, scene = tmp_path / "rig.glb", tmp_path / "scene.yaml"
    artists_rig(rig, humanoid())
    glb = Glb(rig.read_bytes())
    glb.document["images"] = [{"uri": "coat.png"}]
    rig.write_bytes(packed(glb.document, glb.numbers))
    scene.write_text(SCENE)
    said = refused("crowd", scene, "--database", database, "-o", tmp_path / "out.glb", "--skeleton", rig)
    assert "coat.png" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rig.glb", "scene.yaml"]
