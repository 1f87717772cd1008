"""GLB in: what we write comes back, other people's rigs become ours, and damaged or hostile files are refused."""

from __future__ import annotations

import json
import struct
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from bodies import humanoid, standing, writhing
from glbs import Glb, complaints, packed
from stridecast.body import kinematics
from stridecast.errors import FileError, SkeletonError, StridecastError
from stridecast.formats.glb import GlbCrowd, body_glb, write_glb
from stridecast.formats.glb_motion import read_glb
from stridecast.formats.motion_files import write_motion
from stridecast.formats.recordings import load_motion, load_skeleton
from stridecast.model.motion import Motion
from synthetic_gait import gait, ramps


@pytest.fixture(scope="module")
def walk():
    return gait(ramps((1.2, 1.0), (1.2, 0.5))).motion


@pytest.mark.parametrize("compact", [False, True])
def test_what_we_write_comes_back(tmp_path, walk, compact):
    write_glb(tmp_path / "a.glb", walk, compact=compact)
    back = load_motion(tmp_path / "a.glb")
    assert back.skeleton.names == walk.skeleton.names
    assert dict(back.skeleton.roles) == dict(walk.skeleton.roles)
    assert back.frame_rate == walk.frame_rate
    agree = 5e-4 if compact else 1e-5
    np.testing.assert_allclose(back.skeleton.offsets, walk.skeleton.offsets, atol=1e-6)
    assert np.abs(kinematics.pose(back).positions - kinematics.pose(walk).positions).max() < agree
    ends = [kinematics.ends(m.skeleton, kinematics.pose(m)) for m in (back, walk)]
    assert np.abs(np.sort(ends[0], axis=1) - np.sort(ends[1], axis=1)).max() < agree


def test_the_first_of_a_crowd_comes_back_at_its_own_size(tmp_path, walk):
    small = replace(walk.skeleton, offsets=0.8 * walk.skeleton.offsets, end_offsets=0.8 * walk.skeleton.end_offsets)
    one = replace(walk, skeleton=small, root_positions=0.8 * walk.root_positions)
    scene = GlbCrowd(tmp_path / "a.glb")
    for motion, start in ((one, 1.5), (walk, 0.0)):
        scene.add(motion, start=start)
    scene.save()
    back = load_motion(tmp_path / "a.glb")
    assert np.abs(kinematics.pose(back).positions - kinematics.pose(one).positions).max() < 1e-5


def test_skins_that_are_endless_are_refused(tmp_path, walk, monkeypatch):
    write_glb(tmp_path / "a.glb", walk)
    glb = Glb((tmp_path / "a.glb").read_bytes())
    glb.document["skins"] *= 10
    (tmp_path / "b.glb").write_bytes(packed(glb.document, glb.numbers))
    assert load_skeleton(tmp_path / "b.glb").names == walk.skeleton.names
    monkeypatch.setattr("stridecast.formats.glb_motion.MOST_WALKED", 300)
    with pytest.raises(FileError, match="has skins with more than 300 joints"):
        load_skeleton(tmp_path / "b.glb")


def animators_rig(path: Path, walk: Motion, seed: int, unit: float, skinned: bool) -> None:
    """The rig of an animator: turned joints, centimetres below a scaled node that is turned to z up."""
    write_glb(path, walk)
    glb, rng = Glb(path.read_bytes()), np.random.default_rng(seed)
    skeleton = walk.skeleton
    rest = Rotation.random(skeleton.joints, random_state=rng)
    offsets = skeleton.offsets.copy()
    tilt, arms = Rotation.from_euler("x", -90, degrees=True), []
    document: dict[str, Any] = {k: v for k, v in glb.document.items() if k in ("asset", "scene")}
    document["scenes"] = [{"nodes": [0]}]
    joints = range(1, skeleton.joints + 1)
    document["nodes"] = [
        {"name": "Armature", "children": [1], "rotation": tilt.as_quat().tolist(), "scale": [unit] * 3}
    ]
    for k in range(skeleton.joints):
        parent = int(skeleton.parents[k])
        above = rest[parent] if parent >= 0 else tilt
        arms.append(above.inv().apply(offsets[k]) / unit)
        turn = above.inv() * rest[k]
        node = {"name": skeleton.names[k], "translation": arms[k].tolist(), "rotation": turn.as_quat().tolist()}
        children = [int(c) + 1 for c in np.flatnonzero(skeleton.parents == k)]
        document["nodes"].append({**node, **({"children": children} if children else {})})
    numbers, views, accessors = b"", [], []

    def put(array: np.ndarray, kind: str) -> int:
        nonlocal numbers
        data = array.astype("<f4").tobytes()
        views.append({"buffer": 0, "byteOffset": len(numbers), "byteLength": len(data)})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5126, "count": len(array), "type": kind})
        numbers += data
        return len(accessors) - 1

    times = put(np.arange(walk.frames) / walk.frame_rate, "SCALAR")
    samplers = [{"input": times, "output": put(tilt.inv().apply(walk.root_positions.copy()) / unit, "VEC3")}]
    channels = [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]
    for k in range(skeleton.joints):
        parent = int(skeleton.parents[k])
        above = rest[parent] if parent >= 0 else tilt
        own = Rotation.from_quat(walk.rotations[:, k][:, [1, 2, 3, 0]])
        turn = (above.inv() * own * rest[k]).as_quat()
        samplers.append({"input": times, "output": put(turn, "VEC4")})
        channels.append({"sampler": k + 1, "target": {"node": k + 1, "path": "rotation"}})
    if skinned:
        places = kinematics.rest(skeleton).positions
        binds = np.tile(np.eye(4), (skeleton.joints, 1, 1))
        for k in range(skeleton.joints):
            bind = np.eye(4)
            bind[:3, :3], bind[:3, 3] = unit * rest[k].as_matrix(), places[k]
            binds[k] = np.linalg.inv(bind).T
        document["skins"] = [{"joints": list(joints), "inverseBindMatrices": put(binds.reshape(-1, 16), "MAT4")}]
        for node in document["nodes"][1:]:  # nodes may stand anywhere: the bind pose is at rest
            node["rotation"] = Rotation.random(random_state=rng).as_quat().tolist()
    document |= {"bufferViews": views, "accessors": accessors, "buffers": [{"byteLength": len(numbers)}]}
    document["animations"] = [{"channels": channels, "samplers": samplers}]
    path.write_bytes(packed(document, numbers))


RIGS = {"seed": st.integers(0, 1000), "unit": st.sampled_from([1.0, 0.01]), "skinned": st.booleans()}


@settings(max_examples=20)
@given(**RIGS)
def test_joints_may_rest_at_any_angle_and_hang_from_anything(tmp_path_factory, walk, seed, unit, skinned):
    path = tmp_path_factory.mktemp("rig") / "a.glb"
    animators_rig(path, walk, seed, unit, skinned)
    back = load_motion(path)
    assert back.frame_rate == walk.frame_rate
    assert np.abs(kinematics.pose(back).positions - kinematics.pose(walk).positions).max() < 2e-4


@settings(max_examples=20)
@given(**RIGS)
def test_any_rig_is_moved(tmp_path_factory, walk, seed, unit, skinned):
    folder = tmp_path_factory.mktemp("rig")
    animators_rig(folder / "a.glb", walk, seed, unit, skinned)
    moved = writhing(load_skeleton(folder / "a.glb"), frames=20, seed=seed)
    write_motion(folder / "b.glb", moved, character=folder / "a.glb")
    glb = Glb((folder / "b.glb").read_bytes())
    world = kinematics.pose(moved).positions
    for frame in (0, 7, 19):
        nodes = glb.world(0, frame / moved.frame_rate)
        found = np.array([nodes[glb.names()[name], :3, 3] for name in moved.skeleton.names])
        assert np.abs(found - world[frame]).max() < 2e-4


def test_a_character_keeps_its_own_mesh(tmp_path, walk, khronos):
    write_glb(tmp_path / "a.glb", walk)
    rig = Glb((tmp_path / "a.glb").read_bytes())
    moved = writhing(load_skeleton(tmp_path / "a.glb"), frames=20)
    write_motion(tmp_path / "b.glb", moved, character=tmp_path / "a.glb")
    glb = Glb((tmp_path / "b.glb").read_bytes())
    assert complaints(khronos, tmp_path / "b.glb") == []
    for part in ("meshes", "skins", "materials", "scenes"):
        assert glb[part] == rig[part]
    assert glb.numbers.startswith(rig.numbers)
    assert len(glb["animations"]) == 1
    back = load_motion(tmp_path / "b.glb")
    assert np.abs(kinematics.pose(back).positions - kinematics.pose(moved).positions).max() < 1e-5
    with pytest.raises(SkeletonError, match="another skeleton"):
        write_motion(tmp_path / "c.glb", stretched(moved), character=tmp_path / "a.glb")
    assert not (tmp_path / "c.glb").exists()


def stretched(motion: Motion) -> Motion:
    """Of a body with longer shins."""
    offsets = motion.skeleton.offsets.copy()
    offsets[motion.skeleton.chain("left_foot", "right_foot")] *= 1.3
    return replace(motion, skeleton=replace(motion.skeleton, offsets=offsets))


def figure(mode: str, times: np.ndarray, turns: np.ndarray, places: np.ndarray) -> bytes:
    """Two joints whose root moves by these keys."""
    arrays = [times, turns, places]
    kinds, starts = ["SCALAR", "VEC4", "VEC3"], np.cumsum([0] + [4 * a.size for a in arrays])
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{"children": [1], "name": "a"}, {"translation": [0, 1, 0], "name": "b"}],
        "buffers": [{"byteLength": int(starts[-1])}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(s), "byteLength": 4 * a.size} for s, a in zip(starts, arrays, strict=False)
        ],
        "accessors": [
            {"bufferView": k, "componentType": 5126, "count": len(a), "type": kind}
            for k, (a, kind) in enumerate(zip(arrays, kinds, strict=True))
        ],
        "animations": [
            {
                "samplers": [{"input": 0, "output": k, "interpolation": mode} for k in (1, 2)],
                "channels": [
                    {"sampler": 0, "target": {"node": 0, "path": "rotation"}},
                    {"sampler": 1, "target": {"node": 0, "path": "translation"}},
                    {"sampler": 0, "target": {"node": 1, "path": "rotation"}},
                ],
            }
        ],
    }
    return packed(document, b"".join(a.astype("<f4").tobytes() for a in arrays))


@pytest.mark.parametrize("mode", ["LINEAR", "STEP", "CUBICSPLINE"])
def test_keys_are_interpolated_as_the_standard_says(tmp_path, mode):
    times, rng = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 1.0, 1.1]), np.random.default_rng(3)
    turns = Rotation.from_rotvec(np.linspace([0, 0, 0], [0, 2.0, 0.5], 7)).as_quat()
    places, slopes = rng.normal(size=(7, 3)), rng.normal(size=(2, 7, 3))
    if mode == "CUBICSPLINE":
        three = np.stack((np.zeros_like(turns), turns, np.zeros_like(turns)), axis=1).reshape(-1, 4)
        moved = np.stack((slopes[0], places, slopes[1]), axis=1).reshape(-1, 3)
        (tmp_path / "a.glb").write_bytes(figure(mode, times, three, moved))
    else:
        (tmp_path / "a.glb").write_bytes(figure(mode, times, turns, places))
    back = read_glb(tmp_path / "a.glb")
    assert back.frame_rate == pytest.approx(10.0)
    when = np.arange(12) / 10
    np.testing.assert_allclose(len(back.root_positions), 12)
    at = np.clip(np.searchsorted(times, when + 1e-5, side="right") - 1, 0, 5)
    after = at + 1
    if mode == "STEP":
        wanted = places[np.searchsorted(times, when + 1e-5, side="right") - 1]
    elif mode == "LINEAR":
        wanted = np.stack([np.interp(when, times, places[:, k]) for k in range(3)], axis=1)
        middle = Rotation.from_quat(turns[4]) * Rotation.from_rotvec(
            0.5 * (Rotation.from_quat(turns[4]).inv() * Rotation.from_quat(turns[5])).as_rotvec()
        )
        np.testing.assert_allclose(back.rotations[7, 0][[1, 2, 3, 0]], middle.as_quat(), atol=1e-6)
    else:
        wanted = np.array(
            [
                CubicHermiteSpline(times[[i, j]], places[[i, j]], np.stack((slopes[1, i], slopes[0, j])))(t)
                for t, i, j in zip(when, at, after, strict=True)
            ]
        )
    np.testing.assert_allclose(back.root_positions, wanted, atol=2e-5)


def broken(data: bytes, change) -> bytes:
    glb = Glb(data)
    document = json.loads(json.dumps(glb.document))
    change(document)
    return packed(document, glb.numbers)


def set_at(*where: object, to: object):
    def change(document: Any) -> None:
        for key in where[:-1]:
            document = document[key]
        document[where[-1]] = to

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (set_at("accessors", 7, "count", to=2**40), "claims 1099511627776 entries"),
        (set_at("accessors", 7, "count", to=2**20), "reaches beyond the numbers"),
        (set_at("accessors", 7, "count", to=0), "is empty"),
        (set_at("accessors", 7, "count", to=-1), "count of accessor 7 .* must be a whole number from 0, not -1"),
        (set_at("accessors", 7, "count", to=True), "must be a whole number"),
        (set_at("accessors", 7, "byteOffset", to=10**9), "reaches beyond"),
        (set_at("accessors", 7, "bufferView", to=999), "points at bufferViews 999"),
        (set_at("accessors", 7, "type", to="VEC2"), "must be VEC3|must be SCALAR"),
        (set_at("accessors", 7, "sparse", to={}), "sparse, which is not read"),
        (set_at("bufferViews", 6, "byteLength", to=10**9), "reaches beyond"),
        (set_at("bufferViews", 6, "byteStride", to=1), "reaches beyond"),
        (set_at("bufferViews", 6, "extensions", to={"EXT_meshopt_compression": {}}), "compressed by meshopt"),
        (set_at("buffers", 0, "uri", to="../../etc/passwd"), "numbers in another file, which is not opened"),
        (set_at("buffers", 0, "uri", to="file:///etc/passwd"), "numbers in another file, which is not opened"),
        (set_at("nodes", 1, "children", to=[0]), "hangs from themselves|hang from themselves|hangs from node"),
        (set_at("nodes", 3, "children", to=[1]), "hangs from node"),
        (set_at("nodes", 1, "children", to=[10**6]), "points at nodes 1000000"),
        (set_at("nodes", 1, "children", to=7), "children of node 1 must be a list"),
        (set_at("nodes", 0, "scale", to=[1, 2, 1]), "has the scale"),
        (set_at("nodes", 0, "scale", to=[0, 0, 0]), "has the scale"),
        (set_at("nodes", 0, "translation", to=[0, 1e999, 0]), "Infinity is no number of JSON"),
        (set_at("nodes", 0, "translation", to=[0, 10**400, 0]), "must be finite"),
        (set_at("nodes", 0, "translation", to=[0, "1", 0]), "translation of node 0 must be 3 numbers"),
        (set_at("nodes", 0, "matrix", to=[0] * 16), "mirrors, flattens"),
        (set_at("nodes", to={}), "nodes must be a list of objects"),
        (set_at("nodes", to=[{}] * (2**17 + 1)), "131073 nodes; at most"),
        (set_at("animations", to=[]), "has no animation"),
        (set_at("animations", 0, "channels", to=[]), "no animation that turns the joints"),
        (set_at("animations", 0, "channels", 0, "sampler", to=99), "points at sampler 99"),
        (set_at("animations", 0, "channels", 0, "target", to=None), "channel 0 has no target"),
        (set_at("animations", 0, "channels", 0, "target", "node", to=-1), "points at nodes -1"),
        (set_at("animations", 0, "samplers", 0, "interpolation", to="MAGIC"), "interpolation 'MAGIC'"),
        (set_at("animations", 0, "samplers", 0, "interpolation", to="CUBICSPLINE"), "150 would be right"),
        (set_at("animations", 0, "samplers", 1, "input", to=7), "must be SCALAR"),
        (set_at("skins", 0, "joints", to=[]), "must have a list of joints"),
        (set_at("skins", 0, "joints", to=[10**7]), "points at nodes"),
        (set_at("skins", 0, "inverseBindMatrices", to=0), "must be MAT4"),
    ],
)
def test_hostile_files_are_refused(tmp_path, change, words):
    path = tmp_path / "a.glb"
    write_glb(path, writhing(frames=50))
    path.write_bytes(broken(path.read_bytes(), change))
    with pytest.raises(FileError, match=rf"a\.glb: .*({words})"):
        load_motion(path)


def test_what_would_fill_memory_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.glb"
    write_glb(path, writhing(frames=50))

    def again(document: Any) -> None:
        document["animations"][0]["channels"] *= 40

    data = path.read_bytes()
    path.write_bytes(broken(data, again))
    monkeypatch.setattr("stridecast.formats.gltf_reading.MOST_IN_ALL", 100_000)
    with pytest.raises(FileError, match="more than 100000 numbers"):
        read_glb(path)
    monkeypatch.undo()
    monkeypatch.setattr("stridecast.formats.glb_motion.MOST_POSES", 24 * 40)
    path.write_bytes(data)
    with pytest.raises(FileError, match="at most 40 are read"):
        read_glb(path)

    def deep(document: Any) -> None:
        first = len(document["nodes"])
        document["nodes"] += [{"children": [first + k + 1]} for k in range(50_000)] + [{"children": [0]}]

    monkeypatch.undo()
    path.write_bytes(broken(data, deep))
    with pytest.raises(FileError, match="nested more than 1024 deep"):
        read_glb(path)


def test_times_that_lie_are_refused(tmp_path):
    turns, places = np.tile([0.0, 0, 0, 1], (3, 1)), np.zeros((3, 3))
    for times, words in (
        ([0.0, 2.0, 1.0], "must increase"),
        ([-1.0, 0.0, 1.0], "must increase"),
        ([0.0, np.nan, 1.0], "not finite, at entry 1"),
        ([0.0, 0.001, 1e9], "at most 262144 are read"),
    ):
        (tmp_path / "a.glb").write_bytes(figure("LINEAR", np.array(times), turns, places))
        with pytest.raises(FileError, match=words):
            read_glb(tmp_path / "a.glb")
    (tmp_path / "a.glb").write_bytes(figure("LINEAR", np.arange(3.0), 0 * turns, places))
    with pytest.raises(FileError, match="node 0 has a rotation without a direction"):
        read_glb(tmp_path / "a.glb")


@pytest.mark.parametrize("length", [0, 3, 12, 19, 30, 5000, -4])
def test_files_that_are_cut_are_refused(tmp_path, length):
    path = tmp_path / "a.glb"
    write_glb(path, standing())
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(FileError, match=r"a\.glb: (is cut|is no GLB|is empty)"):
        load_motion(path)


def test_what_is_no_glb_is_refused(tmp_path):
    deep = b'{"a":' * 200_000
    claims = struct.pack("<4sIII4s", b"glTF", 2, 20, 2**32 - 1, b"JSON")
    for data, words in (
        (packed({})[:12] + struct.pack("<I4s", len(deep), b"JSON") + deep, "is cut|nested too deeply"),
        (struct.pack("<4sIII4s", b"glTF", 2, 20 + len(deep), len(deep), b"JSON") + deep, "nested too deeply"),
        (claims, "is cut"),
        (packed({})[:4] + struct.pack("<I", 1) + packed({})[8:], "version 1; version 2 is read"),
        (packed([]), "JSON that is no object"),
        (packed({"nodes": [{"translation": [float("nan")] * 3}]}), "NaN is no number"),
        (b"HIERARCHY\nROOT a\n", "looks like a BVH recording"),
    ):
        (tmp_path / "a.glb").write_bytes(data)
        with pytest.raises(FileError, match=words):
            read_glb(tmp_path / "a.glb")
    with pytest.raises(FileError, match="No such file"):
        load_motion(tmp_path / "none.glb")


@settings(max_examples=60)
@given(st.data())
def test_flipped_bytes_never_break_the_reader(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "flipped.glb"
    write_glb(path, standing(frames=5))
    whole = bytearray(path.read_bytes())
    length = struct.unpack_from("<I", whole, 12)[0]
    for _ in range(data.draw(st.integers(1, 6))):
        whole[data.draw(st.integers(0, 20 + length))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole)
    with suppress(StridecastError):
        load_motion(path)


def test_names_and_several_takes(tmp_path):
    skeleton = replace(humanoid(), names=("Hips", "Hüfte", *humanoid().names[2:]))
    write_glb(tmp_path / "a.glb", [writhing(skeleton, frames=30), standing(skeleton)])
    back = read_glb(tmp_path / "a.glb")
    assert back.names == skeleton.names
    assert back.notes == ("of 2 animations the first is read",)


def test_a_skeleton_needs_no_animation(tmp_path, walk):
    (tmp_path / "body.glb").write_bytes(body_glb(walk.skeleton))
    write_glb(tmp_path / "walk.glb", walk)
    for name in ("body", "walk"):
        skeleton = load_skeleton(tmp_path / f"{name}.glb")
        assert skeleton.names == walk.skeleton.names
        assert dict(skeleton.roles) == dict(walk.skeleton.roles)
        np.testing.assert_allclose(skeleton.offsets, walk.skeleton.offsets, atol=1e-6)
    with pytest.raises(FileError, match="has no animation"):
        load_motion(tmp_path / "body.glb")
    (tmp_path / "none.glb").write_bytes(packed({}))
    with pytest.raises(FileError, match="has no animation"):
        load_skeleton(tmp_path / "none.glb")
