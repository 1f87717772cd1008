"""What a person can do at each speed, whatever the motion: the bounds of a database's groups as functions of speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from stridecast.errors import DatabaseError
from stridecast.model.database import MotionDatabase
from stridecast.model.segment import RUN, STAND, WALK

Array = np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class HumanBounds:
    """Bounds of steering by gait, slowest gait first: walking (with starts and stops), then running where there is any.

    Between ``fades[0]`` and ``fades[1]`` the bounds run linearly in speed from the first gait's to the last one's.

    Parameters
    ----------
    jerk
        Largest change of acceleration, m/s3.
    tangential
        Least and greatest acceleration along the direction of motion, m/s2.
    lateral_per_speed
        Greatest acceleration across it as a multiple of the speed, 1/s: the largest turning speed.
    fastest
        Greatest speed, m/s.
    fades
        Speeds between which one gait becomes the other, m/s; of no account where there is one gait only.

    Raises
    ------
    DatabaseError
        Arrays of different length, bounds that allow nothing, or gaits out of order.
    """

    jerk: Float[Array, "gaits"]
    tangential: Float[Array, "gaits 2"]
    lateral_per_speed: Float[Array, "gaits"]
    fastest: Float[Array, "gaits"]
    fades: tuple[float, float] = (1.7, 2.3)

    def __post_init__(self) -> None:
        gaits = len(self.jerk)
        for name, shape in (("jerk", ()), ("tangential", (2,)), ("lateral_per_speed", ()), ("fastest", ())):
            array = np.array(getattr(self, name), np.float64)
            if array.shape != (gaits, *shape) or not np.isfinite(array).all():
                raise DatabaseError(f"{name} needs {(gaits, *shape)} finite numbers, not {array.shape}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if gaits not in (1, 2):
            raise DatabaseError(f"there are bounds for one gait or for two, not for {gaits}")
        low, high = self.tangential.T
        if (np.concatenate((self.jerk, high, -low, self.lateral_per_speed, self.fastest)) <= 0).any():
            raise DatabaseError("bounds must leave room to speed up, brake, turn and move")
        if (np.diff(self.fastest) <= 0).any() or not 0 < self.fades[0] < self.fades[1]:
            raise DatabaseError(
                "the second gait must be the faster one, and gaits must change over some range of speed"
            )

    @classmethod
    def of(cls, database: MotionDatabase) -> HumanBounds:
        """Hull over a database's groups: standing, walking, starting and stopping to walk; and running.

        Raises
        ------
        DatabaseError
            Nobody walks in it, or nobody turns.
        """
        slow = [g.bounds for g in database.groups if {g.comes_from, g.leads_to} <= {STAND, WALK}]
        walk = [g.bounds for g in database.groups if g.motion == WALK]
        run = [g.bounds for g in database.groups if g.motion == RUN]
        if not walk:
            raise DatabaseError("nobody walks in this database: it cannot tell what a walking person can do")
        gaits = [slow, run] if run else [slow]
        tangential = [
            (min(b.tangential_hull[0] for b in gait), max(b.tangential_hull[1] for b in gait)) for gait in gaits
        ]
        fastest = [max(high for b in gait for _, high in b.speed) for gait in ([walk, run] if run else [walk])]
        slowest_run = min((low for b in run for low, _ in b.speed), default=0.0)
        middle = 0.5 * (min(slowest_run, fastest[0]) + fastest[0])
        return cls(
            jerk=np.array([max(b.jerk for b in gait) for gait in gaits]),
            tangential=np.array(tangential),
            lateral_per_speed=np.array([max(b.lateral_per_speed for b in gait) for gait in gaits]),
            fastest=np.array(fastest),
            fades=(0.85 * middle, 1.15 * middle),
        )

    def running(self, speed: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """How much of the bounds at a speed is that of the last gait, 0 to 1."""
        if len(self.jerk) == 1:
            return np.zeros_like(speed)
        low, high = self.fades
        return np.clip((speed - low) / (high - low), 0.0, 1.0)

    def at(
        self, speed: Float[Array, "*shape"]
    ) -> tuple[Float[Array, "*shape"], Float[Array, "*shape"], Float[Array, "*shape"], Float[Array, "*shape"]]:
        """Jerk, least and greatest tangential, and greatest lateral acceleration at a speed."""
        share = self.running(speed)

        def mixed(values: Array) -> Array:
            return (1.0 - share) * values[0] + share * values[-1]

        lateral = mixed(self.lateral_per_speed) * np.abs(speed)
        return mixed(self.jerk), mixed(self.tangential[:, 0]), mixed(self.tangential[:, 1]), lateral
