from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bodies import HIP_HEIGHT, humanoid, standing, writhing
from rigs import renamed
from stridecast.body import kinematics
from stridecast.errors import InputError, SkeletonError
from stridecast.formats.bvh import read_bvh, write_bvh
from stridecast.formats.bvh_conventions import BVH_CONVENTIONS, ROOTS, BvhConvention, bvh_convention, standing_height
from stridecast.formats.recordings import load_motion
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from synthetic_gait import gait

ORDERS = ["".join(order) for order in permutations("XYZ")]
ALL = st.builds(
    BvhConvention,
    order=st.sampled_from(ORDERS),
    scale=st.sampled_from([1.0, 0.01, 0.001, 0.0254]),
    up=st.sampled_from(["Y", "Z"]),
    root=st.sampled_from(ROOTS),
    rest_frame=st.booleans(),
)


def walking(frames: int = 60) -> Motion:
    """A walk in a curve that starts away from the origin, with arms that do something."""
    motion = gait(np.full(frames, 1.2), curvature=0.4, facing=2.0).motion
    rotations = motion.rotations.copy()
    wild = writhing(motion.skeleton, frames=frames, seed=3).rotations
    for role in ("chest", "head", "left_upper_arm", "right_forearm"):
        rotations[:, motion.skeleton.joint(role)] = wild[:, motion.skeleton.joint(role)]
    return replace(motion, rotations=rotations, root_positions=motion.root_positions + np.array([3.0, 0.0, -2.0]))


def check_same(read: Motion, motion: Motion) -> None:
    back = [read.skeleton.names.index(name) for name in motion.skeleton.names]
    assert read.skeleton.joints == motion.skeleton.joints
    assert read.skeleton.roles["hips"] == 0
    np.testing.assert_allclose(read.skeleton.offsets[back], motion.skeleton.offsets, atol=1e-7)
    ours, theirs = kinematics.pose(motion), kinematics.pose(read)
    np.testing.assert_allclose(theirs.positions[:, back], ours.positions, atol=1e-6)
    turned = quat.multiply(quat.inverse(read.rotations[:, back]), motion.rotations)
    assert np.abs(quat.log(turned)).max() < 1e-6


@given(ALL)
@settings(max_examples=30)
def test_reader_finds_the_same_motion_again(tmp_path_factory, convention):
    motion, path = walking(), tmp_path_factory.getbasetemp() / "convention.bvh"
    write_bvh(path, motion, convention=convention)
    check_same(load_motion(path, scale=convention.scale), motion)


@pytest.mark.parametrize("name", BVH_CONVENTIONS)
@pytest.mark.parametrize("family", ["Mixamo", "Bandai-Namco", "Unreal"])
def test_every_program_s_file_reads_back(tmp_path, name, family):
    motion = walking()
    motion = replace(motion, skeleton=replace(motion.skeleton, names=renamed(family)))
    write_bvh(tmp_path / "a.bvh", motion, convention=name)
    check_same(load_motion(tmp_path / "a.bvh", scale=BVH_CONVENTIONS[name].scale), motion)


def test_unit_is_found_without_being_told(tmp_path):
    write_bvh(tmp_path / "a.bvh", walking(), convention="motionbuilder")
    check_same(load_motion(tmp_path / "a.bvh"), walking())


def test_somebody_who_only_stands_comes_back_without_the_rest_frame(tmp_path):
    """Hardly a joint moves from the rest pose to this: no jump would tell them apart."""
    motion = standing(frames=5)
    rotations = motion.rotations.copy()
    rotations[:, 3] = quat.exp(np.array([0.01, 0.0, 0.0]))
    motion = replace(motion, rotations=rotations)
    write_bvh(tmp_path / "a.bvh", motion, convention="motionbuilder")
    read = load_motion(tmp_path / "a.bvh", scale=0.01)
    assert read.frames == 5
    check_same(read, motion)


def test_programs_get_what_they_expect(tmp_path):
    motion = walking()
    for name, height in (("plain", 0.0), ("blender", HIP_HEIGHT), ("motionbuilder", 100 * HIP_HEIGHT)):
        write_bvh(tmp_path / "a.bvh", motion, convention=name)
        raw = read_bvh(tmp_path / "a.bvh")
        np.testing.assert_allclose(raw.offsets[0], [0.0, height, 0.0], atol=1e-6)
        first = quat.log(raw.rotations[0])
        assert (np.abs(first).max() < 1e-12) == (name == "motionbuilder")
        assert len(raw.root_positions) == motion.frames + (name == "motionbuilder")


def test_unreal_gets_a_root_on_the_floor_that_goes_where_the_hips_go(tmp_path):
    motion = walking(frames=120)
    write_bvh(tmp_path / "a.bvh", motion, convention="unreal")
    raw = read_bvh(tmp_path / "a.bvh")
    assert raw.names[:2] == ("root", "Hips")
    assert not raw.root_positions[:, 1].any()
    apart = raw.root_positions[:, [0, 2]] / 100 - motion.root_positions[:, [0, 2]]
    assert np.linalg.norm(apart, axis=-1)[30:-30].max() < 0.05
    np.testing.assert_allclose(np.abs(raw.rotations[:, 0, [1, 3]]), 0.0, atol=1e-9)
    facing = quat.rotate(motion.rotations[:, 0], np.array([0.0, 0.0, 1.0]))
    assert (np.sum(facing * quat.rotate(raw.rotations[:, 0], np.array([0.0, 0.0, 1.0])), axis=-1) > 0.9).all()


def test_hips_called_root_become_the_pelvis(tmp_path):
    motion = walking()
    names = ("root", *motion.skeleton.names[1:])
    write_bvh(tmp_path / "a.bvh", replace(motion, skeleton=replace(motion.skeleton, names=names)), convention="unreal")
    assert read_bvh(tmp_path / "a.bvh").names[:2] == ("root", "pelvis")
    names = ("root", "pelvis", *motion.skeleton.names[2:])
    with pytest.raises(SkeletonError, match="root"):
        write_bvh(
            tmp_path / "a.bvh", replace(motion, skeleton=replace(motion.skeleton, names=names)), convention="unreal"
        )


def test_single_things_may_be_otherwise(tmp_path):
    assert bvh_convention("unreal", order="zxy", up="z") == BvhConvention(
        order="ZXY", scale=0.01, up="Z", root="ground"
    )
    write_bvh(tmp_path / "a.bvh", walking(), convention="Blender", order="XYZ", scale=0.01)
    assert "Zposition Xrotation Yrotation Zrotation" in (tmp_path / "a.bvh").read_text()
    check_same(load_motion(tmp_path / "a.bvh", scale=0.01), walking())


def test_z_up_stands_along_z_and_faces_minus_y(tmp_path):
    motion = standing(frames=3)
    write_bvh(tmp_path / "a.bvh", motion, convention=BvhConvention(up="Z", root="standing"))
    raw = read_bvh(tmp_path / "a.bvh")
    np.testing.assert_allclose(raw.offsets[0], [0.0, 0.0, HIP_HEIGHT], atol=1e-8)
    toe = raw.names.index("LeftToeBase")
    np.testing.assert_allclose(raw.offsets[toe], [0.0, -0.13, -0.06], atol=1e-8)


def test_rest_pose_stands_on_its_lowest_point():
    assert standing_height(humanoid()) == pytest.approx(HIP_HEIGHT)
    bare = replace(humanoid(), end_joints=np.zeros(0, np.int64), end_offsets=np.zeros((0, 3)))
    assert standing_height(bare) == pytest.approx(HIP_HEIGHT - 0.01)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"convention": "maya"}, "maya.*blender"),
        ({"convention": "blender", "order": "XXZ"}, "order"),
        ({"scale": -1.0}, "scale"),
    ],
)
def test_conventions_that_are_none(tmp_path, options, message):
    with pytest.raises(InputError, match=message):
        write_bvh(tmp_path / "a.bvh", standing(), **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "value"), [("up", "X"), ("up", "-Y"), ("root", "floor")])
def test_axes_and_roots_that_are_none(name, value):
    with pytest.raises(InputError, match=value.upper() if name == "up" else value):
        BvhConvention(**{name: value})
