"""Database mode: what a database knows, and its clips, played beside what was recorded."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from stridecast.database.clips import Clips, find_clips, followers
from stridecast.database.mining import Mined, mine
from stridecast.database.playing import Performance, perform, recorded
from stridecast.errors import InputError
from stridecast.live.frames import Figures, encode, pack_rotations
from stridecast.live.layout import CLIPS
from stridecast.live.messages import (
    ClipMessage,
    ClipReady,
    MineMessage,
    MixPart,
    Part,
    PlaybackMessage,
    PlayerState,
)
from stridecast.live.pacing import Credit
from stridecast.live.scene_play import no_figures
from stridecast.model.database import MotionDatabase
from stridecast.model.motion import Motion
from stridecast.model.segment import STAND

Array = np.ndarray

LONG = 4.0
"""A cycle is repeated until it lasts so long, seconds."""

BESIDE = 1.2
"""The recorded figure goes so far to the left of the played one, metres."""

TOLD = 0.25
"""How the player stands is told so often, seconds."""


class Browsing:
    """What a session looks at in its database.

    Parameters
    ----------
    database
        The database.
    tell
        Called with messages for the client.
    """

    def __init__(self, database: MotionDatabase, tell: Callable[[Part], None]) -> None:
        self.database, self._tell = database, tell
        self.rate = database.frame_rate
        self.playing, self.pace = False, 1.0
        self.motion: Motion | None = None
        self.frames = 0
        self._film: list[Figures] = []
        self._place = 0
        self._credit = Credit()
        self._since_told = 0.0
        self._stale = True

    @cached_property
    def _clips(self) -> list[Clips]:
        return find_clips(self.database)

    @cached_property
    def _followers(self) -> dict[int, int]:
        return followers(self.database)

    # what the client says

    def show(self, message: ClipMessage) -> ClipReady:
        """Play the clip that an example belongs to.

        Raises
        ------
        InputError
            There is no such example.
        """
        count = len(self.database.examples.durations)
        if message.example >= count:
            raise InputError(f"there is no segment {message.example}; the database has {count}, counted from 0")
        found = self._clip_of(message.example)
        if found is None:
            return self._show_recorded(message)
        clips, k = found
        weights = np.eye(len(clips))[k]
        still = clips.status == STAND
        speed, turn, style = (float(clips.values[name][k]) for name in ("speed", "turn", "style"))
        speed, turn = (0.0, 0.0) if still else (speed, turn)
        played = perform(self.database, clips, weights, speed=speed, turn=turn)
        times = self._times(played.seconds * (math.ceil(LONG / played.seconds) if played.repeats else 1))
        self.motion = played.motion(times, self.rate, clips.status, str(clips.values["subject"][k]))
        self._play(self._posed(played, times), times, message.example)
        row = clips.values
        mix = MixPart(
            weight=1.0,
            take=str(row["take"][k]),
            subject=str(row["subject"][k]),
            status=clips.status,
            first_frame=int(self.database.examples.first_frames[clips.rows[k]].min()),
            seconds=float(row["seconds"][k]),
            mirrored=bool(row["mirrored"][k]),
            speed=float(row["speed"][k]),
            turn=float(row["turn"][k]),
            style=style,
        )
        return ClipReady(
            request=message.request,
            status=clips.status,
            speed=speed,
            turn=turn,
            style=style,
            seconds=float(times[-1]),
            repeats=played.repeats,
            recorded=True,
            beside=True,
            mix=[mix],
            warnings=[],
        )

    def _show_recorded(self, message: ClipMessage) -> ClipReady:
        """Play an example that belongs to no clip, as it was recorded."""
        told, example = self.database.annotations, message.example
        taped = recorded(self.database, self._chain(example, 0.0))
        times = self._times(taped.seconds)
        self.motion = taped.motion(times, self.rate, "segment", "")
        self._play(self._posed(taped, times), times, None)
        return ClipReady(
            request=message.request,
            status=next(g.motion for g in self.database.groups if g.first <= example < g.first + g.count),
            speed=float(told.speed[example]),
            turn=float(told.turn[example]),
            style=float(told.style[example]),
            seconds=taped.seconds,
            repeats=False,
            recorded=True,
            beside=False,
            mix=[],
            warnings=["this segment is part of no clip; it is shown as recorded"],
        )

    def mine(self, message: MineMessage) -> ClipReady:
        """Play what is asked for.

        Raises
        ------
        InputError
            See ``database.mining.mine``.
        """
        asked = {name: getattr(message, name) for name in ("status", "speed", "turn", "style", "where", "subject")}
        mined = mine(self.database, **asked)
        if mined.cycle:
            mined = mine(self.database, **asked, cycles=math.ceil(LONG / mined.cycle))
        self.motion = mined.motion
        times = np.arange(mined.motion.frames) / mined.motion.frame_rate
        self._play(_mined_figures(mined, times), times, self._example_of(mined))
        return ClipReady(
            request=message.request,
            status=mined.status,
            speed=mined.speed,
            turn=mined.turn,
            style=mined.style,
            seconds=mined.motion.seconds,
            repeats=mined.cycle > 0,
            recorded=mined.recorded,
            beside=True,
            mix=[MixPart(**asdict(clip)) for clip in mined.clips],
            warnings=list(mined.warnings),
        )

    def control(self, message: PlaybackMessage) -> None:
        """Play, pause, step, begin anew.

        Raises
        ------
        InputError
            No clip has been chosen.
        """
        if not self._film:
            raise InputError("choose a segment, or mine for one, before it is played")
        self.playing = message.action == "play" or (message.action == "restart" and self.playing)
        if message.action == "restart":
            self._place = 0
        elif message.action == "step":
            self._place = (self._place + 1) % len(self._film)
        self._stale = True
        self.tell_player()

    def scrub(self, time: float) -> None:
        """Pause, and show what is at a time.

        Raises
        ------
        InputError
            No clip has been chosen.
        """
        if not self._film:
            raise InputError("choose a segment, or mine for one, before it is played")
        self.playing, self._stale = False, True
        self._place = min(round(time * self.rate), len(self._film) - 1)
        self.tell_player()

    # playing

    def step(self, seconds: float) -> bytes | None:
        """One frame of the client's time, which lasts so many seconds; what is to be shown, if it is anything new."""
        if self.playing and self._film:
            steps = self._credit.take(self.pace)
            self._place = (self._place + steps) % len(self._film)
            self._stale |= steps > 0
            self._since_told += seconds
            if self._since_told >= TOLD:
                self._since_told = 0.0
                self.tell_player()
        if not self._stale:
            return None
        self._stale = False
        self.frames += 1
        figures = self._film[self._place] if self._film else no_figures(self.database.skeleton.joints)
        return encode(CLIPS, self.frames, self._place / self.rate, figures)

    def show_again(self) -> None:
        """Show the frame that is on, and say how the player stands."""
        self._stale = True
        self.tell_player()

    def tell_player(self) -> None:
        """Say how the player stands."""
        last = max(0, len(self._film) - 1) / self.rate
        self._tell(
            PlayerState(
                mode="database",
                playing=self.playing,
                done=False,
                pace=self.pace,
                time=self._place / self.rate,
                first=0.0,
                last=last,
                there=len(self._film[0].ids) if self._film else 0,
            )
        )

    def _play(self, played: list[Figures], times: Float[Array, "frames"], example: int | None) -> None:
        """Play figures, and what was recorded from an example on beside them."""
        if example is not None:
            taped = recorded(self.database, self._chain(example, float(times[-1])))
            beside = self._posed(taped, np.minimum(times, taped.seconds), 2, BESIDE)
            played = [_together(one, other) for one, other in zip(played, beside, strict=True)]
        self._film, self._place, self.playing, self._stale = played, 0, True, True

    def _times(self, seconds: float) -> Float[Array, "frames"]:
        return np.arange(int(seconds * self.rate + 1e-6) + 1) / self.rate

    def _clip_of(self, example: int) -> tuple[Clips, int] | None:
        for clips in self._clips:
            rows = np.flatnonzero((clips.rows == example).any(axis=1))
            if len(rows):
                return clips, int(rows[0])
        return None

    def _example_of(self, mined: Mined) -> int | None:
        """The first example of the clip that weighs most."""
        best, examples = mined.clips[0], self.database.examples
        names = np.array([take.name for take in self.database.takes])
        same = (names[examples.takes] == best.take) & (examples.mirrored == best.mirrored)
        rows = np.flatnonzero(same & (examples.first_frames == best.first_frame))
        return int(rows[0]) if len(rows) else None

    def _chain(self, example: int, seconds: float) -> list[int]:
        """An example, and those that follow it in its take until they last so long."""
        rows, lasts = [example], float(self.database.examples.durations[example])
        while lasts < seconds and rows[-1] in self._followers:
            rows.append(self._followers[rows[-1]])
            lasts += float(self.database.examples.durations[rows[-1]])
        return rows

    def _posed(
        self, played: Performance, times: Float[Array, "frames"], number: int = 1, aside: float = 0.0
    ) -> list[Figures]:
        roots, rotations = played.pose(times)
        positions, headings = played.vehicle(times)
        return _figures(roots, rotations, positions, headings, played.planted(times), self.rate, number, aside)


def _mined_figures(mined: Mined, times: Float[Array, "frames"]) -> list[Figures]:
    motion = mined.motion
    places = motion.root_positions[:, [0, 2]]
    rate = motion.frame_rate
    return _figures(motion.root_positions, motion.rotations, places, mined.turn * times, mined.planted, rate, 1, 0.0)


def _figures(
    roots: Float[Array, "frames 3"],
    rotations: Float[Array, "frames joints 4"],
    positions: Float[Array, "frames 2"],
    headings: Float[Array, "frames"],
    planted: Bool[Array, "frames 2"],
    rate: float,
    number: int,
    aside: float,
) -> list[Figures]:
    """A figure alone in each frame."""
    packed = pack_rotations(rotations)
    steps = np.hypot(*np.diff(positions, axis=0).T) * rate if len(positions) > 1 else np.zeros(0)
    speeds = np.concatenate((steps, steps[-1:])) if len(steps) else np.zeros(len(positions))
    feet = (planted[:, 0] + 2 * planted[:, 1]).astype(np.uint8)
    return [
        Figures(
            ids=np.array([number]),
            places=np.array([[positions[k, 0] + aside, positions[k, 1], headings[k]]]),
            speeds=speeds[k : k + 1],
            rules=np.array([0]),
            roots=roots[k : k + 1] + np.array([aside, 0.0, 0.0]),
            rotations=packed[k : k + 1],
            planted=feet[k : k + 1],
        )
        for k in range(len(roots))
    ]


def _together(one: Figures, other: Figures) -> Figures:
    names = ("ids", "places", "speeds", "rules", "roots", "rotations", "planted")
    return Figures(**{name: np.concatenate((getattr(one, name), getattr(other, name))) for name in names})
