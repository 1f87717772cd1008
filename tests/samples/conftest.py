from __future__ import annotations

import pytest

from stridecast.analysis.take import TakeAnalysis, analyse
from stridecast.samples import corpus
from stridecast.samples.performance import SampleTake


@pytest.fixture(scope="session")
def sample_takes() -> dict[str, SampleTake]:
    """All sample takes, by name."""
    return {take.motion.name: take for take in corpus.sample_takes()}


@pytest.fixture(scope="session")
def analyses(sample_takes: dict[str, SampleTake]) -> dict[str, TakeAnalysis]:
    """What the analysis finds in each."""
    return {name: analyse(take.motion) for name, take in sample_takes.items()}
