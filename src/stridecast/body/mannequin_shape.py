"""Shape of the mannequin: tables of cross sections of an adult of 1.78 m, and the closed tubes that they make.

Widths and depths are metres on a body whose leg (thigh and shin) is ``LEG`` long, after the segment breadths and
girths of Winter (2009, "Biomechanics and Motor Control of Human Movement") and NASA-STD-3000, rounded to what looks
well. Lengths are those of the skeleton, so tables go by places along the bones.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import PchipInterpolator

Array = np.ndarray

LEG = 0.86
"""Length of the leg that the tables are made for, metres."""

HIP_HALF, SHOULDER_HALF = 0.09, 0.175
"""From the middle to the hip joint and to the shoulder joint of that body, metres."""

# Each row: place along the part, half width, depth to the front, depth to the back, how far the middle lies in front.
TORSO = np.array(
    [  # 0 at the hip joints, 1 at the shoulder joints, 2 at the joint of the head
        (-0.170, 0.000, 0.000, 0.000, 0.000),
        (-0.160, 0.045, 0.040, 0.045, -0.005),
        (-0.100, 0.092, 0.072, 0.085, -0.005),
        (-0.060, 0.143, 0.092, 0.112, -0.004),
        (0.020, 0.166, 0.100, 0.120, -0.003),
        (0.100, 0.169, 0.101, 0.116, -0.002),
        (0.230, 0.153, 0.099, 0.097, 0.000),
        (0.370, 0.134, 0.096, 0.083, 0.003),
        (0.500, 0.134, 0.100, 0.085, 0.005),
        (0.640, 0.149, 0.110, 0.100, 0.002),
        (0.760, 0.164, 0.115, 0.112, -0.004),
        (0.860, 0.164, 0.108, 0.113, -0.008),
        (0.940, 0.160, 0.099, 0.108, -0.011),
        (1.020, 0.154, 0.088, 0.100, -0.014),
        (1.100, 0.143, 0.078, 0.090, -0.016),
        (1.190, 0.124, 0.069, 0.079, -0.016),
        (1.290, 0.101, 0.062, 0.069, -0.015),
        (1.400, 0.080, 0.057, 0.063, -0.012),
        (1.540, 0.066, 0.054, 0.059, -0.009),
        (1.720, 0.058, 0.052, 0.056, -0.005),
        (2.000, 0.051, 0.050, 0.054, 0.000),
        (2.200, 0.040, 0.040, 0.040, 0.002),
        (2.300, 0.000, 0.000, 0.000, 0.002),
    ]
)
HEAD = np.array(
    [  # 0 at the chin, 1 at the crown
        (0.000, 0.000, 0.000, 0.000, 0.052),
        (0.012, 0.020, 0.020, 0.022, 0.051),
        (0.050, 0.033, 0.035, 0.040, 0.046),
        (0.130, 0.047, 0.056, 0.058, 0.031),
        (0.250, 0.059, 0.074, 0.076, 0.018),
        (0.390, 0.067, 0.084, 0.092, 0.011),
        (0.540, 0.073, 0.089, 0.101, 0.006),
        (0.680, 0.075, 0.088, 0.104, 0.003),
        (0.800, 0.071, 0.081, 0.097, 0.002),
        (0.900, 0.058, 0.064, 0.079, 0.001),
        (0.965, 0.037, 0.040, 0.051, -0.002),
        (0.992, 0.018, 0.019, 0.025, -0.004),
        (1.000, 0.000, 0.000, 0.000, -0.005),
    ]
)
HEAD_HEIGHT = 0.228
"""From chin to crown, metres."""

LEG_TUBE = np.array(
    [  # 0 at the hip, 1 at the knee, 2 at the ankle
        (-0.170, 0.000, 0.000, 0.000, 0.000),
        (-0.160, 0.032, 0.034, 0.034, 0.000),
        (-0.100, 0.062, 0.064, 0.068, 0.000),
        (0.000, 0.080, 0.079, 0.086, 0.000),
        (0.120, 0.083, 0.082, 0.088, 0.002),
        (0.280, 0.079, 0.081, 0.079, 0.004),
        (0.500, 0.069, 0.074, 0.068, 0.005),
        (0.720, 0.059, 0.064, 0.059, 0.003),
        (0.880, 0.053, 0.056, 0.053, 0.002),
        (1.000, 0.051, 0.055, 0.050, 0.002),
        (1.100, 0.049, 0.050, 0.053, 0.000),
        (1.220, 0.051, 0.045, 0.063, -0.002),
        (1.350, 0.051, 0.043, 0.066, -0.003),
        (1.520, 0.044, 0.040, 0.055, -0.003),
        (1.700, 0.036, 0.036, 0.042, -0.002),
        (1.860, 0.031, 0.033, 0.036, -0.002),
        (1.960, 0.032, 0.034, 0.037, -0.002),
        (2.020, 0.032, 0.034, 0.034, -0.001),
        (2.070, 0.018, 0.020, 0.020, 0.000),
        (2.080, 0.000, 0.000, 0.000, 0.000),
    ]
)
ARM_TUBE = np.array(
    [  # 0 at the shoulder joint, 1 at the elbow, 2 at the wrist, 3 at the tip of the fingers; width is to the thumb
        # side, depths are to the back of the hand and to the palm, the middle lies to the back of the hand
        (-0.090, 0.000, 0.000, 0.000, -0.001),
        (-0.087, 0.016, 0.015, 0.016, -0.001),
        (-0.075, 0.031, 0.029, 0.030, -0.001),
        (-0.046, 0.045, 0.042, 0.044, -0.001),
        (0.000, 0.055, 0.051, 0.052, 0.000),
        (0.080, 0.058, 0.054, 0.053, 0.001),
        (0.190, 0.056, 0.053, 0.049, 0.003),
        (0.360, 0.050, 0.048, 0.044, 0.003),
        (0.560, 0.047, 0.043, 0.042, 0.001),
        (0.780, 0.041, 0.038, 0.037, 0.000),
        (0.920, 0.038, 0.036, 0.035, 0.000),
        (1.000, 0.038, 0.036, 0.034, 0.000),
        (1.100, 0.041, 0.037, 0.036, 0.000),
        (1.240, 0.043, 0.037, 0.036, 0.000),
        (1.450, 0.038, 0.032, 0.032, 0.000),
        (1.700, 0.031, 0.025, 0.025, 0.000),
        (1.880, 0.028, 0.021, 0.021, 0.000),
        (2.000, 0.029, 0.020, 0.020, 0.000),
        (2.120, 0.035, 0.019, 0.020, 0.000),
        (2.280, 0.042, 0.018, 0.019, 0.000),
        (2.450, 0.044, 0.016, 0.017, -0.001),
        (2.600, 0.042, 0.014, 0.014, -0.005),
        (2.750, 0.038, 0.012, 0.012, -0.013),
        (2.880, 0.032, 0.010, 0.010, -0.023),
        (2.970, 0.022, 0.008, 0.008, -0.031),
        (2.995, 0.012, 0.005, 0.005, -0.034),
        (3.000, 0.000, 0.000, 0.000, -0.034),
    ]
)
THUMB = np.array(
    [  # 0 in the palm, 1 at its tip
        (0.000, 0.000, 0.000, 0.000, 0.000),
        (0.030, 0.010, 0.010, 0.010, 0.000),
        (0.250, 0.016, 0.015, 0.015, 0.000),
        (0.500, 0.0135, 0.013, 0.013, 0.000),
        (0.780, 0.012, 0.011, 0.011, 0.000),
        (0.930, 0.009, 0.008, 0.008, 0.000),
        (0.985, 0.005, 0.004, 0.004, 0.000),
        (1.000, 0.000, 0.000, 0.000, 0.000),
    ]
)
# Each row: place along the part, half width, height of the top, height of the bottom over the sole, shift outwards.
FOOT = np.array(
    [  # -1 at the back of the heel, 0 at the ankle, 1 at the joint of the toes, 2 at their tip
        (-1.000, 0.000, 0.030, 0.030, 0.000),
        (-0.985, 0.012, 0.044, 0.014, 0.000),
        (-0.900, 0.024, 0.058, 0.004, 0.000),
        (-0.600, 0.032, 0.078, 0.000, 0.000),
        (-0.200, 0.035, 0.092, 0.000, 0.000),
        (0.150, 0.036, 0.092, 0.000, 0.000),
        (0.400, 0.038, 0.077, 0.000, 0.001),
        (0.700, 0.044, 0.058, 0.000, 0.002),
        (1.000, 0.049, 0.043, 0.000, 0.003),
        (1.350, 0.048, 0.034, 0.000, 0.003),
        (1.650, 0.043, 0.028, 0.001, 0.001),
        (1.880, 0.032, 0.023, 0.003, -0.003),
        (1.975, 0.018, 0.018, 0.006, -0.006),
        (2.000, 0.000, 0.011, 0.011, -0.007),
    ]
)
HEEL = 0.058
"""From the ankle to the back of the heel, metres."""

SOLE = 0.019
"""From the joint of the toes to the floor under it, metres."""

TOES = 0.075
"""From the joint of the toes to their tip where the skeleton does not tell, metres."""

HAND = 0.185
"""From the wrist to the tip of the fingers where the skeleton does not tell, metres."""


class Detail(NamedTuple):
    """How fine a mannequin is: places of the rings of each part, and vertices around them."""

    torso: Float[Array, "rings"]
    head: Float[Array, "rings"]
    leg: Float[Array, "rings"]
    arm: Float[Array, "rings"]
    thumb: Float[Array, "rings"]
    foot: Float[Array, "rings"]
    around_torso: int
    around_head: int
    around_leg: int
    around_arm: int
    around_thumb: int
    around_foot: int


class Tube(NamedTuple):
    """A closed surface of rings between two poles."""

    positions: Float[Array, "vertices 3"]
    triangles: Int[Array, "triangles 3"]
    places: Float[Array, "vertices"]
    """Place of each vertex along the part, as in its table."""


def rows_at(table: Float[Array, "rows 5"], places: Float[Array, "rings"]) -> Float[Array, "rings 5"]:
    """Rows of a table at other places; no wider than their neighbours in the table."""
    between = PchipInterpolator(table[:, 0], table[:, 1:], axis=0)(places)
    return np.concatenate((places[:, None], between), axis=1)


def finer(table: Float[Array, "rows 5"], between: int) -> Float[Array, "rings"]:
    """Places of a table's rows and of so many more between neighbours, but not beside the poles."""
    inner = table[1:-1, 0]
    parts = [np.linspace(a, b, between + 1, endpoint=False) for a, b in pairwise(inner)]
    return np.concatenate((table[:1, 0], *parts, inner[-1:], table[-1:, 0]))


def tube(
    centres: Float[Array, "rings 3"],
    sides: Float[Array, "rings 3"],
    fronts: Float[Array, "rings 3"],
    sizes: Float[Array, "rings 3"],
    places: Float[Array, "rings"],
    segments: int,
    square: float = 2.2,
) -> Tube:
    """Rings of superellipses; the first and the last are points.

    Parameters
    ----------
    centres, sides, fronts
        Middle of each ring, and the unit vectors of its width and of its depth.
    sizes
        Half width, depth to the front and to the back.
    places
        Place of each ring along the part.
    segments
        Vertices of a ring.
    square
        Exponent: 2 is an ellipse, more is squarer.
    """
    angles = 2 * np.pi * np.arange(segments) / segments
    wide, deep = (np.sign(f(angles)) * np.abs(f(angles)) ** (2 / square) for f in (np.cos, np.sin))
    inner = slice(1, -1)
    depth = np.where(deep > 0, sizes[inner, 1:2], sizes[inner, 2:3]) * deep
    rings = (
        centres[inner, None]
        + (sizes[inner, :1] * wide)[..., None] * sides[inner, None]
        + depth[..., None] * fronts[inner, None]
    )
    count = len(rings)
    positions = np.concatenate((centres[:1], rings.reshape(-1, 3), centres[-1:]))
    a = 1 + np.arange(segments)
    b = 1 + (np.arange(segments) + 1) % segments
    triangles = [np.stack((np.zeros_like(a), b, a), axis=-1)]
    for ring in range(count - 1):
        low, high = ring * segments, (ring + 1) * segments
        triangles += [np.stack((low + a, low + b, high + a), -1), np.stack((low + b, high + b, high + a), -1)]
    last = (count - 1) * segments
    triangles.append(np.stack((last + a, last + b, np.full_like(a, len(positions) - 1)), axis=-1))
    faces = np.concatenate(triangles)
    if np.dot(np.cross(sides[1], fronts[1]), centres[-1] - centres[0]) < 0:
        faces = faces[:, ::-1]
    along = np.concatenate((places[:1], np.repeat(places[inner], segments), places[-1:]))
    return Tube(positions, faces, along)


def face(tube: Tube, segments: int) -> Float[Array, "vertices"]:
    """How far the front of a head stands out more than an egg's, metres: nose, brow and chin tell where it looks."""
    rings = (len(tube.positions) - 2) // segments
    angles = np.concatenate(([0.0], np.tile(2 * np.pi * np.arange(segments) / segments, rings), [0.0]))
    aside = np.where(np.sin(angles) > 0, np.cos(angles), 1.0)
    t = tube.places

    def bump(height: float, tall: float, wide: float) -> Float[Array, "vertices"]:
        return np.asarray(np.exp(-(((t - height) / tall) ** 2) - (aside / wide) ** 2))

    eyes = np.exp(-(((t - 0.50) / 0.07) ** 2) - ((np.abs(aside) - 0.42) / 0.24) ** 2)
    out = 0.017 * bump(0.385, 0.085, 0.17) - 0.007 * eyes + 0.004 * bump(0.6, 0.06, 0.6)
    return np.where(np.sin(angles) > 0.05, out, 0.0)


FULL = Detail(
    torso=finer(TORSO, 1),
    head=finer(HEAD, 1),
    leg=finer(LEG_TUBE, 0),
    arm=finer(ARM_TUBE, 0),
    thumb=finer(THUMB, 0),
    foot=finer(FOOT, 0),
    around_torso=20,
    around_head=24,
    around_leg=16,
    around_arm=12,
    around_thumb=8,
    around_foot=16,
)
LOW = Detail(
    torso=np.array([-0.170, -0.080, 0.080, 0.420, 0.800, 1.020, 1.300, 2.300]),
    head=np.array([0.000, 0.130, 0.500, 0.880, 1.000]),
    leg=np.array([-0.170, -0.060, 0.800, 1.050, 1.350, 1.960, 2.080]),
    arm=np.array([-0.090, 0.000, 0.850, 1.080, 1.950, 2.400, 2.900, 3.000]),
    thumb=np.zeros(0),
    foot=np.array([-1.000, -0.900, 0.150, 1.000, 1.850, 2.000]),
    around_torso=8,
    around_head=6,
    around_leg=5,
    around_arm=4,
    around_thumb=0,
    around_foot=4,
)
