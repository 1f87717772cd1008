"""Small motion databases for tests, learned from walkers made of formulas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from stridecast.analysis.take import analyse
from stridecast.body.mirroring import mirror
from stridecast.database.assembly import AnalysedTake, assemble
from stridecast.model.database import MotionDatabase, Take
from stridecast.model.motion import Motion
from synthetic_gait import gait, ramps


def formula_motions(rate: float = 60.0) -> dict[str, Motion]:
    """Standing, walking and running, straight and in turns, and every way from one to another."""

    def take(*pieces: tuple[float, float], curvature: float = 0.0, change: float = 1.0) -> Motion:
        return gait(ramps(*pieces, rate=rate, change=change), curvature=curvature, rate=rate).motion

    return {
        "stand and walk": take((1.0, 0.0), (2.0, 1.3), (1.0, 0.0)),
        "stand and stroll": take((0.6, 0.0), (2.0, 0.9), (0.6, 0.0), change=0.9),
        "faster": take((1.2, 0.8), (1.2, 1.3), (1.2, 1.8)),
        "left": take((1.5, 1.0), (1.5, 1.5), curvature=0.8),
        "walk and run": take((1.2, 1.4), (1.2, 2.9), (1.2, 1.4), change=1.0),
        "run": take((1.0, 2.5), (1.0, 3.6), change=1.2),
        "run left": take((1.5, 2.8), curvature=0.3),
        "stand and run": take((0.6, 0.0), (1.5, 3.0), (0.6, 0.0), change=1.8),
    }


def analysed(motions: Mapping[str, Motion], *, mirrored: bool = True) -> list[AnalysedTake]:
    out = []
    for number, motion in enumerate(motions.values()):
        understood = analyse(motion)
        out.append(AnalysedTake(analysis=understood, take=number))
        if mirrored:
            out.append(AnalysedTake(analysis=analyse(mirror(understood.motion)), take=number, mirrored=True))
    return out


def takes_of(motions: Mapping[str, Motion], subjects: Sequence[str] | None = None) -> list[Take]:
    return [
        Take(
            name=name,
            subject=subjects[number] if subjects else motion.subject,
            file=f"{name}.bvh",
            sha256="",
            seconds=motion.seconds,
            covered=motion.seconds,
            segments=0,
        )
        for number, (name, motion) in enumerate(motions.items())
    ]


def database_of(motions: Mapping[str, Motion], **options) -> MotionDatabase:
    """What is learned from some motions and their mirror images."""
    return assemble(analysed(motions), takes_of(motions), **options)


def formula_database() -> MotionDatabase:
    """Everything that the walkers made of formulas do."""
    return database_of(formula_motions())


def swapped(name: str) -> str:
    """A group's name with left and right exchanged."""
    motion, _, string = name.partition("/")
    return f"{motion}/{string.translate(str.maketrans('LR', 'RL'))}"
