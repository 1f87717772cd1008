from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from bodies import humanoid, standing, writhing
from rigs import FAMILIES, along_x, renamed
from stridecast.body import kinematics
from stridecast.errors import FileError, InputError, MotionError, SkeletonError
from stridecast.formats.bvh import write_bvh
from stridecast.formats.recordings import load_motion, load_recording, load_skeleton
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import LEGS

BOTH = ("02_01", "09_01", "09_12")
"""Takes that are there as BVH and as AMC."""


def places(motion: Motion, roles: list[str]) -> np.ndarray:
    return kinematics.pose(motion).positions[:, motion.skeleton.chain(*roles)]


def called(motion: Motion, family: str) -> Motion:
    skeleton = motion.skeleton
    other = type(skeleton)(
        names=renamed(family),
        parents=skeleton.parents,
        offsets=skeleton.offsets,
        end_joints=skeleton.end_joints,
        end_offsets=skeleton.end_offsets,
    )
    return Motion(
        skeleton=other,
        frame_rate=motion.frame_rate,
        root_positions=motion.root_positions,
        rotations=motion.rotations,
    )


def upright(frames: int = 60) -> Motion:
    motion = writhing(frames=frames)
    rotations = motion.rotations.copy()
    rotations[:, 1:] = quat.exp(0.4 * quat.log(rotations[:, 1:]))
    rotations[:, 0] = quat.about_y(quat.twist_about_y(rotations[:, 0]))
    return Motion(skeleton=motion.skeleton, frame_rate=30.0, root_positions=motion.root_positions, rotations=rotations)


@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize("scale", [0.01, 0.0254])
def test_what_is_written_loads_as_the_same_movement(tmp_path, family, scale):
    original = upright()
    rig = along_x(original) if family == "LaFAN1" else original
    write_bvh(tmp_path / "take.bvh", called(rig, family), scale=scale)
    motion, notes = load_recording(tmp_path / "take.bvh")
    roles = list(original.skeleton.roles)
    assert sorted(motion.skeleton.roles) == sorted(roles)
    np.testing.assert_allclose(places(motion, roles), places(original, roles), atol=1e-6)
    assert motion.frame_rate == 30.0
    assert any("centimetres" in note or "inches" in note for note in notes)


def test_name_subject_and_source(tmp_path):
    folder = tmp_path / "anna"
    folder.mkdir()
    for name, subject in (("02_01", "02"), ("127_03_trimmed", "127"), ("walk_01", "anna"), ("01", "anna")):
        path = folder / f"{name}.BVH"
        write_bvh(path, standing())
        motion = load_motion(path)
        assert (motion.name, motion.subject, motion.source) == (name, subject, str(path))
        assert load_motion(path, subject="").subject == ""
        assert load_motion(str(path), subject="bea").subject == "bea"


def test_options_reach_the_conventions(tmp_path):
    path = tmp_path / "take.bvh"
    write_bvh(path, standing(), scale=0.01)
    assert load_motion(path, frame_rate=24.0).frame_rate == 24.0
    assert load_motion(path, scale=0.02).skeleton.leg_length == pytest.approx(2 * humanoid().leg_length)
    assert np.ptp(places(load_motion(path, up="Z"), ["hips", "head"])[..., 1]) < 0.1
    assert load_motion(path, roles={"chest": "Spine1"}).skeleton.names[3] == "Chest"
    with pytest.raises(SkeletonError, match=r"take.bvh: there is no joint 'Torso'"):
        load_motion(path, roles={"chest": "Torso"})
    with pytest.raises(InputError, match="scale"):
        load_motion(path, scale=-1.0)


@pytest.mark.parametrize("name", ["walk.fbx", "walk", "walk.txt", "walk.asf"])
def test_other_files_are_refused_with_what_can_be_read(tmp_path, name):
    (tmp_path / name).write_bytes(b"Kaydara FBX Binary  \0" if name.endswith("fbx") else b"once upon a time")
    with pytest.raises(FileError, match=r"readable are \*.bvh \(BVH\), \*.amc \(AMC with its ASF\)"):
        load_motion(tmp_path / name)


def test_recordings_are_known_by_their_words_too(tmp_path):
    write_bvh(tmp_path / "take.txt", standing())
    assert load_motion(tmp_path / "take.txt").name == "take"
    (tmp_path / "take.dat").write_bytes(b"Kaydara FBX Binary  \0")
    with pytest.raises(FileError, match="it looks like an FBX file"):
        load_motion(tmp_path / "take.dat")
    with pytest.raises(FileError, match="cannot be read"):
        load_motion(tmp_path / "take.xyz")


def test_an_asf_is_only_a_skeleton(tmp_path):
    (tmp_path / "02.asf").write_text(":version 1.10\n")
    with pytest.raises(FileError, match="the motion is in its AMC files"):
        load_motion(tmp_path / "02.asf")
    with pytest.raises(FileError, match=r"readable are \*.bvh \(BVH\), \*.asf \(ASF\)"):
        load_skeleton(tmp_path / "02.amc")


def test_errors_name_the_file(tmp_path):
    with pytest.raises(FileError, match=r"none.bvh: cannot be read"):
        load_motion(tmp_path / "none.bvh")
    write_bvh(tmp_path / "still.bvh", standing(frames=1))
    with pytest.raises(MotionError, match=r"still.bvh: a motion needs at least 2 frames"):
        load_motion(tmp_path / "still.bvh")
    write_bvh(tmp_path / "stick.bvh", standing())
    (tmp_path / "stick.bvh").write_text((tmp_path / "stick.bvh").read_text().replace("LeftLeg", "Stick"))
    for load in (load_motion, load_skeleton):
        with pytest.raises(SkeletonError, match=r"stick.bvh: no joint found for left_shin; joints are Hips"):
            load(tmp_path / "stick.bvh")


def test_a_skeleton_alone(tmp_path):
    write_bvh(tmp_path / "a.bvh", standing(frames=1), scale=0.01)
    skeleton, body = load_skeleton(tmp_path / "a.bvh"), humanoid()
    assert dict(skeleton.roles) == {role: skeleton.names.index(body.names[j]) for role, j in body.roles.items()}
    assert skeleton.leg_length == pytest.approx(body.leg_length)
    assert load_skeleton(tmp_path / "a.bvh", scale=1.0).leg_length == pytest.approx(100 * body.leg_length)


def takes(mocap: Path) -> list[dict[str, str]]:
    with (mocap / "manifest.csv").open(newline="") as file:
        return [row for row in csv.DictReader(file) if row["file"].endswith((".bvh", ".amc"))]


def test_every_take_loads_as_a_person(mocap):
    for row in takes(mocap):
        motion, notes = load_recording(mocap / row["file"])
        skeleton = motion.skeleton
        t_pose = row["tpose_first_frame"] == "yes"
        assert any("T-pose" in note for note in notes) == t_pose, row["file"]
        assert motion.frames == int(row["frames"]) - t_pose
        assert motion.frame_rate == 120.0
        assert motion.subject == row["subject"].zfill(2)
        assert skeleton.leg_length == pytest.approx(float(row["leg_m"]), abs=0.012), row["file"]
        rest = kinematics.rest(skeleton).positions
        for side, sign in (("left", 1.0), ("right", -1.0)):
            thigh, shin, foot, toe = rest[skeleton.chain(*(f"{side}_{part}" for part in LEGS))]
            assert sign * thigh[0] > 0.05
            assert thigh[1] > shin[1] > foot[1]
            assert toe[2] - foot[2] > 0.1
        pose = kinematics.pose(motion).positions
        head = pose[:, skeleton.joint("head"), 1] - pose[:, skeleton.chain("left_toe", "right_toe"), 1].min(axis=1)
        assert 1.1 < np.median(head) < 1.6, row["file"]
        assert np.abs(pose[:, skeleton.chain("left_toe", "right_toe"), 1].min()) < 0.07


@pytest.mark.parametrize("take", BOTH)
def test_both_formats_agree(mocap, take):
    folder = mocap / "cmu" / take[:2]
    bvh, amc = load_motion(folder / f"{take}.bvh"), load_motion(folder / f"{take}.amc")
    roles = ["hips", "spine", "spine1", "chest", *(f"{side}_{part}" for side in ("left", "right") for part in LEGS)]
    np.testing.assert_allclose(places(bvh, roles), places(amc, roles), atol=2e-4)
    # the BVH lacks the bone between chest and neck
    above = places(amc, ["neck"]) - places(bvh, ["neck"])
    np.testing.assert_allclose(np.linalg.norm(above, axis=-1), 0.114, atol=0.005)


def test_an_asf_gives_the_skeleton_of_its_takes(mocap):
    alone = load_skeleton(mocap / "cmu" / "09" / "09.asf")
    taken = load_motion(mocap / "cmu" / "09" / "09_01.amc").skeleton
    assert alone.names == taken.names
    np.testing.assert_array_equal(alone.offsets, taken.offsets)
    assert dict(alone.roles) == dict(taken.roles)


@pytest.mark.parametrize("file", ["cmu/09/09_01.bvh", "cmu/16/16_55.amc", "cmu-other/131_01.bvh"])
@pytest.mark.parametrize("order", ["ZYX", "YXZ"])
def test_recordings_survive_writing(mocap, tmp_path, file, order):
    motion = load_motion(mocap / file)
    write_bvh(tmp_path / "again.bvh", motion, order=order)
    again, notes = load_recording(tmp_path / "again.bvh")
    roles = list(motion.skeleton.roles)
    assert not any("left out" in note or "turned" in note for note in notes)
    np.testing.assert_allclose(places(again, roles), places(motion, roles), atol=1e-6)
