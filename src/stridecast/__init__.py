"""stridecast: on-line human locomotion from motion capture.

    >>> import stridecast as sc
    >>> database = sc.sample_database()                 # doctest: +SKIP
    >>> walker = sc.Walker(database)                    # doctest: +SKIP
    >>> pose = walker.step((0.0, 1.5), motion="walk")   # doctest: +SKIP

Names are loaded when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stridecast.body.recasting import recast
    from stridecast.building.build import build
    from stridecast.crowd.crowd import Crowd
    from stridecast.crowd.dressing import dress
    from stridecast.database.mining import Mined, mine
    from stridecast.errors import (
        DatabaseError,
        DatabaseFileError,
        DownloadError,
        FileError,
        InputError,
        MotionError,
        PathError,
        SceneError,
        SkeletonError,
        StridecastError,
        TakeError,
        WishError,
    )
    from stridecast.formats.bvh import write_bvh
    from stridecast.formats.glb import write_glb
    from stridecast.formats.recordings import load_motion, load_skeleton
    from stridecast.formats.scenes import load_scene, save_scene
    from stridecast.formats.store import load_database, save_database
    from stridecast.formats.trajectories import load_trajectories, save_trajectories
    from stridecast.model.database import MotionDatabase
    from stridecast.model.motion import Motion
    from stridecast.model.people import Person, Source
    from stridecast.model.pose import Pose, VehicleState
    from stridecast.model.scene import Behavior, Scene
    from stridecast.model.skeleton import Skeleton
    from stridecast.model.trajectories import Trajectories
    from stridecast.paths.follow import walk_scene
    from stridecast.samples.library import sample_database
    from stridecast.samples.recordings import fetch
    from stridecast.steering.force import SteeringGains
    from stridecast.synthesis.walker import Walker, Walkers

_HOME = {
    "build": "building.build",
    "sample_database": "samples.library",
    "fetch": "samples.recordings",
    "mine": "database.mining",
    "Mined": "database.mining",
    "load_database": "formats.store",
    "save_database": "formats.store",
    "load_motion": "formats.recordings",
    "load_skeleton": "formats.recordings",
    "write_bvh": "formats.bvh",
    "write_glb": "formats.glb",
    "recast": "body.recasting",
    "Motion": "model.motion",
    "MotionDatabase": "model.database",
    "Pose": "model.pose",
    "VehicleState": "model.pose",
    "Skeleton": "model.skeleton",
    "Scene": "model.scene",
    "Behavior": "model.scene",
    "load_scene": "formats.scenes",
    "save_scene": "formats.scenes",
    "walk_scene": "paths.follow",
    "Crowd": "crowd.crowd",
    "dress": "crowd.dressing",
    "Person": "model.people",
    "Source": "model.people",
    "Trajectories": "model.trajectories",
    "load_trajectories": "formats.trajectories",
    "save_trajectories": "formats.trajectories",
    "SceneError": "errors",
    "PathError": "errors",
    "SteeringGains": "steering.force",
    "Walker": "synthesis.walker",
    "Walkers": "synthesis.walker",
    "DatabaseError": "errors",
    "DatabaseFileError": "errors",
    "DownloadError": "errors",
    "FileError": "errors",
    "InputError": "errors",
    "MotionError": "errors",
    "SkeletonError": "errors",
    "StridecastError": "errors",
    "TakeError": "errors",
    "WishError": "errors",
}

__version__ = "0.1.0"
__all__ = [  # noqa: RUF022
    "build",
    "sample_database",
    "fetch",
    "mine",
    "Mined",
    "load_database",
    "save_database",
    "load_motion",
    "load_skeleton",
    "load_scene",
    "save_scene",
    "walk_scene",
    "write_bvh",
    "write_glb",
    "recast",
    "Crowd",
    "dress",
    "load_trajectories",
    "save_trajectories",
    "Trajectories",
    "Scene",
    "Person",
    "Source",
    "Behavior",
    "Motion",
    "MotionDatabase",
    "Pose",
    "VehicleState",
    "Skeleton",
    "SteeringGains",
    "Walker",
    "Walkers",
    "DatabaseError",
    "DatabaseFileError",
    "DownloadError",
    "FileError",
    "InputError",
    "MotionError",
    "PathError",
    "SceneError",
    "SkeletonError",
    "StridecastError",
    "TakeError",
    "WishError",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'stridecast' has no attribute {name!r}")
    return getattr(import_module(f"stridecast.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
