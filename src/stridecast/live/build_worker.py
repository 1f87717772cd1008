"""The process that builds a database of uploaded files; what it has to say goes to its standard output as JSON.

A process of its own, so that a build takes no time from those who walk, and can be given up at once.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from stridecast.building.build import build
from stridecast.errors import InputError
from stridecast.formats.store import save_database


def main() -> None:
    """Build as told by the one argument: ``files``, ``output``, ``jobs`` and options of ``build``, as JSON."""
    told: dict[str, Any] = json.loads(sys.argv[1])
    options = {name: told[name] for name in ("mirror", "scale", "input_rate", "jobs")}

    def progress(stage: str, done: int, total: int) -> None:
        _say({"stage": stage, "done": done, "total": total})

    try:
        database = build([Path(name) for name in told["files"]], cache=False, progress=progress, **options)
        save_database(database, told["output"])
    except InputError as error:
        _say({"error": str(error)})
        return
    _say({"built": told["output"]})


def _say(what: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
