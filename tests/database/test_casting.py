from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bodies import humanoid
from characters import bandai_like, built, mixamo_like
from databases import formula_database
from stridecast.body import kinematics
from stridecast.body.character import character_of, stature
from stridecast.database.casting import cast_database
from stridecast.database.poses import planted_rows, poses_of, sole_height, tangents_of
from stridecast.errors import SkeletonError
from stridecast.geometry import quaternions as quat
from stridecast.geometry import signals
from stridecast.model.contacts import SIDES
from stridecast.model.database import MARGIN, MotionDatabase
from stridecast.model.skeleton import Skeleton
from stridecast.synthesis.walker import Walker

RIGS = {
    "mixamo": mixamo_like,
    "bandai": bandai_like,
    "short legs, long feet": lambda _: built(legs=0.75, feet=1.3, hips=1.2, ankle=1.3),
}


@pytest.fixture(scope="module")
def home() -> MotionDatabase:
    return formula_database()


@pytest.fixture(scope="module", params=RIGS)
def body(request, tmp_path_factory, home) -> Skeleton:
    return character_of(RIGS[request.param](tmp_path_factory.mktemp("rig")), home.skeleton).body


@pytest.fixture(scope="module")
def away(home, body) -> MotionDatabase:
    return cast_database(home, body)


def walked(database: MotionDatabase) -> tuple[Skeleton, kinematics.World, np.ndarray, np.ndarray]:
    """Somebody who sets off, walks round a corner and stops: where joints are, which feet stand, the vehicle."""
    walker = Walker(database, (0.0, 0.0), 0.0)
    poses = []
    for k in range(270):
        t = k / 30
        point = (0.0, 1.3 * t) if t < 3.5 else (1.2 * min(t - 3.5, 3.0), 4.55)
        poses.append(walker.step(point, motion="walk" if t < 6.5 else "stand"))
    roots = np.array([pose.root_position for pose in poses])
    world = kinematics.forward(database.skeleton, roots, np.array([pose.rotations for pose in poses]))
    vehicle = np.array([pose.vehicle.position for pose in poses])
    return database.skeleton, world, np.array([pose.planted for pose in poses]), vehicle


def travels(skeleton: Skeleton, world: kinematics.World, planted: np.ndarray) -> np.ndarray:
    """How far toes go over the ground in each stance, metres."""
    toes = world.positions[:, skeleton.chain("left_toe", "right_toe")][..., ::2]
    return np.array(
        [
            np.linalg.norm(np.diff(toes[start:stop, side], axis=0), axis=-1).sum()
            for side in range(2)
            for on, start, stop in signals.runs(planted[:, side])
            if on
        ]
    )


def test_at_home_the_examples_stay_as_they_are(home):
    again = cast_database(home, home.skeleton)
    for group in home.groups:
        one, other = (poses_of(d.references, d.examples.features[group.rows]) for d in (home, again))
        np.testing.assert_allclose(one[1], other[1], atol=0.012)
        turned = quat.log(quat.multiply(quat.inverse(one[0]), other[0]))
        legs = home.skeleton.chain(*(f"{side}_{part}" for side in SIDES for part in ("thigh", "shin", "foot", "toe")))
        others = sorted({*range(home.skeleton.joints)} - {*legs})
        assert np.abs(turned[..., others, :]).max() < 1e-6
        assert np.abs(turned).max() < 0.12


def test_poses_and_features_are_the_same_thing(home):
    features = home.examples.features
    rotations, roots = poses_of(home.references, features)
    bones = 3 * len(home.references)
    np.testing.assert_allclose(tangents_of(home.references, rotations), features[..., :bones], atol=1e-9)
    np.testing.assert_array_equal(roots, features[..., bones + 3 : bones + 6])


def test_vehicles_and_bounds_are_those_of_the_people(home, away):
    for name in ("times", "travelled", "parameters", "durations", "takes"):
        np.testing.assert_array_equal(getattr(home.examples, name), getattr(away.examples, name))
    assert home.groups == away.groups
    assert away.person == pytest.approx(stature(home.skeleton))


def test_planted_feet_of_the_examples_are_on_the_floor(home, away):
    sole = sole_height(away)
    toes = away.skeleton.chain("left_toe", "right_toe")
    for group in away.groups:
        rotations, roots = poses_of(away.references, away.examples.features[group.rows])
        at = kinematics.forward(away.skeleton, roots, rotations).positions[..., toes, 1]
        heights = at[:, MARGIN:-MARGIN][:, planted_rows(group)[MARGIN:-MARGIN]]
        assert np.abs(heights - sole).min() < 0.004
        assert heights.min() > sole - 0.02


def test_a_walker_in_the_body_plants_its_feet_as_at_home(home, away):
    skeleton, world, planted, vehicle = walked(away)
    at_home = walked(home)
    there, here = travels(skeleton, world, planted), travels(*at_home[:3])
    assert np.median(there) < 1.5 * np.median(here) + 0.002
    assert np.percentile(there, 90) < 1.5 * np.percentile(here, 90) + 0.005
    np.testing.assert_allclose(vehicle, at_home[3], atol=0.5)
    tips = kinematics.ends(skeleton, world)[..., 1]
    assert tips.min() > -0.002


def test_knees_of_a_walker_in_the_body_bend_forward_only(away):
    skeleton, world, _, _ = walked(away)
    ahead = quat.rotate(world.rotations[:, 0], np.array([0.0, 0.0, 1.0]))
    for side in SIDES:
        hip, knee, ankle = (
            world.positions[:, joint]
            for joint in skeleton.chain(*(f"{side}_{part}" for part in ("thigh", "shin", "foot")))
        )
        line = ankle - hip
        share = np.sum((knee - hip) * line, axis=-1) / np.sum(line * line, axis=-1)
        bulge = np.sum((knee - hip - share[:, None] * line) * ahead, axis=-1)
        assert bulge.min() > 0


def test_hips_are_as_high_as_legs_are_long(home, away):
    there, here = (walked(database) for database in (away, home))
    ratio = away.skeleton.leg_length / home.skeleton.leg_length
    heights = [world.positions[:, 0, 1].mean() for _, world, _, _ in (there, here)]
    assert heights[0] / heights[1] == pytest.approx(ratio, abs=0.12)


def test_what_is_told_of_progress_ends_with_all(home):
    told: list[tuple[int, int]] = []
    cast_database(home, home.skeleton, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (len(home.examples.durations),) * 2
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_who_has_no_legs_is_refused(home):
    body = humanoid()
    lame = replace(body, roles={role: joint for role, joint in body.roles.items() if role != "left_shin"})
    with pytest.raises(SkeletonError, match="left_shin"):
        cast_database(home, lame)
