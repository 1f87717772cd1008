"""A motion database on another body: every example played by a character, so that it can be walked with on line.

``body.recasting`` plays a motion that is known as a whole on another body. Here the examples are played, pose by pose;
walkers then choose, blend and plant feet as ever, and no frame waits for what comes later. The vehicle goes as it went,
and so do bounds: it is the same person in another body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from stridecast.body import kinematics
from stridecast.body.character import stature
from stridecast.body.planting import Feet, put_feet, reach_of, with_toes_up
from stridecast.body.recasting import feet_alike, risen, rises, soles, turned_alike
from stridecast.database.poses import planted_rows, poses_of, sole_height, tangents_of
from stridecast.errors import DatabaseError
from stridecast.geometry import quaternions as quat
from stridecast.model.database import INTERVALS, ROWS, Examples, MotionDatabase
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

Array = np.ndarray

AT_ONCE = 128
"""Examples that are worked on together; all would need too much room."""

TRIED = 48
"""Examples of a group that tell how high hips are, and how joints are turned on average."""

SPEEDS = 0.25
"""Hips are at one height on average in each range of speed so wide, m/s; ..."""

DEGREE = 2
"""... a polynomial of this degree passes through them, so that segments meet."""


def cast_database(
    database: MotionDatabase, body: Skeleton, *, progress: Callable[[int, int], None] | None = None
) -> MotionDatabase:
    """Play all examples of a database on another body.

    Parameters
    ----------
    database
        What was learned.
    body
        Who is to move: other proportions, the same rest pose, such as ``character_of`` finds.
    progress
        Called with examples that are done, and all.

    Returns
    -------
    MotionDatabase
        With the same groups, vehicles, bounds, annotations and takes.

    Raises
    ------
    SkeletonError
        A joint of hips or legs is missing.
    DatabaseError
        The database is empty.
    """
    body.require_roles()
    count = len(database.examples.durations)
    if not count:
        raise DatabaseError("there are no examples to be played by another body")
    cast = _Cast.of(database, body)
    features = np.empty((count, ROWS, 3 * (body.joints - 1) + 7))
    for some, _ in _pieces(database, count):
        features[some] = cast.features(database, some)
        if progress is not None:
            progress(some.stop, count)
    tables = {name: getattr(database.examples, name) for name in Examples.__dataclass_fields__}
    return replace(
        database,
        skeleton=body,
        examples=Examples(**tables | {"features": features}),
        references=cast.references,
        sole=float(cast.soles[1].mean()),
        person=stature(database.skeleton) if database.person is None else database.person,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cast:
    """What all examples are played with.

    Parameters
    ----------
    body
        Who plays them.
    soles
        Heights of the toe joints of flat feet at home and of the body, left and right, metres.
    rise
        How much higher hips are, by the speed of the vehicle: coefficients of a polynomial, and the speeds between
        which it holds.
    reaches
        How far legs are stretched (see ``reach_of``).
    references
        Mean rotation of each joint but the root.
    """

    body: Skeleton
    soles: tuple[Float[Array, "2"], Float[Array, "2"]]
    rise: Float[Array, "terms"]
    speeds: tuple[float, float]
    reaches: Float[Array, "2 2"]
    references: Float[Array, "bones 4"]

    @staticmethod
    def of(database: MotionDatabase, body: Skeleton) -> _Cast:
        """Look at some examples of each group."""
        here = np.full(2, sole_height(database))
        both = here, soles(body, database.skeleton, here)
        speeds, heights, reaches, turned = [], [], [], []
        for some, planted in _pieces(database, TRIED):
            motion, posed, feet = _played(database, body, both, some)
            stands = np.tile(planted, (motion.frames // ROWS, 1))
            known = stands.any(axis=1)
            speeds.append(database.examples.travelled[some, :, 3].ravel()[known])
            heights.append(rises(posed, feet, motion, stands)[known])
            reaches.append(reach_of(motion, stands))
            turned.append(posed.rotations[:: ROWS // 2, 1:])
        speed = np.concatenate(speeds)
        rise = _fitted(speed, np.concatenate(heights))
        return _Cast(
            body=body,
            soles=both,
            rise=rise,
            speeds=(float(speed.min()), float(speed.max())),
            reaches=np.max(reaches, axis=0),
            references=quat.mean(np.concatenate(turned)),
        )

    def features(self, database: MotionDatabase, some: slice) -> Float[Array, "examples rows features"]:
        """Features of some examples of one group, played by the body."""
        motion, posed, feet = _played(database, self.body, self.soles, some)
        speeds = np.clip(database.examples.travelled[some, :, 3].ravel(), *self.speeds)
        posed = risen(posed, np.polyval(self.rise, speeds))
        nobody = np.zeros((motion.frames, 2), np.bool_)  # walkers plant feet; rows of examples are no frames
        moved = with_toes_up(put_feet(posed, feet, nobody, self.reaches))
        count = motion.frames // ROWS
        yaws = database.examples.features[some, :, -1]
        root = quat.multiply(quat.about_y(-yaws.ravel()), moved.rotations[:, 0])
        parts = (
            tangents_of(self.references, moved.rotations),
            quat.log(root),
            moved.root_positions,
            yaws.reshape(-1, 1),
        )
        return np.concatenate(parts, axis=-1).reshape(count, ROWS, -1)


def _pieces(database: MotionDatabase, most: int) -> Iterator[tuple[slice, Bool[Array, "rows 2"]]]:
    """Examples in pieces, up to ``most`` of each group, and which feet stand in their rows."""
    for group in database.groups:
        planted = planted_rows(group)
        last = group.first + min(group.count, most)
        for start in range(group.first, last, AT_ONCE):
            yield slice(start, min(start + AT_ONCE, last)), planted


def _played(
    database: MotionDatabase, body: Skeleton, both: tuple[Float[Array, "2"], Float[Array, "2"]], some: slice
) -> tuple[Motion, Motion, Feet]:
    """Rows of examples one after the other, those of the body with hips as high as the length of its legs, its feet."""
    features = database.examples.features[some]
    rotations, roots = poses_of(database.references, features.reshape(-1, features.shape[-1]))
    seconds = float(database.examples.durations[some].mean())
    motion = Motion(
        skeleton=database.skeleton, frame_rate=INTERVALS / seconds, root_positions=roots, rotations=rotations
    )
    world = kinematics.pose(motion)
    feet, _ = feet_alike(body, motion, world, *both)
    return motion, turned_alike(body, motion, world, *both), feet


def _fitted(speeds: Float[Array, "rows"], rises: Float[Array, "rows"]) -> Float[Array, "terms"]:
    """A polynomial through the mean rise at each range of speeds, each range counting alike."""
    ranges = np.floor(speeds / SPEEDS).astype(int)
    kinds = np.unique(ranges)
    middle = np.array([speeds[ranges == kind].mean() for kind in kinds])
    mean = np.array([rises[ranges == kind].mean() for kind in kinds])
    return np.asarray(np.polyfit(middle, mean, min(DEGREE, len(kinds) - 1)))
