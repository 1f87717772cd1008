"""A stage driven by hand: any sequence of messages that are right leaves it playing, and meets nothing unexpected."""

from __future__ import annotations

import asyncio
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stridecast.live.frames import decode
from stridecast.live.hall import Hall
from stridecast.live.limits import usual_limits
from stridecast.live.messages import READER, SERVER_READER
from stridecast.live.outbox import MOST_WAITING, Outbox
from stridecast.live.stage import Stage

MESSAGES = st.one_of(
    st.builds(
        lambda wish: {"type": "wish", "wish": wish},
        st.one_of(
            st.builds(lambda x, z: {"kind": "point", "point": [x, z]}, st.floats(-9, 9), st.floats(-9, 9)),
            st.builds(lambda x, z: {"kind": "drive", "direction": [x, z]}, st.floats(-1, 1), st.floats(-1, 1)),
            st.builds(
                lambda x, z, f: {"kind": "force", "force": [x, z], "frame": f},
                st.floats(-100, 100),
                st.floats(-100, 100),
                st.sampled_from(["own", "world"]),
            ),
            st.builds(
                lambda kind, points: {"kind": kind, "points": points},
                st.sampled_from(["curve", "path"]),
                st.lists(st.lists(st.floats(-9, 9), min_size=2, max_size=2), min_size=2, max_size=6),
            ),
            st.just({"kind": "rest"}),
        ),
    ),
    st.builds(
        lambda motion, speed, turn, style, size, half, ratio: {
            "type": "settings",
            "motion": motion,
            "speed": speed,
            "turn": turn,
            "style": style,
            "size": size,
            "half_life": half,
            "damping_ratio": ratio,
        },
        st.sampled_from(["stand", "walk", "run"]),
        st.floats(0.1, 12),
        st.floats(0.05, 1),
        st.floats(-1, 1),
        st.sampled_from(["calm", "neutral", "lively", "exaggerated"]),
        st.floats(0.05, 3),
        st.floats(0.2, 4),
    ),
    st.builds(lambda x, h: {"type": "place", "position": [x, 0], "heading": h}, st.floats(-9, 9), st.floats(-9, 9)),
    st.builds(lambda mode: {"type": "mode", "mode": mode}, st.sampled_from(["walk", "scene", "database"])),
    st.builds(
        lambda action: {"type": "playback", "action": action}, st.sampled_from(["play", "pause", "step", "restart"])
    ),
    st.builds(lambda factor: {"type": "pace", "factor": factor}, st.floats(0.25, 8)),
    st.builds(lambda time: {"type": "scrub", "time": time}, st.floats(0, 5)),
    st.builds(lambda who: {"type": "explain", "person": who}, st.sampled_from([None, 1, 2, 99])),
    st.builds(
        lambda x, radius, full: {"type": "view", "center": [x, 0], "radius": radius, "full": full},
        st.floats(-20, 20),
        st.floats(0.1, 100),
        st.integers(0, 5),
    ),
    st.builds(
        lambda people, obstacles: {
            "type": "scene",
            "scene": {
                "people": [{"start": [2 * k, 0], "goals": [[2 * k, 9]]} for k in range(people)],
                "obstacles": [{"center": [x, z], "radius": 0.5} for x, z in obstacles],
            },
        },
        st.integers(0, 3),
        st.lists(st.tuples(st.floats(-3, 8), st.floats(0, 9)), max_size=2),
    ),
    st.builds(lambda example: {"type": "clip", "example": example}, st.integers(0, 6000)),
    st.builds(
        lambda status, speed: {"type": "mine", "status": status, "speed": speed},
        st.sampled_from([None, "walk", "run", "stand", "walk-run", "fly"]),
        st.floats(0, 5),
    ),
    st.sampled_from(
        [
            {"type": "use", "database": "built"},
            {"type": "cancel"},
            {"type": "build"},
            {"type": "forget_files"},
            {"type": "export", "what": "glb"},
            {"type": "export", "what": "database"},
            {"type": "open_scene", "text": "people: [{start: [0, 0]}]"},
            {"type": "open_scene", "text": "[]"},
            {"type": "save_scene", "scene": {"people": [{"start": [0, 0]}]}},
            {"type": "save_scene", "scene": {}},
        ]
    ),
)


@pytest.fixture(scope="module")
def hall(learned):
    found = Hall(database=learned, limits=usual_limits(), threads=1)
    yield found
    found.close()


class Driven:
    """A stage without its thread, and what it tells and shows."""

    def __init__(self, hall: Hall) -> None:
        self.loop = asyncio.new_event_loop()
        self.outbox = Outbox(self.loop)
        self.stage = Stage(hall, self.outbox, hall.enter())
        self.stage._use(hall.database, hall.name, None, built=False)

    def take(self) -> tuple[list, bytes | None]:
        texts, frame = self.loop.run_until_complete(self.outbox.next())
        return [SERVER_READER.validate_json(text) for text in texts], frame


@settings(max_examples=12)
@given(messages=st.lists(MESSAGES, min_size=1, max_size=12))
def test_whatever_is_said_leaves_the_stage_playing(hall, messages):
    driven = Driven(hall)
    try:
        driven.take()
        for message in messages:
            driven.stage._take(READER.validate_json(json.dumps(message)))
            for _ in range(4):
                driven.stage._play()
        driven.stage._take(READER.validate_json('{"type": "mode", "mode": "walk"}'))
        driven.stage._play()
        told, frame = driven.take()
        wrong = [m for m in told if m.type == "error" and m.code == "internal"]
        assert not wrong
        assert frame is not None
        assert decode(frame).kind == 1
    finally:
        driven.loop.close()
        hall.leave(driven.stage.word)


def test_an_outbox_keeps_the_newest_frame_and_all_messages_in_order():
    loop = asyncio.new_event_loop()
    outbox = Outbox(loop)
    ping = READER.validate_json('{"type": "ping", "at": 1}')
    for k in range(5):
        outbox.tell(ping)
        outbox.show(bytes([k]))
    messages, frame = loop.run_until_complete(outbox.next())
    assert len(messages) == 5
    assert frame == bytes([4])
    assert outbox.dropped == 4
    for _ in range(MOST_WAITING + 10):
        outbox.tell(ping)
    assert outbox.overflown
    assert len(loop.run_until_complete(outbox.next())[0]) == MOST_WAITING
    loop.close()
    outbox.show(b"late")  # nobody is there any more, and that is no error
