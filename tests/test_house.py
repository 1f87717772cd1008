"""The package as a whole: what it shows, what it promises in writing, what it costs to import."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import stridecast
from stridecast import errors
from typechecks import SOURCES, checked_modules

ROOT = Path(__file__).resolve().parent.parent

PUBLIC = [
    "Behavior",
    "Crowd",
    "DatabaseError",
    "DatabaseFileError",
    "DownloadError",
    "FileError",
    "InputError",
    "Mined",
    "Motion",
    "MotionDatabase",
    "MotionError",
    "PathError",
    "Person",
    "Pose",
    "Scene",
    "SceneError",
    "Skeleton",
    "SkeletonError",
    "Source",
    "SteeringGains",
    "StridecastError",
    "TakeError",
    "Trajectories",
    "VehicleState",
    "Walker",
    "Walkers",
    "WishError",
    "build",
    "dress",
    "fetch",
    "load_database",
    "load_motion",
    "load_scene",
    "load_skeleton",
    "load_trajectories",
    "mine",
    "recast",
    "sample_database",
    "save_database",
    "save_scene",
    "save_trajectories",
    "walk_scene",
    "write_bvh",
    "write_glb",
]
"""Every public name. A change here is a change for users: say so in CHANGELOG.md."""

MODULES = sorted(module.name for module in pkgutil.walk_packages(stridecast.__path__, "stridecast."))

HEAVY = ("numba", "scipy", "matplotlib", "typer", "rich", "safetensors")


def test_public_names_are_pinned():
    names = list(getattr(stridecast, "__all__", ()))
    assert sorted(names) == PUBLIC
    for name in names:
        assert getattr(stridecast, name) is not None


@pytest.mark.parametrize("name", [name for name in MODULES if not name.endswith("__main__")])
def test_every_module_imports(name):
    assert importlib.import_module(name).__doc__


def test_import_loads_nothing_heavy():
    code = f"import sys, stridecast; print(*sorted(set({HEAVY!r}) & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == []


def test_error_tree_is_as_drawn():
    drawn: dict[str, tuple[str, ...]] = {}
    above: list[tuple[int, str]] = []
    for line in (errors.__doc__ or "").splitlines():
        if found := re.match(r"    ([ │├└─]*)(\w+Error)(?: \((\w+)\))?  ", line):
            depth, name, other = len(found[1]), found[2], found[3]
            above = [(column, parent) for column, parent in above if column < depth]
            parents = (above[-1][1] if above else "Exception", *([other] if other else []))
            drawn[name] = parents
            above.append((depth, name))
    written = {
        name: tuple(base.__name__ for base in kind.__bases__)
        for name, kind in inspect.getmembers(errors, inspect.isclass)
        if kind.__module__ == errors.__name__
    }
    assert drawn == written


def test_compiled_code_lives_in_kernel_modules():
    """What Numba compiles must not be wrapped by the type checks, which go by the names of modules."""
    checked = set(checked_modules())
    for path in SOURCES.rglob("*.py"):
        if re.search(r"^@(numba\.)?n?jit", path.read_text(encoding="utf-8"), re.MULTILINE):
            name = ".".join(path.relative_to(SOURCES).with_suffix("").parts)
            assert name not in checked, f"{name} is compiled: call it kernels.py or ..._kernels.py"


def test_every_dependency_is_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [
        *project["dependencies"],
        *(need for extra in project["optional-dependencies"].values() for need in extra),
    ]
    names = {re.match(r"[\w.-]+", need)[0].lower().replace("_", "-") for need in wanted} - {project["name"]}
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = {line.split("==")[0].lower().replace("_", "-") for line in lines}
    assert all("==" in line for line in lines)
    assert names <= pinned
