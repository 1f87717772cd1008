"""How heavy each part of the body is, and where its centre of mass is.

Figures are the means of men and women in P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia
parameters", Journal of Biomechanics 29(9), 1996, table 4.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.model.skeleton import ARMS, Skeleton


class Limb(NamedTuple):
    """A part of the body between two joints.

    ``mass`` is its share of the body (of one side, where there are two), ``along`` the place of its centre from the
    first joint (0) to the second (1).
    """

    mass: float
    first: str
    second: str
    along: float

    def of(self, side: str) -> Limb:
        """Return the same part of the ``left`` or ``right`` side."""
        return self._replace(first=f"{side}_{self.first}", second=f"{side}_{self.second}")


HEAD = Limb(0.0681, "neck", "head", 1.0)
"""Head and neck; their centre is halfway from the seventh neck vertebra to the crown, about where the head joint is."""

SIDES = (
    Limb(0.1447, "thigh", "shin", 0.385),
    Limb(0.0457, "shin", "foot", 0.444),
    Limb(0.0133, "foot", "toe", 0.4),  # 42 % of heel to toe tip; the ankle stands at about 22 %, the toe joint at 72 %
    Limb(0.0263, "upper_arm", "forearm", 0.576),
    Limb(0.0150, "forearm", "hand", 0.457),
    Limb(0.00585, "hand", "hand", 0.0),  # a palm's breadth beyond the wrist: less than a millimetre of the whole
)
"""The parts of one leg and one arm."""

TRUNK_MASSES = (0.1182, 0.1549, 0.15705)
"""Lower, middle and upper part of the trunk."""

TRUNK_PLACES = (0.122, 0.458, 0.805)
"""Their centres on the line from between the hip joints (0) to the seventh neck vertebra (1)."""

_SHOULDER_PLACE = 0.83  # of the middle between the shoulder joints, on the same line

# who carries the mass of a part that the skeleton lacks
_CARRIERS = {"head": "neck", "neck": "chest", "chest": "spine1", "spine1": "spine", "spine": "hips"} | {
    outer: inner
    for side in ("left", "right")
    for inner, outer in pairwise(("chest", *(f"{side}_{part}" for part in ARMS)))
}


def joint_weights(skeleton: Skeleton) -> Float[np.ndarray, "joints"]:
    """Share of each joint in the centre of mass, which is the weighted sum of joint positions.

    A part's mass is split between the joints at its two ends. What hangs from a joint that the skeleton lacks is
    carried by the nearest one towards the hips, so that the shares always add up to 1.

    Raises
    ------
    SkeletonError
        The skeleton has no hips or lacks a joint of the legs.
    """
    skeleton.require_roles()
    weights = np.asarray(TRUNK_MASSES) @ _trunk_points(skeleton)
    limbs = [HEAD, *(limb.of(side) for side in ("left", "right") for limb in SIDES)]
    for limb in limbs:
        weights[_carrier(skeleton, limb.first)] += limb.mass * (1.0 - limb.along)
        weights[_carrier(skeleton, limb.second)] += limb.mass * limb.along
    return weights / weights.sum()


def center_of_mass(skeleton: Skeleton, world: kinematics.World) -> Float[np.ndarray, "*shape 3"]:
    """Centre of mass of the posed body, metres, in the world.

    Parameters
    ----------
    skeleton
        The body; see ``joint_weights`` for the roles it needs.
    world
        Its pose, of any leading shape.
    """
    return joint_weights(skeleton) @ world.positions


def _carrier(skeleton: Skeleton, role: str) -> int:
    """Joint of a role, or the one that carries its mass."""
    while role not in skeleton.roles and role in _CARRIERS:
        role = _CARRIERS[role]
    return skeleton.joint(role)


def _trunk_points(skeleton: Skeleton) -> Float[np.ndarray, "parts joints"]:
    """Weights of joints whose sums are the centres of the trunk's parts: places on a line up the spine at rest."""

    def middle(*roles: str) -> Float[np.ndarray, "joints"]:
        return np.eye(skeleton.joints)[skeleton.chain(*roles)].mean(axis=0)

    line = [middle("left_thigh", "right_thigh")]
    line += [middle(role) for role in ("spine", "spine1", "chest") if role in skeleton.roles]
    reach = 1.0
    if "neck" in skeleton.roles:
        line.append(middle("neck"))
    elif {"left_upper_arm", "right_upper_arm"} <= skeleton.roles.keys():
        line.append(middle("left_upper_arm", "right_upper_arm"))
        reach = _SHOULDER_PLACE
    points = np.stack(line)
    steps = np.linalg.norm(np.diff(points @ kinematics.rest(skeleton).positions, axis=0), axis=-1)
    lengths = np.concatenate(([0.0], np.cumsum(steps)))
    places = np.asarray(TRUNK_PLACES) / reach * lengths[-1]
    return np.stack([np.interp(places, lengths, share) for share in points.T], axis=-1)
