"""What stands near a place, and how far away it is."""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.state import Ground
from stridecast.geometry.kernels import kernel


@kernel
def to_segment(s: np.ndarray, x: float, z: float) -> tuple[float, float]:
    """From the nearest place of a segment to a point."""
    dx, dz = s[2] - s[0], s[3] - s[1]
    length2 = dx * dx + dz * dz
    u = ((x - s[0]) * dx + (z - s[1]) * dz) / length2 if length2 > 0.0 else 0.0
    u = min(max(u, 0.0), 1.0)
    return x - s[0] - u * dx, z - s[1] - u * dz


@kernel
def room(ground: Ground, thing: int, x: float, z: float) -> float:
    """Distance of a point from what stands there, metres; below 0 inside a circle."""
    if thing < len(ground.segments):
        ex, ez = to_segment(ground.segments[thing], x, z)
        return math.hypot(ex, ez)
    circle = ground.circles[thing - len(ground.segments)]
    return math.hypot(x - circle[0], z - circle[1]) - circle[2]


@kernel
def standing_near(ground: Ground, x: float, z: float, reach: float, out: np.ndarray) -> int:
    """Numbers of what stands within ``reach`` of a point, in rising order; how many. The nearest if there are more."""
    if len(ground.segments) + len(ground.circles) == 0:
        return 0
    nx, nz = int(ground.shape[0]), int(ground.shape[1])
    i0 = max(math.floor((x - reach - ground.corner[0]) / ground.cell), 0)
    i1 = min(math.floor((x + reach - ground.corner[0]) / ground.cell), nx - 1)
    k0 = max(math.floor((z - reach - ground.corner[1]) / ground.cell), 0)
    k1 = min(math.floor((z + reach - ground.corner[1]) / ground.cell), nz - 1)
    n = 0
    for i in range(i0, i1 + 1):
        for k in range(k0, k1 + 1):
            cell = i * nz + k
            for e in range(ground.first[cell], ground.first[cell + 1]):
                thing = ground.entries[e]
                if room(ground, thing, x, z) > reach:
                    continue
                known = False
                for m in range(n):
                    if out[m] == thing:
                        known = True
                        break
                if known:
                    continue
                if n < len(out):
                    out[n] = thing
                    n += 1
                else:
                    worst, gap = 0, -1e18
                    for m in range(n):
                        d = room(ground, out[m], x, z)
                        if d > gap:
                            worst, gap = m, d
                    if room(ground, thing, x, z) < gap:
                        out[worst] = thing
    for m in range(1, n):  # few: the order must not depend on cells
        thing, k = out[m], m
        while k > 0 and out[k - 1] > thing:
            out[k] = out[k - 1]
            k -= 1
        out[k] = thing
    return n


@kernel
def free_way(
    ground: Ground, things: np.ndarray, count: int, x: float, z: float, dx: float, dz: float, radius: float, most: float
) -> float:
    """How far a disc can go in a unit direction until it touches something that stands, up to ``most``, metres."""
    way = most
    for m in range(count):
        thing = things[m]
        if thing < len(ground.segments):
            way = min(way, _to_wall(ground.segments[thing], x, z, dx, dz, radius, way))
        else:
            circle = ground.circles[thing - len(ground.segments)]
            way = min(way, disc_way(circle[0] - x, circle[1] - z, dx, dz, radius + circle[2], way))
    return way


@kernel
def disc_way(px: float, pz: float, dx: float, dz: float, radius: float, most: float) -> float:
    """How far along a unit direction a point touches a circle at ``(px, pz)``; 0 if inside and going deeper."""
    along = px * dx + pz * dz
    if along <= 0.0:
        return most
    across2 = px * px + pz * pz - along * along
    if across2 >= radius * radius:
        return most
    return min(max(along - math.sqrt(radius * radius - across2), 0.0), most)


@kernel
def _to_wall(s: np.ndarray, x: float, z: float, dx: float, dz: float, radius: float, most: float) -> float:
    """The same for a segment with round ends: its two sides and its ends."""
    way = min(disc_way(s[0] - x, s[1] - z, dx, dz, radius, most), disc_way(s[2] - x, s[3] - z, dx, dz, radius, most))
    wx, wz = s[2] - s[0], s[3] - s[1]
    length = math.hypot(wx, wz)
    if length <= 0.0:
        return way
    wx, wz = wx / length, wz / length
    # Distance from the wall's line, and how fast it shrinks.
    off = (x - s[0]) * wz - (z - s[1]) * wx
    rate = dx * wz - dz * wx
    if off < 0.0:
        off, rate = -off, -rate
    if rate >= -1e-9:
        return way
    t = max((off - radius) / -rate, 0.0)
    u = (x + t * dx - s[0]) * wx + (z + t * dz - s[1]) * wz
    if 0.0 <= u <= length:
        return min(way, t)
    return way
