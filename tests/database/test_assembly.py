from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, RotationSpline

from bodies import standing
from databases import analysed, database_of, swapped, takes_of
from stridecast.analysis.bounds import METHODS
from stridecast.analysis.take import analyse
from stridecast.body.mirroring import mirror
from stridecast.database.assembly import GENERIC, AnalysedTake, assemble, warp
from stridecast.errors import TakeError
from stridecast.formats.recordings import load_motion
from stridecast.geometry import ground
from stridecast.geometry import quaternions as quat
from stridecast.model.database import INTERVALS, MARGIN, ROWS, MotionDatabase
from stridecast.synthesis.blend_kernels import blended, seconds_per_generic
from stridecast.synthesis.state import State, make_state
from stridecast.synthesis.tables import Tables, make_tables
from synthetic_gait import gait, ramps

FIRST, LAST = MARGIN, MARGIN + INTERVALS
"""Rows of an example's first and last frame."""


def source_of(database: MotionDatabase, sources: list[AnalysedTake], example: int) -> AnalysedTake:
    take, mirrored = int(database.examples.takes[example]), bool(database.examples.mirrored[example])
    return next(s for s in sources if s.take == take and s.mirrored == mirrored)


def frames_of(database: MotionDatabase, source: AnalysedTake, example: int) -> np.ndarray:
    """Frames of the recording, with fractions, at which an example is sampled."""
    rate = source.analysis.motion.frame_rate
    return database.examples.first_frames[example] + database.examples.times[example] * rate


def rotations_of(database: MotionDatabase, features: np.ndarray) -> np.ndarray:
    bones = len(database.references)
    return quat.multiply(database.references, quat.exp(features[..., : 3 * bones].reshape(*features.shape[:-1], -1, 3)))


def apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(quat.log(quat.multiply(quat.inverse(a), b))).max())


# the warp that lays keys onto keys


def shares(count: int, seed: int) -> np.ndarray:
    """Increasing places between 0 and 1, not too near each other."""
    gaps = np.random.default_rng(seed).uniform(0.1, 1.0, count + 1)
    return np.cumsum(gaps)[:-1] / gaps.sum()


@given(st.integers(0, 7), st.integers(0, 10_000), st.integers(0, 10_000), st.floats(10.0, 200.0))
def test_warp_is_monotone_from_end_to_end(count, seed, other, length):
    times = warp(shares(count, seed), length * shares(count, other), length)
    assert len(times) == ROWS
    assert (np.diff(times) > 0).all()
    assert times[FIRST] == 0.0
    assert times[LAST] == pytest.approx(length)


@given(st.integers(1, 7), st.integers(0, 10_000), st.integers(0, 10_000), st.floats(10.0, 200.0))
def test_warp_lays_own_keys_onto_those_of_the_group(count, seed, other, length):
    keys, own = shares(count, seed), length * shares(count, other)
    times = warp(keys, own, length)
    for key, at in zip(keys, own, strict=True):
        before, after = times[key >= GENERIC][-1], times[key <= GENERIC][0]
        assert before - 1e-9 <= at <= after + 1e-9


@given(st.integers(0, 7), st.integers(0, 10_000), st.floats(10.0, 200.0))
def test_warp_of_keys_in_the_groups_places_is_even(count, seed, length):
    keys = shares(count, seed)
    np.testing.assert_allclose(warp(keys, length * keys, length), length * GENERIC, atol=1e-9 * length)


@given(st.integers(1, 7), st.integers(0, 10_000))
def test_keys_at_the_very_ends_still_leave_time_running(count, seed):
    own = np.sort(np.random.default_rng(seed).choice([0.0, 50.0], count))
    assert (np.diff(warp(shares(count, seed), own, 50.0)) > 0).all()


# groups


def test_groups_are_stretches_of_the_tables(learned):
    first = 0
    for group in learned.groups:
        assert group.first == first
        assert group.count > 0
        first += group.count
    assert first == len(learned.examples.durations)
    assert len({group.name for group in learned.groups}) == len(learned.groups)


def test_group_names_tell_motion_and_string(learned):
    for group in learned.groups:
        assert group.name == f"{group.motion}/{group.string}"
        assert len(group.keys) == len(group.string) - 1


def test_keys_of_groups_increase_between_first_and_last_frame(learned):
    for group in learned.groups:
        edges = np.array([0.0, *group.keys, 1.0])
        assert (np.diff(edges) > 0).all()


def test_keys_of_examples_lie_on_the_keys_of_their_group(learned, sources):
    """What makes segments with equal strings blend without search."""
    for group in learned.groups:
        for example in range(group.rows.start, group.rows.stop):
            source = source_of(learned, sources, example)
            own = next(
                s
                for s in source.analysis.gait.segments
                if s.start.frame <= learned.examples.first_frames[example] < s.stop.frame and s.string == group.string
            )
            frames = frames_of(learned, source, example)
            least = 0.02 * own.frames * (len(own.keys) + 1)  # keys at the very ends are moved inwards by so much
            for key, frame in zip(group.keys, own.keys, strict=True):
                before, after = frames[key >= GENERIC][-1], frames[key <= GENERIC][0]
                assert before - least <= frame <= after + least


def test_members_of_a_group_run_between_the_same_kinds_of_boundaries(sources):
    kinds: dict[str, set[tuple[str, str]]] = {}
    for source in sources:
        for s in source.analysis.gait.segments:
            kinds.setdefault(s.group, set()).add((s.start.kind, s.stop.kind))
    assert {name: len(found) for name, found in kinds.items() if len(found) > 1} == {}


def test_every_group_has_its_mirror_image_with_as_many_examples(learned):
    for group in learned.groups:
        other = learned.group(swapped(group.name))
        assert other.count == group.count
        assert other.bounds.jerk == pytest.approx(group.bounds.jerk)
        assert other.bounds.lateral_per_speed == pytest.approx(group.bounds.lateral_per_speed)
        np.testing.assert_allclose(other.bounds.tangential, group.bounds.tangential, atol=1e-9)
        np.testing.assert_allclose(other.bounds.speed, group.bounds.speed, atol=1e-9)
        np.testing.assert_allclose(other.keys, group.keys, atol=1e-9)


def test_mirrored_examples_steer_the_other_way(learned):
    examples = learned.examples
    for group in learned.groups:
        own, other = group.rows, learned.group(swapped(group.name)).rows
        mine = examples.parameters[own][~examples.mirrored[own]]
        theirs = examples.parameters[other][examples.mirrored[other]] * [1.0, 1.0, -1.0]
        np.testing.assert_allclose(mine[np.lexsort(mine.T)], theirs[np.lexsort(theirs.T)], atol=1e-6)


# examples


def test_examples_give_their_recording_back(learned, sources):
    """At the first and last frame exactly, between frames as a smooth curve through the recorded rotations says."""
    worst, curves = 0.0, {}
    for example in range(0, len(learned.examples.durations), 3):
        source = source_of(learned, sources, example)
        motion = source.analysis.motion
        shown = rotations_of(learned, learned.examples.features[example])
        frames = frames_of(learned, source, example)
        for row in (FIRST, LAST):
            frame = round(frames[row])
            assert frames[row] == pytest.approx(frame, abs=1e-6)
            assert apart(shown[row], motion.rotations[frame, 1:]) < 1e-6
        if id(motion) not in curves:
            turned = [Rotation.from_quat(joint, scalar_first=True) for joint in motion.rotations[:, 1:].swapaxes(0, 1)]
            curves[id(motion)] = [RotationSpline(np.arange(motion.frames), joint) for joint in turned]
        for row in range(FIRST, LAST + 1):
            at = min(frames[row], motion.frames - 1)
            between = np.array([curve(at).as_quat(scalar_first=True) for curve in curves[id(motion)]])
            worst = max(worst, apart(shown[row], between))
    assert worst < 0.01


def test_examples_hold_the_details_of_their_recording(learned, sources):
    for example in range(0, len(learned.examples.durations), 3):
        source = source_of(learned, sources, example)
        details, frames = source.analysis.details, frames_of(learned, source, example)
        features = learned.examples.features[example]
        for row in (FIRST, LAST):
            frame = round(frames[row])
            assert apart(quat.exp(features[row, -7:-4]), details.offsets[frame]) < 1e-6
            np.testing.assert_allclose(features[row, -4:-1], details.displacements[frame], atol=1e-6)
            np.testing.assert_allclose(ground.wrap(features[row, -1:] - details.yaws[frame]), 0.0, atol=1e-6)


def test_examples_tell_how_their_vehicle_went(learned, sources):
    for example in range(len(learned.examples.durations)):
        source = source_of(learned, sources, example)
        vehicle, rate = source.analysis.vehicle, source.analysis.motion.frame_rate
        start = int(learned.examples.first_frames[example])
        stop = start + round(learned.examples.durations[example] * rate)
        expected = [vehicle.speeds[start], vehicle.tangential[start], vehicle.lateral[start]]
        np.testing.assert_allclose(learned.examples.parameters[example], expected)
        travelled = learned.examples.travelled[example]
        np.testing.assert_allclose(travelled[FIRST, :3], 0.0, atol=1e-9)
        there = vehicle.positions[start] + ground.turn(travelled[LAST, :2], np.array(vehicle.headings[start]))
        np.testing.assert_allclose(there, vehicle.positions[stop], atol=1e-6)
        assert travelled[LAST, 2] == pytest.approx(vehicle.headings[stop] - vehicle.headings[start], abs=1e-6)
        assert travelled[LAST, 3] == pytest.approx(vehicle.speeds[stop], abs=1e-6)


def test_frame_rate_of_a_recording_changes_what_is_learned_only_a_little():
    low, high = (database_of({"take": gait(np.full(int(3 * rate), 1.3), rate=rate).motion}) for rate in (60.0, 120.0))
    assert [g.name for g in low.groups] == [g.name for g in high.groups]
    for a, b in zip(low.groups, high.groups, strict=True):
        np.testing.assert_allclose(a.keys, b.keys, atol=0.06)
        durations = [d.examples.durations[g.rows].mean() for d, g in ((low, a), (high, b))]
        assert durations[0] == pytest.approx(durations[1], abs=0.02)


# blending


@pytest.fixture(scope="module")
def blending(learned) -> tuple[Tables, State]:
    tables = make_tables(learned)
    return tables, make_state(1, tables)


def choose(state: State, examples: list[int], weights: list[float]) -> None:
    state.weights[0] = 0.0
    state.weights[0, : len(weights)] = weights
    state.chosen[0, : len(examples)] = examples


def test_an_example_with_all_the_weight_gives_its_own_frames_back(learned, blending):
    tables, state = blending
    out = np.empty(tables.features.shape[2])
    for example in range(0, len(learned.examples.durations), 7):
        choose(state, [example], [1.0])
        for row in range(FIRST, LAST + 1):
            blended(tables, state, 0, (row - FIRST) / INTERVALS, out)
            np.testing.assert_allclose(out, learned.examples.features[example, row], atol=1e-9)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.integers(0, 1000))
def test_blending_is_a_weighted_sum(blending, share, generic, seed):
    tables, state = blending
    a, b = np.random.default_rng(seed).integers(0, len(tables.durations), 2).tolist()
    parts = np.empty((3, tables.features.shape[2]))
    for out, weights in zip(parts, ([1.0, 0.0], [0.0, 1.0], [share, 1.0 - share]), strict=True):
        choose(state, [a, b], weights)
        blended(tables, state, 0, generic, out)
    np.testing.assert_allclose(parts[2], share * parts[0] + (1.0 - share) * parts[1], atol=1e-9)


def test_an_example_with_all_the_weight_lasts_as_long_as_it_did(learned, blending):
    tables, state = blending
    for example in range(0, len(learned.examples.durations), 7):
        choose(state, [example], [1.0])
        slopes = []
        for generic in (np.arange(400) + 0.5) / 400:
            state.generic[0] = generic
            slopes.append(seconds_per_generic(tables, state, 0))
        assert np.mean(slopes) == pytest.approx(learned.examples.durations[example], rel=0.02)


# takes and what became of them


def test_order_of_takes_does_not_matter():
    motions = {
        "walk": gait(np.full(150, 1.3)).motion,
        "turn": gait(np.full(150, 1.1), curvature=0.6).motion,
        "start": gait(ramps((0.8, 0.0), (2.0, 1.3), change=1.0)).motion,
    }
    one, other = (database_of(dict(order)) for order in (motions.items(), reversed(motions.items())))
    assert [(g.name, g.count) for g in one.groups] == [(g.name, g.count) for g in other.groups]
    for a, b in zip(one.groups, other.groups, strict=True):
        assert a.bounds.jerk == pytest.approx(b.bounds.jerk)
        assert a.bounds.lateral_per_speed == pytest.approx(b.bounds.lateral_per_speed)
        mine, theirs = (np.sort(d.examples.durations[g.rows]) for d, g in ((one, a), (other, b)))
        np.testing.assert_allclose(mine, theirs)
    assert apart(one.references, other.references) < 1e-6


def test_segments_of_each_take_are_counted_once(learned):
    original = ~learned.examples.mirrored
    counts = np.bincount(learned.examples.takes[original], minlength=len(learned.takes))
    assert [take.segments for take in learned.takes] == counts.tolist()
    assert all(take.segments > 0 for take in learned.takes)


def test_walking_backwards_is_left_out_with_the_reason():
    forward = gait(np.full(150, 1.1)).motion
    backward = replace(
        forward, root_positions=forward.root_positions[::-1], rotations=forward.rotations[::-1], name="back"
    )
    database = database_of({"forward": forward, "backward": backward})
    assert database.takes[0].segments > 0
    assert database.takes[0].left_out == ()
    assert database.takes[1].segments == 0
    assert database.takes[1].left_out
    assert all("backwards" in reason for reason in database.takes[1].left_out)


def test_nothing_to_learn_from_is_refused():
    walk = analyse(gait(np.full(90, 1.3)).motion)
    empty = replace(walk, gait=replace(walk.gait, segments=()))
    with pytest.raises(TakeError, match="learn from"):
        assemble([AnalysedTake(analysis=empty, take=0)], takes_of({"none": empty.motion}))


def test_a_person_who_stands_like_a_statue_can_be_learned_from():
    database = database_of({"statue": standing(frames=120, frame_rate=60.0)})
    assert [g.name for g in database.groups] == ["stand/S"]


def test_mirroring_is_a_choice():
    motions = {"walk": gait(np.full(150, 1.3)).motion}
    alone = assemble(analysed(motions, mirrored=False), takes_of(motions))
    both = assemble(analysed(motions), takes_of(motions))
    assert 2 * len(alone.examples.durations) == len(both.examples.durations)
    assert not alone.examples.mirrored.any()


@pytest.mark.parametrize("method", METHODS)
def test_method_of_bounds_is_remembered(method, sources):
    database = assemble(sources[:2], takes_of({"stand and walk": sources[0].analysis.motion}), bounds_method=method)
    assert database.bounds_method == method


@given(st.integers(0, 1000))
@settings(max_examples=3)
def test_tables_cannot_be_written_to(learned, seed):
    rng = np.random.default_rng(seed)
    with pytest.raises(ValueError, match="read-only"):
        learned.examples.features[rng.integers(len(learned.examples.features))] = 0.0


def test_recorded_segments_become_groups_with_equal_boundaries(mocap):
    kinds: dict[str, set[tuple[str, str]]] = {}
    for take in ("16_15", "16_31", "16_33", "16_55", "16_08", "127_04", "127_03", "16_41"):
        analysis = analyse(load_motion(mocap / "cmu" / take.split("_")[0] / f"{take}.amc"))
        for understood in (analysis, analyse(mirror(analysis.motion))):
            for s in understood.gait.segments:
                kinds.setdefault(s.group, set()).add((s.start.kind, s.stop.kind))
    assert {name: len(found) for name, found in kinds.items() if len(found) > 1} == {}
