"""What changes while characters walk: plain arrays with a leading ``character`` axis, in one named tuple."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stridecast.model.segment import MOTIONS, STAND
from stridecast.synthesis.tables import Tables

Array = np.ndarray

NEIGHBOURS = 6
"""At most so many examples are blended."""


class State(NamedTuple):
    """State of C characters. D features, J joints; per foot: column 0 left, 1 right."""

    # vehicle (KS07 "Vehicle Model")
    position: Array  # C 2
    velocity: Array  # C 2
    acceleration: Array  # C 2
    heading: Array  # C
    side: Array  # C, to which side a reversal is under way
    elapsed: Array  # C, seconds the last step took
    # wish
    seen: Array  # C 2, the point of the last frame
    seen_velocity: Array  # C 2, how it moves, smoothed
    anchor: Array  # C 2, where the point rested when the character decided to stop beside it
    arriving: Array  # C, whether it has decided so
    # segment
    group: Array  # C
    chosen: Array  # C NEIGHBOURS, examples
    weights: Array  # C NEIGHBOURS
    generic: Array  # C, generic time in the segment, 0 to 1
    started: Array  # C, speed at the segment's first frame
    segments: Array  # C, segments begun so far
    made_up: Array  # C, transitions that had no example
    # size of movement
    size: Array  # C 3: share of what exaggerated movements add, how fast it changes, the share wanted
    # style
    style: Array  # C, the one wanted, from gloomy (-1) to brisk (+1)
    stance: Array  # C D, how people of the style shown stand
    # choice of examples
    choice: Array  # C 3, speed, tangential and lateral acceleration that they are chosen by
    # a vehicle that moves by itself
    given: Array  # C, whether it does
    turning: Array  # C, how fast it turns, smoothed
    phase: Array  # C, phase of the gait in which somebody appears, 0 to 1
    scale: Array  # C, how large movements are against the examples
    scale_rate: Array  # C
    lead: Array  # C 2 3, where a foot comes down against the examples: x, z, turn
    lift: Array  # C 2, how much higher it swings
    astray: Array  # C, how far the feet are from where they belong under a standing body
    # seams
    features: Array  # C D, of the last frame as shown; at first the pose to begin with
    before: Array  # C D, of the frame before
    seam: Array  # C D, what is left of the difference at the last boundary
    seam_rate: Array  # C D
    # feet
    locked: Array  # C 2
    given_up: Array  # C 2, let go early because it could not be reached
    hold: Array  # C 2 3, place of the toe held
    hold_turn: Array  # C 2 4, rotation of the foot held
    toe: Array  # C 2 3, of the last frame as shown
    toe_rate: Array  # C 2 3, how fast it moved
    toe_meant: Array  # C 2 3, of the last frame in the blended pose
    slip: Array  # C 2 3, toe shown minus toe meant
    slip_rate: Array  # C 2 3
    twist: Array  # C 2, turn of the foot about the vertical against the blended pose
    twist_rate: Array  # C 2
    drop: Array  # C, how far the pelvis is lowered
    drop_rate: Array  # C
    # what the last frame shows
    root: Array  # C 3
    rotations: Array  # C J 4
    bounds: Array  # C 7: jerk, least and greatest tangential, greatest lateral, least and greatest speed; in force
    acted: Array  # C, bits of the bounds that acted
    fresh: Array  # C, nothing shown yet
    # room to work in, as kernels make no arrays
    meant: Array  # C D, blended features
    ahead: Array  # C D, those of the next frame
    found: Array  # C NEIGHBOURS+1, distances of the nearest examples
    found_examples: Array  # C NEIGHBOURS+1


def make_state(count: int, tables: Tables) -> State:
    """State of ``count`` characters who have not been placed yet."""
    width = tables.features.shape[2]
    joints = len(tables.parents)
    shapes: dict[str, tuple[int, ...]] = {
        "position": (2,),
        "velocity": (2,),
        "acceleration": (2,),
        "heading": (),
        "side": (),
        "elapsed": (),
        "seen": (2,),
        "seen_velocity": (2,),
        "anchor": (2,),
        "weights": (NEIGHBOURS,),
        "generic": (),
        "started": (),
        "size": (3,),
        "style": (),
        "stance": (width,),
        "choice": (3,),
        "turning": (),
        "phase": (),
        "scale": (),
        "scale_rate": (),
        "lead": (2, 3),
        "lift": (2,),
        "astray": (),
        "features": (width,),
        "before": (width,),
        "seam": (width,),
        "seam_rate": (width,),
        "hold": (2, 3),
        "hold_turn": (2, 4),
        "toe": (2, 3),
        "toe_rate": (2, 3),
        "toe_meant": (2, 3),
        "slip": (2, 3),
        "slip_rate": (2, 3),
        "twist": (2,),
        "twist_rate": (2,),
        "drop": (),
        "drop_rate": (),
        "root": (3,),
        "rotations": (joints, 4),
        "bounds": (6,),
        "meant": (width,),
        "ahead": (width,),
        "found": (NEIGHBOURS + 1,),
    }
    whole = {"group": (), "chosen": (NEIGHBOURS,), "segments": (), "made_up": (), "acted": ()}
    whole["found_examples"] = (NEIGHBOURS + 1,)
    flags = {"arriving": (), "locked": (2,), "given_up": (2,), "fresh": (), "given": ()}
    arrays = {name: np.zeros((count, *shape)) for name, shape in shapes.items()}
    arrays |= {name: np.zeros((count, *shape), np.int64) for name, shape in whole.items()}
    arrays |= {name: np.zeros((count, *shape), bool) for name, shape in flags.items()}
    arrays["fresh"][:] = True
    arrays["features"][:] = arrays["stance"][:] = tables.neutral
    arrays["scale"][:] = 1.0
    return State(**arrays)


STANDING = MOTIONS.index(STAND)
"""Number of the motion that every character begins in, where there is one."""
