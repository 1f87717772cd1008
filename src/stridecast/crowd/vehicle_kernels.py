"""One vehicle for one frame, inside the human bounds, and where it comes to rest if it brakes from now on."""

from __future__ import annotations

import math

import numpy as np

from stridecast.crowd.human_kernels import KEPT, mixed
from stridecast.crowd.state import Limits
from stridecast.geometry.kernels import kernel, wrap
from stridecast.steering.kernels import limit, pull

REST = 0.01
"""A wished speed below this is none, m/s."""

RESPONSE = 7.0
"""How fast a difference between velocity and wish is made up, 1/s."""

SPIN = 1.5
"""The body turns into the direction of motion no faster than this, rad/s."""

ASKEW, ABOUT = math.radians(35.0), math.radians(100.0)
"""Who has just stood may step aside or back before they have turned that way; beyond these angles ..."""

ASIDE, BACK = 0.35, 0.3
"""... no faster than this, m/s."""

SHARP = math.radians(50.0)
"""For a turn sharper than this people slow down first."""


@kernel
def at_speed(limits: Limits, speed: float) -> tuple[float, float, float, float]:
    """Jerk, least and greatest tangential acceleration, and lateral one per speed that hold at a speed."""
    share = min(max((speed - limits.fades[0]) / (limits.fades[1] - limits.fades[0]), 0.0), 1.0)
    return (
        KEPT * mixed(limits.jerk, share),
        KEPT * mixed(limits.low, share),
        KEPT * mixed(limits.high, share),
        KEPT * mixed(limits.wide, share),
    )


@kernel
def brake(
    limits: Limits, x: float, z: float, vx: float, vz: float, ax: float, az: float, dt: float
) -> tuple[float, float, float, float, float, float]:
    """Position, velocity and acceleration of a vehicle after a frame of braking as hard as the bounds allow."""
    speed = math.hypot(vx, vz)
    if speed == 0.0:
        return x, z, 0.0, 0.0, 0.0, 0.0
    sine, cosine = vx / speed, vz / speed
    jerk, low, high, wide = at_speed(limits, speed)
    if rests(speed, vx, vz, ax, az, jerk * dt, dt):
        return x, z, 0.0, 0.0, -vx / dt, -vz / dt
    had_t, had_l = ax * sine + az * cosine, ax * cosine - az * sine
    t, lateral, _, _, _, _ = limit(
        -1e9, 0.0, had_t, had_l, speed, jerk, jerk, low, high, wide, 0.0, speed + 1.0, dt, 0.0
    )
    ax, az = t * sine + lateral * cosine, t * cosine - lateral * sine
    vx, vz = vx + ax * dt, vz + az * dt
    return x + vx * dt, z + vz * dt, vx, vz, ax, az


@kernel
def rests(speed: float, vx: float, vz: float, ax: float, az: float, reach: float, dt: float) -> bool:
    """Whether this is the last frame: nothing is left of the speed then, and of the acceleration what goes in the next.

    ``reach`` is the greatest change of acceleration in a frame.
    """
    return speed <= reach * dt and math.hypot(ax + vx / dt, az + vz / dt) <= reach


@kernel
def turned(heading: float, vx: float, vz: float, most: float) -> float:
    """Heading of a body that turns into the direction of motion, by no more than ``most``."""
    if math.hypot(vx, vz) <= 1e-3:
        return heading
    off = wrap(math.atan2(vx, vz) - heading)
    return wrap(heading + min(max(off, -most), most))


@kernel
def advance(
    limits: Limits,
    runs: bool,
    x: float,
    z: float,
    vx: float,
    vz: float,
    ax: float,
    az: float,
    heading: float,
    turning: float,
    ux: float,
    uz: float,
    dt: float,
) -> tuple[float, float, float, float, float, float, float, float]:
    """State of a vehicle after a frame in which it aims at a velocity ``(ux, uz)``; zero asks for a stop.

    Returns
    -------
    tuple
        Position, velocity, acceleration, heading, side of a reversal under way.
    """
    speed, wish = math.hypot(vx, vz), math.hypot(ux, uz)
    jerk, low, high, wide = at_speed(limits, speed)
    most = max(SPIN, wide) * dt
    if wish < REST:
        x, z, vx, vz, ax, az = brake(limits, x, z, vx, vz, ax, az, dt)
        return x, z, vx, vz, ax, az, turned(heading, vx, vz, most), 0.0
    # The direction of motion; from rest one can go off in any.
    if speed > 0.0:
        sine, cosine = vx / speed, vz / speed
    else:
        sine, cosine = ux / wish, uz / wish
    fastest = KEPT * limits.fastest[1 if runs else 0]
    askew = abs(wrap(math.atan2(sine, cosine) - heading))
    if askew > ASKEW:
        fastest = max(ASIDE if askew < ABOUT else BACK, speed)
    along, across = ux * sine + uz * cosine, ux * cosine - uz * sine
    angle = math.atan2(across, along)
    sharp = abs(angle) > SHARP
    if sharp:
        slower = max(math.cos(angle), 0.0)
        along, across = slower * along, slower * across
    wish_t, wish_l, turning = pull(along, across, speed, 0.0, fastest, RESPONSE, jerk, turning, dt)
    if sharp:
        wish_l = math.copysign(wide * speed, angle if turning == 0.0 else turning)
    if wish_t <= 0.0 and rests(speed, vx, vz, ax, az, jerk * dt, dt):
        return x, z, 0.0, 0.0, -vx / dt, -vz / dt, heading, turning
    had_t, had_l = ax * sine + az * cosine, ax * cosine - az * sine
    t, lateral, _, _, _, _ = limit(
        wish_t, wish_l, had_t, had_l, speed, jerk, jerk, low, high, wide, 0.0, fastest, dt, 0.0
    )
    ax, az = t * sine + lateral * cosine, t * cosine - lateral * sine
    vx, vz = vx + ax * dt, vz + az * dt
    return x + vx * dt, z + vz * dt, vx, vz, ax, az, turned(heading, vx, vz, most), turning


@kernel
def stop(
    limits: Limits,
    x: float,
    z: float,
    vx: float,
    vz: float,
    ax: float,
    az: float,
    dt: float,
    out: np.ndarray,
) -> int:
    """Where a vehicle is in this frame and in all that follow if it brakes; how many until it rests.

    ``out`` has one row a frame; the rows behind the last are not written. A stop that needs more rows than there are
    ends in the last one: nobody may be so fast that this happens.
    """
    out[0, 0], out[0, 1] = x, z
    n = 1
    while n < len(out) and (vx != 0.0 or vz != 0.0):
        x, z, vx, vz, ax, az = brake(limits, x, z, vx, vz, ax, az, dt)
        out[n, 0], out[n, 1] = x, z
        n += 1
    return n
