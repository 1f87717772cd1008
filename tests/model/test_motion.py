from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from bodies import humanoid, writhing
from stridecast.errors import InputError, MotionError


def broken(name: str, place: tuple[int, ...], value: float) -> dict[str, np.ndarray]:
    array = getattr(writhing(frames=5), name).copy()
    array[place] = value
    return {name: array}


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"root_positions": np.zeros((5, 2))}, r"24 joints.*\(frames, 3\).*\(5, 2\)"),
        ({"root_positions": np.zeros((4, 3))}, r"\(4, 3\) and \(5, 24, 4\)"),
        ({"rotations": np.zeros((5, 23, 4))}, r"\(frames, 24, 4\).*\(5, 23, 4\)"),
        ({"rotations": np.zeros((5, 24, 3))}, r"\(5, 24, 3\)"),
        ({"root_positions": np.zeros((0, 3)), "rotations": np.zeros((0, 24, 4))}, "at least one frame"),
        ({"frame_rate": 0.0}, "positive number, not 0"),
        ({"frame_rate": -30.0}, "positive number, not -30"),
        ({"frame_rate": float("nan")}, "positive number, not nan"),
        ({"frame_rate": float("inf")}, "positive number, not inf"),
        (broken("root_positions", (3, 1), np.nan), "root position is not finite at frame 3"),
        (broken("rotations", (2, 4, 0), np.inf), "rotation of joint 'Neck' is not finite at frame 2"),
    ],
)
def test_what_is_no_motion_is_refused_by_name(changes, says):
    with pytest.raises(MotionError, match=says) as refused:
        replace(writhing(frames=5), **changes)
    assert isinstance(refused.value, InputError)


def test_a_motion_keeps_its_own_frozen_arrays():
    motion = writhing(frames=5)
    places = motion.root_positions.copy()
    mine = replace(motion, root_positions=places)
    places[:] = 9.0
    np.testing.assert_array_equal(mine.root_positions, motion.root_positions)
    for array in (motion.root_positions, motion.rotations):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    with pytest.raises(FrozenInstanceError):
        motion.frame_rate = 60.0


def test_frames_and_seconds():
    motion = writhing(frames=61, frame_rate=30.0)
    assert motion.frames == 61
    assert motion.seconds == pytest.approx(2.0)
    assert writhing(frames=1).seconds == 0.0


def test_clip_is_the_frames_between():
    motion = replace(writhing(humanoid(), frames=10), name="16_11", subject="16", source="16_11.amc")
    clip = motion.clip(2, 6)
    np.testing.assert_array_equal(clip.rotations, motion.rotations[2:6])
    np.testing.assert_array_equal(clip.root_positions, motion.root_positions[2:6])
    assert (clip.frames, clip.frame_rate, clip.name, clip.subject) == (4, motion.frame_rate, "16_11", "16")
    with pytest.raises(MotionError, match="at least one frame"):
        motion.clip(6, 6)
