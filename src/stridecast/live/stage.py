"""The thread of a session: takes what the client says, plays the mode that is on, at an even rate."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from stridecast import __version__
from stridecast.crowd.rules import RULES
from stridecast.errors import InputError
from stridecast.formats.recordings import RECORDINGS
from stridecast.formats.scenes import parse_scene, scene_of, scene_text, scene_values
from stridecast.formats.store import load_database, save_database
from stridecast.live import messages as say
from stridecast.live.browsing import Browsing
from stridecast.live.building import Building
from stridecast.live.cast import Costume, cast, meshes_of
from stridecast.live.exporting import write_clip, write_figures, write_motions, write_walk, write_ways
from stridecast.live.hall import Guest, Hall
from stridecast.live.layout import CLAMPED
from stridecast.live.outbox import Outbox
from stridecast.live.pacing import Pacer
from stridecast.live.receivers import LAST_PORT, Receivers
from stridecast.live.scene_play import ScenePlay
from stridecast.live.searching import Gone
from stridecast.live.staging import place_in
from stridecast.live.telling import character_part, database_part, database_state, skeleton_part
from stridecast.live.walking import Walking
from stridecast.model.database import MotionDatabase

log = logging.getLogger("stridecast")

WAITING = 1000
"""So many messages wait at most."""

IDLE = 0.25
"""Messages are looked for at least so often, seconds."""

Code = Literal["message", "wish", "scene", "database", "build", "cancelled", "export", "rate", "busy", "internal"]


@dataclass(frozen=True)
class _BuildEnded:
    """A build has ended, with nothing or with what was wrong."""

    wrong: str | None


class Stage(threading.Thread):
    """Plays for one client.

    Parameters
    ----------
    hall
        What is shared.
    outbox
        What is told and shown goes here.
    word
        By which the hall knows the session.
    """

    def __init__(self, hall: Hall, outbox: Outbox, word: str) -> None:
        super().__init__(name=f"stage {word[:8]}", daemon=True)
        self.hall, self.outbox, self.word = hall, outbox, word
        self.guest: Guest = hall.guests[word]
        self.mode: say.Mode = "walk"
        self._inbox: queue.Queue[object] = queue.Queue(WAITING)
        self._stopped = threading.Event()
        self._times: list[float] = []
        self._building: Building | None = None
        self._build_request = 0
        self._built: MotionDatabase | None = None
        self._exporting = False
        self._receivers: Receivers | None = None

    def put(self, message: object) -> bool:
        """Hand over a message; False where too many wait."""
        if isinstance(message, say.CancelMessage) and message.what == "ways":
            if hasattr(self, "scene"):
                self.scene.search.give_up()  # at once, as the stage is busy with what is to be given up
            return True
        try:
            self._inbox.put_nowait(message)
        except queue.Full:
            return False
        return True

    def stop(self) -> None:
        """End, as soon as what is being done is done."""
        self._stopped.set()
        if self._building is not None:
            self._building.give_up()
        self.put(None)

    def run(self) -> None:
        """Play until stopped."""
        with ExitStack() as stack:
            if self.hall.receiver is not None:
                host, port = self.hall.receiver
                first = min(port + self.guest.seat * self.hall.received, LAST_PORT)
                self._receivers = stack.enter_context(Receivers(host, first, self.hall.received))
            self._run()

    def _run(self) -> None:
        self._guarded("database", lambda: self._use(self.hall.database, self.hall.name, self.hall.costume, built=False))
        if not hasattr(self, "walking"):  # the error has been told; there is nothing to be played with
            return
        told = time.monotonic()
        while not self._stopped.is_set():
            for message in self._come(min(self._pacer.wait(time.monotonic()), IDLE)):
                self._take(message)
            now = time.monotonic()
            due = self._pacer.due(now)
            if due > 1 and self.mode != "walk":  # a crowd that is too slow for the clock goes on more slowly
                self._pacer.late += due - 1
                due = 1
            for _ in range(due):
                self._play()
            if now - told >= 1.0:
                told = now
                self._tell_health()

    def _use(self, database: MotionDatabase, name: str, costume: Costume | None, *, built: bool) -> None:
        """Begin anew with a database; where nobody can walk with it, nothing has changed."""
        tell = self.outbox.tell
        walking = Walking(database, tell)
        self.database, self.name, self.walking, self.costume = database, name, walking, costume
        self.guest.skeleton = database.skeleton
        self.guest.character = meshes_of(costume)
        self.scene = ScenePlay(
            database,
            tell,
            room=self.hall.limits.timeline_bytes,
            threads=self.hall.threads,
            gone=self._stopped.is_set,
        )
        self.browsing = Browsing(database, tell)
        self._pacer = Pacer(database.frame_rate)
        self._pacer.start(time.monotonic())
        tell(
            say.Welcome(
                protocol=say.PROTOCOL,
                version=__version__,
                session=self.word,
                database=database_part(database, name, built),
                skeleton=skeleton_part(database.skeleton),
                character=None if costume is None else character_part(costume),
                settings=self.walking.settings,
                rules=list(RULES),
                bounds=list(CLAMPED),
                scene=dict(self.hall.scene),
                limits=self.hall.limits,
            )
        )

    def _come(self, seconds: float) -> list[object]:
        """Messages that have come, waiting for the first of them for a while."""
        found: list[object] = []
        try:
            found.append(self._inbox.get(timeout=seconds) if seconds > 0 else self._inbox.get_nowait())
            while True:
                found.append(self._inbox.get_nowait())
        except queue.Empty:
            return [message for message in found if message is not None]

    # what the client says

    def _take(self, message: Any) -> None:
        """Do what a message says; what goes wrong is told."""
        code, act = self._meaning(message)
        self._guarded(code, lambda: act(message), getattr(message, "request", 0))

    def _guarded(self, code: Code, act: Callable[[], object], request: int = 0) -> None:
        try:
            act()
        except InputError as error:
            place, what = place_in(str(error)) if code == "scene" else ("", str(error))
            self.outbox.tell(say.ErrorMessage(code=code, message=what, place=place, request=request))
        except Gone:
            self._stopped.set()
        except Exception:
            log.exception("a session met something unexpected and goes on")
            what = "the server met something that it did not expect; its log says more. Please report this"
            self.outbox.tell(say.ErrorMessage(code="internal", message=what, request=request))

    def _meaning(self, message: Any) -> tuple[Code, Callable[[Any], object]]:
        """What a message calls for, and the code of what may go wrong with it."""
        tell = self.outbox.tell
        match message:
            case say.WishMessage() | say.SettingsMessage() | say.PlaceMessage():
                return "wish", self.walking.take
            case say.ModeMessage():
                return "message", self._change_mode
            case say.ViewMessage():
                return "scene", self.scene.look
            case say.SceneMessage():
                return "scene", lambda m: tell(self.scene.check(m))
            case say.OpenSceneMessage():
                return "scene", self._open_scene
            case say.SaveSceneMessage():
                return "scene", self._save_scene
            case say.PlaybackMessage():
                return self._player_code, self._player.control
            case say.PaceMessage():
                return self._player_code, self._change_pace
            case say.ScrubMessage():
                return self._player_code, lambda m: self._player.scrub(m.time)
            case say.ExplainMessage():
                return "scene", lambda m: self.scene.ask(m.person)
            case say.DatabaseMessage():
                return "database", lambda m: tell(database_state(self.database, self.name, m.request))
            case say.ClipMessage():
                return "database", lambda m: self._tell_clip(self.browsing.show(m))
            case say.MineMessage():
                return "database", lambda m: self._tell_clip(self.browsing.mine(m))
            case say.BuildMessage():
                return "build", self._build
            case say.CancelMessage():
                return "build", lambda _: self._cancel()
            case say.ForgetFilesMessage():
                return "build", lambda _: self._forget_files()
            case say.UseMessage():
                return "database", self._change_database
            case say.ExportMessage():
                return "export", self._export
            case _BuildEnded():
                return "build", self._end_build
        raise AssertionError(f"nobody takes {type(message).__name__}")

    @property
    def _player(self) -> ScenePlay | Browsing:
        return self.browsing if self.mode == "database" else self.scene

    @property
    def _player_code(self) -> Code:
        return "database" if self.mode == "database" else "scene"

    def _change_mode(self, message: say.ModeMessage) -> None:
        self.mode = message.mode
        if message.mode != "walk":
            self._player.show_again()

    def _change_pace(self, message: say.PaceMessage) -> None:
        self._player.pace = message.factor
        self._player.tell_player()

    def _open_scene(self, message: say.OpenSceneMessage) -> None:
        values = scene_values(parse_scene(message.text, "scene"))
        self.outbox.tell(say.SceneOpened(request=message.request, scene=values))

    def _save_scene(self, message: say.SaveSceneMessage) -> None:
        self.outbox.tell(say.SceneSaved(request=message.request, text=scene_text(scene_of(message.scene))))

    def _tell_clip(self, ready: say.ClipReady) -> None:
        self.outbox.tell(ready)
        self.browsing.tell_player()

    # builds

    def _build(self, message: say.BuildMessage) -> None:
        if self._building is not None:
            raise InputError("a database is being built already; wait for it, or cancel it")
        uploads = self.guest.uploads
        recordings = [path for path in uploads.paths if path.suffix in RECORDINGS]
        if not recordings:
            known = ", ".join(RECORDINGS.values())
            raise InputError(f"no recording has been uploaded yet; send some first ({known})")
        output = self.guest.folder / "built.safetensors"
        self._build_request = message.request
        self._building = Building(
            uploads.folder,
            recordings,
            output,
            {"mirror": message.mirror, "scale": message.scale, "input_rate": message.input_rate},
            progress=self._tell_progress,
            finished=lambda wrong: self._inbox.put(_BuildEnded(wrong)),
        )

    def _tell_progress(self, stage: Any, done: int, total: int) -> None:
        self.outbox.tell(say.Progress(stage=stage, done=done, total=total))

    def _end_build(self, ended: _BuildEnded) -> None:
        building = self._building
        if building is None:
            return
        self._building = None
        if ended.wrong is not None:
            what = ended.wrong
            self.outbox.tell(say.ErrorMessage(code="build", message=what, request=self._build_request))
            return
        self._built = load_database(building.output)
        takes = self._built.takes
        self.outbox.tell(
            say.Built(
                request=self._build_request,
                takes=sum(1 for take in takes if take.segments),
                left_out=sum(1 for take in takes if not take.segments),
                examples=len(self._built.examples.durations),
                seconds=building.seconds,
                motions=list(self._built.motions),
            )
        )

    def _cancel(self) -> None:
        if self._building is None:
            raise InputError("nothing is being built")
        self._building.give_up()
        self._building = None
        what = "the build was cancelled; the files are still there"
        self.outbox.tell(say.ErrorMessage(code="cancelled", message=what, request=self._build_request))

    def _forget_files(self) -> None:
        if self._building is not None:
            raise InputError("the files are being built from; cancel that first")
        self.guest.uploads.forget()
        self.outbox.tell(say.FilesState(files=[], bytes=0))

    def _change_database(self, message: say.UseMessage) -> None:
        if message.database == "given":
            self._use(self.hall.database, self.hall.name, self.hall.costume, built=False)
        elif self._built is None:
            raise InputError("no database has been built yet; upload recordings and build one")
        else:
            self._use(*self._cast(self._built), built=True)

    def _cast(self, database: MotionDatabase) -> tuple[MotionDatabase, str, Costume | None]:
        """A built database in the body that the server's is in."""
        costume, name = self.hall.costume, "own recordings"
        if costume is None:
            return database, name, None
        progress = lambda done, total: self._tell_progress("cast", done, total)  # noqa: E731
        database, costume = cast(database, costume.file, costume.character.skeleton, progress)
        return database, name, costume

    # files

    def _export(self, message: say.ExportMessage) -> None:
        """Make a file of what was played in the mode that is on, while everything else goes on."""
        if self._exporting:
            raise InputError("another file is being made; wait for it")
        costume = self.costume
        write: Callable[[Path], None]
        if message.what == "database":
            built = self._built
            if built is None:
                raise InputError("no database has been built yet; upload recordings and build one")
            name, write = "own.safetensors", lambda path: save_database(built, path)
        elif self.mode == "walk":
            journey = self.walking.journey()
            name, write = f"walk.{message.what}", lambda path: write_walk(path, journey, message.what, costume)
        elif self.mode == "database":
            name, write = f"clip.{message.what}", self._write_clip(message.what)
        elif message.what == "csv":
            frames = self.scene.timeline.frames()
            name, write = "crowd.csv", lambda path: write_ways(path, frames)
        else:
            name = "crowd.zip" if message.what == "bvh" else "crowd.glb"
            write = self._write_crowd(message.what)
        make = lambda: self._make(name, write, message.request)  # noqa: E731
        self._exporting = True
        threading.Thread(target=lambda: self._guarded("export", make, message.request), daemon=True).start()

    def _make(self, name: str, write: Callable[[Path], None], request: int) -> None:
        """Make a file, in a thread of its own."""
        downloads = self.guest.downloads
        try:
            path = downloads.place(name)
            write(path)
            url = downloads.offer(path, name)
        finally:
            self._exporting = False
        self.outbox.tell(say.ExportReady(request=request, url=url, name=name, bytes=path.stat().st_size))

    def _write_clip(self, what: str) -> Callable[[Path], None]:
        motion = self.browsing.motion
        if motion is None:
            raise InputError("choose a segment, or mine for one, before it is saved")
        if what == "csv":
            raise InputError("a clip is saved as BVH or GLB")
        costume = self.costume
        return lambda path: write_clip(path, motion, costume)

    def _write_crowd(self, what: str) -> Callable[[Path], None]:
        crowd = self.scene.crowd
        if crowd is None:
            raise InputError(
                "nobody is there yet: put people, a source of people, or a start with goals into the scene"
            )
        frames = self.scene.timeline.frames()

        def progress(done: int, total: int) -> None:
            if self._stopped.is_set():
                raise Gone
            if done % max(1, total // 20) == 0:
                self._tell_progress("export", done, total)

        write = write_motions if what == "bvh" else write_figures
        costume = self.costume
        return lambda path: write(path, frames, crowd, costume, progress)

    # playing

    def _play(self) -> None:
        """Make one frame."""
        began = time.perf_counter()
        period = self._pacer.period
        code: Code = "wish" if self.mode == "walk" else self._player_code
        self._guarded(code, lambda: self._show(period, lambda: time.perf_counter() - began < 0.8 * period))
        self._times.append(time.perf_counter() - began)

    def _show(self, period: float, in_time: Callable[[], bool]) -> None:
        if self.mode == "walk":
            frame: bytes | None = self.walking.step()
            if self._receivers is not None:
                self._receivers.play_walker(self.database.skeleton, self.walking.pose, self.walking.time)
        elif self.mode == "scene":
            frame = self.scene.step(period, in_time)
            crowd = self.scene.crowd
            if self._receivers is not None and crowd is not None and frame is not None:
                time_now, figures = self.scene.now()
                self._receivers.play_crowd(crowd, figures, time_now)
        else:
            frame = self.browsing.step(period)
        if frame is not None:
            self.outbox.show(frame)

    def _tell_health(self) -> None:
        times = self._times or [0.0]
        self._times = []
        self.outbox.tell(
            say.Health(
                mode=self.mode,
                step_ms=round(1e3 * sum(times) / len(times), 3),
                worst_ms=round(1e3 * max(times), 3),
                late=self._pacer.late,
                dropped=self.outbox.dropped,
                sessions=len(self.hall.guests),
            )
        )
