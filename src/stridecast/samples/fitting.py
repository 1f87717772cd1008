"""Recordings to a gait model: observe each take, bring takes to one phase, fit what is common to all people.

python -m stridecast.samples.fitting RECORDINGS... -o gait.safetensors --leave-out 08_05 --standing 16 127
"""

from __future__ import annotations

import argparse
import logging
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from stridecast.building.sources import FileSource, collect
from stridecast.errors import InputError, TakeError
from stridecast.formats.recordings import load_motion
from stridecast.geometry import quaternions as quat
from stridecast.samples.adult import standing_height
from stridecast.samples.gait import DETAILS, FEET, RHYTHM, GaitModel, GaitTable, fourier, save_gait
from stridecast.samples.observation import Observation, observe_both

log = logging.getLogger("stridecast")

Array = np.ndarray

HARMONICS = 5

WALKING = (0.6, 2.0)
RUNNING = (2.0, 4.5)
"""Speeds of the two gaits, m/s: the middle and the unit of their speed features."""

STRONGEST = {"walk": (1.7, 1.2), "run": (1.7, 2.5)}
"""Turn (rad/s) and acceleration (m/s2) up to which there are enough examples."""

STIFFNESS = np.array([0.0, 0.01, 0.05, 0.01, 0.01, 0.02, 0.02, 0.5, 0.02, 0.02])
"""How little each feature (see ``GaitTable.features``) is believed, as a share of its weight in the data."""

LIKENESS = 0.05
"""The same for what a person does differently from others."""

ROUGHNESS = 0.05
"""A harmonic is believed less the higher it is, by this times its square."""

TAIL = 2.5
"""A half cycle further off than this many times the median counts less, the more the further it is (Huber)."""


def fit(observations: Sequence[Observation], *, standing: Collection[str] = (), provenance: str = "") -> GaitModel:
    """Fit a model to what takes show.

    Parameters
    ----------
    observations
        Of takes and of their mirror images: the model's left and right are alike only if the observations are.
    standing
        Subjects whose standing is plain standing; all if empty.
    provenance
        Words about the recordings.

    Raises
    ------
    TakeError
        Nobody walks, nobody runs, or nobody stands.
    """
    references = quat.mean(np.concatenate([o.joints[::8] for o in observations]))
    tables = {}
    for name, speeds in (("walk", WALKING), ("run", RUNNING)):
        turn, acceleration = STRONGEST[name]
        chosen = [
            _frames(o, references, (o.running == (name == "run")) & (np.abs(o.accelerations) < 1.3 * acceleration))
            for o in observations
        ]
        chosen = [c for c in chosen if len(c.speeds)]
        if not chosen:
            raise TakeError(f"nobody {name}s in these recordings")
        stances = np.concatenate([o.stances for o in observations])
        blank = GaitTable(
            coefficients=np.zeros((0, 0, 0)),
            rhythm=np.zeros(0),
            contacts=np.zeros((2, 2)),
            speeds=speeds,
            turn=turn,
            acceleration=acceleration,
        )
        tables[name] = _fit_gait(blank, chosen, stances[stances[:, 3] == (name == "run")])
    still = [o for o in observations if len(o.standing_rest) and (not standing or o.subject in standing)]
    if not still:
        raise TakeError("nobody stands in these recordings")
    takes = {o.take for o in observations}
    return GaitModel(
        references=references,
        walk=tables["walk"],
        run=tables["run"],
        stand=_stand(still, references),
        provenance={
            "recordings": provenance,
            "takes": sorted(takes),
            "subjects": sorted({o.subject for o in observations}),
        },
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Frames:
    """Frames of one take and gait."""

    subject: str
    phases: Float[Array, "frames"]
    speeds: Float[Array, "frames"]
    turns: Float[Array, "frames"]
    accelerations: Float[Array, "frames"]
    steps: Float[Array, "frames"]
    strides: Float[Array, "frames"]
    channels: Float[Array, "frames channels"]


def _frames(o: Observation, references: Float[Array, "joints 4"], wanted: Bool[Array, "frames"]) -> _Frames:
    return _Frames(
        subject=o.subject,
        phases=o.phases[wanted],
        speeds=o.speeds[wanted],
        turns=o.turns[wanted],
        accelerations=o.accelerations[wanted],
        steps=o.steps[wanted],
        strides=o.strides[wanted],
        channels=_channels(o.joints[wanted], o.rest[wanted], references),
    )


def _channels(joints: Array, rest: Array, references: Float[Array, "joints 4"]) -> Float[Array, "frames channels"]:
    tangents = quat.log(quat.multiply(quat.inverse(references), joints))
    return np.concatenate((tangents.reshape(len(joints), 3 * len(references)), rest), axis=-1)


def _fit_gait(blank: GaitTable, takes: Sequence[_Frames], stances: Float[Array, "stances 4"]) -> GaitTable:
    """Ridge regression.

    What a person does differently is fitted beside what is common, so that it does not pass for an effect of speed.
    """
    usual = np.concatenate([blank.features(t.speeds, t.turns, t.accelerations, 0 * t.speeds) for t in takes])
    waves = np.concatenate([fourier(t.phases, HARMONICS) for t in takes])
    wanted = np.concatenate([t.channels for t in takes])
    people = sorted({t.subject for t in takes})
    who = np.concatenate([np.full(len(t.speeds), people.index(t.subject)) for t in takes])
    cycles = _numbered(takes)
    own = np.eye(len(people))[who]

    strides = np.log(np.concatenate([t.strides for t in takes]))
    column = np.concatenate((usual[:, RHYTHM], own), axis=1)
    rhythm = _regress(column, strides, _balanced(usual, cycles), len(RHYTHM))
    accelerations = np.concatenate([t.accelerations for t in takes])
    speeds, turns = (np.concatenate([getattr(t, name) for t in takes]) for name in ("speeds", "turns"))
    given = blank.features(speeds, turns, accelerations, strides - usual[:, RHYTHM] @ rhythm)

    weights = _balanced(given, cycles)
    features, terms = given.shape[1], waves.shape[1]
    columns = np.concatenate((given, own), axis=1)
    design = (columns[:, :, None] * waves[:, None]).reshape(len(given), -1)
    harmonics = (np.arange(terms) + 1) // 2
    stiffness = np.concatenate((STIFFNESS, np.full(len(people), LIKENESS)))
    roughness = 1.0 + ROUGHNESS * harmonics**2
    for _ in range(4):
        weighted = design * weights[:, None]
        size = stiffness * (weights @ columns**2)
        penalty = np.outer(size, roughness).ravel() + 1e-5 * weights.sum()
        solved = np.linalg.solve(weighted.T @ design + np.diag(penalty), weighted.T @ wanted)
        far = _distance(design @ solved - wanted, cycles)
        weights = _balanced(given, cycles) * np.minimum(1.0, TAIL * np.median(far) / far)[cycles]
    solved = solved.reshape(-1, terms, wanted.shape[1])
    coefficients = solved[:features]
    coefficients[0] += np.median(solved[features:], axis=0)  # one odd person must not bend the rest

    low, high = blank.speeds
    u = (np.clip(stances[:, 0], low, high) - (low + high) / 2) / ((high - low) / 2)
    line = np.stack((np.ones_like(u), u), axis=-1)
    contacts = np.stack([_regress(line, stances[:, column], np.ones(len(u)), 2) for column in (1, 2)])
    return GaitTable(
        coefficients=coefficients,
        rhythm=rhythm,
        contacts=contacts,
        speeds=blank.speeds,
        turn=blank.turn,
        acceleration=blank.acceleration,
    )


def _numbered(takes: Sequence[_Frames]) -> Array:
    """A number for each half cycle of all takes."""
    names = np.concatenate([np.stack((np.full(len(t.steps), i), t.steps), axis=-1) for i, t in enumerate(takes)])
    return np.unique(names, axis=0, return_inverse=True)[1].ravel()


def _balanced(given: Float[Array, "frames features"], cycles: Array) -> Float[Array, "frames"]:
    """Weights: every half cycle counts alike, and rare speeds, turns and accelerations more than common ones."""
    length = np.bincount(cycles)
    means = np.stack([np.bincount(cycles, given[:, f]) / length for f in (1, 3, 6)], axis=-1)
    cells = np.round(means / [0.25, 0.3, 0.5]).astype(int)
    _, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    return (1.0 / np.sqrt(counts[cell.ravel()]) / length)[cycles]


def _distance(missed: Float[Array, "frames channels"], cycles: Array) -> Float[Array, "cycles"]:
    """How far each half cycle is from the fit, root mean square over its channels."""
    squares = np.bincount(cycles, np.mean(missed**2, axis=1))
    return np.sqrt(squares / np.bincount(cycles)) + 1e-12


def _regress(design: Array, wanted: Array, weights: Array, count: int) -> Array:
    """Regress robustly, with a whisper of ridge; the first ``count`` coefficients."""
    spread = weights
    for _ in range(10):
        weighted = design * spread[:, None]
        ridge = 1e-3 * spread.sum() * np.eye(design.shape[1])
        ridge[0, 0] = 1e-9
        solved = np.linalg.solve(weighted.T @ design + ridge, weighted.T @ wanted)
        missed = np.abs(design @ solved - wanted)
        spread = weights * np.minimum(1.0, 1.5 * np.median(missed) / np.maximum(missed, 1e-12))
    return solved[:count]


def _stand(observations: Iterable[Observation], references: Float[Array, "joints 4"]) -> Float[Array, "channels"]:
    """Median posture over people; the vehicle stands under the pelvis, and the knees are hardly bent.

    How far recorded knees are bent in standing is chance: an ankle a centimetre too high makes 20 degrees.
    """
    people = defaultdict(list)
    for o in observations:
        people[o.subject].append(np.median(_channels(o.standing_joints, o.standing_rest, references), axis=0))
    stand = np.median([np.mean(postures, axis=0) for postures in people.values()], axis=0)
    stand[[-DETAILS, -DETAILS + 2, -DETAILS + 3]] = 0.0
    stand[-DETAILS - FEET : -DETAILS].reshape(2, 3)[:, [0, 2]] = 0.0
    stand[-DETAILS + 1] = standing_height()
    return stand


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit a model to recordings and write it; what was used and left out, and how well it fits, is logged."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    parser = argparse.ArgumentParser(prog="python -m stridecast.samples.fitting", description="Fit a gait model.")
    parser.add_argument("sources", nargs="+", type=Path, help="recordings, or folders of them")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the model, *.safetensors")
    parser.add_argument("--leave-out", nargs="*", default=[], metavar="TAKE", help="names of takes not to learn from")
    parser.add_argument("--standing", nargs="*", default=[], metavar="PERSON", help="whose standing is plain; else all")
    parser.add_argument("--provenance", default="", help="words about the recordings")
    options = parser.parse_args(arguments)
    observations, seen = [], set[str]()
    for path in [source.path for source in collect(options.sources) if isinstance(source, FileSource)]:
        name = path.stem
        if name in options.leave_out or name in seen:
            continue
        try:
            found = observe_both(load_motion(path), name)
        except InputError as error:
            log.info("%s left out: %s", path, error)
            continue
        observations += found
        seen.add(name)
    model = fit(observations, standing=options.standing, provenance=options.provenance)
    for line in judge(model, observations):
        log.info(line)
    save_gait(options.output, model)
    log.info("%d takes of %s: %s", len(seen), ", ".join(model.provenance["subjects"]), options.output)


def judge(model: GaitModel, observations: Sequence[Observation]) -> list[str]:
    """Say how far the takes are from the model, each take's own mean aside: a line for each gait."""
    lines = []
    for name, table in (("walk", model.walk), ("run", model.run)):
        angles, places = [], []
        for o in observations:
            frames = o.running == (name == "run")
            if frames.sum() < 10:
                continue
            shown = _frames(o, model.references, frames)
            hurries = np.log(shown.strides / table.strides(shown.speeds, shown.turns, shown.accelerations))
            missed = shown.channels - table.channels(
                shown.phases, shown.speeds, shown.turns, shown.accelerations, hurries
            )
            missed = missed - missed.mean(axis=0)
            joints = missed[:, : -FEET - DETAILS].reshape(len(missed), -1, 3)
            angles.append(float(np.median(np.linalg.norm(joints, axis=-1))))
            places.append(np.sqrt(np.mean(missed[:, -DETAILS : -DETAILS + 3] ** 2, axis=0)))
        if angles:
            sway, bounce, surge = 1000 * np.median(places, axis=0)
            lines.append(
                f"{name}: joints {np.degrees(np.median(angles)):.1f} degrees, pelvis {sway:.0f} mm sideways, "
                f"{bounce:.0f} mm up, {surge:.0f} mm forward (medians over {len(angles)} takes and mirror images)"
            )
    return lines


if __name__ == "__main__":
    main()
