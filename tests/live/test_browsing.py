"""Database mode in this process."""

from __future__ import annotations

import numpy as np
import pytest

from stridecast.database.clips import LAST, find_clips
from stridecast.database.playing import recorded
from stridecast.errors import InputError
from stridecast.live.browsing import BESIDE, Browsing
from stridecast.live.frames import decode
from stridecast.live.messages import ClipMessage, MineMessage, PlaybackMessage
from stridecast.live.telling import database_part, database_state

PERIOD = 1 / 30


@pytest.fixture
def browsing(learned):
    said = []
    found = Browsing(learned, said.append)
    found.said = said
    return found


def run(browsing, count):
    shown = [browsing.step(PERIOD) for _ in range(count)]
    return [decode(data) for data in shown if data is not None]


def clip_example(database, status):
    clips = next(c for c in find_clips(database) if c.status == status)
    return int(clips.rows[0][0])


def test_all_segments_and_all_takes_are_told(learned):
    told = database_state(learned, "all", 3)
    count = len(learned.examples.durations)
    for name, column in told.examples:
        assert len(column) == count, name
    assert len(told.takes) == len(learned.takes)
    assert max(told.examples.take) < len(told.takes)
    names = [group.name for group in database_part(learned, "all", False).groups]
    row = count // 2
    assert learned.by_name[names[told.examples.group[row]]].rows.start <= row
    assert told.examples.speed[row] == pytest.approx(learned.annotations.speed[row], abs=1e-4)
    assert sum(told.examples.clip) > 0.5 * count


@pytest.mark.parametrize("status", ["walk", "run", "stand", "stand-walk"])
def test_a_clip_plays_beside_what_was_recorded(browsing, learned, status):
    ready = browsing.show(ClipMessage(type="clip", example=clip_example(learned, status), request=5))
    assert (ready.request, ready.status, ready.recorded, ready.beside) == (5, status, True, True)
    assert ready.repeats == ("-" not in status)
    frames = run(browsing, 40)
    assert len(frames) == 40
    for frame in frames:
        assert frame.arrays["ids"].tolist() == [1, 2]
        assert frame.arrays["roots"][1, 0] - frame.arrays["places"][1, 0] == pytest.approx(0.0, abs=0.3)
    start = frames[0].arrays["places"]
    assert start[1, 0] - start[0, 0] == pytest.approx(BESIDE, abs=1e-2)
    # Both show the same movement: the heights of their pelvises are alike over a second.
    heights = np.array([frame.arrays["roots"][:, 1] for frame in frames])
    assert np.abs(heights.mean(axis=0)[0] - heights.mean(axis=0)[1]) < 0.08


def test_what_was_recorded_is_shown_to_the_bit(learned):
    """A pose at a sample of the tables is that sample."""
    example = clip_example(learned, "walk")
    taped = recorded(learned, [example])
    assert taped.seconds == pytest.approx(float(learned.examples.durations[example]))
    times = learned.examples.times[example, 2:LAST]
    assert np.allclose(taped.values(times)[:, :-1], learned.examples.features[example, 2:LAST, :-1], atol=1e-9)
    _, headings = taped.vehicle(times)
    assert np.allclose(headings, learned.examples.travelled[example, 2:LAST, 2], atol=1e-9)


def test_motion_is_mined(browsing):
    ready = browsing.mine(MineMessage(type="mine", status="walk", speed=1.4, request=2))
    assert (ready.status, ready.request) == ("walk", 2)
    assert ready.speed == pytest.approx(1.4, abs=0.05)
    assert sum(part.weight for part in ready.mix) == pytest.approx(1.0)
    assert ready.seconds >= 4.0
    frames = run(browsing, 60)
    way = frames[-1].arrays["places"][0, :2] - frames[0].arrays["places"][0, :2]
    assert np.hypot(*way) == pytest.approx(1.4 * 59 / 30, abs=0.15)


def test_the_clip_comes_again_stops_and_is_scrubbed(browsing, learned):
    ready = browsing.show(ClipMessage(type="clip", example=clip_example(learned, "walk")))
    long = round(ready.seconds * 30) + 1
    frames = run(browsing, long + 5)
    assert frames[-1].time < frames[-10].time
    browsing.control(PlaybackMessage(type="playback", action="pause"))
    assert len(run(browsing, 5)) == 1
    browsing.scrub(1.0)
    assert run(browsing, 3)[-1].time == pytest.approx(1.0)
    browsing.control(PlaybackMessage(type="playback", action="step"))
    assert run(browsing, 3)[-1].time == pytest.approx(1.0 + PERIOD)
    browsing.pace = 0.5
    browsing.control(PlaybackMessage(type="playback", action="play"))
    assert run(browsing, 30)[-1].time == pytest.approx(1.0 + PERIOD + 0.5, abs=0.05)


def test_wrong_wishes_are_refused(browsing):
    with pytest.raises(InputError, match="there is no segment 999999"):
        browsing.show(ClipMessage(type="clip", example=999_999))
    with pytest.raises(InputError, match="choose a segment"):
        browsing.control(PlaybackMessage(type="playback", action="play"))
    with pytest.raises(InputError, match="choose a segment"):
        browsing.scrub(1.0)
    with pytest.raises(InputError, match="fly"):
        browsing.mine(MineMessage(type="mine", status="fly"))
    assert [frame.arrays["ids"].size for frame in run(browsing, 3)] == [0]
