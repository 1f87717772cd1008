"""Walk mode: one walker under somebody's hand, frame by frame."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from stridecast.body import kinematics
from stridecast.errors import InputError, WishError
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.live.frames import Figures, encode, pack_rotations
from stridecast.live.layout import CLAMPED, WALK
from stridecast.live.messages import (
    CurveWish,
    DriveWish,
    Footprint,
    ForceWish,
    Part,
    PathWish,
    PlaceMessage,
    PointWish,
    SettingsMessage,
    SettingsState,
    WayState,
    WishMessage,
)
from stridecast.live.ways import Run, way_of
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import Pose
from stridecast.model.scene import Behavior
from stridecast.model.segment import RUN, STAND
from stridecast.model.segment import WALK as WALKING
from stridecast.paths.curve import Curve
from stridecast.paths.follow import Guide
from stridecast.paths.plan import plan_speeds
from stridecast.steering.force import SteeringGains
from stridecast.synthesis.journey import Journey, journey_of
from stridecast.synthesis.walker import Walker

Array = np.ndarray

SPEEDS = {STAND: 1.3, WALKING: 1.5, RUN: 3.2}
"""Wished speed to begin with, m/s."""

LEAST_DRIVE = 0.4
"""Who is driven at all goes at least so fast, m/s; nobody starts to walk more slowly."""

AT_REST, OFF = 0.05, 2.2
"""Who is slower than this (m/s) stands, and sets off for a point that is so far away (metres) in any case."""

HELD = 0.05
"""A stick that is bent less is at rest."""

BRAKING = 0.3
"""Beyond the wished speed a force is taken back within this time, seconds."""

KEPT = 300.0
"""So much of the walk can be saved, seconds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Asked:
    """What the walker is asked for in one frame: one of the three, and the point that is shown."""

    motion: str
    point: Float[Array, "2"] | None = None
    force: Float[Array, "2"] | None = None
    acceleration: Float[Array, "2"] | None = None
    rests_in: float = np.inf
    shown: Float[Array, "2"] | None = None


class Walking:
    """A walker, what is wished of it, and what it did.

    Parameters
    ----------
    database
        What it has learned.
    tell
        Called with messages for the client.
    """

    def __init__(self, database: MotionDatabase, tell: Callable[[Part], None]) -> None:
        self.database, self._tell = database, tell
        motion = WALKING if WALKING in database.motions else database.motions[-1]
        self.settings = SettingsState(
            motion=motion,  # type: ignore[arg-type]  # the motion types are these words
            speed=SPEEDS[motion],
            turn=1.0,
            style=0.0,
            size="neutral",
            half_life=SteeringGains().half_life,
            damping_ratio=SteeringGains().damping_ratio,
        )
        self._groups = {group.name: number for number, group in enumerate(database.groups)}
        self._feet = database.skeleton.chain("left_foot", "right_foot")
        self.rate = database.frame_rate
        self.frames = 0
        self.echo = 0.0
        self._begin(np.zeros(2), 0.0)

    def _begin(self, position: Array, heading: float) -> None:
        self.walker = Walker(self.database, position, heading)
        self._use_settings()
        self._wish: object = None
        self._way: Run | Guide | None = None
        self._position, self._velocity, self._heading = position.astype(np.float64), np.zeros(2), heading
        self._acceleration, self._planted = np.zeros(2), np.ones(2, np.bool_)
        length = int(KEPT * self.rate)
        self._poses: deque[Pose] = deque(maxlen=length)
        self._inputs: deque[Array] = deque(maxlen=length)

    def _use_settings(self) -> None:
        wanted = self.settings
        self.walker.gains = SteeringGains(half_life=wanted.half_life, damping_ratio=wanted.damping_ratio)
        self.walker.limit_turning(wanted.turn)

    @property
    def time(self) -> float:
        """Seconds that have been walked."""
        return self.frames / self.rate

    @property
    def pose(self) -> Pose:
        """The newest pose."""
        return self._poses[-1]

    def take(self, message: WishMessage | SettingsMessage | PlaceMessage) -> None:
        """Take over what the client wishes.

        Raises
        ------
        InputError
            A motion that is not in the database, a line that nobody can walk. Nothing has changed then.
        """
        if isinstance(message, WishMessage):
            self._take_wish(message)
        elif isinstance(message, SettingsMessage):
            self._take_settings(message)
        else:
            self._give_up_way()
            self._begin(np.array(message.position), float(ground.wrap(np.array(message.heading))))

    def _take_settings(self, message: SettingsMessage) -> None:
        if message.motion is not None and message.motion not in self.walker.motions:
            there = ", ".join(self.walker.motions)
            raise WishError(f"there is no motion {message.motion!r} in this database; there are {there}")
        new = message.model_dump(exclude={"type", "at"}, exclude_none=True)
        self.settings = self.settings.model_copy(update=new)
        self._use_settings()
        self.echo = message.at or self.echo
        self._tell(self.settings)

    def _take_wish(self, message: WishMessage) -> None:
        wish = message.wish
        way: Run | Guide | None = None
        if isinstance(wish, CurveWish):
            way = Run(way_of(self._position, self._heading, wish.points))
        elif isinstance(wish, PathWish):
            way = self._guide(way_of(self._position, self._heading, wish.points))
        self._give_up_way()
        self._wish, self._way = wish, way
        self.echo = message.at or self.echo
        if way is not None:
            self._tell_way(arrived=False)

    def _guide(self, way: Float[Array, "points 2"]) -> Guide:
        wanted = self.settings
        curve = Curve.through(way)
        behavior = Behavior(
            velocity=max(wanted.speed, 0.1),
            status=RUN if wanted.motion == RUN else WALKING,
            size=wanted.size,
            style=wanted.style,
        )
        return Guide(curve, plan_speeds(curve, self.database, behavior))

    def _give_up_way(self) -> None:
        if self._way is not None:
            self._tell(WayState(kind=self._kind_of_way(), points=[], length=0.0, arrived=False))
            self._way = None

    def _kind_of_way(self) -> Literal["curve", "path"]:
        return "curve" if isinstance(self._way, Run) else "path"

    def _tell_way(self, *, arrived: bool) -> None:
        way = self._way
        assert way is not None
        points, length = (way.points, way.length) if isinstance(way, Run) else (way.curve.points, way.curve.length)
        thinned = points[:: max(1, len(points) // 500)] if len(points) > 1000 else points
        shown = [] if arrived else [(float(x), float(z)) for x, z in np.concatenate((thinned, points[-1:]))]
        self._tell(WayState(kind=self._kind_of_way(), points=shown, length=length, arrived=arrived))

    @property
    def _speed(self) -> float:
        return float(np.hypot(*self._velocity))

    def step(self) -> bytes:
        """Walk on by one frame; the frame as bytes."""
        asked = self._asked()
        pose = self.walker.step(
            asked.point,
            force=asked.force,
            acceleration=asked.acceleration,
            rests_in=asked.rests_in,
            motion=asked.motion,
            size=self.settings.size,
            style=self.settings.style,
        )
        self.frames += 1
        self._poses.append(pose)
        self._inputs.append(pose.vehicle.position if asked.shown is None else asked.shown)
        data = self._frame(pose, asked.shown)
        self._see(pose)
        return data

    def _asked(self) -> _Asked:
        """What the wish means where the walker is now."""
        wish, here, motion = self._wish, self._position, self.settings.motion
        if isinstance(wish, PointWish):
            point = np.array(wish.point)
            return _Asked(point=self._leashed(point), motion=motion, shown=point)
        if isinstance(wish, ForceWish):
            return _Asked(force=self._force(wish), motion=motion)
        if isinstance(wish, DriveWish) and np.hypot(*wish.direction) >= HELD:
            way = np.array(wish.direction)
            length = float(np.hypot(*way))
            far = max(min(length, 1.0) * self.settings.speed, LEAST_DRIVE) * self.walker.gains.lag
            far = OFF if self._speed < AT_REST else far
            return _Asked(point=here + way / length * far, motion=motion)
        if isinstance(self._way, Run):
            point = self._way.advance(here, self.settings.speed, self.walker.gains.lag, 1.0 / self.rate)
            return _Asked(point=self._leashed(point), motion=motion, shown=point)
        if isinstance(self._way, Guide):
            acceleration, rests_in, planned = self._way.wish(here, self._velocity)
            shown = np.asarray(self._way.curve.at(self._way.place).point)
            return _Asked(acceleration=acceleration, rests_in=rests_in, motion=planned, shown=shown)
        return _Asked(point=here, motion=STAND if STAND in self.walker.motions else motion)

    def _leashed(self, point: Float[Array, "2"]) -> Float[Array, "2"]:
        """A point in the same direction that asks for no more than the wished speed."""
        away = point - self._position
        far, most = float(np.hypot(*away)), self.settings.speed * self.walker.gains.lag
        return point if far <= most or self._speed < AT_REST else self._position + away * (most / far)

    def _force(self, wish: ForceWish) -> Float[Array, "2"]:
        """A force in the world that does not ask for more than the wished speed."""
        ahead = ground.direction(np.array(self._heading))
        left = ground.left_of(ahead)
        force = np.array(wish.force)
        if wish.frame == "own":
            force = force[0] * ahead + force[1] * left
        along = float(force @ ahead)
        return force + (min(along, (self.settings.speed - self._speed) / BRAKING) - along) * ahead

    def _frame(self, pose: Pose, shown: Float[Array, "2"] | None) -> bytes:
        v, b = pose.vehicle, pose.bounds
        ahead = ground.direction(np.array(self._heading))
        jerk = float(np.hypot(*(v.acceleration - self._acceleration))) * self.rate
        playing = self.walker.playing
        steering = (
            *((np.nan, np.nan) if shown is None else shown),
            *v.velocity,
            *v.acceleration,
            v.acceleration @ ahead,
            v.acceleration @ ground.left_of(ahead),
            jerk,
            b.jerk,
            *b.tangential,
            b.lateral,
            *b.speed,
            playing.generic[0],
        )
        bits = sum(1 << k for k, name in enumerate(CLAMPED) if name in pose.clamped)
        numbers = (bits, playing.group[0], playing.segments[0], self.walker.made_up)
        figures = Figures(
            ids=np.array([1]),
            places=np.array([[*v.position, float(v.heading)]]),
            speeds=np.array([np.hypot(*v.velocity)]),
            rules=np.array([0]),
            roots=pose.root_position[None],
            rotations=pack_rotations(pose.rotations[None]),
            planted=np.array([pose.planted[0] + 2 * pose.planted[1]], np.uint8),
        )
        extra = {"steering": np.array([steering], np.float64), "playing": np.array([numbers], np.int64)}
        return encode(WALK, self.frames, self.time, figures, echo=self.echo, extra=extra)

    def _see(self, pose: Pose) -> None:
        """Take note of where the walker is, which foot came down, and whether it has arrived."""
        v = pose.vehicle
        self._position, self._velocity, self._acceleration = v.position, v.velocity, v.acceleration
        self._heading = float(v.heading)
        came = pose.planted & ~self._planted
        self._planted = pose.planted
        if came.any():
            world = kinematics.forward(self.database.skeleton, pose.root_position, pose.rotations)
            for side in np.flatnonzero(came).tolist():
                ahead = quat.rotate(world.rotations[self._feet[side]], np.array([0.0, 0.0, 1.0]))
                x, _, z = world.positions[self._feet[side]].tolist()
                heading = float(np.arctan2(ahead[0], ahead[2]))
                self._tell(
                    Footprint(side="right" if side else "left", time=self.time, position=(x, z), heading=heading)
                )
        if self._way is None:
            return
        done = self._way.see(pose)
        if done:
            self._tell_way(arrived=True)
            self._way, self._wish = None, None

    def journey(self) -> Journey:
        """What was walked, the last ``KEPT`` seconds of it.

        Raises
        ------
        InputError
            Nothing yet.
        """
        if len(self._poses) < 2:
            raise InputError("nothing has been walked yet; walk first, then save it")
        poses, count = list(self._poses), len(self._poses)
        times = np.arange(count) / self.rate
        return journey_of(self.walker, times, np.array(self._inputs), poses)
