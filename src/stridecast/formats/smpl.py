"""SMPL's bodies: what SMPL, SMPL+H and SMPL-X call their joints, a mean skeleton, and skeletons of a body model.

Loper et al. 2015, "SMPL: a skinned multi-person linear model"; Romero et al. 2017, "Embodied hands"; Pavlakos et al.
2019, "Expressive body capture". The body models themselves may not be handed on, so a user who has one names its file;
without one the skeleton is the mean one below, with figures of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from stridecast.errors import FileError
from stridecast.formats.npz import NpzArrays, open_npz

Array = np.ndarray

# name, parent, place in the parent's frame in the T-pose: x to the left, y up, z ahead, metres. An adult of 1.72 m;
# lengths are rounded to a centimetre, left and right alike. Thigh and shin are those of the mean of the people whom the
# database AMASS holds (0.38 and 0.40 m), as on longer legs their feet would slide.
_MIDDLE = (
    ("pelvis", "", (0.0, 0.0, 0.0)),
    ("spine1", "pelvis", (0.0, 0.11, -0.03)),
    ("spine2", "spine1", (0.0, 0.14, 0.0)),
    ("spine3", "spine2", (0.0, 0.05, 0.03)),
    ("neck", "spine3", (0.0, 0.21, -0.04)),
    ("head", "neck", (0.0, 0.07, 0.05)),
)
_LEFT = (
    ("hip", "pelvis", (0.07, -0.09, -0.01)),
    ("knee", "hip", (0.035, -0.378, -0.005)),
    ("ankle", "knee", (-0.015, -0.397, -0.043)),
    ("foot", "ankle", (0.025, -0.056, 0.12)),
    ("collar", "spine3", (0.08, 0.12, -0.03)),
    ("shoulder", "collar", (0.09, 0.03, -0.01)),
    ("elbow", "shoulder", (0.26, -0.01, -0.02)),
    ("wrist", "elbow", (0.25, 0.01, 0.0)),
    ("hand", "wrist", (0.085, -0.01, -0.015)),
)
_ENDS = (
    ("head", (0.0, 0.19, 0.03)),
    ("left_foot", (0.0, -0.02, 0.08)),
    ("right_foot", (0.0, -0.02, 0.08)),
    ("left_wrist", (0.18, -0.01, 0.0)),
    ("right_wrist", (-0.18, -0.01, 0.0)),
)

BODY = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle",
    "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder",
    "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
)  # fmt: skip
"""Joints that all three models have, in their order."""

_BODY_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
_HANDS = tuple(
    f"{side}_{finger}{k}"
    for side in ("left", "right")
    for finger in ("index", "middle", "pinky", "ring", "thumb")
    for k in (1, 2, 3)
)
_FACE = ("jaw", "left_eye_smplhf", "right_eye_smplhf")

MODELS = {
    "SMPL": (*BODY, "left_hand", "right_hand"),
    "SMPL+H": BODY + _HANDS,
    "SMPL-X": BODY + _FACE + _HANDS,
}
"""The models and their joints, in the order of their poses."""

ORIGIN = (0.0, -0.23, 0.03)
"""Place of the pelvis in the mean template, whose origin ``trans`` moves, metres."""

MOST_VERTICES, MOST_SHAPES = 20_000, 500
"""Size of a body model: SMPL-X has 10,475 vertices and 400 directions of shape."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SmplSkeleton:
    """A skeleton in SMPL's T-pose.

    Parameters
    ----------
    names, parents, offsets, end_joints, end_offsets
        As in ``Skeleton``.
    origin
        Place of the pelvis in the template: at ``trans`` zero it is there in the world, whatever the pose.
    """

    names: tuple[str, ...]
    parents: Int[Array, "joints"]
    offsets: Float[Array, "joints 3"]
    end_joints: Int[Array, "ends"]
    end_offsets: Float[Array, "ends 3"]
    origin: Float[Array, "3"]


def joint_parents(names: tuple[str, ...]) -> Int[Array, "joints"]:
    """Index of each joint's parent, for the joints of one of ``MODELS``."""
    index = {name: joint for joint, name in enumerate(names)}
    parents = list(_BODY_PARENTS)
    for name in names[len(BODY) :]:
        if name in _FACE:
            parents.append(index["head"])
        elif name.endswith(("2", "3")):
            parents.append(index[f"{name[:-1]}{int(name[-1]) - 1}"])
        else:
            parents.append(index[f"{name.partition('_')[0]}_wrist"])
    return np.array(parents)


def mean_skeleton() -> SmplSkeleton:
    """The skeleton that is used without a body model: the 22 joints that all models have."""
    places: dict[str, tuple[float, float, float]] = {name: place for name, _, place in _MIDDLE}
    for name, _, (x, y, z) in _LEFT:
        places[f"left_{name}"], places[f"right_{name}"] = (x, y, z), (-x, y, z)
    return SmplSkeleton(
        names=BODY,
        parents=np.array(_BODY_PARENTS),
        offsets=np.array([places[name] for name in BODY]),
        end_joints=np.array([BODY.index(name) for name, _ in _ENDS]),
        end_offsets=np.array([place for _, place in _ENDS]),
        origin=np.array(ORIGIN),
    )


def read_body_model(path: str | Path, betas: Float[Array, "shapes"]) -> SmplSkeleton:
    """Make the skeleton of a person from a body model.

    Parameters
    ----------
    path
        The model as ``.npz`` (as SMPL+H and SMPL-X are handed out): ``v_template``, ``shapedirs`` and ``J_regressor``.
        It should be that of the person's gender.
    betas
        The person's shape; as many of them are used as the model has directions.

    Raises
    ------
    FileError
        The file is no such model, or is damaged.
    """
    with open_npz(path) as arrays:
        missing = [name for name in ("v_template", "shapedirs", "J_regressor") if name not in arrays]
        if missing:
            raise FileError(
                f"is no body model: it lacks {', '.join(missing)}; a model is a .npz file of SMPL, SMPL+H or SMPL-X",
                path=path,
            )
        vertices, shapes, joints = _sizes(path, arrays)
        template = arrays.numbers("v_template", 3 * vertices)
        directions = arrays.numbers("shapedirs", 3 * vertices * shapes)
        regressor = arrays.numbers("J_regressor", joints * vertices)
    for name, values in (("v_template", template), ("shapedirs", directions), ("J_regressor", regressor)):
        if not np.isfinite(values).all():
            raise FileError(f"{name!r} holds numbers that are not finite", path=path)
    used = min(shapes, len(betas))
    at = regressor @ template + np.tensordot(np.tensordot(regressor, directions[..., :used], 1), betas[:used], 1)
    names = next(known for known in MODELS.values() if len(known) == joints)
    parents = joint_parents(names)
    offsets = at - at[np.maximum(parents, 0)]
    mean = mean_skeleton()
    size = _leg(offsets) / _leg(mean.offsets)
    if not 0.2 < size < 3.0:
        raise FileError(
            f"makes a leg of {_leg(offsets):.3g} m, which is no person's; lengths should be metres", path=path
        )
    return SmplSkeleton(
        names=names,
        parents=parents,
        offsets=offsets,
        end_joints=mean.end_joints,
        end_offsets=mean.end_offsets * size,
        origin=at[0],
    )


def _sizes(path: str | Path, arrays: NpzArrays) -> tuple[int, int, int]:
    """Numbers of vertices, of directions of shape and of joints, once they fit together."""
    template, directions = arrays.shape("v_template"), arrays.shape("shapedirs")
    regressor = arrays.shape("J_regressor")
    if not (
        len(template) == 2
        and template[1] == 3
        and 3 < template[0] <= MOST_VERTICES
        and directions[:2] == template
        and len(directions) == 3
        and directions[2] <= MOST_SHAPES
        and len(regressor) == 2
        and regressor[1] == template[0]
    ):
        raise FileError(
            "is no body model: v_template (vertices, 3), shapedirs (vertices, 3, shapes) and J_regressor (joints, "
            f"vertices) do not fit together, as they are {template}, {directions} and {regressor}",
            path=path,
        )
    if regressor[0] not in {len(names) for names in MODELS.values()}:
        known = ", ".join(f"{len(names)} ({model})" for model, names in MODELS.items())
        raise FileError(f"is a body model of {regressor[0]} joints; known are {known}", path=path)
    return template[0], directions[2], regressor[0]


def _leg(offsets: Float[Array, "joints 3"]) -> float:
    """Length of thigh and shin, mean of both sides."""
    parts = [BODY.index(f"{side}_{part}") for side in ("left", "right") for part in ("knee", "ankle")]
    return float(np.linalg.norm(offsets[parts], axis=-1).sum() / 2)
