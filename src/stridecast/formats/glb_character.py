"""Motion on somebody's own character: a rigged GLB comes back with its meshes, materials and skins, now walking.

The file stays as it is, but for its animations, which give way to one of ours. Joints may rest at any angle in it; ours
agree with the world at rest, so a joint is turned to ``W F G`` in the world, with our rotation ``W``, the rest
orientation ``G`` of the file, and ``F``, which turns the file's body at rest into ours.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from stridecast.body import kinematics
from stridecast.errors import FileError, SkeletonError
from stridecast.formats.files import replacing
from stridecast.formats.glb_motion import GlbFigure
from stridecast.formats.gltf import BIN_CHUNK, JSON_CHUNK, MAGIC, VERSION
from stridecast.formats.gltf_reading import GltfReader
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion

Array = np.ndarray

ALIKE = 1e-3
"""Bones of the motion and of the file differ by less than this share of the largest, else it is another body."""


def write_character(path: str | Path, motion: Motion, character: str | Path) -> None:
    """Write a motion onto a rigged GLB.

    Parameters
    ----------
    path
        The file to write.
    motion
        Of the skeleton that ``load_skeleton(character)`` gives, such as ``recast`` makes.
    character
        The rigged GLB.

    Raises
    ------
    FileError
        The character is no GLB that can be read, or the file system refuses; what was there is untouched.
    SkeletonError
        The motion is that of another skeleton.
    """
    try:
        with Path(character).open("rb") as file:
            reader = GltfReader(character, file)
            document, numbers = _animated(reader, reader.binary(), motion)
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=character) from error
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    total = 28 + len(text) + len(numbers)
    with replacing(path) as out:
        out.write(struct.pack("<3I", MAGIC, VERSION, total))
        out.write(struct.pack("<2I", len(text), JSON_CHUNK) + text)
        out.write(struct.pack("<2I", len(numbers), BIN_CHUNK) + numbers)


def _animated(reader: GltfReader, numbers: bytes, motion: Motion) -> tuple[dict[str, Any], bytes]:
    """The file's document and numbers with the motion as its only animation."""
    figure = GlbFigure(reader, still=True)
    document = reader.document
    turns, place = _keys(figure, motion)
    blocks, size = [numbers + b"\0" * (-len(numbers) % 4)], len(numbers) + (-len(numbers) % 4)
    views, accessors = document.setdefault("bufferViews", []), document.setdefault("accessors", [])

    def put(values: Array, kind: str, **more: Any) -> int:
        nonlocal size
        data = np.ascontiguousarray(values, "<f4").tobytes()
        views.append({"buffer": 0, "byteOffset": size, "byteLength": len(data)})
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": 5126, "count": len(values), "type": kind, **more}
        )
        blocks.append(data)
        size += len(data)
        return len(accessors) - 1

    times = np.arange(motion.frames, dtype=np.float32) / np.float32(motion.frame_rate)
    clock = put(times, "SCALAR", min=[float(times[0])], max=[float(times[-1])])
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []

    def move(node: int, what: str, output: int) -> None:
        channels.append({"sampler": len(samplers), "target": {"node": node, "path": what}})
        samplers.append({"input": clock, "output": output, "interpolation": "LINEAR"})

    for node, keys in turns.items():
        figure.unpack(node)
        move(node, "rotation", put(keys[:, [1, 2, 3, 0]], "VEC4"))
    root, keys = place
    move(root, "translation", put(keys, "VEC3"))
    told = {"frame_rate": motion.frame_rate, "frames": motion.frames}
    document["animations"] = [
        {
            "name": motion.name or "Walk",
            "channels": channels,
            "samplers": samplers,
            "extras": {"stridecast": told},
        }
    ]
    document["buffers"] = [{"byteLength": size}]
    return document, b"".join(blocks)


def _keys(
    figure: GlbFigure, motion: Motion
) -> tuple[dict[int, Float[Array, "frames 4"]], tuple[int, Float[Array, "frames 3"]]]:
    """Rotations of the nodes that the motion knows, and the root's node with its places, in their parents' frames."""
    rest = figure.at_rest()
    body = motion.skeleton
    ours = {name: k for k, name in enumerate(body.names)}
    shared = [(k, ours[name]) for k, name in enumerate(rest.names) if name in ours]
    root = next((k for k, own in shared if own == 0), None)
    if root is None:
        raise SkeletonError(f"the character has no joint {body.names[0]!r}; the motion is that of another skeleton")
    if len(shared) < 2:
        raise SkeletonError("the character shares one joint with the motion; that is of another skeleton")
    theirs = np.array([rest.places[k] for k, _ in shared])
    mine = kinematics.rest(body).positions[[own for _, own in shared]]
    theirs, mine = theirs - theirs[0], mine - mine[0]
    size = np.linalg.norm(mine) / np.linalg.norm(theirs)
    left, _, right = np.linalg.svd(mine.T @ theirs)
    fit = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    if np.abs(size * theirs @ fit.T - mine).max() > ALIKE * np.abs(mine).max():
        raise SkeletonError("the bones of the character have other lengths; the motion is that of another skeleton")
    facing = np.array(Rotation.from_matrix(fit).as_quat()[[3, 0, 1, 2]])
    world = kinematics.pose(motion)
    out: dict[int, Array] = {}
    known = dict(shared)
    turned: dict[int, Array] = {}
    for k, node in enumerate(rest.nodes):
        above = figure.over(node)[1] if rest.parents[k] < 0 else turned[int(rest.parents[k])]
        own = known.get(k)
        if own is None:
            turned[k] = quat.multiply(above, rest.local[k])
            continue
        turned[k] = quat.multiply(world.rotations[:, own], quat.multiply(facing, rest.turns[k]))
        out[node] = quat.continuous(quat.multiply(quat.inverse(above), turned[k]))
    corner, turn, grown = figure.over(rest.nodes[root])  # nothing over the root is moved
    local = quat.rotate(quat.inverse(turn), motion.root_positions - corner) / grown
    return out, (rest.nodes[root], local)
