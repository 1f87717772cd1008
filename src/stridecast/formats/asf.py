"""ASF, the Acclaim skeleton, that AMC recordings need.

A bone has a direction and a length in the axes of the world, and axes of its own about which its degrees of freedom
turn it. A joint here is where a bone starts and has the bone's name; the bones below the root start at the root. Angles
about X, Y and Z are applied in the order in which the letters stand after ``axis``: ``XYZ`` is ``Rz * Ry * Rx``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from jaxtyping import Float, Int

from stridecast.body.conventions import UNITS
from stridecast.body.rig import RawRecording
from stridecast.errors import FileError
from stridecast.formats.files import looks_like, read_text
from stridecast.geometry import quaternions as quat

MOST_BONES = 4096
CMU_LENGTH = 0.45
"""What ASF files of the CMU database say as unit of length."""

_TURNS = ("rx", "ry", "rz")
_SHIFTS = ("tx", "ty", "tz")


@dataclass(frozen=True, kw_only=True, eq=False)
class AsfSkeleton:
    """An ASF file in plain arrays: the root first, parents before children, lengths in the file's unit.

    Parameters
    ----------
    names, parents, offsets, end_joints, end_offsets
        As in ``Skeleton``; the offset of the root is zero.
    place
        Where the root is when its AMC says nothing.
    axes
        Axes of each bone against the world, ``w x y z``.
    orders
        ``X``, ``Y``, ``Z`` in the order in which the turns of each bone are applied.
    freedoms
        What an AMC gives for each bone, in its order: some of ``rx ry rz``, for the root also of ``tx ty tz``.
    unit
        Metres per unit, if the file says.
    degrees
        Whether angles are in degrees, else in radians.
    """

    names: tuple[str, ...]
    parents: Int[np.ndarray, "joints"]
    offsets: Float[np.ndarray, "joints 3"]
    end_joints: Int[np.ndarray, "ends"]
    end_offsets: Float[np.ndarray, "ends 3"]
    place: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "joints 4"]
    orders: tuple[str, ...]
    freedoms: tuple[tuple[str, ...], ...]
    unit: float | None
    degrees: bool

    def posed(
        self, root_positions: Float[np.ndarray, "frames 3"], rotations: Float[np.ndarray, "frames joints 4"]
    ) -> RawRecording:
        """Make a recording of this skeleton."""
        return RawRecording(
            names=self.names,
            parents=self.parents,
            offsets=self.offsets,
            end_joints=self.end_joints,
            end_offsets=self.end_offsets,
            root_positions=root_positions,
            rotations=rotations,
            unit=self.unit,
        )

    def at_rest(self) -> RawRecording:
        """One frame of the rest pose."""
        return self.posed(self.place[None], np.tile(quat.IDENTITY, (1, len(self.names), 1)))


def applied(angles: Float[np.ndarray, "*shape 3"], order: str) -> Float[np.ndarray, "*shape 4"]:
    """Turn by ``angles`` (radians) about X, Y and Z, first about the axis whose letter comes first in ``order``."""
    backwards = order[::-1]
    return quat.from_euler(angles[..., ["XYZ".index(letter) for letter in backwards]], backwards)


def read_asf(path: str | Path) -> AsfSkeleton:
    """Read an ASF skeleton.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    FileError
        The file is no ASF, is cut or contradicts itself; with the line.
    """
    data = read_text(path)
    if b":bonedata" not in data.lower():
        seems = looks_like(data)
        hint = f"; it looks like {seems}" if seems and "ASF" not in seems else "; is it cut?"
        raise FileError(f"is no ASF skeleton: it has no :bonedata{hint}", path=path)
    return _Reader(path).read(data.decode("utf-8", "replace"))


@dataclass(kw_only=True)
class _Bone:
    name: str
    line: int
    direction: np.ndarray
    length: float | None = None
    axis: np.ndarray
    order: str = "XYZ"
    freedoms: tuple[str, ...] = ()


class _Reader:
    """Reads one section after the other."""

    def __init__(self, path: str | Path) -> None:
        self.path = path
        self.line = 0
        self.root = _Bone(
            name="root", line=0, direction=np.zeros(3), length=0.0, axis=np.zeros(3), freedoms=_SHIFTS + _TURNS
        )
        self.bones = {"root": self.root}
        self.place = np.zeros(3)
        self.bone: _Bone | None = None
        self.children: dict[str, list[str]] = {}
        self.parent: dict[str, str] = {}
        self.unit: float | None = None
        self.degrees = True

    def fail(self, message: str, line: int | None = None) -> NoReturn:
        raise FileError(message, path=self.path, line=self.line if line is None else line)

    def read(self, text: str) -> AsfSkeleton:
        sections: dict[str, Callable[[str, list[str]], None]] = {
            ":units": self.read_units,
            ":root": self.read_root,
            ":bonedata": self.read_bone,
            ":hierarchy": self.read_link,
        }
        section = None
        for self.line, row in enumerate(text.rstrip().split("\n"), start=1):
            words = row.partition("#")[0].split()
            if words and words[0].startswith(":"):
                section = sections.get(words[0].lower())
            elif words and section is not None:
                section(words[0], words[1:])
        if self.bone is not None:
            self.fail("the file is cut: the last bone has no 'end'")
        if not self.children:
            self.fail("the file is cut: it has no :hierarchy")
        return self.skeleton()

    def numbers(self, words: list[str], count: int, what: str) -> np.ndarray:
        try:
            values = np.array([float(word) for word in words[:count]])
        except ValueError:
            values = np.zeros(0)
        if len(values) != count or not np.isfinite(values).all():
            self.fail(f"{what} needs {count} finite number(s), not {' '.join(words)[:60]!r}")
        return values

    def order(self, words: list[str]) -> str:
        order = "".join(words).upper() or "XYZ"
        if sorted(order) != ["X", "Y", "Z"]:
            self.fail(f"an order of axes is made of X, Y and Z, not {order[:20]!r}")
        return order

    def freedoms(self, words: list[str], known: tuple[str, ...], whose: str) -> tuple[str, ...]:
        found = tuple(word.lower() for word in words)
        for word in found:
            if word not in known or found.count(word) > 1:
                self.fail(
                    f"{whose} cannot have the degree of freedom {word[:20]!r} here; it may have {' '.join(known)}"
                )
        return found

    def read_units(self, keyword: str, words: list[str]) -> None:
        if keyword.lower() == "length":
            if self.numbers(words, 1, "length")[0] == CMU_LENGTH:
                self.unit = UNITS["CMU units"]
        elif keyword.lower() == "angle":
            unit = " ".join(words).lower()
            if not unit.startswith(("deg", "rad")):
                self.fail(f"angles are in deg or rad, not {unit[:20]!r}")
            self.degrees = unit.startswith("deg")

    def read_root(self, keyword: str, words: list[str]) -> None:
        match keyword.lower():
            case "order":
                self.root.freedoms = self.freedoms(words, _SHIFTS + _TURNS, "the root")
            case "axis":
                self.root.order = self.order(words)
            case "position":
                self.place = self.numbers(words, 3, "position")
            case "orientation":
                self.root.axis = self.numbers(words, 3, "orientation")

    def read_bone(self, keyword: str, words: list[str]) -> None:
        keyword, bone = keyword.lower(), self.bone
        if keyword == "begin":
            if bone is not None:
                self.fail("a bone begins inside of another: an 'end' is missing")
            self.bone = _Bone(name="", line=self.line, direction=np.zeros(3), axis=np.zeros(3))
            return
        if bone is None:
            self.fail(f"{keyword[:40]!r} stands outside of begin and end")
        match keyword:
            case "end":
                self.add(bone)
                self.bone = None
            case "name":
                bone.name = " ".join(words)
            case "direction":
                direction = self.numbers(words, 3, "direction")
                bone.direction = direction / max(float(np.linalg.norm(direction)), 1e-12)
            case "length":
                bone.length = float(self.numbers(words, 1, "length")[0])
            case "axis":
                bone.axis, bone.order = self.numbers(words, 3, "axis"), self.order(words[3:])
            case "dof":
                bone.freedoms = self.freedoms(words, _TURNS, f"bone {bone.name!r}")

    def add(self, bone: _Bone) -> None:
        if not bone.name:
            self.fail("this bone has no name", bone.line)
        if bone.name in self.bones:
            self.fail(f"there is a second bone {bone.name!r}", bone.line)
        if bone.length is None or (bone.length > 0 and not bone.direction.any()):
            self.fail(f"bone {bone.name!r} needs a direction and a length", bone.line)
        if len(self.bones) > MOST_BONES:
            self.fail(f"more than {MOST_BONES} bones")
        self.bones[bone.name] = bone

    def read_link(self, parent: str, children: list[str]) -> None:
        if parent.lower() in ("begin", "end") and not children:
            return
        for name in (parent, *children):
            if name not in self.bones:
                self.fail(f"{name[:40]!r} is no bone; there are {', '.join(self.bones)}")
        for child in children:
            if child in self.parent or child == "root":
                self.fail(f"bone {child!r} has two parents")
            self.parent[child] = parent
            self.children.setdefault(parent, []).append(child)

    def skeleton(self) -> AsfSkeleton:
        names: list[str] = []
        waiting = ["root"]
        while waiting:
            names.append(waiting.pop())
            waiting.extend(reversed(self.children.get(names[-1], [])))
        lost = [name for name in self.bones if name not in names]
        if lost:
            self.fail(f"the hierarchy does not lead from the root to {', '.join(lost)}", self.bones[lost[0]].line)
        bones = [self.bones[name] for name in names]
        reach = {bone.name: bone.direction * (bone.length or 0.0) for bone in bones}
        index = {name: joint for joint, name in enumerate(names)}
        leaves = [joint for joint, name in enumerate(names) if name not in self.children]
        angle = np.pi / 180 if self.degrees else 1.0
        return AsfSkeleton(
            names=tuple(names),
            parents=np.array([index[self.parent[name]] if name in self.parent else -1 for name in names]),
            offsets=np.array([np.zeros(3), *(reach[self.parent[name]] for name in names[1:])]),
            end_joints=np.array(leaves, np.int64),
            end_offsets=np.array([reach[names[joint]] for joint in leaves]),
            place=self.place,
            axes=np.array([applied(bone.axis * angle, bone.order) for bone in bones]),
            orders=tuple(bone.order for bone in bones),
            freedoms=tuple(bone.freedoms for bone in bones),
            unit=self.unit,
            degrees=self.degrees,
        )
