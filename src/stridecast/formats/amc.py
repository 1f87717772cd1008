"""AMC, the motion of an Acclaim skeleton: a frame number, then one line for each bone that moves, and so on.

The numbers turn a bone about its own axes, C in the ASF: against its parent it is turned by ``C M C^-1``.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np
from jaxtyping import Float

from stridecast.body.rig import RawRecording
from stridecast.errors import FileError
from stridecast.formats.asf import AsfSkeleton, applied, read_asf
from stridecast.formats.files import looks_like, read_text
from stridecast.formats.numbers import parse_numbers
from stridecast.geometry import quaternions as quat


def read_amc(path: str | Path, skeleton_path: str | Path | None = None) -> RawRecording:
    """Read an AMC recording with its ASF skeleton.

    Parameters
    ----------
    path
        The AMC file.
    skeleton_path
        Its ASF; else ``07.asf`` beside ``07_01.amc``, else the only ASF in that folder.

    Returns
    -------
    The recording as it is: its own unit and axes, no frame rate (an AMC has none).

    Raises
    ------
    FileError
        Either file is missing, damaged or not what it should be, or they do not belong together; with the line.
    """
    data = read_text(path)
    asf = read_asf(_asf_beside(Path(path)) if skeleton_path is None else skeleton_path)
    return _Reader(path, asf).read(data)


def _asf_beside(path: Path) -> Path:
    files = sorted(file for file in path.absolute().parent.iterdir() if file.suffix.lower() == ".asf")
    subject = path.stem.partition("_")[0]
    for stem in (subject.lower(), path.stem.lower()):
        for file in files:
            if file.stem.lower() == stem:
                return file
    if len(files) == 1:
        return files[0]
    have = f"the folder has {', '.join(file.name for file in files)}" if files else "the folder has none"
    raise FileError(f"needs its skeleton, {subject}.asf; {have}; name one as skeleton_path", path=path)


class _Row(NamedTuple):
    """A line of the file: number, first word, and the rest."""

    line: int
    label: bytes
    rest: bytes


class _Reader:
    """Reads the frames for a skeleton."""

    def __init__(self, path: str | Path, asf: AsfSkeleton) -> None:
        self.path = path
        self.asf = asf
        self.moving = [joint for joint, freedoms in enumerate(asf.freedoms) if freedoms]
        self.labels = [asf.names[joint].encode() for joint in self.moving]
        self.widths = [len(asf.freedoms[joint]) for joint in self.moving]

    def fail(self, message: str, line: int) -> NoReturn:
        raise FileError(message, path=self.path, line=line)

    def read(self, data: bytes) -> RawRecording:
        if not self.labels:
            raise FileError("cannot be read: no bone of its skeleton has a degree of freedom", path=self.path)
        degrees, rows = self.split(data)
        bones = self.in_step(rows) or self.sorted_out(rows)
        lines = [row.line for row in bones]
        frames = len(bones) // len(self.labels)
        numbers = parse_numbers(b"\n".join([row.rest for row in bones]), path=self.path, lines=lines)
        counts = np.bincount(numbers.rows, minlength=len(bones))
        wrong = np.flatnonzero(counts != np.tile(self.widths, frames))
        if len(wrong):
            row = bones[wrong[0]]
            freedoms = self.asf.freedoms[self.moving[wrong[0] % len(self.moving)]]
            cut = "; the file is cut here" if row.line == rows[-1].line else ""
            self.fail(
                f"bone {row.label.decode()!r} has {counts[wrong[0]]} numbers where its skeleton has {len(freedoms)} "
                f"({' '.join(freedoms)}){cut}",
                row.line,
            )
        bad = np.flatnonzero(~np.isfinite(numbers.values))
        if len(bad):
            index = int(numbers.rows[bad[0]])
            row, frame = bones[index], index // len(self.labels)
            self.fail(f"frame {frame} (counted from 0): joint {row.label.decode()!r} is not finite", row.line)
        return self.posed(numbers.values.reshape(frames, sum(self.widths)), degrees)

    def split(self, data: bytes) -> tuple[bool, list[_Row]]:
        """Whether angles are degrees, and the lines from the first frame number on, without comments."""
        degrees = self.asf.degrees
        rows: list[_Row] = []
        for line, text in enumerate(data.split(b"\n"), start=1):
            words = text.split(None, 1)
            if not words or words[0][:1] == b"#":
                continue
            if words[0][:1] == b":":
                keyword = words[0].lower()
                degrees = keyword == b":degrees" if keyword in (b":degrees", b":radians") else degrees
            elif rows or _is_number(words):
                rows.append(_Row(line, words[0], words[1] if len(words) > 1 else b""))
            else:
                seems = looks_like(data)
                hint = f"; the file looks like {seems}" if seems and "AMC" not in seems else ""
                self.fail(f"a frame number should stand here, not {_shown(text)}{hint}", line)
        if not rows:
            raise FileError("holds no frames", path=self.path)
        return degrees, rows

    def in_step(self, rows: list[_Row]) -> list[_Row]:
        """Lines of the bones in the skeleton's order, if every frame has the same lines in one order; else none."""
        size = len(self.labels) + 1
        labels = [row.label for row in rows]
        first = labels[1:size]
        if len(rows) % size or sorted(first) != sorted(self.labels):
            return []
        if any(set(labels[k::size]) != {first[k - 1]} for k in range(1, size)):
            return []
        self.check_count(rows[::size])
        order = [first.index(label) + 1 for label in self.labels]
        return [rows[start + k] for start in range(0, len(rows), size) for k in order]

    def sorted_out(self, rows: list[_Row]) -> list[_Row]:
        """Do the same for frames whose lines differ in order, and say which line is wrong where one is."""
        starts = [k for k, row in enumerate(rows) if row.label.isdigit() and not row.rest]
        self.check_count([rows[k] for k in starts])
        bones: list[_Row] = []
        for start, stop in zip(starts, [*starts[1:], len(rows)], strict=True):
            frame = rows[start].label.decode()
            found: dict[bytes, _Row] = {}
            for row in rows[start + 1 : stop]:
                if row.label not in self.labels:
                    known = b", ".join(self.labels).decode()
                    cut = "; is the file cut here?" if row is rows[-1] else ""
                    what = f"frame {frame}: {_shown(row.label)} is no moving bone of the skeleton{cut}"
                    self.fail(f"{what}; it has {known}", row.line)
                if row.label in found:
                    self.fail(f"frame {frame}: bone {_shown(row.label)} stands twice", row.line)
                found[row.label] = row
            lacking = [label.decode() for label in self.labels if label not in found]
            if lacking:
                what = "the file is cut: its last frame" if stop == len(rows) else "frame"
                have = f"{len(found)} of {len(self.labels)} bones"
                self.fail(f"{what} {frame} has {have}; it lacks {', '.join(lacking)}", rows[stop - 1].line)
            bones.extend(found[label] for label in self.labels)
        return bones

    def check_count(self, rows: list[_Row]) -> None:
        """Frame numbers may start anywhere, but must count up by one."""
        for row in rows:
            if not _is_number([row.label, *row.rest.split()]):
                self.fail(f"a frame number should stand here, not {_shown(row.label + b' ' + row.rest)}", row.line)
        numbers = [int(row.label) for row in rows]
        for before, after, row in zip(numbers, numbers[1:], rows[1:], strict=False):
            if after != before + 1:
                self.fail(f"frame {after} follows frame {before}: frames are missing or out of order", row.line)

    def posed(self, values: Float[np.ndarray, "frames channels"], degrees: bool) -> RawRecording:
        """Degrees of freedom to places and rotations."""
        asf, frames = self.asf, len(values)
        angles = np.zeros((frames, len(asf.names), 3))
        places = np.tile(asf.place, (frames, 1))
        channels = [(joint, freedom) for joint in self.moving for freedom in asf.freedoms[joint]]
        for column, (joint, freedom) in zip(values.T, channels, strict=True):
            axis = "xyz".index(freedom[1])
            if freedom[0] == "t":
                places[:, axis] += column
            else:
                angles[:, joint, axis] = np.radians(column) if degrees else column
        rotations = np.empty((frames, len(asf.names), 4))
        for order in set(asf.orders):
            joints = [joint for joint, own in enumerate(asf.orders) if own == order]
            axes = asf.axes[joints]
            turns = applied(angles[:, joints], order)
            rotations[:, joints] = quat.multiply(quat.multiply(axes, turns), quat.inverse(axes))
        return asf.posed(places, rotations)


def _is_number(words: list[bytes]) -> bool:
    return len(words) == 1 and words[0].isdigit() and len(words[0]) <= 18


def _shown(text: bytes) -> str:
    return repr(text.strip()[:40].decode("utf-8", "replace"))
