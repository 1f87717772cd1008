"""Recordings from GLB: the first animation of a skinned figure, or of what moves where nothing has a skin.

Joints may rest at any angle in a file. Here all frames agree at rest, so rotations are told against the bind pose (that
of the nodes where there is no skin): ``G_parent r G^-1`` for a local rotation ``r`` and rest orientations ``G``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from stridecast.body.rig import RawRecording
from stridecast.errors import FileError
from stridecast.formats.gltf_reading import GltfReader
from stridecast.formats.vrm import vrm_roles
from stridecast.geometry import quaternions as quat

Array = np.ndarray

MOST_JOINTS = 1024
MOST_FRAMES, MOST_POSES = 1 << 18, 1 << 24
"""Of what is read at most; poses are frames times joints."""

MOST_WALKED = 1 << 22
"""Joints of all skins, and nodes over them, that are looked at at most."""

RATES = (1.0, 1000.0)
"""Frames a second that are believed."""

BOUND = 0.02
"""Nodes that are turned against the bind pose by this, all by the same, stand in it, radians."""

SLIDES = 1e-5
"""A joint that moves against its parent by less stays in its place, metres."""


def read_glb(path: str | Path) -> RawRecording:
    """Read an animation of a GLB.

    Parameters
    ----------
    path
        The file. Keys may be LINEAR, STEP or CUBICSPLINE, at any times; they are sampled evenly, at the rate that a
        file of our own tells, else that of its keys.

    Raises
    ------
    FileError
        It is no GLB, damaged, has no animation of a skeleton, or one that is not read (sparse or compressed numbers,
        numbers in other files).
    """
    try:
        with Path(path).open("rb") as file:
            return GlbFigure(GltfReader(path, file)).recording()
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error


def read_glb_at_rest(path: str | Path) -> RawRecording:
    """Read the skeleton of a GLB, one frame at rest: of its skins, else of what its first animation turns.

    Where there are several figures it is that with most joints.

    Raises
    ------
    FileError
        As of ``read_glb``, or there is neither a skin nor an animation.
    """
    try:
        with Path(path).open("rb") as file:
            return GlbFigure(GltfReader(path, file), still=True).recording()
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error


class _Track(NamedTuple):
    times: Float[Array, "keys"]
    values: Float[Array, "keys components"]
    mode: str


class _Figure(NamedTuple):
    """Skins that move one body: their numbers, all their joints in order, and these with all nodes over them."""

    skins: tuple[int, ...]
    joints: dict[int, None]
    over: set[int]


class Rest(NamedTuple):
    """Joints of a figure at rest, parents first.

    Parameters
    ----------
    nodes, names, parents
        Their nodes, their names, and their parents among them, -1 for the root.
    turns, places
        How they are turned in the world when the body is at rest, and where they are then, from the root.
    local
        How their nodes are turned.
    """

    nodes: tuple[int, ...]
    names: tuple[str, ...]
    parents: Int[Array, "joints"]
    turns: Float[Array, "joints 4"]
    places: Float[Array, "joints 3"]
    local: Float[Array, "joints 4"]


class GlbFigure:
    """What of a file is read: which nodes are joints, how they rest, and the animation that moves them."""

    def __init__(self, reader: GltfReader, *, still: bool = False) -> None:
        self.reader = reader
        self.nodes = reader.objects("nodes")
        self.notes: list[str] = []
        self._walked = 0
        self.tracks: dict[tuple[int, str], _Track] = {}
        self.told: Mapping[str, Any] = {}
        if not (still and reader.objects("skins")):
            self.tracks, self.told = self._tracks()
            if not any(path == "rotation" for _, path in self.tracks):
                reader.wrong("has no animation that turns the joints of a skeleton")
        self.joints, self.binds = self._joints()
        self.root = self.joints[0]
        self.times, self.rate = np.zeros(1), 30.0
        if not still:
            self.times, self.rate = self._clock()

    def recording(self) -> RawRecording:
        """The figure in the form of all recordings."""
        r = self.reader
        index = {node: k for k, node in enumerate(self.joints)}
        frames = len(self.times)
        above = self._above()
        scale = float(np.prod([self._scale(node) for node in above])) if above else 1.0
        turns, places = np.tile(quat.IDENTITY, (frames, 1)), np.zeros((frames, 3))
        grown, upright = 1.0, np.array(quat.IDENTITY)
        for node in [*above, self.root]:
            upright = quat.multiply(upright, self._rest(node))
            places = places + grown * quat.rotate(turns, self._moved(node, "translation"))
            turns = quat.multiply(turns, self._moved(node, "rotation"))
            grown *= self._scale(node)
        rest, sizes = [self.binds.get(self.root, upright)], [scale * self._scale(self.root)]
        offsets, slides = [np.zeros(3)], {}
        rotations = np.empty((frames, len(self.joints), 4))
        rotations[:, 0] = quat.multiply(turns, quat.inverse(rest[0]))
        parents = [-1]
        for k, node in enumerate(self.joints[1:], start=1):
            parent = index[int(r.parents[node])]
            parents.append(parent)
            rest.append(self.binds.get(node, quat.multiply(rest[parent], self._rest(node))))
            own = quat.multiply(quat.multiply(rest[parent], self._moved(node, "rotation")), quat.inverse(rest[k]))
            rotations[:, k] = own
            place = sizes[parent] * quat.rotate(rest[parent], self._moved(node, "translation"))
            offsets.append(place[0])
            if np.abs(place - place[0]).max() > SLIDES:
                slides[k] = place
            sizes.append(sizes[parent] * self._scale(node))
        ends, names = self._ends(index), self._names()
        return RawRecording(
            names=names,
            parents=np.array(parents),
            offsets=np.array(offsets),
            end_joints=np.array([joint for joint, _ in ends], np.int64),
            end_offsets=np.array([sizes[j] * quat.rotate(rest[j], arm) for j, arm in ends]).reshape(-1, 3),
            root_positions=places,
            rotations=quat.continuous(rotations),
            slides=slides,
            frame_rate=self.rate,
            unit=1.0,
            notes=tuple(self.notes),
            roles={role: names[index[node]] for role, node in vrm_roles(r).items() if node in index},
        )

    def at_rest(self) -> Rest:
        """Its joints at rest."""
        told = self.recording()
        upright = quat.multiply(self.over(self.root)[1], self._rest(self.root))
        turns = [self.binds.get(self.root, upright)]
        places = np.zeros((len(self.joints), 3))
        for k, node in enumerate(self.joints[1:], start=1):
            parent = int(told.parents[k])
            turns.append(self.binds.get(node, quat.multiply(turns[parent], self._rest(node))))
            places[k] = places[parent] + told.offsets[k]
        local = np.array([self._rest(node) for node in self.joints])
        return Rest(tuple(self.joints), told.names, told.parents, np.array(turns), places, local)

    def over(self, node: int) -> tuple[Float[Array, "3"], Float[Array, "4"], float]:
        """The frame in which a node is placed, in the world with all nodes as they are: its place, turn and scale."""
        place, turn, size = np.zeros(3), np.array(quat.IDENTITY), 1.0
        for above in self.line_over(node)[::-1]:
            place = place + size * quat.rotate(turn, self._place(above))
            turn = quat.multiply(turn, self._rest(above))
            size *= self._scale(above)
        return place, turn, size

    def line_over(self, node: int) -> list[int]:
        """Nodes over another, the nearest first."""
        line: list[int] = []
        parent = int(self.reader.parents[node])
        while parent >= 0:
            line.append(parent)
            if len(line) > MOST_JOINTS:
                self.reader.wrong(f"has nodes that are nested more than {MOST_JOINTS} deep")
            parent = int(self.reader.parents[parent])
        return line

    def unpack(self, node: int) -> None:
        """Give a node that has a matrix its place, turn and scale instead, so that an animation can move it."""
        if "matrix" in self.nodes[node]:
            place, turn, size = self._of_matrix(node)
            del self.nodes[node]["matrix"]
            apart = {"translation": place.tolist(), "rotation": turn[[1, 2, 3, 0]].tolist(), "scale": [size] * 3}
            self.nodes[node].update(apart)

    def _tracks(self) -> tuple[dict[tuple[int, str], _Track], Mapping[str, Any]]:
        """Keys by node and what they move, of the first animation."""
        r = self.reader
        animations = r.objects("animations")
        if not animations:
            r.wrong("has no animation")
        if len(animations) > 1:
            self.notes.append(f"of {len(animations)} animations the first is read")
        first = animations[0]
        samplers = r.objects("samplers", first, "animation 0: ")
        out: dict[tuple[int, str], _Track] = {}
        times: dict[object, Array] = {}
        for k, channel in enumerate(r.objects("channels", first, "animation 0: ")):
            where = f"channel {k}"
            target = channel.get("target")
            if not isinstance(target, dict):
                r.wrong(f"{where} has no target")
            path = target.get("path")
            if "node" not in target or path not in ("translation", "rotation"):
                continue  # scales hide people, weights move faces
            r.one("nodes", target["node"], where)
            sampler = channel.get("sampler")
            if isinstance(sampler, bool) or not isinstance(sampler, int) or not 0 <= sampler < len(samplers):
                r.wrong(f"{where} points at sampler {sampler!r}, and there are {len(samplers)}")
            out[target["node"], path] = self._track(samplers[sampler], path, where, times)
        told = first.get("extras")
        own = told.get("stridecast") if isinstance(told, dict) else None
        return out, own if isinstance(own, dict) else {}

    def _track(self, sampler: Mapping[str, Any], path: str, where: str, known: dict[object, Array]) -> _Track:
        r = self.reader
        mode = sampler.get("interpolation", "LINEAR")
        if mode not in ("LINEAR", "STEP", "CUBICSPLINE"):
            r.wrong(f"{where} has the interpolation {mode!r}; there are LINEAR, STEP and CUBICSPLINE")
        source = sampler.get("input")
        if not isinstance(source, int) or source not in known:
            keys = r.accessor(source, f"times of {where}", ["SCALAR"])[:, 0]
            if (np.diff(keys) <= 0).any() or keys[0] < 0:
                r.wrong(f"times of {where} must increase from 0 on")
            known[source] = keys
        times = known[source]
        values = r.accessor(sampler.get("output"), where, ["VEC4" if path == "rotation" else "VEC3"])
        wanted = len(times) * (3 if mode == "CUBICSPLINE" else 1)
        if len(values) != wanted:
            r.wrong(f"{where} has {len(values)} values for {len(times)} keys; {wanted} would be right")
        return _Track(times, values, mode)

    def _joints(self) -> tuple[list[int], dict[int, Float[Array, "4"]]]:
        """Nodes that are joints, parents first, and how those of skins are turned in their bind pose."""
        moving = {node for node, _ in self.tracks}
        figures = self._figures()
        shown = [figure for figure in figures if not (moving and moving.isdisjoint(figure.joints))]
        if not shown:
            return self._tree(sorted(node for node, path in self.tracks if path == "rotation")), {}
        figure = max(shown, key=lambda one: len(one.joints))  # the first of equals
        if len(figures) > 1:
            self.notes.append(f"of {len(figures)} skinned figures number {figures.index(figure) + 1} is read")
        binds: dict[int, Array] = {}
        for number in figure.skins:
            own = self._bound(self.reader.objects("skins")[number], number)
            binds = (self._in_place(own, binds) if own else {}) | binds
        return self._tree(list(figure.joints)), binds

    def _figures(self) -> list[_Figure]:
        """Skins that share joints, or hang from one another's: a body often has one for each of its meshes."""
        r = self.reader
        figures: dict[int, _Figure] = {}
        owner: dict[int, int] = {}
        hanging: dict[int, set[int]] = {}
        for k, skin in enumerate(r.objects("skins")):
            found = skin.get("joints", [])
            if not isinstance(found, list) or not found:
                r.wrong(f"skin {k} must have a list of joints")
            for joint in found:
                r.one("nodes", joint, f"skin {k}")
            over = self._all_over(found)
            same = {owner[node] for node in over if node in owner}.union(*(hanging.get(joint, ()) for joint in found))
            parts = [figures.pop(number) for number in sorted(same)]
            parts = sorted([*parts, _Figure((k,), dict.fromkeys(found), over)], key=lambda one: -len(one.joints))
            first = min(number for one in parts for number in one.skins)
            figures[first] = _Figure(
                tuple(number for one in parts for number in one.skins),
                dict.fromkeys(joint for one in parts for joint in one.joints),
                self._counted({node for one in parts for node in one.over}),
            )
            owner |= dict.fromkeys(figures[first].joints, first)
            for node in figures[first].over:
                hanging[node] = (hanging.get(node, set()) - same) | {first}
        return [figures[number] for number in sorted(figures)]

    def _all_over(self, joints: list[int]) -> set[int]:
        """Joints with all nodes over them."""
        known = set(joints)
        for joint in joints:
            node = int(self.reader.parents[joint])
            while node >= 0 and node not in known:
                known.add(node)
                node = int(self.reader.parents[node])
        return self._counted(known)

    def _counted(self, nodes: set[int]) -> set[int]:
        """The nodes, unless too many were looked at by now."""
        self._walked += len(nodes)
        if self._walked > MOST_WALKED:
            self.reader.wrong(f"has skins with more than {MOST_WALKED} joints and nodes over them")
        return nodes

    def _in_place(self, own: dict[int, Array], known: Mapping[int, Array]) -> dict[int, Array]:
        """Joints of a skin in its bind pose, turned as a whole to where the file shows them.

        A skin has a space of its own. Where nodes stand in the bind pose they tell how it is turned; else joints do
        that another skin has too, and where there are none it is believed to be that of the world.
        """
        joints = list(own)
        shown = np.array([quat.multiply(self.over(node)[1], self._rest(node)) for node in joints])
        turns = quat.multiply(shown, quat.inverse(np.array([own[node] for node in joints])))
        turn = quat.mean(turns)
        away = np.linalg.norm(quat.log(quat.multiply(quat.inverse(turn), turns)), axis=-1)
        if away.max() > BOUND:
            shared = next((node for node in joints if node in known), None)
            turn = quat.IDENTITY
            if shared is not None:
                turn = quat.multiply(known[shared], quat.inverse(own[shared]))
        return {node: quat.multiply(turn, rotation) for node, rotation in own.items()}

    def _tree(self, listed: list[int]) -> list[int]:
        """The joints that hang from the one with most of them, with the nodes that are between."""
        wanted = set(listed)
        if len(wanted) > MOST_JOINTS:
            self.reader.wrong(f"has a skeleton of {len(wanted)} joints; at most {MOST_JOINTS} are read")
        count: dict[int, int] = {}
        inside: set[int] = set()
        lines: dict[int, list[int]] = {}
        for joint in listed:
            line = [joint, *self.line_over(joint)]
            top = max(k for k, node in enumerate(line) if node in wanted)
            lines[joint] = line[: top + 1]
            count[line[top]] = count.get(line[top], 0) + 1
        self._check_rigify(lines)
        root = max(count, key=lambda node: count[node])
        kept = [joint for joint in listed if lines[joint][-1] == root]
        if len(kept) < len(listed):
            self.notes.append(f"left out, as they hang elsewhere: {len(listed) - len(kept)} joints")
        ordered: list[int] = []
        for joint in kept:
            for node in lines[joint][::-1]:
                if node not in inside:
                    inside.add(node)
                    ordered.append(node)
        if len(ordered) > MOST_JOINTS:
            self.reader.wrong(f"has a skeleton of {len(ordered)} joints; at most {MOST_JOINTS} are read")
        return ordered

    def _check_rigify(self, lines: Mapping[int, list[int]]) -> None:
        """Refuse a control rig of Rigify: what deforms the body hangs in pieces there, held together by Blender."""
        hang = {str(self.nodes[joint].get("name")): line[-1] for joint, line in lines.items()}
        spine, thigh = (hang.get(f"DEF-{name}") for name in ("spine", "thigh.L"))
        if spine is not None and thigh is not None and spine != thigh:
            self.reader.wrong(
                "is a control rig of Rigify: its bones DEF-spine and DEF-thigh.L do not hang together, so only Blender "
                "can move it; export it with integrations/blender/rigify_to_glb.py"
            )

    def _bound(self, skin: Mapping[str, Any], number: int) -> dict[int, Float[Array, "4"]]:
        """How the joints of a skin are turned in its bind pose."""
        r = self.reader
        if "inverseBindMatrices" not in skin:
            return {}
        joints = skin["joints"]
        rows = r.accessor(skin["inverseBindMatrices"], f"bind matrices of skin {number}", ["MAT4"])
        if len(rows) < len(joints):
            r.wrong(f"skin {number} has {len(joints)} joints and {len(rows)} bind matrices")
        matrices = rows[: len(joints)].reshape(-1, 4, 4)[:, :3, :3]  # columns first: transposed, which inverts turns
        left, sizes, right = np.linalg.svd(matrices)
        if (sizes[:, 2] <= 1e-9 * sizes[:, 0]).any() or (np.linalg.det(left @ right) < 0).any():
            r.wrong(f"skin {number} has a bind matrix that mirrors or flattens")
        return dict(zip(joints, _turn_of(left @ right), strict=True))

    def _clock(self) -> tuple[Float[Array, "frames"], float]:
        """Times of frames and their rate, from what moves the figure."""
        r = self.reader
        inside = {*self.joints, *self._above()}
        every = [track.times for (node, _), track in self.tracks.items() if node in inside]
        first, last = min(float(t[0]) for t in every), max(float(t[-1]) for t in every)
        finest = max(every, key=len)
        gaps = np.diff(finest)
        rate = self.told.get("frame_rate")
        if isinstance(rate, bool) or not isinstance(rate, (int, float)) or not RATES[0] <= rate <= RATES[1]:
            rate = 1.0 / float(np.median(gaps)) if len(gaps) else 30.0
            rate = round(rate) if abs(rate - round(rate)) < 0.01 * rate else rate
            rate = float(np.clip(rate, *RATES))
        frames = round((last - first) * rate) + 1
        most = min(MOST_FRAMES, MOST_POSES // len(self.joints))
        if frames > most:
            r.wrong(f"has an animation of {last - first:g} s at {rate:g} frames a second; at most {most} are read")
        return first + np.arange(frames) / rate, float(rate)

    def _above(self) -> list[int]:
        """Nodes over the root of the figure, the topmost first."""
        return self.line_over(self.root)[::-1]

    def _moved(self, node: int, path: str) -> Float[Array, "frames components"]:
        """A node's translation, or rotation as ``w x y z``, at each frame."""
        track = self.tracks.get((node, path))
        if track is None:
            still = self._rest(node) if path == "rotation" else self._place(node)
            return np.tile(still, (len(self.times), 1))
        if path == "translation":
            return _sampled(track, self.times, turns=False)
        values = track.values[:, [3, 0, 1, 2]]
        if track.mode != "CUBICSPLINE":
            self._check_turns(values, node)
        out = _sampled(track._replace(values=values), self.times, turns=True)
        self._check_turns(out, node)
        return quat.normalize(out)

    def _check_turns(self, turns: Float[Array, "_ 4"], node: int) -> None:
        if np.linalg.norm(turns, axis=-1).min() < 0.1:
            self.reader.wrong(f"node {node} has a rotation without a direction")

    def _rest(self, node: int) -> Float[Array, "4"]:
        told = self.nodes[node]
        if "matrix" in told:
            return self._of_matrix(node)[1]
        x, y, z, w = self.reader.numbers(told, "rotation", (0, 0, 0, 1), f"node {node}")
        turn = np.array([w, x, y, z])
        self._check_turns(turn[None], node)
        return quat.normalize(turn)

    def _place(self, node: int) -> Float[Array, "3"]:
        told = self.nodes[node]
        if "matrix" in told:
            return self._of_matrix(node)[0]
        return self.reader.numbers(told, "translation", (0, 0, 0), f"node {node}")

    def _scale(self, node: int) -> float:
        """Of a node at rest; bones of a body do not stretch one way only."""
        told = self.nodes[node]
        if "matrix" in told:
            return self._of_matrix(node)[2]
        size = self.reader.numbers(told, "scale", (1, 1, 1), f"node {node}")
        if not (size > 0).all() or size.max() > 1.01 * size.min():
            self.reader.wrong(f"node {node} has the scale {size.tolist()}; one number for all axes would be right")
        return float(size.mean())

    def _of_matrix(self, node: int) -> tuple[Float[Array, "3"], Float[Array, "4"], float]:
        told = self.nodes[node]
        matrix = self.reader.numbers(told, "matrix", np.eye(4).ravel().tolist(), f"node {node}").reshape(4, 4).T
        left, sizes, right = np.linalg.svd(matrix[:3, :3])
        if sizes[2] <= 0.99 * sizes[0] or np.linalg.det(left @ right) < 0:
            self.reader.wrong(f"node {node} has a matrix that mirrors, flattens or stretches one way")
        return matrix[:3, 3], _turn_of(left @ right), float(sizes.mean())

    def _ends(self, index: Mapping[int, int]) -> list[tuple[int, Float[Array, "3"]]]:
        """Ends of the last bones: as a file of our own tells, and leaves below joints that are none themselves."""
        out = []
        for node, joint in index.items():
            told = self.nodes[node].get("extras")
            own = told.get("stridecast") if isinstance(told, dict) else None
            ends = own.get("ends", []) if isinstance(own, dict) else []
            if not isinstance(ends, list) or len(ends) > MOST_JOINTS:
                self.reader.wrong(f"ends of node {node} must be a list of places")
            out += [(joint, self.reader.numbers({"end": e}, "end", (0, 0, 0), f"node {node}")) for e in ends]
            for child in self.nodes[node].get("children", ()):
                leaf = self.nodes[child]
                if child not in index and not leaf.get("children") and "mesh" not in leaf and "camera" not in leaf:
                    out.append((joint, self._place(child)))
        return [(joint, arm) for joint, arm in out if np.linalg.norm(arm) > 0]

    def _names(self) -> tuple[str, ...]:
        """Names of the joints, each once."""
        out: dict[str, None] = {}
        for node in self.joints:
            told = self.nodes[node].get("name")
            name = told if isinstance(told, str) and told.strip() else f"node{node}"
            word, k = name, 2
            while word in out:
                word, k = f"{name}.{k}", k + 1
            out[word] = None
        return tuple(out)


def _turn_of(matrices: Float[Array, "*shape 3 3"]) -> Float[Array, "*shape 4"]:
    """Rotations ``w x y z`` of matrices."""
    return np.asarray(Rotation.from_matrix(matrices).as_quat()[..., [3, 0, 1, 2]])


def _sampled(track: _Track, times: Float[Array, "frames"], *, turns: bool) -> Float[Array, "frames components"]:
    """Values of a track at times, as glTF interpolates them (appendix C); before and after the keys they stay."""
    keys, mode = track.times, track.mode
    values = track.values.reshape(len(keys), 3, -1) if mode == "CUBICSPLINE" else track.values[:, None]
    middle = values[:, 1 if mode == "CUBICSPLINE" else 0]
    if len(keys) == 1:
        return np.tile(middle[0], (len(times), 1))
    at = np.clip(np.searchsorted(keys, times + 1e-6, side="right") - 1, 0, len(keys) - 1)
    after = np.minimum(at + 1, len(keys) - 1)
    if mode == "STEP":
        return np.asarray(middle[at])
    gap = np.maximum(keys[after] - keys[at], 1e-9)
    u = np.clip((times - keys[at]) / gap, 0.0, 1.0)[:, None]
    if mode == "CUBICSPLINE":
        a, b = middle[at], middle[after]
        leaving, coming = gap[:, None] * values[at, 2], gap[:, None] * values[after, 0]
        cubic = (2 * u**3 - 3 * u**2 + 1) * a + (u**3 - 2 * u**2 + u) * leaving
        cubic = cubic + (3 * u**2 - 2 * u**3) * b + (u**3 - u**2) * coming
        return np.where(after[:, None] == at[:, None], a, cubic)
    if turns:
        one, other = quat.normalize(middle[at]), quat.normalize(middle[after])
        return quat.slerp(one, other, u[:, 0])
    return (1 - u) * middle[at] + u * middle[after]
