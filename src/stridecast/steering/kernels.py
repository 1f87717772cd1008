"""Steering of one vehicle for one frame: from a wish to a lawful acceleration.

KS07 "Force Extraction" and "Clamping Outliers".

Everything here is written in the vehicle's frame: *tangential* along the direction of motion, *lateral* to its left.
"""

from __future__ import annotations

import math

from stridecast.geometry.kernels import kernel

JERK, TANGENTIAL, LATERAL, SPEED = 1, 2, 4, 8
"""Which bound acted: bits of what ``limit`` returns."""

BEHIND = math.radians(100.0)
"""A wish further round than this asks for a reversal: the vehicle walks round instead of backing up."""

STEADY = 0.8
"""Share of the jerk bound that keeping up a turn may take; the rest is left for speeding up and braking in it."""

UNWIND = 0.7
"""Share of the jerk bound that may be spent on each part of the acceleration while it is wound down in time."""


@kernel
def unwinding(error: float, jerk: float, dt: float) -> float:
    """Greatest acceleration that can still be taken back to nothing before a speed difference ``error`` is used up.

    Counted in whole frames: ``a + (a - r) + (a - 2 r) + ...`` times ``dt`` with ``r = jerk dt`` stays within ``error``.
    """
    r = jerk * dt
    spare = error - r * dt / 8.0
    if spare <= 0.0:
        return 0.0
    return math.sqrt(0.25 * r * r + 2.0 * jerk * spare) - 0.5 * r


@kernel
def pull(
    tangential: float,
    lateral: float,
    speed: float,
    slowest: float,
    fastest: float,
    beta: float,
    jerk: float,
    side: float,
    dt: float,
) -> tuple[float, float, float]:
    """Wished acceleration of a spring-damper towards a wished velocity, without swinging past it.

    KS07's ``alpha (S - x) - beta v`` is ``beta (u - v)`` with the wished velocity ``u = alpha / beta (S - x)``. Its
    acceleration could not be taken back in time under the bound on jerk, so each part is held to what can be unwound.

    Parameters
    ----------
    tangential, lateral
        Wished velocity in the vehicle's frame, m/s.
    speed
        The vehicle's own, m/s.
    slowest, fastest
        The wished speed is brought into this range, m/s.
    beta
        Damping per mass, 1/s.
    jerk
        Bound on the change of acceleration, m/s3.
    side
        To which side a reversal is under way: 1 left, -1 right, 0 none.

    Returns
    -------
    tuple
        Tangential and lateral acceleration (m/s2), and the side of the reversal now.
    """
    wish = math.hypot(tangential, lateral)
    angle = math.atan2(lateral, tangential) if wish > 1e-9 else 0.0
    if abs(angle) > BEHIND:
        if side == 0.0:
            # Straight behind there is no side: left then, whichever way rounding goes.
            side = 1.0 if angle > 0.0 or abs(angle) > math.pi - 1e-6 else -1.0
        angle = side * BEHIND
    elif abs(angle) < 0.8 * BEHIND:
        side = 0.0
    wish = min(max(wish, slowest), fastest)
    along = max(wish * math.cos(angle), slowest)
    a = beta * (along - speed)
    most = unwinding(abs(along - speed), UNWIND * jerk, dt)
    a = min(max(a, -most), most)
    b = beta * wish * math.sin(min(max(angle, -0.5 * math.pi), 0.5 * math.pi))
    most = unwinding(speed * abs(angle), UNWIND * jerk, dt)
    return a, min(max(b, -most), most), side


@kernel
def limit(
    wish_t: float,
    wish_l: float,
    had_t: float,
    had_l: float,
    speed: float,
    jerk: float,
    later_jerk: float,
    low: float,
    high: float,
    lateral_per_speed: float,
    slowest: float,
    fastest: float,
    dt: float,
    rising: float = 0.0,
) -> tuple[float, float, float, float, float, int]:
    """The acceleration nearest to a wish that keeps every bound (KS07 "Clamping Outliers").

    KS07 clamps the change of acceleration, then its parts, then the speed, each undoing some of the one before. Here
    all hold at once: bounds on the parts, tightened so far ahead that the bound on speed is met within the bound on
    jerk, are a box; the last acceleration lies in it, so the way from there to the wish, cut to the box and to the
    jerk, does too. Where it does not (the bounds have just changed), the bound that cannot be met in this frame moves
    as fast as the jerk allows; ``in force`` is what then holds.

    Parameters
    ----------
    wish_t, wish_l
        Wished acceleration, m/s2.
    had_t, had_l
        Acceleration of the last frame, in the same frame of reference.
    speed
        Speed before this frame, m/s.
    jerk, low, high, lateral_per_speed, slowest, fastest
        The bounds.
    later_jerk
        Bound on the jerk that will hold when the speed bounds are met: that of the motion a transition leads to.
    rising
        How fast the greatest speed rises, m/s2: at this rate the speed may go on growing when it meets it.

    Returns
    -------
    tuple
        Tangential and lateral acceleration, the least and greatest tangential and the greatest lateral one in force,
        and the bits of the bounds that acted.
    """
    reach = jerk * dt
    acted = 0

    # 1. The box. Turning alone adds a little speed each frame; that much is taken off what may be added.
    # In a turn at the rate w the force across comes round by w2 v a second: no sharper than the jerk can keep up.
    lateral_per_speed = min(lateral_per_speed, math.sqrt(STEADY * jerk / max(speed, 1e-3)))
    wide = lateral_per_speed * max(speed, 0.0)
    turned = min(abs(wish_l), wide)
    own = 0.5 * turned * turned * dt / max(speed, 1e-6) if speed > 1e-6 else 0.0
    lowest, highest = low, high
    if speed > slowest:
        brake = -min(unwinding(speed - slowest, later_jerk, dt), (speed - slowest) / dt)
    else:
        brake = min(0.0 if speed == slowest else (slowest - speed) / dt, high)
    if brake > lowest:
        lowest = brake
    push = max((fastest - speed) / dt, low)
    if speed < fastest:
        # In a turn the force across comes round into the direction of motion; what that takes of the jerk cannot brake.
        bent = max(turned, min(abs(had_l), wide))
        spare = max(later_jerk - bent * bent / max(speed, 1e-6), 0.2 * later_jerk)
        push = min(push, rising + unwinding(fastest - speed, spare, dt))
    if push - own < highest:
        highest = max(push - own, low)
    speed_low, speed_high = lowest > low, highest < high
    if lowest > highest:
        lowest = highest

    # 2. The wish, cut to the box.
    t = min(max(wish_t, lowest), highest)
    if wish_t < lowest:
        acted |= SPEED if speed_low else TANGENTIAL
    elif wish_t > highest:
        acted |= SPEED if speed_high else TANGENTIAL
    # Slowing down narrows the bound on turning within the frame.
    wide = lateral_per_speed * max(min(speed, speed + t * dt), 0.0)
    lateral = min(max(wish_l, -wide), wide)
    if lateral != wish_l:
        acted |= LATERAL

    # 3. The way there, cut to the jerk.
    far = math.hypot(t - had_t, lateral - had_l)
    if far > reach:
        acted |= JERK
        inside_t = min(max(had_t, lowest), highest)
        inside_l = min(max(had_l, -wide), wide)
        back = math.hypot(inside_t - had_t, inside_l - had_l)
        if back >= reach:
            # The box cannot be reached at once: go straight for it.
            t = had_t + (inside_t - had_t) * reach / back
            lateral = had_l + (inside_l - had_l) * reach / back
        else:
            # The furthest point on the way from inside the box to the wish that the jerk allows.
            dt_, dl_ = t - inside_t, lateral - inside_l
            et, el = inside_t - had_t, inside_l - had_l
            qa = dt_ * dt_ + dl_ * dl_
            qb = et * dt_ + el * dl_
            qc = et * et + el * el - reach * reach
            share = (-qb + math.sqrt(max(qb * qb - qa * qc, 0.0))) / qa if qa > 0.0 else 0.0
            share = min(max(share, 0.0), 1.0)
            t, lateral = inside_t + share * dt_, inside_l + share * dl_
        narrow = lateral_per_speed * max(min(speed, speed + t * dt), 0.0)
        if abs(lateral) > narrow:
            cut = narrow if lateral > 0.0 else -narrow
            if math.hypot(t - had_t, cut - had_l) <= reach:
                lateral = cut
    if speed + t * dt < 0.0:
        # Rather a jolt than a step backwards: only here the bound on jerk gives way.
        t, lateral = -speed / dt, 0.0
    return t, lateral, min(lowest, t), max(highest, t), max(wide, abs(lateral)), acted
