from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bodies import humanoid
from characters import A_POSE, bandai_like, built, mixamo_like, posed_at_rest, with_fingers, with_twist_bones
from stridecast.body import kinematics
from stridecast.body.character import character_of, resized, stature
from stridecast.errors import SkeletonError
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

RIGS = {
    "twist bones": lambda _: with_twist_bones(),
    "fingers": lambda _: with_fingers(humanoid()),
    "arms half down": lambda _: posed_at_rest(built(legs=0.8, feet=1.3), A_POSE),
    "mixamo": mixamo_like,
    "bandai": bandai_like,
}


@pytest.fixture(scope="module", params=RIGS)
def rig(request, tmp_path_factory) -> Skeleton:
    return RIGS[request.param](tmp_path_factory.mktemp("rig"))


def moved(skeleton: Skeleton, seed: int, frames: int = 3) -> Motion:
    rng = np.random.default_rng(seed)
    rotations = quat.exp(rng.normal(0, 0.6, (frames, skeleton.joints, 3)))
    return Motion(skeleton=skeleton, frame_rate=30.0, root_positions=rng.normal(0, 1, (frames, 3)), rotations=rotations)


def test_the_body_has_a_joint_for_each_role_and_no_more(rig):
    body = character_of(rig, humanoid()).body
    assert body.roles.keys() == rig.roles.keys()
    assert body.joints == len(set(body.roles.values()))
    assert [body.names[joint] for joint in body.roles.values()] == [rig.names[joint] for joint in rig.roles.values()]


def test_limbs_of_the_body_rest_as_those_of_the_model(rig):
    model, body = humanoid(), character_of(rig, humanoid()).body
    for side in ("left", "right"):
        for inner, outer in (("thigh", "shin"), ("shin", "foot"), ("upper_arm", "forearm"), ("forearm", "hand")):
            ways = []
            for one in (model, body):
                at = kinematics.rest(one).positions
                a, b = one.chain(f"{side}_{inner}", f"{side}_{outer}")
                ways.append((at[b] - at[a]) / np.linalg.norm(at[b] - at[a]))
            np.testing.assert_allclose(*ways, atol=1e-9)


@given(seed=st.integers(0, 999), size=st.sampled_from([1.0, 0.7, 1.4]))
@settings(max_examples=10, deadline=None)
def test_what_the_body_plays_the_whole_skeleton_plays_in_the_same_places(rig, seed, size):
    character = character_of(rig, humanoid())
    motion = moved(resized(character.body, size), seed)
    played = character.played(motion)
    there, here = (kinematics.pose(one).positions for one in (played, motion))
    np.testing.assert_allclose(there[:, character.joints], here, atol=1e-9)
    bones = np.linalg.norm(there[:, 1:] - there[:, rig.parents[1:]], axis=-1)
    np.testing.assert_allclose(bones, size * np.tile(np.linalg.norm(rig.offsets[1:], axis=-1), (3, 1)), atol=1e-9)


def test_the_tips_of_the_body_are_those_of_the_file():
    rig = with_fingers(humanoid())
    character = character_of(rig, humanoid())
    tips = kinematics.ends(character.body, kinematics.rest(character.body))
    for name in ("LeftHandIndex2", "RightHandIndex2"):
        finger = kinematics.rest(rig).positions[rig.names.index(name)]
        assert np.linalg.norm(tips - finger, axis=-1).min() < 1e-9
    assert stature(character.body) == pytest.approx(stature(rig))


def test_who_has_no_legs_is_refused():
    model = humanoid()
    legless = Skeleton(names=("hips",), parents=np.array([-1]), offsets=np.zeros((1, 3)), roles={"hips": 0})
    with pytest.raises(SkeletonError, match="left_thigh"):
        character_of(legless, model)
