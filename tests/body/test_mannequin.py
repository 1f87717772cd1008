"""The mannequin: a closed, well-weighted skin around whatever skeleton there is."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bodies import humanoid, writhing
from stridecast.body import kinematics
from stridecast.body.mannequin import mannequin
from stridecast.body.skinning import skin
from stridecast.errors import SkeletonError
from stridecast.geometry import quaternions as quat
from stridecast.model.mesh import SkinnedMesh
from stridecast.model.skeleton import ROLES, Skeleton


def tubes(mesh: SkinnedMesh) -> list[np.ndarray]:
    """Triangles of each connected surface."""
    label = np.arange(len(mesh.positions))
    while True:
        least = label[mesh.triangles].min(axis=1)
        new = label.copy()
        np.minimum.at(new, mesh.triangles.ravel(), np.repeat(least, 3))
        if (new == label).all():
            break
        label = new
    owner = label[mesh.triangles[:, 0]]
    return [mesh.triangles[owner == k] for k in np.unique(owner)]


def volume(positions: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@settings(max_examples=25)
@given(
    have=st.sets(st.sampled_from(ROLES)),
    stretch=st.lists(st.floats(0.0, 2.0), min_size=24, max_size=24),
    low=st.booleans(),
)
def test_any_skeleton_has_a_closed_skin(have: set[str], stretch: list[float], low: bool) -> None:
    whole = humanoid()
    skeleton = replace(
        whole,
        roles={role: joint for role, joint in whole.roles.items() if role in have | {"hips"}},
        offsets=whole.offsets * np.array(stretch)[:, None],
    )
    mesh = mannequin(skeleton, low=low)
    edges = Counter((int(t[k]), int(t[(k + 1) % 3])) for t in mesh.triangles for k in range(3))
    assert all(n == 1 and edges[b, a] == 1 for (a, b), n in edges.items())
    assert all(volume(mesh.positions, part) > 0 for part in tubes(mesh))
    assert np.allclose(mesh.weights.sum(axis=1), 1.0)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)


def test_left_and_right_are_alike() -> None:
    mesh = mannequin(humanoid())
    mirrored = mesh.positions * (-1.0, 1.0, 1.0)
    gaps = np.linalg.norm(mirrored[:, None, :] - mesh.positions[None], axis=-1).min(axis=1)
    assert gaps.max() < 1e-9


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_a_larger_body_has_a_larger_skin(scale: float) -> None:
    small, large = mannequin(humanoid()), mannequin(humanoid(scale))
    np.testing.assert_allclose(large.positions, scale * small.positions, atol=1e-12)
    np.testing.assert_array_equal(large.joints, small.joints)
    np.testing.assert_allclose(large.weights, small.weights, atol=1e-9)


def test_sizes_and_proportions_are_those_of_a_person() -> None:
    mesh = mannequin(humanoid())
    assert 3000 <= len(mesh.triangles) <= 6100
    assert 250 <= len(mannequin(humanoid(), low=True).triangles) <= 400
    tall = np.ptp(mesh.positions[:, 1])
    assert 1.65 < tall < 1.9
    litres = 1000 * sum(volume(mesh.positions, part) for part in tubes(mesh))
    assert 45 < litres < 95, litres  # a person's is 70; parts overlap a little
    assert mesh.positions[:, 2].max() > -mesh.positions[:, 2].min()  # feet and nose point ahead


def test_skinning_at_rest_changes_nothing_and_one_joint_moves_rigidly() -> None:
    skeleton = humanoid()
    mesh = mannequin(skeleton)
    np.testing.assert_allclose(skin(mesh, kinematics.rest(skeleton)), mesh.positions, atol=1e-12)
    rotations = np.tile(quat.IDENTITY, (skeleton.joints, 1))
    rotations[0] = quat.about_y(0.7)
    world = kinematics.forward(skeleton, np.array([1.0, 2.0, 3.0]), rotations)
    expected = np.array([1.0, 2.0, 3.0]) + quat.rotate(quat.about_y(0.7), mesh.positions)
    np.testing.assert_allclose(skin(mesh, world), expected, atol=1e-12)


def test_each_vertex_stays_near_its_bones_in_any_pose() -> None:
    skeleton = humanoid()
    mesh = mannequin(skeleton)
    world = kinematics.pose(writhing(skeleton, frames=20))
    places = skin(mesh, world)
    nearest = np.linalg.norm(mesh.positions[:, None] - mesh.bind_positions[mesh.joints], axis=-1)
    now = np.linalg.norm(places[:, :, None] - world.positions[:, mesh.joints], axis=-1)
    carried = mesh.weights > 0.999
    np.testing.assert_allclose(now[:, carried], np.broadcast_to(nearest[carried], now[:, carried].shape), atol=1e-9)


def test_a_bent_knee_does_not_collapse() -> None:
    skeleton = humanoid()
    mesh = mannequin(skeleton)
    rotations = np.tile(quat.IDENTITY, (skeleton.joints, 1))
    shin = skeleton.joint("left_shin")
    rotations[shin] = quat.exp(np.array([1.4, 0.0, 0.0]))
    bent = skin(mesh, kinematics.forward(skeleton, np.zeros(3), rotations))
    leg = next(
        part
        for part in tubes(mesh)
        if shin in mesh.joints[part[:, 0]] and skeleton.joint("left_thigh") in mesh.joints[part[:, 0]]
    )
    assert volume(bent, leg) > 0.9 * volume(mesh.positions, leg)


def test_no_roles_are_refused() -> None:
    bare = Skeleton(names=("a", "b"), parents=np.array([-1, 0]), offsets=np.array([[0.0, 0, 0], [0, 1.0, 0]]))
    with pytest.raises(SkeletonError, match="hips, legs, arms, head"):
        mannequin(bare)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"positions": np.full((3, 3), np.nan)}, "positions of a mesh must be finite"),
        ({"triangles": np.array([[0, 1, 3]])}, "triangles of a mesh must be numbers from 0 to 2"),
        ({"joints": np.full((3, 4), 1)}, "joints of a mesh must be numbers from 0 to 0"),
        ({"weights": np.full((3, 4), 0.2)}, "must sum to 1"),
    ],
)
def test_a_mesh_that_is_none_is_refused(changed: dict[str, np.ndarray], words: str) -> None:
    good: dict[str, np.ndarray] = {
        "positions": np.eye(3),
        "normals": np.eye(3),
        "triangles": np.array([[0, 1, 2]]),
        "joints": np.zeros((3, 4), np.int64),
        "weights": np.full((3, 4), 0.25),
        "bind_positions": np.zeros((1, 3)),
        "bind_rotations": np.array([quat.IDENTITY]),
    }
    with pytest.raises(SkeletonError, match=words):
        SkinnedMesh(**{**good, **changed})
