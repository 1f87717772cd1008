"""A rigged GLB of somebody else that our motion moves: its document, how its joints rest, and a crowd of it.

Joints may rest at any angle in a file; ours agree with the world at rest. So a joint is turned to ``W F G`` in the
world, with our rotation ``W``, the rest orientation ``G`` of the file, and ``F``, which turns the file's body at rest
into ours. Nothing else of a file is touched, and its numbers are never looked at but for the rest pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from stridecast.body import kinematics
from stridecast.errors import FileError, SkeletonError
from stridecast.formats.glb_figure import Moved
from stridecast.formats.glb_motion import GlbFigure
from stridecast.formats.gltf import GltfWriter, to_json
from stridecast.formats.gltf_reading import GltfReader
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

ALIKE = 1e-3
"""Bones of the motion and of the file differ by less than this share of the largest, else it is another body."""

EXACT = 1e-5
"""Sizes that differ by less are one."""

SHARED = ("accessors", "bufferViews", "meshes", "materials", "textures", "images", "samplers")
"""Lists of a document that nodes and skins point into, and that point at neither."""

PACKED = ("EXT_meshopt_compression", "KHR_meshopt_compression")


class Fit(NamedTuple):
    """A skeleton in a file: its joints by those of the file, how much larger it is, and how it is turned."""

    joints: dict[int, int]
    size: float
    facing: Float[Array, "4"]


class GlbRig:
    """A rigged GLB, read whole.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    FileError
        It is no GLB, damaged, has no skeleton, needs other files, or is compressed so that it cannot be carried over.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            with self.path.open("rb") as file:
                self.reader = GltfReader(path, file)
                self.figure = GlbFigure(self.reader, still=True)
                self.rest = self.figure.at_rest()
                self.numbers = self.reader.binary()
        except OSError as error:
            raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error
        self.document = self.reader.document
        _check_whole(self.reader)
        for node in self.rest.nodes:
            self.figure.unpack(node)

    def embed(self, writer: GltfWriter) -> None:
        """Put what nodes and skins point at into a file that is empty yet, so that all indices stay as they are."""
        for part in SHARED:
            for one in self.reader.objects(part):
                writer.add(part, one)
        writer.put(np.frombuffer(self.numbers, np.uint8))

    def moved(self, motion: Motion) -> Moved:
        """How a motion turns and places the nodes of the file, and how much larger its body is.

        Raises
        ------
        SkeletonError
            The motion is that of another skeleton.
        """
        rest = self.rest
        known, size, facing = self.fitted(motion.skeleton)
        root = next(k for k, own in known.items() if own == 0)
        world = kinematics.pose(motion)
        turned: dict[int, Array] = {}
        local: dict[int, Array] = {}
        for k, node in enumerate(rest.nodes):
            above = self.figure.over(node)[1] if rest.parents[k] < 0 else turned[int(rest.parents[k])]
            if k not in known:
                turned[k] = quat.multiply(above, rest.local[k])
                continue
            turned[k] = quat.multiply(world.rotations[:, known[k]], quat.multiply(facing, rest.turns[k]))
            local[node] = quat.continuous(quat.multiply(quat.inverse(above), turned[k]))
        corner, turn, grown = self.figure.over(rest.nodes[root])  # nothing over the root is moved
        places = quat.rotate(quat.inverse(turn), motion.root_positions / size - corner) / grown
        return Moved(
            nodes=tuple(local), turns=np.stack(list(local.values())), root=rest.nodes[root], places=places, scale=size
        )

    def fitted(self, skeleton: Skeleton) -> Fit:
        """Find a skeleton in the file.

        Raises
        ------
        SkeletonError
            It is not there, or has bones of other lengths.
        """
        ours = {name: k for k, name in enumerate(skeleton.names)}
        known = {k: ours[name] for k, name in enumerate(self.rest.names) if name in ours}
        if 0 not in known.values():
            raise SkeletonError(
                f"the character has no joint {skeleton.names[0]!r}; the motion is that of another skeleton"
            )
        if len(known) < 2:
            raise SkeletonError("the character shares one joint with the motion; that is of another skeleton")
        theirs = self.rest.places[list(known)]
        mine = kinematics.rest(skeleton).positions[list(known.values())]
        theirs, mine = theirs - theirs[0], mine - mine[0]
        size = float(np.linalg.norm(mine) / np.linalg.norm(theirs))
        left, _, right = np.linalg.svd(mine.T @ theirs)
        fit = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        if np.abs(size * theirs @ fit.T - mine).max() > ALIKE * np.abs(mine).max():
            raise SkeletonError("the bones of the character have other lengths; the motion is that of another skeleton")
        facing = np.array(Rotation.from_matrix(fit).as_quat()[[3, 0, 1, 2]])
        return Fit(known, 1.0 if abs(size - 1.0) < EXACT else size, facing)


def extensions_in(content: object) -> Iterator[str]:
    """Names of the extensions that a part of a document has."""
    if isinstance(content, dict):
        own = content.get("extensions")
        if isinstance(own, dict):
            yield from own
        for value in content.values():
            yield from extensions_in(value)
    elif isinstance(content, list):
        for value in content:
            yield from extensions_in(value)


def _check_whole(reader: GltfReader) -> None:
    """Refuse what would be lost or broken in another file."""
    views: list[dict[str, Any]] = [*reader.objects("bufferViews"), *reader.objects("buffers")]
    if any(name in PACKED for one in views for name in extensions_in(one)):
        reader.wrong("is compressed by meshopt, which is not read; export it without compression")
    buffers = reader.objects("buffers")
    if len(buffers) > 1 or any("uri" in buffer for buffer in buffers):
        reader.wrong("has its numbers in another file, which is not opened; export it as one GLB")
    for image in reader.objects("images"):
        uri = image.get("uri")
        if isinstance(uri, str) and not uri.startswith("data:"):
            reader.wrong(f"has the picture {uri!r} in another file, which is not opened; export it as one GLB")
    for part in SHARED:
        reader.objects(part)
    try:
        to_json(reader.document)
    except ValueError:
        reader.wrong("has a number in its JSON that is too large")
    except RecursionError:
        reader.wrong("has JSON that is nested too deeply")
