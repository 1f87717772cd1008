from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stridecast.crowd.population import population, task_of
from stridecast.errors import FileError
from stridecast.formats.scenes import load_scene, save_scene
from stridecast.model import people as model
from stridecast.model.people import Mover, Person, Route, Source, Spread, Wall
from stridecast.model.scene import DISTANCES, PATIENCE, SIDES_OF_WAY, SIZES, Behavior, Preference, Scene
from stridecast.paths.generate import generate_path

SCENES = Path(__file__).resolve().parent.parent.parent / "examples" / "scenes"

CROWD = """
seconds: 60
seed: 7
walls: [{name: fence, points: [[-1, -1], [20, -1]]}]
movers: [{name: cart, radius: 0.5, times: [0, 4], points: [[20, 20], [30, 20]]}]
people:
  - {name: Ann, start: [0, 0], goals: [[8, 6], [[1, 2], [3, 4]]], behavior: {velocity: 1.5}, together: pair,
     stays: true}
  - {name: Ben, start: [1, 0], heading: 1, begins: 2.5, height: 1.8, together: pair, speed: 0.5}
  - {name: several, count: 5, start: [[3, 3], [9, 3], [9, 9]], heading: 2,
     behavior: {size: calm, preference: {side: left}}}
sources:
  - name: west
    start: [[0, 20], [0, 25]]
    routes: [{goals: [[9, 20]], share: 2, stays: true}, {goals: [[9, 9], [[20, 20], [20, 30]]]}]
    flow: 0.5
    at_once: 3
    begins: 1
    ends: 30
    most: 20
    velocity: {mean: 1.34, deviation: 0.26, least: 0.8, most: 1.9}
    height: 1.7
    preference: {side: {left: 1, right: 2}, patience: wait}
    together: [3, 1]
    moving: false
  - {name: east, start: [40, 0], goals: [[0, 0]], stays: true, at_once: 1}
"""


def yaml(folder, content: str):
    path = folder / "scene.yaml"
    path.write_text(content, encoding="utf-8")
    return path


def plain(thing):
    """Whatever it is as something that can be compared."""
    if isinstance(thing, np.ndarray):
        return thing.tolist()
    if isinstance(thing, tuple | list):
        return [plain(part) for part in thing]
    if hasattr(thing, "__dict__"):
        return (type(thing).__name__, {name: plain(value) for name, value in vars(thing).items()})
    return thing


def test_a_crowd_is_read(tmp_path):
    found = load_scene(yaml(tmp_path, CROWD))
    ann = Person(
        name="Ann",
        start=np.zeros(2),
        stops=(np.array([[8.0, 6.0]]), np.array([[1.0, 2.0], [3.0, 4.0]])),
        behavior=Behavior(velocity=1.5),
        together="pair",
        stays=True,
    )
    ben = Person(name="Ben", start=np.array([1.0, 0.0]), heading=1, begins=2.5, height=1.8, together="pair", speed=0.5)
    several = Source(
        name="several",
        area=np.array([[3.0, 3.0], [9.0, 3.0], [9.0, 9.0]]),
        at_once=5,
        size="calm",
        sides=(0.0, 1.0, 0.0),
        moving=False,
        heading=Spread(mean=2),
    )
    west = Source(
        name="west",
        area=np.array([[0.0, 20.0], [0.0, 25.0]]),
        routes=(
            Route(stops=(np.array([[9.0, 20.0]]),), share=2, stays=True),
            Route(stops=(np.array([[9.0, 9.0]]), np.array([[20.0, 20.0], [20.0, 30.0]]))),
        ),
        flow=0.5,
        at_once=3,
        begins=1,
        ends=30,
        most=20,
        velocity=Spread(mean=1.34, deviation=0.26, least=0.8, most=1.9),
        height=Spread(mean=1.7),
        sides=(0.0, 1.0, 2.0),
        patience=(1.0, 0.0),
        together=(3.0, 1.0, 0.0, 0.0),
        moving=False,
    )
    east = Source(
        name="east",
        area=np.array([[40.0, 0.0]]),
        routes=(Route(stops=(np.zeros((1, 2)),), stays=True),),
        at_once=1,
    )
    expected = Scene(
        walls=(Wall(name="fence", points=np.array([[-1.0, -1.0], [20.0, -1.0]])),),
        movers=(
            Mover(name="cart", radius=0.5, times=np.array([0.0, 4.0]), points=np.array([[20.0, 20.0], [30.0, 20.0]])),
        ),
        people=(ann, ben),
        sources=(several, west, east),
        seconds=60,
        seed=7,
    )
    assert plain(found) == plain(expected)


def test_what_is_not_said_is_as_in_the_model(tmp_path):
    found = load_scene(yaml(tmp_path, "people: [{start: [1, 2]}]\nsources: [{start: [5, 6], flow: 1}]\n"))
    ann = Person(name="person 1", start=np.array([1.0, 2.0]))
    source = Source(name="source 1", area=np.array([[5.0, 6.0]]), flow=1)
    assert plain(found) == plain(Scene(people=(ann,), sources=(source,)))


numbers = st.floats(-1e6, 1e6)
names = st.text(min_size=1, max_size=12)
stops = st.lists(st.tuples(numbers, numbers), min_size=1, max_size=5).map(lambda points: np.array(points, float))
shares = st.floats(0, 1e9) | st.just(0.0) | st.just(1.0)


def some_shares(count: int):
    return st.tuples(*[shares] * count).filter(lambda drawn: sum(drawn) > 0)


def spreads(low: float, high: float):
    def made(values, deviation, cut):
        low, mean, high = sorted(values)
        return Spread(mean=mean, deviation=deviation, **({"least": low, "most": high} if cut else {}))

    three = st.tuples(*[st.floats(low, high)] * 3)
    return st.builds(made, three, st.floats(0, 1e3) | st.just(0.0), st.booleans())


behaviors = st.builds(
    Behavior,
    velocity=st.floats(0.1, 12),
    weight=st.floats(20, 300),
    status=st.sampled_from(["walk", "run"]),
    size=st.sampled_from(SIZES),
    style=st.floats(-1, 1),
    body_radius=st.floats(0.05, 2),
    preference=st.builds(
        Preference,
        side=st.sampled_from(SIDES_OF_WAY),
        distance=st.sampled_from(DISTANCES),
        patience=st.sampled_from(PATIENCE),
    ),
)
# what holds tuples is made in the test: beartype picks one of their items by chance, which strategies must not
persons = st.fixed_dictionaries(
    {
        "name": names,
        "start": stops.map(lambda points: points[0]),
        "stops": st.lists(stops, max_size=3).map(tuple),
        "behavior": behaviors,
        "heading": st.none() | st.floats(-100, 100),
        "begins": st.floats(0, 1e5),
        "height": st.none() | st.floats(*model.HEIGHTS),
        "stays": st.booleans(),
        "speed": st.floats(0, 12),
    }
)
routes = st.fixed_dictionaries(
    {
        "stops": st.lists(stops, min_size=1, max_size=3).map(tuple),
        "share": st.floats(0.1, 9),
        "stays": st.booleans(),
    }
)
sources = st.fixed_dictionaries(
    {
        "name": names,
        "area": stops,
        "routes": st.lists(routes, max_size=3),
        "flow": st.floats(0.001, 1000),
        "at_once": st.integers(0, 100),
        "begins": st.floats(0, 10),
        "ends": st.just(np.inf) | st.floats(10, 1e5),
        "most": st.none() | st.integers(100, 1_000_000),
        "velocity": spreads(0.1, 12),
        "weight": spreads(20, 300),
        "style": spreads(-1, 1),
        "height": st.none() | spreads(*model.HEIGHTS),
        "body_radius": spreads(0.05, 2),
        "status": st.sampled_from(["walk", "run"]),
        "size": st.sampled_from(SIZES),
        "sides": some_shares(3),
        "distance": some_shares(2),
        "patience": some_shares(2),
        "together": some_shares(4),
        "moving": st.booleans(),
        "heading": st.none() | spreads(-10, 10),
    }
)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(persons, max_size=3, unique_by=lambda p: p["name"]),
    st.lists(sources, min_size=1, max_size=2, unique_by=lambda s: s["name"]),
    st.none() | st.floats(1e-3, 1e6),
    st.integers(0, 2**32 - 1),
)
def test_what_is_written_is_read_to_the_last_bit(tmp_path_factory, drawn, from_where, seconds, seed):
    taken = {values["name"] for values in from_where}
    people = tuple(Person(**values) for values in drawn if values["name"] not in taken)
    made = tuple(
        Source(**values | {"routes": tuple(Route(**route) for route in values["routes"])}) for values in from_where
    )
    scene = Scene(people=people, sources=made, seconds=seconds, seed=seed)
    path = tmp_path_factory.mktemp("crowd") / "scene.yaml"
    save_scene(path, scene)
    assert plain(load_scene(path)) == plain(scene)


def test_a_whole_scene_is_written_and_read(tmp_path):
    scene = load_scene(yaml(tmp_path, CROWD))
    save_scene(tmp_path / "again.yaml", scene)
    assert plain(load_scene(tmp_path / "again.yaml")) == plain(scene)


@pytest.mark.parametrize(("name", "least", "most"), [("avenue", 7, 7), ("street", 250, 310), ("plaza", 900, 1000)])
def test_the_scenes_of_the_examples_hold_crowds(name, least, most):
    scene = load_scene(SCENES / f"{name}.yaml")
    people = [p for due in population(scene).until(scene.seconds) for p in due.people]
    assert least <= len(people) <= most
    for person in [p for p in people if p.stops][:: max(1, len(people) // 12)]:
        curve = generate_path(task_of(scene, person)).curve
        np.testing.assert_allclose(curve.points[-1], person.stops[-1][0], atol=1e-9)


def test_the_examples_of_the_page_are_scenes(tmp_path):
    page = (SCENES.parent.parent / "docs" / "command.md").read_text(encoding="utf-8")
    walk, crowd = (load_scene(yaml(tmp_path, text)) for text in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL))
    assert walk.has_walker
    people = [p for due in population(crowd).until(crowd.seconds) for p in due.people]
    assert {"Ann", "Ben", "window shoppers 4", "south end 20"} <= {p.name for p in people}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("flow: 0.5", "flow: -1", r"yaml:16: sources\[0\]\.flow: should be at least 0, not -1"),
        ("flow: 0.5", "flow: .nan", r"yaml:16: sources\[0\]\.flow: should be a finite number, not nan"),
        ("flow: 0.5", "flows: 1", r"yaml:16: sources\[0\]\.flows: is not known here; there are name, start, goals"),
        ("at_once: 3", "at_once: 3.5", r"yaml:17: sources\[0\]\.at_once: should be a whole number, not 3.5"),
        ("at_once: 3", "at_once: 30", r"yaml:13: sources\[0\]: source 'west' holds 30 at once, but 20 at most"),
        ("ends: 30", "ends: 0.5", r"yaml:13: sources\[0\]: source 'west' ends at 0.5 s, before it begins at 1 s"),
        ("mean: 1.34", "mean: 30", r"yaml:21: sources\[0\]\.velocity\.mean: should be at most 12, not 30"),
        ("mean: 1.34, ", "", r"yaml:21: sources\[0\]\.velocity\.mean: is missing"),
        ("least: 0.8", "least: 1.5", r"yaml:21: sources\[0\]\.velocity: a spread's mean lies between least 1.5"),
        ("deviation: 0.26", "spread: 1", r"sources\[0\]\.velocity\.spread: .*; there are mean, deviation, least, most"),
        ("height: 1.7", "height: tall", r"yaml:22: sources\[0\]\.height: should be a finite number, not 'tall'"),
        (
            "left: 1, right: 2",
            "left: 0",
            r"yaml:23: sources\[0\]\.preference\.side: shares of none, left, right are all",
        ),
        ("left: 1", "up: 1", r"yaml:23: sources\[0\]\.preference\.side\.up: .*; there are none, left, right$"),
        ("left: 1", "left: -1", r"yaml:23: sources\[0\]\.preference\.side\.left: should be at least 0, not -1"),
        (
            "patience: wait",
            "patience: never",
            r"yaml:23: sources\[0\]\.preference\.patience: should be one of 'wait' or",
        ),
        ("[3, 1]", "[0, 0]", r"sources\[0\]: together of source 'west': shares of 1, 2, 3, 4 are all 0"),
        ("[3, 1]", "[1, 1, 1, 1, 1]", r"yaml:24: sources\[0\]\.together: should hold at most 4, not 5"),
        ("moving: false", "moving: 0", r"yaml:25: sources\[0\]\.moving: should be true or false, not 0"),
        ("share: 2", "share: -2", r"yaml:15: sources\[0\]\.routes\[0\]\.share: should be at least 0, not -2"),
        ("share: 2", "part: 2", r"sources\[0\]\.routes\[0\]\.part: is not known here; there are goals, share, stays$"),
        ("goals: [[9, 20]]", "goals: []", r"yaml:15: sources\[0\]\.routes\[0\]\.goals: should hold at least 1, not 0"),
        ("goals: [[9, 20]]", "goals: [[9, 20, 1]]", r"sources\[0\]\.routes\[0\]\.goals\[0\]: a point is two numbers"),
        ("goals: [[9, 20]]", "goals: [9, 20]", r"sources\[0\]\.routes\[0\]\.goals\[0\]: should be a list, not 9"),
        ("flow: 0.5", "goals: [[1, 1]]", r"yaml:15: sources\[0\]\.routes: a source has goals, for all, or routes"),
        ("flow: 0.5", "stays: true", r"yaml:16: sources\[0\]\.stays: goes with goals; routes have their own"),
        ("stays: true, at_once: 1", "stays: true", r"yaml:26: sources\[1\]: source 'east' needs flow"),
        ("name: east", "name: west", r"yaml:26: sources\[1\]: the name 'west' is taken"),
        ("name: Ann", "name: fence", r"yaml:7: people\[0\]: the name 'fence' is taken"),
        ("times: [0, 4]", "times: [4, 4]", r"yaml:5: movers\[0\]: times of mover 'cart' must rise"),
        ("times: [0, 4]", "times: [4]", r"yaml:5: movers\[0\]: mover 'cart' needs a time for each of its 2 points"),
        ("radius: 0.5", "radius: 0", r"yaml:5: movers\[0\]\.radius: should be greater than 0"),
        ("[20, -1]", "[-1, -1]", r"yaml:4: walls\[0\]: wall 'fence' has the same point twice"),
        ("velocity: 1.5", "velocity: 50", r"yaml:7: people\[0\]\.behavior\.velocity: should be at most 12, not 50"),
        ("begins: 2.5", "begins: -1", r"yaml:9: people\[1\]\.begins: should be at least 0, not -1"),
        ("height: 1.8", "height: 18", r"yaml:9: people\[1\]\.height: should be at most 2.5, not 18"),
        ("together: pair, speed", "speed", "together 'pair' is the word of 1; 2 to 4 people walk together"),
        ("count: 5", "count: 0", r"yaml:10: people\[2\]\.count: should be at least 1, not 0"),
        ("count: 5", "count: 5, speed: 1", r"yaml:10: people\[2\]\.speed: goes with one person at one point"),
        ("count: 5", "count: 5, together: us", r"yaml:10: people\[2\]\.together: goes with one person at one point"),
        ("count: 5", "count: 5, goals: [[1, 1]]", r"yaml:10: people\[2\]\.heading: several who have goals look there"),
        ("seconds: 60", "seconds: 0", r"yaml:2: seconds: should be greater than 0, not 0"),
        ("seed: 7", "seed: -7", r"yaml:3: seed: should be at least 0, not -7"),
        ("seed: 7", "goals: [[1, 1]]", "start: is missing"),
        ("seed: 7", "start: [1, 1]", "goals: is missing"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_what_is_wrong_is_named_with_its_line_and_place(tmp_path, old, new, says):
    assert old in CROWD
    with pytest.raises(FileError, match=says):
        load_scene(yaml(tmp_path, CROWD.replace(old, new, 1)))
