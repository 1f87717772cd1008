"""A server whose people are somebody's own character."""

from __future__ import annotations

import http.client
import io
import json
import zipfile

import numpy as np
import pytest

from characters import built
from glb_rigs import artists_rig
from glbs import Glb
from live_clients import Client, open_socket
from stridecast.body import kinematics
from stridecast.errors import SkeletonError
from stridecast.formats.bvh import write_bvh
from stridecast.formats.recordings import load_motion, load_skeleton
from stridecast.live.cast import cast
from stridecast.live.serve import LiveServer
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("character") / "character.glb"
    artists_rig(path, built(legs=0.95, feet=1.1, hips=1.1), seed=3, unit=0.01)
    return path


@pytest.fixture(scope="module")
def running(learned, file):
    database, costume = cast(learned, file, load_skeleton(file))
    with LiveServer(database, port=0, costume=costume).running() as server:
        yield server


@pytest.fixture
def guest(running):
    with open_socket(running) as socket:
        client = Client(socket)
        client.welcome = client.until("welcome")
        yield client


def get(server, url):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20)
    connection.request("GET", url)
    answer = connection.getresponse()
    data = answer.read()
    connection.close()
    return answer, data


def saved(server, guest, what, path):
    """A file of what was played."""
    guest.say("export", what=what)
    _, data = get(server, guest.until("export_ready", "error").url)
    path.write_bytes(data)
    return data


def test_the_welcome_tells_how_the_file_is_posed(guest, running, file):
    told, whole = guest.welcome, load_skeleton(file)
    assert set(told.skeleton.names) <= set(whole.names)
    glb = Glb(file.read_bytes())
    assert [glb["nodes"][node]["name"] for node in told.character.nodes] == told.skeleton.names
    assert told.character.size == pytest.approx(0.01)
    answer, data = get(running, f"/character.glb?session={told.session}")
    assert (answer.status, answer.headers["content-type"], data) == (200, "model/gltf-binary", file.read_bytes())
    answer, said = get(running, "/character.glb?session=nobody")
    assert (answer.status, "no such session" in json.loads(said)["error"]) == (404, True)


def test_who_has_no_character_gives_none(learned):
    with LiveServer(learned, port=0).running() as server, open_socket(server) as socket:
        welcome = Client(socket).until("welcome")
        assert welcome.character is None
        assert get(server, f"/character.glb?session={welcome.session}")[0].status == 404


def test_a_walk_comes_back_on_the_whole_file(guest, running, file, tmp_path):
    guest.say("wish", wish={"kind": "drive", "direction": [0, 1]})
    frame = guest.until_frame(1, lambda f: f.time > 1.5)
    whole = Glb(saved(running, guest, "glb", tmp_path / "walk.glb"))
    assert whole["meshes"] == Glb(file.read_bytes())["meshes"]
    saved(running, guest, "bvh", tmp_path / "walk.bvh")
    one, other = load_motion(tmp_path / "walk.bvh"), load_motion(tmp_path / "walk.glb")
    assert set(one.skeleton.names) == set(load_skeleton(file).names)
    at = kinematics.pose(one).positions[frame.frame - 1]
    assert np.abs(at[0] - frame.arrays["roots"][0]).max() < 2e-3
    order = [other.skeleton.names.index(name) for name in one.skeleton.names]
    there = kinematics.pose(other).positions[frame.frame - 1, order]
    assert np.abs(at - there).max() < 3e-3


def test_people_of_a_scene_are_the_character_in_their_sizes(guest, running, file, tmp_path):
    guest.say("mode", mode="scene")
    people = [{"start": [0, 0], "goals": [[0, 9]]}, {"start": [3, 0], "goals": [[3, 9]], "height": 1.62}]
    guest.say("scene", scene={"people": people})
    told = guest.until("people")
    sizes = [one.scale for one in told.people]
    assert sizes[0] == 1.0
    assert 0.85 < sizes[1] < 0.95
    guest.say("playback", action="play")
    guest.until_frame(2, lambda f: f.time > 0.5)
    guest.say("playback", action="pause")
    glb = Glb(saved(running, guest, "glb", tmp_path / "crowd.glb"))
    assert [mesh["name"] for mesh in glb["meshes"]] == [mesh["name"] for mesh in Glb(file.read_bytes())["meshes"]]
    with zipfile.ZipFile(io.BytesIO(saved(running, guest, "bvh", tmp_path / "crowd.zip"))) as archive:
        archive.extractall(tmp_path)
        rows = archive.read("crowd.people.csv").decode().splitlines()[1:]
    ratio = load_skeleton(tmp_path / rows[1].split(",")[-1]).leg_length / load_skeleton(file).leg_length
    assert ratio == pytest.approx(sizes[1], rel=1e-3)


def test_a_character_without_meshes_is_a_mannequin(learned, tmp_path):
    body = built(legs=1.1)
    write_bvh(
        tmp_path / "a.bvh",
        Motion(
            skeleton=body,
            frame_rate=30.0,
            root_positions=np.zeros((2, 3)),
            rotations=np.tile([1.0, 0.0, 0.0, 0.0], (2, body.joints, 1)),
        ),
    )
    database, costume = cast(learned, tmp_path / "a.bvh", load_skeleton(tmp_path / "a.bvh"))
    assert costume.bones is None
    assert database.skeleton.leg_length == pytest.approx(body.leg_length)


def test_who_has_no_legs_is_refused(learned, tmp_path):
    legless = Skeleton(names=("hips",), parents=np.array([-1]), offsets=np.zeros((1, 3)), roles={"hips": 0})
    with pytest.raises(SkeletonError, match="left_thigh"):
        cast(learned, tmp_path / "a.bvh", legless)
