"""From places of joints to a skeleton and its rotations: a bone's frame from its two ends and the axis it bends about.

The skeleton is as long as the person's bones are in the median; then the legs are bent so that the ankles are where
they were seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.body.joint_centres import BodyPoints, across, bend_axis, unit
from stridecast.body.legs import reach
from stridecast.body.rig import RawRecording, body_of
from stridecast.geometry import quaternions as quat

Array = np.ndarray

TREE = (
    ("hips", ""),
    *((f"{side}_{part}", above) for side in ("left", "right") for part, above in (
        ("thigh", "hips"), ("shin", f"{side}_thigh"), ("foot", f"{side}_shin"), ("toe", f"{side}_foot"))),
    ("spine", "hips"),
    ("chest", "spine"),
    ("neck", "chest"),
    ("head", "neck"),
    *((f"{side}_{part}", above) for side in ("left", "right") for part, above in (
        ("shoulder", "chest"), ("upper_arm", f"{side}_shoulder"), ("forearm", f"{side}_upper_arm"),
        ("hand", f"{side}_forearm"))),
)  # fmt: skip
"""Joints by role and what they hang from."""

NAMES = {
    "hips": "Hips", "spine": "Spine", "chest": "Chest", "neck": "Neck", "head": "Head",
    **{f"{side}_{part}": side.capitalize() + name for side in ("left", "right") for part, name in (
        ("thigh", "UpLeg"), ("shin", "Leg"), ("foot", "Foot"), ("toe", "ToeBase"),
        ("shoulder", "Shoulder"), ("upper_arm", "Arm"), ("forearm", "ForeArm"), ("hand", "Hand"))},
}  # fmt: skip
"""What the joints are called."""

TOE_TIP, CROWN, FINGERS = 0.07, 0.19, 0.17
"""Lengths of the last bones, metres: no marker tells them."""

ENDS = (
    ("head", (0.0, CROWN, 0.0)),
    ("left_toe", (0.0, 0.0, TOE_TIP)),
    ("right_toe", (0.0, 0.0, TOE_TIP)),
    ("left_hand", (FINGERS, 0.0, 0.0)),
    ("right_hand", (-FINGERS, 0.0, 0.0)),
)
"""Ends of the last bones in the frames of their joints."""


def solve(body: BodyPoints, frame_rate: float) -> tuple[RawRecording, float]:
    """Fit a skeleton to a body and find its rotations.

    Parameters
    ----------
    body
        Places and directions, in metres, without gaps.
    frame_rate
        Frames a second.

    Returns
    -------
    recording
        In metres, its rest pose facing +Z with arms to the sides, in the world of ``body``.
    error
        How far its joints are from the given places, root of the mean square, metres.
    """
    roles = [role for role, above in TREE if role in body.centres and (not above or above in body.centres)]
    above = dict(TREE)
    parents = np.array([roles.index(above[role]) if above[role] else -1 for role in roles])
    world = _frames(body, roles)
    places = np.stack([body.centres[role] for role in roles], axis=1)
    offsets = np.zeros((len(roles), 3))
    for joint in range(1, len(roles)):
        parent = parents[joint]
        local = quat.rotate(quat.inverse(world[:, parent]), places[:, joint] - places[:, parent])
        offsets[joint] = np.median(local, axis=0)
    offsets = _even(offsets, roles)
    local = world.copy()
    local[:, 1:] = quat.multiply(quat.inverse(world[:, parents[1:]]), world[:, 1:])
    ends = [(role, end) for role, end in ENDS if role in roles]
    recording = RawRecording(
        names=tuple(NAMES[role] for role in roles),
        parents=parents,
        offsets=offsets,
        end_joints=np.array([roles.index(role) for role, _ in ends], np.int64),
        end_offsets=np.array([end for _, end in ends]).reshape(-1, 3),
        root_positions=places[:, 0],
        rotations=local,
        frame_rate=frame_rate,
        unit=1.0,
    )
    skeleton = body_of(recording, {role: joint for joint, role in enumerate(roles)})
    rotations = recording.rotations
    for side in ("left", "right"):
        rotations = reach(skeleton, recording.root_positions, rotations, side, body.centres[f"{side}_foot"])
    found = kinematics.forward(skeleton, recording.root_positions, rotations).positions
    error = float(np.sqrt(np.mean(np.sum((found - places) ** 2, axis=-1))))
    return replace(recording, rotations=quat.continuous(quat.normalize(rotations))), error


def _even(offsets: Float[Array, "joints 3"], roles: list[str]) -> Float[Array, "joints 3"]:
    """Left and right alike: what differs is where the markers are, more than the person."""
    out = offsets.copy()
    for joint, role in enumerate(roles):
        other = role.replace("left", "right", 1)
        if role.startswith("left") and other in roles:
            twin = roles.index(other)
            out[joint] = 0.5 * (offsets[joint] + offsets[twin] * [-1.0, 1.0, 1.0])
            out[twin] = out[joint] * [-1.0, 1.0, 1.0]
        elif not role.startswith(("left", "right")):
            out[joint, 0] = 0.0
    return out


def _frames(body: BodyPoints, roles: list[str]) -> Float[Array, "frames joints 4"]:
    """World rotations of all joints."""
    at, out = body.centres, {}
    out["hips"] = _upright(body)
    for side in ("left", "right"):
        hip, knee, ankle = (at[f"{side}_{part}"] for part in ("thigh", "shin", "foot"))
        axis = body.lefts.get(f"{side}_knee", body.lefts["pelvis"])
        out[f"{side}_thigh"] = _rotation(left=axis, up=hip - knee)
        out[f"{side}_shin"] = _rotation(left=axis, up=knee - ankle)
        sole = body.forwards[f"{side}_foot"]
        out[f"{side}_foot"] = _rotation(left=body.lefts.get(f"{side}_ankle", axis), forward=sole)
        out[f"{side}_toe"] = out[f"{side}_foot"]
    if "neck" in roles:
        left = body.lefts["chest"]
        out["spine"] = _rotation(left=unit(left + body.lefts["pelvis"]), up=at["chest"] - at["spine"])
        out["chest"] = _rotation(left=left, up=at["neck"] - at["chest"])
        out["neck"] = out["chest"]
    if "head" in roles:
        out["neck"] = _rotation(left=unit(body.lefts["head"] + body.lefts["chest"]), up=at["head"] - at["neck"])
        out["head"] = _rotation(left=body.lefts["head"], forward=body.forwards["head"])
    for side, way in (("left", 1.0), ("right", -1.0)):
        if f"{side}_hand" not in roles:
            continue
        shoulder, elbow, wrist = (at[f"{side}_{part}"] for part in ("upper_arm", "forearm", "hand"))
        ahead = body.forwards["chest"]
        out[f"{side}_shoulder"] = _sideways(way * (shoulder - at[f"{side}_shoulder"]), ahead)
        # bent elbows bring the hand ahead of the arm: the normal of the plane is the axis
        hanging = np.cross(unit(elbow - shoulder), ahead)
        axis = bend_axis(shoulder, elbow, wrist, hanging)
        out[f"{side}_upper_arm"] = _sideways(way * (elbow - shoulder), np.cross(axis, unit(elbow - shoulder)))
        out[f"{side}_forearm"] = _sideways(way * (wrist - elbow), np.cross(axis, unit(wrist - elbow)))
        out[f"{side}_hand"] = out[f"{side}_forearm"]
    return np.stack([quat.continuous(out[role]) for role in roles], axis=1)


def _upright(body: BodyPoints) -> Float[Array, "frames 4"]:
    """Rotation of the pelvis, upright in the median: how far its spines lie one above the other tells nothing."""
    left = body.lefts["pelvis"]
    raw = _rotation(left=left, forward=body.forwards["pelvis"])
    legs = body.centres["hips"] - 0.5 * (body.centres["left_foot"] + body.centres["right_foot"])
    up = unit(quat.rotate(quat.inverse(raw), across(np.broadcast_to(unit(legs.mean(axis=0)), left.shape), left)))
    tilt = float(np.median(np.arctan2(up[:, 2], up[:, 1])))
    return quat.multiply(raw, quat.exp(np.array([tilt, 0.0, 0.0])))


def _rotation(
    *, left: Float[Array, "frames 3"], up: Array | None = None, forward: Array | None = None
) -> Float[Array, "frames 4"]:
    """Rotation that turns +X near to ``left`` and +Y to ``up``, or +Z to ``forward``."""
    if up is not None:
        y = unit(up)
        x = across(left, y)
        z = np.cross(x, y)
    else:
        z = unit(np.asarray(forward))
        x = across(left, z)
        y = np.cross(z, x)
    return _of_axes(x, y, z)


def _sideways(along: Float[Array, "frames 3"], ahead: Float[Array, "frames 3"]) -> Float[Array, "frames 4"]:
    """Rotation that turns +X to ``along`` and +Z near to ``ahead``."""
    x = unit(along)
    z = across(ahead, x)
    return _of_axes(x, np.cross(z, x), z)


def _of_axes(x: Array, y: Array, z: Array) -> Float[Array, "frames 4"]:
    """Quaternions of rotation matrices with these columns (Shepperd 1978, the largest part first)."""
    m = np.stack((x, y, z), axis=-1)
    d = np.einsum("...ii->...i", m)
    trace = d.sum(axis=-1)
    four = np.stack((1 + trace, *(1 + 2 * d[..., i] - trace for i in range(3))), axis=-1)
    k = np.argmax(four, axis=-1)
    s = np.sqrt(np.maximum(np.take_along_axis(four, k[..., None], -1), 1e-12))[..., 0]
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    p, q, r = m[..., 1, 0] + m[..., 0, 1], m[..., 2, 0] + m[..., 0, 2], m[..., 2, 1] + m[..., 1, 2]
    rows = (
        np.stack((s * s, a, b, c), axis=-1),
        np.stack((a, s * s, p, q), axis=-1),
        np.stack((b, p, s * s, r), axis=-1),
        np.stack((c, q, r, s * s), axis=-1),
    )
    out = np.choose(k[..., None], rows)
    return quat.normalize(out)
