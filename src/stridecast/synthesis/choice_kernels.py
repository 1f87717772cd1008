"""Which segment comes next, and of which examples it is blended (KS05, KS07 "Adding Details"; style: BJL 4.1)."""

from __future__ import annotations

import math

from stridecast.database.graph import UNREACHABLE
from stridecast.geometry.kernels import kernel
from stridecast.model.database import MARGIN
from stridecast.synthesis.state import NEIGHBOURS, State
from stridecast.synthesis.tables import STOP_TOLERANCE, Tables

SPEED_SCALE, TANGENTIAL_SCALE, LATERAL_SCALE = 0.1, 1.2, 0.45
"""Differences in speed (m/s) and acceleration (m/s2) that weigh as much as each other ..."""

AHEAD = 0.22
"""Speeds are compared this far into the segment, where the acceleration will have taken them, seconds."""

POSE_SCALE = 0.12
"""... and as much as a pose that differs by this on average, radians."""

STYLE_SCALE = 0.2
"""... and as much as a style that differs by this; ..."""

STYLE_MOST = 16.0
"""... but no difference in style weighs more than this in a squared distance: a sharp turn is one in any mood."""

STYLE_TOLERANCE = 0.1
"""A blend whose style is off by no more is left as it is."""

NEARBY, FAR = 3.0, 7.0
"""Examples are called in for their style alone where they are no further off than the first of these (squared distance)
beyond what would be chosen otherwise; less and less up to the second."""

ENTRY_TOLERANCE = 0.2
"""A transition can begin this far outside the speeds at which its examples began, m/s."""

SPEED_TOLERANCE = 0.04
"""Walking and running can begin this much above their speeds, m/s: who slows down nears them ever more slowly."""

HARDEST = 3.0
"""Accelerations of vehicles that move by themselves count up to this, m/s2."""

TIE = 1e-7
"""Left and right, mirrored, cost the same: the first is taken then, whichever way rounding goes."""


@kernel
def begin_segment(tables: Tables, state: State, c: int, request: int, leftover: float) -> None:
    """Choose group and examples for the next segment of character ``c``; ``leftover`` seconds of it have passed."""
    begin_group(tables, state, c, next_group(tables, state, c, request), 0.0)
    slope = 0.0
    for n in range(NEIGHBOURS):
        if state.weights[c, n] > 0.0:
            e = state.chosen[c, n]
            slope += state.weights[c, n] * (tables.times[e, MARGIN + 1] - tables.times[e, MARGIN])
    intervals = tables.times.shape[1] - 1 - 2 * MARGIN
    state.generic[c] = min(leftover / (slope * intervals), 0.5)


@kernel
def begin_group(tables: Tables, state: State, c: int, group: int, generic: float) -> None:
    """Begin a segment of a group at a generic time, with the examples nearest to what the character does."""
    state.group[c] = group
    describe_vehicle(tables, state, c)
    blend_nearest(tables, state, c, group)
    take_stance(tables, state, c)
    speed = math.hypot(state.velocity[c, 0], state.velocity[c, 1])
    state.started[c] = speed
    state.segments[c] += 1
    state.generic[c] = generic


@kernel
def describe_vehicle(tables: Tables, state: State, c: int) -> None:
    """Take down what groups and examples are chosen by: speed, tangential and lateral acceleration.

    A vehicle that moves by itself and goes slower than anybody was seen to walk has the examples of the slowest that
    turn as it does, one that goes faster than everybody those of the fastest.
    """
    vx, vz = state.velocity[c, 0], state.velocity[c, 1]
    ax, az = state.acceleration[c, 0], state.acceleration[c, 1]
    sine, cosine = math.sin(state.heading[c]), math.cos(state.heading[c])
    speed = math.hypot(vx, vz)
    state.choice[c, 0] = speed
    state.choice[c, 1] = ax * sine + az * cosine
    state.choice[c, 2] = ax * cosine - az * sine
    if state.given[c]:
        speed = min(max(speed, tables.slowest), tables.fastest)
        state.choice[c, 0] = speed
        state.choice[c, 1] = min(max(state.choice[c, 1], -HARDEST), HARDEST)
        state.choice[c, 2] = min(max(speed * state.turning[c], -HARDEST), HARDEST)


@kernel
def next_group(tables: Tables, state: State, c: int, request: int) -> int:
    """The group on the shortest way to the motion asked for that the present speed allows."""
    g = state.group[c]
    describe_vehicle(tables, state, c)
    speed = state.choice[c, 0]
    if state.fresh[c]:
        return first_group(tables, state, c, request)
    best, best_cost = -1, 1e18
    for h in range(len(tables.first)):
        if not tables.follows[g, h] or tables.sizes[h] == 0:
            continue
        steps = tables.steps[h, request]
        cost = 1e9 if steps >= UNREACHABLE else 10.0 * steps
        # Stay with a transition that is under way, prefer one that is meant for this; begin nothing at a speed it does
        # not know.
        if tables.comes_from[h] != tables.leads_to[h]:
            if tables.leads_to[h] == request:
                cost -= 2.0
            if tables.label[h] == tables.label[g]:
                cost -= 3.0
            if tables.comes_from[h] == request:  # no way to what is asked for leads away from it
                cost += 1e7
        off = misfit(tables, h, speed)
        if off > 0.0:
            cost += 1e6 + 1e4 * off
        if cost >= best_cost - TIE:  # too dear already
            continue
        cost += nearest(tables, state, c, h, 50.0) / 50.0
        if cost < best_cost - TIE:
            best, best_cost = h, cost
    if best < 0 or (best_cost > 5e8 and tables.steps[g, request] >= UNREACHABLE):
        other = first_group(tables, state, c, request)
        if tables.comes_from[other] == request or best < 0:
            state.made_up[c] += 1
            return other
    return best


@kernel
def misfit(tables: Tables, h: int, speed: float) -> float:
    """How far a speed lies outside those at which a group can begin, m/s; slower does for stops, faster for starts."""
    if tables.from_rest[h]:  # whoever has stopped stands, also where nobody was seen to stand so unquietly
        return 0.0
    low, high = tables.entry_speed[h, 0], tables.entry_speed[h, 1]
    start, goal = tables.comes_from[h], tables.leads_to[h]
    if start == goal:
        return max(low - speed - ENTRY_TOLERANCE, speed - high - SPEED_TOLERANCE, 0.0)
    if goal < start:
        return max(speed - high - (STOP_TOLERANCE if goal == 0 else ENTRY_TOLERANCE), 0.0)
    return max(low - speed - ENTRY_TOLERANCE, 0.0)


@kernel
def first_group(tables: Tables, state: State, c: int, request: int) -> int:
    """The group of a motion whose examples begin nearest to the present pose; of any motion if it has none."""
    best, best_cost = 0, 1e18
    for h in range(len(tables.first)):
        if tables.sizes[h] == 0:
            continue
        cost = nearest(tables, state, c, h, 1e18)
        if tables.comes_from[h] != request or tables.leads_to[h] != request:
            cost += 1e9
        if cost < best_cost - TIE:
            best, best_cost = h, cost
    return best


@kernel
def distance(tables: Tables, state: State, c: int, e: int, style: float, most: float) -> float:
    """Squared distance of an example's beginning from what the character does, and in style: vehicle, style, pose.

    What is ``most`` or more is not worked out to the end.
    """
    more = state.choice[c, 1] - tables.parameters[e, 1]
    a = (state.choice[c, 0] - tables.parameters[e, 0] + AHEAD * more) / SPEED_SCALE
    b = more / TANGENTIAL_SCALE
    d = (state.choice[c, 2] - tables.parameters[e, 2]) / LATERAL_SCALE
    s = (tables.styles[e] - style) / STYLE_SCALE
    total = a * a + b * b + d * d + s * s / (1.0 + s * s / STYLE_MOST)
    if total >= most:
        return total
    return total + 3.0 * unlike(tables.beginnings[e], state.features[c], tables.feature_weights) / POSE_SCALE**2


@kernel
def unlike(a, b, weights):  # type: ignore[no-untyped-def]
    """Weighted sum of squared differences; four sums at a time, which a processor can add side by side."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    whole = len(a) // 4 * 4
    for k in range(0, whole, 4):
        s0 += weights[k] * (a[k] - b[k]) ** 2
        s1 += weights[k + 1] * (a[k + 1] - b[k + 1]) ** 2
        s2 += weights[k + 2] * (a[k + 2] - b[k + 2]) ** 2
        s3 += weights[k + 3] * (a[k + 3] - b[k + 3]) ** 2
    for k in range(whole, len(a)):
        s0 += weights[k] * (a[k] - b[k]) ** 2
    return (s0 + s1) + (s2 + s3)


@kernel
def nearest(tables: Tables, state: State, c: int, h: int, most: float) -> float:
    """Smallest distance to any example of a group, at most ``most``."""
    best, style = most, style_in(tables, state, c, h)
    for e in range(tables.first[h], tables.first[h] + tables.sizes[h]):
        if tables.allowed[e]:
            best = min(best, distance(tables, state, c, e, style, best))
    return best


@kernel
def style_in(tables: Tables, state: State, c: int, h: int) -> float:
    """The style wanted, or what comes nearest to it in a group."""
    return min(max(state.style[c], tables.style_range[h, 0]), tables.style_range[h, 1])


@kernel
def blend_nearest(tables: Tables, state: State, c: int, h: int) -> None:
    """Weights over the nearest examples of a group; where they miss the style wanted, over some on both sides of it."""
    style = style_in(tables, state, c, h)
    choose(tables, state, c, h, style, -2.0, 2.0, 0, NEIGHBOURS)
    shown = shown_style(tables, state, c)
    if abs(shown - style) <= STYLE_TOLERANCE:
        return
    # In between what there is: the other side is called in too, so that together they show the style wanted.
    half = NEIGHBOURS // 2
    near = distance(tables, state, c, state.chosen[c, 0], tables.styles[state.chosen[c, 0]], 1e18)
    for n in range(half, NEIGHBOURS):
        state.weights[c, n] = 0.0
    total = 0.0
    for n in range(half):
        total += state.weights[c, n]
    for n in range(half):
        state.weights[c, n] /= total
    shown = shown_style(tables, state, c)
    if shown < style:
        choose(tables, state, c, h, style, style - 1e-9, 2.0, half, NEIGHBOURS - half)
    else:
        choose(tables, state, c, h, style, -2.0, style + 1e-9, half, NEIGHBOURS - half)
    other = 0.0
    for n in range(half, NEIGHBOURS):
        other += state.weights[c, n] * tables.styles[state.chosen[c, n]]
    share = 0.0 if other == shown else min(max((style - shown) / (other - shown), 0.0), 1.0)
    e = state.chosen[c, half]
    further = distance(tables, state, c, e, tables.styles[e], 1e18) - near
    share *= min(max((FAR - further) / (FAR - NEARBY), 0.0), 1.0)
    for n in range(NEIGHBOURS):
        state.weights[c, n] *= share if n >= half else 1.0 - share


@kernel
def shown_style(tables: Tables, state: State, c: int) -> float:
    """Style of the examples chosen, on average."""
    shown = 0.0
    for n in range(NEIGHBOURS):
        shown += state.weights[c, n] * tables.styles[state.chosen[c, n]]
    return shown


@kernel
def take_stance(tables: Tables, state: State, c: int) -> None:
    """How people stand whose style is that of the examples chosen; small movements are small against this."""
    shown = shown_style(tables, state, c)
    mood = 0 if shown < 0.0 else 2
    whole = tables.stance_styles[mood] - tables.stance_styles[1]
    share = min(max((shown - tables.stance_styles[1]) / whole, 0.0), 1.0) if whole != 0.0 else 0.0
    for k in range(tables.stances.shape[1]):
        state.stance[c, k] = tables.stances[1, k] + share * (tables.stances[mood, k] - tables.stances[1, k])


@kernel
def choose(
    tables: Tables, state: State, c: int, h: int, style: float, low: float, high: float, slot: int, count: int
) -> None:
    """Fill ``count`` slots with the nearest examples of a group among those of styles from ``low`` to ``high``.

    Weights are 1/d2 less what the first one left out would get (BJL eq. 3). So weights fall to nothing where a
    neighbour drops out of the blend, and an exact hit takes all the weight.
    """
    found, which = state.found[c], state.found_examples[c]
    for k in range(count + 1):
        found[k], which[k] = 1e18, 0
    for e in range(tables.first[h], tables.first[h] + tables.sizes[h]):
        if not tables.allowed[e] or not low <= tables.styles[e] <= high:
            continue
        d = distance(tables, state, c, e, style, found[count]) + 1e-9
        if d >= found[count]:
            continue
        k = count
        while k > 0 and found[k - 1] > d:
            found[k], which[k] = found[k - 1], which[k - 1]
            k -= 1
        found[k], which[k] = d, e
    total = 0.0
    for n in range(count):
        w = 1.0 / found[n] - 1.0 / found[count] if found[n] < 1e17 else 0.0
        if n == 0:
            w = max(w, 1e-12)
        state.chosen[c, slot + n] = which[n]
        state.weights[c, slot + n] = w
        total += w
    for n in range(slot, slot + count):
        state.weights[c, n] /= total
