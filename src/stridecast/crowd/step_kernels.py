"""One frame of a crowd: all read what was, then all write what is (as RVO2 does), each in a column of stages."""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.choice_kernels import CHOICES, SHARES
from stridecast.crowd.decision_kernels import cheapest, decide, gradual
from stridecast.crowd.ground_kernels import room, standing_near
from stridecast.crowd.neighbour_kernels import FIELDS, cell_of, look
from stridecast.crowd.rules import HELD, STAND
from stridecast.crowd.safety_kernels import HAIR, apart, clear_of_ground
from stridecast.crowd.state import Cells, Ground, Limits, Moving, People, Scratch, Ways
from stridecast.crowd.vehicle_kernels import advance, stop
from stridecast.crowd.way_kernels import company_pace, find_place, look_ahead, wanted
from stridecast.geometry.kernels import kernel

SIGHT = 16.0
"""Others are looked at within this, metres ..."""

SEEN = 24
"""... and no more than so many, the nearest."""

STANDING = 24
"""So many walls and obstacles near somebody are looked at, the nearest."""

REACH = 5.0
"""... within this, metres, ..."""

REACH_AHEAD = 2.5
"""... or as far as one gets in so many seconds."""

DECIDES = 0.1
"""Everybody decides anew about so often, seconds."""

TRIES = 8
"""So many velocities are tried, the best first, until one leaves room to stop."""


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
        standing = standing_near(ground, x, z, max(REACH, REACH_AHEAD * people.wish[c]), things)
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
        moving.wants[c, 0], moving.wants[c, 1] = moving.wants_next[c, 0], moving.wants_next[c, 1]
        find_place(people, moving, ways, c)
        look_ahead(people, moving, ways, c)
