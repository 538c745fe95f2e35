"""The frequency response of a record beside that of a model whose scheduling moved through it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.estimators.filter_error import noise_variance
from identification.judge.frequency_response import (
    FrequencyResponse,
    independent,
    mismatch_cost,
    response_of,
)
from identification.judge.frequency_response import windows as windows_of
from identification.structure.regressors import as_records, units_of
from symheli import LinearModel
from symheli.errors import ExcitationError
from symheli.records import FlightRecord
from symheli.values.arrays import Array

COHERENCE, RANDOM_ERROR = 0.6, 0.2
"""Less coherence and a larger random error say too little of a response. Source: Tischler and
Remple (2012), ch. 8 and 9.
"""

WINDOWS = 2
"""Independent windows an input: with fewer the inputs explain by chance what they do not cause."""

KNOWN = 1.1
"""The variance of sensor noise is told from a fifth of a spectrum: to ten percent."""

LEAST, SPAN = 8, 3.0
"""A pair of signals counts where so many frequencies say enough, over such a ratio of them."""


@dataclass(frozen=True, eq=False)
class ResponseMatch:
    """Measured response G and that of the model, H (n, ny, nu), at the frequencies of `measured`.

    `cost` (ny, nu) is J of Tischler and Remple over the frequencies that say enough, NaN where
    those are too few; `scatter` what random errors of G alone add to it.
    """

    measured: FrequencyResponse
    H: Array
    cost: Array
    scatter: Array

    @property
    def known(self) -> bool:
        """Whether every input is judged by at least one output."""
        return bool(np.all(np.any(np.isfinite(self.cost), axis=0)))


def response_match(
    records: FlightRecord | Iterable[FlightRecord],
    model_at: Callable[[Array], LinearModel],
    outputs: Sequence[str],
    inputs: Sequence[str],
    scheduling: Sequence[str],
    *,
    window: float,
    band: tuple[float, float],
    judged: Sequence[str],
) -> ResponseMatch:
    """Responses of `outputs` to the `judged` ones of all `inputs`, the others taken off.

    Each window of the record (s) has its own scheduling: the model is frozen at the mean there and
    averaged as the estimate averages, sum_w G(p_w) S_uu,w (sum_w S_uu,w)^-1, so that a moving
    airspeed passes for no error. Raises `ExcitationError` as `frequency_response`, and where the
    windows are too few for so many inputs.
    """
    records = as_records(records)
    outputs_, inputs_ = units_of(outputs, records), units_of(inputs, records)
    nu, ny = len(inputs_), len(outputs_)
    found = windows_of(records, (*inputs_, *outputs_), window, band, tuple(scheduling))
    omega, pieces = found.omega, list(zip(found.spectra, found.means, strict=True))
    if independent(len(pieces)) < WINDOWS * nu:
        raise ExcitationError(
            f"{len(pieces)} windows of {window:g} s are too few for {nu} inputs: record longer"
        )
    measured = response_of(found, outputs_, inputs_, window)
    power = sum(S[:, :nu, :nu] for S, _ in pieces)
    crossed = np.zeros((len(omega), ny, nu), complex)
    left = np.zeros((len(omega), ny))  # power of what the model leaves of an output
    for S, p in pieces:
        model = model_at(p).select(inputs=inputs_, outputs=outputs_)
        response = model.frequency_response(omega)
        crossed += response @ S[:, :nu, :nu]
        rest = np.concatenate([-response, np.tile(np.eye(ny), (len(omega), 1, 1))], axis=2)
        left += np.einsum("kij,kjl,kil->ki", rest, S, np.conj(rest)).real / len(pieces)
    H = np.swapaxes(np.linalg.solve(np.swapaxes(power, 1, 2), np.swapaxes(crossed, 1, 2)), 1, 2)  # type: ignore[arg-type]
    alone = 1 / np.einsum("kjj->kj", np.linalg.inv(power / len(pieces))).real
    good = (measured.coherence >= COHERENCE) & (measured.random_error <= RANDOM_ERROR)
    good &= ~_fed_back(
        measured, H, alone, left, _floor(records, outputs_), independent(len(pieces))
    )
    columns = [list(map(str, inputs_)).index(name) for name in judged]
    first = np.min(np.where(good, omega[:, None, None], np.inf), axis=0)
    last = np.max(np.where(good, omega[:, None, None], 0.0), axis=0)
    enough = (good.sum(axis=0) >= LEAST) & (last >= SPAN * first)
    cost = np.where(enough, mismatch_cost(measured.G, H, measured.coherence, good), np.nan)
    # an error e of |G| is 8.7 e dB and 57 e degrees
    noise = (20 / np.log(10) * measured.random_error) ** 2
    noise = noise + 0.01745 * np.degrees(measured.random_error) ** 2
    weight = (1.58 * (1 - np.exp(-measured.coherence))) ** 2
    scatter = 20 * np.sum(np.where(good, weight * noise, 0.0), axis=0)
    scatter = scatter / np.maximum(good.sum(axis=0), 1)
    return ResponseMatch(measured, H[:, :, columns], cost[:, columns], scatter[:, columns])


def _floor(records: Sequence[FlightRecord], outputs: Sequence[str]) -> Array:
    """Spectral density (ny,) of white noise of the sensors, one-sided as that of the windows."""
    level = [[noise_variance(record[y], record.segments()) for record in records] for y in outputs]
    return 2 * records[0].dt * np.mean(level, axis=1)


def _fed_back(
    measured: FrequencyResponse,
    H: Array,
    alone: Array,
    left: Array,
    floor: Array,
    windows: float,
) -> Array:
    """Frequencies (n, ny, nu) at which the estimate is off by noise that a feedback brought to the
    inputs: what the model leaves of the output is no more than the noise of its sensor, yet G and H
    are farther apart than random errors, and the noise is large enough for that.

    In feedback G is off by S_eu / S_uu, up to (S_ee / S_uu)^(1/2), and is -1/K where noise alone
    moves the inputs, with a coherence near 1. Such a frequency
    says nothing of the model.
    """
    own = np.abs(measured.G) ** 2 * alone[:, None, :]
    explained = left <= KNOWN * floor * (1 + 2 / np.sqrt(windows))
    random = np.sqrt(2) * measured.random_error * np.abs(measured.G)  # both parts of G
    biased = np.abs(measured.G - H) > 2 * random
    return explained[:, :, None] & biased & (floor[:, None] > RANDOM_ERROR**2 * own)
