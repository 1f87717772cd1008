"""What a file holds, and how the joints of its rig become those of a body: rooted at the hips, with toes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int

from stridecast.geometry import quaternions as quat
from stridecast.model.skeleton import Skeleton


@dataclass(frozen=True, kw_only=True, eq=False)
class RawRecording:
    """What a file holds, in the file's own units and axes; angles are already rotations.

    Parameters
    ----------
    names, parents, offsets
        Joints as in ``Skeleton``. The first row of ``offsets`` is what the file gives as the root's own offset.
    end_joints, end_offsets
        Ends of the last bones as in ``Skeleton``.
    root_positions
        Place of the root at each frame.
    rotations
        Unit quaternions ``w x y z``, joint to parent, the root's in the world.
    slides
        Joints other than the root that move against their parent: joint to its places in the parent's frame.
    frame_rate
        Frames a second, if the file says.
    unit
        Metres per unit, if the file says.
    notes
        What the reader had to guess or leave out, one sentence each.
    roles
        Joints whose role the file tells, role to name; what else there is is found by names.
    """

    names: tuple[str, ...]
    parents: Int[np.ndarray, "joints"]
    offsets: Float[np.ndarray, "joints 3"]
    end_joints: Int[np.ndarray, "ends"]
    end_offsets: Float[np.ndarray, "ends 3"]
    root_positions: Float[np.ndarray, "frames 3"]
    rotations: Float[np.ndarray, "frames joints 4"]
    slides: Mapping[int, Float[np.ndarray, "frames 3"]] = field(default_factory=dict)
    frame_rate: float | None = None
    unit: float | None = None
    notes: tuple[str, ...] = ()
    roles: Mapping[str, str] = field(default_factory=dict)


def body_of(recording: RawRecording, roles: Mapping[str, int]) -> Skeleton:
    """Make the recording's skeleton, in its unit and axes."""
    offsets = recording.offsets.copy()
    offsets[0] = 0.0
    return Skeleton(
        names=recording.names,
        parents=recording.parents,
        offsets=offsets,
        roles=roles,
        end_joints=recording.end_joints,
        end_offsets=recording.end_offsets,
    )


def rooted_at_hips(
    recording: RawRecording, roles: Mapping[str, int], notes: list[str]
) -> tuple[RawRecording, dict[str, int]]:
    """Fold joints above the hips (a root on the floor, say) into the root, and leave out what else hangs there.

    Parameters
    ----------
    recording, roles
        Joints and their roles, role to index.
    notes
        What was done is appended.

    Returns
    -------
    The recording and its roles, with the joint of role ``hips`` as its root.
    """
    hips = roles.get("hips", 0)
    if hips == 0:
        return recording, dict(roles)
    line = [hips]
    while line[-1] > 0:
        line.append(int(recording.parents[line[-1]]))
    place, turn = recording.root_positions, recording.rotations[:, 0]
    for joint in line[-2::-1]:
        place = place + quat.rotate(turn, recording.slides.get(joint, recording.offsets[joint]))
        turn = quat.multiply(turn, recording.rotations[:, joint])
    new = {hips: 0}
    for joint in range(hips + 1, len(recording.names)):
        if int(recording.parents[joint]) in new:
            new[joint] = len(new)
    kept = list(new)
    ends = [k for k, joint in enumerate(recording.end_joints) if int(joint) in new]
    rotations = recording.rotations[:, kept]
    rotations[:, 0] = turn
    notes.append(f"the root is {recording.names[hips]!r}, below {', '.join(recording.names[j] for j in line[:0:-1])}")
    lost = [name for joint, name in enumerate(recording.names) if joint not in new and joint not in line]
    if lost:
        notes.append(f"left out, as they do not hang from the hips: {', '.join(lost)}")
    rooted = replace(
        recording,
        names=tuple(recording.names[joint] for joint in kept),
        parents=np.array([new.get(int(recording.parents[joint]), -1) for joint in kept]),
        offsets=recording.offsets[[0, *kept[1:]]],
        end_joints=np.array([new[int(recording.end_joints[k])] for k in ends], np.int64),
        end_offsets=recording.end_offsets[ends],
        root_positions=place,
        rotations=rotations,
        slides={new[joint]: slide for joint, slide in recording.slides.items() if joint in new and joint != hips},
    )
    return rooted, {role: new[joint] for role, joint in roles.items() if joint in new}


def with_toes(
    recording: RawRecording, roles: Mapping[str, int], notes: list[str]
) -> tuple[RawRecording, dict[str, int]]:
    """Find or make a toe joint for each foot that has none: its longest child, else a new joint where the foot ends.

    Parameters, result and notes are as of ``rooted_at_hips``; a foot with neither keeps no toe.
    """
    found = dict(roles)
    for side in ("left", "right"):
        foot = found.get(f"{side}_foot")
        if foot is None or f"{side}_toe" in found:
            continue
        below = np.flatnonzero(recording.parents == foot)
        ends = np.flatnonzero(recording.end_joints == foot)
        if len(below):
            toe = int(below[np.argmax(np.linalg.norm(recording.offsets[below], axis=-1))])
            notes.append(f"{recording.names[toe]!r} is taken for the {side} toe")
        elif len(ends):
            toe = len(recording.names)
            recording = _with_joint_at_end(recording, int(ends[0]), f"{recording.names[foot]}Toe")
            notes.append(f"a {side} toe joint is added where {recording.names[foot]!r} ends")
        else:
            continue
        found[f"{side}_toe"] = toe
    return recording, found


def _with_joint_at_end(recording: RawRecording, end: int, name: str) -> RawRecording:
    """Make the end of a bone a joint that never turns."""
    still = np.broadcast_to(quat.IDENTITY, (len(recording.rotations), 1, 4))
    return replace(
        recording,
        names=(*recording.names, name),
        parents=np.append(recording.parents, recording.end_joints[end]),
        offsets=np.concatenate((recording.offsets, recording.end_offsets[end : end + 1])),
        end_joints=np.delete(recording.end_joints, end),
        end_offsets=np.delete(recording.end_offsets, end, axis=0),
        rotations=np.concatenate((recording.rotations, still), axis=1),
    )
