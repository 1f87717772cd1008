"""Scene mode, in this process: every message and frame can be looked at, and time runs as fast as it can."""

from __future__ import annotations

import numpy as np
import pytest

from stridecast.crowd.rules import RULES
from stridecast.errors import FileError, InputError
from stridecast.formats.scenes import is_empty, parse_scene, scene_of, scene_text, scene_values
from stridecast.live.frames import decode
from stridecast.live.layout import REPLAYED
from stridecast.live.messages import PlaybackMessage, SceneMessage, ViewMessage
from stridecast.live.scene_play import ScenePlay
from stridecast.live.searching import TOLD, TOLD_FIRST, GivenUp, Gone, Search
from stridecast.live.staging import place_in, read_scene, why_anew

PERIOD = 1 / 30


class Player:
    """A scene, what it said, and what it showed."""

    def __init__(self, database, **options) -> None:
        self.said: list = []
        self.play = ScenePlay(database, self.said.append, room=options.pop("room", 2**26), **options)
        self.frames: list = []

    def scene(self, document, request=0):
        return self.play.check(SceneMessage(type="scene", scene=document, request=request))

    def act(self, action):
        self.play.control(PlaybackMessage(type="playback", action=action))

    def run(self, count):
        for _ in range(count):
            shown = self.play.step(PERIOD, lambda: True)
            if shown is not None:
                self.frames.append(decode(shown))
        return self.frames[-1] if self.frames else None

    def told(self, type):
        return [message for message in self.said if message.type == type]


@pytest.fixture
def player(learned):
    return Player(learned)


def people(count=4, **more):
    return {"people": [{"start": [1.5 * k, 0], "goals": [[1.5 * k, 30]]} for k in range(count)], **more}


# documents


def test_scenes_come_back_from_text_and_from_values():
    document = scene_values(scene_of(people(obstacles=[{"center": [0, 9], "radius": 1}])))
    assert scene_values(parse_scene(scene_text(scene_of(document)))) == document
    assert [p["name"] for p in document["people"]] == ["person 1", "person 2", "person 3", "person 4"]


@pytest.mark.parametrize(
    ("document", "place", "words"),
    [
        ({"people": [{"start": [0, 0], "behavior": {"velocity": 99}}]}, "people[0].behavior.velocity", "at most 12"),
        ({"roads": [{"points": [[0, 0]], "width": 1}]}, "roads[0].points", "at least 2"),
        ({"obstacles": [{"center": [0, 0], "radius": "x"}]}, "obstacles[0].radius", "should be a finite number"),
        ({"walls": [{"points": [[0, 0], [0, 0]]}]}, "walls[0]", "same point twice"),
        ({"fly": 1}, "fly", "is not known here"),
        ({"start": [0, 0]}, "goals", "is missing"),
        ({"people": 3}, "people", "should be a list"),
        ({"people": [{"start": [0, 0]}, {"start": [0, 0.1]}]}, "", "start in the same place"),
    ],
)
def test_what_is_wrong_with_a_scene_is_told_with_its_place(player, document, place, words):
    player.scene(people())
    before = player.play.document
    checked = player.scene(document, request=9)
    assert (checked.applied, checked.request, checked.place) == ("refused", 9, place)
    assert words in checked.message
    assert player.play.document is before


def test_nobody_is_no_mistake_but_a_wrong_road_is(player):
    assert player.scene({"version": 1}).applied == "empty"
    assert is_empty({"roads": [{"points": [[0, 0], [5, 0]], "width": 2}]})
    with pytest.raises(FileError, match="same point twice"):
        is_empty({"roads": [{"points": [[0, 0], [0, 0]], "width": 2}]})
    with pytest.raises(InputError, match="nobody is there yet"):
        player.act("play")
    assert player.run(2).arrays["ids"].size == 0


def test_too_many_people_are_refused():
    source = {"name": "all", "start": [[0, 0], [99, 0], [99, 99], [0, 99]], "at_once": 5000}
    with pytest.raises(InputError, match="5000 people are there at once; 4000 are the most"):
        read_scene({"sources": [source]})
    with pytest.raises(InputError, match="people a second"):
        read_scene({"sources": [{"name": "all", "start": [0, 0], "goals": [[0, 9]], "flow": 200.0}]})


def test_places_are_told_from_words():
    assert place_in("people[2].start: should be a list") == ("people[2].start", "should be a list")
    assert place_in("roads: should be a list") == ("roads", "should be a list")
    assert place_in("person 'a': no way: really") == ("", "person 'a': no way: really")


def test_moving_obstacles_and_the_seed_alone_begin_anew():
    one = people()
    assert why_anew(one, {**one, "obstacles": [{"center": [9, 9], "radius": 1}], "movers": []}) == ""
    assert why_anew(one, people(3)) == ""
    assert why_anew(one, {**one, "seed": 2}) == "the seed cannot change while people walk"
    cart = {"points": [[0, 9], [9, 9]], "radius": 0.5, "times": [0.0, 18.0]}
    assert why_anew(one, {**one, "seed": 2, "movers": [cart]}).startswith("moving obstacles and the seed cannot")


# playing


def test_a_scene_is_shown_before_it_plays(player):
    assert player.scene(people()).applied == "restarted"
    frame = player.run(3)
    assert len(player.frames) == 1  # nothing new, nothing sent
    assert frame.arrays["ids"].tolist() == [1, 2, 3, 4]
    assert frame.arrays["rotations"].shape == (4, player.play.database.skeleton.joints, 3)
    assert np.allclose(frame.arrays["roots"][:, [0, 2]], frame.arrays["places"][:, :2], atol=0.2)
    named = player.told("people")
    assert named[0].begins
    assert [p.name for p in named[0].people] == [f"person {k}" for k in range(1, 5)]


def test_people_walk_and_time_runs_at_the_pace(player):
    player.scene(people())
    player.act("play")
    first = player.run(1).time
    assert player.run(30).time == pytest.approx(first + 1.0)
    player.play.pace = 4.0
    assert player.run(30).time == pytest.approx(first + 5.0)
    player.play.pace = 0.5
    assert player.run(30).time == pytest.approx(first + 5.5)
    assert player.frames[-1].arrays["places"][:, 1].min() > 3.0
    assert player.told("player")[-1].there == 4


def test_who_is_slow_does_not_run_ahead_of_the_time_that_is_left(player):
    player.scene(people(1))
    player.act("play")
    player.play.pace = 8.0
    player.play.step(PERIOD, lambda: False)
    assert player.play.crowd.time == pytest.approx(2 / 30)


def test_pause_step_and_restart(player):
    player.scene(people())
    player.act("play")
    player.run(10)
    player.act("pause")
    there = player.play.time
    count = len(player.frames)
    player.run(5)
    assert len(player.frames) == count + 1  # what was on is shown once more
    player.act("step")
    assert player.run(1).time == pytest.approx(there + PERIOD)
    player.act("restart")
    assert player.run(1).time == pytest.approx(PERIOD)
    assert player.told("people")[-1].begins


def test_the_same_scene_plays_the_same_again(player):
    document = people(obstacles=[{"center": [2, 8], "radius": 1.5}])
    player.scene(document)
    player.act("play")
    once = player.run(60).arrays["places"]
    player.act("restart")
    again = player.run(60).arrays["places"]
    assert np.array_equal(once, again)


def test_what_was_played_is_scrubbed_and_goes_on(player):
    player.scene(people())
    player.act("play")
    player.run(60)
    places = {round(frame.time, 4): frame.arrays["places"] for frame in player.frames}
    player.play.scrub(1.0)
    frame = player.run(1)
    assert frame.flags == REPLAYED
    assert np.array_equal(frame.arrays["places"], places[round(frame.time, 4)])
    assert frame.time == pytest.approx(1.0)
    player.act("play")
    back = player.run(10)
    assert np.array_equal(back.arrays["places"], places[round(back.time, 4)])
    on = player.run(60)
    assert on.flags == 0
    assert on.time > 2.0


def test_the_timeline_has_bounds(learned):
    player = Player(learned, room=40_000)
    player.scene(people())
    player.act("play")
    player.run(120)
    told = player.told("player")[-1]
    assert told.first > 1.0
    assert told.last > 3.0
    player.play.scrub(0.0)
    assert player.run(1).time == pytest.approx(told.first, abs=0.5)


# editing while it plays


def test_an_obstacle_put_in_the_way_is_gone_round(player):
    document = people(1)
    player.scene(document)
    player.act("play")
    player.run(30)
    obstacle = {"name": "tree", "center": [0.0, 8.0], "radius": 1.0}
    checked = player.scene({**document, "obstacles": [obstacle]})
    assert checked.applied == "live"
    before = player.play.time
    player.run(240)
    assert player.play.time > before + 7.9
    tracks = np.array([f.arrays["places"][0, :2] for f in player.frames if len(f.arrays["ids"])])
    assert np.hypot(*(tracks - [0.0, 8.0]).T).min() > 1.29
    assert tracks[-1, 1] > 9.0


def test_an_obstacle_upon_somebody_is_refused_and_nothing_changes(player):
    document = people(2)
    player.scene(document)
    player.act("play")
    here = player.run(30).arrays["places"][0]
    checked = player.scene({**document, "obstacles": [{"center": [float(here[0]), float(here[1])], "radius": 0.5}]})
    assert checked.applied == "refused"
    assert "person 1" in checked.message
    assert player.play.document == document
    assert player.play.playing
    assert player.scene(document).applied == "kept"


def test_somebody_more_appears_and_walks_while_the_others_go_on(player):
    player.scene(people(2))
    player.act("play")
    before = player.run(60)
    assert player.scene(people(3)).applied == "live"
    assert player.play.playing
    frame = player.run(1)
    assert frame.time == pytest.approx(before.time + PERIOD)
    assert frame.arrays["ids"].tolist() == [1, 2, 3]
    assert np.abs(frame.arrays["places"][:2, :2] - before.arrays["places"][:, :2]).max() < 0.1
    assert [p.name for p in player.told("people")[-1].people] == ["person 3"]
    assert not player.told("people")[-1].begins
    moved = player.run(60).arrays["places"][2]
    assert moved[1] > 1.0
    assert player.told("player")[-1].there == 3


def test_who_is_deleted_vanishes_and_counts_as_nobody(player):
    player.scene(people(3))
    player.act("play")
    player.run(30)
    kept = [{"name": f"person {k}", **people(3)["people"][k - 1]} for k in (1, 3)]
    assert player.scene({"people": kept}).applied == "live"
    assert player.run(1).arrays["ids"].tolist() == [1, 3]
    told = player.told("player")[-1]
    assert (told.came, told.there, told.arrived) == (3, 2, 0)
    player.act("restart")
    assert player.run(1).arrays["ids"].tolist() == [1, 2]


def test_whose_goal_is_moved_goes_on_and_whose_start_is_moved_comes_anew(player):
    document = people(2)
    player.scene(document)
    player.act("play")
    before = player.run(60).arrays["places"]
    ann, bob = document["people"]
    run = {"status": "run", "velocity": 2.8}
    checked = player.scene({"people": [{**ann, "goals": [[-9, 9]], "behavior": run}, {**bob, "start": [9, 0]}]})
    assert (checked.applied, checked.anew) == ("live", ["person 2"])
    frame = player.run(1)
    assert frame.arrays["ids"].tolist() == [1, 3]
    assert np.abs(frame.arrays["places"][0, :2] - before[0, :2]).max() < 0.1
    assert np.allclose(frame.arrays["places"][1, :2], (9, 0), atol=0.1)
    again = [p for m in player.told("people") for p in m.people if p.id == 1]
    assert [p.status for p in again] == ["walk", "run"]
    assert player.run(60).arrays["places"][0, 0] < -1.0


def test_moving_obstacles_begin_anew_and_it_is_said_why(player):
    player.scene(people(2))
    player.act("play")
    player.run(30)
    cart = {"name": "cart", "points": [[9, 20], [-9, 20]], "radius": 0.5, "times": [0.0, 18.0]}
    checked = player.scene(people(2, movers=[cart]))
    assert (checked.applied, checked.message) == ("restarted", "moving obstacles cannot change while people walk")
    assert player.play.playing
    assert player.run(2).time < 0.2


def test_the_one_walker_begins_anew_as_often_as_you_like(player):
    player.scene({"start": [0, 0], "goals": [[0, 9]]})
    for _ in range(2):
        player.act("restart")
        assert player.run(1).arrays["ids"].tolist() == [1]


# searching


def test_a_search_is_told_about_once_it_lasts_and_at_its_end():
    now, said = [0.0], []
    search = Search(said.append, lambda: False, lambda: now[0])
    with search:
        for k in range(3):
            search.tell_ways(k, 9)
    assert not said
    with search:
        for k in range(9):
            now[0] += 0.6 * TOLD_FIRST
            search.tell_ways(k, 9)
    assert 0.6 * TOLD_FIRST > TOLD
    assert [(m.done, m.total) for m in said] == [*((k, 9) for k in range(1, 9)), (1, 1)]


def test_a_search_ends_when_it_is_given_up_or_nobody_is_there():
    gone = [False]
    search = Search(lambda _: None, lambda: gone[0])
    search.give_up()  # too early: nothing is searched for
    with search:
        search.tell_ways(0, 1)
        search.give_up()
        with pytest.raises(GivenUp):
            search.tell_ways(0, 1)
    gone[0] = True
    with search, pytest.raises(Gone):
        search.tell_ways(0, 1)


@pytest.mark.parametrize("playing", [False, True])
def test_a_scene_whose_search_is_given_up_leaves_everything_as_it_was(player, playing):
    document = people(2)
    player.scene(document)
    if playing:
        player.act("play")
        player.run(30)
    crowd, time = player.play.crowd, player.play.time
    tell = player.play.search.tell_ways

    def once(done, total):
        player.play.search.give_up()
        tell(done, total)

    player.play.search.tell_ways = once
    checked = player.scene(people(4, obstacles=[{"center": [0, 9], "radius": 1}]), request=5)
    assert (checked.applied, checked.request) == ("cancelled", 5)
    player.act("restart")
    assert player.told("scene_checked")[-1].applied == "cancelled"
    player.play.search.tell_ways = tell
    assert (player.play.crowd, player.play.time, player.play.document) == (crowd, time, document)
    assert player.scene(people(4)).applied == ("live" if playing else "restarted")


# looking


def test_the_nearest_come_with_poses_and_first(player):
    player.scene(people(8))
    player.play.look(ViewMessage(type="view", center=(10.5, 0.0), radius=100.0, full=3))
    frame = player.run(1)
    assert frame.arrays["ids"][:3].tolist() == [8, 7, 6]
    assert sorted(frame.arrays["ids"].tolist()) == list(range(1, 9))
    assert len(frame.arrays["roots"]) == 3
    for full, radius, poses in ((100, 100.0, 8), (0, 100.0, 0), (100, 3.1, 3)):
        player.play.look(ViewMessage(type="view", center=(10.5, 0.0), radius=radius, full=full))
        frame = player.run(1)
        assert len(frame.arrays["roots"]) == poses
        assert sorted(frame.arrays["ids"].tolist()) == list(range(1, 9))


def test_far_bodies_have_poses_from_their_first_frame_on(learned):
    """Bodies that are stepped less often have a pose before their turn comes."""
    player = Player(learned)
    source = {"name": "gate", "start": [[0, 100], [9, 100]], "goals": [[[0, 130], [9, 130]]], "flow": 3.0}
    player.scene({"sources": [source], "people": [{"start": [0, 0]}], "seed": 3})
    player.play.look(ViewMessage(type="view", center=(0.0, 0.0), radius=500.0, full=100))
    player.act("play")
    player.run(90)
    assert len(player.frames[-1].arrays["ids"]) > 3
    for frame in player.frames:
        away = frame.arrays["roots"][:, [0, 2]] - frame.arrays["places"][:, :2]
        assert np.abs(away).max() < 0.5
        assert frame.arrays["roots"][:, 1].min() > 0.6


# explaining


def test_somebody_is_explained(player):
    player.scene({"people": [{"start": [0, 0], "goals": [[0, 20]]}, {"start": [0.2, 20], "goals": [[0.2, 0]]}]})
    player.play.ask(1)
    player.act("play")
    player.run(150)
    told = player.told("explanation")
    assert {m.name for m in told} == {"person 1"}
    assert {m.rule for m in told} <= set(RULES)
    met = [m for m in told if m.other_id == 2]
    assert met
    assert all(m.other == "person 2" and m.why for m in met)
    last = told[-1]
    here = player.frames[-1].arrays["places"][player.frames[-1].arrays["ids"] == 1][0, :2]
    assert np.hypot(*(np.array(last.path[0]) - here)) < 0.6
    assert last.path[-1] == (0.0, 20.0)
    ahead = np.array(last.window)
    assert 0.2 < np.hypot(*(ahead[-1] - ahead[0])) < 3.0  # the room to stop


def test_of_what_is_shown_again_only_the_rule_is_known(player):
    player.scene(people(2))
    player.play.ask(1)
    player.act("play")
    player.run(60)
    player.play.scrub(1.0)
    told = player.told("explanation")[-1]
    assert (told.name, told.gone, told.rule, told.path, told.window) == ("person 1", False, "on the way", [], [])
    player.play.scrub(99.0)
    assert player.told("explanation")[-1].path


def test_who_has_left_is_said_to_be_gone(player):
    player.scene({"people": [{"start": [0, 0], "goals": [[0, 3]]}, {"start": [5, 0]}]})
    player.play.ask(1)
    player.act("play")
    player.run(240)
    assert player.told("explanation")[-1].gone
    assert player.play.asked is None
    player.play.ask(77)
    assert player.told("explanation")[-1].gone
