"""A crowd of somebody's own character: what nodes point at is there once, nodes and skins for each person."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from stridecast.formats.glb_figure import Moved, Nodes, free_name, numbers, person_node, turned
from stridecast.formats.glb_rig import SHARED, GlbRig, extensions_in
from stridecast.formats.gltf import GltfWriter
from stridecast.model.motion import Motion

OF_NODES = ("KHR_node_visibility", "EXT_mesh_gpu_instancing")
"""Extensions of nodes that point at no other node, and so can be there for each person."""

OF_ASSET = ("copyright", "minVersion")
"""What a file says of itself that stays true in another."""

APART = ("children", "mesh", "skin", "weights", "camera", "extensions")
"""Of a node, what is put together anew."""


class RigFigure:
    """A rigged GLB, placed as often as needed.

    Kept are its joints with all that hangs from them and is between and above them, and the meshes that are skinned to
    them. A skinned mesh becomes a node of the scene itself, as nothing above it moves it. What else there is in the
    file stays behind: animations, cameras, lights, other figures, and what stands beside the figure.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    FileError
        As of ``GlbRig``, or its scene does not show the joints, or nodes and skins point at what is not there.
    """

    def __init__(self, path: str | Path) -> None:
        self.rig = rig = GlbRig(path)
        reader = rig.reader
        self._nodes = reader.objects("nodes")
        shown = self._below(self._scene())
        if rig.rest.nodes[0] not in shown:
            reader.wrong("has no scene that shows its skeleton; export it with the skeleton in the scene")
        hanging = self._below([rig.rest.nodes[0]])
        skins = self._checked_skins()
        self._skins = {k: skin for k, skin in enumerate(skins) if not hanging.isdisjoint(skin["joints"])}
        joints = {joint for skin in self._skins.values() for joint in skin["joints"]} | {*rig.rest.nodes}
        wanted = hanging | {node for joint in joints for node in (joint, *rig.figure.line_over(joint))}
        self._skinned = [k for k in sorted(shown) if "mesh" in self._nodes[k] and self._skin_of(k) in self._skins]
        self._kept = [k for k in sorted(wanted) if k in joints or not self._is_spare(k, wanted)]
        self._index = {node: k for k, node in enumerate(self._kept)}
        self._own = [self._plain(node) for node in self._kept]
        self._meshes = [self._skin_node(node) for node in self._skinned]
        self._names = [str(node.get("name", "")) for node in (*self._own, *self._meshes)]

    def place(
        self, writer: GltfWriter, name: str, motion: Motion, *, extras: Mapping[str, Any] | None = None
    ) -> tuple[Nodes, Moved]:
        """Put somebody into a file that has the rig's numbers, as in the first frame; their nodes, and what moves them.

        Raises
        ------
        SkeletonError
            The motion is that of another skeleton.
        """
        moved = self.rig.moved(motion)
        w, first = writer, writer.count("nodes") + 1
        at = {node: first + k for node, k in self._index.items()}
        tops = [at[node] for node in self._kept if int(self.rig.reader.parents[node]) not in at]
        person = w.add("nodes", person_node(free_name(name, self._names), tops, moved.scale, extras))
        turns = dict(zip(moved.nodes, moved.turns[:, 0], strict=True))
        for node, plain in zip(self._kept, self._own, strict=True):
            what = dict(plain)
            if node in turns:
                what["rotation"] = numbers(turned(turns[node]))
            if node == moved.root:
                what["translation"] = numbers(moved.places[0])
            children = [at[child] for child in self._nodes[node].get("children", ()) if child in at]
            w.add("nodes", {**what, "children": children} if children else what)
        skins = {}
        for number, skin in self._skins.items():
            what = {**skin, "joints": [at[joint] for joint in skin["joints"]]}
            if "skeleton" in skin:
                what["skeleton"] = at.get(skin["skeleton"], person)
            skins[number] = w.add("skins", what)
        meshes = [
            w.add("nodes", {**what, "skin": skins[self._nodes[node]["skin"]]})
            for node, what in zip(self._skinned, self._meshes, strict=True)
        ]
        nodes = [at[node] for node in moved.nodes]
        return Nodes(person, nodes, [person, *meshes]), moved._replace(nodes=nodes, root=at[moved.root])

    def head(self) -> dict[str, Any]:
        """What a document with this figure says beside its lists: who made it, and which extensions it needs."""
        document = self.rig.document
        asset = document.get("asset")
        told = {key: asset[key] for key in OF_ASSET if key in asset} if isinstance(asset, dict) else {}
        carried = [document.get(part) for part in SHARED] + [self._own, self._meshes, [*self._skins.values()]]
        here = set(extensions_in(carried))
        gone = set(extensions_in(document)) - here  # what nothing names, such as quantised numbers, is in the meshes
        out: dict[str, Any] = {"asset": told}
        for part in ("extensionsUsed", "extensionsRequired"):
            names = document.get(part, [])
            kept = [str(name) for name in names if str(name) not in gone] if isinstance(names, list) else []
            if kept:
                out[part] = kept
        whole = document.get("extensions")
        more = {name: own for name, own in whole.items() if name in here} if isinstance(whole, dict) else {}
        return {**out, "extensions": more} if more else out

    def _scene(self) -> list[int]:
        """Nodes that the scene lists, or all that hang from none where there is no scene."""
        reader = self.rig.reader
        if not reader.objects("scenes"):
            return [k for k, parent in enumerate(reader.parents.tolist()) if parent < 0]
        roots = reader.one("scenes", reader.document.get("scene", 0), "the file").get("nodes", [])
        if not isinstance(roots, list):
            reader.wrong("nodes of its scene must be a list")
        for node in roots:
            reader.one("nodes", node, "the scene")
        return roots

    def _checked_skins(self) -> list[dict[str, Any]]:
        """Skins of the file, which point at nodes."""
        reader = self.rig.reader
        skins = reader.objects("skins")
        for k, skin in enumerate(skins):
            joints = skin.get("joints")
            if not isinstance(joints, list) or not joints:
                reader.wrong(f"skin {k} must have a list of joints")
            for node in [*joints, *([skin["skeleton"]] if "skeleton" in skin else [])]:
                reader.one("nodes", node, f"skin {k}")
        return skins

    def _skin_of(self, node: int) -> int:
        """Number of a node's skin, -1 where it has none."""
        told = self._nodes[node]
        if "skin" not in told:
            return -1
        self.rig.reader.one("skins", told["skin"], f"node {node}")
        return int(told["skin"])

    def _below(self, roots: Iterable[int]) -> set[int]:
        """Nodes and all that hangs from them."""
        line = list(roots)
        for node in line:  # grows while it is walked over
            line += self._nodes[node].get("children", [])
        return set(line)

    def _is_spare(self, node: int, wanted: set[int]) -> bool:
        """Whether nothing is left of a node when its skinned mesh, camera or light is elsewhere."""
        told = self._nodes[node]
        rigid = "mesh" in told and "skin" not in told
        if rigid or any(child in wanted for child in told.get("children", ())):
            return False
        return "skin" in told or "camera" in told or "KHR_lights_punctual" in _extensions(told)

    def _plain(self, node: int) -> dict[str, Any]:
        """A node as it is kept, without what points at other nodes; meshes stay where they are rigid."""
        told = self._nodes[node]
        out = {key: value for key, value in told.items() if key not in APART}
        if "mesh" in told and "skin" not in told:
            out |= {key: told[key] for key in ("mesh", "weights") if key in told}
        return {**out, **_extended(told)}

    def _skin_node(self, node: int) -> dict[str, Any]:
        told = self._nodes[node]
        return {**{key: told[key] for key in ("name", "mesh", "weights", "extras") if key in told}, **_extended(told)}


def _extensions(node: Mapping[str, Any]) -> Mapping[str, Any]:
    own = node.get("extensions")
    return own if isinstance(own, dict) else {}


def _extended(node: Mapping[str, Any]) -> dict[str, Any]:
    kept = {name: own for name, own in _extensions(node).items() if name in OF_NODES}
    return {"extensions": kept} if kept else {}
