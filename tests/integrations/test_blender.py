"""The Blender add-on: its parts without Blender, and all of it in a Blender without a window."""

from __future__ import annotations

import importlib.util
import json
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blenders import run_in_blender
from bodies import writhing
from stridecast.body import kinematics
from stridecast.formats.bvh import write_bvh
from stridecast.formats.recordings import load_motion
from stridecast.formats.vmc import VmcFigure, VmcSender, datagrams, osc_message
from stridecast.samples.corpus import RECIPES, sample_take

ADDON = Path(__file__).resolve().parents[2] / "integrations" / "blender"


def load(name: str) -> ModuleType:
    """A plain module of the add-on, whose package itself needs Blender."""
    package = sys.modules.setdefault("stridecast_vmc_plain", ModuleType("stridecast_vmc_plain"))
    package.__path__ = [str(ADDON / "stridecast_vmc")]  # type: ignore[attr-defined]
    return importlib.import_module(f"stridecast_vmc_plain.{name}")


osc, listener = load("osc"), load("listener")


@given(st.text(max_size=20).filter(lambda s: "\0" not in s), st.integers(-(2**31), 2**31 - 1), st.floats(width=32))
def test_it_hears_what_we_say(text, whole, number):
    ((address, arguments),) = osc.messages(osc_message("/a", text, whole, number))
    assert address == "/a"
    assert arguments[:2] == [text, whole]
    assert arguments[2] == number or np.isnan(number)


@given(st.binary(max_size=200), st.sampled_from([b"", b"#bundle\0", b"/VMC/Ext/Bone/Pos\0\0\0,s\0\0"]))
def test_anything_else_is_refused(data, before):
    try:
        said = list(osc.messages(before + data))
    except ValueError:
        return
    assert all(address.startswith("/") for address, _ in said)


def test_a_bundle_in_a_bundle_in_a_bundle():
    data = osc_message("/a")
    for _ in range(3):
        data = b"#bundle\0" + bytes(8) + len(data).to_bytes(4, "big") + data
    assert [address for address, _ in osc.messages(data)] == ["/a"]
    for _ in range(3):
        data = b"#bundle\0" + bytes(8) + len(data).to_bytes(4, "big") + data
    with pytest.raises(ValueError, match="bundles within"):
        list(osc.messages(data))


def test_the_newest_whole_pose_counts():
    motion = writhing(frames=3)
    heard = listener.Listener("127.0.0.1", 0)
    try:
        assert heard.poll() is None
        with VmcSender("127.0.0.1", heard.port) as sender:
            for n in range(3):
                sender.send(motion.skeleton, (motion.root_positions[n], motion.rotations[n]), n / 30)
        pose, moment = heard.poll()
        assert moment == pytest.approx(2 / 30)
        places, turns = VmcFigure(motion.skeleton).bones(motion.root_positions[2], motion.rotations[2])
        assert len(pose) == len(places)
        np.testing.assert_allclose(pose["Hips"], [*places[0], *turns[0]], atol=1e-6)
        assert heard.poll() is None
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            for data in (b"", b"x", osc_message("/VMC/Ext/Bone/Pos", "Hips", 1.0), b"#bundle\0" + bytes(12)):
                other.sendto(data, ("127.0.0.1", heard.port))
            nan = [float("nan")] * 7
            other.sendto(osc_message("/VMC/Ext/Bone/Pos", "Hips", *nan), ("127.0.0.1", heard.port))
            for k in range(140):  # names are taken up to a bound
                other.sendto(osc_message("/VMC/Ext/Bone/Pos", f"Bone{k}", *[0.0] * 7), ("127.0.0.1", heard.port))
            other.sendto(osc_message("/VMC/Ext/T", 9.0), ("127.0.0.1", heard.port))
        pose, moment = heard.poll()
        assert heard.refused == 5
        assert moment == 9.0
        assert 0 < len(pose) <= listener.MOST_BONES
    finally:
        heard.close()


def test_a_port_that_is_taken_is_an_error():
    first = listener.Listener("127.0.0.1", 0)
    try:
        with pytest.raises(OSError, match=r"in use|permitted"):
            listener.Listener("127.0.0.1", first.port)
    finally:
        first.close()


def test_the_add_on_says_what_it_is():
    import tomllib

    said = tomllib.loads((ADDON / "stridecast_vmc" / "blender_manifest.toml").read_text())
    assert (said["id"], said["type"]) == ("stridecast_vmc", "add-on")
    assert len(said["tagline"]) <= 64
    assert not said["tagline"].endswith(".")
    assert "network" in said["permissions"]


HEADLESS = """
import json, sys, time
sys.path.insert(0, sys.argv[1])
import bpy
import stridecast_vmc as addon
bpy.ops.wm.read_factory_settings(use_empty=True)
addon.register()
bpy.context.scene.render.fps = 30
settings = bpy.context.scene.stridecast_vmc
settings.port = 0
settings.record = True
assert bpy.ops.stridecast.start() == {"FINISHED"}
open(sys.argv[2], "w").write(str(addon._state["listener"].port))
said, until = [], time.monotonic() + 60
while len(said) < int(sys.argv[3]) and time.monotonic() < until:
    if addon.update():
        bpy.context.view_layer.update()
        figure = settings.figure
        heads = {b.name: list(figure.matrix_world @ b.head) for b in figure.pose.bones}
        said.append([addon._state["listener"]._time, heads])
    time.sleep(0.002)
bpy.context.scene.frame_set(4)
keyed = {b.name: list(settings.figure.matrix_world @ b.head) for b in settings.figure.pose.bones}
rest = {b.name: list(b.head_local) for b in settings.figure.data.bones}
assert bpy.ops.stridecast.stop() == {"FINISHED"}
addon.unregister()
json.dump({"said": said, "keyed": keyed, "rest": rest}, open(sys.argv[4], "w"))
"""

BONES = {"Hips": "hips", "Head": "head", "LeftHand": "left_hand", "RightToes": "right_toe", "LeftLowerLeg": "left_shin"}


def test_blender_shows_every_joint_where_we_have_it(tmp_path, blender):
    motion, frames = writhing(frames=12), 12
    script, told, out = tmp_path / "script.py", tmp_path / "port", tmp_path / "said.json"
    script.write_text(HEADLESS)
    command = [blender, str(script), str(ADDON), str(told), str(frames), str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as running:
        try:
            until = time.monotonic() + 60
            while not (told.exists() and told.read_text()) and running.poll() is None and time.monotonic() < until:
                time.sleep(0.05)
            assert told.exists(), running.communicate()[0]
            with VmcSender("127.0.0.1", int(told.read_text())) as sender:
                for n in range(frames):
                    sender.send(motion.skeleton, (motion.root_positions[n], motion.rotations[n]), n / 30)
                    time.sleep(0.1)
            output, _ = running.communicate(timeout=90)
        finally:
            running.kill()
    assert running.returncode == 0, output
    said = json.loads(out.read_text())
    world = kinematics.pose(motion).positions
    assert [round(30 * moment) for moment, _ in said["said"]] == list(range(frames))
    for n, (_, heads) in enumerate(said["said"]):
        for bone, role in BONES.items():
            x, y, z = heads[bone]
            np.testing.assert_allclose([x, z, -y], world[n, motion.skeleton.joint(role)], atol=1e-3, err_msg=bone)
    x, y, z = said["keyed"]["Hips"]  # recording began at frame 1
    np.testing.assert_allclose([x, z, -y], world[3, 0], atol=1e-3)
    assert said["rest"]["LeftHand"][0] > 0.5


MAKE_FBX = """
import bpy, json, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_anim.bvh(filepath=sys.argv[1], update_scene_fps=True, update_scene_duration=True)
bpy.ops.export_scene.fbx(filepath=sys.argv[2], add_leaf_bones=False, bake_anim_simplify_factor=0.0)
json.dump({}, open(sys.argv[3], "w"))
"""


def test_fbx_becomes_bvh_and_glb(tmp_path, blender):
    recipe = next(recipe for recipe in RECIPES if recipe.name == "walk_turns")
    motion = sample_take(recipe, seed=3).motion.clip(0, 60)
    write_bvh(tmp_path / "in.bvh", motion)
    run_in_blender(blender, MAKE_FBX, tmp_path, str(tmp_path / "in.bvh"), str(tmp_path / "walk.fbx"))

    def convert(*words: object) -> subprocess.CompletedProcess[str]:
        command = [blender, str(ADDON / "fbx_to_glb.py"), *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)

    for ending in ("bvh", "glb"):
        done = convert(tmp_path / "walk.fbx", tmp_path / f"walk.{ending}")
        assert done.returncode == 0, done.stderr
        assert "60 frames" in done.stdout
    assert (tmp_path / "walk.glb").read_bytes()[:4] == b"glTF"
    back = load_motion(tmp_path / "walk.bvh")
    roles = tuple(motion.skeleton.roles)
    ours, theirs = (kinematics.pose(m).positions[:, m.skeleton.chain(*roles)] for m in (motion, back))
    np.testing.assert_allclose(theirs, ours, atol=2e-3)
    for words, says in (
        ((tmp_path / "in.bvh", tmp_path / "x.bvh"), "there is no such FBX file"),
        ((tmp_path / "walk.fbx", tmp_path / "x.obj"), "the result is *.glb or *.bvh"),
        ((tmp_path / "walk.fbx",), "two files are needed"),
    ):
        done = convert(*words)
        assert done.returncode != 0
        assert says in done.stderr
    (tmp_path / "broken.fbx").write_bytes(b"Kaydara FBX Binary  \0" + bytes(50))
    done = convert(tmp_path / "broken.fbx", tmp_path / "x.bvh")
    assert done.returncode != 0
    assert not (tmp_path / "x.bvh").exists()


def test_datagrams_are_what_the_listener_takes():
    motion = writhing(frames=1)
    parts = datagrams(VmcFigure(motion.skeleton), motion.root_positions[0], motion.rotations[0], 0.0)
    assert sum(1 for part in parts for _ in osc.messages(part)) == 24
