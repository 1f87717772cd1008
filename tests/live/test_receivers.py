"""Who of a crowd has which port."""

from __future__ import annotations

import numpy as np
import pytest

from stridecast.crowd.crowd import Crowd
from stridecast.errors import InputError
from stridecast.formats.scenes import scene_of
from stridecast.live.frames import Figures
from stridecast.live.receivers import Receivers
from stridecast.live.serve import LiveServer


class Sent:
    """Takes the place of a sender: from where the root was sent, time by time."""

    def __init__(self, host: str, port: int) -> None:
        self.places: list[float] = []
        PORTS.append(self)

    def send(self, skeleton, pose, time) -> None:
        self.places.append(float(pose[0][0]))


PORTS: list[Sent] = []


def figures(*ids: int) -> Figures:
    """People whose numbers are their places."""
    count = len(ids)
    return Figures(
        ids=np.array(ids, np.uint32),
        places=np.zeros((count, 3), np.float32),
        speeds=np.zeros(count, np.float32),
        rules=np.zeros(count, np.uint8),
        roots=np.array([[number, 1.0, 0.0] for number in ids], np.float32).reshape(count, 3),
        rotations=np.zeros((count, 2, 3), np.uint16),
        planted=np.zeros(count, np.uint8),
    )


@pytest.fixture
def receivers(monkeypatch) -> Receivers:
    PORTS.clear()
    monkeypatch.setattr("stridecast.live.receivers.VmcSender", Sent)
    return Receivers("127.0.0.1", 39539, 2)


@pytest.fixture
def crowds(learned) -> list[Crowd]:
    return [Crowd(learned, scene_of({"people": [{"start": [k, 0]} for k in range(10)]})) for _ in range(2)]


def test_who_has_a_port_keeps_it_until_they_leave(receivers, crowds):
    for there in ((4, 2), (1, 4, 2), (1, 4), (4,), (7, 9)):
        receivers.play_crowd(crowds[0], figures(*there), 0.0)
    assert [port.places for port in PORTS] == [[2, 2, 1, 7], [4, 4, 4, 4, 9]]


def test_another_crowd_begins_anew(receivers, crowds):
    receivers.play_crowd(crowds[0], figures(3), 0.0)
    receivers.play_crowd(crowds[1], figures(1, 3), 0.0)
    assert [port.places for port in PORTS] == [[3, 1], [3]]


@pytest.mark.parametrize("count", [0, 17])
def test_so_many_people_are_not_played(learned, count):
    with pytest.raises(InputError, match=f"1 to 16 people .* not {count}"):
        LiveServer(learned, port=0, receiver=("127.0.0.1", 39539), received=count)
