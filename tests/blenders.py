"""Blender for tests, in a process of its own: a Python that has ``bpy`` runs a script with JSON in and out."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path


def run_in_blender(python: str, script: str, folder: Path, *arguments: str, timeout: float = 120.0) -> dict:
    """Run a script, by a Python that has bpy, that writes JSON to the file named by its last argument."""
    code, out = folder / "script.py", folder / "said.json"
    code.write_text(script, encoding="utf-8")
    command = [python, str(code), *arguments, str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return json.loads(out.read_text(encoding="utf-8"))
