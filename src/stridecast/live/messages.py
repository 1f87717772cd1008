"""What client and server say to each other in text frames: one JSON object each, told apart by ``type``.

The one source of the protocol: the server checks by it, ``python -m stridecast.live.typescript`` makes the page's types
of it, and docs/protocol.md explains it.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, TypeAdapter, WithJsonSchema

PROTOCOL = "stridecast.1"
"""Subprotocol of the websocket."""

LARGEST_MESSAGE = 4 * 2**20
"""Bytes of a message from the client; a larger one closes the connection (code 1009)."""

FARTHEST = 10_000.0
"""Nothing lies further from the origin, metres."""

MOST_POINTS = 5_000
"""Of a curve."""

LONGEST_TEXT = 2 * 2**20
"""Characters of a scene as YAML."""

PACES = (0.25, 8.0)
"""Slowest and fastest pace of a scene's clock."""


class Part(BaseModel):
    """Checked to the last key; numbers are finite."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        json_schema_serialization_defaults_required=True,
    )


Coordinate = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
Point = tuple[Coordinate, Coordinate]
Vector3 = tuple[float, float, float]
Turn = tuple[float, float, float, float]
Stamp = Annotated[float, Field(ge=-1e15, le=1e15)]
Request = Annotated[int, Field(ge=0, lt=2**31)]
Name = Annotated[str, Field(min_length=1, max_length=200)]
Motion = Literal["stand", "walk", "run"]
Size = Literal["calm", "neutral", "lively", "exaggerated"]
Mode = Literal["walk", "scene", "database"]
SceneDocument = Annotated[dict[str, JsonValue], WithJsonSchema({"type": "object", "tsType": "ScenePart"})]
"""A scene as its YAML file says it; ``ScenePart`` in ``formats.scene_parts``."""


# from the client


class PointWish(Part):
    """Follow a ground point."""

    kind: Literal["point"]
    point: Point


class ForceWish(Part):
    """A force on a unit mass, m/s2: in the world ``(x, z)``, or in the walker's own frame ``(ahead, left)``."""

    kind: Literal["force"]
    force: tuple[Annotated[float, Field(ge=-100, le=100)], Annotated[float, Field(ge=-100, le=100)]]
    frame: Literal["world", "own"] = "own"


class DriveWish(Part):
    """Go in a direction of the world ``(x, z)`` at the speed of the settings times its length; (0, 0) stops."""

    kind: Literal["drive"]
    direction: tuple[Annotated[float, Field(ge=-1, le=1)], Annotated[float, Field(ge=-1, le=1)]]


class CurveWish(Part):
    """Follow a point that runs along a drawn line at the speed of the settings."""

    kind: Literal["curve"]
    points: Annotated[list[Point], Field(min_length=2, max_length=MOST_POINTS)]


class PathWish(Part):
    """Keep to a drawn line, with the speed planned ahead, and stop at its end."""

    kind: Literal["path"]
    points: Annotated[list[Point], Field(min_length=2, max_length=MOST_POINTS)]


class RestWish(Part):
    """Come to stand."""

    kind: Literal["rest"]


class WishMessage(Part):
    """Walk mode: what is wished from now on. ``at`` comes back as ``echo`` in the first frame that has used it."""

    type: Literal["wish"]
    wish: Annotated[PointWish | ForceWish | DriveWish | CurveWish | PathWish | RestWish, Field(discriminator="kind")]
    at: Stamp = 0.0


class SettingsMessage(Part):
    """Walk mode: what changes of the settings; what is left out stays. Answered by ``settings_state``."""

    type: Literal["settings"]
    motion: Motion | None = None
    speed: Annotated[float, Field(ge=0.1, le=12, description="Wished speed, and never faster, m/s.")] | None = None
    turn: (
        Annotated[float, Field(ge=0.05, le=1, description="Of the turning that was learned, so much may be used.")]
        | None
    ) = None
    style: Annotated[float, Field(ge=-1, le=1, description="From gloomy to brisk.")] | None = None
    size: Size | None = None
    half_life: Annotated[float, Field(ge=0.05, le=3, description="Spring to the point, seconds.")] | None = None
    damping_ratio: Annotated[float, Field(ge=0.2, le=4)] | None = None
    at: Stamp = 0.0


class PlaceMessage(Part):
    """Walk mode: begin anew, standing at a place (m, rad)."""

    type: Literal["place"]
    position: Point = (0.0, 0.0)
    heading: Annotated[float, Field(ge=-1e3, le=1e3)] = 0.0


class ModeMessage(Part):
    """What the frames are to show; the others wait."""

    type: Literal["mode"]
    mode: Mode


class ViewMessage(Part):
    """Scene mode: where the client looks. The ``full`` people nearest to ``center`` within ``radius`` come as poses."""

    type: Literal["view"]
    center: Point
    radius: Annotated[float, Field(gt=0, le=FARTHEST)] = 60.0
    full: Annotated[int, Field(ge=0, le=1000)] = 100


class SceneMessage(Part):
    """Scene mode: the scene is now this one. Answered by ``scene_checked``.

    What differs from the scene that plays decides what happens: roads, obstacles and walls change while people walk,
    anything else begins anew.
    """

    type: Literal["scene"]
    scene: SceneDocument
    request: Request = 0


class OpenSceneMessage(Part):
    """A scene as YAML; answered by ``scene_opened``."""

    type: Literal["open_scene"]
    text: Annotated[str, Field(max_length=LONGEST_TEXT)]
    request: Request = 0


class SaveSceneMessage(Part):
    """A scene to be written as YAML; answered by ``scene_saved``."""

    type: Literal["save_scene"]
    scene: SceneDocument
    request: Request = 0


class PlaybackMessage(Part):
    """Scene and database mode: ``play``, ``pause``, ``step`` (one frame), ``restart``."""

    type: Literal["playback"]
    action: Literal["play", "pause", "step", "restart"]


class PaceMessage(Part):
    """Scene and database mode: how fast the clock runs, 1 is real time."""

    type: Literal["pace"]
    factor: Annotated[float, Field(ge=PACES[0], le=PACES[1])]


class ScrubMessage(Part):
    """Scene and database mode: pause and show what was at this time, seconds."""

    type: Literal["scrub"]
    time: Annotated[float, Field(ge=0, le=1e7)]


class ExplainMessage(Part):
    """Scene mode: tell about this person, a few times a second, until another or nobody is named."""

    type: Literal["explain"]
    person: Annotated[int, Field(ge=1, lt=2**32)] | None


class DatabaseMessage(Part):
    """Ask for everything about the database; answered by ``database``."""

    type: Literal["database"]
    request: Request = 0


class ClipMessage(Part):
    """Database mode: play the clip that an example belongs to, as it is blended, beside the recorded segment."""

    type: Literal["clip"]
    example: Annotated[int, Field(ge=0, lt=2**31)]
    request: Request = 0


class MineMessage(Part):
    """Database mode: ask for motion by what it is, as ``stridecast mine`` does; answered by ``clip_ready``."""

    type: Literal["mine"]
    status: Name | None = None
    speed: Annotated[float, Field(ge=0, le=20)] | None = None
    turn: Annotated[float, Field(ge=-20, le=20)] | None = None
    style: Annotated[float, Field(ge=-1, le=1)] | None = None
    where: Name | None = None
    subject: Name | None = None
    request: Request = 0


class BuildMessage(Part):
    """Build a database from the files uploaded in this session; answered by ``progress`` and then ``built``."""

    type: Literal["build"]
    mirror: bool = True
    scale: Annotated[float, Field(gt=0, le=1000, description="Metres in one unit.")] | None = None
    input_rate: Annotated[float, Field(gt=0, le=2000, description="Of files that carry none, Hz.")] | None = None
    request: Request = 0


class CancelMessage(Part):
    """Give up the build that is running; answered by an ``error`` with code ``cancelled``.

    Or the search for ways that is going on, if there is one: answered by ``scene_checked`` with ``cancelled``.
    """

    type: Literal["cancel"]
    what: Literal["build", "ways"] = "build"


class ForgetFilesMessage(Part):
    """Throw away what was uploaded."""

    type: Literal["forget_files"]


class UseMessage(Part):
    """Use the database that was built, or the one that the server began with; answered by a new ``welcome``."""

    type: Literal["use"]
    database: Literal["given", "built"]
    request: Request = 0


class ExportMessage(Part):
    """Make a file of what was played in this mode; answered by ``export_ready``.

    ``bvh`` is a zip of a BVH a person (walk mode: one BVH), ``glb`` the figures in motion, ``csv`` everybody's ways
    (walk mode: the trace), ``database`` what was built.
    """

    type: Literal["export"]
    what: Literal["bvh", "glb", "csv", "database"]
    request: Request = 0


class PingMessage(Part):
    """Answered by ``pong`` at once."""

    type: Literal["ping"]
    at: Stamp


FromClient = Annotated[
    WishMessage
    | SettingsMessage
    | PlaceMessage
    | ModeMessage
    | ViewMessage
    | SceneMessage
    | OpenSceneMessage
    | SaveSceneMessage
    | PlaybackMessage
    | PaceMessage
    | ScrubMessage
    | ExplainMessage
    | DatabaseMessage
    | ClipMessage
    | MineMessage
    | BuildMessage
    | CancelMessage
    | ForgetFilesMessage
    | UseMessage
    | ExportMessage
    | PingMessage,
    Field(discriminator="type"),
]
"""Whatever a client may say."""


# from the server


class BoundsPart(Part):
    """Bounds of a group: jerk (m/s3), tangential acceleration (m/s2), turning (1/s) and speed (m/s).

    Pairs are least and greatest; of pairs of pairs the first is at the first frame of a segment, the second at the
    last.
    """

    jerk: float
    tangential: tuple[tuple[float, float], tuple[float, float]]
    lateral_per_speed: float
    speed: tuple[tuple[float, float], tuple[float, float]]
    assumed: list[str]


class GroupPart(Part):
    """A group of segments: a node of the transition graph. Frames name it by its place in the list."""

    name: str
    motion: str
    string: str
    start: str
    stop: str
    count: int
    bounds: BoundsPart


class SkeletonPart(Part):
    """Joints, parents before children, in the rest pose: +Y up, facing +Z, left at +X, metres."""

    names: list[str]
    parents: list[int]
    offsets: list[Vector3]
    roles: dict[str, int]
    end_joints: list[int]
    end_offsets: list[Vector3]
    height: float


class CharacterPart(Part):
    """The file of the character in whose body everybody is (``GET /character.glb``), and how to pose it.

    With its rotation ``q`` in a frame, joint ``j`` turns node ``nodes[j]`` of the file (-1: it has none) to
    ``before[j] q after[j]``, all ``w x y z``. With its place ``p`` there, the root's node has the translation
    ``turn^-1 (p / size - corner) / grown``, and the whole scene of the file the scale ``size``; for a person of another
    size multiply ``size`` by theirs. Other nodes stay as they are.
    """

    nodes: list[int]
    before: list[Turn]
    after: list[Turn]
    corner: Vector3
    turn: Turn
    grown: float
    size: float


class DatabasePart(Part):
    """What is known of the database in use. ``graph``: pairs of groups of which the second can follow the first."""

    name: str
    built: bool
    frame_rate: float
    motions: list[Motion]
    groups: list[GroupPart]
    graph: list[tuple[int, int]]
    subjects: list[str]
    takes: int
    examples: int
    styles: tuple[float, float]
    top_speeds: dict[str, float]


class LimitsPart(Part):
    """What the server takes."""

    message_bytes: int
    messages_per_second: int
    file_bytes: int
    files: int
    files_bytes: int
    file_kinds: list[str]
    timeline_bytes: int


class SettingsState(Part):
    """Settings of walk mode as they are."""

    type: Literal["settings_state"] = "settings_state"
    motion: Motion
    speed: float
    turn: float
    style: float
    size: Size
    half_life: float
    damping_ratio: float


class Welcome(Part):
    """The first message, and the answer to ``use``: all that is steady. ``session`` goes with uploads."""

    type: Literal["welcome"] = "welcome"
    protocol: str
    version: str
    session: str
    database: DatabasePart
    skeleton: SkeletonPart
    character: CharacterPart | None
    settings: SettingsState
    rules: list[str]
    bounds: list[str]
    scene: SceneDocument
    limits: LimitsPart


class Footprint(Part):
    """Walk mode: a foot came down, at this place of its ankle and turned so (m, rad)."""

    type: Literal["footprint"] = "footprint"
    side: Literal["left", "right"]
    time: float
    position: Point
    heading: float


class WayState(Part):
    """Walk mode: the line that is walked, as it is followed; no points when it ends or is given up."""

    type: Literal["way"] = "way"
    kind: Literal["curve", "path"]
    points: list[Point]
    length: float
    arrived: bool


class Health(Part):
    """How the server fares, about once a second: ``step_ms`` is the mean time of a step and its frame.

    ``late`` frames were left out as the machine was too slow, ``dropped`` as the client was.
    """

    type: Literal["health"] = "health"
    mode: Mode
    step_ms: float
    worst_ms: float
    late: int
    dropped: int
    sessions: int


class SceneChecked(Part):
    """Answer to ``scene``. ``applied``: ``live`` (people go on), ``restarted``, ``kept`` (nothing that plays changed).

    ``refused``: ``message`` says what is wrong and ``place`` where, such as ``people[2].behavior.velocity``; what plays
    is as it was, as after ``cancelled``. ``empty``: right so far, but nobody is there to play it. Where something that
    played was ``restarted``, ``message`` says why. ``anew`` names those who have left their places and come once more,
    at their start, while the others go on.
    """

    type: Literal["scene_checked"] = "scene_checked"
    request: int
    applied: Literal["live", "restarted", "kept", "empty", "refused", "cancelled"]
    message: str = ""
    place: str = ""
    anew: list[str] = []


class SceneOpened(Part):
    """Answer to ``open_scene``; everything has a name. It is not played until it comes back as ``scene``."""

    type: Literal["scene_opened"] = "scene_opened"
    request: int
    scene: SceneDocument


class SceneSaved(Part):
    """Answer to ``save_scene``: the YAML."""

    type: Literal["scene_saved"] = "scene_saved"
    request: int
    text: str


class PlayerState(Part):
    """Scene and database mode: the player, a few times a second while it plays and whenever it changes.

    ``first`` to ``last`` is what can be scrubbed, seconds. The counts are of people: have come, are there, have
    arrived, wait outside for room, found no way.
    """

    type: Literal["player"] = "player"
    mode: Mode
    playing: bool
    done: bool
    pace: float
    time: float
    first: float
    last: float
    came: int = 0
    there: int = 0
    arrived: int = 0
    waiting: int = 0
    turned_away: int = 0


class Somebody(Part):
    """Somebody of the crowd: height as a part of the skeleton's, and radius of the disc (m)."""

    id: int
    name: str
    scale: float
    radius: float
    status: Literal["walk", "run"]
    velocity: float
    style: float


class PeopleMessage(Part):
    """Scene mode: who is who, of those of whom nothing was said yet. ``begins``: forget all earlier ones."""

    type: Literal["people"] = "people"
    begins: bool
    people: list[Somebody]
    movers: list[float]


class ExplanationMessage(Part):
    """Scene mode: what somebody is up to. ``gone`` when they have left.

    ``window`` is where they would be if they braked from now on (what they have reserved), ``path`` the way that is
    left, ``target`` the velocity they aim at (m/s), ``contact_in`` seconds or nothing where they would not meet.
    """

    type: Literal["explanation"] = "explanation"
    person: int
    name: str
    gone: bool
    rule: str = ""
    why: str = ""
    other: str | None = None
    other_id: int | None = None
    contact_in: float | None = None
    side: str = ""
    held: bool = False
    path: list[Point] = []
    window: list[Point] = []
    target: Point = (0.0, 0.0)


class ExampleColumns(Part):
    """The segments, a column a quantity. ``take`` and ``group`` are places in the lists of takes and groups."""

    group: list[int]
    take: list[int]
    first_frame: list[int]
    mirrored: list[bool]
    seconds: list[float]
    speed: list[float]
    start_speed: list[float]
    end_speed: list[float]
    turn: list[float]
    cadence: list[float]
    spread: list[float]
    stoop: list[float]
    style: list[float]
    clip: list[bool]


class TakePart(Part):
    """A take, used or not; ``left_out`` says why, or what of it was left out."""

    name: str
    subject: str
    seconds: float
    covered: float
    segments: int
    left_out: list[str]
    notes: list[str]
    statuses: list[str]


class DatabaseState(Part):
    """Answer to ``database``: all segments and all takes. ``clip``: whether the segment is part of a clip."""

    type: Literal["database_state"] = "database_state"
    request: int
    name: str
    examples: ExampleColumns
    takes: list[TakePart]


class MixPart(Part):
    """A clip that a mined motion is made of."""

    weight: float
    take: str
    subject: str
    status: str
    first_frame: int
    seconds: float
    mirrored: bool
    speed: float
    turn: float
    style: float


class ClipReady(Part):
    """Answer to ``clip`` and ``mine``: figure 1 is shown as played, and figure 2 as recorded if ``beside``."""

    type: Literal["clip_ready"] = "clip_ready"
    request: int
    status: str
    speed: float
    turn: float
    style: float
    seconds: float
    repeats: bool
    recorded: bool
    beside: bool
    mix: list[MixPart]
    warnings: list[str]


class FilesState(Part):
    """What has been uploaded in this session."""

    type: Literal["files"] = "files"
    files: list[str]
    bytes: int


class Progress(Part):
    """How far something long is: ``read``, ``analyse``, ``assemble`` of a build, ``compile``, ``ways``, ``export``."""

    type: Literal["progress"] = "progress"
    stage: Literal["read", "analyse", "assemble", "compile", "ways", "cast", "export"]
    done: int
    total: int


class Built(Part):
    """A database has been built; ``use`` makes it the session's."""

    type: Literal["built"] = "built"
    request: int
    takes: int
    left_out: int
    examples: int
    seconds: float
    motions: list[str]


class ExportReady(Part):
    """A file is ready at ``url`` (``/download/...``), to be saved as ``name``."""

    type: Literal["export_ready"] = "export_ready"
    request: int
    url: str
    name: str
    bytes: int


class Pong(Part):
    """Answer to ``ping``."""

    type: Literal["pong"] = "pong"
    at: float


class ErrorMessage(Part):
    """Something went wrong and nothing has changed; ``message`` says what and what would be right.

    ``code``: ``message`` (no JSON, or none of the messages), ``wish``, ``scene``, ``database``, ``build``,
    ``cancelled``, ``export``, ``rate`` (too many messages; some were left out), ``busy``, ``internal``.
    """

    type: Literal["error"] = "error"
    code: Literal["message", "wish", "scene", "database", "build", "cancelled", "export", "rate", "busy", "internal"]
    message: str
    place: str = ""
    request: int = 0


FromServer = Annotated[
    Welcome
    | SettingsState
    | Footprint
    | WayState
    | Health
    | SceneChecked
    | SceneOpened
    | SceneSaved
    | PlayerState
    | PeopleMessage
    | ExplanationMessage
    | DatabaseState
    | ClipReady
    | FilesState
    | Progress
    | Built
    | ExportReady
    | Pong
    | ErrorMessage,
    Field(discriminator="type"),
]
"""Whatever the server may say."""

READER: TypeAdapter[Any] = TypeAdapter(FromClient)
"""Reads what a client says: ``READER.validate_json(text)``."""

SERVER_READER: TypeAdapter[Any] = TypeAdapter(FromServer)
"""Reads what the server says, for clients in Python."""
