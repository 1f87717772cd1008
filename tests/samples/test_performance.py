"""What the sample person does is what people can do, and what is said about it is so."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid

from stridecast.body import kinematics
from stridecast.body.mirroring import mirror
from stridecast.errors import InputError
from stridecast.geometry import ground, signals
from stridecast.geometry import quaternions as quat
from stridecast.model.contacts import LEFT, RIGHT, SIDES
from stridecast.samples.adult import HEEL, SOLE, adult, standing_height
from stridecast.samples.corpus import RECIPES
from stridecast.samples.gait import DETAILS, FEET, gait_model
from stridecast.samples.manner import BRISK, GLOOMY, MANNERS, NEUTRAL, Variation
from stridecast.samples.performance import SampleTake, perform

NAMES = [recipe.name for recipe in RECIPES]
EXACT = 1e-6
"""Feet that stand stand exactly; what is left is rounding, metres."""

BELOW = 0.003
"""Nothing is further below the floor, metres. Measured: 1.4 mm, a ball that just leaves it."""

KNEES = np.radians((3.0, 130.0))
"""How far human knees bend in walking and running. Measured: 6 to 118 degrees."""

FASTEST = {"toe": 35.0, "foot": 25.0, "shin": 20.0, "forearm": 18.0}
OTHERS_FASTEST = 14.0
"""No joint turns faster, rad/s; a sprinter's knee reaches 20. Measured: 28 (toes), 20, 14, 14, and 9 (thigh)."""

HARDEST = {"toe": 1800.0, "shin": 1300.0, "foot": 900.0}
OTHERS_HARDEST = 600.0
"""No joint speeds up or brakes harder from frame to frame at 60 Hz, rad/s2: a jump of 10 degrees would show as 600.
Measured: 1400, 1000, 600 and 390; recorded knees reach 550."""

LOWEST = 0.74
"""The root stays higher, metres; only who runs round a sharp corner leans so far. Measured: 0.775."""


def steady(speed: float, seconds: float = 5.0, *, turn: float = 0.0, run: bool = False, **how) -> SampleTake:
    rate = how.get("rate", 60.0)
    frames = round(seconds * rate)
    return perform(np.full(frames, speed), np.full(frames, turn), running=np.full(frames, run), **how)


@cache
def plain(speed: float, manner: str = "neutral") -> SampleTake:
    """Straight on without chance, 30 m of it or so; it runs above 2 m/s."""
    return steady(speed, 10.0, run=speed > 2.0, manner=MANNERS[manner], variation=0.0)


def ease(u: np.ndarray) -> np.ndarray:
    """From 0 to 1, with no jump up to the second derivative."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10 - 15 * u + 6 * u * u)


@dataclass(frozen=True)
class Foot:
    """One foot, from the joint rotations alone."""

    heel: np.ndarray
    ball: np.ndarray
    tip: np.ndarray
    forward: np.ndarray
    left: np.ndarray
    planted: np.ndarray


def feet_of(take: SampleTake) -> list[Foot]:
    """Both feet: matrices down the chain of bones instead of the package's own kinematics."""
    motion, skeleton = take.motion, take.motion.skeleton
    feet = []
    for column, side in enumerate(SIDES):
        ankle, toe = skeleton.chain(f"{side}_foot", f"{side}_toe")
        chain = [toe]
        while chain[0] != 0:
            chain.insert(0, int(skeleton.parents[chain[0]]))
        place, turn = motion.root_positions, np.tile(np.eye(3), (motion.frames, 1, 1))
        seen = {}
        for joint in chain:
            if joint:
                place = place + turn @ skeleton.offsets[joint]
            turn = turn @ quat.to_matrix(motion.rotations[:, joint])
            seen[joint] = place, turn
        tip = skeleton.end_offsets[list(skeleton.end_joints).index(toe)]
        (at, sole), (ball, toes) = seen[ankle], seen[toe]
        feet.append(
            Foot(at + sole @ HEEL, ball, ball + toes @ tip, sole[..., 2], sole[..., 0], take.planted[:, column])
        )
    return feet


def check_feet_stand(take: SampleTake) -> None:
    """A planted foot turns about its heel while the toes are up and about its ball while the heel is up."""
    for side, foot in zip(SIDES, feet_of(take), strict=True):
        for value, start, stop in signals.runs(foot.planted):
            if not value:
                continue
            at = np.arange(start, stop)
            where = f"{side} foot, frames {start} to {stop}"
            toes_up, heel_up = at[foot.forward[at, 1] > -1e-9], at[foot.forward[at, 1] < 1e-9]
            assert len(toes_up) + len(heel_up) >= stop - start
            if len(toes_up):
                assert np.abs(foot.heel[toes_up, 1]).max() < EXACT, where
                assert np.ptp(foot.heel[toes_up], axis=0).max() < EXACT, where
            if len(heel_up):
                assert np.abs(foot.ball[heel_up, 1] - SOLE).max() < EXACT, where
                assert np.ptp(foot.ball[heel_up], axis=0).max() < EXACT, where
                assert np.abs(foot.tip[heel_up, 1] - foot.tip[heel_up[0], 1]).max() < EXACT, where
                assert np.ptp(foot.tip[heel_up], axis=0).max() < EXACT, where
            assert np.abs(foot.left[at, 1]).max() < EXACT, f"{where} stands on its edge"
            heading = ground.heading(ground.project(foot.forward[at]))
            assert np.abs(ground.wrap(heading - heading[0])).max() < EXACT, f"{where} turns on the spot"
            if len(toes_up) and len(heel_up):  # heel and ball are marks of one footprint
                long = HEEL[2] - take.motion.skeleton.offsets[take.motion.skeleton.joint(f"{side}_toe")][2]
                print_ = ground.project(foot.heel[toes_up[0]] - foot.ball[heel_up[0]])
                np.testing.assert_allclose(print_, long * ground.direction(heading[:1])[0], atol=EXACT)


def check_above_floor(take: SampleTake) -> None:
    world = kinematics.pose(take.motion)
    joints = world.positions[..., 1].min(axis=0)
    lowest = take.motion.skeleton.names[int(joints.argmin())]
    assert joints.min() > SOLE - BELOW, f"{lowest} is {1000 * joints.min():.1f} mm above the floor"
    assert kinematics.ends(take.motion.skeleton, world)[..., 1].min() > -BELOW
    for foot in feet_of(take):
        assert foot.heel[:, 1].min() > -BELOW
        assert foot.ball[:, 1].min() > SOLE - BELOW


def knee_bends(take: SampleTake) -> np.ndarray:
    """Signed bend of both knees, radians: negative for a knee that bends forward."""
    motion, world = take.motion, kinematics.pose(take.motion)
    bends = []
    for side in SIDES:
        hip, knee, ankle = (
            world.positions[:, joint]
            for joint in motion.skeleton.chain(f"{side}_thigh", f"{side}_shin", f"{side}_foot")
        )
        down, on = knee - hip, ankle - knee
        across = np.cross(down, on)
        leftward = quat.rotate(world.rotations[:, 0], np.array([1.0, 0.0, 0.0]))
        sine = np.linalg.norm(across, axis=-1) * np.sign(np.sum(across * leftward, axis=-1))
        bends.append(np.arctan2(sine, np.sum(down * on, axis=-1)))
    return np.array(bends)


def check_knees(take: SampleTake) -> None:
    bends = knee_bends(take)
    assert bends.min() > KNEES[0], f"a knee is bent {np.degrees(bends.min()):.1f} degrees"
    assert bends.max() < KNEES[1], f"a knee is bent {np.degrees(bends.max()):.0f} degrees"


def part_of(role: str) -> str:
    return role.removeprefix("left_").removeprefix("right_")


def check_nothing_pops(take: SampleTake) -> None:
    motion = take.motion
    assert motion.frame_rate == 60.0, "the limits are those of 60 Hz"
    steps = quat.log(quat.multiply(quat.inverse(motion.rotations[:-1]), motion.rotations[1:])) * motion.frame_rate
    speeds = np.linalg.norm(steps, axis=-1).max(axis=0)
    jumps = np.linalg.norm(np.diff(steps, axis=0), axis=-1).max(axis=0) * motion.frame_rate
    for role, joint in motion.skeleton.roles.items():
        assert speeds[joint] < FASTEST.get(part_of(role), OTHERS_FASTEST), f"{role} turns at {speeds[joint]:.1f} rad/s"
        hardest = HARDEST.get(part_of(role), OTHERS_HARDEST)
        assert jumps[joint] < hardest, f"{role} speeds up by {jumps[joint]:.0f} rad/s2"
    pushed = np.linalg.norm(np.diff(motion.root_positions, 2, axis=0), axis=-1).max() * motion.frame_rate**2
    assert pushed < 30.0, f"the root is pushed with {pushed:.0f} m/s2"
    assert motion.root_positions[:, 1].min() > LOWEST
    assert motion.root_positions[:, 1].max() < standing_height() + 0.02


def check_person(take: SampleTake) -> None:
    """Everything that holds whatever somebody is asked to do."""
    check_feet_stand(take)
    check_above_floor(take)
    check_knees(take)
    check_nothing_pops(take)
    assert (np.diff(take.phases) >= 0).all()
    assert np.isfinite(take.motion.rotations).all()


# all sample takes


@pytest.mark.parametrize("name", NAMES)
def test_planted_feet_stand_still(sample_takes, name):
    check_feet_stand(sample_takes[name])


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_below_the_floor(sample_takes, name):
    check_above_floor(sample_takes[name])


@pytest.mark.parametrize("name", NAMES)
def test_knees_bend_as_human_knees_do(sample_takes, name):
    check_knees(sample_takes[name])


@pytest.mark.parametrize("name", NAMES)
def test_nothing_pops(sample_takes, name):
    check_nothing_pops(sample_takes[name])


@pytest.mark.parametrize("name", NAMES)
def test_truth_belongs_together(sample_takes, name):
    """The vehicle is the integral of its speed along its heading, the phase never runs back, a flight is a run's."""
    take = sample_takes[name]
    rate = take.motion.frame_rate
    velocity = take.speeds[:, None] * np.stack((np.sin(take.headings), np.cos(take.headings)), axis=-1)
    integral = cumulative_trapezoid(velocity, dx=1 / rate, axis=0, initial=0.0)
    np.testing.assert_allclose(take.positions, integral, atol=1e-9)
    assert (np.diff(take.phases) >= 0).all()
    assert np.diff(take.phases).max() < 2 * np.pi * 2.2 / rate, "more than 2.2 strides a second"
    flight = ~take.planted.any(axis=-1)
    assert (flight & ~take.running).mean() < 0.005, "who walks does not fly"
    assert flight.any() if take.running.any() else not flight[take.speeds < 1.8].any()
    assert take.planted[take.speeds == 0.0].all()


@pytest.mark.parametrize("name", [name for name in NAMES if "start_stop" in name or name == "stand"])
def test_the_phase_rests_while_the_steps_do(sample_takes, name):
    take = sample_takes[name]
    still = take.speeds < 1e-3
    for value, start, stop in signals.runs(still):
        if value:
            assert np.ptp(take.phases[start:stop]) < 1e-9
            assert take.planted[start:stop].all()
    moving = take.speeds > 0.3
    assert (np.diff(take.phases)[moving[1:] & moving[:-1]] > 0).all()


@pytest.mark.parametrize("name", [name for name in NAMES if "start_stop" in name])
def test_stretches_between_rests_are_whole_half_cycles(sample_takes, name):
    """They meet rest in the middle of a double support, a quarter cycle from either foot's mid-stance or nearly so."""
    take = sample_takes[name]
    held = [
        take.phases[(start + stop) // 2]
        for value, start, stop in signals.runs(np.diff(take.phases) < 1e-9)
        if value and stop - start > 20
    ]
    assert len(held) >= 3
    counts = np.diff(held) / np.pi
    np.testing.assert_allclose(counts, np.round(counts), atol=0.15)
    assert counts.min() > 2.5


# feet


@pytest.mark.parametrize("name", [name for name in NAMES if name != "stand"])
def test_feet_alternate(sample_takes, name):
    """Each foot comes down between two landings of the other, but beside standing."""
    take = sample_takes[name]
    landings = sorted(
        (start, foot)
        for foot in (LEFT, RIGHT)
        for value, start, _ in signals.runs(take.planted[:, foot])
        if value and start > 0
    )
    for (before, foot), (after, other) in pairwise(landings):
        assert foot != other or np.diff(take.phases[before:after]).min() < 1e-9, f"frame {after}"
    assert len(landings) > 10


@pytest.mark.parametrize("speed", [0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 3.0, 3.6, 4.5])
def test_legs_do_not_cross(speed):
    take = steady(speed, 8.0, run=speed > 2.0, seed=5)
    left, right = feet_of(take)
    way = ground.left_of(ground.direction(take.headings))
    for a, b in ((left.ball, right.ball), (left.heel, right.heel)):
        apart = np.sum(ground.project(a - b) * way, axis=-1)
        assert apart.min() > 0.0, "never one before the other"
        assert apart.max() < 0.35
    knees = kinematics.pose(take.motion).positions[:, take.motion.skeleton.chain("left_shin", "right_shin")]
    assert np.sum(ground.project(knees[:, 0] - knees[:, 1]) * way, axis=-1).min() > 0.05


@pytest.mark.parametrize("speed", [0.8, 1.3, 2.0, 2.5, 3.5])
def test_steps_are_as_long_as_the_way(speed):
    """Footprints of one foot are a stride apart, and the vehicle comes as far in one turn of the phase."""
    take = plain(speed)
    for foot in feet_of(take):
        runs = [r for r in signals.runs(foot.planted) if r.value and r.start > 0 and r.stop < take.motion.frames]
        prints = np.array([foot.ball[r.stop - 1, 2] for r in runs])
        turns = np.diff([take.phases[(r.start + r.stop) // 2] for r in runs]) / (2 * np.pi)
        stride = speed / float(strides_of(speed))
        np.testing.assert_allclose(np.diff(prints), stride, rtol=0.01)
        np.testing.assert_allclose(turns, 1.0, atol=0.06)


def strides_of(speed: float) -> float:
    model = gait_model()
    table = model.run if speed > 2.0 else model.walk
    return float(table.strides(np.array([speed]), np.zeros(1))[0])


# chance


def test_the_same_seed_gives_the_same_bits():
    speeds, turns = np.linspace(0.8, 1.6, 240), np.linspace(-0.3, 0.6, 240)
    one, two, other = (perform(speeds, turns, seed=seed) for seed in (7, 7, 8))
    for name in ("root_positions", "rotations"):
        assert getattr(one.motion, name).tobytes() == getattr(two.motion, name).tobytes()
        assert not np.allclose(getattr(one.motion, name), getattr(other.motion, name), atol=0.002)
    assert one.phases.tobytes() == two.phases.tobytes()
    assert one.planted.tobytes() == two.planted.tobytes()
    assert not np.allclose(60 * np.diff(one.phases), 60 * np.diff(other.phases), atol=0.2), "the same rhythm"
    np.testing.assert_array_equal(one.positions, other.positions)


def in_step(speed: float, run: bool) -> tuple[SampleTake, int]:
    """Six strides of a whole and even number of frames each, without chance."""
    strides = strides_of(speed)
    period = 2 * round(30 / strides)
    frames = 6 * period + 1
    speeds, running = np.full(frames, speed), np.full(frames, run)
    return perform(speeds, np.zeros(frames), running=running, rate=period * strides, seed=3, variation=0.0), period


@pytest.mark.parametrize(
    ("speed", "run"), [(0.8, False), (1.3, False), (1.9, False), (2.3, True), (3.0, True), (4.2, True)]
)
def test_without_chance_every_stride_is_like_the_one_before(speed, run):
    take, period = in_step(speed, run)
    here, later = slice(2 * period, 3 * period), slice(3 * period, 4 * period)
    apart = quat.multiply(quat.inverse(take.motion.rotations[here]), take.motion.rotations[later])
    assert np.abs(quat.log(apart)).max() < 1e-5
    gone = take.motion.root_positions[later] - take.motion.root_positions[here]
    np.testing.assert_allclose(gone, np.tile([0.0, 0.0, speed / strides_of(speed)], (period, 1)), atol=1e-5)
    np.testing.assert_array_equal(take.planted[here], take.planted[later])
    np.testing.assert_allclose(take.phases[later] - take.phases[here], 2 * np.pi, atol=1e-5)


@pytest.mark.parametrize(
    ("speed", "run"), [(0.8, False), (1.3, False), (1.9, False), (2.3, True), (3.0, True), (4.2, True)]
)
def test_half_a_stride_later_the_pose_is_mirrored(speed, run):
    take, period = in_step(speed, run)
    here, later = slice(2 * period, 3 * period), slice(2 * period + period // 2, 3 * period + period // 2)
    apart = quat.multiply(quat.inverse(take.motion.rotations[here]), mirror(take.motion).rotations[later])
    assert np.abs(quat.log(apart)).max() < 1e-5
    np.testing.assert_array_equal(take.planted[here], take.planted[later][:, ::-1])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_with_chance_strides_differ_but_not_much(seed):
    """Stride times of one person differ by two or three per cent, steps by a centimetre or two (Hausdorff 2005)."""
    take = steady(1.3, 30.0, seed=seed)
    foot = feet_of(take)[0]
    runs = [r for r in signals.runs(foot.planted) if r.value and r.start > 0 and r.stop < take.motion.frames]
    at = [np.interp(2 * np.pi * n, take.phases, np.arange(take.motion.frames) / 60.0) for n in range(3, 25)]
    spread = np.std(np.diff(at)) / np.mean(np.diff(at))
    assert 0.005 < spread < 0.04
    prints = np.array([foot.ball[r.stop - 1] for r in runs])
    assert 0.004 < np.std(prints[:, 0]) < 0.03, "to the side"
    assert 0.004 < np.std(np.diff(prints[:, 2])) < 0.06, "along the way"


def test_chance_is_as_large_as_it_says():
    chance = Variation(seed=4, seconds=600.0, amount=1.0)
    for purpose, slowness in ((1, 0.6), (3, 0.8)):
        series = chance.series(purpose, 3, slowness, 12000)
        np.testing.assert_allclose(series.std(axis=0), 1.0, atol=0.12)
        np.testing.assert_allclose(series.mean(axis=0), 0.0, atol=0.15)
        late = round(slowness * 20)
        kept = [np.corrcoef(column[:-late], column[late:])[0, 1] for column in series.T]
        assert 0.6 < np.mean(kept) < 0.95, "it keeps its value for so long"
        assert abs(np.corrcoef(series[: -8 * late, 0], series[8 * late :, 0])[0, 1]) < 0.2, "and then forgets it"
    assert chance.rhythm(12000).std() == pytest.approx(0.02, rel=0.15)
    places = chance.places(0, 4000)
    np.testing.assert_allclose(places.std(axis=0), [0.0096, 0.0115], rtol=0.05)  # cut at twice the deviation
    assert (np.abs(places) <= [0.020, 0.024]).all()
    assert np.abs(np.corrcoef(places.T)[0, 1]) < 0.1
    wandering = chance.posture(30, 6000)
    assert wandering[:, : -FEET - DETAILS].std() == pytest.approx(0.012, rel=0.1)
    assert not wandering[:, -FEET - DETAILS :].any(), "the feet are placed by themselves"
    none = replace(chance, amount=0.0)
    assert not none.rhythm(60).any()
    assert not none.places(1, 9).any()
    half = replace(chance, amount=0.5)
    np.testing.assert_allclose(half.posture(30, 60), chance.posture(30, 60) / 2)


def test_places_are_beside_by_what_chance_says(monkeypatch):
    """Oracle: the footprints of the same walk without that chance."""
    frames, turns = np.full(480, 1.3), np.full(480, 0.2)
    wanted = Variation(seed=6, seconds=8.0, amount=1.0)
    with_it, places = perform(frames, turns, seed=6), [wanted.places(foot, 20) for foot in (LEFT, RIGHT)]
    monkeypatch.setattr(Variation, "places", lambda self, foot, count: np.zeros((count, 2)))
    without = perform(frames, turns, seed=6)
    for one, other, beside in zip(feet_of(with_it), feet_of(without), places, strict=True):
        moved = []
        for value, start, stop in signals.runs(one.planted):
            if value:
                flat = start + int(np.argmin(np.abs(one.forward[start:stop, 1])))
                at = with_it.headings[(start + stop) // 2]
                moved.append(ground.turn(ground.project(one.ball[flat] - other.ball[flat]), np.asarray(-at)))
        first = int(np.argmin(np.linalg.norm(beside - moved[1], axis=-1))) - 1
        assert len(moved) > 5
        np.testing.assert_allclose(moved[1:-1], beside[first + 1 : first + len(moved) - 1], atol=3e-4)


@pytest.mark.parametrize(
    ("speed", "frames"), [(1.3, 200), (1.3, 221), (1.8, 228), (3.0, 228), (3.0, 242), (4.0, 228), (4.0, 242)]
)
def test_what_comes_after_the_end_hardly_matters_before_it(speed, frames):
    """A swing that the take cuts leads nowhere in particular, but not somewhere odd. Measured: 24 degrees, 12 cm."""
    one, longer = (
        perform(np.full(n, speed), np.full(n, 0.4), running=np.full(n, speed > 2), seed=3)
        for n in (frames, frames + 90)
    )
    np.testing.assert_allclose(one.phases, longer.phases[:frames], atol=0.25)
    here, there = kinematics.pose(one.motion), kinematics.pose(longer.motion.clip(0, frames))
    joints = one.motion.skeleton.chain("left_foot", "right_foot")
    turned = quat.log(quat.multiply(quat.inverse(here.rotations[:, joints]), there.rotations[:, joints]))
    assert np.degrees(np.linalg.norm(turned, axis=-1)).max() < (26.0 if speed < 2 else 22.0)
    assert np.linalg.norm(here.positions[:, joints] - there.positions[:, joints], axis=-1).max() < 0.16
    np.testing.assert_allclose(here.positions[:-60], there.positions[:-60], atol=0.025)


# frame rates


@pytest.mark.parametrize("seed", [0, 4])
def test_truth_does_not_depend_on_the_frame_rate(seed):
    seconds = 8.0
    takes = {}
    for rate in (30.0, 60.0, 120.0):
        t = np.arange(round(seconds * rate)) / rate
        takes[rate] = perform(1.2 * ease((t - 1) / 1.5), 0.5 * np.sin(0.7 * t), rate=rate, seed=seed)
    times = np.arange(round((seconds - 0.5) * 30)) / 30
    for rate, take in takes.items():
        every = round(rate / 30)
        there, finest = take.motion, takes[120.0]
        here = slice(0, len(times) * every, every), slice(0, len(times) * 4, 4)
        np.testing.assert_allclose(take.positions[here[0]], finest.positions[here[1]], atol=2e-3)
        np.testing.assert_allclose(take.headings[here[0]], finest.headings[here[1]], atol=1e-3)
        np.testing.assert_allclose(take.phases[here[0]], finest.phases[here[1]], atol=0.12)
        assert (take.planted[here[0]] == finest.planted[here[1]]).mean() > 0.96
        places = there.root_positions[here[0]] - finest.motion.root_positions[here[1]]
        assert np.sqrt(np.mean(places**2)) < 0.006


# manners


def arm_swing(take: SampleTake) -> float:
    hand = take.motion.skeleton.joint("left_hand")
    places = ground.project(kinematics.pose(take.motion).positions[:, hand]) - take.positions
    return float(np.ptp(places[120:-120, 1]))


def lean(take: SampleTake) -> float:
    """How far the neck is before the hips, radians from upright, mean."""
    hips, neck = take.motion.skeleton.chain("hips", "neck")
    world = kinematics.pose(take.motion).positions
    up = world[:, neck] - world[:, hips]
    return float(np.arctan2(up[:, 2], up[:, 1]).mean())


def bow(take: SampleTake) -> float:
    head = kinematics.pose(take.motion).rotations[:, take.motion.skeleton.joint("head")]
    return float(-np.arcsin(quat.rotate(head, np.array([0.0, 0.0, 1.0]))[:, 1]).mean())


def cadence(take: SampleTake) -> float:
    return float(np.ptp(take.phases)) / (2 * np.pi * take.motion.seconds)


@pytest.mark.parametrize("speed", [0.9, 1.3, 1.8])
def test_manners_show(speed):
    gloomy, neutral, brisk = (plain(speed, name) for name in ("gloomy", "neutral", "brisk"))
    assert arm_swing(gloomy) < 0.7 * arm_swing(neutral)
    assert arm_swing(brisk) > 1.1 * arm_swing(neutral)
    assert lean(gloomy) > lean(neutral) + np.radians(4) > lean(brisk) + np.radians(4)
    assert bow(gloomy) > bow(neutral) + np.radians(15)
    assert cadence(brisk) == pytest.approx(BRISK.rhythm * cadence(neutral), rel=0.005)
    assert cadence(gloomy) == pytest.approx(GLOOMY.rhythm * cadence(neutral), rel=0.005)
    for take, manner in ((gloomy, GLOOMY), (neutral, NEUTRAL), (brisk, BRISK)):
        assert take.style == manner.name
        assert take.speeds[0] == speed
        check_person(take)


# whatever is asked for

STEPS = st.integers(0, 2**20)


@given(st.floats(0.6, 2.0), st.floats(-1.2, 1.2), st.sampled_from(sorted(MANNERS)), STEPS)
@settings(max_examples=8)
def test_walking_at_any_speed_and_turn(speed, turn, manner, seed):
    take = steady(speed, 4.0, turn=turn / max(1.0, speed), manner=MANNERS[manner], seed=seed)
    check_person(take)
    assert take.planted.any(axis=-1).mean() > 0.97, "a walker always has a foot on the floor, or nearly so"
    assert not take.running.any()


@given(st.floats(2.0, 4.5), st.floats(-2.5, 2.5), STEPS)
@settings(max_examples=8)
def test_running_at_any_speed_and_turn(speed, lateral, seed):
    """Turns as sharp as to be pushed aside with a quarter of one's weight."""
    take = steady(speed, 4.0, turn=lateral / speed, run=True, seed=seed)
    check_person(take)
    assert (~take.planted).all(axis=-1).mean() > 0.1, "a runner flies"
    assert not take.planted.all(axis=-1).any()
    assert take.running.all()


@given(st.floats(0.7, 1.7), st.floats(1.0, 1.3), st.floats(0.5, 2.0), st.floats(-0.4, 0.4), STEPS)
@settings(max_examples=8)
def test_any_start_and_stop(speed, gently, hold, turn, seed):
    seconds = gently * (1.0 + 0.9 * speed)  # the quickest: pushed with 2 m/s2 at most
    t = np.arange(round((2.4 + 2 * seconds + hold) * 60)) / 60
    speeds = speed * ease((t - 1.2) / seconds) * ease((1.2 + 2 * seconds + hold - t) / seconds)
    take = perform(speeds, turn * speeds, seed=seed)
    check_person(take)
    assert take.planted[t < 1.2].all()
    assert take.planted[-60:].all()
    assert not take.running.any()


@given(st.floats(1.2, 1.7), st.floats(2.4, 3.6), STEPS)
@settings(max_examples=6)
def test_any_change_between_walking_and_running(slow, fast, seed):
    seconds = 1.1 * (fast - slow) / 2.1 + 0.5
    t = np.arange(round((4.0 + 2 * seconds + 1.6) * 60)) / 60
    speeds = slow + (fast - slow) * ease((t - 2) / seconds) * ease((2 * seconds + 3.6 - t) / seconds)
    take = perform(speeds, np.zeros_like(speeds), running=speeds > 2.0, seed=seed)
    check_person(take)
    assert [bool(run.value) for run in signals.runs(take.running)] == [False, True, False]


@given(st.floats(0.5, 4.5), st.floats(-0.8, 0.8))
@settings(max_examples=6)
def test_a_steady_turn_is_a_circle(speed, turn):
    """Oracle: the closed form."""
    take = steady(speed, 3.0, turn=turn, run=speed > 2.0)
    t = np.arange(take.motion.frames) / 60.0
    np.testing.assert_allclose(take.headings, turn * t, atol=1e-9)
    if abs(turn) > 1e-3:
        circle = speed / turn * np.stack((1 - np.cos(turn * t), np.sin(turn * t)), axis=-1)
        np.testing.assert_allclose(take.positions, circle, atol=1e-3)
    np.testing.assert_array_equal(take.speeds, speed)


@pytest.mark.parametrize("frames", [2, 3, 7, 20])
def test_a_moment_will_do(frames):
    for speed in (0.0, 1.3, 3.0):
        take = perform(np.full(frames, speed), np.zeros(frames), rate=60.0)
        assert take.motion.frames == frames
        check_feet_stand(take)


@pytest.mark.parametrize("rate", [10.0, 24.0, 240.0, 1000.0])
def test_any_lawful_frame_rate(rate):
    take = steady(1.3, 3.0, rate=rate)
    check_feet_stand(take)
    check_above_floor(take)
    check_knees(take)


def test_left_out_running_begins_where_nobody_walks():
    speeds = np.linspace(1.5, 2.6, 300)
    take = perform(speeds, np.zeros(300))
    assert 1.9 < speeds[np.flatnonzero(take.running)[0]] < 2.3
    assert [bool(run.value) for run in signals.runs(take.running)] == [False, True]


# takes as things


def test_truth_is_a_copy_and_read_only():
    speeds, turns = np.full(60, 1.2), np.zeros(60)
    take = perform(speeds, turns)
    speeds[:] = 9.0
    assert take.speeds.max() == 1.2
    for name in ("positions", "headings", "speeds", "phases", "planted", "running"):
        assert not getattr(take, name).flags.writeable
    take = replace(take, style="grim")
    assert take.style == "grim"


def test_a_clip_is_those_frames():
    take = steady(1.4, 3.0, seed=2)
    clip = take.clip(20, 95)
    assert clip.motion.frames == 75
    np.testing.assert_array_equal(clip.motion.rotations, take.motion.rotations[20:95])
    for name in ("positions", "headings", "speeds", "phases", "planted", "running"):
        np.testing.assert_array_equal(getattr(clip, name), getattr(take, name)[20:95])


def test_the_body_is_alike_on_both_sides():
    skeleton = adult()
    for role, joint in skeleton.roles.items():
        if role.startswith("left_"):
            other = skeleton.joint(role.replace("left_", "right_"))
            np.testing.assert_array_equal(skeleton.offsets[joint] * [-1, 1, 1], skeleton.offsets[other])
    world = kinematics.rest(skeleton)
    crown = kinematics.ends(skeleton, world)[..., 1].max()
    assert crown - world.positions[skeleton.joint("left_toe"), 1] + SOLE == pytest.approx(1.78, abs=0.01)


# refusals


def refused(speeds, turns, **how) -> str:
    with pytest.raises(InputError) as caught:
        perform(speeds, turns, **how)
    return str(caught.value)


GOOD = np.full(30, 1.2)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("speeds", "turns", "running"),
    [
        (GOOD, np.zeros(29), None),
        (GOOD, np.zeros(30), np.zeros(31, bool)),
        (GOOD[:1], np.zeros(1), None),
        (np.zeros(0), np.zeros(0), None),
        (np.zeros((30, 1)), np.zeros((30, 1)), None),
    ],
)
def test_shapes_that_differ_are_refused(speeds, turns, running):
    message = refused(speeds, turns, running=running)
    assert "one number each for each frame" in message
    assert str(np.shape(speeds)) in message


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused_with_the_frame(value):
    speeds, turns = GOOD.copy(), np.zeros(30)
    turns[17] = value
    assert refused(speeds, turns) == "turning is not finite at frame 17"
    speeds[4] = value
    assert refused(speeds, turns) == "speed is not finite at frame 4"


def test_speeds_that_nobody_goes_are_refused_with_the_frame():
    for value, running, words in (
        (-0.1, False, "-0.1 m/s at frame 9 cannot be walked: speeds are 0 to 2.4 m/s there"),
        (2.5, False, "2.5 m/s at frame 9 cannot be walked: speeds are 0 to 2.4 m/s there"),
        (5.5, True, "5.5 m/s at frame 9 cannot be run: speeds are 0 to 5 m/s there"),
    ):
        speeds = np.full(30, 2.2)
        speeds[9] = value
        assert refused(speeds, np.zeros(30), running=np.full(30, running)) == words
    perform(np.full(30, 2.4), np.zeros(30), running=np.zeros(30, bool))
    perform(np.full(30, 5.0), np.zeros(30))


@pytest.mark.parametrize("rate", [0.0, -60.0, 9.9, 1001.0, np.nan, np.inf])
def test_frame_rates_out_of_bounds_are_refused(rate):
    assert "frame rate must be 10 to 1000" in refused(GOOD, np.zeros(30), rate=rate)


@pytest.mark.parametrize("variation", [-0.1, np.nan, np.inf])
def test_variation_out_of_bounds_is_refused(variation):
    assert "variation must be a number from 0 on" in refused(GOOD, np.zeros(30), variation=variation)


def test_negative_seeds_are_refused():
    assert "seed must be a whole number from 0 on, not -1" in refused(GOOD, np.zeros(30), seed=-1)
