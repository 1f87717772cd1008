"""Scenes as YAML: what stands where, where to go and how; short for people, checked to the last key."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError

from stridecast.errors import FileError, SceneError
from stridecast.formats.files import looks_like, read_text, replacing
from stridecast.formats.points import FARTHEST
from stridecast.model import scene as model
from stridecast.model.scene import USUAL_WEIGHT, Scene

LARGEST = 64 * 2**20
"""Larger files are a mistake, bytes."""

MOST_THINGS = 200_000
"""Of each kind; more are a mistake."""

MOST_VALUES = 4_000_000
"""Numbers, names and lists of a file, all together."""

DEEPEST = 16
"""Lists and keys inside each other."""

_NUMBER = re.compile(r"[-+]?(\d[\d_]*\.?\d*|\.\d+)([eE][-+]?\d+)?")
_SPECIAL = {"nan": math.nan, "inf": math.inf, "+inf": math.inf, "-inf": -math.inf}

Place = tuple[str | int, ...]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


Coordinate = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-FARTHEST, le=FARTHEST)]
Length = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=FARTHEST)]
Point = Annotated[
    tuple[Coordinate, Coordinate], Field(description="Ground point (x, z), metres; +x is to the left of +z.")
]
Name = Annotated[str, Field(min_length=1, max_length=200)]
Velocity = Annotated[float, Field(strict=True, ge=0.1, le=12.0, description="Wished speed, m/s.")]
Style = Annotated[float, Field(strict=True, ge=-1.0, le=1.0, description="From gloomy (-1) to brisk (1).")]
Status = Literal["walk", "run"]
Size = Literal["calm", "neutral", "lively", "exaggerated"]


class RoadPart(_Part):
    """A strip on which one may go; its ends are round."""

    name: Name | None = None
    points: Annotated[list[Point], Field(min_length=2, max_length=MOST_THINGS)]
    width: Annotated[Length, Field(description="From edge to edge, metres.")]


class CirclePart(_Part):
    """A round obstacle."""

    name: Name | None = None
    center: Point
    radius: Length


class PolygonPart(_Part):
    """An obstacle with corners; its outline goes round once, without crossing itself."""

    name: Name | None = None
    points: Annotated[list[Point], Field(min_length=3, max_length=MOST_THINGS)]


class PreferencePart(_Part):
    """What somebody does where there is a choice."""

    side: Literal["none", "left", "right"] = "none"
    distance: Literal["near", "far"] = "near"
    patience: Literal["wait", "go"] = "go"


class BehaviorPart(_Part):
    """How somebody goes."""

    velocity: Velocity = 1.3
    weight: Annotated[float, Field(strict=True, ge=20.0, le=300.0, description="Kilograms.")] = USUAL_WEIGHT
    status: Status = "walk"
    size: Annotated[Size, Field(description="How large movements are.")] = "neutral"
    style: Style = 0.0
    preference: PreferencePart = PreferencePart()
    body_radius: Annotated[
        float, Field(strict=True, ge=0.05, le=2.0, description="Half the width kept free, metres.")
    ] = 0.3


class StationPart(_Part):
    """Where somebody begins to go differently: at the place nearest to a point, or after so many metres."""

    near: Point | None = None
    distance: Annotated[float, Field(strict=True, ge=0, le=FARTHEST, description="Along the way, metres.")] | None = (
        None
    )
    velocity: Velocity | None = None
    status: Status | None = None
    size: Size | None = None
    style: Style | None = None


def _shape(value: Any) -> str:
    """Which obstacle is meant: what has corners is a polygon."""
    has = value if isinstance(value, dict) else getattr(value, "__dict__", {})
    return "polygon" if "points" in has else "circle"


ObstaclePart = Annotated[
    Annotated[CirclePart, Tag("circle")] | Annotated[PolygonPart, Tag("polygon")], Discriminator(_shape)
]


class ScenePart(_Part):
    """A place and a task: lengths are metres, ground points (x, z)."""

    version: Literal[1] = 1
    start: Point
    goals: Annotated[list[Point], Field(min_length=1, max_length=MOST_THINGS, description="Reached in this order.")]
    roads: Annotated[list[RoadPart], Field(max_length=MOST_THINGS, description="None: anywhere.")] = []
    obstacles: Annotated[list[ObstaclePart], Field(max_length=MOST_THINGS)] = []
    behavior: BehaviorPart = BehaviorPart()
    stations: Annotated[list[StationPart], Field(max_length=MOST_THINGS)] = []


def load_scene(path: str | Path) -> Scene:
    """Read a scene.

    Parameters
    ----------
    path
        YAML as described by ``scene_schema``: ``start``, ``goals`` and, if you like, ``roads``, ``obstacles``,
        ``behavior`` and ``stations``. Roads and obstacles without names are called by their places, from 1.

    Raises
    ------
    FileError
        The file cannot be read, is something else, or holds what makes no scene; with line and place in it, such as
        ``obstacles[2].radius``.
    """
    values, lines = _values(path, _text(path))
    try:
        part = ScenePart.model_validate(values)
    except ValidationError as error:
        raise _refusal(path, error, lines) from None
    return _scene(path, part, lines)


_BREAKS = ("\x85", "\u2028", "\u2029")
"""Line ends beyond those of ASCII: YAML folds them unless they are escaped."""


def save_scene(path: str | Path, scene: Scene) -> None:
    """Write a scene that ``load_scene`` reads to the last bit; what is as usual is left out.

    Raises
    ------
    FileError
        The file cannot be written; what was there is untouched.
    """
    behavior = {
        name: _plain(getattr(scene.behavior, name))
        for name in ("velocity", "weight", "status", "size", "style", "body_radius")
        if getattr(scene.behavior, name) != getattr(model.Behavior(), name)
    }
    preference = {
        name: getattr(scene.behavior.preference, name)
        for name in ("side", "distance", "patience")
        if getattr(scene.behavior.preference, name) != getattr(model.Preference(), name)
    }
    if preference:
        behavior["preference"] = preference
    out: dict[str, Any] = {"version": 1, "start": scene.task()[0].tolist(), "goals": scene.goals.tolist()}
    out["roads"] = [{"name": r.name, "points": r.points.tolist(), "width": float(r.width)} for r in scene.roads]
    out["obstacles"] = [
        {"name": o.name, "center": o.center.tolist(), "radius": float(o.radius)}
        if isinstance(o, model.Circle)
        else {"name": o.name, "points": o.points.tolist()}
        for o in scene.obstacles
    ]
    out["behavior"] = behavior
    out["stations"] = [
        {
            name: _plain(getattr(s, name))
            for name in ("near", "distance", "velocity", "status", "size", "style")
            if getattr(s, name) is not None
        }
        for s in scene.stations
    ]
    kept = {name: value for name, value in out.items() if value or name in ("version", "start", "goals")}
    told = any(mark in thing["name"] for mark in _BREAKS for thing in (*out["roads"], *out["obstacles"]))
    text = yaml.dump(kept, Dumper=_Dumper, default_flow_style=None, sort_keys=False, allow_unicode=not told, width=118)
    with replacing(path) as file:
        file.write(text.encode())


def scene_schema() -> dict[str, Any]:
    """JSON schema of scene files, for editors that check while one types."""
    schema = ScenePart.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "stridecast scene"}


class _Dumper(yaml.SafeDumper):
    """Numbers, names, lists; no anchors for lists that are equal."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True


def _plain(value: Any) -> Any:
    """NumPy's numbers as Python's, points as lists."""
    if isinstance(value, str):
        return value
    return np.asarray(value, np.float64).tolist()


def _text(path: str | Path) -> str:
    try:
        size = Path(path).stat().st_size
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error
    if size > LARGEST:
        what = f"has {size / 2**20:.0f} MB; a scene has at most {LARGEST // 2**20} MB"
        raise FileError(what, path=path)
    data = read_text(path)
    if name := looks_like(data):
        raise FileError(f"is no scene but {name}", path=path)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FileError("is no text in UTF-8", path=path, line=line) from None


def _values(path: str | Path, text: str) -> tuple[Any, dict[Place, int]]:
    """What YAML says, as lists, dictionaries, numbers and names, and the line of each place.

    Built from the parser's events, so that nothing is expanded, nested or repeated without bounds.
    """
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    lines: dict[Place, int] = {}
    builder = _Builder(path, lines)
    try:
        for event in yaml.parse(text, Loader=loader):
            builder.take(event)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise FileError(f"is no YAML: {problem}", path=path, line=None if mark is None else mark.line + 1) from None
    if not isinstance(builder.root, dict):
        raise FileError("is no scene: it should name start and goals, as 'start: [0, 0]'", path=path)
    return builder.root, lines


class _Builder:
    """Values from events, one after the other."""

    def __init__(self, path: str | Path, lines: dict[Place, int]) -> None:
        self.path = path
        self.lines = lines
        self.root: Any = None
        self.documents = 0
        self.count = 0
        self.open: list[tuple[Any, Place]] = []
        self.key: list[str | None] = []

    def take(self, event: yaml.Event) -> None:
        """Take the next event."""
        line = event.start_mark.line + 1 if event.start_mark else 1
        if isinstance(event, yaml.DocumentStartEvent):
            self.documents += 1
            if self.documents > 1:
                raise FileError("holds a second document; a file holds one scene", path=self.path, line=line)
        elif isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise FileError("anchors and aliases (& and *) are not taken; write it out", path=self.path, line=line)
        elif getattr(event, "tag", None) not in (None, "!"):
            raise FileError(f"tags such as {getattr(event, 'tag', '')!r} are not taken", path=self.path, line=line)
        elif isinstance(event, yaml.ScalarEvent):
            self._scalar(event, line)
        elif isinstance(event, yaml.SequenceStartEvent | yaml.MappingStartEvent):
            self._begin([] if isinstance(event, yaml.SequenceStartEvent) else {}, line)
        elif isinstance(event, yaml.SequenceEndEvent | yaml.MappingEndEvent):
            self.open.pop()
            self.key.pop()

    def _scalar(self, event: yaml.ScalarEvent, line: int) -> None:
        if self.open and isinstance(self.open[-1][0], dict) and self.key[-1] is None:
            self._take_key(event.value, line)
        else:
            self._put(event.value if event.style else _scalar(event.value), line)

    def _take_key(self, key: str, line: int) -> None:
        values, place = self.open[-1]
        if key in values:
            first = self.lines[(*place, key)]
            what = f"{_named((*place, key))} stands here a second time; the first is in line {first}"
            raise FileError(what, path=self.path, line=line)
        self.key[-1] = key

    def _begin(self, value: Any, line: int) -> None:
        if len(self.open) >= DEEPEST:
            raise FileError(f"lists go deeper than {DEEPEST} levels", path=self.path, line=line)
        if self.open and isinstance(self.open[-1][0], dict) and self.key[-1] is None:
            raise FileError("a key must be a name, not a list", path=self.path, line=line)
        place = self._put(value, line)
        self.open.append((value, place))
        self.key.append(None)

    def _put(self, value: Any, line: int) -> Place:
        self.count += 1
        if self.count > MOST_VALUES:
            raise FileError(f"holds more than {MOST_VALUES} values", path=self.path, line=line)
        if not self.open:
            self.root = value
            return ()
        into, at = self.open[-1]
        place: Place
        if isinstance(into, dict):
            key = self.key[-1] or ""
            into[key] = value
            place = (*at, key)
            self.key[-1] = None
        else:
            place = (*at, len(into))
            into.append(value)
        self.lines[place] = line
        return place


def _scalar(text: str) -> Any:
    """A plain scalar: nothing, true, a number, else text. Numbers may be written 1e3, which YAML 1.1 takes for text."""
    if text in ("", "~", "null"):
        return None
    if text in ("true", "false"):
        return text == "true"
    if _NUMBER.fullmatch(text):
        return float(text) if any(c in text for c in ".eE") or len(text) > 15 else int(text)
    return _SPECIAL.get(text.lower().replace(".", "", 1) if "." in text[:2] else "", text)


def _refusal(path: str | Path, error: ValidationError, lines: dict[Place, int]) -> FileError:
    """The first of the complaints, in words, with its place."""
    found = error.errors(include_url=False, include_context=True)
    first = min(found, key=lambda e: _line(lines, _place(e["loc"])) or 0)
    place = _place(first["loc"])
    kind, value, context = first["type"], first["input"], first.get("ctx", {})
    shown = f"{value!r:.40}" if not isinstance(value, list | dict) else "a list" if isinstance(value, list) else "keys"
    if kind == "missing":
        what = "is missing" if isinstance(place[-1], str) else "the second number of the point (x, z) is missing"
    elif kind == "extra_forbidden":
        what = f"is not known here; there are {', '.join(_known(place[:-1], lines))}"
    elif kind in ("float_type", "finite_number"):
        what = f"should be a finite number, not {shown}"
    elif kind in ("greater_than", "greater_than_equal", "less_than_equal"):
        sign, bound = next(iter(context.items()))
        words = {"gt": "greater than", "ge": "at least", "le": "at most"}
        what = f"should be {words[sign]} {bound:g}, not {shown}"
    elif kind == "literal_error":
        what = f"should be one of {context['expected']}, not {shown}"
    elif kind in ("tuple_type", "list_type"):
        what = f"should be a list, not {shown}"
    elif kind == "too_long" and context.get("max_length") == 2:
        what = "a point is two numbers (x, z)"
    elif kind in ("too_short", "too_long"):
        sign = "least" if kind == "too_short" else "most"
        bound = context.get("min_length" if sign == "least" else "max_length")
        what = f"should hold at {sign} {bound}, not {context.get('actual_length')}"
    elif kind in ("model_type", "model_attributes_type", "dict_type", "union_tag_not_found"):
        what = f"should hold keys, as 'name: value', not {shown}"
    else:
        what = f"{first['msg'][0].lower()}{first['msg'][1:]}, not {shown}"
    more = "" if len(found) == 1 else f" ({len(found) - 1} more mistake{'s' if len(found) > 2 else ''})"
    return FileError(f"{_named(place)}: {what}{more}", path=path, line=_line(lines, place))


def _place(location: tuple[int | str, ...]) -> Place:
    """Where pydantic found something, without the kinds of obstacle that it adds."""
    at = list(location)
    if len(at) > 2 and at[0] == "obstacles" and at[2] in ("circle", "polygon"):
        del at[2]
    return tuple(at)


def _known(place: Place, lines: dict[Place, int]) -> list[str]:
    """Keys that may stand at a place."""
    parts: dict[Place, type[BaseModel]] = {
        (): ScenePart,
        ("behavior",): BehaviorPart,
        ("behavior", "preference"): PreferencePart,
        ("roads",): RoadPart,
        ("stations",): StationPart,
        ("obstacles",): PolygonPart if (*place, "points") in lines else CirclePart,
    }
    return list(parts[tuple(key for key in place if isinstance(key, str))].model_fields)


def _line(lines: dict[Place, int], place: Place) -> int | None:
    """Line of a place, or of what holds it."""
    while place and place not in lines:
        place = place[:-1]
    return lines.get(place)


def _named(place: Place) -> str:
    """A place as ``obstacles[2].radius``, counted from 0."""
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place)
    return text.removeprefix(".") or "the scene"


def _scene(path: str | Path, part: ScenePart, lines: dict[Place, int]) -> Scene:
    """The scene of what was read; the model's own complaints get their places."""
    at: Place = ()
    try:
        roads: list[model.Road] = []
        obstacles: list[model.Obstacle] = []
        stations: list[model.Station] = []
        for k, road in enumerate(part.roads):
            at = ("roads", k)
            name = road.name or f"road {k + 1}"
            roads.append(model.Road(name=name, points=np.array(road.points), width=road.width))
        seen = {road.name for road in roads}
        for k, obstacle in enumerate(part.obstacles):
            at = ("obstacles", k)
            name = obstacle.name or f"obstacle {k + 1}"
            if name in seen:
                raise SceneError(f"the name {name!r} is taken; names of roads and obstacles must differ")
            seen.add(name)
            if isinstance(obstacle, CirclePart):
                obstacles.append(model.Circle(name=name, center=np.array(obstacle.center), radius=obstacle.radius))
            else:
                obstacles.append(model.Polygon(name=name, points=np.array(obstacle.points)))
        for k, station in enumerate(part.stations):
            at = ("stations", k)
            stations.append(model.Station(**station.model_dump()))
        at = ("behavior",)
        behavior = part.behavior.model_dump()
        behavior["preference"] = model.Preference(**behavior["preference"])
        made = model.Behavior(**behavior)
        at = ()
        return Scene(
            start=np.array(part.start),
            goals=np.array(part.goals),
            roads=tuple(roads),
            obstacles=tuple(obstacles),
            behavior=made,
            stations=tuple(stations),
        )
    except SceneError as error:
        where = f"{_named(at)}: " if at else ""
        raise FileError(f"{where}{error}", path=path, line=_line(lines, at)) from None
