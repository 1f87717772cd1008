"""Walkers: characters that follow points or forces, frame by frame and without latency (KS07 "Synthesis")."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from stridecast.errors import InputError, WishError
from stridecast.geometry.kernels import is_compiled
from stridecast.model.database import MotionDatabase
from stridecast.model.pose import BoundsInForce, Pose, VehicleState
from stridecast.model.segment import MOTIONS
from stridecast.steering.force import SteeringGains
from stridecast.steering.kernels import JERK, LATERAL, SPEED, TANGENTIAL
from stridecast.synthesis.sizes import kept_enlargement
from stridecast.synthesis.state import make_state
from stridecast.synthesis.step_kernels import GIVEN, PLAN, POINT, Given, step_block
from stridecast.synthesis.styles import Style, style_numbers
from stridecast.synthesis.tables import make_tables
from stridecast.synthesis.wishes import Wish, WishReader, newcomers, single, size_amounts

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


LEAST_TURNING = 0.05
"""Somebody who may not turn at all could not follow anything: the least share of the turning that was learned."""


class Playing(NamedTuple):
    """What plays, of each character: place of the group in the database, generic time (0 to 1), segments begun."""

    group: Int[Array, "characters"]
    generic: Float[Array, "characters"]
    segments: Int[Array, "characters"]


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
        self._blank = make_state(1, self._tables)
        self._made_up_before = 0
        self._state.position[:] = places
        self._state.heading[:] = looks
        self._points = places.copy()
        self._forces = np.zeros_like(places)
        self._kind = np.full(len(places), POINT)
        self._rests_in = np.full(len(places), np.inf)
        self._wanted = np.zeros(len(places), np.int64)
        s = self._state
        self._given = Given(s.position.copy(), s.velocity.copy(), s.acceleration.copy(), s.heading.copy())
        self._active = np.ones(len(places), bool)
        self._steps = np.full(len(places), 1.0 / rate)
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._reader = WishReader(len(places), rate, self._motions)
        self._set_sizes(size_amounts(size, len(places)))
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
        return self._made_up_before + int(self._state.made_up.sum())

    @property
    def playing(self) -> Playing:
        """Which group plays, how far it is, and how many segments have begun."""
        s = self._state
        return Playing(group=s.group.copy(), generic=np.minimum(s.generic, 1.0), segments=s.segments.copy())

    def limit_turning(self, share: float) -> None:
        """Let everybody use only so much of the turning that was learned, from the next frame on (KS07's slide bars).

        Parameters
        ----------
        share
            Of the greatest lateral acceleration, ``LEAST_TURNING`` to 1.

        Raises
        ------
        InputError
            Another share. Nothing has changed then.
        """
        if not LEAST_TURNING <= share <= 1.0:
            raise InputError(f"the share of the turning must lie between {LEAST_TURNING} and 1, not at {share}")
        learned = np.array([group.bounds.lateral_per_speed for group in self.database.groups])
        self._tables = self._tables._replace(lateral_per_speed=share * learned)

    def place(
        self,
        rows: Sequence[int] | Int[Array, "rows"],
        positions: Float[Array, "rows 2"],
        headings: Float[Array, "rows"] | float = 0.0,
        *,
        phase: Float[Array, "rows"] | float = 0.0,
        size: str | Sequence[str] = "neutral",
        style: Style | Sequence[Style] | Float[Array, "rows"] = 0.0,
    ) -> None:
        """Put new people into rows; nothing is left there of who was in them before.

        Whoever is then stepped with a vehicle in motion walks or runs in the first frame.

        Parameters
        ----------
        rows
            Which rows, each once.
        positions, headings
            Where they are and look, metres and radians.
        phase
            Where in their gait those are who appear in motion, from 0 to below 1: the half cycle of the left foot
            begins at 0, that of the right foot at 0.5.
        size, style
            Size of movement and style (see ``step``).

        Raises
        ------
        InputError
            Rows that are not there or come twice, places that are no finite numbers, a phase outside 0 to 1.
        WishError
            An unknown size or style. Nothing has changed then.
        """
        new = newcomers(rows, positions, headings, phase, len(self))
        sizes, styles = size_amounts(size, len(new.rows)), style_numbers(style, len(new.rows))
        self._enlarge_if(sizes)
        self._made_up_before += int(self._state.made_up[new.rows].sum())
        for field, blank in zip(self._state, self._blank, strict=True):
            field[new.rows] = blank[0]
        self._state.position[new.rows] = new.places
        self._state.heading[new.rows] = new.headings
        self._state.phase[new.rows] = new.phases
        self._state.size[new.rows, 2] = sizes
        self._state.style[new.rows] = styles
        self._points[new.rows] = new.places
        self._forces[new.rows] = 0.0

    def step(
        self,
        points: Float[Array, "characters 2"] | None = None,
        *,
        forces: Float[Array, "characters 2"] | None = None,
        accelerations: Float[Array, "characters 2"] | None = None,
        rests_in: Float[Array, "characters"] | float = np.inf,
        motion: str | Sequence[str] | Int[Array, "characters"] = "walk",
        size: str | Sequence[str] | None = None,
        style: Style | Sequence[Style] | Float[Array, "characters"] | None = None,
        vehicles: VehicleState | None = None,
        active: Bool[Array, "characters"] | None = None,
        dt: Float[Array, "characters"] | float | None = None,
    ) -> Pose:
        """Advance by one frame. Give one of points, forces, accelerations and vehicles.

        Parameters
        ----------
        points
            Ground points to follow, metres.
        forces
            Instead of points: forces on a unit mass in the world, m/s2 (a joystick, sliders).
        accelerations
            Instead of points: what a plan wants, in the world, m/s2 (see ``paths.follow``).
        rests_in
            With accelerations or vehicles: time until the plan comes to rest, seconds; stops begin and play so that
            they end then. Infinite for those who are not about to rest.
        motion
            ``stand``, ``walk`` or ``run``, one for all or one each, or an array of their numbers in ``MOTIONS``;
            carried out at the next segment the graph allows.
            Beside a point that rests, a character comes to stand by itself.
        size
            How large movements are: ``calm``, ``neutral``, ``lively`` or ``exaggerated``, one for all or one each; as
            before if left out. It changes smoothly, in about half a second.
        style
            In what mood to go: a number from -1 (gloomy) to 1 (brisk), or ``gloomy``, ``neutral``, ``brisk``, one for
            all or one each; as before if left out. It acts from the next half cycle on, as far as the database shows
            it: examples are chosen by it too.
        vehicles
            Instead of points: vehicles that move by themselves, a row each, at any speed, also turning on the spot.
            They are shown as given, and the bodies follow: smaller and slower steps below the slowest walk of the
            database, feet put beside each other where the vehicle rests, running only where it is fast enough.
        active
            Who is stepped; everybody if left out. The others stay as they are, and what is given for them does not
            matter.
        dt
            Seconds that pass in this step, one for all or one each, up to ``LONGEST_STEP``; 1 / frame_rate if left
            out. Who is far away can be stepped every third frame with thrice the time.

        Raises
        ------
        WishError
            Not exactly one of points, forces, accelerations and vehicles, wrong shape, numbers that are not finite, an
            unknown motion, size or style. Nothing has changed then.
        """
        wish = self._reader.read(points, forces, accelerations, vehicles, rests_in, motion, active, dt)
        sizes = None if size is None else size_amounts(size, len(self))
        styles = None if style is None else style_numbers(style, len(self), wish.active)
        self._take(wish)
        if sizes is not None:
            self._set_sizes(sizes)
        if styles is not None:
            self._state.style[wish.active] = styles[wish.active]
        self._advance()
        return self._pose()

    def _take(self, wish: Wish) -> None:
        """Store a wish that was found right."""
        stepped = wish.active
        self._active[:] = stepped
        self._steps[:] = wish.steps
        self._wanted[stepped] = wish.motions[stepped]
        self._kind[stepped] = wish.kind
        self._rests_in[stepped] = wish.rests_in[stepped] if wish.kind in (PLAN, GIVEN) else np.inf
        if isinstance(wish.what, Given):
            self._given = wish.what
        else:
            (self._points if wish.kind == POINT else self._forces)[stepped] = wish.what[stepped]

    def _set_sizes(self, sizes: list[float]) -> None:
        """Take sizes over; the first that is not neutral costs a second or two."""
        self._enlarge_if(sizes)
        self._state.size[self._active, 2] = np.array(sizes)[self._active]

    def _enlarge_if(self, sizes: list[float]) -> None:
        if any(sizes) and not len(self._tables.larger):
            self._tables = self._tables._replace(larger=kept_enlargement(self.database))

    def _advance(self) -> None:
        if not step_block.signatures and not is_compiled(step_block):
            log.warning("compiling the walker, once for this machine and version: this takes a minute or two")
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
            self._given,
            self._active,
            self.gains.alpha,
            self.gains.beta,
            self._steps,
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
        """Spring and damper between vehicle and point; others act from the next frame on."""
        return self._batch.gains

    @gains.setter
    def gains(self, gains: SteeringGains) -> None:
        self._batch.gains = gains

    @property
    def playing(self) -> Playing:
        """Which group plays, how far it is, and how many segments have begun; arrays of one."""
        return self._batch.playing

    def limit_turning(self, share: float) -> None:
        """Use only so much of the turning that was learned; see ``Walkers.limit_turning``."""
        self._batch.limit_turning(share)

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
            single(point),
            forces=single(force),
            accelerations=single(acceleration),
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
