"""The frequency response of a record beside that of a model whose scheduling moved through it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.judge.frequency_response import (
    FrequencyResponse,
    independent,
    mismatch_cost,
    response_of,
)
from identification.judge.frequency_response import windows as windows_of
from identification.structure.regressors import as_records, units_of
from symheli.errors import ExcitationError
from symheli.lpv import LinearModel
from symheli.records import FlightRecord
from symheli.values.arrays import Array

COHERENCE, RANDOM_ERROR = 0.6, 0.2
"""Less coherence and a larger random error say too little of a response. Source: Tischler and
Remple (2012), ch. 8 and 9.
"""

WINDOWS = 2
"""Independent windows an input: with fewer the inputs explain by chance what they do not cause."""

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
    nu = len(inputs_)
    omega, pieces = windows_of(records, (*inputs_, *outputs_), window, band, tuple(scheduling))
    if independent(len(pieces)) < WINDOWS * nu:
        raise ExcitationError(
            f"{len(pieces)} windows of {window:g} s are too few for {nu} inputs: record longer"
        )
    measured = response_of(
        omega, np.mean([S for S, _ in pieces], axis=0), len(pieces), outputs_, inputs_, window
    )
    power = sum(S[:, :nu, :nu] for S, _ in pieces)
    crossed = np.zeros((len(omega), len(outputs_), nu), complex)
    for S, p in pieces:
        model = model_at(p).select(inputs=inputs_, outputs=outputs_)
        crossed += model.frequency_response(omega) @ S[:, :nu, :nu]
    H = np.swapaxes(np.linalg.solve(np.swapaxes(power, 1, 2), np.swapaxes(crossed, 1, 2)), 1, 2)  # type: ignore[arg-type]
    good = (measured.coherence >= COHERENCE) & (measured.random_error <= RANDOM_ERROR)
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
