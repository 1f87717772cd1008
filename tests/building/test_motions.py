"""Motions in memory as sources of a build."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bodies import humanoid, standing
from stridecast.building import build as building
from stridecast.building.build import build
from stridecast.errors import TakeError
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import save_database
from stridecast.model.database import MotionDatabase
from stridecast.model.motion import Motion

NAMES = ["01_01", "01_02", "02_01"]


def learn(sources, **options) -> MotionDatabase:
    return build(sources, **{"jobs": 1, "cache": False, "mirror": False, **options})


def content(database: MotionDatabase, path: Path) -> bytes:
    save_database(database, path)
    return path.read_bytes()


def told(database: MotionDatabase) -> dict[str, tuple[str, ...]]:
    return {take.file: take.left_out for take in database.takes if not take.segments}


@pytest.fixture(scope="module")
def motions(formula_takes) -> list[Motion]:
    return [load_motion(formula_takes / f"{name}.bvh") for name in NAMES]


@pytest.fixture
def walk(motions) -> Motion:
    return motions[1]


@pytest.fixture
def cache_folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(tmp_path / "cache"))
    return tmp_path / "cache" / "takes"


def test_motions_are_learned_from_as_their_files_are(motions, formula_database):
    database = build(motions, jobs=1, cache=False)
    assert database.groups == formula_database.groups
    for table in ("features", "times", "travelled", "parameters", "takes", "first_frames", "mirrored"):
        assert np.array_equal(getattr(database.examples, table), getattr(formula_database.examples, table))
    for ours, theirs in zip(database.takes, formula_database.takes, strict=True):
        assert ours.file == ours.name
        assert len(ours.sha256) == 64
        assert ours.left_out == theirs.left_out
        assert replace(ours, file="", sha256="", notes=()) == replace(theirs, file="", sha256="", notes=())


def test_one_motion_is_enough(walk):
    assert [take.name for take in learn(walk).takes] == ["01_02"]


def test_motions_come_after_the_files_in_the_order_in_which_they_are_given(motions, formula_takes):
    first, _, run = motions
    database = learn([run, str(formula_takes / "01_02.bvh"), first])
    assert [take.file for take in database.takes] == [(formula_takes / "01_02.bvh").as_posix(), "02_01", "01_01"]
    assert np.array_equal(np.unique(database.examples.takes), [0, 1, 2])


def test_the_result_depends_on_neither_jobs_nor_memory(motions, tmp_path, cache_folder):
    alone = content(learn(motions), tmp_path / "a")
    together = content(learn(motions, jobs=2, cache=True), tmp_path / "b")
    assert len(list(cache_folder.iterdir())) == len(motions)
    remembered = content(learn(motions, cache=True), tmp_path / "c")
    assert alone == together == remembered


def test_what_is_remembered_goes_by_content_name_and_person(walk, cache_folder, monkeypatch):
    learn(walk, cache=True)
    monkeypatch.setattr(building, "understand", lambda task: pytest.fail("done again"))
    assert learn(replace(walk, rotations=walk.rotations.copy()), cache=True).takes[0].segments
    for other in (
        replace(walk, name="other"),
        replace(walk, subject="other"),
        replace(walk, frame_rate=59.0),
        replace(walk, root_positions=walk.root_positions + 1e-9),
        replace(walk, skeleton=replace(walk.skeleton, offsets=1.001 * walk.skeleton.offsets)),
    ):
        with pytest.raises(pytest.fail.Exception, match="done again"):
            learn(other, cache=True)


def test_a_copy_is_left_out_whatever_its_name(motions):
    first, walk, _ = motions
    database = learn([first, walk, replace(walk, name="again", subject="somebody else")])
    assert told(database) == {"again": ("a copy of 01_02",)}


def test_motions_without_a_name_are_counted(motions):
    first, walk, run = motions
    database = learn([replace(run, name=""), walk, replace(first, name="")])
    assert [take.name for take in database.takes] == ["motion 0", "01_02", "motion 2"]


def test_motions_that_cannot_be_used_are_left_out_by_name_and_reason(walk):
    body = walk.skeleton
    roles = {role: joint for role, joint in body.roles.items() if "shin" not in role}
    legless = replace(walk, name="legless", skeleton=replace(body, roles=roles))
    places = walk.root_positions.copy()
    places[40:] += 5.0
    jumping = replace(walk, name="jumping", root_positions=places)
    short = replace(standing(humanoid(), frames=3), name="short")
    database = learn([legless, walk, jumping, short])
    reasons = told(database)
    assert list(reasons) == ["legless", "jumping", "short"]
    assert "no joint found for left_shin, right_shin" in reasons["legless"][0]
    assert reasons["jumping"][0].startswith("the root jumps at frame 40: ")
    assert "are the least" in reasons["short"][0]
    assert np.array_equal(database.examples.features, learn(walk).examples.features)
    with pytest.raises(TakeError, match=r"no take could be used:\n  legless: no joint found .*\n  jumping: the root"):
        learn([legless, jumping])


def test_nothing_is_told_of_reading_where_nothing_is_read(walk):
    steps: list[tuple[str, int, int]] = []
    learn(walk, progress=lambda *step: steps.append(step))
    assert steps == [("analyse", 0, 1), ("analyse", 1, 1), ("assemble", 0, 1), ("assemble", 1, 1)]


def test_the_body_is_that_of_the_person_with_the_most_seconds(walk):
    tall = replace(standing(humanoid(1.1), frames=600), name="tall", subject="tall")
    assert learn([walk, tall]).skeleton.leg_length == pytest.approx(humanoid(1.1).leg_length)
    assert learn([walk, tall], skeleton=walk.skeleton).skeleton.leg_length == pytest.approx(walk.skeleton.leg_length)
