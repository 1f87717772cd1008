"""Godot itself imports what is written and plays it: its bones are where ours are."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bodies import writhing
from exported_rigs import MIXAMO, export
from stridecast.body import kinematics
from stridecast.formats.glb import GlbCrowd, write_glb
from stridecast.formats.motion_files import write_motion
from stridecast.formats.recordings import load_skeleton
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from synthetic_gait import gait

PLAY = Path(__file__).resolve().parents[1] / "integrations" / "play.gd"

EXACT = ("animation/fps=30", "animation/optimizer/enabled=false")
"""Settings of an import that keeps every key of a file with 30 frames a second."""


class Project:
    """A Godot project in a folder."""

    def __init__(self, godot: str, folder: Path) -> None:
        self.godot, self.folder = godot, folder
        self.here = {**os.environ, **{f"XDG_{what}_HOME": str(folder / what) for what in ("CONFIG", "DATA", "CACHE")}}
        (folder / "project.godot").write_text("config_version=4\n")
        shutil.copy(PLAY, folder)

    def imports(self, name: str, settings: Sequence[str] = EXACT) -> None:
        """Let the editor import a file, and end the editor, which does not end by itself without a window."""
        told = '[remap]\n\nimporter="scene"\n\n[params]\n\n' + "\n".join(settings) + "\n"
        (self.folder / f"{name}.import").write_text(told)
        log = self.folder / "import.log"
        with log.open("w") as out:
            command = [self.godot, "--path", str(self.folder), "--editor", "--quit"]
            editor = subprocess.Popen(command, stdout=out, stderr=out, env=self.here)
            try:
                end = time.monotonic() + 60
                while not (done := list(self.folder.glob(f".import/{name}-*.md5"))) and time.monotonic() < end:
                    time.sleep(0.05)
            finally:
                editor.kill()
                editor.wait()
        assert done, log.read_text()[-2000:]

    def plays(self, name: str, times: Sequence[float]) -> dict[str, Any]:
        """What ``play.gd`` tells."""
        out = self.folder / "said.json"
        command = [self.godot, "--path", str(self.folder), "--script", "play.gd"]
        command += ["--scene", f"res://{name}", json.dumps(list(times)), str(out)]
        done = subprocess.run(command, capture_output=True, text=True, env=self.here, timeout=60, check=False)
        assert out.exists(), done.stdout[-2000:] + done.stderr[-2000:]
        return json.loads(out.read_text())


@pytest.fixture
def project(godot, tmp_path) -> Project:
    return Project(godot, tmp_path)


def places(joints: list[list[Any]], names: Sequence[str]) -> np.ndarray:
    """Bones in the order of ours; Godot 3 spells ``mixamorig:LeftUpLeg`` as ``mixamorigleft_up_leg``."""
    plain = {re.sub("[_:]", "", name).lower(): at for name, *at in joints}
    return np.array([plain[re.sub("[_:]", "", name).lower()] for name in names])


def between(motion: Motion, frame: float) -> np.ndarray:
    """Joints at a moment between two frames, every rotation half way on the great circle."""
    before, after = int(frame), min(int(frame) + 1, motion.frames - 1)
    share = frame - before
    turns = motion.rotations[before]
    step = quat.log(quat.multiply(quat.inverse(turns), motion.rotations[after]))
    root = (1 - share) * motion.root_positions[before] + share * motion.root_positions[after]
    return kinematics.forward(motion.skeleton, root, quat.multiply(turns, quat.exp(share * step))).positions


@pytest.mark.parametrize("compact", [False, True])
def test_one_character_plays(project, tmp_path, compact):
    walk = gait(np.full(40, 1.2), curvature=0.4, facing=2.0, rate=30.0).motion
    write_glb(tmp_path / "one.glb", walk, compact=compact)
    project.imports("one.glb")
    frames = [*np.linspace(0, walk.frames - 1, 10).astype(int), 3.5, 20.25]
    told = project.plays("one.glb", [frame / 30 for frame in frames])
    assert told["length"] == pytest.approx((walk.frames - 1) / 30, abs=1e-5)
    assert told["meshes"] == 1
    for frame, moment in zip(frames, told["moments"], strict=True):
        (joints,) = moment.values()
        assert len(joints) == walk.skeleton.joints
        away = np.abs(places(joints, walk.skeleton.names) - between(walk, float(frame))).max()
        assert away < (1e-3 if compact else 1e-4), frame


def test_a_crowd_plays_on_one_clock(project, tmp_path):
    walk = gait(np.full(40, 1.2), curvature=0.4, rate=30.0).motion
    body = walk.skeleton
    small = replace(body, offsets=0.8 * body.offsets, end_offsets=0.8 * body.end_offsets)
    people = {"Ann": (walk, 0.0), "Ben": (replace(walk, skeleton=small, root_positions=0.8 * walk.root_positions), 0.5)}
    scene = GlbCrowd(tmp_path / "crowd.glb")
    for name, (motion, start) in people.items():
        scene.add(motion, name=name, start=start)
    scene.save()
    project.imports("crowd.glb")
    frames = np.linspace(0, walk.frames - 1 + 15, 10).astype(int)
    told = project.plays("crowd.glb", (frames / 30).tolist())
    assert len(told["animations"]) == 1
    seen = dict.fromkeys(people, 0)
    for frame, moment in zip(frames, told["moments"], strict=True):
        assert len(moment) == len(people)
        for where, joints in moment.items():
            name = where.split("/")[0]
            motion, start = people[name]
            own = int(frame - round(start * 30))
            at = places(joints, body.names)
            if 0 <= own < motion.frames:
                seen[name] += 1
                assert np.abs(at - between(motion, own)).max() < 1e-4, (frame, name)
            else:
                assert np.ptp(at, axis=0).max() < 1e-6, (frame, name)
    assert min(seen.values()) >= 5


def test_a_moved_character_plays(project, tmp_path):
    export(tmp_path / "rig.glb", MIXAMO)
    moved = writhing(load_skeleton(tmp_path / "rig.glb"), frames=20, seed=2)
    write_motion(tmp_path / "moved.glb", moved, character=tmp_path / "rig.glb")
    project.imports("moved.glb", (f"animation/fps={moved.frame_rate:g}", EXACT[1]))
    told = project.plays("moved.glb", [frame / moved.frame_rate for frame in (0, 7, 19)])
    for frame, moment in zip((0, 7, 19), told["moments"], strict=True):
        (joints,) = moment.values()
        assert np.abs(places(joints, moved.skeleton.names) - between(moved, frame)).max() < 1e-4
