from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from databases import analysed, formula_motions, swapped, takes_of
from stridecast.database.assembly import assemble
from stridecast.database.graph import UNREACHABLE, can_follow, connect, made_up
from stridecast.errors import DatabaseError
from stridecast.model.bounds import SteeringBounds
from stridecast.model.group import MotionGroup
from stridecast.model.segment import MOTIONS
from stridecast.synthesis.tables import make_tables

ANY = SteeringBounds(
    jerk=1.0, tangential=((-1.0, 1.0), (-1.0, 1.0)), lateral_per_speed=1.0, speed=((0.0, 1.0), (0.0, 1.0))
)
STAND, WALK, RUN = (MOTIONS.index(motion) for motion in ("stand", "walk", "run"))


def group(name: str, start: str, stop: str) -> MotionGroup:
    motion, _, string = name.partition("/")
    return MotionGroup(
        name=name,
        motion=motion,
        string=string,
        start=start,
        stop=stop,
        keys=tuple(np.linspace(0, 1, len(string) + 1)[1:-1].tolist()),
        first=0,
        count=1,
        bounds=ANY,
    )


STANDING = [group("stand/S", "S", "S")]
WALKING = [group("walk/LDR", "L", "R"), group("walk/RDL", "R", "L")]
RUNNING = [group("run/FLF", "FL", "FR"), group("run/FRF", "FR", "FL")]
STARTING = [group("stand-walk/SL", "S", "L"), group("stand-walk/SR", "S", "R")]
STOPPING = [group("walk-stand/LS", "L", "S"), group("walk-stand/RS", "R", "S")]
SPEEDING = [group("walk-run/LF", "L", "FR"), group("walk-run/RF", "R", "FL")]
SLOWING = [group("run-walk/FL", "FL", "L"), group("run-walk/FR", "FR", "R")]
EVERYTHING = STANDING + WALKING + RUNNING + STARTING + STOPPING + SPEEDING + SLOWING


def names_after(groups: list[MotionGroup], name: str) -> set[str]:
    graph = connect(groups)
    row = [g.name for g in groups].index(name)
    return {g.name for g, follows in zip(groups, graph.follows[row], strict=True) if follows}


# what follows what


def test_left_and_right_halves_alternate():
    assert names_after(WALKING, "walk/LDR") == {"walk/RDL"}
    assert names_after(WALKING, "walk/RDL") == {"walk/LDR"}
    assert names_after(RUNNING, "run/FLF") == {"run/FRF"}
    assert names_after(RUNNING, "run/FRF") == {"run/FLF"}


def test_standing_goes_on_or_starts_with_either_foot():
    assert names_after(EVERYTHING, "stand/S") == {"stand/S", "stand-walk/SL", "stand-walk/SR"}


def test_a_step_goes_on_speeds_up_or_stops_on_the_foot_it_ends_on():
    assert names_after(EVERYTHING, "walk/LDR") == {"walk/RDL", "walk-stand/RS", "walk-run/RF"}


def test_a_transition_under_way_goes_on_arrives_or_is_left_where_it_has_come_to_walking():
    longer = [
        *EVERYTHING,
        group("stand-run/SL", "S", "L"),
        group("stand-run/LDR", "L", "R"),
        group("stand-run/RF", "R", "FL"),
    ]
    assert names_after(longer, "stand-run/SL") == {"stand-run/LDR", "walk/LDR", "walk-stand/LS", "walk-run/LF"}
    assert names_after(longer, "stand-run/RF") == {"run/FLF", "run-walk/FL"}
    assert "stand-run/LDR" not in names_after(longer, "walk/RDL"), "nobody enters it in the middle"


def test_boundaries_of_followers_are_the_same(learned):
    graph = connect(learned.groups)
    for a, b in np.argwhere(graph.follows):
        assert learned.groups[a].stop == learned.groups[b].start


def test_exchanging_the_feet_exchanges_the_graph(learned):
    names = [g.name for g in learned.groups]
    other = [names.index(swapped(name)) for name in names]
    graph = connect(learned.groups)
    np.testing.assert_array_equal(graph.follows, graph.follows[np.ix_(other, other)])
    np.testing.assert_array_equal(graph.steps, graph.steps[other])


# how far it is


def test_steps_count_segments_to_the_nearest_of_a_motion():
    graph = connect(EVERYTHING)
    steps = {g.name: graph.steps[i].tolist() for i, g in enumerate(EVERYTHING)}
    assert steps["stand/S"] == [0, 2, 3]
    assert steps["walk/LDR"] == [2, 0, 2]
    assert steps["run/FLF"] == [3, 2, 0]
    assert steps["walk-stand/LS"][STAND] == 1


def test_steps_are_one_more_than_those_of_the_best_follower(learned):
    """Oracle: what a shortest way is."""
    graph = connect(learned.groups)
    for row, g in enumerate(learned.groups):
        for m, motion in enumerate(MOTIONS):
            after = graph.steps[graph.follows[row], m]
            if g.motion == motion:
                assert graph.steps[row, m] == 0
            else:
                assert graph.steps[row, m] == 1 + after.min()


def test_every_motion_is_reached_from_everywhere(learned):
    assert (connect(learned.groups).steps < UNREACHABLE).all()
    assert made_up(learned.groups) == []


def test_following_the_shortest_way_arrives(learned):
    graph = connect(learned.groups)
    for start in range(len(learned.groups)):
        for m in range(len(MOTIONS)):
            at, way = start, [start]
            while graph.steps[at, m] > 0:
                after = np.flatnonzero(graph.follows[at])
                at = int(after[np.argmin(graph.steps[after, m])])
                way.append(at)
            assert len(way) == graph.steps[start, m] + 1
            assert all(can_follow(learned.groups[a], learned.groups[b]) for a, b in pairwise(way))


# what is missing


@pytest.mark.parametrize(
    ("groups", "missing"),
    [
        (EVERYTHING, []),
        (WALKING, []),
        (STANDING + WALKING, ["stand-walk", "walk-stand"]),
        (STANDING + WALKING + STARTING, ["walk-stand"]),
        (WALKING + RUNNING + SPEEDING, ["run-walk"]),
        (STANDING + WALKING + RUNNING + STARTING + STOPPING + SPEEDING, ["run-stand", "run-walk"]),
    ],
)
def test_transitions_without_an_example_are_named(groups, missing):
    assert made_up(groups) == missing


def test_unreachable_motions_are_marked_so():
    graph = connect(STANDING + WALKING)
    assert graph.steps[0, WALK] == UNREACHABLE
    assert graph.steps[1, STAND] == UNREACHABLE
    assert (graph.steps[:, RUN] == UNREACHABLE).all()


def test_groups_that_may_not_be_used_are_cut_off():
    usable = np.array([g.motion not in ("walk-run", "run") for g in EVERYTHING])
    graph = connect(EVERYTHING, usable)
    assert not graph.follows[:, ~usable].any()
    assert (graph.steps[usable, RUN] == UNREACHABLE).all()
    assert (graph.steps[usable, STAND] < UNREACHABLE).all()


def test_six_recordings_hold_every_transition(small_database):
    assert made_up(small_database.groups) == []
    assert (connect(small_database.groups).steps < UNREACHABLE).all()


# one person of many


@pytest.fixture(scope="module")
def two_people():
    motions = formula_motions()
    chosen = {name: motions[name] for name in ("stand and walk", "walk and run")}
    return assemble(analysed(chosen), takes_of(chosen, ["walker", "runner"]))


def test_a_walker_keeps_to_the_examples_of_one_person(two_people):
    tables = make_tables(two_people, "walker")
    whose = np.array([take.subject for take in two_people.takes])[two_people.examples.takes]
    np.testing.assert_array_equal(tables.allowed, whose == "walker")
    assert make_tables(two_people).allowed.all()


def test_what_a_person_never_did_is_out_of_reach(two_people):
    assert (make_tables(two_people).steps[:, RUN] < UNREACHABLE).any()
    steps = make_tables(two_people, "walker").steps
    own = [g.motion in ("stand", "walk", "stand-walk", "walk-stand") for g in two_people.groups]
    assert (steps[:, RUN] == UNREACHABLE).all()
    assert (steps[own][:, [STAND, WALK]] < UNREACHABLE).all()


def test_an_unknown_person_is_refused_with_those_there_are(two_people):
    with pytest.raises(DatabaseError, match=r"nobody.*runner, walker"):
        make_tables(two_people, "nobody")
