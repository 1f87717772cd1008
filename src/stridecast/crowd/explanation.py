"""Why somebody does what they do, in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from stridecast.crowd.rules import RULES, WHY

Array = np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Outlook:
    """Where somebody is about to be.

    Parameters
    ----------
    way
        From where they are to their last stop, metres; the place alone where they stand for good.
    window
        Where they would be, frame by frame, if they braked from now on: what is reserved, and nobody else enters.
    target
        Velocity that they aim at, m/s.
    other
        Number of whom their rule is about, if that is somebody.
    """

    way: Float[Array, "points 2"]
    window: Float[Array, "frames 2"]
    target: Float[Array, "2"]
    other: int | None


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """What somebody is up to.

    Parameters
    ----------
    person
        Name of whom it is about.
    rule
        Name of the rule followed (see ``crowd.rules``).
    other
        Name of the one whom it answers, if there is one.
    contact_in
        Seconds until the two would meet if both went on, infinity if they would not.
    side
        On which they are passed: ``left``, ``right`` or nothing.
    held
        Whether the speed is held down in this frame so that there is room left to stop.
    why
        A sentence.
    """

    person: str
    rule: str
    other: str | None
    contact_in: float
    side: str
    held: bool
    why: str

    def __str__(self) -> str:
        return f"{self.person}: {self.rule}, as {self.why}"


def explanation_of(
    person: str, code: int, other: str | None, contact_in: float, side: float, held: bool
) -> Explanation:
    """Put what the kernels know into words."""
    where = "left" if side > 0 else "right" if side < 0 else ""
    why = WHY[code].format(other=other or "somebody", time=min(contact_in, 99.0), side=where or "wider side")
    return Explanation(
        person=person, rule=RULES[code], other=other, contact_in=contact_in, side=where, held=held, why=why
    )
