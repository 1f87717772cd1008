"""GLB out: what an independent reader makes of it is where our kinematics has it, and Khronos has no complaint."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blenders import run_in_blender
from bodies import humanoid, standing, writhing
from glbs import Glb, complaints, played
from stridecast.body import kinematics
from stridecast.body.mannequin import mannequin
from stridecast.body.skinning import skin
from stridecast.errors import FileError, InputError, SkeletonError
from stridecast.formats.glb import GlbCrowd, body_glb, write_glb
from stridecast.model.motion import Motion

AGREE, COMPACT = 1e-5, 4e-4
HEIGHTS = (1.0, 0.9, 1.1, 1.0)


def people() -> list[tuple[Motion, float]]:
    return [(writhing(humanoid(k), frames=30, seed=n), 0.4 * n) for n, k in enumerate(HEIGHTS)]


def crowd(path: Path, *, compact: bool = False) -> list[tuple[Motion, float]]:
    scene, all_ = GlbCrowd(path, compact=compact), people()
    for motion, start in all_:
        scene.add(motion, name="Ann", start=start)
    scene.save()
    return all_


@settings(max_examples=12)
@given(
    seed=st.integers(0, 1000),
    compact=st.booleans(),
    scale=st.floats(0.3, 3.0),
    rate=st.sampled_from([24.0, 30.0, 120.0]),
)
def test_joints_and_skin_are_where_ours_are(tmp_path_factory, seed, compact, scale, rate):
    motion = writhing(humanoid(scale), frames=9, frame_rate=rate, seed=seed)
    path = tmp_path_factory.mktemp("glb") / "a.glb"
    write_glb(path, motion, compact=compact)
    glb = Glb(path.read_bytes())
    ours, joints = kinematics.pose(motion), glb["skins"][0]["joints"]
    assert [glb["nodes"][joint]["name"] for joint in joints] == list(motion.skeleton.names)
    agree = COMPACT * scale if compact else AGREE
    for frame in range(motion.frames):
        worlds = glb.world(0, frame / rate)
        assert np.abs(worlds[joints, :3, 3] - ours.positions[frame]).max() < agree
        vertices = skin(mannequin(motion.skeleton), kinematics.World(*(a[frame] for a in ours)))
        assert np.abs(glb.skinned(0, 0, worlds) - vertices).max() < agree + 1e-4 * scale  # weights are 16 bit


def test_a_body_at_rest_stands_on_the_floor():
    skeleton = humanoid()
    glb = Glb(body_glb(skeleton))
    worlds, mesh = glb.world(None, 0.0), mannequin(skeleton)
    there = glb.skinned(0, 0, worlds)
    assert there[:, 1].min() == pytest.approx(0.0, abs=1e-5)
    np.testing.assert_allclose(
        there - mesh.positions, [[0.0, -mesh.positions[:, 1].min(), 0.0]] * len(there), atol=1e-5
    )
    assert [glb["nodes"][k]["name"] for k in glb["skins"][0]["joints"]] == list(skeleton.names)
    assert not glb["animations"]
    assert len(glb["scenes"][0]["nodes"]) == 2


def test_several_takes_are_several_animations_with_their_events(tmp_path):
    takes = [replace(writhing(frames=8, seed=1), name="one", subject="Ann", source="/secret/a.bvh"), standing(frames=6)]
    planted = np.array([[0, 1], [1, 1], [1, 0], [0, 0], [0, 0], [1, 0], [1, 0], [1, 0]], bool)
    write_glb(tmp_path / "a.glb", takes, planted=[planted, None])
    glb = Glb((tmp_path / "a.glb").read_bytes())
    assert [animation["name"] for animation in glb["animations"]] == ["one", "standing"]
    told = glb["animations"][0]["extras"]["stridecast"]
    assert told == {
        "frame_rate": 30.0,
        "frames": 8,
        "subject": "Ann",
        "source": "a.bvh",
        "foot_plants": [
            {"foot": "right", "from": 0.0, "to": round(1 / 30, 6)},
            {"foot": "left", "from": round(1 / 30, 6), "to": round(2 / 30, 6)},
            {"foot": "left", "from": round(5 / 30, 6), "to": round(7 / 30, 6)},
        ],
    }
    for k, take in enumerate(takes):
        worlds = glb.world(k, 4 / 30)[glb["skins"][0]["joints"], :3, 3]
        assert np.abs(worlds - kinematics.pose(take).positions[4]).max() < AGREE


@pytest.mark.parametrize("compact", [False, True])
def test_a_crowd_shares_its_bodies_and_a_clock(tmp_path, compact):
    all_ = crowd(tmp_path / "a.glb", compact=compact)
    glb = Glb((tmp_path / "a.glb").read_bytes())
    assert len(glb["meshes"]) == 1
    assert len(glb["animations"]) == 1
    assert {one["inverseBindMatrices"] for one in glb["skins"]} == {glb["skins"][0]["inverseBindMatrices"]}
    for (motion, start), told in zip(all_, glb["skins"], strict=True):
        ours = kinematics.pose(motion).positions
        for frame in (0, 13, 29):
            there = glb.world(0, start + frame / 30)[told["joints"], :3, 3]
            assert np.abs(there - ours[frame]).max() < (COMPACT if compact else AGREE)
        for when, shown in ((start - 0.02, False), (start, True), (start + 29 / 30, True), (start + 1.01, False)):
            if 0 <= when <= 1.2 + 29 / 30:
                spread = np.ptp(glb.skinned(0, 0, glb.world(0, when)), axis=0) if told is glb["skins"][0] else None
                places = glb.world(0, when)[told["joints"], :3, 3]
                assert (np.ptp(places, axis=0).max() > 0.1) == shown
                assert spread is None or (spread.max() > 0.1) == shown


@pytest.mark.parametrize("begins", [-3.0, 1.7e9])
def test_any_clock_will_do(tmp_path, khronos, begins):
    scene = GlbCrowd(tmp_path / "a.glb")
    for late in (1.0, 0.0):
        scene.add(writhing(frames=30), start=begins + late)
    scene.save()
    glb = Glb((tmp_path / "a.glb").read_bytes())
    assert glb["animations"][0]["extras"]["stridecast"]["origin"] == begins
    ours = kinematics.pose(writhing(frames=30)).positions
    for told, late in zip(glb["skins"], (1.0, 0.0), strict=True):
        there = glb.world(0, late + 7 / 30)[told["joints"], :3, 3]
        assert np.abs(there - ours[7]).max() < AGREE
    assert complaints(khronos, tmp_path / "a.glb") == []


def test_other_proportions_are_other_meshes(tmp_path):
    lanky = humanoid()
    offsets = lanky.offsets.copy()
    offsets[lanky.chain("left_shin", "right_shin")] *= 1.3
    scene = GlbCrowd(tmp_path / "a.glb")
    motions = [standing(), standing(replace(lanky, offsets=offsets)), standing()]
    for motion in motions:
        scene.add(motion)
    scene.save()
    glb = Glb((tmp_path / "a.glb").read_bytes())
    assert len(glb["meshes"]) == 2
    for motion, told in zip(motions, glb["skins"], strict=True):
        assert np.abs(glb.world(0, 0.1)[told["joints"], :3, 3] - kinematics.pose(motion).positions[3]).max() < AGREE


def test_khronos_has_no_complaint(tmp_path, khronos):
    paths = [tmp_path / f"{name}.glb" for name in ("body", "two", "compact", "crowd", "small", "empty", "still")]
    paths[0].write_bytes(body_glb(humanoid()))
    write_glb(paths[1], [writhing(frames=30), standing()], planted=[np.ones((30, 2), bool), None])
    write_glb(paths[2], [writhing(frames=30), standing()], compact=True)
    crowd(paths[3])
    crowd(paths[4], compact=True)
    GlbCrowd(paths[5]).save()
    write_glb(paths[6], standing(frames=1))
    assert complaints(khronos, *paths) == []


def test_khronos_would_complain(tmp_path, khronos):
    data = body_glb(humanoid()).replace(b'"VEC4"', b'"VEC3"')
    (tmp_path / "bad.glb").write_bytes(data)
    assert complaints(khronos, tmp_path / "bad.glb")


@pytest.mark.parametrize("compact", [False, True])
@pytest.mark.parametrize("many", [False, True])
def test_three_has_joints_and_skin_where_ours_are(tmp_path, khronos, many, compact):
    path = tmp_path / "a.glb"
    all_ = crowd(path, compact=compact) if many else [(writhing(frames=30), 0.0)]
    if not many:
        write_glb(path, all_[0][0], compact=compact)
    said = played(khronos, path, [k / 30 for k in range(0, 66, 3)])
    agree = COMPACT if compact else AGREE
    for n, (motion, start) in enumerate(all_):
        pose, mesh = kinematics.pose(motion), mannequin(motion.skeleton)
        for k, figures in enumerate(said):
            frame = 3 * k - round(30 * start)
            if 0 <= frame < motion.frames:
                assert np.abs(np.array(figures[n]["joints"]) - pose.positions[frame]).max() < agree
                world = kinematics.World(*(a[frame] for a in pose))
                assert np.abs(figures[n]["corner"] - skin(mesh, world)[0]).max() < agree + 1e-4
            elif many:
                assert np.ptp(figures[n]["joints"], axis=0).max() < 1e-6  # not there


def test_small_and_fast(tmp_path):
    motion = writhing(frames=6000)
    raw = 6000 * (3 + 4 * motion.skeleton.joints) * 4
    began = time.perf_counter()
    write_glb(tmp_path / "a.glb", motion)
    assert time.perf_counter() - began < 3.0  # measured: 0.03 s
    write_glb(tmp_path / "b.glb", motion, compact=True)
    assert (tmp_path / "a.glb").stat().st_size < 1.1 * raw
    assert (tmp_path / "b.glb").stat().st_size < 0.6 * raw


def test_names_in_other_languages_and_as_joints_are_called(tmp_path):
    skeleton = replace(humanoid(), names=("Mannequin", 'a"\\b', *humanoid().names[2:]))
    write_glb(tmp_path / "a.glb", replace(standing(skeleton), name="Überquerung ✓"))
    glb = Glb((tmp_path / "a.glb").read_bytes())
    assert glb["animations"][0]["name"] == "Überquerung ✓"
    assert len(glb.names()) == skeleton.joints + 2  # nothing has the name of another


def test_refusals_change_nothing(tmp_path, monkeypatch):
    path = tmp_path / "a.glb"
    path.write_text("old")
    with pytest.raises(InputError, match="no motion"):
        write_glb(path, [])
    with pytest.raises(InputError, match="'standing' has another skeleton than 'writhing'"):
        write_glb(path, [writhing(), standing(humanoid(1.1))])
    with pytest.raises(InputError, match="a row for each frame"):
        write_glb(path, standing(frames=5), planted=np.ones((4, 2), bool))
    with pytest.raises(InputError, match="a row for each frame"):
        write_glb(path, [standing(frames=5)], planted=[None, None])
    with pytest.raises(SkeletonError, match="hips, legs, arms, head"):
        write_glb(path, replace(standing(), skeleton=replace(humanoid(), roles={})))
    with pytest.raises(FileError, match="No such file"):
        write_glb(tmp_path / "none" / "a.glb", standing())
    with pytest.raises(FileError, match="No such file"):
        GlbCrowd(tmp_path / "none" / "a.glb")
    scene = GlbCrowd(path)
    with pytest.raises(InputError, match="start must be a number"):
        scene.add(standing(), start=np.nan)
    with pytest.raises(InputError, match="a row for each of 60 frames, not 3"):
        scene.add(standing(), planted=np.ones((3, 2), bool))
    monkeypatch.setattr("stridecast.formats.gltf.LARGEST", (1 << 28) + 1000)
    with pytest.raises(FileError, match="4 GB"):
        scene.add(standing())
    scene.close()
    monkeypatch.undo()
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(FileError, match=r"a\.glb: cannot be written: No space left"):
        write_glb(path, standing())
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["a.glb"]


IMPORTED = """
import json, sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = 30
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
figures = [o for o in bpy.data.objects if o.type == "ARMATURE"]
said = {}
for code in json.loads(sys.argv[2]):
    bpy.context.scene.frame_set(code)
    said[code] = [{b.name: list(o.matrix_world @ b.head) for b in o.pose.bones} for o in figures]
json.dump(said, open(sys.argv[3], "w"))
"""


@pytest.mark.parametrize("many", [False, True])
def test_blender_has_joints_where_ours_are(tmp_path, blender, many):
    path = tmp_path / "a.glb"
    if many:
        all_ = crowd(path)
    else:
        all_ = [(writhing(frames=30), 0.0)]
        write_glb(path, all_[0][0])
    codes = list(range(0, 30, 3))
    said = run_in_blender(blender, IMPORTED, tmp_path, str(path), str(codes))
    for motion, start in all_:
        ours = kinematics.pose(motion).positions
        for code in codes:
            frame = code - round(30 * start)
            if 0 <= frame < motion.frames:
                gaps = []
                for figure in said[str(code)]:
                    places = np.array([figure[name] for name in motion.skeleton.names])
                    there = places[:, [0, 2, 1]] * [1.0, 1.0, -1.0]  # Blender's z is up
                    gaps.append(np.abs(there - ours[frame]).max())
                assert min(gaps) < 1e-3
