"""A small reader of GLB for tests, and Khronos' validator; knows nothing of the package."""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import json
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

TESTS = Path(__file__).resolve().parent
TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDE = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    """A file with its document and numbers."""

    def __init__(self, data: bytes) -> None:
        magic, version, total = struct.unpack_from("<4sII", data)
        assert (magic, version, total) == (b"glTF", 2, len(data))
        length, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.document: dict[str, Any] = json.loads(data[20 : 20 + length])
        at = 20 + length
        self.numbers = b""
        self._arrays: dict[int, np.ndarray] = {}
        if at < total:
            size, kind = struct.unpack_from("<I4s", data, at)
            assert kind == b"BIN\0"
            assert at + 8 + size == total
            self.numbers = data[at + 8 :]

    def __getitem__(self, part: str) -> Any:
        return self.document.get(part, [])

    def array(self, index: int) -> np.ndarray:
        if index not in self._arrays:
            self._arrays[index] = self._read(index)
        return self._arrays[index]

    def _read(self, index: int) -> np.ndarray:
        accessor = self["accessors"][index]
        view = self["bufferViews"][accessor["bufferView"]]
        wide, kind = WIDE[accessor["type"]], TYPES[accessor["componentType"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        out = np.frombuffer(self.numbers, kind, accessor["count"] * wide, start).astype(np.float64)
        if accessor.get("normalized"):
            out = np.maximum(out / np.iinfo(kind).max, -1.0)
        return out.reshape(-1, wide) if wide > 1 else out

    def names(self) -> dict[str, int]:
        return {node["name"]: k for k, node in enumerate(self["nodes"])}

    def world(self, animation: int | None, time: float) -> np.ndarray:
        """Matrices of all nodes in the world at a time, as a player shows them."""
        moved: dict[tuple[int, str], np.ndarray] = {}
        if animation is not None:
            told = self["animations"][animation]
            for channel in told["channels"]:
                sampler = told["samplers"][channel["sampler"]]
                times, keys = self.array(sampler["input"]), self.array(sampler["output"])
                at = int(np.clip(np.searchsorted(times, time + 1e-6, side="right") - 1, 0, len(times) - 1))
                value = keys[at]
                if sampler.get("interpolation", "LINEAR") == "LINEAR" and at + 1 < len(times) and time > times[at]:
                    share = (time - times[at]) / (times[at + 1] - times[at])
                    value = (1 - share) * value + share * keys[at + 1]
                moved[channel["target"]["node"], channel["target"]["path"]] = value
        out = np.zeros((len(self["nodes"]), 4, 4))

        def visit(node: int, above: np.ndarray) -> None:
            own = self["nodes"][node]
            place, turn, size = (
                moved.get((node, path), np.array(own.get(path, usual)))
                for path, usual in (("translation", [0, 0, 0]), ("rotation", [0, 0, 0, 1]), ("scale", [1, 1, 1]))
            )
            local = np.array(own.get("matrix", np.eye(4)), float).reshape(4, 4).T
            if "matrix" not in own:
                local[:3, :3], local[:3, 3] = matrix(turn) * size, place
            out[node] = above @ local
            for child in own.get("children", ()):
                visit(child, out[node])

        for root in self["scenes"][self.document.get("scene", 0)].get("nodes", ()):
            visit(root, np.eye(4))
        return out

    def skinned(self, skin: int, mesh: int, worlds: np.ndarray) -> np.ndarray:
        """Where the vertices of a mesh are."""
        told = self["skins"][skin]
        binds = self.array(told["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        carry = worlds[told["joints"]] @ binds
        attributes = self["meshes"][mesh]["primitives"][0]["attributes"]
        places = self.array(attributes["POSITION"])
        joints, weights = self.array(attributes["JOINTS_0"]).astype(int), self.array(attributes["WEIGHTS_0"])
        ones = np.concatenate((places, np.ones((len(places), 1))), axis=1)
        return np.einsum("vk,vkij,vj->vi", weights, carry[joints], ones)[:, :3]

    def seen(self, node: int, worlds: np.ndarray) -> np.ndarray:
        """Where the vertices of a node's mesh are, skinned or rigid."""
        told = self["nodes"][node]
        if "skin" in told:
            return self.skinned(told["skin"], told["mesh"], worlds)
        places = self.array(self["meshes"][told["mesh"]]["primitives"][0]["attributes"]["POSITION"])
        return places @ worlds[node][:3, :3].T + worlds[node][:3, 3]

    def below(self, node: int) -> list[int]:
        """A node and all that hangs from it."""
        line = [node]
        for one in line:
            line += self["nodes"][one].get("children", ())
        return line


def matrix(turn: np.ndarray) -> np.ndarray:
    x, y, z, w = turn / np.linalg.norm(turn)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def packed(document: dict[str, Any], numbers: bytes = b"") -> bytes:
    """A GLB of a document and numbers, whatever they say."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    numbers += b"\0" * (-len(numbers) % 4)
    tail = struct.pack("<I4s", len(numbers), b"BIN\0") + numbers if numbers else b""
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(tail), len(text), b"JSON") + text + tail


def install() -> str | None:
    """Node with the validator beside it, installed once; nothing where that cannot be."""
    spec = importlib.util.spec_from_file_location("bundle", TESTS.parent / "web" / "bundle.py")
    assert spec is not None
    assert spec.loader is not None
    bundle = importlib.util.module_from_spec(spec)
    sys.modules["bundle"] = bundle
    spec.loader.exec_module(bundle)
    found = bundle.find_node()
    if found is None:
        return None
    folder = TESTS / "node"
    lock = hashlib.sha256((folder / "package-lock.json").read_bytes()).hexdigest()
    stamp = folder / "node_modules" / ".installed"
    with (folder / ".lock").open("w") as guard:
        fcntl.flock(guard, fcntl.LOCK_EX)  # several processes may test at once
        if not (stamp.is_file() and stamp.read_text() == lock):
            npm = [str(found.node), str(found.npm)] if found.npm.suffix == ".js" else [str(found.npm)]
            command = [*npm, "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error"]
            if subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode:
                return None
            stamp.write_text(lock)
    return str(found.node)


def complaints(node: str, *paths: Path) -> list[str]:
    """Errors and warnings of Khronos' validator."""
    command = [node, str(TESTS / "node" / "validate.mjs"), *map(str, paths)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    reports = json.loads(done.stdout)
    assert len(reports) == len(paths)
    return [
        f"{Path(report['path']).name}: {issue['code']} {issue['message']} at {issue.get('pointer')}"
        for report in reports
        for issue in report["issues"]["messages"]
        if issue["severity"] < 2
    ]


def played(node: str, path: Path, times: list[float]) -> list[list[dict[str, Any]]]:
    """What three.js makes of a file: at each time, of each skinned figure, its ``joints`` and its first ``corner``."""
    command = [node, str(TESTS / "node" / "play.mjs"), str(path), *map(str, times)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
