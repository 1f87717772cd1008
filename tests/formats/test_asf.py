from __future__ import annotations

import csv
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stridecast.errors import FileError
from stridecast.formats.amc import read_amc
from stridecast.formats.asf import read_asf

ASF = """# a comment
:version 1.10
:name tiny
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
   axis of nothing :units
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name hip
     direction 1 0 0
     length 2.5
     axis 0 0 0  XYZ
  end
  begin
     id 2
     name thigh
     direction 0.6 -0.8 0
     length 7
     axis 10 -20 30  XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 3
     name shin
     direction 0 -1 2.83e-014
     length 6   # half the leg
     axis 0 0 20  XYZ
    dof rz rx
  end
:hierarchy
  begin
    root hip
    hip thigh
    thigh shin
  end
"""
FRAMES = """#!OML:ASF tiny.ASF
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 10 20 30
thigh 5 6 7
shin 8 9
2
root 1 2 3.5 10 20 30
thigh 5 6 7
shin 8 9
3
root 1 2 4 10 20 30
thigh 5 6 7
shin 8 9
"""


@pytest.fixture
def pair(tmp_path: Path):
    def write(amc: str = FRAMES, asf: str = ASF) -> Path:
        (tmp_path / "07.asf").write_bytes(asf.encode())
        (tmp_path / "07_01.amc").write_bytes(amc.encode())
        return tmp_path / "07_01.amc"

    return write


def matrix(order: str, degrees: list[float]) -> np.ndarray:
    """Turns about the axes of ``order`` by ``degrees``, the first letter's first, about axes that stay."""
    return Rotation.from_euler(order.lower(), degrees, degrees=True).as_matrix()


def turned(quaternion: np.ndarray) -> np.ndarray:
    w, x, y, z = quaternion
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def test_skeleton(pair):
    asf = read_asf(pair().with_name("07.asf"))
    assert asf.names == ("root", "hip", "thigh", "shin")
    assert asf.parents.tolist() == [-1, 0, 1, 2]
    np.testing.assert_allclose(asf.offsets, [[0, 0, 0], [0, 0, 0], [2.5, 0, 0], [4.2, -5.6, 0]])
    assert asf.end_joints.tolist() == [3]
    np.testing.assert_allclose(asf.end_offsets, [[0, -6, 0]], atol=1e-12)
    assert asf.freedoms == (("tx", "ty", "tz", "rx", "ry", "rz"), (), ("rx", "ry", "rz"), ("rz", "rx"))
    assert asf.unit == pytest.approx(0.0254 / 0.45)
    assert asf.degrees
    rest = asf.at_rest()
    assert rest.rotations.tolist() == [[[1, 0, 0, 0]] * 4]


def test_motion_agrees_with_scipy(pair):
    recording = read_amc(pair())
    assert recording.root_positions.tolist() == [[1, 2, 3], [1, 2, 3.5], [1, 2, 4]]
    assert recording.frame_rate is None
    assert recording.unit == pytest.approx(0.0254 / 0.45)
    thigh, shin = matrix("xyz", [10, -20, 30]), matrix("xyz", [0, 0, 20])
    wanted = [
        matrix("xyz", [10, 20, 30]),
        np.eye(3),
        thigh @ matrix("xyz", [5, 6, 7]) @ thigh.T,
        shin @ matrix("xyz", [9, 0, 8]) @ shin.T,
    ]
    for frame in range(3):
        for joint in range(4):
            np.testing.assert_allclose(turned(recording.rotations[frame, joint]), wanted[joint], atol=1e-12)


@pytest.mark.parametrize("order", [*map("".join, permutations("XYZ"))])
def test_orders_of_axes(pair, order):
    asf = ASF.replace("axis 10 -20 30  XYZ", f"axis 10 -20 30 {order}").replace("axis XYZ", f"axis {order}")
    recording = read_amc(pair(asf=asf.replace("orientation 0 0 0", "orientation 40 0 -15")))
    values = dict(zip("XYZ", [10, -20, 30], strict=True))
    own = matrix(order, [values[letter] for letter in order])
    values = dict(zip("XYZ", [5, 6, 7], strict=True))
    wanted = own @ matrix(order, [values[letter] for letter in order]) @ own.T
    np.testing.assert_allclose(turned(recording.rotations[0, 2]), wanted, atol=1e-12)
    values = dict(zip("XYZ", [40, 0, -15], strict=True))
    own = matrix(order, [values[letter] for letter in order])
    values = dict(zip("XYZ", [10, 20, 30], strict=True))
    wanted = own @ matrix(order, [values[letter] for letter in order]) @ own.T
    np.testing.assert_allclose(turned(recording.rotations[0, 0]), wanted, atol=1e-12)


def test_the_roots_order_says_what_its_numbers_are(pair):
    asf = ASF.replace("order TX TY TZ RX RY RZ", "order RZ TY TX RX TZ RY")
    recording = read_amc(pair(FRAMES.replace("root 1 2 3 10 20 30", "root 30 2 1 10 3 20"), asf))
    np.testing.assert_array_equal(recording.root_positions[0], [1, 2, 3])
    np.testing.assert_allclose(turned(recording.rotations[0, 0]), matrix("xyz", [10, 20, 30]), atol=1e-12)


def test_the_roots_position_is_added(pair):
    recording = read_amc(pair(asf=ASF.replace("position 0 0 0", "position 10 0 -1")))
    assert recording.root_positions[0].tolist() == [11, 2, 2]
    assert not recording.offsets[0].any()


def test_radians(pair):
    def in_radians(text: str, keyword: str) -> str:
        return "\n".join(
            " ".join([*words[:skip], *(repr(float(np.radians(float(word)))) for word in words[skip:])])
            if skip
            else line
            for line in text.split("\n")
            for words in [line.split()]
            for skip in [{"thigh": 1, "shin": 1, "root": 4}.get(words[0], 0) if keyword in text and words else 0]
        )

    plain = read_amc(pair())
    amc = in_radians(FRAMES.replace(":DEGREES", ":RADIANS"), "RADIANS")
    np.testing.assert_allclose(read_amc(pair(amc)).rotations, plain.rotations, atol=1e-12)
    asf = ASF.replace("angle deg", "angle rad").replace(
        "10 -20 30", " ".join(map(repr, map(float, np.radians([10, -20, 30]))))
    )
    asf = asf.replace("axis 0 0 20", f"axis 0 0 {float(np.radians(20))!r}")
    silent = amc.replace(":RADIANS\n", "")
    np.testing.assert_allclose(read_amc(pair(silent, asf)).rotations, plain.rotations, atol=1e-12)
    np.testing.assert_allclose(read_amc(pair(FRAMES, asf)).rotations, plain.rotations, atol=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace(" ", "\t"),
        lambda text: text.replace("\n", "\n\n  \n"),
        lambda text: text.replace("\n", "   \n"),
        lambda text: text.rstrip("\n"),
        lambda text: "# more\n" + text,
        lambda text: text.replace("2.83e-014", "0").replace(" 5 6 7", " 5.0 +6e0 .7E1"),
        lambda text: text.replace("axis 0 0 20  XYZ", "axis 0 0 20").replace("dof", "DOF").replace("begin", "BEGIN"),
        lambda text: text.replace("deg", "degrees").replace(":bonedata", ":BONEDATA"),
        lambda text: text.replace("thigh 5 6 7\nshin 8 9", "shin 8 9\nthigh 5 6 7", 1),
        lambda text: text.replace("thigh 5 6 7\nshin 8 9", "shin 8 9\nthigh 5 6 7"),
        lambda text: text.replace("1\nroot", "98\nroot").replace("2\nroot", "99\nroot").replace("3\nroot", "100\nroot"),
        lambda text: text.replace("hip thigh\n    thigh shin", "thigh shin\n    hip thigh"),
    ],
)
def test_small_liberties_change_nothing(pair, change):
    plain = read_amc(pair())
    recording = read_amc(pair(change(FRAMES), change(ASF)))
    assert recording.names == plain.names
    np.testing.assert_allclose(recording.offsets, plain.offsets, atol=1e-12)
    np.testing.assert_allclose(recording.rotations, plain.rotations, atol=1e-12)
    np.testing.assert_array_equal(recording.root_positions, plain.root_positions)
    assert recording.unit == plain.unit


def test_another_unit_is_not_guessed(pair):
    assert read_asf(pair(asf=ASF.replace("length 0.45", "length 1.0")).with_name("07.asf")).unit is None
    assert read_asf(pair(asf=ASF.replace("  length 0.45\n", "")).with_name("07.asf")).unit is None


def test_the_skeleton_is_found(pair, tmp_path):
    path = pair()
    (tmp_path / "08.asf").write_text(ASF.replace("thigh", "femur"))
    assert read_amc(path).names[2] == "thigh"
    with pytest.raises(FileError, match="'thigh' is no moving bone"):
        read_amc(path, tmp_path / "08.asf")
    other = path.rename(tmp_path / "walk.amc")
    with pytest.raises(FileError, match=r"needs its skeleton, walk.asf; the folder has 07.asf, 08.asf"):
        read_amc(other)
    (tmp_path / "08.asf").unlink()
    assert read_amc(other).names[2] == "thigh"
    (tmp_path / "07.asf").rename(tmp_path / "WALK.ASF")
    assert read_amc(other).names[2] == "thigh"
    (tmp_path / "WALK.ASF").unlink()
    with pytest.raises(FileError, match="the folder has none"):
        read_amc(other)
    with pytest.raises(FileError, match=r"no.asf: cannot be read"):
        read_amc(other, tmp_path / "no.asf")


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (lambda text: "", None, "is empty"),
        (lambda text: text[:40], None, "it has no :bonedata; is it cut?"),
        (lambda text: FRAMES, None, "it has no :bonedata; it looks like an AMC recording"),
        (lambda text: "HIERARCHY\nROOT x\n", None, "it looks like a BVH recording"),
        (lambda text: text[: text.index("axis 0 0 20")], 38, "the last bone has no 'end'"),
        (lambda text: text[: text.index(":hierarchy")], 41, "the file is cut: it has no :hierarchy"),
        (lambda text: text.replace("direction 1 0 0", "direction 1 0"), 19, "direction needs 3 finite number(s)"),
        (lambda text: text.replace("direction 1 0 0", "direction 1 0 nan"), 19, "direction needs 3 finite"),
        (lambda text: text.replace("length 2.5", "length much"), 20, "length needs 1 finite number(s), not 'much'"),
        (lambda text: text.replace("     length 2.5\n", ""), 16, "bone 'hip' needs a direction and a length"),
        (lambda text: text.replace("direction 1 0 0", "direction 0 0 0"), 16, "bone 'hip' needs a direction"),
        (lambda text: text.replace("     name hip\n", ""), 16, "this bone has no name"),
        (lambda text: text.replace("name thigh", "name hip"), 23, "a second bone 'hip'"),
        (lambda text: text.replace("  end\n  begin\n     id 2", "  begin\n     id 2"), 22, "begins inside of another"),
        (lambda text: text.replace("  begin\n     id 1", "     id 1"), 16, "'id' stands outside"),
        (lambda text: text.replace("axis 10 -20 30  XYZ", "axis 10 -20 30  XYY"), 28, "made of X, Y and Z, not 'XYY'"),
        (lambda text: text.replace("axis 10 -20 30  XYZ", "axis 10 -20"), 28, "axis needs 3"),
        (lambda text: text.replace("dof rx ry rz", "dof rx ry rw"), 29, "degree of freedom 'rw'"),
        (lambda text: text.replace("dof rx ry rz", "dof rx ry rx"), 29, "degree of freedom 'rx'"),
        (lambda text: text.replace("dof rx ry rz", "dof rx ry rz l"), 29, "degree of freedom 'l' here; it may have rx"),
        (lambda text: text.replace("order TX", "order QX"), 11, "the root cannot have the degree of freedom 'qx'"),
        (lambda text: text.replace("angle deg", "angle grad"), 7, "angles are in deg or rad, not 'grad'"),
        (lambda text: text.replace("hip thigh\n", "hip femur\n"), 45, "'femur' is no bone; there are root, hip"),
        (lambda text: text.replace("    hip thigh\n", ""), 23, "does not lead from the root to thigh, shin"),
        (lambda text: text.replace("thigh shin\n", "thigh shin\n    hip shin\n"), 47, "bone 'shin' has two parents"),
        (lambda text: text.replace("thigh shin\n", "thigh shin root\n"), 46, "bone 'root' has two parents"),
        (lambda text: text.replace("hip thigh\n", "shin thigh\n"), 23, "does not lead from the root"),
    ],
)
def test_bad_skeletons_are_refused_with_the_line(pair, change, line, message):
    path = pair(asf=change(ASF)).with_name("07.asf")
    with pytest.raises(FileError) as caught:
        read_asf(path)
    assert message in str(caught.value)
    assert (caught.value.line, caught.value.path) == (line, str(path))


def test_too_many_bones(pair):
    bone = "  begin\n name {}\n direction 0 1 0\n length 1\n axis 0 0 0 XYZ\n  end\n"
    many = ":bonedata\n" + "".join(bone.format(f"b{k}") for k in range(5000)) + ":hierarchy\n"
    with pytest.raises(FileError, match="more than 4096 bones"):
        read_asf(pair(asf=many).with_name("07.asf"))


def test_a_skeleton_that_cannot_move(pair):
    asf = ASF.replace("order TX TY TZ RX RY RZ", "order").replace("dof rx ry rz", "").replace("dof rz rx", "")
    with pytest.raises(FileError, match="no bone of its skeleton has a degree of freedom"):
        read_amc(pair(asf=asf))


LAST = FRAMES.count("\n")


@pytest.mark.parametrize(
    ("amc", "line", "message"),
    [
        ("", None, "is empty"),
        ("#!OML\n:DEGREES\n", None, "holds no frames"),
        ("HIERARCHY\nROOT x\n", 1, "a frame number should stand here, not 'HIERARCHY'; the file looks like a BVH"),
        (ASF, 5, "a frame number should stand here, not 'mass 1.0'; the file looks like an ASF skeleton"),
        (FRAMES[:-3], LAST, "bone 'shin' has 1 numbers where its skeleton has 2 (rz rx); the file is cut here"),
        (FRAMES[:-5], LAST, "bone 'shin' has 0 numbers where its skeleton has 2 (rz rx); the file is cut here"),
        (FRAMES[:-6], LAST, "frame 3: 'shi' is no moving bone of the skeleton; is the file cut here?"),
        (FRAMES[:-9], LAST - 1, "the file is cut: its last frame 3 has 2 of 3 bones; it lacks shin"),
        (FRAMES[: FRAMES.index("3\nroot") + 2], LAST - 3, "the file is cut: its last frame 3 has 0 of 3 bones"),
        (FRAMES.replace("thigh 5 6 7\n", "", 1), 6, "frame 1 has 2 of 3 bones; it lacks thigh"),
        (FRAMES.replace("thigh 5 6 7\n", ""), 6, "frame 1 has 2 of 3 bones; it lacks thigh"),
        (FRAMES.replace("shin 8 9\n", "shin 8 9\narm 1\n", 1), 8, "frame 1: 'arm' is no moving bone of the skeleton"),
        (
            FRAMES.replace("shin 8 9\n", "shin 8 9\nhip 1\n", 1),
            8,
            "'hip' is no moving bone of the skeleton; it has root",
        ),
        (FRAMES.replace("shin 8 9", "thigh 5 6 7", 1), 7, "frame 1: bone 'thigh' stands twice"),
        (FRAMES.replace("thigh 5 6 7", "thigh 5 6", 1), 6, "bone 'thigh' has 2 numbers where its skeleton has 3"),
        (FRAMES.replace("shin 8 9", "shin 8 9 10"), 7, "bone 'shin' has 3 numbers where its skeleton has 2"),
        (FRAMES.replace("thigh 5 6 7\nshin 8 9", "thigh 5 6\nshin 8 9 7"), 6, "bone 'thigh' has 2 numbers"),
        (FRAMES.replace("2\nroot", "3\nroot"), 8, "frame 3 follows frame 1: frames are missing or out of order"),
        (FRAMES.replace("2\nroot", "2 x\nroot"), 8, "a frame number should stand here, not '2 x'"),
        (FRAMES.replace("5 6 7", "5 six 7", 1), 6, "a number should stand here, not 'six'"),
        (FRAMES.replace("3.5 10", "3.5 nan"), 9, "frame 1 (counted from 0): joint 'root' is not finite"),
        (FRAMES.replace("1 2 3 10", "1 2 inf 10"), 5, "frame 0 (counted from 0): joint 'root' is not finite"),
        (FRAMES + "\0", None, "binary data"),
    ],
)
def test_bad_motions_are_refused_with_the_line(pair, amc, line, message):
    path = pair(amc)
    with pytest.raises(FileError) as caught:
        read_amc(path)
    assert message in str(caught.value)
    assert (caught.value.line, caught.value.path) == (line, str(path))


def test_any_damage_is_refused_or_read(pair):
    rng = np.random.default_rng(0)
    good = 0
    for k in range(400):
        texts = [bytearray(FRAMES.encode()), bytearray(ASF.encode())]
        for place in rng.integers(0, len(texts[k % 2]), rng.integers(1, 4)):
            texts[k % 2][place] = rng.choice(np.frombuffer(b":#0-.e\n aZ", np.uint8))
        try:
            read_amc(pair(*(text.decode() for text in texts)))
            good += 1
        except FileError:
            pass
    assert 0 < good < 400


def test_every_recording_has_the_frames_it_should(mocap: Path):
    with (mocap / "manifest.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["file"].endswith(".amc")]
    for row in rows[::6]:
        recording = read_amc(mocap / row["file"])
        assert len(recording.root_positions) == int(row["frames"])
        assert recording.names[0] == "root"
