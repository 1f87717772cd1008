"""FBX to GLB or BVH through Blender, without a window.

::

    blender --background --python fbx_to_glb.py -- walk.fbx walk.bvh
    python fbx_to_glb.py walk.fbx walk.glb          # with a Python that has the package bpy

The figure is the first armature of the file; BVH has the action that it plays. The result is in the file's frame rate.
A character that does not move becomes a GLB for ``stridecast walk --skeleton``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy


def convert(source: Path, target: Path) -> str:
    """Convert a file; what was done, in a sentence.

    Raises
    ------
    SystemExit
        It cannot be done, with the reason.
    """
    if source.suffix.lower() != ".fbx" or not source.is_file():
        raise SystemExit(f"{source}: there is no such FBX file")
    if target.suffix.lower() not in (".glb", ".bvh"):
        raise SystemExit(f"{target}: the result is *.glb or *.bvh")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    try:
        if hasattr(bpy.ops.wm, "fbx_import"):
            bpy.ops.wm.fbx_import(filepath=str(source))
        else:
            bpy.ops.import_scene.fbx(filepath=str(source), automatic_bone_orientation=False)
    except RuntimeError as error:
        raise SystemExit(f"{source}: Blender cannot read it: {str(error).strip()}") from None
    figures = [it for it in bpy.data.objects if it.type == "ARMATURE"]
    if not figures:
        raise SystemExit(f"{source}: it holds no skeleton")
    figure = figures[0]
    scene, still = bpy.context.scene, figure.animation_data is None or figure.animation_data.action is None
    if still:
        if target.suffix.lower() != ".glb":
            raise SystemExit("the skeleton does not move: it has no action; as a character write it to *.glb")
        bpy.ops.export_scene.gltf(filepath=str(target), export_format="GLB", export_yup=True, export_animations=False)
        return f"{target}: {figure.name} at rest"
    first, last = _range(figure)
    scene.frame_start, scene.frame_end = first, last
    if target.suffix.lower() == ".glb":
        bpy.ops.export_scene.gltf(filepath=str(target), export_format="GLB", export_yup=True)
    else:
        _write_bvh(target, figure, first, last)
    return (
        f"{target}: {last - first + 1} frames of {figure.name}, {scene.render.fps / scene.render.fps_base:g} a second"
    )


def _range(figure: bpy.types.Object) -> tuple[int, int]:
    """First and last frame of what the figure plays."""
    first, last = figure.animation_data.action.frame_range
    return int(first), max(round(last), int(first) + 1)


def _write_bvh(target: Path, figure: bpy.types.Object, first: int, last: int) -> None:
    """Write the figure in metres; Blender's z stays up, which readers find out."""
    bpy.ops.object.select_all(action="DESELECT")
    figure.select_set(True)
    bpy.context.view_layer.objects.active = figure
    bpy.ops.object.transform_apply(location=False, rotation=True, scale=True)
    bpy.ops.export_anim.bvh(
        filepath=str(target), frame_start=first, frame_end=last, root_transform_only=True, rotate_mode="NATIVE"
    )


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    if len(words) != 2:
        raise SystemExit(f"two files are needed, such as walk.fbx walk.bvh, not {len(words)}")
    print(convert(Path(words[0]), Path(words[1])))
