"""The motion transition graph: coarse motions above, groups below (KS05)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from stridecast.model.group import MotionGroup
from stridecast.model.segment import MOTIONS

Array = np.ndarray

UNREACHABLE = 1_000_000
"""Number of steps to a motion that no way leads to."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TransitionGraph:
    """Which group can follow which, and how far it is to each motion.

    Parameters
    ----------
    follows
        ``follows[g, h]``: a segment of group h can follow one of group g.
    steps
        ``steps[g, m]``: segments it takes after g until motion m (of ``MOTIONS``) is reached; ``UNREACHABLE`` if no way
        leads there, and then the transition has to be made up.
    """

    follows: Bool[Array, "groups groups"]
    steps: Int[Array, "groups motions"]


def connect(groups: Sequence[MotionGroup], usable: Bool[Array, "groups"] | None = None) -> TransitionGraph:
    """Transition graph over groups, those not ``usable`` (no example left after a choice of subject) cut off."""
    count = len(groups)
    usable = np.ones(count, bool) if usable is None else usable
    follows = np.array([[bool(usable[j]) and can_follow(a, b) for j, b in enumerate(groups)] for a in groups])
    follows = follows.reshape(count, count)
    steps = np.full((count, len(MOTIONS)), UNREACHABLE, np.int64)
    for m, motion in enumerate(MOTIONS):
        goal = np.array([g.motion == motion for g in groups]) & usable
        steps[goal, m] = 0
        for distance in range(1, count + 1):
            reached = steps[:, m] < UNREACHABLE
            new = ~reached & (follows & reached[None, :]).any(axis=1)
            if not new.any():
                break
            steps[new, m] = distance
    return TransitionGraph(follows=follows, steps=steps)


def can_follow(a: MotionGroup, b: MotionGroup) -> bool:
    """Whether ``b`` begins where ``a`` ends: the same kind of boundary, and a motion that leads on.

    A transition that is under way goes on, arrives, or is left where it has come to walking.
    """
    if a.stop != b.start:
        return False
    if b.motion == a.motion or b.comes_from == a.leads_to:
        return True
    walking_there = a.stop in ("L", "R")
    return walking_there and b.comes_from == "walk"


def made_up(groups: Sequence[MotionGroup]) -> list[str]:
    """Transitions between motions for which there is no example, as ``walk-run``: they would be made up."""
    graph = connect(groups)
    have = [m for m in MOTIONS if any(g.motion == m for g in groups)]
    missing = []
    for start in have:
        rows = [i for i, g in enumerate(groups) if g.motion == start]
        missing += [
            f"{start}-{goal}"
            for goal in have
            if goal != start and graph.steps[rows, MOTIONS.index(goal)].min() >= UNREACHABLE
        ]
    return missing
