"""Who arrives, how long that takes and how far it is, against what somebody alone would need."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int

from stridecast.scorecard.clock import Tracks

Array = np.ndarray

REACH = 0.5
"""Somebody is at a goal who is so near to it, metres."""

PASSED = 1.5
"""Stops on the way count as passed from so far, metres."""

START = 0.5
"""What one start from standing costs against going at full speed at once, and one stop, seconds."""

BRISK = 90.0
"""Percentile of somebody's speeds that is taken for their own pace."""

LEAST_WAY = 1.0
"""Whose way is shorter is not asked how straight it was, metres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Travel:
    """Ways of all people, in rising order of their numbers.

    Parameters
    ----------
    people
        Their numbers.
    has_goal
        Of whom it is known where they want to go.
    arrivals
        When they reach their last stop, seconds of the clock; not a number for those who do not, or have none.
    seconds
        From the first row to the arrival, else to the last row.
    walked
        Metres walked in that time.
    shortest
        Length of the planned way where that is known, else straight from stop to stop; without stops to the last place.
    alone
        Seconds that the shortest way takes at the wished speed, with ``START`` where somebody starts from standing and
        again where they stop there; not a number where no wished speed is known.
    own_pace
        Seconds that the shortest way takes at a person's own pace: the 90th percentile of their speeds.
    """

    people: Int[Array, "people"]
    has_goal: Bool[Array, "people"]
    arrivals: Float[Array, "people"]
    seconds: Float[Array, "people"]
    walked: Float[Array, "people"]
    shortest: Float[Array, "people"]
    alone: Float[Array, "people"]
    own_pace: Float[Array, "people"]

    @property
    def arrived(self) -> int:
        """So many reach their goal."""
        return int(np.isfinite(self.arrivals).sum())

    @property
    def complete(self) -> Bool[Array, "people"]:
        """Whose whole way is known: who arrives, or has no goal; and goes far enough to be judged."""
        return (np.isfinite(self.arrivals) | ~self.has_goal) & (self.shortest >= LEAST_WAY)

    @property
    def against_alone(self) -> Float[Array, "_"]:
        """Time as a multiple of that alone at the wished speed, of those of whom both are known."""
        known = self.complete & np.isfinite(self.alone)
        return self.seconds[known] / self.alone[known]

    @property
    def against_own_pace(self) -> Float[Array, "_"]:
        """Time as a multiple of that on the shortest way at their own pace."""
        known = self.complete & np.isfinite(self.own_pace)
        return self.seconds[known] / self.own_pace[known]

    @property
    def detours(self) -> Float[Array, "_"]:
        """Metres walked as a multiple of the shortest way."""
        return self.walked[self.complete] / self.shortest[self.complete]


def travel(
    tracks: Tracks,
    *,
    goals: Mapping[int, Sequence[Float[Array, "_ 2"]]],
    free_speeds: Mapping[int, float],
    ways: Mapping[int, float],
) -> Travel:
    """Judge everybody's way.

    Parameters
    ----------
    goals
        Stops of each person one after the other: points, lines or polygons of ground points.
    free_speeds
        Speeds at which they would go alone, m/s.
    ways
        Lengths of their planned ways, metres.
    """
    trajectories = tracks.trajectories
    rows_of_all = []
    speeds = np.linalg.norm(tracks.velocities, axis=-1)
    for person, rows in trajectories.each():
        places, times = trajectories.positions[rows], trajectories.times[rows]
        stops = [area(stop) for stop in goals.get(person, ())]
        at = first_at_goal(places, stops)
        end = len(places) - 1 if at is None else at
        lengths = np.linalg.norm(np.diff(places[: end + 1], axis=0), axis=-1)
        shortest = ways[person] if person in ways else _straight(places, stops)
        pace = speeds[rows][: max(end, 1)]
        pace = pace[np.isfinite(pace)]
        own = float(np.percentile(pace, BRISK)) if len(pace) else 0.0
        wished = free_speeds.get(person)
        alone = np.nan
        if wished is not None:
            slow = 0.5 * wished
            standing = [len(pace) > 0 and pace[k] < slow for k in (0, -1)]
            alone = shortest / wished + START * sum(standing)
        rows_of_all.append(
            (
                bool(stops),
                np.nan if at is None else times[at],
                times[end] - times[0],
                lengths.sum(),
                shortest,
                alone,
                shortest / own if own > 0 else np.nan,
            )
        )
    table = np.array(rows_of_all, np.float64).reshape(-1, 7).T
    names = ("arrivals", "seconds", "walked", "shortest", "alone", "own_pace")
    columns = dict(zip(names, table[1:], strict=True))
    return Travel(people=trajectories.people, has_goal=table[0] > 0, **columns)


def area(points: Float[Array, "_ 2"]) -> shapely.Geometry:
    """A point, a line between two, or a polygon of more."""
    if len(points) == 1:
        return shapely.Point(points[0])
    return shapely.LineString(points) if len(points) == 2 else shapely.Polygon(points)


def first_at_goal(places: Float[Array, "rows 2"], stops: Sequence[shapely.Geometry]) -> int | None:
    """The first row at the last stop after all others were passed in turn; nothing where that never happens."""
    at = 0
    for k, stop in enumerate(stops):
        reach = REACH if k == len(stops) - 1 else PASSED
        near = np.flatnonzero(shapely.distance(shapely.points(places[at:]), stop) <= reach)
        if not len(near):
            return None
        at += int(near[0])
    return at if stops else None


def _straight(places: Float[Array, "rows 2"], stops: Sequence[shapely.Geometry]) -> float:
    """Length of the straight way from stop to stop, as far as somebody has to go to be there."""
    if not stops:
        return float(np.linalg.norm(places[-1] - places[0]))
    length, here = 0.0, shapely.Point(places[0])
    for stop in stops:
        way = shapely.shortest_line(here, stop)
        length += way.length
        here = shapely.Point(way.coords[-1])
    return max(length - REACH, 0.0)
