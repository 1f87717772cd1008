"""What every test stands on: run-time type checks of the package, the recordings, a body."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from jaxtyping import config, install_import_hook
from threadpoolctl import threadpool_limits

from typechecks import checked_modules

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of what is loaded later
SINGLE_THREADED = threadpool_limits(1)  # the matrices are small: threads would only wait for each other

TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent

loaded = sorted(name for name in sys.modules if name.split(".")[0] == "stridecast")
if loaded:
    raise pytest.UsageError(f"imported before the type checks were in place: {', '.join(loaded)}")
install_import_hook(checked_modules(), "typechecks.typechecked")

from bodies import humanoid  # noqa: E402
from stridecast.model.database import MotionDatabase  # noqa: E402
from stridecast.model.skeleton import Skeleton  # noqa: E402

settings.register_profile(
    "default", deadline=None, max_examples=40, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.register_profile("ci", settings.get_profile("default"), max_examples=150, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what needs the recordings, so that ``-m "not mocap"`` leaves it out."""
    for item in items:
        if "mocap" in getattr(item, "fixturenames", ()):
            item.add_marker("mocap")


def absent(what: str, reason: str) -> None:
    """Skip a test that lacks something, or fail it where ``STRIDECAST_REQUIRE`` says that it must be there."""
    if what in os.environ.get("STRIDECAST_REQUIRE", "").replace(" ", "").split(","):
        pytest.fail(f"{reason}, and STRIDECAST_REQUIRE asks for {what}")
    pytest.skip(reason)


@pytest.fixture(scope="session")
def mocap() -> Path:
    """Folder of the recordings: ``STRIDECAST_MOCAP``, or ``shared/mocap`` beside the repository."""
    named = os.environ.get("STRIDECAST_MOCAP")
    folder = Path(named) if named else ROOT.parent / "shared" / "mocap"
    if not folder.is_dir():
        absent("mocap", f"no recordings in {folder} (STRIDECAST_MOCAP names another folder)")
    return folder


@pytest.fixture(scope="session")
def blender() -> str:
    """A Python that has Blender as a module: ``STRIDECAST_BLENDER``, or this one."""
    named = os.environ.get("STRIDECAST_BLENDER", "")
    if not named and find_spec("bpy") is None:
        absent("blender", "no bpy in this Python, and STRIDECAST_BLENDER names no other")
    return named or sys.executable


@pytest.fixture(scope="session")
def pedpy() -> str:
    """A Python that has PedPy: ``STRIDECAST_PEDPY``, or this one."""
    named = os.environ.get("STRIDECAST_PEDPY", "")
    if not named and find_spec("pedpy") is None:
        absent("pedpy", "no PedPy in this Python, and STRIDECAST_PEDPY names no other")
    return named or sys.executable


@pytest.fixture(scope="session")
def jupedsim() -> str:
    """A Python that has JuPedSim: ``STRIDECAST_JUPEDSIM``, or this one."""
    named = os.environ.get("STRIDECAST_JUPEDSIM", "")
    if not named and find_spec("jupedsim") is None:
        absent("jupedsim", "no JuPedSim in this Python, and STRIDECAST_JUPEDSIM names no other")
    return named or sys.executable


@pytest.fixture(scope="session")
def vmcp() -> str:
    """A Python that has vmcp, a receiver of the VMC protocol: ``STRIDECAST_VMCP``, or this one."""
    named = os.environ.get("STRIDECAST_VMCP", "")
    if not named and find_spec("vmcp") is None:
        absent("vmcp", "no vmcp in this Python, and STRIDECAST_VMCP names no other")
    return named or sys.executable


@pytest.fixture(scope="session")
def godot() -> str:
    """Godot 3 with its editor, without a window: ``STRIDECAST_GODOT``, or what is called godot3-server here."""
    found = os.environ.get("STRIDECAST_GODOT") or shutil.which("godot3-server")
    if not found:
        absent("godot", "no godot3-server on this machine (STRIDECAST_GODOT names another Godot 3)")
    return str(found)


@pytest.fixture(scope="session")
def chromium() -> Path:
    """The browser in which the page is tested: ``STRIDECAST_CHROMIUM``, or what is called chromium here."""
    named = os.environ.get("STRIDECAST_CHROMIUM")
    found = named or shutil.which("chromium") or shutil.which("chromium-browser")
    if not found:
        absent("chromium", "no chromium on this machine (STRIDECAST_CHROMIUM names another browser)")
    return Path(str(found))


@pytest.fixture(scope="session")
def khronos() -> str:
    """Node, with Khronos' glTF validator in ``tests/node``, which is installed when it is first asked for."""
    from glbs import install

    node = install()
    if node is None:
        absent("node", "no node on this machine, or no network for the package in tests/node")
    return str(node)


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Switch the type checks off, to see what the package itself says to arrays of the wrong shape."""
    config.update("jaxtyping_disable", True)
    yield
    config.update("jaxtyping_disable", False)


@pytest.fixture(scope="session")
def skeleton() -> Skeleton:
    """The humanoid of ``bodies``: 24 joints, left and right alike, all roles."""
    return humanoid()


@pytest.fixture(scope="session")
def formula_takes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with BVH takes of a person made of formulas: standing, walking, running, and what lies between."""
    from stridecast.formats.bvh import write_bvh
    from synthetic_gait import gait, ramps

    folder = tmp_path_factory.mktemp("formulas")
    takes = {
        "01_01": (ramps((0.8, 0.0), (2.4, 1.3), (0.8, 0.0)), 0.0),
        "01_02": (ramps((1.5, 1.0), (1.5, 1.5)), 0.5),
        "02_01": (ramps((1.5, 3.0)), 0.1),
    }
    for name, (speeds, curvature) in takes.items():
        write_bvh(folder / f"{name}.bvh", gait(speeds, curvature=curvature).motion)
    return folder


@pytest.fixture(scope="session")
def formula_database(formula_takes: Path) -> MotionDatabase:
    """What is learned from ``formula_takes``."""
    from stridecast.building.build import build

    return build(formula_takes, jobs=1, cache=False)


@pytest.fixture(scope="session")
def small_database(mocap: Path) -> MotionDatabase:
    """What is learned from six recordings: walking, a start, a stop, and running from and to standing."""
    from stridecast.building.build import build

    takes = ("16/16_15", "16/16_31", "16/16_33", "16/16_55", "16/16_08", "127/127_04")
    return build([mocap / "cmu" / f"{take}.amc" for take in takes], jobs=1, cache=False)
