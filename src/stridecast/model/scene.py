"""A scene: roads, obstacles, where to start and where to go, and how (BJL section 3)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from stridecast.errors import SceneError
from stridecast.model.segment import RUN, WALK

Array = np.ndarray

SIDES_OF_WAY = ("none", "left", "right")
DISTANCES = ("near", "far")
PATIENCE = ("wait", "go")
SIZES = ("calm", "neutral", "lively", "exaggerated")
"""Size of movement: gains per frequency band over the joint curves (BJL's status; Bruderlin and Williams 1995)."""

USUAL_WEIGHT = 70.0
"""Of whom turns are as wide as their speed asks for, kilograms."""


@dataclass(frozen=True, kw_only=True)
class Preference:
    """What somebody does where there is a choice.

    Parameters
    ----------
    side
        Passes obstacles and people on the ``left`` or ``right``; ``none``: whichever is shorter.
    distance
        Keeps ``near`` to what is passed, or ``far``.
    patience
        Would rather ``wait`` for what moves, or ``go`` first.
    """

    side: str = "none"
    distance: str = "near"
    patience: str = "go"

    def __post_init__(self) -> None:
        for name, known in (("side", SIDES_OF_WAY), ("distance", DISTANCES), ("patience", PATIENCE)):
            value = getattr(self, name)
            if value not in known:
                raise SceneError(f"preference.{name} is one of {', '.join(known)}, not {value!r}")


@dataclass(frozen=True, kw_only=True)
class Behavior:
    """How somebody goes (BJL's behavior parameters).

    Parameters
    ----------
    velocity
        Wished speed, m/s.
    weight
        Kilograms: the heavier and faster, the wider the turns (BJL eq. 1).
    status
        ``walk`` or ``run``.
    size
        How large movements are: one of ``SIZES``.
    style
        From gloomy (-1) to brisk (1); 0 is neutral. Walkers show it as far as their database does.
    preference
        What is done where there is a choice.
    body_radius
        Half the width that is kept free, metres.
    """

    velocity: float = 1.3
    weight: float = USUAL_WEIGHT
    status: str = WALK
    size: str = "neutral"
    style: float = 0.0
    preference: Preference = field(default_factory=Preference)
    body_radius: float = 0.3

    def __post_init__(self) -> None:
        for name, low, high in (
            ("velocity", 0.1, 12.0),
            ("weight", 20.0, 300.0),
            ("style", -1.0, 1.0),
            ("body_radius", 0.05, 2.0),
        ):
            value = getattr(self, name)
            if not (np.isfinite(value) and low <= value <= high):
                raise SceneError(f"{name} must lie between {low:g} and {high:g}, not at {value}")
        if self.status not in (WALK, RUN):
            raise SceneError(f"status is {WALK} or {RUN}, not {self.status!r}")
        if self.size not in SIZES:
            raise SceneError(f"size is one of {', '.join(SIZES)}, not {self.size!r}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Road:
    """A strip on which one may go: a line of points ``(x, z)`` and how wide it is, metres."""

    name: str
    points: Float[Array, "points 2"]
    width: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", _points(self.points, f"road {self.name!r}", 2))
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
        object.__setattr__(self, "center", _points([self.center], f"obstacle {self.name!r}", 1)[0])
        if not (np.isfinite(self.radius) and self.radius > 0):
            raise SceneError(f"obstacle {self.name!r} must have a radius above 0 m, not {self.radius}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Polygon:
    """An obstacle with corners ``(x, z)``, metres; its outline does not cross itself."""

    name: str
    points: Float[Array, "points 2"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", _points(self.points, f"obstacle {self.name!r}", 3))


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
    """A place and a task.

    Parameters
    ----------
    start
        Ground point ``(x, z)``, metres.
    goals
        One or more points, reached in this order.
    roads
        Where one may go; anywhere if there is none.
    obstacles
        What is in the way.
    behavior
        How to go.
    stations
        Where that changes.
    """

    start: Float[Array, "2"]
    goals: Float[Array, "goals 2"]
    roads: tuple[Road, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    behavior: Behavior = field(default_factory=Behavior)
    stations: tuple[Station, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", _points([self.start], "start", 1)[0])
        object.__setattr__(self, "goals", _points(self.goals, "goals", 1))
        seen: set[str] = set()
        for thing in (*self.roads, *self.obstacles):
            if thing.name in seen:
                raise SceneError(f"two roads or obstacles are called {thing.name!r}; names must differ")
            seen.add(thing.name)


def _points(values: object, what: str, least: int) -> Array:
    """Ground points as an array that cannot be changed."""
    try:
        out = np.array(values, np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{what}: points are pairs of numbers (x, z)") from None
    if out.ndim != 2 or out.shape[1] != 2 or len(out) < least:
        raise SceneError(f"{what}: {least} or more points (x, z) are needed, not an array of shape {out.shape}")
    if not np.isfinite(out).all():
        raise SceneError(f"{what}: point {int(np.flatnonzero(~np.isfinite(out).all(axis=1))[0])} is not finite")
    out.setflags(write=False)
    return out
