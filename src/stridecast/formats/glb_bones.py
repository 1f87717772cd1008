"""How joints of a character's body turn the nodes of its file, for players that pose the file themselves."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from stridecast.body.character import Character
from stridecast.formats.glb_rig import GlbRig
from stridecast.geometry import quaternions as quat

Array = np.ndarray


class Bones(NamedTuple):
    """Joint ``j`` turned by ``q`` against its parent turns node ``nodes[j]`` to ``before[j] q after[j]``.

    The root at ``p`` has its node at ``turn^-1 (p / size - corner) / grown``, and the file's scene has the scale
    ``size``. Joints that the file has not have the node -1.
    """

    nodes: Int[Array, "joints"]
    before: Float[Array, "joints 4"]
    after: Float[Array, "joints 4"]
    corner: Float[Array, "3"]
    turn: Float[Array, "4"]
    grown: float
    size: float


def bones_of(path: str | Path, character: Character) -> Bones | None:
    """Find how a character's body poses its file; nothing where that has no meshes.

    Raises
    ------
    FileError
        It is no GLB that can be read (see ``GlbRig``).
    SkeletonError
        It is not the file that the character is from.
    """
    rig = GlbRig(path)
    if not rig.reader.objects("meshes"):
        return None
    rest = rig.rest
    known, size, facing = rig.fitted(character.skeleton)
    own = {int(joint): k for k, joint in enumerate(character.joints)}
    bones = {k: own[joint] for k, joint in known.items() if joint in own}
    count = character.body.joints
    nodes = np.full(count, -1)
    before, after = (np.tile(quat.IDENTITY, (count, 1)) for _ in range(2))
    frames: list[Float[Array, "4"]] = []  # of the file's joints against those of the body that carry them
    for k, node in enumerate(rest.nodes):
        above = rig.figure.over(node)[1] if rest.parents[k] < 0 else frames[int(rest.parents[k])]
        if k not in bones:
            frames.append(quat.multiply(above, rest.local[k]))
            continue
        joint = bones[k]
        turn = character.turns[character.joints[joint]]
        frames.append(quat.multiply(turn, quat.multiply(facing, rest.turns[k])))
        nodes[joint], before[joint], after[joint] = node, quat.inverse(above), frames[k]
    corner, turn, grown = rig.figure.over(int(nodes[0]))
    return Bones(nodes, before, after, corner, turn, grown, size)
