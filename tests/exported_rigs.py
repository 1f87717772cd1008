"""Rigged characters as other programs export them to GLB: how their nodes hang, lie and are called, round one body.

Nothing of the package's GLB is used here but the mesh; each rig is a mannequin that stands on the floor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from bodies import HIP_HEIGHT, humanoid
from glbs import Glb, packed
from stridecast.body import kinematics
from stridecast.body.mannequin import mannequin
from stridecast.model.skeleton import Skeleton

SIDES = ("Left", "Right")


@dataclass(frozen=True, kw_only=True)
class Export:
    """What a program makes of a body.

    Parameters
    ----------
    names
        What it calls our joints.
    further
        Joints more: name, parent (both as the file says) and place in the parent's frame, world axes.
    frames
        How a joint is turned at rest, of the joint and the direction of its bone.
    facing
        How the whole character is turned in the file.
    floor
        Name of a joint on the floor over the root; empty: none.
    above
        Nodes over the root, the topmost first: name, rotation, scale.
    meshes
        Names of the meshes, each with its own skin, and which joints that lists (by name; empty: all).
    unit
        Metres in one unit of the vertices.
    extensions
        Makes ``extensions`` of the document from node indices by name.
    """

    names: Callable[[str], str]
    further: Sequence[tuple[str, str, tuple[float, float, float]]] = ()
    frames: Callable[[str, np.ndarray], Rotation] = lambda _name, _bone: Rotation.identity()
    facing: Rotation = Rotation.identity()  # noqa: RUF009
    floor: str = ""
    above: Sequence[tuple[str, Rotation, float]] = ()
    meshes: Mapping[str, tuple[str, ...]] | None = None
    unit: float = 1.0
    extensions: Callable[[dict[str, int]], dict[str, Any]] | None = None


def export(path: Path, how: Export, body: Skeleton | None = None) -> Skeleton:
    """Write a character, and return its body, with the names in the file."""
    body = body or humanoid()
    skin = mannequin(body, low=True)
    names, parents = [how.names(name) for name in body.names], body.parents.tolist()
    floor = np.array([0.0, HIP_HEIGHT * body.leg_length / humanoid().leg_length, 0.0])
    at = (kinematics.rest(body).positions + floor).tolist()
    if how.floor:
        parents[0] = len(names)
        names.append(how.floor)
        parents.append(-1)
        at.append([0.0, 0.0, 0.0])
    for name, parent, offset in how.further:
        index = names.index(parent) if parent else -1
        names.append(name)
        parents.append(index)
        at.append((np.array(at[index] if parent else [0.0, 0.0, 0.0]) + offset).tolist())
    order, where = _parents_first(parents), np.array(at)
    tops = [joint for joint in order if parents[joint] < 0]
    worlds = np.tile(np.eye(4), (len(names), 1, 1))
    for joint in order:
        below = [k for k, parent in enumerate(parents) if parent == joint]
        bone = where[below[0]] - where[joint] if below else np.array([0.0, 1.0, 0.0])
        worlds[joint, :3, :3] = (how.facing * how.frames(names[joint], bone)).as_matrix()
        worlds[joint, :3, 3] = how.facing.apply(where[joint])
    document: dict[str, Any] = {"asset": {"version": "2.0"}, "nodes": [], "scene": 0}
    nodes, over, scale = document["nodes"], np.eye(4), 1.0
    for name, turn, size in how.above:
        node: dict[str, Any] = {"name": name, "rotation": turn.as_quat().tolist(), "scale": [size] * 3}
        if nodes:
            nodes[-1]["children"] = [len(nodes)]
        nodes.append(node)
        own = np.eye(4)
        own[:3, :3] = turn.as_matrix() * size
        over, scale = over @ own, scale * size
    worlds[:, :3, :3] *= scale
    index = {joint: len(nodes) + k for k, joint in enumerate(order)}
    for joint in order:
        local = np.linalg.inv(worlds[parents[joint]] if parents[joint] >= 0 else over) @ worlds[joint]
        turn = Rotation.from_matrix(local[:3, :3] / np.cbrt(np.linalg.det(local[:3, :3])))
        below = [index[k] for k, parent in enumerate(parents) if parent == joint]
        node = {"name": names[joint], "translation": local[:3, 3].tolist(), "rotation": turn.as_quat().tolist()}
        nodes.append({**node, **({"children": below} if below else {})})
    roots = [0] if how.above else [index[joint] for joint in tops]
    if how.above:
        nodes[len(how.above) - 1]["children"] = [index[joint] for joint in tops]
    pack = _Numbers()
    vertices = how.facing.apply(skin.positions + floor) / how.unit
    grown = np.diag([how.unit, how.unit, how.unit, 1.0])
    document["skins"], document["meshes"] = [], []
    for name, listed in (how.meshes or {"Body": ()}).items():
        joints = [joint for joint in order if not listed or names[joint] in listed]
        slots = {joint: k for k, joint in enumerate(joints)}
        binds = np.array([(np.linalg.inv(worlds[joint]) @ grown).T for joint in joints])
        inside = np.isin(skin.joints, joints) | (skin.weights == 0)
        kept = skin.triangles[inside.all(axis=1)[skin.triangles].all(axis=1)]
        slot = np.vectorize(lambda joint, slots=slots: slots.get(joint, 0))(skin.joints)
        weights = np.where(inside, skin.weights, 0.0)
        primitive = {
            "attributes": {
                "POSITION": pack.put(vertices, "VEC3", 5126),
                "JOINTS_0": pack.put(slot, "VEC4", 5123),
                "WEIGHTS_0": pack.put(weights, "VEC4", 5126),
            },
            "indices": pack.put(kept.reshape(-1, 1), "SCALAR", 5125),
        }
        document["skins"].append(
            {"joints": [index[k] for k in joints], "inverseBindMatrices": pack.put(binds.reshape(-1, 16), "MAT4", 5126)}
        )
        (nodes[len(how.above) - 1]["children"] if how.above else roots).append(len(nodes))
        nodes.append({"name": name, "mesh": len(document["meshes"]), "skin": len(document["skins"]) - 1})
        document["meshes"].append({"name": name, "primitives": [primitive]})
    document |= {"scenes": [{"nodes": roots}], **pack.told()}
    if how.extensions is not None:
        document["extensions"] = how.extensions({node["name"]: k for k, node in enumerate(nodes)})
        document["extensionsUsed"] = list(document["extensions"])
    path.write_bytes(packed(document, pack.data))
    return replace(body, names=tuple(names[: body.joints]))


def _parents_first(parents: Sequence[int]) -> list[int]:
    """Joints so that every parent comes before its children, branch by branch as exporters list them."""
    out: list[int] = []

    def visit(joint: int) -> None:
        out.append(joint)
        for child, parent in enumerate(parents):
            if parent == joint:
                visit(child)

    for top in [joint for joint, parent in enumerate(parents) if parent < 0]:
        visit(top)
    return out


class _Numbers:
    """Numbers of a file as they are added."""

    def __init__(self) -> None:
        self.data, self.views, self.accessors = b"", [], []

    def put(self, values: np.ndarray, kind: str, code: int) -> int:
        data = np.ascontiguousarray(values, {5126: "<f4", 5123: "<u2", 5125: "<u4"}[code]).tobytes()
        data += b"\0" * (-len(data) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        more = {"min": values.min(0).tolist(), "max": values.max(0).tolist()} if kind == "VEC3" else {}
        told = {"bufferView": len(self.views) - 1, "componentType": code, "count": len(values), "type": kind, **more}
        self.accessors.append(told)
        self.data += data
        return len(self.accessors) - 1

    def told(self) -> dict[str, Any]:
        return {
            "bufferViews": self.views,
            "accessors": self.accessors,
            "buffers": [{"byteLength": len(self.data)}],
        }


def skinned(glb: Glb, worlds: np.ndarray) -> np.ndarray:
    """Where all vertices of all skinned meshes are that a triangle has."""
    out = []
    for node in glb["nodes"]:
        for primitive in glb["meshes"][node["mesh"]]["primitives"] if "skin" in node else ():
            told = glb["skins"][node["skin"]]
            carry = worlds[told["joints"]] @ glb.array(told["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
            attributes = primitive["attributes"]
            places = glb.array(attributes["POSITION"])
            joints, weights = glb.array(attributes["JOINTS_0"]).astype(int), glb.array(attributes["WEIGHTS_0"])
            ones = np.concatenate((places, np.ones((len(places), 1))), axis=1)
            moved = np.einsum("vk,vkij,vj->vi", weights, carry[joints], ones)[:, :3]
            out.append(moved[np.unique(glb.array(primitive["indices"]).astype(int))])
    return np.concatenate(out)


# --- what the programs do -------------------------------------------------------------------------------------------


def _words(table: Mapping[str, str], left: tuple[str, str] = ("Left", "Right")) -> Callable[[str], str]:
    """Our names in other words; ``{S}`` stands for the side."""

    def word(name: str) -> str:
        for side, short in zip(SIDES, left, strict=True):
            if name.startswith(side):
                return table.get(name.removeprefix(side), name).format(S=short)
        return table.get(name, name)

    return word


def _along(axis: Sequence[float], bone: np.ndarray) -> Rotation:
    """The turn by which a joint's axis lies along its bone, and another one points ahead."""
    way = bone / np.linalg.norm(bone) if np.linalg.norm(bone) > 0 else np.array([0.0, 1.0, 0.0])
    return Rotation.align_vectors([way, [0.0, 0.0, 1.0]], [axis, [0.0, 0.0, 1.0]], weights=[1.0, 1e-3])[0]


def _both(rows: Sequence[tuple[str, str, tuple[float, float, float]]], sides: tuple[str, str]):
    """Rows of the left, ``{S}``, and their mirror images."""
    return [
        (name.format(S=side), parent.format(S=side), (sign * x, y, z))
        for side, sign in zip(sides, (1.0, -1.0), strict=True)
        for name, parent, (x, y, z) in rows
    ]


MIXAMO = Export(
    names=lambda name: f"mixamorig:{'Spine2' if name == 'Chest' else name}",
    further=[
        ("mixamorig:HeadTop_End", "mixamorig:Head", (0.0, 0.19, 0.0)),
        *_both(
            [
                ("mixamorig:{S}Toe_End", "mixamorig:{S}ToeBase", (0.0, -0.01, 0.07)),
                ("mixamorig:{S}HandIndex1", "mixamorig:{S}Hand", (0.09, 0.0, 0.02)),
                ("mixamorig:{S}HandIndex2", "mixamorig:{S}HandIndex1", (0.03, 0.0, 0.0)),
            ],
            SIDES,
        ),
    ],
    frames=lambda _name, bone: _along([0.0, 1.0, 0.0], bone),
    above=[("Armature", Rotation.from_euler("x", 90, degrees=True), 0.01)],
    meshes={"Beta_Joints": (), "Beta_Surface": ()},
)
"""A Mixamo FBX that Blender made a GLB of: centimetres below an armature that is turned and scaled."""

VROID = Export(
    names=_words(
        {
            "Hips": "J_Bip_C_Hips",
            "Spine": "J_Bip_C_Spine",
            "Spine1": "J_Bip_C_Chest",
            "Chest": "J_Bip_C_UpperChest",
            "Neck": "J_Bip_C_Neck",
            "Head": "J_Bip_C_Head",
            "UpLeg": "J_Bip_{S}_UpperLeg",
            "Leg": "J_Bip_{S}_LowerLeg",
            "Foot": "J_Bip_{S}_Foot",
            "ToeBase": "J_Bip_{S}_ToeBase",
            "Shoulder": "J_Bip_{S}_Shoulder",
            "Arm": "J_Bip_{S}_UpperArm",
            "ForeArm": "J_Bip_{S}_LowerArm",
            "Hand": "J_Bip_{S}_Hand",
            "HandThumb": "J_Bip_{S}_Thumb1",
        },
        ("L", "R"),
    ),
    further=[
        *((f"J_Sec_Hair{k}_{i:02d}", "J_Bip_C_Head", (0.02 * k - 0.1, 0.15, -0.05)) for k in range(10) for i in (1, 2)),
        *_both(
            [
                ("J_Adj_{S}_FaceEye", "J_Bip_C_Head", (0.03, 0.06, 0.08)),
                ("J_Sec_{S}_Bust1", "J_Bip_C_UpperChest", (0.05, 0.0, 0.1)),
                ("J_Sec_{S}_SkirtFront0_01", "J_Bip_C_Hips", (0.1, -0.05, 0.1)),
            ],
            ("L", "R"),
        ),
    ],
    facing=Rotation.from_euler("y", 180, degrees=True),
    above=[("Root", Rotation.identity(), 1.0)],
    meshes={"Face": (), "Body": (), "Hair001": ("J_Bip_C_Head", "J_Bip_C_Neck")},
)
"""VRM 0 from VRoid: frames agree with the world, faces -Z, more hair than bones."""

VRM_BONES = {
    "Hips": "hips",
    "Spine": "spine",
    "Chest": "chest",
    "Neck": "neck",
    "Head": "head",
    **{
        f"{side}{ours}": f"{side.lower()}{theirs}"
        for side in SIDES
        for ours, theirs in (
            ("UpLeg", "UpperLeg"),
            ("Leg", "LowerLeg"),
            ("Foot", "Foot"),
            ("ToeBase", "Toes"),
            ("Shoulder", "Shoulder"),
            ("Arm", "UpperArm"),
            ("ForeArm", "LowerArm"),
            ("Hand", "Hand"),
        )
    },
}


def _numbered(name: str) -> str:
    """A name that says nothing."""
    return f"Bone.{humanoid().names.index(name):03d}"


def _vrm1(nodes: dict[str, int]) -> dict[str, Any]:
    bones = {theirs: {"node": nodes[_numbered(ours)]} for ours, theirs in VRM_BONES.items()}
    return {"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}}


def _vrm0(nodes: dict[str, int]) -> dict[str, Any]:
    bones = [{"bone": theirs, "node": nodes[_numbered(ours)]} for ours, theirs in VRM_BONES.items()]
    return {"VRM": {"specVersion": "0.0", "humanoid": {"humanBones": bones}}}


VRM1 = Export(names=_numbered, above=[("Root", Rotation.identity(), 1.0)], extensions=_vrm1)
VRM0 = Export(
    names=_numbered,
    facing=Rotation.from_euler("y", 180, degrees=True),
    above=[("Root", Rotation.identity(), 1.0)],
    extensions=_vrm0,
)
"""VRM of somebody's own bones, whose names only the extension explains."""

READY_PLAYER_ME = Export(
    names=lambda name: "Spine2" if name == "Chest" else name,
    further=[
        ("HeadTop_End", "Head", (0.0, 0.19, 0.0)),
        *_both([("{S}Eye", "Head", (0.03, 0.06, 0.08)), ("{S}Toe_End", "{S}ToeBase", (0.0, -0.01, 0.07))], SIDES),
    ],
    frames=lambda _name, bone: _along([0.0, 1.0, 0.0], bone),
    above=[("Armature", Rotation.identity(), 1.0)],
    meshes={
        "EyeLeft": ("Head", "LeftEye", "Neck"),
        "Wolf3D_Head": ("Spine2", "Neck", "Head"),
        "Wolf3D_Body": (),
        "Wolf3D_Outfit_Footwear": ("LeftFoot", "LeftToeBase", "RightFoot", "RightToeBase", "LeftLeg", "RightLeg"),
    },
)
"""Ready Player Me: one skin a mesh, the first ones of a few joints."""

UNREAL = Export(
    names=_words(
        {
            "Hips": "pelvis",
            "Spine": "spine_01",
            "Spine1": "spine_02",
            "Chest": "spine_03",
            "Neck": "neck_01",
            "Head": "head",
            "UpLeg": "thigh_{S}",
            "Leg": "calf_{S}",
            "Foot": "foot_{S}",
            "ToeBase": "ball_{S}",
            "Shoulder": "clavicle_{S}",
            "Arm": "upperarm_{S}",
            "ForeArm": "lowerarm_{S}",
            "Hand": "hand_{S}",
            "HandThumb": "thumb_01_{S}",
        },
        ("l", "r"),
    ),
    further=[
        *_both(
            [
                ("thigh_twist_01_{S}", "thigh_{S}", (0.0, -0.2, 0.0)),
                ("calf_twist_01_{S}", "calf_{S}", (0.0, -0.2, 0.0)),
                ("upperarm_twist_01_{S}", "upperarm_{S}", (0.1, 0.0, 0.0)),
                ("lowerarm_twist_01_{S}", "lowerarm_{S}", (0.1, 0.0, 0.0)),
            ],
            ("l", "r"),
        ),
        ("ik_foot_root", "root", (0.0, 0.0, 0.0)),
        *_both([("ik_foot_{S}", "ik_foot_root", (0.09, 0.08, -0.01))], ("l", "r")),
        ("ik_hand_root", "root", (0.0, 0.0, 0.0)),
        ("ik_hand_gun", "ik_hand_root", (-0.8, 1.4, 0.0)),
        *_both([("ik_hand_{S}", "ik_hand_gun", (0.8, 0.0, 0.0))], ("l", "r")),
    ],
    frames=lambda name, bone: _along([-1.0 if name.endswith("_r") else 1.0, 0.0, 0.0], bone),
    floor="root",
    above=[("SKM_Manny", Rotation.from_euler("x", -90, degrees=True), 1.0)],
    unit=0.01,
)
"""Unreal's mannequin: a root on the floor, twist and IK bones, X along the bones, the right side mirrored."""

RIGIFY = Export(
    names=_words(
        {
            "Hips": "DEF-spine",
            "Spine": "DEF-spine.001",
            "Spine1": "DEF-spine.002",
            "Chest": "DEF-spine.003",
            "Neck": "DEF-spine.004",
            "Head": "DEF-spine.006",
            "UpLeg": "DEF-thigh.{S}",
            "Leg": "DEF-shin.{S}",
            "Foot": "DEF-foot.{S}",
            "ToeBase": "DEF-toe.{S}",
            "Shoulder": "DEF-shoulder.{S}",
            "Arm": "DEF-upper_arm.{S}",
            "ForeArm": "DEF-forearm.{S}",
            "Hand": "DEF-hand.{S}",
            "HandThumb": "DEF-thumb.01.{S}",
        },
        ("L", "R"),
    ),
    further=_both(
        [
            ("DEF-pelvis.{S}", "DEF-spine", (0.02, 0.0, 0.02)),
            ("DEF-breast.{S}", "DEF-spine.003", (0.1, 0.0, 0.1)),
            ("DEF-f_index.01.{S}", "DEF-hand.{S}", (0.09, 0.0, 0.02)),
        ],
        ("L", "R"),
    ),
    frames=lambda _name, bone: _along([0.0, 1.0, 0.0], bone),
    above=[("rig", Rotation.identity(), 1.0)],
)
"""Rigify's deforming bones, once they are made one tree."""
