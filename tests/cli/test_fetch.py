from __future__ import annotations

import json
import shutil
import socket
from functools import partial
from pathlib import Path

import pytest
from typer.testing import CliRunner

from recording_servers import recording_set, served
from stridecast.cli.main import app
from stridecast.formats.store import load_database
from stridecast.samples import recordings
from stridecast.samples.recordings import SETS


def call(*arguments: object):
    """Run the command in this process; nothing but ``typer.Exit`` may come out of it."""
    result = CliRunner().invoke(app, ["fetch", *map(str, arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exc_info
    return result


def refused(*arguments: object) -> str:
    """Run the command, and return the one line that says what is wrong."""
    result = call(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    *notes, last = result.stderr.splitlines()
    assert all(note.startswith("note: ") for note in notes)
    assert last.startswith("error: ")
    return last.removeprefix("error: ")


@pytest.fixture(autouse=True)
def user(tmp_path, monkeypatch) -> Path:
    """A user with folders of their own and no patience."""
    monkeypatch.setenv("NO_PROXY", "*")
    for kind in ("data", "cache"):
        monkeypatch.setattr(
            f"platformdirs.user_{kind}_dir", lambda *_, kind=kind, **__: str(tmp_path / kind / "stridecast")
        )
    monkeypatch.setattr(recordings, "bring", partial(recordings.bring, pauses=(0.0,)))
    return tmp_path


@pytest.fixture
def server(formula_takes, user, monkeypatch):
    """Serves the set ``tiny``: a person made of formulas."""
    contents = {f"{path.stem[:2]}/{path.name}": path.read_bytes() for path in sorted(formula_takes.iterdir())}
    monkeypatch.setitem(SETS, "tiny", recording_set(contents, user / "tiny.csv"))
    with served(contents) as server:
        yield server


def test_what_there_is_is_listed():
    assert "cmu  walking, running" in call().stdout
    assert "93 files, 23.8 MB" in call().stdout
    listed = json.loads(call("--json").stdout)["sets"]
    assert [(each["set"], each["files"], each["bytes"]) for each in listed] == [("cmu", 93, 23773936)]
    for option in ("--folder", "--no-build", "--mirror", "--jobs", "--json"):
        assert option in call("--help").output


def test_recordings_become_a_database_with_one_command(server, user):
    result = call("tiny", "--mirror", server.address, "--jobs", 1)
    assert result.exit_code == 0, result.output
    place = user / "data" / "stridecast" / "tiny"
    path = place / "tiny.safetensors"
    assert "3 files downloaded (" in result.stdout
    assert "Thanks to all.\nDo no harm.\n" in result.stdout
    assert "3 takes used" in result.stdout
    assert result.stdout.endswith(f"next: stridecast walk {path} --curve eight:2 -o eight.bvh\n")
    assert load_database(path).groups
    assert (place / "CREDIT.txt").exists()


def test_a_second_time_downloads_nothing_and_says_so(server):
    call("tiny", "--mirror", server.address, "--jobs", 1)
    server.requests.clear()
    result = call("tiny", "--mirror", server.address, "--jobs", 1)
    assert result.exit_code == 0
    assert "all 3 files are there already, nothing was downloaded" in result.stdout
    assert "Thanks to all." in result.stdout
    assert server.requests == []


def test_other_recordings_in_the_folder_are_not_learned_from(server, user, formula_takes):
    (user / "mine").mkdir()
    shutil.copy(formula_takes / "01_02.bvh", user / "mine" / "99_01.bvh")
    call("tiny", "--mirror", server.address, "--jobs", 1, "--folder", user / "mine", "-q")
    assert len(load_database(user / "mine" / "tiny.safetensors").takes) == 3


def test_the_summary_is_json_if_asked(server, user):
    place, path = user / "here", user / "new.safetensors"
    options = ["--mirror", server.address, "--folder", place, "--jobs", 1, "--json"]
    content = json.loads(call("tiny", *options, "--no-build").stdout)
    assert content["downloaded"] == content["files"] == 3
    assert content["output"] is None
    content = json.loads(call("tiny", *options, "-o", path).stdout)
    assert content["folder"] == str(place)
    assert content["output"] == str(path)
    assert content["downloaded"] == 0
    assert content["credit"] == "Thanks to all."
    assert content["takes"] == 3
    assert content["left_out"] is not None


def test_the_database_can_be_left_out(server, user):
    result = call("tiny", "--mirror", server.address, "--folder", user / "my [own]", "--no-build")
    assert result.exit_code == 0
    assert f"next: stridecast build '{user}/my [own]' -o tiny.safetensors" in result.stdout
    assert f"MB in all): {user}/my [own]\n" in result.stdout
    assert sorted(path.name for path in (user / "my [own]").glob("[!.]*")) == ["01", "02", "CREDIT.txt"]


def test_quiet_is_quiet(server, user):
    result = call("tiny", "--mirror", server.address, "--folder", user / "x", "--jobs", 1, "-q")
    assert (result.exit_code, result.output) == (0, "")
    assert (user / "x" / "tiny.safetensors").exists()


def test_a_fetch_that_cannot_be_is_refused(server, user):
    assert refused("kit") == "there is no set of recordings 'kit'; there are cmu, tiny"
    assert "leave out one" in refused("tiny", "--no-build", "-o", user / "x.safetensors")
    assert "a motion database is a *.safetensors file" in refused("tiny", "-o", user / "x.bvh")
    assert "no such folder" in refused("tiny", "-o", user / "none" / "x.safetensors")
    assert "a mirror is an address like" in refused("tiny", "--mirror", "somewhere")
    assert "at least 1 job" in refused("tiny", "--jobs", 0)
    assert server.requests == []


def test_what_does_not_come_is_told_in_one_line(server, user):
    del server.contents["01/01_02.bvh"]
    said = refused("tiny", "--mirror", server.address)
    assert f"01_02.bvh: {server.address}/01/01_02.bvh is not there (404 Not Found); 2 of 3 files are here" in said
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        said = refused("tiny", "--mirror", f"http://127.0.0.1:{unused.getsockname()[1]}")
    assert "cannot be reached" in said
    assert not list(user.rglob("*.safetensors"))
