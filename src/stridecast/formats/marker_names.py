"""What laboratories call their markers and joint centres."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

# {l} stands for l and left, {r} for r and right; case, spaces and marks do not matter
_MARKERS: Mapping[str, tuple[str, ...]] = {
    # Plug-in Gait, Cleveland and Helen Hayes as Cortex writes it, CMU's 41, Visual3D's
    "{side}_asis": ("{l}asi", "{l}asis", "{l}fwt", "{l}ias"),
    "{side}_psis": ("{l}psi", "{l}psis", "{l}bwt", "{l}ips"),
    "{side}_knee": ("{l}kne", "{l}knee", "{l}kneelateral", "{l}fle", "{l}lk", "{l}lfc"),
    "{side}_knee_inner": ("{l}knm", "{l}knem", "{l}mkne", "{l}kneemedial", "{l}fme", "{l}mk", "{l}mfc", "{l}kneinner"),
    "{side}_ankle": ("{l}ank", "{l}ankle", "{l}anklelateral", "{l}fal", "{l}la", "{l}lm"),
    "{side}_ankle_inner": ("{l}anm", "{l}ankm", "{l}med", "{l}mank", "{l}anklemedial", "{l}tam", "{l}ma", "{l}mm"),
    "{side}_heel": ("{l}hee", "{l}heel", "{l}fcc", "{l}cal"),
    "{side}_toe": ("{l}toe", "{l}toe2", "{l}fm2", "{l}mt2", "{l}sm2"),
    "{side}_shoulder": ("{l}sho", "{l}shoulder", "{l}cac", "{l}acr", "{l}acromion", "{l}ac"),
    "{side}_elbow": ("{l}elb", "{l}elbow", "{l}elblateral", "{l}elbowlateral", "{l}hle", "{l}el"),
    "{side}_wrist": ("{l}wra", "{l}wrist", "{l}wristradius", "{l}wristlateral", "{l}rsp", "{l}wrt"),
    "{side}_wrist_inner": ("{l}wrb", "{l}wristulna", "{l}wristmedial", "{l}usp"),
    "{side}_front_head": ("{l}fhd", "{l}fronthead", "{l}headfront"),
    "{side}_back_head": ("{l}bhd", "{l}backhead", "{l}headback"),
}
_MIDDLE: Mapping[str, tuple[str, ...]] = {
    "sacrum": ("sacr", "sacrum", "vsacral", "sac"),
    "c7": ("c7", "cv7", "vc7"),
    "t10": ("t10", "tv10", "vt10"),
    "clavicle": ("clav", "clavicle", "sjn", "ij", "jugularnotch"),
    "sternum": ("strn", "stern", "sternum", "sxs", "px", "xiphoid"),
}
_CENTRES: Mapping[str, tuple[str, ...]] = {
    "{side}_thigh": (
        "{l}hjc",
        "{l}hip",
        "{l}hipjc",
        "{l}hipjointcentre",
        "{l}hipjointcenter",
        "{l}fep",
        "{l}hipcenter",
    ),
    "{side}_shin": ("{l}kjc", "{l}knee", "{l}kneejc", "{l}kneejointcentre", "{l}kneejointcenter", "{l}feo"),
    "{side}_foot": ("{l}ajc", "{l}ankle", "{l}anklejc", "{l}anklejointcentre", "{l}anklejointcenter", "{l}tio"),
    "{side}_toe": ("{l}tjc", "{l}toe", "{l}mtp", "{l}foottoe", "{l}bigtoe", "{l}toejc", "{l}mtpjc"),
    "{side}_heel": ("{l}hee", "{l}heel"),
    "{side}_upper_arm": ("{l}sjc", "{l}shoulder", "{l}shoulderjc", "{l}clo"),
    "{side}_forearm": ("{l}ejc", "{l}elbow", "{l}elbowjc", "{l}huo"),
    "{side}_hand": ("{l}wjc", "{l}wrist", "{l}wristjc", "{l}rao"),
}
_CENTRES_MIDDLE: Mapping[str, tuple[str, ...]] = {
    "spine": ("spine", "lumbar", "l5", "l5s1", "pelvisspine", "spinebase"),
    "chest": ("chest", "thorax", "spinechest", "spineshoulder", "t8", "torso"),
    "neck": ("neck", "c7t1", "necklower"),
    "head": ("head", "skull", "headcenter", "headcentre"),
}

_SIDES = (("left", ("l", "left")), ("right", ("r", "right")))


def _spelt(words: Mapping[str, tuple[str, ...]], middle: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    out = dict(middle)
    for side, spellings in _SIDES:
        for name, known in words.items():
            out[name.format(side=side)] = tuple(word.format(l=l) for word in known for l in spellings)  # noqa: E741
    return out


MARKERS = _spelt(_MARKERS, _MIDDLE)
"""Markers on the skin and what they are called."""

CENTRES = _spelt(_CENTRES, _CENTRES_MIDDLE)
"""Joint centres (and heels) and what they are called."""

NEEDED_MARKERS = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("asis", "knee", "ankle", "toe"))
"""Markers without which there is no body; one of ``sacrum`` and both ``psis`` comes to them."""

NEEDED_CENTRES = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("thigh", "shin", "foot", "toe"))
"""Joint centres without which there is no body."""

KNOWN = "Plug-in Gait, Helen Hayes, CMU's 41, or joint centres such as LHJC, LKJC, LAJC with LTOE"


def squeezed(label: str) -> str:
    """A label without its subject (``Anna:LASI``), case and marks."""
    return re.sub(r"[\s_.\-]", "", label.rpartition(":")[2]).lower()


def subjects_of(labels: Iterable[str]) -> list[str]:
    """Subjects in the order of their first label; "" where labels name none."""
    return list(dict.fromkeys(label.rpartition(":")[0] for label in labels))


def found_in(labels: Mapping[int, str], words: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    """Which point is which: by the first of its names that is there."""
    places: dict[str, int] = {}
    for point, label in labels.items():
        places.setdefault(squeezed(label), point)
    found = {}
    for name, known in words.items():
        there = [places[word] for word in known if word in places]
        if there:
            found[name] = there[0]
    return found
