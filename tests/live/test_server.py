from __future__ import annotations

import json
import math
import socket
import threading
import time
from contextlib import ExitStack

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed

from live_clients import Client, open_narrow_socket, open_socket
from stridecast.live.layout import PLAYING, SCENE, STEERING, WALK
from stridecast.live.serve import LiveServer

TOLERANCE = 2e-3
"""Bounds travel in single precision."""


def steering(frame) -> dict[str, float]:
    return dict(zip(STEERING, frame.arrays["steering"][0].tolist(), strict=True))


def place(frame) -> np.ndarray:
    return frame.arrays["places"][0]


def wish(client: Client, kind: str, at: float = 0.0, **fields) -> None:
    client.say("wish", wish={"kind": kind, **fields}, at=at)


def walk(client: Client, frames: int) -> list:
    """The next frames of walk mode."""
    return [client.until_frame(WALK) for _ in range(frames)]


# beginning


def test_the_welcome_tells_all_that_is_steady(client, learned):
    told = client.welcome
    assert told.database.name == "sample database"
    assert told.database.motions == list(learned.motions)
    assert [group.name for group in told.database.groups] == [group.name for group in learned.groups]
    assert told.skeleton.names == list(learned.skeleton.names)
    assert told.skeleton.parents[0] == -1
    assert len(told.session) >= 32
    assert told.scene == {"version": 1}
    assert told.bounds == ["jerk", "tangential", "lateral", "speed"]
    follows = {(told.database.groups[a].name, told.database.groups[b].name) for a, b in told.database.graph}
    assert ("stand/S", "stand/S") in follows


def test_frames_come_at_the_rate_of_the_database(client):
    walk(client, 5)
    began = time.monotonic()
    frames = walk(client, 45)
    seconds = time.monotonic() - began
    assert seconds == pytest.approx(1.5, abs=0.4)
    times = [frame.time for frame in frames]
    assert np.all(np.diff(times) > 0)
    assert times[-1] - times[0] == pytest.approx(44 / 30, abs=0.2)
    assert np.isnan(steering(frames[0])["input_x"])


# walking


def test_a_moving_point_is_followed_within_the_bounds(client):
    """What a mouse does: a circle of two metres, once round."""
    last = None
    distances = []
    for k in range(130):
        angle = 0.65 * k / 30
        wish(client, "point", at=float(k + 1), point=[2 * math.sin(angle), 2 - 2 * math.cos(angle)])
        frame = client.until_frame(WALK)
        told = steering(frame)
        assert told["jerk"] <= told["most_jerk"] + TOLERANCE * 30
        assert told["least_tangential"] - TOLERANCE <= told["tangential"] <= told["most_tangential"] + TOLERANCE
        assert abs(told["lateral"]) <= told["most_lateral"] + TOLERANCE
        speed = float(frame.arrays["speeds"][0])
        assert told["least_speed"] - TOLERANCE <= speed <= told["most_speed"] + TOLERANCE
        if last is not None:
            assert np.hypot(*(place(frame)[:2] - last)) < 0.2
        last = place(frame)[:2]
        distances.append(float(np.hypot(*(last - [told["input_x"], told["input_z"]]))))
    assert np.median(distances[60:]) < 1.0
    assert {m.side for m in client.said if m.type == "footprint"} == {"left", "right"}


def test_the_echo_tells_which_input_a_frame_has_used(client):
    assert client.until_frame(WALK).echo == 0
    wish(client, "point", at=123.25, point=[0, 1])
    frame = client.until_frame(WALK, lambda f: f.echo == 123.25)
    assert steering(frame)["input_z"] == 1.0


def test_keys_drive_and_their_release_stops(client):
    wish(client, "drive", direction=[0, 1])
    frame = client.until_frame(WALK, lambda f: f.arrays["speeds"][0] > 0.8)
    wish(client, "drive", direction=[1, 0])
    client.until_frame(WALK, lambda f: abs(place(f)[2] - math.pi / 2) < 0.2)
    wish(client, "drive", direction=[0, 0])
    frame = client.until_frame(WALK, lambda f: f.arrays["speeds"][0] < 0.01)
    there = place(frame)[:2]
    assert np.hypot(*(place(walk(client, 20)[-1])[:2] - there)) < 0.02


def test_forces_push_ahead_and_turn(client):
    wish(client, "force", force=[1.0, 0.0])
    client.until_frame(WALK, lambda f: f.arrays["speeds"][0] > 1.0)
    wish(client, "force", force=[0.0, 0.6])
    frame = client.until_frame(WALK, lambda f: place(f)[2] > 0.5)
    assert frame.arrays["speeds"][0] < client.welcome.settings.speed + 0.4


@pytest.mark.parametrize("kind", ["curve", "path"])
def test_a_drawn_line_is_walked_to_its_end(client, kind):
    line = [[0.05 * k, 0.6 * math.sin(0.06 * k)] for k in range(20, 60)]
    wish(client, kind, points=line)
    way = client.until("way")
    assert (way.kind, way.arrived) == (kind, False)
    shown = np.array(way.points)
    first = len(client.frames)
    end = client.until("way")
    nearest = [np.hypot(*(shown - place(frame)[:2]).T).min() for frame in client.frames[first:]]
    assert (end.arrived, end.points) == (True, [])
    assert max(nearest) < (0.6 if kind == "curve" else 0.2)  # who follows a point stops a bit beyond it
    assert np.hypot(*(place(client.until_frame(WALK))[:2] - line[-1])) < 0.7


def test_settings_are_told_and_act(client):
    client.say("settings", turn=0.3, speed=0.9)
    told = client.until("settings_state")
    assert (told.turn, told.speed, told.motion) == (0.3, 0.9, "walk")
    wish(client, "drive", direction=[0, 1])
    frames = walk(client, 60)
    widest = {g.name: g.bounds.lateral_per_speed for g in client.welcome.database.groups}
    for frame in frames[5:]:
        playing = dict(zip(PLAYING, frame.arrays["playing"][0].tolist(), strict=True))
        name = client.welcome.database.groups[playing["group"]].name
        assert steering(frame)["most_lateral"] <= 0.3 * widest[name] * 1.0 + 0.4 * widest[name]
    assert max(f.arrays["speeds"][0] for f in frames) < 1.15


def test_a_place_begins_anew(client):
    client.say("place", position=[5, -3], heading=1.0)
    frame = client.until_frame(WALK, lambda f: abs(place(f)[0] - 5) < 0.01)
    assert place(frame) == pytest.approx([5, -3, 1.0], abs=1e-4)


def test_what_was_walked_is_saved(client, server):
    wish(client, "drive", direction=[0, 1])
    walk(client, 30)
    for what, name in (("bvh", "walk.bvh"), ("glb", "walk.glb"), ("csv", "walk.csv")):
        client.say("export", what=what, request=7)
        ready = client.until("export_ready", "error")
        assert (ready.type, ready.name, ready.request) == ("export_ready", name, 7)
        assert ready.url.startswith("/download/")


def heard(receiver: socket.socket, until: float) -> tuple[float, float]:
    """Time of the first frame from ``until`` on that a receiver of VMC hears, and how far ahead the hips are."""
    osc_bundle = pytest.importorskip("pythonosc.osc_bundle", reason="python-osc decodes")
    when = z = -1.0
    while when < until:
        for message in osc_bundle.OscBundle(receiver.recv(65536)):
            said = list(message.params)
            if message.address == "/VMC/Ext/T":
                when = said[0]
            elif said[0] == "Hips":
                z = said[3]
    return when, z


def neighbours() -> tuple[socket.socket, socket.socket]:
    """Two receivers at ports side by side."""
    while True:
        first, second = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        first.bind(("127.0.0.1", 0))
        try:
            second.bind(("127.0.0.1", first.getsockname()[1] + 1))
        except (OSError, OverflowError):
            first.close()
            second.close()
            continue
        return first, second


def test_walkers_are_played_to_receivers_a_port_each(learned):
    with ExitStack() as stack:
        receivers = [stack.enter_context(receiver) for receiver in neighbours()]
        for receiver in receivers:
            receiver.settimeout(20.0)
        running = stack.enter_context(LiveServer(learned, port=0, receiver=receivers[0].getsockname()).running())
        steered, left_alone = (Client(stack.enter_context(open_socket(running))) for _ in receivers)
        wish(steered, "drive", direction=[0, 1])
        left_alone.until("welcome")
        frame = steered.until_frame(WALK, lambda f: place(f)[1] > 0.5)
        when, z = heard(receivers[0], frame.time)
        assert z == pytest.approx(place(frame)[1], abs=0.2 + 1.5 * (when - frame.time))
        assert abs(heard(receivers[1], 0.3)[1]) < 0.2  # nobody steers the other


def test_people_of_a_scene_are_played_to_receivers_a_port_each(learned):
    with ExitStack() as stack:
        receivers = [stack.enter_context(receiver) for receiver in neighbours()]
        for receiver in receivers:
            receiver.settimeout(20.0)
        where = receivers[0].getsockname()
        running = stack.enter_context(LiveServer(learned, port=0, receiver=where, received=2).running())
        guest = Client(stack.enter_context(open_socket(running)))
        guest.until("welcome")
        guest.say("mode", mode="scene")
        starts = [[0, 0], [4, 0], [8, 0]]
        scene = {"people": [{"start": start, "goals": [[start[0], 30]]} for start in starts]}
        guest.say("scene", scene=scene, request=1)
        guest.until("scene_checked")
        guest.say("playback", action="play")
        frame = guest.until_frame(SCENE, lambda f: f.time > 2.0)
        ahead = dict(zip(frame.arrays["ids"].tolist(), frame.arrays["places"][:, 1].tolist(), strict=True))
        for number, receiver in zip((1, 2), receivers, strict=True):
            when, z = heard(receiver, frame.time)
            assert z == pytest.approx(ahead[number], abs=0.25 + 1.6 * (when - frame.time))
            assert z > 1.0


# what is wrong is told, and changes nothing


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        ("", "message", "no JSON"),
        ("rubbish", "message", "no JSON"),
        ("[" * 50_000, "message", "no JSON"),
        ('{"type": "fly"}', "message", "fly"),
        ('{"type": "wish", "wish": {"kind": "point", "point": [1e400, 0]}}', "message", "finite"),
        ('{"type": "settings", "motion": "fly"}', "message", "motion"),
        ('{"type": "wish", "wish": {"kind": "path", "points": [[0, 0], [0, 0.01]]}}', "wish", "draw at least"),
        ('{"type": "wish", "wish": {"kind": "curve", "points": [[0, 0], [0, 2000]]}}', "wish", "1000 m are the most"),
        ('{"type": "playback", "action": "play", "more": 1}', "message", "more"),
        ('{"type": "use", "database": "built", "request": 4}', "database", "no database has been built"),
        ('{"type": "build", "request": 4}', "build", "no recording has been uploaded"),
        ('{"type": "cancel"}', "build", "nothing is being built"),
        ('{"type": "playback", "action": "play"}', "scene", "nobody is there yet"),
        ('{"type": "scrub", "time": 1}', "scene", "nothing has been played"),
        ('{"type": "export", "what": "database"}', "export", "no database has been built"),
        ('{"type": "clip", "example": 999999}', "database", "there is no segment"),
        ('{"type": "mine", "status": "fly"}', "database", "fly"),
        ('{"type": "open_scene", "text": "a: [1"}', "scene", "is no YAML"),
        ('{"type": "open_scene", "text": "a: &x [*x]"}', "scene", "anchors"),
    ],
)
def test_wrong_messages_are_answered(client, text, code, words):
    client.socket.send(text)
    error = client.until("error")
    assert error.code == code
    assert words in error.message
    frame = client.until_frame(WALK)
    assert place(frame) == pytest.approx([0, 0, 0], abs=1e-3)
    client.say("ping", at=1.0)
    assert client.until("pong").at == 1.0


def closed_by(send, server) -> ConnectionClosed:
    """How the server ends a connection on which something was sent."""
    with open_socket(server) as socket:
        client = Client(socket)
        client.until("welcome")
        try:
            send(socket)
        except ConnectionClosed as closed:  # before all of it was out
            return closed
        return closing(client)


def closing(client: Client) -> ConnectionClosed:
    """How the connection ends, whatever comes before."""
    try:
        while True:
            client.receive()
    except ConnectionClosed as closed:
        return closed


def is_alive(server) -> bool:
    with open_socket(server) as socket:
        client = Client(socket)
        client.until("welcome")
        return bool(walk(client, 3))


def test_an_oversized_message_closes_only_its_connection(server):
    closed = closed_by(lambda socket: socket.send("x" * (4 * 2**20 + 1)), server)
    assert closed.rcvd is None or closed.rcvd.code == 1009  # none where the reset is quicker than the word
    assert is_alive(server)


def test_a_message_in_endless_pieces_closes_only_its_connection(server):
    def pieces():
        for _ in range(100):
            yield "x" * 2**16

    closed = closed_by(lambda socket: socket.send(pieces()), server)
    assert closed.rcvd is None or closed.rcvd.code == 1009
    assert is_alive(server)


def test_binary_messages_close_the_connection(server):
    closed = closed_by(lambda socket: socket.send(bytes(range(256))), server)
    assert (closed.rcvd.code, "JSON" in closed.rcvd.reason) == (1003, True)


def test_garbage_without_end_closes_the_connection(server):
    closed = closed_by(lambda socket: [socket.send("{") for _ in range(60)], server)
    assert closed.rcvd.code == 1008


def test_text_that_is_no_text_closes_only_its_connection(server):
    closed = closed_by(lambda socket: socket.send(b"\xff\xfe\xfa", text=True), server)
    assert closed.rcvd.code == 1007
    assert is_alive(server)


def test_too_many_messages_are_left_out_and_told(client):
    text = json.dumps({"type": "ping", "at": 1.0})
    for _ in range(900):
        client.socket.send(text)
    error = client.until("error")
    assert error.code == "rate"
    assert "Send the newest input only" in error.message
    time.sleep(1.1)
    client.say("ping", at=2.0)
    while client.until("pong").at != 2.0:
        pass


def test_a_flood_closes_only_its_connection(server):
    def flood(socket):
        for _ in range(20_000):
            socket.send('{"type": "ping", "at": 1}')

    closed = closed_by(flood, server)
    assert closed.rcvd is None or closed.rcvd.code == 1008
    assert is_alive(server)


def test_the_subprotocol_has_to_be_offered(server):
    with open_socket(server, protocols=()) as socket, pytest.raises(ConnectionClosed) as caught:
        socket.recv(timeout=10)
    assert (caught.value.rcvd.code, caught.value.rcvd.reason) == (
        4400,
        "the subprotocol stridecast.1 has to be offered",
    )


# several clients


def test_two_clients_walk_each_for_themselves(server):
    with open_socket(server) as first, open_socket(server) as second:
        one, other = Client(first), Client(second)
        assert one.until("welcome").session != other.until("welcome").session
        wish(one, "drive", direction=[0, 1])
        one.until_frame(WALK, lambda f: place(f)[1] > 0.5)
        frame = other.until_frame(WALK)
        assert place(frame) == pytest.approx([0, 0, 0], abs=1e-3)


def test_more_clients_than_there_is_room_for_are_sent_away(server):
    with ExitStack() as stack:
        for _ in range(4):
            Client(stack.enter_context(open_socket(server))).until("welcome")
        fifth = stack.enter_context(open_socket(server))
        with pytest.raises(ConnectionClosed) as caught:
            fifth.recv(timeout=10)
        assert caught.value.rcvd.code == 1013
        assert "try again later" in caught.value.rcvd.reason
    end = time.monotonic() + 5
    while server.hall.guests and time.monotonic() < end:
        time.sleep(0.05)
    assert is_alive(server)


def test_nothing_is_left_of_who_has_gone(server, client):
    folder = server.hall.guests[client.welcome.session].folder
    client.say("export", what="csv")
    walk(client, 5)
    client.say("export", what="csv")
    client.until("export_ready")
    assert folder.is_dir()
    client.socket.close()
    end = time.monotonic() + 10
    while folder.exists() and time.monotonic() < end:
        time.sleep(0.05)
    assert not folder.exists()
    names = {thread.name for thread in threading.enumerate()}
    assert f"stage {client.welcome.session[:8]}" not in names


def test_a_client_that_reads_slowly_gets_fewer_frames_and_no_old_ones(server):
    with open_narrow_socket(server, max_queue=1) as socket:
        client = Client(socket)
        client.until("welcome")
        client.say("mode", mode="scene")
        people = [{"start": [x, z], "goals": [[x, z + 40.0]]} for x in range(-12, 12, 2) for z in range(-8, 9, 2)]
        client.say("scene", scene={"people": people})
        assert client.until("scene_checked").applied == "restarted"
        client.say("view", center=[0, 0], radius=100, full=1000)
        client.say("playback", action="play")
        client.until_frame(SCENE, lambda f: f.time > 0.5)
        before = len(client.frames)
        time.sleep(5.0)  # nothing is read: what the system keeps is full, and the server goes on
        client.say("ping", at=5.0)
        client.until("pong")
        client.until_frame(SCENE, lambda f: f.time > 4.5)
        times = [frame.time for frame in client.frames[before:]]
        assert max(np.diff(times)) > 1.0  # these were left out, ...
        assert len(times) < 70  # ... and did not wait somewhere
        client.say("playback", action="pause")
        assert client.until("health").dropped > 60


def test_clients_connect_again_after_the_server_has_begun_anew(learned):
    first = LiveServer(learned, port=0)
    with first.running(), open_socket(first) as socket:
        client = Client(socket)
        client.until("welcome")
        first.stop()
        assert closing(client).rcvd.code == 1012
    port = first.port
    with LiveServer(learned, port=port).running() as second:
        assert is_alive(second)
