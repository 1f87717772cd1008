from __future__ import annotations

from pathlib import Path

import pytest

from databases import formula_database
from stridecast.building.build import build
from stridecast.model.database import MotionDatabase

TAKES = ("16_15", "16_17", "16_21", "16_27", "16_31", "16_33", "16_35", "16_41", "16_08", "16_55", "127_04")
"""Walking straight and in turns, a start, a stop, running, and the ways between walking, running and standing."""


@pytest.fixture(scope="session")
def formulas() -> MotionDatabase:
    """What is learned from walkers made of formulas: every motion and every way from one to another."""
    return formula_database()


@pytest.fixture(scope="session")
def recordings(mocap: Path) -> MotionDatabase:
    """What is learned from a few recordings."""
    return build([mocap / "cmu" / take.split("_")[0] / f"{take}.amc" for take in TAKES], jobs=1, cache=False)


@pytest.fixture(scope="session", params=["formulas", "recordings"])
def database(request: pytest.FixtureRequest) -> MotionDatabase:
    """The same laws for people made of formulas and for recorded ones."""
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="session")
def sample_person() -> MotionDatabase:
    """The database of the sample person, made once for this machine."""
    from stridecast.samples.library import sample_database

    return sample_database()
