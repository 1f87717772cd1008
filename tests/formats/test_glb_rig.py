"""A crowd of somebody's own character: everybody has the vertices that a file of their own would have."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bodies import humanoid, standing, writhing
from glb_rigs import artists_rig
from glbs import Glb, complaints, packed
from stridecast.body import kinematics
from stridecast.errors import FileError, InputError, SkeletonError
from stridecast.formats.glb import GlbCrowd
from stridecast.formats.glb_character import write_character
from stridecast.formats.recordings import load_motion, load_skeleton
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

AGREE, COMPACT = 2e-4, 2e-3
SIZES = (1.0, 0.85, 1.2)
PARTS = ("Coat", "Legs", "Brim")


def sized(skeleton: Skeleton, size: float) -> Skeleton:
    return replace(skeleton, offsets=size * skeleton.offsets, end_offsets=size * skeleton.end_offsets)


def crowd(path: Path, rig: Path, seed: int = 0, *, compact: bool = False) -> list[tuple[Motion, float]]:
    """People of different sizes, one after the other."""
    scene, skeleton = GlbCrowd(path, compact=compact, character=rig), load_skeleton(rig)
    people = []
    for k, size in enumerate(SIZES):
        motion = writhing(sized(skeleton, size), frames=24, seed=seed + k)
        scene.add(motion, name=f"Person {k}", start=0.3 * k)
        people.append((motion, 0.3 * k))
    scene.save()
    return people


def meshes(glb: Glb) -> list[dict[str, int]]:
    """By person: nodes with a mesh, by name."""
    roots = glb["scenes"][0]["nodes"]
    first = [k for k, root in enumerate(roots) if "start" in glb["nodes"][root].get("extras", {}).get("stridecast", {})]
    out = []
    for begin, end in zip(first, [*first[1:], len(roots)], strict=True):
        nodes = [node for root in roots[begin:end] for node in glb.below(root)]
        out.append({glb["nodes"][node]["name"]: node for node in nodes if "mesh" in glb["nodes"][node]})
    return out


@settings(max_examples=12)
@given(
    seed=st.integers(0, 1000),
    unit=st.sampled_from([1.0, 0.01]),
    armature=st.sampled_from([1.0, 0.01, 2.5]),
    body=st.floats(0.85, 1.15),
    compact=st.booleans(),
)
def test_everybody_looks_as_in_a_file_of_their_own(tmp_path_factory, seed, unit, armature, body, compact):
    folder = tmp_path_factory.mktemp("rig")
    artists_rig(folder / "rig.glb", humanoid(body), seed=seed, unit=unit, armature=armature)
    people = crowd(folder / "crowd.glb", folder / "rig.glb", seed, compact=compact)
    many = Glb((folder / "crowd.glb").read_bytes())
    agree = COMPACT if compact else AGREE
    for size, (motion, start), found in zip(SIZES, people, meshes(many), strict=True):
        write_character(folder / "one.glb", motion, folder / "rig.glb")
        one = Glb((folder / "one.glb").read_bytes())
        assert sorted(found) == sorted(PARTS)
        for frame in range(0, 20, 2):
            worlds, own = many.world(0, start + frame / 30), one.world(0, frame / 30)
            for name, node in found.items():
                wanted = size * unit * one.seen(one.names()[name], own)  # that file keeps its size and unit
                assert np.abs(many.seen(node, worlds) - wanted).max() < agree


@settings(max_examples=10)
@given(seed=st.integers(0, 1000), unit=st.sampled_from([1.0, 0.01]), armature=st.sampled_from([1.0, 0.01]))
def test_joints_are_where_ours_are(tmp_path_factory, seed, unit, armature):
    folder = tmp_path_factory.mktemp("rig")
    artists_rig(folder / "rig.glb", humanoid(), seed=seed, unit=unit, armature=armature)
    people = crowd(folder / "crowd.glb", folder / "rig.glb", seed)
    glb = Glb((folder / "crowd.glb").read_bytes())
    roots = [root for root in glb["scenes"][0]["nodes"] if "mesh" not in glb["nodes"][root]]
    for root, (motion, start) in zip(roots, people, strict=True):
        nodes = {glb["nodes"][node]["name"]: node for node in glb.below(root)}
        ours = kinematics.pose(motion).positions
        for frame in (0, 11, 23):
            worlds = glb.world(0, start + frame / 30)
            there = worlds[[nodes[name] for name in motion.skeleton.names], :3, 3]
            assert np.abs(there - ours[frame]).max() < AGREE
        write_character(folder / "one.glb", motion, folder / "rig.glb")
        one, size = Glb((folder / "one.glb").read_bytes()), unit * motion.skeleton.leg_length / humanoid().leg_length
        there = one.world(0, 11 / 30)[[one.names()[name] for name in motion.skeleton.names], :3, 3]
        assert np.abs(size * there - ours[11]).max() < AGREE
