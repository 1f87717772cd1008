"""Whom somebody will meet, and which of the rules of BJL section 5 answers it."""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.ground_kernels import free_way
from stridecast.crowd.neighbour_kernels import (
    BX,
    BZ,
    EX,
    EZ,
    FELLOW,
    FIRST,
    PX,
    PZ,
    RADIUS,
    RANK,
    ROW,
    SETTLING,
    VX,
    VZ,
)
from stridecast.crowd.rules import (
    BEHIND,
    FOLLOW,
    GO_FIRST,
    GO_ON,
    HEAD_ON,
    ON_THE_WAY,
    OTHER_SIDE,
    OVERTAKE,
    PASS_ROUND,
    SLOW_DOWN,
    WAIT,
)
from stridecast.crowd.state import Ground, Moving, People
from stridecast.geometry.kernels import kernel

WINDOW = 8.0
"""So far people look ahead, seconds."""

MARGIN = 0.04
"""Who comes nearer than this counts as a collision, metres."""

STANDS = 0.15
"""Slower than this somebody stands, m/s."""

OPPOSITE, SAME = math.radians(135.0), math.radians(45.0)
"""Directions that differ by more than the first meet head-on, by less than the second one overtakes the other."""

PERSISTS, PERSISTS_LONGER = 2.0, 4.0
"""A close encounter that lasts so long is tried on the other side, then waited out, seconds."""

OFFSET = 0.7
"""Who has no preference passes on the right, unless the other is so far to the right, in parts of both radii."""

ELBOWS = 0.1
"""Room that somebody takes beyond their body who overtakes, metres."""

PASSES = 3.0
"""Room for it is looked for no longer ahead than this, seconds."""

CLOSING_UP = 0.15
"""Who follows may be so much faster, m/s."""

QUEUES = 0.3
"""Somebody who stands and is bound the way one goes (cosine) waits in a queue."""

LATE = 0.6
"""Who need not give way goes on until they would meet within this, seconds."""

USUAL = 1.3
"""Somebody who is just setting off is expected to go so fast at least, m/s."""

WAITS, GOES = 0.6, 0.2
"""Who rather waits goes first only with so much time to spare; who rather goes, also if so late, seconds."""

CLOSE = 1.2
"""... if they would meet within this, seconds."""


@kernel
def contact_time(px: float, pz: float, wx: float, wz: float, radius: float) -> float:
    """When two discs touch whose centres are ``(px, pz)`` apart and approach at ``(wx, wz)``; infinity if never."""
    b = px * wx + pz * wz
    if b <= 0.0:
        return math.inf
    c = px * px + pz * pz - radius * radius
    if c <= 0.0:
        return 0.0
    ww = wx * wx + wz * wz
    root = b * b - ww * c
    if root <= 0.0:
        return math.inf
    return c / (b + math.sqrt(root))


@kernel
def answer(
    people: People,
    moving: Moving,
    ground: Ground,
    things: np.ndarray,
    standing: int,
    seen: np.ndarray,
    count: int,
    c: int,
    dx: float,
    dz: float,
    wish: float,
    elapsed: float,
) -> tuple[int, int, float, float, float]:
    """The rule that somebody follows who would go at ``wish`` in the direction ``(dx, dz)``.

    Returns
    -------
    tuple
        Code of the rule, row of whom it is about (-1 nobody), time until they would meet, side on which to pass (1
        left, -1 right, 0 either), greatest speed.
    """
    # What would happen on the way as meant, at the speed at which one is.
    ahead_x = moving.velocity[c, 0] + SETTLING * moving.acceleration[c, 0]
    ahead_z = moving.velocity[c, 1] + SETTLING * moving.acceleration[c, 1]
    pace = max(math.hypot(ahead_x, ahead_z), min(wish, 0.6))
    ux, uz = pace * dx, pace * dz
    radius, waits = people.radius[c], people.waits[c]
    threat, soonest = -1, WINDOW
    for m in range(count):
        o = seen[m]
        if o[FELLOW] > 0.0:
            continue
        t = contact_time(o[PX], o[PZ], ux - o[EX], uz - o[EZ], radius + o[RADIUS] + MARGIN)
        if t < soonest:
            threat, soonest = m, t
    if threat < 0:
        moving.since[c] = 0.0
        return ON_THE_WAY, -1, math.inf, 0.0, math.inf
    o = seen[threat]
    j = int(o[ROW])
    moving.since[c] = moving.since[c] + elapsed if moving.other[c] == j and soonest < 1.5 * CLOSE else 0.0
    px, pz, ex, ez = o[PX], o[PZ], o[EX], o[EZ]
    off = px * dz - pz * dx  # how far to the left the other is
    moves = math.hypot(ex, ez) > STANDS
    between = abs(math.atan2(ex * dz - ez * dx, ex * dx + ez * dz))
    junior = people.rank[c] < o[RANK]
    if moves and moving.since[c] > PERSISTS_LONGER and soonest < CLOSE and junior and waits:
        return WAIT, j, soonest, 0.0, 0.0
    side = people.side[c]
    if side == 0.0:  # the nearer one, else the right
        side = -1.0 if off > -OFFSET * (radius + o[RADIUS]) else 1.0
    if o[FIRST] != 0.0:  # ways run together
        return (FOLLOW if o[FIRST] > 0.0 else GO_FIRST), j, soonest, 0.0, math.inf
    if not moves and o[BX] * dx + o[BZ] * dz > QUEUES:
        return FOLLOW, j, soonest, 0.0, math.inf
    if not moves:
        rule = PASS_ROUND
    elif between > OPPOSITE:
        if not junior and soonest > LATE:
            return GO_ON, j, soonest, 0.0, math.inf
        rule = HEAD_ON
    elif between < SAME:
        along = ex * dx + ez * dz
        beside = min(soonest + 2.0 * (radius + o[RADIUS]) / max(wish - along, 0.3), PASSES)
        left, right = room_beside(moving, ground, things, standing, seen, count, c, threat, dx, dz, beside)
        need = 2.0 * radius + ELBOWS
        if max(left, right) < need or wish < along + 0.1:
            return FOLLOW, j, soonest, 0.0, along + CLOSING_UP
        if people.side[c] == 0.0 and abs(left - right) > 0.5:
            side = 1.0 if left > right else -1.0
        if (left if side > 0.0 else right) < need:
            side = -side
        return OVERTAKE, j, soonest, side, math.inf
    else:
        # Who is first where the ways cross; the other's tail is on the side from which it comes.
        tail = 1.0 if ex * dz - ez * dx < 0.0 else -1.0
        # Both are taken to go at a usual pace by then, lest half a step at the beginning decides.
        up = max(pace, min(wish, USUAL)) / pace
        comes_up, gets = 1.0, math.hypot(ex, ez)
        if gets > math.hypot(o[VX], o[VZ]) + 0.02 and gets < USUAL:
            comes_up = USUAL / gets
        arrives, comes = crossing_times(px, pz, up * ux, up * uz, comes_up * ex, comes_up * ez)
        lead = -WAITS if waits else GOES if junior else 2.0 * GOES
        if arrives < comes + lead:
            return GO_FIRST, j, soonest, -tail, math.inf
        if soonest < 0.7 * CLOSE:
            return SLOW_DOWN, j, soonest, tail, 0.5 * wish
        return BEHIND, j, soonest, tail, math.inf
    if moving.since[c] > PERSISTS and soonest < CLOSE:
        return OTHER_SIDE, j, soonest, -side, math.inf
    return rule, j, soonest, side, math.inf


@kernel
def crossing_times(px: float, pz: float, ux: float, uz: float, ex: float, ez: float) -> tuple[float, float]:
    """When oneself and the other are where the ways cross, seconds."""
    cross = ux * ez - uz * ex
    if abs(cross) < 1e-9:
        return 0.0, 0.0
    return (px * ez - pz * ex) / cross, (px * uz - pz * ux) / cross


@kernel
def room_beside(
    moving: Moving,
    ground: Ground,
    things: np.ndarray,
    standing: int,
    seen: np.ndarray,
    count: int,
    c: int,
    whom: int,
    dx: float,
    dz: float,
    beside: float,
) -> tuple[float, float]:
    """Free width to the left and to the right of somebody who goes ahead, up to walls and to other people, metres.

    Up to walls it is the smaller one of now and of ``beside`` seconds later, when one would have passed.
    """
    o = seen[whom]
    x, z = moving.position[c, 0] + o[PX], moving.position[c, 1] + o[PZ]
    left, right = 3.0, 3.0
    for _ in range(2):
        left = free_way(ground, things, standing, x, z, dz, -dx, 0.0, left)
        right = free_way(ground, things, standing, x, z, -dz, dx, 0.0, right)
        x, z = x + beside * o[EX], z + beside * o[EZ]
    left, right = left - o[RADIUS], right - o[RADIUS]
    for m in range(count):
        if m == whom:
            continue
        px, pz = seen[m, PX] - o[PX], seen[m, PZ] - o[PZ]
        along, off = px * dx + pz * dz, px * dz - pz * dx
        if -0.5 < along < 2.0:
            gap = abs(off) - o[RADIUS] - seen[m, RADIUS]
            if off > 0.0:
                left = min(left, gap)
            else:
                right = min(right, gap)
    return left, right
