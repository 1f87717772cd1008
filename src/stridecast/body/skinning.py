"""Where the skin is when the bones have moved: linear blend skinning, as every engine does it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from stridecast.body.kinematics import World
from stridecast.geometry import quaternions as quat
from stridecast.model.mesh import SkinnedMesh


def skin(mesh: SkinnedMesh, world: World) -> Float[np.ndarray, "*shape vertices 3"]:
    """Places of a mesh's vertices when its joints are where ``world`` has them, metres.

    Each joint carries the vertex from where it is in the bind pose; the weighted mean of where they carry it is where
    it goes.
    """
    moved = 0.0
    turns = quat.multiply(world.rotations, quat.inverse(mesh.bind_rotations))
    for k in range(mesh.joints.shape[1]):
        joints = mesh.joints[:, k]
        arms = mesh.positions - mesh.bind_positions[joints]
        carried = world.positions[..., joints, :] + quat.rotate(turns[..., joints, :], arms)
        moved = moved + mesh.weights[:, k : k + 1] * carried
    return np.asarray(moved)


def vertex_normals(
    positions: Float[np.ndarray, "vertices 3"], triangles: np.ndarray
) -> Float[np.ndarray, "vertices 3"]:
    """Unit normals of a closed surface: the mean of its triangles about each vertex, by area; up where it has none."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    out = np.zeros_like(positions)
    for k in range(3):
        np.add.at(out, triangles[:, k], faces)
    sizes = np.linalg.norm(out, axis=-1, keepdims=True)
    return np.where(sizes > 1e-18, out / np.maximum(sizes, 1e-18), [0.0, 1.0, 0.0])
