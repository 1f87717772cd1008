from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stridecast.analysis.events import find_gait, find_mid_stances, label_motions, support_phases
from stridecast.analysis.take import analyse
from stridecast.body.mirroring import mirror
from stridecast.formats.recordings import load_motion
from stridecast.model.contacts import LEFT, RIGHT, Contacts
from stridecast.model.segment import Boundary, Phase, Segment
from stridecast.samples.performance import perform
from synthetic_gait import gait, ramps

RATE = 60.0
SHORTEST = 0.05
"""A state shorter than this between two equal ones is none, seconds."""
WALKING, RUNNING = st.floats(0.8, 1.8), st.floats(2.5, 4.0)
CURVATURES, PHASES = st.floats(-0.5, 0.5), st.floats(0.0, 2 * np.pi)
SUPPORTS = st.lists(st.tuples(st.sampled_from("SLRDF"), st.integers(1, 25)), min_size=1, max_size=25).map(
    lambda runs: "".join(letter * count for letter, count in runs)
)
OTHER = str.maketrans("LR", "RL")


def strings(motion) -> list[str]:
    return [segment.string for segment in analyse(motion).gait.segments]


# phases


@given(SUPPORTS, st.floats(0.0, 5.0))
def test_phases_cover_every_frame_once_and_in_order(support, speed):
    phases = support_phases(support, np.full(len(support), speed), RATE)
    assert phases[0].start == 0
    assert phases[-1].stop == len(support)
    assert all(a.stop == b.start and a.state != b.state for a, b in pairwise(phases))
    assert all(p.start < p.stop for p in phases)


@given(SUPPORTS, st.floats(0.0, 5.0))
def test_no_step_from_foot_to_foot_without_double_support_or_flight(support, speed):
    letters = "".join(p.state for p in support_phases(support, np.full(len(support), speed), RATE))
    assert "LR" not in letters
    assert "RL" not in letters


@given(SUPPORTS.map(lambda s: s.replace("F", "D").replace("LR", "LDR").replace("RL", "RDL")))
def test_no_blips_inside(support):
    phases = support_phases(support, np.full(len(support), 1.2), RATE)
    for before, here, after in zip(phases[:-2], phases[1:-1], phases[2:], strict=True):
        if before.state == after.state and here.state != "S":
            assert here.stop - here.start >= SHORTEST * RATE


@given(SUPPORTS, st.floats(0.0, 5.0))
def test_exchanging_the_feet_exchanges_the_phases(support, speed):
    speeds = np.full(len(support), speed)
    here, there = support_phases(support, speeds, RATE), support_phases(support.translate(OTHER), speeds, RATE)
    assert [p._replace(state=p.state.translate(OTHER)) for p in here] == there


def test_speed_decides_what_a_step_without_either_was():
    support = "L" * 20 + "R" * 20
    assert [p.state for p in support_phases(support, np.full(40, 1.2), RATE)] == ["L", "D", "R"]
    assert [p.state for p in support_phases(support, np.full(40, 3.0), RATE)] == ["L", "F", "R"]


@pytest.mark.parametrize("speed", [1.8, 2.05, 2.5])
def test_between_walking_and_running_the_bounce_decides(speed):
    """Steps without either, and a short gap between contacts: a runner's body is high then, a walker's low."""
    for between, running, walking in (("", "F", "D"), ("FFF", "F", "D"), ("DDD", "F", "D")):
        support = between.join(("L" * 20, "R" * 20, "L" * 20, "R" * 20))
        step = 20 + len(between)
        bounce = 0.02 * np.cos(2 * np.pi * (np.arange(len(support)) - 20) / step)  # high where the feet change
        speeds = np.full(len(support), speed)
        for heights, wanted in ((0.95 + bounce, running), (0.95 - bounce, walking)):
            found = support_phases(support, speeds, RATE, heights)
            assert "".join(p.state for p in found) == f"L{wanted}R{wanted}L{wanted}R"


@pytest.mark.parametrize(("speed", "wanted"), [(1.6, "D"), (2.7, "F")])
def test_beyond_that_the_bounce_decides_nothing(speed, wanted):
    bounce = 0.95 + 0.02 * np.cos(2 * np.pi * (np.arange(80) - 20) / 20)
    for heights in (bounce, 1.9 - bounce):
        found = support_phases("L" * 20 + "R" * 20 + "L" * 20 + "R" * 20, np.full(80, speed), RATE, heights)
        assert "".join(p.state for p in found) == f"L{wanted}R{wanted}L{wanted}R"


@pytest.mark.parametrize("speed", [2.0, 2.2])
def test_where_the_take_ends_the_step_before_tells_running_from_walking(speed):
    """Only a corner of the last gap is seen, and on one side of it no whole stance."""
    support = "FF" + "FFF".join(("L" * 15, "R" * 15, "L" * 15)) + "FF"
    bounce = 0.02 * np.cos(2 * np.pi * (np.arange(len(support)) + 0.5) / 18)
    for heights, wanted in ((0.95 + bounce, "F"), (0.95 - bounce, "D")):
        found = support_phases(support, np.full(len(support), speed), RATE, heights)
        assert "".join(p.state for p in found) == f"{wanted}L{wanted}R{wanted}L{wanted}"


def test_a_stance_that_the_take_cuts_is_measured_by_those_beside_it():
    """In a take that gets slower, the first stances are short and the last are long."""
    lengths = [24, 24, 24, 24, 36, 36, 36, 36]
    edges = np.concatenate(([0], np.cumsum(lengths)))
    phases = [Phase("LR"[i % 2], int(a), int(b)) for i, (a, b) in enumerate(pairwise(edges))]
    frames = phases[-1].stop
    cut = [Phase(phases[0].state, 0, 18), *(Phase(p.state, p.start - 6, p.stop - 6) for p in phases[1:-1])]
    cut.append(Phase(phases[-1].state, phases[-1].start - 6, frames - 15))
    found = find_mid_stances(cut, frames - 15)
    assert found[0] == (18 - 25 / 2, LEFT)
    assert found[-1] == (cut[-1].start + 35 / 2, RIGHT)


# segments of anything


def random_gait(support: str, seed: int):
    planted = np.array([[s in "LDS", s in "RDS"] for s in support])
    contacts = Contacts(planted=planted, standing=np.array([s == "S" for s in support]), floor=0.0)
    t = np.arange(len(support)) / RATE
    heights = 0.95 + 0.02 * np.sin(12.0 * t + seed)
    return find_gait(contacts, heights, np.full(len(support), 1.2), RATE)


@given(SUPPORTS, st.integers(0, 100))
def test_boundaries_are_in_order_and_inside_the_take(support, seed):
    frames = [b.frame for b in random_gait(support, seed).boundaries]
    assert frames == sorted(frames)
    assert not frames or (frames[0] >= 0 and frames[-1] < len(support))


@given(SUPPORTS, st.integers(0, 100))
def test_segments_have_one_key_for_each_change_and_keys_lie_inside(support, seed):
    for s in random_gait(support, seed).segments:
        assert len(s.keys) == len(s.string) - 1
        assert list(s.keys) == sorted(set(s.keys))
        assert all(s.start.frame < key <= s.stop.frame for key in s.keys)
        assert all(a != b for a, b in pairwise(s.string))


@given(SUPPORTS, st.integers(0, 100))
def test_segments_never_overlap_and_run_between_neighbouring_boundaries(support, seed):
    found = random_gait(support, seed)
    neighbours = set(pairwise(found.boundaries))
    assert all((s.start, s.stop) in neighbours and s.frames > 0 for s in found.segments)
    assert all(a.stop.frame <= b.start.frame for a, b in pairwise(found.segments))


@given(SUPPORTS, st.integers(0, 100))
def test_mid_stances_lie_in_stances_and_in_order(support, seed):
    found = random_gait(support, seed)
    frames = [m.frame for m in found.mid_stances]
    assert frames == sorted(frames)
    assert all(0 <= frame <= len(support) - 1 for frame in frames)


# the walker made of formulas


@given(WALKING, CURVATURES, PHASES, st.integers(0, 180))
@settings(max_examples=25)
def test_walking_is_cut_into_half_cycles(speed, curvature, phase, cut):
    walk = gait(np.full(360, speed), curvature=curvature, phase=phase).clip(cut, cut + 120)
    found = analyse(walk.motion).gait.segments
    assert len(found) >= 2
    assert {s.string for s in found} <= {"LDR", "RDL"}
    assert {s.motion for s in found} == {"walk"}
    assert all(a.string != b.string and a.stop == b.start for a, b in pairwise(found))


@given(RUNNING, CURVATURES, PHASES, st.integers(0, 180))
@settings(max_examples=25)
def test_running_is_cut_into_half_cycles(speed, curvature, phase, cut):
    run = gait(np.full(360, speed), curvature=curvature, phase=phase).clip(cut, cut + 120)
    found = analyse(run.motion).gait.segments
    assert len(found) >= 3
    assert {s.string for s in found} <= {"FRF", "FLF"}
    assert {s.motion for s in found} == {"run"}
    assert all(a.string != b.string and a.stop == b.start for a, b in pairwise(found))


@given(st.one_of(WALKING, RUNNING), PHASES)
@settings(max_examples=15)
def test_mid_stances_are_where_they_are(speed, phase):
    walk = gait(np.full(240, speed), phase=phase)
    grid = np.arange(240)
    found = [m for m in analyse(walk.motion).gait.mid_stances if 15 < m.frame < 225]
    assert found
    for m in found:
        angle = np.interp(m.frame, grid, walk.phase) - (np.pi if m.side == RIGHT else 0.0)
        away = (angle + np.pi) % (2 * np.pi) - np.pi
        assert abs(away) < 0.35, "more than a twentieth of a stride from the middle of the stance"
    assert all(a.side != b.side for a, b in pairwise(found))
    assert {m.side for m in found} == {LEFT, RIGHT}


@given(st.floats(0.9, 1.6))
@settings(max_examples=8)
def test_standing_ends_are_boundaries_and_starts_and_stops_are_segments(speed):
    take = gait(ramps((1.0, 0.0), (3.0, speed), (1.0, 0.0), change=1.0))
    found = analyse(take.motion).gait.segments
    motions = [s.motion for s in found]
    assert motions[:2] == ["stand", "stand-walk"]
    assert motions[-2:] == ["walk-stand", "stand"]
    assert set(motions[2:-2]) == {"walk"}
    assert all(a.stop == b.start for a, b in pairwise(found))
    assert [s.string[0] + s.string[-1] for s in (found[0], found[-1])] == ["SS", "SS"]
    assert found[1].string.startswith("S")
    assert found[-2].string.endswith("S")


@pytest.mark.parametrize(("speed", "running"), [(2.0, False), (2.1, False), (2.2, False), (2.0, True), (2.2, True)])
def test_the_sample_person_may_walk_fast_or_run_slowly(speed, running):
    """Cut anywhere, it is one or the other to the last segment."""
    frames = np.full(600, speed)
    take = perform(frames, 0 * frames, running=np.full(600, running), seed=round(10 * speed)).motion
    lawful = {"FLF", "FRF"} if running else {"LDR", "RDL"}
    for start, stop in ((0, 600), *((start, start + 90) for start in range(0, 510, 37))):
        found = strings(take.clip(start, stop))
        assert found
        assert set(found) <= lawful, f"frames {start} to {stop}"


def test_walking_to_running_and_back_is_found():
    take = gait(ramps((2.0, 1.3), (2.0, 3.0), (2.0, 1.3)))
    motions = [s.motion for s in analyse(take.motion).gait.segments]
    order = [motion for i, motion in enumerate(motions) if i == 0 or motions[i - 1] != motion]
    assert order == ["walk", "walk-run", "run", "run-walk", "walk"]


def test_equal_strings_have_equal_numbers_of_keys():
    take = gait(ramps((1.0, 0.0), (2.0, 1.4), (2.0, 3.0), (2.0, 1.3)), curvature=0.2)
    counts: dict[str, set[int]] = {}
    for s in analyse(take.motion).gait.segments:
        counts.setdefault(s.string, set()).add(len(s.keys))
    assert all(len(numbers) == 1 for numbers in counts.values())


def test_mirrored_walk_has_mirrored_strings():
    motion = gait(ramps((1.0, 0.0), (2.0, 1.4), (1.0, 0.0)), curvature=0.3).motion
    assert strings(mirror(motion)) == [string.translate(OTHER) for string in strings(motion)]


# coarse motions in their context


def chain(*kinds: str) -> list[Segment]:
    """Segments that follow each other between boundaries of these kinds, 30 frames each."""
    of = {"S": "stand", "L": "walk", "R": "walk", "FL": "run", "FR": "run"}
    out = []
    for i, (a, b) in enumerate(pairwise(kinds)):
        motion = of[a] if of[a] == of[b] else f"{of[a]}-{of[b]}"
        ends = Boundary(30 * i, a), Boundary(30 * i + 30, b)
        out.append(Segment(start=ends[0], stop=ends[1], string="D", keys=(), motion=motion))
    return out


@pytest.mark.parametrize("kinds", [("S", "S"), ("S", "L", "R", "S"), ("L", "R", "FL", "FR", "FL", "L"), ("FL", "FR")])
def test_gentle_segments_keep_the_motion_of_their_ends(kinds):
    segments = chain(*kinds)
    assert label_motions(segments, [0.2] * len(segments)) == segments


def test_a_few_steps_from_standing_to_running_are_one_transition():
    segments = chain("S", "L", "R", "FL", "FR")
    assert [s.motion for s in label_motions(segments, [0.0] * 4)] == ["stand-run"] * 3 + ["run"]
    back = chain("FR", "FL", "L", "R", "S")
    assert [s.motion for s in label_motions(back, [0.0] * 4)] == ["run"] + ["run-stand"] * 3


def test_a_long_walk_between_standing_and_running_is_walking():
    segments = chain("S", *"LRLRLRL", "FR")
    motions = [s.motion for s in label_motions(segments, [0.0] * len(segments))]
    assert motions == ["stand-walk"] + ["walk"] * 6 + ["walk-run"]


def test_hard_speeding_up_before_running_belongs_to_the_transition():
    segments = chain("L", "R", "L", "R", "FL")
    motions = [s.motion for s in label_motions(segments, [0.0, 2.0, 2.0, 2.0])]
    assert motions == ["walk", "walk-run", "walk-run", "walk-run"]
    braking = chain("FR", "L", "R", "L", "R")
    assert [s.motion for s in label_motions(braking, [-2.0, -2.0, -2.0, 0.0])] == ["run-walk"] * 3 + ["walk"]


def test_a_foot_that_brushes_the_floor_ends_no_run_and_one_flight_begins_none():
    assert {s.motion for s in label_motions(chain("FL", "R", "L", "FR"), [0.0] * 3)} == {"run"}
    assert {s.motion for s in label_motions(chain("L", "FR", "L"), [0.0] * 2)} == {"walk"}


# recordings, looked at by eye

GOLDENS = {
    "16_15": ["walk/LDR", "walk/RDL"] * 3,
    "16_31": ["stand/S", "stand-walk/SR", *["walk/RDL", "walk/LDR"] * 2, "walk/RDL"],
    "16_33": ["walk/RDL", "walk/LDR", "walk-stand/RS", "stand/S"],
    "16_55": ["walk-run/RDL", "walk-run/LF", "run/FRF", "run/FLF", "run/FRF"],
    "127_04": ["stand/S", "stand-run/SL", "stand-run/LDR", "stand-run/RDL", "stand-run/LF", "run/FRF", "run/FLF"],
}


@pytest.mark.parametrize("take", sorted(GOLDENS))
def test_strings_of_recordings(mocap, take):
    found = analyse(load_motion(mocap / "cmu" / take.split("_")[0] / f"{take}.amc")).gait.segments
    assert [s.group for s in found] == GOLDENS[take]
    assert all(a.stop == b.start for a, b in pairwise(found)), "no hole between segments"


def test_segments_cover_nine_tenths_of_the_recorded_seconds(mocap):
    covered = seconds = 0.0
    for take in GOLDENS:
        motion = load_motion(mocap / "cmu" / take.split("_")[0] / f"{take}.amc")
        covered += sum(s.frames for s in analyse(motion).gait.segments) / motion.frame_rate
        seconds += motion.seconds
    assert covered / seconds > 0.9
