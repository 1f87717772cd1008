"""Which recordings a build uses, and whose body they are carried over to."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from stridecast.building.sources import Source
from stridecast.building.stages import Recording
from stridecast.model.skeleton import Skeleton

SAME_TAKE = 4
"""Two files whose frame counts differ by at most this can hold the same take: a T-pose added, a frame lost."""


def said_twice(sources: Sequence[Source], recordings: Mapping[int, Recording]) -> dict[int, str]:
    """Find takes that are there twice: copies, and BVH files of a take whose AMC is there too.

    Parameters
    ----------
    sources
        All files and motions.
    recordings
        Those that could be read, by their place in the list.

    Returns
    -------
    Why a take is left out, by its place in the list. An AMC comes with the complete skeleton, so its BVH goes.
    """
    out: dict[int, str] = {}
    first: dict[tuple[str, str], int] = {}
    complete: dict[tuple[str, str], int] = {}
    for i, recording in recordings.items():
        original = first.setdefault((sources[i].sha256, sources[i].companions), i)
        if original != i:
            out[i] = f"a copy of {sources[original].shown}"
        elif sources[i].suffix == ".amc":
            complete.setdefault(_take(recording), i)
    for i, recording in recordings.items():
        twin = complete.get(_take(recording), i)
        if (
            i not in out
            and sources[i].suffix == ".bvh"
            and abs(recordings[twin].frames - recording.frames) <= SAME_TAKE
            and twin != i
        ):
            out[i] = f"the same take as {Path(sources[twin].shown).name}, which comes with the complete skeleton"
    return out


def body_of_most_seconds(recordings: Sequence[Recording]) -> Skeleton:
    """Choose the body of the person with the most seconds; the most complete one, where that person's files differ."""
    seconds: dict[str, float] = defaultdict(float)
    for recording in recordings:
        seconds[recording.subject] += recording.seconds
    subject = max(seconds, key=lambda name: seconds[name])
    bodies = [recording.skeleton for recording in recordings if recording.subject == subject]
    return replace(max(bodies, key=lambda body: (len(body.roles), body.joints)))


def _take(recording: Recording) -> tuple[str, str]:
    return recording.subject, recording.name.lower()
