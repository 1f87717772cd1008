"""YAML as lists, keys, numbers and names, with the line of each; strict, and bounded in size and depth."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import yaml

from stridecast.errors import FileError
from stridecast.formats.files import looks_like, read_text

LARGEST = 64 * 2**20
"""Larger files are a mistake, bytes."""

MOST_VALUES = 4_000_000
"""Numbers, names and lists of a file, all together."""

DEEPEST = 16
"""Lists and keys inside each other."""

_NUMBER = re.compile(r"[-+]?(\d[\d_]*\.?\d*|\.\d+)([eE][-+]?\d+)?")
_SPECIAL = {"nan": math.nan, "inf": math.inf, "+inf": math.inf, "-inf": -math.inf}

Place = tuple[str | int, ...]
"""Keys and indices that lead to a value."""


def read_values(path: str | Path) -> tuple[Any, dict[Place, int]]:
    """What a scene file says, as lists, dictionaries, numbers and names, and the line of each place.

    Built from the parser's events, so that nothing is expanded, nested or repeated without bounds.

    Raises
    ------
    FileError
        The file cannot be read, or is no YAML or none that is taken; with the line.
    """
    data = _data(path)
    try:
        return values_of(_text(data, path), path)
    except FileError:
        if name := looks_like(data):  # only now: anything may be the name of somebody in a scene
            raise FileError(f"is no scene but {name}", path=path) from None
        raise


def values_of(text: str, path: str | Path) -> tuple[Any, dict[Place, int]]:
    """The same of text; ``path`` is what messages call it.

    Raises
    ------
    FileError
        As of ``read_values``.
    """
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    lines: dict[Place, int] = {}
    builder = _Builder(path, lines)
    try:
        for event in yaml.parse(text, Loader=loader):
            builder.take(event)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise FileError(f"is no YAML: {problem}", path=path, line=None if mark is None else mark.line + 1) from None
    if not isinstance(builder.root, dict):
        raise FileError("is no scene: it should name start and goals, as 'start: [0, 0]'", path=path)
    return builder.root, lines


def _data(path: str | Path) -> bytes:
    try:
        size = Path(path).stat().st_size
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror or error}", path=path) from error
    if size > LARGEST:
        what = f"has {size / 2**20:.0f} MB; a scene has at most {LARGEST // 2**20} MB"
        raise FileError(what, path=path)
    return read_text(path)


def _text(data: bytes, path: str | Path) -> str:
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FileError("is no text in UTF-8", path=path, line=line) from None


def line_of(lines: dict[Place, int], place: Place) -> int | None:
    """Line of a place, or of what holds it."""
    while place and place not in lines:
        place = place[:-1]
    return lines.get(place)


def named(place: Place) -> str:
    """A place as ``obstacles[2].radius``, counted from 0."""
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place)
    return text.removeprefix(".") or "the scene"


class _Builder:
    """Values from events, one after the other."""

    def __init__(self, path: str | Path, lines: dict[Place, int]) -> None:
        self.path = path
        self.lines = lines
        self.root: Any = None
        self.documents = 0
        self.count = 0
        self.open: list[tuple[Any, Place]] = []
        self.key: list[str | None] = []

    def take(self, event: yaml.Event) -> None:
        """Take the next event."""
        line = event.start_mark.line + 1 if event.start_mark else 1
        if isinstance(event, yaml.DocumentStartEvent):
            self.documents += 1
            if self.documents > 1:
                raise FileError("holds a second document; a file holds one scene", path=self.path, line=line)
        elif isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise FileError("anchors and aliases (& and *) are not taken; write it out", path=self.path, line=line)
        elif getattr(event, "tag", None) not in (None, "!"):
            raise FileError(f"tags such as {getattr(event, 'tag', '')!r} are not taken", path=self.path, line=line)
        elif isinstance(event, yaml.ScalarEvent):
            self._scalar(event, line)
        elif isinstance(event, yaml.SequenceStartEvent | yaml.MappingStartEvent):
            self._begin([] if isinstance(event, yaml.SequenceStartEvent) else {}, line)
        elif isinstance(event, yaml.SequenceEndEvent | yaml.MappingEndEvent):
            self.open.pop()
            self.key.pop()

    def _scalar(self, event: yaml.ScalarEvent, line: int) -> None:
        if self.open and isinstance(self.open[-1][0], dict) and self.key[-1] is None:
            self._take_key(event.value, line)
        else:
            self._put(event.value if event.style else _scalar(event.value), line)

    def _take_key(self, key: str, line: int) -> None:
        values, place = self.open[-1]
        if key in values:
            first = self.lines[(*place, key)]
            what = f"{named((*place, key))} stands here a second time; the first is in line {first}"
            raise FileError(what, path=self.path, line=line)
        self.key[-1] = key

    def _begin(self, value: Any, line: int) -> None:
        if len(self.open) >= DEEPEST:
            raise FileError(f"lists go deeper than {DEEPEST} levels", path=self.path, line=line)
        if self.open and isinstance(self.open[-1][0], dict) and self.key[-1] is None:
            raise FileError("a key must be a name, not a list", path=self.path, line=line)
        place = self._put(value, line)
        self.open.append((value, place))
        self.key.append(None)

    def _put(self, value: Any, line: int) -> Place:
        self.count += 1
        if self.count > MOST_VALUES:
            raise FileError(f"holds more than {MOST_VALUES} values", path=self.path, line=line)
        if not self.open:
            self.root = value
            return ()
        into, at = self.open[-1]
        place: Place
        if isinstance(into, dict):
            key = self.key[-1] or ""
            into[key] = value
            place = (*at, key)
            self.key[-1] = None
        else:
            place = (*at, len(into))
            into.append(value)
        self.lines[place] = line
        return place


def _scalar(text: str) -> Any:
    """A plain scalar: nothing, true, a number, else text. Numbers may be written 1e3, which YAML 1.1 takes for text."""
    if text in ("", "~", "null"):
        return None
    if text in ("true", "false"):
        return text == "true"
    if _NUMBER.fullmatch(text):
        return float(text) if any(c in text for c in ".eE") or len(text) > 15 else int(text)
    return _SPECIAL.get(text.lower().replace(".", "", 1) if "." in text[:2] else "", text)
