"""From people and moving obstacles of a scene to those who appear in traffic."""

from __future__ import annotations

import hashlib
import math

import numpy as np
from jaxtyping import Float

from stridecast.crowd.bounds import HumanBounds
from stridecast.crowd.traffic import Newcomer
from stridecast.model.people import Mover, Person
from stridecast.model.scene import Scene
from stridecast.model.segment import RUN

Array = np.ndarray

KEEPS = {"near": 0.1, "far": 0.35}
"""What is kept from others beyond the bodies where there is room, by preference, metres."""

SIDES = {"none": 0.0, "left": 1.0, "right": -1.0}

BESIDE = 0.15
"""What people who walk together leave between them, metres."""

SPARE = 0.95
"""Nobody wishes to go faster than this part of what a person can."""


def newcomer_of(person: Person, way: Float[Array, "points 2"], slot: float, bounds: HumanBounds, seed: int) -> Newcomer:
    """Somebody who is about to appear and go a way, so far to the left of it as their place in a group says."""
    b = person.behavior
    heading = person.heading
    if heading is None:
        ahead = way[min(4, len(way) - 1)] - way[0]  # people who walk together all look the same way
        heading = math.atan2(*ahead) if len(way) > 1 and np.hypot(*ahead) > 1e-6 else 0.0
    fastest = SPARE * float(bounds.fastest[-1 if b.status == RUN else 0])
    return Newcomer(
        number=number_of(person.name),
        position=(float(person.start[0]), float(person.start[1])),
        heading=heading,
        way=way,
        speed=min(person.speed, fastest, b.velocity),
        wish=min(b.velocity, fastest),
        radius=b.body_radius,
        runs=b.status == RUN,
        side=SIDES[b.preference.side],
        keep=KEEPS[b.preference.distance],
        waits=b.preference.patience == "wait",
        rank=chance_of(person.name, seed, "rank"),
        company=-1 if person.together is None else number_of(person.together),
        slot=slot,
        stays=person.stays,
    )


def obstacle_of(mover: Mover) -> Newcomer:
    """Something that moves by a script; it goes first where it may go at all."""
    place = mover.at(np.zeros(()))
    return Newcomer(
        number=number_of(mover.name),
        position=(float(place[0]), float(place[1])),
        heading=0.0,
        way=place[None],
        radius=mover.radius,
        rank=2.0,
        mover=mover,
    )


def walker_of(scene: Scene) -> Person:
    """The one walker of a scene as one of its people."""
    start, goals = scene.task()
    names = {person.name for person in scene.people}
    name = next(n for n in ("walker", *(f"walker {k}" for k in range(2, len(names) + 3))) if n not in names)
    return Person(
        name=name, start=start, stops=tuple(goal[None] for goal in goals), behavior=scene.behavior, stays=True
    )


def slots_of(group: tuple[Person, ...]) -> list[float]:
    """Places of a group beside each other, to the left of its way, metres."""
    widths = [2 * person.behavior.body_radius + BESIDE for person in group]
    edges = np.concatenate(([0.0], np.cumsum(widths)))
    return (0.5 * (edges[1:] + edges[:-1]) - 0.5 * edges[-1]).tolist() if len(group) > 1 else [0.0]


def number_of(name: str) -> int:
    """A number that only depends on a name."""
    return int.from_bytes(hashlib.blake2b(name.encode(), digest_size=7).digest(), "big")


def chance_of(name: str, seed: int, what: str) -> float:
    """A number from 0 to below 1 that only depends on a name, the seed, and what it is for."""
    return number_of(f"{what} {seed} {name}") / 2.0**56
