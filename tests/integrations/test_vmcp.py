"""A receiver of the VMC protocol that others wrote, the package vmcp, understands what ``walk --vmc`` plays."""

from __future__ import annotations

import json
import socket
import subprocess
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from stridecast.cli.main import app
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import save_database

SCRIPT = """
import json, sys, time
from vmcp.events import BoneTransformEvent, RelativeTimeEvent, RootTransformEvent, StateEvent
from vmcp.facades import on_receive
from vmcp.osc import OSC
from vmcp.osc.backend.osc4py3 import as_eventloop as backend
heard = []
def place(what):
    return [*(getattr(what.position, k) for k in "xyz"), *(getattr(what.rotation, k) for k in "wxyz")]
osc = OSC(backend)
with osc.open():
    receiver = osc.create_receiver("127.0.0.1", int(sys.argv[1]), "stridecast").open()
    on_receive(receiver, RootTransformEvent, lambda e: heard.append(["root", e.joint, *place(e)]))
    on_receive(receiver, BoneTransformEvent, lambda e: heard.append(["bone", e.joint.value, *place(e)]))
    on_receive(receiver, StateEvent, lambda e: heard.append(["state", e.model_state.value]))
    on_receive(receiver, RelativeTimeEvent, lambda e: heard.append(["time", float(e.delta)]))
    print("ready", flush=True)
    last, end = 0, time.monotonic() + 30
    while time.monotonic() < end and not (heard and time.monotonic() > last + 0.8):
        before = len(heard)
        osc.run()
        last = time.monotonic() if len(heard) > before else last
        time.sleep(0.002)
osc.close()
json.dump(heard, open(sys.argv[2], "w"))
"""


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        asked.bind(("127.0.0.1", 0))
        return int(asked.getsockname()[1])


def test_another_receiver_understands_a_walk(vmcp, formula_database, tmp_path: Path):
    script, said, out, points = (tmp_path / name for name in ("script.py", "said.json", "out.bvh", "points.csv"))
    script.write_text(SCRIPT)
    points.write_text("time,x,z\n0,0,0\n0.6,0.3,0.6\n")
    save_database(formula_database, tmp_path / "database.safetensors")
    port = free_port()
    process = subprocess.Popen(
        [vmcp, str(script), str(port), str(said)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        words = ["walk", tmp_path / "database.safetensors", "--input", points, "-o", out, "--vmc", f"127.0.0.1:{port}"]
        result = CliRunner().invoke(app, [*map(str, words), "-q"])
        assert result.exit_code == 0, result.output
        _, complaints = process.communicate(timeout=40)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0, complaints
    heard, motion = json.loads(said.read_text()), load_motion(out)
    times = [what[1] for what in heard if what[0] == "time"]
    np.testing.assert_allclose(times, np.arange(motion.frames) / 30, atol=1e-5)
    assert [what[1] for what in heard if what[0] == "state"] == [1] * motion.frames
    assert [what[1:] for what in heard if what[0] == "root"] == [["root", 0, 0, 0, 1, 0, 0, 0]] * motion.frames
    bones: dict[str, list[list[float]]] = {}
    for what, name, *rest in heard:
        if what == "bone":
            bones.setdefault(name, []).append(rest)
    assert len(bones) == 21
    assert {len(rows) for rows in bones.values()} == {motion.frames}
    hips = np.array(bones["Hips"])[:, :3]
    np.testing.assert_allclose(hips * [-1, 1, 1], motion.root_positions, atol=1e-5)
    turns = np.array(list(bones.values()))[:, :, 3:]
    np.testing.assert_allclose(np.linalg.norm(turns, axis=-1), 1.0, atol=1e-5)
