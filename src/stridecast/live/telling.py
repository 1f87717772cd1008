"""A database, a skeleton and settings in the words of the protocol."""

from __future__ import annotations

import numpy as np

from stridecast.body.character import stature
from stridecast.database.clips import find_clips
from stridecast.database.graph import connect
from stridecast.live.cast import Costume
from stridecast.live.messages import (
    BoundsPart,
    CharacterPart,
    DatabasePart,
    DatabaseState,
    ExampleColumns,
    GroupPart,
    SkeletonPart,
    TakePart,
)
from stridecast.model.bounds import SteeringBounds
from stridecast.model.database import MotionDatabase
from stridecast.model.skeleton import Skeleton

COLUMNS = ("speed", "start_speed", "end_speed", "turn", "cadence", "spread", "stoop", "style")
"""What is told of each segment as it is annotated."""


def skeleton_part(skeleton: Skeleton) -> SkeletonPart:
    """A skeleton."""
    return SkeletonPart(
        names=list(skeleton.names),
        parents=skeleton.parents.tolist(),
        offsets=[_three(row) for row in skeleton.offsets.tolist()],
        roles=dict(skeleton.roles),
        end_joints=skeleton.end_joints.tolist(),
        end_offsets=[_three(row) for row in skeleton.end_offsets.tolist()],
        height=stature(skeleton),
    )


def character_part(costume: Costume) -> CharacterPart | None:
    """The file of a character that has meshes, and how it is posed."""
    bones = costume.bones
    if bones is None:
        return None
    return CharacterPart(
        nodes=bones.nodes.tolist(),
        before=[_four(turn) for turn in bones.before.tolist()],
        after=[_four(turn) for turn in bones.after.tolist()],
        corner=_three(bones.corner.tolist()),
        turn=_four(bones.turn.tolist()),
        grown=bones.grown,
        size=bones.size,
    )


def database_part(database: MotionDatabase, name: str, built: bool) -> DatabasePart:
    """What is steady about a database."""
    follows = connect(database.groups).follows
    styles = database.annotations.style
    return DatabasePart(
        name=name,
        built=built,
        frame_rate=database.frame_rate,
        motions=list(database.motions),  # type: ignore[arg-type]  # the motion types are these words
        groups=[
            GroupPart(
                name=group.name,
                motion=group.motion,
                string=group.string,
                start=group.start,
                stop=group.stop,
                count=group.count,
                bounds=_bounds(group.bounds),
            )
            for group in database.groups
        ],
        graph=[(int(a), int(b)) for a, b in np.argwhere(follows)],
        subjects=list(database.subjects),
        takes=sum(1 for take in database.takes if take.segments),
        examples=len(database.examples.durations),
        styles=(float(styles.min(initial=0.0)), float(styles.max(initial=0.0))),
        top_speeds={
            motion: max(max(pair[1] for pair in g.bounds.speed) for g in database.groups if g.motion == motion)
            for motion in database.motions
        },
    )


def database_state(database: MotionDatabase, name: str, request: int) -> DatabaseState:
    """All segments and all takes."""
    examples, told = database.examples, database.annotations
    groups = np.repeat(np.arange(len(database.groups)), [group.count for group in database.groups])
    in_clips = np.zeros(len(examples.durations), np.bool_)
    for clips in find_clips(database):
        in_clips[clips.rows.ravel()] = True
    return DatabaseState(
        request=request,
        name=name,
        examples=ExampleColumns(
            group=groups.tolist(),
            take=examples.takes.tolist(),
            first_frame=examples.first_frames.tolist(),
            mirrored=examples.mirrored.tolist(),
            seconds=_short(examples.durations),
            clip=in_clips.tolist(),
            **{column: _short(getattr(told, column)) for column in COLUMNS},
        ),
        takes=[
            TakePart(
                name=take.name,
                subject=take.subject,
                seconds=take.seconds,
                covered=take.covered,
                segments=take.segments,
                left_out=list(take.left_out),
                notes=list(take.notes),
                statuses=list(take.annotation.statuses) if take.annotation else [],
            )
            for take in database.takes
        ],
    )


def _short(values: np.ndarray) -> list[float]:
    """Numbers with no more digits than anybody reads."""
    return np.round(values, 4).tolist()


def _three(row: list[float]) -> tuple[float, float, float]:
    x, y, z = row
    return x, y, z


def _four(row: list[float]) -> tuple[float, float, float, float]:
    w, x, y, z = row
    return w, x, y, z


def _bounds(bounds: SteeringBounds) -> BoundsPart:
    return BoundsPart(
        jerk=bounds.jerk,
        tangential=bounds.tangential,
        lateral_per_speed=bounds.lateral_per_speed,
        speed=bounds.speed,
        assumed=list(bounds.assumed),
    )
