"""Following a reference with a vehicle that keeps a person's bounds, frame by frame."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from stridecast.geometry.kernels import kernel
from stridecast.steering.kernels import limit, pull, unwinding

Floats = NDArray[np.float64]

STIFFNESS = 4.0
"""How fast a distance from the reference is made up, 1/s (a critically damped spring)."""

TURNING_SPEED = 0.25
"""Who has to turn round on the spot walks so fast, m/s: nobody turns without a step."""

SLOW = 0.45
"""Below this speed a reference that leads elsewhere is turned to before it is followed, m/s."""

ASIDE = math.radians(40.0)
"""It leads elsewhere where it leads more than this to the side."""

NEAR = 0.1
"""Who stands no further than this from where one should stand stays there, metres."""

AT_REST = 1e-3
"""Who comes to stand and is slower than this stands, m/s."""

AHEAD = 0.4
"""Where to turn on the spot is looked for so far ahead, seconds."""

HASTE, HASTE_SHARE = 0.5, 0.25
"""Who is behind by more than the one, metres, hurries as if it were that (1 m/s), or the share of the way if more."""

KEPT = 0.985
"""Share of the bounds that is used; the rest is for bounds that change with speed within a frame."""


@kernel
def mixed(values: Floats, share: float) -> float:
    """A bound between that of the first gait and that of the last."""
    return (1.0 - share) * values[0] + share * values[-1]


@kernel
def follow(
    reference: Floats,
    standing: NDArray[np.bool_],
    starts: NDArray[np.int64],
    headings: Floats,
    jerks: Floats,
    tangential: Floats,
    lateral_per_speed: Floats,
    fastest: float,
    fades: Floats,
    dt: float,
    out: Floats,
) -> None:
    """Follow references ``(rows, 2)``; that of person ``c`` is rows ``starts[c]`` to ``starts[c + 1]``.

    ``out`` takes position, velocity, acceleration and heading, seven columns.
    """
    ahead_of = int(AHEAD / dt)
    for c in range(len(starts) - 1):
        first, last = starts[c], starts[c + 1]
        x, z = reference[first, 0], reference[first, 1]
        heading = headings[c]
        vx, vz, ax, az, side = 0.0, 0.0, 0.0, 0.0, 0.0
        if last - first > 1 and not standing[first]:
            sine, cosine = math.sin(heading), math.cos(heading)
            rx, rz = (reference[first + 1, 0] - x) / dt, (reference[first + 1, 1] - z) / dt
            speed = min(max(rx * sine + rz * cosine, 0.0), KEPT * fastest)
            vx, vz = speed * sine, speed * cosine
            if last - first > 2:
                # who is seen first in a bend, or speeding up, is in the middle of it
                share = 0.0
                if len(jerks) > 1:
                    share = min(max((speed - fades[0]) / (fades[1] - fades[0]), 0.0), 1.0)
                fx = ((reference[first + 2, 0] - reference[first + 1, 0]) / dt - rx) / dt
                fz = ((reference[first + 2, 1] - reference[first + 1, 1]) / dt - rz) / dt
                wide = 0.5 * mixed(lateral_per_speed, share) * speed
                low, high = 0.5 * mixed(tangential[:, 0], share), 0.5 * mixed(tangential[:, 1], share)
                high = min(high, unwinding(KEPT * fastest - speed, 0.5 * mixed(jerks, share), dt))
                t = min(max(fx * sine + fz * cosine, low), high)
                lateral = min(max(fx * cosine - fz * sine, -wide), wide)
                ax, az = t * sine + lateral * cosine, t * cosine - lateral * sine
        for n in range(first, last):
            if n > first:
                sine, cosine = math.sin(heading), math.cos(heading)
                speed = math.hypot(vx, vz)
                # where the reference was, is in this frame, and what that takes
                px, pz = reference[n - 1, 0], reference[n - 1, 1]
                rx, rz = (reference[n, 0] - px) / dt, (reference[n, 1] - pz) / dt
                qx, qz = rx, rz
                if n - 1 > first:
                    qx, qz = (px - reference[n - 2, 0]) / dt, (pz - reference[n - 2, 1]) / dt
                ex, ez = px - x, pz - z
                away = math.hypot(ex, ez)
                if away > HASTE:
                    held = max(HASTE, HASTE_SHARE * away) / away
                    ex, ez = held * ex, held * ez
                k = STIFFNESS
                fx = (rx - qx) / dt + k * k * ex + 2.0 * k * (qx - vx)
                fz = (rz - qz) / dt + k * k * ez + 2.0 * k * (qz - vz)
                if n - 1 == first:
                    fx, fz = (rx - vx) / dt + k * k * ex, (rz - vz) / dt + k * k * ez
                wish_t, wish_l = fx * sine + fz * cosine, fx * cosine - fz * sine
                share = 0.0
                if len(jerks) > 1:
                    share = min(max((speed - fades[0]) / (fades[1] - fades[0]), 0.0), 1.0)
                jerk = KEPT * mixed(jerks, share)
                low, high = KEPT * mixed(tangential[:, 0], share), KEPT * mixed(tangential[:, 1], share)
                wide = KEPT * mixed(lateral_per_speed, share)

                later = min(n + ahead_of, last - 1)
                far = 2.0 * max(1.0 - NEAR / away, 0.0) if away > 0.0 else 0.0
                ux = (reference[later, 0] - px) / AHEAD + far * ex
                uz = (reference[later, 1] - pz) / AHEAD + far * ez
                along, across = ux * sine + uz * cosine, ux * cosine - uz * sine
                leaving = math.hypot(reference[later, 0] - px, reference[later, 1] - pz) > 0.5 * NEAR
                hold = standing[n] and not leaving and away < NEAR and speed < SLOW
                if hold:
                    wish_t, wish_l, side = -4.0 * speed if speed > 0.02 else -speed / dt, 0.0, 0.0
                elif speed < SLOW and abs(math.atan2(across, along)) > ASIDE and math.hypot(ux, uz) > 0.1:
                    wish_t, wish_l, side = pull(
                        along, across, speed, TURNING_SPEED, max(TURNING_SPEED, 0.6 * SLOW), 6.0, jerk, side, dt
                    )
                else:
                    side = 0.0
                had_t, had_l = ax * sine + az * cosine, ax * cosine - az * sine
                t, lateral, _, _, _, _ = limit(
                    wish_t, wish_l, had_t, had_l, speed, jerk, jerk, low, high, wide, 0.0, KEPT * fastest, dt
                )
                if hold and speed < AT_REST and math.hypot(speed / dt + had_t, had_l) < jerk * dt:
                    t, lateral = -speed / dt, 0.0
                if speed + t * dt < 1e-3:
                    # hardly moving: straight on, and never back by a rounding error
                    t, lateral = max(t, -speed / dt), 0.0
                ax, az = t * sine + lateral * cosine, t * cosine - lateral * sine
                now = max(speed + t * dt, 0.0)
                vx, vz = now * sine + lateral * dt * cosine, now * cosine - lateral * dt * sine
                x += vx * dt
                z += vz * dt
                if lateral != 0.0:
                    heading = math.atan2(vx, vz)
            out[n, 0], out[n, 1], out[n, 2], out[n, 3], out[n, 4], out[n, 5] = x, z, vx, vz, ax, az
            out[n, 6] = heading
