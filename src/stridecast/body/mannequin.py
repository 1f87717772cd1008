"""A mannequin around any skeleton: closed tubes along its bones, in its rest pose, whose weights blend at the joints.

Every part is there that the skeleton's roles tell of: a body without arms gets none, one without a spine a trunk that
is carried by the hips.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from stridecast.body import kinematics
from stridecast.body import mannequin_shape as shape
from stridecast.body.mannequin_shape import Detail, Tube
from stridecast.body.skinning import vertex_normals
from stridecast.errors import SkeletonError
from stridecast.geometry import quaternions as quat
from stridecast.model.mesh import INFLUENCES, SkinnedMesh
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

UP = np.array([0.0, 1.0, 0.0])
FRONT = np.array([0.0, 0.0, 1.0])
LEFT = np.array([1.0, 0.0, 0.0])

STATURE = 1.78
"""Of the body that the tables are made for, metres."""

BROADEST = 1.3
"""Hips and shoulders are this much broader at most, or narrower, than the legs' length would let one expect."""

TRUNK, NECK = 0.515, 0.145
"""From the hip joints to the shoulder joints and on to the head's joint where the skeleton does not tell, metres."""


SHORTEST = 0.02
"""Bones of arms and legs that are shorter have no flesh, metres."""

CROWN = 0.31
"""From the shoulder joints to the crown at least, metres."""


class _Part(NamedTuple):
    tube: Tube
    weights: Float[Array, "vertices joints"]


class _Body(NamedTuple):
    """What the parts are made from: the rest pose, the scale of the tables, how fine."""

    skeleton: Skeleton
    places: Float[Array, "joints 3"]
    scale: float
    detail: Detail

    def at(self, role: str) -> Float[Array, "3"] | None:
        """Place of the joint with a role, if there is one."""
        joint = self.skeleton.roles.get(role)
        return None if joint is None else self.places[joint]

    def carrier(self, *roles: str) -> int:
        """The first joint that there is of several roles, else the root."""
        return next((self.skeleton.roles[role] for role in roles if role in self.skeleton.roles), 0)

    def end(self, joint: int) -> Float[Array, "3"] | None:
        """End of the bone that begins at a joint, the farthest of several."""
        arms = self.skeleton.end_offsets[self.skeleton.end_joints == joint]
        arms = arms[np.linalg.norm(arms, axis=-1) > 1e-6] if len(arms) else arms
        return None if len(arms) == 0 else self.places[joint] + arms[np.argmax(np.linalg.norm(arms, axis=-1))]


def mannequin(skeleton: Skeleton, *, low: bool = False) -> SkinnedMesh:
    """Build a mannequin around a skeleton in its rest pose.

    Parameters
    ----------
    skeleton
        Whose roles tell what its joints are; facing +Z at rest.
    low
        A coarse one, of about 350 triangles, for crowds seen from afar; else about 6000.

    Returns
    -------
    SkinnedMesh
        Its bind pose is the rest pose, the root at the origin.

    Raises
    ------
    SkeletonError
        No joints for legs, trunk or arms: nothing tells where there is flesh.
    """
    places = kinematics.rest(skeleton).positions
    body = _Body(skeleton, places, _scale(skeleton, places), shape.LOW if low else shape.FULL)
    parts = [part for side in ("left", "right") for make in (_leg, _foot, _arm) for part in make(body, side)]
    if "hips" in skeleton.roles or "chest" in skeleton.roles:
        parts += _trunk(body)
    if not parts:
        raise SkeletonError("a mannequin needs joints with roles: hips, legs, arms, head")
    first = np.cumsum([0] + [len(part.tube.positions) for part in parts])
    positions = np.concatenate([part.tube.positions for part in parts])
    triangles = np.concatenate([part.tube.triangles + at for part, at in zip(parts, first[:-1], strict=True)])
    joints, weights = _strongest(np.concatenate([part.weights for part in parts]))
    return SkinnedMesh(
        positions=positions,
        normals=vertex_normals(positions, triangles),
        triangles=triangles,
        joints=joints,
        weights=weights,
        bind_positions=places,
        bind_rotations=np.tile(quat.IDENTITY, (skeleton.joints, 1)),
    )


def _scale(skeleton: Skeleton, places: Float[Array, "joints 3"]) -> float:
    """How large the tables' widths are on this body."""
    if all(f"{side}_{part}" in skeleton.roles for side in ("left", "right") for part in ("thigh", "shin", "foot")):
        leg = skeleton.leg_length
        if leg > 1e-6:
            return leg / shape.LEG
    tall = float(np.ptp(places[:, 1]))
    return tall / (STATURE - 0.2) if tall > 1e-6 else 1.0


def _trunk(body: _Body) -> list[_Part]:
    """Torso with the neck, and the head."""
    scale = body.scale
    roles = body.skeleton.roles
    hips = _middle(body, "thigh")
    low = body.places[body.carrier("hips")] - 0.04 * scale * UP if hips is None else hips
    shoulders = _middle(body, "upper_arm")
    head = body.at("head")
    up = _unit((head if head is not None else low + UP) - low, UP)
    if shoulders is None or (shoulders - low) @ up < 0.2 * scale:
        shoulders = low + TRUNK * scale * up if head is None else low + (head - low) * (TRUNK / (TRUNK + NECK))
    if head is None or (head - shoulders) @ up < 0.02 * scale:
        head = shoulders + NECK * scale * up
    top = body.carrier("head", "neck", "chest", "spine1", "spine", "hips")
    end = body.end(top) if top == roles.get("head") else None
    if end is None or (end - head) @ up < 0.1 * scale:
        end = head + 0.2 * scale * up
    crown = head + _unit(end - head, UP) * min(np.linalg.norm(end - head), 0.24 * scale)
    lift = max(CROWN * scale - float((crown - shoulders) @ up), 0.0) * up  # some files hang the head at the shoulders
    head, crown = head + lift, crown + lift
    table = shape.rows_at(shape.TORSO, body.detail.torso)
    t = table[:, 0]
    path = np.array([low, shoulders, head])
    centres = _along(path, t) + scale * table[:, 4:] * FRONT
    below, above = _breadth(body, "thigh", shape.HIP_HALF), _breadth(body, "upper_arm", shape.SHOULDER_HALF)
    across = np.interp(t, [0.1, 0.8, 1.05, 1.5], [below, above, above, 1.0])
    sizes = scale * table[:, 1:4] * np.stack((across, np.sqrt(across), np.sqrt(across)), axis=-1)
    frames = np.tile(LEFT, (len(t), 1)), np.tile(FRONT, (len(t), 1))
    torso = shape.tube(centres, *frames, sizes, t, body.detail.around_torso, square=2.25)

    chain = _chain(body.skeleton, top)
    heights = (body.places[chain] - low) @ up
    weights = _graded(body, (torso.positions - low) @ up, chain, heights, 0.06 * scale)
    for side in ("left", "right"):
        if f"{side}_shoulder" in roles and f"{side}_upper_arm" in roles:
            _shrug(body, side, torso, weights)

    return [_Part(torso, weights), _head(body, head, crown, top)]


def _head(body: _Body, neck: Float[Array, "3"], crown: Float[Array, "3"], joint: int) -> _Part:
    table = shape.rows_at(shape.HEAD, body.detail.head)
    scale, up = body.scale, _unit(crown - neck, UP)
    chin = crown - shape.HEAD_HEIGHT * scale * up
    front = _across(FRONT, up)
    centres = chin + table[:, :1] * (crown - chin) + scale * table[:, 4:] * front
    frames = np.tile(np.cross(up, front), (len(table), 1)), np.tile(front, (len(table), 1))
    tube = shape.tube(centres, *frames, scale * table[:, 1:4], table[:, 0], body.detail.around_head)
    positions = tube.positions + scale * shape.face(tube, body.detail.around_head)[:, None] * front
    return _Part(tube._replace(positions=positions), _all_of(body, len(tube.positions), joint))


def _leg(body: _Body, side: str) -> list[_Part]:
    path = [body.at(f"{side}_{part}") for part in ("thigh", "shin", "foot")]
    if any(place is None for place in path) or _folded(body, path):
        return []
    table = shape.rows_at(shape.LEG_TUBE, body.detail.leg)
    joints = _joints(body, (f"{side}_thigh", f"{side}_shin", f"{side}_foot"))
    out = LEFT if side == "left" else -LEFT
    return [_limb(body, np.array(path), FRONT, out, table, body.detail.around_leg, joints, (0.075, 0.055, 0.03))]


def _arm(body: _Body, side: str) -> list[_Part]:
    path = [body.at(f"{side}_{part}") for part in ("upper_arm", "forearm", "hand")]
    if path[0] is None or path[1] is None:
        return []
    shoulder, elbow = path[0], path[1]
    along = _unit(elbow - shoulder, -UP)
    wrist = path[2] if path[2] is not None else elbow + 0.25 * body.scale * along
    if _folded(body, [shoulder, elbow, wrist]):
        return []
    along = _unit(wrist - elbow, along)
    hand = body.carrier(f"{side}_hand", f"{side}_forearm")
    end = body.end(hand) if f"{side}_hand" in body.skeleton.roles else None
    reach = shape.HAND * body.scale
    if end is None or not 0.5 * reach < np.linalg.norm(end - wrist) < 1.5 * reach:
        end = wrist + reach * along
    thumb = _across(_thumbwards(body, hand, wrist), along)
    back = np.cross(thumb, along) * (1.0 if side == "left" else -1.0)
    table = shape.rows_at(shape.ARM_TUBE, body.detail.arm)
    joints = _joints(body, (f"{side}_upper_arm", f"{side}_forearm", f"{side}_hand"))
    arm = _limb(
        body, np.array([shoulder, elbow, wrist, end]), back, thumb, table, body.detail.around_arm, joints,
        (0.05, 0.045, 0.03), rigid=True,
    )  # fmt: skip
    if not len(body.detail.thumb):
        return [arm]
    ball = shape.rows_at(shape.THUMB, body.detail.thumb)
    root = wrist + 0.022 * body.scale * along + 0.014 * body.scale * thumb - 0.004 * body.scale * back
    tip = root + body.scale * (0.072 * along + 0.042 * thumb - 0.018 * back)
    way = _unit(tip - root, along)
    side_of = _across(thumb, way)
    frames = np.tile(side_of, (len(ball), 1)), np.tile(np.cross(way, side_of), (len(ball), 1))
    tube = shape.tube(
        root + ball[:, :1] * (tip - root), *frames, body.scale * ball[:, 1:4], ball[:, 0], body.detail.around_thumb
    )
    return [arm, _Part(tube, _all_of(body, len(tube.positions), hand))]


def _foot(body: _Body, side: str) -> list[_Part]:
    ankle, toe = body.at(f"{side}_foot"), body.at(f"{side}_toe")
    if ankle is None:
        return []
    scale = body.scale
    if toe is None:
        toe = ankle + scale * np.array([0.0, -0.055, 0.125])
    level = (toe - ankle) * (1.0, 0.0, 1.0)
    ahead = _unit(level, FRONT)
    length = max(float(np.linalg.norm(level)), 0.06 * scale)
    joint = body.skeleton.roles.get(f"{side}_toe")
    end = None if joint is None else body.end(joint)
    toes = shape.TOES * scale if end is None else float(np.clip((end - toe) @ ahead, 0.05 * scale, 0.11 * scale))
    sole = min(toe[1] - shape.SOLE * scale, ankle[1] - 0.05 * scale)
    tall = np.clip((ankle[1] - sole) / (0.061 * scale), 0.8, 1.4)
    table = shape.rows_at(shape.FOOT, body.detail.foot)
    t = table[:, 0]
    away = np.cross(UP, ahead) * (1.0 if side == "left" else -1.0)
    way = np.interp(t, [-1, 0, 1, 2], [-shape.HEEL * scale, 0.0, length, length + toes])
    top, bottom = scale * tall * table[:, 2], scale * table[:, 3]
    middle = 0.35 * top + 0.65 * bottom
    centres = ankle * (1, 0, 1) + sole * UP + way[:, None] * ahead + middle[:, None] * UP
    centres = centres + scale * table[:, 4:] * away
    sizes = np.stack((scale * table[:, 1], top - middle, middle - bottom), axis=-1)
    frames = np.tile(away, (len(t), 1)), np.tile(UP, (len(t), 1))
    tube = shape.tube(centres, *frames, sizes, t, body.detail.around_foot, square=2.5)
    foot = body.carrier(f"{side}_foot")
    chain = [foot] if joint is None else [foot, joint]
    weights = _graded(body, np.interp(tube.places, t, way), chain, np.array([0.0, length])[: len(chain)], 0.022 * scale)
    return [_Part(tube, weights)]


def _folded(body: _Body, path: list[Float[Array, "3"] | None]) -> bool:
    """Whether a limb has a bone without length, round which there is no flesh."""
    bones = np.diff(np.array(path, np.float64), axis=0)
    return bool((np.linalg.norm(bones, axis=-1) < SHORTEST * body.scale).any())


def _limb(
    body: _Body,
    path: Float[Array, "points 3"],
    front: Float[Array, "3"],
    side: Float[Array, "3"],
    table: Float[Array, "rings 5"],
    around: int,
    joints: list[int],
    blends: tuple[float, ...],
    *,
    rigid: bool = False,
) -> _Part:
    """A tube along a chain of bones.

    ``joints`` are whoever carries the first one, and those along the path. A ``rigid`` one is a ball in its socket: who
    carries the first joint has no part in it.
    """
    t, scale = table[:, 0], body.scale
    bones = np.diff(path, axis=0)
    ways = np.array([_unit(bone, -UP) for bone in bones])
    knots = np.arange(len(ways)) + 0.5  # rings turn from bone to bone about the joints
    knees = np.repeat(knots, 2)[1:-1] + np.tile([0.3, -0.3], len(knots) - 1)
    turned = np.stack([np.interp(t, knees, np.repeat(way, 2)[1:-1]) for way in ways.T], axis=-1)
    turned /= np.maximum(np.linalg.norm(turned, axis=-1, keepdims=True), 1e-9)
    fronts = np.array([_across(front, way) for way in turned])
    across = np.cross(fronts, turned)
    across *= np.sign(across @ side + 1e-12)[:, None]
    centres = _along(path, t) + scale * table[:, 4:] * fronts
    tube = shape.tube(centres, across, fronts, scale * table[:, 1:4], t, around, 2.1)
    lengths = np.linalg.norm(bones, axis=-1)
    places = np.concatenate(([0.0], np.cumsum(lengths)))
    beyond = np.minimum(tube.places, 0.0) * lengths[0]
    way = beyond + np.interp(tube.places, np.arange(len(places)), places)
    chain = [joint for k, joint in enumerate(joints) if k == 0 or joint != joints[k - 1]]
    at = [k for k, joint in enumerate(joints) if k == 0 or joint != joints[k - 1]]
    starts = np.array([places[max(k - 1, 0)] if k else -np.inf for k in at])
    if rigid:
        starts[np.array(at) == 1] = -np.inf
    wide = np.array([0.0, *blends])[at]
    return _Part(tube, _graded(body, way, chain, starts, scale * wide))


def _graded(
    body: _Body,
    way: Float[Array, "vertices"],
    chain: list[int],
    starts: Float[Array, "chain"],
    blends: float | Float[Array, "chain"],
) -> Float[Array, "vertices joints"]:
    """Weights along a chain: each joint takes over where it lies, within so much before and behind."""
    out = np.zeros((len(way), body.skeleton.joints))
    wide = np.broadcast_to(blends, len(chain))
    before = np.ones(len(way))
    out[:, chain[0]] = 1.0
    for k in range(1, len(chain)):
        x = np.clip((way - starts[k]) / (2 * max(wide[k], 1e-9)) + 0.5, 0.0, 1.0)
        taken = np.minimum(x * x * (3 - 2 * x), before)
        out[:, chain[k - 1]] -= taken
        out[:, chain[k]] += taken
        before = taken
    return np.maximum(out, 0.0)


def _shrug(body: _Body, side: str, torso: Tube, weights: Float[Array, "vertices joints"]) -> None:
    """Let the collar bone carry the shoulder of the torso."""
    clavicle, joint = (body.skeleton.joint(f"{side}_{part}") for part in ("shoulder", "upper_arm"))
    middle = _middle(body, "upper_arm")
    if clavicle == joint or middle is None:
        return
    reach = body.places[joint] - middle
    out = np.clip((torso.positions - middle) @ reach / max(reach @ reach, 1e-9), 0.0, 1.0)
    x = np.clip((out - 0.1) / 0.75, 0.0, 1.0)
    share = 0.9 * x * x * (3 - 2 * x) * np.interp(torso.places, [0.6, 0.95, 1.3, 1.7], [0.0, 1.0, 1.0, 0.0])
    weights *= 1.0 - share[:, None]
    weights[:, clavicle] += share


def _strongest(weights: Float[Array, "vertices joints"]) -> tuple[Int[Array, "vertices 4"], Float[Array, "vertices 4"]]:
    """The joints that move each vertex most; those that do nothing are joint 0."""
    some = min(INFLUENCES, weights.shape[1])
    order = np.argsort(-weights, axis=1, kind="stable")[:, :some]
    best = np.take_along_axis(weights, order, axis=1)
    best = np.where(best < 1e-3, 0.0, best)
    joints, out = np.zeros((len(weights), INFLUENCES), np.int64), np.zeros((len(weights), INFLUENCES))
    joints[:, :some] = np.where(best > 0, order, 0)
    out[:, :some] = best / best.sum(axis=1, keepdims=True)
    return joints, out


def _joints(body: _Body, roles: tuple[str, ...]) -> list[int]:
    """Who carries the first joint of a limb, and its joints; one that is missing is carried by the one before."""
    first = body.carrier(roles[0])
    out = [max(int(body.skeleton.parents[first]), 0)]
    for role in roles:
        out.append(body.skeleton.roles.get(role, out[-1]))
    return out


def _chain(skeleton: Skeleton, joint: int) -> list[int]:
    out = [joint]
    while skeleton.parents[out[-1]] >= 0:
        out.append(int(skeleton.parents[out[-1]]))
    return out[::-1]


def _all_of(body: _Body, count: int, joint: int) -> Float[Array, "vertices joints"]:
    out = np.zeros((count, body.skeleton.joints))
    out[:, joint] = 1.0
    return out


def _middle(body: _Body, part: str) -> Float[Array, "3"] | None:
    """Between the left and the right one of a joint."""
    left, right = body.at(f"left_{part}"), body.at(f"right_{part}")
    return None if left is None or right is None else 0.5 * (left + right)


def _breadth(body: _Body, part: str, usual: float) -> float:
    """How much broader the body is there than the tables'."""
    left, right = body.at(f"left_{part}"), body.at(f"right_{part}")
    if left is None or right is None:
        return 1.0
    half = 0.5 * float(np.linalg.norm(left - right)) / (usual * body.scale)
    return float(np.clip(half, 1 / BROADEST, BROADEST))


def _thumbwards(body: _Body, hand: int, wrist: Float[Array, "3"]) -> Float[Array, "3"]:
    """Where the thumb is, seen from the wrist: a joint of that name, else forward."""
    for joint, name in enumerate(body.skeleton.names):
        if "thumb" in name.lower() and hand in _chain(body.skeleton, joint):
            return np.asarray(body.places[joint] - wrist)
    return FRONT


def _along(path: Float[Array, "points 3"], t: Float[Array, "rings"]) -> Float[Array, "rings 3"]:
    """Places along a path, 0 and 1 and so on at its points, and straight on beyond its ends."""
    k = np.clip(np.floor(t).astype(int), 0, len(path) - 2)
    return np.asarray(path[k] + (t - k)[:, None] * (path[k + 1] - path[k]))


def _unit(vector: Float[Array, "3"], other: Float[Array, "3"]) -> Float[Array, "3"]:
    """Direction of a vector; another one if it has no length."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-6 else other


def _across(vector: Float[Array, "3"], way: Float[Array, "3"]) -> Float[Array, "3"]:
    """The part of a direction that is square to another one; some such direction where they are parallel."""
    for candidate in (vector, FRONT, UP, LEFT):
        rest = candidate - (candidate @ way) * way
        if np.linalg.norm(rest) > 0.2 * np.linalg.norm(candidate):
            return _unit(rest, UP)
    raise AssertionError
