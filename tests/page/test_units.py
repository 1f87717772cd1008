"""Tests of the page's own parts, in TypeScript: the scene document, undo, frames."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

WEB = Path(__file__).resolve().parent.parent.parent / "web"


def test_parts_of_the_page() -> None:
    done = subprocess.run([sys.executable, str(WEB / "bundle.py"), "test"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
