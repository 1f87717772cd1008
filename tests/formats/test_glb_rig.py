"""A crowd of somebody's own character: everybody has the vertices that a file of their own would have."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blenders import run_in_blender
from bodies import humanoid, standing, writhing
from glb_rigs import artists_rig
from glbs import Glb, complaints, packed, played
from stridecast.body import kinematics
from stridecast.body.recasting import recast
from stridecast.errors import FileError, InputError, SkeletonError, StridecastError
from stridecast.formats.glb import GlbCrowd
from stridecast.formats.glb_character import write_character
from stridecast.formats.recordings import load_motion, load_skeleton
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton
from synthetic_gait import gait, ramps

AGREE, COMPACT = 2e-4, 2e-3
SIZES = (1.0, 0.85, 1.2)
PARTS = ("Coat", "Legs", "Brim")


def sized(skeleton: Skeleton, size: float) -> Skeleton:
    return replace(skeleton, offsets=size * skeleton.offsets, end_offsets=size * skeleton.end_offsets)


def crowd(path: Path, rig: Path, seed: int = 0, *, compact: bool = False) -> list[tuple[Motion, float]]:
    """People of different sizes, one after the other."""
    scene, skeleton = GlbCrowd(path, compact=compact, character=rig), load_skeleton(rig)
    people = []
    for k, size in enumerate(SIZES):
        motion = writhing(sized(skeleton, size), frames=24, seed=seed + k)
        scene.add(motion, name=f"Person {k}", start=0.3 * k)
        people.append((motion, 0.3 * k))
    scene.save()
    return people


def meshes(glb: Glb) -> list[dict[str, int]]:
    """By person: nodes with a mesh, by name."""
    roots = glb["scenes"][0]["nodes"]
    first = [k for k, root in enumerate(roots) if "start" in glb["nodes"][root].get("extras", {}).get("stridecast", {})]
    out = []
    for begin, end in zip(first, [*first[1:], len(roots)], strict=True):
        nodes = [node for root in roots[begin:end] for node in glb.below(root)]
        out.append({glb["nodes"][node]["name"]: node for node in nodes if "mesh" in glb["nodes"][node]})
    return out


@settings(max_examples=8)
@given(
    seed=st.integers(0, 1000),
    unit=st.sampled_from([1.0, 0.01]),
    armature=st.sampled_from([1.0, 0.01, 2.5]),
    body=st.floats(0.85, 1.15),
    compact=st.booleans(),
)
def test_everybody_looks_as_in_a_file_of_their_own(tmp_path_factory, seed, unit, armature, body, compact):
    folder = tmp_path_factory.mktemp("rig")
    artists_rig(folder / "rig.glb", humanoid(body), seed=seed, unit=unit, armature=armature)
    people = crowd(folder / "crowd.glb", folder / "rig.glb", seed, compact=compact)
    many = Glb((folder / "crowd.glb").read_bytes())
    agree = COMPACT if compact else AGREE
    for size, (motion, start), found in zip(SIZES, people, meshes(many), strict=True):
        write_character(folder / "one.glb", motion, folder / "rig.glb")
        one = Glb((folder / "one.glb").read_bytes())
        assert sorted(found) == sorted(PARTS)
        for frame in range(0, 20, 2):
            worlds, own = many.world(0, start + frame / 30), one.world(0, frame / 30)
            for name, node in found.items():
                wanted = size * unit * one.seen(one.names()[name], own)  # that file keeps its size and unit
                assert np.abs(many.seen(node, worlds) - wanted).max() < agree


@settings(max_examples=6)
@given(seed=st.integers(0, 1000), unit=st.sampled_from([1.0, 0.01]), armature=st.sampled_from([1.0, 0.01]))
def test_joints_are_where_ours_are(tmp_path_factory, seed, unit, armature):
    folder = tmp_path_factory.mktemp("rig")
    artists_rig(folder / "rig.glb", humanoid(), seed=seed, unit=unit, armature=armature)
    people = crowd(folder / "crowd.glb", folder / "rig.glb", seed)
    glb = Glb((folder / "crowd.glb").read_bytes())
    roots = [root for root in glb["scenes"][0]["nodes"] if "mesh" not in glb["nodes"][root]]
    for root, (motion, start) in zip(roots, people, strict=True):
        nodes = {glb["nodes"][node]["name"]: node for node in glb.below(root)}
        ours = kinematics.pose(motion).positions
        for frame in (0, 11, 23):
            worlds = glb.world(0, start + frame / 30)
            there = worlds[[nodes[name] for name in motion.skeleton.names], :3, 3]
            assert np.abs(there - ours[frame]).max() < AGREE
        write_character(folder / "one.glb", motion, folder / "rig.glb")
        one, size = Glb((folder / "one.glb").read_bytes()), unit * motion.skeleton.leg_length / humanoid().leg_length
        there = one.world(0, 11 / 30)[[one.names()[name] for name in motion.skeleton.names], :3, 3]
        assert np.abs(size * there - ours[11]).max() < AGREE


def test_what_can_be_shared_is_there_once(tmp_path):
    artists_rig(tmp_path / "rig.glb", humanoid())
    crowd(tmp_path / "crowd.glb", tmp_path / "rig.glb")
    rig, many = (Glb((tmp_path / f"{name}.glb").read_bytes()) for name in ("rig", "crowd"))
    for part in ("meshes", "materials", "textures", "images", "samplers"):
        assert many[part] == rig[part]
    assert many.numbers.startswith(rig.numbers)
    assert len(many["skins"]) == len(SIZES) * len(rig["skins"])
    for k, skin in enumerate(many["skins"]):
        own = rig["skins"][k % 2]
        assert skin["inverseBindMatrices"] == own["inverseBindMatrices"]
        names = [[glb["nodes"][joint]["name"] for joint in one["joints"]] for glb, one in ((many, skin), (rig, own))]
        assert names[0] == names[1]
        assert ("skeleton" in skin) == ("skeleton" in own)
    names = [node.get("name") for node in many["nodes"]]
    for name in ("Armature", "Hips", "Socket", "Brim", "Coat"):
        assert names.count(name) == len(SIZES)
    assert {"Eye", "Lamp", "Crate", "Elsewhere"}.isdisjoint(names)
    assert not many["cameras"]
    assert [animation["name"] for animation in many["animations"]] == ["Crowd"]
    assert many["extensionsUsed"] == ["KHR_texture_transform", "KHR_materials_ior"]
    assert not many["extensions"]
    assert many["asset"]["copyright"] == "Ann Artist"
    assert [node["extras"] for node in many["nodes"] if node.get("name") == "Legs"] == [{"of": "the artist"}] * 3


def changed(path: Path, change: Callable[[Any], None]) -> None:
    """A file whose document is another."""
    glb = Glb(path.read_bytes())
    change(glb.document)
    path.write_bytes(packed(glb.document, glb.numbers))


def test_extensions_go_with_what_has_them(tmp_path, khronos):
    def change(document: Any) -> None:
        """Coats of two colours, a vertex format that only its name tells, and a thing that points at nodes."""
        mapped = [{"material": 0, "variants": [0]}]
        document["meshes"][0]["primitives"][0]["extensions"] = {"KHR_materials_variants": {"mappings": mapped}}
        document["extensions"] |= {"KHR_materials_variants": {"variants": [{"name": "red"}]}, "OF_nodes": {"node": 3}}
        brim, eye = (next(n for n in document["nodes"] if n.get("name") == name) for name in ("Brim", "Eye"))
        brim["camera"] = eye["camera"]
        brim["extensions"] = {"KHR_node_visibility": {"visible": True}, "OF_nodes": {"node": 4}}
        used = ["KHR_materials_variants", "KHR_mesh_quantization", "KHR_node_visibility", "OF_nodes"]
        document["extensionsUsed"] += used
        document["extensionsRequired"] = ["KHR_mesh_quantization", "OF_nodes"]

    artists_rig(tmp_path / "rig.glb", humanoid())
    changed(tmp_path / "rig.glb", change)
    crowd(tmp_path / "crowd.glb", tmp_path / "rig.glb")
    glb = Glb((tmp_path / "crowd.glb").read_bytes())
    kept = ["KHR_materials_variants", "KHR_mesh_quantization", "KHR_node_visibility"]
    assert glb["extensionsUsed"] == ["KHR_texture_transform", "KHR_materials_ior", *kept]
    assert glb["extensionsRequired"] == ["KHR_mesh_quantization"]
    assert glb["extensions"] == {"KHR_materials_variants": {"variants": [{"name": "red"}]}}
    brims = [node for node in glb["nodes"] if node.get("name") == "Brim"]
    assert [node["extensions"] for node in brims] == [{"KHR_node_visibility": {"visible": True}}] * len(SIZES)
    assert not any("camera" in node for node in glb["nodes"])
    assert complaints(khronos, tmp_path / "crowd.glb") == []


def test_a_figure_without_skins_walks_too(tmp_path):
    def change(document: Any) -> None:
        """Only the hat is left, and joints are those that an animation turns."""
        del document["skins"]
        nodes = document["nodes"]
        for node in nodes:
            if node.pop("skin", None) is not None:
                del node["mesh"]
        turned = [k for k, node in enumerate(nodes) if node.get("name") in humanoid().names]
        channels = [{"sampler": 0, "target": {"node": k, "path": "rotation"}} for k in turned]
        document["animations"][0]["channels"] = channels

    artists_rig(tmp_path / "rig.glb", humanoid(), seed=1, matrices=False)
    changed(tmp_path / "rig.glb", change)
    people = crowd(tmp_path / "crowd.glb", tmp_path / "rig.glb")
    many = Glb((tmp_path / "crowd.glb").read_bytes())
    for size, (motion, start), found in zip(SIZES, people, meshes(many), strict=True):
        write_character(tmp_path / "one.glb", motion, tmp_path / "rig.glb")
        one = Glb((tmp_path / "one.glb").read_bytes())
        assert list(found) == ["Brim"]
        wanted = size * one.seen(one.names()["Brim"], one.world(0, 0.5))
        assert np.abs(many.seen(found["Brim"], many.world(0, start + 0.5)) - wanted).max() < AGREE


def test_it_is_read_again(tmp_path):
    artists_rig(tmp_path / "rig.glb", humanoid(), seed=3, armature=0.01)
    walk = gait(ramps((1.2, 1.0), (1.2, 0.5))).motion
    skeleton = sized(load_skeleton(tmp_path / "rig.glb"), 0.9)
    motion = recast(walk, skeleton, np.zeros((walk.frames, 2), bool))
    scene = GlbCrowd(tmp_path / "crowd.glb", character=tmp_path / "rig.glb")
    scene.add(motion, start=0.5)
    scene.add(motion)
    scene.save()
    back = load_motion(tmp_path / "crowd.glb")
    order = [back.skeleton.names.index(name) for name in motion.skeleton.names]
    there, ours = kinematics.pose(back).positions[:, order], kinematics.pose(motion).positions
    assert np.abs(there[-motion.frames :] - ours).max() < 1e-4  # it stands until it begins


def test_who_is_not_there_has_no_size(tmp_path):
    artists_rig(tmp_path / "rig.glb", humanoid())
    crowd(tmp_path / "crowd.glb", tmp_path / "rig.glb")
    glb = Glb((tmp_path / "crowd.glb").read_bytes())
    last = meshes(glb)[-1]
    for when, there in ((0.1, False), (0.61, True), (0.6 + 23 / 30, True)):
        worlds = glb.world(0, when)
        assert all((np.ptp(glb.seen(node, worlds), axis=0).max() > 0.1) == there for node in last.values())


@pytest.mark.parametrize("compact", [False, True])
def test_khronos_complains_no_more_than_of_the_rig(tmp_path, khronos, compact):
    paths = [tmp_path / f"{name}.glb" for name in ("rig", "crowd", "one")]
    artists_rig(paths[0], humanoid(), armature=0.01)
    ((motion, _), *_) = crowd(paths[1], paths[0], compact=compact)
    write_character(paths[2], motion, paths[0], compact=compact, planted=np.ones((24, 2), bool))
    before, many, one = (complaints(khronos, path) for path in paths)
    assert {said.split()[1] for said in before} <= {"NODE_SKINNED_MESH_NON_ROOT"}
    assert many == []  # skinned meshes are nodes of the scene
    assert len(one) == len(before)


def test_three_shows_what_our_reader_shows(tmp_path, khronos):
    artists_rig(tmp_path / "rig.glb", humanoid(), seed=5, picture=False)  # node draws none
    people = crowd(tmp_path / "crowd.glb", tmp_path / "rig.glb")
    glb = Glb((tmp_path / "crowd.glb").read_bytes())
    times = [0.0, 0.4, 0.7]
    for time, figures in zip(times, played(khronos, tmp_path / "crowd.glb", times), strict=True):
        worlds = glb.world(0, time)
        nodes = [node for node in glb["scenes"][0]["nodes"] if "skin" in glb["nodes"][node]]
        assert len(figures) == len(nodes) == 2 * len(people)
        for node, figure in zip(nodes, figures, strict=True):
            assert np.abs(glb.seen(node, worlds)[0] - figure["corner"]).max() < 1e-4


def test_a_file_of_its_own_tells_who_stands_and_can_be_compact(tmp_path):
    artists_rig(tmp_path / "rig.glb", humanoid())
    motion = replace(standing(load_skeleton(tmp_path / "rig.glb")), name="Ann", source="/secret/a.bvh")
    for name, compact in (("large", False), ("small", True)):
        planted = np.ones((motion.frames, 2), bool)
        write_character(tmp_path / f"{name}.glb", motion, tmp_path / "rig.glb", compact=compact, planted=planted)
    large, small = (Glb((tmp_path / f"{name}.glb").read_bytes()) for name in ("large", "small"))
    told = small["animations"][0]["extras"]["stridecast"]
    assert told["source"] == "a.bvh"
    assert [plant["foot"] for plant in told["foot_plants"]] == ["left", "right"]
    assert len(small.numbers) < 0.8 * len(large.numbers)
    assert small["cameras"] == large["cameras"] != []
    with pytest.raises(InputError, match="a row for each of 60 frames, not 3"):
        write_character(tmp_path / "c.glb", motion, tmp_path / "rig.glb", planted=np.ones((3, 2), bool))
    assert not (tmp_path / "c.glb").exists()


def set_at(*where: Any, to: Any):
    def change(document: Any) -> None:
        for key in where[:-1]:
            document = document[key]
        document[where[-1]] = to

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (set_at("images", 0, to={"uri": "coat.png"}), r"the picture 'coat\.png' in another file"),
        (set_at("buffers", to=[{"byteLength": 4}, {"byteLength": 4, "uri": "a.bin"}]), "numbers in another file"),
        (set_at("bufferViews", 0, "extensions", to={"EXT_meshopt_compression": {}}), "compressed by meshopt"),
        (set_at("scenes", 1, "nodes", to=[]), "no scene that shows its skeleton"),
        (set_at("scenes", 1, "nodes", to=[10**6]), "points at nodes 1000000"),
        (set_at("scenes", 1, "nodes", to={}), "nodes of its scene must be a list"),
        (set_at("scene", to=7), "points at scenes 7"),
        (set_at("skins", 1, "joints", to=[-1]), "points at nodes -1"),
        (set_at("skins", 1, "skeleton", to=[]), "points at nodes"),
        (set_at("materials", to={}), "materials must be a list of objects"),
    ],
)
def test_files_that_cannot_be_carried_over_are_refused(tmp_path, change, words):
    artists_rig(tmp_path / "rig.glb", humanoid())
    changed(tmp_path / "rig.glb", change)
    with pytest.raises(FileError, match=words):
        GlbCrowd(tmp_path / "crowd.glb", character=tmp_path / "rig.glb")
    assert [path.name for path in tmp_path.iterdir()] == ["rig.glb"]


def test_numbers_that_json_cannot_hold_are_refused(tmp_path):
    artists_rig(tmp_path / "rig.glb", humanoid())
    data = (tmp_path / "rig.glb").read_bytes()
    (tmp_path / "rig.glb").write_bytes(data.replace(b'0.7, "znear": 0.1', b'0.7,"znear":1e999'))
    with pytest.raises(FileError, match="number in its JSON that is too large"):
        GlbCrowd(tmp_path / "crowd.glb", character=tmp_path / "rig.glb")


@settings(max_examples=25)
@given(st.data())
def test_changed_files_never_break_it(tmp_path_factory, data):
    folder = tmp_path_factory.getbasetemp()
    rig = folder / "rig.glb"
    artists_rig(rig, humanoid())
    skeleton = load_skeleton(rig)

    def change(document: Any) -> None:
        for _ in range(data.draw(st.integers(1, 3))):
            where: Any = document
            while True:
                key = data.draw(st.sampled_from(sorted(where) if isinstance(where, dict) else range(len(where))))
                if not isinstance(where[key], (dict, list)) or not where[key] or data.draw(st.booleans()):
                    break
                where = where[key]
            where[key] = data.draw(st.sampled_from([None, -1, 0, 5, 10**6, 1.5, "a", [], {}, [0], [{}], {"a": 1}]))

    changed(rig, change)
    with suppress(StridecastError):
        scene = GlbCrowd(folder / "crowd.glb", character=rig)
        try:
            scene.add(standing(skeleton, frames=3))
            scene.save()
        finally:
            scene.close()


def test_motions_of_others_change_nothing(tmp_path):
    artists_rig(tmp_path / "rig.glb", humanoid())
    skeleton = load_skeleton(tmp_path / "rig.glb")
    scene = GlbCrowd(tmp_path / "crowd.glb", character=tmp_path / "rig.glb")
    scene.add(standing(skeleton), name="Ann")
    offsets = skeleton.offsets.copy()
    offsets[skeleton.chain("left_foot", "right_foot")] *= 1.3
    for other, words in (
        (replace(skeleton, offsets=offsets), "other lengths"),
        (replace(skeleton, names=tuple(f"x{name}" for name in skeleton.names)), "no joint 'xHips'"),
    ):
        with pytest.raises(SkeletonError, match=words):
            scene.add(standing(other), name="Ben")
    scene.save()
    assert len(meshes(Glb((tmp_path / "crowd.glb").read_bytes()))) == 1


SEEN = """
import json, sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = 30
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
said = {}
for code in json.loads(sys.argv[2]):
    bpy.context.scene.frame_set(code)
    graph = bpy.context.evaluated_depsgraph_get()
    said[code] = []
    for thing in bpy.data.objects:
        if thing.type == "MESH" and thing.name.startswith(("Coat", "Legs", "Brim")):
            shape = thing.evaluated_get(graph)
            at = [shape.matrix_world @ vertex.co for vertex in shape.data.vertices]
            corners = [[f(p[k] for p in at) for k in range(3)] for f in (min, max)]
            said[code].append([thing.name.split(".")[0], len(at), corners])
json.dump(said, open(sys.argv[3], "w"))
"""


def test_blender_shows_everybody_as_they_are(tmp_path, blender):
    artists_rig(tmp_path / "rig.glb", humanoid(), seed=2)  # Blender itself misplaces hats below a scaled armature
    people = crowd(tmp_path / "crowd.glb", tmp_path / "rig.glb")
    glb = Glb((tmp_path / "crowd.glb").read_bytes())
    codes = [0, 4, 12, 20]
    said = run_in_blender(blender, SEEN, tmp_path, str(tmp_path / "crowd.glb"), str(codes))
    seen = 0
    for (motion, start), found in zip(people, meshes(glb), strict=True):
        for code in codes:
            if 0 <= code - round(30 * start) < motion.frames:
                worlds = glb.world(0, code / 30)
                for name, node in found.items():
                    x, y, z = glb.seen(node, worlds).T
                    box = np.stack((x, -z, y), axis=1)  # Blender's z is up
                    wanted = np.stack((box.min(axis=0), box.max(axis=0)))
                    gaps = [np.abs(wanted - at).max() for what, _, at in said[str(code)] if what == name]
                    assert len(gaps) == len(people)
                    assert min(gaps) < 1e-3
                    seen += 1
    assert seen > 15
