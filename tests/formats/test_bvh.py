from __future__ import annotations

import errno
import time
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bodies import humanoid, standing, writhing
from stridecast.body import kinematics
from stridecast.errors import FileError, InputError
from stridecast.formats import files
from stridecast.formats.bvh import read_bvh, write_bvh
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion
from stridecast.model.skeleton import Skeleton

HEADER = """HIERARCHY
ROOT Hips
{
  OFFSET 1 2 3
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT Leg
  {
    OFFSET 0 -1 0
    CHANNELS 3 Yrotation Xrotation Zrotation
    End Site
    {
      OFFSET 0 -2 0.5
    }
  }
}
"""
FRAME = "1 2 3 10 20 30 40 50 60"
TEXT = f"{HEADER}MOTION\nFrames: 3\nFrame Time: 0.01\n{FRAME}\n{FRAME}\n{FRAME}\n"
LAST = TEXT.count("\n")


@pytest.fixture
def bvh(tmp_path: Path):
    def write(content: str | bytes) -> Path:
        path = tmp_path / "take.bvh"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def scipy_quaternion(order: str, degrees: list[float]) -> np.ndarray:
    x, y, z, w = Rotation.from_euler(order.upper(), degrees, degrees=True).as_quat()
    return np.array([w, x, y, z])


def same_rotation(a: np.ndarray, b: np.ndarray, tolerance: float = 1e-12) -> bool:
    return bool(np.all(1.0 - np.abs(np.sum(a * b, axis=-1)) < tolerance))


def test_reads_what_is_written(bvh):
    recording = read_bvh(bvh(TEXT))
    assert recording.names == ("Hips", "Leg")
    assert recording.parents.tolist() == [-1, 0]
    assert recording.offsets.tolist() == [[1, 2, 3], [0, -1, 0]]
    assert recording.end_joints.tolist() == [1]
    assert recording.end_offsets.tolist() == [[0, -2, 0.5]]
    assert recording.root_positions.tolist() == [[1, 2, 3]] * 3
    assert recording.frame_rate == pytest.approx(100.0)
    assert recording.unit is None
    assert not recording.slides
    assert same_rotation(recording.rotations[:, 0], scipy_quaternion("ZYX", [10, 20, 30]))
    assert same_rotation(recording.rotations[:, 1], scipy_quaternion("YXZ", [40, 50, 60]))


@pytest.mark.parametrize("order", [*map("".join, permutations("XYZ")), "X", "ZY", "XZ"])
def test_rotation_orders_agree_with_scipy(bvh, order):
    channels = f"{len(order)} {' '.join(f'{axis}rotation' for axis in order)}"
    angles = [17.0, -75.0, 130.0][: len(order)]
    text = TEXT.replace("3 Yrotation Xrotation Zrotation", channels)
    text = text.replace("40 50 60", " ".join(map(str, angles)))
    assert same_rotation(read_bvh(bvh(text)).rotations[:, 1], scipy_quaternion(order, angles))


def test_channels_may_stand_in_any_order(bvh):
    text = TEXT.replace(
        "Xposition Yposition Zposition Zrotation Yrotation Xrotation",
        "Zrotation Zposition YROTATION xposition Xrotation Yposition",
    )
    recording = read_bvh(bvh(text.replace(FRAME, "10 3 20 1 30 2 40 50 60")))
    plain = read_bvh(bvh(TEXT))
    np.testing.assert_array_equal(recording.root_positions, plain.root_positions)
    np.testing.assert_array_equal(recording.rotations, plain.rotations)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: text.replace("  ", "\t"),
        lambda text: text.replace(" ", "  \t "),
        lambda text: text + "\n\n \n\t\n",
        lambda text: text.rstrip("\n"),
        lambda text: text.replace(FRAME, f"\n  {FRAME}  \n"),
        lambda text: text.replace("\n{", " {"),
        lambda text: text.replace("}\n  }", "} }"),
        lambda text: "\ufeff" + text,
        lambda text: "\n\n" + text,
        lambda text: text.replace("Frames: 3\nFrame Time: 0.01", "\nFrame Time:\t.01\n\nFRAMES :3\n"),
        lambda text: text.replace("HIERARCHY", "Hierarchy").replace("ROOT", "Root").replace("MOTION", "Motion"),
        lambda text: text.replace("JOINT", "joint").replace("OFFSET", "offset").replace("CHANNELS", "channels"),
        lambda text: text.replace("End Site", "END SITE"),
        lambda text: text.replace("End Site", "End site Toe"),
        lambda text: text.replace("10 20 30", "1e1 +2.0E+001 3000e-002"),
    ],
)
def test_small_liberties_change_nothing(bvh, change):
    recording, plain = read_bvh(bvh(change(TEXT))), read_bvh(bvh(TEXT))
    assert recording.names == plain.names
    np.testing.assert_array_equal(recording.rotations, plain.rotations)
    np.testing.assert_array_equal(recording.root_positions, plain.root_positions)
    np.testing.assert_array_equal(recording.end_offsets, plain.end_offsets)
    assert recording.frame_rate == plain.frame_rate


def test_names_may_have_spaces(bvh):
    assert read_bvh(bvh(TEXT.replace("JOINT Leg", "JOINT Left Upper Leg"))).names[1] == "Left Upper Leg"


def test_end_sites_belong_to_their_joint_wherever_they_stand(bvh):
    end = "  End Site\n  {\n    OFFSET 9 9 9\n  }\n}\nMOTION"
    recording = read_bvh(bvh(TEXT.replace("}\nMOTION", end)))
    assert recording.end_joints.tolist() == [0, 1]
    assert recording.end_offsets.tolist() == [[9, 9, 9], [0, -2, 0.5]]


def with_leg_positions(*places: str) -> str:
    text = TEXT.replace("3 Yrotation Xrotation", "6 Xposition Yposition Zposition Yrotation Xrotation")
    for place in places:
        text = text.replace(f"\n{FRAME}", f"\n1 2 3 10 20 30 {place} 40 50 60", 1)
    return text


def test_steady_positions_replace_offsets(bvh):
    recording = read_bvh(bvh(with_leg_positions("0 -1.5 0", "0 -1.5 0", "0 -1.5 0")))
    assert recording.offsets[1].tolist() == [0, -1.5, 0]
    assert not recording.slides
    assert same_rotation(recording.rotations[:, 1], scipy_quaternion("YXZ", [40, 50, 60]))


def test_positions_that_change_are_kept(bvh):
    recording = read_bvh(bvh(with_leg_positions("0 -1 0", "0 -1.5 0", "0 -3 0")))
    assert recording.offsets[1].tolist() == [0, -1.5, 0]
    assert recording.slides[1].tolist() == [[0, -1, 0], [0, -1.5, 0], [0, -3, 0]]


def test_a_root_without_position_channels_is_at_its_offset(bvh):
    text = TEXT.replace("6 Xposition Yposition Zposition", "3").replace("1 2 3 10", "10")
    recording = read_bvh(bvh(text))
    assert recording.root_positions.tolist() == [[1, 2, 3]] * 3
    assert recording.offsets[0].tolist() == [0, 0, 0]


def cut(text: str, after: str) -> str:
    return text[: text.index(after) + len(after)]


@pytest.mark.parametrize(
    ("content", "line", "message"),
    [
        ("", None, "is empty"),
        (" \n\n", None, "is empty"),
        (b"\0\1\2\3", None, "binary data"),
        (TEXT.encode("utf-16"), None, "UTF-16"),
        (b"Kaydara FBX Binary  \0", None, "an FBX file"),
        (b"PK\3\4\0\0", None, "a ZIP archive"),
        (b"\2\x50" + bytes(600), None, "a C3D file"),
        (TEXT.encode() + b"\0", None, "binary data"),
        ("#!OML:ASF x.ASF\n:FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 0 0 0 0 0\n", None, "looks like an AMC recording"),
        (":version 1.10\n:name VICON\n:bonedata\n:hierarchy\n", None, "looks like an ASF skeleton"),
        ("version https://git-lfs.github.com/spec/v1\noid sha256:1\n", None, "Git LFS pointer"),
        ("<!DOCTYPE html>\n<html>404</html>\n", None, "looks like a web page"),
        ("walk\n", None, "it has no HIERARCHY"),
        (cut(TEXT, "HIERARCHY\n"), 1, "no ROOT"),
        (cut(TEXT, "ROOT Hips"), 2, "the file is cut"),
        (cut(TEXT, "CHANNELS 6 Xpos"), 5, "CHANNELS needs a count"),
        (cut(TEXT, "OFFSET 0 -1"), 8, "OFFSET needs three finite numbers, not '0 -1'"),
        (cut(TEXT, "Zrotation\n    End"), 10, "the file is cut: 3 joints"),
        (HEADER, 15, "MOTION should follow"),
        (HEADER + "MOTION", 16, "Frames: should follow"),
        (HEADER + "MOTION\nFrames: 3\n", 17, "Frame Time: should follow"),
        (HEADER + "MOTION\nFrames: 3\nFrame Time: 0.01", 17, "promises 3 frames, but 0 lines"),
        (TEXT.replace(f"{FRAME}\n", "", 1), 17, "but 2 lines of numbers follow; the file is cut, or"),
        (TEXT.replace("Frames: 3", "Frames: 2"), 17, "the line should be 'Frames: 3'"),
        (TEXT.replace("Frames: 3", f"Frames: {10**12}"), 17, f"promises {10**12} frames, but 3 lines"),
        (TEXT.replace("Frames: 3", "Frames: " + "9" * 100), 17, "needs a count"),
        (TEXT.replace("Frames: 3", "Frames: 0"), 17, "needs a count of at least 1"),
        (TEXT.replace("Frames: 3", "Frames: -3"), 17, "needs a count"),
        (TEXT.replace("Frames: 3", "Frames: 3.5"), 17, "needs a count"),
        (TEXT.replace("Frames: 3", "Takes: 3"), 17, "Frames: or Frame Time: should stand here, not 'Takes: 3'"),
        (TEXT.replace("0.01", "0"), 18, "Frame Time: needs 0.0001 to 10 seconds, not '0'"),
        (TEXT.replace("0.01", "nan"), 18, "Frame Time: needs"),
        (TEXT.replace("0.01", "fast"), 18, "Frame Time: needs"),
        (TEXT[:-3], LAST, "the file is cut: frame 2 (counted from 0) has 8 numbers"),
        (TEXT[:-30], 20, "frame 1 (counted from 0) has 7 numbers, the hierarchy has 9 channels; line 17 promises 3"),
        (TEXT.replace(" 60\n", "\n", 1), 19, "frame 0 (counted from 0) has 8 numbers, the hierarchy has 9 channels"),
        (TEXT.replace(FRAME, FRAME + " 7", 1), 19, "frame 0 (counted from 0) has 10 numbers"),
        (TEXT + FRAME[:7], LAST + 1, "the file is cut: frame 3"),
        (TEXT + "MOTION\n", LAST + 1, "a number should stand here, not 'MOTION'"),
        (TEXT.replace("50 60\n", "nan 60\n", 1), 19, "(counted from 0): xrotation of joint 'Leg' is not finite"),
        (TEXT.replace("1 2 3 10", "1 -inf 3 10", 1), 19, "yposition of joint 'Hips' is not finite"),
        (TEXT.replace("1 2 3 10", "1 1.#IND 3 10", 1), 19, "yposition of joint 'Hips' is not finite"),
        (TEXT.replace("1 2 3 10", "1 1e999 3 10", 1), 19, "yposition of joint 'Hips' is not finite"),
        (TEXT.replace("1 2 3 10", "1,5 2 3 10", 1), 19, "decimals need a point"),
        (TEXT.replace("OFFSET 0 -1 0", "OFFSET 0 nan 0"), 8, "three finite numbers"),
        (TEXT.replace("OFFSET 0 -1 0", "OFFSET 0 -1 0 0"), 8, "three finite numbers"),
        (TEXT.replace("    OFFSET 0 -1 0\n", ""), 13, "joint 'Leg' has no OFFSET"),
        (TEXT.replace("JOINT Leg", "JOINT"), 6, "JOINT needs a name"),
        (TEXT.replace("JOINT Leg", "JOINT Hips"), 6, "a second joint 'Hips'; the first is in line 2"),
        (TEXT.replace("JOINT Leg", "ROOT Leg"), 6, "a second ROOT"),
        (TEXT.replace("MOTION", "ROOT Other\n{\n}\nMOTION"), 16, "second ROOT"),
        (TEXT.replace("JOINT Leg\n  {", "JOINT Leg"), 7, "a brace should open here"),
        (TEXT.replace("}\nMOTION", "}\n}\nMOTION"), 16, "closing brace stands outside"),
        (TEXT.replace("}\nMOTION", "MOTION"), 14, "1 joints are not closed"),
        (TEXT.replace("    End Site", "    Ende"), 10, "a brace should stand here, not 'Ende'"),
        (TEXT.replace("OFFSET 0 -2 0.5", "CHANNELS 0"), 12, "an End Site has no CHANNELS"),
        (TEXT.replace("OFFSET 0 -2 0.5", "JOINT Toe"), 12, "joint 'Toe' stands inside of an End Site"),
        (TEXT.replace("OFFSET 0 -2 0.5", "End Site"), 12, "End Site stands inside of an End Site"),
        (TEXT.replace("ROOT Hips", "OFFSET 0 0 0\nROOT Hips"), 2, "OFFSET stands outside"),
        (TEXT.replace("ROOT Hips", "JOINT Hips"), 2, "JOINT stands outside"),
        (TEXT.replace("CHANNELS 3", "CHANNELS 4"), 9, "as many channels"),
        (TEXT.replace("CHANNELS 3", "CHANNELS " + "3" * 5000), 9, "as many channels"),
        (TEXT.replace("3 Yrotation Xrotation", "3 Yrotation Wrotation"), 9, "there is no channel 'Wrotation'"),
        (TEXT.replace("3 Yrotation Xrotation", "3 Yrotation Yrotation"), 9, "has the channel Yrotation twice"),
        (
            TEXT.replace("CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation", "")
            .replace("CHANNELS 3 Yrotation Xrotation Zrotation", ""),
            2,
            "no joint has CHANNELS",
        ),
    ],
)  # fmt: skip
def test_bad_files_are_refused_with_the_line(bvh, content, line, message):
    path = bvh(content)
    with pytest.raises(FileError) as caught:
        read_bvh(path)
    assert message in str(caught.value)
    assert caught.value.line == line
    assert caught.value.path == str(path)
    assert len(str(caught.value)) < 400


def nested(depth: int) -> str:
    rows = [f"{'JOINT' if k else 'ROOT'} j{k} {{ OFFSET 0 1 0" for k in range(depth)]
    return "HIERARCHY\n" + "\n".join(rows).replace("{ ", "{\n") + "\n" + "}" * depth + "\nMOTION\n"


def test_absurd_skeletons_are_refused_at_once(bvh):
    wide = (
        "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\n"
        + "".join(f"JOINT j{k} {{\nOFFSET 0 0 0\n}}\n" for k in range(5000))
        + "}\n"
    )
    start = time.perf_counter()
    for text, message in ((nested(100_000), "nested deeper than 256"), (wide, "more than 4096 joints")):
        with pytest.raises(FileError, match=message):
            read_bvh(bvh(text))
    with pytest.raises(FileError, match="Frames: should follow"):
        read_bvh(bvh(nested(256)))
    assert time.perf_counter() - start < 2.0


@pytest.mark.parametrize("missing", ["no/such/file.bvh", "."])
def test_files_that_cannot_be_opened(tmp_path, missing):
    with pytest.raises(FileError, match="cannot be read"):
        read_bvh(tmp_path / missing)


def test_any_cut_is_noticed(bvh):
    for size in range(len(TEXT) - 3):
        with pytest.raises(FileError):
            read_bvh(bvh(TEXT[:size]))


def test_any_damage_is_refused_or_read(bvh):
    rng = np.random.default_rng(0)
    good = 0
    for _ in range(500):
        damaged = bytearray(TEXT.encode())
        for place in rng.integers(0, len(damaged), rng.integers(1, 4)):
            damaged[place] = rng.choice(np.frombuffer(b"{}0-.e:\n \0aZ\xff", np.uint8))
        try:
            read_bvh(bvh(bytes(damaged)))
            good += 1
        except FileError:
            pass
    assert 0 < good < 500


def random_motion(seed: int, locked: bool = False) -> Motion:
    """Any tree, any offsets, any rotations; some of them with the middle angle at or next to a right angle."""
    rng = np.random.default_rng(seed)
    joints, frames = int(rng.integers(1, 9)), 4
    parents = np.array([-1, *(rng.integers(0, k) for k in range(1, joints))])
    hang = rng.integers(0, joints, rng.integers(0, 4))
    skeleton = Skeleton(
        names=tuple(f"joint {k}" if k % 3 else f"joint{k}" for k in range(joints)),
        parents=parents,
        offsets=np.where(np.arange(joints)[:, None] > 0, rng.normal(0, 0.3, (joints, 3)), 0.0),
        end_joints=hang,
        end_offsets=rng.normal(0, 0.3, (len(hang), 3)),
    )
    rotations = quat.normalize(rng.normal(size=(frames, joints, 4)))
    if locked:
        angles = rng.uniform(-np.pi, np.pi, (frames, joints, 3))
        near = 10.0 ** rng.uniform(-16, -1, (frames, joints)) * rng.choice([-1, 0, 1], (frames, joints))
        angles[..., 1] = rng.choice([-1, 1], (frames, joints)) * np.pi / 2 + near
        rotations = quat.from_euler(angles, "ZYX")
    return Motion(
        skeleton=skeleton,
        frame_rate=float(rng.uniform(10, 240)),
        root_positions=rng.normal(0, 10, (frames, 3)),
        rotations=rotations,
    )


@given(
    st.integers(0, 2**32 - 1),
    st.booleans(),
    st.sampled_from(sorted(map("".join, permutations("XYZ")))),
    st.sampled_from([1.0, 0.01, 0.0254 / 0.45, 0.001]),
)
def test_what_is_written_reads_back(tmp_path_factory, seed, locked, order, scale):
    motion = random_motion(seed, locked)
    path = tmp_path_factory.getbasetemp() / "round.bvh"
    write_bvh(path, motion, order=order, scale=scale)
    recording = read_bvh(path)
    skeleton = motion.skeleton
    back = [recording.names.index(name.replace(" ", "_")) for name in skeleton.names]
    read = Skeleton(names=recording.names, parents=recording.parents, offsets=recording.offsets * scale)
    assert [read.names[p] if p >= 0 else "" for p in read.parents[back]] == [
        skeleton.names[p].replace(" ", "_") if p >= 0 else "" for p in skeleton.parents
    ]
    assert not read.offsets[0].any()
    world = kinematics.pose(motion)
    again = kinematics.forward(read, recording.root_positions * scale, recording.rotations)
    np.testing.assert_allclose(again.positions[:, back], world.positions, atol=1e-6)
    error = quat.log(quat.multiply(quat.inverse(recording.rotations[:, back]), motion.rotations))
    assert np.abs(error).max() < 1e-6
    assert recording.frame_rate == pytest.approx(motion.frame_rate, rel=1e-9)
    for joint, name in enumerate(skeleton.names):
        wanted = skeleton.end_offsets[skeleton.end_joints == joint]
        if not len(wanted) and joint not in skeleton.parents:
            wanted = np.zeros((1, 3))
        ends = recording.end_offsets[recording.end_joints == back[joint]] * scale
        np.testing.assert_allclose(ends, wanted, atol=1e-7, err_msg=name)


def turning(vector: tuple[float, float, float], frames: int = 200) -> Motion:
    """Three even turns about an axis."""
    angles = np.linspace(0, 6 * np.pi, frames)[:, None] * np.array(vector)
    motion = standing(frames=frames)
    rotations = motion.rotations.copy()
    rotations[:, 3] = quat.exp(angles)
    return Motion(skeleton=motion.skeleton, frame_rate=30.0, root_positions=motion.root_positions, rotations=rotations)


@pytest.mark.parametrize(("axis", "vector"), [(0, (0, 0, 1.0)), (1, (0, 1.0, 0)), (2, (1.0, 0, 0))])
def test_angles_run_on(tmp_path, axis, vector):
    write_bvh(tmp_path / "a.bvh", turning(vector), order="ZYX")
    rows = (tmp_path / "a.bvh").read_text().split("Frame Time")[1].splitlines()[1:]
    values = np.array([row.split() for row in rows], float)
    angles = values[:, 3 + 3 * 3 : 6 + 3 * 3]
    wanted = np.zeros_like(angles)
    wanted[:, axis] = np.linspace(0, 1080, 200)
    np.testing.assert_allclose(angles - angles[0], wanted, atol=1e-5)


def test_angles_of_movement_do_not_jump(tmp_path):
    write_bvh(tmp_path / "a.bvh", writhing(frames=240, frame_rate=120.0), order="XYZ")
    rows = (tmp_path / "a.bvh").read_text().split("Frame Time")[1].splitlines()[1:]
    values = np.array([row.split() for row in rows], float)[:, 3:]
    assert np.abs(np.diff(values, axis=0)).max() < 60.0


def test_the_file_is_plain(tmp_path):
    write_bvh(tmp_path / "a.bvh", standing(frames=2, frame_rate=30.0), order="zxy", scale=0.01)
    text = (tmp_path / "a.bvh").read_text()
    assert text.startswith(
        "HIERARCHY\nROOT Hips\n{\n\tOFFSET 0.00000000 0.00000000 0.00000000\n\tCHANNELS 6 Xposition "
    )
    assert "Zposition Zrotation Xrotation Yrotation\n\tJOINT Spine\n\t{\n\t\tOFFSET 0.00000000 9.00000000 -1.0" in text
    assert "MOTION\nFrames: 2\nFrame Time: 0.03333333333\n0.00000000 98.00000000 0.0" in text
    assert "-0.000000 " not in text
    assert text.count("{") == text.count("}") == humanoid().joints + text.count("End Site")


@pytest.mark.parametrize("order", ["", "XY", "XYX", "ZYXZ", "abc"])
def test_orders_that_are_none(tmp_path, order):
    with pytest.raises(InputError, match="order"):
        write_bvh(tmp_path / "a.bvh", standing(), order=order)


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf")])
def test_scales_that_are_none(tmp_path, scale):
    with pytest.raises(InputError, match="scale"):
        write_bvh(tmp_path / "a.bvh", standing(), scale=scale)
    assert not list(tmp_path.iterdir())


def test_writing_replaces_the_old_file(tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text("old")
    write_bvh(path, standing())
    assert read_bvh(path).names[0] == "Hips"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("step", ["write", "rename"])
def test_a_full_disk_leaves_the_old_file(tmp_path, monkeypatch, step):
    path = tmp_path / "a.bvh"
    path.write_text("old")

    def full(*args: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    if step == "rename":
        monkeypatch.setattr(files.Path, "replace", full)
    else:
        monkeypatch.setattr("stridecast.formats.bvh.hierarchy_text", full)
    with pytest.raises(FileError, match=r"a.bvh: cannot be written: No space left on device"):
        write_bvh(path, standing())
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_writing_where_nothing_can_be(tmp_path):
    with pytest.raises(FileError, match="cannot be written: No such file or directory"):
        write_bvh(tmp_path / "no" / "a.bvh", standing())
