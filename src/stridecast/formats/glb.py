"""GLB out: skeletons in motion with the mannequin's skin, one or a crowd (Khronos, "glTF 2.0").

Metres, +Y up, facing +Z, as everywhere in the package and in glTF. Joints are nodes of the skeleton's names, in its
order; what glTF has no place for is in ``extras`` under ``stridecast``: roles, ends of the last bones, foot plants, and
where a motion comes from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from stridecast.body.mannequin import mannequin
from stridecast.errors import FileError, InputError
from stridecast.formats.glb_figure import Figure, Keys, Planted, moved_as_ours, plants, provenance
from stridecast.formats.glb_rig_figure import RigFigure
from stridecast.formats.gltf import GltfWriter
from stridecast.model.mesh import SkinnedMesh
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

ALIKE = 1e-6
"""Bodies whose bones are alike to this share of their length are one body in different sizes."""


LONG = 4096.0
"""Single precision tells frames apart so far from 0, seconds; what is later, or before 0, gets an origin of its own."""


def check_compact(path: str | Path, compact: bool) -> None:
    """Refuse ``compact`` for what is no GLB.

    Raises
    ------
    FileError
        The file has another ending.
    """
    if compact and Path(path).suffix.lower() != ".glb":
        raise FileError("only *.glb is written compactly", path=path)


def body_glb(skeleton: Skeleton, *, mesh: SkinnedMesh | None = None) -> bytes:
    """A body at rest as the bytes of a GLB, standing on the floor.

    Parameters
    ----------
    skeleton
        Its joints; nodes have their names, ``skin.joints`` their order.
    mesh
        Its skin; the mannequin if left out.

    Raises
    ------
    SkeletonError
        There is no skin and the skeleton has no roles to make one.
    """
    writer = GltfWriter()
    figure = Figure(writer, skeleton, mannequin(skeleton) if mesh is None else mesh)
    return writer.to_bytes(_head(figure.place("Mannequin").roots))


def write_glb(
    path: str | Path,
    motions: Motion | Sequence[Motion],
    *,
    compact: bool = False,
    planted: Planted | Sequence[Planted | None] | None = None,
    mesh: SkinnedMesh | None = None,
) -> None:
    """Write a character that can play one motion or several takes, an animation each.

    Parameters
    ----------
    path
        The file. It is written beside its place and then renamed, so what was there stays whole until the end.
    motions
        Of one skeleton.
    compact
        Rotations as 16 bit numbers (off by 1e-4 rad at most) and one key for joints that never turn, half the size.
    planted
        Which feet stand at which frame (left, right), of each motion; they are told as ``foot_plants``.
    mesh
        Its skin; the mannequin if left out.

    Raises
    ------
    InputError
        No motion, motions of different skeletons, or ``planted`` of other lengths.
    SkeletonError
        There is no skin and the skeleton has no roles to make one.
    FileError
        The file system refuses, or the file would be larger than 4 GB.
    """
    takes = [motions] if isinstance(motions, Motion) else list(motions)
    if not takes:
        raise InputError("there is no motion to write")
    feet: list[Planted | None] = (
        [None] * len(takes) if planted is None else [planted] if isinstance(planted, np.ndarray) else list(planted)
    )
    if len(feet) != len(takes) or any(
        own is not None and len(own) != take.frames for take, own in zip(takes, feet, strict=True)
    ):
        raise InputError(f"planted must have a row for each frame of each of {len(takes)} motions")
    skeleton = takes[0].skeleton
    for take in takes[1:]:
        if take.skeleton.names != skeleton.names or not _alike(take.skeleton.offsets, skeleton.offsets):
            raise InputError(
                f"motion {take.name!r} has another skeleton than {takes[0].name!r}; write each to a file of its own, "
                "or all as a crowd"
            )
    writer = GltfWriter()
    figure = Figure(writer, skeleton, mannequin(skeleton) if mesh is None else mesh)
    nodes = figure.place("Mannequin", takes[0])
    for k, (take, own) in enumerate(zip(takes, feet, strict=True)):
        keys = Keys(writer)
        keys.move(moved_as_ours(take, nodes.joints), take.frame_rate, compact=compact)
        extras = {**provenance(take), **({} if own is None else {"foot_plants": plants(own, take.frame_rate)})}
        keys.save(take.name or f"Take {k + 1}", extras)
    writer.save(path, _head(nodes.roots))


class GlbCrowd:
    """A crowd as one file: a mesh that people of alike proportions share, and one animation on one clock.

    The animation moves everybody, as that is what Blender, three.js and Unreal play at once; somebody who is not there
    yet, or has left, has the scale 0. Time is that of ``start``, as in the files beside, unless some of it is before 0
    or so late that single precision does not tell its frames apart: then 0 is when the first person appears, and
    ``origin`` of the animation's extras says when that is.

    Numbers go to a nameless file beside the place as people are added, so memory holds a few kilobytes for each.

    Parameters
    ----------
    path
        Where it is to be.
    compact
        As of ``write_glb``.
    character
        A rigged GLB that everybody is, in any size: with its meshes, materials and skins, which are in the file once
        (see ``RigFigure``). Left out: the mannequin.

    Raises
    ------
    FileError
        The character cannot be read or carried over, or the file system refuses.
    """

    def __init__(
        self, path: str | Path, *, compact: bool = False, character: str | Path | RigFigure | None = None
    ) -> None:
        self.path = Path(path)
        self.compact = compact
        self.people = 0
        self._worn = RigFigure(character) if isinstance(character, (str, Path)) else character
        self._writer = GltfWriter(path)
        if self._worn is not None:
            try:
                self._worn.rig.embed(self._writer)
            except FileError:
                self._writer.close()
                raise
        self._keys = Keys(self._writer)
        self._figures: list[tuple[Skeleton, Figure]] = []
        self._roots: list[int] = []
        self._hidden: list[tuple[int, float, float, float]] = []
        self._first, self._last = np.inf, -np.inf
        self._rate = 0.0

    def add(self, motion: Motion, *, name: str = "", start: float = 0.0, planted: Planted | None = None) -> None:
        """Add somebody who is there from ``start`` (seconds) to the end of their motion.

        Raises
        ------
        InputError
            ``start`` is no number, or ``planted`` has another length than the motion.
        SkeletonError
            The skeleton has no roles to make a skin, or is not that of the character.
        FileError
            The disk is full, or the file would be larger than 4 GB.
        """
        if not np.isfinite(start):
            raise InputError(f"the start must be a number of seconds, not {start}")
        if planted is not None and len(planted) != motion.frames:
            raise InputError(f"planted must have a row for each of {motion.frames} frames, not {len(planted)}")
        extras: dict[str, Any] = {"start": start, **provenance(motion)}
        if planted is not None:
            extras["foot_plants"] = plants(planted, motion.frame_rate, start)
        name = name or motion.name or f"Person {self.people + 1}"
        if self._worn is not None:
            nodes, moved = self._worn.place(self._writer, name, motion, extras=extras)
        else:
            figure, scale = self._figure_of(motion.skeleton)
            nodes = figure.place(name, motion, scale=scale, extras=extras)
            moved = moved_as_ours(motion, nodes.joints, scale)
        self._keys.move(moved, motion.frame_rate, start=start, compact=self.compact)
        end = start + motion.seconds
        half = 0.5 / motion.frame_rate  # between frames, so that rounding hides nobody in their first or last one
        self._hidden.append((nodes.person, moved.scale, start - half, end + half))
        self._first, self._last = min(self._first, start), max(self._last, end)
        self._rate = max(self._rate, motion.frame_rate)
        self._roots += nodes.roots
        self.people += 1

    def save(self, path: str | Path | None = None) -> None:
        """Write who has been added, and be done.

        Raises
        ------
        FileError
            The file system refuses; what was there is untouched.
        """
        if self.people:
            far = self._first < 0 or self._last > LONG
            origin = self._first if far else 0.0
            for node, scale, start, end in self._hidden:
                self._keys.show(node, scale, start - origin, end - origin, self._last - origin)
            told = {"origin": origin, "seconds": self._last - origin, "frame_rate": self._rate}
            self._keys.save("Crowd", told, origin=origin)
        told = {} if self._worn is None else self._worn.head()
        self._writer.save(self.path if path is None else path, _head(self._roots, told))
        self.close()

    def close(self) -> None:
        """Drop what was added."""
        self._writer.close()

    def _figure_of(self, skeleton: Skeleton) -> tuple[Figure, float]:
        """The figure for a skeleton, and how much larger than its mesh it is."""
        for known, figure in self._figures:
            if known.names == skeleton.names and dict(known.roles) == dict(skeleton.roles):
                scale = _scale(known, skeleton)
                if _alike(scale * known.offsets, skeleton.offsets):
                    return figure, scale
        figure = Figure(self._writer, skeleton, mannequin(skeleton))
        self._figures.append((skeleton, figure))
        return figure, 1.0


def _head(roots: Sequence[int], told: Mapping[str, Any] | None = None) -> Mapping[str, object]:
    """What a document says beside its lists; ``told`` is more of that."""
    more = dict(told or {})
    asset = {**more.pop("asset", {}), "version": "2.0", "generator": "stridecast"}
    scene: dict[str, object] = {"nodes": list(roots)} if roots else {}
    return {**more, "asset": asset, "scene": 0, "scenes": [scene]}


def _scale(known: Skeleton, skeleton: Skeleton) -> float:
    return float(np.linalg.norm(skeleton.offsets)) / max(float(np.linalg.norm(known.offsets)), 1e-12)


def _alike(one: Float[Array, "joints 3"], other: Float[Array, "joints 3"]) -> bool:
    return one.shape == other.shape and bool(np.abs(one - other).max() <= ALIKE * max(np.abs(other).max(), 1e-12))
