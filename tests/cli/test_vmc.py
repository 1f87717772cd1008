"""``walk --vmc`` plays in real time."""

from __future__ import annotations

import json
import socket
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from stridecast.cli.main import app
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import save_database

osc_bundle = pytest.importorskip("pythonosc.osc_bundle", reason="python-osc decodes (pip install 'stridecast[dev]')")


@pytest.fixture(scope="module")
def database(formula_database, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("database") / "vmc.safetensors"
    save_database(formula_database, path)
    return path


def test_a_walk_is_played_in_real_time(database, tmp_path):
    points, out = tmp_path / "points.csv", tmp_path / "out.bvh"
    points.write_text("time,x,z\n0,0,0\n1.5,0,1.5\n")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(2.0)
        where = f"127.0.0.1:{receiver.getsockname()[1]}"
        words = ["walk", database, "--input", points, "--vmc", where, "-o", out, "--json"]
        began = time.monotonic()
        result = CliRunner().invoke(app, [str(word) for word in words])
        assert time.monotonic() - began > 1.4
        assert result.exit_code == 0, result.output
        frames = json.loads(result.stdout)["frames"]
        times, hips = [], []
        while len(times) < frames:
            for message in osc_bundle.OscBundle(receiver.recv(65536)):
                said = list(message.params)
                if message.address == "/VMC/Ext/T":
                    times += said
                elif said[0] == "Hips":
                    hips.append(said[1:4])
    np.testing.assert_allclose(times, np.arange(frames) / 30.0, atol=1e-5)
    np.testing.assert_allclose(np.array(hips) * [-1, 1, 1], load_motion(out).root_positions, atol=1e-5)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "name a file to write with --output, or a receiver with --vmc"),
        (["--vmc", "nowhere:port"], "an address is HOST:PORT"),
        (["--vmc", "no.such.host.invalid:39539"], "there is no host"),
    ],
)
def test_refusals(database, words, says):
    result = CliRunner().invoke(app, ["walk", str(database), "--curve", "line:2", *words])
    assert result.exit_code == 2
    assert says in result.stderr
