"""One frame of a crowd: all read what was, then all write what is (as RVO2 does), each in a column of stages."""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.choice_kernels import CHOICES, SHARES, weigh
from stridecast.crowd.ground_kernels import room, standing_near
from stridecast.crowd.neighbour_kernels import BX, BZ, FIELDS, JAMMED, PX, PZ, RADIUS, cell_of, look
from stridecast.crowd.rule_kernels import answer
from stridecast.crowd.rules import GIVE_WAY, HELD, ON_THE_WAY, RETURN, STAND, WAIT
from stridecast.crowd.safety_kernels import HAIR, apart, clear_of_ground
from stridecast.crowd.state import Cells, Ground, Limits, Moving, People, Scratch, Ways
from stridecast.crowd.vehicle_kernels import REST, advance, stop
from stridecast.crowd.way_kernels import (
    company_pace,
    find_place,
    look_ahead,
    place_at,
    room_in,
    round_the_jam,
    wanted,
    way_out,
)
from stridecast.geometry.kernels import kernel

SIGHT = 16.0
"""Others are looked at within this, metres ..."""

SEEN = 24
"""... and no more than so many, the nearest."""

STANDING = 24
"""So many walls and obstacles near somebody are looked at, the nearest."""

REACH = 5.0
"""... within this, metres."""

DECIDES = 0.1
"""Everybody decides anew about so often, seconds."""

CHANGING = 0.8
"""The direction that is aimed at changes no faster than this, rad/s, lest people waver, ..."""

URGENT, UNHURRIED = 0.8, 0.3
"""... unless they would meet somebody within this, seconds, or hardly move, m/s."""

TRIES = 8
"""So many velocities are tried, the best first, until one leaves room to stop."""

SLOW = 0.08
"""Who wants to go and is slower than this does not get on, m/s."""

PATIENCE = 1.5
"""Who has not got on for so long gives way, seconds; those who rather wait sooner, some by chance later."""


STUCK = 0.7
"""Who has not got on for so long and is blocked by somebody who wants to go elsewhere is in a jam, seconds."""

ROOM = 0.4
"""Behind people who block each other there should be so much room, metres ..."""

STEPPING_BACK, STEP_BACK = 0.6, 1.5
"""... so this part of those who have less step back, for so long (seconds) ..."""

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


def make_scratch() -> Scratch:
    """Room for one thread."""
    return Scratch(
        near=np.zeros(SEEN, np.int64),
        gaps=np.zeros(SEEN),
        seen=np.zeros((SEEN, FIELDS)),
        things=np.zeros(STANDING, np.int64),
        targets=np.zeros((CHOICES, 2)),
        costs=np.zeros(CHOICES),
    )


@kernel
def mixed(a: int, b: int, seed: int) -> float:
    """A number from 0 to 1 that only looks random (splitmix64)."""
    v = np.uint64(a) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(b) * np.uint64(0xBF58476D1CE4E5B9) + np.uint64(seed)
    v = (v ^ (v >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    v = (v ^ (v >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    v = v ^ (v >> np.uint64(31))
    return float(v >> np.uint64(11)) / 9007199254740992.0


@kernel
def propose(
    people: People,
    moving: Moving,
    ways: Ways,
    ground: Ground,
    limits: Limits,
    cells: Cells,
    scratch: Scratch,
    farthest: float,
    widest: float,
    frame: int,
    seed: int,
    dt: float,
    begin: int,
    end: int,
) -> None:
    """The read phase: what each of the rows ``begin`` to ``end`` would do, without touching what others read."""
    seen, things, targets, costs = scratch.seen, scratch.things, scratch.targets, scratch.costs
    every = max(round(DECIDES / dt), 1)
    for c in range(begin, end):
        if not moving.here[c]:
            continue
        moving.held[c] = False
        if people.scripted[c]:
            moving.free[c] = conflict(people, moving, cells, farthest, widest, c, False) < 0
            continue
        x, z = moving.position[c, 0], moving.position[c, 1]
        standing = standing_near(ground, x, z, REACH, things)
        decides = (frame + people.number[c]) % every == 0
        if not decides and try_target(
            people,
            moving,
            ground,
            limits,
            cells,
            farthest,
            widest,
            things,
            standing,
            c,
            moving.target[c, 0],
            moving.target[c, 1],
            dt,
        ):
            continue
        count = look(people, moving, cells, c, SIGHT, scratch)
        dx, dz, wish = wanted(people, moving, ways, ground, things, standing, c)
        if people.company[c] >= 0 and wish > 0.0:
            wish *= company_pace(seen, count, dx, dz)
        decide(
            people,
            moving,
            ways,
            ground,
            things,
            standing,
            seen,
            count,
            c,
            dx,
            dz,
            wish,
            frame,
            seed,
            every * dt if decides else dt,
            targets,
            costs,
        )
        moving.free[c] = False
        for n in range(TRIES):
            best = cheapest(costs)
            if not costs[best] < np.inf:
                break
            ux, uz = targets[best, 0], targets[best, 1]
            if n == 0:  # first gradually
                ux, uz = gradual(moving, c, ux, uz, every * dt)
            if try_target(people, moving, ground, limits, cells, farthest, widest, things, standing, c, ux, uz, dt):
                moving.target[c, 0], moving.target[c, 1] = ux, uz
                break
            if n == 0 and (ux != targets[best, 0] or uz != targets[best, 1]):
                continue  # there is no room for a gradual turn: at once then
            same = best - best % len(SHARES) if best < CHOICES - 1 else best
            if moving.velocity[c, 0] == 0.0 and moving.velocity[c, 1] == 0.0:
                costs[same : same + len(SHARES)] = np.inf  # from rest the first step is the same at any speed
            costs[best] = np.inf
        if not moving.free[c]:
            moving.target[c] = 0.0
            moving.held[c] = True


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
    moving.jammed_next[c] = moving.retreat[c] > 0.0
    moving.opposed[c] = False
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
            wedged = gap < TIGHT and moving.stuck[c] > WEDGED * (1.0 + people.rank[c])
            moving.jammed_next[c] = jammed or moving.opposed[c] or wedged
            if not moving.jammed_next[c]:
                patience *= QUEUING
            else:
                narrow = gap < ROOM
                back = narrow and luck < STEPPING_BACK and room_in(seen, count, people.radius[c], -dx, -dz) > ROOM
                if back:
                    dx, dz = -dx, -dz
                else:
                    own = people.side[c] if people.side[c] != 0.0 else -1.0
                    if luck > 1.0 - CONTRARY:
                        own = -own
                    x, z = moving.position[c, 0], moving.position[c, 1]
                    dx, dz = round_the_jam(ground, things, standing, x, z, people.radius[c], dx, dz, own)
                moving.retreat[c] = STEP_BACK if back else GOING_ROUND * (0.6 + 0.8 * luck)
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
            moving.stuck[c] = 0.0
            if space > 0.3:
                moving.retreat[c] = 0.8 + 1.6 * luck
                moving.retreat_way[c, 0], moving.retreat_way[c, 1] = bx, bz
                dx, dz, rule, most, side = bx, bz, GIVE_WAY, np.inf, 0.0
    moving.rule[c], moving.other[c], moving.contact[c], moving.chosen_side[c] = rule, other, contact, side
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
) -> tuple[float, bool, bool]:
    """Gap to the nearest one in front, whether somebody there wants to go elsewhere, whether somebody is jammed."""
    nearest, opposed, jammed = BLOCKED, False, False
    for m in range(count):
        o = seen[m]
        away = math.hypot(o[PX], o[PZ])
        gap = away - radius - o[RADIUS]
        if gap < BLOCKED and o[PX] * dx + o[PZ] * dz > CONE * away:
            nearest = min(nearest, gap)
            opposed = opposed or o[BX] * moving.bound[c, 0] + o[BZ] * moving.bound[c, 1] < OPPOSED
            jammed = jammed or o[JAMMED] > 0.0
    return nearest, opposed, jammed


@kernel
def try_target(
    people: People,
    moving: Moving,
    ground: Ground,
    limits: Limits,
    cells: Cells,
    farthest: float,
    widest: float,
    things: np.ndarray,
    standing: int,
    c: int,
    ux: float,
    uz: float,
    dt: float,
) -> bool:
    """Propose the step towards a velocity; whether it leaves everybody the room in which they can stop."""
    runs = people.runs[c]
    x, z, vx, vz, ax, az, heading, turning = advance(
        limits,
        runs,
        moving.position[c, 0],
        moving.position[c, 1],
        moving.velocity[c, 0],
        moving.velocity[c, 1],
        moving.acceleration[c, 0],
        moving.acceleration[c, 1],
        moving.heading[c],
        moving.turning[c],
        ux,
        uz,
        dt,
    )
    n = stop(limits, x, z, vx, vz, ax, az, dt, moving.meant[c])
    moving.meant_stops[c] = n
    out = moving.next[c]
    out[0], out[1], out[2], out[3], out[4], out[5], out[6] = x, z, vx, vz, ax, az, heading
    moving.next_turning[c] = turning
    x, z = moving.position[c, 0], moving.position[c, 1]
    moving.free[c] = clear_of_ground(ground, things, standing, x, z, moving.meant[c], n, people.radius[c]) and (
        conflict(people, moving, cells, farthest, widest, c, False) < 0
    )
    return moving.free[c]


@kernel
def conflict(
    people: People,
    moving: Moving,
    cells: Cells,
    farthest: float,
    widest: float,
    c: int,
    proposals: bool,
) -> int:
    """Somebody whom the proposal of ``c`` leaves no room: by their commitment, or by a proposal that goes before.

    -1 if there is nobody. ``farthest`` is the longest stopping distance of all, ``widest`` the largest radius.
    """
    meant, n = moving.meant[c], moving.meant_stops[c]
    x, z = moving.position[c, 0], moving.position[c, 1]
    own = math.hypot(meant[n - 1, 0] - x, meant[n - 1, 1] - z)
    reach = 1.1 * (own + farthest) + people.radius[c] + widest + 0.3
    low, high = cell_of(cells, x - reach, z - reach), cell_of(cells, x + reach, z + reach)
    nz = cells.shape[1]
    for i in range(low // nz, high // nz + 1):
        for k in range(low % nz, high % nz + 1):
            for e in range(cells.first[i * nz + k], cells.first[i * nz + k + 1]):
                j = cells.rows[e]
                if j == c:
                    continue
                if proposals and not (moving.free[j] and goes_before(people, moving, j, c)):
                    continue
                now = math.hypot(moving.position[j, 0] - x, moving.position[j, 1] - z)
                if now > reach:
                    continue
                least = min(people.radius[c] + people.radius[j] + HAIR, now)
                if proposals:
                    clear = apart(meant, n, moving.meant[j], moving.meant_stops[j], 0, least)
                else:
                    clear = apart(meant, n, moving.path[j], moving.stops[j], 1, least)
                if not clear:
                    return int(j)
    return -1


@kernel
def fits(
    people: People,
    moving: Moving,
    ground: Ground,
    limits: Limits,
    state: np.ndarray,
    radius: float,
    things: np.ndarray,
    path: np.ndarray,
    dt: float,
) -> bool:
    """Whether somebody who appears in a state has room to stop, and leaves it to everybody else."""
    n = stop(limits, state[0], state[1], state[2], state[3], state[4], state[5], dt, path)
    standing = standing_near(ground, state[0], state[1], REACH, things)
    for m in range(standing):
        if room(ground, things[m], state[0], state[1]) < radius:
            return False
    if not clear_of_ground(ground, things, standing, state[0], state[1], path, n, radius):
        return False
    for j in range(len(moving.here)):
        if moving.here[j] and not apart(path, n, moving.path[j], moving.stops[j], 0, radius + people.radius[j] + HAIR):
            return False
    return True


@kernel
def goes_before(people: People, moving: Moving, j: int, c: int) -> bool:
    """Whether ``j`` goes before ``c`` where both want the same room: who is stuck longer, then who ranks higher."""
    if moving.stuck[j] != moving.stuck[c]:
        return moving.stuck[j] > moving.stuck[c]
    if people.rank[j] != people.rank[c]:
        return people.rank[j] > people.rank[c]
    return people.number[j] < people.number[c]


@kernel
def settle(
    people: People,
    moving: Moving,
    cells: Cells,
    farthest: float,
    widest: float,
    granted: np.ndarray,
    begin: int,
    end: int,
) -> None:
    """Of two proposals that leave each other no room, the one that goes before is granted."""
    for c in range(begin, end):
        granted[c] = (
            moving.here[c] and moving.free[c] and conflict(people, moving, cells, farthest, widest, c, True) < 0
        )


@kernel
def write(
    people: People, moving: Moving, ways: Ways, limits: Limits, granted: np.ndarray, dt: float, begin: int, end: int
) -> None:
    """The write phase: take the step proposed, or brake."""
    for c in range(begin, end):
        if not moving.here[c]:
            continue
        if granted[c]:
            n = moving.meant_stops[c]
            for k in range(n):
                moving.path[c, k, 0], moving.path[c, k, 1] = moving.meant[c, k, 0], moving.meant[c, k, 1]
            moving.stops[c] = n
            out = moving.next[c]
            moving.turning[c] = moving.next_turning[c]
            moving.position[c, 0], moving.position[c, 1] = out[0], out[1]
            moving.velocity[c, 0], moving.velocity[c, 1] = out[2], out[3]
            moving.acceleration[c, 0], moving.acceleration[c, 1] = out[4], out[5]
            moving.heading[c] = out[6]
        elif people.scripted[c]:
            moving.velocity[c] = 0.0
            moving.held[c] = True
        else:
            n = moving.stops[c]
            if n > 1:
                for k in range(n - 1):
                    moving.path[c, k, 0], moving.path[c, k, 1] = moving.path[c, k + 1, 0], moving.path[c, k + 1, 1]
                moving.stops[c] = n - 1
            x, z, vx, vz, ax, az, heading, _ = advance(
                limits,
                people.runs[c],
                moving.position[c, 0],
                moving.position[c, 1],
                moving.velocity[c, 0],
                moving.velocity[c, 1],
                moving.acceleration[c, 0],
                moving.acceleration[c, 1],
                moving.heading[c],
                0.0,
                0.0,
                0.0,
                dt,
            )
            moving.position[c, 0], moving.position[c, 1] = x, z
            moving.velocity[c, 0], moving.velocity[c, 1] = vx, vz
            moving.acceleration[c, 0], moving.acceleration[c, 1] = ax, az
            moving.heading[c], moving.turning[c] = heading, 0.0
            moving.held[c] = True
            if moving.rule[c] != STAND:
                moving.rule[c] = HELD
        moving.jammed[c] = moving.jammed_next[c]
        find_place(people, moving, ways, c)
        look_ahead(people, moving, ways, c)
