"""How fast a crowd steps: pytest bench/bench_crowd.py --benchmark-only (or make bench).

A thousand people with bodies cross an open place of 50 by 50 metres from four sides, from the sample database, on one
core. A frame of 30 Hz lasts 33 ms.
"""

from __future__ import annotations

import numpy as np
import pytest

import stridecast as sc
from stridecast.model.people import Route, Source, Spread
from stridecast.model.scene import Scene

SIDE = 25.0
"""Half the width of the place, metres."""


def _place(people: int) -> Scene:
    """A quarter of the people on each side of the place, all on their way to the opposite one."""
    sources = []
    for k, name in enumerate(("north", "west", "south", "east")):
        c, s = round(np.cos(k * np.pi / 2)), round(np.sin(k * np.pi / 2))
        turn = np.array([[c, -s], [s, c]])
        area = np.array([(-SIDE + 4, -SIDE), (SIDE - 4, -SIDE), (6.0, -3.0), (-6.0, -3.0)]) @ turn
        gate = np.array([(-SIDE + 4, SIDE + 60), (SIDE - 4, SIDE + 60)]) @ turn
        sources.append(
            Source(
                name=name,
                area=area,
                routes=(Route(stops=(gate,)),),
                at_once=people // 4,
                velocity=Spread(mean=1.34, deviation=0.26, least=0.8, most=1.9),
                body_radius=Spread(mean=0.25),
                together=(0.7, 0.2, 0.1, 0.0),
            )
        )
    return Scene(start=None, goals=np.zeros((0, 2)), sources=tuple(sources))


@pytest.mark.parametrize(("people", "bodies"), [(100, True), (1000, False), (1000, True)])
def test_step_of_a_crowd(benchmark, people, bodies):
    crowd = sc.Crowd(sc.sample_database(), _place(people), bodies=bodies)
    for _ in range(60):
        crowd.step()
    benchmark.pedantic(crowd.step, rounds=90, iterations=1)
    assert len(crowd.frame().ids) == people
    benchmark.extra_info["frames_per_second"] = round(1 / benchmark.stats["median"])
