from __future__ import annotations

import logging

import numpy as np
import pytest

from databases import analysed, formula_motions, takes_of
from stridecast.database.assembly import assemble
from stridecast.errors import DatabaseError, InputError, WishError
from stridecast.geometry import ground
from stridecast.model.pose import Pose
from stridecast.steering.force import SteeringGains
from stridecast.synthesis.sizes import enlargement
from stridecast.synthesis.walker import Walker, Walkers
from stridecast.synthesis.wishes import FARTHEST
from walks import motions_of, points_of

FRAMES = 45


def numbers(pose: Pose) -> tuple:
    """Everything in a pose, to be compared bit for bit."""
    vehicle, bounds = pose.vehicle, pose.bounds
    arrays = (
        pose.root_position,
        pose.rotations,
        pose.planted,
        vehicle.position,
        vehicle.velocity,
        vehicle.acceleration,
        vehicle.heading,
        bounds.jerk,
        bounds.tangential,
        bounds.lateral,
        bounds.speed,
    )
    return (*(np.asarray(array).tobytes() for array in arrays), pose.motion, pose.group, pose.clamped)


def warmed(walker: Walker, frames: int = FRAMES, seed: int = 0) -> list[Pose]:
    points = points_of("mouse", frames, 30.0, seed)
    return [walker.step(point, motion="walk") for point in points]


# one and many


def test_a_walker_is_a_batch_of_one_without_its_axis(database):
    one, many = Walker(database, (1.0, 2.0), 0.4), Walkers(database, np.array([[1.0, 2.0]]), 0.4)
    motions = motions_of(database.motions, FRAMES, 30.0, 3)
    for point, motion in zip(points_of("zigzag", FRAMES, 30.0, 3), motions, strict=True):
        single, batch = one.step(point, motion=motion), many.step(point[None], motion=motion)
        assert (single.motion, single.group, single.clamped) == (batch.motion[0], batch.group[0], batch.clamped[0])
        for a, b in (
            (single.root_position, batch.root_position[0]),
            (single.rotations, batch.rotations[0]),
            (single.planted, batch.planted[0]),
            (single.vehicle.position, batch.vehicle.position[0]),
            (single.vehicle.heading, batch.vehicle.heading[0]),
            (single.bounds.jerk, batch.bounds.jerk[0]),
        ):
            np.testing.assert_array_equal(a, b)


def test_shapes_of_one_pose_and_of_many(formulas):
    joints = formulas.skeleton.joints
    one = Walker(formulas).step((0.0, 1.0))
    many = Walkers(formulas, np.zeros((3, 2))).step(np.ones((3, 2)))
    assert (one.root_position.shape, one.rotations.shape, one.planted.shape) == ((3,), (joints, 4), (2,))
    assert (many.root_position.shape, many.rotations.shape, many.planted.shape) == ((3, 3), (3, joints, 4), (3, 2))
    assert (many.vehicle.position.shape, many.vehicle.heading.shape) == ((3, 2), (3,))
    assert many.bounds.tangential.shape == (3, 2)
    assert len(many.motion) == len(many.group) == len(many.clamped) == 3


def test_poses_already_handed_out_do_not_change(formulas):
    walker = Walker(formulas)
    first = walker.step((0.0, 3.0))
    kept = numbers(first)
    warmed(walker)
    assert numbers(first) == kept


def test_walkers_of_one_database_do_not_share_their_state(formulas):
    alone, busy = Walker(formulas), Walker(formulas)
    expected = [numbers(pose) for pose in warmed(alone)]
    found = []
    for point in points_of("mouse", FRAMES, 30.0, 0):
        Walker(formulas).step((5.0, 5.0), motion="run")
        found.append(numbers(busy.step(point, motion="walk")))
    assert found == expected


# where it starts


@pytest.mark.parametrize("heading", [0.0, 1.0, -3.0, np.pi])
def test_the_first_frame_stands_where_it_was_put_and_looks_where_it_was_told(database, heading):
    pose = Walker(database, (3.0, -2.0), heading).step((3.0, -2.0))
    np.testing.assert_allclose(pose.vehicle.position, [3.0, -2.0], atol=1e-9)
    np.testing.assert_array_equal(pose.vehicle.velocity, 0.0)
    assert abs(ground.wrap(np.asarray(pose.vehicle.heading - heading))) < 1e-12
    assert pose.motion == "stand"
    assert pose.planted.all()
    assert np.linalg.norm(ground.project(pose.root_position) - [3.0, -2.0]) < 0.2


def test_names_of_motions_are_those_of_the_database(database):
    walker = Walker(database)
    assert walker.motions == database.motions == ("stand", "walk", "run")
    assert walker.database is database
    assert walker.frame_rate == database.frame_rate
    assert len(Walkers(database, np.zeros((4, 2)))) == 4


def test_frame_rate_is_a_choice(formulas):
    slow, fast = Walker(formulas, frame_rate=30.0), Walker(formulas, frame_rate=120.0)
    for frame in range(120):
        a = slow.step((0.0, 1.2 * frame / 30.0))
        for part in range(4):
            b = fast.step((0.0, 1.2 * (frame + part / 4) / 30.0))
    np.testing.assert_allclose(b.vehicle.position, a.vehicle.position, atol=0.15)
    np.testing.assert_allclose(b.vehicle.velocity, a.vehicle.velocity, atol=0.15)


def test_stiffer_gains_follow_closer(formulas):
    behind = []
    for half_life in (0.15, 0.3, 0.6):
        walker = Walker(formulas, gains=SteeringGains(half_life=half_life))
        for frame in range(180):
            pose = walker.step((0.0, 1.2 * frame / 30))
        behind.append(1.2 * 179 / 30 - pose.vehicle.position[1])
    assert 0.0 < behind[0] < behind[1] < behind[2]
    assert behind[1] == pytest.approx(1.2 * SteeringGains(half_life=0.3).lag, abs=0.1)


# forces


def test_a_force_ahead_speeds_up_and_one_behind_slows_down(database):
    walker = Walker(database)
    speeds = []
    for force in (3.0, 0.0, -3.0):
        for _ in range(45):
            pose = walker.step(force=(0.0, force), motion="walk")
        speeds.append(float(pose.vehicle.velocity[1]))
    assert speeds[0] > 1.0
    assert speeds[2] < speeds[1] - 0.3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_force_to_the_side_turns_to_that_side(database, side):
    walker = Walker(database)
    for _ in range(60):
        walker.step(force=(0.0, 2.0), motion="walk")
    before = float(walker.step(force=(0.0, 0.0), motion="walk").vehicle.heading)
    for _ in range(15):
        pose = walker.step(force=(1.5 * side, 0.0), motion="walk")
    assert side * (float(pose.vehicle.heading) - before) > 0.08


def test_no_force_starts_nobody(database):
    walker = Walker(database)
    for _ in range(60):
        pose = walker.step(force=(0.0, 0.0), motion="walk")
    assert pose.motion == "stand"
    np.testing.assert_array_equal(pose.vehicle.position, 0.0)


# wishes that are rejected change nothing

BAD_WISHES = {
    "nothing": {},
    "both": {"point": (0.0, 1.0), "force": (0.0, 1.0)},
    "not a number": {"point": (float("nan"), 1.0)},
    "infinite": {"point": (0.0, float("inf"))},
    "infinite force": {"force": (float("-inf"), 0.0)},
    "too far": {"point": (0.0, 2 * FARTHEST)},
    "unknown motion": {"point": (0.0, 1.0), "motion": "swim"},
    "a transition": {"point": (0.0, 1.0), "motion": "stand-walk"},
    "empty motion": {"point": (0.0, 1.0), "motion": ""},
    "three numbers": {"point": (0.0, 1.0, 2.0)},
    "one number": {"point": 1.0},
    "words": {"point": ("far", "away")},
    "no motion": {"point": (0.0, 1.0), "motion": None},
    "many motions": {"point": (0.0, 1.0), "motion": ["walk"]},
}


@pytest.mark.parametrize("wish", list(BAD_WISHES.values()), ids=list(BAD_WISHES))
@pytest.mark.usefixtures("unchecked")
def test_a_rejected_wish_leaves_the_walker_as_it_was(formulas, wish):
    asked, spared = Walker(formulas), Walker(formulas)
    warmed(asked), warmed(spared)
    with pytest.raises(WishError):
        asked.step(**wish)
    after = [numbers(pose) for pose in warmed(asked, seed=1)]
    assert after == [numbers(pose) for pose in warmed(spared, seed=1)]


@pytest.mark.parametrize(
    ("wish", "culprit"),
    [
        ({"points": np.array([[0.0, 0.0], [np.nan, 1.0], [0.0, 0.0]])}, "character 1"),
        ({"points": np.zeros((2, 2))}, r"\(3, 2\)"),
        ({"forces": np.zeros((3, 3))}, r"forces.*\(3, 2\)"),
        ({"points": np.zeros((3, 2)), "motion": ["walk", "run"]}, "2 motions for 3 characters"),
        ({"points": np.zeros((3, 2)), "motion": ["walk", "fly", "run"]}, "'fly'; there are stand, walk, run"),
        ({"points": np.zeros((3, 2)), "motion": ["walk", 7, "run"]}, "7"),
        ({"points": np.zeros((3, 2)), "motion": ["walk", ["run"], "run"]}, "run"),
        ({"points": np.zeros((3, 2)), "forces": np.zeros((3, 2))}, "one of points, forces and accelerations"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_a_rejected_wish_of_one_changes_nobody(formulas, wish, culprit):
    asked, spared = (Walkers(formulas, np.zeros((3, 2))) for _ in range(2))
    stream = np.stack([points_of(kind, FRAMES, 30.0, 2) for kind in ("straight", "circle", "noise")], axis=1)
    for frame in range(FRAMES):
        if frame % 15 == 7:
            with pytest.raises(WishError, match=culprit):
                asked.step(**wish)
        a, b = asked.step(stream[frame], motion="walk"), spared.step(stream[frame], motion="walk")
        assert numbers(a) == numbers(b)


# refusals at the start


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        ({"positions": np.zeros((0, 2))}, "positions"),
        ({"positions": np.zeros((2, 3))}, r"\(2, 3\)"),
        ({"positions": np.zeros(2)}, r"\(2,\)"),
        ({"positions": np.array([[np.nan, 0.0]])}, "finite"),
        ({"positions": np.zeros((1, 2)), "headings": float("inf")}, "finite"),
        ({"positions": np.zeros((1, 2)), "frame_rate": 5.0}, "10 and 240"),
        ({"positions": np.zeros((1, 2)), "frame_rate": float("nan")}, "10 and 240"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_places_that_are_none_are_refused(formulas, arguments, culprit):
    with pytest.raises(InputError, match=culprit):
        Walkers(formulas, **arguments)


@pytest.mark.parametrize("position", [(0.0,), (0.0, 0.0, 0.0), 1.0])
@pytest.mark.usefixtures("unchecked")
def test_a_position_is_two_numbers(formulas, position):
    with pytest.raises(InputError, match="ground point"):
        Walker(formulas, position)


def test_an_unknown_subject_is_refused_with_those_there_are(formulas):
    with pytest.raises(DatabaseError, match=r"nobody.*formula"):
        Walker(formulas, subject="nobody")


# one person's manner, and what nobody showed


@pytest.fixture(scope="module")
def two_people():
    motions = formula_motions()
    chosen = {name: motions[name] for name in ("stand and walk", "walk and run")}
    return assemble(analysed(chosen), takes_of(chosen, ["walker", "runner"]))


def test_who_keeps_to_a_person_can_do_what_that_person_did(two_people):
    assert Walker(two_people).motions == ("stand", "walk", "run")
    assert Walker(two_people, subject="walker").motions == ("stand", "walk")
    with pytest.raises(WishError, match=r"'run'; there are stand, walk$"):
        Walker(two_people, subject="walker").step((0.0, 1.0), motion="run")


def test_who_keeps_to_a_person_does_nothing_that_only_others_did(two_people):
    whose = np.array([take.subject for take in two_people.takes])[two_people.examples.takes]
    own = {group.name for group in two_people.groups if (whose[group.rows] == "walker").any()}
    assert own < {group.name for group in two_people.groups}
    assert {pose.group for pose in warmed(Walker(two_people, subject="walker"), 90)} <= own


def test_a_transition_without_an_example_is_made_up_and_counted():
    motions = formula_motions()
    chosen = {name: motions[name] for name in ("faster", "run")}
    database = assemble(analysed(chosen), takes_of(chosen))
    walker = Walker(database)
    assert walker.motions == ("walk", "run")
    assert walker.made_up == 0
    seen = set()
    for frame in range(120):
        motion = "walk" if frame < 60 else "run"
        seen.add(walker.step((0.0, 0.05 * frame), motion=motion).motion)
    assert "run" in seen
    assert walker.made_up >= 1


def test_compiling_is_announced_not_silent(formulas, caplog, monkeypatch):
    import stridecast.synthesis.walker as module

    class Fresh:
        signatures = ()

        def __call__(self, *arguments: object) -> None:
            pass

    monkeypatch.setattr(module, "step_block", Fresh())
    monkeypatch.setattr(module, "is_compiled", lambda _: False)
    with caplog.at_level(logging.WARNING, logger="stridecast"):
        Walker(formulas).step((0.0, 0.0))
    assert "compiling" in caplog.text


# what plays, and how much of the turning may be used


def test_what_plays_is_told_with_its_place_in_the_database(formulas):
    walker = Walker(formulas)
    names = [group.name for group in formulas.groups]
    segments = 0
    for frame in range(90):
        pose = walker.step((0.0, 0.05 * frame))
        playing = walker.playing
        assert names[playing.group[0]] == pose.group
        assert 0.0 <= playing.generic[0] <= 1.0
        assert playing.segments[0] >= segments
        segments = playing.segments[0]
    assert segments > 3


@pytest.mark.parametrize("share", [1.0, 0.5, 0.1])
def test_less_turning_makes_wider_ways(formulas, share):
    """Never faster round than the share of what was learned; the bounds in force say so."""
    walker = Walkers(formulas, np.zeros((2, 2)))
    walker.limit_turning(share)
    widest = max(group.bounds.lateral_per_speed for group in formulas.groups)
    before, turned = 0.0, []
    for frame in range(120):
        point = (0.0, 0.05 * frame) if frame < 60 else (3.0 + 0.05 * (frame - 60), 3.0)
        pose = walker.step(np.tile(point, (2, 1)))
        heading, speed = float(pose.vehicle.heading[0]), float(np.hypot(*pose.vehicle.velocity[0]))
        if speed > 0.5 and "stand" not in pose.motion[0]:
            turned.append(abs(heading - before) * 30)
            assert turned[-1] <= share * widest * 1.25 + 0.02
        before = heading
    assert max(turned) > 0.4 * share * widest


def test_a_share_that_is_none_is_refused(formulas):
    walker = Walker(formulas)
    for share in (0.0, -1.0, 1.01, float("nan")):
        with pytest.raises(InputError, match="share of the turning"):
            walker.limit_turning(share)


def test_gains_are_changed_while_walking(formulas):
    far = []
    for half_life in (0.15, 0.6):
        walker = Walker(formulas)
        walker.gains = SteeringGains(half_life=half_life)
        for frame in range(90):
            pose = walker.step((0.0, 0.04 * frame))
        far.append(0.04 * 89 - pose.vehicle.position[1])
    assert far[0] < far[1]


def test_what_larger_movements_add_is_worked_out_once(formulas):
    first, other = Walker(formulas, size="lively"), Walker(formulas)
    for walker in (first, other):
        walker.step((0.0, 1.0), size="exaggerated")
    assert first._batch._tables.larger is other._batch._tables.larger
    assert np.allclose(first._batch._tables.larger, enlargement(formulas), atol=1e-5)
