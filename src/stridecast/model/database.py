"""The motion database: everything that was learned, frozen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from stridecast.errors import DatabaseError
from stridecast.model.annotation import Annotations, TakeAnnotation
from stridecast.model.group import MotionGroup
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

INTERVALS = 24
"""Generic time of a segment is sampled at this many intervals, ..."""

MARGIN = 2
"""... and at this many more samples before its first and after its last frame, so that seams know whence it comes."""

ROWS = INTERVALS + 1 + 2 * MARGIN
"""Samples of an example."""


@dataclass(frozen=True, kw_only=True)
class Take:
    """Where examples come from, and what became of the take.

    ``left_out`` says why nothing (or, with ``segments`` above zero, why not everything) of it was used; ``annotation``
    is what it shows, none where nothing was used.
    """

    name: str
    subject: str
    file: str
    sha256: str
    seconds: float
    covered: float
    segments: int
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    annotation: TakeAnnotation | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Examples:
    """Example segments as tables, sorted by group; all are sampled in generic time, so their rows can be added.

    Parameters
    ----------
    features
        What is blended, one row a sample: rotation vectors of all joints but the root about ``references``, then the
        rotation vector of the pelvis's tilt, its displacement from the vehicle (left, up, forward), its yaw.
    times
        When an example reaches each sample, seconds from its first frame (the warp from generic time to its own).
    parameters
        Speed, tangential and lateral acceleration of the vehicle at the first frame (KS07).
    travelled
        The vehicle from the first frame: left and forward (m), heading (rad), speed (m/s) at every sample.
    durations
        Seconds from boundary to boundary.
    takes, first_frames, mirrored
        Where it comes from: index of the take, frame in it (native rate), whether left and right are exchanged.
    """

    features: Float[Array, "examples rows features"]
    times: Float[Array, "examples rows"]
    parameters: Float[Array, "examples 3"]
    travelled: Float[Array, "examples rows 4"]
    durations: Float[Array, "examples"]
    takes: Int[Array, "examples"]
    first_frames: Int[Array, "examples"]
    mirrored: Bool[Array, "examples"]

    def __post_init__(self) -> None:
        count = len(self.durations)
        for name, kind in _TABLES.items():
            array: Array = np.ascontiguousarray(getattr(self, name), kind)
            if len(array) != count or not np.isfinite(array).all():
                raise DatabaseError(f"table {name!r} is damaged: {count} finite rows wanted, shape {array.shape} found")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.features.shape[1] != ROWS or self.times.shape != self.features.shape[:2]:
            raise DatabaseError(f"examples need {ROWS} samples each, not {self.features.shape[1]}")


_TABLES = {
    "features": np.float64,
    "times": np.float64,
    "parameters": np.float64,
    "travelled": np.float64,
    "durations": np.float64,
    "takes": np.int64,
    "first_frames": np.int64,
    "mirrored": np.bool_,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionDatabase:
    """All that a walker needs: skeleton, groups, examples, bounds, and where everything came from.

    Parameters
    ----------
    skeleton
        The one body of the database.
    frame_rate
        Frames a second of what is synthesised from it.
    groups
        Groups of segments; their order is the order of the examples.
    examples
        The tables.
    references
        Rotation of each joint but the root about which its rotation vectors are written, ``w x y z``.
    takes
        Every take that was offered, used or left out.
    annotations
        What each example shows: velocity, turn, style.
    bounds_method
        How bounds were learned, ``balanced`` or ``paper``.
    sole
        Height of the toe joints of feet that stand flat, metres; None for that to which recordings are brought.
    person
        Height of a person who is as large as the skeleton, metres; None for that of the skeleton. They differ where the
        skeleton is that of somebody else than the people who were recorded.
    """

    skeleton: Skeleton
    frame_rate: float
    groups: tuple[MotionGroup, ...]
    examples: Examples
    references: Float[Array, "bones 4"]
    takes: tuple[Take, ...]
    annotations: Annotations
    bounds_method: str = "balanced"
    sole: float | None = None
    person: float | None = None

    def __post_init__(self) -> None:
        array = np.array(self.references, np.float64)
        array.setflags(write=False)
        object.__setattr__(self, "references", array)
        joints = self.skeleton.joints
        width = 3 * (joints - 1) + 7
        if self.examples.features.shape[2] != width or array.shape != (joints - 1, 4):
            raise DatabaseError(f"a skeleton of {joints} joints needs {width} features and {joints - 1} references")
        if sum(g.count for g in self.groups) != len(self.examples.durations):
            raise DatabaseError("groups and examples differ in number")
        if len(self.annotations) != len(self.examples.durations):
            raise DatabaseError("annotations and examples differ in number")
        if self.sole is not None and not (np.isfinite(self.sole) and self.sole >= 0):
            raise DatabaseError(f"toe joints of flat feet must be at a height of 0 or more, not {self.sole}")
        if self.person is not None and not (np.isfinite(self.person) and self.person > 0):
            raise DatabaseError(f"a person must have a height above 0, not {self.person}")
        if not (np.isfinite(self.frame_rate) and 10 <= self.frame_rate <= 240):
            raise DatabaseError(f"the frame rate must lie between 10 and 240 Hz, not at {self.frame_rate}")

    def __repr__(self) -> str:
        sizes = f"{len(self.groups)} groups, {len(self.examples.durations)} examples, {len(self.takes)} takes"
        return f"MotionDatabase({sizes}, {self.frame_rate:g} Hz)"

    @cached_property
    def by_name(self) -> dict[str, MotionGroup]:
        """Groups by name."""
        return {group.name: group for group in self.groups}

    def group(self, name: str) -> MotionGroup:
        """The group with a name.

        Raises
        ------
        DatabaseError
            There is none; the message lists what there is.
        """
        try:
            return self.by_name[name]
        except KeyError:
            raise DatabaseError(f"there is no group {name!r}; there are {', '.join(self.by_name)}") from None

    @property
    def subjects(self) -> tuple[str, ...]:
        """Everybody whose examples are in it, sorted."""
        used = {self.takes[i].subject for i in np.unique(self.examples.takes)}
        return tuple(sorted(used))

    @property
    def motions(self) -> tuple[str, ...]:
        """Motion types a walker can be asked for."""
        return tuple(m for m in ("stand", "walk", "run") if any(g.motion == m for g in self.groups))
