"""From markers on the skin to the joints inside, by the regressions of gait laboratories.

Hip joints by Harrington et al. 2007, "Prediction of the hip joint centre in adults, children, and patients with
cerebral palsy based on magnetic resonance imaging", from the width and depth of the pelvis; knees, ankles and elbows
half a joint's width inside of the outer marker, or between two markers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Array = np.ndarray
Points = Float[Array, "frames 3"]

KNEE_WIDTH, ANKLE_WIDTH, ELBOW_WIDTH = 0.105, 0.07, 0.07
"""Widths of an adult's joints, metres, where the file does not tell."""

SHOULDER_DROP = 0.045
"""The shoulder joint lies so far below the marker on the acromion, metres."""

MARKER_RADIUS = 0.007
"""From the skin to the middle of a marker, metres."""

TOE_DROP = 0.012
"""The toe joint lies so far below the skin under its marker, metres."""

HARRINGTON = ((-0.24, -0.0099), (-0.30, -0.0109), (0.33, 0.0073))
"""Hip joint from the middle between the front spines of the pelvis: ahead by depth, up and outwards by width (m)."""


@dataclass(frozen=True, kw_only=True)
class Widths:
    """Widths of joints, metres."""

    knee: tuple[float, float] = (KNEE_WIDTH, KNEE_WIDTH)
    ankle: tuple[float, float] = (ANKLE_WIDTH, ANKLE_WIDTH)
    elbow: tuple[float, float] = (ELBOW_WIDTH, ELBOW_WIDTH)
    marker_radius: float = MARKER_RADIUS


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyPoints:
    """Where the joints of a body are, frame by frame, and how its parts are turned.

    Parameters
    ----------
    centres
        Role to places of the joint, metres. Hips and legs are always there.
    lefts
        Directions to the left, of ``pelvis``, ``chest``, ``head`` and of the axes of knees and ankles
        (``left_knee``, ...); those that are known.
    forwards
        Directions ahead, of ``pelvis``, ``chest``, ``head``, and along the soles (``left_foot``, ...); likewise.
    """

    centres: Mapping[str, Points]
    lefts: Mapping[str, Points]
    forwards: Mapping[str, Points]


def unit(v: Float[Array, "*shape 3"]) -> Float[Array, "*shape 3"]:
    """Vectors of length one; what is zero stays so."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)


def across(v: Float[Array, "*#shape 3"], along: Float[Array, "*#shape 3"]) -> Float[Array, "*_ 3"]:
    """The part of vectors that is square to directions, made one long."""
    return unit(v - np.sum(v * along, axis=-1, keepdims=True) * along)


def bend_axis(near: Points, middle: Points, far: Points, left: Points, sharp: float = 0.35) -> Points:
    """Axis about which a limb bends, to the left: the normal of its plane where it is bent, else ``left``.

    Parameters
    ----------
    near, middle, far
        The three joints of the limb.
    left
        Where the axis points where the limb is straight; also tells the sense.
    sharp
        Sine of the bend from which on the plane alone tells.
    """
    along = unit(far - near)
    normal = np.cross(unit(middle - near), unit(far - middle))
    bent = np.clip(np.linalg.norm(normal, axis=-1, keepdims=True) / sharp, 0.0, 1.0) ** 2
    sense = np.sign(np.sum(normal * left, axis=-1, keepdims=True))
    return across(bent * sense * unit(normal) + (1 - bent) * across(left, along), along)


def level_sole(ankle: Points, knee: Points, toe: Points) -> Points:
    """Direction ahead along the sole, where no heel tells it: level where a foot stands square under its shin."""
    along = unit(toe - ankle)
    shank = unit(knee - ankle)
    axis = np.cross(shank, across(along, shank))
    steep = np.arcsin(np.clip(float(np.median(np.sum(along * shank, axis=-1))), -1.0, 1.0))
    return np.cos(steep) * along - np.sin(steep) * np.cross(along, axis)


def body_of_markers(markers: Mapping[str, Points], widths: Widths) -> BodyPoints:
    """Find the joints of a body that wears markers.

    Parameters
    ----------
    markers
        Places without gaps, by the names of ``stridecast.formats.c3d.MARKERS``: all that are required, others if there.
    widths
        Of joints.
    """
    m = dict(markers)
    front = 0.5 * (m["left_asis"] + m["right_asis"])
    back = m["sacrum"] if "sacrum" in m else 0.5 * (m["left_psis"] + m["right_psis"])
    left = unit(m["left_asis"] - m["right_asis"])
    ahead = across(front - back, left)
    up = np.cross(ahead, left)
    width = float(np.median(np.linalg.norm(m["left_asis"] - m["right_asis"], axis=-1)))
    depth = float(np.median(np.linalg.norm(front - back, axis=-1)))
    x, y, z = (k * size + c for (k, c), size in zip(HARRINGTON, (depth, width, width), strict=True))
    centres: dict[str, Points] = {}
    lefts: dict[str, Points] = {"pelvis": left}
    forwards: dict[str, Points] = {"pelvis": ahead}
    for k, (side, out) in enumerate((("left", 1.0), ("right", -1.0))):
        hip = front + x * ahead + y * up + out * z * left
        centres[f"{side}_thigh"] = hip
        _leg(m, widths, k, side, out, centres, lefts, forwards)
    centres["hips"] = 0.5 * (centres["left_thigh"] + centres["right_thigh"])
    _trunk(m, centres, lefts, forwards, 0.6 * back + 0.4 * front)
    for k, side in enumerate(("left", "right")):
        _arm(m, widths, k, side, centres, lefts)
    return BodyPoints(centres=centres, lefts=lefts, forwards=forwards)


def _leg(
    m: Mapping[str, Points],
    widths: Widths,
    k: int,
    side: str,
    out: float,
    centres: dict[str, Points],
    lefts: dict[str, Points],
    forwards: dict[str, Points],
) -> None:
    """Knee, ankle and toe of one leg, and the axes about which they bend."""
    hip, knee, ankle, toe = centres[f"{side}_thigh"], m[f"{side}_knee"], m[f"{side}_ankle"], m[f"{side}_toe"]
    heel = m.get(f"{side}_heel")
    sole = unit(toe - heel) if heel is not None else level_sole(ankle, knee, toe)
    shank = unit(knee - ankle)
    inner, ankle_inner = m.get(f"{side}_knee_inner"), m.get(f"{side}_ankle_inner")
    aside = out * (0.5 * widths.ankle[k] + widths.marker_radius)
    if ankle_inner is None:
        axis = across(np.cross(shank, sole), shank)
        outer, ankle = ankle, ankle - aside * axis
    else:
        axis = unit(out * (ankle - ankle_inner))
        outer, ankle = ankle, 0.5 * (ankle + ankle_inner)
    if inner is None:
        # the shin turns against the thigh by little, so the knee's axis lies between those of pelvis and foot
        between = turned = across(unit(lefts["pelvis"]) + axis, unit(hip - knee))
        inside = out * (0.5 * widths.knee[k] + widths.marker_radius)
        for _ in range(3):  # an axis that is off moves the knee within the plane of the leg, which tells the axis
            turned = bend_axis(hip, knee - inside * turned, ankle, between)
        centre = knee - inside * turned
    else:
        turned, centre = unit(out * (knee - inner)), 0.5 * (knee + inner)
    if ankle_inner is None:  # feet turn under the shin, so the ankle's axis lies between those of knee and foot
        axis = across(turned + axis, shank)
        ankle = outer - aside * axis
    if heel is not None:  # the ankle stands above the line from heel to toe, which tells how the foot rolls
        axis = np.cross(across(ankle - heel, sole), sole)
    centres[f"{side}_shin"], centres[f"{side}_foot"] = centre, ankle
    centres[f"{side}_toe"] = toe - (TOE_DROP + widths.marker_radius) * unit(np.cross(sole, axis))
    lefts[f"{side}_knee"], lefts[f"{side}_ankle"] = turned, axis
    forwards[f"{side}_foot"] = sole


def _trunk(
    m: Mapping[str, Points],
    centres: dict[str, Points],
    lefts: dict[str, Points],
    forwards: dict[str, Points],
    lumbar: Points,
) -> None:
    """Spine, chest, neck and head, as far as there are markers."""
    if "c7" not in m or "clavicle" not in m:
        return
    # the spine runs nearer to the back: a quarter of the depth from it
    neck = 0.65 * m["c7"] + 0.35 * m["clavicle"]
    centres["spine"] = lumbar
    if "t10" in m and "sternum" in m:
        centres["chest"] = 0.7 * m["t10"] + 0.3 * m["sternum"]
        ahead = unit(m["clavicle"] + m["sternum"] - m["c7"] - m["t10"])
    else:
        centres["chest"] = 0.5 * (lumbar + neck)
        ahead = unit(m["clavicle"] - m["c7"])
    centres["neck"] = neck
    shoulders = m["left_shoulder"] - m["right_shoulder"] if "left_shoulder" in m and "right_shoulder" in m else None
    forwards["chest"] = across(ahead, unit(neck - centres["chest"]))
    lefts["chest"] = across(lefts["pelvis"] if shoulders is None else shoulders, unit(neck - centres["chest"]))
    if all(f"{side}_{end}_head" in m for side in ("left", "right") for end in ("front", "back")):
        front, rear = (0.5 * (m[f"left_{end}_head"] + m[f"right_{end}_head"]) for end in ("front", "back"))
        side = m["left_front_head"] + m["left_back_head"] - m["right_front_head"] - m["right_back_head"]
        lefts["head"] = unit(side)
        forwards["head"] = across(front - rear, lefts["head"])
        up = np.cross(forwards["head"], lefts["head"])
        # the band goes round the forehead; the head turns on the spine about at the height of the ears' lower end
        centres["head"] = 0.45 * front + 0.55 * rear - 0.09 * up


def _arm(
    m: Mapping[str, Points],
    widths: Widths,
    k: int,
    side: str,
    centres: dict[str, Points],
    lefts: Mapping[str, Points],
) -> None:
    """Shoulder, elbow, wrist and hand, if the markers and the trunk are there."""
    if "neck" not in centres or not all(f"{side}_{part}" in m for part in ("shoulder", "elbow", "wrist")):
        return
    down = unit(centres["chest"] - centres["neck"])
    shoulder = m[f"{side}_shoulder"] + (SHOULDER_DROP + widths.marker_radius) * down
    wrist = m[f"{side}_wrist"]
    if f"{side}_wrist_inner" in m:
        wrist = 0.5 * (wrist + m[f"{side}_wrist_inner"])
    elbow = m[f"{side}_elbow"]
    # the marker is on the outer side: with hanging arms that is away from the body
    out = lefts["chest"] if side == "left" else -lefts["chest"]
    elbow = elbow - (0.5 * widths.elbow[k] + widths.marker_radius) * across(out, unit(wrist - shoulder))
    centres[f"{side}_upper_arm"], centres[f"{side}_forearm"], centres[f"{side}_hand"] = shoulder, elbow, wrist
    inward = 0.85 * centres["neck"] + 0.15 * shoulder
    centres[f"{side}_shoulder"] = inward + 0.02 * down
