"""Criteria of the verdict `fit_for_control`: in feedback, on the stability and control derivatives
that matter to the loop, and beside a record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from identification.design.criterion import Criterion, Verdict, judged
from identification.estimators.filter_error import noise_variance
from identification.judge.derivatives import Certainty, Derivatives
from identification.judge.frozen_plant import AtPoint, FrozenPlant, Model, text, worst
from identification.judge.residuals import theil
from identification.judge.response_match import KNOWN, response_match
from identification.judge.unseen_flight import validate
from identification.model.kinematic_model import KinematicModel
from identification.model.prediction import LARGEST
from symheli import LinearModel
from symheli.errors import ExcitationError
from symheli.lpv.tools import nu_gaps
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.signal import Signal

SET = 0.95
"""Share of the distribution of the estimate inside the ellipsoid whose boundary is drawn from."""

TISCHLER = "Tischler and Remple (2012)"
VINNICOMBE = "Vinnicombe (2001)"
GUIDELINE = "usual guideline"
HERE = "here"
NO_COVARIANCE = "no covariance"

SHARE_OF_MARGIN = 1 / 3
"""Largest nu-gap, as a share of the stability margin, where nothing is known of the structure's
bias.
"""

GAIN = 0.25
"""Largest error of the static gain, as a share of it."""

BOUND, INSENSITIVITY, CORRELATION = 0.2, 0.1, 0.9
"""Largest Cramer-Rao bound and insensitivity of a derivative, as shares of it, and correlation."""

EXPLAINED = 1.0
"""Largest residual power, as a share of its expectation."""

COST, INEQUALITY = 50.0, 0.25
"""Largest mismatch cost J of the frequency responses, and inequality coefficient (TIC) of the
predictions.
"""


def stability(at: Sequence[AtPoint], true: Sequence[LinearModel | None]) -> Criterion:
    """The share of the draws whose loop is unstable; none may be, nor the estimate's own."""
    alone = [a.margin > 0 for a in at]
    lost, where = worst(np.array([a.lost for a in at]), at)
    otherwise: Verdict = "not known"
    if np.isnan(lost):
        where = NO_COVARIANCE
    if not all(alone):
        lost, otherwise = 1.0, "not fit"
        where = f"p = {text(at[alone.index(False)].p)}: the estimate itself"
    known = [(a, t) for a, t in zip(at, true, strict=True) if t is not None]
    return judged(
        "unstable loops",
        lost,
        0.0,
        otherwise,
        source=HERE,
        where=where,
        truth=float(np.mean([not a.stable(t) for a, t in known])) if known else None,
    )


def feedback(
    at: Sequence[AtPoint],
    bound: Array,
    second_gap: Array,
    true_gap: Array | None,
    threshold: float,
) -> Criterion:
    """The distance that the truth may have, as a share of the margin."""
    margin = np.array([a.margin for a in at])
    with np.errstate(divide="ignore"):
        value, where = worst(bound / margin, at)
        truth = None if true_gap is None else float((true_gap / margin).max())
        apart = np.any(second_gap / margin > threshold)
    if apart:
        where = f"{where}; another estimate is as far"
    row = judged(
        "nu-gap over margin",
        value,
        threshold,
        "not known",
        source=VINNICOMBE,
        where=where,
        truth=truth,
    )
    sampled = at[0].thetas is not None
    return row if sampled else replace(row, verdict="not known", where=NO_COVARIANCE)


def static_gain(
    at: Sequence[AtPoint], true: Sequence[LinearModel | None], in_loop: bool
) -> Criterion:
    """What 95 % of the draws stay within, of the plant alone or in the loop."""
    errors = [
        float("nan")
        if a.drawn is None
        else float(np.quantile(a.gain_errors(a.drawn, in_loop), SET))
        for a in at
    ]
    value, where = worst(np.array(errors), at)
    known = [a.gain_errors([t], in_loop)[0] for a, t in zip(at, true, strict=True) if t is not None]
    return judged(
        "static gain in the loop" if in_loop else "static gain, open",
        value,
        GAIN,
        "not known",
        source=HERE,
        where=NO_COVARIANCE if np.isnan(value) else where,
        truth=float(max(known)) if known else None,
        decides=in_loop,
    )


def certainty(at: Sequence[AtPoint]) -> tuple[Criterion, ...]:
    """Three rows over the derivatives that matter to the loop."""
    none = NO_COVARIANCE if at[0].covariance is None else "none matters to this loop"
    value = float("nan") if at[0].covariance is None else 0.0
    limits = {"Cramer-Rao bound": BOUND, "insensitivity": INSENSITIVITY, "correlation": CORRELATION}
    largest: dict[str, tuple[float, str]] = {name: (value, none) for name in limits}
    for a in at:
        if a.covariance is None:
            continue
        all_ = Derivatives.of(a.plant, a.plant.model.theta, a.p)
        moved = nu_gaps(
            a.estimate,
            a.plant.of_each(a.plant.model.theta + all_.without, a.p),  # type: ignore[arg-type]
            **a.sizes,
        )
        matter = np.flatnonzero(moved > SHARE_OF_MARGIN * a.margin)
        if not len(matter):
            continue
        names = [all_.names[i] for i in matter]
        sure = Certainty.of(all_.value[matter], all_.covariance(a.covariance)[matter][:, matter])
        strongest = np.argmax(np.abs(sure.correlation))  # of two equal entries the first is named
        pair = sorted(np.unravel_index(strongest, sure.correlation.shape))
        for name, values, which in (
            ("Cramer-Rao bound", sure.bound, names[int(np.argmax(sure.bound))]),
            ("insensitivity", sure.insensitivity, names[int(np.argmax(sure.insensitivity))]),
            ("correlation", np.abs(sure.correlation), f"{names[pair[0]]}, {names[pair[1]]}"),
        ):
            if values.max() >= largest[name][0]:
                largest[name] = float(values.max()), f"{which}, p = {text(a.p)}"
    return tuple(
        judged(name, value, limits[name], "not known", source=GUIDELINE, where=where)
        for name, (value, where) in largest.items()
    )


def responses(
    plant: FrozenPlant, records: Sequence[FlightRecord], window: float, band: tuple[float, float]
) -> Criterion:
    """J, the mean over the pairs of signals that say enough."""
    value, verdict, where = float("nan"), "not known", ""
    model = plant.model
    try:
        found = response_match(
            [plant.regression.prepared(record) for record in records],
            lambda p: model.at(*p),
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
            at = np.unravel_index(int(np.nanargmax(found.cost)), found.cost.shape)
            where = (
                f"mean of {int(np.isfinite(found.cost).sum())} pairs, worst"
                f" {plant.outputs[at[0]]} from {plant.inputs[at[1]]}"
                f" ({found.cost[at]:.0f})"
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


def residual_power(model: Model, records: Sequence[FlightRecord]) -> tuple[Criterion, ...]:
    """The residual power on the flights that a model is judged by, of what noise of the sensors,
    the structure and errors of the coefficients explain; no row where the method does not say how
    large they are.
    """
    if not isinstance(model, KinematicModel) or "sensor_noise" not in model.details:
        return ()
    powers = [validate(model, record).power for record in records]
    value = float(max(powers))
    where = f"flight {powers.index(value) + 1} of {len(powers)}"
    return (judged("residual power", value, EXPLAINED, "not known", source=HERE, where=where),)


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
        y = plant.regression.prepared(record).columns(plant.outputs) / size
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
