"""An armature of Unity's bones in Blender: made from a pose that came, and posed by others."""

from __future__ import annotations

import bpy
from mathutils import Matrix, Quaternion, Vector

from .listener import Pose

PARENTS = {
    "Spine": "Hips", "Chest": "Spine", "UpperChest": "Chest", "Neck": "UpperChest", "Head": "Neck",
    **{f"{side}{bone}": above.format(side) for side in ("Left", "Right") for bone, above in (
        ("UpperLeg", "Hips"), ("LowerLeg", "{}UpperLeg"), ("Foot", "{}LowerLeg"), ("Toes", "{}Foot"),
        ("Shoulder", "UpperChest"), ("UpperArm", "{}Shoulder"), ("LowerArm", "{}UpperArm"), ("Hand", "{}LowerArm"))},
}  # fmt: skip
"""What Unity's bones hang from; one that is not there passes its children up."""

ENDS = {"Head": (0.0, 0.0, 0.18), "Toes": (0.0, -0.07, 0.0), "Hand": (0.17, 0.0, 0.0)}
"""Where the last bones end, metres, in Blender's axes; of the left side."""


def place_of(numbers: tuple[float, ...]) -> Vector:
    """A place in Blender's axes: z up, the figure faces -y with its left hand at +x."""
    x, y, z = numbers[:3]
    return Vector((-x, -z, y))


def turn_of(numbers: tuple[float, ...]) -> Quaternion:
    """A rotation in Blender's axes."""
    x, y, z, w = numbers[3:7]
    return Quaternion((w, x, z, -y)).normalized()


def above(name: str, pose: Pose) -> str | None:
    """The bone that a bone hangs from, of those that are there."""
    parent = PARENTS.get(name)
    while parent is not None and parent not in pose:
        parent = PARENTS.get(parent)
    return parent


def make(pose: Pose, name: str = "Stridecast") -> bpy.types.Object:
    """Make an armature in a T-pose, as long as the bones of a pose are."""
    data = bpy.data.armatures.new(name)
    figure = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(figure)
    before = bpy.context.view_layer.objects.active
    bpy.context.view_layer.objects.active = figure
    bpy.ops.object.mode_set(mode="EDIT")
    heads: dict[str, Vector] = {}
    known = [bone for bone in ("Hips", *PARENTS) if bone in pose]
    for bone in known:
        parent = above(bone, pose)
        heads[bone] = place_of(pose[bone]) if parent is None else heads[parent] + place_of(pose[bone])
    for bone in known:
        edit = data.edit_bones.new(bone)
        edit.head, edit.tail = heads[bone], _tail(bone, heads, pose)
        parent = above(bone, pose)
        if parent is not None:
            edit.parent = data.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.objects.active = before or figure
    for bone in figure.pose.bones:
        bone.rotation_mode = "QUATERNION"
    return figure


def _tail(bone: str, heads: dict[str, Vector], pose: Pose) -> Vector:
    """Where a bone ends: at the bone that goes on, else some way further."""
    on = {"Hips": "Spine", "Chest": "Neck", "UpperChest": "Neck"}.get(bone)
    children = [name for name in heads if above(name, pose) == bone]
    after = on if on in children else (children[0] if len(children) == 1 else None)
    if after is not None and (heads[after] - heads[bone]).length > 1e-3:
        return heads[after]
    way = next((Vector(end) for word, end in ENDS.items() if bone.endswith(word)), Vector((0.0, 0.0, 0.1)))
    if bone.startswith("Right"):
        way.x = -way.x
    return heads[bone] + way


def show(figure: bpy.types.Object, pose: Pose, *, frame: float | None = None) -> int:
    """Pose an armature, whose bones are called as Unity's and which rests in a T-pose.

    Parameters
    ----------
    figure
        The armature; bones of other names are left alone.
    pose
        What came.
    frame
        Insert keys at this frame.

    Returns
    -------
    How many bones were posed.
    """
    shown = 0
    own = bool(figure.get("stridecast_vmc"))
    for name, numbers in pose.items():
        bone = figure.pose.bones.get(name)
        if bone is None:
            continue
        rest: Matrix = bone.bone.matrix_local
        turn = rest.to_quaternion()
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = turn.inverted() @ turn_of(numbers) @ turn
        parent = above(name, pose)
        if parent is None or own:  # the bones of somebody else's figure keep their length
            origin = Vector() if parent is None else figure.pose.bones[parent].bone.matrix_local.translation
            bone.location = turn.inverted() @ (place_of(numbers) + origin - rest.translation)
        if frame is not None:
            bone.keyframe_insert("rotation_quaternion", frame=frame)
            if parent is None:
                bone.keyframe_insert("location", frame=frame)
        shown += 1
    return shown
