"""The sample takes: what a person is asked to do who shows everything that a motion database wants to know."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from stridecast.samples.gait import GaitModel
from stridecast.samples.manner import MANNERS
from stridecast.samples.performance import SampleTake, perform

Array = np.ndarray

RATE = 60.0
"""Frames a second of the sample takes."""

CHANGES = (2.1, 1.95)
"""Who slows down walks below the first speed, who speeds up runs above the second, m/s."""

ENTERING = 0.7
"""A circle is entered and left within this time, seconds."""


@dataclass(frozen=True, kw_only=True)
class Leg:
    """A part of a take.

    Parameters
    ----------
    seconds
        How long it takes.
    speed
        Speed at its end, m/s, reached evenly over the leg; as before if left out.
    turn
        Angle that the way turns to the left, radians, smoothly over the leg.
    rate
        Instead of that: turning of a circle, rad/s.
    running
        Whether to run; as before if left out.
    """

    seconds: float
    speed: float | None = None
    turn: float = 0.0
    rate: float = 0.0
    running: bool | None = None


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A take: where it begins (speed, whether running), its legs, and the manner of going."""

    name: str
    legs: tuple[Leg, ...]
    speed: float = 0.0
    running: bool = False
    style: str = "neutral"

    def course(self, rate: float) -> tuple[Float[Array, "frames"], Float[Array, "frames"], Bool[Array, "frames"]]:
        """Speed, turning and gait of every frame."""
        speeds, turns, running = [], [], []
        speed, run = self.speed, self.running
        for leg in self.legs:
            frames = round(leg.seconds * rate)
            u = (np.arange(frames) + 0.5) / frames
            goal = speed if leg.speed is None else leg.speed
            changes = leg.running is not None and leg.running != run
            run = run if leg.running is None else leg.running
            speeds.append(speed + (goal - speed) * _ease(u))
            edge = np.minimum(u, 1 - u) * leg.seconds / ENTERING
            turns.append(leg.turn / leg.seconds * _ease_rate(u) + leg.rate * _ease(np.minimum(edge, 1.0)))
            running.append(speeds[-1] > CHANGES[int(run)] if changes else np.full(frames, run))
            speed = goal
        return np.concatenate(speeds), np.concatenate(turns), np.concatenate(running)


def _ease(u: Array) -> Array:
    """From 0 to 1 with the least jerk (Flash and Hogan 1985)."""
    return u * u * u * (10 - 15 * u + 6 * u * u)


def _ease_rate(u: Array) -> Array:
    return 30 * u * u * (1 - u) ** 2


def _bends(angle: float, seconds: float, straight: float, slower: float | None = None, speed: float = 0.0) -> list[Leg]:
    """To one side and to the other, with straight parts between; slower in the bend if so asked."""
    legs = []
    for side in (1, -1, -1, 1):
        if slower is None:
            legs += [Leg(seconds=straight), Leg(seconds=seconds, turn=side * angle)]
        else:
            legs += [Leg(seconds=straight, speed=speed), Leg(seconds=0.9, speed=slower)]
            legs += [Leg(seconds=seconds, turn=side * angle), Leg(seconds=0.9, speed=speed)]
    return [*legs, Leg(seconds=straight)]


def _from_rest(speed: float, gather: float, brake: float, holds: tuple[float, ...], **how: bool) -> list[Leg]:
    """Off and to a stop again, for different lengths, so that either foot comes first."""
    legs = [Leg(seconds=1.0)]
    for hold in holds:
        legs += [Leg(seconds=gather, speed=speed, **how), Leg(seconds=hold), Leg(seconds=brake, speed=0.0)]
        legs += [Leg(seconds=1.2)]
    return legs


def _back_and_forth(low: float, high: float, seconds: float, hold: float, run: bool | None = None) -> list[Leg]:
    """Faster and slower again; from walking to running and back where ``run`` is True."""
    legs = []
    for _ in range(3):
        legs += [Leg(seconds=hold), Leg(seconds=seconds, speed=high, running=run)]
        legs += [Leg(seconds=hold), Leg(seconds=seconds, speed=low, running=None if run is None else False)]
    return [*legs, Leg(seconds=hold)]


RIGHT_ANGLE, ABOUT = np.pi / 2, np.pi


def _walking(style: str, prefix: str = "") -> list[Recipe]:
    """What every manner of walking shows."""
    return [
        Recipe(name=f"{prefix}walk_faster", speed=0.6, legs=(Leg(seconds=20.0, speed=2.0),), style=style),
        Recipe(name=f"{prefix}walk_turns", speed=1.3, legs=(*_bends(RIGHT_ANGLE, 1.6, 2.4),), style=style),
        Recipe(name=f"{prefix}walk_start_stop", legs=(*_from_rest(1.3, 1.9, 2.2, (1.0, 1.6, 1.3)),), style=style),
    ]


def _in_a_mood(style: str) -> list[Recipe]:
    """What a walker needs to go everywhere in a mood: less of each than of the usual manner, but of everything."""
    how: dict[str, Any] = {"style": style}
    run: dict[str, Any] = {"style": style, "running": True}
    circle = Leg(seconds=6.0, rate=0.8), Leg(seconds=6.0, rate=-0.8)
    return [
        *_walking(style, f"{style}_"),
        Recipe(name=f"{style}_walk_turns_slow", speed=0.85, legs=(*_bends(RIGHT_ANGLE, 2.4, 1.2),), **how),
        Recipe(name=f"{style}_walk_turns_fast", speed=1.6, legs=(*_bends(RIGHT_ANGLE, 1.8, 0.8, 1.4, 1.6),), **how),
        Recipe(name=f"{style}_walk_about", speed=1.2, legs=(*_bends(ABOUT, 2.4, 0.6, 0.9, 1.2),), **how),
        Recipe(name=f"{style}_walk_circles", speed=1.1, legs=circle, **how),
        Recipe(name=f"{style}_walk_changes", speed=0.8, legs=(*_back_and_forth(0.8, 1.7, 1.8, 0.8),), **how),
        Recipe(name=f"{style}_walk_start_stop_slow", legs=(*_from_rest(0.8, 1.4, 1.7, (1.8, 2.3)),), **how),
        Recipe(name=f"{style}_walk_start_stop_fast", legs=(*_from_rest(1.7, 2.5, 2.8, (0.5, 1.0)),), **how),
        Recipe(name=f"{style}_run", speed=2.0, legs=(Leg(seconds=18.0, speed=4.5),), **run),
        Recipe(name=f"{style}_run_turns", speed=2.5, legs=(*_bends(RIGHT_ANGLE, 1.7, 1.4),), **run),
        Recipe(name=f"{style}_run_turns_fast", speed=3.4, legs=(*_bends(RIGHT_ANGLE, 2.0, 0.8, 2.8, 3.4),), **run),
        Recipe(name=f"{style}_run_changes", speed=2.3, legs=(*_back_and_forth(2.3, 3.8, 1.6, 0.8),), **run),
        Recipe(name=f"{style}_walk_jog", speed=1.7, legs=(*_back_and_forth(1.7, 2.5, 0.9, 1.6, run=True),), **how),
        Recipe(name=f"{style}_run_start_stop", legs=(*_from_rest(3.0, 1.6, 1.6, (1.6, 2.1), running=True),), **how),
    ]


RECIPES: tuple[Recipe, ...] = (
    Recipe(name="stand", legs=(Leg(seconds=20.0),)),
    *_walking("neutral"),
    Recipe(name="walk_slower", speed=2.0, legs=(Leg(seconds=20.0, speed=0.6),)),
    *(
        Recipe(name=f"walk_veer_{name}", speed=speed, legs=(*_bends(np.radians(40), seconds, 1.6),))
        for name, speed, seconds in (("slow", 0.9, 2.6), ("usual", 1.3, 2.2), ("fast", 1.7, 2.0))
    ),
    Recipe(name="walk_turns_slow", speed=0.85, legs=(*_bends(RIGHT_ANGLE, 2.4, 2.0),)),
    Recipe(name="walk_turns_fast", speed=1.6, legs=(*_bends(RIGHT_ANGLE, 1.8, 1.2, 1.4, 1.6),)),
    Recipe(name="walk_about", speed=1.2, legs=(*_bends(ABOUT, 2.4, 0.9, 0.9, 1.2),)),
    Recipe(name="walk_circles", speed=1.2, legs=(Leg(seconds=10.0, rate=0.55), Leg(seconds=10.0, rate=-0.55))),
    Recipe(name="walk_small_circles", speed=1.0, legs=(Leg(seconds=10.0, rate=1.0), Leg(seconds=10.0, rate=-1.0))),
    Recipe(name="walk_changes", speed=0.8, legs=(*_back_and_forth(0.8, 1.7, 1.8, 1.4),)),
    Recipe(name="walk_start_stop_slow", legs=(*_from_rest(0.8, 1.4, 1.7, (1.8, 2.3, 2.0)),)),
    Recipe(name="walk_start_stop_fast", legs=(*_from_rest(1.7, 2.5, 2.8, (0.5, 1.0, 0.7)),)),
    Recipe(
        name="walk_start_stop_turning",
        legs=tuple(
            leg
            for side in (1, -1, 1)
            for leg in (
                Leg(seconds=1.2),
                Leg(seconds=1.7, speed=1.2, turn=side * 0.5),
                Leg(seconds=2.0, turn=side * 0.7),
                Leg(seconds=1.8, speed=0.0, turn=-side * 0.4),
            )
        ),
    ),
    Recipe(name="run_faster", speed=2.0, running=True, legs=(Leg(seconds=20.0, speed=4.5),)),
    Recipe(name="run_slower", speed=4.5, running=True, legs=(Leg(seconds=20.0, speed=2.0),)),
    Recipe(name="run_veer", speed=2.6, running=True, legs=(*_bends(np.radians(35), 1.9, 1.6),)),
    Recipe(name="run_veer_fast", speed=3.8, running=True, legs=(*_bends(np.radians(30), 1.9, 1.6),)),
    Recipe(name="run_turns", speed=2.5, running=True, legs=(*_bends(RIGHT_ANGLE, 1.7, 2.2),)),
    Recipe(name="run_turns_fast", speed=3.4, running=True, legs=(*_bends(RIGHT_ANGLE, 2.0, 1.0, 2.8, 3.4),)),
    Recipe(
        name="run_circles", speed=3.0, running=True, legs=(Leg(seconds=10.0, rate=0.7), Leg(seconds=10.0, rate=-0.7))
    ),
    Recipe(name="run_changes", speed=2.3, running=True, legs=(*_back_and_forth(2.3, 4.2, 1.6, 1.4),)),
    Recipe(name="walk_run", speed=1.4, legs=(*_back_and_forth(1.4, 3.5, 1.1, 1.7, run=True),)),
    Recipe(name="walk_jog", speed=1.7, legs=(*_back_and_forth(1.7, 2.5, 0.9, 2.0, run=True),)),
    Recipe(name="run_start_stop", legs=(*_from_rest(3.0, 1.6, 1.6, (1.6, 2.1, 1.8), running=True),)),
    Recipe(name="run_start_stop_fast", legs=(*_from_rest(3.8, 2.0, 2.0, (1.5, 1.9), running=True),)),
    *_in_a_mood("brisk"),
    *_in_a_mood("gloomy"),
)
"""All sample takes."""


def sample_takes(
    *, progress: Callable[[int, int], None] | None = None, model: GaitModel | None = None
) -> list[SampleTake]:
    """Make all sample takes.

    Parameters
    ----------
    progress
        Called with how many are made, and how many there are.
    model
        The gait model; left out, the one that comes with the package.
    """
    takes = []
    for number, recipe in enumerate(RECIPES):
        takes.append(sample_take(recipe, seed=number, model=model))
        if progress is not None:
            progress(number + 1, len(RECIPES))
    return takes


def sample_take(
    recipe: Recipe, *, seed: int = 0, rate: float = RATE, variation: float = 1.0, model: GaitModel | None = None
) -> SampleTake:
    """Make one take; ``seed`` and ``variation`` are those of ``perform``."""
    speeds, turns, running = recipe.course(rate)
    return perform(
        speeds,
        turns,
        running=running,
        rate=rate,
        manner=MANNERS[recipe.style],
        seed=seed,
        variation=variation,
        name=recipe.name,
        model=model,
    )
