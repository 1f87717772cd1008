"""VMC, the Virtual Motion Capture protocol: a pose a frame as OSC messages by UDP, for Unity, Unreal, Blender, Godot.

The protocol (protocol.vmc.info) names the joints as Unity does and has Unity's axes: metres, y up, the character faces
+z with its left hand at -x, so that everything is mirrored in x. OSC 1.0 is that of Wright & Freed
(opensoundcontrol.org).
"""

from __future__ import annotations

import re
import socket
import struct
from types import TracebackType

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.errors import InputError
from stridecast.geometry import quaternions as quat
from stridecast.model.pose import Pose
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

PORT = 39539
"""Where receivers usually listen."""

MOST_BYTES = 1400
"""A datagram stays smaller, so that no network cuts it."""

BONES = (
    # Unity's name, role, name of the bone it hangs from
    ("Hips", "hips", ""),
    ("Spine", "spine", "Hips"),
    ("Chest", "chest", "Spine"),
    ("Neck", "neck", "Chest"),
    ("Head", "head", "Neck"),
    *(
        (f"{side}{bone}", f"{side.lower()}_{part}", above.format(side))
        for side in ("Left", "Right")
        for bone, part, above in (
            ("UpperLeg", "thigh", "Hips"),
            ("LowerLeg", "shin", "{}UpperLeg"),
            ("Foot", "foot", "{}LowerLeg"),
            ("Toes", "toe", "{}Foot"),
            ("Shoulder", "shoulder", "Chest"),
            ("UpperArm", "upper_arm", "{}Shoulder"),
            ("LowerArm", "forearm", "{}UpperArm"),
            ("Hand", "hand", "{}LowerArm"),
        )
    ),
)
"""Bones of Unity's ``HumanBodyBones`` that are sent; those whose role a skeleton lacks are left out."""

_MIRROR_PLACE = np.array([-1.0, 1.0, 1.0])
_MIRROR_TURN = np.array([1.0, 1.0, -1.0, -1.0])
_AT_ONCE = b"#bundle\0" + struct.pack(">Q", 1)


class VmcFigure:
    """What is known beforehand of a skeleton that is sent.

    Receivers pose a figure whose joint frames all agree with the world while it stands in a T-pose. So each limb is
    turned by what leads from there to the skeleton's own rest pose.

    Parameters
    ----------
    skeleton
        Whose poses are sent.

    Raises
    ------
    SkeletonError
        It lacks the hips or a joint of the legs.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        skeleton.require_roles()
        self.skeleton = skeleton
        there = [bone for bone in BONES if bone[1] in skeleton.roles]
        above = {name: parent for name, _, parent in BONES}
        self.names = tuple(name for name, _, _ in there)
        self.joints = np.array([skeleton.joint(role) for _, role, _ in there])
        self.parents = np.array([self._nearest(parent, above) for _, _, parent in there])
        self._turns = np.array([self._from_t_pose(role) for _, role, _ in there])

    def _nearest(self, name: str, above: dict[str, str]) -> int:
        while name and name not in self.names:
            name = above[name]
        return self.names.index(name) if name else -1

    def _from_t_pose(self, role: str) -> Float[Array, "4"]:
        """Rotation from the direction a bone has in a T-pose to that in the rest pose."""
        side, _, part = role.partition("_")
        out = 1.0 if side == "left" else -1.0
        ways = {
            "thigh": ("shin", (0.0, -1.0, 0.0)),
            "shin": ("foot", (0.0, -1.0, 0.0)),
            "upper_arm": ("forearm", (out, 0.0, 0.0)),
            "forearm": ("hand", (out, 0.0, 0.0)),
        }
        part = "forearm" if part == "hand" else part  # a hand goes with its arm
        after, way = ways.get(part, ("", (0.0, 0.0, 0.0)))
        roles = self.skeleton.roles
        if f"{side}_{part}" not in roles or f"{side}_{after}" not in roles:
            return quat.IDENTITY
        rest = kinematics.rest(self.skeleton).positions
        bone = rest[roles[f"{side}_{after}"]] - rest[roles[f"{side}_{part}"]]
        return quat.between(np.array(way), bone) if np.linalg.norm(bone) > 0 else quat.IDENTITY

    def bones(
        self, root_position: Float[Array, "3"], rotations: Float[Array, "joints 4"]
    ) -> tuple[Float[Array, "bones 3"], Float[Array, "bones 4"]]:
        """Places and rotations of the bones against the bone they hang from, as Unity has them.

        Parameters
        ----------
        root_position, rotations
            A pose, as in ``Pose``.

        Returns
        -------
        places
            Metres, +x to the right.
        rotations
            Quaternions in the order ``x y z w``. Those of the hips are in the world.
        """
        world = kinematics.forward(self.skeleton, root_position, rotations)
        at = world.positions[self.joints]
        turned = quat.multiply(world.rotations[self.joints], self._turns)
        back = quat.inverse(turned[self.parents])
        places = np.where(self.parents[:, None] < 0, at, quat.rotate(back, at - at[self.parents]))
        turns = np.where(self.parents[:, None] < 0, turned, quat.multiply(back, turned))
        mirrored = turns * _MIRROR_TURN
        return places * _MIRROR_PLACE, mirrored[:, [1, 2, 3, 0]]


class VmcSender:
    """Sends poses to one receiver; a context that closes its socket.

    Parameters
    ----------
    host, port
        Where the receiver listens. One character a port.

    Raises
    ------
    InputError
        There is no such host, or no such port.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = PORT) -> None:
        if not 0 < port < 65536:
            raise InputError(f"a port is a number from 1 to 65535, not {port}")
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
        except (OSError, UnicodeError) as error:
            raise InputError(f"there is no host {host!r}: {error}") from None
        family, kind, protocol, _, address = found[0]
        self.address: tuple[object, ...] = address
        self._socket = socket.socket(family, kind, protocol)
        self._figure: VmcFigure | None = None

    def __enter__(self) -> VmcSender:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def send(self, skeleton: Skeleton, pose: Pose | tuple[Array, Array], time: float) -> None:
        """Send one frame.

        Parameters
        ----------
        skeleton
            Whose pose it is.
        pose
            Of one character; or its ``root_position`` and ``rotations``.
        time
            Seconds, on whatever clock.

        Raises
        ------
        SkeletonError
            The skeleton lacks hips or legs.
        InputError
            A pose of many characters, or with numbers that are not finite; the network refuses.
        """
        if self._figure is None or self._figure.skeleton is not skeleton:
            self._figure = VmcFigure(skeleton)
        root, rotations = (pose.root_position, pose.rotations) if isinstance(pose, Pose) else pose
        if root.shape != (3,) or rotations.shape != (skeleton.joints, 4):
            raise InputError("VMC takes the pose of one character; open a sender, with a port, for each")
        if not (np.isfinite(root).all() and np.isfinite(rotations).all() and np.isfinite(time)):
            raise InputError("a pose that is sent must be of finite numbers")
        for datagram in datagrams(self._figure, root, rotations, time):
            try:
                self._socket.sendto(datagram, self.address)
            except OSError as error:
                raise InputError(f"cannot send to {self.address[0]} port {self.address[1]}: {error}") from error


def datagrams(
    figure: VmcFigure, root_position: Float[Array, "3"], rotations: Float[Array, "joints 4"], time: float
) -> list[bytes]:
    """OSC bundles of one frame, each within ``MOST_BYTES``; the last ends with the frame's time.

    The root stays at the origin and the hips have their place in the world, which all receivers understand alike.
    """
    places, turns = figure.bones(root_position, rotations)
    messages = [osc_message("/VMC/Ext/Root/Pos", "root", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)]
    for name, place, turn in zip(figure.names, places.tolist(), turns.tolist(), strict=True):
        messages.append(osc_message("/VMC/Ext/Bone/Pos", name, *place, *turn))
    messages += [osc_message("/VMC/Ext/OK", 1), osc_message("/VMC/Ext/T", float(time))]
    bundles, size = [[_AT_ONCE]], len(_AT_ONCE)
    for message in messages:
        if size + 4 + len(message) > MOST_BYTES:
            bundles.append([_AT_ONCE])
            size = len(_AT_ONCE)
        bundles[-1] += [struct.pack(">i", len(message)), message]
        size += 4 + len(message)
    return [b"".join(parts) for parts in bundles]


def osc_message(address: str, *arguments: str | int | float) -> bytes:
    """Encode an OSC message of strings, 32-bit integers and floats."""
    kinds, data = ",", b""
    for argument in arguments:
        if isinstance(argument, str):
            kinds, data = kinds + "s", data + _padded(argument)
        elif isinstance(argument, int):
            kinds, data = kinds + "i", data + struct.pack(">i", argument)
        else:
            kinds, data = kinds + "f", data + struct.pack(">f", argument)
    return _padded(address) + _padded(kinds) + data


def _padded(text: str) -> bytes:
    """A string with its end, filled to a multiple of four bytes."""
    data = text.encode("utf-8") + b"\0"
    return data + b"\0" * (-len(data) % 4)


def parsed_address(text: str) -> tuple[str, int]:
    """Host and port of ``HOST:PORT``, ``[IPV6]:PORT``, or only a host with the usual port.

    Raises
    ------
    InputError
        It is none.
    """
    match = re.fullmatch(r"\[([0-9A-Fa-f:.%\w]+)\](?::(\d{1,5}))?|([^\s:\[\]]+)(?::(\d{1,5}))?", text.strip())
    if match is None:
        raise InputError(f"an address is HOST:PORT, such as 127.0.0.1:{PORT}, not {text!r}")
    host, port = match[1] or match[3], match[2] or match[4]
    return host, PORT if port is None else int(port)
