"""A small corpus in the place of the sample takes, made in a moment: three takes of formulas, one of them gloomy."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from stridecast.model.motion import Motion
from synthetic_gait import Gait, gait, ramps

PIECES = {
    "walk": ("neutral", ((1.0, 1.0), (0.6, 1.5))),
    "start": ("neutral", ((0.8, 0.0), (0.8, 1.2))),
    "trudge": ("gloomy", ((1.2, 0.8),)),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class FakeTake:
    """What is used of a sample take."""

    motion: Motion
    style: str
    positions: np.ndarray
    headings: np.ndarray
    speeds: np.ndarray
    phases: np.ndarray
    planted: np.ndarray


def fake_take(name: str, style: str, truth: Gait) -> FakeTake:
    return FakeTake(
        motion=replace(truth.motion, name=name, subject="sample"),
        style=style,
        positions=truth.positions,
        headings=truth.headings,
        speeds=truth.speeds,
        phases=truth.phase,
        planted=truth.planted,
    )


class FakeCorpus(ModuleType):
    """Stands in for ``stridecast.samples.corpus``; counts how often takes were made, and calls ``before`` each time."""

    def __init__(self, before: Callable[[], object] = lambda: None) -> None:
        super().__init__("stridecast.samples.corpus")
        self.made = 0
        self.before = before

    def sample_takes(self, *, progress: Callable[[int, int], None] | None = None) -> list[FakeTake]:
        self.made += 1
        self.before()
        takes = []
        for name, (style, pieces) in PIECES.items():
            takes.append(fake_take(name, style, gait(ramps(*pieces))))
            if progress is not None:
                progress(len(takes), len(PIECES))
        return takes

    def install(self) -> None:
        """Take the corpus's place in this process."""
        sys.modules[self.__name__] = self
