from __future__ import annotations

import pytest

from databases import analysed, formula_motions, takes_of
from stridecast.database.assembly import AnalysedTake, assemble
from stridecast.model.database import MotionDatabase


@pytest.fixture(scope="session")
def sources() -> list[AnalysedTake]:
    """The walkers made of formulas, understood, and their mirror images."""
    return analysed(formula_motions())


@pytest.fixture(scope="session")
def learned(sources: list[AnalysedTake]) -> MotionDatabase:
    """What is learned from them."""
    return assemble(sources, takes_of(formula_motions()))
