"""Bodies that are in one another, or in something solid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from stridecast.scorecard.clock import Tracks
from stridecast.scorecard.solids import Solids

Array = np.ndarray

TOUCH = 1e-3
"""Who is no deeper in another touches, metres: files round places."""


@dataclass(frozen=True, kw_only=True)
class Overlap:
    """Two bodies, or one and something solid, that overlap at some moments.

    Parameters
    ----------
    one, other
        Numbers of the people; ``other`` is the name of the thing where it is no person.
    frames
        At so many frames.
    first, last
        When, seconds.
    depth
        How deep at most, metres.
    time
        When that is, seconds.
    """

    one: int
    other: int | str
    frames: int
    first: float
    last: float
    depth: float
    time: float


@dataclass(frozen=True, kw_only=True)
class Overlaps:
    """All overlaps of a crowd, the deepest first.

    Parameters
    ----------
    each
        One a pair.
    frames
        Frames in which anybody overlaps with anybody.
    """

    each: tuple[Overlap, ...]
    frames: int

    @property
    def pairs(self) -> int:
        """So many pairs."""
        return len(self.each)

    @property
    def pair_frames(self) -> int:
        """Frames of all pairs together."""
        return sum(overlap.frames for overlap in self.each)

    @property
    def depth(self) -> float:
        """The deepest, metres; 0 where there is none."""
        return max((overlap.depth for overlap in self.each), default=0.0)


def overlaps(tracks: Tracks, radii: Float[Array, "people"]) -> Overlaps:
    """People whose discs overlap by more than ``TOUCH``.

    Parameters
    ----------
    radii
        Of the bodies, metres, in the order of ``tracks.trajectories.people``.
    """
    positions, owners = tracks.trajectories.positions, tracks.owners
    order, edges = tracks.by_frame
    reach = 2 * float(radii.max(initial=0.0))
    found: list[Array] = [np.zeros((0, 2), np.int64)]
    for first, stop in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if stop - first > 1:
            rows = order[first:stop]
            found.append(rows[cKDTree(positions[rows]).query_pairs(reach, output_type="ndarray")])
    one, other = np.concatenate(found).T
    depth = radii[owners[one]] + radii[owners[other]] - np.linalg.norm(positions[one] - positions[other], axis=-1)
    deep = depth > TOUCH
    people = tracks.trajectories.people.tolist()
    a, b = np.sort((owners[one[deep]], owners[other[deep]]), axis=0)
    return _collect(tracks, tracks.frames[one[deep]], a, b, depth[deep], people, people)


def overlaps_with_solids(tracks: Tracks, radii: Float[Array, "people"], solids: Solids) -> Overlaps:
    """People whose discs reach into obstacles, walls or movers, or off the roads, by more than ``TOUCH``."""
    trajectories = tracks.trajectories
    row, thing, depth = solids.depths(trajectories.positions, radii[tracks.owners], trajectories.times)
    deep = depth > TOUCH
    row, thing, depth = row[deep], thing[deep], depth[deep]
    return _collect(
        tracks, tracks.frames[row], tracks.owners[row], thing, depth, trajectories.people.tolist(), solids.names
    )


def _collect(
    tracks: Tracks,
    frames: Int[Array, "hits"],
    one: Int[Array, "hits"],
    other: Int[Array, "hits"],
    depth: Float[Array, "hits"],
    ones: list[int],
    others: list[int] | list[str],
) -> Overlaps:
    """Hits by pairs."""
    key = one * max(len(others), 1) + other
    order = np.lexsort((frames, key))
    firsts = np.flatnonzero(np.concatenate(([True], np.diff(key[order]) > 0))) if len(order) else order
    each = []
    for hits in np.split(order, firsts[1:]) if len(order) else []:
        k = hits[np.argmax(depth[hits])]
        first, last, deepest = tracks.times(frames[[hits[0], hits[-1], k]]).tolist()
        each.append(
            Overlap(
                one=ones[int(one[k])],
                other=others[int(other[k])],
                frames=len(np.unique(frames[hits])),
                first=first,
                last=last,
                depth=float(depth[k]),
                time=deepest,
            )
        )
    each.sort(key=lambda overlap: -overlap.depth)
    return Overlaps(each=tuple(each), frames=len(np.unique(frames)))
