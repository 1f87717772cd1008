"""A build that is going on beside everything else: what it says is read, and it can be given up."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any


class Building:
    """A database that is being built.

    Parameters
    ----------
    folder
        Where the files lie; they are named relative to it.
    files
        Recordings and skeletons.
    output
        The database to be written.
    options
        ``mirror``, ``scale`` and ``input_rate`` of ``building.build``.
    progress
        Called with a stage, how much of it is done, and how much there is; from another thread.
    finished
        Called once at the end with nothing or with what was wrong; from another thread. Not after it was given up.
    """

    def __init__(
        self,
        folder: Path,
        files: list[Path],
        output: Path,
        options: Mapping[str, Any],
        *,
        progress: Callable[[str, int, int], None],
        finished: Callable[[str | None], None],
    ) -> None:
        self.output, self.seconds = output, 0.0
        self._progress, self._finished = progress, finished
        self._began, self._given_up = time.monotonic(), False
        jobs = max(1, (os.cpu_count() or 1) - 1)
        told = {"files": [path.name for path in files], "output": str(output), "jobs": jobs, **options}
        command = [sys.executable, "-m", "stridecast.live.build_worker", json.dumps(told)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        self._process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        threading.Thread(target=self._listen, daemon=True).start()

    def give_up(self) -> None:
        """End it."""
        self._given_up = True
        with contextlib.suppress(OSError):
            self._process.kill()

    def _listen(self) -> None:
        wrong: str | None = "the build ended without a word; is there enough memory?"
        assert self._process.stdout is not None
        for line in self._process.stdout:
            said = json.loads(line)
            if "stage" in said:
                self._progress(said["stage"], said["done"], said["total"])
            else:
                wrong = said.get("error")
        self._process.stdout.close()
        self._process.wait()
        self.seconds = time.monotonic() - self._began
        if not self._given_up:
            self._finished(wrong)
