"""A scene as the client has it: checked, compared with what plays, small enough to be played live."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from stridecast.errors import SceneError
from stridecast.formats.scenes import is_empty, scene_of
from stridecast.live.limits import FASTEST_FLOW, MOST_LIVE
from stridecast.model.scene import Scene

FIXED = {"movers": "moving obstacles", "seed": "the seed"}
"""Parts that cannot change while people walk, and what they are: with others the scene begins anew."""

_PLACE = re.compile(r"((?:[a-z_]+(?:\[\d+\])*)(?:\.[a-z_]+(?:\[\d+\])*)*): ")


def read_scene(values: Mapping[str, Any]) -> Scene | None:
    """The scene of a document, nothing where nobody is there yet.

    Raises
    ------
    FileError
        It makes no scene; the place is named.
    SceneError
        More people than can be played live.
    """
    if is_empty(values):
        return None
    scene = scene_of(values)
    there = len(scene.people) + sum(source.at_once for source in scene.sources) + scene.has_walker
    if there > MOST_LIVE:
        raise SceneError(
            f"{there} people are there at once; {MOST_LIVE} are the most here (stridecast crowd takes more)"
        )
    flow = sum(source.flow for source in scene.sources)
    if flow > FASTEST_FLOW:
        raise SceneError(f"{flow:g} people a second come; {FASTEST_FLOW:g} are the most here")
    return scene


def place_in(message: str) -> tuple[str, str]:
    """Split ``people[2].start: should be ...`` into the place and the words; no place where there is none."""
    found = _PLACE.match(message)
    return (found[1], message[found.end() :]) if found else ("", message)


def why_anew(before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """What cannot change while people walk and differs between two documents; nothing where there is nothing."""
    differ = [words for name, words in FIXED.items() if (before.get(name) or None) != (after.get(name) or None)]
    return f"{' and '.join(differ)} cannot change while people walk" if differ else ""
