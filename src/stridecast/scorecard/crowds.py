"""Measures of a crowd, from nothing but where people were."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from stridecast.errors import InputError
from stridecast.model.scene import Scene
from stridecast.model.trajectories import Trajectories
from stridecast.scorecard.clock import SAME_MOMENT, tracks
from stridecast.scorecard.density import SpeedDensity, speed_density
from stridecast.scorecard.limits import RESOLUTION, TOLERANCE, Bounds, Violation, as_bounds, violations
from stridecast.scorecard.overlaps import Overlaps, overlaps, overlaps_with_solids
from stridecast.scorecard.solids import Solids
from stridecast.scorecard.standing import LONG, Deadlock, blocking_groups, deadlocks
from stridecast.scorecard.travel import Travel, travel

Array = np.ndarray

USUAL_RADIUS = 0.25
"""Of a body, metres."""

Goal = Float[Array, "_ 2"] | Sequence[Float[Array, "_ 2"]]
"""A point (a row), line or polygon of ground points, or several of them, reached one after the other."""


@dataclass(frozen=True, kw_only=True)
class Smoothness:
    """How smoothly people move.

    Parameters
    ----------
    squared_jerk
        Mean of the squared jerk, m2/s6.
    acceleration_99
        99 % of accelerations are no larger, m/s2.
    """

    squared_jerk: float
    acceleration_99: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CrowdScore:
    """How well a crowd walked.

    Parameters
    ----------
    people, samples
        So many, and rows of all of them.
    frame_rate
        Hz, of the clock that is common to all.
    seconds
        From the first frame to the last.
    overlaps, solid_overlaps
        Bodies in one another, and in obstacles, walls and movers or off the roads.
    deadlocks
        Who stands for long though not at the goal.
    travel
        Arrivals, times and ways.
    speed_density
        How fast people are in how dense a crowd.
    smoothness
        Of all together.
    violations
        Samples beyond human bounds by kind; nothing where no bounds were given.
    """

    people: int
    samples: int
    frame_rate: float
    seconds: float
    overlaps: Overlaps
    solid_overlaps: Overlaps
    deadlocks: tuple[Deadlock, ...]
    travel: Travel
    speed_density: SpeedDensity
    smoothness: Smoothness
    violations: dict[str, Violation] | None

    @property
    def blocking_groups(self) -> tuple[tuple[int, ...], ...]:
        """People in deadlocks who block each other."""
        return tuple(blocking_groups(list(self.deadlocks)))

    def as_json(self) -> dict[str, Any]:
        """All measures as plain values; what cannot be said is null."""
        way = self.travel
        beyond = None
        if self.violations is not None:
            beyond = {kind: {**asdict(found), "share": found.share} for kind, found in self.violations.items()}
        return {
            "people": self.people,
            "samples": self.samples,
            "frame_rate": self.frame_rate,
            "seconds": self.seconds,
            "overlaps": _overlaps_as_json(self.overlaps),
            "solid_overlaps": _overlaps_as_json(self.solid_overlaps),
            "deadlocks": [{**asdict(one), "with_people": list(one.with_people)} for one in self.deadlocks],
            "blocking_groups": [list(group) for group in self.blocking_groups],
            "goals_known": int(way.has_goal.sum()),
            "arrived": way.arrived,
            "time_against_alone": _spread(way.against_alone),
            "time_against_own_pace": _spread(way.against_own_pace),
            "detour": _spread(way.detours),
            "speed_density": {
                "deviation": _number(self.speed_density.deviation),
                "bins": [asdict(one) for one in self.speed_density.bins],
            },
            "squared_jerk": _number(self.smoothness.squared_jerk),
            "acceleration_99": _number(self.smoothness.acceleration_99),
            "violations": beyond,
        }


def score_crowd(
    trajectories: Trajectories,
    *,
    radius: float | Mapping[int, float] = USUAL_RADIUS,
    scene: Scene | None = None,
    bounds: Bounds | Mapping[str, Any] | None = None,
    free_speeds: float | Mapping[int, float] | None = None,
    goals: Goal | Mapping[int, Goal] | None = None,
    ways: Mapping[int, float] | None = None,
    frame_rate: float | None = None,
    long: float = LONG,
    tolerance: float = TOLERANCE,
    resolution: float = RESOLUTION,
) -> CrowdScore:
    """Judge a crowd.

    Parameters
    ----------
    trajectories
        Where people were; all sampled at the same moments, unless ``frame_rate`` is given.
    radius
        Of the bodies, metres: one number, or one for each person.
    scene
        Its obstacles, walls, roads and movers must not be touched. Who its people are is not asked: see ``roster``.
    bounds
        What a human body can do: ``Limits`` or the like, or its four numbers by name.
    free_speeds
        At which people would go alone, m/s: one number, or for each person of whom it is known.
    goals
        Where all go, or each person of whom it is known.
    ways
        Lengths of planned ways, metres, for people for whom straight is not possible.
    frame_rate
        Sample everybody anew at this rate first, Hz.
    long
        Standing for longer on the way is a deadlock, seconds.
    tolerance, resolution
        By what share bounds may be exceeded before it counts, and to how many metres positions are rounded.

    Returns
    -------
    CrowdScore
        Nothing in it depends on the order of people, their numbers, or where the origin lies.

    Raises
    ------
    InputError
        No common clock (see ``tracks``); numbers of people who are not there; radii, speeds or lengths that are not
        positive; bounds with unknown or missing names.
    """
    judged = None if bounds is None else as_bounds(bounds)
    for name, value in (("long", long), ("resolution", resolution)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} must be above 0, not {value}")
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise InputError(f"tolerance must not be below 0, not {tolerance}")
    on_clock = tracks(trajectories, frame_rate)
    people = on_clock.trajectories.people
    widths = _by_person(radius, people, "radius")
    missing = [person for person in people.tolist() if person not in widths]
    if missing:
        raise InputError(f"there is no radius of person {missing[0]}")
    radii = np.array([widths[person] for person in people.tolist()], np.float64)
    way = travel(
        on_clock,
        goals=_goals(goals, people),
        free_speeds={} if free_speeds is None else _by_person(free_speeds, people, "free speed"),
        ways={} if ways is None else _by_person(ways, people, "way"),
    )
    solids = Solids(scene)
    before = np.where(np.isfinite(way.arrivals), way.arrivals, np.inf)
    on_the_way = on_clock.trajectories.times < before[on_clock.owners] - SAME_MOMENT
    return CrowdScore(
        people=len(people),
        samples=len(on_clock.trajectories),
        frame_rate=1 / on_clock.step,
        seconds=float(on_clock.step * on_clock.frames.max(initial=0)),
        overlaps=overlaps(on_clock, radii),
        solid_overlaps=overlaps_with_solids(on_clock, radii, solids),
        deadlocks=tuple(deadlocks(on_clock, way, radii, long=long)),
        travel=way,
        speed_density=speed_density(on_clock, solids, on_the_way),
        smoothness=_smoothness(on_clock.accelerations, on_clock.jerks),
        violations=None if judged is None else violations(on_clock, judged, tolerance=tolerance, resolution=resolution),
    )


def _smoothness(accelerations: Array, jerks: Array) -> Smoothness:
    amount = np.linalg.norm(accelerations, axis=-1)
    amount, squared = amount[np.isfinite(amount)], np.sum(jerks**2, axis=-1)
    squared = squared[np.isfinite(squared)]
    return Smoothness(
        squared_jerk=float(squared.mean()) if len(squared) else float("nan"),
        acceleration_99=float(np.percentile(amount, 99)) if len(amount) else float("nan"),
    )


def _by_person(given: float | Mapping[int, float], people: Array, what: str) -> dict[int, float]:
    if not isinstance(given, Mapping):
        given = dict.fromkeys(people.tolist(), given)
    _check_known(given, people, what)
    for person, value in given.items():
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{what} of person {person} must be above 0, not {value}")
    return {int(person): float(value) for person, value in given.items()}


def _goals(given: Goal | Mapping[int, Goal] | None, people: Array) -> dict[int, tuple[Array, ...]]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        given = dict.fromkeys(people.tolist(), given)
    _check_known(given, people, "goal")
    return {int(person): _stops(goal, person) for person, goal in given.items()}


def _stops(goal: Any, person: int) -> tuple[Array, ...]:
    stops = (goal,) if isinstance(goal, np.ndarray) else tuple(goal)
    out = []
    for stop in stops:
        points = np.asarray(stop, np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or not len(points) or not np.isfinite(points).all():
            raise InputError(f"goal of person {person}: stops are arrays of ground points (x, z), one a row")
        out.append(points)
    return tuple(out)


def _check_known(given: Mapping[int, Any], people: Array, what: str) -> None:
    unknown = sorted(set(given) - set(people.tolist()))
    if unknown:
        raise InputError(f"there is a {what} of person {unknown[0]}, who is not among the {len(people)} people")


def _overlaps_as_json(found: Overlaps) -> dict[str, Any]:
    return {
        "pairs": found.pairs,
        "frames": found.frames,
        "pair_frames": found.pair_frames,
        "depth": found.depth,
        "each": [asdict(one) for one in found.each],
    }


def _spread(values: Array) -> dict[str, float] | None:
    """Median, 95 % and how many."""
    if not len(values):
        return None
    return {"median": float(np.median(values)), "95": float(np.percentile(values, 95)), "people": len(values)}


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
