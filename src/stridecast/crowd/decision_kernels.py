"""What somebody would rather do next: a rule, or a way out of a jam, and the prices of all that they may do."""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.choice_kernels import weigh
from stridecast.crowd.neighbour_kernels import BX, BZ, JAMMED, PX, PZ, RADIUS
from stridecast.crowd.rule_kernels import answer
from stridecast.crowd.rules import GIVE_WAY, ON_THE_WAY, RETURN, STAND, WAIT
from stridecast.crowd.state import Ground, Moving, People, Ways
from stridecast.crowd.vehicle_kernels import BACK, REST
from stridecast.crowd.way_kernels import back_aside, place_at, room_in, round_the_jam, way_out
from stridecast.geometry.kernels import kernel

CHANGING = 0.8
"""The direction that is aimed at changes no faster than this, rad/s, lest people waver, ..."""

URGENT, UNHURRIED = 0.8, 0.3
"""... unless they would meet somebody within this, seconds, or hardly move, m/s."""

SLOW = 0.08
"""Who wants to go and is slower than this does not get on, m/s."""

PATIENCE = 1.5
"""Who has not got on for so long gives way, seconds; those who rather wait sooner, some by chance later."""


STUCK = 0.7
"""Who has not got on for so long and is blocked by somebody who wants to go elsewhere is in a jam, seconds."""

ROOM = 0.4
"""Behind people who block each other there should be so much room, metres ..."""

STEPPING_BACK, STEP_BACK, STEP_BACK_A_BIT = 0.97, 6.0, 1.5
"""... so nearly all who have less step back, for so long; behind a wedge less; seconds ..."""

A_BIT = 0.06
"""Who is wedged steps back by as little as this, metres."""

CONTRARY = 0.1
"""So many of them go to the other side."""

GOING_ROUND = 3.0
"""... and the others go round the jam, for about so long, seconds."""

TIGHT, WEDGED = 0.15, 2.5
"""Who stands so close (metres) to whom they follow, for so long (seconds), is wedged, as at a door."""

CONE = 0.6
"""Who is within this cosine of the direction wished for is in front."""

OPPOSED = -0.3
"""Whose ways lead apart by more than this (cosine) are in each other's way."""

BLOCKED = 1.0
"""Who is nearer than this in front blocks the way, metres."""

QUEUING = 5.0
"""In a queue people are so many times as patient."""


@kernel
def mixed(a: int, b: int, seed: int) -> float:
    """A number from 0 to 1 that only looks random (splitmix64)."""
    v = np.uint64(a) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(b) * np.uint64(0xBF58476D1CE4E5B9) + np.uint64(seed)
    v = (v ^ (v >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    v = (v ^ (v >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    v = v ^ (v >> np.uint64(31))
    return float(v >> np.uint64(11)) / 9007199254740992.0


@kernel
def decide(
    people: People,
    moving: Moving,
    ways: Ways,
    ground: Ground,
    things: np.ndarray,
    standing: int,
    seen: np.ndarray,
    count: int,
    c: int,
    dx: float,
    dz: float,
    wish: float,
    frame: int,
    seed: int,
    elapsed: float,
    targets: np.ndarray,
    costs: np.ndarray,
) -> None:
    """Rule and costs of what somebody may do next; out of a jam if need be."""
    moving.jammed_next[c] = moving.jammed[c] if moving.retreat[c] > 0.0 else 0.0
    moving.opposed[c] = False
    moving.wants_next[c, 0], moving.wants_next[c, 1] = 0.0, 0.0
    if wish < REST:
        moving.rule[c], moving.other[c], moving.contact[c], moving.chosen_side[c] = STAND, -1, np.inf, 0.0
        targets[:], costs[:] = 0.0, np.inf
        costs[0] = 0.0
        return
    speed = math.hypot(moving.velocity[c, 0], moving.velocity[c, 1])
    if moving.retreat[c] > 0.0:
        moving.retreat[c] -= elapsed
        rule, other, contact, side, most = GIVE_WAY, -1, np.inf, 0.0, np.inf
    else:
        rule, other, contact, side, most = answer(
            people, moving, ground, things, standing, seen, count, c, dx, dz, wish, elapsed
        )
        if rule == ON_THE_WAY and people.points[c] >= 2:
            px, pz, _, _ = place_at(people, ways, c, moving.place[c])
            if math.hypot(moving.position[c, 0] - px, moving.position[c, 1] - pz) > 0.3 + abs(people.slot[c]):
                rule = RETURN
        # Nobody who waits by a rule of theirs is stuck.
        if speed < SLOW and rule != WAIT:
            moving.stuck[c] += elapsed
        else:
            moving.stuck[c] = max(moving.stuck[c] - 2.0 * elapsed, 0.0) if rule != WAIT else moving.stuck[c]
        luck = mixed(people.number[c], frame, seed)
        patience = (0.6 if people.waits[c] else 1.0) * PATIENCE * (1.0 + 2.0 * people.rank[c])
        if moving.stuck[c] > STUCK:
            gap, moving.opposed[c], jammed = in_front(moving, seen, count, c, people.radius[c], dx, dz)
            close = gap < TIGHT or gap >= BLOCKED  # or held fast from the side
            wedged = close and moving.stuck[c] > WEDGED * (1.0 + people.rank[c])
            jammed = max(jammed, 1.0 if moving.opposed[c] else 0.5 if wedged else 0.0)
            moving.jammed_next[c] = jammed
            behind = room_in(seen, count, people.radius[c], -dx, -dz)
            back = (
                jammed > 0.0
                and (gap < ROOM or close)
                and luck < STEPPING_BACK
                and behind > (ROOM if jammed == 1.0 else A_BIT)
            )
            if jammed == 0.0:
                patience *= QUEUING
            elif back or jammed == 1.0:
                x, z = moving.position[c, 0], moving.position[c, 1]
                own = people.side[c] if people.side[c] != 0.0 else -1.0
                if back and jammed == 1.0:
                    dx, dz, behind = back_aside(
                        ground, things, standing, seen, count, x, z, people.radius[c], dx, dz, own, behind
                    )
                elif back:
                    dx, dz = -dx, -dz
                else:
                    if luck > 1.0 - CONTRARY:
                        own = -own
                    dx, dz = round_the_jam(ground, things, standing, x, z, people.radius[c], dx, dz, own)
                longest = STEP_BACK if jammed == 1.0 else STEP_BACK_A_BIT
                moving.retreat[c] = min(longest, behind / BACK) if back else GOING_ROUND * (0.6 + 0.8 * luck)
                moving.retreat_way[c, 0], moving.retreat_way[c, 1] = dx, dz
                rule, most, side = GIVE_WAY, np.inf, 0.0
                moving.stuck[c] = 0.5 * STUCK
                patience = np.inf
        if moving.stuck[c] > patience:
            bx, bz, space = way_out(
                ground,
                things,
                standing,
                seen,
                count,
                moving.position[c, 0],
                moving.position[c, 1],
                people.radius[c],
                dx,
                dz,
                luck,
            )
            if space > 0.3:  # else one waits on, and those behind see it
                moving.stuck[c] = 0.0
                moving.retreat[c] = 0.8 + 1.6 * luck
                moving.retreat_way[c, 0], moving.retreat_way[c, 1] = bx, bz
                dx, dz, rule, most, side = bx, bz, GIVE_WAY, np.inf, 0.0
    moving.rule[c], moving.other[c], moving.contact[c], moving.chosen_side[c] = rule, other, contact, side
    moving.wants_next[c, 0], moving.wants_next[c, 1] = dx, dz
    if rule == WAIT:
        targets[:], costs[:] = 0.0, np.inf
        costs[0] = 0.0
        return
    weigh(
        people, moving, ground, things, standing, seen, count, c, dx, dz, wish, rule, other, side, most, targets, costs
    )


@kernel
def in_front(
    moving: Moving, seen: np.ndarray, count: int, c: int, radius: float, dx: float, dz: float
) -> tuple[float, bool, float]:
    """Gap to the nearest one in front, whether somebody there wants to go elsewhere, how jammed somebody is."""
    nearest, opposed, jammed = BLOCKED, False, 0.0
    for m in range(count):
        o = seen[m]
        away = math.hypot(o[PX], o[PZ])
        gap = away - radius - o[RADIUS]
        if gap < BLOCKED and o[PX] * dx + o[PZ] * dz > CONE * away:
            nearest = min(nearest, gap)
            opposed = opposed or o[BX] * moving.bound[c, 0] + o[BZ] * moving.bound[c, 1] < OPPOSED
            jammed = max(jammed, o[JAMMED])
    return nearest, opposed, jammed


@kernel
def gradual(moving: Moving, c: int, ux: float, uz: float, elapsed: float) -> tuple[float, float]:
    """A new velocity to aim at, no further round from the one before than one turns to gradually; if there is time."""
    wish, aim = math.hypot(ux, uz), math.hypot(moving.target[c, 0], moving.target[c, 1])
    speed = math.hypot(moving.velocity[c, 0], moving.velocity[c, 1])
    if moving.contact[c] < URGENT or speed < UNHURRIED or wish < REST or aim < REST:
        return ux, uz
    tx, tz = moving.target[c, 0] / aim, moving.target[c, 1] / aim
    angle = math.atan2(ux * tz - uz * tx, ux * tx + uz * tz)
    most = CHANGING * elapsed
    if abs(angle) <= most:
        return ux, uz
    sine, cosine = math.sin(math.copysign(most, angle)), math.cos(most)
    return wish * (tx * cosine + tz * sine), wish * (tz * cosine - tx * sine)


@kernel
def cheapest(costs: np.ndarray) -> int:
    """The first of the lowest."""
    best = 0
    for k in range(1, len(costs)):
        if costs[k] < costs[best]:
            best = k
    return best
