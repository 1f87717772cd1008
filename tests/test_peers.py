"""The peers of the benchmark of crowds, where they are installed, on situations of plain numbers."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from stridecast.scorecard.crowds import score_crowd

BENCH = Path(__file__).resolve().parent.parent / "bench"

HEAD_ON = {
    "people": [
        {"start": [0.1, 0.0], "stops": [[0.0, 10.0]], "speed": 1.2, "radius": 0.25},
        {"start": [-0.1, 10.0], "stops": [[0.0, 0.0]], "speed": 1.3, "radius": 0.25},
    ],
    "walls": [[[1.5, -3.0], [1.5, 13.0]], [[-1.5, -3.0], [-1.5, 13.0]]],
    "circles": [],
    "polygons": [],
    "seconds": 30.0,
}
AROUND = {
    "people": [{"start": [0.0, 0.0], "stops": [[0.0, 4.0], [6.0, 6.0]], "speed": 1.3, "radius": 0.25}],
    "walls": [[[1.0, -2.0], [1.0, 5.0]]],
    "circles": [[-2.0, 3.0, 0.5]],
    "polygons": [[[3.0, 4.0], [4.0, 4.0], [4.0, 5.8], [3.0, 5.8]]],
    "seconds": 40.0,
}


@pytest.fixture(scope="module")
def peers():
    spec = importlib.util.spec_from_file_location("peers", BENCH / "peers.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["peers"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["peers"]


INSTALLED = pytest.mark.skipif(
    not (BENCH / ".peers").exists(), reason="RVO2 and JuPedSim are not installed (python bench/peers.py)"
)
PEERS = ("RVO2", "JuPedSim speed", "JuPedSim force")


def test_all_peers_are_tested(peers):
    assert tuple(peers.PEERS) == PEERS


@INSTALLED
@pytest.mark.parametrize("name", PEERS)
@pytest.mark.parametrize("situation", [HEAD_ON, AROUND], ids=["head-on", "around"])
def test_a_peer_arrives_and_keeps_clear(peers, name, situation):
    walked, seconds = peers.simulate(name, situation)
    people = dict(enumerate(situation["people"]))
    assert walked.people.tolist() == list(people)
    for k, rows in walked.each():
        np.testing.assert_allclose(walked.positions[rows.start], people[k]["start"], atol=1e-6)
    goals = {k: [np.array([stop]) for stop in p["stops"]] for k, p in people.items()}
    score = score_crowd(walked, radius=0.25, goals=goals, free_speeds={k: p["speed"] for k, p in people.items()})
    assert score.frame_rate == pytest.approx(30.0)
    assert score.travel.arrived == len(people)
    assert score.overlaps.depth < 0.05
    assert (score.travel.against_alone < 2).all()
    assert 0 < seconds < 60


@INSTALLED
def test_a_peer_that_fails_says_why(peers):
    inside = {**HEAD_ON, "people": [{**HEAD_ON["people"][0], "start": [1.5, 3.0]}]}
    with pytest.raises(peers.PeerError, match="JuPedSim speed: "):
        peers.simulate("JuPedSim speed", inside)
