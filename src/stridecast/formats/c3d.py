"""C3D recordings: markers or joint centres to a skeleton of the person, posed.

Read are labelled joint centres, and the marker sets Plug-in Gait, Helen Hayes and CMU's 41 (and others that have their
markers). Not read: rotations of segments (Theia), clusters without the spines of the pelvis, unlabelled points, static
trials for calibration, forces and other analogue channels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import PchipInterpolator

from stridecast.body.joint_centres import BodyPoints, Widths, across, bend_axis, body_of_markers, level_sole, unit
from stridecast.body.rig import RawRecording
from stridecast.body.segments import solve
from stridecast.errors import FileError, MotionError
from stridecast.formats.c3d_file import C3dPoints, read_c3d_points
from stridecast.formats.marker_names import (
    CENTRES,
    KNOWN,
    MARKERS,
    NEEDED_CENTRES,
    NEEDED_MARKERS,
    found_in,
    subjects_of,
)
from stridecast.geometry import signals

Array = np.ndarray

LONGEST_GAP = 0.25
"""A marker of pelvis or leg may be gone for so long, seconds: its way is then drawn through; else the take is cut."""

UNITS = {"m": 1.0, "meter": 1.0, "meters": 1.0, "metres": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "inch": 0.0254}
"""Metres in one unit of POINT:UNITS."""

_WIDTHS = {"KNEEWIDTH": "knee", "ANKLEWIDTH": "ankle", "ELBOWWIDTH": "elbow"}


def read_c3d(path: str | Path, *, scale: float | None = None) -> RawRecording:
    """Read a C3D file as a posed skeleton.

    Parameters
    ----------
    path
        The file.
    scale
        Metres per unit of the file. Left out: what the file says, else millimetres.

    Returns
    -------
    RawRecording
        In metres, in the axes of the file. Frames before and after those
        in which all markers of pelvis and legs are known are left out, and a note says so.

    Raises
    ------
    FileError
        The file is no C3D file, is damaged, or has no markers that are known.
    MotionError
        Its markers are gone for so long that hardly anything is left.
    """
    file = read_c3d_points(path)
    notes: list[str] = []
    names, centres_given = _named(path, file, notes)
    metres = _metres(file, notes) if scale is None else scale
    points = {name: file.points[:, index] * metres for name, index in names.items()}
    needed = [name for name in (NEEDED_CENTRES if centres_given else (*NEEDED_MARKERS, *_back(names))) if name in names]
    filled = _filled(path, points, needed, file.frame_rate, notes)
    body = _body_of_centres(filled) if centres_given else body_of_markers(filled, _widths(file))
    recording, error = solve(body, file.frame_rate)
    what = "joint centres" if centres_given else "joints that the markers give"
    notes.append(f"a skeleton was fitted; its joints are {1000 * error:.0f} mm off the {what}")
    return replace(recording, notes=tuple(notes))


def _back(names: Mapping[str, int]) -> tuple[str, ...]:
    return ("sacrum",) if "sacrum" in names else ("left_psis", "right_psis")


def _named(path: str | Path, file: C3dPoints, notes: list[str]) -> tuple[dict[str, int], bool]:
    """Which point is what, of the first subject that has all that is needed, and whether they are joint centres."""
    labels = {index: label for index, label in enumerate(file.labels) if label and file.points[:, index].any()}
    seen = {index: label for index, label in labels.items() if np.isfinite(file.points[:, index]).any()}
    best: list[str] = []
    subjects = subjects_of(seen.values())
    for subject in subjects:
        own = {index: label for index, label in seen.items() if label.rpartition(":")[0] == subject}
        centres, markers = found_in(own, CENTRES), found_in(own, MARKERS)
        lacking = [name for name in NEEDED_MARKERS if name not in markers]
        if "sacrum" not in markers and not {"left_psis", "right_psis"} <= set(markers):
            lacking.append("left_psis and right_psis, or sacrum")
        if not lacking:
            _tell_others(subjects, subject, notes)
            return markers, False
        if all(name in centres for name in NEEDED_CENTRES):
            _tell_others(subjects, subject, notes)
            return centres, True
        best = lacking if not best or len(lacking) < len(best) else best
    have = ", ".join(repr(label[:20]) for label in list(seen.values())[:20]) or "no label"
    raise FileError(
        f"has no markers that are known ({KNOWN}): {', '.join(best) or 'all'} is missing; it has {have}", path=path
    )


def _tell_others(subjects: list[str], subject: str, notes: list[str]) -> None:
    others = [name for name in subjects if name not in (subject, "")]
    if others:
        notes.append(f"only {subject or 'the subject without a name'} is read, not {', '.join(others)}")


def _metres(file: C3dPoints, notes: list[str]) -> float:
    said = file.parameters.get("POINT:UNITS", ())
    found = UNITS.get(str(said[0]).strip().lower()) if said else None
    if found is None:
        notes.append("the file names no unit that is known; lengths are taken for millimetres")
    return found or 0.001


def _widths(file: C3dPoints) -> Widths:
    """Widths of joints that Vicon has noted down, in millimetres; usual ones where they are missing."""
    found: dict[str, Any] = {}
    for word, name in _WIDTHS.items():
        sides = [file.parameters.get(f"PROCESSING:{side}{word}", ()) for side in ("L", "R")]
        values = [float(side[0]) for side in sides if len(side) == 1 and not isinstance(side[0], str)]
        if len(values) == 2 and all(10.0 < value < 250.0 for value in values):
            found[name] = (0.001 * values[0], 0.001 * values[1])
    return replace(Widths(), **found)


def _filled(
    path: str | Path, points: Mapping[str, Array], needed: list[str], rate: float, notes: list[str]
) -> dict[str, Float[Array, "frames 3"]]:
    """All points without gaps, over the longest stretch in which those that are needed have short gaps only."""
    longest = max(int(LONGEST_GAP * rate), 1)
    frames = len(next(iter(points.values())))
    usable = np.ones(frames, bool)
    for name in needed:
        usable &= _reachable(np.isfinite(points[name][:, 0]), longest)
    stretches = [(stop - start, start, stop) for good, start, stop in signals.runs(usable) if good]
    length, start, stop = max(stretches, default=(0, 0, 0))
    if length < 2:
        worst = min(needed, key=lambda name: np.isfinite(points[name][:, 0]).sum())
        share = 100 * np.isfinite(points[worst][:, 0]).mean()
        raise MotionError(
            f"{path}: no two frames have all markers of pelvis and legs; {worst} is seen in {share:.0f} % of the frames"
        )
    if length < frames:
        gone = ", ".join(name for name in needed if not _reachable(np.isfinite(points[name][:, 0]), longest).all())
        notes.append(
            f"frames {start} to {stop - 1} of {frames} are used: elsewhere {gone} is not seen for more than "
            f"{LONGEST_GAP:g} s"
        )
    out, told = {}, []
    for name, places in points.items():
        part = places[start:stop]
        known = np.isfinite(part[:, 0])
        if known.all():
            out[name] = part
        elif name in needed or known.mean() > 0.5:
            out[name] = _through(part, known)
            told.append(f"{name} {np.count_nonzero(~known)}")
        else:
            told.append(f"{name} (left out)")
    if told:
        notes.append(f"frames in which a marker was not seen and its way was filled in: {', '.join(told)}")
    return out


def _reachable(known: Bool[Array, "frames"], longest: int) -> Bool[Array, "frames"]:
    """Frames that are known or in a gap that is short and has two ends."""
    out = known.copy()
    for good, start, stop in signals.runs(known):
        if not good and stop - start <= longest and start > 0 and stop < len(known):
            out[start:stop] = True
    return out


def _through(places: Float[Array, "frames 3"], known: Bool[Array, "frames"]) -> Float[Array, "frames 3"]:
    """Draw a smooth way through gaps; before the first and after the last place it rests."""
    frames = np.arange(len(places))
    at = np.flatnonzero(known)
    if len(at) < 2:
        return np.tile(places[at[0]], (len(places), 1))
    inside = PchipInterpolator(frames[at], places[at])(np.clip(frames, at[0], at[-1]))
    return np.where(known[:, None], places, inside)


def _body_of_centres(points: Mapping[str, Array]) -> BodyPoints:
    """Joints that a laboratory has found; directions come from the joints themselves."""
    centres = {name: place for name, place in points.items() if not name.endswith("_heel")}
    left = unit(centres["left_thigh"] - centres["right_thigh"])
    hips = 0.5 * (centres["left_thigh"] + centres["right_thigh"])
    centres["hips"] = hips
    ankles = 0.5 * (centres["left_foot"] + centres["right_foot"])
    top = next((centres[name] for name in ("neck", "chest", "head") if name in centres), None)
    if top is None and "left_upper_arm" in centres and "right_upper_arm" in centres:
        top = 0.5 * (centres["left_upper_arm"] + centres["right_upper_arm"])
        centres["neck"] = top
    up = across((hips - ankles) if top is None else (top - hips), left)
    lefts, forwards = {"pelvis": left}, {"pelvis": np.cross(left, up)}
    for side in ("left", "right"):
        hip, knee, ankle, toe = (centres[f"{side}_{part}"] for part in ("thigh", "shin", "foot", "toe"))
        heel = points.get(f"{side}_heel")
        sole = level_sole(ankle, knee, toe) if heel is None else unit(toe - heel)
        axis = across(np.cross(unit(knee - ankle), sole), unit(knee - ankle))
        lefts[f"{side}_knee"] = bend_axis(hip, knee, ankle, across(left + axis, unit(hip - knee)))
        lefts[f"{side}_ankle"], forwards[f"{side}_foot"] = axis, sole
    _trunk_of_centres(centres, lefts, forwards)
    return BodyPoints(centres=centres, lefts=lefts, forwards=forwards)


def _trunk_of_centres(centres: dict[str, Array], lefts: dict[str, Array], forwards: dict[str, Array]) -> None:
    """Spine, chest and arms, as far as they are told; what lies between hips and neck is put between them."""
    arms = [
        side for side in ("left", "right") if all(f"{side}_{p}" in centres for p in ("upper_arm", "forearm", "hand"))
    ]
    if "neck" not in centres:
        for name in ("spine", "chest", "head"):
            centres.pop(name, None)
        return
    hips, neck = centres["hips"], centres["neck"]
    centres.setdefault("spine", 0.8 * hips + 0.2 * neck)
    centres.setdefault("chest", 0.45 * hips + 0.55 * neck)
    along = unit(neck - centres["chest"])
    shoulders = centres["left_upper_arm"] - centres["right_upper_arm"] if len(arms) == 2 else lefts["pelvis"]
    lefts["chest"] = across(shoulders, along)
    forwards["chest"] = np.cross(lefts["chest"], along)
    if "head" in centres:
        lefts["head"] = lefts["chest"]
        forwards["head"] = across(forwards["chest"], unit(centres["head"] - neck))
    for side in arms:
        centres[f"{side}_shoulder"] = 0.85 * neck + 0.15 * centres[f"{side}_upper_arm"]
