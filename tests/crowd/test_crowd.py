"""Crowds in scenes, without bodies: situations of the literature with few people, who comes and leaves, and why."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import stridecast as sc
from crowds import Walked, beyond, overlap
from stridecast.crowd.bounds import HumanBounds
from stridecast.crowd.crowd import Crowd
from stridecast.crowd.frame import CrowdFrame
from stridecast.crowd.rules import RULES
from stridecast.errors import InputError, PathError, SceneError
from stridecast.model.database import MotionDatabase
from stridecast.model.people import Mover, Person, Route, Source, Spread, Wall
from stridecast.model.scene import Behavior, Preference, Scene
from stridecast.samples.situations import situation

FEW = {
    "head_on": {},
    "overtaking": {},
    "crossing": {},
    "four_way": {"people": 2},
    "antipodal": {"people": 8, "radius": 5.0},
    "two_way": {"density": 0.12},
    "bottleneck": {"people": 8},
    "corner": {"people": 5},
    "ring": {"density": 0.1, "laps": 1},
}
"""Situations with so few people that a test is short."""


@pytest.fixture(scope="module")
def database() -> MotionDatabase:
    return sc.sample_database()


def frames(crowd: Crowd, seconds: float) -> list[CrowdFrame]:
    """What is to be seen until everybody has left."""
    out = [crowd.frame()]
    while not crowd.done and len(out) <= seconds * crowd.frame_rate:
        out.append(crowd.step())
    return out


def table(crowd: Crowd, shown: list[CrowdFrame], values: str = "positions") -> np.ndarray:
    """Something of everybody who came, by number, frame by frame; NaN where they are not there."""
    first = getattr(shown[0], values)
    out = np.full((len(shown), len(crowd.came), *first.shape[1:]), np.nan)
    for k, frame in enumerate(shown):
        out[k, frame.ids - 1] = getattr(frame, values)
    return out


def walked(crowd: Crowd, shown: list[CrowdFrame]) -> Walked:
    behaviors = [person.behavior for person in crowd.came]
    return Walked(
        crowd.frame_rate,
        *(table(crowd, shown, name) for name in ("positions", "velocities", "headings", "rules")),
        np.zeros(0),
        np.zeros(0),
        np.array([b.body_radius for b in behaviors]),
        np.array([b.status == "run" for b in behaviors]),
    )


def by_name(crowd: Crowd, shown: list[CrowdFrame]) -> dict[str, np.ndarray]:
    places = np.concatenate((table(crowd, shown), table(crowd, shown, "velocities")), axis=-1)
    return {person.name: places[:, k] for k, person in enumerate(crowd.came)}


def crowd_of(database: MotionDatabase, *people: Person, **given: object) -> Crowd:
    scene_words = {name: given.pop(name) for name in ("walls", "sources", "movers", "obstacles") if name in given}
    return Crowd(database, Scene(people=people, **scene_words), bodies=False, **given)  # type: ignore[arg-type]


def person(name: str, start: tuple[float, float], *stops: tuple[float, float], **given: object) -> Person:
    words = {"side", "distance", "patience"} & set(given)
    liked = Preference(**{word: given.pop(word) for word in words})  # type: ignore[arg-type]
    how = {word: given.pop(word) for word in ("velocity", "status", "body_radius") if word in given}
    behavior = Behavior(**{"body_radius": 0.25, **how}, preference=liked)  # type: ignore[arg-type]
    return Person(
        name=name,
        start=np.array(start, float),
        stops=tuple(np.array([stop], float) for stop in stops),
        behavior=behavior,
        **given,  # type: ignore[arg-type]
    )


def point_source(name: str = "door", **given: object) -> Source:
    usual = {
        "area": np.array([(0.0, 0.0)]),
        "routes": (Route(stops=(np.array([(0.0, 9.0)]),)),),
        "flow": 2.0,
        "body_radius": Spread(mean=0.25),
    }
    return Source(name=name, **(usual | given))  # type: ignore[arg-type]


class TestSituations:
    @pytest.mark.parametrize("rate", [20.0, 30.0, 60.0])
    @pytest.mark.parametrize("name", FEW)
    def test_nobody_touches_anything_and_all_move_as_a_body_can(self, database, name, rate):
        scene = situation(name, 3, **FEW[name])
        crowd = Crowd(database, scene, bodies=False, frame_rate=rate)
        did = walked(crowd, frames(crowd, 8.0))
        assert overlap(did) <= 1e-9
        for wall in scene.walls:
            for a, b in pairwise(wall.points):
                u = np.clip((did.position - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
                away = np.linalg.norm(did.position - a - u[..., None] * (b - a), axis=-1)
                assert np.nanmin(away - did.radius) >= -1e-9
        excess = {kind: by for kind, by in beyond(did, HumanBounds.of(database)).items() if by > 1e-6}
        assert not excess
        assert np.nanmax(np.linalg.norm(did.velocity, axis=-1)) > 0.5

    @pytest.mark.parametrize("seed", range(3))
    @pytest.mark.parametrize("name", ["head_on", "overtaking", "crossing", "corner"])
    def test_everybody_arrives(self, database, name, seed):
        scene = situation(name, seed, **FEW[name])
        crowd = Crowd(database, scene, bodies=False)
        shown = frames(crowd, scene.seconds or 60.0)
        assert crowd.done
        assert sorted(number for number, _ in crowd.left) == list(range(1, len(crowd.came) + 1))
        places = table(crowd, shown)
        for number, time in crowd.left:
            came = crowd.person(number)
            last = places[round(time * crowd.frame_rate), number - 1]
            assert np.linalg.norm(last - came.stops[-1][0]) < 0.8
            assert np.isnan(places[round(time * crowd.frame_rate) + 1 :, number - 1]).all()


class TestOrder:
    """Who is first in the scene, threads and far strangers decide nothing, and neither does chance twice."""

    def people(self) -> list[Person]:
        scene = situation("antipodal", 2, people=8, radius=4.0)
        return [*scene.people, person("runner", (-9.0, 0.3), (9.0, 0.0), velocity=3.5, status="run")]

    def test_the_order_of_people_decides_nothing(self, database):
        people = self.people()
        one, other = crowd_of(database, *people), crowd_of(database, *people[::-1])
        a, b = by_name(one, frames(one, 9.0)), by_name(other, frames(other, 9.0))
        assert set(a) == set(b)
        for name in a:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)

    def test_somebody_far_away_decides_nothing(self, database):
        people = self.people()
        one = crowd_of(database, *people)
        other = crowd_of(database, person("stranger", (200.0, 0.0), (220.0, 0.0)), *people)
        a, b = by_name(one, frames(one, 9.0)), by_name(other, frames(other, 9.0))
        for name in a:
            both = min(len(a[name]), len(b[name]))
            np.testing.assert_array_equal(a[name][:both], b[name][:both], err_msg=name)

    def test_same_seed_same_bits_other_seed_other_people_and_threads_decide_nothing(self, database):
        def run(seed: int, threads: int = 1) -> np.ndarray:
            crowd = crowd_of(
                database,
                sources=(point_source(flow=1.0, velocity=Spread(mean=1.3, deviation=0.2)),),
                seed=seed,
                threads=threads,
            )
            return table(crowd, [crowd.frame(), *(crowd.step() for _ in range(240))])

        np.testing.assert_array_equal(run(4), run(4))
        np.testing.assert_array_equal(run(4), run(4, threads=2))
        one, other = run(4), run(5)
        assert one.shape != other.shape or not np.array_equal(one, other, equal_nan=True)


class TestComingAndLeaving:
    def test_a_blocked_source_holds_people_back_and_lets_them_in_later(self, database):
        blocker = person("blocker", (0.0, 0.3), (9.0, 0.3), begins=0.0, velocity=0.15)
        crowd = crowd_of(database, blocker, sources=(point_source(most=3, flow=8.0),))
        waited = 0
        for _ in range(30):
            crowd.step()
            waited = max(waited, crowd.waiting)
        assert [p.name for p in crowd.came] == ["blocker"]
        assert waited > 0
        shown = [crowd.step() for _ in range(30 * 25)]
        assert crowd.waiting == 0
        assert [p.name for p in crowd.came] == ["blocker", "door 1", "door 2", "door 3"]
        for frame in shown:
            away = np.linalg.norm(frame.positions[:, None] - frame.positions[None], axis=-1)
            assert (away + 9 * np.eye(len(away))).min() >= 0.5 - 1e-9

    def test_people_come_when_they_begin(self, database):
        crowd = crowd_of(database, person("late", (0.0, 0.0), (0.0, 5.0), begins=1.0), person("idle", (5.0, 0.0)))
        assert not crowd.done
        seen = [frame.ids.tolist() for frame in frames(crowd, 2.0)]
        assert seen[0] == [1]
        assert seen[-1] == [1, 2]
        assert 29 <= next(k for k, ids in enumerate(seen) if 2 in ids) <= 31

    def test_who_stays_stands_at_the_end(self, database):
        crowd = crowd_of(database, person("guest", (0.0, 0.0), (0.0, 4.0), stays=True))
        for _ in range(300):
            frame = crowd.step()
        assert crowd.done  # nobody is left to come or to leave
        assert crowd.left == []
        assert np.linalg.norm(frame.positions[0] - (0.0, 4.0)) < 0.2
        np.testing.assert_array_equal(frame.velocities, 0.0)
        assert RULES[frame.rules[0]] == "stand"

    def test_a_group_walks_together(self, database):
        members = [
            person(f"friend {k}", (0.75 * k - 0.75, 0.0), (0.0, 16.0), together="friends", velocity=1.1 + 0.2 * k)
            for k in range(3)
        ]
        crowd = crowd_of(database, *members, person("other", (0.0, 14.0), (0.0, 0.0)))
        did = walked(crowd, frames(crowd, 12.0))
        walking = np.linalg.norm(did.velocity[:, :3], axis=-1).min(axis=-1) > 0.3
        neighbours = np.linalg.norm(np.diff(did.position[:, :3], axis=1), axis=-1)[walking]
        assert walking.sum() > 150
        assert np.nanmedian(neighbours) < 1.5
        assert overlap(did) <= 1e-9

    def test_groups_come_in_motion_without_touching_each_other(self, database):
        area = np.array([(-6.0, 0.0), (6.0, 0.0), (6.0, 3.0), (-6.0, 3.0)])
        gate = Route(stops=(np.array([(-6.0, 20.0), (6.0, 20.0)]),))
        friends = Source(name="friends", area=area, routes=(gate,), flow=1.5, most=9, together=(0.0, 1.0, 1.0, 1.0))
        crowd = crowd_of(database, sources=(friends,), seed=1)
        shown = [crowd.step() for _ in range(300)]
        assert len(crowd.came) == 9
        assert overlap(walked(crowd, shown)) <= 1e-9

    def test_a_mover_waits_for_people_and_runs_over_nobody(self, database):
        cart = Mover(name="cart", radius=0.4, times=np.array([0.0, 6.0]), points=np.array([(-4.0, 0.0), (8.0, 0.0)]))
        people = [
            person("idle", (1.0, 0.2)),
            *(person(f"p{k}", (0.9 * k - 3, -5.0), (0.9 * k - 3, 5.0)) for k in range(4)),
        ]
        crowd = crowd_of(database, *people, movers=(cart,))
        for _ in range(300):
            frame = crowd.step()
            away = np.linalg.norm(frame.positions - frame.movers[0], axis=-1)
            assert away.min() >= 0.65 - 1e-9
        assert frame.movers[0, 0] < 1.0
        assert crowd.explain("idle").rule == "stand"


class TestExplaining:
    def test_it_names_who_and_which_rule(self, database):
        crowd = crowd_of(
            database,
            person("Ada", (0.0, 0.0), (0.0, 14.0), side="left"),
            person("Ben", (0.0, 12.0), (0.0, -2.0), side="left"),
            person("Eve", (30.0, 0.0)),
        )
        told = []
        for _ in range(240):
            frame = crowd.step()
            for number in frame.ids.tolist():
                said = crowd.explain(number)
                assert said.rule == RULES[frame.rules[frame.ids == number][0]]
                assert said.person == crowd.person(number).name
                assert (said.other is None) == np.isinf(said.contact_in)
                told.append(said)
        about = {(said.person, said.rule, said.other) for said in told}
        yields = next(said.person for said in told if said.rule == "pass head-on")
        other = {"Ada": "Ben", "Ben": "Ada"}[yields]
        assert (yields, "pass head-on", other) in about
        assert (other, "go on", yields) in about
        assert {rule for who, rule, _ in about if who == "Eve"} == {"stand"}
        passing = next(said for said in told if said.rule == "pass head-on")
        assert passing.side == "left"
        assert other in str(passing)
        assert "passing on the left" in passing.why

    def test_who_has_left_is_no_obstacle_that_moves(self, database):
        crowd = crowd_of(
            database,
            person("Ada", (0.0, 0.0), (0.0, 4.5), velocity=1.3),
            person("Ben", (0.0, 11.0), (0.0, -3.0), velocity=1.3),
            frame_rate=60.0,
        )
        met = False
        while not crowd.done:
            crowd.step()
            if 2 in crowd.frame().ids:
                said = crowd.explain("Ben")
                met = met or said.other == "Ada"
                assert said.other in ("Ada", None)
        assert met


class TestRefusals:
    def test_people_who_start_in_each_other(self, database):
        with pytest.raises(SceneError, match="'a' and 'b' start in the same place"):
            crowd_of(database, person("a", (0.0, 0.0)), person("b", (0.3, 0.0)))

    def test_somebody_in_a_wall(self, database):
        with pytest.raises(SceneError, match="person 'a'"):
            crowd_of(
                database, person("a", (0.1, 0.0)), walls=(Wall(name="w", points=np.array([(0.0, -1.0), (0.0, 1.0)])),)
            )

    def test_a_goal_that_nobody_can_reach(self, database):
        room = Wall(name="room", points=np.array([(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -2)], float))
        with pytest.raises(PathError, match="person 'prisoner'"):
            crowd_of(
                database,
                person("free", (9.0, 0.0), (12.0, 0.0)),
                person("prisoner", (0.0, 0.0), (8.0, 0.0)),
                walls=(room,),
            )

    def test_nobody(self, database):
        with pytest.raises(SceneError, match="nobody is there"):
            crowd_of(database)

    def test_places_that_are_no_places(self):
        with pytest.raises(SceneError, match="person 'a'"):
            person("a", (float("nan"), 0.0))

    @pytest.mark.parametrize("lod", [(5.0, 1.0), (-1.0, 5.0), (float("nan"), 5.0)])
    def test_distances_that_do_not_rise(self, database, lod):
        with pytest.raises(InputError, match="lod needs two distances"):
            crowd_of(database, person("a", (0.0, 0.0)), lod=lod)

    @pytest.mark.parametrize("rate", [0.0, 5.0, 1000.0, float("nan"), float("inf")])
    def test_frame_rates_nobody_could_walk_at(self, database, rate):
        with pytest.raises((InputError, SceneError), match="frame rate"):
            crowd_of(database, person("a", (0.0, 0.0)), frame_rate=rate)

    def test_questions_about_nobody_change_nothing(self, database):
        people = [person("a", (0.0, 0.0), (0.0, 9.0)), person("b", (0.1, 8.0), (0.0, 0.0))]
        one, other = crowd_of(database, *people), crowd_of(database, *people)
        for _ in range(60):
            with pytest.raises(InputError, match="nobody called 'c' is there"):
                one.explain("c")
            with pytest.raises(InputError, match="number 7 is not there"):
                one.explain(7)
            with pytest.raises(InputError, match="nobody has the number 3; 2 have come so far"):
                one.person(3)
            a, b = one.step(), other.step()
            np.testing.assert_array_equal(a.positions, b.positions)
            np.testing.assert_array_equal(a.rules, b.rules)

    def test_a_source_without_a_way_out_is_told_at_once(self, database):
        room = Wall(name="room", points=np.array([(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -2)], float))
        free = person("free", (12.0, 0.0), (12.0, 30.0))
        with pytest.raises(PathError, match=r"'cell 1'.*'room' is in the way"):
            crowd_of(database, free, sources=(point_source("cell", flow=0.05, most=4),), walls=(room,))

    def test_who_has_no_way_stays_out_and_everybody_else_goes_on(self, database, caplog):
        room = Wall(name="room", points=np.array([(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -2)], float))
        late = person("late", (0.0, 0.0), (9.0, 5.0), begins=2.0)
        free = person("free", (12.0, 0.0), (12.0, 30.0))
        crowd, alone = (crowd_of(database, *who, walls=(room,)) for who in ((late, free), (free,)))
        for _ in range(150):
            a, b = crowd.step(), alone.step()
            np.testing.assert_array_equal(a.positions, b.positions)
        assert [p.name for p in crowd.came] == ["free"]
        assert [p.name for p in crowd.turned_away] == ["late"]
        assert "person 'late'" in caplog.text
