from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import humanoid, standing, writhing
from rigs import FAMILIES, along_x, recorded, reframed, with_t_pose
from stridecast.body import kinematics
from stridecast.body.conventions import UNITS, to_motion, to_skeleton
from stridecast.body.rig import RawRecording
from stridecast.errors import InputError, MotionError, SkeletonError
from stridecast.geometry import quaternions as quat
from stridecast.model.motion import Motion

UP = {"Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0), "X": (1.0, 0.0, 0.0), "-Y": (0.0, -1.0, 0.0)}
FRONT = np.array([0.0, 0.0, 1.0])


def places(motion: Motion) -> np.ndarray:
    return kinematics.pose(motion).positions


def swaying(frame_rate: float = 60.0, seed: int = 0) -> Motion:
    """Someone upright who walks about and moves every joint."""
    motion = writhing(frames=120, frame_rate=frame_rate, seed=seed)
    rotations = motion.rotations.copy()
    rotations[:, 1:] = quat.exp(0.4 * quat.log(rotations[:, 1:]))
    rotations[:, 0] = quat.about_y(quat.twist_about_y(rotations[:, 0]))
    return replace(motion, rotations=quat.continuous(rotations))


def assert_same_movement(motion: Motion, original: Motion) -> None:
    assert motion.frames == original.frames
    np.testing.assert_allclose(places(motion), places(original), atol=1e-9)


def without(recording: RawRecording, lost: list[str], ends: bool = True) -> RawRecording:
    """The recording without some leaf joints; where they were, bones end, or not."""
    kept = [joint for joint, name in enumerate(recording.names) if name not in lost]
    gone = [joint for joint, name in enumerate(recording.names) if name in lost]
    new = {old: index for index, old in enumerate(kept)}
    hang = [k for k, joint in enumerate(recording.end_joints) if int(joint) in new]
    tips = gone if ends else []
    return replace(
        recording,
        names=tuple(recording.names[joint] for joint in kept),
        parents=np.array([new.get(int(recording.parents[joint]), -1) for joint in kept]),
        offsets=recording.offsets[kept],
        rotations=recording.rotations[:, kept],
        end_joints=np.array(
            [new[int(recording.end_joints[k])] for k in hang] + [new[int(recording.parents[j])] for j in tips], np.int64
        ),
        end_offsets=np.concatenate((recording.end_offsets[hang], recording.offsets[tips])),
    )


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(sorted(UNITS)),
    st.sampled_from(sorted(UP)),
    st.sampled_from(sorted(FAMILIES)),
)
def test_any_unit_axis_and_names_give_the_same_movement(seed: int, unit: str, up: str, family: str):
    original = swaying(seed=seed)
    world = quat.between(np.array([0.0, 1.0, 0.0]), np.array(UP[up]))
    motion, notes = to_motion(recorded(original, unit=UNITS[unit], world=world, family=family))
    # opposite axes leave open which way to turn; all others lead back
    back = quat.multiply(quat.between(np.array(UP[up]), np.array([0.0, 1.0, 0.0])), world)
    np.testing.assert_allclose(places(motion), quat.rotate(back, places(original)), atol=1e-9)
    np.testing.assert_allclose(motion.skeleton.offsets, original.skeleton.offsets, atol=1e-12)
    assert dict(motion.skeleton.roles) == dict(original.skeleton.roles)
    assert any(unit in note for note in notes)
    assert any("up" in note for note in notes) == (up != "Y")


@pytest.mark.parametrize("turns", [1, 2, 3])
@pytest.mark.parametrize("lean", [0.0, np.pi / 2, -np.pi / 2])
def test_rest_poses_are_turned_to_face_forward(turns: int, lean: float):
    original = swaying()
    way = quat.multiply(quat.exp(np.array([lean, 0.0, 0.0])), quat.about_y(turns * np.pi / 2))
    rig = reframed(original, np.tile(quat.inverse(way), (original.skeleton.joints, 1)))
    motion, notes = to_motion(recorded(rig))
    assert_same_movement(motion, original)
    np.testing.assert_allclose(motion.skeleton.offsets, original.skeleton.offsets, atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(motion.rotations * original.rotations, axis=-1)), 1.0, atol=1e-12)
    assert any("face +Z" in note for note in notes)


def test_a_pelvis_that_is_not_quite_symmetric_is_left_alone():
    original = swaying()
    offsets = original.skeleton.offsets.copy()
    offsets[original.skeleton.joint("left_thigh")] += [0.0, 0.0, 0.03]
    crooked = replace(original, skeleton=replace(original.skeleton, offsets=offsets))
    motion, notes = to_motion(recorded(crooked))
    np.testing.assert_array_equal(motion.skeleton.offsets, offsets)
    assert not any("face" in note for note in notes)


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_rest_pose_without_a_pose_has_its_pelvis_turned(mirrored: bool):
    original = swaying()
    motion, _ = to_motion(recorded(along_x(original, mirrored), unit=0.01, family="LaFAN1"))
    assert_same_movement(motion, original)
    fronts = quat.rotate(motion.rotations[:, 0], FRONT)
    wanted = quat.rotate(original.rotations[:, 0], FRONT)
    assert np.degrees(np.arccos(np.sum(fronts * wanted, axis=-1))).max() < 10.0
    left, right = motion.skeleton.offsets[motion.skeleton.chain("left_thigh", "right_thigh")]
    assert (left - right)[0] > 0.1


def test_a_flat_pelvis_is_told():
    original = standing()
    offsets = original.skeleton.offsets.copy()
    for role in ("left_thigh", "right_thigh"):
        offsets[original.skeleton.joint(role), 0] = 0.0
    flat = replace(original, skeleton=replace(original.skeleton, offsets=offsets))
    _, notes = to_motion(recorded(flat))
    assert any("where forward is" in note for note in notes)


def test_left_and_right_changed_over_is_told():
    original = swaying()
    names = tuple(
        name.replace("Left", "*").replace("Right", "Left").replace("*", "Right") for name in original.skeleton.names
    )
    _, notes = to_motion(replace(recorded(original), names=names))
    assert any("left and right changed over" in note for note in notes)


@pytest.mark.parametrize("frame_rate", [30.0, 60.0, 120.0])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (30.0, 1.0, 5.0)])
def test_a_t_pose_is_dropped(frame_rate: float, place: tuple[float, float, float]):
    original = swaying(frame_rate)
    lowered = original.rotations.copy()
    for side, sign in (("left", -1.0), ("right", 1.0)):
        arm, thigh = original.skeleton.chain(f"{side}_upper_arm", f"{side}_thigh")
        lowered[:, arm] = quat.multiply(quat.exp(np.array([0.0, 0.0, sign * 1.3])), lowered[:, arm])
        lowered[:, thigh] = quat.multiply(quat.exp(np.array([0.5 * sign, 0.0, 0.0])), lowered[:, thigh])
    original = replace(original, rotations=quat.continuous(lowered))
    motion, notes = to_motion(recorded(with_t_pose(original, np.array(place))))
    assert_same_movement(motion, original)
    assert any("first frame is left out" in note for note in notes)


@given(st.integers(0, 2**32 - 1), st.sampled_from([24.0, 30.0, 60.0, 120.0, 240.0]))
def test_a_good_first_frame_stays(seed: int, frame_rate: float):
    original = writhing(frames=40, frame_rate=frame_rate, seed=seed)
    motion, _ = to_motion(recorded(original), up="Y")
    assert motion.frames == original.frames


def test_one_joint_that_flips_is_no_t_pose():
    original = standing()
    rotations = original.rotations.copy()
    rotations[0, original.skeleton.joint("left_hand")] = quat.exp(np.array([3.0, 0.0, 0.0]))
    motion, _ = to_motion(recorded(replace(original, rotations=rotations)))
    assert motion.frames == original.frames


@pytest.mark.parametrize(
    ("stated", "rate"),
    [(1 / 0.0083333, 120.0), (1 / 0.033333, 30.0), (1 / 0.0333667, 30000 / 1001), (1 / 0.01, 100.0), (12.37, 12.37)],
)
def test_frame_rates_are_the_usual_ones(stated: float, rate: float):
    motion, notes = to_motion(replace(recorded(standing()), frame_rate=stated))
    assert motion.frame_rate == pytest.approx(rate, rel=1e-12)
    assert not any("frame rate" in note for note in notes)


def test_a_missing_frame_rate_is_told_and_a_given_one_counts():
    silent = replace(recorded(standing()), frame_rate=None)
    motion, notes = to_motion(silent)
    assert motion.frame_rate == 120.0
    assert any("120 frames a second are assumed" in note for note in notes)
    assert to_motion(silent, frame_rate=33.3)[0].frame_rate == 33.3
    assert to_motion(recorded(standing()), frame_rate=60.0)[0].frame_rate == 60.0
    with pytest.raises(MotionError, match="frame rate"):
        to_motion(silent, frame_rate=0.0)


def test_a_scale_counts_before_the_file_and_the_file_before_a_guess():
    recording = replace(recorded(standing(), unit=0.01), unit=0.02)
    assert to_motion(recording)[0].skeleton.leg_length == pytest.approx(2 * humanoid().leg_length)
    assert any("not an adult's" in note for note in to_motion(recording)[1])
    motion, notes = to_motion(recording, scale=0.01)
    assert motion.skeleton.leg_length == pytest.approx(humanoid().leg_length)
    assert not notes
    for scale in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="scale"):
            to_motion(recording, scale=scale)


def test_an_unknown_unit_makes_an_adult():
    motion, notes = to_motion(recorded(standing(), unit=0.5))
    assert motion.skeleton.leg_length == pytest.approx(0.85)
    assert any("no known unit" in note for note in notes)


@pytest.mark.parametrize("unit", [0.01, 0.001])
def test_a_stated_unit_that_makes_giants_is_not_believed(unit):
    recording = replace(recorded(standing(), unit=unit), unit=1.0)
    motion, notes = to_motion(recording)
    np.testing.assert_allclose(places(motion), places(standing()), atol=1e-9)
    assert any("that the file states" in note for note in notes)
    assert to_motion(recording, scale=1.0)[0].skeleton.leg_length == pytest.approx(humanoid().leg_length / unit)


def test_up_may_be_said():
    original = standing()
    lying = recorded(original, world=quat.exp(np.array([np.pi / 2, 0.0, 0.0])))
    np.testing.assert_allclose(places(to_motion(lying, up="z")[0]), places(original), atol=1e-9)
    fallen = to_motion(lying, up="+Y")[0]
    assert np.ptp(places(fallen)[0, :, 1]) < 0.5
    for up in ("W", "", "YZ", "--Y"):
        with pytest.raises(InputError, match="up must be"):
            to_motion(lying, up=up)


def hung(recording: RawRecording, moving: bool) -> RawRecording:
    """The recording below a root on the floor, that stands still while the hips move, or carries them."""
    height = np.array([0.0, float(np.median(recording.root_positions[:, 1])), 0.0])
    frames = len(recording.root_positions)
    return replace(
        recording,
        names=("Armature", "Prop", *recording.names),
        parents=np.concatenate(([-1, 0], np.where(recording.parents < 0, 0, recording.parents + 2))),
        offsets=np.concatenate((np.zeros((2, 3)), height[None], recording.offsets[1:])),
        end_joints=np.append(recording.end_joints + 2, 1),
        end_offsets=np.concatenate((recording.end_offsets, np.ones((1, 3)))),
        root_positions=recording.root_positions - height if moving else np.zeros((frames, 3)),
        rotations=np.concatenate((np.tile(quat.IDENTITY, (frames, 2, 1)), recording.rotations), axis=1),
        slides={} if moving else {2: recording.root_positions},
    )


@pytest.mark.parametrize("moving", [False, True])
def test_joints_above_the_hips_are_folded_into_the_root(moving: bool):
    original = swaying()
    rig = along_x(original, mirrored=True)
    motion, notes = to_motion(hung(recorded(rig, unit=0.01, family="Bandai-Namco"), moving))
    assert motion.skeleton.names[0] == "Hips"
    assert_same_movement(motion, original)
    assert any("below Armature" in note for note in notes)
    assert any("left out" in note and "Prop" in note for note in notes)


def test_turns_above_the_hips_count():
    original = swaying()
    recording = hung(recorded(original), moving=False)
    rotations = recording.rotations.copy()
    rotations[:, 0] = quat.about_y(0.7)
    motion, _ = to_motion(replace(recording, rotations=rotations))
    np.testing.assert_allclose(places(motion), quat.rotate(quat.about_y(0.7), places(original)), atol=1e-9)


def test_the_roots_offset_is_added_where_the_feet_need_it():
    original = swaying()
    lift = np.array([0.0, 0.98, 0.0])
    offsets = recorded(original).offsets.copy()
    offsets[0] = lift
    motion, notes = to_motion(
        replace(recorded(original), offsets=offsets, root_positions=original.root_positions - lift)
    )
    assert_same_movement(motion, original)
    assert any("root's offset is added" in note for note in notes)
    motion, notes = to_motion(replace(recorded(original), offsets=offsets))
    assert_same_movement(motion, original)
    assert not any("offset" in note for note in notes)


def test_missing_toes_are_made_where_the_foot_ends():
    original = swaying()
    recording = without(recorded(original), ["LeftToeBase", "RightToeBase"])
    motion, notes = to_motion(recording)
    for side, name in (("left", "LeftFootToe"), ("right", "RightFootToe")):
        toe = motion.skeleton.joint(f"{side}_toe")
        assert motion.skeleton.names[toe] == name
        wanted = places(original)[:, original.skeleton.joint(f"{side}_toe")]
        np.testing.assert_allclose(places(motion)[:, toe], wanted, atol=1e-9)
    assert sum("toe joint is added" in note for note in notes) == 2
    assert not np.isin(motion.skeleton.end_joints, motion.skeleton.chain("left_foot", "right_foot")).any()


def test_a_child_of_the_foot_is_its_toe():
    original = swaying()
    names = tuple(name.replace("ToeBase", "Ball") for name in original.skeleton.names)
    motion, notes = to_motion(replace(recorded(original), names=names))
    assert motion.skeleton.names[motion.skeleton.joint("left_toe")] == "LeftBall"
    assert any("'RightBall' is taken for the right toe" in note for note in notes)


def test_feet_that_end_nowhere_are_refused():
    with pytest.raises(SkeletonError, match="no joint found for left_toe, right_toe"):
        to_motion(without(recorded(standing()), ["LeftToeBase", "RightToeBase"], ends=False))


def test_joints_that_slide():
    original = swaying()
    recording = recorded(original)

    def sliding(role: str, by: float) -> RawRecording:
        joint = original.skeleton.joint(role)
        slide = np.tile(recording.offsets[joint], (original.frames, 1))
        slide[::2, 1] += by
        return replace(recording, slides={joint: slide})

    assert not to_motion(sliding("left_shin", 0.005))[1][1:]
    with pytest.raises(MotionError, match=r"^take: joint 'LeftLeg' moves up to 0.05 m"):
        to_motion(sliding("left_shin", 0.05), source="take")
    motion, notes = to_motion(sliding("left_hand", 0.05))
    assert any("'LeftHand' moves up to 0.05 m" in note for note in notes)
    assert_same_movement(motion, original)


def test_signs_run_on():
    original = swaying()
    flipped = original.rotations * np.where(np.arange(original.frames) % 2, -2.0, 2.0)[:, None, None]
    motion, _ = to_motion(replace(recorded(original), rotations=flipped))
    assert (np.sum(motion.rotations[1:] * motion.rotations[:-1], axis=-1) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(motion.rotations, axis=-1), 1.0)


def test_a_root_that_jumps_is_refused_with_the_frame():
    original = standing(frame_rate=30.0)
    root = original.root_positions.copy()
    root[17:] += [0.3, 0.0, 0.0]
    with pytest.raises(MotionError, match=r"^a.bvh: the root jumps at frame 17: 9.0 m/s"):
        to_motion(replace(recorded(original), root_positions=root), source="a.bvh")
    root[17:] -= [0.04, 0.0, 0.0]
    assert to_motion(replace(recorded(original), root_positions=root))[0].frames == original.frames


def test_the_frame_of_a_jump_counts_from_the_files_first():
    original = with_t_pose(standing(frame_rate=30.0), np.array([9.0, 0.0, 0.0]))
    root = original.root_positions.copy()
    root[48:] += [1.0, 0.0, 0.0]
    with pytest.raises(MotionError, match="frame 48"):
        to_motion(replace(recorded(original), root_positions=root))


def test_too_few_frames_are_refused():
    recording = recorded(standing(frames=1))
    with pytest.raises(MotionError, match="at least 2 frames, not 1"):
        to_motion(recording)
    assert to_motion(recorded(standing(frames=2)))[0].frames == 2


def test_numbers_that_are_none_are_refused():
    recording = recorded(standing())
    recording.rotations[3, 7, 1] = np.nan
    with pytest.raises(MotionError, match=r"^take: frame 3: joint 'LeftLeg' is not finite"):
        to_motion(recording, source="take")
    recording = recorded(standing())
    recording.root_positions[5, 2] = np.inf
    with pytest.raises(MotionError, match="frame 5: joint 'Hips' is not finite"):
        to_motion(recording)


def test_no_body_is_refused():
    recording = recorded(standing())
    with pytest.raises(SkeletonError, match="no length"):
        to_motion(replace(recording, offsets=np.zeros_like(recording.offsets)))
    strange = replace(recording, names=tuple(f"joint{k}" for k in range(len(recording.names))))
    with pytest.raises(SkeletonError, match="no joint found for hips, left_thigh"):
        to_motion(strange)
    body = humanoid()
    mapping = {role: f"joint{joint}" for role, joint in body.roles.items()}
    assert dict(to_motion(strange, roles=mapping)[0].skeleton.roles) == dict(body.roles)


@pytest.mark.parametrize("family", ["Mixamo", "LaFAN1"])
def test_the_skeleton_alone_is_that_of_the_motion(family: str):
    rig = along_x(swaying()) if family == "LaFAN1" else swaying()
    recording = recorded(rig, unit=0.0254, family=family)
    motion, _ = to_motion(recording)
    skeleton, notes = to_skeleton(recording)
    np.testing.assert_array_equal(skeleton.offsets, motion.skeleton.offsets)
    np.testing.assert_array_equal(skeleton.end_offsets, motion.skeleton.end_offsets)
    assert skeleton.names == motion.skeleton.names
    assert any("inches" in note for note in notes)


def test_names_and_source_are_kept():
    motion, _ = to_motion(recorded(standing()), name="02_01", subject="02", source="02_01.bvh")
    assert (motion.name, motion.subject, motion.source) == ("02_01", "02", "02_01.bvh")
