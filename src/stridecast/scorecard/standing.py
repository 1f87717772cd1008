"""People who want to go and stand all the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from stridecast.scorecard.clock import Tracks
from stridecast.scorecard.travel import Travel

Array = np.ndarray

SLOWEST = 0.05
"""Who is slower stands, m/s."""

LONG = 10.0
"""Standing for longer on the way is a deadlock, seconds."""

NEXT_TO = 0.5
"""Bodies are in each other's way over such a gap, metres."""


@dataclass(frozen=True, kw_only=True)
class Deadlock:
    """Somebody stands who wants to go.

    Parameters
    ----------
    person
        Who.
    first, last
        From when to when, seconds.
    resolved
        They went on afterwards.
    with_people
        Others in a deadlock at the same time and within ``NEXT_TO``: they block each other.
    """

    person: int
    first: float
    last: float
    resolved: bool
    with_people: tuple[int, ...] = ()


def deadlocks(tracks: Tracks, travel: Travel, radii: Float[Array, "people"], *, long: float = LONG) -> list[Deadlock]:
    """Everybody who gets nowhere for long though not at the goal.

    Somebody stands as long as they get no further from where they were than ``SLOWEST`` would take them in the time of
    ``long``; so stepping on the spot is standing too. Who has a goal means to go until they reach it. Of others it is
    known only when they go on afterwards; at the end of their rows they may have arrived.

    Parameters
    ----------
    radii
        Of the bodies, metres, in the order of people.
    long
        Seconds.
    """
    trajectories = tracks.trajectories
    found = []
    for k, (person, rows) in enumerate(trajectories.each()):
        places, times = trajectories.positions[rows], trajectories.times[rows]
        arrival = travel.arrivals[k]
        upto = len(times) if np.isnan(arrival) else int(np.searchsorted(times, arrival))
        for first, stop in _stands(places[:upto], times[:upto], long):
            resolved = stop < len(times)
            if travel.has_goal[k] or resolved:
                found.append((k, person, float(times[first]), float(times[stop - 1]), resolved))
    return [
        Deadlock(
            person=person,
            first=first,
            last=last,
            resolved=resolved,
            with_people=tuple(
                other for j, other, a, b, _ in found if j != k and _side_by_side(tracks, radii, k, j, first, last, a, b)
            ),
        )
        for k, person, first, last, resolved in found
    ]


def _stands(places: Float[Array, "rows 2"], times: Float[Array, "rows"], long: float) -> list[tuple[int, int]]:
    """Stretches of rows, from and to before, in which somebody stands for long."""
    reach = SLOWEST * long
    later = np.searchsorted(times, times + long - 1e-6)
    whole = later < len(times)
    candidates = np.flatnonzero(whole)
    near = np.linalg.norm(places[later[whole]] - places[whole], axis=-1) <= reach
    stretches: list[tuple[int, int]] = []
    for first in candidates[near].tolist():
        if stretches and first < stretches[-1][1] - 1:
            continue  # the next stretch begins where the last one ends, else where somebody stands anew
        away = np.linalg.norm(places[first:] - places[first], axis=-1) > reach
        stop = first + int(np.argmax(away)) if away.any() else len(times)
        if stop <= later[first]:
            continue
        if stretches and first < stretches[-1][1]:
            stretches[-1] = (stretches[-1][0], stop)
        else:
            stretches.append((first, stop))
    trimmed = [_trim(places, times, *stretch) for stretch in stretches]
    return [(first, stop) for first, stop in trimmed if times[stop - 1] - times[first] >= long - 1e-6]


def _trim(places: Array, times: Array, first: int, stop: int) -> tuple[int, int]:
    """Without coming to a stand before and going on after, if there is a second of real standing between."""
    later = np.searchsorted(times[:stop], times[first:stop] + 1.0 - 1e-6)
    rows = np.flatnonzero(later < stop)
    gone = np.linalg.norm(places[later[rows]] - places[first + rows], axis=-1)
    still = rows[gone <= SLOWEST * 1.0]
    return (first + int(still[0]), int(later[still[-1]]) + 1) if len(still) else (first, stop)


def _side_by_side(
    tracks: Tracks, radii: Array, k: int, j: int, first: float, last: float, other_first: float, other_last: float
) -> bool:
    """Whether two people stand in each other's way in the middle of the time in which both stand."""
    begin, end = max(first, other_first), min(last, other_last)
    if end <= begin:
        return False
    middle = 0.5 * (begin + end)
    places = []
    for person in tracks.trajectories.people[[k, j]].tolist():
        rows = tracks.trajectories.rows(person)
        row = min(int(np.searchsorted(tracks.trajectories.times[rows], middle)), rows.stop - rows.start - 1)
        places.append(tracks.trajectories.positions[rows.start + row])
    one, other = places
    return bool(np.linalg.norm(one - other) - radii[k] - radii[j] <= NEXT_TO)


def blocking_groups(found: list[Deadlock]) -> list[tuple[int, ...]]:
    """People who block each other, each group once."""
    groups: list[set[int]] = []
    for one in found:
        if one.with_people:
            group = {one.person, *one.with_people}
            apart = [g for g in groups if not g & group]
            groups = [*apart, group.union(*(g for g in groups if g & group))]
    return sorted(tuple(sorted(group)) for group in groups)
