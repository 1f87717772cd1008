"""Scene mode: a crowd in a scene that somebody draws, played, scrubbed and explained."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Int

from stridecast.crowd.crowd import Crowd
from stridecast.crowd.frame import CrowdFrame
from stridecast.crowd.rules import RULES
from stridecast.errors import InputError
from stridecast.live.frames import Figures, encode, pack_rotations
from stridecast.live.layout import REPLAYED, SCENE
from stridecast.live.limits import MOST_LIVE
from stridecast.live.messages import (
    ExplanationMessage,
    Part,
    PeopleMessage,
    PlaybackMessage,
    PlayerState,
    SceneChecked,
    SceneMessage,
    Somebody,
    ViewMessage,
)
from stridecast.live.pacing import Credit
from stridecast.live.searching import GivenUp, Search
from stridecast.live.staging import place_in, read_scene, why_anew
from stridecast.live.timeline import Timeline
from stridecast.model.database import MotionDatabase
from stridecast.model.scene import Scene

Array = np.ndarray

TOLD = 0.25
"""How the player stands, and what somebody is up to, is told so often, seconds of the client's time."""

LOD = (25.0, 60.0)
"""Bodies further from the view than these are stepped less often, metres."""

MOST_STEPS = 12
"""Of a clock that runs faster, in one frame."""


class ScenePlay:
    """The scene of a session.

    Parameters
    ----------
    database
        Whose motion people show.
    tell
        Called with messages for the client.
    room
        Bytes of the timeline.
    threads
        Threads that share the people.
    gone
        Whether the client has left.
    """

    def __init__(
        self,
        database: MotionDatabase,
        tell: Callable[[Part], None],
        *,
        room: int,
        threads: int = 1,
        gone: Callable[[], bool] = lambda: False,
    ) -> None:
        self.database, self._tell = database, tell
        self.search = Search(tell, gone)
        self.rate, self.threads, self._room = database.frame_rate, threads, room
        self.document: Mapping[str, Any] = {"version": 1}
        self.crowd: Crowd | None = None
        self.timeline = Timeline(room)
        self.playing, self.pace = False, 1.0
        self.view = ViewMessage(type="view", center=(0.0, 0.0))
        self.asked: int | None = None
        self.frames = 0
        self._credit = Credit()
        self._cursor: float | None = None
        self._known = 0
        self._since_told = 0.0
        self._stale = True

    # what the client says

    def check(self, message: SceneMessage) -> SceneChecked:
        """Take over a scene; what became of it."""
        try:
            with self.search:
                return self._apply(message.scene, message.request)
        except GivenUp:
            return _cancelled(message.request)
        except InputError as error:
            place, what = place_in(str(error))
            return SceneChecked(request=message.request, applied="refused", message=what, place=place)

    def _apply(self, document: Mapping[str, Any], request: int) -> SceneChecked:
        scene = read_scene(document)
        if scene is None:
            self.document, self.crowd = document, None
            self._clear()
            return SceneChecked(request=request, applied="empty")
        crowd, why = self.crowd, ""
        if crowd is not None:
            if document == self.document:
                return SceneChecked(request=request, applied="kept")
            if self.playing or len(self.timeline) > 1:
                why = why_anew(self.document, document)
                if not why:
                    return SceneChecked(request=request, applied="live", anew=self._change(crowd, scene, document))
        crowd = self._made(scene)
        self.document = document
        self._begin(crowd)
        return SceneChecked(request=request, applied="restarted", message=why)

    def _change(self, crowd: Crowd, scene: Scene, document: Mapping[str, Any]) -> list[str]:
        """Change the scene while people walk; who begins anew."""
        changes = crowd.change(scene, progress=self.search.tell_ways)
        self.document, self._stale = document, True
        if changes.altered:
            self._tell(PeopleMessage(begins=False, people=_named(crowd, crowd.frame(), changes.altered), movers=[]))
        self.tell_player()
        return list(changes.anew)

    def _begin(self, crowd: Crowd) -> None:
        """Show a new crowd: its first frame, as bodies are only known once they have been stepped."""
        self.crowd = crowd
        self._clear()
        crowd.step(focus=self.view.center)
        self._keep(crowd)

    def _made(self, scene: Scene) -> Crowd:
        self.search.tell_compiling()
        return Crowd(self.database, scene, threads=self.threads, lod=LOD, progress=self.search.tell_ways)

    def _clear(self) -> None:
        self.timeline = Timeline(self._room)
        self._cursor, self._known, self.frames, self._stale = None, 0, 0, True

    def control(self, message: PlaybackMessage) -> None:
        """Play, pause, step, begin anew.

        Raises
        ------
        InputError
            Nobody is there.
        """
        if self.crowd is None:
            raise InputError(
                "nobody is there yet: put people, a source of people, or a start with goals into the scene"
            )
        match message.action:
            case "play":
                self.playing = not self.done
            case "pause":
                self.playing = False
            case "step":
                self.playing = False
                self._advance(self.crowd)
            case "restart":
                self._restart(self.crowd)
        self._stale = True
        self.tell_player()
        self.explain()

    def _restart(self, crowd: Crowd) -> None:
        try:
            with self.search:
                self._begin(self._made(crowd.scene))
        except GivenUp:
            self._tell(_cancelled(0))

    def scrub(self, time: float) -> None:
        """Pause, and show what was at a time.

        Raises
        ------
        InputError
            Nothing has been played.
        """
        if not len(self.timeline):
            raise InputError("nothing has been played yet")
        self.playing, self._stale = False, True
        time = min(max(time, self.timeline.first), self.timeline.last)
        self._cursor = None if time >= self.timeline.last else time
        self.tell_player()
        self.explain()

    def look(self, view: ViewMessage) -> None:
        """Show what is near to another place."""
        self.view, self._stale = view, True

    def ask(self, number: int | None) -> None:
        """Tell about somebody from now on."""
        self.asked = number
        self.explain()

    # playing

    @property
    def done(self) -> bool:
        """Whether everything has been shown, and nobody moves any more."""
        crowd = self.crowd
        if crowd is None or self._cursor is not None:
            return False
        seconds = crowd.scene.seconds
        return crowd.done if seconds is None else crowd.time >= seconds - 0.5 / self.rate

    @property
    def time(self) -> float:
        """What is shown was at this time, seconds."""
        if self._cursor is not None:
            return self._cursor
        return 0.0 if self.crowd is None else self.crowd.time

    def step(self, seconds: float, in_time: Callable[[], bool]) -> bytes | None:
        """One frame of the client's time, which lasts so many seconds; what is to be shown, if it is anything new.

        Steps of a clock that runs faster are left out once there is no time left.
        """
        crowd = self.crowd
        if crowd is None:
            return self._nobody()
        if self.playing:
            for _ in range(min(self._credit.take(self.pace), MOST_STEPS)):
                self._advance(crowd)
                self._stale = True
                if not (self.playing and in_time()):
                    break
        self._since_told += seconds
        if self.playing and self._since_told >= TOLD:
            self._since_told = 0.0
            self.tell_player()
            self.explain()
        return self._shown() if self._stale else None

    def _advance(self, crowd: Crowd) -> None:
        """On by one step: through what was recorded, and then on."""
        if self._cursor is not None:
            self._cursor += 1.0 / self.rate
            if self._cursor >= self.timeline.last - 1e-9:
                self._cursor = None
        elif self.done:
            self.playing = False
            self.tell_player()
            self.explain()
        else:
            crowd.step(focus=self.view.center)
            self._keep(crowd)

    def _keep(self, crowd: Crowd) -> None:
        frame = crowd.frame()
        if len(frame.ids) > MOST_LIVE:
            self.playing = False
            raise InputError(f"{len(frame.ids)} people are there, more than can be shown live; let fewer come")
        self._introduce(crowd, frame)
        self.timeline.add(crowd.time, figures_of(frame))

    def _introduce(self, crowd: Crowd, frame: CrowdFrame) -> None:
        """Say who those are who have come."""
        if self._known and len(crowd.came) == self._known:
            return
        people = _named(crowd, frame, range(self._known + 1, len(crowd.came) + 1))
        movers = [float(mover.radius) for mover in crowd.scene.movers]
        self._tell(PeopleMessage(begins=self._known == 0, people=people, movers=movers))
        self._known = len(crowd.came)

    def _shown(self) -> bytes:
        time, figures = self.now()
        self.frames += 1
        self._stale = False
        rows, full = self._near(figures)
        flags = 0 if self._cursor is None else REPLAYED
        return encode(SCENE, self.frames, time, figures.chosen(rows, full), flags=flags)

    def now(self) -> tuple[float, Figures]:
        """Everybody who is shown, with their poses, and the time on the crowd's clock."""
        return self.timeline.at(self.timeline.last if self._cursor is None else self._cursor)

    def _near(self, figures: Figures) -> tuple[Int[Array, "figures"], int]:
        """Everybody, those first who come with poses, the nearest first; and how many these are."""
        away = np.hypot(*(figures.places[:, :2] - np.array(self.view.center)).T)
        most = min(self.view.full, int((away <= self.view.radius).sum()))
        if not 0 < most < len(away):
            return np.argsort(away, kind="stable") if most else np.arange(len(away)), most
        near = np.argpartition(away, most)[:most]
        near = near[np.argsort(away[near], kind="stable")]
        others = np.ones(len(away), np.bool_)
        others[near] = False
        return np.concatenate((near, np.flatnonzero(others))), most

    def _nobody(self) -> bytes | None:
        if not self._stale:
            return None
        self._stale = False
        self.frames += 1
        return encode(SCENE, self.frames, 0.0, no_figures(self.database.skeleton.joints))

    # telling

    def show_again(self) -> None:
        """Show the frame that is on, and say how the player stands."""
        self._stale = True
        self.tell_player()

    def tell_player(self) -> None:
        """Say how the player stands."""
        crowd = self.crowd
        counts: dict[str, Any] = {}
        if crowd is not None:
            gone = len(crowd.left)
            counts = {
                "came": len(crowd.came),
                "there": len(crowd.came) - gone - len(crowd.removed),
                "arrived": gone + len(crowd.at_last_stop()),
                "waiting": crowd.waiting,
                "turned_away": len(crowd.turned_away),
            }
        self._tell(
            PlayerState(
                mode="scene",
                playing=self.playing,
                done=self.done,
                pace=self.pace,
                time=self.time,
                first=self.timeline.first,
                last=self.timeline.last,
                **counts,
            )
        )

    def explain(self) -> None:
        """Say what the person who was asked about is up to."""
        number, crowd = self.asked, self.crowd
        if number is None or crowd is None:
            return
        if self._cursor is not None:
            self._recall(crowd, number, self._cursor)
            return
        try:
            told, ahead = crowd.explain(number), crowd.outlook(number)
        except InputError:
            name = crowd.person(number).name if number <= len(crowd.came) else ""
            self._tell(ExplanationMessage(person=number, name=name, gone=True))
            self.asked = None
            return
        self._tell(
            ExplanationMessage(
                person=number,
                name=told.person,
                gone=False,
                rule=told.rule,
                why=told.why,
                other=told.other,
                other_id=ahead.other,
                contact_in=told.contact_in if np.isfinite(told.contact_in) else None,
                side=told.side,
                held=told.held,
                path=_points(ahead.way),
                window=_points(ahead.window),
                target=_points(ahead.target[None])[0],
            )
        )

    def _recall(self, crowd: Crowd, number: int, time: float) -> None:
        """Say what somebody was up to at an earlier time; why, nobody remembers."""
        _, figures = self.timeline.at(time)
        rows = np.flatnonzero(figures.ids == number)
        name = crowd.person(number).name if number <= len(crowd.came) else ""
        rule = RULES[int(figures.rules[rows[0]])] if len(rows) else ""
        self._tell(ExplanationMessage(person=number, name=name, gone=not len(rows), rule=rule))


def _named(crowd: Crowd, frame: CrowdFrame, numbers: Sequence[int]) -> list[Somebody]:
    """Who those are of some numbers who are there."""
    rows = {int(number): row for row, number in enumerate(frame.ids)}
    return [
        Somebody(
            id=number,
            name=crowd.person(number).name,
            scale=float(frame.heights[rows[number]]),
            radius=float(frame.radii[rows[number]]),
            status="run" if crowd.person(number).behavior.status == "run" else "walk",
            velocity=crowd.person(number).behavior.velocity,
            style=crowd.person(number).behavior.style,
        )
        for number in numbers
        if number in rows
    ]


def _cancelled(request: int) -> SceneChecked:
    return SceneChecked(request=request, applied="cancelled", message="the search was given up; all is as it was")


def figures_of(frame: CrowdFrame) -> Figures:
    """A frame of a crowd with bodies, in little room."""
    assert frame.roots is not None
    assert frame.rotations is not None
    assert frame.planted is not None
    return Figures(
        ids=frame.ids.astype(np.uint32),
        places=np.concatenate((frame.positions, frame.headings[:, None]), axis=1).astype(np.float32),
        speeds=np.hypot(*frame.velocities.T).astype(np.float32),
        rules=frame.rules.astype(np.uint8),
        roots=frame.roots.astype(np.float32),
        rotations=pack_rotations(frame.rotations),
        planted=(frame.planted[:, 0] + 2 * frame.planted[:, 1]).astype(np.uint8),
        movers=frame.movers.astype(np.float32),
    )


def no_figures(joints: int) -> Figures:
    """Nobody."""
    return Figures(
        ids=np.zeros(0, np.uint32),
        places=np.zeros((0, 3)),
        speeds=np.zeros(0),
        rules=np.zeros(0, np.uint8),
        roots=np.zeros((0, 3)),
        rotations=np.zeros((0, joints, 3), np.uint16),
        planted=np.zeros(0, np.uint8),
    )


def _points(points: Array) -> list[tuple[float, float]]:
    return [(float(x), float(z)) for x, z in np.round(points, 4)]
