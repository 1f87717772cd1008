"""Size of movement, of clips and of walkers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaits import accelerations, angles, clip, knee_bends, travel
from stridecast.body import kinematics
from stridecast.body.mirroring import mirror
from stridecast.errors import MotionError, WishError
from stridecast.geometry import quaternions as quat
from stridecast.model.clip import Clip
from stridecast.model.motion import Motion
from stridecast.model.scene import SIZES
from stridecast.synthesis.clips import loop
from stridecast.synthesis.multiresolution import FREQUENCIES, GAINS, resize
from stridecast.synthesis.sizes import AMOUNTS
from stridecast.synthesis.walker import Walker, Walkers


@pytest.fixture(scope="module", params=[1.3, 3.0], ids=["walk", "run"])
def whole(request: pytest.FixtureRequest) -> Clip:
    return clip(request.param)


def arm_swing(motion: Motion) -> float:
    """How far the left hand goes to and fro beside the pelvis, metres."""
    hand = motion.skeleton.joint("left_hand")
    places = kinematics.pose(motion).positions
    return float(np.ptp(quat.rotate(quat.inverse(motion.rotations[:, 0]), places[:, hand] - places[:, 0])[..., 2]))


def test_gains_of_one_change_nothing(whole):
    assert resize(whole.motion, "neutral", planted=whole.planted) is whole.motion
    nearly = [1.0] * len(FREQUENCIES) + [1.0 + 1e-13]
    out = resize(whole.motion, nearly, planted=whole.planted)
    np.testing.assert_allclose(out.root_positions, whole.motion.root_positions, atol=1e-9)
    assert angles(out, whole.motion).max() < 1e-6


@pytest.mark.parametrize("size", ["calm", "lively", "exaggerated"])
def test_steps_stay_and_knees_bend_forward(whole, size):
    out = resize(whole.motion, size, planted=whole.planted)
    np.testing.assert_array_equal(out.root_positions[:, [0, 2]], whole.motion.root_positions[:, [0, 2]])
    toes = out.skeleton.chain("left_toe", "right_toe")
    before, after = (kinematics.pose(m).positions[:, toes] for m in (whole.motion, out))
    assert np.linalg.norm(after - before, axis=-1)[whole.planted].max() < 1e-6
    assert travel(out, whole.planted) < 0.003
    assert knee_bends(out).min() > 0.0
    assert after[..., 1].min() > before[..., 1].min() - 0.01


def test_sizes_differ_in_order(whole):
    swings = [arm_swing(resize(whole.motion, size, planted=whole.planted)) for size in SIZES]
    assert swings == sorted(swings)
    assert swings[0] < 0.85 * swings[1]
    assert swings[3] > 1.2 * swings[1]


def test_posture_stays(whole):
    out = resize(whole.motion, "exaggerated", planted=whole.planted)
    arms = whole.motion.skeleton.chain("left_upper_arm", "right_upper_arm")
    before, after = (quat.mean(m.rotations[:, arms]) for m in (whole.motion, out))
    assert np.linalg.norm(quat.log(quat.multiply(quat.inverse(before), after)), axis=-1).max() < 0.06


def test_the_frame_rate_does_not_matter(whole):
    half = replace(
        whole.motion,
        frame_rate=30.0,
        root_positions=whole.motion.root_positions[::2],
        rotations=whole.motion.rotations[::2],
    )
    there = resize(half, "lively", planted=whole.planted[::2])
    back = resize(whole.motion, "lively", planted=whole.planted)
    arm = half.skeleton.joint("left_upper_arm")
    turned = quat.multiply(quat.inverse(there.rotations[:, arm]), back.rotations[::2, arm])
    assert np.linalg.norm(quat.log(turned), axis=-1)[20:-20].max() < 0.02


def test_a_mirrored_motion_is_resized_to_the_mirrored_one(whole):
    there = resize(mirror(whole.motion), "lively", planted=whole.planted[:, ::-1])
    back = mirror(resize(whole.motion, "lively", planted=whole.planted))
    np.testing.assert_allclose(there.root_positions, back.root_positions, atol=1e-6)
    assert angles(there, back).max() < 1e-4


def test_a_cycle_stays_one(whole):
    cycle = loop(whole)
    out = resize(cycle.motion, "exaggerated", planted=cycle.planted, cyclic=True)
    assert angles(out.clip(0, 1), out.clip(out.frames - 1, out.frames)).max() < 1e-6
    assert out.root_positions[0, 1] == pytest.approx(out.root_positions[-1, 1], abs=1e-6)
    assert travel(out, cycle.planted) < 0.003


def test_contacts_are_found_where_none_are_given(whole):
    out = resize(whole.motion, "lively")
    assert knee_bends(out).min() > 0.0


def test_wrong_sizes_are_refused(whole):
    with pytest.raises(MotionError, match="calm, neutral, lively, exaggerated"):
        resize(whole.motion, "huge")
    with pytest.raises(MotionError, match="6 numbers from 0 to 4"):
        resize(whole.motion, [1.0, 2.0])
    with pytest.raises(MotionError, match="do not fit"):
        resize(whole.motion, "calm", planted=whole.planted[:5])


def test_every_size_has_its_gains_and_amount():
    assert tuple(GAINS) == tuple(AMOUNTS) == SIZES


# walkers


def walked(
    formulas, size: str, motion: str, seconds: float = 5.0, then: str | None = None
) -> tuple[Motion, np.ndarray]:
    """Somebody of this size, and which feet stood; from half of the time on of another size."""
    speed, rate = {"walk": 1.3, "run": 3.0}[motion], 30.0
    walker = Walker(formulas, size=size)
    poses = []
    for frame in range(int(seconds * rate)):
        changes = then if frame == int(0.5 * seconds * rate) else None
        poses.append(walker.step((0.0, speed * frame / rate), motion=motion, size=changes))
    walk = Motion(
        skeleton=formulas.skeleton,
        frame_rate=rate,
        root_positions=np.array([p.root_position for p in poses]),
        rotations=quat.continuous(np.array([p.rotations for p in poses])),
    )
    return walk, np.array([p.planted for p in poses])


@pytest.mark.parametrize("motion", ["walk", "run"])
def test_walkers_come_in_sizes(formulas, motion):
    found = {size: walked(formulas, size, motion) for size in SIZES}
    swings = [arm_swing(walk.clip(75, walk.frames)) for walk, _ in found.values()]
    assert swings == sorted(swings)
    assert swings[3] > 1.15 * swings[1]
    for walk, _ in found.values():
        assert knee_bends(walk).min() > 0.0
        assert kinematics.pose(walk).positions[..., 1].min() > -0.01


def test_a_size_changes_nothing_of_the_way(formulas):
    ways = np.stack([np.stack((0.0 * f, 1.3 * f), axis=-1) for f in (np.arange(90) / 30,)])[0]
    batches = [Walkers(formulas, np.zeros((1, 2)), size=size) for size in ("neutral", "exaggerated")]
    for point in ways:
        poses = [batch.step(point[None]) for batch in batches]
        # Other weights of examples that last equally long: a half cycle ends at the same time but for rounding.
        np.testing.assert_allclose(poses[0].vehicle.position, poses[1].vehicle.position, rtol=0.0, atol=1e-12)
        assert poses[0].group == poses[1].group


def test_a_size_asked_for_later_comes_smoothly(formulas):
    changed, _ = walked(formulas, "calm", "walk", 6.0, then="exaggerated")
    steady, _ = walked(formulas, "exaggerated", "walk", 6.0)
    assert accelerations(changed.clip(60, 150)).max() < 1.3 * accelerations(steady.clip(60, 150)).max()
    assert angles(changed.clip(160, 180), steady.clip(160, 180)).max() < 0.05
    calm, _ = walked(formulas, "calm", "walk", 6.0)
    assert angles(changed.clip(0, 90), calm.clip(0, 90)).max() < 1e-12


def test_each_character_has_its_own_size(formulas):
    together = Walkers(formulas, np.zeros((3, 2)), size=["calm", "neutral", "lively"])
    alone = [Walkers(formulas, np.zeros((1, 2)), size=size) for size in ("calm", "neutral", "lively")]
    for frame in range(60):
        point = np.array([[0.0, 1.2 * frame / 30]])
        pose = together.step(np.repeat(point, 3, axis=0))
        for k, one in enumerate(alone):
            np.testing.assert_array_equal(pose.rotations[k], one.step(point).rotations[0])


def test_a_size_that_does_not_exist_changes_nothing(formulas):
    with pytest.raises(WishError, match="'huge'"):
        Walkers(formulas, np.zeros((1, 2)), size="huge")
    walkers = [Walkers(formulas, np.zeros((1, 2))) for _ in range(2)]
    with pytest.raises(WishError, match="sizes for 1"):
        walkers[0].step(np.ones((1, 2)), size=["calm", "calm"])
    poses = [walker.step(np.ones((1, 2))) for walker in walkers]
    np.testing.assert_array_equal(poses[0].rotations, poses[1].rotations)
