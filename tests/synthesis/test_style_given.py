"""Vehicles that move by themselves, with bodies in a mood."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import pytest

from stridecast.analysis.style import stoop
from stridecast.body import kinematics
from stridecast.crowd.bodies import Bodies
from stridecast.errors import WishError
from stridecast.geometry import quaternions as quat
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import Pose
from stridecast.synthesis.tables import make_tables
from stridecast.synthesis.walker import Walkers
from vehicles import at, bodies_of, body_of, tracks

RATE = 30.0
STYLES = (-1.0, -0.5, 0.0, 1.0)
TRACKS = tracks(RATE)
ROWS = list(product(TRACKS, STYLES))


@cache
def moods(database: MotionDatabase) -> list[Pose]:
    """Every track in every mood."""
    return bodies_of(database, [TRACKS[name] for name, _ in ROWS], RATE, style=np.array([style for _, style in ROWS]))


def bends(database: MotionDatabase, poses: list[Pose], row: int) -> np.ndarray:
    """Stoop in every frame of one body."""
    rotations = np.array([pose.rotations[row] for pose in poses])[:, None]
    headings = np.array([pose.vehicle.heading[row] for pose in poses])[:, None]
    return stoop(database.skeleton, rotations, headings)


def toes_under(database: MotionDatabase, stance: np.ndarray) -> np.ndarray:
    """Where the toes are in a stance, left and ahead of the vehicle."""
    joints = stance[: 3 * (database.skeleton.joints - 1)].reshape(-1, 3)
    tilt, place, yaw = np.split(stance[joints.size :], [3, 6])
    root = quat.multiply(quat.about_y(yaw[0]), quat.exp(tilt))
    turned = np.concatenate((root[None], quat.multiply(database.references, quat.exp(joints))))
    world = kinematics.forward(database.skeleton, place, turned).positions
    return world[[database.skeleton.joint(f"{side}_toe") for side in ("left", "right")]][:, [0, 2]]


@pytest.mark.parametrize("name", list(TRACKS))
def test_bodies_show_their_mood_whatever_their_vehicle_does(sample_person, name):
    poses = moods(sample_person)[20:]
    gloomy, half, neutral, brisk = (bends(sample_person, poses, ROWS.index((name, style))) for style in STYLES)
    assert gloomy.mean() - 0.08 > half.mean() > neutral.mean() + 0.08
    assert brisk.mean() < neutral.mean()
    assert np.median(gloomy - neutral) > 0.2


@pytest.mark.parametrize("style", STYLES)
def test_feet_keep_to_the_floor_in_every_mood(sample_person, style):
    poses, hinges = moods(sample_person), make_tables(sample_person).hinges
    slides = []
    for name in TRACKS:
        body = body_of(sample_person.skeleton, poses, ROWS.index((name, style)), RATE, hinges)
        slides.append(body.slides(RATE))
        assert np.degrees(body.bends.min()) > 2.0, name
        assert body.reach.max() < 0.9985, name
        assert body.lowest.min() > 0.0, name
    assert np.median(np.concatenate(slides)) < 0.001
    assert np.percentile(np.concatenate(slides), 90) < 0.003


def test_people_of_all_moods_stand_above_the_same_place(sample_person):
    tables = make_tables(sample_person)
    gloomy, neutral, brisk = tables.stance_styles
    assert gloomy < -0.6 < neutral == 0.0 < 0.2 < brisk
    tilt = 3 * (sample_person.skeleton.joints - 1)
    assert (np.abs(tables.stances[[0, 2], :tilt] - tables.stances[1, :tilt]).max(axis=1) > 0.04).all()
    np.testing.assert_array_equal(tables.stances[1], tables.neutral)
    for stance in tables.stances:
        home = toes_under(sample_person, stance)
        np.testing.assert_allclose(home.mean(axis=0), tables.home.mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(home, tables.home, atol=0.01)


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("name", ["stop and go", "turns on the spot", "to a run and back"])
def test_who_comes_to_rest_stands_still_in_every_mood(sample_person, name, style):
    last = moods(sample_person)[-8:]
    row = ROWS.index((name, style))
    assert {pose.motion[row] for pose in last} == {"stand"}
    assert all(pose.planted[row].all() for pose in last)


# rows


def test_a_row_placed_in_a_mood_is_as_one_made_in_it(sample_person):
    names = list(TRACKS)
    given, styles = [TRACKS[name] for name in names], np.linspace(-1.0, 1.0, len(names))
    one = Walkers(sample_person, np.zeros((len(names), 2)), style=styles)
    other = Walkers(sample_person, np.zeros((len(names), 2)), style="brisk")
    for frame in range(40):
        other.step(**at(given, frame))
    everybody = np.arange(len(names))
    for walkers in (one, other):
        walkers.place(everybody, np.zeros((len(names), 2)), style=styles)
    for frame in range(60):
        here, there = one.step(**at(given, 60 + frame)), other.step(**at(given, 60 + frame))
        np.testing.assert_array_equal(here.rotations, there.rotations)
        if frame == 0:
            assert bends(sample_person, [here], 0)[0] > bends(sample_person, [here], 4)[0] + 0.2
    other.place([0], np.zeros((1, 2)))
    assert other._state.style[0] == 0.0
    np.testing.assert_array_equal(other._state.style[1:], styles[1:])


def test_a_style_is_asked_of_those_who_are_stepped(formulas):
    walkers = Walkers(formulas, np.zeros((3, 2)), style=[0.1, 0.2, 0.3])
    active = np.array([True, False, True])
    walkers.step(np.zeros((3, 2)), style=np.array([0.5, np.nan, -0.5]), active=active)
    assert walkers._state.style.tolist() == [0.5, 0.2, -0.5]
    walkers.step(np.zeros((3, 2)), style="gloomy", active=~active)
    assert walkers._state.style.tolist() == [0.5, -1.0, -0.5]


@pytest.mark.parametrize("style", [1.5, [0.0], [0.0, "merry"], float("nan")])
@pytest.mark.usefixtures("unchecked")
def test_nobody_is_placed_in_a_style_that_is_none(formulas, style):
    asked, spared = (Walkers(formulas, np.zeros((3, 2))) for _ in range(2))
    for frame in range(40):
        points = np.full((3, 2), 0.04 * frame)
        if frame == 20:
            with pytest.raises(WishError, match="style"):
                asked.place([0, 2], np.ones((2, 2)), style=style)
        np.testing.assert_array_equal(asked.step(points).rotations, spared.step(points).rotations)


def test_bodies_of_a_crowd_have_the_moods_they_are_placed_in(sample_person):
    bodies = Bodies(sample_person, RATE)
    styles, rows = np.array([-1.0, 0.0, 1.0]), np.array([1, 0, 300])
    bodies.place(
        rows,
        np.zeros((3, 2)),
        np.zeros(3),
        phases=np.zeros(3),
        heights=np.full(3, bodies.height),
        sizes=["neutral"] * 3,
        styles=styles,
    )
    track = TRACKS["shuffle"]
    for frame in range(30):
        given = at([track] * 3, frame)
        bodies.step(rows, given["vehicles"], given["motion"], given["rests_in"])
    gloomy, neutral, brisk = (
        stoop(sample_person.skeleton, bodies.rotations[row][None, None], np.zeros((1, 1)))[0] for row in rows
    )
    assert gloomy > neutral + 0.2
    assert neutral > brisk
