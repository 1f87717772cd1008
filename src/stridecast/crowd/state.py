"""What a crowd is made of: plain arrays with a leading ``person`` axis, in named tuples for compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stridecast.crowd.bounds import HumanBounds

Array = np.ndarray


class People(NamedTuple):
    """Who they are: does not change while they are there. N rows, of which some may be empty."""

    number: Array  # N, who it is; decides ties, so that the order of rows does not
    radius: Array  # N, of the body, metres
    wish: Array  # N, wished speed, m/s
    runs: Array  # N, whether faster than a walk is a run
    side: Array  # N, 1 passes on the left, -1 on the right, 0 either
    keep: Array  # N, what is kept from others beyond the bodies, metres
    waits: Array  # N, would rather wait than go first
    rank: Array  # N, who gives way: the lower one
    company: Array  # N, number of the group who walk together, -1 alone
    slot: Array  # N, place in that group to the left of its way, metres
    scripted: Array  # N, moves by a script and waits where people are in its way
    stays: Array  # N, stands at the end of the way instead of leaving
    first: Array  # N, first point of the way among all ways
    points: Array  # N, points of the way; below 2: stands where it is


class Scratch(NamedTuple):
    """Room for what one thread works out about one person at a time; kernels make no arrays."""

    near: Array  # rows of those who are seen
    gaps: Array
    seen: Array  # what is seen of them (see ``neighbour_kernels``)
    things: Array  # what stands near
    targets: Array  # velocities that may be aimed at
    costs: Array


def make_people(count: int) -> People:
    """``count`` empty rows."""
    numbers = ("radius", "wish", "side", "keep", "rank", "slot")
    flags = ("runs", "waits", "scripted", "stays")
    arrays = {name: np.zeros(count) for name in numbers} | {name: np.zeros(count, np.bool_) for name in flags}
    whole = {name: np.zeros(count, np.int64) for name in ("number", "first", "points")}
    return People(**arrays, **whole, company=np.full(count, -1))


class Moving(NamedTuple):
    """How they move and what they are up to. K frames that stopping may take at most."""

    here: Array  # N, row in use
    position: Array  # N 2
    velocity: Array  # N 2
    acceleration: Array  # N 2
    heading: Array  # N
    turning: Array  # N, side of a reversal under way
    place: Array  # N, how far along the way, metres
    wants: Array  # N 2, direction in which they want to go now; none for who stands
    wants_next: Array  # N 2, the same after this frame
    bound: Array  # N 2, direction in which the way leads on the whole; none for who stands
    # decision
    target: Array  # N 2, velocity that is aimed at
    rule: Array  # N, code of the rule that is followed
    other: Array  # N, row of whom it is about, -1 nobody
    contact: Array  # N, time until they would meet, seconds
    chosen_side: Array  # N, 1 left, -1 right, 0 none
    since: Array  # N, how long this encounter lasts, seconds
    stuck: Array  # N, how long somebody who wants to go has not got on, seconds
    jammed: Array  # N, 1 where people who want to go in other directions block each other, 0.5 where they are wedged
    jammed_next: Array  # N, the same after this frame
    opposed: Array  # N, faces somebody there who wants to go the other way
    retreat: Array  # N, so long they still give way, seconds
    retreat_way: Array  # N 2, direction in which
    held: Array  # N, whether the room to stop decided in this frame
    # commitment: where somebody is from frame to frame who brakes from now on
    path: Array  # N K 2
    stops: Array  # N, frames until rest; from then on the last place
    meant: Array  # N K 2, the same for the step that is proposed
    meant_stops: Array  # N
    next: Array  # N 7, position, velocity, acceleration and heading proposed
    next_turning: Array  # N
    free: Array  # N, whether the proposal leaves everybody else's commitment alone


class Ground(NamedTuple):
    """What stands: segments (walls, edges) and circles, found through a grid of cells."""

    segments: Array  # S 4: x, z, x, z
    circles: Array  # C 3: x, z, radius
    corner: Array  # 2, of the grid
    cell: float
    shape: Array  # 2, cells in x and z
    first: Array  # cells + 1, first entry of each cell
    entries: Array  # indices: a segment, or S + circle


class Cells(NamedTuple):
    """People sorted into the cells of a grid."""

    corner: Array  # 2
    size: float  # of a cell, metres
    shape: Array  # 2, cells in x and z
    first: Array  # cells + 1, first entry of each cell in rows
    rows: Array  # N


class Ways(NamedTuple):
    """All ways one after the other."""

    points: Array  # P 2
    along: Array  # P, distance from the way's own beginning


class Limits(NamedTuple):
    """Human bounds for compiled code (see ``HumanBounds``): the slow gait, then the fast one."""

    jerk: Array  # 2
    low: Array  # 2
    high: Array  # 2
    wide: Array  # 2, lateral acceleration per speed, which is turning speed
    fastest: Array  # 2
    fades: Array  # 2, between these speeds one becomes the other, m/s


def make_limits(bounds: HumanBounds) -> Limits:
    """Bounds as arrays; who cannot run has the bounds of walking at all speeds."""
    both = [0, -1]
    return Limits(
        jerk=bounds.jerk[both],
        low=bounds.tangential[both, 0],
        high=bounds.tangential[both, 1],
        wide=bounds.lateral_per_speed[both],
        fastest=bounds.fastest[both],
        fades=np.array(bounds.fades),
    )


def make_moving(count: int, frames: int) -> Moving:
    """State of ``count`` empty rows."""

    def zeros(*shape: int) -> Array:
        return np.zeros((count, *shape))

    return Moving(
        here=np.zeros(count, np.bool_),
        position=zeros(2),
        velocity=zeros(2),
        acceleration=zeros(2),
        heading=zeros(),
        turning=zeros(),
        place=zeros(),
        wants=zeros(2),
        wants_next=zeros(2),
        bound=zeros(2),
        target=zeros(2),
        rule=np.zeros(count, np.int64),
        other=np.full(count, -1),
        contact=np.full(count, np.inf),
        chosen_side=zeros(),
        since=zeros(),
        stuck=zeros(),
        jammed=zeros(),
        jammed_next=zeros(),
        opposed=np.zeros(count, np.bool_),
        retreat=zeros(),
        retreat_way=zeros(2),
        held=np.zeros(count, np.bool_),
        path=zeros(frames, 2),
        stops=np.ones(count, np.int64),
        meant=zeros(frames, 2),
        meant_stops=np.ones(count, np.int64),
        next=zeros(7),
        next_turning=zeros(),
        free=np.zeros(count, np.bool_),
    )
