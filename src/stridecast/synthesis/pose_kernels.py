"""From vehicle and blended features to root and joint rotations (KS07 "Adding Details")."""

from __future__ import annotations

from stridecast.geometry.kernels import about_y, add, exp, kernel, multiply, rotate
from stridecast.synthesis.state import State
from stridecast.synthesis.tables import Tables


@kernel
def compose(tables: Tables, state: State, c: int) -> None:
    """Root and local rotations of character ``c``: details about the vehicle, joints about their references."""
    f = state.features[c]
    joints = len(tables.parents)
    tilt = 3 * (joints - 1)
    facing = about_y(state.heading[c])
    turned = multiply(about_y(state.heading[c] + f[tilt + 6]), exp((f[tilt], f[tilt + 1], f[tilt + 2])))
    away = rotate(facing, (f[tilt + 3], f[tilt + 4], f[tilt + 5]))
    root = add((state.position[c, 0], 0.0, state.position[c, 1]), away)
    for k in range(3):
        state.root[c, k] = root[k]
    set_quaternion(state.rotations, c, 0, turned)
    r = tables.references
    for j in range(1, joints):
        k = 3 * (j - 1)
        q = multiply((r[j - 1, 0], r[j - 1, 1], r[j - 1, 2], r[j - 1, 3]), exp((f[k], f[k + 1], f[k + 2])))
        set_quaternion(state.rotations, c, j, q)


@kernel
def set_quaternion(rotations, c, j, q):  # type: ignore[no-untyped-def]
    """Write a rotation."""
    rotations[c, j, 0] = q[0]
    rotations[c, j, 1] = q[1]
    rotations[c, j, 2] = q[2]
    rotations[c, j, 3] = q[3]
