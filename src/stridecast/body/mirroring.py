"""Left and right changed over: the same walk by the same body, as a mirror shows it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from stridecast.body import kinematics
from stridecast.body.legs import reach
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import ARMS, LEGS, Skeleton

_VECTOR = np.array([-1.0, 1.0, 1.0])  # a place, mirrored across the plane x = 0
_ROTATION = np.array([1.0, 1.0, -1.0, -1.0])  # a rotation ``w x y z``, mirrored across the same plane

_SIDES = (
    re.compile(r"left|right", re.IGNORECASE),  # LeftFoot, foot_right
    re.compile(r"(?<![A-Za-z0-9])[lr](?![A-Za-z0-9])", re.IGNORECASE),  # Foot_L, foot.r, Bip01 L Foot
    re.compile(r"(?<![A-Za-z0-9])[lr](?=[A-Za-z])", re.IGNORECASE),  # lfoot, RThumb
    re.compile(r"(?<=[a-z0-9])[LR](?![A-Za-z0-9])"),  # FootL
)
_OTHER = {"l": "r", "r": "l", "left": "right", "right": "left"}


def mirror(motion: Motion) -> Motion:
    """Mirror a motion across the plane ``x = 0``, on the skeleton it has.

    Every joint's bone points where its partner's did, mirrored, also when left and right differ in the rest pose; where
    they differ in length, places differ by as much. Mirroring twice gives the motion back.

    Parameters
    ----------
    motion
        Any motion; joints without a partner (see ``mirror_pairs``) mirror their own turn.

    Returns
    -------
    Motion
        The mirrored motion, its name followed by `` mirrored``.
    """
    skeleton = motion.skeleton
    pairs = mirror_pairs(skeleton)
    lean = _rest_difference(skeleton, pairs)
    reflected = kinematics.pose(motion).rotations[:, pairs] * _ROTATION
    turned = quat.multiply(reflected, lean)
    for joint in _one_sided(skeleton, pairs):
        own = motion.rotations[:, joint] * _ROTATION
        turned[:, joint] = quat.multiply(turned[:, skeleton.parents[joint]], own)
    return replace(
        motion,
        root_positions=motion.root_positions * _VECTOR,
        rotations=kinematics.local(skeleton, turned),
        name=f"{motion.name} mirrored".strip(),
    )


def mirror_planted(motion: Motion) -> Motion:
    """Mirror a motion as ``mirror`` does, then bend the legs so that each toe is where its partner's mirror image is.

    Legs of a real skeleton differ by a few millimetres, and so far a foot that stood still would slide once mirrored.

    Raises
    ------
    SkeletonError
        A joint of the legs is missing.
    """
    skeleton = motion.skeleton
    mirrored = mirror(motion)
    before, after = kinematics.pose(motion), kinematics.pose(mirrored)
    rotations = mirrored.rotations
    for side, other in (("left", "right"), ("right", "left")):
        foot, toe = skeleton.chain(f"{side}_foot", f"{side}_toe")
        toes = before.positions[:, skeleton.joint(f"{other}_toe")] * _VECTOR
        ankles = toes - quat.rotate(after.rotations[:, foot], skeleton.offsets[toe])
        rotations = reach(skeleton, mirrored.root_positions, rotations, side, ankles)
    return replace(mirrored, rotations=quat.continuous(quat.normalize(rotations)))


def mirror_pairs(skeleton: Skeleton) -> Int[np.ndarray, "joints"]:
    """Index of each joint's partner on the other side of the body; its own for joints in the middle or without one.

    Partners are found by role, then by name: ``LeftFoot`` and ``RightFoot``, ``lfoot`` and ``rfoot``, ``Foot_L`` and
    ``Foot_R``, ``LThumb`` and ``RThumb``, ``Bip01 L Foot`` and ``Bip01 R Foot``.
    """
    pairs = np.arange(skeleton.joints)
    for role, joint in skeleton.roles.items():
        if role.startswith("left_") and (other := role.replace("left_", "right_")) in skeleton.roles:
            partner = skeleton.roles[other]
            pairs[joint], pairs[partner] = partner, joint
    index = {name: joint for joint, name in enumerate(skeleton.names)}
    for name, joint in index.items():
        for other in _other_side(name):
            partner = index.get(other, joint)
            if pairs[joint] == joint and pairs[partner] == partner:
                pairs[joint], pairs[partner] = partner, joint
    return pairs


def _other_side(name: str) -> Iterator[str]:
    """Yield what a joint's partner may be called: every way to read a side in its name, turned round."""
    for side in _SIDES:
        for found in side.finditer(name):
            word = found.group()
            other = _OTHER[word.lower()]
            other = other.upper() if word.isupper() else other.capitalize() if word[0].isupper() else other
            yield name[: found.start()] + other + name[found.end() :]


def _rest_difference(skeleton: Skeleton, pairs: Int[np.ndarray, "joints"]) -> Float[np.ndarray, "joints 4"]:
    """Rotation that turns each joint's bone in the rest pose onto the mirror image of its partner's."""
    bones = np.stack([_bone(skeleton, joint) for joint in range(skeleton.joints)])
    lean = quat.between(bones, bones[pairs] * _VECTOR)
    # a bone of the middle that grows sideways has no mirror image on this skeleton
    sideways = (pairs == np.arange(skeleton.joints)) & (np.abs(bones[:, 0]) > 0.5 * np.linalg.norm(bones, axis=-1))
    lean[sideways] = quat.IDENTITY
    return lean


def _bone(skeleton: Skeleton, joint: int) -> Float[np.ndarray, "3"]:
    """Bone that a joint moves, in its own frame: the limb's next part, else the only one there is, else none (zero)."""
    for side in ("left", "right"):
        for limb in (LEGS, ARMS):
            chain = [skeleton.roles.get(f"{side}_{part}", -1) for part in limb]
            if joint in chain[:-1]:
                following = chain[chain.index(joint) + 1]
                if following >= 0 and skeleton.parents[following] == joint:
                    return skeleton.offsets[following]
    bones = np.concatenate(
        (skeleton.offsets[skeleton.parents == joint], skeleton.end_offsets[skeleton.end_joints == joint])
    )
    return bones[0] if len(bones) == 1 else np.zeros(3)


def _one_sided(skeleton: Skeleton, pairs: Int[np.ndarray, "joints"]) -> list[int]:
    """List joints without a partner that hang from one side of the body, parents first."""
    alone = pairs == np.arange(skeleton.joints)
    found = []
    for joint in range(1, skeleton.joints):
        parent = int(skeleton.parents[joint])
        if alone[joint] and (not alone[parent] or parent in found):
            found.append(joint)
    return found
