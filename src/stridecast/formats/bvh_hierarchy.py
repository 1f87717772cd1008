"""The upper half of a BVH file: joints in nested braces, read into a flat list and written from one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from stridecast.body.rig import RawRecording
from stridecast.errors import FileError

MOST_JOINTS = 4096
DEEPEST = 256
MOST_CHANNELS = 6

_CHANNEL = re.compile(r"[xyz](position|rotation)")
_END = -1
"""Stands for an End Site where joints are counted."""


@dataclass(kw_only=True)
class BvhJoint:
    """A joint as a BVH describes it; channels in lower case, as ``xposition`` or ``zrotation``."""

    name: str
    parent: int
    line: int
    offset: tuple[float, ...] = ()
    channels: tuple[str, ...] = ()
    ends: list[tuple[float, ...]] = field(default_factory=list)


def read_hierarchy(text: str, path: str | Path) -> list[BvhJoint]:
    """Read everything above the word MOTION.

    Returns
    -------
    The root and its joints, parents before children, in the order of the file.

    Raises
    ------
    FileError
        A word that does not belong there, braces that do not match, or more of something than any body has.
    """
    return _Reader(path).read(text)


class _Reader:
    def __init__(self, path: str | Path) -> None:
        self.path = path
        self.line = 1
        self.joints: list[BvhJoint] = []
        self.lines: dict[str, int] = {}
        self.open: list[int] = []

    def fail(self, message: str) -> NoReturn:
        raise FileError(message, path=self.path, line=self.line)

    def read(self, text: str) -> list[BvhJoint]:
        named: int | None = None  # whose brace must open next
        for words in self.statements(text):
            keyword = words[0].lower()
            if named is not None:
                if keyword != "{":
                    self.fail(f"a brace should open here, not {' '.join(words)[:40]!r}")
                self.open.append(named)
                named = None
            elif keyword in ("root", "joint"):
                named = self.joint(keyword, " ".join(words[1:]))
            elif keyword == "end":
                named = self.end()
            elif keyword == "offset":
                self.offset(words[1:])
            elif keyword == "channels":
                self.channels(words[1:])
            elif keyword == "}":
                self.close()
            elif keyword != "hierarchy":
                self.fail(
                    f"ROOT, JOINT, End Site, OFFSET, CHANNELS or a brace should stand here, not {words[0][:40]!r}"
                )
        if named is not None or self.open:
            self.fail(f"the file is cut: {len(self.open) + (named is not None)} joints are not closed")
        if not self.joints:
            self.fail("the hierarchy has no ROOT")
        return self.joints

    def statements(self, text: str) -> Iterator[list[str]]:
        """Words of each line, a brace always on its own."""
        for self.line, row in enumerate(text.rstrip().split("\n"), start=1):
            for piece in re.findall(r"[{}]|[^{}]+", row):
                words = piece.split()
                if words:
                    yield words

    def inside(self, what: str) -> int:
        """Name the innermost open joint."""
        if not self.open:
            self.fail(f"{what} stands outside of any joint")
        return self.open[-1]

    def joint(self, keyword: str, name: str) -> int:
        if not name:
            self.fail(f"{keyword.upper()} needs a name")
        if keyword == "joint" and self.inside("JOINT") == _END:
            self.fail(f"joint {name!r} stands inside of an End Site")
        if keyword == "root" and self.joints:
            self.fail(f"a second ROOT, {name!r}; a recording has one person, so split the file")
        if name in self.lines:
            self.fail(f"a second joint {name!r}; the first is in line {self.lines[name]}")
        if len(self.joints) == MOST_JOINTS:
            self.fail(f"more than {MOST_JOINTS} joints")
        if len(self.open) == DEEPEST:
            self.fail(f"joints are nested deeper than {DEEPEST}")
        self.lines[name] = self.line
        self.joints.append(BvhJoint(name=name, parent=self.open[-1] if self.open else -1, line=self.line))
        return len(self.joints) - 1

    def end(self) -> int:
        if self.inside("End Site") == _END:
            self.fail("an End Site stands inside of an End Site")
        return _END

    def offset(self, words: Sequence[str]) -> None:
        joint = self.inside("OFFSET")
        try:
            place = tuple(float(word) for word in words)
        except ValueError:
            place = ()
        if len(place) != 3 or not np.isfinite(place).all():
            self.fail(f"OFFSET needs three finite numbers, not {' '.join(words)[:60]!r}")
        if joint == _END:
            self.joints[self.open[-2]].ends.append(place)
        else:
            self.joints[joint].offset = place

    def channels(self, words: Sequence[str]) -> None:
        joint = self.inside("CHANNELS")
        if joint == _END:
            self.fail("an End Site has no CHANNELS")
        names = tuple(word.lower() for word in words[1:])
        if len(names) > MOST_CHANNELS or list(words[:1]) != [str(len(names))]:
            said = " ".join(words)[:80]
            self.fail(f"CHANNELS needs a count, at most {MOST_CHANNELS}, and as many channels, not {said!r}")
        for name, word in zip(names, words[1:], strict=True):
            if not _CHANNEL.fullmatch(name):
                self.fail(
                    f"there is no channel {word[:40]!r}; there are Xposition to Zposition, Xrotation to Zrotation"
                )
            if names.count(name) > 1:
                self.fail(f"joint {self.joints[joint].name!r} has the channel {word} twice")
        self.joints[joint].channels = names

    def close(self) -> None:
        joint = self.inside("a closing brace")
        if joint != _END and not self.joints[joint].offset:
            self.fail(f"joint {self.joints[joint].name!r} has no OFFSET")
        self.open.pop()


def depth_first(parents: Sequence[int]) -> list[int]:
    """Joints in the order in which nested braces name them; parents before children."""
    children: list[list[int]] = [[] for _ in parents]
    for joint in range(len(parents) - 1, 0, -1):
        children[parents[joint]].append(joint)
    order, waiting = [], [0]
    while waiting:
        order.append(waiting.pop())
        waiting.extend(children[order[-1]])
    return order


def hierarchy_text(recording: RawRecording, order: str) -> str:
    """Write joints ``depth_first``, offsets as they are, rotation channels in this order.

    The root and joints that slide have position channels. A joint without children or end has an End Site of no length,
    as many programs want one.
    """
    turns = " ".join(f"{axis}rotation" for axis in order)
    ends: dict[int, list[np.ndarray]] = {}
    for joint, end in zip(recording.end_joints, recording.end_offsets, strict=True):
        ends.setdefault(int(joint), []).append(end)
    parents = recording.parents.tolist()
    depths = [0] * len(parents)
    rows, depth = ["HIERARCHY"], 0
    for joint in depth_first(parents):
        if joint > 0:
            depths[joint] = depths[parents[joint]] + 1
        rows += _closing(depth, depths[joint])
        depth = depths[joint]
        tabs = "\t" * depth
        name = re.sub(r"[\s{}]+", "_", recording.names[joint])
        rows += [f"{tabs}{'JOINT' if depth else 'ROOT'} {name}", f"{tabs}{{"]
        depth += 1
        rows.append(f"{tabs}\t{_offset(recording.offsets[joint])}")
        moves = joint == 0 or joint in recording.slides
        rows.append(f"{tabs}\tCHANNELS {'6 Xposition Yposition Zposition' if moves else '3'} {turns}")
        for end in ends.get(joint, [] if joint in parents else [np.zeros(3)]):
            rows += [f"{tabs}\tEnd Site", f"{tabs}\t{{", f"{tabs}\t\t{_offset(end)}", f"{tabs}\t}}"]
    return "\n".join([*rows, *_closing(depth, 0)]) + "\n"


def _closing(depth: int, down_to: int) -> list[str]:
    return ["\t" * level + "}" for level in range(depth - 1, down_to - 1, -1)]


def _offset(place: np.ndarray) -> str:
    return "OFFSET " + " ".join(f"{value:.8f}" for value in place + 0.0)
