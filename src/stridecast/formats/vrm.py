"""What a VRM says of its bones: a character of VRM is a GLB that tells which node is which part of the body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from stridecast.formats.gltf_reading import GltfReader

BONES: Mapping[str, str] = {
    "hips": "hips",
    "head": "head",
    **{
        f"{side}{bone}": f"{side}_{part}"
        for side in ("left", "right")
        for bone, part in (
            ("UpperLeg", "thigh"),
            ("LowerLeg", "shin"),
            ("Foot", "foot"),
            ("Toes", "toe"),
            ("Shoulder", "shoulder"),
            ("UpperArm", "upper_arm"),
            ("LowerArm", "forearm"),
            ("Hand", "hand"),
        )
    },
}
"""Bones of VRM and their roles. Spine, chest and neck are found by where the limbs hang."""


EXTENSIONS = ("VRMC_vrm", "VRM", "VRMC_vrm_animation")
"""By these names documents tell of a character of VRM 1 or 0, or of an animation for any."""


def vrm_roles(reader: GltfReader) -> dict[str, int]:
    """Roles and their nodes, as VRM 1, VRM 0 or a VRM animation tells; none where a file is no VRM.

    Raises
    ------
    FileError
        The file calls itself a VRM, and its bones cannot be read.
    """
    extensions = reader.document.get("extensions")
    if not isinstance(extensions, dict):
        return {}
    told = next((extensions[name] for name in EXTENSIONS if name in extensions), None)
    if told is None:
        return {}
    humanoid = told.get("humanoid") if isinstance(told, dict) else None
    bones = humanoid.get("humanBones") if isinstance(humanoid, dict) else None
    pairs: list[tuple[Any, Any]] = []
    if isinstance(bones, dict):
        pairs = list(bones.items())
    elif isinstance(bones, list):  # of VRM 0
        pairs = [(one.get("bone"), one) if isinstance(one, dict) else (None, one) for one in bones]
    out: dict[str, int] = {}
    for bone, one in pairs:
        if not isinstance(one, dict):
            reader.wrong("has a bone of VRM that is no object")
        if isinstance(bone, str) and bone in BONES:
            reader.one("nodes", one.get("node"), f"bone {bone} of VRM")
            out[BONES[bone]] = one["node"]
    return out
