"""Style at run time: in which mood each example counts when a walker who is gloomy or brisk chooses among them.

The style of a single half cycle is as uncertain as one step is long; that of a take is steady, and it tells the mood of
its standing, its starts and stops too, which show little of it themselves. So an example counts with what its take
shows where it walks and runs. Mirror images are of the same take and mood.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from jaxtyping import Bool, Float

from stridecast.errors import WishError
from stridecast.geometry.signals import smooth
from stridecast.model.database import MotionDatabase

Array = np.ndarray

Style = float | str

WORDS: Mapping[str, float] = MappingProxyType({"gloomy": -1.0, "neutral": 0.0, "brisk": 1.0})
"""Words for styles."""

USUAL, MOODY = 0.3, 0.45
"""A take whose style is nearer to 0 than the first counts as neutral, from the second on as what it is."""


def example_styles(database: MotionDatabase) -> Float[Array, "examples"]:
    """Style with which each example counts, from gloomy (-1) to brisk (+1).

    A take is no more gloomy or brisk than half of those that are: what lies beyond is the manner of one take.
    """
    takes, told = database.examples.takes, database.annotations
    own = np.zeros(len(database.takes))
    for take in np.unique(takes):
        rows = np.flatnonzero(takes == take)
        going = rows[told.cadence[rows] > 0]
        rows = going if len(going) else rows
        own[take] = np.average(told.style[rows], weights=database.examples.durations[rows])
    own *= smooth((np.abs(own) - USUAL) / (MOODY - USUAL))
    styles = own[takes]
    low, high = (float(np.median(side)) if len(side) else 0.0 for side in (styles[styles < 0], styles[styles > 0]))
    return np.clip(styles, low, high)


def style_ranges(
    styles: Float[Array, "examples"], allowed: Bool[Array, "examples"], rows: Sequence[slice]
) -> Float[Array, "groups 2"]:
    """Least and greatest style in each group, given by its rows; nobody is asked for more than there is."""
    own = [styles[some][allowed[some]] for some in rows]
    return np.array([(some.min(), some.max()) if len(some) else (0.0, 0.0) for some in own])


def style_numbers(
    style: Style | Sequence[Style] | Float[Array, "characters"],
    count: int,
    asked: Bool[Array, "characters"] | None = None,
) -> Float[Array, "characters"]:
    """Styles that are asked for as numbers, one each; only of those who are ``asked`` if that is given.

    Raises
    ------
    WishError
        A word that is none, a number outside -1 to 1, or not as many as there are characters.
    """
    given = [style] * count if isinstance(style, str) or np.ndim(style) == 0 else list(style)  # type: ignore[arg-type]
    if len(given) != count:
        raise WishError(f"{len(given)} styles for {count} characters")
    if asked is None:
        asked = np.ones(count, bool)
    return np.array([_number(value) if counts else 0.0 for value, counts in zip(given, asked.tolist(), strict=True)])


def _number(style: object) -> float:
    if isinstance(style, str) and style in WORDS:
        return WORDS[style]
    if isinstance(style, int | float | np.number) and not isinstance(style, bool) and -1.0 <= float(style) <= 1.0:
        return float(style)
    raise WishError(f"a style is {', '.join(WORDS)} or a number from -1 (gloomy) to 1 (brisk), not {style!r}")
