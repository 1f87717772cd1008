"""Feet: a planted foot stays where it came down; the leg bends to it, as a hinge that only bends forward.

A foot that comes to stand is caught, one that leaves is let go, both without a jump: what the toe shown differs from
the toe meant fades (inertialization). A leg that cannot reach lets the heel rise first; then the pelvis sinks.
"""

from __future__ import annotations

import math

from stridecast.geometry.kernels import (
    about_y,
    add,
    between,
    cross,
    decay,
    dot,
    exp,
    inverse,
    kernel,
    multiply,
    norm,
    normalize,
    rotate,
    scale,
    subtract,
    twist_about_y,
)
from stridecast.synthesis.pose_kernels import set_quaternion
from stridecast.synthesis.state import State
from stridecast.synthesis.tables import Tables

CATCH_HALF_LIFE = 0.035
"""Half of the way of a landing foot is braked in this time, seconds."""

CATCH_WAY = 0.02
"""A foot comes to rest this far ahead in time on its way, seconds ..."""

CATCH_MOST = 0.03
"""... but no further than this, metres."""

RELEASE_HALF_LIFE = 0.09
"""Half of what a foot was held back by is made up in this time once it is free, seconds."""

SETTLE_HALF_LIFE = 0.05
"""A planted toe comes down to the floor with this half-life, seconds."""

DROP_HALF_LIFE = 0.06
"""The pelvis sinks and rises with this half-life, seconds."""

MOST_HEEL_RISE = math.radians(40.0)
"""So far the heel rises, beyond the blended pose, so that a leg reaches its foot."""

STRAIGHTEST = 0.998
"""Largest reach of a leg as a part of its length."""

NEARLY_STRAIGHT = 0.972
"""From here on a leg stretches less and less, so that the knee does not snap straight and the heel rises gently."""

GIVE_UP = 0.05
"""A planted foot that would pull the pelvis down by more than this is let go early, metres."""

APART, ABREAST = 0.07, 0.5
"""Led feet keep their toes so far apart sideways, the less the further one is ahead, up to the second; metres."""

TIP = 0.004
"""The tips of the toes stay above this height, metres."""


@kernel
def plant_feet(tables: Tables, state: State, c: int, dt: float) -> None:
    """Hold planted feet, let go others, bend the legs."""
    need = 0.0
    for side in range(2):
        planted = is_planted(tables, state, c, side)
        hip, toe, turned, toes = meant_foot(tables, state, c, side)
        toe = (toe[0], toe[1] + state.lift[c, side], toe[2])
        if not planted:
            state.given_up[c, side] = False
        hold_or_release(tables, state, c, side, planted and not state.given_up[c, side], toe, turned, toes, dt)
        if state.locked[c, side]:
            short = shortfall(tables, state, c, side, hip, turned)
            state.given_up[c, side] = short > GIVE_UP
            need = max(need, min(short, GIVE_UP))
    # The pelvis follows what the legs need, smoothly: a spring towards the need.
    gap, rate = decay(state.drop[c] - need, state.drop_rate[c], DROP_HALF_LIFE, dt)
    state.drop[c], state.drop_rate[c] = gap + need, rate
    state.root[c, 1] -= state.drop[c]
    for side in range(2):
        bend_leg(tables, state, c, side)
        lift_toes(tables, state, c, side)


@kernel
def is_planted(tables: Tables, state: State, c: int, side: int) -> bool:
    """Whether the string has a foot on the floor at this time of the segment."""
    g = state.group[c]
    phase = 0
    while state.generic[c] >= tables.keys[g, phase]:
        phase += 1
    return tables.planted[g, phase, side]


@kernel
def quaternion_at(rotations, c, j):  # type: ignore[no-untyped-def]
    """Read a rotation."""
    return (rotations[c, j, 0], rotations[c, j, 1], rotations[c, j, 2], rotations[c, j, 3])


@kernel
def offset_of(tables, j):  # type: ignore[no-untyped-def]
    """Place of a joint in its parent's frame."""
    return (tables.offsets[j, 0], tables.offsets[j, 1], tables.offsets[j, 2])


@kernel
def joint_in_world(tables, state, c, side, joint):  # type: ignore[no-untyped-def]
    """Place and rotation of a joint of the leg in the world, by forward kinematics down its path."""
    at = (state.root[c, 0], state.root[c, 1], state.root[c, 2])
    turned = quaternion_at(state.rotations, c, 0)
    for k in range(tables.paths.shape[1]):
        j = tables.paths[side, k]
        if j < 0:
            break
        at = add(at, rotate(turned, offset_of(tables, j)))
        turned = multiply(turned, quaternion_at(state.rotations, c, j))
        if j == joint:
            break
    return at, turned


@kernel
def meant_foot(tables, state, c, side):  # type: ignore[no-untyped-def]
    """Places of hip and toe joint, rotations of foot and toes in the blended pose."""
    hip, _ = joint_in_world(tables, state, c, side, tables.legs[side, 0])
    _, turned = joint_in_world(tables, state, c, side, tables.legs[side, 2])
    toe, toes = joint_in_world(tables, state, c, side, tables.legs[side, 3])
    return hip, toe, turned, toes


@kernel
def toe_tip(tables, side):  # type: ignore[no-untyped-def]
    """From the toe joint to the tip of the toes, in the toes' frame."""
    return (tables.tips[side, 0], tables.tips[side, 1], tables.tips[side, 2])


@kernel
def stand_on_toes(tables, state, c, side, toe, tip, dt):  # type: ignore[no-untyped-def]
    """Where the toe joint of a held foot is: on the floor, or over the tips of the toes once they carry alone.

    ``tip`` is the vector from the toe joint to the tip. While the foot lies flat the joint stays where it is held; when
    the toes turn down, the tip stays and the joint moves up and over it.
    """
    level, length = math.hypot(tip[0], tip[2]), norm(tip)
    over = 0.0 if level < 1e-9 or tip[1] > 0.0 else (length - level) / level
    floor = max(tables.sole, TIP - tip[1])
    height = min(state.hold[c, side, 1], max(toe[1], floor))
    height = floor + (height - floor) * 0.5 ** (dt / SETTLE_HALF_LIFE) if height > floor else floor
    state.hold[c, side, 1] = height
    return (state.hold[c, side, 0] + over * tip[0], height, state.hold[c, side, 2] + over * tip[2])


@kernel
def hold_or_release(tables, state, c, side, planted, toe, turned, toes, dt):  # type: ignore[no-untyped-def]
    """Where the toe is shown: held, on its way to being held, or on its way back to the blended pose."""
    if state.fresh[c]:
        for k in range(3):
            state.toe[c, side, k] = toe[k]
            state.toe_meant[c, side, k] = toe[k]
            state.hold[c, side, k] = toe[k]
        for k in range(4):
            state.hold_turn[c, side, k] = turned[k]
        state.locked[c, side] = planted
    shown = (state.toe[c, side, 0], state.toe[c, side, 1], state.toe[c, side, 2])
    if planted and not state.locked[c, side]:
        # Caught: it comes to rest a little ahead on its way.
        state.locked[c, side] = True
        free_x, free_z = toe[0] + state.slip[c, side, 0], toe[2] + state.slip[c, side, 2]
        level = math.hypot(free_x - shown[0], free_z - shown[2]) / dt
        share = CATCH_WAY if level * CATCH_WAY <= CATCH_MOST else CATCH_MOST / level
        for k in range(3):
            free = toe[k] + state.slip[c, side, k]
            rate = (free - shown[k]) / dt
            ahead = rate * share if k != 1 else 0.0
            state.hold[c, side, k] = free + ahead
            state.slip[c, side, k] = -ahead
            state.slip_rate[c, side, k] = rate if k != 1 else state.slip_rate[c, side, k]
        held = multiply(about_y(state.twist[c, side]), turned)
        for k in range(4):
            state.hold_turn[c, side, k] = held[k]
    elif not planted and state.locked[c, side]:
        # Let go: what it was held back by in the last frame fades, and so does how much slower it was.
        state.locked[c, side] = False
        for k in range(3):
            state.slip[c, side, k] = shown[k] - state.toe_meant[c, side, k]
            rate = (toe[k] - state.toe_meant[c, side, k]) / dt
            state.slip_rate[c, side, k] = state.toe_rate[c, side, k] - rate

    lead_x, lead_z = 0.0, 0.0
    if state.locked[c, side]:
        half_life = CATCH_HALF_LIFE
        tip = rotate(foot_turn(state, c, side, toes), toe_tip(tables, side))
        meant = stand_on_toes(tables, state, c, side, toe, tip, dt)
        q = (
            state.hold_turn[c, side, 0],
            state.hold_turn[c, side, 1],
            state.hold_turn[c, side, 2],
            state.hold_turn[c, side, 3],
        )
        twist = twist_about_y(multiply(q, inverse(turned)))
        state.twist_rate[c, side] = 0.5 * (twist - state.twist[c, side]) / dt
        state.twist[c, side] = twist
    else:
        half_life = RELEASE_HALF_LIFE
        meant = toe
        turn = state.lead[c, side, 2]
        twist, state.twist_rate[c, side] = decay(
            state.twist[c, side] - turn, state.twist_rate[c, side], RELEASE_HALF_LIFE, dt
        )
        state.twist[c, side] = twist + turn
        lead_x, lead_z = led(state, c, side, toe)
        if state.given[c]:
            push = apart(state, c, side, toe[0] + lead_x, toe[2] + lead_z)
            lead_x += push * math.cos(state.heading[c])
            lead_z -= push * math.sin(state.heading[c])
    for k in range(3):
        aim = lead_x if k == 0 else (lead_z if k == 2 else 0.0)
        slip, rate = decay(state.slip[c, side, k] - aim, state.slip_rate[c, side, k], half_life, dt)
        slip += aim
        state.slip[c, side, k], state.slip_rate[c, side, k] = slip, rate
        state.toe[c, side, k] = meant[k] + slip
    state.toe[c, side, 1] = max(state.toe[c, side, 1], tables.sole)
    for k in range(3):
        state.toe_rate[c, side, k] = 0.0 if state.fresh[c] else (state.toe[c, side, k] - shown[k]) / dt
        state.toe_meant[c, side, k] = toe[k]


@kernel
def led(state, c, side, toe):  # type: ignore[no-untyped-def]
    """By how much a free foot is led away from its place in the pose: turned about the vehicle, and moved."""
    turn = state.lead[c, side, 2]
    x, z = toe[0] - state.position[c, 0], toe[2] - state.position[c, 1]
    sine, cosine = math.sin(turn), math.cos(turn)
    return (
        state.lead[c, side, 0] + x * (cosine - 1.0) + z * sine,
        state.lead[c, side, 1] + z * (cosine - 1.0) - x * sine,
    )


@kernel
def apart(state, c, side, x, z):  # type: ignore[no-untyped-def]
    """By how much a free foot that passes the other one is moved to the left so that the legs do not touch."""
    sine, cosine = math.sin(state.heading[c]), math.cos(state.heading[c])
    dx, dz = x - state.toe[c, 1 - side, 0], z - state.toe[c, 1 - side, 2]
    ahead, left = dx * sine + dz * cosine, dx * cosine - dz * sine
    outwards = 1.0 if side == 0 else -1.0
    near = 1.0 - (ahead / ABREAST) ** 2
    return outwards * min(max(near * (APART - outwards * left), 0.0), APART) if near > 0.0 else 0.0


@kernel
def foot_turn(state, c, side, turned):  # type: ignore[no-untyped-def]
    """Rotation of the foot as shown: the blended one, turned about the vertical with what it was held by."""
    return multiply(about_y(state.twist[c, side]), turned)


@kernel
def raise_heel(tables, state, c, side, hip, turned):  # type: ignore[no-untyped-def]
    """Ankle and foot rotation for the toe shown; the heel rises about the toe as far as the leg is too short."""
    toe = (state.toe[c, side, 0], state.toe[c, side, 1], state.toe[c, side, 2])
    turned = foot_turn(state, c, side, turned)
    sole = rotate(turned, offset_of(tables, tables.legs[side, 3]))
    ankle = subtract(toe, sole)
    length = tables.bones[side, 0] + tables.bones[side, 1]
    far = norm(subtract(ankle, hip)) / length
    if far <= NEARLY_STRAIGHT:
        return ankle, turned
    spare = STRAIGHTEST - NEARLY_STRAIGHT
    longest = length * (STRAIGHTEST - spare * math.exp((NEARLY_STRAIGHT - far) / spare))
    # In the triangle toe, ankle, hip: the angle at the toe that brings the ankle to the right distance from the hip.
    up, back = subtract(hip, toe), scale(sole, -1.0)
    a, b = norm(up), norm(back)
    have = math.acos(min(max(dot(up, back) / (a * b), -1.0), 1.0))
    want = math.acos(min(max((a * a + b * b - longest * longest) / (2.0 * a * b), -1.0), 1.0))
    axis = cross(back, up)
    across = norm(axis)
    if across < 1e-9:
        return ankle, turned
    rise = exp(scale(axis, min(have - want, MOST_HEEL_RISE) / across))
    turned = multiply(rise, turned)
    return subtract(toe, rotate(turned, offset_of(tables, tables.legs[side, 3]))), turned


@kernel
def shortfall(tables, state, c, side, hip, turned):  # type: ignore[no-untyped-def]
    """How far the pelvis must sink so that a leg reaches its foot."""
    ankle, _ = raise_heel(tables, state, c, side, hip, turned)
    longest = STRAIGHTEST * (tables.bones[side, 0] + tables.bones[side, 1])
    away = subtract(hip, ankle)
    level2 = away[0] * away[0] + away[2] * away[2]
    if level2 >= longest * longest:
        return 2.0 * GIVE_UP
    return max(away[1] - math.sqrt(longest * longest - level2), 0.0)


@kernel
def bend_leg(tables, state, c, side):  # type: ignore[no-untyped-def]
    """Two-bone inverse kinematics: knee by the law of cosines about its hinge, then the whole leg swings."""
    thigh, shin, foot = tables.legs[side, 0], tables.legs[side, 1], tables.legs[side, 2]
    hip, thigh_turn = joint_in_world(tables, state, c, side, thigh)
    knee, shin_turn = joint_in_world(tables, state, c, side, shin)
    ankle, foot_rotation = joint_in_world(tables, state, c, side, foot)
    above_thigh = multiply(thigh_turn, inverse(quaternion_at(state.rotations, c, thigh)))
    above_shin = multiply(shin_turn, inverse(quaternion_at(state.rotations, c, shin)))
    above_foot = multiply(foot_rotation, inverse(quaternion_at(state.rotations, c, foot)))
    goal, turned = raise_heel(tables, state, c, side, hip, foot_rotation)

    upper, lower = tables.bones[side, 0], tables.bones[side, 1]
    want = norm(subtract(goal, hip))
    want = min(max(want, abs(upper - lower) * 1.01 + 1e-6), STRAIGHTEST * (upper + lower))
    inner = math.acos(min(max((upper * upper + lower * lower - want * want) / (2.0 * upper * lower), -1.0), 1.0))
    hinge = rotate(shin_turn, (tables.hinges[side, 0], tables.hinges[side, 1], tables.hinges[side, 2]))
    down, on = subtract(knee, hip), subtract(ankle, knee)
    # The leg's own plane, and where it is nearly straight (or bent the wrong way) the hinge.
    plane = scale(cross(down, on), 1.0 / (upper * lower))
    if dot(plane, hinge) < 0.0:
        plane = scale(plane, -1.0)
    plane = add(plane, scale(hinge, 0.15))
    plane = scale(plane, 1.0 / norm(plane))
    # Bend so far that the angle between the bones, signed about that axis, is right.
    flat_down = subtract(down, scale(plane, dot(down, plane)))
    flat_on = subtract(on, scale(plane, dot(on, plane)))
    have = math.atan2(dot(cross(flat_down, flat_on), plane), dot(flat_down, flat_on))
    bend = exp(scale(plane, (math.pi - inner) - have))
    on = rotate(bend, on)
    swing = between(add(down, on), subtract(goal, hip))
    whole = multiply(swing, bend)
    set_quaternion(state.rotations, c, thigh, normalize(multiply(inverse(above_thigh), multiply(swing, thigh_turn))))
    set_quaternion(
        state.rotations, c, shin, normalize(multiply(inverse(multiply(swing, above_shin)), multiply(whole, shin_turn)))
    )
    set_quaternion(state.rotations, c, foot, normalize(multiply(inverse(multiply(whole, above_foot)), turned)))
    # The toes keep the direction they had before the heel rose.
    toe = tables.legs[side, 3]
    flat = multiply(foot_turn(state, c, side, foot_rotation), quaternion_at(state.rotations, c, toe))
    set_quaternion(state.rotations, c, toe, normalize(multiply(inverse(turned), flat)))


@kernel
def lift_toes(tables, state, c, side):  # type: ignore[no-untyped-def]
    """Bend the toes up where their tips would go through the floor."""
    joint = tables.legs[side, 3]
    toe, turned = joint_in_world(tables, state, c, side, joint)
    tip = rotate(turned, toe_tip(tables, side))
    far = norm(tip)
    level = math.hypot(tip[0], tip[2])
    if toe[1] + tip[1] >= TIP or level < 1e-6:
        return
    have = math.atan2(tip[1], level)
    want = math.asin(min(max((TIP - toe[1]) / far, -1.0), 1.0))
    # About the horizontal axis across the toes: (tip x up), so that a positive turn raises the tip.
    lift = exp(scale((-tip[2] / level, 0.0, tip[0] / level), want - have))
    above = multiply(turned, inverse(quaternion_at(state.rotations, c, joint)))
    set_quaternion(state.rotations, c, joint, normalize(multiply(inverse(above), multiply(lift, turned))))
