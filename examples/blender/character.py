"""Take a rigged character out of Blender as a skeleton, and let it play what stridecast made for it. Runs in Blender.

    blender my.blend -b -P character.py -- export Armature my_character.bvh
    stridecast walk --curve circle:3 --skeleton my_character.bvh --bvh-for blender -o walk.bvh
    blender my.blend -b -P character.py -- play Armature walk.bvh my_walking.blend

The character stands upright and looks along -Y, as Blender's front view has it. Its bones may have any roll: what is
carried over is how each one turns in the world.
"""

from __future__ import annotations

import sys

import bpy
from mathutils import Matrix


def export(armature: str, path: str) -> None:
    """Write the armature in its rest pose as a BVH."""
    body = _armature(armature)
    bpy.context.scene.frame_set(0)
    body.data.pose_position = "REST"
    bpy.ops.export_anim.bvh(filepath=path, frame_start=0, frame_end=1, root_transform_only=True)
    body.data.pose_position = "POSE"


def play(armature: str, path: str, saved: str = "") -> None:
    """Key the motion of a BVH, which has the bones of the armature, on the armature."""
    body, scene = _armature(armature), bpy.context.scene
    bpy.ops.import_anim.bvh(filepath=path, update_scene_fps=True)
    model = bpy.context.object
    bones = [bone for bone in body.pose.bones if _same(bone.name) in model.pose.bones]  # parents before children
    if not bones:
        raise SystemExit(f"{path} has no bone of {armature}")
    upright = body.matrix_world.to_3x3().normalized().to_quaternion()
    rests = [model.data.bones[_same(bone.name)].matrix_local.to_quaternion() for bone in bones]
    for bone in bones:
        bone.rotation_mode = "QUATERNION"
    first, last = (int(frame) for frame in model.animation_data.action.frame_range)
    scene.frame_start, scene.frame_end = first, last
    for frame in range(first, last + 1):
        scene.frame_set(frame)
        turned: dict[str, Matrix] = {}
        for bone, rest in zip(bones, rests, strict=True):
            other = model.pose.bones[_same(bone.name)]
            turn = upright.inverted() @ other.matrix.to_quaternion() @ rest.inverted() @ upright
            turned[bone.name] = turn @ bone.bone.matrix_local.to_quaternion()
            above = bone.parent
            if above is None or above.name not in turned:
                base = bone.bone.matrix_local.to_quaternion()
            else:
                between = above.bone.matrix_local.to_quaternion().inverted() @ bone.bone.matrix_local.to_quaternion()
                base = turned[above.name] @ between
            bone.rotation_quaternion = base.inverted() @ turned[bone.name]
            bone.keyframe_insert("rotation_quaternion", frame=frame)
        root = bones[0]
        place = body.matrix_world.inverted() @ (model.matrix_world @ model.pose.bones[_same(root.name)].head)
        rest_place = root.bone.matrix_local
        root.location = rest_place.to_quaternion().inverted() @ (place - rest_place.translation)
        root.keyframe_insert("location", frame=frame)
    bpy.data.objects.remove(model)
    print(f"{len(bones)} bones of {armature} move, frames {first} to {last}")
    if saved:
        bpy.ops.wm.save_as_mainfile(filepath=saved)


def _armature(name: str) -> bpy.types.Object:
    found = bpy.data.objects.get(name)
    if found is None or found.type != "ARMATURE":
        named = ", ".join(one.name for one in bpy.data.objects if one.type == "ARMATURE")
        raise SystemExit(f"there is no armature {name!r}; there are {named or 'none'}")
    bpy.ops.object.select_all(action="DESELECT")
    found.select_set(True)
    bpy.context.view_layer.objects.active = found
    return found


def _same(name: str) -> str:
    """A bone's name as a BVH holds it."""
    return "_".join(name.split())


if __name__ == "__main__":
    what, *arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [""]
    if what not in ("export", "play"):
        raise SystemExit("say export ARMATURE OUT.bvh, or play ARMATURE IN.bvh [OUT.blend]")
    {"export": export, "play": play}[what](*arguments)
