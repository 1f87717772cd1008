"""Where somebody wants to go now: along their way, or out of a jam."""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.ground_kernels import disc_way, free_way
from stridecast.crowd.neighbour_kernels import FELLOW, PX, PZ, RADIUS
from stridecast.crowd.state import Ground, Moving, People, Ways
from stridecast.geometry.kernels import kernel

LOOK = 1.6
"""People go for a place of their way so far ahead, metres: along its tangent, and back to it (BJL fig. 6b)."""

WINDOW = 2.0
"""The place on the way is looked for so far ahead of the last one, metres."""

OVERVIEW = 8.0
"""Where somebody is bound for is told by the place of their way so far ahead, metres."""

BRAKING = 0.7
"""Who will stand at the end of the way slows down as gently as this, m/s2."""

RETREAT_SPEED = 0.8
"""Who makes room does so at this speed, m/s."""

ROUND = np.radians(np.array([75.0, 45.0, -75.0, -45.0, 20.0]))
"""How far to their side people go who go round a jam; below 0 to the other side."""

ASIDE = (math.cos(math.radians(40.0)), math.sin(math.radians(40.0)))
"""Who steps back out of a jam goes so far aside: cosine, sine."""

AROUND = 16
"""Directions in which room is looked for."""


@kernel
def find_place(people: People, moving: Moving, ways: Ways, c: int) -> None:
    """Take up the place on the way that is nearest now."""
    first, count = people.first[c], people.points[c]
    if count < 2:
        return
    x, z = moving.position[c, 0], moving.position[c, 1]
    k = index_of(ways, first, count, moving.place[c])
    best, place = 1e18, moving.place[c]
    while k < first + count - 1 and ways.along[k] <= moving.place[c] + WINDOW:
        dx, dz = ways.points[k + 1, 0] - ways.points[k, 0], ways.points[k + 1, 1] - ways.points[k, 1]
        length = ways.along[k + 1] - ways.along[k]
        u = ((x - ways.points[k, 0]) * dx + (z - ways.points[k, 1]) * dz) / (length * length)
        u = max(u, 0.0) if k == first + count - 2 else min(max(u, 0.0), 1.0)  # beyond the end it goes straight on
        ex, ez = x - ways.points[k, 0] - u * dx, z - ways.points[k, 1] - u * dz
        gap = ex * ex + ez * ez
        if gap < best - 1e-9:
            best, place = gap, ways.along[k] + u * length
        k += 1
    moving.place[c] = max(place, moving.place[c])


@kernel
def look_ahead(people: People, moving: Moving, ways: Ways, c: int) -> None:
    """Take up where the way leads on the whole."""
    if people.points[c] < 2:
        moving.bound[c, 0], moving.bound[c, 1] = 0.0, 0.0
        return
    px, pz, tx, tz = place_at(people, ways, c, moving.place[c] + OVERVIEW)
    gx, gz = px - moving.position[c, 0], pz - moving.position[c, 1]
    gap = math.hypot(gx, gz)
    if gap > 1e-6:
        tx, tz = gx / gap, gz / gap
    moving.bound[c, 0], moving.bound[c, 1] = tx, tz


@kernel
def index_of(ways: Ways, first: int, count: int, place: float) -> int:
    """The point of a way at or before a place."""
    low, high = first, first + count - 2
    while low < high:
        middle = (low + high + 1) // 2
        if ways.along[middle] <= place:
            low = middle
        else:
            high = middle - 1
    return low


@kernel
def place_at(people: People, ways: Ways, c: int, place: float) -> tuple[float, float, float, float]:
    """Point and direction of a way at a place; beyond its end it goes straight on."""
    first, count = people.first[c], people.points[c]
    k = index_of(ways, first, count, place)
    length = ways.along[k + 1] - ways.along[k]
    dx = (ways.points[k + 1, 0] - ways.points[k, 0]) / length
    dz = (ways.points[k + 1, 1] - ways.points[k, 1]) / length
    ahead = place - ways.along[k]
    return ways.points[k, 0] + ahead * dx, ways.points[k, 1] + ahead * dz, dx, dz


@kernel
def length_of(people: People, ways: Ways, c: int) -> float:
    """Length of somebody's way, metres."""
    return ways.along[people.first[c] + people.points[c] - 1]


@kernel
def wanted(
    people: People, moving: Moving, ways: Ways, ground: Ground, things: np.ndarray, standing: int, c: int
) -> tuple[float, float, float]:
    """Direction and speed that somebody would take if they were alone; speed 0 for who stands."""
    if moving.retreat[c] > 0.0:
        return moving.retreat_way[c, 0], moving.retreat_way[c, 1], min(RETREAT_SPEED, people.wish[c])
    if people.points[c] < 2:
        return math.sin(moving.heading[c]), math.cos(moving.heading[c]), 0.0
    x, z = moving.position[c, 0], moving.position[c, 1]
    left = length_of(people, ways, c) - moving.place[c]
    speed = people.wish[c]
    ahead = LOOK
    if people.stays[c]:
        speed = min(speed, math.sqrt(2.0 * BRAKING * max(left - 0.05, 0.0)))
        ahead = min(ahead, max(left, 0.1))
        if left < 0.08:
            return math.sin(moving.heading[c]), math.cos(moving.heading[c]), 0.0
    for _ in range(3):
        px, pz, tx, tz = place_at(people, ways, c, moving.place[c] + ahead)
        px, pz = px + people.slot[c] * tz, pz - people.slot[c] * tx
        gx, gz = px - x, pz - z
        gap = math.hypot(gx, gz)
        if gap < 1e-6:
            return tx, tz, speed
        if free_way(ground, things, standing, x, z, gx / gap, gz / gap, 0.9 * people.radius[c], gap) >= gap - 1e-9:
            return gx / gap, gz / gap, speed
        ahead *= 0.5
    return gx / gap, gz / gap, speed


@kernel
def company_pace(seen: np.ndarray, count: int, dx: float, dz: float) -> float:
    """Factor by which somebody speeds up or slows down to keep with those they walk with."""
    ahead, known = 0.0, 0
    for m in range(count):
        if seen[m, FELLOW] > 0.0:
            ahead += seen[m, PX] * dx + seen[m, PZ] * dz
            known += 1
    if known == 0:
        return 1.0
    return min(max(1.0 + 0.25 * ahead / known, 0.5), 1.15)


@kernel
def way_out(
    ground: Ground,
    things: np.ndarray,
    standing: int,
    seen: np.ndarray,
    count: int,
    x: float,
    z: float,
    radius: float,
    dx: float,
    dz: float,
    luck: float,
) -> tuple[float, float, float]:
    """Direction in which there is most room for somebody who is stuck and wanted to go to ``(dx, dz)``; how much.

    Sideways and back rather than ahead, as ahead is what is blocked; ``luck`` from 0 to 1 decides among equals.
    """
    best, bx, bz, space = -1e18, dx, dz, 0.0
    for k in range(AROUND):
        angle = 2.0 * math.pi * (k + luck) / AROUND
        ax, az = math.sin(angle), math.cos(angle)
        way = free_way(ground, things, standing, x, z, ax, az, radius + 0.02, 2.5)
        way = min(way, room_in(seen, count, radius, ax, az))
        facing = ax * dx + az * dz
        value = way - 0.6 * max(facing, 0.0) - 0.3 * max(-facing - 0.5, 0.0)
        if value > best:
            best, bx, bz, space = value, ax, az, way
    return bx, bz, space


@kernel
def back_aside(
    ground: Ground,
    things: np.ndarray,
    standing: int,
    seen: np.ndarray,
    count: int,
    x: float,
    z: float,
    radius: float,
    dx: float,
    dz: float,
    side: float,
    behind: float,
) -> tuple[float, float, float]:
    """Direction in which somebody steps back, and how far they can: to their side where there is room for it.

    All do it to the same side, so that those who come out of the jam have made lanes. ``behind`` is the room straight
    back.
    """
    bx, bz = -ASIDE[0] * dx + side * ASIDE[1] * dz, -ASIDE[0] * dz - side * ASIDE[1] * dx
    aside = room_in(seen, count, radius, bx, bz)
    if aside > 0.6 * behind and free_way(ground, things, standing, x, z, bx, bz, radius + 0.01, 0.6) > 0.3:
        return bx, bz, aside
    return -dx, -dz, behind


@kernel
def round_the_jam(
    ground: Ground,
    things: np.ndarray,
    standing: int,
    x: float,
    z: float,
    radius: float,
    dx: float,
    dz: float,
    side: float,
) -> tuple[float, float]:
    """Direction in which somebody goes round people who block each other: all to the same side, so that the jam turns.

    Where there is a wall on that side, less far round, along it, or to the other side.
    """
    for k in range(len(ROUND)):
        angle = side * ROUND[k]
        sine, cosine = math.sin(angle), math.cos(angle)
        ax, az = dx * cosine + dz * sine, dz * cosine - dx * sine
        if free_way(ground, things, standing, x, z, ax, az, radius + 0.01, 0.6) > 0.3:
            return ax, az
    return dx, dz


@kernel
def room_in(seen: np.ndarray, count: int, radius: float, ax: float, az: float) -> float:
    """How far somebody can go in a direction until they touch somebody else, up to a metre and a half."""
    way = 1.5
    for m in range(count):
        way = disc_way(seen[m, PX], seen[m, PZ], ax, az, radius + seen[m, RADIUS] + 0.01, way)
    return way
