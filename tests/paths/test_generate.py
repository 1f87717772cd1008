from __future__ import annotations

import time

import numpy as np
import pytest
import shapely

from places import MARGIN, block, disc, fits_through, polygon, random_scene, road, room, scene
from stridecast.errors import PathError, SceneError
from stridecast.model.scene import Circle, Scene
from stridecast.paths.generate import Path, generate_path

TREE = disc("tree", 0.0, 5.0, 0.5)
CHUNK = 80


def check(place: Scene, path: Path) -> None:
    """What holds of every path."""
    curve = path.curve
    assert room(place, curve.points) >= place.behavior.body_radius - 1e-5
    np.testing.assert_allclose(curve.points[0], place.start, atol=1e-9)
    np.testing.assert_allclose(curve.points[-1], place.goals[-1], atol=1e-9)
    done = 0.0
    for goal in place.goals:
        ahead = curve.points[curve.distances >= done - 1e-9]
        away = np.linalg.norm(ahead - goal, axis=-1)
        assert away.min() < 0.05
        done = float(curve.distances[len(curve.points) - len(ahead) + int(np.flatnonzero(away < 0.05)[0])])
    steps = np.linalg.norm(np.diff(curve.points, axis=0), axis=-1)
    assert steps.max() < 0.021
    assert np.isfinite(curve.curvatures).all()
    shortest = np.linalg.norm(np.diff(path.polygon, axis=0), axis=-1).sum()
    assert curve.length < 1.25 * shortest + 0.5, "a needless detour"


@pytest.mark.parametrize("chunk", range(2000 // CHUNK))
def test_whenever_a_grid_finds_a_way_there_is_a_curve_and_it_is_clear(chunk):
    ways = 0
    for seed in range(chunk * CHUNK, (chunk + 1) * CHUNK):
        place = random_scene(seed)
        try:
            path = generate_path(place)
        except SceneError:  # somebody would stand in something
            assert min(room(place, np.stack((p, p))) for p in (place.start, *place.goals)) < (
                place.behavior.body_radius + 1e-3
            ), f"seed {seed}"
        except PathError as refused:
            says = str(refused)
            assert not fits_through(place, MARGIN), f"seed {seed}: {says}"
            assert any(thing.name in says for thing in (*place.obstacles, *place.roads)), says
        else:
            check(place, path)
            ways += 1
    assert ways > CHUNK // 2


@pytest.mark.parametrize("chunk", range(2))
def test_where_even_a_thinner_body_finds_no_way_on_a_grid_there_is_none(chunk):
    for seed in range(5000 + chunk * CHUNK, 5000 + (chunk + 1) * CHUNK):
        place = random_scene(seed)
        if not fits_through(place, -MARGIN):
            with pytest.raises((PathError, SceneError)):
                generate_path(place)


def test_nothing_in_the_way_leaves_a_straight_line():
    path = generate_path(scene((0, 0), [(3, 4)], [disc("tree", 3, 0, 0.5)]))
    assert path.curve.length == pytest.approx(5.0)
    assert path.inserted == ()
    assert (path.rounds, path.searched) == (0, False)


def test_a_control_point_is_inserted_beside_what_blocks():
    path = generate_path(scene((0, 0), [(0, 10)], [disc("tree", 0.2, 5, 0.5)]))
    assert [i.obstacle for i in path.inserted] == ["tree"]
    assert path.inserted[0].point == pytest.approx((-0.7, 5.0)), "0.5 m tree, 0.3 m body, 0.1 m room"
    assert (path.rounds, path.searched) == (1, False)
    assert np.abs(path.curve.curvatures).max() < 0.6


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("obstacle", [TREE, block("kiosk", -1, 4, 1, 5), block("wall", -3, 4.9, 3, 5.1)])
@pytest.mark.parametrize("aside", [-0.2, 0.0, 0.2])
def test_the_preferred_side_is_taken(side, obstacle, aside):
    path = generate_path(scene((aside, 0), [(aside, 10)], [obstacle], side=side))
    x = path.curve.at(path.curve.nearest(np.array([0.0, 5.0]))).point[0]
    assert (x > 0) == (side == "left")


def test_the_preferred_side_is_not_worth_any_way():
    path = generate_path(scene((-9.5, 0), [(-9.5, 10)], [block("wall", -10, 4.9, 10, 5.1)], side="left"))
    assert path.curve.points[:, 0].min() < -10


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_other_side_is_taken_where_one_is_closed(side):
    closed = block("fence", 0, 4.9, 4, 5.1) if side == "left" else block("fence", -4, 4.9, 0, 5.1)
    path = generate_path(scene((0, 0), [(0, 10)], [TREE, closed], side=side))
    assert (path.curve.points[:, 0].max() > 0.5) == (side == "right")


@pytest.mark.parametrize("obstacle", [TREE, block("kiosk", -1, 4, 1, 5), block("wall", -4, 4.9, 4, 5.1)])
def test_far_keeps_more_than_near(obstacle):
    near, far = (
        room(place, generate_path(place).curve.points)
        for place in (scene((0, 0), [(0, 10)], [obstacle], distance=distance) for distance in ("near", "far"))
    )
    assert 0.3 <= near < 0.45
    assert far > near + 0.2


def test_far_goes_through_a_narrow_gap_rather_than_round():
    gap = [block("left", 0.4, 4, 20, 5), block("right", -20, 4, -0.4, 5)]
    path = generate_path(scene((1, 0), [(1, 10)], gap, distance="far"))
    assert path.curve.length < 11.5


def test_the_faster_and_heavier_the_wider_the_turn():
    walls = [block("wall", -20, 4, 1, 4.2)]
    sharpest = [
        np.abs(generate_path(scene((0, 0), [(-3, 8)], walls, velocity=v, weight=w)).curve.curvatures).max()
        for v, w in ((0.5, 60), (0.9, 60), (1.3, 70), (1.3, 95), (2.0, 95))
    ]
    assert (np.diff(sharpest) <= 1e-6).all()
    assert sharpest[-1] < 0.6 * sharpest[0]


@pytest.mark.parametrize("room_left", [0.03, 0.1, 0.3])
def test_narrow_gaps_are_taken(room_left):
    half = 0.3 + room_left
    gap = [block("left", half, 4, 9, 8), block("right", -9, 4, -half, 8)]
    place = scene((3, 0), [(-3, 12)], gap)
    path = generate_path(place)
    check(place, path)
    assert path.curve.length < 14.5


def test_gaps_too_narrow_are_not():
    gap = [block("left", 0.29, 4, 3, 8), block("right", -3, 4, -0.29, 8)]
    path = generate_path(scene((0, 0), [(0, 12)], gap))
    assert np.abs(path.curve.points[:, 0]).max() > 3


def test_a_dead_end_is_left_again():
    trap = polygon("trap", (-3, 2), (3, 2), (3, 8), (2.5, 8), (2.5, 2.5), (-2.5, 2.5), (-2.5, 8), (-3, 8))
    place = scene((0, 4), [(0, -3)], [trap])
    path = generate_path(place)
    check(place, path)
    assert path.searched
    assert {i.obstacle for i in path.inserted} == {"trap"}


def test_overlapping_obstacles_are_passed_as_one():
    cluster = [disc("a", -1, 5, 1), disc("b", 0.5, 5, 1), disc("c", 1.6, 4, 1)]
    place = scene((0, 0), [(0, 10)], cluster)
    check(place, generate_path(place))


def test_a_way_bends_with_its_road_and_turns_at_crossings():
    bent = scene((0, 0), [(8, 10)], [disc("t", 0.4, 4, 0.3)], [road("r", 3, (0, 0), (0, 8), (8, 8), (8, 10))])
    check(bent, generate_path(bent))
    crossing = scene((-8, 0), [(0, 8)], [], [road("r", 2, (-8, 0), (8, 0)), road("q", 2, (0, -8), (0, 8))])
    path = generate_path(crossing)
    check(crossing, path)
    assert path.inserted[0].obstacle == "the edge of the roads"


def test_goals_are_passed_in_their_order():
    place = scene((0, 0), [(0, 6), (6, 6), (0, 0)], [disc("a", 0.2, 3, 0.4), disc("b", 3, 6.1, 0.3)])
    path = generate_path(place)
    check(place, path)
    assert np.abs(path.curve.curvatures).max() < 4


def test_turning_back_takes_a_turn():
    place = scene((0, 0), [(0, 6), (0, 0.5)])
    path = generate_path(place)
    check(place, path)
    assert np.abs(path.curve.curvatures).max() < 4
    assert np.abs(path.curve.points[:, 0]).max() > 0.3


def test_a_goal_where_one_is_already_is_reached():
    assert generate_path(scene((0, 0), [(0, 0), (0, 3), (0, 3)])).curve.length == pytest.approx(3.0)


def test_the_same_scene_has_the_same_path():
    for seed in range(20):
        try:
            one, other = (generate_path(random_scene(seed)).curve for _ in range(2))
        except (SceneError, PathError):
            continue
        np.testing.assert_array_equal(one.points, other.points)


@pytest.fixture(scope="module")
def trees() -> list[Circle]:
    rng = np.random.default_rng(0)
    return [disc(f"t{k}", *rng.uniform(2, 198, 2), rng.uniform(0.1, 0.6)) for k in range(10_000)]


@pytest.mark.parametrize("side", ["none", "left"])
def test_ten_thousand_obstacles_take_seconds(side, trees):
    place = scene((0, 0), [(200, 200)], trees, side=side)
    told: list[float] = []
    began = time.perf_counter()
    path = generate_path(place, progress=told.append)
    assert time.perf_counter() - began < 30
    assert path.curve.length < 1.1 * np.hypot(200, 200)
    assert told[0] == 0
    assert told[-1] == 1
    assert (np.diff(told) >= 0).all()
    line = shapely.LineString(path.curve.points)
    centers = shapely.points([tree.center for tree in trees])
    assert (shapely.distance(line, centers) - [tree.radius for tree in trees]).min() >= 0.3 - 1e-5


def test_a_search_is_told_about_often_and_ends_when_that_raises(trees):
    """Whoever does not want to wait need not, wherever the search is."""
    place = scene((0, 0), [(60, 60)], [tree for tree in trees if max(tree.center) < 60])
    told: list[float] = []
    generate_path(place, progress=told.append)
    assert sum(0.6 < part < 0.9 for part in told) > 10
    for enough in (1, len(told) // 2, len(told) - 1):
        calls = []

        def progress(part, calls=calls, enough=enough):
            calls.append(part)
            if len(calls) == enough:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            generate_path(place, progress=progress)
        assert calls == told[:enough]


PEN = (
    block("west", -3, 3, -2.8, 9),
    block("east", 2.8, 3, 3, 9),
    block("south", -3, 3, 3, 3.2),
    block("north", -3, 8.8, 3, 9),
)


@pytest.mark.parametrize(("start", "goal"), [((0, 0), (0, 6)), ((0, 6), (0, 0))])
def test_no_way_names_what_separates_and_nothing_else(start, goal):
    others = [disc("tree", 5, 2, 0.4), disc("bush", 0, 4.2, 0.4)]
    with pytest.raises(PathError) as refused:
        generate_path(scene(start, [goal], [*PEN, *others]))
    assert all(f"obstacle {name!r}" in str(refused.value) for name in ("west", "east", "south", "north"))
    assert "tree" not in str(refused.value)
    assert "bush" not in str(refused.value)


def test_of_many_things_in_the_way_some_are_named():
    angles = np.linspace(0, 2 * np.pi, 20)[:-1]
    ring = [disc(f"post {k}", 3 * np.cos(a), 6 + 3 * np.sin(a), 0.5) for k, a in enumerate(angles)]
    with pytest.raises(PathError, match=r"'post 0'.* and 13 more are in the way; the body needs gaps of 0\.64 m"):
        generate_path(scene((0, 0), [(0, 6)], ring))


BOW = polygon("bow", (0, 2), (1, 3), (1, 2), (0, 3))
FLAT = polygon("flat", (0, 2), (1, 2), (2, 2))
KIOSK = (block("kiosk", -1, 4, 1, 5), disc("bin", 1, 2, 0.2))
LANE = road("lane", 3, (20, 0), (20, 9))
NARROW = road("path", 0.5, (0, 0), (0, 5))
STREET = road("street", 3, (0, -1), (0, 11))


@pytest.mark.parametrize(
    ("place", "says"),
    [
        (((0, 0), [(0, 10)], KIOSK, [STREET]), r"\): obstacle 'kiosk' and the edge of road 'street' are"),
        (((0, 0), [(20, 0)], [], [STREET, LANE]), "road 'street' does not lead to road 'lane'"),
        (((0, 0), [(0, 6), (5, 6)], PEN[:3], []), None),
        (((0, 0), [(-5, 6), (0, 6)], PEN, []), r"from goal 1 \(-5, 6\) to goal 2 \(0, 6\)"),
    ],
)
def test_no_way_on_roads_and_between_goals(place, says):
    if says is None:
        check(scene(*place), generate_path(scene(*place)))
        return
    with pytest.raises(PathError, match=says):
        generate_path(scene(*place))


@pytest.mark.parametrize(
    ("place", "says"),
    [
        (((0, 5), [(0, 10)], [TREE]), r"the start \(0, 5\) lies inside obstacle 'tree'"),
        (((0, 0), [(0, 5.7)], [TREE]), r"the goal \(0, 5\.7\) lies 0\.2 m from obstacle 'tree'; the body needs 0\.3 m"),
        (((0, 0), [(0, 2), (0, 5)], [TREE]), "goal 2 .* lies inside obstacle 'tree'"),
        (((0, 0), [(5, 0)], [], [STREET]), r"the goal .* lies off the roads, 3\.5 m from the edge of road 'street'"),
        (((0, 0), [(1.4, 0)], [], [STREET]), r"lies 0\.1 m from the edge of road 'street'"),
        (((0, 0), [(0, 5)], [], [NARROW]), r"road 'path' is 0\.5 m wide; the body needs 0\.6 m"),
        (((0, 0), [(0, 0)]), "the goal lies at the start"),
        (((0, 0), [(0, 9)], [BOW]), "obstacle 'bow' is no polygon: Self-inter"),
        (((0, 0), [(0, 9)], [FLAT]), "obstacle 'flat' is no polygon"),
    ],
)
def test_scenes_that_make_no_sense_are_refused(place, says):
    with pytest.raises(SceneError, match=says):
        generate_path(scene(*place))
