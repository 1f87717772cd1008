"""Scenes as YAML: what stands where, who is there, where to go and how; short for people, checked to the last key."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from stridecast.errors import FileError
from stridecast.formats.files import replacing
from stridecast.formats.scene_building import SceneBuilder, written
from stridecast.formats.scene_parts import ScenePart, known_keys, place_of
from stridecast.formats.yaml_values import Place, line_of, named, read_values
from stridecast.model.scene import Scene


def load_scene(path: str | Path) -> Scene:
    """Read a scene.

    Parameters
    ----------
    path
        YAML as described by ``scene_schema``: ``start`` and ``goals`` of a walker, ``people`` or ``sources``, and, if
        you like, ``roads``, ``obstacles``, ``walls``, ``movers``, ``behavior``, ``stations``, ``seconds`` and ``seed``.
        What has no name is called by its place, from 1. People with an area as start, or a count, become sources.

    Raises
    ------
    FileError
        The file cannot be read, is something else, or holds what makes no scene; with line and place in it, such as
        ``obstacles[2].radius``.
    """
    values, lines = read_values(path)
    try:
        part = ScenePart.model_validate(values)
    except ValidationError as error:
        raise _refusal(path, error, lines) from None
    return SceneBuilder(path, lines).scene(part)


_BREAKS = ("\x85", "\u2028", "\u2029")
"""Line ends beyond those of ASCII: YAML folds them unless they are escaped."""


def save_scene(path: str | Path, scene: Scene) -> None:
    """Write a scene that ``load_scene`` reads to the last bit; what is as usual is left out.

    Raises
    ------
    FileError
        The file cannot be written; what was there is untouched.
    """
    kept = written(scene)
    told = any(mark in text for mark in _BREAKS for text in _texts(kept))
    text = yaml.dump(kept, Dumper=_Dumper, default_flow_style=None, sort_keys=False, allow_unicode=not told, width=118)
    with replacing(path) as file:
        file.write(text.encode())


def scene_schema() -> dict[str, Any]:
    """JSON schema of scene files, for editors that check while one types."""
    schema = ScenePart.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "stridecast scene"}


class _Dumper(yaml.SafeDumper):
    """Numbers, names, lists; no anchors for lists that are equal."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True


def _texts(value: Any) -> Iterator[str]:
    """All names in what is written."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | dict):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _texts(part)


def _refusal(path: str | Path, error: ValidationError, lines: dict[Place, int]) -> FileError:
    """The first of the complaints, in words, with its place."""
    found = error.errors(include_url=False, include_context=True)
    first = min(found, key=lambda e: line_of(lines, place_of(e["loc"])) or 0)
    place = place_of(first["loc"])
    kind, value, context = first["type"], first["input"], first.get("ctx", {})
    shown = f"{value!r:.40}" if not isinstance(value, list | dict) else "a list" if isinstance(value, list) else "keys"
    if kind == "missing":
        what = "is missing" if isinstance(place[-1], str) else "the second number of the point (x, z) is missing"
    elif kind == "extra_forbidden":
        what = f"is not known here; there are {', '.join(known_keys(place[:-1], lines))}"
    elif kind in ("float_type", "finite_number"):
        what = f"should be a finite number, not {shown}"
    elif kind in ("greater_than", "greater_than_equal", "less_than_equal", "less_than"):
        sign, bound = next(iter(context.items()))
        words = {"gt": "greater than", "ge": "at least", "le": "at most", "lt": "less than"}
        what = f"should be {words[sign]} {bound:g}, not {shown}"
    elif kind == "literal_error":
        what = f"should be one of {context['expected']}, not {shown}"
    elif kind == "int_type":
        what = f"should be a whole number, not {shown}"
    elif kind == "bool_type":
        what = f"should be true or false, not {shown}"
    elif kind in ("tuple_type", "list_type"):
        what = f"should be a list, not {shown}"
    elif kind == "too_long" and context.get("max_length") == 2:
        what = "a point is two numbers (x, z)"
    elif kind in ("too_short", "too_long"):
        sign = "least" if kind == "too_short" else "most"
        bound = context.get("min_length" if sign == "least" else "max_length")
        what = f"should hold at {sign} {bound}, not {context.get('actual_length')}"
    elif kind in ("model_type", "model_attributes_type", "dict_type", "union_tag_not_found"):
        what = f"should hold keys, as 'name: value', not {shown}"
    else:
        what = f"{first['msg'][0].lower()}{first['msg'][1:]}, not {shown}"
    more = "" if len(found) == 1 else f" ({len(found) - 1} more mistake{'s' if len(found) > 2 else ''})"
    return FileError(f"{named(place)}: {what}{more}", path=path, line=line_of(lines, place))
