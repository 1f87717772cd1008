"""What is asked of walkers, checked whole before any of it is stored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from stridecast.errors import InputError, WishError
from stridecast.model.behavior import SIZES
from stridecast.model.pose import VehicleState
from stridecast.synthesis.sizes import AMOUNTS
from stridecast.synthesis.step_kernels import FORCE, GIVEN, PLAN, POINT, Given

Array = np.ndarray

LONGEST_STEP = 0.2
"""Nobody is stepped by more than this at a time, seconds."""

FARTHEST = 1e6
"""A point further from the origin than this is a mistake, metres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Wish:
    """What is asked for in one step. What it holds for those who are not stepped means nothing.

    Parameters
    ----------
    kind
        ``POINT``, ``FORCE``, ``PLAN`` or ``GIVEN``.
    what
        Points, metres, forces or accelerations, m/s2, or vehicles.
    rests_in
        Time until a plan comes to rest, seconds.
    motions
        Numbers in ``MOTIONS``.
    active
        Who is stepped.
    steps
        By how much, seconds.
    """

    kind: int
    what: Float[Array, "characters 2"] | Given
    rests_in: Float[Array, "characters"]
    motions: Int[Array, "characters"]
    active: Bool[Array, "characters"]
    steps: Float[Array, "characters"]


class WishReader:
    """Reads the wishes of a batch.

    Parameters
    ----------
    count
        How many characters there are.
    frame_rate
        Of whose steps nothing is said, Hz.
    motions
        Motions that can be asked for, and their numbers.
    """

    def __init__(self, count: int, frame_rate: float, motions: Mapping[str, int]) -> None:
        self.count, self.frame_rate, self.motions = count, frame_rate, motions

    def read(
        self,
        points: Array | None,
        forces: Array | None,
        accelerations: Array | None,
        vehicles: VehicleState | None,
        rests_in: Array | float,
        motion: str | Sequence[str] | Array,
        active: Array | None,
        dt: Array | float | None,
    ) -> Wish:
        """What ``Walkers.step`` was given, as arrays with a row for everybody.

        Raises
        ------
        WishError
            See ``Walkers.step``.
        """
        given = [
            (kind, name, wish)
            for kind, name, wish in (
                (POINT, "points", points),
                (FORCE, "forces", forces),
                (PLAN, "accelerations", accelerations),
                (GIVEN, "vehicles", vehicles),
            )
            if wish is not None
        ]
        if len(given) != 1:
            raise WishError("give one of points, forces and accelerations, or vehicles")
        kind, name, wish = given[0]
        stepped = self._who(active)
        what: Array | Given
        if isinstance(wish, VehicleState):
            what = self._vehicles(wish, stepped)
        else:
            what = self._numbers(name, wish, (self.count, 2), stepped)
            if np.abs(what[stepped]).max(initial=0.0) > FARTHEST:
                raise WishError(f"the wish lies further than {FARTHEST:.0e} from the origin")
        rests = np.asarray(rests_in, np.float64)
        if rests.shape not in ((), (self.count,)):
            raise WishError("rests_in must be seconds from 0, one for all or one each")
        rests = np.broadcast_to(rests, (self.count,))
        if not (rests[stepped] >= 0).all():
            raise WishError("rests_in must be seconds from 0, one for all or one each")
        motions = self._numbers_of(motion, stepped)
        return Wish(
            kind=kind,
            what=what,
            rests_in=rests,
            motions=motions,
            active=stepped,
            steps=self._steps_of(dt, stepped),
        )

    def _who(self, active: Array | None) -> Array:
        if active is None:
            return np.ones(self.count, bool)
        stepped = np.asarray(active)
        if stepped.shape != (self.count,) or stepped.dtype != bool:
            raise WishError(f"active must be {self.count} truth values, not {stepped.dtype} of shape {stepped.shape}")
        return stepped

    def _numbers(self, name: str, wish: object, shape: tuple[int, ...], stepped: Array) -> Array:
        """Numbers of a wish as an array of a shape, finite for those who are stepped."""
        try:
            numbers = np.ascontiguousarray(wish, np.float64)
            if not numbers.flags.writeable:  # to compiled code a type of its own
                numbers = numbers.copy()
        except (TypeError, ValueError):
            raise WishError(f"{name} must be numbers of shape {shape}") from None
        if numbers.shape != shape:
            raise WishError(f"{name} must have shape {shape}, not {numbers.shape}")
        fine = np.isfinite(numbers).reshape(self.count, -1).all(axis=1) | ~stepped
        if not fine.all():
            row = int(np.flatnonzero(~fine)[0])
            raise WishError(f"the wish of character {row} is {numbers[row].tolist()}: finite numbers are wanted")
        return numbers

    def _vehicles(self, vehicles: VehicleState, stepped: Array) -> Given:
        pairs, single_numbers = (self.count, 2), (self.count,)
        given = Given(
            *(
                self._numbers(f"vehicles.{name}", getattr(vehicles, name), shape, stepped)
                for name, shape in (
                    ("position", pairs),
                    ("velocity", pairs),
                    ("acceleration", pairs),
                    ("heading", single_numbers),
                )
            )
        )
        if np.abs(given.position[stepped]).max(initial=0.0) > FARTHEST:
            raise WishError(f"a vehicle lies further than {FARTHEST:.0e} from the origin")
        return given

    def _numbers_of(self, motion: str | Sequence[str] | Array, stepped: Array) -> Array:
        """Numbers of the motions asked for."""
        if isinstance(motion, str):
            return np.full(self.count, self._number_of(motion))
        if len(motion) != self.count:
            raise WishError(f"{len(motion)} motions for {self.count} characters")
        if isinstance(motion, np.ndarray) and motion.dtype.kind in "iu":
            known = np.isin(motion, list(self.motions.values())) | ~stepped
            if not known.all():
                wrong = motion[~known][0]
                there = ", ".join(f"{number} ({name})" for name, number in self.motions.items())
                raise WishError(f"there is no motion {wrong}; there are {there}")
            return motion.astype(np.int64)
        return np.array([self._number_of(name) for name in motion])

    def _number_of(self, motion: str) -> int:
        try:
            return self.motions[motion]
        except (KeyError, TypeError):
            raise WishError(f"there is no motion {motion!r}; there are {', '.join(self.motions)}") from None

    def _steps_of(self, dt: Array | float | None, stepped: Array) -> Array:
        """Seconds of everybody's step."""
        if dt is None:
            return np.full(self.count, 1.0 / self.frame_rate)
        steps = np.asarray(dt, np.float64)
        if steps.shape not in ((), (self.count,)):
            raise WishError(f"dt must be seconds, one for all or one each of {self.count}")
        steps = np.broadcast_to(steps, (self.count,))
        if not ((steps[stepped] > 0.0) & (steps[stepped] <= LONGEST_STEP)).all():
            raise WishError(f"a step takes more than 0 and at most {LONGEST_STEP} seconds")
        return steps


@dataclass(frozen=True, kw_only=True, eq=False)
class Newcomers:
    """Who is put into which rows: places (metres), headings (radians) and phases (0 to below 1), one each."""

    rows: Int[Array, "rows"]
    places: Float[Array, "rows 2"]
    headings: Float[Array, "rows"]
    phases: Float[Array, "rows"]


def newcomers(
    rows: Sequence[int] | Array, positions: Array, headings: Array | float, phase: Array | float, count: int
) -> Newcomers:
    """What ``Walkers.place`` was given, for a batch of ``count``.

    Raises
    ------
    InputError
        See ``Walkers.place``.
    """
    which = np.asarray(rows)
    if which.ndim != 1 or (which.size and which.dtype.kind not in "iu"):
        raise InputError("rows must be a list of whole numbers")
    which = which.astype(np.int64)
    outside = which[(which < 0) | (which >= count)]
    if len(outside):
        raise InputError(f"there is no row {outside[0]}; rows are 0 to {count - 1}")
    if len(np.unique(which)) != len(which):
        raise InputError("a row can be filled once at a time; one comes twice")
    places = np.asarray(positions, np.float64)
    if places.shape != (len(which), 2):
        raise InputError(f"positions must have shape {(len(which), 2)}, not {places.shape}")
    looks, phases = np.asarray(headings, np.float64), np.asarray(phase, np.float64)
    for name, values in (("headings", looks), ("phase", phases)):
        if values.shape not in ((), (len(which),)):
            raise InputError(f"{name} must be one number or one for each of {len(which)} rows")
    if not (np.isfinite(places).all() and np.isfinite(looks).all()):
        raise InputError("positions and headings must be finite numbers")
    if not ((phases >= 0.0) & (phases < 1.0)).all():
        raise InputError("a phase lies between 0 and 1, without 1")
    each = (len(which),)
    return Newcomers(
        rows=which, places=places, headings=np.broadcast_to(looks, each), phases=np.broadcast_to(phases, each)
    )


def size_amounts(size: str | Sequence[str], count: int) -> list[float]:
    """Sizes of movement as parts of what exaggerated movements add, one each.

    Raises
    ------
    WishError
        An unknown size, or not as many as there are characters.
    """
    names = [size] * count if isinstance(size, str) else list(size)
    if len(names) != count:
        raise WishError(f"{len(names)} sizes for {count} characters")
    try:
        return [AMOUNTS[name] for name in names]
    except (KeyError, TypeError):
        wrong = next(name for name in names if name not in SIZES)
        raise WishError(f"there is no size {wrong!r} of movement; there are {', '.join(SIZES)}") from None


def single(wish: object) -> Float[Array, "1 2"] | None:
    """One wish as a batch of one.

    Raises
    ------
    WishError
        It is not two numbers.
    """
    if wish is None:
        return None
    try:
        row = np.asarray(wish, np.float64)
    except (TypeError, ValueError):
        raise WishError(f"a wish is two numbers (x, z), not {wish!r}") from None
    if row.shape != (2,):
        raise WishError(f"a wish is two numbers (x, z), not an array of shape {row.shape}")
    return row[None]
