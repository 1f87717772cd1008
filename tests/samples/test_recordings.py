from __future__ import annotations

import itertools
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path, PurePosixPath

import pooch
import pytest

from recording_servers import RecordingServer, recording_set, served
from stridecast.building.build import build
from stridecast.errors import DownloadError, FileError, InputError
from stridecast.samples import recordings
from stridecast.samples.recordings import SETS, RecordingSet, bring, fetch, find_set

CONTENTS = {f"{folder}/{folder}_{take:02d}.bvh": os.urandom(200_000) for folder in ("01", "02") for take in (1, 2)}
FILES = list(CONTENTS)
FIRST = FILES[0]
ALWAYS = itertools.repeat


@pytest.fixture(autouse=True)
def no_proxy(monkeypatch):
    monkeypatch.setenv("NO_PROXY", "*")


@pytest.fixture
def server():
    with served(CONTENTS) as server:
        yield server


@pytest.fixture
def tiny(tmp_path) -> RecordingSet:
    return recording_set(CONTENTS, tmp_path / "tiny.csv")


@pytest.fixture
def folder(tmp_path) -> Path:
    return tmp_path / "data" / "tiny"


def get(tiny: RecordingSet, folder: Path, server: RecordingServer, pauses=(0.0, 0.0), **options) -> int:
    return bring(tiny, folder, mirror=server.address, pauses=pauses, **options)


def refused(*arguments, **options) -> str:
    with pytest.raises(DownloadError) as caught:
        get(*arguments, **options)
    return str(caught.value)


def recordings_in(folder: Path) -> list[str]:
    """What has its own name, in the right content."""
    found = sorted(path.relative_to(folder).as_posix() for path in folder.glob("*/[!.]*"))
    assert all((folder / file).read_bytes() == CONTENTS[file] for file in found)
    return found


def unfinished_in(folder: Path) -> list[Path]:
    return list(folder.glob("**/.*.part"))


def part_of(tiny: RecordingSet, folder: Path, file: str) -> Path:
    sha256 = next(recording.sha256 for recording in tiny.files if recording.file == file)
    path = folder / file
    path.parent.mkdir(parents=True, exist_ok=True)
    return path.with_name(f".{path.name}.{sha256[:8]}.part")


# the table


def test_the_table_of_cmu_is_complete():
    table = find_set("cmu").files
    assert len(table) == len({r.file for r in table}) == len({r.address() for r in table}) == 93
    places = {r.file for r in table}
    for recording in table:
        assert re.fullmatch(r"[0-9a-f]{40}", recording.commit)
        assert re.fullmatch(r"[0-9a-f]{64}", recording.sha256)
        assert recording.size > 1000
        place = PurePosixPath(recording.file)
        assert ".." not in place.parts
        assert not place.is_absolute()
        if place.suffix == ".amc":
            assert str(place.parent / f"{place.parent.name}.asf") in places
    assert Counter(place.rpartition(".")[2] for place in places) == {"amc": 55, "bvh": 31, "asf": 7}


def test_addresses_name_one_version_of_a_file():
    recording = find_set("cmu").files[0]
    assert recording.address() == (
        f"https://raw.githubusercontent.com/{recording.repository}/{recording.commit}/{recording.path}"
    )
    odd = replace(recording, file="1/a b#?.amc", path="data/a b#?.amc")
    assert odd.address().endswith("/data/a%20b%23%3F.amc")
    assert odd.address("http://host/copy/") == "http://host/copy/1/a%20b%23%3F.amc"


def test_those_who_made_the_recordings_are_credited():
    cmu = find_set("cmu")
    assert cmu.credit == (
        "The data used in this project was obtained from mocap.cs.cmu.edu. "
        "The database was created with funding from NSF EIA-0196217."
    )
    text = cmu.credit_text()
    assert text.startswith(cmu.credit)
    assert "may not be sold" in text
    assert all(f"https://github.com/{r.repository} at {r.commit}" in text for r in cmu.files)


# what is asked for comes


def test_all_files_come(tiny, folder, server):
    assert get(tiny, folder, server) == len(FILES)
    assert recordings_in(folder) == FILES
    assert sorted(server.requests) == [(file, None) for file in FILES]
    assert not unfinished_in(folder)
    assert tiny.takes_in(folder) == [folder / file for file in FILES]
    assert (folder / "CREDIT.txt").read_text().startswith("Thanks to all.\n\nDo no harm.\n")


def test_a_second_time_asks_for_nothing(tiny, folder, server):
    get(tiny, folder, server)
    server.requests.clear()
    assert get(tiny, folder, server) == 0
    assert server.requests == []


def test_what_is_here_needs_no_right_to_write(tiny, folder, server, monkeypatch):
    get(tiny, folder, server)

    def forbidden(*_, **__):
        raise PermissionError(13, "Permission denied")

    for name in ("mkdir", "touch", "replace"):
        monkeypatch.setattr(Path, name, forbidden)
    monkeypatch.setattr(recordings, "FileLock", forbidden)
    assert get(tiny, folder, server) == 0


def test_a_damaged_file_is_downloaded_again(tiny, folder, server):
    get(tiny, folder, server)
    server.requests.clear()
    path = folder / FIRST
    path.write_bytes(CONTENTS[FIRST][:-1] + b"\0")
    (folder / FILES[1]).unlink()
    (folder / "CREDIT.txt").unlink()
    assert get(tiny, folder, server) == 2
    assert sorted(file for file, _ in server.requests) == FILES[:2]
    assert recordings_in(folder) == FILES
    assert (folder / "CREDIT.txt").exists()


def test_progress_begins_with_what_is_here_and_reaches_the_total(tiny, folder, server):
    told = []
    get(tiny, folder, server)
    (folder / FIRST).unlink()
    get(tiny, folder, server, progress=lambda *numbers: told.append(numbers))
    size = len(CONTENTS[FIRST])
    assert told[:2] == [("files", 3, 4), ("bytes", 3 * size, 4 * size)]
    assert told[-2:] == [("files", 4, 4), ("bytes", 4 * size, 4 * size)]
    for stage in ("files", "bytes"):
        done = [done for name, done, _ in told if name == stage]
        assert done == sorted(done)
    told.clear()
    get(tiny, folder, server, progress=lambda *numbers: told.append(numbers))
    assert told == [("files", 4, 4), ("bytes", 4 * size, 4 * size)]


def test_several_files_come_at_once(tiny, folder, server):
    server.together = threading.Barrier(4)  # no request is answered before four are there
    assert get(tiny, folder, server, jobs=4) == 4


def test_what_comes_compressed_is_unpacked(tiny, folder, server):
    server.zips = True
    server.go_wrong(FIRST, [("cut", 150_000)])
    assert get(tiny, folder, server) == 4
    assert recordings_in(folder) == FILES


def test_the_folder_of_the_user_is_where_it_goes(tiny, server, tmp_path, monkeypatch):
    monkeypatch.setitem(SETS, "tiny", tiny)
    monkeypatch.setattr(recordings.platformdirs, "user_data_dir", lambda name, **_: str(tmp_path / name))
    assert fetch("tiny", mirror=server.address) == tmp_path / "stridecast" / "tiny"
    assert recordings_in(tmp_path / "stridecast" / "tiny") == FILES
    assert fetch("tiny", folder=str(tmp_path / "own"), mirror=server.address + "/") == tmp_path / "own"


# what was cut goes on


@pytest.mark.parametrize("ranges", [True, False])
def test_a_cut_file_goes_on_where_it_stopped_if_the_server_can(tiny, folder, server, ranges):
    server.ranges = ranges
    server.go_wrong(FIRST, [("cut", 150_000)])
    assert get(tiny, folder, server) == 4
    assert recordings_in(folder) == FILES
    asked = [rest for file, rest in server.requests if file == FIRST]
    assert asked[0] is None
    assert len(asked) == 2
    assert 130_000 < int(re.fullmatch(r"bytes=(\d+)-", asked[1])[1]) <= 150_000


def test_the_next_fetch_goes_on_where_the_last_one_gave_up(tiny, folder, server):
    server.go_wrong(FIRST, [("cut", 70_000), *ALWAYS(("cut", 0), 2)])
    said = refused(tiny, folder, server)
    assert "broke off after" in said
    assert recordings_in(folder) == FILES[1:]
    begun = unfinished_in(folder)[0].stat().st_size
    assert 0 < begun <= 70_000
    server.requests.clear()
    assert get(tiny, folder, server) == 1
    assert server.requests == [(FIRST, f"bytes={begun}-")]
    assert recordings_in(folder) == FILES
    assert not unfinished_in(folder)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGKILL])
def test_a_fetch_that_is_stopped_leaves_nothing_half_done(tiny, folder, server, sign):
    server.go_wrong(FIRST, [("stall", 130_000)])
    code = (
        "from pathlib import Path\n"
        "from stridecast.samples.recordings import RecordingSet, bring\n"
        f"tiny = RecordingSet(name='', about='', credit='', terms='', table=Path({str(tiny.table)!r}))\n"
        f"bring(tiny, Path({str(folder)!r}), mirror={server.address!r}, jobs=1)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE)
    part = part_of(tiny, folder, FIRST)
    deadline = time.monotonic() + 20
    while not (part.exists() and part.stat().st_size >= 65536) and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(sign)
    said = process.communicate(timeout=5)[1]  # although the server is silent
    assert b"KeyboardInterrupt" in said or sign == signal.SIGKILL
    assert process.returncode != 0
    assert recordings_in(folder) == []
    server.release.set()
    server.requests.clear()
    assert get(tiny, folder, server) == 4
    assert dict(server.requests)[FIRST] is not None
    assert recordings_in(folder) == FILES
    assert not unfinished_in(folder)


@pytest.mark.parametrize("begun", [b"something else" * 100, b"x" * 300_000, b"x" * 200_000])
def test_a_damaged_beginning_is_thrown_away(tiny, folder, server, begun):
    part_of(tiny, folder, FIRST).write_bytes(begun)
    assert get(tiny, folder, server) == 4
    assert recordings_in(folder) == FILES
    assert not unfinished_in(folder)


def test_a_file_that_had_come_whole_only_needs_its_name(tiny, folder, server):
    part_of(tiny, folder, FIRST).write_bytes(CONTENTS[FIRST])
    assert get(tiny, folder, server) == 4
    assert FIRST not in dict(server.requests)


def test_two_fetches_at_once_share_the_work(tiny, folder, server, caplog):
    server.go_wrong(FIRST, [("stall", 100_000)])
    with ThreadPoolExecutor(2) as pool:
        fetches = [pool.submit(get, tiny, folder, server) for _ in range(2)]
        deadline = time.monotonic() + 10
        while "another fetch is at work" not in caplog.text and time.monotonic() < deadline:
            time.sleep(0.01)
        server.release.set()
        assert sorted(fetch.result() for fetch in fetches) == [0, 4]
    assert Counter(file for file, rest in server.requests if rest is None) == dict.fromkeys(FILES, 1)
    assert recordings_in(folder) == FILES


# what goes wrong


def test_a_server_in_trouble_is_asked_again_after_growing_pauses(tiny, folder, server, caplog):
    caplog.set_level("INFO", logger="stridecast")
    server.go_wrong(FIRST, [("status", 503), ("status", 429), ("hang up", 0)])
    began = time.monotonic()
    assert get(tiny, folder, server, pauses=(0.01, 0.02, 0.3)) == 4
    assert time.monotonic() - began > 0.33
    assert recordings_in(folder) == FILES
    assert [record.levelname for record in caplog.records if "trying again" in record.message] == [
        "WARNING",
        "INFO",
        "INFO",
    ]


def test_a_file_that_is_not_there_is_named_and_the_others_come(tiny, folder, server):
    del server.contents[FIRST]
    said = refused(tiny, folder, server)
    assert said == (
        f"{folder / FIRST}: {server.address}/{FIRST} is not there (404 Not Found); "
        "3 of 4 files are here; fetch again for the rest, or name a mirror"
    )
    assert recordings_in(folder) == FILES[1:]
    assert sorted(server.requests) == [(file, None) for file in FILES]  # no use asking again
    assert not unfinished_in(folder)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (b"x" * 200_000, "200000 bytes with sha256"),
        (b"<html>sign in</html>", "20 bytes that look like a web page"),
        (b"x" * 300_000, "sends more than the 200000 bytes"),
        (b"", "sends nothing"),
    ],
)
def test_another_content_is_refused(tiny, folder, server, wrong, says):
    server.contents[FIRST] = wrong
    said = refused(tiny, folder, server)
    assert said.startswith(f"{folder / FIRST}: {server.address}/{FIRST} sends ")
    assert says in said
    assert recordings_in(folder) == FILES[1:]
    assert not unfinished_in(folder)


def test_a_file_that_is_there_stays_until_a_better_one_has_come(tiny, folder, server):
    get(tiny, folder, server)
    (folder / FIRST).write_bytes(b"damaged")
    del server.contents[FIRST]
    refused(tiny, folder, server)
    assert (folder / FIRST).read_bytes() == b"damaged"


def test_where_trying_again_was_in_vain_the_others_are_tried_once(tiny, folder, server):
    for file in FILES[:3]:
        server.go_wrong(file, ALWAYS(("status", 503)))
    said = refused(tiny, folder, server, jobs=1)
    assert "answers 503 Service Unavailable (and 2 more failed); 1 of 4 files are here" in said
    assert Counter(file for file, _ in server.requests) == dict(zip(FILES, (3, 1, 1, 1), strict=True))


def test_a_server_that_hangs_up_costs_only_that_file(tiny, folder, server):
    server.go_wrong(FIRST, ALWAYS(("hang up", 0)))
    assert "is not answered" in refused(tiny, folder, server, jobs=1)
    assert recordings_in(folder) == FILES[1:]


def test_without_a_connection_it_is_over_soon(tiny, folder):
    with socket.socket() as unused:  # bound, but nobody listens
        unused.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{unused.getsockname()[1]}"
        with pytest.raises(DownloadError) as caught:
            bring(tiny, folder, mirror=address, pauses=(0.0,), jobs=1)
    assert f"{folder / FIRST}: {address}/{FIRST} does not come: " in str(caught.value)
    assert "cannot be reached (Connection refused); check the connection; 0 of 4 files" in str(caught.value)
    assert "more failed" not in str(caught.value)  # the others were not even tried
    assert [path.name for path in folder.iterdir() if not path.name.startswith(".")] == ["CREDIT.txt", "01"]
    assert not unfinished_in(folder)


def test_a_host_that_does_not_exist_is_named(tiny, folder):
    with pytest.raises(DownloadError, match=r"nowhere\.invalid cannot be reached \(.*\); check the connection"):
        bring(tiny, folder, mirror="http://nowhere.invalid", pauses=())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_is_told_and_what_came_is_kept(tiny, folder, server):
    part = part_of(tiny, folder, FILES[2])
    part.symlink_to("/dev/full")
    with pytest.raises(FileError) as caught:
        get(tiny, folder, server, jobs=1)
    assert str(caught.value) == (
        f"{folder / FILES[2]}: cannot be written: No space left on device; make room or name another folder, "
        "then fetch again: what has come is kept"
    )
    assert recordings_in(folder) == FILES[:2]
    assert get(tiny, folder, server) == 2


def test_a_folder_that_cannot_be_written_is_named(tiny, folder, server, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(FileError, match=r"file.tiny: cannot be written: Not a directory; name another folder"):
        get(tiny, tmp_path / "file" / "tiny", server)

    def forbidden(*_, **__):
        raise PermissionError(13, "Permission denied")

    for owner, name in ((Path, "mkdir"), (recordings, "FileLock")):
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, forbidden)
            with pytest.raises(FileError, match="tiny: cannot be written: Permission denied; name another folder"):
                get(tiny, folder, server)
    assert server.requests == []


def test_a_place_that_is_taken_by_a_folder_is_named(tiny, folder, server):
    (folder / FIRST / "more").mkdir(parents=True)
    with pytest.raises(FileError, match=r"01_01\.bvh: cannot be written: .*directory"):
        get(tiny, folder, server, jobs=1)


def test_a_request_that_makes_no_sense_is_refused(tiny, folder):
    with pytest.raises(InputError, match=r"no set of recordings 'kit'; there are cmu"):
        fetch("kit")
    for mirror in ("ftp://host/x", "host/x", "http://", "http://[x", "file:///x", ""):
        with pytest.raises(InputError, match="a mirror is an address like https://host/folder, not"):
            bring(tiny, folder, mirror=mirror)
    with pytest.raises(InputError, match="at least 1 job, not 0"):
        bring(tiny, folder, jobs=0)
    assert not folder.exists()


# the real thing


def real(mocap: Path, file: str) -> Path:
    return mocap / (f"cmu-{file}" if file.startswith("other/") else f"cmu/{file}")


def test_the_table_says_what_the_recordings_are(mocap):
    for recording in find_set("cmu").files:
        path = real(mocap, recording.file)
        assert (path.stat().st_size, pooch.file_hash(str(path))) == (recording.size, recording.sha256), recording.file


def test_real_recordings_are_fetched_and_learned_from(mocap, tmp_path):
    wanted = ("16/16.asf", "16/16_15.amc", "16/16_31.amc", "16/16_33.amc", "02/02_01.bvh")
    lines = SETS["cmu"].table.read_text(encoding="utf-8").splitlines()
    table = tmp_path / "few.csv"
    table.write_text("\n".join([lines[0], *(line for line in lines if line.split(",")[0] in wanted)]) + "\n")
    few = replace(SETS["cmu"], table=table)
    with served({file: real(mocap, file).read_bytes() for file in wanted}) as server:
        assert bring(few, tmp_path / "few", mirror=server.address) == len(wanted)
    database = build(few.takes_in(tmp_path / "few"), jobs=1, cache=False)
    assert [take.subject for take in database.takes if take.segments] == ["02", "16", "16", "16"]
