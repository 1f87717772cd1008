// Made by `python -m stridecast.live.typescript` from src/stridecast/live/messages.py and layout.py; do not edit.

export const PROTOCOL = "stridecast.1" as const;
export const PACES = [0.25, 8.0] as const;
export const WALK = 1 as const;
export const SCENE = 2 as const;
export const CLIPS = 3 as const;
export const REPLAYED = 1 as const;
export const ALIGNMENT = 4 as const;
export const LEVELS = 16383 as const;
export const HEADER_BYTES = 32 as const;
export const HEADER = {"kind": ["u1", 0], "flags": ["u1", 1], "count": ["u2", 2], "frame": ["u4", 4], "time": ["f8", 8], "echo": ["f8", 16], "full": ["u2", 24], "joints": ["u2", 26], "movers": ["u2", 28], "reserved": ["u2", 30]} as const;
export const ARRAYS = [{"name": "ids", "kind": "u4", "rows": "count", "width": 1, "joints": false}, {"name": "places", "kind": "f4", "rows": "count", "width": 3, "joints": false}, {"name": "speeds", "kind": "f4", "rows": "count", "width": 1, "joints": false}, {"name": "rules", "kind": "u1", "rows": "count", "width": 1, "joints": false}, {"name": "roots", "kind": "f4", "rows": "full", "width": 3, "joints": false}, {"name": "rotations", "kind": "u2", "rows": "full", "width": 3, "joints": true}, {"name": "planted", "kind": "u1", "rows": "full", "width": 1, "joints": false}, {"name": "movers", "kind": "f4", "rows": "movers", "width": 2, "joints": false}] as const;
export const WALK_ARRAYS = [{"name": "steering", "kind": "f4", "rows": "1", "width": 16, "joints": false}, {"name": "playing", "kind": "u4", "rows": "1", "width": 4, "joints": false}] as const;
export const STEERING = ["input_x", "input_z", "velocity_x", "velocity_z", "acceleration_x", "acceleration_z", "tangential", "lateral", "jerk", "most_jerk", "least_tangential", "most_tangential", "most_lateral", "least_speed", "most_speed", "generic"] as const;
export const PLAYING = ["clamped", "group", "segment", "made_up"] as const;
export const CLAMPED = ["jerk", "tangential", "lateral", "speed"] as const;

/** How somebody goes. */
export interface BehaviorPart {
  /** Wished speed, m/s. */
  velocity?: number;
  /** Kilograms. */
  weight?: number;
  status?: "walk" | "run";
  /** How large movements are. */
  size?: "calm" | "neutral" | "lively" | "exaggerated";
  /** From gloomy (-1) to brisk (1). */
  style?: number;
  preference?: PreferencePart;
  /** Half the width kept free, metres. */
  body_radius?: number;
}

/** A round obstacle. */
export interface CirclePart {
  name?: string | null;
  /** Ground point (x, z), metres; +x is to the left of +z. */
  center: [number, number];
  radius: number;
}

/** How many keep near, and how many far. */
export interface DistanceShares {
  near?: number;
  far?: number;
}

/** Normally distributed headings, cut off at both ends, radians. */
export interface HeadingSpread {
  /** Where somebody looks, radians: 0 towards +z, positive towards +x. */
  mean: number;
  /** Of the normal distribution before it is cut. */
  deviation?: number;
  least?: number | null;
  most?: number | null;
}

/** Normally distributed heights, cut off at both ends, metres. */
export interface HeightSpread {
  /** Of the body, metres. */
  mean: number;
  /** Of the normal distribution before it is cut. */
  deviation?: number;
  least?: number | null;
  most?: number | null;
}

/** A round obstacle that moves straight from point to point. */
export interface MoverPart {
  name?: string | null;
  radius: number;
  /** When it is at each point, seconds, rising. */
  times: number[];
  points: [number, number][];
}

/** How many rather wait, and how many go. */
export interface PatienceShares {
  wait?: number;
  go?: number;
}

/** Somebody with a way of their own, or several who are in an area at once. */
export interface PersonPart {
  name?: string | null;
  /** A point, a line between two points, or the corners of a polygon. */
  start: [number, number] | [number, number][];
  count?: number | null;
  /** Reached in this order; without any they stand at the start. */
  goals?: ([number, number] | [number, number][])[];
  behavior?: BehaviorPart;
  heading?: number | null;
  begins?: number;
  height?: number | null;
  together?: string | null;
  /** Stands at the last goal instead of leaving. */
  stays?: boolean;
  /** At the beginning, m/s. */
  speed?: number;
}

/** An obstacle with corners; its outline goes round once, without crossing itself. */
export interface PolygonPart {
  name?: string | null;
  points: [number, number][];
}

/** What somebody does where there is a choice. */
export interface PreferencePart {
  side?: "none" | "left" | "right";
  distance?: "near" | "far";
  patience?: "wait" | "go";
}

/** What people do where there is a choice: a word for all, or shares. */
export interface PreferenceShares {
  side?: "none" | "left" | "right" | SideShares;
  distance?: "near" | "far" | DistanceShares;
  patience?: "wait" | "go" | PatienceShares;
}

/** Normally distributed radii of bodies, cut off at both ends, metres. */
export interface RadiusSpread {
  /** Half the width kept free, metres. */
  mean: number;
  /** Of the normal distribution before it is cut. */
  deviation?: number;
  least?: number | null;
  most?: number | null;
}

/** A strip on which one may go; its ends are round. */
export interface RoadPart {
  name?: string | null;
  points: [number, number][];
  /** From edge to edge, metres. */
  width: number;
}

/** A way that some of a source's people take. */
export interface RoutePart {
  /** Reached in this order. */
  goals: ([number, number] | [number, number][])[];
  share?: number;
  /** They stand at the last goal instead of leaving. */
  stays?: boolean;
}

/** How many prefer which side. */
export interface SideShares {
  none?: number;
  left?: number;
  right?: number;
}

/** Where people come from: some at once, others one after the other. */
export interface SourcePart {
  name?: string | null;
  /** Where they appear: a point, a line or a polygon. */
  start: [number, number] | [number, number][];
  /** Where all of them go; instead of routes. */
  goals?: ([number, number] | [number, number][])[];
  /** They stand at the last of the goals. */
  stays?: boolean;
  routes?: RoutePart[];
  /** Arrivals a second, people: a Poisson process. */
  flow?: number;
  /** So many are there when it begins. */
  at_once?: number;
  begins?: number;
  ends?: number | null;
  most?: number | null;
  velocity?: number | VelocitySpread;
  weight?: number | WeightSpread;
  style?: number | StyleSpread;
  height?: number | HeightSpread | null;
  body_radius?: number | RadiusSpread;
  status?: "walk" | "run";
  size?: "calm" | "neutral" | "lively" | "exaggerated";
  preference?: PreferenceShares;
  /** Shares of groups of 1, 2, 3 and 4. */
  together?: number[];
  /** Whether those who go somewhere appear at their speed. */
  moving?: boolean;
  heading?: number | HeadingSpread | null;
}

/** Where somebody begins to go differently: at the place nearest to a point, or after so many metres. */
export interface StationPart {
  near?: [number, number] | null;
  distance?: number | null;
  velocity?: number | null;
  status?: "walk" | "run" | null;
  size?: "calm" | "neutral" | "lively" | "exaggerated" | null;
  style?: number | null;
}

/** Normally distributed styles, cut off at both ends. */
export interface StyleSpread {
  /** From gloomy (-1) to brisk (1). */
  mean: number;
  /** Of the normal distribution before it is cut. */
  deviation?: number;
  least?: number | null;
  most?: number | null;
}

/** Normally distributed speeds, cut off at both ends, m/s. */
export interface VelocitySpread {
  /** Wished speed, m/s. */
  mean: number;
  /** Of the normal distribution before it is cut. */
  deviation?: number;
  least?: number | null;
  most?: number | null;
}

/** A thin line that nobody crosses. */
export interface WallPart {
  name?: string | null;
  points: [number, number][];
}

/** Normally distributed weights, cut off at both ends, kilograms. */
export interface WeightSpread {
  /** Kilograms. */
  mean: number;
  /** Of the normal distribution before it is cut. */
  deviation?: number;
  least?: number | null;
  most?: number | null;
}

/** A place and a task: lengths are metres, ground points (x, z). */
export interface ScenePart {
  version?: 1;
  start?: [number, number] | null;
  goals?: [number, number][] | null;
  /** None: anywhere. */
  roads?: RoadPart[];
  obstacles?: (CirclePart | PolygonPart)[];
  behavior?: BehaviorPart;
  stations?: StationPart[];
  walls?: WallPart[];
  movers?: MoverPart[];
  people?: PersonPart[];
  sources?: SourcePart[];
  seconds?: number | null;
  /** Of all that is drawn by chance. */
  seed?: number;
}

/** Build a database from the files uploaded in this session; answered by ``progress`` and then ``built``. */
export interface BuildMessage {
  type: "build";
  mirror?: boolean;
  scale?: number | null;
  input_rate?: number | null;
  request?: number;
}

/**
 * Give up the build that is running; answered by an ``error`` with code ``cancelled``.
 *
 * Or the search for ways that is going on, if there is one: answered by ``scene_checked`` with ``cancelled``.
 */
export interface CancelMessage {
  type: "cancel";
  what?: "build" | "ways";
}

/** Database mode: play the clip that an example belongs to, as it is blended, beside the recorded segment. */
export interface ClipMessage {
  type: "clip";
  example: number;
  request?: number;
}

/** Follow a point that runs along a drawn line at the speed of the settings. */
export interface CurveWish {
  kind: "curve";
  points: [number, number][];
}

/** Ask for everything about the database; answered by ``database``. */
export interface DatabaseMessage {
  type: "database";
  request?: number;
}

/** Go in a direction of the world ``(x, z)`` at the speed of the settings times its length; (0, 0) stops. */
export interface DriveWish {
  kind: "drive";
  direction: [number, number];
}

/** Scene mode: tell about this person, a few times a second, until another or nobody is named. */
export interface ExplainMessage {
  type: "explain";
  person: number | null;
}

/**
 * Make a file of what was played in this mode; answered by ``export_ready``.
 *
 * ``bvh`` is a zip of a BVH a person (walk mode: one BVH), ``glb`` the figures in motion, ``csv`` everybody's ways
 * (walk mode: the trace), ``database`` what was built.
 */
export interface ExportMessage {
  type: "export";
  what: "bvh" | "glb" | "csv" | "database";
  request?: number;
}

/** A force on a unit mass, m/s2: in the world ``(x, z)``, or in the walker's own frame ``(ahead, left)``. */
export interface ForceWish {
  kind: "force";
  force: [number, number];
  frame?: "world" | "own";
}

/** Throw away what was uploaded. */
export interface ForgetFilesMessage {
  type: "forget_files";
}

/** Database mode: ask for motion by what it is, as ``stridecast mine`` does; answered by ``clip_ready``. */
export interface MineMessage {
  type: "mine";
  status?: string | null;
  speed?: number | null;
  turn?: number | null;
  style?: number | null;
  where?: string | null;
  subject?: string | null;
  request?: number;
}

/** What the frames are to show; the others wait. */
export interface ModeMessage {
  type: "mode";
  mode: "walk" | "scene" | "database";
}

/** A scene as YAML; answered by ``scene_opened``. */
export interface OpenSceneMessage {
  type: "open_scene";
  text: string;
  request?: number;
}

/** Scene and database mode: how fast the clock runs, 1 is real time. */
export interface PaceMessage {
  type: "pace";
  factor: number;
}

/** Keep to a drawn line, with the speed planned ahead, and stop at its end. */
export interface PathWish {
  kind: "path";
  points: [number, number][];
}

/** Answered by ``pong`` at once. */
export interface PingMessage {
  type: "ping";
  at: number;
}

/** Walk mode: begin anew, standing at a place (m, rad). */
export interface PlaceMessage {
  type: "place";
  position?: [number, number];
  heading?: number;
}

/** Scene and database mode: ``play``, ``pause``, ``step`` (one frame), ``restart``. */
export interface PlaybackMessage {
  type: "playback";
  action: "play" | "pause" | "step" | "restart";
}

/** Follow a ground point. */
export interface PointWish {
  kind: "point";
  point: [number, number];
}

/** Come to stand. */
export interface RestWish {
  kind: "rest";
}

/** A scene to be written as YAML; answered by ``scene_saved``. */
export interface SaveSceneMessage {
  type: "save_scene";
  scene: ScenePart;
  request?: number;
}

/**
 * Scene mode: the scene is now this one. Answered by ``scene_checked``.
 *
 * What differs from the scene that plays decides what happens: roads, obstacles and walls change while people walk,
 * anything else begins anew.
 */
export interface SceneMessage {
  type: "scene";
  scene: ScenePart;
  request?: number;
}

/** Scene and database mode: pause and show what was at this time, seconds. */
export interface ScrubMessage {
  type: "scrub";
  time: number;
}

/** Walk mode: what changes of the settings; what is left out stays. Answered by ``settings_state``. */
export interface SettingsMessage {
  type: "settings";
  motion?: "stand" | "walk" | "run" | null;
  speed?: number | null;
  turn?: number | null;
  style?: number | null;
  size?: "calm" | "neutral" | "lively" | "exaggerated" | null;
  half_life?: number | null;
  damping_ratio?: number | null;
  at?: number;
}

/** Use the database that was built, or the one that the server began with; answered by a new ``welcome``. */
export interface UseMessage {
  type: "use";
  database: "given" | "built";
  request?: number;
}

/** Scene mode: where the client looks. The ``full`` people nearest to ``center`` within ``radius`` come as poses. */
export interface ViewMessage {
  type: "view";
  center: [number, number];
  radius?: number;
  full?: number;
}

/** Walk mode: what is wished from now on. ``at`` comes back as ``echo`` in the first frame that has used it. */
export interface WishMessage {
  type: "wish";
  wish: PointWish | ForceWish | DriveWish | CurveWish | PathWish | RestWish;
  at?: number;
}

export type FromClient = WishMessage | SettingsMessage | PlaceMessage | ModeMessage | ViewMessage | SceneMessage | OpenSceneMessage | SaveSceneMessage | PlaybackMessage | PaceMessage | ScrubMessage | ExplainMessage | DatabaseMessage | ClipMessage | MineMessage | BuildMessage | CancelMessage | ForgetFilesMessage | UseMessage | ExportMessage | PingMessage;

/**
 * Bounds of a group: jerk (m/s3), tangential acceleration (m/s2), turning (1/s) and speed (m/s).
 *
 * Pairs are least and greatest; of pairs of pairs the first is at the first frame of a segment, the second at the
 * last.
 */
export interface BoundsPart {
  jerk: number;
  tangential: [[number, number], [number, number]];
  lateral_per_speed: number;
  speed: [[number, number], [number, number]];
  assumed: string[];
}

/** A database has been built; ``use`` makes it the session's. */
export interface Built {
  type: "built";
  request: number;
  takes: number;
  left_out: number;
  examples: number;
  seconds: number;
  motions: string[];
}

/**
 * The file of the character in whose body everybody is (``GET /character.glb``), and how to pose it.
 *
 * With its rotation ``q`` in a frame, joint ``j`` turns node ``nodes[j]`` of the file (-1: it has none) to
 * ``before[j] q after[j]``, all ``w x y z``. With its place ``p`` there, the root's node has the translation
 * ``turn^-1 (p / size - corner) / grown``, and the whole scene of the file the scale ``size``; for a person of another
 * size multiply ``size`` by theirs. Other nodes stay as they are.
 */
export interface CharacterPart {
  nodes: number[];
  before: [number, number, number, number][];
  after: [number, number, number, number][];
  corner: [number, number, number];
  turn: [number, number, number, number];
  grown: number;
  size: number;
}

/** Answer to ``clip`` and ``mine``: figure 1 is shown as played, and figure 2 as recorded if ``beside``. */
export interface ClipReady {
  type: "clip_ready";
  request: number;
  status: string;
  speed: number;
  turn: number;
  style: number;
  seconds: number;
  repeats: boolean;
  recorded: boolean;
  beside: boolean;
  mix: MixPart[];
  warnings: string[];
}

/** What is known of the database in use. ``graph``: pairs of groups of which the second can follow the first. */
export interface DatabasePart {
  name: string;
  built: boolean;
  frame_rate: number;
  motions: ("stand" | "walk" | "run")[];
  groups: GroupPart[];
  graph: [number, number][];
  subjects: string[];
  takes: number;
  examples: number;
  styles: [number, number];
  top_speeds: Record<string, number>;
}

/** Answer to ``database``: all segments and all takes. ``clip``: whether the segment is part of a clip. */
export interface DatabaseState {
  type: "database_state";
  request: number;
  name: string;
  examples: ExampleColumns;
  takes: TakePart[];
}

/**
 * Something went wrong and nothing has changed; ``message`` says what and what would be right.
 *
 * ``code``: ``message`` (no JSON, or none of the messages), ``wish``, ``scene``, ``database``, ``build``,
 * ``cancelled``, ``export``, ``rate`` (too many messages; some were left out), ``busy``, ``internal``.
 */
export interface ErrorMessage {
  type: "error";
  code: "message" | "wish" | "scene" | "database" | "build" | "cancelled" | "export" | "rate" | "busy" | "internal";
  message: string;
  place: string;
  request: number;
}

/** The segments, a column a quantity. ``take`` and ``group`` are places in the lists of takes and groups. */
export interface ExampleColumns {
  group: number[];
  take: number[];
  first_frame: number[];
  mirrored: boolean[];
  seconds: number[];
  speed: number[];
  start_speed: number[];
  end_speed: number[];
  turn: number[];
  cadence: number[];
  spread: number[];
  stoop: number[];
  style: number[];
  clip: boolean[];
}

/**
 * Scene mode: what somebody is up to. ``gone`` when they have left.
 *
 * ``window`` is where they would be if they braked from now on (what they have reserved), ``path`` the way that is
 * left, ``target`` the velocity they aim at (m/s), ``contact_in`` seconds or nothing where they would not meet.
 */
export interface ExplanationMessage {
  type: "explanation";
  person: number;
  name: string;
  gone: boolean;
  rule: string;
  why: string;
  other: string | null;
  other_id: number | null;
  contact_in: number | null;
  side: string;
  held: boolean;
  path: [number, number][];
  window: [number, number][];
  target: [number, number];
}

/** A file is ready at ``url`` (``/download/...``), to be saved as ``name``. */
export interface ExportReady {
  type: "export_ready";
  request: number;
  url: string;
  name: string;
  bytes: number;
}

/** What has been uploaded in this session. */
export interface FilesState {
  type: "files";
  files: string[];
  bytes: number;
}

/** Walk mode: a foot came down, at this place of its ankle and turned so (m, rad). */
export interface Footprint {
  type: "footprint";
  side: "left" | "right";
  time: number;
  position: [number, number];
  heading: number;
}

/** A group of segments: a node of the transition graph. Frames name it by its place in the list. */
export interface GroupPart {
  name: string;
  motion: string;
  string: string;
  start: string;
  stop: string;
  count: number;
  bounds: BoundsPart;
}

/**
 * How the server fares, about once a second: ``step_ms`` is the mean time of a step and its frame.
 *
 * ``late`` frames were left out as the machine was too slow, ``dropped`` as the client was.
 */
export interface Health {
  type: "health";
  mode: "walk" | "scene" | "database";
  step_ms: number;
  worst_ms: number;
  late: number;
  dropped: number;
  sessions: number;
}

/** What the server takes. */
export interface LimitsPart {
  message_bytes: number;
  messages_per_second: number;
  file_bytes: number;
  files: number;
  files_bytes: number;
  file_kinds: string[];
  timeline_bytes: number;
}

/** A clip that a mined motion is made of. */
export interface MixPart {
  weight: number;
  take: string;
  subject: string;
  status: string;
  first_frame: number;
  seconds: number;
  mirrored: boolean;
  speed: number;
  turn: number;
  style: number;
}

/** Scene mode: who is who, of those of whom nothing was said yet. ``begins``: forget all earlier ones. */
export interface PeopleMessage {
  type: "people";
  begins: boolean;
  people: Somebody[];
  movers: number[];
}

/**
 * Scene and database mode: the player, a few times a second while it plays and whenever it changes.
 *
 * ``first`` to ``last`` is what can be scrubbed, seconds. The counts are of people: have come, are there, have
 * arrived, wait outside for room, found no way.
 */
export interface PlayerState {
  type: "player";
  mode: "walk" | "scene" | "database";
  playing: boolean;
  done: boolean;
  pace: number;
  time: number;
  first: number;
  last: number;
  came: number;
  there: number;
  arrived: number;
  waiting: number;
  turned_away: number;
}

/** Answer to ``ping``. */
export interface Pong {
  type: "pong";
  at: number;
}

/** How far something long is: ``read``, ``analyse``, ``assemble`` of a build, ``compile``, ``ways``, ``export``. */
export interface Progress {
  type: "progress";
  stage: "read" | "analyse" | "assemble" | "compile" | "ways" | "cast" | "export";
  done: number;
  total: number;
}

/**
 * Answer to ``scene``. ``applied``: ``live`` (people go on), ``restarted``, ``kept`` (nothing that plays changed).
 *
 * ``refused``: ``message`` says what is wrong and ``place`` where, such as ``people[2].behavior.velocity``; what plays
 * is as it was, as after ``cancelled``. ``empty``: right so far, but nobody is there to play it. Where something that
 * played was ``restarted``, ``message`` says why. ``anew`` names those who have left their places and come once more,
 * at their start, while the others go on.
 */
export interface SceneChecked {
  type: "scene_checked";
  request: number;
  applied: "live" | "restarted" | "kept" | "empty" | "refused" | "cancelled";
  message: string;
  place: string;
  anew: string[];
}

/** Answer to ``open_scene``; everything has a name. It is not played until it comes back as ``scene``. */
export interface SceneOpened {
  type: "scene_opened";
  request: number;
  scene: ScenePart;
}

/** Answer to ``save_scene``: the YAML. */
export interface SceneSaved {
  type: "scene_saved";
  request: number;
  text: string;
}

/** Settings of walk mode as they are. */
export interface SettingsState {
  type: "settings_state";
  motion: "stand" | "walk" | "run";
  speed: number;
  turn: number;
  style: number;
  size: "calm" | "neutral" | "lively" | "exaggerated";
  half_life: number;
  damping_ratio: number;
}

/** Joints, parents before children, in the rest pose: +Y up, facing +Z, left at +X, metres. */
export interface SkeletonPart {
  names: string[];
  parents: number[];
  offsets: [number, number, number][];
  roles: Record<string, number>;
  end_joints: number[];
  end_offsets: [number, number, number][];
  height: number;
}

/** Somebody of the crowd: height as a part of the skeleton's, and radius of the disc (m). */
export interface Somebody {
  id: number;
  name: string;
  scale: number;
  radius: number;
  status: "walk" | "run";
  velocity: number;
  style: number;
}

/** A take, used or not; ``left_out`` says why, or what of it was left out. */
export interface TakePart {
  name: string;
  subject: string;
  seconds: number;
  covered: number;
  segments: number;
  left_out: string[];
  notes: string[];
  statuses: string[];
}

/** Walk mode: the line that is walked, as it is followed; no points when it ends or is given up. */
export interface WayState {
  type: "way";
  kind: "curve" | "path";
  points: [number, number][];
  length: number;
  arrived: boolean;
}

/** The first message, and the answer to ``use``: all that is steady. ``session`` goes with uploads. */
export interface Welcome {
  type: "welcome";
  protocol: string;
  version: string;
  session: string;
  database: DatabasePart;
  skeleton: SkeletonPart;
  character: CharacterPart | null;
  settings: SettingsState;
  rules: string[];
  bounds: string[];
  scene: ScenePart;
  limits: LimitsPart;
}

export type FromServer = Welcome | SettingsState | Footprint | WayState | Health | SceneChecked | SceneOpened | SceneSaved | PlayerState | PeopleMessage | ExplanationMessage | DatabaseState | ClipReady | FilesState | Progress | Built | ExportReady | Pong | ErrorMessage;
