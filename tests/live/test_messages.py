from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from stridecast.live.messages import READER, SERVER_READER, FromClient, FromServer
from stridecast.live.typescript import typescript

ROOT = Path(__file__).resolve().parent.parent.parent


def types_of(union) -> set[str]:
    return {part.model_fields["type"].annotation.__args__[0] for part in union.__args__[0].__args__}


def test_the_types_of_the_page_agree():
    path = ROOT / "web" / "src" / "protocol.ts"
    assert path.read_text(encoding="utf-8") == typescript(), (
        "run python -m stridecast.live.typescript web/src/protocol.ts"
    )


def test_types_cover_every_message():
    text = typescript()
    for union in (FromClient, FromServer):
        for name in types_of(union):
            assert f'type: "{name}"' in text or f'type?: "{name}"' in text


def test_every_message_is_documented():
    text = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
    for name in types_of(FromClient) | types_of(FromServer):
        assert f"`{name}`" in text, name


GOOD = [
    {"type": "wish", "wish": {"kind": "point", "point": [1, 2.5]}, "at": 1e9},
    {"type": "wish", "wish": {"kind": "force", "force": [1, -1], "frame": "own"}},
    {"type": "wish", "wish": {"kind": "drive", "direction": [0, 1]}},
    {"type": "wish", "wish": {"kind": "curve", "points": [[0, 0], [1, 1]]}},
    {"type": "settings", "turn": 0.5, "style": -1},
    {"type": "scene", "scene": {"people": [{"start": [0, 0]}], "deep": [[[{}]]]}},
    {"type": "explain", "person": None},
    {"type": "export", "what": "bvh", "request": 3},
]

BAD = [
    ([], "object"),
    ({}, "type"),
    ({"type": "fly"}, "type"),
    ({"type": "wish", "wish": {"kind": "point", "point": [1]}}, "point"),
    ({"type": "wish", "wish": {"kind": "point", "point": [1, "2"]}}, "point"),
    ({"type": "wish", "wish": {"kind": "point", "point": [1e9, 0]}}, "point"),
    ({"type": "wish", "wish": {"kind": "curve", "points": [[0, 0]]}}, "points"),
    ({"type": "wish", "wish": {"kind": "curve", "points": [[0, 0]] * 5001}}, "points"),
    ({"type": "wish", "wish": {"kind": "rest"}, "more": 1}, "more"),
    ({"type": "settings", "turn": 1.5}, "turn"),
    ({"type": "settings", "motion": "fly"}, "motion"),
    ({"type": "pace", "factor": 9}, "factor"),
    ({"type": "explain", "person": 0}, "person"),
    ({"type": "scene", "scene": 3}, "scene"),
    ({"type": "export", "what": "../../etc/passwd"}, "what"),
]


@pytest.mark.parametrize("message", GOOD)
def test_good_messages_are_read(message):
    assert READER.validate_json(json.dumps(message)).type == message["type"]


@pytest.mark.parametrize(("message", "place"), BAD)
def test_bad_messages_are_refused_with_their_place(message, place):
    with pytest.raises(ValidationError) as caught:
        READER.validate_json(json.dumps(message))
    assert place in str(caught.value).lower()


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_are_finite(number):
    text = json.dumps({"type": "wish", "wish": {"kind": "point", "point": [1234, 0]}}).replace("1234", number)
    with pytest.raises(ValidationError):
        READER.validate_json(text)


@given(st.text() | st.binary() | st.recursive(st.none() | st.integers(), st.lists, max_leaves=20).map(json.dumps))
def test_garbage_is_refused(text):
    with pytest.raises(ValidationError):
        READER.validate_json(text)


@pytest.mark.parametrize("shape", ["[" * 100_000, '{"a":' * 100_000, '{"type":"scene","scene":' + '{"a":' * 50_000])
def test_depth_is_refused(shape):
    with pytest.raises(ValidationError):
        READER.validate_json(shape)


def test_the_server_is_read_by_the_same_rules():
    assert SERVER_READER.validate_json('{"type": "pong", "at": 1.5}').at == 1.5
    with pytest.raises(ValidationError):
        SERVER_READER.validate_json('{"type": "pong", "at": 1.5, "more": 1}')
