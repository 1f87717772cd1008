"""Files up and down, builds, through a real server."""

from __future__ import annotations

import asyncio
import http.client
import io
import json
import time
import zipfile
from dataclasses import replace
from urllib.parse import quote

import numpy as np
import pytest

from glbs import Glb
from live_clients import Client, open_socket
from marker_files import marker_places, write_c3d
from smpl_files import on_smpl, write_amass
from stridecast.formats.motion_files import write_motion
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import load_database
from stridecast.live.downloads import MOST, Downloads
from stridecast.live.limits import usual_limits
from stridecast.live.serve import LiveServer
from stridecast.live.uploads import UploadRefusedError, Uploads, safe_name
from synthetic_gait import gait, ramps

LIMITS = usual_limits().model_copy(update={"file_bytes": 400_000, "files": 4, "files_bytes": 900_000})


@pytest.fixture(scope="module")
def narrow(learned):
    """A server that takes little."""
    with LiveServer(learned, port=0, limits=LIMITS).running() as running:
        yield running


@pytest.fixture
def guest(narrow):
    with open_socket(narrow) as socket:
        client = Client(socket)
        client.welcome = client.until("welcome")
        yield client


def post(server, session, name, body, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20)
    named = {"content-type": "application/octet-stream"} | {k.replace("_", "-"): v for k, v in headers.items()}
    connection.request("POST", f"/files?session={session}&name={quote(name, safe='')}", body, named)
    answer = connection.getresponse()
    told = json.loads(answer.read())
    connection.close()
    return answer.status, told


def get(server, url):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20)
    connection.request("GET", url)
    answer = connection.getresponse()
    data = answer.read()
    connection.close()
    return answer, data


# names


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("16_27.amc", "16_27.amc"),
        ("Walk 1 (slow).BVH", "Walk_1_slow.bvh"),
        ("../../etc/passwd.bvh", "passwd.bvh"),
        ("C:\\evil\\x.asf", "x.asf"),
        ("walk_poses.NPZ", "walk_poses.npz"),
        ("Trial01.C3D", "Trial01.c3d"),
        ("a b.glb", "a_b.glb"),
        ("..bvh", "take.bvh"),
        ("/.bvh", "take.bvh"),
        ("träge\0.bvh", "tr_ge.bvh"),
        ("a" * 300 + ".bvh", "a" * 60 + ".bvh"),
    ],
)
def test_names_are_made_by_the_server(given, kept):
    assert safe_name(given, LIMITS.file_kinds) == kept


@pytest.mark.parametrize("given", ["", "bvh", "x.exe", "x.bvh/", "x.bvh.zip", "x."])
def test_other_kinds_of_files_are_refused(given):
    with pytest.raises(
        UploadRefusedError, match=r"recordings are \*\.bvh, \*\.amc, \*\.npz, \*\.c3d, \*\.glb, \*\.vrma, \*\.asf"
    ):
        safe_name(given, LIMITS.file_kinds)


# uploads


def test_files_are_bounded_in_size_and_number(tmp_path):
    uploads = Uploads(tmp_path / "files", LIMITS)

    async def chunks(count, size=1000):
        for _ in range(count):
            yield bytes(size)

    def save(name, count):
        return asyncio.run(uploads.save(name, chunks(count)))

    with pytest.raises(UploadRefusedError, match=r"a\.bvh is larger than 0\.38147 MB"):
        save("a.bvh", 401)
    with pytest.raises(UploadRefusedError, match="is empty"):
        save("a.bvh", 0)
    assert list((tmp_path / "files").iterdir()) == []
    save("a.bvh", 400)
    save("b.bvh", 400)
    with pytest.raises(UploadRefusedError, match="the most for all files together"):
        save("c.bvh", 101)
    save("b.bvh", 100)  # the later one takes the place of the earlier
    assert uploads.size == 500_000
    save("c.bvh", 100)
    save("d.bvh", 100)
    with pytest.raises(UploadRefusedError, match="4 files are the most"):
        save("e.bvh", 1)
    assert uploads.files == ["a.bvh", "b.bvh", "c.bvh", "d.bvh"]
    uploads.forget()
    assert list((tmp_path / "files").iterdir()) == []
    assert uploads.size == 0


def test_uploads_need_a_session_and_say_what_is_wrong(narrow, guest):
    session = guest.welcome.session
    assert post(narrow, "nobody", "a.bvh", b"x")[0] == 404
    assert post(narrow, session, "a.exe", b"x") == (
        415,
        {"error": "recordings are *.bvh, *.amc, *.npz, *.c3d, *.glb, *.vrma, *.asf, not 'a.exe'"},
    )
    status, told = post(narrow, session, "a.bvh", b"x", content_type="text/plain")
    assert (status, "application/octet-stream" in told["error"]) == (415, True)
    assert post(narrow, session, "a.bvh", b"")[0] == 400
    assert post(narrow, session, "a.bvh", b"x" * 400_001)[0] == 413
    assert post(narrow, session, "../a b.bvh", b"abc") == (200, {"file": "a_b.bvh", "files": ["a_b.bvh"], "bytes": 3})
    guest.say("forget_files")
    assert guest.until("files").files == []


def test_the_files_of_one_are_not_those_of_another(narrow, guest):
    with open_socket(narrow) as socket:
        other = Client(socket)
        session = other.until("welcome").session
        post(narrow, guest.welcome.session, "a.bvh", b"x")
        assert post(narrow, session, "b.bvh", b"x")[1]["files"] == ["b.bvh"]


# builds


def test_a_database_is_built_of_what_was_uploaded(narrow, guest, formula_takes):
    for path in sorted(formula_takes.glob("*.bvh")):
        assert post(narrow, guest.welcome.session, path.name, path.read_bytes())[0] == 200
    post(narrow, guest.welcome.session, "bad.bvh", b"rubbish")
    guest.say("build", request=11)
    built = guest.until("built", "error")
    assert (built.type, built.request, built.takes, built.left_out) == ("built", 11, 3, 1)
    stages = [m.stage for m in guest.said if m.type == "progress"]
    assert list(dict.fromkeys(stages)) == ["read", "analyse", "assemble"]
    guest.say("use", database="built")
    welcome = guest.until("welcome")
    assert welcome.database.built
    assert welcome.database.takes == 3
    guest.say("database")
    told = guest.until("database_state")
    bad = next(take for take in told.takes if take.name == "bad")
    assert "is no BVH" in bad.left_out[0]
    guest.say("export", what="database")
    ready = guest.until("export_ready", "error")
    answer, data = get(narrow, ready.url)
    assert answer.headers["content-disposition"] == 'attachment; filename="own.safetensors"'
    path = formula_takes.parent / "own.safetensors"
    path.write_bytes(data)
    assert len(load_database(path).takes) == 4
    guest.say("use", database="given")
    assert not guest.until("welcome").database.built


def test_every_format_that_the_command_builds_from_is_taken(learned, tmp_path):
    """One take each way, and rubbish by the same names."""
    pytest.importorskip("ezc3d", reason="ezc3d writes the files (pip install 'stridecast[dev]')")
    takes = gait(ramps((1.0, 0.0), (2.4, 1.3), (1.0, 0.0)))
    motion = replace(takes.motion, name="take", subject="somebody")
    write_amass(tmp_path / "amass.npz", on_smpl(motion))
    write_c3d(tmp_path / "c3d.c3d", marker_places(motion), motion.frame_rate)
    write_motion(tmp_path / "glb.glb", motion)
    write_motion(tmp_path / "bvh.bvh", motion)
    with LiveServer(learned, port=0).running() as server, open_socket(server) as socket:
        client = Client(socket)
        session = client.until("welcome").session
        for path in sorted(tmp_path.iterdir()):
            assert post(server, session, path.name, path.read_bytes())[0] == 200
        for broken in ("no.npz", "no.c3d", "no.glb"):
            assert post(server, session, broken, b"rubbish")[0] == 200
        client.say("build", request=1)
        built = client.until("built", "error")
        assert (built.type, built.takes, built.left_out) == ("built", 4, 3), built
        client.say("use", database="built")
        client.say("database")
        told = client.until("database_state")
    used = {take.name: take for take in told.takes if take.segments}
    assert sorted(used) == ["amass", "bvh", "c3d", "glb"]
    for take in used.values():
        assert take.seconds == pytest.approx(motion.seconds, abs=0.1)
        assert "walk" in take.statuses
    assert [bool(take.left_out) for take in told.takes if take.name == "no"] == [True] * 3


def test_what_cannot_be_built_is_told_in_the_words_of_build(narrow, guest):
    post(narrow, guest.welcome.session, "bad.bvh", b"rubbish")
    guest.say("build", request=12)
    error = guest.until("error", "built")
    assert (error.code, error.request) == ("build", 12)
    assert "no take could be used" in error.message
    assert "bad.bvh: is no BVH" in error.message
    assert "/tmp" not in error.message


def test_a_build_is_cancelled(narrow, guest, formula_takes):
    path = formula_takes / "01_01.bvh"
    post(narrow, guest.welcome.session, path.name, path.read_bytes())
    guest.say("build", request=13)
    guest.say("build", request=14)
    assert "already" in guest.until("error").message
    guest.say("cancel")
    error = guest.until("error", "built")
    assert (error.code, error.request) == ("cancelled", 13)
    guest.say("build", request=15)
    assert guest.until("built", "error").request == 15


# downloads


def test_only_so_many_files_are_kept(tmp_path):
    downloads = Downloads(tmp_path)
    urls, paths = [], []
    for k in range(MOST + 3):
        path = downloads.place("walk.bvh")
        path.write_text(str(k))
        paths.append(path)
        urls.append(downloads.offer(path, "walk.bvh").removeprefix("/download/"))
    assert [path.exists() for path in paths] == [False] * 3 + [True] * MOST
    assert downloads.find(urls[0]) is None
    assert downloads.find(urls[-1]).path == paths[-1]
    assert downloads.find("../../etc/passwd") is None
    assert len(set(urls)) == len(urls)


def test_a_walk_is_saved_as_a_recording(narrow, guest, tmp_path):
    guest.say("wish", wish={"kind": "drive", "direction": [0, 1]})
    frame = guest.until_frame(1, lambda f: f.time > 1.5)
    guest.say("export", what="bvh")
    ready = guest.until("export_ready", "error")
    answer, data = get(narrow, ready.url)
    assert (answer.status, len(data)) == (200, ready.bytes)
    (tmp_path / "walk.bvh").write_bytes(data)
    motion = load_motion(tmp_path / "walk.bvh")
    assert motion.frames >= frame.frame
    assert np.abs(motion.root_positions[frame.frame - 1] - frame.arrays["roots"][0]).max() < 1e-3


def test_a_crowd_is_saved_as_motions_and_as_ways(narrow, guest, tmp_path):
    guest.say("mode", mode="scene")
    guest.say("scene", scene={"people": [{"name": "A/..", "start": [0, 0], "goals": [[0, 9]]}, {"start": [3, 0]}]})
    assert guest.until("scene_checked").applied == "restarted"
    guest.say("playback", action="play")
    guest.until_frame(2, lambda f: f.time > 1.0)
    guest.say("playback", action="pause")
    guest.say("export", what="bvh")
    _, data = get(narrow, guest.until("export_ready", "error").url)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert sorted(archive.namelist()) == ["crowd.A.bvh", "crowd.csv", "crowd.people.csv", "crowd.person_2.bvh"]
        (tmp_path / "a.bvh").write_bytes(archive.read("crowd.A.bvh"))
        rows = archive.read("crowd.csv").decode().splitlines()
    motion = load_motion(tmp_path / "a.bvh")
    assert (len(rows) - 1) % 2 == 0
    assert motion.frames == (len(rows) - 1) // 2
    guest.say("export", what="csv")
    _, ways = get(narrow, guest.until("export_ready", "error").url)
    assert ways.decode().splitlines() == rows
    guest.say("export", what="glb")
    _, data = get(narrow, guest.until("export_ready", "error").url)
    glb = Glb(data)
    head = next(k for k in glb["skins"][0]["joints"] if glb["nodes"][k]["name"] == "Head")
    first = float(rows[1].split(",")[1])
    for time_ in (first, first + 0.5):
        at = glb.world(0, time_)[head, :3, 3]
        whole = motion.root_positions[round((time_ - first) * motion.frame_rate)]
        assert np.hypot(*(at - whole)[[0, 2]]) < 0.3  # the head of the first is over their feet
        assert 1.3 < at[1] < 1.9


def test_the_mannequin_has_the_bones_of_the_session(narrow, guest):
    skeleton = guest.welcome.skeleton
    answer, data = get(narrow, f"/body.glb?session={guest.welcome.session}")
    assert (answer.status, answer.headers["content-type"]) == (200, "model/gltf-binary")
    glb = Glb(data)
    assert [glb["nodes"][k]["name"] for k in glb["skins"][0]["joints"]] == skeleton.names
    answer, said = get(narrow, "/body.glb?session=nobody")
    assert (answer.status, json.loads(said)["error"]) == (404, "there is no such session; connect again")


def test_downloads_end_with_the_session(narrow):
    with open_socket(narrow) as socket:
        client = Client(socket)
        client.until("welcome")
        client.until_frame(1, lambda f: f.frame > 4)
        client.say("export", what="csv")
        url = client.until("export_ready").url
        assert get(narrow, url)[0].status == 200
    end = time.monotonic() + 10
    while narrow.hall.guests and time.monotonic() < end:
        time.sleep(0.05)
    answer, data = get(narrow, url)
    assert (answer.status, json.loads(data)["error"]) == (404, "there is no such file any more; make it again")
