"""Walking along a planned curve: the plan's acceleration, and what it takes to keep to the curve, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from stridecast.geometry import ground
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import Pose
from stridecast.model.scene import Behavior, Scene, Station
from stridecast.paths.curve import Curve
from stridecast.paths.generate import generate_path
from stridecast.paths.plan import SpeedPlan, plan_speeds
from stridecast.synthesis.journey import Journey, journey_of
from stridecast.synthesis.styles import Style
from stridecast.synthesis.walker import Walker

Array = np.ndarray

STIFFNESS = 3.0
"""How fast a distance from the curve is made up, 1/s (a critically damped spring)."""

CATCHING_UP = 2.5
"""How fast a difference from the planned speed is made up, 1/s."""

PREVIEW = 0.08
"""Bends are steered into so much earlier, as a force takes time to build up, seconds."""

WINDOW = 1.0
"""The place on the curve is looked for so far around the last one, metres: curves may cross themselves."""

THERE = 0.01
"""Nearer than this the end is reached, metres."""

PAUSE = 1.0
"""Who has arrived stands for this long, seconds."""

PATIENCE = 3.0
"""Who takes this many times as long as planned, and 10 s more, does not arrive."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PathWalk:
    """A walk along a curve.

    Parameters
    ----------
    journey
        Every frame; its ``inputs`` are the places on the curve.
    curve, plan
        What was followed.
    distances
        How far along the curve, metres, frame by frame.
    errors
        How far the vehicle is from the curve, metres, frame by frame.
    arrived
        Whether it came to rest at the end.
    """

    journey: Journey
    curve: Curve
    plan: SpeedPlan
    distances: Float[Array, "frames"]
    errors: Float[Array, "frames"]
    arrived: bool


class Guide:
    """Leads a walker along a curve as planned, frame by frame.

    Parameters
    ----------
    curve, plan
        The way, and how fast to go.
    """

    def __init__(self, curve: Curve, plan: SpeedPlan) -> None:
        self.curve, self.plan = curve, plan
        self.place = 0.0

    @property
    def behavior(self) -> Behavior:
        """How to go here."""
        return self.plan.behavior_at(self.place)

    def wish(self, position: Float[Array, "2"], velocity: Float[Array, "2"]) -> tuple[Float[Array, "2"], float, str]:
        """What to ask a walker for who is here: acceleration, seconds until the end, and the motion."""
        return _wish(self.curve, self.plan, self.place, position, velocity)

    def see(self, pose: Pose) -> bool:
        """Take note of where the walker is now; whether it has come to rest at the end."""
        position, velocity = pose.vehicle.position, pose.vehicle.velocity
        self.place = _place(self.curve, position, self.place)
        slow = float(np.hypot(*velocity)) < 0.02
        return self.curve.length - self.place < 0.25 and slow and pose.motion == "stand"


def walk_scene(
    database: MotionDatabase,
    scene: Scene,
    *,
    subject: str | None = None,
    frame_rate: float | None = None,
    size: str | None = None,
    style: Style | None = None,
    finding: Callable[[float], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> PathWalk:
    """Find a way through a scene, plan it, and walk it (BJL sections 3 and 4).

    Parameters
    ----------
    database, subject, frame_rate, size, style, progress
        See ``walk_along``.
    scene
        The place and the task.
    finding
        Called with how much of finding the way is done, 0 to 1.

    Raises
    ------
    SceneError, PathError, DatabaseError
        See ``generate_path`` and ``plan_speeds``.
    """
    way = generate_path(scene, progress=finding)
    how = {"subject": subject, "frame_rate": frame_rate, "size": size, "style": style}
    return walk_along(database, way.curve, scene.behavior, scene.stations, progress=progress, **how)  # type: ignore[arg-type]


def walk_along(
    database: MotionDatabase,
    curve: Curve,
    behavior: Behavior | None = None,
    stations: Sequence[Station] = (),
    *,
    subject: str | None = None,
    frame_rate: float | None = None,
    size: str | None = None,
    style: Style | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> PathWalk:
    """Let a character walk along a curve as planned, from standing at its beginning to standing at its end.

    Parameters
    ----------
    database, subject, frame_rate
        See ``Walker``.
    curve, behavior, stations
        The way, how to go, and where that changes (see ``plan_speeds``).
    size
        Size of movement instead of the behavior's.
    style
        Style instead of the behavior's (see ``Walkers.step``).
    progress
        Called with frames done and frames in all, about once a second of the walk.

    Raises
    ------
    PathError, DatabaseError
        See ``plan_speeds``.
    """
    plan = plan_speeds(curve, database, behavior, stations)
    walker = Walker(
        database,
        curve.points[0],
        float(curve.headings[0]),
        subject=subject,
        frame_rate=frame_rate,
        size=size or plan.behaviors[0].size,
        style=plan.behaviors[0].style if style is None else style,
    )
    rate = walker.frame_rate
    expected = int((plan.seconds + PAUSE) * rate) + 1
    most = int(PATIENCE * expected + 10 * rate)
    poses: list[Pose] = []
    places: list[float] = []
    guide = Guide(curve, plan)
    velocity, position, resting = np.zeros(2), curve.points[0], 0
    while len(poses) < most and resting < PAUSE * rate:
        acceleration, rests_in, motion = guide.wish(position, velocity)
        here = guide.behavior
        how = {"size": size or here.size, "style": here.style if style is None else style}
        pose = walker.step(acceleration=acceleration, rests_in=rests_in, motion=motion, **how)  # type: ignore[arg-type]
        position, velocity = pose.vehicle.position, pose.vehicle.velocity
        resting = resting + 1 if guide.see(pose) else 0
        poses.append(pose)
        places.append(guide.place)
        if progress is not None and len(poses) % int(rate) == 0:
            progress(min(len(poses), expected), expected)
    if progress is not None:
        progress(expected, expected)
    distances = np.array(places)
    on_curve = curve.at(distances)[0]
    times = np.arange(len(poses)) / rate
    journey = journey_of(walker, times, on_curve, poses, subject=subject)
    nearest = np.linalg.norm(journey.positions - on_curve, axis=-1)
    return PathWalk(
        journey=journey,
        curve=curve,
        plan=plan,
        distances=distances,
        errors=nearest,
        arrived=resting >= PAUSE * rate,
    )


def _place(curve: Curve, position: Float[Array, "2"], last: float) -> float:
    """Distance along the curve of its point nearest to a position, near the last one."""
    low, high = np.searchsorted(curve.distances, (last - 0.3 * WINDOW, last + WINDOW))
    window = slice(max(0, int(low) - 1), int(high) + 1)
    points = curve.points[window]
    nearest = int(np.argmin(np.sum((points - position) ** 2, axis=-1)))
    heading = curve.headings[window][nearest]
    ahead = float((position - points[nearest]) @ ground.direction(np.asarray(heading)))
    return float(np.clip(curve.distances[window][nearest] + ahead, 0.0, curve.length))


def _wish(
    curve: Curve, plan: SpeedPlan, place: float, position: Float[Array, "2"], velocity: Float[Array, "2"]
) -> tuple[Float[Array, "2"], float, str]:
    """Acceleration that keeps to curve and plan, seconds until the end, and the motion to ask for."""
    speed = float(np.hypot(*velocity))
    early = min(place + speed * PREVIEW, curve.length)
    point, heading, _ = (value[0] for value in curve.at(np.array([place])))
    bend = float(curve.at(np.array([early]))[2][0])
    ahead = ground.direction(np.asarray(heading))
    left = ground.left_of(ahead)
    # The plan begins and ends at rest: a look ahead gets it going, and the last centimetre counts as reached.
    planned = float(np.interp(max(place, 0.03) if place < 0.5 * curve.length else place, plan.distances, plan.speeds))
    gathering = float(np.interp(early, plan.distances, plan.accelerations))
    if curve.length - place < THERE:
        planned, gathering = 0.0, 0.0
    beside = float((point - position) @ left)
    drift = float(velocity @ left)
    along = gathering + CATCHING_UP * (planned - float(velocity @ ahead))
    across = planned * speed * bend + STIFFNESS**2 * beside - 2 * STIFFNESS * drift
    rests_in = float(np.interp(place, plan.distances, plan.rests_in))
    motion = plan.motions[int(np.clip(np.searchsorted(plan.distances, place), 0, len(plan.motions) - 1))]
    return along * ahead + across * left, rests_in, motion
