from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import stridecast as sc
from databases import swapped
from stridecast.analysis.take import SOLE, analyse
from stridecast.body import kinematics
from stridecast.database.clips import COLUMNS, Clips, find_clips
from stridecast.database.mining import HARDEST_GAIN, MOST_GAIN, MOST_GAP, TOLERANCES, Mined, mine
from stridecast.errors import DatabaseError, InputError
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import SIDES

MOVING = st.sampled_from([("walk", 0.9, 1.7), ("run", 2.6, 3.5)])
FEW = settings(max_examples=12)


def wishes(status: str, low: float, high: float, share: float) -> dict[str, object]:
    return {"status": status, "speed": low + share * (high - low)}


def clips_of(database, status: str) -> Clips:
    return next(clips for clips in find_clips(database) if clips.status == status)


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return 2 * np.arccos(np.minimum(np.abs(np.sum(a * b, axis=-1)), 1.0))


def in_its_own_frame(motion, vehicle_turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Root and joints at the last frame, seen as the first frame's are: turned back by what the way has turned."""
    back = quat.about_y(-vehicle_turn)
    return quat.multiply(back, motion.rotations[-1, 0]), motion.rotations[-1, 1:]


# clips


def test_cycles_begin_with_the_half_in_which_the_right_foot_leaves(learned):
    for status, strings in (("walk", ["RDL", "LDR"]), ("run", ["FRF", "FLF"]), ("stand", ["S"])):
        assert [group.string for group in clips_of(learned, status).groups] == strings


def test_examples_of_a_clip_belong_together(learned):
    examples = learned.examples
    group_of = np.repeat(np.arange(len(learned.groups)), [group.count for group in learned.groups])
    for clips in find_clips(learned):
        assert list(clips.values) == list(COLUMNS)
        for rows in clips.rows:
            assert [learned.groups[group_of[row]] for row in rows] == list(clips.groups)
            assert len(set(examples.takes[rows])) == 1
        total = examples.durations[clips.rows].sum(axis=1)
        np.testing.assert_allclose(clips.values["seconds"], total)


def test_transitions_run_from_end_to_end(learned):
    found = {clips.status for clips in find_clips(learned)}
    assert {"stand-walk", "walk-stand", "walk-run", "stand-run"} <= found
    for clips in find_clips(learned):
        if clips.status.startswith("stand-"):
            assert clips.groups[0].start == "S"
            assert (clips.values["start_speed"] < 0.3).all()
        if clips.status.endswith("-stand"):
            assert clips.groups[-1].stop == "S"


def test_clips_come_in_mirrored_pairs(learned):
    known = {clips.groups: clips for clips in find_clips(learned)}
    for clips in known.values():
        if clips.repeats:
            own, other = (clips.values["mirrored"] == value for value in (0.0, 1.0))
            assert own.sum() == other.sum()
            np.testing.assert_allclose(
                np.sort(clips.values["turn"][own]), np.sort(-clips.values["turn"][other]), atol=1e-4
            )
        else:
            names = [swapped(group.name) for group in clips.groups]
            assert any([group.name for group in groups] == names for groups in known)


# laws


@FEW
@given(MOVING, st.floats(0, 1), st.one_of(st.none(), st.floats(-0.3, 0.3)))
def test_weights_are_a_mean_that_shows_what_is_wished_for(learned, kind, share, turn):
    wish = wishes(*kind, share)
    mined = mine(learned, **wish, turn=turn)
    weights = np.array([clip.weight for clip in mined.clips])
    assert weights.sum() == pytest.approx(1.0)
    assert (weights > 0).all()
    assert (np.diff(weights) <= 1e-6).all()
    assert mined.recorded == (len(weights) == 1)
    if not mined.warnings:
        assert mined.speed == pytest.approx(wish["speed"], abs=TOLERANCES["speed"] + 1e-9)
        assert mined.turn == pytest.approx(turn or 0.0, abs=TOLERANCES["turn"] + 1e-9 if turn else 0.05)
    assert mined.status == wish["status"]


@FEW
@given(MOVING, st.floats(0, 1), st.one_of(st.none(), st.floats(-0.3, 0.3)))
def test_a_cycle_has_no_seam(learned, kind, share, turn):
    """The last frame is the first one moved on, and so is what comes after it."""
    mined = mine(learned, **wishes(*kind, share), turn=turn, cycles=1)
    motion = mined.motion
    turned = mined.turn * mined.cycle
    root, joints = in_its_own_frame(motion, turned)
    assert angle(root, motion.rotations[0, 0]) < 1e-6
    assert angle(joints, motion.rotations[0, 1:]).max() < 1e-6
    assert motion.root_positions[-1, 1] == pytest.approx(motion.root_positions[0, 1], abs=1e-9)
    step = quat.multiply(quat.inverse(motion.rotations[:-1, 1:]), motion.rotations[1:, 1:])
    bends = quat.log(quat.normalize(np.concatenate((step, step[:1]))))
    changes = np.linalg.norm(np.diff(bends, axis=0), axis=-1).max(axis=-1)
    assert changes[-1] <= 1.5 * changes[:-1].max()


@FEW
@given(MOVING, st.floats(0, 1))
def test_a_second_round_is_the_first_one_moved_on(learned, kind, share):
    wish = wishes(*kind, share)
    once, twice = mine(learned, **wish, cycles=1).motion, mine(learned, **wish, cycles=2).motion
    assert twice.frames in (2 * once.frames - 2, 2 * once.frames - 1, 2 * once.frames)
    np.testing.assert_allclose(angle(twice.rotations[-1, 1:], once.rotations[-1, 1:]), 0.0, atol=1e-6)
    way = [np.linalg.norm(ground.project(m.root_positions[-1] - m.root_positions[0])) for m in (once, twice)]
    assert way[1] == pytest.approx(2 * way[0], rel=1e-6)


@FEW
@given(MOVING, st.floats(0, 1), st.one_of(st.none(), st.floats(-0.3, 0.3)))
def test_asking_for_what_was_given_gives_the_same(learned, kind, share, turn):
    first = mine(learned, **wishes(*kind, share), turn=turn)
    again = mine(learned, status=first.status, speed=first.speed, **({"turn": first.turn} if turn is not None else {}))
    shares = [{(c.take, c.first_frame, c.mirrored): c.weight for c in mined.clips} for mined in (first, again)]
    assert all(abs(shares[0].get(clip, 0.0) - shares[1].get(clip, 0.0)) < 0.01 for clip in {*shares[0], *shares[1]})
    assert not again.warnings


@FEW
@given(MOVING, st.floats(0, 1), st.floats(0.05, 0.4))
def test_left_and_right_are_mirror_images(learned, kind, share, turn):
    one, other = (mine(learned, **wishes(*kind, share), turn=sign * turn, style=(-1.0, 1.0)) for sign in (1, -1))
    assert one.speed == pytest.approx(other.speed, abs=2e-3)
    assert one.turn == pytest.approx(-other.turn, abs=2e-3)
    assert one.cycle == pytest.approx(other.cycle, rel=0.01)


@FEW
@given(st.data())
def test_an_exact_hit_comes_back_as_recorded(learned, sources, data):
    """Joints that no foot can move are those of the recording, from the right toe-off on."""
    clips = clips_of(learned, data.draw(st.sampled_from(["walk", "run"])))
    good = np.flatnonzero((np.abs(clips.gain) < MOST_GAIN) & (clips.gap < MOST_GAP) & (clips.values["mirrored"] == 0))
    which = int(data.draw(st.sampled_from(good.tolist())))
    wish = {name: float(clips.values[name][which]) for name in ("speed", "turn", "style")}
    mined = mine(learned, status=clips.status, **wish)
    assert mined.recorded
    assert len(mined.clips) == 1
    assert mined.speed == pytest.approx(wish["speed"], abs=1e-9)
    own = next(
        s.analysis
        for s in sources
        if learned.takes[s.take].name == mined.clips[0].take and s.mirrored == mined.clips[0].mirrored
    )
    # somewhere in the take there are these very postures of the arms
    arms = own.motion.skeleton.chain("left_upper_arm", "right_upper_arm", "left_forearm", "right_forearm")
    first = mined.clips[0].first_frame
    stretch = slice(max(0, first - 2), first + round(mined.cycle * own.motion.frame_rate) + 3)
    apart = angle(mined.motion.rotations[:, None, arms], own.motion.rotations[None, stretch, arms]).max(axis=-1)
    assert apart.min(axis=1).max() < np.radians(6)


@FEW
@given(MOVING, st.floats(0, 1), st.one_of(st.none(), st.floats(-0.3, 0.3)))
def test_feet_stay_where_they_stand(learned, kind, share, turn):
    """All the time they stand, knees bend forward, and no toe goes through the floor."""
    mined = mine(learned, **wishes(*kind, share), turn=turn, cycles=3)
    motion = mined.motion
    positions = kinematics.pose(motion).positions
    for side, name in enumerate(SIDES):
        toe = positions[:, motion.skeleton.joint(f"{name}_toe")]
        assert toe[:, 1].min() > 0.95 * SOLE * motion.skeleton.leg_length
        assert quat.log(motion.rotations[:, motion.skeleton.joint(f"{name}_shin")])[:, 0].min() > 0
        for planted, start, stop in signals.runs(mined.planted[:, side]):
            if planted:
                held = ground.project(toe[start:stop])
                assert np.linalg.norm(held - held.mean(axis=0), axis=-1).max() < 0.003


@pytest.fixture(scope="module")
def farthest(sources) -> dict[str, float]:
    """How far each knee and elbow was ever bent."""
    bent = {}
    for joint in (f"{side}_{part}" for side in SIDES for part in ("forearm", "shin")):
        motions = [source.analysis.motion for source in sources]
        bent[joint] = max(angle(m.rotations[:, m.skeleton.joint(joint)], quat.IDENTITY).max() for m in motions)
    return bent


@FEW
@example(("run", 2.6, 3.5), 0.415, -0.02)  # one recorded cycle, of somebody who still gains speed
@given(MOVING, st.floats(0, 1), st.floats(-0.3, 0.3))
def test_no_limb_goes_beyond_what_was_recorded(learned, farthest, kind, share, turn):
    """But for what holding a foot bends a knee, and what closing a cycle swings a limb."""
    mined = mine(learned, **wishes(*kind, share), turn=turn, cycles=2)
    for joint, most in farthest.items():
        bent = angle(mined.motion.rotations[:, mined.motion.skeleton.joint(joint)], quat.IDENTITY)
        assert bent.max() < most + np.radians(5)


def test_the_same_question_has_the_same_answer(learned):
    one, other = (mine(learned, status="walk", speed=1.234, turn=0.2, cycles=2) for _ in range(2))
    assert np.array_equal(one.motion.rotations, other.motion.rotations)
    assert np.array_equal(one.motion.root_positions, other.motion.root_positions)


def test_a_mined_walk_is_understood_as_what_was_asked_for(learned):
    mined = mine(learned, status="walk", speed=1.3, seconds=5.0)
    take = analyse(mined.motion)
    assert {segment.motion for segment in take.gait.segments} == {"walk"}
    assert np.median(take.vehicle.speeds) == pytest.approx(mined.speed, abs=0.03)
    same = [m.frame for m in take.gait.mid_stances if m.side == 0]
    assert np.median(np.diff(same)) / take.motion.frame_rate == pytest.approx(mined.cycle, rel=0.04)
    assert (take.contacts.planted == mined.planted).mean() > 0.85


# what is asked for


def test_it_begins_where_the_right_foot_leaves_at_the_origin(learned):
    mined = mine(learned, status="walk", speed=1.3, cycles=2)
    assert not mined.planted[0, 1]
    assert mined.planted[-2, 1]  # of the cycle before
    assert np.linalg.norm(ground.project(mined.motion.root_positions[0])) < 0.15
    assert mined.motion.root_positions[-1, 2] > 1.0


def test_lengths_are_those_asked_for(learned):
    walk = {"status": "walk", "speed": 1.3}
    one = mine(learned, **walk)
    assert one.motion.seconds == pytest.approx(one.cycle, abs=0.5 / 30)
    assert mine(learned, **walk, cycles=5).motion.seconds == pytest.approx(5 * one.cycle, abs=0.5 / 30)
    for seconds in (0.2, 1.0, 7.3):
        assert mine(learned, **walk, seconds=seconds).motion.seconds == pytest.approx(seconds, abs=0.5 / 30)


def test_ranges_and_lists_take_what_is_there(learned):
    known = clips_of(learned, "walk").values["speed"]
    ranged = mine(learned, status="walk", speed=(1.1, 1.5))
    assert ranged.recorded
    assert 1.1 <= ranged.speed <= 1.5
    listed = mine(learned, status="walk", speed=[9.0, float(known[3])])
    assert listed.recorded
    assert listed.speed == pytest.approx(known[3], abs=0.02)
    assert mine(learned, status=["run", "walk"], speed=1.2).status == "walk"


def test_status_follows_from_speed_where_it_is_left_out(learned):
    assert mine(learned, speed=0.0).status == "stand"
    assert mine(learned, speed=1.2).status == "walk"
    assert mine(learned, speed=3.2).status == "run"


def test_who_stands_stays(learned):
    mined = mine(learned, status="stand", seconds=4.0)
    assert mined.planted.all()
    assert mined.speed == mined.turn == 0.0
    positions = kinematics.pose(mined.motion).positions
    for name in SIDES:
        toe = ground.project(positions[:, mined.motion.skeleton.joint(f"{name}_toe")])
        assert np.linalg.norm(toe - toe[0], axis=-1).max() < 0.002


def test_transitions_come_from_end_to_end(learned):
    start = mine(learned, status="stand-walk", speed=1.3)
    assert start.cycle == 0.0
    assert start.status == "stand-walk"
    way = ground.project(start.motion.root_positions)
    speeds = np.linalg.norm(np.diff(way, axis=0), axis=-1) * start.motion.frame_rate
    assert speeds[0] < 0.3
    assert speeds[-4:].mean() == pytest.approx(start.speed, abs=0.3)
    stop = mine(learned, status="walk-stand")
    assert stop.planted[-1].any()
    way = ground.project(stop.motion.root_positions)
    assert np.linalg.norm(way[-1] - way[-2]) * stop.motion.frame_rate < 0.3


def test_conditions_hold_for_every_clip(learned):
    mined = mine(learned, status="walk", speed=1.3, where="take != 'faster' and mirrored = 0")
    assert all(clip.take != "faster" and not clip.mirrored for clip in mined.clips)
    assert {clip.take for clip in mine(learned, speed=1.0, where="take = 'stand and stroll'").clips} == {
        "stand and stroll"
    }


def test_a_person_can_be_chosen(formula_database):
    mined = mine(formula_database, status="walk", subject="01")
    assert {clip.subject for clip in mined.clips} == {"01"}
    assert mined.motion.subject == "01"
    with pytest.raises(DatabaseError, match="no subject '9' in the database; there are 01, 02"):
        mine(formula_database, subject="9")


def test_style_is_a_word_or_a_number(learned):
    """A database in which half of the walkers are said to be gloomy."""
    told = learned.annotations
    gloomy = np.isin(learned.examples.takes, [i for i, take in enumerate(learned.takes) if take.name == "faster"])
    database = replace(learned, annotations=replace(told, style=np.where(gloomy, -0.8, 0.1)))
    assert {clip.take for clip in mine(database, status="walk", style="gloomy").clips} == {"faster"}
    assert mine(database, status="walk", style="neutral").style == pytest.approx(0.1)
    half = mine(database, status="walk", speed=1.3, style=-0.35)
    assert half.style == pytest.approx(-0.35, abs=0.06)
    brisk = mine(database, status="walk", style="brisk")
    assert "style 0.35 to 1.00 is out of reach of walk; recorded is -0.80 to 0.10" in brisk.warnings[0]


# what nobody showed


@pytest.mark.parametrize(
    ("wish", "says"),
    [
        ({"status": "walk", "speed": 4.0}, "speed 4.00 m/s is out of reach of walk; recorded is"),
        ({"status": "walk", "speed": 0.1}, "speed 0.10 m/s is out of reach of walk; recorded is"),
        ({"status": "run", "speed": 3.0, "turn": 9.0}, "turn 9.00 rad/s is out of reach of run; recorded is -"),
        ({"status": "walk", "style": "gloomy", "speed": 1.3}, "style -1.00 to -0.35 is out of reach of walk"),
    ],
)
def test_what_nobody_showed_is_answered_by_the_nearest(learned, caplog, wish, says):
    with caplog.at_level(logging.WARNING, logger="stridecast"):
        mined = mine(learned, **wish)
    assert any(says in warning for warning in mined.warnings)
    assert tuple(caplog.messages) == mined.warnings
    values = clips_of(learned, wish["status"]).values
    for name in ("speed", "turn", "style"):
        assert values[name].min() - 1e-6 <= getattr(mined, name) <= values[name].max() + 1e-6


def test_an_impossible_speed_gives_the_fastest_there_is(learned):
    clips = clips_of(learned, "walk")
    fastest = clips.values["speed"][np.abs(clips.gain) <= HARDEST_GAIN].max()
    mined = mine(learned, status="walk", speed=4.0)
    assert mined.speed == pytest.approx(fastest, abs=1e-3)
    again = mine(learned, status="walk", speed=mined.speed)
    assert not again.warnings
    assert again.speed == pytest.approx(mined.speed)


@pytest.mark.parametrize(
    ("wish", "says"),
    [
        ({"status": "hop"}, "no status 'hop'; there are stand, walk, run and transitions"),
        ({"status": "walk-hop"}, "no status 'walk-hop'"),
        ({"style": "merry"}, "style must be a number, not 'merry'; the words are gloomy, neutral, brisk"),
        ({"speed": float("nan")}, "speed must be finite numbers"),
        ({"speed": -1.0}, "speed must not be negative"),
        ({"speed": (2.0, 1.0)}, "range of speed must go from low to high, not from 2 to 1"),
        ({"speed": []}, "speed must be finite numbers"),
        ({"speed": list(range(20)), "turn": [0.1, 0.2, 0.3, 0.4]}, "make 80 wishes; 64 are the most"),
        ({"cycles": 2, "seconds": 3.0}, "cycles or seconds, not both"),
        ({"cycles": 0}, "cycles must lie between 1 and"),
        ({"seconds": 0.0}, "seconds must lie above 0"),
        ({"seconds": float("nan")}, "seconds must lie above 0"),
        ({"status": "stand-walk", "cycles": 2}, "a transition such as stand-walk is played once"),
        ({"where": "speed > 99"}, "none of .* recorded clips is one where speed > 99; they show speed"),
        ({"where": "pace > 1"}, "no column 'pace'; there are take, subject, status, speed"),
    ],
)
def test_wishes_that_are_none_are_refused(learned, wish, says):
    with pytest.raises(InputError, match=says):
        mine(learned, **wish)


def test_words_belong_to_style(learned, unchecked):
    with pytest.raises(InputError, match="speed must be a number, not 'fast'"):
        mine(learned, speed="fast")


def test_what_is_not_in_the_database_is_told(formula_database):
    with pytest.raises(DatabaseError, match=r"nothing recorded shows stand-run; there are .*walk"):
        mine(formula_database, status="stand-run")


def test_mining_is_public(learned):
    assert isinstance(sc.mine(learned, status="walk", speed=1.3), Mined)
    assert sc.Mined is Mined


@pytest.mark.parametrize(
    "wish", [{"status": "walk", "speed": 1.15}, {"status": "run"}, {"status": "walk", "turn": 0.3}]
)
def test_real_people_are_mined_without_sliding(small_database, wish):
    mined = mine(small_database, **wish, cycles=4)
    positions = kinematics.pose(mined.motion).positions
    for side, name in enumerate(SIDES):
        toe = ground.project(positions[:, mined.motion.skeleton.joint(f"{name}_toe")])
        for planted, start, stop in signals.runs(mined.planted[:, side]):
            if planted:
                assert np.linalg.norm(toe[start:stop] - toe[start:stop].mean(axis=0), axis=-1).max() < 0.004
