"""Rigs for tests: the movement of one body as other people's files have it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bodies import humanoid
from stridecast.body import kinematics
from stridecast.body.rig import RawRecording
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion

PARTS = ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand")
"""Limbs of ``bodies.humanoid`` in the order in which ``FAMILIES`` names them."""

TRUNK = ("Hips", "Spine", "Spine1", "Chest", "Neck", "Head")

FAMILIES: Mapping[str, tuple[str, str]] = {
    # trunk, then the limbs of the left with {} for the side
    "cgspeed": (
        "Hips LowerBack Spine Spine1 Neck Head",
        "{Left}UpLeg {Left}Leg {Left}Foot {Left}ToeBase {Left}Shoulder {Left}Arm {Left}ForeArm {Left}Hand",
    ),
    "cgspeed for 3dsMax": (
        "Hips lowerback Chest Chest2 Neck Head",
        "{Left}Hip {Left}Knee {Left}Ankle {Left}Toe {Left}Collar {Left}Shoulder {Left}Elbow {Left}Wrist",
    ),
    "ASF": (
        "root lowerback upperback thorax lowerneck head",
        "{l}femur {l}tibia {l}foot {l}toes {l}clavicle {l}humerus {l}radius {l}wrist",
    ),
    "Mixamo": (
        "mixamorig:Hips mixamorig:Spine mixamorig:Spine1 mixamorig:Spine2 mixamorig:Neck mixamorig:Head",
        "mixamorig:{Left}UpLeg mixamorig:{Left}Leg mixamorig:{Left}Foot mixamorig:{Left}ToeBase "
        "mixamorig:{Left}Shoulder mixamorig:{Left}Arm mixamorig:{Left}ForeArm mixamorig:{Left}Hand",
    ),
    "LaFAN1": (
        "Hips Spine Spine1 Spine2 Neck Head",
        "{Left}UpLeg {Left}Leg {Left}Foot {Left}Toe {Left}Shoulder {Left}Arm {Left}ForeArm {Left}Hand",
    ),
    "Xsens": (
        "Pelvis L5 L3 T8 Neck Head",
        "{Left}UpperLeg {Left}LowerLeg {Left}Foot {Left}Toe {Left}Shoulder {Left}UpperArm {Left}ForeArm {Left}Hand",
    ),
    "Bandai-Namco": (
        "Hips Spine Spine1 Chest Neck Head",
        "UpperLeg_{L} LowerLeg_{L} Foot_{L} Toes_{L} Shoulder_{L} UpperArm_{L} LowerArm_{L} Hand_{L}",
    ),
    "DAZ": (
        "hip abdomen abdomen2 chest neck head",
        "{l}Thigh {l}Shin {l}Foot {l}Toe {l}Collar {l}Shldr {l}ForeArm {l}Hand",
    ),
    "DAZ Genesis 8": (
        "hip abdomenLower abdomenUpper chestUpper neckLower head",
        "{l}ThighBend {l}Shin {l}Foot {l}Toe {l}Collar {l}ShldrBend {l}ForearmBend {l}Hand",
    ),
    "classic": (
        "Hips Spine Spine1 Chest Neck Head",
        "{Left}UpLeg {Left}LowLeg {Left}Foot {Left}Toe {Left}Collar {Left}UpArm {Left}LowArm {Left}Hand",
    ),
    "SMPL": (
        "Pelvis Spine1 Spine2 Spine3 Neck Head",
        "{L}_Hip {L}_Knee {L}_Ankle {L}_Foot {L}_Collar {L}_Shoulder {L}_Elbow {L}_Wrist",
    ),
    "AMASS": (
        "pelvis spine1 spine2 spine3 neck head",
        "{left}_hip {left}_knee {left}_ankle {left}_foot {left}_collar {left}_shoulder {left}_elbow {left}_wrist",
    ),
    "3ds Max Biped": (
        "Bip01 Bip01_Spine Bip01_Spine1 Bip01_Spine2 Bip01_Neck Bip01_Head",
        "Bip01_{L}_Thigh Bip01_{L}_Calf Bip01_{L}_Foot Bip01_{L}_Toe0 "
        "Bip01_{L}_Clavicle Bip01_{L}_UpperArm Bip01_{L}_Forearm Bip01_{L}_Hand",
    ),
    "Unreal": (
        "pelvis spine_01 spine_02 spine_03 neck_01 head",
        "thigh_{l} calf_{l} foot_{l} ball_{l} clavicle_{l} upperarm_{l} lowerarm_{l} hand_{l}",
    ),
}
"""How makers of recordings call the joints that ``bodies.humanoid`` has."""


def renamed(family: str) -> tuple[str, ...]:
    """The joint names of ``bodies.humanoid`` in the words of a family; joints without a role keep theirs."""
    trunk, limbs = FAMILIES[family]
    words = dict(zip(TRUNK, trunk.split(), strict=True))
    for side in ("Left", "Right"):
        spelling = {"Left": side, "left": side.lower(), "L": side[0], "l": side[0].lower()}
        for part, word in zip(PARTS, limbs.split(), strict=True):
            words[side + part] = word.format_map(spelling)
    prefix = words["Spine"].rpartition(":")[0]
    return tuple(words.get(name, f"{prefix}:{name}" if prefix else name) for name in humanoid().names)


def recorded(motion: Motion, *, unit: float = 1.0, world: np.ndarray = quat.IDENTITY, family: str = "") -> RawRecording:
    """A motion as a file might hold it: in another unit, turned in the world, with other names."""
    skeleton = motion.skeleton
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat.multiply(world, rotations[:, 0])
    return RawRecording(
        names=renamed(family) if family else skeleton.names,
        parents=skeleton.parents,
        offsets=skeleton.offsets / unit,
        end_joints=skeleton.end_joints,
        end_offsets=skeleton.end_offsets / unit,
        root_positions=quat.rotate(world, motion.root_positions) / unit,
        rotations=rotations,
        frame_rate=motion.frame_rate,
    )


def reframed(motion: Motion, frames: np.ndarray) -> Motion:
    """The same movement of a skeleton whose joints have other axes, ``frames`` (joints, 4) in the old rest pose."""
    skeleton = motion.skeleton
    above = frames[np.maximum(skeleton.parents, 0)]
    hang = skeleton.end_joints
    other = replace(
        skeleton,
        offsets=quat.rotate(quat.inverse(above), skeleton.offsets),
        end_offsets=quat.rotate(quat.inverse(frames[hang]), skeleton.end_offsets),
    )
    turned = quat.multiply(kinematics.pose(motion).rotations, frames)
    return replace(motion, skeleton=other, rotations=kinematics.local(other, turned))


def along_x(motion: Motion, mirrored: bool = False) -> Motion:
    """The same movement of a skeleton whose bones all point along +X at zero rotation, as in LaFAN1.

    Mirrored, the bones of the right side point along -X, as in the Bandai-Namco dataset.
    """
    skeleton = motion.skeleton
    frames = np.tile(quat.IDENTITY, (skeleton.joints, 1))
    for joint in range(skeleton.joints):
        below = np.flatnonzero(skeleton.parents == joint)
        if len(below):
            way = -1.0 if mirrored and skeleton.names[joint].startswith("Right") else 1.0
            frames[joint] = quat.between(np.array([way, 0.0, 0.0]), skeleton.offsets[below[0]])
    return reframed(motion, frames)


def with_t_pose(motion: Motion, place: np.ndarray) -> Motion:
    """The motion after a first frame that stands in the rest pose at ``place``."""
    return replace(
        motion,
        root_positions=np.concatenate((place[None], motion.root_positions)),
        rotations=np.concatenate((np.tile(quat.IDENTITY, (1, motion.skeleton.joints, 1)), motion.rotations)),
    )
