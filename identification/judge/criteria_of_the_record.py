"""Criteria that hold a model against a record: its spectral estimate, its course."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from identification.estimators.filter_error import noise_variance
from identification.judge.criterion import TISCHLER, Criterion
from identification.judge.frozen_plant import FrozenPlant
from identification.judge.residuals import theil
from identification.judge.response_match import KNOWN, response_match
from identification.model.prediction import LARGEST
from symheli.errors import ExcitationError
from symheli.records import FlightRecord
from symheli.values.signal import Signal

COST = 50.0
INEQUALITY = 0.25


def responses(
    plant: FrozenPlant, records: Sequence[FlightRecord], window: float, band: tuple[float, float]
) -> Criterion:
    """J, the mean over the pairs of signals that say enough."""
    value, verdict, where = float("nan"), "not known", ""
    model = plant.model
    try:
        found = response_match(
            records,
            lambda p: model.at(p if len(p) > 1 else float(p[0])),  # type: ignore[arg-type]
            plant.outputs,
            [str(u) for u in model.inputs],
            plant.regression.parameters,
            window=window,
            band=band,
            judged=plant.inputs,
        )
    except ExcitationError as error:
        where = str(error)
    else:
        if np.isfinite(found.cost).any():
            value = float(np.nanmean(found.cost))
            worst = np.unravel_index(int(np.nanargmax(found.cost)), found.cost.shape)
            where = (
                f"mean of {int(np.isfinite(found.cost).sum())} pairs, worst"
                f" {plant.outputs[worst[0]]} from {plant.inputs[worst[1]]}"
                f" ({found.cost[worst]:.0f})"
            )
            explained = float(np.mean(found.scatter[np.isfinite(found.cost)]))
            if not found.known:
                where = f"{where}; an input is not seen in any output"
            elif value <= COST:
                verdict = "fit"
            elif value - explained > COST:
                verdict = "not fit"
        else:
            where = "too little coherence"
    return Criterion(
        name="J",
        value=value,
        threshold=COST,
        verdict=verdict,  # type: ignore[arg-type]
        source=TISCHLER,
        where=where,
    )


def predictions(
    plant: FrozenPlant, records: Sequence[FlightRecord], scales: Mapping[str, float], horizon: float
) -> Criterion:
    """TIC pooled over outputs and records. Noise of the sensors excuses what it explains: in what
    is measured, and in where each prediction starts, which an unstable model makes large.
    """
    model = plant.model
    steps = max(round(horizon / model.dt), 1)
    columns = [list(map(str, model.outputs)).index(y) for y in plant.outputs]
    size = np.array([scales[y] for y in plant.outputs])
    measured, guessed, noise, started = [], [], 0.0, 0.0
    rng = np.random.default_rng(0)
    for record in records:
        y = record.columns(plant.outputs) / size
        guess = model.predict(record, steps)[:, columns] / size
        keep = np.isfinite(y).all(axis=1) & ~np.isnan(guess).any(axis=1)
        if not keep.any():
            continue
        mean = y[keep].mean(axis=0)
        measured.append((y[keep] - mean).ravel())
        guessed.append((guess[keep] - mean).ravel())
        noise += keep.sum() * sum(noise_variance(v, record.segments()) for v in y.T)
        moved = model.predict(_noisier(record, model.outputs, rng), steps)[:, columns] / size
        started += np.sum((moved - guess)[keep & ~np.isnan(moved).any(axis=1)] ** 2)
    value, verdict, where = float("nan"), "not known", "no unbroken stretch so long"
    if measured:
        a, b = np.concatenate(measured), np.concatenate(guessed)
        where = ""
        if not np.all(np.abs(b) < LARGEST):
            value, verdict, where = 1.0, "not fit", "predictions diverge"
        else:
            value = theil(a, b).coefficient
            power = np.array([np.mean((a - b) ** 2), np.mean(a**2), np.mean(b**2)])
            known = np.array([noise + started, noise, started]) / len(a)
            # of the signals themselves, and as much of the difference as the noise may leave
            clean = power - known * [1 / KNOWN, KNOWN, KNOWN]
            size_of_both = np.sqrt(power[1:]).sum()
            if value <= INEQUALITY:
                verdict = "fit"
            elif np.sqrt(max(power[0] - KNOWN * known[0], 0.0)) > INEQUALITY * size_of_both:
                verdict = "not fit"
            elif np.all(clean[1:] > 0) and np.sqrt(max(clean[0], 0.0)) <= INEQUALITY * np.sum(
                np.sqrt(clean[1:])
            ):
                verdict, where = "fit", "noise of the sensors taken off"
            else:
                where = "noise explains it"
    return Criterion(
        name="TIC",
        value=value,
        threshold=INEQUALITY,
        verdict=verdict,  # type: ignore[arg-type]
        source=TISCHLER,
        where=where or f"{horizon:g} s",
    )


def _noisier(
    record: FlightRecord, outputs: Sequence[Signal], rng: np.random.Generator
) -> FlightRecord:
    """With as much noise again on the outputs: what predictions then differ by is what the noise in
    the record makes of them.
    """
    added = {
        y: record[y]
        + np.sqrt(noise_variance(record[y], record.segments())) * rng.standard_normal(len(record))
        for y in map(str, outputs)
    }
    return record.with_signals({str(y): y.unit for y in outputs}, **added)
