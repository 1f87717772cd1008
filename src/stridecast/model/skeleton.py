"""The skeleton: joints, their parents, their offsets, and what part of a body each of them is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from stridecast.errors import SkeletonError

LEGS = ("thigh", "shin", "foot", "toe")
"""The joints of a leg from the hip down; each role is ``left_`` or ``right_`` with one of these."""

ARMS = ("shoulder", "upper_arm", "forearm", "hand")
"""The joints of an arm from the breastbone out: clavicle, shoulder joint, elbow, wrist."""

TRUNK = ("hips", "spine", "spine1", "chest", "neck", "head")
"""The joints of the trunk from the root up; ``chest`` is the one the arms hang from."""

ROLES = TRUNK + tuple(f"{side}_{part}" for side in ("left", "right") for part in LEGS + ARMS)
"""Every role a joint can have."""

REQUIRED_ROLES = ("hips", *(f"{side}_{part}" for side in ("left", "right") for part in LEGS))
"""Roles without which there is no locomotion to learn."""

MOST_LISTED = 80
"""So many joints are listed where none is found for a role; control rigs have many hundreds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Skeleton:
    """A tree of joints in its rest pose: +Y up, facing +Z, metres.

    Parameters
    ----------
    names
        Joint names, the root first, parents before children.
    parents
        Index of each joint's parent, -1 for the root.
    offsets
        Place of each joint in its parent's frame, in metres; zero for the root.
    roles
        What part of the body a joint is, role to index (see ``ROLES``); other joints have none.
    end_joints, end_offsets
        Ends of the last bones (toe tips, crown, finger tips): the joint they hang from and their place in its frame.

    Raises
    ------
    SkeletonError
        Shapes that do not fit, joints before their parents, names twice, unknown roles, numbers that are not finite.
    """

    names: tuple[str, ...]
    parents: Int[np.ndarray, "joints"]
    offsets: Float[np.ndarray, "joints 3"]
    roles: Mapping[str, int] = field(default_factory=dict)
    end_joints: Int[np.ndarray, "ends"] = field(default_factory=lambda: np.zeros(0, np.int64))
    end_offsets: Float[np.ndarray, "ends 3"] = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        frozen = {
            "parents": np.array(self.parents, np.int64),
            "offsets": np.array(self.offsets, np.float64),
            "end_joints": np.array(self.end_joints, np.int64),
            "end_offsets": np.array(self.end_offsets, np.float64).reshape(-1, 3),
        }
        for name, array in frozen.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "roles", MappingProxyType(dict(self.roles)))
        self._check()

    def _check(self) -> None:
        count = len(self.names)
        if count == 0:
            raise SkeletonError("a skeleton needs at least one joint")
        if self.parents.shape != (count,) or self.offsets.shape != (count, 3):
            raise SkeletonError(
                f"{count} joint names need parents of shape ({count},) and offsets of shape ({count}, 3), "
                f"not {self.parents.shape} and {self.offsets.shape}"
            )
        if self.end_offsets.shape != (len(self.end_joints), 3):
            raise SkeletonError("end_joints and end_offsets differ in length")
        if ((self.end_joints < 0) | (self.end_joints >= count)).any():
            raise SkeletonError(f"end_joints must be joints of the skeleton, 0 to {count - 1}")
        if len(set(self.names)) != count:
            twice = sorted({name for name in self.names if self.names.count(name) > 1})
            raise SkeletonError(f"joint names must be unique; these stand twice: {', '.join(twice)}")
        if self.parents[0] != -1:
            raise SkeletonError(f"the first joint must be the root (parent -1), not a child of joint {self.parents[0]}")
        for joint in range(1, count):
            if not 0 <= self.parents[joint] < joint:
                raise SkeletonError(f"joint {self.names[joint]!r} must come after its parent")
        if not (np.isfinite(self.offsets).all() and np.isfinite(self.end_offsets).all()):
            raise SkeletonError("offsets must be finite numbers")
        for role, joint in self.roles.items():
            if role not in ROLES:
                raise SkeletonError(f"there is no role {role!r}; there are {', '.join(ROLES)}")
            if not 0 <= joint < count:
                raise SkeletonError(f"role {role!r} points at joint {joint} of {count}")

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "roles": dict(self.roles)}  # read-only views do not travel between processes

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, roles=MappingProxyType(state["roles"]))

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.names)

    def joint(self, role: str) -> int:
        """Index of the joint with a role.

        Raises
        ------
        SkeletonError
            No joint has it.
        """
        try:
            return self.roles[role]
        except KeyError:
            have = ", ".join(sorted(self.roles))
            raise SkeletonError(f"the skeleton has no joint for {role!r}; it has {have or 'no roles at all'}") from None

    def require_roles(self, roles: tuple[str, ...] = REQUIRED_ROLES) -> None:
        """Raise a ``SkeletonError`` that names every role in ``roles`` that no joint has."""
        missing = [role for role in roles if role not in self.roles]
        if missing:
            more = f" and {self.joints - MOST_LISTED} more" if self.joints > MOST_LISTED else ""
            raise SkeletonError(
                f"no joint found for {', '.join(missing)}; joints are {', '.join(self.names[:MOST_LISTED])}{more}. "
                "Name them in a mapping from role to joint"
            )

    def chain(self, *roles: str) -> list[int]:
        """Joint indices of several roles, in order."""
        return [self.joint(role) for role in roles]

    @property
    def leg_length(self) -> float:
        """Thigh plus shin, in metres, mean of both sides."""
        parts = [self.joint(f"{side}_{part}") for side in ("left", "right") for part in ("shin", "foot")]
        return float(np.linalg.norm(self.offsets[parts], axis=-1).sum() / 2)
