"""BVH, the Biovision hierarchy: a skeleton in nested braces, then one line of channel values a frame.

The places of the root's position channels are absolute; the root's own OFFSET is kept beside them for those few files that
mean it to be added. Rotation channels turn about the axes in the order in which they are written (Meredith & Maddock 2001).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np
from jaxtyping import Float

from stridecast.body.rig import RawRecording
from stridecast.errors import FileError
from stridecast.formats.files import looks_like, read_text, replacing
from stridecast.formats.numbers import Numbers, parse_numbers
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion

MOST_JOINTS = 4096
DEEPEST = 256
MOST_CHANNELS = 6
SHORTEST_FRAME, LONGEST_FRAME = 0.0001, 10.0

_CHANNEL = re.compile(r"([xyz])(position|rotation)", re.IGNORECASE)
_HIERARCHY = re.compile(rb"^[ \t]*hierarchy\b", re.IGNORECASE | re.MULTILINE)
_MOTION = re.compile(rb"^[ \t]*motion[ \t]*$", re.IGNORECASE | re.MULTILINE)
_FRAMES = re.compile(r"frames\s*:\s*(\S+)", re.IGNORECASE)
_COUNT = re.compile(r"[0-9]{1,18}")
_FRAME_TIME = re.compile(r"frame\s*time\s*:\s*(\S+)", re.IGNORECASE)


@dataclass(kw_only=True)
class _Joint:
    name: str
    parent: int
    line: int
    offset: list[float] | None = None
    channels: list[str] | None = None
    ends: list[list[float]] = field(default_factory=list)


def read_bvh(path: str | Path) -> RawRecording:
    """Read a BVH file as it is: its own units, axes and first frame.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Skeleton, places of the root, rotations of the joints, frame rate. Position channels of other joints replace their
    offsets; where they change from frame to frame they are in ``slides``.

    Raises
    ------
    FileError
        The file is no BVH, is cut, contradicts itself or holds numbers that are not finite; with the line.
    """
    data = read_text(path)
    if not _HIERARCHY.search(data, 0, 65536):
        seems = looks_like(data)
        hint = f"; it looks like {seems}" if seems and "BVH" not in seems else ""
        raise FileError(f"is no BVH recording: it has no HIERARCHY{hint}", path=path, line=1)
    start = _MOTION.search(data)
    joints = _Hierarchy(path).read(data[: start.start()] if start else data)
    if start is None:
        raise FileError("ends before MOTION: the file is cut", path=path, line=_lines(data))
    return _motion(path, joints, data, start.end())


def _lines(data: bytes) -> int:
    return data.rstrip().count(b"\n") + 1


class _Hierarchy:
    """Reads the nested braces into a flat list of joints, parents first."""

    def __init__(self, path: str | Path) -> None:
        self.path = path
        self.line = 0
        self.joints: list[_Joint] = []

    def fail(self, message: str) -> NoReturn:
        raise FileError(message, path=self.path, line=self.line)

    def read(self, text: bytes) -> list[_Joint]:
        # what is open: joint indices, with -1 for an End Site
        opened: list[int] = []
        waiting: int | None = None
        for self.line, row in enumerate(text.decode("utf-8", "replace").split("\n"), start=1):
            for piece in re.findall(r"[{}]|[^{}]+", row):
                words = piece.split()
                if not words:
                    continue
                keyword = words[0].lower()
                if keyword == "{":
                    if waiting is None:
                        self.fail("a brace opens here that belongs to no joint")
                    opened.append(waiting)
                    waiting = None
                elif waiting is not None:
                    self.fail(f"{{ should follow the name of a joint, not {piece.strip()[:40]!r}")
                elif keyword == "}":
                    if not opened:
                        self.fail("a brace closes here that was never opened")
                    self.close(opened.pop())
                elif keyword in ("root", "joint", "end"):
                    waiting = self.open(keyword, words, opened)
                elif keyword in ("offset", "channels"):
                    if not opened:
                        self.fail(f"{words[0]} stands outside of any joint")
                    self.offset(words, opened[-1]) if keyword == "offset" else self.channels(words, opened[-1])
                elif keyword != "hierarchy":
                    self.fail(f"no BVH keyword: {words[0][:40]!r} (ROOT, JOINT, End Site, OFFSET, CHANNELS or MOTION)")
        if waiting is not None or opened:
            self.fail(f"the hierarchy is cut: {max(len(opened), 1)} brace(s) are still open where it ends")
        if not self.joints:
            self.fail("the hierarchy has no ROOT")
        return self.joints

    def check_name(self, name: str) -> None:
        twin = next((joint for joint in self.joints if joint.name == name), None)
        if twin is not None:
            self.fail(f"a second joint {name!r}; the first is in line {twin.line}")

    def open(self, keyword: str, words: list[str], opened: list[int]) -> int:
        parent = opened[-1] if opened else -1
        if len(opened) >= DEEPEST:
            self.fail(f"joints are nested deeper than {DEEPEST}")
        if opened and parent < 0:
            self.fail("an End Site has no joints below it")
        if keyword == "end":
            if not opened:
                self.fail("an End Site stands outside of any joint")
            return -1
        name = " ".join(words[1:])
        if not name:
            self.fail(f"{words[0]} needs a name")
        if (keyword == "root") == bool(opened):
            self.fail(f"{words[0]} {name!r} stands {'inside' if opened else 'outside'} of a joint")
        if keyword == "root" and self.joints:
            self.fail(f"a second ROOT, {name!r}: a recording has one person; split the file")
        if len(self.joints) >= MOST_JOINTS:
            self.fail(f"more than {MOST_JOINTS} joints")
        self.joints.append(_Joint(name=name, parent=parent, line=self.line))
        return len(self.joints) - 1

    def close(self, joint: int) -> None:
        if joint >= 0 and self.joints[joint].offset is None:
            self.fail(f"joint {self.joints[joint].name!r} closes without an OFFSET")

    def offset(self, words: list[str], joint: int) -> None:
        try:
            place = [float(word) for word in words[1:]]
        except ValueError:
            place = []
        if len(place) != 3 or not np.isfinite(place).all():
            self.fail(f"OFFSET needs three finite numbers, not {' '.join(words[1:])[:60]!r}")
        if joint >= 0:
            self.joints[joint].offset = place
        else:
            self.joints[-1].ends.append(place)

    def channels(self, words: list[str], joint: int) -> None:
        if joint < 0:
            self.fail("an End Site has no CHANNELS")
        names = [word.lower() for word in words[2:]]
        if len(words) < 2 or not _COUNT.fullmatch(words[1]) or int(words[1]) != len(names) or len(names) > MOST_CHANNELS:
            self.fail(
                f"CHANNELS should give a count (up to {MOST_CHANNELS}) and as many names, not {' '.join(words)[:80]!r}"
            )
        for word in words[2:]:
            if not _CHANNEL.fullmatch(word):
                self.fail(f"no channel: {word[:40]!r}; there are Xposition ... Zposition, Xrotation ... Zrotation")
        if len(set(names)) != len(names):
            self.fail(f"a channel of joint {self.joints[joint].name!r} stands twice")
        self.joints[joint].channels = names


def _motion(path: str | Path, joints: list[_Joint], data: bytes, start: int) -> RawRecording:
    """Read everything after the word MOTION."""
    count, rate, begin, line = _motion_header(path, data, start)
    width = sum(len(joint.channels or ()) for joint in joints)
    if width == 0:
        raise FileError("no joint has CHANNELS, so there is no motion", path=path, line=joints[0].line)
    lines = range(line, line + data.count(b"\n", begin) + 1)
    values = _frames(path, parse_numbers(data[begin:], path=path, lines=lines), lines, count, width, joints)
    return _recording(joints, values, rate)


def _motion_header(path: str | Path, data: bytes, start: int) -> tuple[tuple[int, int], float, int, int]:
    """``Frames:`` with its line, frame rate, and where the numbers begin: byte and line."""
    line = data.count(b"\n", 0, start) + 1
    found: dict[str, tuple[str, int]] = {}
    while len(found) < 2:
        start = data.find(b"\n", start) + 1
        line += 1
        if start == 0:
            missing = "Frames:" if "frames" not in found else "Frame Time:"
            raise FileError(f"ends before {missing}; the file is cut", path=path, line=_lines(data))
        end = data.find(b"\n", start)
        row = data[start : end if end >= 0 else len(data)][:200].decode("utf-8", "replace").strip()
        for name, pattern in (("frames", _FRAMES), ("time", _FRAME_TIME)):
            match = pattern.fullmatch(row)
            if match:
                found[name] = (match.group(1), line)
                break
        else:
            if row:
                raise FileError(f"'Frames: count' or 'Frame Time: seconds' should stand here, not {row[:60]!r}",
                                path=path, line=line)  # fmt: skip
    frames, seconds = found["frames"], found["time"]
    if not _COUNT.fullmatch(frames[0]) or int(frames[0]) == 0:
        raise FileError(f"Frames: needs a count of at least 1, not {frames[0]!r}", path=path, line=frames[1])
    try:
        time = float(seconds[0])
    except ValueError:
        time = 0.0
    if not SHORTEST_FRAME <= time <= LONGEST_FRAME:
        raise FileError(
            f"Frame Time: needs seconds between {SHORTEST_FRAME} and {LONGEST_FRAME}, not {seconds[0]!r}",
            path=path,
            line=seconds[1],
        )
    end = data.find(b"\n", start)
    return (int(frames[0]), frames[1]), 1.0 / time, end + 1 if end >= 0 else len(data), line + 1


def _frames(
    path: str | Path, numbers: Numbers, lines: range, count: tuple[int, int], width: int, joints: list[_Joint]
) -> Float[np.ndarray, "frames channels"]:
    """One row a frame, once every line holds its channels, every frame its line and every number a value."""
    sizes = np.bincount(numbers.rows)
    rows = np.flatnonzero(sizes)
    sizes = sizes[rows]
    promised, count_line = count
    wrong = np.flatnonzero(sizes != width)
    if len(wrong) and (len(wrong) > 1 or wrong[0] < len(rows) - 1 or sizes[-1] > width):
        first = int(wrong[0])
        raise FileError(
            f"frame {first} has {sizes[first]} numbers, but the hierarchy has {width} channels",
            path=path,
            line=lines[rows[first]],
        )
    if len(wrong):
        raise FileError(
            f"the file is cut: its last line, frame {len(rows) - 1}, has {sizes[-1]} of {width} numbers "
            f"(Frames: promises {promised} in line {count_line}, {len(rows) - 1} are whole)",
            path=path,
            line=lines[rows[-1]],
        )
    if len(rows) != promised:
        what = "the file is cut, or the line should read" if len(rows) < promised else "the line should read"
        raise FileError(
            f"Frames: promises {promised}, but {len(rows)} lines of numbers follow; {what} 'Frames: {len(rows)}'",
            path=path,
            line=count_line,
        )
    values = numbers.values.reshape(promised, width)
    if not np.isfinite(values).all():
        frame, channel = (int(i) for i in np.argwhere(~np.isfinite(values))[0])
        names = [f"{channel} of joint {joint.name!r}" for joint in joints for channel in joint.channels or ()]
        raise FileError(f"frame {frame}: {names[channel]} is no finite number", path=path, line=lines[rows[frame]])
    return values


def _recording(joints: list[_Joint], values: Float[np.ndarray, "frames channels"], rate: float) -> RawRecording:
    """Channels to places and rotations."""
    frames = len(values)
    offsets = np.array([joint.offset for joint in joints])
    rotations = np.broadcast_to(quat.IDENTITY, (frames, len(joints), 4)).copy()
    places: dict[int, np.ndarray] = {}
    turning: dict[str, tuple[list[int], list[list[int]]]] = {}
    column = 0
    for index, joint in enumerate(joints):
        channels = joint.channels or []
        moved = {"xyz".index(name[0]): column + k for k, name in enumerate(channels) if name.endswith("position")}
        if moved:
            places[index] = np.tile(offsets[index] * (index > 0), (frames, 1))
            places[index][:, list(moved)] = values[:, list(moved.values())]
        turned = [(name[0].upper(), column + k) for k, name in enumerate(channels) if name.endswith("rotation")]
        who, which = turning.setdefault("".join(axis for axis, _ in turned), ([], []))
        who.append(index)
        which.append([place for _, place in turned])
        column += len(channels)
    for order, (who, which) in turning.items():
        rotations[:, who] = quat.from_euler(np.radians(values[:, np.array(which, np.int64)]), order)
    if 0 not in places:
        places[0] = np.tile(offsets[0], (frames, 1))
        offsets[0] = 0.0
    slides = {}
    for index, place in places.items():
        if index > 0:
            offsets[index] = np.median(place, axis=0)
            if np.ptp(place, axis=0).max() > 0:
                slides[index] = place
    ends = [(index, end) for index, joint in enumerate(joints) for end in joint.ends]
    return RawRecording(
        names=tuple(joint.name for joint in joints),
        parents=np.array([joint.parent for joint in joints]),
        offsets=offsets,
        end_joints=np.array([index for index, _ in ends], np.int64),
        end_offsets=np.array([end for _, end in ends]).reshape(-1, 3),
        root_positions=places[0],
        rotations=rotations,
        slides=slides,
        frame_rate=rate,
    )
