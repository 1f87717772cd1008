"""A scene: roads, obstacles, where to start and where to go, and how (BJL section 3)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

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
    Preference,
    ground_points,
)
from stridecast.model.people import LARGEST_GROUP, Mover, Person, Source, Wall

__all__ = [
    "DISTANCES",
    "PATIENCE",
    "SIDES_OF_WAY",
    "SIZES",
    "USUAL_WEIGHT",
    "Behavior",
    "Circle",
    "Mover",
    "Obstacle",
    "Person",
    "Polygon",
    "Preference",
    "Road",
    "Scene",
    "Source",
    "Station",
    "Wall",
]

Array = np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Road:
    """A strip on which one may go: a line of points ``(x, z)`` and how wide it is, metres."""

    name: str
    points: Float[Array, "points 2"]
    width: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", ground_points(self.points, f"road {self.name!r}", 2))
        if not (np.isfinite(self.width) and self.width > 0):
            raise SceneError(f"road {self.name!r} must have a width above 0 m, not {self.width}")
        if (np.linalg.norm(np.diff(self.points, axis=0), axis=-1) < 1e-6).any():
            raise SceneError(f"road {self.name!r} has the same point twice in a row")


@dataclass(frozen=True, kw_only=True, eq=False)
class Circle:
    """A round obstacle: centre ``(x, z)`` and radius, metres."""

    name: str
    center: Float[Array, "2"]
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", ground_points([self.center], f"obstacle {self.name!r}", 1)[0])
        if not (np.isfinite(self.radius) and self.radius > 0):
            raise SceneError(f"obstacle {self.name!r} must have a radius above 0 m, not {self.radius}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Polygon:
    """An obstacle with corners ``(x, z)``, metres; its outline does not cross itself."""

    name: str
    points: Float[Array, "points 2"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", ground_points(self.points, f"obstacle {self.name!r}", 3))


Obstacle = Circle | Polygon


@dataclass(frozen=True, kw_only=True)
class Station:
    """A place on the way from which on somebody goes differently.

    Parameters
    ----------
    near, distance
        Where: at the place of the way that is nearest to the point ``(x, z)``, or after so many metres of it. Exactly
        one of the two.
    velocity, status, size, style
        What changes there; what is left out stays.
    """

    near: tuple[float, float] | None = None
    distance: float | None = None
    velocity: float | None = None
    status: str | None = None
    size: str | None = None
    style: float | None = None

    def __post_init__(self) -> None:
        if (self.near is None) == (self.distance is None):
            raise SceneError("a station needs either near (a point) or distance (metres along the way)")
        if self.near is not None and not np.isfinite(self.near).all():
            raise SceneError(f"a station's point must be two finite numbers, not {self.near}")
        if self.distance is not None and not (np.isfinite(self.distance) and self.distance >= 0):
            raise SceneError(f"a station's distance must be a number of metres from 0, not {self.distance}")
        self.after(Behavior())  # whatever it sets is checked there

    def after(self, behavior: Behavior) -> Behavior:
        """Somebody's behavior from here on."""
        names = ("velocity", "status", "size", "style")
        return replace(behavior, **{n: getattr(self, n) for n in names if getattr(self, n) is not None})


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A place and a task: for one walker, for a crowd, or for both.

    Parameters
    ----------
    start
        Ground point ``(x, z)`` of the one walker, metres; nothing where there is none.
    goals
        One or more points, reached in this order; none where there is no walker.
    roads
        Where one may go; anywhere if there is none.
    obstacles
        What is in the way.
    behavior
        How the walker goes.
    stations
        Where that changes.
    walls
        Thin lines that are in the way too.
    movers
        Obstacles that move, for crowds; the one walker's path does not know them.
    people
        Who is there by name.
    sources
        Where more come from.
    seconds
        How long it lasts; as long as somebody is on the way where nothing is said.
    seed
        Of all that is drawn by chance.
    """

    start: Float[Array, "2"] | None = None
    goals: Float[Array, "goals 2"] = field(default_factory=lambda: np.zeros((0, 2)))
    roads: tuple[Road, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    behavior: Behavior = field(default_factory=Behavior)
    stations: tuple[Station, ...] = ()
    walls: tuple[Wall, ...] = ()
    movers: tuple[Mover, ...] = ()
    people: tuple[Person, ...] = ()
    sources: tuple[Source, ...] = ()
    seconds: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        crowd = bool(self.people or self.sources)
        if self.start is None:
            if len(self.goals):
                raise SceneError("there are goals but no start")
            if not crowd:
                raise SceneError("nobody is there: start and goals, people or sources are needed")
        else:
            object.__setattr__(self, "start", ground_points([self.start], "start", 1)[0])
        least = 0 if self.start is None else 1
        goals = self.goals if least else np.zeros((0, 2))
        object.__setattr__(self, "goals", ground_points(goals, "goals", least))
        if self.seconds is not None and not (np.isfinite(self.seconds) and self.seconds > 0):
            raise SceneError(f"seconds must be a finite number above 0, not {self.seconds}")
        if not 0 <= self.seed < 2**32:
            raise SceneError(f"seed must be a whole number from 0 to {2**32 - 1}, not {self.seed}")
        seen: dict[str, str] = {}
        for kind, name in self._names():
            if name in seen:
                raise SceneError(f"two things are called {name!r}, {seen[name]} and {kind}; names must differ")
            seen[name] = kind
        for word, count in Counter(p.together for p in self.people if p.together is not None).items():
            if not 2 <= count <= LARGEST_GROUP:
                raise SceneError(f"together {word!r} is the word of {count}; 2 to {LARGEST_GROUP} people walk together")

    @property
    def has_walker(self) -> bool:
        """Whether there is a start and a goal for a single walker."""
        return self.start is not None

    def task(self) -> tuple[Float[Array, "2"], Float[Array, "goals 2"]]:
        """Start and goals of the one walker.

        Raises
        ------
        SceneError
            There are none.
        """
        if self.start is None:
            raise SceneError("the scene has no start and goals for a single walker, only people and sources of people")
        return self.start, self.goals

    def _names(self) -> Iterator[tuple[str, str]]:
        for kind, things in (
            ("road", self.roads),
            ("obstacle", self.obstacles),
            ("wall", self.walls),
            ("mover", self.movers),
            ("person", self.people),
            ("source", self.sources),
        ):
            for thing in things:
                yield kind, thing.name
