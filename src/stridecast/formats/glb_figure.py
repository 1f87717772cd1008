"""Parts of a GLB: a body (mesh, skin, nodes) and the keys that move it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from stridecast.formats.gltf import INDICES, VERTICES, GltfWriter, number, to_json
from stridecast.geometry import signals
from stridecast.model.contacts import SIDES
from stridecast.model.mesh import SkinnedMesh
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

SHORT = 32767
"""Largest number of a normalised 16 bit integer."""

COLOR = (0.62, 0.60, 0.57, 1.0)
"""Of the mannequin, linear."""


Planted = Bool[Array, "frames 2"]


class Moved(NamedTuple):
    """A motion as nodes of a file have it, each in its parent's frame."""

    nodes: Sequence[int]
    turns: Float[Array, "nodes frames 4"]
    root: int
    """The node that is placed, ..."""

    places: Float[Array, "frames 3"]
    """... and where."""

    scale: float
    """How much larger the body of the motion is than that of the file."""


class Nodes(NamedTuple):
    """Nodes of one body in a scene."""

    person: int
    """Above its joints; its scale is that of the body."""

    joints: list[int]
    roots: list[int]
    """Those that the scene lists."""


class Figure:
    """A body: its mesh and skin are written once, and placed as often as needed.

    Parameters
    ----------
    writer
        Of the file.
    skeleton, mesh
        The body and its skin.
    """

    def __init__(self, writer: GltfWriter, skeleton: Skeleton, mesh: SkinnedMesh) -> None:
        self.skeleton = skeleton
        self._writer = writer
        self._mesh = _add_mesh(writer, mesh)
        self._lift = -float(mesh.positions[:, 1].min()) if len(mesh.positions) else 0.0
        binds = np.tile(np.eye(4, dtype="<f4"), (skeleton.joints, 1, 1))
        binds[:, 3, :3] = -mesh.bind_positions  # columns first, as glTF has matrices; all frames agree at rest
        self._binds = writer.accessor(binds.reshape(-1, 16))

    def place(
        self,
        name: str,
        motion: Motion | None = None,
        *,
        scale: float = 1.0,
        extras: dict[str, Any] | None = None,
    ) -> Nodes:
        """Put a body into the scene, as in the first frame of a motion, else at rest on the floor."""
        w, s = self._writer, self.skeleton
        first = w.count("nodes") + 1
        children: list[list[int]] = [[] for _ in range(s.joints)]
        for joint in range(1, s.joints):
            children[s.parents[joint]].append(first + joint)
        node = w.add("nodes", person_node(free_name(name, s.names), [first], scale, extras))
        offsets = s.offsets.copy()
        offsets[0] = (0.0, self._lift, 0.0) if motion is None else motion.root_positions[0] / scale
        roles: dict[int, str] = {}
        for role, joint in s.roles.items():
            roles.setdefault(joint, role)
        ends: dict[int, list[list[float]]] = {}
        for joint, end in zip(s.end_joints.tolist(), s.end_offsets.tolist(), strict=True):
            ends.setdefault(joint, []).append(numbers(end))
        for joint in range(s.joints):
            what: dict[str, Any] = {"name": s.names[joint], "translation": numbers(offsets[joint])}
            if motion is not None:
                what["rotation"] = numbers(turned(motion.rotations[0, joint]))
            if children[joint]:
                what["children"] = children[joint]
            own: dict[str, Any] = {}
            if joint in roles:
                own["role"] = roles[joint]
            if joint in ends:
                own["ends"] = ends[joint]
            if own:
                what["extras"] = {"stridecast": own}
            w.add("nodes", what)
        joints = list(range(first, first + s.joints))
        skin = w.add("skins", {"inverseBindMatrices": self._binds, "joints": joints})
        # a node of the scene itself: what is above a skinned mesh does not move it
        skinned = w.add("nodes", {"name": free_name(f"{name} skin", s.names), "mesh": self._mesh, "skin": skin})
        return Nodes(node, joints, [node, skinned])


class Keys:
    """One animation in the making.

    Parameters
    ----------
    writer
        Of the file.
    """

    def __init__(self, writer: GltfWriter) -> None:
        self._writer = writer
        self._samplers: list[str] = []
        self._channels: list[str] = []
        self._times: dict[tuple[float, int, float], int] = {}

    def move(self, moved: Moved, frame_rate: float, *, start: float = 0.0, compact: bool = False) -> None:
        """Add a motion from a time on."""
        w = self._writer
        times = self._times_of(start, len(moved.places), frame_rate)
        self._channel(moved.root, "translation", times, w.accessor(moved.places.astype("<f4")))
        turns = moved.turns[..., [1, 2, 3, 0]].astype("<f4")
        keys: Array = turns
        if compact:
            keys = np.rint(turns * SHORT).astype("<i2")
        rest = still(keys) if compact else np.zeros(len(keys), bool)
        view = w.view(keys[~rest]) if not rest.all() else -1
        size = keys[0].nbytes
        at = 0
        for joint, node in enumerate(moved.nodes):
            if rest[joint]:
                once = self._times_of(start, 1, frame_rate)
                self._channel(node, "rotation", once, w.accessor(keys[joint, :1], normalized=compact))
                continue
            self._channel(node, "rotation", times, w.part_of(view, at * size, keys[joint], normalized=compact))
            at += 1

    def show(self, node: int, scale: float, start: float, end: float, last: float) -> None:
        """Hide a person by the scale 0 before they appear and from when they have left; ``last`` is when all ends."""
        times, scales = [0.0], [scale]
        if start > 0:
            times, scales = [0.0, start], [0.0, scale]
        if end <= last:
            times.append(end)
            scales.append(0.0)
        if len(times) == 1:
            return
        keys = np.repeat(np.array(scales, "<f4")[:, None], 3, axis=1)
        when = self._writer.accessor(np.array(times, "<f4"), bounds=True)
        self._channel(node, "scale", when, self._writer.accessor(keys), "STEP")

    def save(self, name: str, extras: dict[str, Any], *, origin: float = 0.0) -> None:
        """Add the animation to the file; its time 0 is that of ``origin``."""
        for (start, frames, rate), accessor in self._times.items():
            self._writer.come(accessor, (start - origin + np.arange(frames) / rate).astype("<f4"))
        self._writer.add_text(
            "animations",
            f'{{"name":{to_json(name)},"channels":[{",".join(self._channels)}],"samplers":[{",".join(self._samplers)}],'
            f'"extras":{to_json({"stridecast": extras})}}}',
        )

    def _channel(self, node: int, path: str, times: int, values: int, mode: str = "LINEAR") -> None:
        sampler = len(self._samplers)
        how = "" if mode == "LINEAR" else f',"interpolation":"{mode}"'
        self._samplers.append(f'{{"input":{times},"output":{values}{how}}}')
        self._channels.append(f'{{"sampler":{sampler},"target":{{"node":{node},"path":"{path}"}}}}')

    def _times_of(self, start: float, frames: int, rate: float) -> int:
        """Accessor of the times of frames, which are written at the end: only then it is clear where they begin."""
        key = (start, frames, rate)
        if key not in self._times:
            self._times[key] = self._writer.later()
        return self._times[key]


def still(keys: Array) -> Bool[Array, "joints"]:
    """Which joints never turn, of keys (joints, frames, 4)."""
    return np.asarray((keys == keys[:, :1]).all(axis=(1, 2)))


def moved_as_ours(motion: Motion, joints: Sequence[int], scale: float = 1.0) -> Moved:
    """A motion of nodes that are joints of ours, below a person of a scale."""
    return Moved(joints, motion.rotations.transpose(1, 0, 2), joints[0], motion.root_positions / scale, scale)


def person_node(
    name: str, children: Sequence[int], scale: float = 1.0, extras: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """A node above a body that has its size, and what there is to say of the person."""
    person: dict[str, Any] = {"name": name, "children": list(children)}
    if scale != 1.0:
        person["scale"] = [scale] * 3
    if extras:
        person["extras"] = {"stridecast": extras}
    return person


def provenance(motion: Motion) -> dict[str, Any]:
    """Where a motion comes from; only the file's name, as folders are nobody else's business."""
    told = {"subject": motion.subject, "source": Path(motion.source).name}
    return {"frame_rate": motion.frame_rate, "frames": motion.frames, **{k: v for k, v in told.items() if v}}


def plants(planted: Planted, rate: float, start: float = 0.0) -> list[dict[str, object]]:
    """Foot plants as they are told in ``extras``: which foot, from when to when in seconds, in the order of time."""
    found = [
        (start + begin / rate, start + (end - 1) / rate, side)
        for column, side in enumerate(SIDES)
        for stands, begin, end in signals.runs(planted[:, column])
        if stands
    ]
    return [{"foot": side, "from": round(a, 6), "to": round(b, 6)} for a, b, side in sorted(found)]


def _add_mesh(writer: GltfWriter, mesh: SkinnedMesh) -> int:
    small = len(mesh.positions) < 65535
    narrow = len(mesh.bind_positions) <= 256
    attributes = {
        "POSITION": writer.accessor(mesh.positions.astype("<f4"), target=VERTICES, bounds=True),
        "NORMAL": writer.accessor(mesh.normals.astype("<f4"), target=VERTICES),
        "JOINTS_0": writer.accessor(mesh.joints.astype("<u1" if narrow else "<u2"), target=VERTICES),
        "WEIGHTS_0": writer.accessor(_whole(mesh.weights), target=VERTICES, normalized=True),
    }
    indices = writer.accessor(mesh.triangles.reshape(-1).astype("<u2" if small else "<u4"), target=INDICES)
    material = writer.add(
        "materials",
        {
            "name": "Mannequin",
            "pbrMetallicRoughness": {"baseColorFactor": list(COLOR), "metallicFactor": 0, "roughnessFactor": 0.8},
        },
    )
    primitive = {"attributes": attributes, "indices": indices, "material": material}
    return writer.add("meshes", {"name": "Mannequin", "primitives": [primitive]})


def _whole(weights: Float[Array, "vertices 4"]) -> Array:
    """Weights as 16 bit numbers whose sum is exactly 1: the largest takes what rounding leaves."""
    most = 65535
    out = np.rint(weights * most).astype(np.int64)
    rows = np.arange(len(out))
    out[rows, out.argmax(axis=1)] += most - out.sum(axis=1)
    return out.astype("<u2")


def turned(rotation: Float[Array, "4"]) -> Float[Array, "4"]:
    """``x y z w``, exactly of unit length in single precision."""
    return rotation[[1, 2, 3, 0]] / np.linalg.norm(rotation)


def numbers(values: Float[Array, "n"] | list[float]) -> list[float]:
    """As JSON has them, to a nanometre."""
    return [number(round(float(value), 9) + 0.0) for value in values]


def free_name(name: str, taken: Sequence[str]) -> str:
    """A name that no joint has."""
    while name in taken:
        name += "_"
    return name
