"""Walkers: characters that follow points or forces, frame by frame and without latency (KS07 "Synthesis")."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from jaxtyping import Float

from stridecast.errors import InputError, WishError
from stridecast.geometry.kernels import is_compiled
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import BoundsInForce, Pose, VehicleState
from stridecast.model.scene import SIZES
from stridecast.model.segment import MOTIONS
from stridecast.steering.force import SteeringGains
from stridecast.steering.kernels import JERK, LATERAL, SPEED, TANGENTIAL
from stridecast.synthesis.sizes import AMOUNTS, enlargement
from stridecast.synthesis.state import make_state
from stridecast.synthesis.step_kernels import FORCE, PLAN, POINT, step_block
from stridecast.synthesis.styles import Style, style_numbers
from stridecast.synthesis.tables import make_tables

Array = np.ndarray
log = logging.getLogger("stridecast")

_NAMES = tuple(
    tuple(
        name
        for bit, name in ((JERK, "jerk"), (TANGENTIAL, "tangential"), (LATERAL, "lateral"), (SPEED, "speed"))
        if bits & bit
    )
    for bits in range(16)
)

BLOCK = 64
"""Characters a thread steps at a time."""

FARTHEST = 1e6
"""A point further from the origin than this is a mistake, metres."""


class Walkers:
    """Many characters from one database, stepped together.

    Parameters
    ----------
    database
        What they have learned.
    positions
        Where they stand, ground points ``(x, z)``, metres; one row a character.
    headings
        Where they look, radians.
    subject
        Keep to the manner of this person of the database; everybody's if left out.
    gains
        Spring and damper between vehicle and point.
    frame_rate
        Frames a second; the database's if left out.
    threads
        Threads that share the characters. The result does not depend on it.
    size, style
        Size of movement and style to begin with (see ``step``).

    Raises
    ------
    InputError
        Places or headings that are no finite numbers, a frame rate outside 10 to 240 Hz.
    WishError
        An unknown size or style.
    DatabaseError
        Nobody called ``subject``.
    """

    def __init__(
        self,
        database: MotionDatabase,
        positions: Float[Array, "characters 2"],
        headings: Float[Array, "characters"] | float = 0.0,
        *,
        subject: str | None = None,
        gains: SteeringGains | None = None,
        frame_rate: float | None = None,
        threads: int = 1,
        size: str | Sequence[str] = "neutral",
        style: Style | Sequence[Style] | Float[Array, "characters"] = 0.0,
    ) -> None:
        places = np.array(positions, np.float64)
        if places.ndim != 2 or places.shape[1] != 2 or len(places) == 0:
            raise InputError(f"positions must be ground points of shape (characters, 2), not {places.shape}")
        looks = np.broadcast_to(np.asarray(headings, np.float64), (len(places),))
        if not (np.isfinite(places).all() and np.isfinite(looks).all()):
            raise InputError("positions and headings must be finite numbers")
        rate = float(database.frame_rate if frame_rate is None else frame_rate)
        if not 10 <= rate <= 240:
            raise InputError(f"the frame rate must lie between 10 and 240 Hz, not at {rate}")
        self.database = database
        self.gains = gains or SteeringGains()
        self.frame_rate = rate
        self._tables = make_tables(database, subject)
        self._motions = {
            motion: i
            for i, motion in enumerate(MOTIONS)
            if any(
                group.motion == motion and count
                for group, count in zip(database.groups, self._tables.sizes, strict=True)
            )
        }
        self._state = make_state(len(places), self._tables)
        self._state.position[:] = places
        self._state.heading[:] = looks
        self._points = places.copy()
        self._forces = np.zeros_like(places)
        self._kind = np.full(len(places), POINT)
        self._rests_in = np.full(len(places), np.inf)
        self._wanted = np.zeros(len(places), np.int64)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._set_sizes(self._sizes_of(size))
        self._state.style[:] = style_numbers(style, len(places))

    def __len__(self) -> int:
        return len(self._wanted)

    @property
    def motions(self) -> tuple[str, ...]:
        """Motion types that can be asked for."""
        return tuple(self._motions)

    @property
    def made_up(self) -> int:
        """Transitions so far for which the database had no example, so that poses were blended over instead."""
        return int(self._state.made_up.sum())

    def step(
        self,
        points: Float[Array, "characters 2"] | None = None,
        *,
        forces: Float[Array, "characters 2"] | None = None,
        accelerations: Float[Array, "characters 2"] | None = None,
        rests_in: Float[Array, "characters"] | float = np.inf,
        motion: str | Sequence[str] = "walk",
        size: str | Sequence[str] | None = None,
        style: Style | Sequence[Style] | Float[Array, "characters"] | None = None,
    ) -> Pose:
        """Advance by one frame. Give one of points, forces and accelerations.

        Parameters
        ----------
        points
            Ground points to follow, metres.
        forces
            Instead of points: forces on a unit mass in the world, m/s2 (a joystick, sliders).
        accelerations
            Instead of points: what a plan wants, in the world, m/s2 (see ``paths.follow``).
        rests_in
            With accelerations: time until the plan comes to rest, seconds; stops begin and play so that they end then.
        motion
            ``stand``, ``walk`` or ``run``, one for all or one each; carried out at the next segment the graph allows.
            Beside a point that rests, a character comes to stand by itself.
        size
            How large movements are: ``calm``, ``neutral``, ``lively`` or ``exaggerated``, one for all or one each; as
            before if left out. It changes smoothly, in about half a second.
        style
            In what mood to go: a number from -1 (gloomy) to 1 (brisk), or ``gloomy``, ``neutral``, ``brisk``, one for
            all or one each; as before if left out. It acts from the next half cycle on, as far as the database shows
            it: examples are chosen by it too.

        Raises
        ------
        WishError
            Not exactly one of points, forces and accelerations, wrong shape, numbers that are not finite, an unknown
            motion, size or style. Nothing has changed then.
        """
        sizes = None if size is None else self._sizes_of(size)
        styles = None if style is None else style_numbers(style, len(self))
        self._take_wish(points, forces, accelerations, rests_in, motion)
        if sizes is not None:
            self._set_sizes(sizes)
        if styles is not None:
            self._state.style[:] = styles
        self._advance()
        return self._pose()

    def _take_wish(
        self,
        points: Array | None,
        forces: Array | None,
        accelerations: Array | None,
        rests_in: Array | float,
        motion: str | Sequence[str],
    ) -> None:
        """Check a wish whole before any of it is stored."""
        given = [
            (kind, name, wish)
            for kind, name, wish in (
                (POINT, "points", points),
                (FORCE, "forces", forces),
                (PLAN, "accelerations", accelerations),
            )
            if wish is not None
        ]
        if len(given) != 1:
            raise WishError("give one of points, forces and accelerations")
        kind, name, wish = given[0]
        wish = np.asarray(wish, np.float64)
        if wish.shape != self._points.shape:
            raise WishError(f"{name} must have shape {self._points.shape}, not {wish.shape}")
        if not np.isfinite(wish).all():
            row = int(np.flatnonzero(~np.isfinite(wish).all(axis=1))[0])
            raise WishError(f"the wish of character {row} is {wish[row].tolist()}: finite numbers are wanted")
        if np.abs(wish).max() > FARTHEST:
            raise WishError(f"the wish lies further than {FARTHEST:.0e} from the origin")
        rests = np.asarray(rests_in, np.float64)
        if rests.shape not in ((), (len(self),)) or np.isnan(rests).any() or (rests < 0).any():
            raise WishError("rests_in must be seconds from 0, one for all or one each")
        if isinstance(motion, str):
            wanted: int | list[int] = self._number_of(motion)
        else:
            if len(motion) != len(self):
                raise WishError(f"{len(motion)} motions for {len(self)} characters")
            wanted = [self._number_of(name) for name in motion]
        self._wanted[:] = wanted
        self._kind[:] = kind
        self._rests_in[:] = rests if kind == PLAN else np.inf
        (self._points if kind == POINT else self._forces)[:] = wish

    def _sizes_of(self, size: str | Sequence[str]) -> list[float]:
        names = [size] * len(self) if isinstance(size, str) else list(size)
        if len(names) != len(self):
            raise WishError(f"{len(names)} sizes for {len(self)} characters")
        try:
            return [AMOUNTS[name] for name in names]
        except (KeyError, TypeError):
            wrong = next(name for name in names if name not in SIZES)
            raise WishError(f"there is no size {wrong!r} of movement; there are {', '.join(SIZES)}") from None

    def _set_sizes(self, sizes: list[float]) -> None:
        """Take sizes over; the first that is not neutral costs a second or two."""
        if any(sizes) and not len(self._tables.larger):
            self._tables = self._tables._replace(larger=enlargement(self.database).astype(np.float32))
        self._state.size[:, 2] = sizes

    def _number_of(self, motion: str) -> int:
        try:
            return self._motions[motion]
        except (KeyError, TypeError):
            raise WishError(f"there is no motion {motion!r}; there are {', '.join(self._motions)}") from None

    def _advance(self) -> None:
        if not step_block.signatures and not is_compiled(step_block):
            log.warning("compiling the walker, once for this machine and version: this takes half a minute")
        run = [self._block(a, min(a + BLOCK, len(self))) for a in range(0, len(self), BLOCK)]
        if self._pool is None or len(run) == 1:
            for arguments in run:
                step_block(*arguments)
        else:
            list(self._pool.map(lambda arguments: step_block(*arguments), run))

    def _block(self, first: int, last: int) -> tuple[object, ...]:
        return (
            self._tables,
            self._state,
            self._points,
            self._forces,
            self._kind,
            self._rests_in,
            self._wanted,
            self.gains.alpha,
            self.gains.beta,
            1.0 / self.frame_rate,
            first,
            last,
        )

    def _pose(self) -> Pose:
        s, groups = self._state, self.database.groups
        playing = s.group.tolist()
        return Pose(
            root_position=s.root.copy(),
            rotations=s.rotations.copy(),
            vehicle=VehicleState(
                position=s.position.copy(),
                velocity=s.velocity.copy(),
                acceleration=s.acceleration.copy(),
                heading=s.heading.copy(),
            ),
            planted=s.locked.copy(),
            motion=tuple([groups[g].motion for g in playing]),
            group=tuple([groups[g].name for g in playing]),
            clamped=tuple([_NAMES[bits] for bits in s.acted.tolist()]),
            bounds=BoundsInForce(
                jerk=s.bounds[:, 0].copy(),
                tangential=s.bounds[:, 1:3].copy(),
                lateral=s.bounds[:, 3].copy(),
                speed=s.bounds[:, 4:6].copy(),
            ),
        )


class Walker:
    """One character: a batch of one, without the batch's axis.

    Parameters are those of ``Walkers``; ``position`` is one ground point ``(x, z)``.

    Examples
    --------
    >>> walker = Walker(database)                       # doctest: +SKIP
    >>> pose = walker.step((0.0, 1.5), motion="walk")   # doctest: +SKIP
    """

    def __init__(
        self,
        database: MotionDatabase,
        position: Sequence[float] | Float[Array, "2"] = (0.0, 0.0),
        heading: float = 0.0,
        *,
        subject: str | None = None,
        gains: SteeringGains | None = None,
        frame_rate: float | None = None,
        size: str = "neutral",
        style: Style = 0.0,
    ) -> None:
        place = np.asarray(position, np.float64)
        if place.shape != (2,):
            raise InputError(f"a position is a ground point (x, z), not an array of shape {place.shape}")
        self._batch = Walkers(
            database,
            place[None],
            float(heading),
            subject=subject,
            gains=gains,
            frame_rate=frame_rate,
            size=size,
            style=style,
        )

    @property
    def database(self) -> MotionDatabase:
        """What it has learned."""
        return self._batch.database

    @property
    def frame_rate(self) -> float:
        """Frames a second."""
        return self._batch.frame_rate

    @property
    def gains(self) -> SteeringGains:
        """Spring and damper between vehicle and point."""
        return self._batch.gains

    @property
    def motions(self) -> tuple[str, ...]:
        """Motion types that can be asked for."""
        return self._batch.motions

    @property
    def made_up(self) -> int:
        """Transitions so far for which the database had no example."""
        return self._batch.made_up

    def step(
        self,
        point: Sequence[float] | Float[Array, "2"] | None = None,
        *,
        force: Sequence[float] | Float[Array, "2"] | None = None,
        acceleration: Sequence[float] | Float[Array, "2"] | None = None,
        rests_in: float = np.inf,
        motion: str = "walk",
        size: str | None = None,
        style: Style | None = None,
    ) -> Pose:
        """Advance by one frame to a ground point ``(x, z)``, by a force on a unit mass or as a plan wants (m/s2).

        See ``Walkers.step``.

        Raises
        ------
        WishError
            A wish that is rejected; nothing has changed then.
        """
        if not isinstance(motion, str):
            raise WishError(f"a motion is one of {', '.join(self.motions)}, not {motion!r}")
        pose = self._batch.step(
            _row(point),
            forces=_row(force),
            accelerations=_row(acceleration),
            rests_in=rests_in,
            motion=motion,
            size=size,
            style=style,
        )
        v, b = pose.vehicle, pose.bounds
        return Pose(
            root_position=pose.root_position[0],
            rotations=pose.rotations[0],
            vehicle=VehicleState(
                position=v.position[0],
                velocity=v.velocity[0],
                acceleration=v.acceleration[0],
                heading=np.asarray(v.heading)[0],
            ),
            planted=pose.planted[0],
            motion=pose.motion[0],
            group=pose.group[0],
            clamped=pose.clamped[0],  # type: ignore[arg-type]
            bounds=BoundsInForce(
                jerk=np.asarray(b.jerk)[0],
                tangential=b.tangential[0],
                lateral=np.asarray(b.lateral)[0],
                speed=b.speed[0],
            ),
        )


def _row(wish: object) -> Array | None:
    """One wish as a batch of one."""
    if wish is None:
        return None
    try:
        row = np.asarray(wish, np.float64)
    except (TypeError, ValueError):
        raise WishError(f"a wish is two numbers (x, z), not {wish!r}") from None
    if row.shape != (2,):
        raise WishError(f"a wish is two numbers (x, z), not an array of shape {row.shape}")
    return row[None]
