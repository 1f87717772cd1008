from __future__ import annotations

import pytest

from stridecast.model.database import MotionDatabase


@pytest.fixture(scope="session")
def sample_person() -> MotionDatabase:
    """The database of the sample person, made once for this machine."""
    from stridecast.samples.library import sample_database

    return sample_database()
