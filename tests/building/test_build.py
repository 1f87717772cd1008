from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from bodies import humanoid, standing
from stridecast.building import build as building
from stridecast.building import stages
from stridecast.building.build import build
from stridecast.errors import FileError, InputError, SkeletonError, TakeError
from stridecast.formats.bvh import write_bvh
from stridecast.formats.recordings import load_skeleton
from stridecast.formats.store import save_database
from stridecast.model.database import MotionDatabase
from stridecast.model.motion import Motion

WALK = "01_02.bvh"


def learn(sources, **options) -> MotionDatabase:
    return build(sources, **{"jobs": 1, "cache": False, "mirror": False, **options})


def content(database: MotionDatabase, path: Path) -> bytes:
    save_database(database, path)
    return path.read_bytes()


def left_out(database: MotionDatabase) -> dict[str, str]:
    return {Path(take.file).name: take.left_out[0] for take in database.takes if not take.segments}


@pytest.fixture
def cache_folder(tmp_path, monkeypatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(folder))
    return folder / "takes"


@pytest.fixture
def takes(formula_takes, tmp_path) -> Path:
    """A folder of one's own with one good take."""
    folder = tmp_path / "takes"
    folder.mkdir()
    shutil.copy(formula_takes / WALK, folder)
    return folder


def test_recordings_become_a_database(formula_database):
    assert formula_database.motions == ("stand", "walk", "run")
    assert [(take.name, take.subject) for take in formula_database.takes] == [
        ("01_01", "01"),
        ("01_02", "01"),
        ("02_01", "02"),
    ]
    for take in formula_database.takes:
        assert len(take.sha256) == 64
        assert take.segments > 0
        assert take.seconds == pytest.approx(take.covered)
        assert any("leg" in note for note in take.notes)


def test_the_result_depends_on_neither_jobs_nor_memory(formula_takes, formula_database, tmp_path, cache_folder):
    alone = content(formula_database, tmp_path / "a")
    together = content(build(formula_takes, jobs=2), tmp_path / "b")
    assert len(list(cache_folder.iterdir())) == 6
    remembered = content(build(formula_takes, jobs=1), tmp_path / "c")
    assert alone == together == remembered


def test_what_is_remembered_is_not_done_again(formula_takes, cache_folder, monkeypatch):
    learn(formula_takes, cache=True)

    def refuse(task):
        raise TakeError("done again")

    monkeypatch.setattr(building, "read", refuse)
    monkeypatch.setattr(building, "understand", refuse)
    assert not left_out(learn(formula_takes, cache=True))
    with pytest.raises(TakeError, match="done again"):
        learn(formula_takes, cache=True, scale=0.9)


def test_reasons_are_remembered_too(takes, cache_folder, monkeypatch):
    (takes / "broken.bvh").write_text("HIERARCHY\n")
    first = left_out(learn(takes, cache=True))
    monkeypatch.setattr(building, "read", lambda task: pytest.fail("done again"))
    assert left_out(learn(takes, cache=True)) == first


def test_a_damaged_memory_is_worked_out_again(takes, cache_folder, tmp_path):
    first = content(learn(takes, cache=True), tmp_path / "a")
    for entry in cache_folder.iterdir():
        entry.write_bytes(b"rubbish")
    assert content(learn(takes, cache=True), tmp_path / "b") == first


def test_progress_is_told(formula_takes):
    told = []
    learn(formula_takes, progress=lambda *step: told.append(step))
    for stage, total in (("read", 3), ("analyse", 3), ("assemble", 1)):
        steps = [done for name, done, of in told if name == stage and of == total]
        assert steps == sorted(steps)
        assert (steps[0], steps[-1]) == (0, total)
    assert list(dict.fromkeys(stage for stage, _, _ in told)) == list(building.STAGES)


def test_mirror_images_double_the_examples(takes):
    once, twice = learn(takes), learn(takes, mirror=True)
    assert not once.examples.mirrored.any()
    assert twice.examples.mirrored.sum() == len(once.examples.durations) == len(twice.examples.durations) / 2


def test_bounds_and_rate_are_as_asked(takes):
    database = learn(takes, bounds="paper", frame_rate=60)
    assert (database.bounds_method, database.frame_rate) == ("paper", 60.0)


def test_a_body_can_be_named(takes, tmp_path):
    tall = standing(humanoid(1.1), frames=2)
    write_bvh(tmp_path / "tall.bvh", tall)
    for body in (tall.skeleton, tmp_path / "tall.bvh", str(tmp_path / "tall.bvh")):
        assert learn(takes, skeleton=body).skeleton.leg_length == pytest.approx(tall.skeleton.leg_length, abs=1e-6)
    with pytest.raises(FileError, match="cannot be read"):
        learn(takes, skeleton=tmp_path / "none.bvh")


def test_the_body_is_that_of_the_person_with_the_most_seconds(takes, tmp_path):
    write_bvh(takes / "09_01.bvh", standing(humanoid(1.1), frames=600))
    assert learn(takes).skeleton.leg_length == pytest.approx(humanoid(1.1).leg_length, abs=1e-6)
    write_bvh(takes / "09_01.bvh", standing(humanoid(1.1), frames=30))
    assert learn(takes).skeleton.leg_length == pytest.approx(humanoid().leg_length, abs=1e-6)


def test_paths_are_told_below_the_working_folder(takes, monkeypatch):
    assert learn(takes).takes[0].file == (takes / WALK).as_posix()
    monkeypatch.chdir(takes.parent)
    assert learn(takes).takes[0].file == f"takes/{WALK}"
    assert learn("takes").takes[0].file == f"takes/{WALK}"


def test_a_file_named_twice_is_taken_once_and_a_copy_is_left_out(takes):
    (takes / "deeper").mkdir()
    shutil.copy(takes / WALK, takes / "deeper" / "99_07.bvh")
    database = learn([takes, takes / WALK, takes / "." / WALK])
    assert len(database.takes) == 2
    assert left_out(database) == {"99_07.bvh": f"a copy of {(takes / WALK).as_posix()}"}


@pytest.mark.parametrize("take", ["02_01", "09_01"])
def test_of_a_take_in_two_formats_the_complete_one_stays(mocap, take):
    folder = mocap / "cmu" / take[:2]
    database = learn([folder / f"{take}.bvh", folder / f"{take}.amc"])
    assert left_out(database) == {f"{take}.bvh": f"the same take as {take}.amc, which comes with the complete skeleton"}
    assert {name for name in database.skeleton.names if "thorax" in name} == {"thorax"}


def bad_takes(folder: Path, good: bytes) -> dict[str, str]:
    """Write every kind of bad take; return what is to be said about each."""
    text = good.decode()
    head, motion = text.split("MOTION\n")
    rows = motion.splitlines()
    frames = next(i for i, row in enumerate(rows) if row.startswith("Frame Time"))
    wild = rows.copy()
    wild[frames + 40] = " ".join(["0.1", "nan", *wild[frames + 40].split()[2:]])
    far = rows.copy()
    far[frames + 40] = " ".join(["500", *far[frames + 40].split()[1:]])
    files: dict[str, tuple[str | bytes, str]] = {
        "empty": ("", "is empty"),
        "binary": (bytes(range(256)) * 20, "should be text"),
        "misnamed": ("; FBX 7.4.0 project file\n", "is no BVH recording"),
        "truncated": (text[: len(text) * 2 // 3], r"line \d+: .*the file is cut"),
        "lying": (text.replace("Frames: ", "Frames: 9"), r"line \d+: .*promises \d+ frames"),
        "not_finite": (head + "MOTION\n" + "\n".join(wild), r"line \d+: frame 39 .* is not finite"),
        "jumping": (head + "MOTION\n" + "\n".join(far), "frame"),
        "unknown_joints": (text.replace("Left", "Bone").replace("Right", "Knob"), "no joint found for .*left_thigh"),
        "no_length": ("\n".join(zeroed(head)) + "\nMOTION\n" + motion, "length"),
        "one_frame": (head + "MOTION\nFrames: 1\n" + rows[frames] + "\n" + rows[frames + 1] + "\n", "frame"),
    }
    for name, (data, _) in files.items():
        (folder / f"{name}.bvh").write_bytes(data if isinstance(data, bytes) else data.encode())
    (folder / "alone.amc").write_text(":FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 0 0 0 0 0\n")
    return {f"{name}.bvh": says for name, (_, says) in files.items()} | {"alone.amc": "needs its skeleton"}


def zeroed(head: str) -> list[str]:
    return [row[: row.index("OFFSET")] + "OFFSET 0 0 0" if "OFFSET" in row else row for row in head.splitlines()]


def test_bad_takes_are_left_out_by_name_and_reason(takes, tmp_path):
    good = content(learn(takes), tmp_path / "good")
    says = bad_takes(takes, (takes / WALK).read_bytes())
    database = learn(takes)
    reasons = left_out(database)
    assert set(reasons) == set(says)
    for name, expected in says.items():
        assert re.search(expected, reasons[name]), f"{name}: {reasons[name]}"
        assert str(takes) not in reasons[name]
    alone = learn(takes / WALK)
    assert np.array_equal(database.examples.features, alone.examples.features)
    assert good


def test_takes_that_show_no_gait_are_left_out(takes):
    lying = standing(frames=90)
    lying = Motion(
        skeleton=lying.skeleton,
        frame_rate=30.0,
        root_positions=lying.root_positions + np.linspace(0, 0.5, 90)[:, None] * [0.0, 0.0, 1.0],
        rotations=lying.rotations,
    )
    write_bvh(takes / "sliding.bvh", lying)
    write_bvh(takes / "blink.bvh", standing(frames=4))
    assert set(left_out(learn(takes))) == {"sliding.bvh", "blink.bvh"}


def test_a_fault_of_the_package_in_one_take_stops_no_other(takes, formula_takes, monkeypatch):
    shutil.copy(formula_takes / "01_01.bvh", takes)

    def faulty(task):
        if task.motion.name == "01_01":
            raise ZeroDivisionError("in the analysis")
        return stages.understand(task)

    monkeypatch.setattr(building, "understand", faulty)
    database = learn(takes)
    assert left_out(database) == {"01_01.bvh": "unexpected ZeroDivisionError: in the analysis; please report this"}


def test_a_mirror_image_that_fails_costs_only_itself(takes, monkeypatch):
    def refuse(motion):
        raise TakeError("no mirror")

    monkeypatch.setattr(stages, "mirror_planted", refuse)
    database = learn(takes, mirror=True)
    assert not database.examples.mirrored.any()
    assert database.takes[0].notes[-1] == "its mirror image is left out: no mirror"


def test_when_no_take_is_good_the_first_reasons_are_told(takes):
    (takes / WALK).unlink()
    for n in range(7):
        (takes / f"take{n}.bvh").write_text("rubbish")
    with pytest.raises(TakeError, match=r"no take could be used:\n .*take0.bvh: is no BVH.*\n(.*\n)*  and 2 more$"):
        learn(takes)


@pytest.mark.parametrize(
    ("sources", "says"),
    [
        ([], "name at least one recording"),
        (["none"], "none: there is no such file or folder; readable are .*bvh"),
        (["empty"], "empty: the folder holds no recording; readable are .*bvh"),
    ],
)
def test_sources_that_are_none_are_refused(tmp_path, monkeypatch, sources, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "readme.txt").write_text("nothing to see")
    with pytest.raises(InputError, match=says):
        learn(sources)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"frame_rate": 5.0}, "between 10 and 240 Hz, not at 5"),
        ({"frame_rate": float("nan")}, "between 10 and 240 Hz"),
        ({"bounds": "tight"}, "'tight'.* there are balanced, paper"),
        ({"jobs": 0}, "at least 1 job"),
        ({"scale": -1.0}, "scale must be a positive number"),
        ({"input_rate": float("inf")}, "input rate must be a positive number"),
    ],
)
def test_options_that_are_none_are_refused_before_anything_is_read(options, says):
    with pytest.raises(InputError, match=says):
        learn("there is no such folder", **options)


def test_a_body_without_legs_is_refused(takes):
    body = humanoid()
    roles = {role: joint for role, joint in body.roles.items() if "shin" not in role}
    legless = type(body)(names=body.names, parents=body.parents, offsets=body.offsets, roles=roles)
    with pytest.raises(SkeletonError, match="left_shin, right_shin"):
        learn(takes, skeleton=legless)


def test_the_rate_of_files_that_do_not_say_can_be_told(mocap):
    take = mocap / "cmu" / "16" / "16_15.amc"
    slow = learn(take, input_rate=100.0).takes[0].seconds
    assert slow == pytest.approx(1.2 * learn(take).takes[0].seconds)


def test_real_recordings_give_what_their_descriptions_say(small_database, mocap):
    assert small_database.subjects == ("127", "16")
    assert {"stand-walk", "walk-stand", "walk-run", "run-stand"} <= {g.motion for g in small_database.groups}
    assert small_database.skeleton.names == load_skeleton(mocap / "cmu" / "16" / "16.asf").names
