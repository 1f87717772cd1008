from __future__ import annotations

import os
import subprocess
import sys

import pytest

from stridecast.building.processes import Failure, Workers, attempt
from stridecast.errors import TakeError


def refuse(task):
    raise TakeError(f"task {task} is no good")


def stumble(task):
    raise KeyError(task)


def miss(task):
    try:
        open(task).close()
    except OSError as error:
        raise TakeError(f"{task} cannot be read") from error


def test_results_come_with_their_task_numbers():
    with Workers(1) as workers:
        assert dict(workers.spread(str, [7, 8])) == {0: "7", 1: "8"}


def test_what_an_input_does_wrong_lasts():
    assert attempt(refuse, 3) == Failure(reason="task 3 is no good", lasting=True)


def test_what_the_code_or_the_disk_does_wrong_does_not_last():
    found = attempt(stumble, "x")
    assert isinstance(found, Failure)
    assert not found.lasting
    assert found.reason == "unexpected KeyError: 'x'; please report this"
    assert attempt(miss, "/none") == Failure(reason="/none cannot be read", lasting=False)


def test_the_death_of_a_worker_costs_only_its_own_task(caplog):
    tasks = ["6 * 7", "__import__('os')._exit(9)", "1 / 0", "'last'"]
    with Workers(2) as workers:
        found = dict(workers.spread(eval, tasks))
        again = dict(workers.spread(eval, ["2 + 2"]))  # and work goes on afterwards
    assert found[0] == 42
    assert "died" in found[1].reason
    assert "ZeroDivisionError" in found[2].reason
    assert found[3] == "last"
    assert again == {0: 4}
    assert "a worker process died" in caplog.text


SCRIPT = """
import os, sys
from stridecast.building.processes import Workers
print("the script runs")
with Workers(2) as workers:
    print(sorted(workers.spread(eval, ["1 + 1", "__import__('os').environ.get('NONE')"])))
assert __file__ and __spec__ is None
"""


@pytest.mark.skipif(sys.platform == "win32", reason="other paths")
def test_a_script_needs_no_guard(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60, check=False)
    assert (done.stdout, done.stderr) == ("the script runs\n[(0, 2), (1, None)]\n", "")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs /proc or ps")
def test_workers_end_with_their_parent(tmp_path):
    import signal
    import time

    code = (
        "import os, signal, sys\n"
        "from stridecast.building.processes import Workers\n"
        "with Workers(2) as workers:\n"
        "    for _, pid in workers.spread(eval, [\"__import__('os').getpid()\"]):\n"
        "        print(pid, flush=True)\n"
        "        sys.stdin.read()\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    worker = int(parent.stdout.readline())
    os.kill(worker, 0)
    parent.send_signal(signal.SIGKILL)
    parent.communicate()
    for _ in range(100):
        time.sleep(0.05)
        if gone(worker):
            return
    raise AssertionError("the worker outlives its parent")


def gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    try:  # nobody may have fetched its exit status yet
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return False
