"""Bodies of vehicles that move by themselves."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from stridecast.body import kinematics
from stridecast.errors import InputError, WishError
from stridecast.geometry import ground
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import Pose, VehicleState
from stridecast.synthesis.tables import make_tables
from stridecast.synthesis.walker import Walkers
from stridecast.synthesis.wishes import LONGEST_STEP
from vehicles import Body, Track, at, bodies_of, body_of, track, tracks

RATES = (30.0, 60.0)
NAMES = tuple(tracks(30.0))

every_track = pytest.mark.parametrize("name", NAMES)
any_rate = pytest.mark.parametrize("rate", RATES)


@cache
def bodies(database: MotionDatabase, rate: float) -> dict[str, tuple[Track, Body]]:
    """Every track with its body, all stepped together; every law looks at the same bodies."""
    given = tracks(rate)
    poses = bodies_of(database, list(given.values()), rate)
    hinges = make_tables(database).hinges
    return {
        name: (one, body_of(database.skeleton, poses, row, rate, hinges))
        for row, (name, one) in enumerate(given.items())
    }


def shown(pose: Pose, rows=slice(None)) -> list[bytes]:
    """What a pose shows of some rows, to be compared bit for bit."""
    v, b = pose.vehicle, pose.bounds
    arrays = (pose.root_position, pose.rotations, pose.planted, v.position, v.velocity, v.acceleration, v.heading)
    return [np.asarray(array)[rows].tobytes() for array in (*arrays, b.jerk, b.tangential, b.lateral, b.speed)]


def walking(speed: float, rate: float = 30.0, seconds: float = 2.0) -> Track:
    n = round(seconds * rate)
    return track(np.full(n, speed), np.zeros(n), rate)


# the vehicle


def test_a_given_vehicle_is_shown_bit_for_bit(database):
    given = list(tracks(30.0).values())
    for frame, pose in enumerate(bodies_of(database, given, 30.0)[:200]):
        wish = at(given, frame)["vehicles"]
        for name in ("position", "velocity", "acceleration", "heading"):
            assert getattr(pose.vehicle, name).tobytes() == getattr(wish, name).tobytes(), name
        assert not any(pose.clamped)


def test_bounds_say_what_the_vehicle_did(formulas):
    given = [tracks(30.0)["surges"]]
    poses = bodies_of(formulas, given, 30.0)
    for before, pose in pairwise(poses):
        v, b = pose.vehicle, pose.bounds
        size = np.linalg.norm(v.acceleration[0]) - 1e-12
        assert b.tangential[0, 0] <= -size <= size <= b.tangential[0, 1]
        assert size <= b.lateral[0]
        speed = np.linalg.norm(v.velocity[0])
        assert b.speed[0] == pytest.approx([speed, speed])
        assert b.jerk[0] == pytest.approx(30 * np.linalg.norm(v.acceleration[0] - before.vehicle.acceleration[0]))


# the body


@any_rate
@every_track
def test_planted_feet_stay_where_they_are(formulas, name, rate):
    slides = bodies(formulas, rate)[name][1].slides(rate)
    assert len(slides) >= 8
    assert np.median(slides) < 0.001
    assert np.percentile(slides, 90) < 0.003


@every_track
def test_planted_feet_of_recorded_people_move_little(recordings, name):
    slides = bodies(recordings, 30.0)[name][1].slides(30.0)
    assert np.median(slides) < 0.005
    assert np.percentile(slides, 90) < 0.021, "viewers notice more (Prazak et al. 2011)"


@any_rate
@every_track
def test_knees_bend_forward_and_legs_are_not_stretched(database, name, rate):
    body = bodies(database, rate)[name][1]
    assert np.degrees(body.bends.min()) > 2.0
    assert body.reach.max() < 0.9985
    assert body.lowest.min() > 0.0


@any_rate
@every_track
def test_feet_that_step_leave_the_floor(database, name, rate):
    body = bodies(database, rate)[name][1]
    sole = make_tables(database).sole
    for foot in range(2):
        changes = np.flatnonzero(np.diff(body.planted[:, foot].astype(int)))
        for start, stop in pairwise(changes):
            if not body.planted[start + 1, foot] and stop - start > 0.2 * rate:
                assert body.toes[start : stop + 1, foot, 1].max() > sole + 0.012


@any_rate
@every_track
def test_nothing_pops(database, name, rate):
    """No joint turns faster than legs do in the fastest swing, and no foot moves faster than a swinging one."""
    one, body = bodies(database, rate)[name]
    fastest = np.linalg.norm(one.velocity, axis=-1).max()
    assert np.percentile(body.turning, 99.9) < 9.0 + 3.0 * fastest
    assert np.linalg.norm(np.diff(body.toes, axis=0), axis=-1).max() * rate < 2.5 + 3.2 * fastest


@any_rate
@every_track
def test_legs_do_not_cross(database, name, rate):
    one, body = bodies(database, rate)[name]
    ahead = ground.direction(one.heading)
    apart = ground.project(body.toes[:, 0] - body.toes[:, 1])
    along, across = np.sum(apart * ahead, axis=-1), np.sum(apart * ground.left_of(ahead), axis=-1)
    assert across[np.abs(along) < 0.1].min() > 0.0


@any_rate
@pytest.mark.parametrize("name", ["stop and go", "stutter", "turns on the spot", "to a run and back"])
def test_who_has_stopped_stands_with_the_feet_beside_each_other(database, name, rate):
    one, body = bodies(database, rate)[name]
    assert not one.velocity[-int(1.5 * rate) :].any()
    assert body.planted[-3:].all()
    ahead = ground.direction(one.heading)[-1]
    apart = ground.project(body.toes[-1, 0] - body.toes[-1, 1])
    assert abs(apart @ ahead) < 0.11
    assert 0.05 < apart @ ground.left_of(ahead) < 0.4
    assert np.abs(np.diff(ground.project(body.toes[-int(0.2 * rate) :]), axis=0)).max() < 5e-4


@pytest.mark.parametrize("rests_in", ["known", "unknown"])
@pytest.mark.parametrize("seconds", np.arange(2.0, 3.0, 0.1).tolist())
def test_a_stop_at_any_phase_ends_in_a_quiet_stance(formulas, seconds, rests_in):
    n = round(30 * (seconds + 3.5))
    one = track(np.where(np.arange(n) < 30 * seconds, 1.3, 0.0), np.zeros(n), 30.0)
    if rests_in == "unknown":
        one.rests_in[:] = np.inf
    poses = bodies_of(formulas, [one], 30.0)
    assert poses[-1].motion == ("stand",)
    assert poses[-1].planted.all()
    steps = np.array([pose.planted[0].all() for pose in poses])
    rested = np.flatnonzero(one.velocity.any(axis=1))[-1] + 1
    assert steps[rested + 45 :].all(), "within one and a half seconds"


def test_who_turns_on_the_spot_steps_round_and_is_not_wrung(database):
    one, body = bodies(database, 30.0)["turns on the spot"]
    lifted = (np.diff(body.planted.astype(int), axis=0) == -1).sum()
    assert lifted >= 8
    feet = ground.project(body.tips - body.toes)
    yaw = ground.wrap(np.arctan2(feet[..., 0], feet[..., 1]) - one.heading[:, None])
    assert np.degrees(np.abs(yaw[body.planted])).max() < 75.0


def test_body_and_vehicle_go_together(database):
    for one, body in bodies(database, 30.0).values():
        middle = ground.project(body.toes.mean(axis=1)) - one.position
        assert np.linalg.norm(middle, axis=-1).max() < 0.62


def test_who_starts_follows_at_once(database):
    n = 60
    one = track(np.where(np.arange(n) < 15, 0.0, 1.3), np.zeros(n), 30.0)
    poses = bodies_of(database, [one], 30.0)
    moving = np.flatnonzero(np.linalg.norm(one.velocity, axis=-1) > 0.1)[0]
    assert not all(pose.planted[0].all() for pose in poses[moving : moving + 8])


# who is placed


@pytest.mark.parametrize(("speed", "motion"), [(1.3, "walk"), (0.6, "walk"), (3.2, "run")])
def test_who_appears_in_motion_is_in_motion_in_the_first_frame(database, speed, motion):
    count = 8
    walkers = Walkers(database, np.zeros((count, 2)))
    phases = np.arange(count) / count
    walkers.place(range(count), np.zeros((count, 2)), 0.0, phase=phases)
    given = [walking(speed)] * count
    number = {"walk": 1, "run": 2}[motion]
    poses = [walkers.step(**at(given, frame) | {"motion": np.full(count, number)}) for frame in range(20)]
    assert set(poses[0].motion) == {motion}
    joints = [database.skeleton.joint(f"{side}_toe") for side in ("left", "right")]
    world = [kinematics.forward(database.skeleton, p.root_position, p.rotations) for p in poses]
    toes = np.array([w.positions[:, joints] for w in world])
    ahead = toes[0, :, 0, 2] - toes[0, :, 1, 2]
    assert np.ptp(ahead) > 0.3 * min(speed, 1.0), "phases differ"
    assert ahead.min() < 0.0 < ahead.max()
    # no start: each frame the feet move as those of somebody who walks on, and the planted ones do not
    fastest = np.linalg.norm(np.diff(toes, axis=0), axis=-1).max(axis=(1, 2)) * 30
    assert fastest[0] > 0.8 * speed
    assert fastest.max() < 2.5 + 3.2 * speed


def test_a_row_placed_anew_does_not_depend_on_its_past(database):
    given = list(tracks(30.0).values())
    count = len(given)
    used, new = (Walkers(database, np.zeros((count, 2))) for _ in range(2))
    for frame in range(70):
        used.step(**at(given[::-1], frame))
    for walkers in (used, new):
        walkers.place(np.arange(count), np.ones((count, 2)), 0.5, phase=0.3)
    for frame in range(90, 150):
        assert shown(used.step(**at(given, frame))) == shown(new.step(**at(given, frame)))


def test_only_the_rows_named_are_placed_anew(formulas):
    given = list(tracks(30.0).values())
    count = len(given)
    a, b = (Walkers(formulas, np.zeros((count, 2))) for _ in range(2))
    for frame in range(90):
        if frame == 40:
            a.place([2, 5], np.ones((2, 2)))
        poses = [walkers.step(**at(given, frame)) for walkers in (a, b)]
        others = [row for row in range(count) if row not in (2, 5)]
        assert shown(poses[0], others) == shown(poses[1], others)
    assert shown(poses[0], [2]) != shown(poses[1], [2])


# who is stepped


def test_order_and_company_do_not_matter(database):
    given = list(tracks(30.0).values())
    order = np.random.default_rng(0).permutation(len(given))
    here = bodies_of(database, given, 30.0)
    there = bodies_of(database, [given[i] for i in order], 30.0)
    alone = bodies_of(database, [given[3]], 30.0)
    for a, b, c in zip(here, there, alone, strict=False):
        assert shown(a, order) == shown(b)
        assert shown(a, [3]) == shown(c)


def test_same_vehicles_give_the_same_bits(formulas):
    given = list(tracks(30.0).values())
    for a, b in zip(bodies_of(formulas, given, 30.0), bodies_of(formulas, given, 30.0, threads=2), strict=True):
        assert shown(a) == shown(b)


def test_rows_that_are_not_active_stay_as_they_are_whatever_is_given_for_them(formulas):
    given = list(tracks(30.0).values())
    count = len(given)
    some, alone = Walkers(formulas, np.zeros((count, 2))), Walkers(formulas, np.zeros((count, 2)))
    active = np.arange(count) % 3 > 0
    last = None
    for frame in range(120):
        wish = at(given, frame)
        expected = alone.step(**wish)
        v = wish["vehicles"]
        v.position[~active], v.heading[~active], wish["motion"][~active] = np.nan, np.inf, 77
        wish["rests_in"][~active] = -1.0
        pose = some.step(**wish, active=active)
        assert shown(pose, active) == shown(expected, active)
        assert last is None or shown(pose, ~active) == shown(last, ~active)
        last = pose


def test_a_longer_step_every_third_frame_keeps_up(formulas):
    """Who is far away is stepped at a third of the rate, beside others who are stepped every frame."""
    names = ["stop and go", "surges", "in a dense crowd", "to a run and back"]
    near, far = [tracks(30.0)[name] for name in names], [tracks(10.0)[name] for name in names]
    walkers = Walkers(formulas, np.zeros((2 * len(names), 2)))
    row_is_far = np.repeat([False, True], len(names))
    poses = []
    for frame in range(360):
        wish = at(near + near, frame)
        due = ~row_is_far | (frame % 3 == 0)
        dt = np.where(row_is_far, 3 / 30, 1 / 30)
        pose = walkers.step(**wish, active=due, dt=dt)
        if frame % 3 == 0:
            poses.append(pose)
    hinges = make_tables(formulas).hinges
    assert len(far[0]) == len(poses)
    for row in np.flatnonzero(row_is_far):
        body = body_of(formulas.skeleton, poses, row, 10.0, hinges)
        assert np.degrees(body.bends.min()) > 2.0
        slides = body.slides(10.0)
        assert np.median(slides) < 0.003
        apart = ground.project(body.toes.mean(axis=1)) - near[row - len(names)].position[::3]
        assert np.linalg.norm(apart, axis=-1).max() < 0.62


def test_steps_of_one_length_are_those_of_the_frame_rate(formulas):
    given = [tracks(30.0)["surges"]]
    a, b = (Walkers(formulas, np.zeros((1, 2)), frame_rate=rate) for rate in (30.0, 60.0))
    for frame in range(60):
        assert shown(a.step(**at(given, frame))) == shown(b.step(**at(given, frame), dt=1 / 30))


def test_numbers_and_names_of_motions_are_the_same(formulas):
    given = list(tracks(30.0).values())
    a, b = (Walkers(formulas, np.zeros((len(given), 2))) for _ in range(2))
    for frame in range(60):
        wish = at(given, frame)
        names = [("stand", "walk", "run")[number] for number in wish["motion"]]
        assert shown(a.step(**wish)) == shown(b.step(**wish | {"motion": names}))


def test_arrays_that_cannot_be_written_do(formulas):
    wish = at([walking(1.0)] * 2, 0)
    for name in ("position", "velocity", "acceleration", "heading"):
        getattr(wish["vehicles"], name).setflags(write=False)
    Walkers(formulas, np.zeros((2, 2))).step(**wish)


# refusals


def vehicle(**other: object) -> VehicleState:
    kept = {"position": np.zeros((3, 2)), "velocity": np.zeros((3, 2)), "acceleration": np.zeros((3, 2))}
    return VehicleState(**(kept | {"heading": np.zeros(3)} | other))  # type: ignore[arg-type]


NOT_A_NUMBER = np.array([[0.0, 0.0], [np.nan, 0.0], [0.0, 0.0]])

BAD_STEPS = {
    "position": ({"vehicles": {"position": NOT_A_NUMBER}}, "character 1"),
    "velocity": ({"vehicles": {"velocity": NOT_A_NUMBER}}, "character 1"),
    "acceleration": ({"vehicles": {"acceleration": NOT_A_NUMBER}}, "character 1"),
    "heading": ({"vehicles": {"heading": np.array([0.0, 0.0, np.inf])}}, "character 2"),
    "far": ({"vehicles": {"position": np.full((3, 2), 1e9)}}, "further"),
    "shape": ({"vehicles": {"velocity": np.zeros((2, 2))}}, r"velocity.*\(3, 2\)"),
    "one heading": ({"vehicles": {"heading": 0.0}}, r"heading.*\(3,\)"),
    "both": ({"vehicles": {}, "points": np.zeros((3, 2))}, "one of"),
    "motion": ({"vehicles": {}, "motion": np.array([0, 1, 7])}, r"no motion 7; there are 0 \(stand\)"),
    "motions": ({"vehicles": {}, "motion": np.array([0, 1])}, "2 motions for 3"),
    "rests": ({"vehicles": {}, "rests_in": np.array([1.0, -1.0, 1.0])}, "rests_in"),
    "active": ({"vehicles": {}, "active": np.array([1, 0, 1])}, "truth values"),
    "actives": ({"vehicles": {}, "active": np.array([True])}, "3 truth values"),
    "dt": ({"vehicles": {}, "dt": 0.0}, "a step takes"),
    "long dt": ({"vehicles": {}, "dt": np.array([0.1, 0.1, 2 * LONGEST_STEP])}, "a step takes"),
    "dts": ({"vehicles": {}, "dt": np.array([0.1])}, "dt"),
    "size": ({"vehicles": {}, "size": "huge"}, "huge"),
}

BAD_PLACES = {
    "row": ({"rows": [0, 3], "positions": np.zeros((2, 2))}, "no row 3"),
    "negative row": ({"rows": [-1], "positions": np.zeros((1, 2))}, "no row -1"),
    "twice": ({"rows": [1, 1], "positions": np.zeros((2, 2))}, "twice"),
    "fractions": ({"rows": np.array([0.5]), "positions": np.zeros((1, 2))}, "whole numbers"),
    "positions": ({"rows": [0], "positions": np.zeros((2, 2))}, r"\(1, 2\)"),
    "not a number": ({"rows": [0], "positions": np.array([[np.nan, 0.0]])}, "finite"),
    "heading": ({"rows": [0], "positions": np.zeros((1, 2)), "headings": np.inf}, "finite"),
    "headings": ({"rows": [0], "positions": np.zeros((1, 2)), "headings": np.zeros(2)}, "headings"),
    "phase": ({"rows": [0], "positions": np.zeros((1, 2)), "phase": 1.0}, "phase"),
    "size": ({"rows": [0], "positions": np.zeros((1, 2)), "size": "huge"}, "huge"),
}


@pytest.mark.parametrize(
    ("way", "wish", "culprit"),
    [("step", *case) for case in BAD_STEPS.values()] + [("place", *case) for case in BAD_PLACES.values()],
    ids=[f"step {name}" for name in BAD_STEPS] + [f"place {name}" for name in BAD_PLACES],
)
@pytest.mark.usefixtures("unchecked")
def test_what_is_refused_changes_nobody(formulas, way, wish, culprit):
    given = list(tracks(30.0).values())[:3]
    asked, spared = (Walkers(formulas, np.zeros((3, 2))) for _ in range(2))
    if "vehicles" in wish:
        wish = wish | {"vehicles": vehicle(**wish["vehicles"])}
    for frame in range(40):
        if frame == 20:
            with pytest.raises((WishError, InputError), match=culprit):
                getattr(asked, way)(**wish)
        assert shown(asked.step(**at(given, frame))) == shown(spared.step(**at(given, frame)))
