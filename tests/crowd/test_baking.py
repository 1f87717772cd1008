"""A crowd from beginning to end: nothing is lost, nothing is shown twice, and it ends when it should."""

from __future__ import annotations

import numpy as np
import pytest

from stridecast.body import kinematics
from stridecast.body.character import stature
from stridecast.crowd.baking import LONGEST, Baking, overlap_depths
from stridecast.crowd.crowd import Crowd
from stridecast.crowd.frame import CrowdFrame
from stridecast.errors import InputError
from stridecast.model.people import Person
from stridecast.model.scene import Scene


def person(name, start, *stops, **more) -> Person:
    return Person(name=name, start=np.array(start, float), stops=tuple(np.array([s], float) for s in stops), **more)


def pair() -> Scene:
    """Two people who meet head on; one of them is small, one stays."""
    people = (person("ann", (0, 0), (0, 5), height=1.5), person("ben", (0.1, 5), (0, 0), stays=True))
    return Scene(people=people)


@pytest.fixture(scope="module")
def baked(formula_database):
    crowd = Crowd(formula_database, pair())
    baking = Baking(crowd)
    return crowd, baking, list(baking)


def test_everybody_is_filmed_from_appearance_to_leaving(baked):
    crowd, _, frames = baked
    finished = [one for item in frames for one in item.finished]
    assert sorted(one.number for one in finished) == [1, 2]
    for one in finished:
        there = [item.frame for item in frames if one.number in item.frame.ids]
        assert one.start == there[0].time
        assert one.frames == one.motion.frames == len(there)
        row = [int(np.flatnonzero(frame.ids == one.number)[0]) for frame in there]
        roots = np.array([frame.roots[k] for frame, k in zip(there, row, strict=True)])
        assert np.array_equal(one.motion.root_positions, roots)
        turns = np.array([frame.rotations[k] for frame, k in zip(there, row, strict=True)])
        assert np.allclose(np.abs(np.sum(turns * one.motion.rotations, axis=-1)), 1.0, atol=1e-6)
        assert np.allclose(np.linalg.norm(one.motion.rotations, axis=-1), 1.0, atol=1e-12)
        assert one.arrived
    assert [one.person.name for one in finished] == [crowd.person(one.number).name for one in finished]


def test_bodies_have_their_own_height_and_stand_on_the_ground(baked):
    crowd, _, frames = baked
    for one in (one for item in frames for one in item.finished):
        wanted = crowd.height(one.number)
        assert stature(one.motion.skeleton) == pytest.approx(wanted)
        low = kinematics.pose(one.motion).positions[..., 1].min()
        assert -0.03 < low < 0.15
    assert crowd.height(1) == 1.5


def test_it_ends_when_all_have_left_or_stand_at_their_end(baked):
    crowd, baking, frames = baked
    assert crowd.done
    assert [item.last for item in frames] == [False] * (len(frames) - 1) + [True]
    assert len(frames) == baking.tally.frames < LONGEST * crowd.frame_rate
    assert frames[-1].frame.ids.tolist() == [2]
    assert np.linalg.norm(frames[-1].frame.positions[0]) < 0.4
    assert not frames[-1].frame.velocities.any()


def test_the_tally_agrees_with_the_frames(baked):
    _, baking, frames = baked
    tally = baking.tally
    assert tally.frames == len(frames)
    assert (tally.came, tally.arrived, tally.there, tally.waiting, tally.most) == (2, 2, 1, 0, 2)
    assert (tally.overlaps, tally.deepest) == (0, 0.0)
    assert 9.0 < tally.metres < 12.0


def test_a_bake_does_not_change_the_ways(baked, formula_database):
    """The same places without bodies, frame by frame."""
    _, _, frames = baked
    bare = list(Baking(Crowd(formula_database, pair(), bodies=False)))
    assert len(bare) == len(frames)
    for one, other in zip(bare, frames, strict=True):
        assert np.array_equal(one.frame.positions, other.frame.positions)
    assert all(one.motion is None for item in bare for one in item.finished)


def test_what_ends_early_gives_everybody_who_is_there(formula_database):
    baking = Baking(Crowd(formula_database, pair(), bodies=False), seconds=1.0)
    frames = list(baking)
    assert len(frames) == baking.frames == 30
    assert [(one.number, one.frames, one.arrived) for one in frames[-1].finished] == [(1, 30, False), (2, 30, False)]


def test_overlaps_are_found():
    def frame(*places: tuple[float, float]) -> CrowdFrame:
        count = len(places) - 1
        zeros = np.zeros((count, 2))
        return CrowdFrame(
            time=0.0,
            ids=np.arange(count),
            positions=np.array(places[:-1], float).reshape(-1, 2),
            velocities=zeros,
            accelerations=zeros,
            headings=np.zeros(count),
            radii=np.full(count, 0.3),
            rules=np.zeros(count, int),
            heights=np.ones(count),
            roots=None,
            rotations=None,
            planted=None,
            movers=np.array(places[-1:], float),
        )

    mover = np.array([1.0])
    assert len(overlap_depths(frame((0, 0), (0.6, 0), (9, 9)), mover)) == 0
    assert overlap_depths(frame((0, 0), (0.5, 0), (9, 9)), mover) == pytest.approx([0.1])
    assert overlap_depths(frame((0, 0), (2, 0), (0, 1.2)), mover) == pytest.approx([0.1])
    assert len(overlap_depths(frame((9, 9)), mover)) == 0


def test_what_makes_no_bake_is_refused(formula_database):
    crowd = Crowd(formula_database, Scene(people=(person("stone", (0, 0)),)), bodies=False)
    with pytest.raises(InputError, match="nobody in the scene goes anywhere"):
        Baking(crowd)
    for seconds in (0.0, -1.0, float("nan"), 1e9):
        with pytest.raises(InputError, match="seconds must lie above 0"):
            Baking(crowd, seconds=seconds)
    assert len(list(Baking(crowd, seconds=0.2))) == 6
    with pytest.raises(InputError, match=r"stepped to 0\.2 s"):
        Baking(crowd, seconds=1.0)
