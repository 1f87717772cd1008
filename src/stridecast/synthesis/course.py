"""A clip seen from its vehicle: what can be added up, frame by frame, and how a body is made of it again.

Places of the pelvis and the feet are kept in the frame of the vehicle, and so are the turns of the feet: two clips that
go different ways over the ground then differ only in how they go. The vehicle itself is kept as what it does from frame
to frame. A planted foot moves in that frame as the vehicle leaves it behind; blended with the vehicle's way, it stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import CubicSpline

from stridecast.analysis.details import add_details, extract_details
from stridecast.body.planting import Feet, corrected, feet_of, put_feet
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.geometry.squad import squad
from stridecast.model.clip import Clip
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton
from stridecast.model.vehicle import MotionDetails

Array = np.ndarray

EVEN = 1e-9
"""Moments closer to a frame than this (in frames) are that frame."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """What somebody does, seen from the vehicle. All parts but ``ways`` and ``steps`` have one row a frame.

    Parameters
    ----------
    skeleton, frame_rate
        Whose, and how many frames a second.
    start
        Vehicle at the first frame: ``x``, ``z``, heading.
    ways
        Vehicle from each frame to the next: left, forward (m, about the heading half-way), turn (rad).
    vectors
        Pelvis from the vehicle (left, up, forward), its yaw, then left and right toe joint from the vehicle.
    turns
        Rotations: the pelvis without its yaw, all other joints to their parents, then left and right foot against the
        vehicle.
    steps
        Toe joints from each frame to the next, in the frame of the vehicle's heading half-way; zero for a foot that
        stands still.
    heights
        Of the toe joints while they stand, metres.
    planted
        Which foot stands.
    """

    skeleton: Skeleton
    frame_rate: float
    start: Float[Array, "3"]
    ways: Float[Array, "steps 3"]
    vectors: Float[Array, "frames 10"]
    turns: Float[Array, "frames turning 4"]
    steps: Float[Array, "steps 2 3"]
    heights: Float[Array, "frames 2"]
    planted: Bool[Array, "frames 2"]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.vectors)


def course_of(clip: Clip, times: Float[Array, "frames"], rate: float, planted: Bool[Array, "frames 2"]) -> Course:
    """A clip at moments of it.

    Parameters
    ----------
    clip
        Whose frames are interpolated: rotations by squad, places by cubic splines.
    times
        Rising moments, in frames of the clip.
    rate
        Frames a second of the result.
    planted
        Which foot stands at these moments.
    """
    motion = clip.motion
    details = extract_details(motion.root_positions, motion.rotations[:, 0], clip.positions, clip.headings)
    feet = feet_of(motion)
    series = np.concatenate(
        (
            clip.positions,
            clip.headings[:, None],
            details.displacements,
            details.yaws[:, None],
            feet.toes.reshape(-1, 6),
        ),
        axis=-1,
    )
    level = quat.about_y(-clip.headings)[:, None]
    turns = np.concatenate(
        (details.offsets[:, None], motion.rotations[:, 1:], quat.multiply(level, feet.turns)), axis=1
    )
    series, turns = _at(series, times), _turned_at(turns, times)
    positions, headings, toes = series[:, :2], series[:, 2], series[:, 7:].reshape(-1, 2, 3)
    away = quat.rotate(quat.about_y(-headings)[:, None], toes - ground.lift(positions)[:, None])
    middle = 0.5 * (headings[1:] + headings[:-1])
    ways = ground.turn(np.diff(positions, axis=0), -middle)
    return Course(
        skeleton=motion.skeleton,
        frame_rate=rate,
        start=series[0, :3],
        ways=np.concatenate((ways, np.diff(headings)[:, None]), axis=-1),
        vectors=np.concatenate((series[:, 3:7], away.reshape(-1, 6)), axis=-1),
        turns=turns,
        steps=quat.rotate(quat.about_y(-middle)[:, None], np.diff(toes, axis=0)),
        heights=toes[..., 1],
        planted=planted,
    )


def _at(series: Float[Array, "own channels"], times: Float[Array, "frames"]) -> Float[Array, "frames channels"]:
    whole = np.round(times)
    if (np.abs(times - whole) < EVEN).all() or len(series) < 2:
        return series[np.clip(whole, 0, len(series) - 1).astype(int)]
    return CubicSpline(np.arange(len(series)), series)(np.clip(times, 0, len(series) - 1))


def _turned_at(turns: Float[Array, "own turning 4"], times: Float[Array, "frames"]) -> Float[Array, "frames turning 4"]:
    whole = np.round(times)
    if (np.abs(times - whole) < EVEN).all():
        return turns[np.clip(whole, 0, len(turns) - 1).astype(int)]
    return squad(np.arange(len(turns), dtype=float), turns, times)


def way_of(course: Course) -> tuple[Float[Array, "frames 2"], Float[Array, "frames"]]:
    """Vehicle of a course: its steps summed up; ground points and headings."""
    headings = course.start[2] + np.concatenate(([0.0], np.cumsum(course.ways[:, 2])))
    middle = 0.5 * (headings[1:] + headings[:-1])
    moves = ground.turn(course.ways[:, :2], middle)
    return course.start[:2] + np.concatenate((np.zeros((1, 2)), np.cumsum(moves, axis=0))), headings


def body_of(course: Course, name: str, fixed: int = 0) -> tuple[Motion, Array, Array]:
    """Make a motion of a course: vehicle, pelvis, joints, feet.

    Parameters
    ----------
    course
        What is done.
    name
        Of the motion.
    fixed
        Where two courses are joined, the first frame of the second. Before it feet are where the course has them;
        later stances are held at their middle.

    Returns
    -------
    The motion, and positions and headings of its vehicle.
    """
    positions, headings = way_of(course)
    details = MotionDetails(
        displacements=course.vectors[:, :3], yaws=course.vectors[:, 3], offsets=quat.normalize(course.turns[:, 0])
    )
    joints = course.skeleton.joints
    rotations = np.empty((course.frames, joints, 4))
    root, rotations[:, 0] = add_details(positions, headings, details)
    rotations[:, 1:] = course.turns[:, 1:joints]
    level = quat.about_y(headings)[:, None]
    toes = quat.rotate(level, course.vectors[:, 4:].reshape(-1, 2, 3)) + ground.lift(positions)[:, None]
    turns = quat.multiply(level, course.turns[:, joints:])
    motion = Motion(
        skeleton=course.skeleton,
        frame_rate=course.frame_rate,
        root_positions=root,
        rotations=quat.continuous(quat.normalize(rotations)),
        name=name,
    )
    if fixed:  # what fades in the joints is what fades in the feet
        own = feet_of(motion)
        toes, turns = (
            np.concatenate((toes[:fixed], own.toes[fixed:])),
            np.concatenate((turns[:fixed], own.turns[fixed:])),
        )
    free = Feet(toes=toes, turns=turns)
    held = Feet(toes=_held(course, toes, headings, fixed), turns=turns)
    feet = corrected(free, held, course.planted, course.frame_rate)
    return put_feet(motion, feet, course.planted), positions, headings


def _held(course: Course, toes: Array, headings: Array, fixed: int) -> Float[Array, "frames 2 3"]:
    """Toes that move in each stance no more than the course's steps say; in between as they are."""
    out = toes.copy()
    middle = 0.5 * (headings[1:] + headings[:-1])
    moves = quat.rotate(quat.about_y(middle)[:, None], course.steps)
    for side in range(2):
        for stands, start, stop in signals.runs(course.planted[:, side]):
            if not stands:
                continue
            anchor = min(stop, fixed) - 1 if start < fixed else (start + stop - 1) // 2
            way = np.concatenate((np.zeros((1, 3)), np.cumsum(moves[start : stop - 1, side], axis=0)))
            out[start:stop, side] = toes[anchor, side] + way - way[anchor - start]
            if start < fixed:
                out[start:stop, side, 1] = np.maximum(toes[start:stop, side, 1], course.heights[start:stop, side].min())
            else:
                out[start:stop, side, 1] = course.heights[start:stop, side]
    return out
