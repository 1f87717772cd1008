"""One take, understood: contacts, gait, vehicle and details, in one column of stages."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stridecast.analysis.bounds import SteeringSamples
from stridecast.analysis.contacts import find_contacts
from stridecast.analysis.details import extract_details
from stridecast.analysis.events import Gait, find_gait, label_motions
from stridecast.analysis.vehicle import fit_vehicle
from stridecast.body import kinematics
from stridecast.body.mass import center_of_mass
from stridecast.body.retargeting import retarget
from stridecast.geometry import ground, signals
from stridecast.model.contacts import Contacts
from stridecast.model.motion import Motion
from stridecast.model.segment import Segment
from stridecast.model.skeleton import Skeleton
from stridecast.model.vehicle import MotionDetails, VehicleTrajectory

SOLE = 0.022
"""Height of the toe joint above the floor when the foot is flat, as a part of the leg's length."""

MASS_CUTOFF = 6.0
"""The centre of mass does nothing faster than this, Hz."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TakeAnalysis:
    """What the person of a take was doing. ``motion`` stands on the floor, which is at height 0."""

    motion: Motion
    contacts: Contacts
    gait: Gait
    vehicle: VehicleTrajectory
    details: MotionDetails

    def steering(self, segment: Segment) -> SteeringSamples:
        """What the vehicle did in one segment."""
        frames = slice(segment.start.frame, segment.stop.frame + 1)
        return SteeringSamples(
            speeds=self.vehicle.speeds[frames],
            tangential=self.vehicle.tangential[frames],
            lateral=self.vehicle.lateral[frames],
            jerks=np.linalg.norm(self.vehicle.jerks[frames], axis=-1),
        )


def analyse(motion: Motion, skeleton: Skeleton | None = None) -> TakeAnalysis:
    """Understand a take (KS05, KS07 "Analysis").

    Parameters
    ----------
    motion
        The recording, at its own rate.
    skeleton
        The body it is carried over to first; its own if left out.

    Raises
    ------
    SkeletonError, TakeError
        A body that cannot be mapped; a take that shows no gait.
    """
    if skeleton is not None:
        motion = retarget(motion, skeleton)
    motion = _on_the_floor(motion)
    world = kinematics.pose(motion)
    contacts = find_contacts(motion, world)
    mass = signals.lowpass(center_of_mass(motion.skeleton, world), motion.frame_rate, MASS_CUTOFF)
    speeds = np.linalg.norm(signals.rate_of_change(ground.project(mass), motion.frame_rate), axis=-1)
    gait = find_gait(contacts, mass[:, 1], speeds, motion.frame_rate)
    pelvis, turned = motion.root_positions, motion.rotations[:, 0]
    vehicle = fit_vehicle(ground.project(pelvis), gait.mid_stances, contacts.standing, motion.frame_rate)
    gait = _labelled(gait, vehicle)
    return TakeAnalysis(
        motion=motion,
        contacts=contacts,
        gait=gait,
        vehicle=vehicle,
        details=extract_details(pelvis, turned, vehicle.positions, vehicle.headings),
    )


def _labelled(gait: Gait, vehicle: VehicleTrajectory) -> Gait:
    """The same gait, each segment's coarse motion seen in its context."""
    means = [float(vehicle.tangential[s.start.frame : s.stop.frame + 1].mean()) for s in gait.segments]
    return replace(gait, segments=tuple(label_motions(gait.segments, means)))


def _on_the_floor(motion: Motion) -> Motion:
    """The same motion, its flat feet standing on height 0."""
    floor = find_contacts(motion).floor - SOLE * motion.skeleton.leg_length
    return replace(motion, root_positions=motion.root_positions - np.array([0.0, floor, 0.0]))
