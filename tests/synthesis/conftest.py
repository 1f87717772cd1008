from __future__ import annotations

import pytest

from databases import formula_database
from stridecast.model.database import MotionDatabase


@pytest.fixture(scope="session")
def formulas() -> MotionDatabase:
    """What is learned from walkers made of formulas: every motion and every way from one to another."""
    return formula_database()


@pytest.fixture(scope="session", params=["formulas", "recordings"])
def database(request: pytest.FixtureRequest) -> MotionDatabase:
    """The same laws for people made of formulas and for recorded ones."""
    return request.getfixturevalue("formulas" if request.param == "formulas" else "small_database")
