"""From a recording as a file has it to a ``Motion``: in metres, +Y up, facing +Z at rest, without T-pose.

A column of small repairs; each says in a note what it did, so that the user can overrule it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.body.character import resized
from stridecast.body.rig import RawRecording, body_of, rooted_at_hips, with_toes
from stridecast.body.roles import find_roles
from stridecast.errors import InputError, MotionError, SkeletonError
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import REQUIRED_ROLES, Skeleton

UNITS: Mapping[str, float] = {
    "metres": 1.0,
    "centimetres": 0.01,
    "millimetres": 0.001,
    "inches": 0.0254,
    "CMU units": 0.0254 / 0.45,
    "decimetres": 0.1,
    "feet": 0.3048,
}
"""Units that recordings come in, metres each. CMU's are inches divided by the scale 0.45 that its ASF files state."""

ADULT_LEG = (0.7, 1.0)
"""Hip to ankle of an adult, metres; it tells the unit of a file that does not."""

DEFAULT_RATE = 120.0
"""Frames a second of recordings that do not say (AMC; it is the rate of the CMU database)."""

BELIEVED = (0.1, 10.0)
"""A leg that is shorter or longer than this, metres, tells that the unit which a file states is not what it has."""

LARGEST_SPEED = 8.0
"""A root that moves faster than this, m/s, is a broken recording."""

LARGEST_SLIDE = 0.01
"""How far a joint may stray from its place in the parent's frame, metres, before that counts as movement."""

LEAST_JUMPS = 3
"""So many joints jump at once from an added T-pose to the motion; inside the CMU takes two do at most."""

NEAR_AXIS = np.radians(15.0)
"""A rest pose that faces an axis to within this angle is taken to face it: no pelvis is quite symmetric."""

_UP = np.array([0.0, 1.0, 0.0])


def to_motion(
    recording: RawRecording,
    *,
    roles: Mapping[str, str] | None = None,
    scale: float | None = None,
    frame_rate: float | None = None,
    up: str | None = None,
    name: str = "",
    subject: str = "",
    source: str = "",
) -> tuple[Motion, tuple[str, ...]]:
    """Bring a recording into the conventions of the package.

    Parameters
    ----------
    recording
        What the file holds.
    roles
        Roles whose joints the caller knows, role to joint name.
    scale
        Metres per unit; else what the file says, else guessed from the length of the legs.
    frame_rate
        Frames a second; else what the file says, else 120.
    up
        Axis that points up in the file, ``"Y"``, ``"Z"``, ``"-Y"``, ...; else found from where the head is.
    name, subject, source
        As in ``Motion``.

    Returns
    -------
    motion
        Its floor is still where the recording has it.
    notes
        What was guessed, turned, dropped or added, one sentence each.

    Raises
    ------
    SkeletonError
        The joints of the legs are not found or have no length, or ``roles`` names something that does not exist.
    MotionError
        Fewer than two frames, or a root or legs that move as no person's do.
    InputError
        A scale that is not positive, or an unknown axis.
    """
    notes = list(recording.notes)
    before = f"{source}: " if source else ""
    frames = len(recording.root_positions)
    if frames < 2:
        raise MotionError(f"{before}a motion needs at least 2 frames, not {frames}")
    _check_numbers(recording, before)
    recording, skeleton = _body(recording, roles, notes)
    unit = _unit(skeleton, recording.unit, scale, notes)
    _check_slides(recording, skeleton, unit, before, notes)
    motion = Motion(
        skeleton=resized(skeleton, unit),
        frame_rate=_frame_rate(recording.frame_rate, frame_rate, notes),
        root_positions=recording.root_positions * unit,
        rotations=quat.continuous(quat.normalize(recording.rotations)),
        name=name,
        subject=subject,
        source=source,
    )
    motion = _without_t_pose(motion, notes)
    axis = _axis_named(up) if up is not None else _axis_found(motion, notes)
    motion = _with_root_offset(motion, recording.offsets[0] * unit, axis, notes)
    motion = _turned(motion, quat.between(axis, _UP))
    motion = _rested(motion, _rest_turn(motion.skeleton, notes))
    check_speed(motion, before, frames - motion.frames)
    return motion, tuple(notes)


def to_skeleton(
    recording: RawRecording, *, roles: Mapping[str, str] | None = None, scale: float | None = None
) -> tuple[Skeleton, tuple[str, ...]]:
    """Bring only the skeleton of a recording into the conventions; parameters and errors as of ``to_motion``."""
    notes = list(recording.notes)
    recording, skeleton = _body(recording, roles, notes)
    skeleton = resized(skeleton, _unit(skeleton, recording.unit, scale, notes))
    return _skeleton_rested(skeleton, _rest_turn(skeleton, notes)), tuple(notes)


def _check_numbers(recording: RawRecording, before: str) -> None:
    for numbers in (recording.rotations, recording.root_positions[:, None]):
        bad = np.argwhere(~np.isfinite(numbers))
        if len(bad):
            frame, joint = bad[0, :2]
            raise MotionError(f"{before}frame {frame}: joint {recording.names[joint]!r} is not finite")


def _body(
    recording: RawRecording, mapping: Mapping[str, str] | None, notes: list[str]
) -> tuple[RawRecording, Skeleton]:
    """Joints with their roles, still in the file's unit and axes."""
    roles = find_roles(recording.names, recording.parents.tolist(), {**recording.roles, **(mapping or {})})
    recording, roles = rooted_at_hips(recording, roles, notes)
    recording, roles = with_toes(recording, roles, notes)
    skeleton = body_of(recording, roles)
    skeleton.require_roles(REQUIRED_ROLES)
    return recording, skeleton


def _unit(skeleton: Skeleton, stated: float | None, scale: float | None, notes: list[str]) -> float:
    """Metres per unit."""
    leg = skeleton.leg_length
    if leg <= 0:
        raise SkeletonError("thigh and shin have no length, so nobody can walk on them")
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise InputError(f"the scale must be a positive number of metres per unit, not {scale}")
    unit = stated if scale is None else scale
    if scale is None and unit is not None and not BELIEVED[0] <= leg * unit <= BELIEVED[1]:
        notes.append(f"the leg would be {leg * unit:.3g} m long at the {unit:.4g} m per unit that the file states")
        unit = None
    if unit is not None:
        if not ADULT_LEG[0] <= leg * unit <= ADULT_LEG[1]:
            notes.append(f"the leg is {leg * unit:.3g} m long at {unit:.4g} m per unit, which is not an adult's")
        return unit
    for name, metres in UNITS.items():
        if ADULT_LEG[0] <= leg * metres <= ADULT_LEG[1]:
            notes.append(f"lengths are taken for {name}, as the leg is then {leg * metres:.2f} m long")
            return metres
    unit = sum(ADULT_LEG) / 2 / leg
    notes.append(f"lengths are in no known unit; {unit:.4g} m per unit makes the leg {unit * leg:.2f} m long")
    return unit


def _frame_rate(stated: float | None, given: float | None, notes: list[str]) -> float:
    """Frames a second; files round their frame time, so a rate next to a usual one is meant to be it."""
    if given is not None:
        return given
    if stated is None:
        notes.append(f"the file gives no frame rate; {DEFAULT_RATE:g} frames a second are assumed")
        return DEFAULT_RATE
    whole = max(round(stated), 1)
    usual = min((whole, whole * 1000 / 1001), key=lambda rate: abs(rate - stated))  # 29.97 is 30000/1001
    return float(usual) if abs(usual - stated) < 1.5e-3 * stated else stated


def _check_slides(recording: RawRecording, skeleton: Skeleton, unit: float, before: str, notes: list[str]) -> None:
    """Bones keep their length: refuse legs that do not, and tell of other joints that are held from now on."""
    legs = {skeleton.roles[role] for role in REQUIRED_ROLES}
    for joint, places in recording.slides.items():
        slide = float(np.abs(places - recording.offsets[joint]).max()) * unit
        if slide > LARGEST_SLIDE:
            what = f"joint {recording.names[joint]!r} moves up to {slide:.2g} m against its parent"
            if joint in legs:
                raise MotionError(f"{before}{what}; bones of a leg must keep their length")
            notes.append(f"{what}; it is held at its usual place")


def _without_t_pose(motion: Motion, notes: list[str]) -> Motion:
    """Drop a first frame that is exactly the rest pose, or from which no human movement leads to the second.

    Several joints at once turn three times further than they ever do in the second that follows, and by far more than a
    moment allows; or the root leaps once and never again.
    """
    start = slice(0, int(motion.frame_rate) + 3)
    q, places = motion.rotations[start], motion.root_positions[start]
    if len(q) < 3:
        return motion
    if not q[0, :, 1:].any() and q[1, :, 1:].any():
        notes.append("the first frame is left out: it is the rest pose")
        return motion.clip(1, motion.frames)
    turns = np.linalg.norm(quat.log(quat.multiply(q[1:], quat.inverse(q[:-1]))), axis=-1)
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=-1) * motion.frame_rate
    least = np.maximum(3.0 * turns[1:].max(axis=0), max(0.25, 10.0 / motion.frame_rate))
    jumps = np.count_nonzero(turns[0] > least)
    leaps = speeds[0] > LARGEST_SPEED >= speeds[1:].max()
    if jumps < LEAST_JUMPS and not leaps:
        return motion
    what = f"{jumps} joints jump" if jumps >= LEAST_JUMPS else "the root leaps"
    notes.append(f"the first frame is left out: {what} from it to the next, as from a T-pose")
    return motion.clip(1, motion.frames)


def _axis(direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Find the signed axis nearest to a direction."""
    widest = int(np.argmax(np.abs(direction)))
    return np.eye(3)[widest] * (-1.0 if direction[widest] < 0 else 1.0)


def _axis_named(up: str) -> Float[np.ndarray, "3"]:
    sign, letter = ("-", up[1:]) if up.startswith("-") else ("", up.removeprefix("+"))
    if letter.upper() not in ("X", "Y", "Z"):
        raise InputError(f"up must be X, Y or Z, with a minus if need be, not {up!r}")
    return np.eye(3)["XYZ".index(letter.upper())] * (-1.0 if sign else 1.0)


def _top(skeleton: Skeleton) -> int:
    """Choose the highest joint of the trunk that is known."""
    return next(skeleton.roles[role] for role in ("head", "neck", "chest", "hips") if role in skeleton.roles)


def _some_frames(motion: Motion) -> Float[np.ndarray, "frames joints 3"]:
    """Places of the joints at about 50 frames from all over the motion."""
    some = slice(None, None, max(motion.frames // 50, 1))
    return kinematics.forward(motion.skeleton, motion.root_positions[some], motion.rotations[some]).positions


def _axis_found(motion: Motion, notes: list[str]) -> Float[np.ndarray, "3"]:
    """Find the axis of the recording that points up: the head is that way from the feet."""
    skeleton, places = motion.skeleton, _some_frames(motion)
    feet = places[:, skeleton.chain("left_foot", "right_foot")].mean(axis=1)
    axis = _axis((places[:, _top(skeleton)] - feet).mean(axis=0))
    if axis[1] != 1.0:
        name = "XYZ"[int(np.argmax(np.abs(axis)))]
        notes.append(f"{'-' if axis.min() < 0 else ''}{name} is taken for up, as the head is that way from the feet")
    return axis


def _with_root_offset(
    motion: Motion, offset: Float[np.ndarray, "3"], up: Float[np.ndarray, "3"], notes: list[str]
) -> Motion:
    """Add the root's own offset where the file means it so.

    Nearly always the root's places are absolute and its offset repeats one of them. It is to be added if without it the
    feet are far from the floor and with it they come down to it.
    """
    legs = motion.skeleton.chain("left_foot", "right_foot", "left_toe", "right_toe")
    lowest = float((_some_frames(motion)[:, legs] @ up).min())
    leg, lifted = motion.skeleton.leg_length, lowest + float(offset @ up)
    if abs(lowest) < 0.5 * leg or abs(lifted) > 0.25 * leg:
        return motion
    notes.append("the root's offset is added to its places, which brings the feet to the floor")
    return replace(motion, root_positions=motion.root_positions + offset)


def _turned(motion: Motion, turn: Float[np.ndarray, "4"]) -> Motion:
    """Turn the whole recording in the world."""
    if turn[0] == 1.0:
        return motion
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat.multiply(turn, rotations[:, 0])
    return replace(motion, root_positions=quat.rotate(turn, motion.root_positions), rotations=rotations)


def _rest_turn(skeleton: Skeleton, notes: list[str]) -> Float[np.ndarray, "4"]:
    """Find the rotation that makes a rest pose stand upright and face +Z.

    Rest poses that are no pose (bones all along one axis, as in LaFAN1) have a pelvis nevertheless: up is then where
    the spine leaves it.
    """
    places = kinematics.rest(skeleton).positions
    left, right = places[skeleton.chain("left_thigh", "right_thigh")]
    feet = places[skeleton.chain("left_foot", "right_foot")].mean(axis=0)
    top = places[_top(skeleton)]
    stands = float(top @ feet) <= 0
    trunk = [skeleton.roles[role] for role in ("spine", "spine1", "chest", "neck", "head") if role in skeleton.roles]
    spine = next((places[joint] for joint in trunk if places[joint].any()), -feet)
    turn = quat.between(_axis(top - feet if stands else spine), _UP)
    across = quat.rotate(turn, left - right)
    if np.hypot(across[0], across[2]) < 1e-3 * skeleton.leg_length:
        notes.append("the rest pose does not tell where forward is: its hip joints are not side by side")
        return turn
    heading = np.arctan2(-across[2], across[0])
    square = np.round(heading / (np.pi / 2)) * (np.pi / 2)
    turn = quat.multiply(quat.about_y(-(square if abs(heading - square) < NEAR_AXIS else heading)), turn)
    toes = places[skeleton.chain("left_toe", "right_toe")].mean(axis=0) - feet
    if stands and quat.rotate(turn, toes)[2] < -0.5 * np.linalg.norm(toes):
        notes.append("the toes point backwards at rest; are left and right changed over?")
    if abs(turn[0]) > 1.0 - 1e-12:
        return quat.IDENTITY
    notes.append("the rest pose is turned to stand upright and face +Z")
    return turn


def _skeleton_rested(skeleton: Skeleton, turn: Float[np.ndarray, "4"]) -> Skeleton:
    offsets, ends = quat.rotate(turn, skeleton.offsets), quat.rotate(turn, skeleton.end_offsets)
    return replace(skeleton, offsets=offsets, end_offsets=ends)


def _rested(motion: Motion, turn: Float[np.ndarray, "4"]) -> Motion:
    """Give the skeleton another rest pose, turned, and keep its movement."""
    if turn[0] == 1.0:
        return motion
    rotations = quat.multiply(motion.rotations, quat.inverse(turn))
    rotations[:, 1:] = quat.multiply(turn, rotations[:, 1:])
    return replace(motion, skeleton=_skeleton_rested(motion.skeleton, turn), rotations=rotations)


def check_speed(motion: Motion, before: str = "", dropped: int = 0) -> None:
    """Refuse a root that moves as no person's does.

    Parameters
    ----------
    motion
        In metres.
    before, dropped
        What the message begins with, and how many frames of the recording come before the first of the motion.

    Raises
    ------
    MotionError
        It is faster than ``LARGEST_SPEED``; the frame is named.
    """
    speeds = np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=-1) * motion.frame_rate
    fast = np.flatnonzero(speeds > LARGEST_SPEED)
    if len(fast):
        raise MotionError(
            f"{before}the root jumps at frame {fast[0] + 1 + dropped}: {speeds[fast[0]]:.1f} m/s, where a person does "
            f"{LARGEST_SPEED:g} at most; the recording is broken there, or its unit or frame rate is another"
        )
