"""What part of the body a joint is, from its name and its place in the tree.

Limbs are known by name. Every family of skeletons has its own words for them, and one word may mean different joints:
``LeftShoulder`` is the clavicle of one family and the upper arm of another. So the family that explains most joints is
chosen whole. The trunk is known by its place: the hips are where legs and head meet, the chest is where the arms hang.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from stridecast.errors import SkeletonError
from stridecast.model.skeleton import ARMS, LEGS, ROLES

Limbs = Mapping[str, tuple[str, ...]]

FAMILIES: Mapping[str, Limbs] = {
    # CMU as BVH for MotionBuilder (cgspeed), Mixamo, LaFAN1 and whatever else was characterised in MotionBuilder
    "MotionBuilder": {
        "thigh": ("{Left}UpLeg",),
        "shin": ("{Left}Leg",),
        "foot": ("{Left}Foot",),
        "toe": ("{Left}ToeBase", "{Left}Toe"),
        "shoulder": ("{Left}Shoulder",),
        "upper_arm": ("{Left}Arm",),
        "forearm": ("{Left}ForeArm",),
        "hand": ("{Left}Hand",),
    },
    # named by the joint, not by the bone: CMU as BVH for 3dsMax (cgspeed), BVH of Xsens MVN, Poser
    "joint names": {
        "thigh": ("{Left}Hip",),
        "shin": ("{Left}Knee",),
        "foot": ("{Left}Ankle",),
        "toe": ("{Left}Toe",),
        "shoulder": ("{Left}Collar",),
        "upper_arm": ("{Left}Shoulder",),
        "forearm": ("{Left}Elbow",),
        "hand": ("{Left}Wrist",),
    },
    # ASF skeletons; the bone from the hips to the thigh is lhipjoint and has no role
    "ASF": {
        "thigh": ("{l}femur",),
        "shin": ("{l}tibia",),
        "foot": ("{l}foot",),
        "toe": ("{l}toes",),
        "shoulder": ("{l}clavicle",),
        "upper_arm": ("{l}humerus",),
        "forearm": ("{l}radius",),
        "hand": ("{l}wrist",),
    },
    # Bandai-Namco, Unity and VRM humanoids, VRoid (J_Bip_L_UpperLeg), Xsens' own words
    "upper and lower": {
        "thigh": ("UpperLeg_{L}", "{L}_UpperLeg", "{Left}UpperLeg"),
        "shin": ("LowerLeg_{L}", "{L}_LowerLeg", "{Left}LowerLeg"),
        "foot": ("Foot_{L}", "{L}_Foot", "{Left}Foot"),
        "toe": ("Toes_{L}", "{L}_ToeBase", "{Left}Toes", "{Left}Toe"),
        "shoulder": ("Shoulder_{L}", "{L}_Shoulder", "{Left}Shoulder"),
        "upper_arm": ("UpperArm_{L}", "{L}_UpperArm", "{Left}UpperArm"),
        "forearm": ("LowerArm_{L}", "{L}_LowerArm", "{Left}LowerArm", "{Left}ForeArm"),
        "hand": ("Hand_{L}", "{L}_Hand", "{Left}Hand"),
    },
    # the first BVH files there were
    "classic": {
        "thigh": ("{Left}UpLeg",),
        "shin": ("{Left}LowLeg",),
        "foot": ("{Left}Foot",),
        "toe": ("{Left}Toe",),
        "shoulder": ("{Left}Collar",),
        "upper_arm": ("{Left}UpArm",),
        "forearm": ("{Left}LowArm",),
        "hand": ("{Left}Hand",),
    },
    "SMPL": {
        "thigh": ("{L}_Hip", "{Left}_Hip"),
        "shin": ("{L}_Knee", "{Left}_Knee"),
        "foot": ("{L}_Ankle", "{Left}_Ankle"),
        "toe": ("{L}_Foot", "{Left}_Foot"),
        "shoulder": ("{L}_Collar", "{Left}_Collar"),
        "upper_arm": ("{L}_Shoulder", "{Left}_Shoulder"),
        "forearm": ("{L}_Elbow", "{Left}_Elbow"),
        "hand": ("{L}_Wrist", "{Left}_Wrist"),
    },
    # Poser's and DAZ's figures up to Genesis 8, whose limbs have a bend and a twist joint
    "DAZ": {
        "thigh": ("{l}Thigh", "{l}ThighBend"),
        "shin": ("{l}Shin",),
        "foot": ("{l}Foot",),
        "toe": ("{l}Toe",),
        "shoulder": ("{l}Collar",),
        "upper_arm": ("{l}Shldr", "{l}ShldrBend"),
        "forearm": ("{l}ForeArm", "{l}ForearmBend"),
        "hand": ("{l}Hand",),
    },
    "3ds Max Biped": {
        "thigh": ("{L} Thigh",),
        "shin": ("{L} Calf",),
        "foot": ("{L} Foot",),
        "toe": ("{L} Toe0",),
        "shoulder": ("{L} Clavicle",),
        "upper_arm": ("{L} UpperArm",),
        "forearm": ("{L} Forearm",),
        "hand": ("{L} Hand",),
    },
    # Unreal's mannequin and Blender's Rigify
    "game engines": {
        "thigh": ("thigh_{l}",),
        "shin": ("calf_{l}", "shin.{L}"),
        "foot": ("foot_{l}",),
        "toe": ("ball_{l}", "toe.{L}"),
        "shoulder": ("clavicle_{l}", "shoulder.{L}"),
        "upper_arm": ("upperarm_{l}", "upper_arm.{L}"),
        "forearm": ("lowerarm_{l}", "forearm.{L}"),
        "hand": ("hand_{l}",),
    },
}
"""Families of skeletons and what they call the joints of limbs; ``{Left}``, ``{L}`` and ``{l}`` stand for the side."""

HEADS = ("head", "spine006")
"""What heads are called; the second is Rigify's."""

_PREFIX = re.compile(r"^(J_Bip_C_|J_Bip_|DEF-)")
"""What VRoid and Rigify write before the names of a body's joints, and not before those of hair, cloth and controls."""

_SIDES = (("left", {"Left": "Left", "L": "L", "l": "l"}), ("right", {"Left": "Right", "L": "R", "l": "r"}))


def find_roles(
    names: Sequence[str], parents: Sequence[int], mapping: Mapping[str, str] | None = None
) -> dict[str, int]:
    """Find the joints of a body.

    Parameters
    ----------
    names, parents
        The joints and the index of each one's parent, -1 for the root; parents before children.
    mapping
        Roles the caller knows better, role to joint name; they override what the names suggest.

    Returns
    -------
    Role to joint index. Roles that no joint seems to have are left out.

    Raises
    ------
    SkeletonError
        The mapping names a role or a joint that does not exist; the message lists those that do.
    """
    given = _given_roles(names, mapping or {})
    roles = _limbs(names) | given
    roles = _trunk(names, parents, roles) | roles
    return {role: roles[role] for role in ROLES if role in roles}


def _given_roles(names: Sequence[str], mapping: Mapping[str, str]) -> dict[str, int]:
    for role, name in mapping.items():
        if role not in ROLES:
            raise SkeletonError(f"there is no role {role!r}; there are {', '.join(ROLES)}")
        if name not in names:
            raise SkeletonError(f"there is no joint {name!r} for role {role!r}; the joints are {', '.join(names)}")
    return {role: list(names).index(name) for role, name in mapping.items()}


def _limbs(names: Sequence[str]) -> dict[str, int]:
    """Legs and arms in the words of the family that knows most of these names (the first of equals)."""
    joints = {plain: joint for joint, plain in reversed(list(enumerate(_plain(names))))}
    found = []
    for family in FAMILIES.values():
        limbs: dict[str, int] = {}
        for side, spelling in _SIDES:
            for part in (*LEGS, *ARMS):
                known = (_squeeze(word.format_map(spelling)) for word in family[part])
                joint = next((joints[word] for word in known if word in joints), None)
                if joint is not None:
                    limbs[f"{side}_{part}"] = joint
        found.append(limbs)
    return max(found, key=len)


def _plain(names: Sequence[str]) -> list[str]:
    """Strip namespaces (``mixamorig:``), what bodies or nearly all begin with (``Bip01 ``), case and marks."""
    bare = [_PREFIX.sub("", name.rpartition(":")[2]) for name in names]
    middle = sorted(bare)[len(bare) // 2] if bare else ""
    starts = [middle[: mark.end()] for mark in re.finditer(r"[\s_.-]", middle)]
    shared = [start for start in starts if sum(name.startswith(start) for name in bare) > 0.75 * len(bare)]
    return [_squeeze(name.removeprefix(max(shared, key=len, default=""))) for name in bare]


def _squeeze(name: str) -> str:
    return re.sub(r"[\s_.-]", "", name).lower()


def _trunk(names: Sequence[str], parents: Sequence[int], roles: Mapping[str, int]) -> dict[str, int]:
    """Hips, spine, chest, neck and head, from where the limbs hang and which joint is called head."""
    head = roles.get("head", _head(names))
    arms = [roles[f"{side}_{part}"] for side in ("left", "right") for part in ARMS[:2] if f"{side}_{part}" in roles]
    thighs = [roles[role] for role in ("left_thigh", "right_thigh") if role in roles]
    upper = [joint for joint in (head, *arms) if joint is not None]
    if len(thighs) < 2:
        return {}
    trunk = {"hips": roles.get("hips", _meeting(parents, thighs + upper))}
    if len(arms) > 1 or "chest" in roles:
        trunk["chest"] = roles.get("chest", _meeting(parents, arms))
    if head is not None:
        trunk["head"] = head
    if "chest" in trunk:
        back = _between(parents, trunk["hips"], trunk["chest"])
        if back:
            trunk["spine"] = back[0]
        if len(back) > 1:
            trunk["spine1"] = back[len(back) // 2]
        if head is not None:
            neck = _between(parents, trunk["chest"], head)
            if neck:
                trunk["neck"] = neck[0]
    if trunk.get("chest") == trunk["hips"]:
        del trunk["chest"]
    return trunk


def _head(names: Sequence[str]) -> int | None:
    plain = _plain(names)
    return next((plain.index(word) for word in HEADS if word in plain), None)


def _line(parents: Sequence[int], joint: int) -> list[int]:
    """List the joint and its ancestors, the root last."""
    line = [joint]
    while parents[line[-1]] >= 0:
        line.append(int(parents[line[-1]]))
    return line


def _meeting(parents: Sequence[int], joints: Sequence[int]) -> int:
    """Find the nearest joint that is above (or one of) all these joints."""
    shared = set.intersection(*(set(_line(parents, joint)) for joint in joints))
    return max(shared)  # parents come before children


def _between(parents: Sequence[int], top: int, bottom: int) -> list[int]:
    """List the joints strictly between an ancestor and its descendant, top down; none if it is no ancestor."""
    line = _line(parents, bottom)
    return line[1 : line.index(top)][::-1] if top in line[1:] else []
