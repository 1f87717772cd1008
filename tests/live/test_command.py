"""The commands that open the page, as processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import urllib.request

import pytest
from typer.testing import CliRunner
from websockets.sync.client import connect

from stridecast.cli.main import app
from stridecast.formats.store import save_database

COMMAND = [sys.executable, "-c", "from stridecast.cli.main import main; main()"]


def refused(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 2, result.output
    return result.stderr


def test_what_cannot_be_served_is_refused(server, tmp_path):
    assert "no such file" in refused("live", tmp_path / "none.safetensors", "--no-browser")
    assert "cannot be read" in refused("demo", "--scene", tmp_path / "none.yaml", "--no-browser")
    assert f"port {server.port}" in refused("demo", "--no-browser", "--quiet", "--port", server.port)
    assert refused("live", "--port", 99999)
    assert "an address is HOST:PORT" in refused("live", "--vmc", "nowhere:port", "--no-browser")
    assert "there is no host" in refused("demo", "--vmc", "no.such.host.invalid:39539", "--no-browser")


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_the_page_is_served_until_interrupted(formula_database, tmp_path):
    database, scene = tmp_path / "own.safetensors", tmp_path / "scene.yaml"
    save_database(formula_database, database)
    scene.write_text("people: [{name: Ann, start: [0, 0]}]")
    command = [*COMMAND, "live", str(database), "--scene", str(scene), "--no-browser", "--port", "0"]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        address = running.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:")
        try:
            status = urllib.request.urlopen(address, timeout=10).status
        except urllib.error.HTTPError as error:  # a source checkout without the bundle
            status = error.code
            error.close()
        assert status in (200, 503)
        with connect(address.replace("http", "ws") + "ws", subprotocols=["stridecast.1"], close_timeout=1) as socket:
            welcome = json.loads(socket.recv(timeout=20))
        assert welcome["database"]["name"] == "own"
        assert welcome["scene"]["people"] == [{"name": "Ann", "start": [0.0, 0.0]}]
        running.send_signal(signal.SIGINT)
        _, told = running.communicate(timeout=20)
    finally:
        running.kill()
        running.wait()
    assert running.returncode == 0
    assert "Traceback" not in told
    assert "Ctrl-C ends it" in told
