"""Runs where there is Blender's ``bpy``: characters as people have them there. Arguments: what to make, then files."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix, Vector


def mixamo(description: str, saved: str) -> None:
    """An FBX as Mixamo's: centimetres, Y up, so that Blender has it below an object that is turned and scaled."""
    told = json.loads(Path(description).read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = bpy.data.armatures.new("Armature")
    body = _added("Armature", data)
    body.rotation_euler, body.scale = (1.5707963267948966, 0.0, 0.0), (0.01,) * 3
    bpy.context.view_layer.objects.active = body
    body.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bones: list[Any] = []
    for name, parent, place, tip in zip(*(told[k] for k in ("names", "parents", "places", "tips")), strict=True):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = 100.0 * Vector(place), 100.0 * Vector(tip)
        if parent >= 0:
            bone.parent = bones[parent]
        bones.append(bone)
    bpy.ops.object.mode_set(mode="OBJECT")
    mesh = bpy.data.meshes.new("Beta_Surface")
    mesh.from_pydata([100.0 * Vector(place) for place in told["vertices"]], [], told["triangles"])
    skin = _added("Beta_Surface", mesh)
    for name in told["names"]:
        skin.vertex_groups.new(name=name)
    for vertex, (joints, weights) in enumerate(zip(told["joints"], told["weights"], strict=True)):
        for joint, weight in zip(joints, weights, strict=True):
            if weight > 0:
                skin.vertex_groups[joint].add([vertex], weight, "REPLACE")
    _bound(skin, body)
    skin.matrix_parent_inverse = Matrix.Identity(4)
    bpy.ops.export_scene.fbx(filepath=saved, add_leaf_bones=False, bake_anim=False)


def rigify(as_it_is: str, example: str, joined: str) -> None:
    """The human of Rigify with blocks for a skin, as Blender exports it, and as our script does."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_human_metarig_add()
    meta = bpy.context.object
    bpy.ops.pose.rigify_generate()
    rig = bpy.context.object
    bpy.data.objects.remove(meta)
    for name in [one.name for one in bpy.data.objects if one.name.startswith("WGT-")]:
        bpy.data.objects.remove(bpy.data.objects[name])
    _blocks(rig)
    bpy.ops.export_scene.gltf(filepath=as_it_is, export_animations=False)
    sys.argv = [example, "--", rig.name, joined]
    runpy.run_path(example, run_name="__main__")


def _blocks(rig: Any) -> None:
    """A block about each bone that deforms."""
    places, faces, groups = [], [], []
    for bone in rig.data.bones:
        if bone.use_deform:
            along = bone.tail_local - bone.head_local
            thick = min(0.04, 0.25 * along.length)
            side = along.normalized().orthogonal().normalized() * thick
            across = along.normalized().cross(side)
            first = len(places)
            for end in (bone.head_local, bone.tail_local):
                places += [end + side + across, end - side + across, end - side - across, end + side - across]
            groups.append((bone.name, list(range(first, first + 8))))
            corners = ((0, 1, 2, 3), (7, 6, 5, 4), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
            faces += [tuple(first + k for k in face) for face in corners]
    mesh = bpy.data.meshes.new("Body")
    mesh.from_pydata(places, [], faces)
    skin = _added("Body", mesh)
    for name, vertices in groups:
        skin.vertex_groups.new(name=name).add(vertices, 1.0, "REPLACE")
    _bound(skin, rig)


def _added(name: str, data: Any) -> Any:
    one = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(one)
    return one


def _bound(skin: Any, body: Any) -> None:
    skin.parent = body
    skin.modifiers.new("Armature", "ARMATURE").object = body


if __name__ == "__main__":
    what, *arguments = sys.argv[1:]
    {"mixamo": mixamo, "rigify": rigify}[what](*arguments)
