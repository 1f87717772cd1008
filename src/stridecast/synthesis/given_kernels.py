"""Bodies of vehicles that move by themselves: crowds, other people's trajectories.

Such a vehicle goes at any speed, turns on the spot and brakes whenever it likes. Examples show no such slow, sharp or
broken steps, so they are played smaller and slower: step length times cadence is the speed of the vehicle. Feet are
put down where the vehicle will need them, and whoever comes to rest steps until the feet stand beside each other.
"""

from __future__ import annotations

import math

from stridecast.geometry.kernels import decay, kernel, wrap
from stridecast.synthesis.blend_kernels import blended, row_of, seconds_per_generic
from stridecast.synthesis.choice_kernels import begin_group, begin_segment, describe_vehicle, first_group
from stridecast.synthesis.state import NEIGHBOURS, State
from stridecast.synthesis.tables import Tables

STAND, WALK, RUN = 0, 1, 2

TURNING_HALF_LIFE = 0.06
"""How fast the vehicle turns is smoothed with this half-life, seconds."""

FASTEST_TURNING = 4.0
"""Nobody turns faster than this, rad/s: what does is no turn but a jump."""

AT_REST = 0.04
"""Slower than this a vehicle rests, m/s ..."""

NOT_TURNING = 0.08
"""... if it turns no faster than this, rad/s."""

TURNS = 0.3
"""Who stands steps at once if the vehicle turns faster than this, rad/s; below only once the feet are left behind."""

FEET_TOLERANCE, TWIST_TOLERANCE = 0.045, 0.22
"""Feet this far from where they belong under a standing body are astray by 1: metres and radians."""

HOME, ASTRAY = 1.0, 1.6
"""A body that comes to rest stands once its feet are less astray than this; one that stands steps beyond that."""

APPEARS_WALKING = 0.25
"""Who is placed anew and goes faster than this is seen walking in the first frame, m/s."""

MOST_TURN = 0.75
"""Steps get quicker so that the vehicle turns no further than this in a half cycle, radians ..."""

QUICKEST = 1.35
"""... but they are no quicker than this, as a part of the recorded pace."""

LARGEST = 1.2
"""Movements get no larger than this against the examples."""

SWING = 0.8
"""A foot in the air takes no longer than at this pace; who is slower waits with both feet on the floor."""

SCALE_HALF_LIFE = 0.06
"""Half of a change of how large movements are is done after this, seconds."""

STANCE = 1.35
"""How long a foot stands, in half cycles of walking."""

FARTHEST_LEAD = 0.2
"""A foot is put down no further from its place in the examples than this, metres ..."""

MOST_LEAD_TURN = 0.7
"""... and turned no further, radians."""

INNER, OUTER = 0.7, 0.2
"""Share of a stance's turn by which a foot is turned ahead when it comes down, inside the turn and outside."""

LANDS = 0.5
"""A foot that swings when a half cycle begins lands after about this part of it."""

CLEARANCE = 0.045
"""The smaller the step, the more of this is added to the height of the swinging foot, metres."""


@kernel
def take_over(state: State, given, c: int, dt: float) -> None:  # type: ignore[no-untyped-def]
    """The vehicle as it is given; the bounds in force are what it does."""
    speed = math.hypot(given.velocity[c, 0], given.velocity[c, 1])
    ax, az = given.acceleration[c, 0], given.acceleration[c, 1]
    if state.fresh[c]:
        sine, cosine = math.sin(given.heading[c]), math.cos(given.heading[c])
        state.turning[c] = (ax * cosine - az * sine) / speed if speed > APPEARS_WALKING else 0.0
        state.turning[c] = min(max(state.turning[c], -FASTEST_TURNING), FASTEST_TURNING)
        change = 0.0
    else:
        rate = wrap(given.heading[c] - state.heading[c]) / dt
        rate = min(max(rate, -FASTEST_TURNING), FASTEST_TURNING)
        state.turning[c] += (rate - state.turning[c]) * (1.0 - 0.5 ** (dt / TURNING_HALF_LIFE))
        change = math.hypot(ax - state.acceleration[c, 0], az - state.acceleration[c, 1]) / dt
    for k in range(2):
        state.position[c, k] = given.position[c, k]
        state.velocity[c, k] = given.velocity[c, k]
        state.acceleration[c, k] = given.acceleration[c, k]
    state.heading[c] = given.heading[c]
    most = math.hypot(ax, az)
    bounds = state.bounds[c]
    bounds[0], bounds[1], bounds[2], bounds[3], bounds[4], bounds[5] = change, -most, most, most, speed, speed
    state.acted[c] = 0


@kernel
def next_segment_of_given(tables: Tables, state: State, c: int, motion: int, dt: float) -> bool:
    """Let the segment run on at the pace of the vehicle; stand and step off as soon as feet and vehicle ask for it."""
    if state.fresh[c]:
        appear(tables, state, c, motion)
        return True
    g = state.group[c]
    idle = tables.comes_from[g] == STAND and tables.leads_to[g] == STAND
    request = motion_of_given(tables, state, c, motion, idle)
    if idle and request != STAND:
        step_off(tables, state, c, request)
        return True
    if request == STAND and not idle and tables.standing >= 0:
        state.scale[c], state.scale_rate[c] = 1.0, 0.0
        describe_vehicle(tables, state, c)
        begin_group(tables, state, c, first_group(tables, state, c, STAND), 0.0)
        return True
    slope = seconds_per_generic(tables, state, c)
    pace = 1.0
    if not idle:
        pace = pace_of_given(tables, state, c, request == STAND, dt)
    state.generic[c] += dt / slope * pace
    if state.generic[c] >= 1.0:
        begin_segment(tables, state, c, request, (state.generic[c] - 1.0) * slope)
        return True
    return False


@kernel
def appear(tables: Tables, state: State, c: int, motion: int) -> None:
    """The first frame of somebody nobody has seen: standing, or in the midst of the half cycle its phase says."""
    speed = math.hypot(state.velocity[c, 0], state.velocity[c, 1])
    state.scale[c], state.scale_rate[c] = 1.0, 0.0
    if motion == STAND or speed < APPEARS_WALKING:
        begin_segment(tables, state, c, STAND, 0.0)
        return
    request = gait(tables, motion, speed, False)
    half = 0 if state.phase[c] < 0.5 else 1
    describe_vehicle(tables, state, c)
    group = tables.halves[request, half]
    if group < 0:
        group = first_group(tables, state, c, request)
    # Nobody knows the pose before: examples are chosen by the vehicle, and then by the pose that follows from it.
    for _ in range(2):
        begin_group(tables, state, c, group, 0.0)
        blended(tables, state, c, 0.0, state.features[c])
    state.segments[c] = 1
    state.generic[c] = 2.0 * state.phase[c] - half
    ratio, _, _ = against_examples(tables, state, c)
    _, state.scale[c] = pace_and_scale(tables, state, c, ratio)


@kernel
def gait(tables: Tables, motion: int, speed: float, runs: bool) -> int:
    """Walking or running: as is asked for, where the speed allows it."""
    if tables.halves[RUN, 0] < 0 and tables.halves[RUN, 1] < 0:
        return WALK
    if tables.halves[WALK, 0] < 0 and tables.halves[WALK, 1] < 0:
        return RUN
    slowest, fastest = tables.run_from, tables.walk_to
    if motion == RUN:
        return RUN if speed > slowest - (0.4 if runs else 0.1) else WALK
    return RUN if speed > fastest + (0.0 if runs else 0.25) else WALK


@kernel
def motion_of_given(tables: Tables, state: State, c: int, motion: int, idle: bool) -> int:
    """Standing while the vehicle rests and the feet are where they belong; else walking or running."""
    speed = math.hypot(state.velocity[c, 0], state.velocity[c, 1])
    turning = abs(state.turning[c])
    h = tables.halves
    if max(h[WALK, 0], h[WALK, 1], h[RUN, 0], h[RUN, 1]) < 0:
        return STAND
    if idle:
        goes = state.astray[c] > ASTRAY or turning > TURNS or (speed > AT_REST and motion != STAND)
        return gait(tables, motion, speed, False) if goes else STAND
    rests = speed < AT_REST and turning < NOT_TURNING
    if rests and state.locked[c, 0] and state.locked[c, 1] and state.astray[c] < HOME:
        return STAND
    g = state.group[c]
    return gait(tables, motion, speed, tables.comes_from[g] == RUN or tables.leads_to[g] == RUN)


@kernel
def step_off(tables: Tables, state: State, c: int, request: int) -> None:
    """Begin to step: with the foot on the inside of a turn, else with the one that is left behind."""
    side = 1
    if abs(state.turning[c]) > NOT_TURNING:
        side = 0 if state.turning[c] > 0.0 else 1
    else:
        sine, cosine = math.sin(state.heading[c]), math.cos(state.heading[c])
        ahead_left = state.toe[c, 0, 0] * sine + state.toe[c, 0, 2] * cosine
        ahead_right = state.toe[c, 1, 0] * sine + state.toe[c, 1, 2] * cosine
        if ahead_left < ahead_right - 0.02:
            side = 0
    group, generic = tables.step_off[side], tables.step_off_at[side]
    if group < 0:
        describe_vehicle(tables, state, c)
        group, generic = first_group(tables, state, c, request), 0.0
    state.scale[c], state.scale_rate[c] = 0.0, 0.0
    begin_group(tables, state, c, group, generic)


@kernel
def against_examples(tables: Tables, state: State, c: int) -> tuple[float, float, float]:
    """Speed against the examples', by how much more the vehicle turns (rad/s), seconds of a half cycle."""
    rows = tables.times.shape[1]
    i, u = row_of(min(state.generic[c], 1.0), rows)
    speed, turning, duration = 0.0, 0.0, 0.0
    for n in range(NEIGHBOURS):
        w = state.weights[c, n]
        if w > 0.0:
            e = state.chosen[c, n]
            speed += w * ((1.0 - u) * tables.speeds[e, i] + u * tables.speeds[e, i + 1])
            turning += w * tables.turning[e]
            duration += w * tables.durations[e]
    sine, cosine = math.sin(state.heading[c]), math.cos(state.heading[c])
    ahead = max(state.velocity[c, 0] * sine + state.velocity[c, 1] * cosine, 0.0)
    return ahead / max(speed, 0.3), state.turning[c] - min(state.scale[c], 1.0) * turning, duration


@kernel
def pace_and_scale(tables: Tables, state: State, c: int, ratio: float) -> tuple[float, float]:
    """How quick and how large steps are against the examples, so that their product is the speed against theirs."""
    g = state.group[c]
    _, turning, duration = against_examples(tables, state, c)
    runs = tables.leads_to[g] == RUN and tables.comes_from[g] == RUN
    pace = ratio**0.3 if runs else math.sqrt(ratio)
    sine, cosine = math.sin(state.heading[c]), math.cos(state.heading[c])
    ahead = state.velocity[c, 0] * sine + state.velocity[c, 1] * cosine
    across = abs(state.velocity[c, 0] * cosine - state.velocity[c, 1] * sine) + max(-ahead, 0.0)
    pace = max(pace, abs(turning) * duration / MOST_TURN, math.sqrt(across / 0.5))
    pace = min(pace, QUICKEST)
    return pace, min(ratio / max(pace, 1e-3), LARGEST)


@kernel
def pace_of_given(tables: Tables, state: State, c: int, waits: bool, dt: float) -> float:
    """Pace of the steps in this frame; brings their scale nearer to what the speed asks for."""
    g = state.group[c]
    ratio, _, _ = against_examples(tables, state, c)
    pace, scale = pace_and_scale(tables, state, c, ratio)
    gap, rate = decay(state.scale[c] - scale, state.scale_rate[c], SCALE_HALF_LIFE, dt)
    state.scale[c], state.scale_rate[c] = max(scale + gap, 0.0), rate
    if waits:
        return 0.0
    if tables.leads_to[g] == RUN or tables.comes_from[g] == RUN:
        return max(pace, 0.6)
    if pace >= SWING:
        return pace
    # Feet swing quickly; the time that is left is spent with both on the floor.
    swings = tables.swings[g]
    if swings >= 1.0:
        return max(pace, 0.4)
    if not (state.locked[c, 0] and state.locked[c, 1]):
        return SWING
    speed = math.hypot(state.velocity[c, 0], state.velocity[c, 1])
    if state.astray[c] >= HOME and speed < 2.0 * AT_REST:
        return 1.0
    return (1.0 - swings) / (1.0 / max(pace, 1e-3) - swings / SWING)


@kernel
def aim_feet(tables: Tables, state: State, c: int, rests_in: float) -> None:
    """Where feet come down against the examples: in the midst of what the vehicle does while they will stand.

    Takes also down how high the swinging foot is lifted beyond the examples.
    """
    g = state.group[c]
    state.lift[c] = 0.0
    state.lead[c] = 0.0
    if tables.comes_from[g] == STAND and tables.leads_to[g] == STAND:
        return
    ratio, turning, duration = against_examples(tables, state, c)
    pace, _ = pace_and_scale(tables, state, c, ratio)
    sine, cosine = math.sin(state.heading[c]), math.cos(state.heading[c])
    ahead = max(state.velocity[c, 0] * sine + state.velocity[c, 1] * cosine, 0.0)
    half = 0.5 * STANCE * duration
    share = 1.0
    if tables.leads_to[g] == RUN or tables.comes_from[g] == RUN:
        share = 0.5
    speed = math.hypot(state.velocity[c, 0], state.velocity[c, 1])
    brakes = state.acceleration[c, 0] * sine + state.acceleration[c, 1] * cosine
    turn = share * turning * STANCE * duration / max(pace, 0.5)
    for side in range(2):
        # The way the vehicle goes from where the foot lands until it stands below it, less the one that the pose has.
        lands = until_landing(tables, state.generic[c], g, side) * duration / max(pace, SWING)
        later = min(max(1.0 + brakes * lands / max(speed, 0.05), 0.0), 1.5)
        shows = state.scale[c] * math.sqrt(later) * ahead / ratio * half if ratio > 1e-6 else 0.0
        until = later * min(half / max(pace, 0.2), 0.5 * max(rests_in - lands, 0.0))
        x = share * (state.velocity[c, 0] * until - shows * sine)
        z = share * (state.velocity[c, 1] * until - shows * cosine)
        far = math.hypot(x, z)
        if far > FARTHEST_LEAD:
            x, z = x * FARTHEST_LEAD / far, z * FARTHEST_LEAD / far
        inside = (turning > 0.0) == (side == 0)
        state.lead[c, side, 0], state.lead[c, side, 1] = x, z
        state.lead[c, side, 2] = min(max((INNER if inside else OUTER) * turn, -MOST_LEAD_TURN), MOST_LEAD_TURN)
        small = max(1.0 - state.scale[c], 0.0)
        if small > 0.0:
            state.lift[c, side] = CLEARANCE * small * swing_height(tables, state.generic[c], g, side)


@kernel
def until_landing(tables: Tables, generic: float, g: int, side: int) -> float:
    """Generic time until a foot in the air lands; 0 for one that stands."""
    if tables.planted[g, 0, side]:
        last = 0
        while tables.keys[g, last] < 1.0:
            last += 1
        in_air = not tables.planted[g, last, side] and last > 0 and generic > tables.keys[g, last - 1]
        return 1.0 - min(generic, 1.0) + LANDS if in_air else 0.0
    return max(tables.keys[g, 0] - generic, 0.0)


@kernel
def swing_height(tables: Tables, generic: float, g: int, side: int) -> float:
    """0 where a foot leaves the floor, 1 in the middle of its swing (a half cycle's boundary), 0 where it lands."""
    last = 0
    while tables.keys[g, last] < 1.0:
        last += 1
    if last == 0:
        return 0.0
    if not tables.planted[g, 0, side] and generic < tables.keys[g, 0]:
        return math.cos(0.5 * math.pi * generic / tables.keys[g, 0]) ** 2
    from_key = tables.keys[g, last - 1]
    if not tables.planted[g, last, side] and generic > from_key:
        return math.sin(0.5 * math.pi * (min(generic, 1.0) - from_key) / (1.0 - from_key)) ** 2
    return 0.0


@kernel
def watch_feet(tables: Tables, state: State, c: int) -> None:
    """How far the feet are from where they belong under a standing body."""
    sine, cosine = math.sin(state.heading[c]), math.cos(state.heading[c])
    worst = 0.0
    for side in range(2):
        x, z = state.toe[c, side, 0] - state.position[c, 0], state.toe[c, side, 2] - state.position[c, 1]
        left, ahead = x * cosine - z * sine, x * sine + z * cosine
        away = math.hypot(left - tables.home[side, 0], ahead - tables.home[side, 1]) / FEET_TOLERANCE
        turned = abs(state.twist[c, side]) / TWIST_TOLERANCE
        worst = max(worst, away, turned)
    state.astray[c] = worst
