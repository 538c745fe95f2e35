"""Power of whitened residuals by equation, band of frequency and window of time: what a structure
leaves of the flights it was identified from, and of another flight.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from symheli.values.arrays import Array

WINDOW = 20.0
"""Length of a window, s: how soon a change of the vehicle is to be found."""

BANDS = (0.0, 0.04, 0.12, 0.32)
"""Edges of the bands, fractions of the Nyquist frequency. Above them sensor noise is all there is,
whose level is that of each flight.
"""


def window_powers(parts: Sequence[Array], dt: float, window: float = WINDOW) -> Array:
    """Return the mean power (windows, bands, equations) of whitened residuals, each of `parts` (m,
    equations) an unbroken stretch sampled every `dt` s: 1 where their noise is their only cause.
    Stretches shorter than a window (s) are left out.
    """
    size = round(window / dt)
    whole = [
        part[start : start + size]
        for part in parts
        for start in range(0, len(part) - size + 1, size)
    ]
    if not whole:
        return np.zeros((0, len(BANDS) - 1, parts[0].shape[1] if len(parts) else 0))
    spectra = np.abs(np.fft.rfft(np.stack(whole), axis=1)) ** 2 / size
    share = np.fft.rfftfreq(size) / 0.5
    return np.stack(
        [spectra[:, (share >= low) & (share < high)].mean(axis=1) for low, high in pairwise(BANDS)],
        axis=1,
    )
