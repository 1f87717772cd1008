"""BVH, the Biovision hierarchy: joints in nested braces, then one line of channel values a frame.

Rotation channels turn about the axes in the order in which they are written; the position channels of the root are its
place, those of other joints their place in the parent's frame (Meredith & Maddock 2001, "Motion capture file formats
explained").
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from stridecast.body.rig import RawRecording
from stridecast.errors import FileError
from stridecast.formats.bvh_conventions import BvhConvention, bvh_convention, in_convention
from stridecast.formats.bvh_hierarchy import BvhJoint, depth_first, hierarchy_text, read_hierarchy
from stridecast.formats.files import looks_like, read_text, replacing
from stridecast.formats.numbers import Numbers, parse_numbers
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion

SHORTEST_FRAME, LONGEST_FRAME = 1e-4, 10.0
LONGEST_HIERARCHY = 1 << 24
"""Bytes within which the word MOTION must come."""

_HIERARCHY = re.compile(rb"^[ \t]*hierarchy\b", re.IGNORECASE | re.MULTILINE)
_MOTION = re.compile(rb"^[ \t]*motion[ \t]*$", re.IGNORECASE | re.MULTILINE)
_FRAMES = re.compile(r"frames\s*:\s*(\S+)", re.IGNORECASE)
_FRAME_TIME = re.compile(r"frame\s*time\s*:\s*(\S+)", re.IGNORECASE)
_FRAMES_AT_A_TIME = 1024


def read_bvh(path: str | Path) -> RawRecording:
    """Read a BVH file as it is: its own unit, axes and first frame.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Position channels of joints other than the root replace their offsets; where they change from frame to frame they
    are also in ``slides``.

    Raises
    ------
    FileError
        The file is no BVH, is cut, contradicts itself or holds numbers that are not finite; with the line.
    """
    data = read_text(path)
    if not _HIERARCHY.search(data, 0, LONGEST_HIERARCHY):
        seems = looks_like(data)
        hint = f"; it looks like {seems}" if seems and "BVH" not in seems else ""
        raise FileError(f"is no BVH recording: it has no HIERARCHY{hint}", path=path)
    start = _MOTION.search(data, 0, LONGEST_HIERARCHY)
    upper = data[: start.start() if start else LONGEST_HIERARCHY]
    joints = read_hierarchy(upper.decode("utf-8", "replace"), path)
    if start is None:
        raise FileError("the file is cut: MOTION should follow the hierarchy", path=path, line=_last_line(data))
    header = _read_header(data, start.end(), path)
    if not any(joint.channels for joint in joints):
        raise FileError("no joint has CHANNELS, so there is no motion", path=path, line=joints[0].line)
    lines = range(header.line, header.line + data.count(b"\n", header.end) + 1)
    numbers = parse_numbers(data[header.end :], path=path, lines=lines)
    return _posed(joints, _frames(numbers, lines, header, joints, path), 1.0 / header.frame_time)


class _Header(NamedTuple):
    """What stands between MOTION and the numbers; they begin at byte ``end`` in line ``line``."""

    frames: int
    frames_line: int
    frame_time: float
    end: int
    line: int


def _last_line(data: bytes) -> int:
    return data.rstrip().count(b"\n") + 1


def _read_header(data: bytes, start: int, path: str | Path) -> _Header:
    frames, frames_line, frame_time = 0, 0, 0.0
    line = data.count(b"\n", 0, start) + 1
    while not (frames and frame_time):
        start = data.find(b"\n", start) + 1
        line += 1
        if start == 0:
            missing = "Frame Time:" if frames else "Frames:"
            raise FileError(f"the file is cut: {missing} should follow", path=path, line=_last_line(data))
        row = data[start : start + 200].partition(b"\n")[0].decode("utf-8", "replace").strip()
        if match := _FRAMES.fullmatch(row):
            if not re.fullmatch("[0-9]{1,18}", match[1]) or int(match[1]) == 0:
                raise FileError(f"Frames: needs a count of at least 1, not {match[1][:40]!r}", path=path, line=line)
            frames, frames_line = int(match[1]), line
        elif match := _FRAME_TIME.fullmatch(row):
            try:
                frame_time = float(match[1])
            except ValueError:
                frame_time = 0.0
            if not SHORTEST_FRAME <= frame_time <= LONGEST_FRAME:
                said = f"{SHORTEST_FRAME} to {LONGEST_FRAME:g} seconds, not {match[1][:40]!r}"
                raise FileError(f"Frame Time: needs {said}", path=path, line=line)
        elif row:
            raise FileError(f"Frames: or Frame Time: should stand here, not {row[:60]!r}", path=path, line=line)
    end = data.find(b"\n", start)
    return _Header(frames, frames_line, frame_time, end + 1 if end >= 0 else len(data), line + 1)


def _frames(
    numbers: Numbers, lines: range, header: _Header, joints: list[BvhJoint], path: str | Path
) -> Float[np.ndarray, "frames channels"]:
    """One row a frame, once every frame has its line, every line its channels and every number a value."""
    names = [f"{channel} of joint {joint.name!r}" for joint in joints for channel in joint.channels]
    sizes = np.bincount(numbers.rows)
    rows = np.flatnonzero(sizes)
    wrong = np.flatnonzero(sizes[rows] != len(names))
    promised = f"line {header.frames_line} promises {header.frames} frames"
    if len(wrong):
        frame = int(wrong[0])
        row = rows[frame]
        what = f"frame {frame} (counted from 0) has {sizes[row]} numbers, the hierarchy has {len(names)} channels"
        if frame == len(rows) - 1 and sizes[row] < len(names):
            what = f"the file is cut: {what}; {promised}, {frame} are whole"
        raise FileError(what, path=path, line=lines[row])
    if len(rows) != header.frames:
        what = f"{promised}, but {len(rows)} lines of numbers follow"
        hint = "the file is cut, or the" if len(rows) < header.frames else "the"
        raise FileError(f"{what}; {hint} line should be 'Frames: {len(rows)}'", path=path, line=header.frames_line)
    values = numbers.values.reshape(len(rows), len(names))
    if not np.isfinite(values).all():
        frame, channel = (int(index) for index in np.argwhere(~np.isfinite(values))[0])
        what = f"frame {frame} (counted from 0): {names[channel]} is not finite"
        raise FileError(what, path=path, line=lines[rows[frame]])
    return values


def _posed(joints: list[BvhJoint], values: Float[np.ndarray, "frames channels"], frame_rate: float) -> RawRecording:
    """Channels to places and rotations."""
    offsets = np.array([joint.offset for joint in joints])
    places: dict[int, np.ndarray] = {}
    turning: dict[str, list[tuple[int, list[int]]]] = {}
    column = 0
    for index, joint in enumerate(joints):
        shifts = {
            "xyz".index(name[0]): column + k for k, name in enumerate(joint.channels) if name.endswith("position")
        }
        if shifts:
            places[index] = np.tile(offsets[index] if index else np.zeros(3), (len(values), 1))
            places[index][:, list(shifts)] = values[:, list(shifts.values())]
        turns = {name[0].upper(): column + k for k, name in enumerate(joint.channels) if name.endswith("rotation")}
        if turns:
            turning.setdefault("".join(turns), []).append((index, list(turns.values())))
        column += len(joint.channels)
    rotations = np.broadcast_to(quat.IDENTITY, (len(values), len(joints), 4)).copy()
    for order, turned in turning.items():
        columns = np.array([columns for _, columns in turned])
        rotations[:, [index for index, _ in turned]] = quat.from_euler(np.radians(values[:, columns]), order)
    if 0 not in places:
        places[0] = np.tile(offsets[0], (len(values), 1))
        offsets[0] = 0.0
    root_positions = places.pop(0)
    for index, place in places.items():
        offsets[index] = np.median(place, axis=0)
    ends = [(index, end) for index, joint in enumerate(joints) for end in joint.ends]
    return RawRecording(
        names=tuple(joint.name for joint in joints),
        parents=np.array([joint.parent for joint in joints]),
        offsets=offsets,
        end_joints=np.array([index for index, _ in ends], np.int64),
        end_offsets=np.array([end for _, end in ends], np.float64).reshape(-1, 3),
        root_positions=root_positions,
        rotations=rotations,
        slides={index: place for index, place in places.items() if np.ptp(place, axis=0).any()},
        frame_rate=frame_rate,
    )


def write_bvh(
    path: str | Path,
    motion: Motion,
    *,
    convention: str | BvhConvention = "plain",
    order: str | None = None,
    scale: float | None = None,
) -> None:
    """Write a motion as a BVH file that reads back to within 1e-6 m and rad.

    Parameters
    ----------
    path
        The file. It is written beside its place and then renamed, so what was there stays whole until the end.
    motion
        The motion. The root's position channels are its place, whatever its OFFSET.
    convention
        For which program: ``"plain"``, ``"blender"``, ``"motionbuilder"``, ``"unreal"`` (see ``BVH_CONVENTIONS``), or
        a ``BvhConvention`` of your own.
    order
        Order of the rotation channels, each of ``X``, ``Y``, ``Z`` once; else that of the convention. Angles run on
        from frame to frame, without jumps by a turn.
    scale
        Metres per unit of the file, 0.01 writes centimetres; else that of the convention.

    Raises
    ------
    FileError
        The file system refuses (no such folder, no right, disk full).
    InputError
        A convention, an order or a scale that is none.
    SkeletonError
        The convention wants a joint on the floor, and the skeleton has another one of that name.
    """
    how = bvh_convention(convention, order=order, scale=scale)
    recording = in_convention(motion, how)
    joints = depth_first(recording.parents.tolist())
    angles = np.degrees(_steady_angles(recording.rotations, how.order))
    columns, formats = [], []
    for joint in joints:
        places = recording.root_positions if joint == 0 else recording.slides.get(joint)
        if places is not None:
            columns.append(np.round(places, 8))
            formats += ["%.8f"] * 3
        columns.append(np.round(angles[:, joint], 6))
        formats += ["%.6f"] * 3
    values = np.concatenate(columns, axis=1) + 0.0  # no minus before a zero
    row = " ".join(formats) + "\n"
    with replacing(path) as file:
        file.write(hierarchy_text(recording, how.order).encode())
        file.write(f"MOTION\nFrames: {len(values)}\nFrame Time: {1.0 / motion.frame_rate:.10g}\n".encode())
        for start in range(0, len(values), _FRAMES_AT_A_TIME):
            block = values[start : start + _FRAMES_AT_A_TIME].tolist()
            file.write("".join([row % tuple(frame) for frame in block]).encode())


def _steady_angles(rotations: Float[np.ndarray, "frames joints 4"], order: str) -> Float[np.ndarray, "frames joints 3"]:
    """Angles that run on from frame to frame.

    Every rotation has two triples of angles, ``(a, b, c)`` and ``(a + pi, pi - b, c + pi)``; each frame takes the one
    nearer to the frame before. How far two frames are apart depends only on whether they take the same kind, so the
    kinds follow from counting the changes.
    """
    angles = quat.to_euler(rotations, order)
    other = np.stack((angles[..., 0] + np.pi, np.pi - angles[..., 1], angles[..., 2] + np.pi), axis=-1)

    def apart(after: np.ndarray) -> np.ndarray:
        return np.abs(np.remainder(after[1:] - angles[:-1] + np.pi, 2 * np.pi) - np.pi).sum(axis=-1)

    changes = np.cumsum(apart(other) < apart(angles), axis=0) % 2 == 1
    angles[1:][changes] = other[1:][changes]
    return np.unwrap(angles, axis=0)
