"""Force extraction: a spring-damper between the vehicle and the point that is followed (KS07 "Force Extraction")."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stridecast.errors import InputError


@dataclass(frozen=True, kw_only=True)
class SteeringGains:
    """The spring-damper ``f = alpha (S - x) - beta v``, told in terms one can feel.

    Parameters
    ----------
    half_life
        Time in which half of a distance to the point is made up when nothing is clamped, seconds.
    damping_ratio
        1 comes to rest at the point without swinging past it, less swings.

    Raises
    ------
    InputError
        Values that are not positive and finite.
    """

    half_life: float = 0.3
    damping_ratio: float = 1.0

    def __post_init__(self) -> None:
        for name in ("half_life", "damping_ratio"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} must be a positive number, not {value}")

    @property
    def _frequency(self) -> float:
        # A critically damped spring (1 + w t) exp(-w t) is at one half for w t = 1.678.
        return 1.6783469900166605 / self.half_life

    @property
    def alpha(self) -> float:
        """Stiffness per mass, 1/s2 (KS07's alpha)."""
        return self._frequency**2

    @property
    def beta(self) -> float:
        """Damping per mass, 1/s (KS07's beta)."""
        return 2.0 * self.damping_ratio * self._frequency

    @property
    def lag(self) -> float:
        """How long the vehicle stays behind a point that moves evenly, seconds."""
        return self.beta / self.alpha
