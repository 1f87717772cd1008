"""What holds in every frame, whatever the input."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from stridecast.body import kinematics
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import Pose
from stridecast.synthesis.walker import Walkers
from walks import KINDS, Walk, beyond_published, motions_of, points_of, random_walk, steering_of, walk_through

TOLERANCE = 1e-9
CASES = [(0, 30.0, False), (1, 60.0, False), (2, 30.0, True), (3, 60.0, True), (4, 30.0, False), (5, 60.0, False)]

any_input = pytest.mark.parametrize(("seed", "rate", "forces"), CASES)
any_seed = pytest.mark.parametrize("seed", range(4))


@cache
def any_walk(database: MotionDatabase, seed: int, rate: float, forces: bool) -> Walk:
    """Ten characters behind streams of all kinds for eight seconds; every law looks at the same walks."""
    return random_walk(database, seed, int(8 * rate), rate, forces=forces)


# the vehicle


@any_input
def test_no_frame_lies_beyond_the_bounds_in_force(database, seed, rate, forces):
    walk = any_walk(database, seed, rate, forces)
    did = steering_of(walk)
    assert (did.jerk <= walk.jerk[1:] + TOLERANCE * rate).all()
    assert (did.tangential >= walk.tangential[1:, :, 0] - TOLERANCE).all()
    assert (did.tangential <= walk.tangential[1:, :, 1] + TOLERANCE).all()
    assert (np.abs(did.lateral) <= walk.lateral[1:] + TOLERANCE).all()
    assert (did.speed >= walk.speed[1:, :, 0] - TOLERANCE).all()
    assert (did.speed <= walk.speed[1:, :, 1] + TOLERANCE).all()


@any_input
def test_jerk_in_force_is_that_of_the_group_but_where_a_stop_would_lead_backwards(database, seed, rate, forces):
    walk = any_walk(database, seed, rate, forces)
    published = [[database.group(name).bounds.jerk for name in row] for row in walk.groups]
    given = walk.jerk > np.array(published) * (1 + 1e-9)
    assert (walk.jerk >= np.array(published) * (1 - 1e-9)).all()
    # only a stop that would become a step backwards may jolt, and the frame after it, which has nothing left to brake
    still = np.linalg.norm(walk.velocities, axis=-1) < 1e-9
    assert still[given].all()


@any_input
def test_bounds_give_way_only_while_the_jerk_is_spent_on_going_back(database, seed, rate, forces):
    """Beyond what its group publishes (its bounds have just changed) a walker does nothing but return."""
    walk = any_walk(database, seed, rate, forces)
    did, beyond = steering_of(walk), beyond_published(database, walk)
    outside = beyond["tangential"] > 1e-6
    assert (did.jerk[outside] >= (1 - 1e-6) * walk.jerk[1:][outside]).all()


@any_input
def test_bounds_of_the_groups_hold_nearly_always(database, seed, rate, forces):
    walk = any_walk(database, seed, rate, forces)
    beyond = beyond_published(database, walk)
    assert (beyond["jerk"] > 1e-6).mean() < 0.005  # a stop that would lead backwards jolts
    for name, least, share in (("tangential", 0.05, 0.04), ("lateral", 0.05, 0.04), ("fast", 0.02, 0.08)):
        assert (beyond[name] > least).mean() < share, name


@any_input
def test_velocity_and_position_are_integrated_frame_by_frame(database, seed, rate, forces):
    walk = any_walk(database, seed, rate, forces)
    np.testing.assert_allclose(np.diff(walk.velocities, axis=0), walk.accelerations[1:] / rate, atol=1e-12)
    np.testing.assert_allclose(np.diff(walk.positions, axis=0), walk.velocities[1:] / rate, atol=1e-11)


@any_input
def test_heading_is_the_direction_of_motion(database, seed, rate, forces):
    walk = any_walk(database, seed, rate, forces)
    forward = np.sum(walk.velocities * ground.direction(walk.headings), axis=-1)
    speeds = np.linalg.norm(walk.velocities, axis=-1)
    moving = speeds > 0.05
    np.testing.assert_allclose(forward[moving], speeds[moving], rtol=1e-9)


@any_input
def test_nobody_spins(database, seed, rate, forces):
    """Not even when the point jumps behind the back: the direction changes no faster than the bound on turning."""
    walk = any_walk(database, seed, rate, forces)
    turned = np.abs(ground.wrap(np.diff(walk.headings, axis=0))) * rate
    most = np.array([[database.group(name).bounds.lateral_per_speed for name in row] for row in walk.groups[1:]])
    moving = steering_of(walk).before > 0.3
    assert (turned[moving] > 1.15 * most[moving] + 0.05).mean() < 0.01
    assert turned.max() < 3.5


# the body


@any_input
def test_everything_is_finite_and_rotations_are_unit(database, seed, rate, forces):
    walk = any_walk(database, seed, rate, forces)
    for name in ("positions", "velocities", "accelerations", "headings", "roots", "rotations"):
        assert np.isfinite(getattr(walk, name)).all()
    np.testing.assert_allclose(np.linalg.norm(walk.rotations, axis=-1), 1.0, atol=1e-9)


def knee_bends(database: MotionDatabase, walk: Walk, side: str) -> np.ndarray:
    """Angle from thigh to shin, positive where the knee points forward."""
    world = kinematics.forward(database.skeleton, walk.roots, walk.rotations)
    joints = database.skeleton.chain(*(f"{side}_{part}" for part in ("thigh", "shin", "foot")))
    hip, knee, ankle = (world.positions[..., joint, :] for joint in joints)
    left = quat.rotate(world.rotations[..., joints[1], :], np.array([1.0, 0.0, 0.0]))
    bend = np.sum(np.cross(knee - hip, ankle - knee) * left, axis=-1)
    return np.arctan2(bend, np.sum((knee - hip) * (ankle - knee), axis=-1))


@any_input
def test_knees_never_bend_backwards(database, seed, rate, forces):
    walk = any_walk(database, seed, rate, forces)
    assert min(knee_bends(database, walk, side).min() for side in ("left", "right")) > 0.0


@any_input
def test_nothing_goes_through_the_floor(database, seed, rate, forces):
    walk = any_walk(database, seed, rate, forces)
    world = kinematics.forward(database.skeleton, walk.roots, walk.rotations)
    assert world.positions[..., 1].min() > -0.010
    assert kinematics.ends(database.skeleton, world)[..., 1].min() > -0.010


@any_input
def test_pelvis_stays_near_its_vehicle(database, seed, rate, forces):
    walk = any_walk(database, seed, rate, forces)
    assert np.linalg.norm(ground.project(walk.roots) - walk.positions, axis=-1).max() < 0.35
    legs = database.skeleton.leg_length
    assert 0.6 * legs < walk.roots[..., 1].min()
    assert walk.roots[..., 1].max() < 1.5 * legs


@any_input
def test_poses_never_jump(database, seed, rate, forces):
    """No joint turns faster than a limb can, not even where segments meet."""
    walk = any_walk(database, seed, rate, forces)
    turned = quat.log(quat.multiply(quat.inverse(walk.rotations[:-1]), walk.rotations[1:]))
    rates = np.linalg.norm(turned, axis=-1).max(axis=(0, 1)) * rate
    feet = database.skeleton.chain("left_foot", "right_foot", "left_toe", "right_toe")
    assert np.delete(rates, feet).max() < 35.0
    assert rates.max() < 80.0
    assert np.linalg.norm(np.diff(walk.roots, axis=0), axis=-1).max() * rate < 9.0


def test_the_first_step_begins_in_the_pose_of_standing(database):
    """Also when it is taken in the second frame, before there is a past to go on from."""
    walkers = Walkers(database, np.zeros((1, 2)))
    roots = np.array([walkers.step(np.array([[0.0, 3.0]]), motion="walk").root_position[0] for _ in range(30)])
    assert np.abs(np.diff(roots[:, 1])).max() < 0.02
    assert np.ptp(roots[:, 1]) < 0.1


def slides(database: MotionDatabase, walk: Walk) -> np.ndarray:
    """Way of the foot over the floor in each contact, metres, once it has come to stand (70 ms).

    A foot rolls over its toes: of the toe joint and the tip of the toes the one that moves less counts.
    """
    skeleton, settled = database.skeleton, int(0.07 * walk.rate) + 1
    world = kinematics.forward(skeleton, walk.roots, walk.rotations)
    ends = kinematics.ends(skeleton, world)
    out = []
    for foot, side in enumerate(("left", "right")):
        joint = skeleton.joint(f"{side}_toe")
        tip = np.flatnonzero(skeleton.end_joints == joint)[0]
        steps = np.minimum(
            *(
                np.linalg.norm(np.diff(ground.project(place), axis=0), axis=-1)
                for place in (world.positions[..., joint, :], ends[..., tip, :])
            )
        )
        for c in range(walk.planted.shape[1]):
            for value, start, stop in signals.runs(walk.planted[:, c, foot]):
                if value and stop - start > settled + 2 and walk.motions[start][c] != "stand":
                    out.append(steps[start + settled : stop - 1, c].sum())
    return np.array(out)


@pytest.mark.parametrize("rate", [30.0, 60.0])
def test_planted_feet_stay_where_they_are_in_steady_walking(database, rate):
    way = np.arange(8 * rate) / rate
    streams = np.stack([np.stack((0 * way, speed * way), axis=-1) for speed in (1.0, 1.2, 1.4)], axis=1)
    found = slides(database, walk_through(database, streams, "walk", frame_rate=rate))
    assert len(found) > 30
    assert np.median(found) < 0.006
    assert np.percentile(found, 90) < 0.021, "viewers notice more (Prazak et al. 2011)"


@any_input
def test_planted_feet_move_little_whatever_the_input(database, seed, rate, forces):
    found = slides(database, any_walk(database, seed, rate, forces))
    assert np.median(found) < 0.010
    assert found.max(initial=0.0) < 0.10


# symmetries


@pytest.mark.parametrize(("seed", "angle", "shift"), [(0, 1.0, 0.0), (1, np.pi, 3.0), (2, -2.5, -40.0), (3, 0.3, 7.0)])
def test_turning_and_shifting_the_input_turns_and_shifts_the_walk(database, seed, angle, shift):
    rng = np.random.default_rng(seed)
    names = database.motions
    frames, facing = 120, rng.uniform(-np.pi, np.pi, len(KINDS))
    streams = np.stack([points_of(kind, frames, 30.0, seed + i) for i, kind in enumerate(KINDS)], axis=1)
    motions = [motions_of(names, frames, 30.0, seed + i) for i in range(len(KINDS))]
    move = np.array([shift, -0.5 * shift])
    here = walk_through(database, streams, motions, headings=facing)
    moved = ground.turn(streams, np.array(angle)) + move
    there = walk_through(database, moved, motions, headings=facing + angle)
    assert there.groups == here.groups
    np.testing.assert_allclose(there.positions, ground.turn(here.positions, np.array(angle)) + move, atol=1e-6)
    np.testing.assert_allclose(there.velocities, ground.turn(here.velocities, np.array(angle)), atol=1e-6)
    turn = quat.about_y(angle)
    np.testing.assert_allclose(there.roots, quat.rotate(turn, here.roots) + ground.lift(move), atol=1e-6)
    np.testing.assert_allclose(
        np.abs(np.sum(there.rotations[..., 0, :] * quat.multiply(turn, here.rotations[..., 0, :]), axis=-1)), 1.0
    )
    np.testing.assert_allclose(there.rotations[..., 1:, :], here.rotations[..., 1:, :], atol=1e-5)


def same(a: Pose, b: Pose, rows_of_a=slice(None)) -> None:
    """Bit for bit."""
    for x, y in (
        (a.root_position, b.root_position),
        (a.rotations, b.rotations),
        (a.planted, b.planted),
        (a.vehicle.position, b.vehicle.position),
        (a.vehicle.velocity, b.vehicle.velocity),
        (a.vehicle.acceleration, b.vehicle.acceleration),
        (a.vehicle.heading, b.vehicle.heading),
        (a.bounds.tangential, b.bounds.tangential),
        (a.bounds.speed, b.bounds.speed),
    ):
        np.testing.assert_array_equal(x[rows_of_a], y)


@any_input
def test_same_input_gives_the_same_bits(database, seed, rate, forces):
    one, other = any_walk(database, seed, rate, forces), random_walk(database, seed, int(8 * rate), rate, forces=forces)
    for name in ("positions", "accelerations", "roots", "rotations", "planted", "tangential"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.groups == other.groups
    assert one.clamped == other.clamped


@any_seed
def test_order_of_characters_does_not_matter(database, seed):
    rng = np.random.default_rng(seed)
    count, frames = 12, 60
    streams = np.stack([points_of(KINDS[i % len(KINDS)], frames, 30.0, seed + i) for i in range(count)], axis=1)
    motions = [motions_of(database.motions, frames, 30.0, seed + i) for i in range(count)]
    order = rng.permutation(count)
    here = walk_through(database, streams, motions)
    there = walk_through(database, streams[:, order], [motions[i] for i in order])
    np.testing.assert_array_equal(there.roots, here.roots[:, order])
    np.testing.assert_array_equal(there.rotations, here.rotations[:, order])


def test_many_characters_walk_as_each_would_alone(database):
    frames, count = 60, 5
    streams = np.stack([points_of(KINDS[i + 1], frames, 30.0, i) for i in range(count)], axis=1)
    motions = [motions_of(database.motions, frames, 30.0, i) for i in range(count)]
    together = Walkers(database, streams[0], 0.3)
    alone = [Walkers(database, streams[0, i : i + 1], 0.3) for i in range(count)]
    for frame in range(frames):
        wanted = [own[frame] for own in motions]
        pose = together.step(streams[frame], motion=wanted)
        for i, walker in enumerate(alone):
            single = walker.step(streams[frame, i : i + 1], motion=wanted[i])
            same(pose, single, slice(i, i + 1))
            assert (pose.group[i], pose.clamped[i]) == (single.group[0], single.clamped[0])


def test_threads_do_not_matter(formulas):
    rng = np.random.default_rng(0)
    count = 200
    places = rng.normal(0.0, 20.0, (count, 2))
    batches = [Walkers(formulas, places, threads=threads) for threads in (1, 2, 3)]
    for frame in range(20):
        points = places + frame * 0.05 + rng.normal(0.0, 0.3, (count, 2))
        poses = [batch.step(points, motion="walk") for batch in batches]
        same(poses[0], poses[1])
        same(poses[0], poses[2])


# input acts in the frame in which it comes


def before_the_impulse(database: MotionDatabase, case: str, rate: float) -> tuple[list[Walkers], np.ndarray, str]:
    """Two walkers alike in the middle of something, the wish that would go on, and the motion asked for."""
    walkers = [Walkers(database, np.zeros((1, 2)), frame_rate=rate) for _ in range(2)]
    speed = {"standing": 0.0, "walking": 1.2, "running": 3.0}[case.split()[0]]
    motion = {"standing": "walk", "walking": "walk", "running": "run"}[case.split()[0]]
    frames = int(4.0 * rate)
    wish = np.zeros((1, 2))
    for frame in range(frames):
        if key_of(case) == "forces":
            wish = np.array([[0.0, 3.0 if speed > 0.0 and frame < 0.5 * speed * rate else 0.0]])
        else:
            wish = np.array([[0.0, speed * frame / rate]])
        poses = [walker.step(**{key_of(case): wish}, motion=motion) for walker in walkers]
    same(poses[0], poses[1])
    return walkers, wish, motion


def key_of(case: str) -> str:
    return "forces" if case.endswith("forces") else "points"


@pytest.mark.parametrize("rate", [30.0, 60.0])
@pytest.mark.parametrize(
    "case",
    ["standing points", "walking points", "running points", "standing forces", "walking forces", "running forces"],
)
def test_an_impulse_moves_the_frame_in_which_it_comes(database, case, rate):
    walkers, wish, motion = before_the_impulse(database, case, rate)
    push = np.array([[0.5, 1.5]]) if case.startswith("standing") else np.array([[0.8, -0.4]])
    quiet = walkers[0].step(**{key_of(case): wish}, motion=motion)
    pushed = walkers[1].step(**{key_of(case): wish + push}, motion=motion)
    assert np.abs(pushed.vehicle.acceleration - quiet.vehicle.acceleration).max() > 1e-3
    assert np.abs(pushed.vehicle.position - quiet.vehicle.position).max() > 1e-7
    assert np.abs(pushed.root_position - quiet.root_position).max() > 1e-7


# coming to rest, turning round, doing what is asked for


@pytest.mark.parametrize("speed", [0.8, 1.2, 1.6])
def test_beside_a_point_that_rests_a_walker_comes_to_stand_and_stays(database, speed):
    way = np.minimum(np.arange(300) / 30, 4.0) * speed
    walk = walk_through(database, np.stack((0 * way, way), axis=-1)[:, None], "walk")
    speeds = np.linalg.norm(walk.velocities[:, 0], axis=-1)
    late = slice(-60, None)
    assert speeds[late].max() < 1e-3
    assert {row[0] for row in walk.motions[late]} == {"stand"}
    assert np.linalg.norm(walk.positions[-1, 0] - [0.0, 4.0 * speed]) < 0.3 + 0.6 * speed
    assert walk.planted[late].all()
    assert np.ptp(walk.positions[late, 0], axis=0).max() < 1e-3


def test_a_point_that_never_moves_moves_nobody(database):
    walk = walk_through(database, np.zeros((150, 1, 2)), "walk", headings=1.0)
    assert np.abs(walk.positions).max() < 1e-6
    assert np.abs(ground.wrap(walk.headings - 1.0)).max() < 1e-9
    assert {row[0] for row in walk.motions} == {"stand"}


@pytest.mark.parametrize("rate", [30.0, 60.0])
def test_a_reversal_is_half_a_turn_and_not_more(database, rate):
    t = np.arange(int(12 * rate)) / rate
    there = np.where(t < 4.0, 1.2 * t, 4.8 - 1.2 * (t - 4.0))
    walk = walk_through(database, np.stack((0 * there, there), axis=-1)[:, None], "walk", frame_rate=rate)
    turned = np.unwrap(walk.headings[:, 0])
    assert np.ptp(turned) < 1.5 * np.pi
    assert np.abs(np.abs(turned[-1] - turned[int(3.5 * rate)]) - np.pi) < 0.3
    assert walk.velocities[-1, 0, 1] < -0.8


@any_seed
def test_the_motion_asked_for_is_carried_out_within_six_seconds_from_any_state(database, seed):
    """After two seconds of anything, somebody who asks for a motion and goes at its pace gets it."""
    rng = np.random.default_rng(seed)
    names = database.motions
    count, before, after = 3 * len(names), 60, 180
    walkers = Walkers(database, np.zeros((count, 2)), rng.uniform(-3, 3, count))
    streams = [points_of(KINDS[rng.integers(len(KINDS))], before, 30.0, seed + i) for i in range(count)]
    wild = [motions_of(names, before, 30.0, seed + i) for i in range(count)]
    for frame in range(before):
        pose = walkers.step(np.array([stream[frame] for stream in streams]), motion=[own[frame] for own in wild])
    wanted = [names[i % len(names)] for i in range(count)]
    pace = np.array([{"stand": 0.0, "walk": 1.2, "run": 3.0}[name] for name in wanted])
    point, ahead = pose.vehicle.position.copy(), ground.direction(pose.vehicle.heading)
    got, played = np.zeros(count, bool), []
    for _ in range(after):
        point = point + pace[:, None] * ahead / 30
        pose = walkers.step(point, motion=wanted)
        got |= [playing == asked for playing, asked in zip(pose.motion, wanted, strict=True)]
        played.append(pose.group)
    missed = [(name, list(dict.fromkeys(row[i] for row in played))) for i, name in enumerate(wanted) if not got[i]]
    assert not missed


def test_every_motion_follows_every_other(database):
    names = ["walk", "run", "walk", "stand", "run", "stand", "walk", "run", "stand"]
    walkers = Walkers(database, np.zeros((1, 2)))
    point, seen, late, poses = np.zeros((1, 2)), [], [], []
    for name in names:
        for frame in range(180):
            point = point + np.array([[0.0, {"stand": 0.0, "walk": 1.2, "run": 3.0}[name] / 30]])
            poses.append(walkers.step(point, motion=name))
            if poses[-1].motion[0] == name:
                late.append(frame / 30)
                break
        seen.append(poses[-1].motion[0])
    assert seen == names
    assert max(late) < 5.0  # where nobody was seen to go from running to walking, the way leads through standing
    assert walkers.made_up == 0
