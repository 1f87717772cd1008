"""Blending, joining and looping of clips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaits import accelerations, angles, clip, knee_bends, known, steps, travel
from stridecast.analysis.take import analyse
from stridecast.body.mirroring import mirror
from stridecast.errors import InputError, MotionError, TakeError
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.clip import Clip
from stridecast.synthesis.clips import blend, clip_of, loop, place, repeat, transition
from synthetic_gait import gait, ramps

PLANTED = 0.003


@pytest.fixture(scope="module")
def walks() -> list[Clip]:
    """Three walks of twelve support states: slow, fast, and in a turn."""
    return [steps(c, 12) for c in (clip(1.0, 5.0), clip(1.6), clip(1.3, curvature=0.4))]


@pytest.fixture(scope="module")
def walk() -> Clip:
    return clip(1.4)


@pytest.fixture(scope="module")
def run() -> Clip:
    return clip(2.8)


def mirrored(clip: Clip) -> Clip:
    return Clip(
        motion=mirror(clip.motion),
        positions=clip.positions * [-1.0, 1.0],
        headings=-clip.headings,
        support=clip.support.translate(str.maketrans("LR", "RL")),
    )


# blending


@pytest.mark.parametrize("k", range(3))
def test_one_clip_with_all_the_weight_comes_back(walks, k):
    out = blend(walks, np.eye(3)[k])
    assert out.support == walks[k].support
    np.testing.assert_allclose(out.motion.root_positions, walks[k].motion.root_positions, atol=1e-9)
    np.testing.assert_allclose(out.positions, walks[k].positions, atol=1e-9)
    assert angles(out.motion, walks[k].motion).max() < 1e-6


@pytest.mark.parametrize("weights", [(0.5, 0.5, 0.0), (0.2, 0.8, 0.0), (0.4, 0.3, 0.3), (0.0, 0.5, 0.5)])
def test_a_blend_lies_between_its_clips(walks, weights):
    out = blend(walks, weights)
    used = [c for c, w in zip(walks, weights, strict=True) if w]
    assert out.string == walks[0].string
    for measure in (lambda c: c.motion.seconds, lambda c: c.speed):
        values = [measure(c) for c in used]
        assert min(values) - 0.02 < measure(out) < max(values) + 0.02
    assert out.motion.seconds == pytest.approx(
        sum(w * c.motion.seconds for c, w in zip(walks, weights, strict=True)), abs=1 / 60
    )
    assert travel(out.motion, out.planted) < PLANTED
    assert knee_bends(out.motion).min() > 0.0
    turned = sum(w * (c.headings[-1] - c.headings[0]) for c, w in zip(walks, weights, strict=True))
    assert out.headings[-1] - out.headings[0] == pytest.approx(turned, abs=0.02)


def test_order_does_not_matter(walks):
    there, back = blend(walks, [0.2, 0.3, 0.5]), blend(walks[::-1], [0.5, 0.3, 0.2])
    np.testing.assert_allclose(there.positions, back.positions, atol=1e-6)
    assert angles(there.motion, back.motion).max() < 1e-5


def test_mirrored_clips_blend_to_the_mirrored_blend(walks):
    there = blend([mirrored(c) for c in walks], [0.4, 0.3, 0.3])
    back = mirrored(blend(walks, [0.4, 0.3, 0.3]))
    assert there.support == back.support
    np.testing.assert_allclose(there.motion.root_positions, back.motion.root_positions, atol=1e-6)
    assert angles(there.motion, back.motion).max() < 1e-5


def test_weights_may_change_on_the_way(walks):
    out = blend(walks[:2], [[1.0, 0.0], [0.0, 1.0]])
    speeds = np.linalg.norm(np.diff(out.positions, axis=0), axis=-1) * 60
    assert speeds[0] == pytest.approx(1.0, abs=0.05)
    assert speeds[-1] == pytest.approx(1.6, abs=0.05)
    assert (np.diff(speeds) > -1e-3).all()
    assert travel(out.motion, out.planted) < PLANTED


def test_clips_of_other_rates_are_brought_to_the_highest(walks):
    slow = known(gait(ramps((5.0, 1.0), rate=30.0), rate=30.0))
    out = blend([steps(slow, 12), walks[1]], [0.5, 0.5])
    assert out.motion.frame_rate == 60.0
    assert travel(out.motion, out.planted) < PLANTED


def test_an_analysed_take_can_be_blended():
    takes = [clip_of(analyse(gait(ramps((5.0, speed))).motion)) for speed in (1.1, 1.5)]
    out = blend([steps(c, 8) for c in takes], [0.5, 0.5])
    assert 1.1 < out.speed < 1.5


def test_other_strings_weights_and_bodies_are_refused(walks, run):
    with pytest.raises(MotionError, match="same support states"):
        blend([walks[0], run], [0.5, 0.5])
    with pytest.raises(InputError, match="sum one"):
        blend(walks, [0.5, 0.6, 0.0])
    with pytest.raises(InputError, match="one a clip"):
        blend(walks, [0.5, 0.5])
    with pytest.raises(MotionError, match="nothing to blend"):
        blend([], [])
    skeleton = replace(walks[1].motion.skeleton, offsets=walks[1].motion.skeleton.offsets * 1.1)
    with pytest.raises(MotionError, match="one skeleton"):
        blend([walks[0], replace(walks[1], motion=replace(walks[1].motion, skeleton=skeleton))], [0.5, 0.5])


# transitions


@pytest.mark.parametrize("seconds", [0.3, 0.6])
@pytest.mark.parametrize("way", ["walk to run", "run to walk", "faster", "into a turn"])
def test_a_transition_is_smooth_and_nothing_slides(walk, run, way, seconds):
    a, b = {
        "walk to run": (walk, run),
        "run to walk": (run, walk),
        "faster": (clip(1.0), walk),
        "into a turn": (walk, clip(1.2, curvature=0.5, facing=2.0)),
    }[way]
    out = transition(a, b, seconds)
    np.testing.assert_allclose(out.positions[0], a.positions[0], atol=1e-9)
    speeds = np.linalg.norm(np.diff(out.positions, axis=0), axis=-1) * 60
    low, high = sorted((a.speed, b.speed))
    assert low - 0.1 < speeds.min() < speeds.max() < high + 0.1
    assert speeds[0] == pytest.approx(a.speed, abs=0.02)
    assert speeds[-1] == pytest.approx(b.speed, abs=0.02)
    assert np.abs(np.diff(speeds)).max() * 60 < 3.0 * (high - low) / seconds + 1.0
    assert np.abs(np.diff(out.headings)).max() < 0.03
    assert travel(out.motion, out.planted) < PLANTED
    assert knee_bends(out.motion).min() > 0.0
    heights = out.motion.root_positions[:, 1]
    assert heights.min() > min(a.motion.root_positions[:, 1].min(), b.motion.root_positions[:, 1].min()) - 0.06


def test_what_goes_on_anyway_is_joined_without_a_trace(walk):
    """The second clip shares its first frame with the last one of the first."""
    out = transition(walk.cut(0, 121), walk.cut(120, walk.motion.frames), 0.4, search=0.0)
    assert out.motion.frames == walk.motion.frames
    np.testing.assert_allclose(out.motion.root_positions, walk.motion.root_positions, atol=5e-4)
    assert angles(out.motion, walk.motion)[:, :6].max() < 0.005


def test_the_most_alike_poses_are_found(walk):
    cut = walk.cut(0, 150)
    again = place(walk.cut(3, walk.motion.frames), np.array([5.0, -2.0]), 1.0)
    out = transition(cut, again, 0.3)
    assert accelerations(out.motion).max() < 1.5 * accelerations(walk.motion).max()


def test_mirrored_clips_are_joined_to_the_mirrored_whole(walk, run):
    there, back = transition(mirrored(walk), mirrored(run), 0.5), mirrored(transition(walk, run, 0.5))
    np.testing.assert_allclose(there.motion.root_positions, back.motion.root_positions, atol=1e-6)
    assert angles(there.motion, back.motion).max() < 1e-5


def test_times_and_clips_that_make_no_sense_are_refused(walk, run):
    with pytest.raises(InputError, match="above zero"):
        transition(walk, run, 0.0)
    with pytest.raises(MotionError, match="2 frames"):
        transition(walk.cut(0, 2), run)


# cycles


@pytest.mark.parametrize("speed", [1.2, 3.0])
def test_a_cycle_follows_itself_without_a_seam(speed):
    cycle = loop(clip(speed))
    assert cycle.string in ("LDRDL", "FLFRF", "LFRFL")
    row = repeat(cycle, 3)
    assert row.motion.frames == 3 * (cycle.motion.frames - 1) + 1
    seams = [k * (cycle.motion.frames - 1) for k in (1, 2)]
    found = accelerations(row.motion)
    near = [found[seam - 2 : seam + 1].max() for seam in seams]
    assert max(near) <= np.delete(found, [s + k for s in seams for k in (-2, -1, 0)]).max() * 1.05
    assert travel(row.motion, row.planted) < PLANTED


def test_the_end_of_a_cycle_is_its_beginning_moved_on():
    cycle = loop(clip(1.2, curvature=0.3))
    motion, turn = cycle.motion, float(cycle.headings[-1] - cycle.headings[0])
    np.testing.assert_allclose(motion.rotations[-1, 1:], motion.rotations[0, 1:], atol=1e-9)
    moved = quat.multiply(quat.about_y(turn), motion.rotations[0, 0])
    assert np.linalg.norm(quat.log(quat.multiply(quat.inverse(moved), motion.rotations[-1, 0]))) < 1e-9
    away = [motion.root_positions[k] - ground.lift(cycle.positions[k]) for k in (0, -1)]
    np.testing.assert_allclose(away[1], quat.rotate(quat.about_y(turn), away[0]), atol=1e-9)


def test_a_clip_without_a_cycle_is_refused(walk):
    with pytest.raises(TakeError, match="no whole cycle"):
        loop(walk.cut(0, 40))
    with pytest.raises(InputError, match="once or more"):
        repeat(loop(walk), 0)


def test_a_clip_checks_its_parts(walk):
    with pytest.raises(MotionError, match="support states"):
        replace(walk, support="LR")
    with pytest.raises(MotionError, match="'X'"):
        replace(walk, support="X" * walk.motion.frames)
