"""Scenes as YAML: what stands where, who is there, where to go and how; short for people, checked to the last key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from stridecast.errors import FileError
from stridecast.formats.files import replacing
from stridecast.formats.scene_building import SceneBuilder, written
from stridecast.formats.scene_parts import ScenePart, known_keys, place_of
from stridecast.formats.yaml_values import Place, line_of, named, read_values, values_of
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
    return SceneBuilder(path, lines).scene(_checked(values, path, lines))


def parse_scene(text: str, name: str = "scene.yaml") -> Scene:
    """Read a scene that is at hand as text; ``name`` is what messages call it.

    Raises
    ------
    FileError
        As of ``load_scene``.
    """
    values, lines = values_of(text, name)
    return SceneBuilder(name, lines).scene(_checked(values, name, lines))


def scene_of(values: Mapping[str, Any]) -> Scene:
    """The scene of what a scene file says, as lists, dictionaries, numbers and names.

    Raises
    ------
    FileError
        As of ``load_scene``; the place is named, and no file.
    """
    return SceneBuilder(None, {}).scene(_checked(values, None, {}))


def is_empty(values: Mapping[str, Any]) -> bool:
    """Whether what a scene file says is right so far, but nobody is there.

    Raises
    ------
    FileError
        It is not right, as far as that can be told without anybody in it.
    """
    part = _checked(values, None, {})
    empty = not (part.people or part.sources or part.start is not None or part.goals is not None)
    if empty:
        somebody = part.model_copy(update={"start": (0.0, 0.0), "goals": [(0.0, 1.0)]})
        SceneBuilder(None, {}).scene(somebody)
    return empty


def scene_values(scene: Scene) -> dict[str, Any]:
    """What the file of a scene says, as lists, dictionaries, numbers and names; ``scene_of`` reads it."""
    return written(scene)


def _checked(values: Any, path: str | Path | None, lines: dict[Place, int]) -> ScenePart:
    try:
        return ScenePart.model_validate(values)
    except ValidationError as error:
        raise _refusal(path, error, lines) from None


_BREAKS = ("\x85", "\u2028", "\u2029")
"""Line ends beyond those of ASCII: YAML folds them unless they are escaped."""


def save_scene(path: str | Path, scene: Scene) -> None:
    """Write a scene that ``load_scene`` reads to the last bit; what is as usual is left out.

    Raises
    ------
    FileError
        The file cannot be written; what was there is untouched.
    """
    with replacing(path) as file:
        file.write(scene_text(scene).encode())


def scene_text(scene: Scene) -> str:
    """A scene as YAML, which ``parse_scene`` reads to the last bit; what is as usual is left out."""
    kept = written(scene)
    told = any(mark in text for mark in _BREAKS for text in _texts(kept))
    return yaml.dump(kept, Dumper=_Dumper, default_flow_style=None, sort_keys=False, allow_unicode=not told, width=118)


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


def _refusal(path: str | Path | None, error: ValidationError, lines: dict[Place, int]) -> FileError:
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
