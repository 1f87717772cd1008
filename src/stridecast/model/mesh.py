"""The skin of a body: triangles whose corners follow joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from stridecast.errors import SkeletonError

INFLUENCES = 4
"""So many joints move a vertex at most."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SkinnedMesh:
    """Triangles around a skeleton, as they are in one pose of it, the bind pose.

    Parameters
    ----------
    positions, normals
        Of the vertices in the bind pose, metres and unit vectors; the root of the skeleton is at the origin.
    triangles
        Three vertices each, counter-clockwise seen from outside.
    joints, weights
        Which joints move a vertex and how much each; the weights of a vertex are not negative and sum to 1.
    bind_positions, bind_rotations
        Where the joints are in the bind pose and how they are turned, in the world.

    Raises
    ------
    SkeletonError
        Shapes that do not fit, numbers that are not finite, a vertex or joint that does not exist, weights that do not
        sum to 1.
    """

    positions: Float[np.ndarray, "vertices 3"]
    normals: Float[np.ndarray, "vertices 3"]
    triangles: Int[np.ndarray, "triangles 3"]
    joints: Int[np.ndarray, "vertices 4"]
    weights: Float[np.ndarray, "vertices 4"]
    bind_positions: Float[np.ndarray, "joints 3"]
    bind_rotations: Float[np.ndarray, "joints 4"]

    def __post_init__(self) -> None:
        for name in ("positions", "normals", "weights", "bind_positions", "bind_rotations"):
            self._freeze(name, np.float64)
        for name in ("triangles", "joints"):
            self._freeze(name, np.int64)
        self._check()

    def _freeze(self, name: str, kind: type[np.generic]) -> None:
        array = np.array(getattr(self, name), kind)
        array.setflags(write=False)
        object.__setattr__(self, name, array)

    def _check(self) -> None:
        vertices, count = len(self.positions), len(self.bind_positions)
        shapes = {
            "positions": (vertices, 3),
            "normals": (vertices, 3),
            "triangles": (len(self.triangles), 3),
            "joints": (vertices, INFLUENCES),
            "weights": (vertices, INFLUENCES),
            "bind_positions": (count, 3),
            "bind_rotations": (count, 4),
        }
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.shape != shape:
                raise SkeletonError(f"{name} of a mesh must have the shape {shape}, not {array.shape}")
            if not np.isfinite(array).all():
                raise SkeletonError(f"{name} of a mesh must be finite numbers")
        for name, most in (("triangles", vertices), ("joints", count)):
            array = getattr(self, name)
            if array.size and not (array.min() >= 0 and array.max() < most):
                raise SkeletonError(f"{name} of a mesh must be numbers from 0 to {most - 1}")
        if (self.weights < 0).any() or not np.allclose(self.weights.sum(axis=-1), 1.0, atol=1e-6):
            raise SkeletonError("weights of a vertex must not be negative and must sum to 1")
