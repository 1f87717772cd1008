"""What differs between a scene that people walk in and the one that it becomes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace

import numpy as np

from stridecast.crowd.newcomers import walker_of
from stridecast.model.people import Person, Source
from stridecast.model.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Changes:
    """What a change did to the people of a crowd.

    Parameters
    ----------
    added
        Names of those who are new: they come as soon as they are due and have room.
    anew
        Names of those who have left their places and come once more, at their start: what was changed of them
        (start, heading, height, radius) only changes for who begins.
    altered
        Numbers of those who go on from where they are, in another way or elsewhere.
    removed
        Numbers of those who are not there any more, those who come anew among them.
    """

    added: tuple[str, ...] = ()
    anew: tuple[str, ...] = ()
    altered: tuple[int, ...] = ()
    removed: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Difference:
    """People and sources of a scene that are new, gone, or not what they were, by name."""

    new_people: Mapping[str, Person]
    other_people: Mapping[str, Person]
    gone_people: frozenset[str]
    new_sources: Mapping[str, Source]
    other_sources: Mapping[str, Source]
    gone_sources: frozenset[str]
    place: bool


def of_crowd(scene: Scene) -> Scene:
    """The scene with its one walker among the people."""
    if not scene.has_walker:
        return scene
    return replace(scene, people=(*scene.people, walker_of(scene)), start=None, goals=np.zeros((0, 2)))


def difference(before: Scene, after: Scene) -> Difference:
    """What is new, other and gone; both are scenes ``of_crowd``."""
    people, sources = ({thing.name: thing for thing in things} for things in (before.people, before.sources))
    still = {person.name for person in after.people}, {source.name for source in after.sources}
    return Difference(
        new_people={p.name: p for p in after.people if p.name not in people},
        other_people={p.name: p for p in after.people if p.name in people and not alike(p, people[p.name])},
        gone_people=frozenset(people.keys() - still[0]),
        new_sources={s.name: s for s in after.sources if s.name not in sources},
        other_sources={s.name: s for s in after.sources if s.name in sources and not alike(s, sources[s.name])},
        gone_sources=frozenset(sources.keys() - still[1]),
        place=not all(alike(getattr(before, name), getattr(after, name)) for name in ("roads", "obstacles", "walls")),
    )


def has_to_begin_anew(before: Person, after: Person) -> bool:
    """Whether somebody who is there cannot simply go on as what they become."""
    same = all(alike(getattr(before, name), getattr(after, name)) for name in ("start", "heading", "height"))
    return not same or before.behavior.body_radius != after.behavior.body_radius


def alike(one: object, other: object) -> bool:
    """Whether two values are the same through and through: numbers, arrays, and what is made of them."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return np.array_equal(one, np.asarray(other))
    if isinstance(one, tuple):
        assert isinstance(other, tuple)
        return len(one) == len(other) and all(map(alike, one, other))
    if is_dataclass(one):
        return all(alike(getattr(one, field.name), getattr(other, field.name)) for field in fields(one))
    return one == other
