"""Characters of other people for tests: skeletons as their files have them, with names, proportions and rest poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from bodies import humanoid
from rigs import along_x, renamed
from stridecast.body import kinematics
from stridecast.formats.bvh import write_bvh
from stridecast.formats.recordings import load_skeleton
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Turns = Mapping[str, tuple[float, float, float]]

A_POSE: Turns = {"left_upper_arm": (0.0, 0.0, -0.8), "right_upper_arm": (0.0, 0.0, 0.8)}
"""Arms half down, in rotation vectors of joints."""


def posed_at_rest(skeleton: Skeleton, turns: Turns) -> Skeleton:
    """The same body whose rest pose is another: joints turned there, all frames still those of the world."""
    rotations = np.tile(quat.IDENTITY, (skeleton.joints, 1))
    for role, vector in turns.items():
        rotations[skeleton.joint(role)] = quat.exp(np.array(vector))
    world = kinematics.forward(skeleton, np.zeros(3), rotations)
    offsets = world.positions - world.positions[np.maximum(skeleton.parents, 0)]
    ends = quat.rotate(world.rotations[skeleton.end_joints], skeleton.end_offsets)
    return replace(skeleton, offsets=offsets, end_offsets=ends)


def built(legs: float = 1.0, feet: float = 1.0, arms: float = 1.0, hips: float = 1.0, ankle: float = 1.0) -> Skeleton:
    """The humanoid with limbs of other lengths."""
    body = humanoid()
    offsets, ends = body.offsets.copy(), body.end_offsets.copy()
    for side in ("left", "right"):
        thigh, shin, foot, toe = body.chain(*(f"{side}_{part}" for part in ("thigh", "shin", "foot", "toe")))
        offsets[thigh, 0] *= hips
        offsets[[shin, foot]] *= legs
        offsets[toe] *= [1.0, ankle, feet]
        ends[body.end_joints == toe] *= feet
        offsets[body.chain(f"{side}_forearm", f"{side}_hand")] *= arms
    return replace(body, offsets=offsets, end_offsets=ends)


def with_fingers(skeleton: Skeleton) -> Skeleton:
    """Two joints more in each hand."""
    names, parents, offsets = list(skeleton.names), skeleton.parents.tolist(), skeleton.offsets.tolist()
    at = kinematics.rest(skeleton).positions
    for side in ("left", "right"):
        elbow, hand = skeleton.chain(f"{side}_forearm", f"{side}_hand")
        way = (at[hand] - at[elbow]) / np.linalg.norm(at[hand] - at[elbow])
        for k, parent in enumerate((hand, len(names))):
            names.append(f"{side.title()}HandIndex{k + 1}")
            parents.append(parent)
            offsets.append((0.08 * way / (k + 1)).tolist())
    return replace(skeleton, names=tuple(names), parents=np.array(parents), offsets=np.array(offsets))


def with_twist_bones() -> Skeleton:
    """The humanoid with a bone in the middle of each thigh and shin that no role knows."""
    body = humanoid()
    names, parents, offsets, roles = list(body.names), list(body.parents), list(body.offsets), dict(body.roles)
    rows = []
    for joint, name in enumerate(names):
        limb = next((r for r, j in roles.items() if j == joint), "")
        if limb.endswith(("_shin", "_foot")):
            above = names[parents[joint]]
            rows += [(f"{above}Twist", above, offsets[joint] / 2), (name, f"{above}Twist", offsets[joint] / 2)]
        else:
            rows.append((name, names[parents[joint]] if joint else "", offsets[joint]))
    order = [name for name, _, _ in rows]
    return Skeleton(
        names=tuple(order),
        parents=np.array([order.index(above) if above else -1 for _, above, _ in rows]),
        offsets=np.array([offset for _, _, offset in rows]),
        roles={role: order.index(names[joint]) for role, joint in roles.items()},
    )


def written(folder: Path, motion: Motion, scale: float = 0.01) -> Skeleton:
    """A skeleton as it comes back from a BVH file."""
    path = folder / "character.bvh"
    write_bvh(path, motion, convention="motionbuilder", scale=scale)
    return load_skeleton(path, scale=scale)


def still(skeleton: Skeleton) -> Motion:
    """Two frames of the rest pose."""
    return Motion(
        skeleton=skeleton,
        frame_rate=30.0,
        root_positions=np.tile([0.0, 1.0, 0.0], (2, 1)),
        rotations=np.tile(quat.IDENTITY, (2, skeleton.joints, 1)),
    )


def mixamo_like(folder: Path, legs: float = 1.12) -> Skeleton:
    """Names of Mixamo, arms half down, fingers, long legs and arms, wide hips, low ankles."""
    body = built(legs=legs, feet=1.15, arms=1.1, hips=1.25, ankle=1.3)
    body = posed_at_rest(replace(body, names=renamed("Mixamo")), A_POSE)
    return written(folder, still(with_fingers(body)))


def bandai_like(folder: Path, legs: float = 0.88) -> Skeleton:
    """Names of Bandai-Namco, bones along +X at rest, on the right -X; short legs, narrow hips, high ankles."""
    body = built(legs=legs, feet=0.85, arms=0.9, hips=0.85, ankle=1.4)
    motion = along_x(still(replace(body, names=renamed("Bandai-Namco"))), mirrored=True)
    return written(folder, motion)
