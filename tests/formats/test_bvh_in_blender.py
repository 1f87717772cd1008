"""Blender itself reads what is written. Its ``bpy`` is large, so it is only tested where it is installed."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from characters import mixamo_like
from stridecast.body import kinematics
from stridecast.body.recasting import recast
from stridecast.formats.bvh import write_bvh
from stridecast.formats.bvh_conventions import BVH_CONVENTIONS, BvhConvention, bvh_convention, standing_height
from stridecast.formats.recordings import load_skeleton
from stridecast.model.motion import Motion
from synthetic_gait import gait

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "blender" / "character.py"

Blender = Callable[..., None]


@pytest.fixture(scope="module")
def blender(blender: str) -> Blender:
    """Runs ``blender_rig.py`` with its arguments, in a process of its own."""

    def run(*arguments: object) -> None:
        command = [blender, str(Path(__file__).with_name("blender_rig.py")), *map(str, arguments)]
        clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, env=clean)
        assert done.returncode == 0, done.stdout + done.stderr

    return run


def walking() -> Motion:
    return gait(np.full(20, 1.2), curvature=0.4, facing=2.0, rate=30.0).motion


def check_places(told: dict[str, Any], motion: Motion, first: int = 0) -> None:
    at = np.array(told["places"])[first:]
    assert len(at) == motion.frames
    there = [told["names"].index(name) for name in motion.skeleton.names]
    np.testing.assert_allclose(at[:, there], kinematics.pose(motion).positions, atol=1e-4)


@pytest.mark.parametrize("program", [*BVH_CONVENTIONS, "blender on the ground"])
def test_joints_are_where_ours_are(blender, tmp_path, program):
    how = bvh_convention("blender", root="ground") if "ground" in program else BVH_CONVENTIONS[program]
    motion = walking()
    write_bvh(tmp_path / "a.bvh", motion, convention=how)
    blender("imported", tmp_path / "a.bvh", how.scale, tmp_path / "told.json")
    told = json.loads((tmp_path / "told.json").read_text())
    check_places(told, motion, first=int(how.rest_frame))
    assert told["rate"] == 30
    lowest = min(height for _, height, _ in told["rest"])
    assert (abs(lowest) < 0.02) == (how != BvhConvention())


def test_a_rigged_character_walks(blender, tmp_path):
    """From the armature to a skeleton, recast, and back on the armature, whatever the rolls of its bones."""
    body = mixamo_like(tmp_path)
    at = kinematics.rest(body).positions + np.array([0.0, standing_height(body), 0.0])
    tips = []
    for joint in range(body.joints):
        below = np.flatnonzero(body.parents == joint)
        tips.append((at[below[0]] if len(below) else at[joint] + [0.0, 0.05, 0.0]).tolist())
    rig = {"names": body.names, "parents": body.parents.tolist(), "places": at.tolist(), "tips": tips}
    (tmp_path / "rig.json").write_text(json.dumps(rig))
    blender("rig", tmp_path / "rig.json", tmp_path / "my.blend")
    blender("example", EXAMPLE, tmp_path / "my.blend", "export", "Armature", tmp_path / "my.bvh")
    walk = gait(np.full(30, 1.2), curvature=0.4, facing=2.0, rate=30.0)
    motion = recast(walk.motion, load_skeleton(tmp_path / "my.bvh"), walk.planted)
    assert motion.skeleton.leg_length == pytest.approx(body.leg_length, abs=1e-5)
    write_bvh(tmp_path / "walk.bvh", motion, convention="blender")
    files = (tmp_path / "walk.bvh", tmp_path / "done.blend")
    blender("example", EXAMPLE, tmp_path / "my.blend", "play", "Armature", *files)
    blender("opened", tmp_path / "done.blend", tmp_path / "told.json")
    check_places(json.loads((tmp_path / "told.json").read_text()), motion)
