"""Rigged GLB for tests, as artists make them: joints at any angle, several skins, a hat, and much that is no figure."""

from __future__ import annotations

from base64 import b64decode
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from glbs import packed
from stridecast.body import kinematics
from stridecast.body.mannequin import mannequin
from stridecast.model.skeleton import Skeleton

PIXEL = b64decode("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC")
"""A red picture, PNG."""


@dataclass
class Parts:
    """A document in the making."""

    document: dict[str, Any] = field(default_factory=dict)
    numbers: bytes = b""

    def add(self, part: str, **content: Any) -> int:
        self.document.setdefault(part, []).append(content)
        return len(self.document[part]) - 1

    def view(self, data: bytes, **more: Any) -> int:
        self.numbers += b"\0" * (-len(self.numbers) % 4)
        view = self.add("bufferViews", buffer=0, byteOffset=len(self.numbers), byteLength=len(data), **more)
        self.numbers += data
        return view

    def put(self, array: np.ndarray, kind: str, code: str = "<f4", **more: Any) -> int:
        data = np.ascontiguousarray(array, code)
        number = {"<f4": 5126, "<u1": 5121, "<u2": 5123}[code]
        return self.add(
            "accessors", bufferView=self.view(data.tobytes()), componentType=number, count=len(data), type=kind, **more
        )

    def mesh(self, name: str, places: np.ndarray, triangles: np.ndarray, normals: np.ndarray, **attributes: int) -> int:
        flat = places.astype("<f4")
        bounds = {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        shape = {"POSITION": self.put(flat, "VEC3", **bounds), "NORMAL": self.put(normals, "VEC3"), **attributes}
        indices = self.put(triangles.reshape(-1), "SCALAR", "<u2")
        return self.add("meshes", name=name, primitives=[{"attributes": shape, "indices": indices, "material": 0}])

    def write(self, path: Path) -> None:
        document = {**self.document, "buffers": [{"byteLength": len(self.numbers) + -len(self.numbers) % 4}]}
        path.write_bytes(packed(document, self.numbers))


def numbers(values: np.ndarray) -> list[float]:
    return np.asarray(values, float).tolist()


def artists_rig(
    path: Path,
    skeleton: Skeleton,
    *,
    seed: int = 0,
    unit: float = 1.0,
    armature: float = 1.0,
    picture: bool = True,
    matrices: bool = True,
) -> None:
    """A figure that faces anywhere, in two skinned meshes of different spaces, with a hat on its head.

    Beside it are a camera, lights, a thing on the floor, a scene that is not shown, and an animation.

    Parameters
    ----------
    unit
        Metres per unit of the file.
    armature
        Scale of the node above the joints.
    picture
        Whether there is a texture.
    matrices
        Whether some nodes have a matrix, which no animation may turn.
    """
    rng, parts = np.random.default_rng(seed), Parts()
    parts.document["asset"] = {"version": "2.0", "copyright": "Ann Artist"}
    facing = Rotation.from_euler("y", rng.uniform(-np.pi, np.pi))
    places = facing.apply(kinematics.rest(skeleton).positions) / unit + [0.0, 1.0 / unit, 0.0]
    rest = Rotation.random(skeleton.joints, random_state=rng)
    over = np.eye(4)
    over[:3, :3], over[:3, 3] = armature * Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3) / unit
    _materials(parts, picture)

    def local(above: np.ndarray, own: np.ndarray) -> dict[str, Any]:
        own = np.linalg.inv(above) @ own
        if matrices and rng.uniform() < 0.2:
            return {"matrix": numbers(own.T.ravel())}
        size = float(np.cbrt(np.linalg.det(own[:3, :3])))
        turn = Rotation.from_matrix(own[:3, :3] / size).as_quat()
        scale = {} if abs(size - 1) < 1e-9 else {"scale": [size] * 3}
        return {"translation": numbers(own[:3, 3]), "rotation": numbers(turn), **scale}

    worlds = np.tile(np.eye(4), (skeleton.joints, 1, 1))
    worlds[:, :3, :3], worlds[:, :3, 3] = rest.as_matrix() * armature, places
    first = parts.add("nodes", name="Armature", **local(np.eye(4), over)) + 1
    for k in range(skeleton.joints):
        parent = int(skeleton.parents[k])
        above = worlds[parent] if parent >= 0 else over
        below = [first + int(c) for c in np.flatnonzero(skeleton.parents == k)]
        children = {"children": below} if below else {}
        parts.add("nodes", name=skeleton.names[k], **local(above, worlds[k]), **children)
    _skins(parts, skeleton, worlds, facing, unit, first, rng)
    _hat(parts, first + skeleton.names.index("Head"), 1.0 / unit / armature, rng)
    _beside(parts, first)
    parts.document["nodes"][0]["children"] = [first, *parts.document.pop("_below")]
    parts.write(path)


def _materials(parts: Parts, picture: bool) -> None:
    shine = {"KHR_materials_ior": {"ior": 1.4}}
    coat: dict[str, Any] = {"name": "Coat", "extensions": shine, "pbrMetallicRoughness": {"metallicFactor": 0.0}}
    if picture:
        parts.add("images", bufferView=parts.view(PIXEL), mimeType="image/png")
        parts.add("samplers", magFilter=9729)
        parts.add("textures", source=0, sampler=0)
        laid = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
        coat["pbrMetallicRoughness"]["baseColorTexture"] = laid
    parts.add("materials", **coat)
    used = ["KHR_texture_transform"] if picture else []
    parts.document["extensionsUsed"] = [*used, "KHR_materials_ior", "KHR_lights_punctual"]


def _skins(
    parts: Parts,
    skeleton: Skeleton,
    worlds: np.ndarray,
    facing: Rotation,
    unit: float,
    first: int,
    rng: np.random.Generator,
) -> None:
    """Legs and the rest of the mannequin as two meshes; each in a space of its own, with the joints that it needs."""
    body = mannequin(skeleton, low=True)
    legs = [k for k in range(skeleton.joints) if "Leg" in skeleton.names[k] or "Foot" in skeleton.names[k]]
    legs += [k for k in range(skeleton.joints) if "Toe" in skeleton.names[k]]
    below: list[int] = []
    for name in ("Coat", "Legs"):
        chosen = body.triangles[np.isin(body.joints[body.triangles[:, 0], 0], legs) == (name == "Legs")]
        used = np.unique(chosen)
        influences, weights = body.joints[used], body.weights[used]
        turn = facing * Rotation.create_group("O")[int(rng.integers(24))]  # any axis of a mesh may be up
        space = np.eye(4)  # from the mesh to the world at rest
        space[:3, :3], space[:3, 3] = 0.5 * turn.as_matrix(), rng.normal(size=3) / unit
        there = facing.apply(body.positions[used]) / unit + [0.0, 1.0 / unit, 0.0]
        inside = np.linalg.inv(space)
        places = there @ inside[:3, :3].T + inside[:3, 3]
        joints = np.unique(np.append(influences[weights > 0], 0))
        rng.shuffle(joints)
        slots = np.zeros(skeleton.joints, int)
        slots[joints] = np.arange(len(joints))
        binds = np.linalg.inv(worlds[joints]) @ space
        skin = parts.add(
            "skins",
            name=name,
            joints=[first + int(k) for k in joints],
            inverseBindMatrices=parts.put(binds.transpose(0, 2, 1).reshape(-1, 16), "MAT4"),
            **({"skeleton": first} if name == "Legs" else {}),
        )
        mesh = parts.mesh(
            name,
            places,
            np.searchsorted(used, chosen),
            turn.inv().apply(facing.apply(body.normals[used])),
            TEXCOORD_0=parts.put(body.positions[used, :2], "VEC2"),
            JOINTS_0=parts.put(np.where(weights > 0, slots[influences], 0), "VEC4", "<u1"),
            WEIGHTS_0=parts.put(weights, "VEC4"),
        )
        below.append(parts.add("nodes", name=name, mesh=mesh, skin=skin, extras={"of": "the artist"}))
    parts.document["_below"] = below


def _hat(parts: Parts, head: int, size: float, rng: np.random.Generator) -> None:
    """A rigid mesh below a node that is no joint, and a camera in its brim."""
    corners = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 1.5, 0.0]]) * 0.1
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0]])
    normals = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    uv = parts.put(rng.uniform(size=(5, 2)), "VEC2")
    hat = parts.mesh("Hat", corners, faces, normals, TEXCOORD_0=uv)
    lens = parts.add("cameras", type="perspective", perspective={"yfov": 0.7, "znear": 0.1})
    brim = parts.add("nodes", name="Brim", mesh=hat, scale=[size, 0.5 * size, size])
    eye = parts.add("nodes", name="Eye", camera=lens)
    turn = Rotation.random(random_state=rng).as_quat()
    socket = parts.add("nodes", name="Socket", rotation=numbers(turn), children=[brim, eye])
    parts.document["nodes"][head].setdefault("children", []).append(socket)


def _beside(parts: Parts, first: int) -> None:
    """What is no part of the figure."""
    light = {"KHR_lights_punctual": {"light": 0}}
    parts.document["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    lamp = parts.add("nodes", name="Lamp", extensions=light, translation=[0, 3, 0])
    thing = parts.add("nodes", name="Crate", mesh=2)
    elsewhere = parts.add("nodes", name="Elsewhere", mesh=2)
    parts.document["scenes"] = [{"nodes": [elsewhere]}, {"nodes": [0, lamp, thing]}]
    parts.document["scene"] = 1
    times = parts.put(np.array([0.0, 1.0]), "SCALAR", min=[0.0], max=[1.0])
    keys = parts.put(np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)), "VEC4")
    channel = {"sampler": 0, "target": {"node": lamp, "path": "rotation"}}
    parts.add("animations", name="Blink", channels=[channel], samplers=[{"input": times, "output": keys}])
