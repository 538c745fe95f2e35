"""Leakage of outputs into regressors: through a scheduling signal computed from the outputs, or
through resampled data.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence

import numpy as np

from identification.structure.kinematic_arx import KinematicARX
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import as_records, scheduling_values
from symheli.errors import DataWarning
from symheli.records import FlightRecord
from symheli.values.arrays import Array

MADE_OF_OUTPUTS = 0.5
"""A scheduling signal of whose news the outputs of the same instant explain more than this is a
measurement of them.
"""

PAST_SAMPLES = 2
"""Number of samples of p and the outputs that are known before the sample k."""

NOTHING_NEW = 1e-6
"""Share of the spread of p from sample to sample; news below this is rounding."""


def share_from_outputs(arx: LPVARX, records: FlightRecord | Iterable[FlightRecord]) -> Array:
    """Share (parameters,) in [0, 1] of what is new in each scheduling parameter at k that the
    outputs at k explain.

    New is the residual of a linear regression on p and the outputs at k-1 and k-2. About 1 for a
    filtered output, 0 for a command: above `MADE_OF_OUTPUTS` p(k) contains the outputs that a model
    has to predict.
    """
    now, past, p = [], [], []
    for record in as_records(records):
        y, s = record.columns(arx.outputs), scheduling_values(arx, record).reshape(len(record), -1)
        for part in record.segments():
            n = part.stop - part.start - PAST_SAMPLES
            if n > 0:
                both = np.hstack([y[part], s[part]])
                now.append(y[part][PAST_SAMPLES:])
                past.append(
                    np.hstack(
                        [
                            np.ones((n, 1)),
                            *(
                                both[PAST_SAMPLES - lag : PAST_SAMPLES - lag + n]
                                for lag in range(1, PAST_SAMPLES + 1)
                            ),
                        ]
                    )
                )
                p.append(s[part][PAST_SAMPLES:])
    if not now:
        return np.zeros(len(arx.parameters))
    rows = np.hstack([np.vstack(past), np.vstack(now), np.vstack(p)])
    rows = rows[np.isfinite(rows).all(axis=1)]
    known = rows.shape[1] - arx.ny - len(arx.parameters)
    if len(rows) <= rows.shape[1]:
        return np.zeros(len(arx.parameters))
    new = (
        rows[:, known:]
        - rows[:, :known] @ np.linalg.lstsq(rows[:, :known], rows[:, known:], rcond=None)[0]
    )
    y, s = new[:, : arx.ny], new[:, arx.ny :]
    left = s - y @ np.linalg.lstsq(y, s, rcond=None)[0]
    change = np.sqrt(np.mean(np.diff(rows[:, known + arx.ny :], axis=0) ** 2, axis=0))
    size = np.sqrt(np.mean(s**2, axis=0))
    return np.where(
        size > NOTHING_NEW * change,
        1 - np.sum(left**2, axis=0) / np.maximum(np.sum(s**2, axis=0), np.finfo(float).tiny),
        0.0,
    )


def warn_of_own_past(arx: LPVARX | KinematicARX, record: FlightRecord) -> None:
    """Warn (`DataWarning`) where a scheduling parameter is the outputs, their squares or products,
    now or up to two samples ago: a free run with the measured parameter then uses the measured
    outputs.
    """
    if arx.constant:
        return
    y = record.columns(arx.outputs)
    y = (y - np.nanmean(y, axis=0)) / np.maximum(np.nanstd(y, axis=0), np.finfo(float).tiny)
    p = scheduling_values(arx, record).reshape(len(record), -1)
    for j, name in enumerate(arx.parameters):
        for lag in range(PAST_SAMPLES + 1):
            rows = [
                np.arange(part.start + lag, part.stop)
                for part in record.segments()
                if part.stop - part.start > lag
            ]
            at = np.concatenate(rows) if rows else np.zeros(0, int)
            of = y[at - lag]
            products = (of[:, :, None] * of[:, None, :]).reshape(len(at), of.shape[1] ** 2)
            known = np.column_stack([np.ones(len(at)), of, products, p[at, j]])
            known = known[np.isfinite(known).all(axis=1)]
            if len(known) <= known.shape[1] or not np.ptp(known[:, -1]):
                continue
            left = (
                known[:, -1]
                - known[:, :-1] @ np.linalg.lstsq(known[:, :-1], known[:, -1], rcond=None)[0]
            )
            if np.std(left) < NOTHING_NEW * np.std(known[:, -1]):
                when = "now" if lag == 0 else f"{lag} sample{'s' if lag > 1 else ''} ago"
                warnings.warn(
                    f"{name} is made of the outputs {when}: a free run with the measured one"
                    " contains the outputs that it has to predict; on its own outputs it may be far"
                    " worse",
                    DataWarning,
                    stacklevel=3,
                )
                break


def warn_of_leakage(arx: LPVARX, records: Sequence[FlightRecord]) -> None:
    """Warn (`DataWarning`) where y(k) is among its own regressors, or an input at k that it depends
    on is not.
    """
    if arx.offset_rate or arx.scheduling_at == "now":
        for parameter, share in zip(arx.parameters, share_from_outputs(arx, records), strict=True):
            if share > MADE_OF_OUTPUTS:
                term = "offset_rate" if arx.offset_rate else 'scheduling_at="now"'
                warnings.warn(
                    f"{parameter} is made of the outputs ({100 * share:.0f} % of what is new in it"
                    f" at k is in the outputs at k): with {term} the regressors contain the"
                    " outputs to predict, and the fits are too good; schedule on a command, or"
                    f" leave {term} out and score with hold_p=True",
                    DataWarning,
                    stacklevel=3,
                )
    made = next((record.resampled for record in records if record.resampled), "")
    if made and arx.inputs and arx.input_lags and arx.input_lags.start > 0:
        warnings.warn(
            f"the samples are {made}: y(k) may depend on u(k), and delay {arx.input_lags.start}"
            " leaves that out; give delay=0",
            DataWarning,
            stacklevel=3,
        )
