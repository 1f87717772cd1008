"""Following a reference with a vehicle that keeps a person's bounds, frame by frame."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from stridecast.geometry.kernels import kernel
from stridecast.steering.kernels import limit, pull

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

                ux, uz = rx + 2.0 * ex, rz + 2.0 * ez
                along, across = ux * sine + uz * cosine, ux * cosine - uz * sine
                away = math.hypot(ex, ez)
                if standing[n] and away < NEAR and speed < SLOW:
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
                ax, az = t * sine + lateral * cosine, t * cosine - lateral * sine
                vx += ax * dt
                vz += az * dt
                x += vx * dt
                z += vz * dt
                if math.hypot(vx, vz) > 1e-3 and vx * sine + vz * cosine > 0.0:
                    heading = math.atan2(vx, vz)
            out[n, 0], out[n, 1], out[n, 2], out[n, 3], out[n, 4], out[n, 5] = x, z, vx, vz, ax, az
            out[n, 6] = heading
