from __future__ import annotations

import numpy as np
import pytest

from stridecast.analysis.take import TakeAnalysis
from stridecast.body import kinematics
from stridecast.body.mirroring import mirror, mirror_planted
from stridecast.building.stages import AnalysisTask, Reading, ReadTask, read, understand
from stridecast.errors import TakeError
from stridecast.model.contacts import SIDES
from stridecast.model.motion import Motion


def toes(motion: Motion) -> np.ndarray:
    return kinematics.pose(motion).positions[:, motion.skeleton.chain(*(f"{side}_toe" for side in SIDES))]


def sliding(motion: Motion, planted: np.ndarray) -> float:
    """How far planted toes travel on the floor, metres."""
    steps = np.linalg.norm(np.diff(toes(motion)[..., [0, 2]], axis=0), axis=-1)
    return float(steps[planted[1:] & planted[:-1]].sum())


@pytest.fixture(scope="module", params=["16/16_15", "16/16_31", "127/127_04"])
def analysed(mocap, request) -> TakeAnalysis:
    path = mocap / "cmu" / f"{request.param}.amc"
    body = read(ReadTask(path=mocap / "cmu" / "35" / "35_01.amc", reading=Reading())).skeleton
    task = AnalysisTask(motion=ReadTask(path=path, reading=Reading()), skeleton=body, mirror=False)
    return understand(task).analysis


def test_mirrored_toes_stand_where_the_mirror_shows_them(analysed):
    original = toes(analysed.motion)[:, ::-1] * [-1.0, 1.0, 1.0]
    planted = analysed.contacts.planted[:, ::-1]
    off = np.linalg.norm(toes(mirror_planted(analysed.motion)) - original, axis=-1)[planted]
    assert np.median(off) < 1e-9
    assert off.max() < 0.01  # a leg that is a little too short reaches as far as it can
    assert off.mean() < np.linalg.norm(toes(mirror(analysed.motion)) - original, axis=-1)[planted].mean()


def test_planted_toes_slide_no_more_in_the_mirror(analysed):
    planted = analysed.contacts.planted
    before, after = sliding(analysed.motion, planted), sliding(mirror_planted(analysed.motion), planted[:, ::-1])
    assert after < 1.01 * before


def test_only_the_legs_differ_from_the_plain_mirror_image(analysed):
    plain, replanted = mirror(analysed.motion), mirror_planted(analysed.motion)
    assert np.array_equal(plain.root_positions, replanted.root_positions)
    legs = {f"{side}_{part}" for side in SIDES for part in ("thigh", "shin", "foot")}
    others = [joint for role, joint in plain.skeleton.roles.items() if role not in legs]
    assert np.allclose(np.abs((plain.rotations * replanted.rotations).sum(-1)[:, others]), 1.0)


def test_the_file_is_named_once(tmp_path):
    path = tmp_path / "take.bvh"
    path.write_text("HIERARCHY\nROOT Hips\n{\n  OFFSET 0 zero 0\n")
    with pytest.raises(TakeError, match=r"^line 4: ") as caught:
        read(ReadTask(path=path, reading=Reading()))
    assert str(tmp_path) not in str(caught.value)
