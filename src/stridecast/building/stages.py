"""What is done with one take: read it, then understand it and its mirror image. Both run in worker processes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from stridecast.analysis.take import TakeAnalysis, analyse
from stridecast.body.conventions import check_speed
from stridecast.body.mirroring import mirror_planted
from stridecast.errors import FileError, InputError, TakeError
from stridecast.formats.recordings import load_recording
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How recordings are read.

    Joints by role, metres per unit, frames a second where a file does not say, and the body model of SMPL bodies.
    """

    roles: Mapping[str, str] | None = None
    scale: float | None = None
    input_rate: float | None = None
    body_model: Path | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """A take as it was read; ``motion`` is left out where only the rest is remembered from an earlier build."""

    name: str
    subject: str
    frames: int
    frame_rate: float
    skeleton: Skeleton
    notes: tuple[str, ...]
    motion: Motion | None

    @property
    def seconds(self) -> float:
        """Time from the first frame to the last."""
        return (self.frames - 1) / self.frame_rate


@dataclass(frozen=True, kw_only=True)
class ReadTask:
    """What ``read`` is to do."""

    path: Path
    reading: Reading


@dataclass(frozen=True, kw_only=True, eq=False)
class AnalysisTask:
    """What ``understand`` is to do; a motion that is not at hand is read (again)."""

    motion: Motion | ReadTask
    skeleton: Skeleton
    mirror: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Understood:
    """Analyses of a take and of its mirror image, if that was wanted and possible."""

    analysis: TakeAnalysis
    mirrored: TakeAnalysis | None
    notes: tuple[str, ...] = ()


def read(task: ReadTask) -> Recording:
    """Read a recording; errors are those of ``load_recording``, without the path in front."""
    return _recorded(*_load(task))


def take_up(motion: Motion) -> Recording:
    """Treat a motion in memory as one that was read.

    Raises
    ------
    SkeletonError, MotionError
        It lacks joints of the legs; its root moves as no person's does.
    """
    motion.skeleton.require_roles()
    check_speed(motion)
    return _recorded(motion, ())


def _load(task: ReadTask) -> tuple[Motion, tuple[str, ...]]:
    reading = task.reading
    try:
        return load_recording(
            task.path,
            roles=reading.roles,
            scale=reading.scale,
            assumed_rate=reading.input_rate,
            body_model=reading.body_model,
        )
    except InputError as error:
        raise TakeError(_without_path(error, task.path)) from error


def _recorded(motion: Motion, notes: tuple[str, ...]) -> Recording:
    return Recording(
        name=motion.name,
        subject=motion.subject,
        frames=motion.frames,
        frame_rate=motion.frame_rate,
        skeleton=motion.skeleton,
        notes=notes,
        motion=motion,
    )


def understand(task: AnalysisTask) -> Understood:
    """Analyse a take on the database's skeleton, and its mirror image; errors are those of ``analyse``."""
    motion = _load(task.motion)[0] if isinstance(task.motion, ReadTask) else task.motion
    analysis = analyse(motion, task.skeleton)
    if not task.mirror:
        return Understood(analysis=analysis, mirrored=None)
    try:
        return Understood(analysis=analysis, mirrored=analyse(mirror_planted(analysis.motion)))
    except InputError as error:
        return Understood(analysis=analysis, mirrored=None, notes=(f"its mirror image is left out: {error}",))


def _without_path(error: InputError, path: Path) -> str:
    """Message of an error without the path of the take in front, which is told beside it."""
    text = str(error)
    if not text.startswith(f"{path}:"):
        return text
    text = text.removeprefix(f"{path}:").strip()
    return f"line {text}" if isinstance(error, FileError) and error.line is not None else text
