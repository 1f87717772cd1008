"""One frame of many characters: the step as a column of stages (KS07 "Synthesis")."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stridecast.geometry.kernels import kernel
from stridecast.steering.kernels import limit, pull
from stridecast.synthesis.blend_kernels import (
    blended,
    change_size,
    close_seam,
    open_seam,
    seconds_per_generic,
    show_features,
)
from stridecast.synthesis.choice_kernels import begin_segment
from stridecast.synthesis.feet_kernels import plant_feet
from stridecast.synthesis.given_kernels import STAND, aim_feet, next_segment_of_given, take_over, watch_feet
from stridecast.synthesis.pose_kernels import compose
from stridecast.synthesis.state import State
from stridecast.synthesis.tables import Tables

POINT, FORCE, PLAN, GIVEN = 0, 1, 2, 3
"""Kinds of wishes: a point to follow, a force, the acceleration of somebody who has planned the way, a vehicle."""
SEEN_HALF_LIFE = 0.07
"""How the point moves is smoothed with this half-life, seconds."""

SETTLED = 0.15
"""A point slower than this is at rest, m/s."""

EASE = 0.7
"""Share of the bounds that making up for a distance counts on."""

MOVED = 0.12
"""A character who stands goes on once the point has moved so far, metres."""

LEFT_BEHIND = 2.0
"""... or is so far away, metres."""

SLOWEST_PACE = 0.4
"""Starts and stops play no slower than this, as a part of the recorded pace."""

REACTION = 0.2
"""Time until a stop begins, on average, seconds."""

WISH_TO_GO = 0.3
"""Slower than this nobody starts to walk, m/s; as a force: m/s2."""

GOING = 0.4
"""Below this speed a force says that one is to go, whatever its direction; above it may also brake, m/s."""

WISH_TO_STOP = 0.55
"""A wished speed below this beside a point at rest is an arrival, m/s."""


class Given(NamedTuple):
    """Vehicles that move by themselves."""

    position: np.ndarray  # C 2
    velocity: np.ndarray  # C 2
    acceleration: np.ndarray  # C 2
    heading: np.ndarray  # C


@kernel
def step_block(
    tables: Tables,
    state: State,
    points: np.ndarray,
    forces: np.ndarray,
    kind: np.ndarray,
    rests_in: np.ndarray,
    motions: np.ndarray,
    given: Given,
    active: np.ndarray,
    alpha: float,
    beta: float,
    steps: np.ndarray,
    first: int,
    last: int,
) -> None:
    """Advance those of characters ``first`` to ``last`` who are active by one frame, of ``steps`` seconds each."""
    for c in range(first, last):
        if not active[c]:
            continue
        dt, meant = steps[c], state.meant[c]
        state.given[c] = kind[c] == GIVEN
        if state.given[c]:
            take_over(state, given, c, dt)
            begun = next_segment_of_given(tables, state, c, motions[c], dt)
            aim_feet(tables, state, c, rests_in[c])
        else:
            state.scale[c], state.lead[c], state.lift[c] = 1.0, 0.0, 0.0
            watch_point(state, points, kind, c, dt)
            request = motion_wanted(tables, state, points, forces, kind, motions[c], alpha, beta, c)
            begun = next_segment_if_due(tables, state, c, request, rests_in[c], dt)
            move_vehicle(tables, state, points, forces, kind, rests_in[c], request, alpha, beta, c, dt)
        if state.size[c, 0] != state.size[c, 2]:
            change_size(state.size[c], state.fresh[c], dt)
        blended(tables, state, c, state.generic[c], meant)
        if begun and not state.fresh[c]:
            open_seam(tables, state, c, meant, dt)
        show_features(state, c, meant)
        compose(tables, state, c)
        plant_feet(tables, state, c, dt)
        close_seam(state, c, dt)
        if state.given[c]:
            watch_feet(tables, state, c)
        state.elapsed[c] = dt
        state.fresh[c] = False


@kernel
def watch_point(state: State, points: np.ndarray, kind: np.ndarray, c: int, dt: float) -> None:
    """How the point moves, smoothed over a tenth of a second."""
    if kind[c] != POINT:
        return
    if state.fresh[c]:
        state.anchor[c, 0], state.anchor[c, 1] = state.position[c, 0], state.position[c, 1]
    else:
        for k in range(2):
            rate = (points[c, k] - state.seen[c, k]) / dt
            state.seen_velocity[c, k] += (rate - state.seen_velocity[c, k]) * (1.0 - 0.5 ** (dt / SEEN_HALF_LIFE))
    state.seen[c, 0], state.seen[c, 1] = points[c, 0], points[c, 1]


@kernel
def seen_speed(state: State, c: int) -> float:
    """How fast the point moves, m/s."""
    return math.hypot(state.seen_velocity[c, 0], state.seen_velocity[c, 1])


@kernel
def motion_wanted(
    tables: Tables,
    state: State,
    points: np.ndarray,
    forces: np.ndarray,
    kind: np.ndarray,
    motion: int,
    alpha: float,
    beta: float,
    c: int,
) -> int:
    """The motion asked for; standing at first, once the point is reached and rests, or while there is nowhere to go."""
    if motion == STAND or state.fresh[c]:
        return STAND
    standing = tables.leads_to[state.group[c]] == STAND
    if kind[c] == PLAN:
        return motion
    if kind[c] == FORCE:
        force = math.hypot(forces[c, 0], forces[c, 1])
        return STAND if standing and force < WISH_TO_GO else motion
    away = math.hypot(points[c, 0] - state.position[c, 0], points[c, 1] - state.position[c, 1])
    wish, moving = alpha / beta * away, seen_speed(state, c)
    if standing or state.arriving[c]:
        # Stay with the decision until the point goes on, or turns out to be far away.
        moved = math.hypot(points[c, 0] - state.anchor[c, 0], points[c, 1] - state.anchor[c, 1])
        if (moved > MOVED and wish > WISH_TO_GO and moving > SETTLED) or (standing and away > LEFT_BEHIND):
            state.arriving[c] = False
            return motion
        return STAND
    rests = moving < SETTLED and (wish < WISH_TO_STOP or away < stopping_way(tables, state, c))
    if rests or (wish < 0.5 * WISH_TO_GO and moving < WISH_TO_GO):
        state.anchor[c, 0], state.anchor[c, 1] = points[c, 0], points[c, 1]
        state.arriving[c] = True
        return STAND
    return motion


@kernel
def stopping_way(tables: Tables, state: State, c: int) -> float:
    """How far the vehicle goes on if it is to stop now: until its next segment, and then braking, metres."""
    speed = math.hypot(state.velocity[c, 0], state.velocity[c, 1])
    brake = max(-tables.tangential[state.group[c], 0, 0], 0.3)
    return speed * REACTION + 0.5 * speed * speed / brake


@kernel
def next_segment_if_due(tables: Tables, state: State, c: int, request: int, rests_in: float, dt: float) -> bool:
    """Let the segment run on by one frame; begin the next where it ends, or at once where standing is to end."""
    if state.fresh[c]:
        begin_segment(tables, state, c, request, 0.0)
        return True
    slope = seconds_per_generic(tables, state, c)
    state.generic[c] += dt / slope * pace(tables, state, c, rests_in, slope)
    g = state.group[c]
    idle = tables.comes_from[g] == STAND and tables.leads_to[g] == STAND
    if state.generic[c] >= 1.0:
        begin_segment(tables, state, c, request, (state.generic[c] - 1.0) * slope)
        return True
    if idle and request != STAND:
        begin_segment(tables, state, c, request, 0.0)
        return True
    return False


@kernel
def eased(state: State, c: int, x: float, z: float, k: float, brake: float, jerk: float) -> float:
    """By how much the spring's wished velocity ``(x, z)`` is scaled so that the vehicle can meet the point in time.

    KS07's spring asks for a speed in proportion to the distance, also when the bounds forbid to lose that speed again
    before the point is reached; the vehicle would swing to and fro. The distance that is more (or less) than an evenly
    moving point keeps ahead may be made up only as fast as the bounds can take the difference in speed back.
    """
    wish = math.hypot(x, z)
    if wish < 1e-6:
        return 1.0
    own = (state.seen_velocity[c, 0] * x + state.seen_velocity[c, 1] * z) / wish
    gap = (wish - max(own, 0.0)) / k
    a, j = EASE * max(brake, 0.1), EASE * jerk
    lead = 0.5 * a / j
    most = a * (math.sqrt(lead * lead + 2.0 * abs(gap) / a) - lead)
    if gap > 0.0:
        return min(wish, max(own, 0.0) + most) / wish
    return max(wish, own - most) / wish


@kernel
def pace(tables: Tables, state: State, c: int, rests_in: float, slope: float) -> float:
    """How fast a start or a stop plays: slower where its vehicle needs longer than the example to get going or to rest.

    Three quarters of the greatest acceleration allowed is what it can count on, as it builds up and is taken back. A
    plan says when it rests.
    """
    g = state.group[c]
    starts, stops = tables.comes_from[g] == STAND, tables.leads_to[g] == STAND
    if starts == stops:
        return 1.0
    speed = math.hypot(state.velocity[c, 0], state.velocity[c, 1])
    left = (1.0 - min(state.generic[c], 1.0)) * slope
    if stops and rests_in < math.inf:
        need = rests_in if tables.to_rest[g] else 0.0
    elif stops:
        need = speed / max(-0.375 * (tables.tangential[g, 0, 0] + tables.tangential[g, 1, 0]), 0.1)
    else:
        need = (tables.speed[g, 1, 0] - speed) / max(
            0.375 * (tables.tangential[g, 0, 1] + tables.tangential[g, 1, 1]), 0.1
        )
    if need <= left:
        return 1.0
    return max(left / need, SLOWEST_PACE)


@kernel
def move_vehicle(
    tables: Tables,
    state: State,
    points: np.ndarray,
    forces: np.ndarray,
    kind: np.ndarray,
    rests_in: float,
    request: int,
    alpha: float,
    beta: float,
    c: int,
    dt: float,
) -> None:
    """Force, clamping, integration: the vehicle's frame (KS07 "Force Extraction", "Clamping Outliers")."""
    g = state.group[c]
    u = min(state.generic[c], 1.0)
    sine, cosine = math.sin(state.heading[c]), math.cos(state.heading[c])
    speed = math.hypot(state.velocity[c, 0], state.velocity[c, 1])

    # The bounds of the group, linear from its first frame to its last; speed from what it was when the segment began.
    jerk, wide = tables.jerk[g], tables.lateral_per_speed[g]
    low = (1.0 - u) * tables.tangential[g, 0, 0] + u * tables.tangential[g, 1, 0]
    high = (1.0 - u) * tables.tangential[g, 0, 1] + u * tables.tangential[g, 1, 1]
    slowest = (1.0 - u) * min(tables.speed[g, 0, 0], state.started[c]) + u * tables.speed[g, 1, 0]
    fastest = (1.0 - u) * max(tables.speed[g, 0, 1], state.started[c]) + u * tables.speed[g, 1, 1]

    # The wish, in the vehicle's frame.
    if kind[c] == PLAN and (tables.comes_from[g] != STAND or tables.leads_to[g] != STAND):
        wish_t = forces[c, 0] * sine + forces[c, 1] * cosine
        wish_l = forces[c, 0] * cosine - forces[c, 1] * sine
    elif kind[c] == FORCE and request != STAND:
        wish_t = forces[c, 0] * sine + forces[c, 1] * cosine
        wish_l = forces[c, 0] * cosine - forces[c, 1] * sine
        if speed < GOING:
            # Nobody pushes off sideways or backwards: off ahead, and round from there.
            wish_t = math.hypot(wish_t, wish_l)
    elif tables.leads_to[g] == STAND:
        # Coming to rest: at the end of the segment, with nothing left of the acceleration.
        if tables.comes_from[g] == STAND:
            wish_t = -speed / dt
        else:
            slope = seconds_per_generic(tables, state, c)
            left = max((1.0 - u) * slope / pace(tables, state, c, rests_in, slope), 2.0 * dt)
            wish_t = -2.0 * speed / left if speed > 0.02 else -speed / dt
        wish_l = 0.0
    else:
        k = alpha / beta
        x, z = k * (points[c, 0] - state.position[c, 0]), k * (points[c, 1] - state.position[c, 1])
        ease = eased(state, c, x, z, k, 0.5 * (high - low), jerk)
        x, z = ease * x, ease * z
        along, across = x * sine + z * cosine, x * cosine - z * sine
        at_least, at_most = slowest, fastest + tables.rising[g]  # what rises is not aimed at but passed
        if request == STAND:
            along, across = 0.0, 0.0
        if tables.comes_from[g] < request:
            at_least = max(at_least, min(tables.approach[g, request, 0], fastest))
        elif tables.comes_from[g] > request:
            at_most = min(at_most, max(tables.approach[g, request, 1], slowest))
        wish_t, wish_l, state.side[c] = pull(
            along, across, speed, at_least, max(at_least, at_most), beta, jerk, state.side[c], dt
        )

    had_t = state.acceleration[c, 0] * sine + state.acceleration[c, 1] * cosine
    had_l = state.acceleration[c, 0] * cosine - state.acceleration[c, 1] * sine
    t, lateral, least, most, widest, acted = limit(
        wish_t,
        wish_l,
        had_t,
        had_l,
        speed,
        jerk,
        tables.later_jerk[g],
        low,
        high,
        wide,
        slowest,
        fastest,
        dt,
        tables.rising[g],
    )

    ax, az = t * sine + lateral * cosine, t * cosine - lateral * sine
    vx, vz = state.velocity[c, 0] + ax * dt, state.velocity[c, 1] + az * dt
    now = math.hypot(vx, vz)
    state.acceleration[c, 0], state.acceleration[c, 1] = ax, az
    state.velocity[c, 0], state.velocity[c, 1] = vx, vz
    state.position[c, 0] += vx * dt
    state.position[c, 1] += vz * dt
    if now > 1e-3 and vx * sine + vz * cosine > 0.0:
        state.heading[c] = math.atan2(vx, vz)
    bounds = state.bounds[c]
    bounds[0] = max(jerk, math.hypot(t - had_t, lateral - had_l) / dt)
    bounds[1], bounds[2], bounds[3] = least, most, widest
    bounds[4], bounds[5] = min(slowest, now), max(fastest, now)
    state.acted[c] = acted
