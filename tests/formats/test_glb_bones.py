"""A file that is posed joint by joint looks as the motion that is written onto it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bodies import humanoid, writhing
from glb_rigs import artists_rig
from glbs import Glb, packed
from stridecast.body.character import Character, character_of, resized
from stridecast.errors import SkeletonError
from stridecast.formats.glb import body_glb
from stridecast.formats.glb_bones import Bones, bones_of
from stridecast.formats.glb_character import write_character
from stridecast.formats.glb_rig import GlbRig
from stridecast.formats.recordings import load_skeleton
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

AGREE = 3e-4


def posed(path, bones: Bones, motion: Motion, frame: int, size: float) -> tuple[Glb, np.ndarray]:
    """The file posed as ``Bones`` says, and matrices of its nodes in the world."""
    glb = Glb(path.read_bytes())
    nodes = GlbRig(path).document["nodes"]  # joints that have a matrix have its parts there
    glb.document["nodes"] = nodes
    for joint, node in enumerate(bones.nodes.tolist()):
        if node >= 0:
            turn = quat.multiply(bones.before[joint], quat.multiply(motion.rotations[frame, joint], bones.after[joint]))
            nodes[node]["rotation"] = turn[[1, 2, 3, 0]].tolist()
    scale = size * bones.size
    place = motion.root_positions[frame] / scale - bones.corner
    nodes[bones.nodes[0]]["translation"] = (quat.rotate(quat.inverse(bones.turn), place) / bones.grown).tolist()
    worlds = glb.world(None, 0.0)
    return glb, np.diag([scale, scale, scale, 1.0]) @ worlds


def character(path) -> Character:
    return character_of(load_skeleton(path), humanoid())


@settings(max_examples=12)
@given(
    seed=st.integers(0, 1000),
    unit=st.sampled_from([1.0, 0.01]),
    armature=st.sampled_from([1.0, 0.01, 2.5]),
    size=st.sampled_from([1.0, 0.8]),
)
def test_a_file_posed_joint_by_joint_looks_as_one_that_is_written(tmp_path_factory, seed, unit, armature, size):
    path = tmp_path_factory.mktemp("rig") / "a.glb"
    artists_rig(path, humanoid(), seed=seed, unit=unit, armature=armature)
    worn = character(path)
    bones = bones_of(path, worn)
    motion = writhing(resized(worn.body, size), frames=12, seed=seed)
    write_character(path.with_name("b.glb"), worn.played(motion), path)
    there = Glb(path.with_name("b.glb").read_bytes())
    for frame in (0, 5, 11):
        here, worlds = posed(path, bones, motion, frame, size)
        written = there.world(0, frame / motion.frame_rate)
        meshes = {node["name"]: k for k, node in enumerate(here["nodes"]) if "mesh" in node}
        for name in ("Coat", "Legs", "Brim"):
            node = meshes[name]
            away = here.seen(node, worlds) - there.seen(node, written) * size * bones.size  # files keep their units
            assert np.abs(away).max() < AGREE, name


def test_a_file_without_meshes_poses_nothing(tmp_path):
    path = tmp_path / "a.glb"
    artists_rig(path, humanoid())
    worn = character(path)
    bare = Glb(path.read_bytes())
    document = {name: part for name, part in bare.document.items() if name != "meshes"}
    for node in document["nodes"]:
        node.pop("mesh", None)
    path.write_bytes(packed(document, bare.numbers))
    assert bones_of(path, worn) is None


def test_another_file_is_refused(tmp_path):
    path = tmp_path / "a.glb"
    artists_rig(path, humanoid())
    (tmp_path / "b.glb").write_bytes(body_glb(Skeleton(**_renamed(humanoid()))))
    with pytest.raises(SkeletonError, match="has no joint"):
        bones_of(tmp_path / "b.glb", character(path))


def _renamed(skeleton: Skeleton) -> dict:
    return {
        "names": tuple(f"other {name}" for name in skeleton.names),
        "parents": skeleton.parents,
        "offsets": skeleton.offsets,
        "roles": skeleton.roles,
    }
