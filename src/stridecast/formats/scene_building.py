"""From the parts of a scene file to the scene, and back to what is written."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from stridecast.errors import FileError, SceneError
from stridecast.formats.scene_parts import BehaviorPart, CirclePart, PersonPart, ScenePart, SourcePart
from stridecast.formats.yaml_values import Place, line_of, named
from stridecast.model import people, scene
from stridecast.model.scene import Scene

Array = np.ndarray

BEHAVIOR = ("velocity", "weight", "status", "size", "style", "body_radius")
SHARES = (
    ("side", "sides", scene.SIDES_OF_WAY),
    ("distance", "distance", scene.DISTANCES),
    ("patience", "patience", scene.PATIENCE),
)
"""Preferences: the word in files, the name in the model, and of what the shares are."""

SPREADS = ("velocity", "weight", "style", "height", "body_radius", "heading")


class SceneBuilder:
    """Makes the model's things of parts; what the model refuses gets its line and place.

    Raises
    ------
    FileError
        The first thing that makes no scene.
    """

    def __init__(self, path: str | Path | None, lines: dict[Place, int]) -> None:
        self.path = path
        self.lines = lines
        self.names: set[str] = set()

    def scene(self, part: ScenePart) -> Scene:
        """The scene of what was read."""
        if not (part.people or part.sources) or part.start is not None or part.goals is not None:
            for name in ("start", "goals"):
                if getattr(part, name) is None:
                    raise FileError(f"{name}: is missing", path=self.path)
        roads = tuple(
            self._make(scene.Road, ("roads", k), road, "road", points=np.array(road.points), width=road.width)
            for k, road in enumerate(part.roads)
        )
        obstacles = tuple(
            self._make(scene.Circle, ("obstacles", k), o, "obstacle", center=np.array(o.center), radius=o.radius)
            if isinstance(o, CirclePart)
            else self._make(scene.Polygon, ("obstacles", k), o, "obstacle", points=np.array(o.points))
            for k, o in enumerate(part.obstacles)
        )
        walls = tuple(
            self._make(scene.Wall, ("walls", k), wall, "wall", points=np.array(wall.points))
            for k, wall in enumerate(part.walls)
        )
        movers = []
        for k, mover in enumerate(part.movers):
            values = {"radius": mover.radius, "times": np.array(mover.times), "points": np.array(mover.points)}
            movers.append(self._make(scene.Mover, ("movers", k), mover, "mover", **values))
        stations = []
        for k, station in enumerate(part.stations):
            with self._at(("stations", k)):
                stations.append(scene.Station(**station.model_dump()))
        persons, sources = self._people(part.people)
        for k, source in enumerate(part.sources):
            sources.append(self._source(source, ("sources", k)))
        with self._at(("behavior",)):
            behavior = _behavior(part.behavior)
        with self._at(()):
            return Scene(
                start=None if part.start is None else np.array(part.start),
                goals=np.array(part.goals or np.zeros((0, 2)), np.float64),
                roads=roads,
                obstacles=obstacles,
                behavior=behavior,
                stations=tuple(stations),
                walls=walls,
                movers=tuple(movers),
                people=tuple(persons),
                sources=tuple(sources),
                seconds=part.seconds,
                seed=part.seed,
            )

    def _people(self, parts: Sequence[PersonPart]) -> tuple[list[people.Person], list[people.Source]]:
        """People by name, and entries that stand for several as sources of whom all are there at once."""
        persons, several = [], []
        for k, part in enumerate(parts):
            place = ("people", k)
            if part.count is None and not _is_area(part.start):
                values = part.model_dump(exclude={"name", "count", "start", "goals", "behavior"})
                with self._at((*place, "behavior")):
                    values["behavior"] = _behavior(part.behavior)
                values |= {"start": np.array(part.start), "stops": _stops(part.goals)}
                persons.append(self._make(people.Person, place, part, "person", **values))
            else:
                several.append(self._several(part, place))
        return persons, several

    def _several(self, part: PersonPart, place: Place) -> people.Source:
        for name, empty in (("together", None), ("speed", 0.0)):
            if getattr(part, name) != empty:
                self._refuse((*place, name), "goes with one person at one point; a source can do that for several")
        if part.heading is not None and part.goals:
            self._refuse((*place, "heading"), "several who have goals look there")
        how = part.behavior
        values: dict[str, Any] = {
            name: people.Spread(mean=getattr(how, name)) for name in ("velocity", "weight", "style", "body_radius")
        }
        for word, name, words in SHARES:
            values[name] = _shares(getattr(how.preference, word), words)
        return self._make(
            people.Source,
            place,
            part,
            "person",
            area=_stop(part.start),
            routes=(people.Route(stops=_stops(part.goals), stays=part.stays),) if part.goals else (),
            at_once=part.count or 1,
            begins=part.begins,
            height=None if part.height is None else people.Spread(mean=part.height),
            heading=None if part.heading is None else people.Spread(mean=part.heading),
            status=how.status,
            size=how.size,
            moving=False,
            **values,
        )

    def _source(self, part: SourcePart, place: Place) -> people.Source:
        if part.goals and part.routes:
            self._refuse((*place, "routes"), "a source has goals, for all, or routes, not both")
        routes = []
        if part.goals:
            routes.append(people.Route(stops=_stops(part.goals), stays=part.stays))
        elif part.stays:
            self._refuse((*place, "stays"), "goes with goals; routes have their own")
        for k, route in enumerate(part.routes):
            with self._at((*place, "routes", k)):
                routes.append(people.Route(stops=_stops(route.goals), share=route.share, stays=route.stays))
        values: dict[str, Any] = {}
        for name in SPREADS:
            with self._at((*place, name)):
                values[name] = _spread(getattr(part, name))
        for word, name, words in SHARES:
            with self._at((*place, "preference", word)):
                values[name] = _shares(getattr(part.preference, word), words)
        for name in ("flow", "at_once", "begins", "most", "status", "size", "moving"):
            values[name] = getattr(part, name)
        return self._make(
            people.Source,
            place,
            part,
            "source",
            area=_stop(part.start),
            routes=tuple(routes),
            ends=math.inf if part.ends is None else part.ends,
            together=(*part.together, *[0.0] * (people.LARGEST_GROUP - len(part.together))),
            **values,
        )

    def _make(self, kind: Any, place: Place, part: Any, word: str, **values: Any) -> Any:
        """A thing with a name: its own, or its place from 1."""
        name = part.name or f"{word} {int(place[-1]) + 1}"
        with self._at(place):
            if name in self.names:
                raise SceneError(f"the name {name!r} is taken; names of all things must differ")
            self.names.add(name)
            return kind(name=name, **values)

    def _refuse(self, place: Place, what: str) -> None:
        raise FileError(f"{named(place)}: {what}", path=self.path, line=line_of(self.lines, place))

    @contextmanager
    def _at(self, place: Place) -> Iterator[None]:
        try:
            yield
        except SceneError as error:
            where = f"{named(place)}: " if place else ""
            line = line_of(self.lines, place)
            raise FileError(f"{where}{error}", path=self.path, line=line) from None


def written(place: Scene) -> dict[str, Any]:
    """A scene as keys, lists, numbers and names; what is as usual is left out."""
    out: dict[str, Any] = {"version": 1}
    if place.start is not None:
        out |= {"start": place.start.tolist(), "goals": place.goals.tolist()}
    out["roads"] = [{"name": r.name, "points": r.points.tolist(), "width": float(r.width)} for r in place.roads]
    out["obstacles"] = [
        {"name": o.name, "center": o.center.tolist(), "radius": float(o.radius)}
        if isinstance(o, scene.Circle)
        else {"name": o.name, "points": o.points.tolist()}
        for o in place.obstacles
    ]
    out["behavior"] = _written_behavior(place.behavior)
    out["stations"] = [
        {
            name: _plain(getattr(s, name))
            for name in ("near", "distance", "velocity", "status", "size", "style")
            if getattr(s, name) is not None
        }
        for s in place.stations
    ]
    out["walls"] = [{"name": w.name, "points": w.points.tolist()} for w in place.walls]
    out["movers"] = [
        {"name": m.name, "radius": float(m.radius), "times": m.times.tolist(), "points": m.points.tolist()}
        for m in place.movers
    ]
    out["people"] = [_written_person(person) for person in place.people]
    out["sources"] = [_written_source(source) for source in place.sources]
    out["seconds"] = None if place.seconds is None else float(place.seconds)
    out["seed"] = int(place.seed)
    return {name: value for name, value in out.items() if value or name == "version"}


def _written_behavior(behavior: scene.Behavior) -> dict[str, Any]:
    usual = scene.Behavior()
    out = {
        name: _plain(getattr(behavior, name)) for name in BEHAVIOR if getattr(behavior, name) != getattr(usual, name)
    }
    preference = {
        name: getattr(behavior.preference, name)
        for name in ("side", "distance", "patience")
        if getattr(behavior.preference, name) != getattr(usual.preference, name)
    }
    return out | ({"preference": preference} if preference else {})


def _written_person(person: people.Person) -> dict[str, Any]:
    out = {"name": person.name, "start": person.start.tolist(), "goals": [_written_stop(s) for s in person.stops]}
    out["behavior"] = _written_behavior(person.behavior)
    usual = {f.name: f.default for f in fields(people.Person)}
    for name in ("heading", "begins", "height", "together", "stays", "speed"):
        out[name] = _plain(getattr(person, name)) if getattr(person, name) != usual[name] else None
    return {name: value for name, value in out.items() if value not in (None, [], {})}


def _written_source(source: people.Source) -> dict[str, Any]:
    out: dict[str, Any] = {"name": source.name, "start": _written_stop(source.area)}
    out["routes"] = [
        {"goals": [_written_stop(s) for s in route.stops]}
        | ({} if route.share == 1 else {"share": float(route.share)})
        | ({"stays": True} if route.stays else {})
        for route in source.routes
    ]
    usual = {f.name: f.default for f in fields(people.Source)}
    changed = {f.name for f in fields(people.Source) if f.name not in ("name", "area", "routes")}
    changed = {name for name in changed if getattr(source, name) != usual[name]}
    for name in ("flow", "at_once", "begins", "ends", "most", "status", "size", "moving"):
        if name in changed:
            out[name] = _plain(getattr(source, name))
    for name in SPREADS:
        if name in changed:
            out[name] = _written_spread(getattr(source, name))
    preference = {}
    for word, name, words in SHARES:
        if name in changed:
            shares = dict(zip(words, map(float, getattr(source, name)), strict=True))
            whole = [key for key, share in shares.items() if share]
            preference[word] = whole[0] if len(whole) == 1 and shares[whole[0]] == 1 else shares
    out["preference"] = preference
    out["together"] = [float(share) for share in source.together] if "together" in changed else None
    return {name: value for name, value in out.items() if value not in (None, [], {})}


def _behavior(part: BehaviorPart) -> scene.Behavior:
    values = part.model_dump()
    values["preference"] = scene.Preference(**values["preference"])
    return scene.Behavior(**values)


def _is_area(value: Any) -> bool:
    return not isinstance(value[0], int | float)


def _stop(value: Any) -> Array:
    return np.array(value if _is_area(value) else [value], np.float64)


def _stops(values: Sequence[Any]) -> tuple[Array, ...]:
    return tuple(_stop(value) for value in values)


def _written_stop(stop: Array) -> list[Any]:
    values: list[Any] = stop.tolist()
    return values if len(values) > 1 else values[0]


def _spread(value: Any) -> people.Spread | None:
    if value is None or isinstance(value, int | float):
        return None if value is None else people.Spread(mean=value)
    least, most = (-math.inf if value.least is None else value.least), (math.inf if value.most is None else value.most)
    return people.Spread(mean=value.mean, deviation=value.deviation, least=least, most=most)


def _written_spread(spread: people.Spread | None) -> Any:
    if spread is None:
        return None
    out = {f.name: float(getattr(spread, f.name)) for f in fields(spread)}
    usual = {"deviation": 0.0, "least": -math.inf, "most": math.inf}
    kept = {name: value for name, value in out.items() if name not in usual or value != usual[name]}
    return kept if len(kept) > 1 else kept["mean"]


def _shares(value: str | BaseModel, words: tuple[str, ...]) -> tuple[float, ...]:
    if isinstance(value, str):
        return tuple(float(word == value) for word in words)
    shares = tuple(float(getattr(value, word)) for word in words)
    if not sum(shares):
        raise SceneError(f"shares of {', '.join(words)} are all 0; one must be above")
    return shares


def _plain(value: Any) -> Any:
    """NumPy's numbers as Python's, points as lists."""
    if isinstance(value, str | bool | int | None):
        return value
    return np.asarray(value, np.float64).tolist()
