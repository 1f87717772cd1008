"""Characters as other programs export them walk: found whole, upright, facing their way, as large as they were."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import exported_rigs
from bodies import humanoid
from characters import A_POSE, mixamo_like, posed_at_rest
from exported_rigs import Export, export, skinned
from glbs import Glb
from stridecast.body import kinematics
from stridecast.body.mannequin import mannequin
from stridecast.cli.main import app
from stridecast.errors import FileError, SkeletonError
from stridecast.formats.bvh_conventions import standing_height
from stridecast.formats.glb import write_glb
from stridecast.formats.recordings import load_motion, load_skeleton
from stridecast.formats.store import save_database
from stridecast.model.skeleton import Skeleton
from synthetic_gait import gait

TALL = 1.78
"""Height of the mannequin, metres."""

EXPORTS: dict[str, tuple[Export, Skeleton, str]] = {
    "Mixamo through Blender": (exported_rigs.MIXAMO, humanoid(), ".glb"),
    "VRoid": (exported_rigs.VROID, humanoid(), ".vrm"),
    "Ready Player Me": (exported_rigs.READY_PLAYER_ME, humanoid(), ".glb"),
    "Unreal": (exported_rigs.UNREAL, posed_at_rest(humanoid(), A_POSE), ".glb"),
    "Rigify, joined": (exported_rigs.RIGIFY, humanoid(), ".glb"),
}


@pytest.fixture(scope="module")
def database(formula_database, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("database") / "rigs.safetensors"
    save_database(formula_database, path)
    return path


def walks(database: Path, rig: Path, tmp_path: Path, tall: float) -> None:
    """The character walks aslant, by what its skin shows at five moments."""
    out, points = tmp_path / "walked.glb", tmp_path / "points.csv"
    points.write_text("time,x,z\n0,0,0\n3,-2,-3\n")
    words = ["walk", database, "--input", points, "--skeleton", rig, "-o", out, "-q"]
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == 0, result.output
    body, glb = load_skeleton(rig), Glb(out.read_bytes())
    moved = load_motion(out)
    nodes = [glb.names()[name] for name in body.names]
    walked = 0.0
    for frame in np.linspace(45, moved.frames - 8, 5).astype(int):
        time, later = frame / moved.frame_rate, (frame + 6) / moved.frame_rate
        worlds = glb.world(0, time)
        skin, joints = skinned(glb, worlds), worlds[nodes, :3, 3]
        assert skin[:, 1].min() == pytest.approx(0.0, abs=0.03)
        assert skin[:, 1].max() == pytest.approx(tall, abs=0.06 * tall)
        spread = np.ptp(skin[:, [0, 2]], axis=0)
        assert spread.max() < 0.75 * tall
        hips, head = joints[body.joint("hips")], joints[body.joint("head")]
        lean = np.linalg.norm((head - hips)[[0, 2]]) / (head - hips)[1]
        assert lean < 0.2
        way = glb.world(0, later)[nodes[body.joint("hips")], :3, 3] - hips
        walked += np.linalg.norm(way) / (later - time) / 5
        ahead = way[[0, 2]] / np.linalg.norm(way[[0, 2]])
        toes = sum(joints[body.joint(f"{side}_toe")] - joints[body.joint(f"{side}_foot")] for side in ("left", "right"))
        across = joints[body.joint("left_thigh")] - joints[body.joint("right_thigh")]
        for forward in (toes[[0, 2]], np.array([-across[2], across[0]])):
            assert forward @ ahead > 0.85 * np.linalg.norm(forward), frame
        beside = skin @ np.array([ahead[1], 0.0, -ahead[0]])
        assert np.ptp(beside) < 0.6 * tall  # arms hang
    assert 0.9 < walked < 1.5


def check_found(rig: Path, how: Export, body: Skeleton) -> None:
    """All joints are found where they are, in metres."""
    there = export(rig, how, body)
    found = load_skeleton(rig)
    named = {role: found.names[joint] for role, joint in found.roles.items()}
    assert named == {role: there.names[joint] for role, joint in there.roles.items()}
    assert found.leg_length == pytest.approx(body.leg_length, abs=1e-5)
    at, theirs = (kinematics.rest(one).positions[one.chain(*body.roles)] for one in (found, body))
    np.testing.assert_allclose(at - at[0], theirs - theirs[0], atol=1e-5)


@pytest.mark.parametrize("name", EXPORTS)
def test_a_character_walks_as_it_was_exported(database, tmp_path, name):
    how, body, suffix = EXPORTS[name]
    check_found(tmp_path / f"rig{suffix}", how, body)
    walks(database, tmp_path / f"rig{suffix}", tmp_path, TALL)


@pytest.mark.parametrize("how", [exported_rigs.VRM0, exported_rigs.VRM1])
def test_vrm_tells_which_bone_is_what(tmp_path, how):
    check_found(tmp_path / "rig.vrm", how, humanoid())
    (tmp_path / "rig.vrm").rename(tmp_path / "rig.glb")
    assert len(load_skeleton(tmp_path / "rig.glb").roles) == 22
    mine = {"left_thigh": "Bone.001"}
    assert load_skeleton(tmp_path / "rig.glb", roles=mine).joint("left_thigh") == 1


def test_an_animation_of_vrm_is_a_recording(tmp_path):
    walk = gait(np.full(20, 1.2), rate=30.0).motion
    write_glb(tmp_path / "walk.glb", walk)
    glb = Glb((tmp_path / "walk.glb").read_bytes())
    document = glb.document
    index = {node["name"]: k for k, node in enumerate(document["nodes"])}
    bones = {theirs: {"node": index[ours]} for ours, theirs in exported_rigs.VRM_BONES.items() if ours in index}
    for node in document["nodes"]:
        node["name"] = f"node {index[node['name']]}"
        node.pop("mesh", None), node.pop("skin", None)
    for part in ("skins", "meshes", "materials"):
        document.pop(part, None)
    document["extensions"] = {"VRMC_vrm_animation": {"humanoid": {"humanBones": bones}}}
    (tmp_path / "walk.vrma").write_bytes(exported_rigs.packed(document, glb.numbers))
    back = load_motion(tmp_path / "walk.vrma")
    known = [role for role in walk.skeleton.roles if role in back.skeleton.roles]
    assert len(known) >= 18
    at, ours = (kinematics.pose(one).positions[:, one.skeleton.chain(*known)] for one in (back, walk))
    assert np.abs(at - ours).max() < 1e-5


def test_a_hat_is_no_body(tmp_path):
    """Of several figures that with most joints is read, whatever order they are in."""
    export(tmp_path / "rig.glb", exported_rigs.READY_PLAYER_ME)
    glb = Glb((tmp_path / "rig.glb").read_bytes())
    nodes = glb.document["nodes"]
    nodes.append({"name": "Hat"})
    glb.document["scenes"][0]["nodes"].append(len(nodes) - 1)
    glb.document["skins"].insert(0, {"joints": [len(nodes) - 1]})
    for node in nodes:
        if "skin" in node:
            node["skin"] += 1
    (tmp_path / "hat.glb").write_bytes(exported_rigs.packed(glb.document, glb.numbers))
    assert load_skeleton(tmp_path / "hat.glb").names == load_skeleton(tmp_path / "rig.glb").names


@pytest.mark.parametrize(
    ("bones", "says"),
    [
        ([{"bone": "hips", "node": 10**6}], "bone hips of VRM points at nodes 1000000"),
        ([{"bone": "hips"}], "bone hips of VRM points at nodes None"),
        (["hips"], "a bone of VRM that is no object"),
        ({"hips": 3}, "a bone of VRM that is no object"),
    ],
)
def test_a_vrm_that_lies_is_refused(tmp_path, bones, says):
    how = Export(names=lambda name: name, extensions=lambda _nodes: {"VRM": {"humanoid": {"humanBones": bones}}})
    export(tmp_path / "rig.vrm", how)
    with pytest.raises(FileError, match=says):
        load_skeleton(tmp_path / "rig.vrm")


@pytest.mark.parametrize("told", [None, 7, {}, {"humanoid": None}, {"humanoid": {"humanBones": None}}])
def test_a_vrm_that_says_nothing_is_a_glb(tmp_path, told):
    export(tmp_path / "rig.vrm", Export(names=lambda name: name, extensions=lambda _nodes: {"VRMC_vrm": told}))
    found = load_skeleton(tmp_path / "rig.vrm")
    assert {role: found.names[joint] for role, joint in found.roles.items()} == {
        role: humanoid().names[joint] for role, joint in humanoid().roles.items()
    }


def test_of_many_joints_a_few_are_listed(tmp_path):
    further = [(f"MCH-{k}", "Bone.000", (0.0, 0.1, 0.0)) for k in range(200)]
    how = Export(names=exported_rigs.VRM1.names, further=further)
    export(tmp_path / "rig.glb", how)
    with pytest.raises(SkeletonError, match=r"no joint found for hips, .* and 144 more\. Name them"):
        load_skeleton(tmp_path / "rig.glb")


def test_a_character_in_centimetres_stays_so(database, tmp_path):
    export(tmp_path / "rig.glb", exported_rigs.READY_PLAYER_ME, humanoid(100.0))
    words = ["walk", database, "--curve", "line:2", "--skeleton", tmp_path / "rig.glb", "-o", tmp_path / "out.glb"]
    assert CliRunner().invoke(app, [str(word) for word in words]).exit_code == 0
    hips = Glb((tmp_path / "out.glb").read_bytes())
    at = hips.world(0, 0.5)[:, 1, 3].max()
    assert 150.0 < at < 180.0


def test_a_giant_is_named(database, tmp_path):
    export(tmp_path / "rig.glb", exported_rigs.READY_PLAYER_ME, humanoid(6.0))
    words = ["walk", database, "--curve", "line:2", "--skeleton", tmp_path / "rig.glb", "-o", tmp_path / "out.glb"]
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == 2
    assert "rig.glb: its legs are 5.1 m long" in result.stderr
    assert not (tmp_path / "out.glb").exists()


def in_blender(blender: str, *arguments: object) -> str:
    command = [blender, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return done.stdout


SCRIPT = Path(__file__).with_name("blender_characters.py")
CONVERTERS = Path(__file__).resolve().parents[2] / "integrations" / "blender"


def test_an_fbx_as_of_mixamo_walks(blender, database, tmp_path):
    body = mixamo_like(tmp_path, legs=1.0)
    skin = mannequin(body, low=True)
    up = np.array([0.0, standing_height(body), 0.0])
    at = kinematics.rest(body).positions + up
    tips = []
    for joint in range(body.joints):
        below = np.flatnonzero(body.parents == joint)
        tips.append((at[below[0]] if len(below) else at[joint] + [0.0, 0.05, 0.0]).tolist())
    told = {"names": body.names, "parents": body.parents.tolist(), "places": at.tolist(), "tips": tips}
    told |= {"vertices": (skin.positions + up).tolist(), "triangles": skin.triangles.tolist()}
    told |= {"joints": skin.joints.tolist(), "weights": skin.weights.tolist()}
    (tmp_path / "rig.json").write_text(json.dumps(told))
    in_blender(blender, SCRIPT, "mixamo", tmp_path / "rig.json", tmp_path / "rig.fbx")
    assert "at rest" in in_blender(blender, CONVERTERS / "fbx_to_glb.py", tmp_path / "rig.fbx", tmp_path / "rig.glb")
    found = load_skeleton(tmp_path / "rig.glb")
    assert found.leg_length == pytest.approx(body.leg_length, rel=1e-4)
    assert len(found.roles) == len(body.roles)
    walks(database, tmp_path / "rig.glb", tmp_path, float((skin.positions + up)[:, 1].max()))


def test_rigify_walks_once_its_bones_hang_together(blender, database, tmp_path):
    files = (tmp_path / "rig.glb", CONVERTERS / "rigify_to_glb.py", tmp_path / "joined.glb")
    assert "160 bones of rig, 1 meshes" in in_blender(blender, SCRIPT, "rigify", *files)
    with pytest.raises(FileError, match=r"a control rig of Rigify: its bones DEF-spine and DEF-thigh\.L do not hang"):
        load_skeleton(tmp_path / "rig.glb")
    assert len(load_skeleton(tmp_path / "joined.glb").roles) == 22
    glb = Glb((tmp_path / "joined.glb").read_bytes())
    walks(database, tmp_path / "joined.glb", tmp_path, float(skinned(glb, glb.world(None, 0.0))[:, 1].max()))
