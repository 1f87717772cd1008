from __future__ import annotations

import pytest

from bodies import humanoid
from rigs import FAMILIES, renamed
from stridecast.body.roles import find_roles
from stridecast.errors import SkeletonError
from stridecast.model.skeleton import LEGS, REQUIRED_ROLES, ROLES

CMU = (
    # name, parent; the BVH of the CMU database for MotionBuilder
    "Hips: LHipJoint:Hips LeftUpLeg:LHipJoint LeftLeg:LeftUpLeg LeftFoot:LeftLeg LeftToeBase:LeftFoot "
    "RHipJoint:Hips RightUpLeg:RHipJoint RightLeg:RightUpLeg RightFoot:RightLeg RightToeBase:RightFoot "
    "LowerBack:Hips Spine:LowerBack Spine1:Spine Neck:Spine1 Neck1:Neck Head:Neck1 "
    "LeftShoulder:Spine1 LeftArm:LeftShoulder LeftForeArm:LeftArm LeftHand:LeftForeArm LeftFingerBase:LeftHand "
    "RightShoulder:Spine1 RightArm:RightShoulder RightForeArm:RightArm RightHand:RightForeArm LThumb:LeftHand"
)
ASF = (
    "root: lhipjoint:root lfemur:lhipjoint ltibia:lfemur lfoot:ltibia ltoes:lfoot "
    "rhipjoint:root rfemur:rhipjoint rtibia:rfemur rfoot:rtibia rtoes:rfoot "
    "lowerback:root upperback:lowerback thorax:upperback lowerneck:thorax upperneck:lowerneck head:upperneck "
    "lclavicle:thorax lhumerus:lclavicle lradius:lhumerus lwrist:lradius lhand:lwrist lfingers:lhand lthumb:lwrist "
    "rclavicle:thorax rhumerus:rclavicle rradius:rhumerus rwrist:rradius rhand:rwrist"
)
GENESIS = (
    "Genesis8Female: hip:Genesis8Female pelvis:hip lThighBend:pelvis lThighTwist:lThighBend lShin:lThighTwist "
    "lFoot:lShin lMetatarsals:lFoot lToe:lMetatarsals rThighBend:pelvis rThighTwist:rThighBend rShin:rThighTwist "
    "rFoot:rShin rMetatarsals:rFoot rToe:rMetatarsals abdomenLower:hip abdomenUpper:abdomenLower "
    "chestLower:abdomenUpper chestUpper:chestLower lCollar:chestUpper lShldrBend:lCollar lForearmBend:lShldrBend "
    "lHand:lForearmBend rCollar:chestUpper rShldrBend:rCollar rForearmBend:rShldrBend rHand:rForearmBend "
    "neckLower:chestUpper neckUpper:neckLower head:neckUpper"
)
BIPED = (
    "Bip01: Bip01_Pelvis:Bip01 Bip01_Spine:Bip01_Pelvis Bip01_L_Thigh:Bip01_Spine Bip01_L_Calf:Bip01_L_Thigh "
    "Bip01_L_Foot:Bip01_L_Calf Bip01_L_Toe0:Bip01_L_Foot Bip01_R_Thigh:Bip01_Spine Bip01_R_Calf:Bip01_R_Thigh "
    "Bip01_R_Foot:Bip01_R_Calf Bip01_R_Toe0:Bip01_R_Foot Bip01_Spine1:Bip01_Spine Bip01_Neck:Bip01_Spine1 "
    "Bip01_Head:Bip01_Neck Bip01_L_Clavicle:Bip01_Spine1 Bip01_L_UpperArm:Bip01_L_Clavicle "
    "Bip01_R_Clavicle:Bip01_Spine1 Bip01_R_UpperArm:Bip01_R_Clavicle"
)


def tree(text: str) -> tuple[list[str], list[int]]:
    pairs = [pair.split(":") for pair in text.split()]
    names = [name for name, _ in pairs]
    return names, [names.index(parent) if parent else -1 for _, parent in pairs]


def called(text: str, mapping: dict[str, str] | None = None) -> dict[str, str]:
    names, parents = tree(text)
    return {role: names[joint] for role, joint in find_roles(names, parents, mapping).items()}


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_is_known(family: str):
    body = humanoid()
    assert find_roles(renamed(family), body.parents.tolist()) == dict(body.roles)


def test_roles_come_in_their_order():
    body = humanoid()
    assert list(find_roles(body.names, body.parents.tolist())) == [role for role in ROLES if role in body.roles]


def test_cmu_bvh():
    roles = called(CMU)
    assert roles["hips"] == "Hips"
    assert [roles[role] for role in ("spine", "spine1", "chest", "neck", "head")] == [
        "LowerBack", "Spine", "Spine1", "Neck", "Head",
    ]  # fmt: skip
    assert [roles[f"left_{part}"] for part in LEGS] == ["LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"]
    assert roles["right_shoulder"] == "RightShoulder"
    assert roles["right_upper_arm"] == "RightArm"
    assert roles["left_hand"] == "LeftHand"


def test_asf():
    roles = called(ASF)
    assert roles["hips"] == "root"
    assert [roles[role] for role in ("spine", "spine1", "chest", "neck", "head")] == [
        "lowerback", "upperback", "thorax", "lowerneck", "head",
    ]  # fmt: skip
    assert [roles[f"right_{part}"] for part in LEGS] == ["rfemur", "rtibia", "rfoot", "rtoes"]
    assert roles["left_hand"] == "lwrist"


def test_hips_are_where_legs_and_head_meet():
    roles = called(GENESIS)
    assert roles["hips"] == "hip"
    assert roles["left_thigh"] == "lThighBend"
    assert roles["left_shin"] == "lShin"
    assert roles["spine"] == "abdomenLower"
    assert roles["chest"] == "chestUpper"
    assert called(BIPED)["hips"] == "Bip01_Spine"


def test_legs_alone_have_hips():
    roles = called("Hips: LeftUpLeg:Hips LeftLeg:LeftUpLeg RightUpLeg:Hips RightLeg:RightUpLeg")
    assert roles["hips"] == "Hips"
    assert "chest" not in roles
    assert "left_foot" not in roles


def test_arms_on_the_hips_make_no_chest():
    roles = called("Hips: LeftUpLeg:Hips RightUpLeg:Hips LeftArm:Hips RightArm:Hips Head:Hips")
    assert "chest" not in roles
    assert roles["head"] == "Head"


def test_one_trunk_joint_is_the_chest():
    roles = called("Hips: LeftUpLeg:Hips RightUpLeg:Hips Body:Hips LeftArm:Body RightArm:Body Head:Body")
    assert roles["chest"] == "Body"
    assert not {"spine", "spine1", "neck"} & set(roles)


def test_unknown_names_have_no_roles():
    assert find_roles(["a", "b"], [-1, 0]) == {}
    assert find_roles(["a"], [-1]) == {}


def test_a_mapping_overrides():
    names = ["a", "ul", "kl", "fl", "tl", "ur", "kr", "fr", "tr"]
    parents = [-1, 0, 1, 2, 3, 0, 5, 6, 7]
    mapping = dict(zip(REQUIRED_ROLES, names, strict=True))
    assert find_roles(names, parents, mapping) == {role: names.index(name) for role, name in mapping.items()}
    assert called(CMU, {"chest": "Spine", "neck": "Neck1"})["chest"] == "Spine"
    assert called(CMU, {"chest": "Spine", "neck": "Neck1"})["neck"] == "Neck1"


def test_hips_follow_from_mapped_legs():
    names, parents = ["a", "x", "l", "r"], [-1, 0, 1, 1]
    assert find_roles(names, parents, {"left_thigh": "l", "right_thigh": "r"})["hips"] == 1


def test_a_wrong_mapping_is_refused():
    body = humanoid()
    with pytest.raises(SkeletonError, match=r"no role 'left_knee'; there are hips, spine.*right_hand"):
        find_roles(body.names, body.parents.tolist(), {"left_knee": "LeftLeg"})
    with pytest.raises(SkeletonError, match=r"no joint 'Knee' for role 'left_shin'; the joints are Hips, Spine"):
        find_roles(body.names, body.parents.tolist(), {"left_shin": "Knee"})
