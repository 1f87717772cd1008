"""A character of Rigify to GLB: the bones that deform it, as one tree. Runs in Blender; the file is not changed.

::

    blender my.blend --background --python rigify_to_glb.py -- rig my_character.glb

Rigify's deforming bones (``DEF-...``) hang from many controls that nothing but Blender understands. Here each hangs
from the bone that it grows out of; their places, rolls and weights stay as they are.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import bpy

GROWS_FROM = (
    (r"DEF-spine$", ""),
    (r"DEF-(thigh|pelvis)", "DEF-spine"),
    (r"DEF-(shoulder|breast)", "DEF-spine.003"),
    (r"DEF-upper_arm", "DEF-shoulder{side}"),
    (r"DEF-(palm|f_|thumb)", "DEF-hand{side}"),
)
"""Bones of Rigify's human, as patterns, and what each grows out of; the rest is the head's."""


def convert(name: str, target: Path) -> str:
    """Write the character; what was done, in a sentence.

    Raises
    ------
    SystemExit
        It cannot be done, with the reason.
    """
    rig = bpy.data.objects.get(name)
    if rig is None or rig.type != "ARMATURE":
        named = ", ".join(one.name for one in bpy.data.objects if one.type == "ARMATURE")
        raise SystemExit(f"there is no armature {name!r}; there are {named or 'none'}")
    if "DEF-spine.003" not in rig.data.bones:
        raise SystemExit(f"{name} is no generated rig of Rigify's human: it has no bone DEF-spine.003")
    skins = [one for one in bpy.data.objects if one.type == "MESH" and one.find_armature() == rig]
    bpy.ops.object.select_all(action="DESELECT")
    for one in (rig, *skins):
        one.hide_set(False)
        one.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bones = rig.data.edit_bones
    for bone in [one for one in bones if one.use_deform]:
        if bone.parent is None or not bone.parent.use_deform:
            above = grows_from(bone.name)
            bone.use_connect = False
            bone.parent = bones[above] if above else None
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.export_scene.gltf(
        filepath=str(target), use_selection=True, export_def_bones=True, export_animations=False, export_yup=True
    )
    return f"{target}: {sum(bone.use_deform for bone in rig.data.bones)} bones of {name}, {len(skins)} meshes"


def grows_from(name: str) -> str:
    """The bone that one grows out of; the pelvis out of none."""
    side = name[-2:] if name.endswith((".L", ".R")) else ""
    for pattern, above in GROWS_FROM:
        if re.match(pattern, name):
            return above.format(side=side)
    if found := re.match(r"DEF-spine\.(\d+)$", name):
        before = int(found.group(1)) - 1
        return f"DEF-spine.{before:03d}" if before else "DEF-spine"
    return "DEF-spine.006"


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    if len(words) != 2:
        raise SystemExit(f"an armature and a file are needed, such as rig my_character.glb, not {len(words)} words")
    print(convert(words[0], Path(words[1])))
