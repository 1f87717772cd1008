from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from bodies import HIP_HEIGHT, humanoid, standing, writhing
from stridecast.analysis.contacts import find_contacts
from stridecast.body.mirroring import mirror
from stridecast.formats.recordings import load_motion
from stridecast.geometry import quaternions as quat
from stridecast.geometry import signals
from stridecast.model.contacts import Contacts
from stridecast.model.motion import Motion
from synthetic_gait import gait, ramps

WALKING, RUNNING = st.floats(0.8, 1.8), st.floats(2.5, 4.0)
CURVATURES, PHASES = st.floats(-0.5, 0.5), st.floats(0.0, 2 * np.pi)


def right_share(found: np.ndarray, truth: np.ndarray) -> float:
    return float((found == truth).mean())


def stances(planted: np.ndarray) -> list[tuple[int, int]]:
    """First frame of each stance of one foot, and the frame after its last."""
    return [(start, stop) for value, start, stop in signals.runs(planted) if value]


@given(WALKING, CURVATURES, PHASES)
@settings(max_examples=20)
def test_walking_feet_are_seen_to_stand(speed, curvature, phase):
    walk = gait(np.full(300, speed), curvature=curvature, phase=phase, rate=120.0)
    assert right_share(find_contacts(walk.motion).planted, walk.planted) >= 0.95


@given(RUNNING, CURVATURES, PHASES)
@settings(max_examples=20)
def test_running_feet_are_seen_to_stand(speed, curvature, phase):
    run = gait(np.full(240, speed), curvature=curvature, phase=phase, rate=120.0)
    assert right_share(find_contacts(run.motion).planted, run.planted) >= 0.95


@given(st.one_of(WALKING, RUNNING), CURVATURES, st.sampled_from((30.0, 60.0, 120.0)))
@settings(max_examples=20)
def test_every_stance_is_found_once_at_any_frame_rate(speed, curvature, rate):
    walk = gait(np.full(int(2.5 * rate), speed), curvature=curvature, rate=rate)
    found = find_contacts(walk.motion).planted
    for foot in (0, 1):
        whole, seen = (stances(planted[:, foot]) for planted in (walk.planted, found))
        for some, others in ((whole, seen), (seen, whole)):  # at the ends the cut may leave too little of a stance
            inside = [(a, b) for a, b in some if a > 0.1 * rate and b < len(found) - 0.1 * rate]
            assert all(sum(a < d and c < b for c, d in others) == 1 for a, b in inside)


@given(st.floats(0.9, 1.6), st.floats(0.55, 1.3))
@settings(max_examples=10)
def test_thresholds_follow_the_size_of_the_body(speed, size):
    """Short legs walk slower by the square root of their length (Froude)."""
    assume(speed < 1.45 or size > 0.75)  # beyond that the formulas' legs do not reach the floor
    walk = gait(np.full(300, speed * size), rate=120.0 * np.sqrt(size), skeleton=humanoid(size))
    assert right_share(find_contacts(walk.motion).planted, walk.planted) >= 0.93


@given(st.floats(-np.pi, np.pi), st.floats(-0.07, 0.07), st.floats(-50.0, 50.0))
@settings(max_examples=10)
def test_contacts_do_not_depend_on_where_and_which_way(angle, height, place):
    motion = gait(np.full(150, 1.3), curvature=0.3).motion
    turn = quat.about_y(angle)
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat.multiply(turn, rotations[:, 0])
    places = quat.rotate(turn, motion.root_positions) + np.array([place, height, -place])
    moved = replace(motion, rotations=rotations, root_positions=places)
    here, there = find_contacts(motion), find_contacts(moved)
    np.testing.assert_array_equal(here.planted, there.planted)
    assert there.floor - here.floor == pytest.approx(height, abs=1e-9)


def test_mirrored_walk_has_the_feet_exchanged():
    motion = gait(np.full(200, 1.3), curvature=0.3).motion
    np.testing.assert_array_equal(find_contacts(mirror(motion)).planted, find_contacts(motion).planted[:, ::-1])


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_noise_of_a_capture_makes_no_chatter(seed):
    walk = gait(np.full(360, 1.3), rate=120.0)
    rng = np.random.default_rng(seed)
    noisy = replace(
        walk.motion,
        root_positions=walk.motion.root_positions + rng.normal(0.0, 0.001, (360, 3)),
        rotations=quat.multiply(walk.motion.rotations, quat.exp(rng.normal(0.0, 0.002, (360, 24, 3)))),
    )
    found = find_contacts(noisy).planted
    assert right_share(found, walk.planted) >= 0.93
    assert [len(stances(foot)) for foot in found.T] == [len(stances(foot)) for foot in walk.planted.T]


def test_floor_is_where_the_toes_stand():
    walk = gait(np.full(200, 1.3))
    assert find_contacts(walk.motion).floor == pytest.approx(0.01, abs=0.003)
    assert find_contacts(standing()).floor == pytest.approx(HIP_HEIGHT - 0.97, abs=1e-6)


# standing


def test_standing_still_is_standing():
    contacts = find_contacts(standing(frames=60))
    assert contacts.standing.all()
    assert contacts.support() == "S" * 60


def test_standing_ends_are_found():
    walk = gait(ramps((1.0, 0.0), (2.0, 1.3), (1.2, 0.0), rate=120.0), rate=120.0)
    found, truth = find_contacts(walk.motion).standing, walk.speeds < 1e-6
    assert found[truth].all()
    runs = signals.runs(found)
    assert [bool(run.value) for run in runs] == [True, False, True]
    assert walk.speeds[found].max() < 0.2, "nobody stands who walks"


@given(WALKING, CURVATURES)
@settings(max_examples=10)
def test_walking_is_never_standing(speed, curvature):
    assert not find_contacts(gait(np.full(150, speed), curvature=curvature).motion).standing.any()


def test_shifting_weight_from_foot_to_foot_is_standing():
    motion = standing(frames=180, frame_rate=60.0)
    t = np.arange(180) / 60.0
    sway = 0.015 * np.sin(2 * np.pi * 0.4 * t)
    shifting = replace(motion, root_positions=motion.root_positions + sway[:, None] * [1.0, 0.0, 0.0])
    assert find_contacts(shifting).standing.mean() > 0.9


def test_a_foot_held_up_does_not_stand():
    motion = standing(frames=60)
    rotations = motion.rotations.copy()
    for role, angle in (("right_thigh", -1.2), ("right_shin", 1.2)):
        rotations[20:, motion.skeleton.joint(role)] = quat.exp(np.array([angle, 0.0, 0.0]))
    contacts = find_contacts(replace(motion, rotations=rotations))
    assert contacts.planted[:, 0].all()
    assert not contacts.planted[25:, 1].any()
    assert contacts.support().endswith("L" * 35)


# anything at all


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
@settings(max_examples=20)
def test_any_motion_gets_contacts(seed, frames):
    motion: Motion = writhing(frames=frames, seed=seed)
    contacts = find_contacts(motion)
    assert contacts.planted.shape == (frames, 2)
    assert np.isfinite(contacts.floor)
    assert len(contacts.support()) == frames


def test_support_letters_are_those_of_the_feet():
    planted = np.array([[True, True], [True, False], [False, True], [False, False], [True, True]])
    contacts = Contacts(planted=planted, standing=np.array([False] * 4 + [True]), floor=0.0)
    assert contacts.support() == "DLRFS"


@pytest.mark.parametrize(
    ("take", "least", "most"),
    [("16_15", 0.5, 0.72), ("07_01", 0.5, 0.72), ("35_01", 0.5, 0.72), ("16_35", 0.2, 0.45), ("02_03", 0.2, 0.45)],
)
def test_recorded_feet_stand_for_a_human_share_of_the_time(mocap, take, least, most):
    folder = mocap / "cmu" / take.split("_")[0]
    contacts = find_contacts(load_motion(next(folder.glob(f"{take}.*"))))
    share = contacts.planted.mean(axis=0)
    assert ((least < share) & (share < most)).all()
