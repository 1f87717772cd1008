"""The parts of a scene file: which keys there are, and between what their values lie."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from stridecast.formats.points import FARTHEST
from stridecast.formats.yaml_values import Place
from stridecast.model.people import HEIGHTS, LARGEST_GROUP
from stridecast.model.scene import USUAL_WEIGHT

MOST_THINGS = 200_000
"""Of each kind; more are a mistake."""

MOST_PEOPLE = 1_000_000
"""Of a source; more are a mistake."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def _number(**limits: Any) -> Any:
    return Field(strict=True, allow_inf_nan=False, **limits)


Coordinate = Annotated[float, _number(ge=-FARTHEST, le=FARTHEST)]
Length = Annotated[float, _number(gt=0, le=FARTHEST)]
Point = Annotated[
    tuple[Coordinate, Coordinate], Field(description="Ground point (x, z), metres; +x is to the left of +z.")
]
Points = Annotated[list[Point], Field(min_length=1, max_length=MOST_THINGS)]
Name = Annotated[str, Field(min_length=1, max_length=200)]
Velocity = Annotated[float, Field(strict=True, ge=0.1, le=12.0, description="Wished speed, m/s.")]
Weight = Annotated[float, Field(strict=True, ge=20.0, le=300.0, description="Kilograms.")]
Style = Annotated[float, Field(strict=True, ge=-1.0, le=1.0, description="From gloomy (-1) to brisk (1).")]
Radius = Annotated[float, Field(strict=True, ge=0.05, le=2.0, description="Half the width kept free, metres.")]
Height = Annotated[float, _number(ge=HEIGHTS[0], le=HEIGHTS[1], description="Of the body, metres.")]
Heading = Annotated[float, _number(description="Where somebody looks, radians: 0 towards +z, positive towards +x.")]
Seconds = Annotated[float, _number(ge=0)]
Deviation = Annotated[float, _number(ge=0, description="Of the normal distribution before it is cut.")]
Share = Annotated[float, _number(ge=0)]
Count = Annotated[int, Field(strict=True, ge=0, le=MOST_PEOPLE)]
Status = Literal["walk", "run"]
Size = Literal["calm", "neutral", "lively", "exaggerated"]
Side = Literal["none", "left", "right"]
Distance = Literal["near", "far"]
Patience = Literal["wait", "go"]


_TAGS = ("<point>", "<points>", "<keys>", "<value>", "<circle>", "<polygon>")
"""Of unions: pydantic tells them among the keys of a place, so they look like none."""


def _area(value: Any) -> str:
    return "<points>" if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple) else "<point>"


def _mapping(value: Any) -> str:
    return "<keys>" if isinstance(value, dict | BaseModel) else "<value>"


def _shape(value: Any) -> str:
    """Which obstacle is meant: what has corners is a polygon."""
    has = value if isinstance(value, dict) else getattr(value, "__dict__", {})
    return "<polygon>" if "points" in has else "<circle>"


AreaPart = Annotated[
    Annotated[Point, Tag("<point>")] | Annotated[Points, Tag("<points>")],
    Discriminator(_area),
    Field(description="A point, a line between two points, or the corners of a polygon."),
]
Goals = Annotated[list[AreaPart], Field(max_length=MOST_THINGS, description="Reached in this order.")]


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


ObstaclePart = Annotated[
    Annotated[CirclePart, Tag("<circle>")] | Annotated[PolygonPart, Tag("<polygon>")], Discriminator(_shape)
]


class WallPart(_Part):
    """A thin line that nobody crosses."""

    name: Name | None = None
    points: Annotated[list[Point], Field(min_length=2, max_length=MOST_THINGS)]


class MoverPart(_Part):
    """A round obstacle that moves straight from point to point."""

    name: Name | None = None
    radius: Length
    times: Annotated[
        list[Annotated[float, _number()]],
        Field(min_length=1, max_length=MOST_THINGS, description="When it is at each point, seconds, rising."),
    ]
    points: Points


class PreferencePart(_Part):
    """What somebody does where there is a choice."""

    side: Side = "none"
    distance: Distance = "near"
    patience: Patience = "go"


class BehaviorPart(_Part):
    """How somebody goes."""

    velocity: Velocity = 1.3
    weight: Weight = USUAL_WEIGHT
    status: Status = "walk"
    size: Annotated[Size, Field(description="How large movements are.")] = "neutral"
    style: Style = 0.0
    preference: PreferencePart = PreferencePart()
    body_radius: Radius = 0.3


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


class PersonPart(_Part):
    """Somebody with a way of their own, or several who are in an area at once."""

    name: Name | None = None
    start: AreaPart
    count: (
        Annotated[int, Field(strict=True, ge=1, le=MOST_PEOPLE, description="So many, anywhere in start.")] | None
    ) = None
    goals: Annotated[Goals, Field(description="Reached in this order; without any they stand at the start.")] = []
    behavior: BehaviorPart = BehaviorPart()
    heading: Heading | None = None
    begins: Seconds = 0.0
    height: Height | None = None
    together: Annotated[Name, Field(description="2 to 4 people with the same word walk together.")] | None = None
    stays: Annotated[bool, Field(strict=True, description="Stands at the last goal instead of leaving.")] = False
    speed: Annotated[float, _number(ge=0, le=12.0, description="At the beginning, m/s.")] = 0.0


class VelocitySpread(_Part):
    """Normally distributed speeds, cut off at both ends, m/s."""

    mean: Velocity
    deviation: Deviation = 0.0
    least: Velocity | None = None
    most: Velocity | None = None


class WeightSpread(_Part):
    """Normally distributed weights, cut off at both ends, kilograms."""

    mean: Weight
    deviation: Deviation = 0.0
    least: Weight | None = None
    most: Weight | None = None


class StyleSpread(_Part):
    """Normally distributed styles, cut off at both ends."""

    mean: Style
    deviation: Deviation = 0.0
    least: Style | None = None
    most: Style | None = None


class HeightSpread(_Part):
    """Normally distributed heights, cut off at both ends, metres."""

    mean: Height
    deviation: Deviation = 0.0
    least: Height | None = None
    most: Height | None = None


class RadiusSpread(_Part):
    """Normally distributed radii of bodies, cut off at both ends, metres."""

    mean: Radius
    deviation: Deviation = 0.0
    least: Radius | None = None
    most: Radius | None = None


class HeadingSpread(_Part):
    """Normally distributed headings, cut off at both ends, radians."""

    mean: Heading
    deviation: Deviation = 0.0
    least: Heading | None = None
    most: Heading | None = None


SpreadPart = VelocitySpread | WeightSpread | StyleSpread | HeightSpread | RadiusSpread | HeadingSpread


class SideShares(_Part):
    """How many prefer which side."""

    none: Share = 0.0
    left: Share = 0.0
    right: Share = 0.0


class DistanceShares(_Part):
    """How many keep near, and how many far."""

    near: Share = 0.0
    far: Share = 0.0


class PatienceShares(_Part):
    """How many rather wait, and how many go."""

    wait: Share = 0.0
    go: Share = 0.0


class PreferenceShares(_Part):
    """What people do where there is a choice: a word for all, or shares."""

    side: Annotated[Annotated[Side, Tag("<value>")] | Annotated[SideShares, Tag("<keys>")], Discriminator(_mapping)] = (
        "none"
    )
    distance: Annotated[
        Annotated[Distance, Tag("<value>")] | Annotated[DistanceShares, Tag("<keys>")], Discriminator(_mapping)
    ] = "near"
    patience: Annotated[
        Annotated[Patience, Tag("<value>")] | Annotated[PatienceShares, Tag("<keys>")], Discriminator(_mapping)
    ] = "go"


class RoutePart(_Part):
    """A way that some of a source's people take."""

    goals: Annotated[Goals, Field(min_length=1)]
    share: Share = 1.0
    stays: Annotated[bool, Field(strict=True, description="They stand at the last goal instead of leaving.")] = False


class SourcePart(_Part):
    """Where people come from: some at once, others one after the other."""

    name: Name | None = None
    start: Annotated[AreaPart, Field(description="Where they appear: a point, a line or a polygon.")]
    goals: Annotated[Goals, Field(description="Where all of them go; instead of routes.")] = []
    stays: Annotated[bool, Field(strict=True, description="They stand at the last of the goals.")] = False
    routes: Annotated[list[RoutePart], Field(max_length=MOST_THINGS)] = []
    flow: Annotated[float, _number(ge=0, le=1000.0, description="Arrivals a second, people: a Poisson process.")] = 0.0
    at_once: Annotated[Count, Field(description="So many are there when it begins.")] = 0
    begins: Seconds = 0.0
    ends: Seconds | None = None
    most: Annotated[Count, Field(description="So many come altogether.")] | None = None
    velocity: Annotated[
        Annotated[Velocity, Tag("<value>")] | Annotated[VelocitySpread, Tag("<keys>")], Discriminator(_mapping)
    ] = 1.3
    weight: Annotated[
        Annotated[Weight, Tag("<value>")] | Annotated[WeightSpread, Tag("<keys>")], Discriminator(_mapping)
    ] = USUAL_WEIGHT
    style: Annotated[
        Annotated[Style, Tag("<value>")] | Annotated[StyleSpread, Tag("<keys>")], Discriminator(_mapping)
    ] = 0.0
    height: (
        Annotated[Annotated[Height, Tag("<value>")] | Annotated[HeightSpread, Tag("<keys>")], Discriminator(_mapping)]
        | None
    ) = None
    body_radius: Annotated[
        Annotated[Radius, Tag("<value>")] | Annotated[RadiusSpread, Tag("<keys>")], Discriminator(_mapping)
    ] = 0.3
    status: Status = "walk"
    size: Size = "neutral"
    preference: PreferenceShares = PreferenceShares()
    together: Annotated[
        list[Share],
        Field(min_length=1, max_length=LARGEST_GROUP, description="Shares of groups of 1, 2, 3 and 4."),
    ] = [1.0]
    moving: Annotated[bool, Field(strict=True, description="Whether those who go somewhere appear at their speed.")] = (
        True
    )
    heading: (
        Annotated[Annotated[Heading, Tag("<value>")] | Annotated[HeadingSpread, Tag("<keys>")], Discriminator(_mapping)]
        | None
    ) = None


class ScenePart(_Part):
    """A place and a task: lengths are metres, ground points (x, z)."""

    version: Literal[1] = 1
    start: Annotated[Point, Field(description="Of the one walker; left out in scenes of crowds.")] | None = None
    goals: (
        Annotated[list[Point], Field(min_length=1, max_length=MOST_THINGS, description="Reached in this order.")] | None
    ) = None
    roads: Annotated[list[RoadPart], Field(max_length=MOST_THINGS, description="None: anywhere.")] = []
    obstacles: Annotated[list[ObstaclePart], Field(max_length=MOST_THINGS)] = []
    behavior: BehaviorPart = BehaviorPart()
    stations: Annotated[list[StationPart], Field(max_length=MOST_THINGS)] = []
    walls: Annotated[list[WallPart], Field(max_length=MOST_THINGS)] = []
    movers: Annotated[list[MoverPart], Field(max_length=MOST_THINGS)] = []
    people: Annotated[list[PersonPart], Field(max_length=MOST_THINGS)] = []
    sources: Annotated[list[SourcePart], Field(max_length=MOST_THINGS)] = []
    seconds: Annotated[float, _number(gt=0, description="How long it lasts.")] | None = None
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**32, description="Of all that is drawn by chance.")] = 0


_PARTS: dict[tuple[str, ...], type[BaseModel]] = {
    (): ScenePart,
    ("behavior",): BehaviorPart,
    ("behavior", "preference"): PreferencePart,
    ("roads",): RoadPart,
    ("stations",): StationPart,
    ("walls",): WallPart,
    ("movers",): MoverPart,
    ("people",): PersonPart,
    ("people", "behavior"): BehaviorPart,
    ("people", "behavior", "preference"): PreferencePart,
    ("sources",): SourcePart,
    ("sources", "routes"): RoutePart,
    ("sources", "preference"): PreferenceShares,
    ("sources", "preference", "side"): SideShares,
    ("sources", "preference", "distance"): DistanceShares,
    ("sources", "preference", "patience"): PatienceShares,
    ("sources", "velocity"): VelocitySpread,
    ("sources", "weight"): WeightSpread,
    ("sources", "style"): StyleSpread,
    ("sources", "height"): HeightSpread,
    ("sources", "body_radius"): RadiusSpread,
    ("sources", "heading"): HeadingSpread,
}


def known_keys(place: Place, lines: dict[Place, int]) -> list[str]:
    """Keys that may stand at a place of a scene file."""
    keys = tuple(key for key in place if isinstance(key, str))
    if keys == ("obstacles",):
        return list((PolygonPart if (*place, "points") in lines else CirclePart).model_fields)
    return list(_PARTS[keys].model_fields)


def place_of(location: tuple[int | str, ...]) -> Place:
    """Where pydantic found something, without the tags of unions."""
    return tuple(key for key in location if key not in _TAGS)
