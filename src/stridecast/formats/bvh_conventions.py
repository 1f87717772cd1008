"""What other programs expect of a BVH file, and a motion brought into that form.

BVH says nothing of units, of which axis is up, or of what a root's OFFSET means; programs have settled on ways of their
own. Blender's importer (``io_anim_bvh``) takes Y for up and a unit for a metre, and the OFFSETs, the root's too, for
the rest pose of its armature; an order ZYX becomes its usual Euler mode XYZ. MotionBuilder works in centimetres, wants
the body in a T-stance facing +Z to characterize it, by custom in the first frame (as in cgspeed's release of the CMU
recordings), and turns joints about X first, then Y, then Z, which a BVH writes ZYX. Unreal has no reader of its own;
plugins and FBX take centimetres, and motion over the ground comes from a joint on the floor called ``root``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from stridecast.body import kinematics
from stridecast.body.rig import RawRecording
from stridecast.errors import InputError, SkeletonError
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

GROUND_JOINT = "root"
"""Name of the joint on the floor."""

PELVIS = "pelvis"
"""Name of hips that are called ``root`` themselves where there is a joint on the floor."""

SWAY = 0.3
"""The joint on the floor goes without the sway of the hips: smoothed over this time, seconds."""

ROOTS = ("zero", "standing", "ground")

_Z_UP = quat.exp(np.array([0.5 * np.pi, 0.0, 0.0]))


@dataclass(frozen=True, kw_only=True)
class BvhConvention:
    """How a BVH is written.

    Parameters
    ----------
    order
        Order of the rotation channels, as ``ZYX``: the last one turns first.
    scale
        Metres per unit.
    up
        ``Y``, facing +Z, or ``Z``, facing -Y.
    root
        The root's OFFSET: ``zero``; ``standing``, where it is when the rest pose stands on the floor; or ``ground``: a
        joint ``root`` on the floor below the hips, which goes and turns as the body does, and above it the hips,
        standing.
    rest_frame
        Whether the first frame is the rest pose, standing at the origin; the motion begins with the second.

    Raises
    ------
    InputError
        An order, scale, axis or root that is none.
    """

    order: str = "ZYX"
    scale: float = 1.0
    up: str = "Y"
    root: str = "zero"
    rest_frame: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", self.order.upper())
        object.__setattr__(self, "up", self.up.upper())
        if sorted(self.order) != ["X", "Y", "Z"]:
            raise InputError(f"the order of rotations must have X, Y and Z once each, not {self.order!r}")
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise InputError(f"the scale must be a positive number of metres per unit, not {self.scale}")
        if self.up not in ("Y", "Z"):
            raise InputError(f"the axis that points up in a BVH is Y or Z, not {self.up!r}")
        if self.root not in ROOTS:
            raise InputError(f"the root of a BVH is {', '.join(ROOTS[:-1])} or {ROOTS[-1]}, not {self.root!r}")


BVH_CONVENTIONS: Mapping[str, BvhConvention] = {
    "plain": BvhConvention(),
    "blender": BvhConvention(root="standing"),
    "motionbuilder": BvhConvention(scale=0.01, root="standing", rest_frame=True),
    "unreal": BvhConvention(scale=0.01, root="ground"),
}
"""What programs expect."""


def bvh_convention(
    convention: str | BvhConvention = "plain",
    *,
    order: str | None = None,
    scale: float | None = None,
    up: str | None = None,
    root: str | None = None,
    rest_frame: bool | None = None,
) -> BvhConvention:
    """A convention by its name, with some things otherwise.

    Raises
    ------
    InputError
        There is none of that name; or as of ``BvhConvention``.
    """
    if isinstance(convention, str):
        if convention.lower() not in BVH_CONVENTIONS:
            raise InputError(f"there is no BVH convention {convention!r}; there are {', '.join(BVH_CONVENTIONS)}")
        convention = BVH_CONVENTIONS[convention.lower()]
    given = {"order": order, "scale": scale, "up": up, "root": root, "rest_frame": rest_frame}
    return replace(convention, **{name: value for name, value in given.items() if value is not None})  # type: ignore[arg-type]


def in_convention(motion: Motion, convention: BvhConvention) -> RawRecording:
    """A motion in the units, axes and joints of a convention.

    Raises
    ------
    SkeletonError
        There is to be a joint ``root``, and the skeleton has another one of that name.
    """
    skeleton = motion.skeleton
    offsets = skeleton.offsets.copy()
    if convention.root != "zero":
        offsets[0] = [0.0, standing_height(skeleton), 0.0]
    recording = RawRecording(
        names=skeleton.names,
        parents=skeleton.parents,
        offsets=offsets,
        end_joints=skeleton.end_joints,
        end_offsets=skeleton.end_offsets,
        root_positions=motion.root_positions,
        rotations=motion.rotations,
        frame_rate=motion.frame_rate,
        unit=convention.scale,
    )
    if convention.root == "ground":
        recording = _on_ground(recording, motion.frame_rate)
    if convention.rest_frame:
        recording = _after_rest(recording)
    return _in_axes(recording, convention)


def standing_height(skeleton: Skeleton) -> float:
    """Height of the root when the lowest point of the rest pose is on the floor, metres."""
    rest = kinematics.rest(skeleton)
    return -float(min(rest.positions[:, 1].min(), kinematics.ends(skeleton, rest)[:, 1].min(initial=0.0)))


def _on_ground(recording: RawRecording, rate: float) -> RawRecording:
    """Put a joint on the floor above the root, which moves as the body does but does not sway."""
    names = list(recording.names)
    if any(name == GROUND_JOINT for name in names[1:]) or (names[0] == GROUND_JOINT and PELVIS in names):
        raise SkeletonError(f"the joint on the floor is called {GROUND_JOINT!r}, and the skeleton has one of that name")
    if names[0] == GROUND_JOINT:
        names[0] = PELVIS
    turn = recording.rotations[:, 0]
    facing = ground.heading(ground.project(quat.rotate(turn, np.array([0.0, 0.0, 1.0]))))
    heading = _without_sway(np.unwrap(facing), rate)
    place = ground.lift(_without_sway(ground.project(recording.root_positions), rate))
    back = quat.about_y(-heading)
    hips = np.concatenate((quat.multiply(back, turn)[:, None], recording.rotations[:, 1:]), axis=1)
    return replace(
        recording,
        names=(GROUND_JOINT, *names),
        parents=np.concatenate(([-1], recording.parents + 1)),
        offsets=np.concatenate((np.zeros((1, 3)), recording.offsets)),
        end_joints=recording.end_joints + 1,
        root_positions=place,
        rotations=np.concatenate((quat.about_y(heading)[:, None], hips), axis=1),
        slides={1: quat.rotate(back, recording.root_positions - place)},
    )


def _without_sway(values: Float[Array, "frames *shape"], rate: float) -> Float[Array, "frames *shape"]:
    return np.asarray(gaussian_filter1d(values, SWAY * rate, axis=0, mode="nearest"))


def _after_rest(recording: RawRecording) -> RawRecording:
    """The motion after a first frame in the rest pose."""
    still = np.tile(quat.IDENTITY, (1, len(recording.names), 1))
    return replace(
        recording,
        root_positions=np.concatenate((recording.offsets[:1], recording.root_positions)),
        rotations=np.concatenate((still, recording.rotations)),
        slides={
            joint: np.concatenate((recording.offsets[joint : joint + 1], places))
            for joint, places in recording.slides.items()
        },
    )


def _in_axes(recording: RawRecording, convention: BvhConvention) -> RawRecording:
    """In the convention's units, and with its axis up."""
    turn, unit = (_Z_UP if convention.up == "Z" else quat.IDENTITY), convention.scale

    def vectors(v: Float[Array, "*shape 3"]) -> Float[Array, "*shape 3"]:
        return (quat.rotate(turn, v) if convention.up == "Z" else v) / unit

    rotations = recording.rotations
    if convention.up == "Z":
        rotations = quat.multiply(quat.multiply(turn, rotations), quat.inverse(turn))
    return replace(
        recording,
        offsets=vectors(recording.offsets),
        end_offsets=vectors(recording.end_offsets),
        root_positions=vectors(recording.root_positions),
        rotations=rotations,
        slides={joint: vectors(places) for joint, places in recording.slides.items()},
    )
