from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock

import stridecast
from corpora import FakeCorpus
from stridecast.formats.store import load_database, save_database
from stridecast.model.database import MotionDatabase
from stridecast.samples import library
from stridecast.samples.library import sample_database

TESTS = Path(__file__).resolve().parents[1]


@pytest.fixture(autouse=True)
def cache_home(tmp_path, monkeypatch) -> Path:
    """The user's folder of caches."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


@pytest.fixture
def folder(cache_home) -> Path:
    """Where the sample database is kept."""
    return library.user_folder()


@pytest.fixture
def corpus(monkeypatch) -> FakeCorpus:
    corpus = FakeCorpus()
    monkeypatch.setitem(sys.modules, corpus.__name__, corpus)
    monkeypatch.setattr(library, "_known", {})
    return corpus


def forget() -> None:
    """Be a new process."""
    library._known.clear()


def kept(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.safetensors"))


def same(a: MotionDatabase, b: MotionDatabase) -> bool:
    return a.groups == b.groups and a.takes == b.takes and np.array_equal(a.examples.features, b.examples.features)


def warnings(caplog) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def test_it_is_learned_from_takes_of_every_style_and_public(corpus):
    database = sample_database()
    assert [(take.name, take.subject) for take in database.takes] == [
        ("walk", "sample"),
        ("start", "sample"),
        ("trudge", "sample"),
    ]
    assert {"walk", "stand", "stand-walk"} & set(database.motions)
    assert stridecast.sample_database is sample_database


def test_it_is_the_same_object_each_time_and_free(corpus):
    assert sample_database() is sample_database()
    began = time.perf_counter()
    for _ in range(1000):
        sample_database()
    assert time.perf_counter() - began < 0.5
    assert corpus.made == 1


def test_threads_get_the_same_one_made_once(corpus):
    corpus.before = lambda: time.sleep(0.1)
    found: list[MotionDatabase] = []
    threads = [threading.Thread(target=lambda: found.append(sample_database())) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({id(database) for database in found}) == 1
    assert (len(found), corpus.made) == (4, 1)


def test_it_is_kept_and_comes_back_to_the_bit(corpus, folder, caplog):
    first = sample_database()
    (path,) = kept(folder)
    assert path.stem.startswith("samples-")
    forget()
    second = sample_database()
    assert second is not first
    assert same(first, second)
    assert corpus.made == 1
    assert warnings(caplog) == []


def test_progress_is_told_until_it_is_kept(corpus):
    told: list[tuple[str, int, int]] = []
    sample_database(progress=lambda *step: told.append(step))
    assert list(dict.fromkeys(stage for stage, _, _ in told)) == list(library.STAGES)
    for stage in library.STAGES:
        steps = [(done, total) for name, done, total in told if name == stage]
        assert steps == sorted(steps)
        assert steps[-1][0] == steps[-1][1]
    forget()
    told.clear()
    sample_database(progress=lambda *step: told.append(step))
    assert told == []


@pytest.mark.parametrize("harm", [lambda data: data[:5000], lambda data: b"", lambda data: b"rubbish" * 100])
def test_a_damaged_file_is_made_again_and_that_is_said(corpus, folder, caplog, harm):
    first = sample_database()
    (path,) = kept(folder)
    path.write_bytes(harm(path.read_bytes()))
    forget()
    assert same(sample_database(), first)
    (said,) = warnings(caplog)
    assert "made again" in said
    assert str(path) in said
    assert corpus.made == 2
    assert same(load_database(path), first)


def test_other_code_makes_another_file_and_removes_those_of_old_code(corpus, folder, monkeypatch):
    sample_database()
    old = kept(folder)
    (folder / "takes").mkdir()
    for name in ("mine.safetensors", ".samples-0123.safetensors.89ab.part", "takes/a.safetensors"):
        (folder / name).write_text("x")
    monkeypatch.setattr(library, "code_hash", lambda *layers: "1" * 64)
    sample_database()
    new = folder / f"samples-{'1' * 40}.safetensors"
    assert kept(folder) == [folder / "mine.safetensors", new]
    assert old != [new]
    assert sorted(path.name for path in folder.iterdir()) == ["mine.safetensors", new.name, "samples.lock", "takes"]
    assert (folder / "takes" / "a.safetensors").exists()


def test_what_is_in_use_stays(corpus, folder, monkeypatch, caplog):
    sample_database()
    old = kept(folder)
    monkeypatch.setattr(library, "code_hash", lambda *layers: "1" * 64)

    unlink = Path.unlink

    def in_use(self, missing_ok=False):
        if self in old:
            raise PermissionError(13, "The process cannot access the file", str(self))
        unlink(self, missing_ok)

    monkeypatch.setattr(Path, "unlink", in_use)
    sample_database()
    assert len(kept(folder)) == 2
    assert warnings(caplog) == []


def test_the_name_tells_of_all_that_it_depends_on(corpus, monkeypatch):
    asked = []
    monkeypatch.setattr(library, "code_hash", lambda *layers: asked.append(layers) or "2" * 64)
    sample_database()
    assert asked == [("database", "samples")]


@pytest.mark.parametrize("blocked", ["home", "home/stridecast"])
def test_a_folder_that_cannot_be_made_costs_only_time(corpus, cache_home, caplog, blocked):
    place = cache_home.parent / blocked
    place.parent.mkdir(exist_ok=True)
    place.write_text("a file, not a folder")
    database = sample_database()
    assert sample_database() is database
    assert place.is_file()
    (said,) = warnings(caplog)
    assert "cannot be kept" in said
    assert "XDG_CACHE_HOME" in said
    assert str(place) in said


def test_a_folder_that_cannot_be_written_costs_only_time(corpus, folder, caplog, monkeypatch):
    folder.mkdir(parents=True)
    open_file, open_low = Path.open, os.open

    def forbidden(self, mode="r", *rest, **more):
        if "x" in mode:
            raise PermissionError(13, "Permission denied", str(self))
        return open_file(self, mode, *rest, **more)

    def forbidden_low(path, flags, *rest, **more):
        if flags & os.O_CREAT and str(path).startswith(str(folder)):
            raise PermissionError(13, "Permission denied", str(path))
        return open_low(path, flags, *rest, **more)

    monkeypatch.setattr(Path, "open", forbidden)
    monkeypatch.setattr(os, "open", forbidden_low)
    assert sample_database().takes
    (said,) = warnings(caplog)
    assert "cannot be written: Permission denied" in said
    assert list(folder.iterdir()) == []


def test_a_folder_that_may_not_be_looked_into_costs_only_time(corpus, caplog, monkeypatch):
    def forbidden(self, *_, **__):
        raise PermissionError(13, "Permission denied", str(self))

    for name in ("is_file", "exists", "mkdir"):
        monkeypatch.setattr(Path, name, forbidden)
    assert sample_database().takes
    assert "cannot be kept" in warnings(caplog)[-1]


@pytest.mark.parametrize("error", [PermissionError(13, "Permission denied"), NotImplementedError("no flock here")])
def test_without_a_lock_it_is_made_and_kept_all_the_same(corpus, folder, caplog, monkeypatch, error):
    def unlockable(*_, **__):
        raise error

    monkeypatch.setattr(FileLock, "acquire", unlockable)
    sample_database()
    assert len(kept(folder)) == 1
    assert warnings(caplog) == []


def test_a_full_disk_leaves_nothing_behind(corpus, folder, caplog, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("stridecast.formats.files.os.fsync", full)
    assert sample_database().takes
    assert "No space left on device" in warnings(caplog)[0]
    assert [path.name for path in folder.iterdir()] == ["samples.lock"]


def test_whoever_waits_too_long_makes_it_itself(corpus, folder, caplog, monkeypatch):
    monkeypatch.setattr(library, "PATIENCE", 0.2)
    folder.mkdir(parents=True)
    with FileLock(folder / "samples.lock"):
        sample_database()
    assert [said.split()[0] for said in warnings(caplog)] == ["waiting", "the"]
    assert "0.2 s" in warnings(caplog)[1]
    assert len(kept(folder)) == 1


def test_whoever_waits_loads_what_was_made(corpus, formula_database, folder, caplog, monkeypatch):
    """The other is a thread here: its lock keeps this one waiting just so."""
    folder.mkdir(parents=True)
    path = folder / f"samples-{library.code_hash('database', 'samples')[:40]}.safetensors"
    other = FileLock(folder / "samples.lock", thread_local=False)
    other.acquire()

    def finish() -> None:
        save_database(formula_database, path)
        other.release()

    later = threading.Timer(0.3, finish)
    later.start()
    assert same(sample_database(), formula_database)
    later.join()
    assert corpus.made == 0
    assert warnings(caplog) == ["waiting for another process, which is making the sample database"]


def test_what_goes_wrong_while_it_is_made_is_not_remembered(corpus, folder):
    def fail() -> None:
        raise RuntimeError("a fault of the corpus")

    corpus.before = fail
    with pytest.raises(RuntimeError, match="a fault of the corpus"):
        sample_database()
    assert kept(folder) == []
    corpus.before = lambda: None
    assert sample_database().takes


# processes of their own

SCRIPT = """
import logging, pathlib, sys, time
sys.path.insert(0, {tests!r})
from corpora import FakeCorpus

def before():
    print("makes", flush=True)
    while not pathlib.Path({go!r}).exists():
        time.sleep(0.01)

FakeCorpus(before).install()
logging.basicConfig(format="%(message)s")
from stridecast.samples.library import sample_database
print("has", len(sample_database().takes))
"""
WAITING = "waiting for another process, which is making the sample database\n"


def start(go: Path, said: Path) -> subprocess.Popen:
    """Ask for the database in a new process, which makes it once ``go`` is there, and logs to ``said``."""
    code = SCRIPT.format(tests=str(TESTS), go=str(go))
    with said.open("a") as log:
        return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=log, text=True)


def until(said: Path, text: str) -> None:
    """Wait until a process has said something."""
    for _ in range(3000):
        if text in said.read_text():
            return
        time.sleep(0.01)
    pytest.fail(f"nobody says {text!r}, but {said.read_text()!r}")


def test_of_two_processes_at_once_one_waits_for_the_other(folder, tmp_path):
    go, said = tmp_path / "go", tmp_path / "said"
    processes = [start(go, said) for _ in range(2)]
    until(said, WAITING)
    go.touch()
    ends = [process.communicate(timeout=60)[0] for process in processes]
    assert [process.returncode for process in processes] == [0, 0], said.read_text()
    assert sorted(ends) == ["has 3\n", "makes\nhas 3\n"]
    assert said.read_text() == WAITING
    assert len(kept(folder)) == 1


def test_a_process_that_is_killed_keeps_nobody_waiting(folder, tmp_path):
    go, said = tmp_path / "go", tmp_path / "said"
    first = start(go, said)
    assert first.stdout.readline() == "makes\n"
    second = start(go, said)
    until(said, WAITING)
    first.kill()
    first.communicate(timeout=30)
    go.touch()
    assert second.communicate(timeout=60)[0] == "makes\nhas 3\n"
    assert (second.returncode, said.read_text()) == (0, WAITING)
    assert len(kept(folder)) == 1
