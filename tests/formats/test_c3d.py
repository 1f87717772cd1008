from __future__ import annotations

import struct
import tracemalloc
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marker_files import centre_places, marker_places, write_c3d
from stridecast.analysis.take import analyse
from stridecast.body import kinematics
from stridecast.body.joint_centres import bend_axis, unit
from stridecast.building.build import build
from stridecast.errors import FileError, MotionError
from stridecast.formats.c3d import LONGEST_GAP, read_c3d
from stridecast.formats.c3d_file import read_c3d_points
from stridecast.formats.recordings import load_motion, load_recording
from stridecast.model.motion import Motion
from stridecast.samples.corpus import RECIPES, sample_take

pytest.importorskip("ezc3d", reason="ezc3d writes the files (pip install 'stridecast[dev]')")

LEGS = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("thigh", "shin", "foot", "toe"))
TRUNK = ("hips", "chest", "neck", "head")
ARMS = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("upper_arm", "forearm", "hand"))


@cache
def walked(name: str = "walk_turns", frames: int | None = None) -> Motion:
    motion = sample_take(next(recipe for recipe in RECIPES if recipe.name == name), seed=3).motion
    return motion if frames is None else motion.clip(0, frames)


def off(loaded: Motion, motion: Motion, roles: tuple[str, ...]) -> np.ndarray:
    """How far joints are apart, (frames, roles), metres."""
    one = kinematics.pose(loaded).positions[:, loaded.skeleton.chain(*roles)]
    return np.linalg.norm(one - kinematics.pose(motion).positions[:, motion.skeleton.chain(*roles)], axis=-1)


@pytest.mark.parametrize("name", ["walk_turns", "walk_start_stop", "run_turns"])
@pytest.mark.parametrize("inner", [False, True])
def test_joints_come_out_of_markers(tmp_path, name, inner):
    motion = walked(name)
    path = write_c3d(tmp_path / "a.c3d", marker_places(motion, inner), motion.frame_rate)
    loaded, notes = load_recording(path)
    # stated: with inner markers 3 mm; without them 10 mm on average and 30 mm at worst, where feet twist under shins
    legs = off(loaded, motion, LEGS)
    assert legs.mean() < (0.003 if inner else 0.010)
    assert legs.max() < (0.005 if inner else 0.030)
    assert off(loaded, motion, ("chest", "neck", "head")).max() < 0.015
    assert off(loaded, motion, ARMS).max() < 0.020
    assert loaded.skeleton.leg_length == pytest.approx(motion.skeleton.leg_length, abs=0.003)
    here, there = analyse(motion), analyse(loaded)
    assert np.mean(here.contacts.planted == there.contacts.planted) > 0.99
    np.testing.assert_allclose(there.vehicle.positions, here.vehicle.positions, atol=0.02)
    assert any("a skeleton was fitted" in note for note in notes)


@pytest.mark.parametrize("upper", [False, True])
def test_joint_centres_stay_where_they_are(tmp_path, upper):
    motion = walked()
    path = write_c3d(tmp_path / "a.c3d", centre_places(motion, upper=upper), motion.frame_rate, unit="m")
    loaded = load_motion(path)
    assert off(loaded, motion, LEGS).max() < 0.005
    assert ("left_hand" in loaded.skeleton.roles) == upper
    if upper:
        assert off(loaded, motion, ("neck", "head", *ARMS)).max() < 0.02
    there = analyse(loaded)
    assert np.mean(analyse(motion).contacts.planted == there.contacts.planted) > 0.99


def knees(motion: Motion) -> np.ndarray:
    world = kinematics.pose(motion)
    hip, knee, ankle = (world.positions[:, motion.skeleton.joint(f"left_{part}")] for part in ("thigh", "shin", "foot"))
    ahead = np.cross(
        world.positions[:, motion.skeleton.joint("left_thigh")]
        - world.positions[:, motion.skeleton.joint("right_thigh")],
        [0.0, 1.0, 0.0],
    )
    return np.sum((knee - 0.5 * (hip + ankle)) * unit(ahead), axis=-1)


def test_bodies_face_ahead_and_knees_bend_forwards(tmp_path):
    motion = walked()
    loaded = load_motion(write_c3d(tmp_path / "a.c3d", marker_places(motion), motion.frame_rate))
    assert knees(loaded).min() > -0.01
    rest = kinematics.rest(loaded.skeleton).positions
    at = {role: rest[joint] for role, joint in loaded.skeleton.roles.items()}
    assert at["left_hand"][0] > 0.4
    assert at["left_thigh"][0] > 0.05
    assert at["left_toe"][2] > at["left_foot"][2] + 0.08
    assert at["head"][1] > 0.4
    np.testing.assert_allclose(at["left_forearm"], at["right_forearm"] * [-1, 1, 1], atol=1e-9)


@pytest.mark.parametrize("unit_", ["mm", "cm", "m"])
def test_units_subjects_and_names(tmp_path, unit_):
    motion = walked(frames=120)
    places = marker_places(motion)
    plain = load_motion(write_c3d(tmp_path / "a.c3d", places, motion.frame_rate))
    cmu = {"LASI": "LFWT", "RASI": "RFWT", "LPSI": "LBWT", "RPSI": "RBWT"}
    other = {f"Anna:{cmu.get(name, name)}": place for name, place in places.items()}
    other["Stick:1"] = places["LASI"] + 1.0
    loaded, notes = load_recording(write_c3d(tmp_path / "b.c3d", other, motion.frame_rate, unit=unit_))
    np.testing.assert_allclose(loaded.root_positions, plain.root_positions, atol=1e-4)
    assert any("only Anna is read, not Stick" in note for note in notes)
    words = {
        "LASI": "L.ASIS",
        "RASI": "R.ASIS",
        "LPSI": "",
        "RPSI": "",
        "LKNE": "L.Knee.Lateral",
        "LANK": "L.Ankle.Lateral",
    }
    words |= {"RKNE": "R.Knee.Lateral", "RANK": "R.Ankle.Lateral", "LTOE": "L.Toe", "RTOE": "R.Toe"}
    hayes = {words[name]: place for name, place in places.items() if words.get(name)}
    hayes["V.Sacral"] = 0.5 * (places["LPSI"] + places["RPSI"])
    legs = load_motion(write_c3d(tmp_path / "c.c3d", hayes, motion.frame_rate))
    assert "head" not in legs.skeleton.roles
    assert off(legs, motion, LEGS).max() < 0.06  # without heels
    centimetres = load_motion(write_c3d(tmp_path / "d.c3d", places, motion.frame_rate, unit="cm"), scale=0.02)
    assert centimetres.skeleton.leg_length == pytest.approx(2 * plain.skeleton.leg_length, rel=0.05)


def test_widths_that_are_noted_down_are_used(tmp_path):
    motion = walked(frames=120)
    widths = {"LKneeWidth": [125.0], "RKneeWidth": [125.0]}
    path = write_c3d(tmp_path / "a.c3d", marker_places(motion), motion.frame_rate, parameters={"PROCESSING": widths})
    knee = off(load_motion(path), motion, ("left_shin", "right_shin"))
    assert 0.008 < np.median(knee) < 0.013  # half of 20 mm more


def with_gap(places: dict[str, np.ndarray], name: str, start: int, stop: int) -> dict[str, np.ndarray]:
    out = {key: place.copy() for key, place in places.items()}
    out[name][start:stop] = np.nan
    return out


def test_short_gaps_are_filled_and_told(tmp_path):
    motion = walked(frames=240)
    places = marker_places(motion)
    plain = load_motion(write_c3d(tmp_path / "a.c3d", places, 60.0))
    gap = int(LONGEST_GAP * 60)
    broken = with_gap(with_gap(places, "LTOE", 50, 50 + gap), "LFHD", 20, 90)
    loaded, notes = load_recording(write_c3d(tmp_path / "b.c3d", broken, 60.0))
    assert loaded.frames == 240
    assert any(f"left_toe {gap}" in note and "left_front_head 70" in note for note in notes)
    steady = np.r_[0:50, 50 + gap : 240]
    assert off(loaded, plain, ("left_foot",))[steady].max() < 0.003
    assert off(loaded, plain, ("left_foot",)).max() < 0.05


def test_long_gaps_cut_the_take(tmp_path):
    motion = walked(frames=240)
    places = marker_places(motion)
    gap = int(LONGEST_GAP * 60) + 1
    loaded, notes = load_recording(write_c3d(tmp_path / "a.c3d", with_gap(places, "RKNE", 80, 80 + gap), 60.0))
    assert loaded.frames == 240 - 80 - gap
    assert any(f"frames {80 + gap} to 239 of 240 are used: elsewhere right_knee" in note for note in notes)
    loaded = load_motion(write_c3d(tmp_path / "b.c3d", with_gap(places, "RKNE", 0, 10), 60.0))
    assert loaded.frames == 230
    gone = with_gap(places, "LELB", 0, 200)
    loaded, notes = load_recording(write_c3d(tmp_path / "c.c3d", gone, 60.0))
    assert "left_hand" not in loaded.skeleton.roles
    assert "right_hand" in loaded.skeleton.roles
    assert any("left_elbow (left out)" in note for note in notes)
    one = {
        name: np.where(np.arange(240)[:, None] % 2 == k % 2, place, np.nan)
        for k, (name, place) in enumerate(places.items())
    }
    one["LASI"][1:] = np.nan
    with pytest.raises(MotionError, match=r"a.c3d: no two frames have all markers .*; left_asis is seen in 0 %"):
        read_c3d(write_c3d(tmp_path / "a.c3d", one, 60.0))


def test_a_folder_of_it_is_learned_from(tmp_path):
    folder = tmp_path / "bea"
    folder.mkdir()
    for name in ("walk_turns", "walk_start_stop"):
        write_c3d(folder / f"{name}.c3d", marker_places(walked(name)), 60.0)
    database = build(folder, jobs=1, cache=False)
    assert not any(take.left_out for take in database.takes)
    assert {take.subject for take in database.takes} == {"bea"}
    assert {group.motion for group in database.groups} >= {"walk", "stand", "stand-walk", "walk-stand"}


@given(st.integers(0, 2**32 - 1))
def test_the_axis_of_a_bend_is_square_to_the_limb(seed):
    rng = np.random.default_rng(seed)
    near, middle, far, left = rng.normal(size=(4, 3, 3))
    axis = bend_axis(near, middle, far, left)
    np.testing.assert_allclose(np.linalg.norm(axis, axis=-1), 1.0, atol=1e-9)
    np.testing.assert_allclose(np.sum(axis * unit(far - near), axis=-1), 0.0, atol=1e-9)
    assert (np.sum(axis * left, axis=-1) > -1e-9).all()


@pytest.mark.parametrize("order", ["DEC", "SGI"])
@pytest.mark.parametrize("whole", [False, True])
def test_other_processors_and_whole_numbers(tmp_path, order, whole):
    motion = walked(frames=20)
    here = read_c3d_points(write_c3d(tmp_path / "a.c3d", marker_places(motion), 60.0))
    (tmp_path / "b.c3d").write_bytes(by_hand(here.labels, here.points, order, whole))
    there = read_c3d_points(tmp_path / "b.c3d")
    assert there.labels == here.labels
    assert there.frame_rate == 60.0
    np.testing.assert_allclose(there.points, here.points, atol=0.06 if whole else 1e-3)


def by_hand(labels: tuple[str, ...], points: np.ndarray, processor: str, whole: bool) -> bytes:
    """A C3D file as other machines write it."""
    mark, kind = (">", 86) if processor == "SGI" else ("<", 85)

    def floats(values: np.ndarray) -> bytes:
        if processor == "SGI":
            return np.asarray(values, ">f4").tobytes()
        return (np.asarray(values, "<f4") * 4).view("<u2").reshape(-1, 2)[:, ::-1].tobytes()

    scale = 0.1 if whole else -1.0
    wide = max(len(label) for label in labels)

    def parameter(name: str, size: int, shape: tuple[int, ...], data: bytes) -> bytes:
        body = struct.pack("bB", size, len(shape)) + bytes(shape) + data + b"\0"
        return struct.pack("bb", len(name), 1) + name.encode() + struct.pack(mark + "H", len(body) + 2) + body

    section = bytes((1, 0x50, 2, kind)) + struct.pack("bb", 5, -1) + b"POINT" + struct.pack(mark + "H", 3) + b"\0"
    section += parameter("USED", 2, (), struct.pack(mark + "H", len(labels)))
    section += parameter("SCALE", 4, (), floats(np.array([scale])))
    section += parameter("RATE", 4, (), floats(np.array([60.0])))
    section += parameter("UNITS", -1, (2,), b"mm")
    section += parameter("LABELS", -1, (wide, len(labels)), "".join(label.ljust(wide) for label in labels).encode())
    section += b"\0\0"
    blocks = -(-len(section) // 512)
    head = bytes((2, 0x50)) + struct.pack(mark + "5H", len(labels), 0, 1, len(points), 0) + floats(np.array([scale]))
    head += struct.pack(mark + "HH", 2 + blocks, 0) + floats(np.array([60.0]))
    rows = np.concatenate((points, np.zeros((*points.shape[:2], 1))), axis=-1)
    data = (rows / 0.1).round().astype(mark + "i2").tobytes() if whole else floats(rows)
    return head.ljust(512, b"\0") + section.ljust(512 * blocks, b"\0") + data


def refused(path: Path, match: str) -> None:
    with pytest.raises(FileError, match=match) as caught:
        read_c3d(path)
    assert str(caught.value).startswith(str(path))


def test_what_is_no_c3d(tmp_path):
    refused(tmp_path / "none.c3d", "cannot be read")
    for data in (b"", b"\x02\x50", b"HIERARCHY\n" * 200, b"\0" * 5000):
        (tmp_path / "a.c3d").write_bytes(data)
        refused(tmp_path / "a.c3d", "is no C3D file, or cut")
    (tmp_path / "b.c3d").write_bytes(b"\x02\x50" + b"\0" * 5000)
    refused(tmp_path / "b.c3d", "unknown processor")


def test_markers_that_nobody_knows_are_told(tmp_path):
    motion = walked(frames=20)
    places = marker_places(motion)
    del places["LKNE"]
    path = write_c3d(tmp_path / "a.c3d", places, 60.0)
    refused(path, r"no markers that are known \(Plug-in Gait.*left_knee is missing; it has 'LASI'")
    refused(
        write_c3d(tmp_path / "b.c3d", {f"*{k}": place for k, place in enumerate(places.values())}, 60.0), "is missing"
    )
    labelled = write_c3d(tmp_path / "c.c3d", {"LPSI": places["LPSI"]}, 60.0)
    refused(labelled, "left_psis and right_psis, or sacrum is missing")


def changed(data: bytes, at: int, value: bytes) -> bytes:
    return data[:at] + value + data[at + len(value) :]


def test_claims_that_are_not_so_cost_no_memory(tmp_path):
    data = write_c3d(tmp_path / "a.c3d", marker_places(walked(frames=20)), 60.0).read_bytes()
    path = tmp_path / "b.c3d"
    tracemalloc.start()
    try:
        for broken in (
            changed(data, 6, b"\x01\x00\xfe\xff"),  # 65,534 frames
            data[: len(data) - 600],
            data[:1500],
            by_hand(("A",) * 100, np.zeros((4, 100, 3)), "SGI", False)[:-4000],
        ):
            path.write_bytes(broken)
            with pytest.raises(FileError):
                read_c3d(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 3e6


@settings(max_examples=150)
@given(st.data())
def test_damage_is_an_error_or_harmless(tmp_path_factory, data):
    folder = tmp_path_factory.getbasetemp()
    whole = bytearray(small_file(folder))
    for _ in range(data.draw(st.integers(1, 12))):
        whole[data.draw(st.integers(0, min(len(whole), 4096) - 1))] = data.draw(st.integers(0, 255))
    path = folder / "damaged.c3d"
    path.write_bytes(whole[: data.draw(st.sampled_from([len(whole), len(whole) // 2, 700]))])
    with suppress(FileError, MotionError):  # and nothing else
        assert read_c3d(path).rotations.shape[-1] == 4


@cache
def small_file(folder: Path) -> bytes:
    return write_c3d(folder / "small.c3d", marker_places(walked(frames=5)), 60.0).read_bytes()


def test_a_motion_on_another_floor_is_the_same(tmp_path):
    motion = walked(frames=120)
    higher = replace(motion, root_positions=motion.root_positions + np.array([3.0, 0.4, -2.0]))
    one, other = (
        load_motion(write_c3d(tmp_path / f"{k}.c3d", marker_places(take), 60.0))
        for k, take in enumerate((motion, higher))
    )
    np.testing.assert_allclose(other.root_positions - one.root_positions, [[3.0, 0.4, -2.0]] * 120, atol=1e-4)
    np.testing.assert_allclose(other.skeleton.offsets, one.skeleton.offsets, atol=1e-5)


@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_markers_on_recorded_people(mocap, tmp_path, noise):
    motion = load_motion(mocap / "cmu" / "16" / "16_31.amc")
    rng = np.random.default_rng(0)
    places = {name: place + noise * rng.normal(size=place.shape) for name, place in marker_places(motion).items()}
    loaded = load_motion(write_c3d(tmp_path / "a.c3d", places, motion.frame_rate))
    here, there = analyse(motion), analyse(loaded)
    assert np.mean(here.contacts.planted == there.contacts.planted) > 0.98
    assert len(here.gait.segments) == len(there.gait.segments)
    # its hips are the middle of the hip joints, those of the recording lie before them
    np.testing.assert_allclose(there.vehicle.positions, here.vehicle.positions, atol=0.06)
