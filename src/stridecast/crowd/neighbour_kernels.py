"""Who is near whom: people sorted into cells, looked up in blocks of cells, and what is seen of them."""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.state import Cells, Moving, People, Scratch
from stridecast.geometry.kernels import kernel

SETTLING = 0.25
"""An acceleration is taken to go on for so long, seconds."""

AT_REST = 0.5
"""Of two people the one is nearer who would be here sooner if everybody came at this speed besides their own, m/s."""

CLOSE, SAME_WAY = 1.0, 0.5
"""Who are nearer than this (metres) and bound the same way (cosine) go one after the other."""

PX, PZ, EX, EZ, VX, VZ, RADIUS, FELLOW, RANK, ROW, HX, HZ, BX, BZ, JAMMED, FIRST, FIELDS = range(17)
"""Columns of what is seen: place from oneself, velocity expected and present one, radius, whether they walk together
with oneself, rank, row, where they face, where they are bound for, whether they are
jammed, whether they go first (1) or oneself (-1) where both go one after the other."""


@kernel
def sort_into_cells(here: np.ndarray, position: np.ndarray, cells: Cells) -> None:
    """Put everybody into the grid; who is outside counts to the nearest cell."""
    first, rows = cells.first, cells.rows
    first[:] = 0
    for c in range(len(here)):
        if here[c]:
            first[cell_of(cells, position[c, 0], position[c, 1])] += 1
    for k in range(1, len(first)):
        first[k] += first[k - 1]
    for n in range(len(here)):  # from the last on, so that each cell's first entry comes back to where it begins
        c = len(here) - 1 - n
        if here[c]:
            k = cell_of(cells, position[c, 0], position[c, 1])
            first[k] -= 1
            rows[first[k]] = c


@kernel
def cell_of(cells: Cells, x: float, z: float) -> int:
    """Number of the cell of a place."""
    i = min(max(math.floor((x - cells.corner[0]) / cells.size), 0), cells.shape[0] - 1)
    k = min(max(math.floor((z - cells.corner[1]) / cells.size), 0), cells.shape[1] - 1)
    return i * cells.shape[1] + k


@kernel
def look(people: People, moving: Moving, cells: Cells, c: int, reach: float, scratch: Scratch) -> int:
    """What somebody sees of the nearest others within ``reach``, nearest first, as many as there is room for.

    Whose distances are equal are sorted by their numbers, so that the order of rows decides nothing.
    """
    x, z = moving.position[c, 0], moving.position[c, 1]
    vx, vz = moving.velocity[c, 0], moving.velocity[c, 1]
    near, gaps, seen = scratch.near, scratch.gaps, scratch.seen
    most = len(near)
    low, high = cell_of(cells, x - reach, z - reach), cell_of(cells, x + reach, z + reach)
    nz = cells.shape[1]
    n = 0
    for i in range(low // nz, high // nz + 1):
        for k in range(low % nz, high % nz + 1):
            for e in range(cells.first[i * nz + k], cells.first[i * nz + k + 1]):
                j = cells.rows[e]
                if j == c:
                    continue
                px, pz = moving.position[j, 0] - x, moving.position[j, 1] - z
                gap = math.hypot(px, pz)
                if gap > reach:
                    continue
                if gap > 0.0:
                    closing = (vx - moving.velocity[j, 0]) * px + (vz - moving.velocity[j, 1]) * pz
                    gap /= AT_REST + max(closing / gap, 0.0)
                if n == most:
                    if not _before(people, gap, j, gaps[n - 1], near[n - 1]):
                        continue
                    n -= 1
                m = n
                while m > 0 and _before(people, gap, j, gaps[m - 1], near[m - 1]):
                    gaps[m], near[m] = gaps[m - 1], near[m - 1]
                    m -= 1
                gaps[m], near[m] = gap, j
                n += 1
    for m in range(n):
        j = near[m]
        out = seen[m]
        out[PX], out[PZ] = moving.position[j, 0] - x, moving.position[j, 1] - z
        out[VX], out[VZ] = moving.velocity[j, 0], moving.velocity[j, 1]
        out[EX], out[EZ] = (
            out[VX] + SETTLING * moving.acceleration[j, 0],
            out[VZ] + SETTLING * moving.acceleration[j, 1],
        )
        if out[EX] * out[VX] + out[EZ] * out[VZ] <= 0.0:  # nobody is expected to turn back
            out[EX], out[EZ] = 0.0, 0.0
        out[RADIUS] = people.radius[j]
        out[FELLOW] = 1.0 if people.company[c] >= 0 and people.company[c] == people.company[j] else 0.0
        out[RANK] = people.rank[j]
        out[ROW] = j
        out[BX], out[BZ] = moving.bound[j, 0], moving.bound[j, 1]
        out[JAMMED] = moving.jammed[j]
        gap = math.hypot(out[PX], out[PZ]) - people.radius[c] - people.radius[j]
        out[FIRST] = order(moving, c, j, out[PX], out[PZ], gap) if out[FELLOW] == 0.0 else 0.0
        out[HX], out[HZ] = math.sin(moving.heading[j]), math.cos(moving.heading[j])
    return n


@kernel
def order(moving: Moving, c: int, j: int, px: float, pz: float, gap: float) -> float:
    """Where two close to each other are bound the same way: 1 the other, at ``(px, pz)``, goes first, -1 oneself.

    Who has the other less in front of them does, wherever each wants to go now, as where ways run together at a door.
    0 for all others, and where one of them stands to stay.
    """
    same = moving.bound[c, 0] * moving.bound[j, 0] + moving.bound[c, 1] * moving.bound[j, 1]
    if gap > CLOSE or same < SAME_WAY:
        return 0.0
    if (moving.wants[c, 0] == 0.0 and moving.wants[c, 1] == 0.0) or (
        moving.wants[j, 0] == 0.0 and moving.wants[j, 1] == 0.0
    ):
        return 0.0
    wx, wz = moving.wants[c, 0] + moving.wants[j, 0], moving.wants[c, 1] + moving.wants[j, 1]
    ahead = px * wx + pz * wz
    return 1.0 if ahead > 0.0 else -1.0 if ahead < 0.0 else 0.0


@kernel
def _before(people: People, gap: float, j: int, other_gap: float, other: int) -> bool:
    return gap < other_gap or (gap == other_gap and people.number[j] < people.number[other])
