"""Who is in a scene besides its one walker: people, sources of people, and what stands or moves in their way."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from stridecast.errors import SceneError
from stridecast.model.behavior import (
    DISTANCES,
    PATIENCE,
    SIDES_OF_WAY,
    SIZES,
    USUAL_WEIGHT,
    Behavior,
    ground_points,
)
from stridecast.model.segment import RUN, WALK

Array = np.ndarray

LARGEST_GROUP = 4
"""So many people walk together at most."""

HEIGHTS = (0.5, 2.5)
"""Of people, metres."""

Stop = Float[Array, "_ 2"]
"""Where one goes: a point, anywhere on a line between two points (a gate), or anywhere in a polygon of more."""


@dataclass(frozen=True, kw_only=True)
class Spread:
    """How something differs from one to the next: normally distributed, cut off at both ends.

    Parameters
    ----------
    mean, deviation
        Of the normal distribution before it is cut.
    least, most
        What is never exceeded: drawn anew where it would be.
    """

    mean: float
    deviation: float = 0.0
    least: float = -np.inf
    most: float = np.inf

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mean) and np.isfinite(self.deviation) and self.deviation >= 0):
            raise SceneError(
                f"a spread has a finite mean and a deviation from 0, not {self.mean:g} and {self.deviation:g}"
            )
        if not self.least <= self.mean <= self.most:  # a mean far outside could never be drawn
            raise SceneError(f"a spread's mean lies between least {self.least:g} and most {self.most:g}, {self.mean:g}")

    @property
    def ends(self) -> tuple[float, float]:
        """Between what everything lies that is drawn."""
        return (self.least, self.most) if self.deviation else (self.mean, self.mean)


@dataclass(frozen=True, kw_only=True, eq=False)
class Person:
    """Somebody with a way of their own.

    Parameters
    ----------
    name
        Differs from all other names of the scene.
    start
        Ground point ``(x, z)``, metres.
    stops
        Where to, one after the other; see ``Stop``. Without any they stand at the start all the time.
    behavior
        How they go.
    heading
        Where they look at the beginning, radians; towards the first stop where nothing is said.
    begins
        When they appear, seconds.
    height
        Of their body, metres; that of the database where nothing is said.
    together
        People with the same word, 2 to 4, walk together.
    stays
        They stand at the last stop instead of leaving.
    speed
        At the beginning, m/s.
    """

    name: str
    start: Float[Array, "2"]
    stops: tuple[Stop, ...] = ()
    behavior: Behavior = field(default_factory=Behavior)
    heading: float | None = None
    begins: float = 0.0
    height: float | None = None
    together: str | None = None
    stays: bool = False
    speed: float = 0.0

    def __post_init__(self) -> None:
        who = f"person {self.name!r}"
        object.__setattr__(self, "start", ground_points([self.start], f"{who}, start", 1)[0])
        object.__setattr__(self, "stops", _stops(self.stops, who))
        _check_number(self.begins, f"begins of {who}", 0.0, np.inf)
        _check_number(self.speed, f"speed of {who}", 0.0, 12.0)
        if self.heading is not None:
            _check_number(self.heading, f"heading of {who}", -np.inf, np.inf)
        if self.height is not None:
            _check_number(self.height, f"height of {who}", *HEIGHTS)
        if self.together == "":
            raise SceneError(f"together of {who} must be a word, not nothing")


@dataclass(frozen=True, kw_only=True, eq=False)
class Route:
    """A way of some of a source's people: stops as those of a person, and the share that takes it."""

    stops: tuple[Stop, ...]
    share: float = 1.0
    stays: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "stops", _stops(self.stops, "route"))
        if not self.stops:
            raise SceneError("a route needs one or more stops")
        _check_number(self.share, "share of a route", 0.0, np.inf)


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """Where people come from: some at once, others one after the other.

    Parameters
    ----------
    name
        Differs from all other names of the scene; its people are called ``name 1`` and so on.
    area
        Where they appear: a point, a line between two points, or a polygon.
    routes
        Where they go; without any they stand where they appear.
    flow
        Arrivals a second: people, not groups; a Poisson process.
    at_once
        So many are inside the area when it begins.
    begins, ends
        When people arrive, seconds.
    most
        So many come altogether, those at once among them; any number where nothing is said.
    velocity, weight, style, height, body_radius
        How they differ; heights are that of the database where nothing is said.
    status, size
        As those of a behavior, for all of them.
    sides, distance, patience
        Shares of the preferences, in the order of ``SIDES_OF_WAY`` (none, left, right), ``DISTANCES`` (near, far) and
        ``PATIENCE`` (wait, go).
    together
        Shares of groups of 1, 2, 3 and 4 who walk together: of 10 groups with equal shares of 1 and 2, 5 are pairs.
    moving
        Whether those with a route appear at their wished speed, instead of standing.
    heading
        Where those without a route look, radians; any way where nothing is said, groups at each other.
    """

    name: str
    area: Stop
    routes: tuple[Route, ...] = ()
    flow: float = 0.0
    at_once: int = 0
    begins: float = 0.0
    ends: float = np.inf
    most: int | None = None
    velocity: Spread = Spread(mean=1.3)
    weight: Spread = Spread(mean=USUAL_WEIGHT)
    style: Spread = Spread(mean=0.0)
    height: Spread | None = None
    body_radius: Spread = Spread(mean=0.3)
    status: str = WALK
    size: str = "neutral"
    sides: tuple[float, float, float] = (1.0, 0.0, 0.0)
    distance: tuple[float, float] = (1.0, 0.0)
    patience: tuple[float, float] = (0.0, 1.0)
    together: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    moving: bool = True
    heading: Spread | None = None

    def __post_init__(self) -> None:
        who = f"source {self.name!r}"
        object.__setattr__(self, "area", ground_points(self.area, f"{who}, area", 1))
        _check_number(self.flow, f"flow of {who}", 0.0, 1000.0)
        _check_number(self.begins, f"begins of {who}", 0.0, np.inf)
        if not self.ends >= self.begins:
            raise SceneError(f"{who} ends at {self.ends:g} s, before it begins at {self.begins:g} s")
        for name, count in (("at_once", self.at_once), ("most", self.most)):
            if count is not None and not 0 <= count <= 1_000_000:
                raise SceneError(f"{name} of {who} is a number of people from 0 to 1000000, not {count}")
        if not (self.flow or self.at_once):
            raise SceneError(f"{who} needs flow (people a second) or at_once (people), or nobody comes")
        if self.most is not None and self.at_once > self.most:
            raise SceneError(f"{who} holds {self.at_once} at once, but {self.most} at most")
        for name, low, high in (
            ("velocity", 0.1, 12.0),
            ("weight", 20.0, 300.0),
            ("style", -1.0, 1.0),
            ("height", *HEIGHTS),
            ("body_radius", 0.05, 2.0),
        ):
            spread = getattr(self, name)
            if spread is not None:
                object.__setattr__(self, name, _cut(spread, f"{name} of {who}", low, high))
        if self.status not in (WALK, RUN):
            raise SceneError(f"status of {who} is {WALK} or {RUN}, not {self.status!r}")
        if self.size not in SIZES:
            raise SceneError(f"size of {who} is one of {', '.join(SIZES)}, not {self.size!r}")
        for name, words in (
            ("sides", SIDES_OF_WAY),
            ("distance", DISTANCES),
            ("patience", PATIENCE),
            ("together", tuple(f"{count + 1}" for count in range(LARGEST_GROUP))),
        ):
            object.__setattr__(self, name, _shares(getattr(self, name), f"{name} of {who}", words))
        if self.routes and not sum(route.share for route in self.routes) > 0:
            raise SceneError(f"shares of the routes of {who} are all 0; somebody must take one")


@dataclass(frozen=True, kw_only=True, eq=False)
class Wall:
    """A thin line that nobody crosses, through ground points ``(x, z)``, metres."""

    name: str
    points: Float[Array, "points 2"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", ground_points(self.points, f"wall {self.name!r}", 2))
        if (np.linalg.norm(np.diff(self.points, axis=0), axis=-1) < 1e-6).any():
            raise SceneError(f"wall {self.name!r} has the same point twice in a row")


@dataclass(frozen=True, kw_only=True, eq=False)
class Mover:
    """A round obstacle on a path of its own: straight from point to point, at rest before and after.

    Parameters
    ----------
    radius
        Metres.
    times
        When it is at each point, seconds, rising.
    points
        Ground points ``(x, z)``, metres.
    """

    name: str
    radius: float
    times: Float[Array, "points"]
    points: Float[Array, "points 2"]

    def __post_init__(self) -> None:
        who = f"mover {self.name!r}"
        object.__setattr__(self, "points", ground_points(self.points, who, 1))
        if not (np.isfinite(self.radius) and self.radius > 0):
            raise SceneError(f"{who} must have a radius above 0 m, not {self.radius}")
        times = np.array(self.times, np.float64)
        if times.shape != (len(self.points),):
            raise SceneError(f"{who} needs a time for each of its {len(self.points)} points, not {times.size}")
        if not np.isfinite(times).all():
            raise SceneError(f"{who}: time {int(np.flatnonzero(~np.isfinite(times))[0])} is not finite")
        late = np.flatnonzero(np.diff(times) <= 0)
        if len(late):
            k = int(late[0])
            raise SceneError(f"times of {who} must rise; {times[k + 1]:g} s comes after {times[k]:g} s")
        times.setflags(write=False)
        object.__setattr__(self, "times", times)

    def at(self, times: Float[Array, "*moments"]) -> Float[Array, "*moments 2"]:
        """Where it is, ``(x, z)``, metres."""
        return np.stack([np.interp(times, self.times, self.points[:, axis]) for axis in (0, 1)], axis=-1)

    def velocity_at(self, times: Float[Array, "*moments"]) -> Float[Array, "*moments 2"]:
        """How it moves, ``(x, z)``, m/s; from each point on as to the next."""
        k = np.searchsorted(self.times, times, side="right")
        steps = np.diff(self.points, axis=0) / np.diff(self.times)[:, None]
        rest = np.zeros((1, 2))
        return np.concatenate((rest, steps, rest))[k]


def _stops(stops: object, who: str) -> tuple[Array, ...]:
    return tuple(ground_points(stop, f"{who}, stop {k + 1}", 1) for k, stop in enumerate(stops))  # type: ignore[arg-type, var-annotated]


def _check_number(value: float, what: str, low: float, high: float) -> None:
    if not (np.isfinite(value) and low <= value <= high):
        if high == np.inf:
            raise SceneError(f"{what} must be a finite number{f' from {low:g}' if low > -np.inf else ''}, not {value}")
        raise SceneError(f"{what} must lie between {low:g} and {high:g}, not at {value}")


def _cut(spread: Spread, what: str, low: float, high: float) -> Spread:
    """A spread cut at what is possible; what was said to be possible must be so."""
    _check_number(spread.mean, what, low, high)
    for end in (spread.least, spread.most):
        if np.isfinite(end) and not low <= end <= high:
            raise SceneError(f"{what} must lie between {low:g} and {high:g}, not at {end:g}")
    if not spread.deviation:
        return spread
    return Spread(
        mean=spread.mean, deviation=spread.deviation, least=max(spread.least, low), most=min(spread.most, high)
    )


def _shares(shares: object, what: str, words: tuple[str, ...]) -> tuple[float, ...]:
    try:
        out = tuple(float(share) for share in shares)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise SceneError(f"{what}: shares are numbers, one each of {', '.join(words)}") from None
    if len(out) != len(words):
        raise SceneError(f"{what}: {len(words)} shares are needed, of {', '.join(words)}, not {len(out)}")
    for word, share in zip(words, out, strict=True):
        if not (np.isfinite(share) and share >= 0):
            raise SceneError(f"{what}: the share of {word} must be a finite number from 0, not {share}")
    if not sum(out) > 0:
        raise SceneError(f"{what}: shares of {', '.join(words)} are all 0; one must be above")
    return out
