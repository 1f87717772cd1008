from __future__ import annotations

import os

import numpy as np
import pytest

from stridecast.building.cache import LAYERS, TakeCache, code_hash, key_of

TENSORS = {"a": np.arange(1000.0)}


@pytest.fixture
def cache(tmp_path) -> TakeCache:
    return TakeCache(tmp_path / "takes")


def test_what_is_put_in_comes_out(cache):
    cache.put("key", {"name": "x"}, TENSORS)
    header, tensors = cache.get("key")
    assert header["name"] == "x"
    assert np.array_equal(tensors["a"], TENSORS["a"])
    assert cache.get("other") is None


def test_names_depend_on_every_part_and_on_the_code(monkeypatch):
    keys = {key_of(file="a", rate=30.0), key_of(file="b", rate=30.0), key_of(file="a", rate=60.0)}
    assert len(keys) == 3
    assert len(code_hash()) == 64
    monkeypatch.setattr("stridecast.building.cache.code_hash", lambda: "newer code")
    assert key_of(file="a", rate=30.0) not in keys


def test_the_hash_tells_of_code_and_of_the_tables_beside_it(tmp_path, monkeypatch):
    monkeypatch.setattr("stridecast.building.cache.resources.files", lambda _: tmp_path)
    for layer in (*LAYERS, "samples", "cli"):
        (tmp_path / layer / "__pycache__").mkdir(parents=True)
        (tmp_path / layer / "code.py").write_text("old")
    plain, more = code_hash.__wrapped__(), code_hash.__wrapped__("samples")
    assert plain != more
    for name in ("cli/code.py", "model/__pycache__/code.pyc", "samples/.code.py.swp"):
        (tmp_path / name).write_text("new")
        assert code_hash.__wrapped__("samples") == more
    seen = {plain, more}
    for name in ("samples/code.py", "samples/table.npz", "samples/deeper/table.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("new")
        assert code_hash.__wrapped__() == plain
        seen.add(code_hash.__wrapped__("samples"))
    assert len(seen) == 5
    (tmp_path / "analysis" / "code.py").write_text("new")
    assert code_hash.__wrapped__() not in seen


def test_a_damaged_entry_is_thrown_away(cache, caplog):
    caplog.set_level("INFO")
    cache.put("key", {}, TENSORS)
    path = next(cache.folder.iterdir())
    path.write_bytes(path.read_bytes()[:100])
    assert cache.get("key") is None
    assert not path.exists()
    assert "damaged" in caplog.text


def test_a_folder_that_cannot_be_written_is_done_without(tmp_path, caplog):
    caplog.set_level("INFO")
    (tmp_path / "takes").write_text("a file, not a folder")
    cache = TakeCache(tmp_path / "takes")
    cache.put("key", {}, TENSORS)
    assert cache.get("key") is None
    cache.trim()
    assert "not remembered" in caplog.text


def test_a_folder_that_may_not_be_looked_into_is_done_without(cache, monkeypatch, caplog):
    caplog.set_level("INFO")

    def forbidden(*_, **__):
        raise PermissionError(13, "Permission denied")

    for name in ("is_file", "unlink", "iterdir"):
        monkeypatch.setattr(f"pathlib.Path.{name}", forbidden)
    assert cache.get("key") is None
    cache.trim()
    assert "not remembered for the next build" in caplog.text


def test_a_full_disk_stops_no_build(cache, monkeypatch, caplog):
    caplog.set_level("INFO")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    cache.put("key", {}, TENSORS)
    assert cache.get("key") is None
    assert "No space left" in caplog.text


def test_what_was_used_longest_ago_goes_first(cache):
    for n in range(5):
        cache.put(f"key{n}", {}, TENSORS)
        os.utime(cache.folder / f"key{n}.safetensors", (n, n))
    cache.get("key0")
    size = (cache.folder / "key0.safetensors").stat().st_size
    cache.trim(3 * size)
    assert sorted(path.stem for path in cache.folder.iterdir()) == ["key0", "key3", "key4"]


def test_no_folder_means_no_memory():
    cache = TakeCache(None)
    cache.put("key", {}, TENSORS)
    cache.trim()
    assert cache.get("key") is None
