"""How fast people are in how dense a crowd, beside the measurements that Weidmann gathered.

Density by Voronoi cells: Steffen and Seyfried, *Methods for measuring pedestrian density, flow, speed and direction
with minimal scatter*, 2010. Speed against density: Weidmann, *Transporttechnik der Fussgänger*, 1993.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Bool, Float
from scipy.spatial import QhullError, Voronoi

from stridecast.scorecard.clock import Tracks
from stridecast.scorecard.solids import Solids

Array = np.ndarray

FREE_SPEED, GAMMA, JAM = 1.34, 1.913, 5.4
"""Weidmann's: m/s, people per m2, and the density at which nobody moves, people per m2."""

REACH = 2.0
"""Nobody's cell reaches further than this, metres."""

FINE = 64
"""Edges of a quarter of a circle: its area is right to a ten thousandth."""

EVERY = 1.0
"""Densities change slowly: they are taken so often, seconds."""

WINDOW = 0.5
"""A speed is that over so long, seconds: shorter than a step, it is sway."""

BIN = 0.25
"""Width of the bins of density, people per m2; beyond ``JAM`` there is one."""


@dataclass(frozen=True, kw_only=True)
class DensityBin:
    """People in crowds of about one density: its mean, their mean speed, Weidmann's there, and how many samples."""

    density: float
    speed: float
    expected: float
    samples: int


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedDensity:
    """Samples of density (people per m2) and speed (m/s), and what they come to in bins."""

    densities: Float[Array, "samples"]
    speeds: Float[Array, "samples"]

    @property
    def bins(self) -> tuple[DensityBin, ...]:
        """Means in bins of ``BIN``, in rising order; empty ones are left out."""
        which = np.floor(np.minimum(self.densities, JAM) / BIN).astype(np.int64)
        out = []
        for k in np.unique(which):
            here = which == k
            density, speed = float(self.densities[here].mean()), float(self.speeds[here].mean())
            expected = float(weidmann(np.array(density)))
            out.append(DensityBin(density=density, speed=speed, expected=expected, samples=int(here.sum())))
        return tuple(out)

    @property
    def deviation(self) -> float:
        """Mean difference between bins and Weidmann, each as often as it has samples, m/s; no number without any."""
        bins = self.bins
        if not bins:
            return float("nan")
        weights = [b.samples for b in bins]
        return float(np.average([abs(b.speed - b.expected) for b in bins], weights=weights))


def weidmann(density: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Mean speed in a crowd of a density, m/s: ``1.34 (1 - exp(-1.913 (1 / density - 1 / 5.4)))``, 0 beyond 5.4."""
    density = np.clip(density, 1e-9, JAM)
    return np.asarray(FREE_SPEED * -np.expm1(-GAMMA * (1 / density - 1 / JAM)))


def speed_density(
    tracks: Tracks, solids: Solids, on_the_way: Bool[Array, "rows"], every: float = EVERY
) -> SpeedDensity:
    """Densities and speeds of people on the way.

    Parameters
    ----------
    solids
        Cells are cut where nobody can be, and at ``REACH``.
    on_the_way
        Rows of people who want to go; the others only take room.
    every
        Seconds between the frames that are looked at.
    """
    order, edges = tracks.by_frame
    stride = max(1, round(every / tracks.step))
    speeds = window_speeds(tracks)
    found: list[tuple[Array, Array]] = [(np.zeros(0), np.zeros(0))]
    for frame in range(0, len(edges) - 1, stride):
        rows = order[edges[frame] : edges[frame + 1]]
        if len(rows):
            areas = cell_areas(tracks.trajectories.positions[rows], solids)
            keep = on_the_way[rows] & np.isfinite(speeds[rows]) & (areas > 0)
            found.append((1 / areas[keep], speeds[rows][keep]))
    densities, paces = (np.concatenate(column) for column in zip(*found, strict=True))
    return SpeedDensity(densities=densities, speeds=paces)


def window_speeds(tracks: Tracks) -> Float[Array, "rows"]:
    """How far everybody gets in ``WINDOW`` about each row, m/s; no number where their rows do not reach so far."""
    half = max(1, int(0.5 * WINDOW / tracks.step + 1e-3))  # whatever way rounding of the step goes
    positions, owners, frames = tracks.trajectories.positions, tracks.owners, tracks.frames
    out = np.full(len(owners), np.nan)
    if len(out) > 2 * half:
        whole = (owners[2 * half :] == owners[: -2 * half]) & (frames[2 * half :] - frames[: -2 * half] == 2 * half)
        far = np.linalg.norm(positions[2 * half :] - positions[: -2 * half], axis=-1)
        out[half:-half] = np.where(whole, far / (2 * half * tracks.step), np.nan)
    return out


def cell_areas(points: Float[Array, "people 2"], solids: Solids) -> Float[Array, "people"]:
    """Areas of the Voronoi cells of people, m2: cut at ``REACH`` and where nobody can be.

    Of two in the very same place one has no number. Whoever has no open ground at all has an area of 0.
    """
    middle = points.mean(axis=0)
    # Far points close the cells at the rim without cutting anything within reach.
    away = 4 * REACH + 4 * float(np.linalg.norm(points - middle, axis=-1).max())
    turns = np.arange(8) * np.pi / 4 + 0.1
    ring = middle + away * np.stack((np.sin(turns), np.cos(turns)), axis=-1)
    try:
        cells = Voronoi(np.concatenate((points, ring)))
    except QhullError:
        return np.full(len(points), np.nan)
    areas = np.zeros(len(points))
    ridges = np.array(cells.ridge_vertices)
    bounded = (ridges >= 0).all(axis=1)
    ends = cells.vertices[ridges[bounded]]
    for side in (0, 1):
        owner = cells.ridge_points[bounded][:, side]
        real = owner < len(points)
        owner = owner[real]
        corners = ends[real] - points[owner][:, None]
        # A cell is convex and holds its point, so it is made of triangles from there over all its edges.
        np.add.at(areas, owner, np.abs(_sector(corners[:, 0], corners[:, 1], REACH)))
    lost = np.array([cells.point_region[k] < 0 or not cells.regions[cells.point_region[k]] for k in range(len(points))])
    areas[lost | (areas == 0)] = np.nan
    if solids.anything:
        near = np.flatnonzero(np.isfinite(areas) & solids.near(points, REACH))
        areas[near] = _cut_areas(cells, points, near, solids)
    return areas


def _cut_areas(cells: Voronoi, points: Array, near: Array, solids: Solids) -> Array:
    """Areas of cells that something solid may cut."""
    polygons = []
    for k in near.tolist():
        corners = cells.vertices[cells.regions[cells.point_region[k]]]
        about = corners - points[k]
        polygons.append(shapely.Polygon(corners[np.argsort(np.arctan2(about[:, 0], about[:, 1]))]))
    centers = points[near]
    # What is reached only by leaving the reach is not in reach.
    discs = shapely.buffer(shapely.points(centers), REACH, quad_segs=FINE)
    open_parts = solids.open_parts(shapely.intersection(np.array(polygons, object), discs), centers)
    rings, of = [], []
    for k, part in enumerate(open_parts):
        for ring, sign in (
            [(part.exterior, 1.0), *((hole, -1.0) for hole in part.interiors)] if not part.is_empty else []
        ):
            rings.append((sign, shapely.get_coordinates(ring) - centers[k]))
            of.append(k)
    areas = np.zeros(len(near))
    for k, (sign, ring) in zip(of, rings, strict=True):
        areas[k] += sign * abs(float(_sector(ring[:-1], ring[1:], REACH).sum()))
    return areas


def _sector(one: Float[Array, "edges 2"], other: Float[Array, "edges 2"], radius: float) -> Float[Array, "edges"]:
    """Signed area of triangles from the origin to edges, as far as a disc about the origin reaches."""
    way = other - one
    a = np.maximum(np.sum(way * way, axis=-1), 1e-30)
    b = np.sum(one * way, axis=-1)
    root = np.sqrt(np.maximum(b * b - a * (np.sum(one * one, axis=-1) - radius**2), 0.0))
    enter = np.clip((-b - root) / a, 0.0, 1.0)[:, None]
    leave = np.clip((-b + root) / a, 0.0, 1.0)[:, None]
    p, q = one + enter * way, one + leave * way
    return 0.5 * (_cross(p, q) + radius**2 * (_angle(one, p) + _angle(q, other)))


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _angle(a: Array, b: Array) -> Array:
    return np.arctan2(_cross(a, b), np.sum(a * b, axis=-1))
