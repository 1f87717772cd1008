from __future__ import annotations

import socket
import time as clock
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import humanoid, standing, writhing
from stridecast.body import kinematics
from stridecast.errors import InputError, SkeletonError
from stridecast.formats.vmc import (
    MOST_BYTES,
    PORT,
    VmcFigure,
    VmcSender,
    datagrams,
    osc_message,
    parsed_address,
)
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton
from stridecast.samples.adult import adult

osc_bundle = pytest.importorskip("pythonosc.osc_bundle", reason="python-osc decodes (pip install 'stridecast[dev]')")
osc_message_module = pytest.importorskip("pythonosc.osc_message")


def decoded(parts: list[bytes]) -> list[tuple[str, list]]:
    """Messages of some datagrams, by somebody else's decoder."""
    out = []
    for part in parts:
        assert len(part) <= MOST_BYTES
        out += [(message.address, list(message.params)) for message in osc_bundle.OscBundle(part)]
    return out


def frames_of(motion: Motion) -> list[tuple[np.ndarray, np.ndarray]]:
    return list(zip(motion.root_positions, motion.rotations, strict=True))


@pytest.fixture
def receiver():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        listening.settimeout(5.0)
        yield listening


def received(receiver: socket.socket) -> list[tuple[str, list]]:
    """Messages up to the end of a frame."""
    parts: list[bytes] = []
    while not parts or decoded(parts)[-1][0] != "/VMC/Ext/T":
        parts.append(receiver.recv(65536))
    return decoded(parts)


PARENTS = {
    "Spine": "Hips", "Chest": "Spine", "Neck": "Chest", "Head": "Neck",
    "LeftUpperLeg": "Hips", "LeftLowerLeg": "LeftUpperLeg", "LeftFoot": "LeftLowerLeg", "LeftToes": "LeftFoot",
    "LeftShoulder": "Chest", "LeftUpperArm": "LeftShoulder", "LeftLowerArm": "LeftUpperArm", "LeftHand": "LeftLowerArm",
}  # fmt: skip
PARENTS |= {name.replace("Left", "Right"): above.replace("Left", "Right") for name, above in PARENTS.items()}
ROLES = {
    "Hips": "hips",
    "Chest": "chest",
    "Head": "head",
    "LeftToes": "left_toe",
    "RightHand": "right_hand",
    "LeftLowerArm": "left_forearm",
}


def matrix(q: np.ndarray) -> np.ndarray:
    x, y, z, w = q
    return quat.to_matrix(np.array([w, x, y, z]))


def posed(messages: list[tuple[str, list]]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """World places and rotations as a receiver with Unity's axes would have them."""
    bones = {params[0]: params[1:] for address, params in messages if address == "/VMC/Ext/Bone/Pos"}
    places: dict[str, np.ndarray] = {}
    turns: dict[str, np.ndarray] = {}
    for name, numbers in bones.items():
        above = PARENTS.get(name)
        place, turn = np.array(numbers[:3]), matrix(np.array(numbers[3:]))
        places[name] = place if above is None else places[above] + turns[above] @ place
        turns[name] = turn if above is None else turns[above] @ turn
    return places, turns


def test_a_receiver_has_every_joint_where_we_have_it(receiver):
    motion = writhing(frames=5)
    world = kinematics.pose(motion).positions
    with VmcSender("127.0.0.1", receiver.getsockname()[1]) as sender:
        for n, pose in enumerate(frames_of(motion)):
            sender.send(motion.skeleton, pose, 0.5 * n)
            messages = received(receiver)
            places, _ = posed(messages)
            for bone, role in ROLES.items():
                ours = world[n, motion.skeleton.joint(role)] * [-1, 1, 1]
                np.testing.assert_allclose(places[bone], ours, atol=1e-5, err_msg=bone)
            said = dict(messages)
            assert said["/VMC/Ext/T"] == [pytest.approx(0.5 * n)]
            assert said["/VMC/Ext/OK"] == [1]
            assert said["/VMC/Ext/Root/Pos"] == ["root", 0, 0, 0, 0, 0, 0, 1]
            assert len(places) == 21


def lowered() -> Skeleton:
    """A humanoid that rests with its arms hanging and its legs astride."""
    body = humanoid()
    offsets, ends = body.offsets.copy(), body.end_offsets.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hang = quat.exp(np.array([0.0, 0.0, -sign * 1.2]))
        astride = quat.exp(np.array([0.0, 0.0, sign * 0.3]))
        for role in ("forearm", "hand"):
            offsets[body.joint(f"{side}_{role}")] = quat.rotate(hang, offsets[body.joint(f"{side}_{role}")])
        for role in ("shin", "foot"):
            offsets[body.joint(f"{side}_{role}")] = quat.rotate(astride, offsets[body.joint(f"{side}_{role}")])
    return replace(body, offsets=offsets, end_offsets=ends)


def test_a_t_pose_is_sent_without_rotations_whatever_the_rest_pose():
    body = humanoid()
    _, turns = VmcFigure(body).bones(np.array([0.0, 1.0, 0.0]), np.tile(quat.IDENTITY, (body.joints, 1)))
    np.testing.assert_allclose(turns[:5], np.tile([0, 0, 0, 1.0], (5, 1)), atol=1e-12)
    low = lowered()
    figure = VmcFigure(low)
    rotations = np.tile(quat.IDENTITY, (low.joints, 1))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        rotations[low.joint(f"{side}_upper_arm")] = quat.exp(np.array([0.0, 0.0, sign * 1.2]))
        rotations[low.joint(f"{side}_thigh")] = quat.exp(np.array([0.0, 0.0, -sign * 0.3]))
    _, turns = figure.bones(np.array([0.0, 1.0, 0.0]), rotations)
    arms = [k for k, name in enumerate(figure.names) if "Arm" in name or "UpperLeg" in name]
    still = np.abs(turns[arms] @ np.array([0, 0, 0, 1.0]))
    np.testing.assert_allclose(still, 1.0, atol=1e-9)


def test_the_sample_person_is_known():
    figure = VmcFigure(adult())
    assert {"Hips", "Spine", "Chest", "Neck", "Head", "LeftToes", "RightHand"} <= set(figure.names)
    assert figure.names[figure.parents[figure.names.index("LeftShoulder")]] == "Chest"


def test_left_is_left():
    motion = standing()
    places, _ = VmcFigure(motion.skeleton).bones(motion.root_positions[0], motion.rotations[0])
    names = VmcFigure(motion.skeleton).names
    assert places[names.index("LeftUpperLeg")][0] < 0 < places[names.index("RightUpperLeg")][0]
    turned = motion.rotations[0].copy()
    turned[0] = quat.about_y(0.5)  # to the left: in Unity's axes, about +y the other way
    _, turns = VmcFigure(motion.skeleton).bones(motion.root_positions[0], turned)
    np.testing.assert_allclose(turns[0], [0.0, -np.sin(0.25), 0.0, np.cos(0.25)], atol=1e-12)


def test_skeletons_without_arms_and_trunk(receiver):
    body = humanoid()
    legs = {
        role: joint
        for role, joint in body.roles.items()
        if not role.startswith(("neck", "spine")) and "arm" not in role
    }
    figure = VmcFigure(replace(body, roles=legs))
    assert "Spine" not in figure.names
    assert figure.names[figure.parents[figure.names.index("Head")]] == "Chest"
    assert figure.names[figure.parents[figure.names.index("LeftHand")]] == "LeftShoulder"
    with pytest.raises(SkeletonError, match="no joint found for left_thigh"):
        VmcFigure(replace(body, roles={"hips": 0}))


@given(
    st.text(min_size=1, max_size=40).filter(lambda s: "\0" not in s),
    st.integers(-(2**31), 2**31 - 1),
    st.floats(width=32, allow_nan=False),
)
def test_messages_are_osc(text, whole, number):
    data = osc_message("/a/b", text, whole, number)
    assert len(data) % 4 == 0
    message = osc_message_module.OscMessage(data)
    assert (message.address, list(message.params)) == ("/a/b", [text, whole, number])


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("127.0.0.1:39540", ("127.0.0.1", 39540)),
        ("localhost", ("localhost", PORT)),
        ("[::1]:9", ("::1", 9)),
        ("[::1]", ("::1", PORT)),
    ],
)
def test_addresses(text, address):
    assert parsed_address(text) == address


@pytest.mark.parametrize("text", ["", ":39539", "a:b", "::1:9", "a:123456", "a b:1"])
def test_addresses_that_are_none(text):
    with pytest.raises(InputError, match="an address is HOST:PORT"):
        parsed_address(text)


def test_refusals(receiver, unchecked):
    motion = standing()
    with pytest.raises(InputError, match="there is no host"):
        VmcSender("no.such.host.invalid")
    with pytest.raises(InputError, match="a port is a number"):
        VmcSender("127.0.0.1", 70000)
    with VmcSender("127.0.0.1", receiver.getsockname()[1]) as sender:
        with pytest.raises(InputError, match="one character"):
            sender.send(motion.skeleton, (motion.root_positions, motion.rotations), 0.0)
        with pytest.raises(InputError, match="finite"):
            sender.send(motion.skeleton, (motion.root_positions[0] + np.nan, motion.rotations[0]), 0.0)


def test_a_frame_is_quick():
    motion: Motion = writhing(frames=2)
    figure = VmcFigure(motion.skeleton)
    began = clock.perf_counter()
    for n in range(30):
        datagrams(figure, motion.root_positions[n % 2], motion.rotations[n % 2], 0.0)
    assert (clock.perf_counter() - began) / 30 < 0.05
