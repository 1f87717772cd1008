"""A crowd as a set of BVH in Blender: each imported on its own, moved to its start, and everybody is where we say."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from blenders import run_in_blender
from stridecast.body import kinematics
from stridecast.cli.main import app
from stridecast.crowd.crowd import Crowd
from stridecast.formats.scenes import load_scene
from stridecast.formats.store import save_database

SCENE = """
seed: 4
people:
  - {name: Ann, start: [0, 0], goals: [[0, 4]], height: 1.5}
  - {name: Ben, start: [0.1, 4], goals: [[0, 0]], begins: 0.5}
  - {name: Cy, start: [2, 2], goals: [[-1, 2]], height: 1.9, begins: 1}
"""

SCRIPT = """
import csv, json, pathlib, sys
import bpy
index, moments = pathlib.Path(sys.argv[1]), json.loads(sys.argv[2])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene, people = bpy.context.scene, {}
for row in csv.DictReader(index.open(newline="")):
    rate = (int(row["frames"]) - 1) / float(row["seconds"])
    bpy.ops.import_anim.bvh(filepath=str(index.parent / row["file"]), update_scene_fps=True,
                            frame_start=1 + round(float(row["start"]) * rate))
    people[row["id"]] = bpy.context.object
said = []
for moment in moments:
    scene.frame_set(1 + round(moment * scene.render.fps))
    said.append({who: {bone.name: [*(body.matrix_world @ bone.head)] for bone in body.pose.bones}
                 for who, body in people.items()})
out = {"rate": scene.render.fps, "ranges": {who: [*body.animation_data.action.frame_range]
       for who, body in people.items()}, "moments": said}
json.dump(out, open(sys.argv[3], "w"))
"""


def test_everybody_is_where_we_have_them(blender, formula_database, tmp_path: Path):
    (tmp_path / "scene.yaml").write_text(SCENE)
    save_database(formula_database, tmp_path / "database.safetensors")
    command = ["crowd", "scene.yaml", "--database", "database.safetensors", "-o", "out.bvh", "-q"]
    command = [str(tmp_path / word) if "." in word else word for word in command]
    assert CliRunner().invoke(app, [*command, "--bvh-for", "blender"]).exit_code == 0
    crowd = Crowd(formula_database, load_scene(tmp_path / "scene.yaml"))
    frames = []
    while not crowd.done:
        frames.append(crowd.step())
    shown = [frames[k] for k in np.linspace(0, len(frames) - 1, 10).astype(int)]
    assert {len(frame.ids) for frame in shown} >= {1, 3}
    arguments = (str(tmp_path / "out.people.csv"), json.dumps([frame.time for frame in shown]))
    said = run_in_blender(blender, SCRIPT, tmp_path, *arguments)
    assert said["rate"] == 30
    assert sorted(said["ranges"]) == ["1", "2", "3"]
    for frame, told in zip(shown, said["moments"], strict=True):
        now = 1 + round(frame.time * 30)
        there = {int(who) for who, (first, last) in said["ranges"].items() if first <= now <= last}
        assert there == set(frame.ids.tolist())
        for k, number in enumerate(frame.ids.tolist()):
            body = crowd.skeleton(number)
            ours = kinematics.forward(body, frame.roots[k], frame.rotations[k]).positions
            theirs = np.array([told[str(number)][name] for name in body.names])[:, [0, 2, 1]] * [1, 1, -1]
            assert np.abs(theirs - ours).max() < 1e-3
