"""The compiled loops under ``numbers``: decimal text to floats, byte by byte."""

from __future__ import annotations

import numpy as np
from numba import njit

_FURTHEST = 100_000
"""Exponents beyond this are as good as this."""

_POWERS = np.array([float(f"1e{exponent}") for exponent in range(309)])
_MOST = (10**18 - 10) // 10
"""Above this, further digits change no float of 53 bits, and would overflow the 64 bits they are gathered in."""


@njit(cache=True, nogil=True)
def count_tokens(text: np.ndarray) -> int:
    """Count the words of a text."""
    count = 0
    outside = True
    for byte in text:
        if byte <= 32:
            outside = True
        elif outside:
            outside = False
            count += 1
    return count


@njit(cache=True, nogil=True)
def _scaled(mantissa: int, exponent: int) -> float:
    """``mantissa * 10**exponent``; up to 15 digits and the 22nd power of ten both are exact, so it is rounded once."""
    value = float(mantissa)
    if mantissa == 0 or exponent == 0:
        return value
    if exponent > 0:
        return value * _POWERS[exponent] if exponent <= 308 else np.inf
    if exponent >= -308:
        return value / _POWERS[-exponent]
    return value / _POWERS[308] / _POWERS[min(-exponent - 308, 308)]


@njit(cache=True, nogil=True)
def read(
    text: np.ndarray, place: int, row: int, values: np.ndarray, rows: np.ndarray, done: int
) -> tuple[int, int, int]:
    """Fill ``values`` from ``place`` on, up to the end or to a word that is no number; return where it stopped."""
    size = len(text)
    while True:
        while place < size and text[place] <= 32:
            if text[place] == 10:
                row += 1
            place += 1
        if place == size:
            return done, place, row
        start = place
        negative = text[place] == 45
        if negative or text[place] == 43:
            place += 1
        mantissa, exponent, digits, after_point = 0, 0, 0, False
        while place < size:
            digit = np.int64(text[place]) - 48
            if 0 <= digit <= 9:
                digits += 1
                if mantissa <= _MOST:
                    mantissa = mantissa * 10 + int(digit)
                    exponent -= after_point
                else:
                    exponent += not after_point
            elif digit == -2 and not after_point:
                after_point = True
            else:
                break
            place += 1
        good = digits > 0
        if good and place < size and (text[place] == 101 or text[place] == 69):
            place += 1
            down = place < size and text[place] == 45
            if down or (place < size and text[place] == 43):
                place += 1
            power, digits = 0, 0
            while place < size and 48 <= text[place] <= 57:
                power = power * 10 + int(np.int64(text[place])) - 48
                if power > _FURTHEST:
                    power = _FURTHEST
                digits += 1
                place += 1
            good = digits > 0
            exponent += -power if down else power
        if not good or (place < size and text[place] > 32):
            return done, start, row
        value = _scaled(mantissa, exponent)
        values[done] = -value if negative else value
        rows[done] = row
        done += 1
