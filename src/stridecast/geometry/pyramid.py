"""Signals in frequency bands: a Gaussian pyramid along time and its differences (Bruderlin and Williams 1995, 2.1).

The paper halves the frequency from level to level with a kernel of five samples, so its bands depend on the frame rate.
Here each level is a Gaussian of so many seconds: bands have their limits in hertz, whatever the rate.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

Array = np.ndarray

HALF = np.sqrt(2 * np.log(2)) / (2 * np.pi)
"""Width of a Gaussian that lets half of a frequency through, in periods of it."""


def lowest(
    signal: Float[Array, "frames *shape"], rate: float, frequency: float, cyclic: bool = False
) -> Float[Array, "frames *shape"]:
    """What a signal does slower than ``frequency`` (Hz; half of that itself), by a Gaussian.

    A signal that is not ``cyclic`` goes on beyond its ends as their mirror image, upside down: values at the ends stay.
    """
    width = HALF / frequency * rate
    if len(signal) < 2 or width < 0.2:
        return signal
    if cyclic:
        return gaussian_filter1d(signal, width, axis=0, mode="wrap")
    pad = int(4 * width) + 1
    wide = np.pad(signal, [(pad, pad)] + [(0, 0)] * (signal.ndim - 1), mode="reflect", reflect_type="odd")
    return gaussian_filter1d(wide, width, axis=0)[pad:-pad]


def split(
    signal: Float[Array, "frames *shape"], rate: float, frequencies: tuple[float, ...], cyclic: bool = False
) -> Float[Array, "bands frames *shape"]:
    """Bands of a signal, the slowest first; their sum is the signal.

    Parameters
    ----------
    signal
        A cyclic one holds each moment of its cycle once: its last frame is followed by its first.
    rate
        Frames a second.
    frequencies
        Where one band ends and the next begins, rising, Hz; there is one band more.
    cyclic
        Whether the signal repeats.
    """
    levels = [np.zeros_like(signal), *(lowest(signal, rate, f, cyclic) for f in frequencies), signal]
    return np.diff(np.stack(levels), axis=0)


def join(
    bands: Float[Array, "bands frames *shape"], gains: Float[Array, "bands"] | tuple[float, ...]
) -> Float[Array, "frames *shape"]:
    """Sum of bands, each times its gain."""
    return np.tensordot(np.asarray(gains, np.float64), bands, axes=1)
