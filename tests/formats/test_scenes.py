from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from places import random_scene
from stridecast.errors import FileError
from stridecast.formats.scenes import load_scene, save_scene, scene_schema
from stridecast.model import scene as model
from stridecast.model.scene import Behavior, Circle, Polygon, Preference, Road, Scene, Station
from stridecast.paths.generate import generate_path

ROOT = Path(__file__).resolve().parent.parent.parent

SHORT = "start: [0, 0]\ngoals: [[8, 6]]\n"

LONG = """
start: [0, 0]
goals: [[8, 6], [1e1, -.5]]
roads: [{name: street, points: [[0, 0], [8, 6]], width: 3}]
obstacles:
  - {name: tree, center: [3, 2], radius: 0.4}
  - name: kiosk
    points: [[5, 1], [6, 1], [6, 2]]
behavior: {velocity: 1.5, weight: 80, status: run, size: lively, style: -0.5, body_radius: 0.25,
           preference: {side: left, distance: far, patience: wait}}
stations: [{near: [4, 3], status: run, velocity: 3.0}, {distance: 7, size: calm}]
"""


@pytest.fixture
def yaml(tmp_path):
    def write(content: str | bytes):
        path = tmp_path / "scene.yaml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def with_circle(circle: Circle) -> Scene:
    return Scene(start=np.zeros(2), goals=np.ones((1, 2)), obstacles=(circle,))


def same(one: Scene, other: Scene) -> None:
    np.testing.assert_array_equal(one.start, other.start)
    np.testing.assert_array_equal(one.goals, other.goals)
    assert one.behavior == other.behavior
    assert one.stations == other.stations
    assert len(one.roads) == len(other.roads)
    assert len(one.obstacles) == len(other.obstacles)
    for a, b in zip((*one.roads, *one.obstacles), (*other.roads, *other.obstacles), strict=True):
        assert type(a) is type(b)
        for name, value in vars(a).items():
            np.testing.assert_array_equal(value, getattr(b, name))


def test_a_scene_is_read(yaml):
    found = load_scene(yaml(LONG))
    expected = Scene(
        start=np.zeros(2),
        goals=np.array([[8.0, 6.0], [10.0, -0.5]]),
        roads=(Road(name="street", points=np.array([[0.0, 0.0], [8.0, 6.0]]), width=3.0),),
        obstacles=(
            Circle(name="tree", center=np.array([3.0, 2.0]), radius=0.4),
            Polygon(name="kiosk", points=np.array([[5.0, 1.0], [6.0, 1.0], [6.0, 2.0]])),
        ),
        behavior=Behavior(
            velocity=1.5,
            weight=80.0,
            status="run",
            size="lively",
            style=-0.5,
            body_radius=0.25,
            preference=Preference(side="left", distance="far", patience="wait"),
        ),
        stations=(Station(near=(4.0, 3.0), status="run", velocity=3.0), Station(distance=7.0, size="calm")),
    )
    same(found, expected)


def test_start_and_goals_are_enough(yaml):
    found = load_scene(yaml(SHORT))
    same(found, Scene(start=np.zeros(2), goals=np.array([[8.0, 6.0]])))


def test_what_has_no_name_is_called_by_its_place(yaml):
    found = load_scene(yaml(SHORT + "obstacles: [{center: [3, 2], radius: 1}, {points: [[4, 1], [5, 1], [5, 2]]}]\n"))
    assert [o.name for o in found.obstacles] == ["obstacle 1", "obstacle 2"]


def test_every_word_of_the_model_is_known_and_no_other(yaml):
    words = {
        "side": model.SIDES_OF_WAY,
        "distance": model.DISTANCES,
        "patience": model.PATIENCE,
    }
    for key, known in words.items():
        for word in known:
            found = load_scene(yaml(SHORT + f"behavior: {{preference: {{{key}: {word}}}}}\n"))
            assert getattr(found.behavior.preference, key) == word
    for word in model.SIZES:
        assert load_scene(yaml(SHORT + f"behavior: {{size: {word}}}\n")).behavior.size == word
    assert load_scene(yaml(SHORT)).behavior == Behavior()


@pytest.mark.parametrize("seed", range(40))
def test_what_is_written_is_read_to_the_last_bit(tmp_path, seed):
    scene = random_scene(seed)
    save_scene(tmp_path / "scene.yaml", scene)
    same(load_scene(tmp_path / "scene.yaml"), scene)


@given(st.text(min_size=1, max_size=20))
def test_any_name_is_kept(tmp_path_factory, name):
    path = tmp_path_factory.mktemp("names") / "scene.yaml"
    scene = with_circle(Circle(name=name, center=np.full(2, 9.0), radius=1.0))
    save_scene(path, scene)
    assert load_scene(path).obstacles[0].name == name


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=2), st.floats(1e-9, 1e6))
def test_numbers_are_kept_to_the_last_bit(tmp_path_factory, center, radius):
    path = tmp_path_factory.mktemp("numbers") / "scene.yaml"
    scene = with_circle(Circle(name="a", center=np.array(center), radius=radius))
    save_scene(path, scene)
    same(load_scene(path), scene)


def test_a_scene_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "scene.yaml"
    path.write_text(SHORT)
    with pytest.raises(FileError, match="cannot be written"):
        save_scene(tmp_path / "nowhere" / "scene.yaml", load_scene(path))
    assert path.read_text() == SHORT


@pytest.mark.parametrize("name", ["road", "square"])
def test_the_walkers_scenes_of_the_examples_have_ways(name):
    path = generate_path(load_scene(ROOT / "examples" / "scenes" / f"{name}.yaml"))
    assert path.inserted
    assert np.abs(path.curve.curvatures).max() < 3


def test_the_published_schema_is_that_of_the_reader():
    published = json.loads((ROOT / "docs" / "scene.schema.json").read_text(encoding="utf-8"))
    assert published == scene_schema(), "write json.dumps(scene_schema(), indent=2) to docs/scene.schema.json"


OBSTACLE = SHORT + "obstacles:\n  - {name: tree, center: [3, 2], radius: 0.4}\n  - "


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "is empty"),
        ("[1, 2]", "is no scene: it should name start and goals"),
        ("start: [0, 0]\n", r"yaml: goals: is missing"),
        (SHORT + "wind: 3\n", r"yaml:3: wind: is not known here; there are version, start, goals, roads"),
        (SHORT + "version: 2\n", r"yaml:3: version: should be one of 1, not 2"),
        ("start: [0, zero]\ngoals: [[8, 6]]\n", r"yaml:1: start\[1\]: should be a finite number, not 'zero'"),
        ("start: [0, '1']\ngoals: [[8, 6]]\n", r"yaml:1: start\[1\]: should be a finite number, not '1'"),
        ("start: [0, true]\ngoals: [[8, 6]]\n", r"start\[1\]: should be a finite number, not True"),
        ("start: [0, .nan]\ngoals: [[8, 6]]\n", r"start\[1\]: should be a finite number, not nan"),
        ("start: [0, nan]\ngoals: [[8, 6]]\n", r"start\[1\]: should be a finite number, not "),
        ("start: [0, -.inf]\ngoals: [[8, 6]]\n", r"start\[1\]: should be a finite number, not -inf"),
        ("start: [0, 1e400]\ngoals: [[8, 6]]\n", r"start\[1\]: should be a finite number, not inf"),
        ("start: [0, 2e6]\ngoals: [[8, 6]]\n", r"start\[1\]: should be at most 1e\+06"),
        ("start: [0, 0, 0]\ngoals: [[8, 6]]\n", r"start: a point is two numbers \(x, z\)"),
        ("start: [0]\ngoals: [[8, 6]]\n", r"start\[1\]: the second number of the point \(x, z\) is missing"),
        ("start: 0\ngoals: [[8, 6]]\n", "start: should be a list, not 0"),
        ("start: [0, 0]\ngoals: []\n", "goals: should hold at least 1, not 0"),
        ("start: [0, 0]\ngoals: [8, 6]\n", r"goals\[0\]: should be a list, not 8 \(1 more mistake\)"),
        (
            OBSTACLE + "{name: bin, center: [1, 1], radius: 0}\n",
            r"yaml:5: obstacles\[1\]\.radius: should be greater than 0, not 0",
        ),
        (OBSTACLE + "{name: bin, center: [1, 1], radius: -1}\n", r"yaml:5: obstacles\[1\]\.radius: .*, not -1"),
        (OBSTACLE + "{name: bin, center: [1, 1]}\n", r"yaml:5: obstacles\[1\]\.radius: is missing"),
        (
            OBSTACLE + "{name: bin, center: [1, 1], radius: 1, colour: red}\n",
            r"obstacles\[1\]\.colour: is not known here; there are name, center, radius$",
        ),
        (
            OBSTACLE + "{name: bin, points: [[1, 1], [2, 1]]}\n",
            r"yaml:5: obstacles\[1\]\.points: should hold at least 3, not 2",
        ),
        (
            OBSTACLE + "{name: bin, points: [[1, 1], [2, 1], [2, 2]], radius: 1}\n",
            r"obstacles\[1\]\.radius: is not known here; there are name, points$",
        ),
        (OBSTACLE + "tree\n", r"yaml:5: obstacles\[1\]: "),
        (OBSTACLE + "{name: tree, center: [1, 1], radius: 1}\n", r"yaml:5: obstacles\[1\]: the name 'tree' is taken"),
        (
            SHORT + "roads: [{points: [[0, 0], [1, 1]], width: 0}]\n",
            r"yaml:3: roads\[0\]\.width: should be greater than 0",
        ),
        (SHORT + "roads: [{points: [[0, 0]], width: 1}]\n", r"roads\[0\]\.points: should hold at least 2, not 1"),
        (
            SHORT + "roads: [{points: [[0, 0], [0, 0]], width: 1}]\n",
            r"roads\[0\]: road 'road 1' has the same point twice in a row",
        ),
        (SHORT + "behavior: {velocity: 40}\n", r"yaml:3: behavior\.velocity: should be at most 12, not 40"),
        (SHORT + "behavior: {weight: 5}\n", r"behavior\.weight: should be at least 20, not 5"),
        (SHORT + "behavior: {status: fly}\n", r"behavior\.status: should be one of 'walk' or 'run', not 'fly'"),
        (
            SHORT + "behavior:\n  preference: {side: up}\n",
            r"yaml:4: behavior\.preference\.side: should be one of 'none', 'left' or 'right'",
        ),
        (SHORT + "behavior: [1]\n", "behavior: should hold keys, as 'name: value', not a list"),
        (SHORT + "stations: [{status: run}]\n", r"yaml:3: stations\[0\]: a station needs either near"),
        (SHORT + "stations: [{near: [1, 1], distance: 3}]\n", r"stations\[0\]: a station needs either near"),
        (SHORT + "start: [1, 1]\n", r"yaml:3: start stands here a second time; the first is in line 1"),
        (SHORT + "behavior: {style: 0, style: 1}\n", r"yaml:3: behavior\.style stands here a second time"),
        ("start: [0, 0\ngoals: [[8, 6]]\n", r"yaml:\d: is no YAML"),
        ("start:\t[0, 0]\n\tgoals: 1", r"yaml:\d: is no YAML"),
        (SHORT + "---\n" + SHORT, r"yaml:3: holds a second document"),
        ("start: &a [0, 0]\ngoals: [*a]\n", r"yaml:1: anchors and aliases .* are not taken"),
        (
            "start: !!python/tuple [0, 0]\ngoals: [[8, 6]]\n",
            "yaml:1: tags such as 'tag:yaml.org,2002:python/tuple' are not taken",
        ),
        ("start: !!python/object/apply:os.system [echo]\n", "tags such as"),
        ("? [1, 2]\n: 3\n", "a key must be a name"),
        ("start: " + "[" * 100_000, "deeper than 16 levels"),
        ("<<: {start: [0, 0]}\ngoals: [[8, 6]]\n", "<<: is not known here|start: is missing"),
        (b"start: [0, \xff]\n", "yaml:1: is no text in UTF-8"),
        (b"start: \x00", "should be text"),
        ("HIERARCHY\nROOT hips\n", "is no scene but a BVH recording"),
        ("<!DOCTYPE html><html></html>", "is no scene but a web page"),
        (b"glTF\x02\x00\x00\x00", "looks like a GLB file"),
        (b"PK\x03\x04\x00", "looks like a ZIP archive"),
    ],
)
def test_what_is_wrong_is_named_with_its_line_and_place(yaml, content, says):
    with pytest.raises(FileError, match=says) as refused:
        load_scene(yaml(content))
    assert str(refused.value).startswith(str(refused.value.path))


def test_a_bomb_of_aliases_is_refused(yaml):
    lines = ["a: &a [x, x, x, x, x, x, x, x, x]"]
    lines += [f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]" for a, b in zip("abcdefgh", "bcdefghi", strict=True)]
    with pytest.raises(FileError, match="anchors and aliases"):
        load_scene(yaml("\n".join(lines)))


def test_a_file_too_large_is_not_even_read(tmp_path):
    path = tmp_path / "scene.yaml"
    with path.open("wb") as file:
        file.truncate(100 * 2**20)
    with pytest.raises(FileError, match="has 100 MB; a scene has at most 64 MB"):
        load_scene(path)


def test_many_obstacles_are_read_in_seconds(yaml):
    text = SHORT + "obstacles:\n" + "".join(f"- {{center: [{k}, 3.5], radius: 0.4}}\n" for k in range(20_000))
    assert len(load_scene(yaml(text)).obstacles) == 20_000


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileError, match=r"none\.yaml: cannot be read"):
        load_scene(tmp_path / "none.yaml")
