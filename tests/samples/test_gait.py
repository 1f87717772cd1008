"""The gait model: a file that comes back, the symmetries of a body, and figures that people have been measured at."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stridecast.body import kinematics
from stridecast.body.mirroring import mirror_pairs
from stridecast.errors import DatabaseFileError, FileError
from stridecast.formats.tensors import read_tensors, write_tensors
from stridecast.geometry import quaternions as quat
from stridecast.samples import gait
from stridecast.samples.adult import adult, standing_height
from stridecast.samples.gait import (
    DETAILS,
    FEET,
    FORMAT,
    VERSION,
    GaitTable,
    Posture,
    fourier,
    gait_model,
    load_gait,
    moved_joints,
    save_gait,
)
from stridecast.samples.performance import perform

GAITS = ["walk", "run"]
WALKING, RUNNING = st.floats(0.6, 2.0), st.floats(2.0, 4.5)
PHASES = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
CREDIT = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217."
)


def table_of(name: str) -> GaitTable:
    return getattr(gait_model(), name)


def spread(*values: float, count: int = len(PHASES)) -> list[np.ndarray]:
    return [np.full(count, value) for value in values]


def posture_at(name: str, speed: float, turn: float = 0.0, acceleration: float = 0.0, hurry: float = 0.0) -> Posture:
    """One stride, frame by frame from the moment at which the feet pass."""
    return gait_model().posture(table_of(name).channels(PHASES, *spread(speed, turn, acceleration, hurry)))


# the file


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "gait.safetensors"


def test_a_model_comes_back_in_single_precision(path):
    model = gait_model()
    rough = replace(model, walk=replace(model.walk, rhythm=model.walk.rhythm + 1e-11))
    save_gait(path, rough)
    back = load_gait(path)
    np.testing.assert_array_equal(back.stand, rough.stand.astype(np.float32))
    assert np.abs(quat.log(quat.multiply(quat.inverse(rough.references), back.references))).max() < 1e-6
    for name in GAITS:
        one, two = getattr(rough, name), getattr(back, name)
        for part in ("coefficients", "rhythm", "contacts"):
            assert getattr(two, part).dtype == np.float64
            np.testing.assert_array_equal(getattr(two, part), getattr(one, part).astype(np.float32))
        assert (two.speeds, two.turn, two.acceleration) == (one.speeds, one.turn, one.acceleration)
    assert back.provenance == rough.provenance


def test_what_has_been_kept_once_is_kept_for_good(path):
    save_gait(path, gait_model())
    first = path.read_bytes()
    save_gait(path, load_gait(path))
    assert path.read_bytes() == first
    speeds, turns = np.full(60, 1.3), np.zeros(60)
    motions = [perform(speeds, turns, model=model).motion for model in (gait_model(), load_gait(path))]
    np.testing.assert_allclose(motions[0].rotations, motions[1].rotations, atol=1e-6)


def test_the_model_that_comes_along_is_small_and_credited():
    file = Path(gait.__file__).with_name("gait.safetensors")
    assert file.stat().st_size < 300_000
    provenance = gait_model().provenance
    assert CREDIT in provenance["recordings"]
    assert "Carnegie Mellon University" in provenance["recordings"]
    takes = provenance["takes"]
    assert takes == sorted(set(takes))
    assert len(takes) >= 30
    assert provenance["subjects"] == sorted({take.split("_")[0] for take in takes})
    assert gait_model() is gait_model()


def test_every_number_of_the_model_is_used_and_finite():
    model = gait_model()
    channels = 3 * len(moved_joints(adult())) + FEET + DETAILS
    assert model.stand.shape == (channels,)
    assert model.references.shape == (len(moved_joints(adult())), 4)
    for name in GAITS:
        table = table_of(name)
        features = table.features(*spread(1.0, 0.0, 0.0, 0.0, count=1)).shape[1]
        assert table.coefficients.shape[0] == features
        assert table.coefficients.shape[2] == channels
        assert table.coefficients.shape[1] % 2 == 1
        for part in (table.coefficients, table.rhythm, table.contacts):
            assert np.isfinite(part).all()
        assert np.ptp(table.coefficients, axis=(0, 1)).min() > 0


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda data: data[: len(data) // 2], "damaged or cut"),
        (lambda data: b"", "is empty"),
        (lambda data: b"HIERARCHY\nROOT Hips\n", "it looks like"),
        (lambda data: b"\x07" * 400, "not a safetensors file"),
    ],
)
def test_a_damaged_file_is_refused_with_its_name(path, harm, words):
    save_gait(path, gait_model())
    path.write_bytes(harm(path.read_bytes()))
    with pytest.raises(DatabaseFileError, match=words) as caught:
        load_gait(path)
    assert caught.value.path == str(path)


def rewritten(path: Path, header: dict, tensors: dict) -> str:
    write_tensors(path, header, tensors)
    with pytest.raises(DatabaseFileError) as caught:
        load_gait(path)
    assert caught.value.path == str(path)
    return str(caught.value)


def test_files_that_lack_something_or_are_something_else_are_refused(path):
    save_gait(path, gait_model())
    header, tensors = read_tensors(path, FORMAT, VERSION)
    assert "'run.rhythm' is missing" in rewritten(path, header, {k: v for k, v in tensors.items() if k != "run.rhythm"})
    assert "fit it again" in rewritten(path, {k: v for k, v in header.items() if k != "walk"}, tensors)
    assert "fit it again" in rewritten(path, header | {"walk": {"speeds": 1.0}}, tensors)
    assert "upgrade stridecast" in rewritten(path, header | {"version": VERSION + 1}, tensors)
    assert f"is no {FORMAT}, but a motion database" in rewritten(path, header | {"format": "motion database"}, tensors)


def test_a_file_that_is_not_there_is_refused(path):
    with pytest.raises(DatabaseFileError, match="no such file"):
        load_gait(path)
    with pytest.raises(DatabaseFileError, match="is a folder"):
        load_gait(path.parent)


def test_a_model_that_cannot_be_written_is_said(tmp_path):
    with pytest.raises(FileError):
        save_gait(tmp_path / "nowhere" / "gait.safetensors", gait_model())


# channels


@given(st.floats(-20.0, 20.0), st.integers(1, 6))
@settings(max_examples=20)
def test_waves_are_those_of_the_series(phase, harmonics):
    waves = fourier(np.array([phase]), harmonics)[0]
    assert waves[0] == 1.0
    for n in range(1, harmonics + 1):
        assert waves[2 * n - 1] == pytest.approx(np.cos(n * phase), abs=1e-12)
        assert waves[2 * n] == pytest.approx(np.sin(n * phase), abs=1e-12)


@pytest.mark.parametrize("name", GAITS)
def test_channels_are_sums_over_features_and_waves(name):
    """Oracle: the double sum, written out; and the mean over a stride is the middle."""
    table, rng = table_of(name), np.random.default_rng(3)
    given_ = [rng.uniform(low, high, 5) for low, high in ((0.8, 4.0), (-1.0, 1.0), (-1.0, 1.0), (-0.2, 0.2))]
    phases = rng.uniform(0, 7, 5)
    found = table.channels(phases, *given_)
    harmonics = table.coefficients.shape[1] // 2
    for frame in range(5):
        features = table.features(*(series[frame : frame + 1] for series in given_))[0]
        terms = [1.0] + [f(n * phases[frame]) for n in range(1, harmonics + 1) for f in (np.cos, np.sin)]
        wanted = sum(a * b * table.coefficients[i, j] for i, a in enumerate(features) for j, b in enumerate(terms))
        np.testing.assert_allclose(found[frame], wanted, atol=1e-12)
    stride = table.channels(PHASES, *spread(1.3, 0.2, 0.3, 0.0))
    np.testing.assert_allclose(stride.mean(axis=0), table.middles(*spread(1.3, 0.2, 0.3, 0.0))[0], atol=1e-12)
    np.testing.assert_allclose(table.channels(PHASES + 2 * np.pi, *spread(1.3, 0.2, 0.3, 0.0)), stride, atol=1e-9)


def test_posture_takes_channels_apart():
    """And quaternions back to rotation vectors give the channels again."""
    model = gait_model()
    channels = model.walk.channels(PHASES, *spread(1.3, 0.3, 0.0, 0.0))
    shown = model.posture(channels)
    moved = quat.log(quat.multiply(quat.inverse(model.references), shown.joints)).reshape(len(PHASES), -1)
    feet = quat.log(shown.feet).reshape(len(PHASES), -1)
    back = np.concatenate((moved, feet, shown.displacements, shown.yaws[:, None], quat.log(shown.offsets)), axis=-1)
    np.testing.assert_allclose(back, channels, atol=1e-9)


def test_moved_joints_are_all_but_root_and_feet():
    skeleton = adult()
    left_out = {skeleton.names[joint] for joint in set(skeleton.roles.values()) - set(moved_joints(skeleton))}
    assert left_out == {"Hips", "LeftFoot", "LeftToeBase", "RightFoot", "RightToeBase"}


# symmetries


@given(st.floats(0.3, 5.0), st.integers(-300, 300).map(lambda w: w / 100), st.floats(-4.0, 4.0), st.floats(-0.5, 0.5))
@settings(max_examples=40)
def test_features_of_a_turn_to_the_other_side(speed, turn, acceleration, hurry):
    """Each is either the same or its negative; the rhythm is asked only of those that stay the same."""
    for name in GAITS:
        table = table_of(name)
        one = table.features(*spread(speed, turn, acceleration, hurry, count=1))[0]
        other = table.features(*spread(speed, -turn, acceleration, hurry, count=1))[0]
        np.testing.assert_array_equal(np.abs(one), np.abs(other))
        odd = one != other
        assert odd.sum() == (2 if turn else 0)
        assert not odd[list(gait.RHYTHM)].any()
        fast, slow = (table.strides(*spread(speed, sign * turn, count=1)) for sign in (1, -1))
        np.testing.assert_array_equal(fast, slow)


def mirrored(posture: Posture) -> Posture:
    """What a mirror shows: left and right changed over, half a stride apart."""
    skeleton, joints = adult(), moved_joints(adult())
    pairs = mirror_pairs(skeleton)
    partner = [joints.index(int(pairs[joint])) for joint in joints]
    flip = np.array([1.0, 1.0, -1.0, -1.0])
    return Posture(
        joints=posture.joints[:, partner] * flip,
        feet=posture.feet[:, ::-1] * flip,
        displacements=posture.displacements * [-1.0, 1.0, 1.0],
        yaws=-posture.yaws,
        offsets=posture.offsets * flip,
    )


@given(st.floats(0.5, 5.0), st.floats(-1.5, 1.5), st.floats(-1.0, 1.0), st.floats(-0.2, 0.2))
@settings(max_examples=10)
def test_left_and_right_are_alike(speed, turn, acceleration, hurry):
    """Half a stride later in a turn to the other side, the posture is mirrored."""
    half = len(PHASES) // 2
    for name in GAITS:
        one = posture_at(name, speed, turn, acceleration, hurry)
        other = mirrored(posture_at(name, speed, -turn, acceleration, hurry))
        for part in ("joints", "feet", "offsets"):
            apart = quat.multiply(quat.inverse(getattr(one, part)), np.roll(getattr(other, part), -half, axis=0))
            assert np.abs(quat.log(apart)).max() < 1e-4
        np.testing.assert_allclose(one.displacements, np.roll(other.displacements, -half, axis=0), atol=1e-4)
        np.testing.assert_allclose(one.yaws, np.roll(other.yaws, -half), atol=1e-4)


def test_standing_is_alike_on_both_sides_and_upright():
    model = gait_model()
    posture = model.posture(model.stand[None])
    other = mirrored(posture)
    for part in ("joints", "feet", "offsets"):
        apart = quat.multiply(quat.inverse(getattr(posture, part)), getattr(other, part))
        assert np.abs(quat.log(apart)).max() < 1e-3
    np.testing.assert_allclose(posture.displacements[0], [0.0, standing_height(), 0.0], atol=1e-6)
    assert posture.yaws[0] == pytest.approx(0.0, abs=1e-6)


# outside what was learned


@pytest.mark.parametrize("name", GAITS)
def test_beyond_what_was_learned_it_stays_there(name):
    table = table_of(name)
    low, high = table.speeds
    edges = {
        "speed": ((low, 0.0, 0.0, 0.0), (low / 2, 0.0, 0.0, 0.0)),
        "fast": ((high, 0.0, 0.0, 0.0), (2 * high, 0.0, 0.0, 0.0)),
        "turn": ((high, table.turn, 0.0, 0.0), (high, 3 * table.turn, 0.0, 0.0)),
        "other turn": ((high, -table.turn, 0.0, 0.0), (high, -3 * table.turn, 0.0, 0.0)),
        "push": ((high, 0.0, table.acceleration, 0.0), (high, 0.0, 9.0, 0.0)),
        "brake": ((low, 0.0, -table.acceleration, 0.0), (low, 0.0, -9.0, 0.0)),
        "hurry": ((low, 0.0, 0.0, gait.HURRY), (low, 0.0, 0.0, 2.0)),
    }
    middle = np.array([(low + high) / 2, 0.0, 0.0, 0.0])
    for which, (edge, beyond) in edges.items():
        inside = middle + 0.9 * (np.array(edge) - middle)
        at_edge, outside, within = (table.features(*spread(*v, count=1)) for v in (edge, beyond, inside.tolist()))
        np.testing.assert_array_equal(at_edge, outside, err_msg=which)
        assert not np.allclose(at_edge, within), which
    assert table.stance(low) == table.stance(0.0)
    assert table.stance(high) == table.stance(20.0)
    assert table.stance(low) != table.stance(high)


# people


def strides_at(name: str, speed: float) -> float:
    return float(table_of(name).strides(*spread(speed, 0.0, count=1))[0])


def duty(name: str, speed: float) -> float:
    """Share of the stride in which a foot is on the floor."""
    down, up = table_of(name).stance(speed)
    return (up - down) / (2 * np.pi)


@pytest.mark.parametrize(
    ("name", "speed", "least", "most"),
    [
        # Walking, adults of all ages: Oberg et al. 1993, Bohannon 1997.
        ("walk", 0.8, 0.65, 0.85),
        ("walk", 1.1, 0.75, 0.95),
        ("walk", 1.4, 0.85, 1.02),
        ("walk", 1.8, 0.95, 1.15),
        # Running: Cavanagh and Kram 1989, Weyand et al. 2000; joggers in a laboratory are at the lower end.
        ("run", 2.5, 1.15, 1.45),
        ("run", 3.2, 1.22, 1.50),
        ("run", 4.0, 1.35, 1.60),
    ],
)
def test_rhythm_is_that_of_people(name, speed, least, most):
    assert least < strides_at(name, speed) < most


@pytest.mark.parametrize(
    ("name", "speed", "least", "most"),
    [("walk", 0.8, 0.48, 0.60), ("walk", 1.4, 0.68, 0.82), ("walk", 1.9, 0.80, 0.98), ("run", 3.0, 0.95, 1.22)],
)
def test_steps_are_as_long_as_those_of_people(name, speed, least, most):
    assert least < speed / strides_at(name, speed) / 2 < most


@given(WALKING, RUNNING)
@settings(max_examples=30)
def test_walkers_always_stand_and_runners_fly(slow, fast):
    assert 0.5 < duty("walk", slow) < 0.68
    assert 0.2 < duty("run", fast) < 0.45
    for name, speed in (("walk", slow), ("run", fast)):
        down, up = table_of(name).stance(speed)
        assert down < 0 < up, "the feet pass while the foot stands"


def test_faster_is_quicker_in_longer_steps_with_shorter_stances():
    for name, speeds in (("walk", np.linspace(0.6, 2.0, 15)), ("run", np.linspace(2.0, 4.5, 15))):
        strides = np.array([strides_at(name, speed) for speed in speeds])
        assert (np.diff(strides) > 0).all()
        assert (np.diff(speeds / strides) > 0).all()
        assert (np.diff([duty(name, speed) for speed in speeds]) < 0).all()
    assert strides_at("run", 2.0) > strides_at("walk", 2.0), "a runner hops at speeds at which a walker strides"


@pytest.mark.parametrize("speed", [0.8, 1.1, 1.4, 1.7])
def test_a_walker_is_high_when_the_feet_pass_and_a_runner_is_low(speed):
    walker, runner = posture_at("walk", speed), posture_at("run", 1.5 + speed)
    passing = np.isin(np.arange(len(PHASES)), [0, len(PHASES) // 2])
    between = np.isin(np.arange(len(PHASES)), [len(PHASES) // 4, 3 * len(PHASES) // 4])
    for posture, higher, lower in ((walker, passing, between), (runner, between, passing)):
        heights = posture.displacements[:, 1]
        assert heights[higher].mean() > heights[lower].mean() + 0.005
    assert 0.01 < np.ptp(walker.displacements[:, 1]) < 0.07
    assert 0.04 < np.ptp(runner.displacements[:, 1]) < 0.12


@pytest.mark.parametrize(("name", "speed", "least", "most"), [("walk", 1.3, 50, 75), ("run", 3.3, 75, 115)])
def test_knees_bend_as_those_of_people(name, speed, least, most):
    """Most in the swing, when the foot passes the standing one (Winter 2009)."""
    posture = posture_at(name, speed)
    for side, swing in (("left", np.pi), ("right", 0.0)):
        joint = moved_joints(adult()).index(adult().joint(f"{side}_shin"))
        knee = np.linalg.norm(quat.log(posture.joints[:, joint]), axis=-1)
        assert least < np.degrees(np.ptp(knee)) < most
        assert np.cos(PHASES[int(knee.argmax())] - swing) > 0.6


@pytest.mark.parametrize(("name", "speed"), [("walk", 1.3), ("run", 3.3)])
def test_each_arm_goes_with_the_leg_of_the_other_side(name, speed):
    skeleton, posture = adult(), posture_at(name, speed)
    rotations = np.tile(quat.IDENTITY, (len(PHASES), skeleton.joints, 1))
    rotations[:, moved_joints(skeleton)] = posture.joints
    rotations[:, 0] = quat.multiply(quat.about_y(posture.yaws), posture.offsets)
    places = kinematics.forward(skeleton, posture.displacements, rotations).positions[..., 2]
    hand, other_hand, ankle, other = (
        places[:, skeleton.joint(role)] for role in ("left_hand", "right_hand", "left_foot", "right_foot")
    )
    assert np.corrcoef(hand, other)[0, 1] > 0.7
    assert np.corrcoef(hand, ankle)[0, 1] < -0.7
    assert np.corrcoef(hand, other_hand)[0, 1] < -0.7
    assert np.ptp(hand) > 0.15
