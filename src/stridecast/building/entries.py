"""Results of the stages as arrays and plain values, to be kept between builds, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from stridecast.analysis.events import Gait
from stridecast.analysis.take import TakeAnalysis
from stridecast.building.cache import Entry
from stridecast.building.processes import Failure
from stridecast.building.stages import Recording, Understood
from stridecast.formats.tensors import Tensors, pack_skeleton, unpack_skeleton
from stridecast.model.contacts import Contacts
from stridecast.model.motion import Motion
from stridecast.model.segment import Boundary, MidStance, Phase, Segment
from stridecast.model.skeleton import Skeleton
from stridecast.model.vehicle import MotionDetails, VehicleTrajectory

_VEHICLE = ("positions", "velocities", "accelerations", "jerks", "headings", "left", "right")
_DETAILS = ("displacements", "yaws", "offsets")


def pack_failure(failure: Failure) -> Entry:
    """Remember why a take has no result."""
    return {"failure": failure.reason}, {}


def unpack_failure(entry: Entry) -> Failure | None:
    """Return the failure an entry tells of, if it does."""
    reason = entry[0].get("failure")
    return None if reason is None else Failure(reason=str(reason), lasting=True)


def pack_recording(recording: Recording) -> Entry:
    """Remember a recording, all but its motion."""
    body, tensors = pack_skeleton(recording.skeleton)
    names = ("name", "subject", "frames", "frame_rate", "notes")
    return {**{name: getattr(recording, name) for name in names}, "skeleton": body}, tensors


def unpack_recording(entry: Entry) -> Recording:
    """Undo ``pack_recording``."""
    header, tensors = entry
    return Recording(
        name=header["name"],
        subject=header["subject"],
        frames=header["frames"],
        frame_rate=header["frame_rate"],
        skeleton=unpack_skeleton(header["skeleton"], tensors),
        notes=tuple(header["notes"]),
        motion=None,
    )


def pack_understood(understood: Understood) -> Entry:
    """Remember both analyses; the skeleton, which is that of the database, is left out."""
    header: dict[str, Any] = {"notes": understood.notes}
    tensors: Tensors = {}
    for name in ("analysis", "mirrored"):
        analysis = getattr(understood, name)
        if analysis is not None:
            header[name], arrays = _pack_analysis(analysis)
            tensors |= {f"{name}.{key}": array for key, array in arrays.items()}
    return header, tensors


def unpack_understood(entry: Entry, skeleton: Skeleton) -> Understood:
    """Undo ``pack_understood``, on the same skeleton."""
    header, tensors = entry

    def analysis(name: str) -> TakeAnalysis:
        arrays = {key.removeprefix(f"{name}."): array for key, array in tensors.items() if key.startswith(f"{name}.")}
        return _unpack_analysis(header[name], arrays, skeleton)

    return Understood(
        analysis=analysis("analysis"),
        mirrored=analysis("mirrored") if "mirrored" in header else None,
        notes=tuple(header["notes"]),
    )


def _pack_analysis(analysis: TakeAnalysis) -> Entry:
    motion, gait = analysis.motion, analysis.gait
    header = {
        "motion": {name: getattr(motion, name) for name in ("frame_rate", "name", "subject", "source")},
        "floor": analysis.contacts.floor,
        "phases": gait.phases,
        "mid_stances": gait.mid_stances,
        "boundaries": gait.boundaries,
        "segments": [(s.start, s.stop, s.string, s.keys, s.motion) for s in gait.segments],
    }
    tensors = {
        "root_positions": motion.root_positions,
        "rotations": motion.rotations,
        "planted": analysis.contacts.planted,
        "standing": analysis.contacts.standing,
        **{f"vehicle.{name}": getattr(analysis.vehicle, name) for name in _VEHICLE},
        **{f"details.{name}": getattr(analysis.details, name) for name in _DETAILS},
    }
    return header, tensors


def _unpack_analysis(header: Mapping[str, Any], tensors: Mapping[str, np.ndarray], skeleton: Skeleton) -> TakeAnalysis:
    return TakeAnalysis(
        motion=Motion(
            skeleton=skeleton,
            root_positions=tensors["root_positions"],
            rotations=tensors["rotations"],
            **header["motion"],
        ),
        contacts=Contacts(planted=tensors["planted"], standing=tensors["standing"], floor=header["floor"]),
        gait=Gait(
            phases=tuple(Phase(*row) for row in header["phases"]),
            mid_stances=tuple(MidStance(*row) for row in header["mid_stances"]),
            boundaries=tuple(Boundary(*row) for row in header["boundaries"]),
            segments=tuple(
                Segment(start=Boundary(*start), stop=Boundary(*stop), string=string, keys=tuple(keys), motion=motion)
                for start, stop, string, keys, motion in header["segments"]
            ),
        ),
        vehicle=VehicleTrajectory(**{name: tensors[f"vehicle.{name}"] for name in _VEHICLE}),
        details=MotionDetails(**{name: tensors[f"details.{name}"] for name in _DETAILS}),
    )
