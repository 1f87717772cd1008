"""Binary frames: figures and what goes with them as bytes, and back (see ``layout``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int, Integer, UInt8, UInt16

from stridecast.errors import InputError
from stridecast.live.layout import ALIGNMENT, ARRAYS, HEADER, LEVELS, WALK, WALK_ARRAYS, Column

Array = np.ndarray

_OTHERS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
"""The three components that are written, by which the greatest is."""

_INVERSE = np.array([[0, 0, 1, 2], [0, 0, 1, 2], [0, 1, 0, 2], [0, 1, 2, 0]])
"""From the three components written back to places of four; the greatest's own place does not matter."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Figures:
    """What one frame shows, ready to be written: poses in the packed form in which they travel.

    Parameters
    ----------
    ids
        Numbers of the figures.
    places
        ``(x, z, heading)``, metres and radians.
    speeds
        m/s.
    rules
        What each is up to (see ``crowd.rules``); 0 where there are no rules.
    roots, rotations, planted
        Poses of the first of them: places of the roots (m), packed rotations, bits of the feet that are held.
    movers
        Places of the moving obstacles, ``(x, z)``, metres.
    """

    ids: Integer[Array, "figures"]
    places: Float[Array, "figures 3"]
    speeds: Float[Array, "figures"]
    rules: Integer[Array, "figures"]
    roots: Float[Array, "full 3"]
    rotations: UInt16[Array, "full joints 3"]
    planted: UInt8[Array, "full"]
    movers: Float[Array, "movers 2"] = field(default_factory=lambda: np.zeros((0, 2)))

    def chosen(self, rows: Int[Array, "rows"], full: int) -> Figures:
        """Some of them in another order, the first ``full`` with poses; all must have poses."""
        posed = rows[:full]
        return Figures(
            ids=self.ids[rows],
            places=self.places[rows],
            speeds=self.speeds[rows],
            rules=self.rules[rows],
            roots=self.roots[posed],
            rotations=self.rotations[posed],
            planted=self.planted[posed],
            movers=self.movers,
        )

    @property
    def nbytes(self) -> int:
        """Room that they take, bytes."""
        arrays = (self.ids, self.places, self.speeds, self.rules, self.roots, self.rotations, self.planted, self.movers)
        return sum(array.nbytes for array in arrays)


def pack_rotations(rotations: Float[Array, "*shape 4"]) -> UInt16[Array, "*shape 3"]:
    """Unit quaternions ``w x y z`` in six bytes each.

    The greatest component is left out and its place (0 to 3) kept in two bits; the other three are divided by it, and
    the angle of that quotient, -45 to 45 degrees, is rounded to one of ``2 * LEVELS + 1`` steps. That is finer than the
    components themselves would be, and off by less than 1e-4 rad everywhere. The first two of the three numbers carry
    the upper and the lower bit of the place as their highest bit.
    """
    flat = np.asarray(rotations, np.float64).reshape(-1, 4)
    rows = np.arange(len(flat))
    greatest = np.abs(flat).argmax(axis=1)
    quotients = flat[rows[:, None], _OTHERS[greatest]] / flat[rows, greatest][:, None]
    packed = np.rint(np.arctan(quotients.astype(np.float32)) * np.float32(LEVELS * 4 / np.pi) + LEVELS).astype(
        np.uint16
    )
    packed[:, 0] |= (greatest >> 1 << 15).astype(np.uint16)
    packed[:, 1] |= ((greatest & 1) << 15).astype(np.uint16)
    return packed.reshape(*np.shape(rotations)[:-1], 3)


def unpack_rotations(packed: UInt16[Array, "*shape 3"]) -> Float[Array, "*shape 4"]:
    """Unit quaternions ``w x y z`` again; the greatest component is positive."""
    flat = packed.reshape(-1, 3).astype(np.int64)
    greatest = (flat[:, 0] >> 15) << 1 | flat[:, 1] >> 15
    angles = ((flat & 0x7FFF) - LEVELS) * (np.pi / (4 * LEVELS))
    out = np.take_along_axis(np.tan(angles), _INVERSE[greatest], axis=1)
    out[np.arange(len(out)), greatest] = 1.0
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    return out.reshape(*packed.shape[:-1], 4)


def encode(
    kind: int,
    frame: int,
    time: float,
    figures: Figures,
    *,
    echo: float = 0.0,
    flags: int = 0,
    extra: Mapping[str, Array] | None = None,
) -> bytes:
    """A frame as bytes.

    Parameters
    ----------
    kind, frame, time, echo, flags
        As in the header.
    figures
        What it shows.
    extra
        Of walk frames: the arrays ``steering`` and ``playing``.
    """
    joints = figures.rotations.shape[1]
    header = np.zeros((), HEADER)
    header["kind"], header["flags"], header["frame"], header["time"], header["echo"] = kind, flags, frame, time, echo
    header["count"], header["full"], header["joints"] = len(figures.ids), len(figures.roots), joints
    header["movers"] = len(figures.movers)
    values: dict[str, Array] = {column.name: getattr(figures, column.name) for column in ARRAYS} | dict(extra or {})
    parts = [header.tobytes()]
    for column in columns_of(kind):
        data = np.ascontiguousarray(values[column.name], column.kind).tobytes()
        parts.append(data)
        parts.append(bytes(-len(data) % ALIGNMENT))
    return b"".join(parts)


def columns_of(kind: int) -> tuple[Column, ...]:
    """Arrays of a kind of frame, in their order."""
    return ARRAYS + WALK_ARRAYS if kind == WALK else ARRAYS


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """A frame that was read; ``arrays`` as in ``layout``, rotations as they travel (see ``unpack_rotations``)."""

    kind: int
    flags: int
    frame: int
    time: float
    echo: float
    arrays: dict[str, Array]

    @property
    def rotations(self) -> Float[Array, "full joints 4"]:
        """Rotations ``w x y z``, joint to parent, the root's in the world."""
        return unpack_rotations(self.arrays["rotations"])


def decode(data: bytes) -> Frame:
    """Read a frame.

    Raises
    ------
    InputError
        It is too short or too long for what its header says.
    """
    if len(data) < HEADER.itemsize:
        raise InputError(f"a frame has at least {HEADER.itemsize} bytes, not {len(data)}")
    header = np.frombuffer(data, HEADER, 1)[0]
    counts = {"1": 1} | {name: int(header[name]) for name in ("count", "full", "movers")}
    arrays: dict[str, Array] = {}
    begin = HEADER.itemsize
    for column in columns_of(int(header["kind"])):
        inner = (int(header["joints"]), column.width) if column.joints else (column.width,)
        shape = (counts[column.rows], *inner)
        number = int(np.prod(shape))
        end = begin + number * np.dtype(column.kind).itemsize
        if end > len(data):
            raise InputError(f"a frame of {len(data)} bytes ends within its {column.name}")
        array = np.frombuffer(data, column.kind, number, begin).reshape(shape)
        arrays[column.name] = array[:, 0] if inner == (1,) else array
        begin = end + -end % ALIGNMENT
    if begin != len(data):
        raise InputError(f"a frame of {len(data)} bytes should have {begin}")
    return Frame(
        kind=int(header["kind"]),
        flags=int(header["flags"]),
        frame=int(header["frame"]),
        time=float(header["time"]),
        echo=float(header["echo"]),
        arrays=arrays,
    )
