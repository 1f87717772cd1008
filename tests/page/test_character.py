"""The page with a character of one's own."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from browsers import Visitor
from characters import built
from glb_rigs import artists_rig
from stridecast.formats.recordings import load_skeleton
from stridecast.live.cast import cast
from stridecast.live.serve import LiveServer
from stridecast.model.database import MotionDatabase


def red(visitor: Visitor, x: float, z: float) -> int:
    """Pixels as red as the coat about somebody who stands at a ground point."""
    at, top = visitor.seen(x, z)
    picture = np.asarray(Image.open(io.BytesIO(visitor.page.screenshot())).convert("RGB")).astype(int)
    about = picture[max(0, int(top) - 260) : int(top) + 20, max(0, int(at) - 80) : int(at) + 80]
    return int(((about[..., 0] > 60) & (about[..., 1] < 30) & (about[..., 2] < 30)).sum())


@pytest.fixture
def server(learned: MotionDatabase, tmp_path: Path):
    file = tmp_path / "character.glb"
    artists_rig(file, built(legs=0.9), seed=2, unit=0.01, armature=2.5)
    database, costume = cast(learned, file, load_skeleton(file))
    with LiveServer(database, port=0, costume=costume).running() as running:
        yield running


def test_a_character_walks_in_its_own_meshes(visit: Callable[[str], Visitor], server: LiveServer) -> None:
    visitor = visit(server.address)
    visitor.go("walk")
    visitor.until(lambda: red(visitor, 0.0, 0.0) > 300, "the character's coat")
    assert visitor.last("welcome")["character"]["size"] == pytest.approx(0.01)
    assert "could not be loaded" not in visitor.page.content()
