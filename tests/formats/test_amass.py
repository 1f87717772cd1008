from __future__ import annotations

import tracemalloc
import zipfile
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

import stridecast.formats.amass as amass
from smpl_files import UP, amass_arrays, body_model, on_smpl, write_amass
from stridecast.analysis.take import analyse
from stridecast.body import kinematics
from stridecast.building.build import build
from stridecast.cli.main import app
from stridecast.errors import FileError, TakeError
from stridecast.formats.amass import read_amass
from stridecast.formats.recordings import load_motion, load_recording
from stridecast.formats.smpl import BODY, MODELS, joint_parents, mean_skeleton, read_body_model
from stridecast.formats.store import load_database
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.samples.corpus import RECIPES, sample_take
from stridecast.synthesis.walker import Walker


@cache
def walked(name: str = "walk_turns", scale: float = 1.0, frames: int | None = None) -> Motion:
    recipe = next(recipe for recipe in RECIPES if recipe.name == name)
    motion = sample_take(recipe, seed=3).motion
    return on_smpl(motion if frames is None else motion.clip(0, frames), scale)


def short() -> Motion:
    return walked(frames=40)


@pytest.mark.parametrize("name", ["walk_turns", "walk_start_stop", "run_turns"])
def test_a_walk_comes_back_with_its_ground_path_and_contacts(tmp_path, name):
    motion = walked(name)
    loaded, notes = load_recording(write_amass(tmp_path / f"{name}.npz", motion))
    world, again = kinematics.pose(motion), kinematics.pose(loaded)
    np.testing.assert_allclose(again.positions, world.positions, atol=1e-6)
    here, there = analyse(motion), analyse(loaded)
    np.testing.assert_allclose(there.vehicle.positions, here.vehicle.positions, atol=1e-6)
    np.testing.assert_array_equal(there.contacts.planted, here.contacts.planted)
    assert loaded.frame_rate == 60.0
    assert any("mean one" in note and "30 joints" in note for note in notes)
    assert any("Z is taken for up" in note for note in notes)


@pytest.mark.parametrize("scale", [0.92, 1.08])
def test_other_people_on_the_mean_skeleton_step_as_they_did(tmp_path, scale):
    motion = walked(scale=scale)
    loaded = load_motion(write_amass(tmp_path / "a.npz", motion))
    here, there = analyse(motion), analyse(loaded)
    assert np.mean(there.contacts.planted == here.contacts.planted) > 0.99
    np.testing.assert_allclose(there.vehicle.positions, here.vehicle.positions, atol=0.03)
    assert len(there.gait.segments) == len(here.gait.segments)


def test_the_body_model_of_the_user_gives_everybody_their_own_bones(tmp_path):
    motion = walked(scale=1.1, frames=60)
    arrays = amass_arrays(motion, origin=1.1 * mean_skeleton().origin) | {"betas": np.array([1.0, 5.0, 0.0, 9.0])}
    np.savez(tmp_path / "a.npz", **arrays)
    model = body_model(tmp_path / "model.npz")
    loaded, notes = load_recording(tmp_path / "a.npz", body_model=model)
    assert loaded.skeleton.leg_length == pytest.approx(motion.skeleton.leg_length)
    assert loaded.skeleton.names == MODELS["SMPL+H"]
    at = [loaded.skeleton.names.index(name) for name in BODY]
    np.testing.assert_allclose(kinematics.pose(loaded).positions[:, at], kinematics.pose(motion).positions, atol=1e-6)
    assert not any("mean" in note for note in notes)
    recording = read_amass(tmp_path / "a.npz", body_model=model)
    np.testing.assert_allclose(recording.end_offsets, 1.1 * mean_skeleton().end_offsets, atol=1e-9)


@pytest.mark.parametrize("model", list(MODELS))
def test_fingers_and_faces_hang_where_they_belong(model):
    names, parents = MODELS[model], joint_parents(MODELS[model])
    above = {name: names[parent] for name, parent in zip(names[1:], parents[1:], strict=True)}
    assert len(names) == {"SMPL": 24, "SMPL+H": 52, "SMPL-X": 55}[model]
    assert (parents[1:] < np.arange(1, len(names))).all()
    assert above["left_foot"] == "left_ankle"
    assert above["head"] == "neck"
    assert above["right_collar"] == "spine3"
    if model == "SMPL":
        assert above["right_hand"] == "right_wrist"
    else:
        assert above["left_index1"] == above["left_thumb1"] == "left_wrist"
        assert above["right_ring3"] == "right_ring2"
    if model == "SMPL-X":
        assert above["jaw"] == above["left_eye_smplhf"] == "head"


def test_the_mean_skeleton_is_an_adult():
    body = smpl_rest()
    assert 1.60 < body["head"][1] - body["left_foot"][1] + 0.19 + 0.02 < 1.80
    for left in (name for name in BODY if name.startswith("left")):
        np.testing.assert_allclose(body[left], body[left.replace("left", "right")] * [-1, 1, 1], atol=1e-12)
    assert body["left_foot"][2] > body["left_ankle"][2] + 0.1
    assert body["left_wrist"][0] > 0.6


def smpl_rest() -> dict[str, np.ndarray]:
    body = mean_skeleton()
    places = body.offsets.copy()
    for joint in range(1, len(places)):
        places[joint] += places[body.parents[joint]]
    return dict(zip(body.names, places, strict=True))


def forms(arrays: dict[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
    """The same motion in the words of others."""
    poses, trans = arrays["poses"], arrays["trans"]
    return {
        "SMPL": {"poses": poses[:, :72], "trans": trans, "fps": np.array([60])},
        "SMPL-X": {
            "poses": np.concatenate((poses, np.zeros((len(poses), 9))), axis=1),
            "trans": trans,
            "mocap_frame_rate": np.array(60),
            "surface_model_type": np.array("smplx"),
        },
        "parts of AMASS": {
            "root_orient": poses[:, :3],
            "pose_body": poses[:, 3:66],
            "trans": trans,
            "mocap_framerate": np.array(60.0),
        },
        "smplx": {
            "global_orient": poses[:, None, :3],
            "body_pose": poses[:, 3:72].reshape(-1, 23, 3),
            "transl": trans,
            "framerate": np.array(60),
        },
        "single precision, in columns": {
            "poses": np.asfortranarray(poses.astype(np.float32)),
            "trans": trans.astype(">f4"),
            "frame_rate": np.array(60),
        },
    }


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("form", [*forms({"poses": np.zeros((2, 156)), "trans": np.zeros((2, 3))})])
def test_all_ways_to_name_it_are_read(tmp_path, form, packed):
    motion = short()
    (np.savez_compressed if packed else np.savez)(tmp_path / "a.npz", **forms(amass_arrays(motion))[form])
    recording = read_amass(tmp_path / "a.npz")
    assert recording.frame_rate == 60.0
    assert recording.names == BODY
    loaded = load_motion(tmp_path / "a.npz")
    np.testing.assert_allclose(kinematics.pose(loaded).positions, kinematics.pose(motion).positions, atol=1e-5)


def test_y_up_and_other_rates_and_pickles_beside(tmp_path):
    motion = short()
    arrays = amass_arrays(motion)
    poses = arrays["poses"].reshape(motion.frames, -1, 3).copy()
    poses[:, 0] = quat.log(motion.rotations[:, 0])
    arrays |= {"poses": poses.reshape(motion.frames, -1), "trans": motion.root_positions - mean_skeleton().origin}
    del arrays["mocap_framerate"]
    arrays["labels"] = np.array([{"a": 1}, None], dtype=object)
    np.savez(tmp_path / "a.npz", **arrays)
    loaded, notes = load_recording(tmp_path / "a.npz", assumed_rate=50.0)
    assert loaded.frame_rate == 50.0
    assert load_motion(tmp_path / "a.npz", frame_rate=25.0).frame_rate == 25.0
    assert load_motion(tmp_path / "a.npz").frame_rate == 120.0
    assert not any("taken for up" in note for note in notes)
    np.testing.assert_allclose(kinematics.pose(loaded).positions, kinematics.pose(motion).positions, atol=1e-6)


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.integers(2, 5))
def test_any_poses_come_back(tmp_path_factory, seed, frames):
    rng = np.random.default_rng(seed)
    poses, trans = rng.normal(size=(frames, 66)), rng.normal(size=(frames, 3))
    path = tmp_path_factory.mktemp("any") / "a.npz"
    np.savez(path, poses=poses, trans=trans, fps=30.0)
    recording = read_amass(path)
    turned = quat.log(recording.rotations).reshape(frames, -1)
    angle = np.linalg.norm(poses.reshape(frames, -1, 3), axis=-1).reshape(-1)
    same = np.repeat(angle < 3.1, 3)  # beyond pi the same rotation has a shorter vector
    np.testing.assert_allclose(turned.reshape(-1)[same], poses.reshape(-1)[same], atol=1e-9)
    np.testing.assert_allclose(recording.root_positions - mean_skeleton().origin, trans, atol=1e-12)


def test_a_database_learns_from_it_and_walks(tmp_path):
    folder = tmp_path / "anna"
    folder.mkdir()
    for name in ("walk_turns", "walk_start_stop", "walk_faster"):
        write_amass(folder / f"{name}.npz", walked(name))
    (folder / "shape.npz").write_bytes(b"no archive")
    database = build(folder, jobs=1, cache=False)
    assert [take.name for take in database.takes if take.left_out] == ["shape"]
    assert {take.subject for take in database.takes if not take.left_out} == {"anna"}
    walker = Walker(database, position=(0.0, 0.0), heading=0.0)
    places = [walker.step((0.0, 1.3 * frame / 30.0 + 0.3)).vehicle.position for frame in range(150)]
    assert places[-1][1] > 5.0
    with pytest.raises(FileError, match=r"none.npz: cannot be read"):
        build(folder, body_model=tmp_path / "none.npz", jobs=1, cache=False)
    model = body_model(tmp_path / "model.npz", scale=1.05)
    taller = build(folder / "walk_turns.npz", body_model=model, jobs=1)
    assert taller.skeleton.leg_length == pytest.approx(1.05 * database.skeleton.leg_length)
    again = build(folder / "walk_turns.npz", jobs=1)
    assert again.skeleton.leg_length == pytest.approx(database.skeleton.leg_length)


def refused(path: Path, match: str, **options) -> None:
    with pytest.raises(FileError, match=match) as caught:
        read_amass(path, **options)
    assert str(caught.value).startswith(str(options.get("body_model", path)))


CHANGES = {
    r"where the body is is missing \(trans or transl or smpl_trans\)": {"trans": None},
    r"how the body is turned is missing": {"poses": None},
    r"'poses' has shape \(40, 155\); a pose has three numbers a joint": {"poses": np.zeros((40, 155))},
    r"'poses' has shape \(156,\)": {"poses": np.zeros(156)},
    r"'trans' should have 3 numbers a frame, but has shape \(40, 2\)": {"trans": np.zeros((40, 2))},
    r"has 40 poses, but 39 places": {"trans": np.zeros((39, 3))},
    r"'poses' should be an array of numbers, not of text": {"poses": np.full((40, 156), "a")},
    r"'poses' should be an array of numbers, not of Python objects": {"poses": np.full((40, 156), None)},
    r"'poses' should be an array of numbers, not of complex": {"poses": np.zeros((40, 156), complex)},
    r"'mocap_framerate' should be frames a second, not 0": {"mocap_framerate": np.array(0)},
    r"'mocap_framerate' should be frames a second, not nan": {"mocap_framerate": np.array(np.nan)},
    r"'mocap_framerate' should be one number": {"mocap_framerate": np.zeros(3)},
    r"'mocap_framerate' should be an array of numbers": {"mocap_framerate": np.array("fast")},
}


@pytest.mark.parametrize("match", list(CHANGES))
def test_what_is_wrong_is_told(tmp_path, match):
    refused(write_amass(tmp_path / "a.npz", short(), **CHANGES[match]), match)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_numbers_that_are_none_are_told_with_their_frame(tmp_path, value):
    poses = amass_arrays(short())["poses"]
    poses[7, 5] = value
    refused(
        write_amass(tmp_path / "a.npz", short(), poses=poses), r"frame 7 \(counted from 0\): number 5 of 'poses' is"
    )


def test_no_archive_at_all(tmp_path):
    refused(tmp_path / "none.npz", "cannot be read")
    for data in (b"", b"PK\x03\x04", b"HIERARCHY", b"PK\x05\x06", b"\0" * 100_000):
        (tmp_path / "a.npz").write_bytes(data)
        refused(tmp_path / "a.npz", "no .npz file")
    np.save(tmp_path / "b.npy", np.zeros(3))
    (tmp_path / "b.npy").rename(tmp_path / "b.npz")
    refused(tmp_path / "b.npz", "no .npz file")


def test_a_cut_file_is_refused_wherever_it_is_cut(tmp_path):
    data = write_amass(tmp_path / "a.npz", short()).read_bytes()
    path = tmp_path / "cut.npz"
    for length in range(0, len(data), max(len(data) // 40, 1)):
        path.write_bytes(data[:length])
        with pytest.raises(FileError):
            read_amass(path)


@settings(max_examples=60)
@given(st.data())
def test_damage_is_an_error_or_harmless(tmp_path_factory, data):
    path = write_amass(tmp_path_factory.mktemp("damage") / "a.npz", short())
    whole = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 8))):
        whole[-data.draw(st.integers(1, min(len(whole), 3000)))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole)
    with suppress(FileError):  # and nothing else
        assert read_amass(path).rotations.shape[1:] == (len(BODY), 4)


def header(shape: str, dtype: str = "<f8") -> bytes:
    text = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def peak(path: Path, match: str) -> int:
    tracemalloc.start()
    try:
        refused(path, match)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_claims_of_size_cost_no_memory(tmp_path):
    path = tmp_path / "a.npz"
    for shape, match in (
        ("(1099511627776, 156)", "claims to have|is cut|at most"),
        ("(999999999999999999, 156)", "which is none"),
        ("(1000000, 156)", "is cut: its shape"),
        ("(-4, 156)", "which is none"),
        ("(4, 156), 'evil': __import__('os')", "no NumPy array"),
        ("(" * 500 + ")" * 500, "no NumPy array"),
    ):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("poses.npy", header(shape) + b"\0" * 64)
            archive.writestr("trans.npy", header("(4, 3)") + b"\0" * 96)
        assert peak(path, match) < 4e6


def test_a_bomb_is_not_unpacked(tmp_path):
    path, frames = tmp_path / "bomb.npz", 1 << 20
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, width in (("poses", 156), ("trans", 3)):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                member.write(header(f"({frames}, {width})", "|i1"))
                for _ in range(width):
                    member.write(b"\0" * frames)
    assert path.stat().st_size < 1e6
    assert peak(path, rf"'poses' has {frames} frames; at most {amass.MOST_FRAMES}") < 4e6


def test_a_member_that_holds_more_than_it_says_is_damaged(tmp_path):
    path = write_amass(tmp_path / "a.npz", short(), poses=np.zeros((40, 156)))
    data = bytearray(path.read_bytes())
    length = 128 + 40 * 156 * 8
    places = [k for k in range(len(data) - 4) if data[k : k + 4] == length.to_bytes(4, "little")]
    for place in places:
        data[place : place + 4] = (2 * length).to_bytes(4, "little")
    path.write_bytes(data)
    assert len(places) >= 2
    refused(path, "'poses' is (cut|damaged)")


def test_other_ways_to_pack_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("poses.npy", header("(4, 66)") + b"\0" * 4 * 66 * 8)
    refused(path, "packed as NumPy packs nothing")
    with zipfile.ZipFile(path, "w") as archive:
        for k in range(10_001):
            archive.writestr(f"{k}.npy", b"")
    refused(path, "more than 10000 arrays")


def test_body_models_that_are_none(tmp_path):
    path, take = tmp_path / "m.npz", write_amass(tmp_path / "a.npz", short())
    joints = len(MODELS["SMPL+H"])
    for match, changes in {
        "do not fit together": {"v_template": np.zeros((joints, 2))},
        "they are": {"shapedirs": np.zeros((joints, 3, 501))},
        r"J_regressor \(joints": {"J_regressor": np.eye(5)},
        "body model of 51 joints; known are 24": {"J_regressor": np.eye(joints)[:51]},
        "makes a leg of 0 m": {"J_regressor": np.zeros((joints, joints))},
        "makes a leg of 77.9 m": {"J_regressor": 100 * np.eye(joints)},
        "not finite": {"v_template": np.full((joints, 3), np.nan)},
        "Python objects": {"J_regressor": np.full((joints, joints), None)},
    }.items():
        body_model(path, **changes)
        refused(take, match, body_model=path)
    np.savez(path, v_template=np.zeros((4, 3)))
    refused(take, "is no body model: it lacks shapedirs, J_regressor", body_model=path)
    body_model(path)
    np.savez(tmp_path / "b.npz", poses=np.zeros((4, 66)), trans=np.zeros((4, 3)))
    with pytest.raises(FileError, match=r"b.npz: has no 'betas'"):
        read_amass(tmp_path / "b.npz", body_model=path)
    assert read_body_model(path, np.zeros(0)).names == MODELS["SMPL+H"]


def test_no_take_is_read_where_nobody_walks(tmp_path):
    np.savez(tmp_path / "a.npz", poses=np.zeros((4, 66)), trans=np.zeros((4, 3)), fps=30)
    with pytest.raises(TakeError):
        build(tmp_path / "a.npz", jobs=1, cache=False)


def test_up_is_what_it_says():
    np.testing.assert_allclose(quat.rotate(UP, np.array([0.0, 1.0, 0.0])), [0.0, 0.0, 1.0], atol=1e-12)


def test_the_command_takes_a_body_model(tmp_path):
    take, out = write_amass(tmp_path / "walk_turns.npz", walked()), tmp_path / "out.safetensors"
    model = body_model(tmp_path / "model.npz", scale=1.05)

    def call(*words: object) -> Result:
        return CliRunner().invoke(app, [str(word) for word in ("build", take, "-o", out, "--jobs", 1, *words)])

    assert call("--body-model", model).exit_code == 0
    assert load_database(out).skeleton.leg_length == pytest.approx(1.05 * walked().skeleton.leg_length)
    wrong = call("--body-model", take)
    assert wrong.exit_code == 2
    assert "walk_turns.npz: is no body model: it lacks v_template" in wrong.stderr
