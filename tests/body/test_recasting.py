from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bodies import humanoid, standing
from characters import A_POSE, bandai_like, built, mixamo_like, posed_at_rest, still, with_twist_bones, written
from rigs import along_x
from stridecast.analysis.contacts import find_contacts
from stridecast.body import kinematics
from stridecast.body.alignment import aligned, alignment, stands, unaligned
from stridecast.body.recasting import recast
from stridecast.errors import MotionError, SkeletonError
from stridecast.formats.recordings import load_motion
from stridecast.geometry import quaternions as quat
from stridecast.geometry import signals
from stridecast.model.contacts import SIDES
from stridecast.model.motion import Motion
from stridecast.model.skeleton import ROLES, Skeleton
from synthetic_gait import Gait, gait, ramps

RIGS = {"mixamo": mixamo_like, "bandai": bandai_like}
LEG_JOINTS = tuple(f"{side}_{part}" for side in SIDES for part in ("thigh", "shin", "foot"))
SPLAYED = {"left_thigh": (0.0, 0.0, 0.35), "right_thigh": (0.0, 0.0, -0.35)}


@pytest.fixture(scope="module", params=RIGS)
def rig(request, tmp_path_factory) -> Skeleton:
    return RIGS[request.param](tmp_path_factory.mktemp(request.param))


@pytest.fixture(scope="module")
def walk() -> Gait:
    """Starts, walks in a curve, and stops."""
    return gait(ramps((0.8, 0.0), (1.6, 1.3), (1.2, 0.0), rate=60.0), curvature=0.5, facing=0.7, rate=60.0)


@pytest.fixture(scope="module")
def recast_walk(walk, rig) -> Motion:
    return recast(walk.motion, rig, walk.planted)


def toes(motion: Motion) -> np.ndarray:
    return kinematics.pose(motion).positions[:, motion.skeleton.chain("left_toe", "right_toe")]


def hips(motion: Motion) -> np.ndarray:
    return kinematics.pose(motion).positions[:, motion.skeleton.chain("left_thigh", "right_thigh")].mean(axis=1)


def travels(motion: Motion, planted: np.ndarray) -> np.ndarray:
    """How far toes go over the ground in each stance, metres."""
    at = toes(motion)[..., ::2]
    return np.array(
        [
            np.linalg.norm(np.diff(at[start:stop, side], axis=0), axis=-1).sum()
            for side in range(2)
            for on, start, stop in signals.runs(planted[:, side])
            if on
        ]
    )


def knees(motion: Motion) -> np.ndarray:
    """How far knees bend, radians; backwards is negative."""
    world = kinematics.pose(motion)
    aside = quat.rotate(world.rotations[:, motion.skeleton.joint("hips")], np.array([1.0, 0.0, 0.0]))
    out = []
    for side in SIDES:
        hip, knee, ankle = (
            world.positions[:, j] for j in motion.skeleton.chain(*(f"{side}_{p}" for p in ("thigh", "shin", "foot")))
        )
        upper, lower = knee - hip, ankle - knee
        out.append(np.arctan2(np.sum(np.cross(upper, lower) * aside, axis=-1), np.sum(upper * lower, axis=-1)))
    return np.array(out)


def pops(motion: Motion, role: str) -> float:
    """Largest angular acceleration of a joint, rad/s2."""
    turning = quat.angular_velocity(motion.rotations[:, motion.skeleton.joint(role)], motion.frame_rate)
    return float(np.linalg.norm(np.diff(turning, axis=0), axis=-1).max() * motion.frame_rate)


def check_played(out: Motion, motion: Motion, planted: np.ndarray) -> None:
    assert (travels(out, planted) <= 1.2 * travels(motion, planted) + 1e-3).all()
    assert np.linalg.norm((hips(out) - hips(motion))[:, ::2], axis=-1).max() < 0.02
    assert knees(out).min() > 0
    for role in LEG_JOINTS:
        assert pops(out, role) < 2.0 * pops(motion, role), role
    tips = kinematics.ends(out.skeleton, kinematics.pose(out))[..., 1]
    assert tips.min() > -1e-3


# what it is for


def test_others_walk_the_same_way_with_planted_feet(walk, recast_walk):
    check_played(recast_walk, walk.motion, walk.planted)


def test_bones_keep_the_lengths_of_the_character(recast_walk, rig):
    assert recast_walk.skeleton is rig
    at = kinematics.pose(recast_walk).positions
    bones = np.linalg.norm(at[:, 1:] - at[:, rig.parents[1:]], axis=-1)
    np.testing.assert_allclose(bones, np.tile(np.linalg.norm(rig.offsets[1:], axis=-1), (len(bones), 1)), atol=1e-9)


def test_limbs_point_as_at_home_whatever_the_rest_pose(walk, recast_walk):
    """Arms; legs have steps to make."""
    there, here = (kinematics.pose(m).positions for m in (recast_walk, walk.motion))
    for side in SIDES:
        for inner, outer in (("upper_arm", "forearm"), ("forearm", "hand")):
            bones = []
            for at, m in ((there, recast_walk), (here, walk.motion)):
                a, b = m.skeleton.chain(f"{side}_{inner}", f"{side}_{outer}")
                bones.append((at[:, b] - at[:, a]) / np.linalg.norm(at[0, b] - at[0, a]))
            np.testing.assert_allclose(bones[0], bones[1], atol=1e-6)


def test_joints_that_nobody_knows_keep_their_rest_rotation(walk, recast_walk, rig):
    unknown = sorted(set(range(rig.joints)) - set(rig.roles.values()))
    assert unknown
    np.testing.assert_allclose(quat.log(recast_walk.rotations[:, unknown]), 0.0, atol=1e-9)


@pytest.mark.parametrize("take", ["07_01", "16_11"])
def test_recordings_play_on_characters(mocap, rig, take):
    folder = mocap / "cmu" / take[:2]
    motion = load_motion(next(folder.glob(f"{take}.*")))
    contacts = find_contacts(motion)
    motion = replace(motion, root_positions=motion.root_positions - [0.0, contacts.floor - 0.02, 0.0])
    out = recast(motion, rig, contacts.planted)
    assert (travels(out, contacts.planted) <= 1.2 * travels(motion, contacts.planted) + 2e-3).all()
    assert np.linalg.norm((hips(out) - hips(motion))[:, ::2], axis=-1).max() < 0.02
    assert knees(out).min() > 0
    for role in LEG_JOINTS:
        assert pops(out, role) < 2.5 * pops(motion, role), role


# laws


@given(st.floats(0.75, 1.5), st.floats(0.8, 1.3), st.floats(0.7, 1.6), st.floats(0.7, 1.6))
@settings(max_examples=12)
def test_any_build_walks(walk, legs, feet, wide, ankle):
    body = posed_at_rest(built(legs=legs, feet=feet, hips=wide, ankle=ankle), A_POSE)
    out = recast(walk.motion, body, walk.planted)
    check_played(out, walk.motion, walk.planted)


@pytest.mark.parametrize("legs", [0.45, 2.5])
def test_steps_that_are_too_long_are_shortened_instead_of_torn(walk, legs):
    """Feet may leave the ground before their time, but nothing snaps, and hips do not drop to the floor."""
    body = built(legs=legs)
    out = recast(walk.motion, body, walk.planted)
    assert np.linalg.norm((hips(out) - hips(walk.motion))[:, ::2], axis=-1).max() < 0.02
    assert knees(out).min() > 0
    assert hips(out)[:, 1].min() > 0.6 * body.leg_length
    for role in LEG_JOINTS:
        assert pops(out, role) < 3.0 / min(legs, 1.0) * pops(walk.motion, role), role


def test_the_same_body_plays_the_same_motion(walk):
    out = recast(walk.motion, humanoid(), walk.planted)
    np.testing.assert_array_equal(out.rotations, walk.motion.rotations)
    np.testing.assert_array_equal(out.root_positions, walk.motion.root_positions)


@pytest.mark.parametrize("rest", [A_POSE, SPLAYED], ids=["arms half down", "legs splayed"])
@pytest.mark.parametrize("axes", [False, True], ids=["", "along x"])
def test_the_same_body_in_another_rest_pose_makes_the_same_movement(walk, rest, axes, tmp_path):
    body = posed_at_rest(humanoid(), rest)
    body = written(tmp_path, along_x(still(body)) if axes else still(body))
    out = recast(walk.motion, body, walk.planted)
    at, wanted = (kinematics.pose(m).positions[:, m.skeleton.chain(*ROLES)] for m in (out, walk.motion))
    np.testing.assert_allclose(at, wanted, atol=3e-3)


def test_bones_between_the_joints_that_we_know_ride_along(walk):
    """Legs are as long as they are, whatever joints lie between: DAZ's bend and twist."""
    out = recast(walk.motion, with_twist_bones(), walk.planted)
    at, wanted = (kinematics.pose(m).positions[:, m.skeleton.chain(*ROLES)] for m in (out, walk.motion))
    np.testing.assert_allclose(at, wanted, atol=3e-3)


def test_planted_feet_stand_further_apart_for_wider_hips(walk):
    wide = recast(walk.motion, built(hips=1.5), walk.planted)
    both = walk.planted.all(axis=1)
    apart = [np.linalg.norm(np.diff(toes(m), axis=1)[:, 0], axis=-1)[both] for m in (wide, walk.motion)]
    assert apart[0].mean() > apart[1].mean()


# alignment


@pytest.mark.parametrize("rest", [A_POSE, SPLAYED], ids=["arms half down", "legs splayed"])
def test_alignment_takes_the_rest_pose_of_the_other(rest):
    body, model = posed_at_rest(humanoid(), rest), humanoid()
    there = kinematics.rest(aligned(body, alignment(body, model))).positions
    np.testing.assert_allclose(there, kinematics.rest(model).positions, atol=1e-9)


def test_aligned_and_back_is_the_same_movement(walk):
    body = posed_at_rest(walk.motion.skeleton, A_POSE)
    turns = alignment(body, walk.motion.skeleton)
    motion = replace(walk.motion, skeleton=aligned(body, turns))
    back = unaligned(motion, body, turns)
    np.testing.assert_allclose(kinematics.pose(back).positions, kinematics.pose(motion).positions, atol=1e-9)


def test_soles_stay_flat_however_high_the_ankles_are():
    body, model = built(ankle=2.0), humanoid()
    turns = alignment(body, model)
    np.testing.assert_allclose(quat.log(turns[body.chain("left_foot", "right_toe")]), 0.0, atol=1e-12)
    outward = posed_at_rest(humanoid(), {"left_foot": (0.0, 0.3, 0.0)})
    turns = alignment(outward, model)
    np.testing.assert_allclose(quat.log(turns[outward.joint("left_foot")]), [0.0, -0.3, 0.0], atol=1e-9)


def test_who_stands():
    assert stands(humanoid())
    assert stands(posed_at_rest(humanoid(), SPLAYED))
    assert not stands(along_x(standing()).skeleton)
    assert not stands(posed_at_rest(humanoid(), {"left_thigh": (-1.5, 0.0, 0.0), "right_thigh": (-1.5, 0.0, 0.0)}))


# refusals


def test_planted_of_other_length(walk):
    with pytest.raises(MotionError, match="planted"):
        recast(walk.motion, built(legs=1.1), walk.planted[1:])


@pytest.mark.parametrize("lacking", ["source", "character"])
def test_missing_leg_is_named(walk, lacking):
    legless = replace(humanoid(), roles={r: j for r, j in humanoid().roles.items() if r != "right_shin"})
    motion = replace(walk.motion, skeleton=legless) if lacking == "source" else walk.motion
    with pytest.raises(SkeletonError, match="right_shin"):
        recast(motion, legless if lacking == "character" else built(legs=1.1), walk.planted)
