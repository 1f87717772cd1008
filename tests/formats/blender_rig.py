"""Runs where there is Blender's ``bpy``: what tests of BVH want of it. Arguments: what to do, then files."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector


def rig(description: str, saved: str) -> None:
    """An armature with bones of any roll, its object turned and scaled as from an FBX."""
    told = json.loads(Path(description).read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = bpy.data.armatures.new("Armature")
    body = bpy.data.objects.new("Armature", data)
    bpy.context.collection.objects.link(body)
    bpy.context.view_layer.objects.active = body
    body.select_set(True)
    body.rotation_euler, body.scale = (0.5 * np.pi, 0.0, 0.0), (0.01,) * 3
    bpy.context.view_layer.update()
    inside = body.matrix_world.inverted()
    bpy.ops.object.mode_set(mode="EDIT")
    rolls, bones = np.random.default_rng(1), []
    for name, parent, (x, y, z), tip in zip(*(told[k] for k in ("names", "parents", "places", "tips")), strict=True):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = inside @ Vector((x, -z, y)), inside @ Vector((tip[0], -tip[2], tip[1]))
        bone.roll = float(rolls.uniform(-3.0, 3.0))
        if parent >= 0:
            bone.parent = bones[parent]
        bones.append(bone)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.wm.save_as_mainfile(filepath=saved)


def example(script: str, blend: str, *arguments: str) -> None:
    """Run an example on a file."""
    bpy.ops.wm.open_mainfile(filepath=blend)
    sys.argv = [script, "--", *arguments]
    runpy.run_path(script, run_name="__main__")


def imported(path: str, scale: str, places: str) -> None:
    """Import a BVH and tell where joints are."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_anim.bvh(filepath=path, global_scale=float(scale), update_scene_fps=True)
    _tell(bpy.context.object, places)


def opened(path: str, places: str) -> None:
    """Open a file and tell where the joints of its armature are."""
    bpy.ops.wm.open_mainfile(filepath=path)
    _tell(bpy.data.objects["Armature"], places)


def _tell(body: Any, places: str) -> None:
    scene = bpy.context.scene
    last = int(body.animation_data.action.frame_range[1])
    names = [bone.name for bone in body.pose.bones]
    at = []
    for frame in range(1, last + 1):
        scene.frame_set(frame)
        heads = (body.matrix_world @ bone.head for bone in body.pose.bones)
        at.append([(head.x, head.z, -head.y) for head in heads])
    rest = [body.matrix_world @ bone.head_local for bone in body.data.bones]
    told = {"rest": [(head.x, head.z, -head.y) for head in rest], "rate": scene.render.fps}
    Path(places).write_text(json.dumps({"names": names, "places": at, **told}))


if __name__ == "__main__":
    what, *arguments = sys.argv[1:]
    {"rig": rig, "example": example, "imported": imported, "opened": opened}[what](*arguments)
