"""How the joints of one skeleton stand when it takes the rest pose of another: by roles, from the hips outwards.

Rest poses differ: arms out, or half down; legs straight down, or apart. A joint of a limb is turned so that its bone
points as the other's does, which takes along what hangs from it. The trunk, and what else has no bone to compare, keeps
to its parent. Feet that stand flat in both rest poses are flat in both again, however high their ankles are.

Rest poses that are none, as all bones along one axis, have nothing that stands; then trunk and feet point like the
other's too. How such a body is twisted about its bones in a pose its file does not tell.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES
from stridecast.model.motion import Motion
from stridecast.model.skeleton import ARMS, LEGS, TRUNK, Skeleton

Array = np.ndarray

UPRIGHT = np.cos(np.radians(40))
"""Legs that stand point down at least so far (cosine)."""

SPLAYED = np.radians(12)
"""Legs further apart than this carry soles tilted as they are, as in the skeletons of CMU; else soles are flat."""

_LIMBS = {
    f"{side}_{inner}": f"{side}_{outer}"
    for side in SIDES
    for limb in (LEGS[:3], ARMS[1:])
    for inner, outer in pairwise(limb)
}
_FURTHER = {
    **{"spine": "chest", "spine1": "chest", "chest": "neck", "neck": "head"},
    **{f"{side}_{inner}": f"{side}_{outer}" for side in SIDES for inner, outer in (("foot", "toe"), ARMS[:2])},
}
"""Further bones that are compared where a rest pose is no pose."""

_GIRDLES = {"hips": ("thigh", *TRUNK[1:]), "chest": ("shoulder", "neck", "head")}
"""Where limbs hang from the trunk: which, and what of the trunk lies beyond."""


def alignment(skeleton: Skeleton, model: Skeleton) -> Float[Array, "joints 4"]:
    """World rotation of each joint of ``skeleton`` when it takes the rest pose of ``model``.

    A joint takes the world rotation that the one of its role has in a motion of ``model``, times this.

    Raises
    ------
    SkeletonError
        A joint of hips or legs is missing.
    """
    skeleton.require_roles()
    model.require_roles()
    standing = stands(skeleton) and stands(model)
    known = {joint: role for role, joint in skeleton.roles.items() if role in model.roles}
    out = np.tile(quat.IDENTITY, (skeleton.joints, 1))
    for joint in range(skeleton.joints):
        if joint > 0:
            out[joint] = out[skeleton.parents[joint]]
        if joint in known:
            make = _standing if standing else _lying
            out[joint] = make(skeleton, model, known[joint], out[joint])
    return out


def _standing(skeleton: Skeleton, model: Skeleton, role: str, above: Float[Array, "4"]) -> Float[Array, "4"]:
    """Rotation of a joint where both rest poses stand; ``above`` is that of its parent."""
    side, _, part = role.partition("_")
    if part == "foot":
        return _flat_foot(skeleton, model, side)
    if part == "shoulder" or role in TRUNK:
        return quat.IDENTITY
    return _pointed(_bones(skeleton, model, role, _LIMBS.get(role)), above)


def _lying(skeleton: Skeleton, model: Skeleton, role: str, above: Float[Array, "4"]) -> Float[Array, "4"]:
    """The same where a rest pose is none."""
    girdle = _girdle(skeleton, model, role)
    if girdle is not None:
        return girdle
    bones = _bones(skeleton, model, role, _LIMBS.get(role) or _FURTHER.get(role))
    return _pointed(bones or _ends(skeleton, model, role), above)


def _pointed(bones: tuple[Array, Array] | None, turn: Float[Array, "4"]) -> Float[Array, "4"]:
    """``turn``, and what more it takes to make the first bone point as the second."""
    if bones is None or not (bones[0].any() and bones[1].any()):
        return turn
    return np.asarray(quat.multiply(quat.between(quat.rotate(turn, bones[0]), bones[1]), turn))


def aligned(skeleton: Skeleton, turns: Float[Array, "joints 4"]) -> Skeleton:
    """The same body, posed by the world rotations ``turns``, as a skeleton whose rest pose that is."""
    above = turns[np.maximum(skeleton.parents, 0)]
    return replace(
        skeleton,
        offsets=quat.rotate(above, skeleton.offsets),
        end_offsets=quat.rotate(turns[skeleton.end_joints], skeleton.end_offsets),
    )


def unaligned(motion: Motion, skeleton: Skeleton, turns: Float[Array, "joints 4"]) -> Motion:
    """The same movement of the body as it was before it was ``aligned``."""
    world = quat.multiply(kinematics.pose(motion).rotations, turns)
    rotations = quat.continuous(quat.normalize(kinematics.local(skeleton, world)))
    return replace(motion, skeleton=skeleton, rotations=rotations)


def stands(skeleton: Skeleton) -> bool:
    """Whether the rest pose is that of somebody who stands: legs down, toes ahead, head up."""
    at = kinematics.rest(skeleton).positions
    for side in SIDES:
        hip, knee, ankle, toe = at[skeleton.chain(*(f"{side}_{part}" for part in LEGS))]
        for inner, outer in ((hip, knee), (knee, ankle)):
            if (inner - outer)[1] < UPRIGHT * np.linalg.norm(outer - inner):
                return False
        if (toe - ankle)[2] <= abs((toe - ankle)[0]) or toe[1] > ankle[1]:
            return False
    return "head" not in skeleton.roles or bool(at[skeleton.joint("head"), 1] > 0)


def _bones(skeleton: Skeleton, model: Skeleton, role: str, after: str | None) -> tuple[Array, Array] | None:
    """From one joint to another in the rest poses of both, where both have them."""
    if after is None or not (after in skeleton.roles and after in model.roles):
        return None
    places = [(body, kinematics.rest(body).positions) for body in (skeleton, model)]
    mine, yours = (at[body.joint(after)] - at[body.joint(role)] for body, at in places)
    return mine, yours


def _ends(skeleton: Skeleton, model: Skeleton, role: str) -> tuple[Array, Array] | None:
    """Where the last bones of a role end in both, from their joints; nothing where one has none."""
    found = [body.end_offsets[body.end_joints == body.roles[role]] for body in (skeleton, model)]
    return (found[0][0], found[1][0]) if len(found[0]) and len(found[1]) else None


def _girdle(skeleton: Skeleton, model: Skeleton, hub: str) -> Float[Array, "4"] | None:
    """Rotation of hips or chest that brings both limbs, and the trunk beyond, to where the model has them."""
    if hub not in _GIRDLES:
        return None
    limb, *beyond = _GIRDLES[hub]
    roles = skeleton.roles.keys() & model.roles.keys()
    further = next((role for role in beyond if role in roles), None)
    across = _bones(skeleton, model, f"left_{limb}", f"right_{limb}") if f"left_{limb}" in roles else None
    up = _bones(skeleton, model, hub, further)
    if across is None or up is None or not all(vector.any() for vector in (*across, *up)):
        return None
    turn = quat.between(*across)
    axis = across[1] / np.linalg.norm(across[1])
    square = [way - (way @ axis) * axis for way in (quat.rotate(turn, up[0]), up[1])]
    return np.asarray(quat.multiply(quat.between(*square), turn))


def _flat_foot(skeleton: Skeleton, model: Skeleton, side: str) -> Float[Array, "4"]:
    """Rotation of a foot that is flat, and points as the model's does, when that has its foot as in its rest pose."""
    flats = [flattening(body, side) for body in (skeleton, model)]
    headings = []
    for body, flat in zip((skeleton, model), flats, strict=True):
        at = kinematics.rest(body).positions
        foot, toe = at[body.chain(f"{side}_foot", f"{side}_toe")]
        headings.append(float(ground.heading(ground.project(quat.rotate(flat, toe - foot)))))
    turned = quat.multiply(quat.about_y(headings[1] - headings[0]), flats[0])
    return quat.multiply(quat.inverse(flats[1]), turned)


def flattening(skeleton: Skeleton, side: str) -> Float[Array, "4"]:
    """World rotation that makes a foot of the rest pose flat: the leg's about the axis ahead, if legs are splayed."""
    at = kinematics.rest(skeleton).positions
    hip, ankle = at[skeleton.chain(f"{side}_thigh", f"{side}_foot")]
    apart = np.arctan2((ankle - hip)[0], -(ankle - hip)[1])
    return quat.exp(np.array([0.0, 0.0, -apart if abs(apart) > SPLAYED else 0.0]))
