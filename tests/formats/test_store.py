from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import save

from stridecast.errors import DatabaseFileError, FileError
from stridecast.formats import files, store
from stridecast.formats.store import as_stored, load_database, save_database
from stridecast.formats.tensors import read_tensors, write_tensors
from stridecast.model.annotation import COLUMNS
from stridecast.model.database import MotionDatabase
from stridecast.synthesis.walker import Walker


@pytest.fixture
def stored(formula_database, tmp_path):
    path = tmp_path / "walk.safetensors"
    save_database(formula_database, path)
    return path


def same(a: MotionDatabase, b: MotionDatabase) -> bool:
    tables = all(np.array_equal(getattr(a.examples, name), getattr(b.examples, name)) for name in store._TABLES)
    body = a.skeleton.names == b.skeleton.names and dict(a.skeleton.roles) == dict(b.skeleton.roles)
    arrays = all(
        np.array_equal(getattr(a.skeleton, name), getattr(b.skeleton, name))
        for name in ("parents", "offsets", "end_joints", "end_offsets")
    )
    rest = (a.frame_rate, a.groups, a.takes, a.bounds_method) == (b.frame_rate, b.groups, b.takes, b.bounds_method)
    rest &= all(np.array_equal(getattr(a.annotations, name), getattr(b.annotations, name)) for name in COLUMNS)
    return tables and body and arrays and rest and np.array_equal(a.references, b.references)


def changed(path, **changes):
    """Write the database again with other entries in its header or other tensors."""
    header, tensors = read_tensors(path, store.FORMAT, store.VERSION)
    for name, value in changes.items():
        name = name.replace("__", ".")
        if name in tensors:
            tensors[name] = value
        else:
            header[name] = value
    write_tensors(path, header, {name: array for name, array in tensors.items() if array is not None})


def test_what_is_saved_loads_as_the_same(formula_database, stored):
    assert same(load_database(stored), formula_database)


def test_saving_what_was_loaded_gives_the_same_bytes(stored, tmp_path):
    save_database(load_database(stored), tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == stored.read_bytes()


def test_what_was_built_is_already_rounded_as_it_is_stored(formula_database):
    assert same(as_stored(formula_database), formula_database)


def test_rounding_is_far_below_what_can_be_seen(formula_database, tmp_path):
    fine = formula_database.examples
    noisy = replace(fine, features=fine.features + 1e-9 * np.random.default_rng(0).normal(size=fine.features.shape))
    rounded = as_stored(replace(formula_database, examples=noisy)).examples
    assert np.abs(rounded.features - noisy.features).max() < 1e-6
    assert rounded.features.dtype == np.float64


def test_a_loaded_database_drives_a_walker_to_the_same_bits(formula_database, stored):
    walkers = [Walker(database) for database in (formula_database, load_database(stored))]
    for frame in range(60):
        a, b = (walker.step((0.0, 0.04 * frame), motion="walk") for walker in walkers)
        assert np.array_equal(a.rotations, b.rotations)
        assert np.array_equal(a.root_position, b.root_position)


def test_header_names_format_and_version(stored):
    with safe_open(str(stored), framework="numpy") as file:
        header = json.loads(file.metadata()["stridecast"])
        assert file.get_tensor("examples.features").dtype == np.float32
    assert header["format"] == "stridecast motion database"
    assert header["version"] == 2


def test_unknown_entries_of_the_header_are_ignored(formula_database, stored):
    changed(stored, remark="by a newer version of the same format")
    assert same(load_database(stored), formula_database)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty"),
        (b"HIERARCHY\nROOT Hips\n", "is no stridecast motion database: .* looks like a BVH"),
        (b"\x00\x01\x02" * 500, "is no stridecast motion database"),
        (b"glTF" + bytes(100), "looks like a GLB file"),
        (save({"weight": np.zeros((2, 3))}), "something else .*weight"),
        (save({"weight": np.zeros(3)}, {"stridecast": "{"}), "header cannot be read"),
        (save({"weight": np.zeros(3)}, {"stridecast": "[]"}), "header cannot be read"),
        (
            save({"a": np.zeros(3)}, {"stridecast": '{"format": "stridecast take", "version": 1}'}),
            "but a stridecast take",
        ),
    ],
)
def test_other_files_are_refused(tmp_path, content, says):
    path = tmp_path / "file.safetensors"
    path.write_bytes(content)
    with pytest.raises(DatabaseFileError, match=says) as caught:
        load_database(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("keep", [5, 9, 300, 0.5, -1])
def test_a_cut_file_is_refused(stored, keep):
    data = stored.read_bytes()
    stored.write_bytes(data[: int(len(data) * keep) if isinstance(keep, float) else keep])
    with pytest.raises(DatabaseFileError, match=r"cut|not a safetensors"):
        load_database(stored)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(DatabaseFileError, match="no such file"):
        load_database(tmp_path / "none.safetensors")
    with pytest.raises(DatabaseFileError, match="folder"):
        load_database(tmp_path)


def test_a_newer_version_is_refused_with_what_to_do(stored):
    changed(stored, version=7)
    with pytest.raises(DatabaseFileError, match=r"version 7.*up to version 2.*upgrade"):
        load_database(stored)


def test_a_file_of_version_1_is_annotated_when_it_is_read(formula_database, stored):
    header, _ = read_tensors(stored, store.FORMAT, store.VERSION)
    takes = [{name: value for name, value in take.items() if name != "annotation"} for take in header["takes"]]
    changed(stored, version=1, takes=takes, **{f"annotations__{name}": None for name in COLUMNS})
    old = load_database(stored)
    for name in COLUMNS:
        np.testing.assert_allclose(
            getattr(old.annotations, name), getattr(formula_database.annotations, name), atol=1e-4, err_msg=name
        )
    for take, known in zip(old.takes, formula_database.takes, strict=True):
        assert take.annotation.statuses == known.annotation.statuses
        assert take.annotation.cycle == 0.0


def test_annotations_that_do_not_fit_are_refused(formula_database, stored, unchecked):
    whole = stored.read_bytes()
    for wrong, says in (
        (formula_database.annotations.style[:-1], "annotation 'style' is damaged"),
        (np.full_like(formula_database.annotations.style, np.nan), "annotation 'style' is damaged"),
        (None, "annotations.style.* is missing"),
    ):
        stored.write_bytes(whole)
        changed(stored, annotations__style=wrong)
        with pytest.raises(DatabaseFileError, match=says):
            load_database(stored)


def test_entries_that_are_missing_are_named(stored):
    changed(stored, groups=None)
    with pytest.raises(DatabaseFileError, match="is damaged"):
        load_database(stored)


@pytest.mark.parametrize("name", ["examples.features", "references", "skeleton.offsets"])
def test_missing_tensors_are_named(stored, name):
    changed(stored, **{name.replace(".", "__"): None})
    with pytest.raises(DatabaseFileError, match=f"{name}.* is missing"):
        load_database(stored)


def test_tables_that_do_not_fit_are_refused(formula_database, stored, unchecked):
    examples = formula_database.examples
    wrong = {
        "examples.durations": (examples.durations[:-1], "damaged"),
        "examples.features": (np.full_like(examples.features, np.nan), "features"),
        "examples.takes": (examples.takes + 99, "not listed"),
        "examples.times": (examples.times[:, :-1], "samples"),
        "references": (formula_database.references * 2, "no rotations"),
    }
    whole = stored.read_bytes()
    for name, (array, says) in wrong.items():
        stored.write_bytes(whole)
        changed(stored, **{name.replace(".", "__"): array})
        with pytest.raises(DatabaseFileError, match=says):
            load_database(stored)


@pytest.mark.parametrize(
    ("entry", "value", "says"),
    [
        ("first", 3, "should begin at example"),
        ("keys", [0.5], "keys for the string"),
        ("motion", "hop", "unknown motion"),
        ("string", "LXR", "keys for the string"),
    ],
)
def test_groups_that_do_not_fit_are_refused(stored, entry, value, says):
    header, _ = read_tensors(stored, store.FORMAT, store.VERSION)
    walk = next(row for row in header["groups"] if row["name"] == "walk/LDR")
    walk[entry] = value
    changed(stored, groups=header["groups"])
    with pytest.raises(DatabaseFileError, match=says):
        load_database(stored)


def test_a_full_disk_leaves_the_old_file(formula_database, stored, monkeypatch):
    old = stored.read_bytes()

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(FileError, match="No space left"):
        save_database(formula_database, stored)
    assert stored.read_bytes() == old
    assert [path.name for path in stored.parent.iterdir()] == [stored.name]


def test_a_kill_while_writing_leaves_the_old_file(stored):
    old = stored.read_bytes()
    code = (
        "import os, signal, sys\n"
        "from stridecast.formats import files, store\n"
        "files.os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)\n"
        "store.save_database(store.load_database(sys.argv[1]), sys.argv[1])\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(stored)], check=False, timeout=60)
    assert done.returncode != 0
    assert stored.read_bytes() == old


def test_a_folder_that_does_not_exist_is_refused(formula_database, tmp_path):
    with pytest.raises(FileError, match="cannot be written"):
        save_database(formula_database, tmp_path / "none" / "walk.safetensors")
    with pytest.raises(FileError, match="no such folder"):
        files.check_place(tmp_path / "none" / "walk.safetensors")
    with pytest.raises(FileError, match="is a folder"):
        files.check_place(tmp_path)
    files.check_place(tmp_path / "walk.safetensors")
    assert not list(tmp_path.iterdir())
