from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from stridecast.errors import InputError
from stridecast.live import layout
from stridecast.live.frames import Figures, columns_of, decode, encode, pack_rotations, unpack_rotations
from stridecast.live.timeline import Timeline

finite = st.floats(-1e4, 1e4, width=32)
counts = st.integers(0, 7)


@st.composite
def quaternions(draw):
    raw = draw(hnp.arrays(np.float64, (draw(st.integers(1, 40)), 4), elements=st.floats(-1, 1)))
    length = np.linalg.norm(raw, axis=-1, keepdims=True)
    return np.where(length > 1e-3, raw / np.maximum(length, 1e-3), np.array([1.0, 0.0, 0.0, 0.0]))


@st.composite
def figures(draw):
    full, joints = draw(counts), draw(st.integers(1, 5))
    count = full + draw(counts)
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rotations = rng.normal(size=(full, joints, 4))
    return Figures(
        ids=rng.integers(1, 2**32 - 1, count),
        places=rng.normal(0, 100, (count, 3)),
        speeds=rng.random(count),
        rules=rng.integers(0, 15, count),
        roots=rng.normal(0, 100, (full, 3)),
        rotations=pack_rotations(rotations / np.linalg.norm(rotations, axis=-1, keepdims=True)),
        planted=rng.integers(0, 4, full).astype(np.uint8),
        movers=rng.normal(size=(draw(counts), 2)),
    )


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    apart = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return 4 * np.arcsin(np.minimum(apart / 2, 1))


@given(quaternions())
def test_rotations_come_back_within_a_ten_thousandth(rotations):
    back = unpack_rotations(pack_rotations(rotations))
    assert angle_between(back, rotations).max() < 1e-4
    assert np.allclose(np.linalg.norm(back, axis=-1), 1.0)


def test_rotations_come_back_everywhere():
    """Dense samples, near the corners at which two components are equally great too."""
    rng = np.random.default_rng(1)
    q = rng.normal(size=(200_000, 4))
    corners = np.sign(rng.normal(size=(200_000, 4))) + 1e-3 * rng.normal(size=(200_000, 4))
    poles = np.eye(4)[rng.integers(0, 4, 100_000)] + 1e-3 * rng.normal(size=(100_000, 4))
    q = np.concatenate((q, corners, poles))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    assert angle_between(unpack_rotations(pack_rotations(q)), q).max() < 9e-5


@given(quaternions())
def test_the_sign_of_a_quaternion_does_not_matter(rotations):
    assert np.array_equal(pack_rotations(rotations), pack_rotations(-rotations))


@given(figures(), st.integers(0, 2**32 - 1), st.floats(0, 1e6), st.floats(0, 1e15))
def test_frames_come_back(shown, number, time, echo):
    data = encode(layout.SCENE, number, time, shown, echo=echo, flags=layout.REPLAYED)
    frame = decode(data)
    assert (frame.kind, frame.flags, frame.frame) == (layout.SCENE, layout.REPLAYED, number)
    assert (frame.time, frame.echo) == (time, echo)
    assert np.array_equal(frame.arrays["ids"], shown.ids)
    assert np.array_equal(frame.arrays["rotations"], shown.rotations)
    assert np.array_equal(frame.arrays["planted"], shown.planted)
    for name in ("places", "speeds", "roots", "movers"):
        assert np.array_equal(frame.arrays[name], getattr(shown, name).astype(np.float32))


@given(figures())
def test_every_array_is_aligned(shown):
    data = encode(layout.SCENE, 1, 0.0, shown)
    assert len(data) % layout.ALIGNMENT == 0
    begin = layout.HEADER.itemsize
    for column in columns_of(layout.SCENE):
        assert begin % layout.ALIGNMENT == 0
        size = np.ascontiguousarray(getattr(shown, column.name), column.kind).nbytes
        begin += size + -size % layout.ALIGNMENT
    assert begin == len(data)


def test_a_walking_figure_takes_few_bytes():
    shown = Figures(
        ids=np.array([1]),
        places=np.zeros((1, 3)),
        speeds=np.zeros(1),
        rules=np.array([0]),
        roots=np.zeros((1, 3)),
        rotations=np.zeros((1, 24, 3), np.uint16),
        planted=np.zeros(1, np.uint8),
    )
    extra = {"steering": np.arange(16.0)[None], "playing": np.arange(4)[None]}
    data = encode(layout.WALK, 1, 0.0, shown, extra=extra)
    assert len(data) < 320
    frame = decode(data)
    assert np.array_equal(frame.arrays["steering"], np.arange(16.0)[None])
    assert np.array_equal(frame.arrays["playing"], [[0, 1, 2, 3]])


@given(figures(), st.integers(1, 60))
def test_cut_frames_are_refused(shown, cut):
    data = encode(layout.SCENE, 1, 0.0, shown)
    with pytest.raises(InputError, match=r"ends within|at least 32 bytes|should have"):
        decode(data[:-cut])
    with pytest.raises(InputError, match="should have"):
        decode(data + bytes(4))


@given(figures(), st.data())
def test_some_are_chosen_with_their_poses(shown, data):
    full = len(shown.roots)
    rows = np.array(data.draw(st.permutations(range(full))), np.int64)
    few = data.draw(st.integers(0, full))
    some = shown.chosen(rows, few)
    assert np.array_equal(some.ids, shown.ids[rows])
    assert np.array_equal(some.rotations, shown.rotations[rows[:few]])


@given(st.lists(st.integers(1, 50), min_size=1, max_size=60), st.integers(600, 4000))
def test_a_timeline_keeps_the_newest_that_have_room(sizes, room):
    line = Timeline(room)
    kept = []
    for number, size in enumerate(sizes):
        shown = Figures(
            ids=np.full(size, number),
            places=np.zeros((size, 3)),
            speeds=np.zeros(size),
            rules=np.zeros(size, np.int64),
            roots=np.zeros((0, 3)),
            rotations=np.zeros((0, 1, 3), np.uint16),
            planted=np.zeros(0, np.uint8),
        )
        line.add(number / 30, shown)
        kept.append(shown)
        while sum(f.nbytes for f in kept) > room and len(kept) > 1:
            kept.pop(0)
        assert [f for _, f in line.frames()] == kept
        assert line.at(line.last) == (number / 30, shown)
        assert line.at(-1.0)[1] is kept[0]
        middle = (line.first + line.last) / 2
        assert line.at(middle)[0] <= middle + 1e-9 or len(kept) == 1
