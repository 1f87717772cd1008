"""TypeScript types of the messages and the layout of frames, for the page.

``python -m stridecast.live.typescript web/src/protocol.ts`` writes them; a test keeps them as the sources say.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import JsonSchemaMode

from stridecast.formats.scene_parts import ScenePart
from stridecast.live import layout, messages

_HEAD = (
    "// Made by `python -m stridecast.live.typescript` from src/stridecast/live/messages.py and layout.py;"
    " do not edit.\n"
)

_PLAIN = {"string": "string", "number": "number", "integer": "number", "boolean": "boolean", "null": "null"}


def typescript() -> str:
    """The whole file."""
    parts: dict[str, str] = {}
    for adapter, mode, union in (
        (TypeAdapter(ScenePart), "validation", ""),
        (messages.READER, "validation", "FromClient"),
        (messages.SERVER_READER, "serialization", "FromServer"),
    ):
        schema = _schema(adapter, mode)
        for name, definition in schema.pop("$defs", {}).items():
            parts.setdefault(name, _interface(name, definition))
        parts[union or "ScenePart"] = (
            f"export type {union} = {_type(schema)};\n" if union else _interface("ScenePart", schema)
        )
    return _HEAD + "\n" + _constants() + "\n" + "\n".join(parts.values())


def _schema(adapter: Any, mode: str) -> dict[str, Any]:
    chosen: JsonSchemaMode = "serialization" if mode == "serialization" else "validation"
    schema: dict[str, Any] = adapter.json_schema(mode=chosen)
    return schema


def _constants() -> str:
    """Numbers that the page needs, and the layout of frames."""
    named = {
        "PROTOCOL": messages.PROTOCOL,
        "PACES": messages.PACES,
        "WALK": layout.WALK,
        "SCENE": layout.SCENE,
        "CLIPS": layout.CLIPS,
        "REPLAYED": layout.REPLAYED,
        "ALIGNMENT": layout.ALIGNMENT,
        "LEVELS": layout.LEVELS,
        "HEADER_BYTES": layout.HEADER.itemsize,
        "HEADER": {name: [kind.str.lstrip("<|"), offset] for name, (kind, offset) in _fields().items()},
        "ARRAYS": [_column(column) for column in layout.ARRAYS],
        "WALK_ARRAYS": [_column(column) for column in layout.WALK_ARRAYS],
        "STEERING": layout.STEERING,
        "PLAYING": layout.PLAYING,
        "CLAMPED": layout.CLAMPED,
    }
    return "".join(f"export const {name} = {json.dumps(value)} as const;\n" for name, value in named.items())


def _fields() -> Mapping[str, Any]:
    fields = layout.HEADER.fields
    assert fields is not None
    return {name: (field[0], field[1]) for name, field in fields.items()}


def _column(column: layout.Column) -> dict[str, Any]:
    return {
        "name": column.name,
        "kind": column.kind.lstrip("<"),
        "rows": column.rows,
        "width": column.width,
        "joints": column.joints,
    }


def _interface(name: str, schema: Mapping[str, Any]) -> str:
    """A named type with its comment."""
    if "properties" not in schema:
        return f"export type {name} = {_type(schema)};\n"
    lines = [*_comment(schema.get("description", ""), ""), f"export interface {name} {{"]
    required = schema.get("required", ())
    for key, value in schema["properties"].items():
        lines += _comment(value.get("description", ""), "  ")
        lines.append(f"  {key}{'' if key in required else '?'}: {_type(value)};")
    return "\n".join([*lines, "}", ""])


def _comment(text: str, indent: str) -> list[str]:
    words = [line.strip() for line in text.strip().splitlines()]
    if not text.strip():
        return []
    if len(words) == 1:
        return [f"{indent}/** {words[0]} */"]
    return [f"{indent}/**", *(f"{indent} * {line}".rstrip() for line in words), f"{indent} */"]


def _type(schema: Mapping[str, Any] | bool) -> str:
    """A schema as a type."""
    if isinstance(schema, bool) or not schema:
        return "unknown"
    if "tsType" in schema:
        return str(schema["tsType"])
    if "$ref" in schema:
        return str(schema["$ref"]).rsplit("/", 1)[-1]
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(json.dumps(value) for value in schema["enum"])
    for union in ("anyOf", "oneOf"):
        if union in schema:
            return " | ".join(dict.fromkeys(_type(part) for part in schema[union]))
    kind = schema.get("type")
    if kind == "array":
        if "prefixItems" in schema:
            return f"[{', '.join(_type(item) for item in schema['prefixItems'])}]"
        item = _type(schema.get("items", {}))
        return f"({item})[]" if "|" in item else f"{item}[]"
    if kind == "object":
        return f"Record<string, {_type(schema.get('additionalProperties', {}))}>"
    return _PLAIN.get(str(kind), "unknown")


def main() -> None:
    """Write the file that is named, or print it."""
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(typescript(), encoding="utf-8")
    else:
        sys.stdout.write(typescript())


if __name__ == "__main__":
    main()
