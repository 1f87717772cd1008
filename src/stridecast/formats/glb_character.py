"""Motion on somebody's own character: a rigged GLB comes back with its meshes, materials and skins, now walking.

The file stays as it is, but for its animations, which give way to one of ours.
"""

from __future__ import annotations

from pathlib import Path

from stridecast.errors import InputError
from stridecast.formats.glb_figure import Keys, Planted, plants, provenance
from stridecast.formats.glb_rig import SHARED, GlbRig
from stridecast.formats.gltf import GltfWriter
from stridecast.model.motion import Motion


def write_character(
    path: str | Path,
    motion: Motion,
    character: str | Path,
    *,
    compact: bool = False,
    planted: Planted | None = None,
) -> None:
    """Write a motion onto a rigged GLB.

    Parameters
    ----------
    path
        The file to write.
    motion
        Of the skeleton that ``load_skeleton(character)`` gives, in any size, such as ``recast`` makes. The file keeps
        its own size and unit: a body that is larger in it goes further, too.
    character
        The rigged GLB.
    compact, planted
        As of ``write_glb``.

    Raises
    ------
    FileError
        The character is no GLB that can be read and carried over (see ``GlbRig``), or the file system refuses; what was
        there is untouched.
    SkeletonError
        The motion is that of another skeleton.
    InputError
        ``planted`` has another length than the motion.
    """
    if planted is not None and len(planted) != motion.frames:
        raise InputError(f"planted must have a row for each of {motion.frames} frames, not {len(planted)}")
    rig = GlbRig(character)
    writer = GltfWriter()
    rig.embed(writer)
    keys = Keys(writer)
    keys.move(rig.moved(motion), motion.frame_rate, compact=compact)
    told = {} if planted is None else {"foot_plants": plants(planted, motion.frame_rate)}
    keys.save(motion.name or "Walk", {**provenance(motion), **told})
    ours = (*SHARED, "animations", "buffers")
    writer.save(path, {part: content for part, content in rig.document.items() if part not in ours})
