"""Which velocity somebody aims at: near to the one wished, free for a while, and as the rule says.

The price of a danger falls with the time until it with the power law that Karamouzas, Skinner and Guy (2014) measured
among pedestrians; the distance kept in front makes speeds fall with density as Weidmann (1993) tells.
"""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.ground_kernels import disc_way, free_way
from stridecast.crowd.neighbour_kernels import (
    BX,
    BZ,
    EX,
    EZ,
    FELLOW,
    FIRST,
    HX,
    HZ,
    JAMMED,
    PX,
    PZ,
    RADIUS,
    ROW,
    VX,
    VZ,
)
from stridecast.crowd.rule_kernels import contact_time
from stridecast.crowd.rules import GO_FIRST, GO_ON, ON_THE_WAY, RETURN
from stridecast.crowd.state import Ground, Moving, People
from stridecast.geometry.kernels import kernel

ANGLES = np.radians(
    np.array([0.0, 8.0, -8.0, 17.0, -17.0, 28.0, -28.0, 42.0, -42.0, 60.0, -60.0, 85.0, -85.0, 115.0, -115.0])
)
"""Directions looked at, from the wished one."""

SINES, COSINES = np.sin(ANGLES), np.cos(ANGLES)

SHARES = np.array([1.0, 0.7, 0.4, 0.15])
"""Shares of the speed that is possible in a direction. The present direction and standing are looked at besides."""

CHOICES = (len(ANGLES) + 1) * len(SHARES) + 1

HURRY = 1.15
"""Who goes first may hurry by this factor."""

DANGER = 0.9
"""Price of a contact within a second."""

FAR = 8.0
"""Later contacts than this do not count, seconds."""

GENTLE = 1.0
"""Who comes nearer more slowly than this is less of a danger, m/s."""

WALL = 0.25
"""The same price for walls, which do not move."""

WALLS, WALLS_AHEAD = 4.0, 2.0
"""They are looked for so far ahead, metres, or as far as one gets in so many seconds."""

CARRIED = 0.25
"""So long runners are carried on as they were, seconds."""

DETOUR = 0.8
"""Price of going backwards, half of that sideways, in units of losing all of the wished speed."""

IMPATIENCE = 0.3
"""How the price of standing grows with every second in which one does not get on."""

HEADWAY = 0.4
"""Distance in front at which people have two thirds of their speed, metres."""

JAM = 0.08
"""Nearer than this nobody follows, metres."""

BESIDE = 0.06
"""Nobody comes nearer than this to who goes first where ways run together, metres, lest both be wedged."""

JAM_LEFT_ALONE = 0.8
"""The same of people who block each other: they need the room, metres."""

FREE = 6.0
"""Who is further ahead does not matter, metres."""

GENTLY = 0.8
"""Up to who does not go the same way people go so fast that they can stop as gently as this, m/s2."""

LEAD = 0.8
"""Who goes on in front makes so much room, seconds of their speed."""

IN_FRONT = 0.7
"""Who is within this cosine of a direction is in front."""

ABREAST = 3.0
"""Who comes towards one further to the side than this does not matter, metres."""

KEEP = 0.3
"""Price of the left, and gain of the right, where many come towards one; the reverse for those who pass on the left."""

MANY = 6
"""So many are many."""

LEAN = 4.0
"""How much people keep to where others go the same way, rather than to their own side."""

TURN = 0.15
"""Price of going to the other side than one has turned to, for those who hardly move."""

SIDE = 0.35
"""Price of the wrong side."""

TURNING = 0.1
"""Price of another direction where others are in the way, a radian of it, lest people waver."""

CHANGE = 0.2
"""Price of changing one's mind."""


@kernel
def danger(time: float) -> float:
    """Price of a contact after ``time`` seconds."""
    if time >= FAR:
        return 0.0
    left = 1.0 - time / FAR
    return DANGER * left * left / (time * time + 0.08)


@kernel
def weigh(
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
    rule: int,
    other: int,
    side: float,
    most: float,
    targets: np.ndarray,
    costs: np.ndarray,
) -> None:
    """Velocities that somebody may aim at who would go at ``wish`` in the direction ``(dx, dz)``, and their costs."""
    x, z = moving.position[c, 0], moving.position[c, 1]
    fastest = wish * (HURRY if rule == GO_FIRST else 1.0)
    firm = 2.0 if rule == GO_ON else 1.0
    own = people.side[c] if people.side[c] != 0.0 else -1.0
    drift = 0.0 if rule == GO_ON else lane(seen, count, dx, dz, own)
    yields = other if rule == GO_ON else -1
    scale = 1.0 / max(wish, 0.1)
    out = moving.opposed[c]
    aim = math.hypot(moving.target[c, 0], moving.target[c, 1])
    still = aim > 0.0 and math.hypot(moving.velocity[c, 0], moving.velocity[c, 1]) < 0.3
    firmly = 0.0 if rule in (ON_THE_WAY, RETURN) else TURNING
    radius, keep = people.radius[c], min(people.keep[c], 0.5)
    far = max(WALLS, WALLS_AHEAD * fastest)
    n = 0
    for a in range(len(ANGLES) + 1):
        if a < len(ANGLES):
            sine, cosine = SINES[a], COSINES[a]
            ax, az = dx * cosine + dz * sine, dz * cosine - dx * sine  # turned to the left by the angle
        elif aim > 0.0:
            ax, az = moving.target[c, 0] / aim, moving.target[c, 1] / aim
            sine, cosine = ax * dz - az * dx, ax * dx + az * dz
        else:
            ax, az, sine, cosine = dx, dz, 0.0, 1.0
        top = min(fastest, most)
        wall = free_way(ground, things, standing, x, z, ax, az, radius, far)
        if people.runs[c]:  # who is fast is carried on before the new direction is reached
            sx = x + CARRIED * (moving.velocity[c, 0] - top * ax)
            sz = z + CARRIED * (moving.velocity[c, 1] - top * az)
            wall = min(wall, free_way(ground, things, standing, sx, sz, ax, az, radius, far))
        for m in range(count):
            o = seen[m]
            along = o[PX] * ax + o[PZ] * az
            if along <= 0.0 or o[VX] * ax + o[VZ] * az < -0.2:
                continue  # behind, or coming towards one: that is no one to follow
            beside = BESIDE if o[FIRST] > 0.0 else 0.0
            gap = disc_way(o[PX], o[PZ], ax, az, radius + o[RADIUS] + beside, FREE)
            if gap >= FREE:
                continue
            if o[BX] * ax + o[BZ] * az > 0.0 and along > IN_FRONT * math.hypot(o[PX], o[PZ]):
                # One follows whom one has in front and who goes the same way.
                reserve = JAM_LEFT_ALONE if o[JAMMED] > 0.0 and not out else JAM
                gap += LEAD * max(o[VX] * ax + o[VZ] * az, 0.0) - reserve
                top = min(top, fastest * (1.0 - math.exp(-max(gap, 0.0) / HEADWAY)))
            else:
                top = min(top, math.sqrt(2.0 * GENTLY * gap))
        wrong = (1.0 - abs(drift)) * SIDE * max(-side * sine, 0.0) - KEEP * drift * sine
        if side != 0.0 and a == 0:
            wrong = 0.25 * (1.0 - abs(drift)) * SIDE
        if aim > 0.0:
            wrong += firmly * math.hypot(ax - moving.target[c, 0] / aim, az - moving.target[c, 1] / aim)
        if still:
            wrong += TURN * (1.0 - (ax * moving.target[c, 0] + az * moving.target[c, 1]) / aim)
        for s in range(len(SHARES)):
            speed = top * SHARES[s]
            ux, uz = speed * ax, speed * az
            lost = 1.0 - speed * scale
            cost = wrong + firm * (lost * lost + DETOUR * (1.0 - cosine))
            cost += CHANGE * scale * scale * ((ux - moving.target[c, 0]) ** 2 + (uz - moving.target[c, 1]) ** 2)
            if wall < far:
                hit = wall / max(speed, 1e-3)
                if hit < WALLS_AHEAD:
                    cost += WALL * (1.0 - hit / WALLS_AHEAD) ** 2 / (hit * hit + 0.08)
            costs[n] = cost + people_in_the_way(seen, count, radius, keep, ux, uz, yields)
            targets[n, 0], targets[n, 1] = ux, uz
            n += 1
    costs[n] = (
        firm
        + IMPATIENCE * moving.stuck[c]
        + CHANGE * scale * scale * (moving.target[c, 0] ** 2 + moving.target[c, 1] ** 2)
    )
    costs[n] += 0.5 * people_in_the_way(seen, count, radius, keep, 0.0, 0.0, yields)
    targets[n, 0], targets[n, 1] = 0.0, 0.0


@kernel
def lane(seen: np.ndarray, count: int, dx: float, dz: float, own: float) -> float:
    """To which side people keep where many come towards them, from -1 (right) to 1 (left): so lanes form.

    To where fewer come and more go the same way, else to their ``own`` side.
    """
    total, lean = 0.0, 0.0
    for m in range(count):
        o = seen[m]
        along, off = o[PX] * dx + o[PZ] * dz, o[PX] * dz - o[PZ] * dx
        if along <= 0.0 or abs(off) >= ABREAST:
            continue
        facing = o[HX] * dx + o[HZ] * dz
        if facing < -0.5:
            total += 1.0 / MANY
            if facing < -0.8:
                lean -= off / (ABREAST * MANY)
        elif facing > 0.8:
            lean += off / (ABREAST * MANY)
    many = min(max(total - 1.0 / MANY, 0.0), 1.0)  # one is not many
    return many * min(max(own + LEAN * lean, -1.0), 1.0)


@kernel
def people_in_the_way(
    seen: np.ndarray, count: int, radius: float, keep: float, ux: float, uz: float, yields: int
) -> float:
    """Price of the contacts that a velocity leads to; less with fellows and with the row that ``yields``.

    Those who come after one, as ways run together, see to it themselves.
    """
    total = 0.0
    for m in range(count):
        o = seen[m]
        if o[FIRST] < 0.0:
            continue
        bodies = radius + o[RADIUS]
        gap = math.hypot(o[PX], o[PZ])
        closing = ((ux - o[EX]) * o[PX] + (uz - o[EZ]) * o[PZ]) / max(gap, 1e-6)
        if closing <= 0.0:
            continue
        kept = min(bodies + (BESIDE if o[FIRST] > 0.0 else keep), max(gap - 0.01, bodies))
        price = danger(contact_time(o[PX], o[PZ], ux - o[EX], uz - o[EZ], kept))
        price *= min(closing / GENTLE, 1.0) ** 2
        if o[FELLOW] > 0.0:
            price *= 0.3
        if int(o[ROW]) == yields:
            price *= 0.4
        total += price
    return total
