"""Is an identified model fit for control? Every criterion with its threshold, and one verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from identification.estimators.filter_error import noise_variance
from identification.judge.criterion import Criterion, Verdict, judged, together
from identification.judge.derivatives import Certainty, Derivatives
from identification.judge.draws import drawn
from identification.judge.frozen_plant import FrozenPlant, Model
from identification.judge.residuals import theil
from identification.judge.response_match import response_match
from identification.model.kinematic_model import KinematicModel
from identification.structure.regressors import as_records
from symheli.errors import ExcitationError, InputError
from symheli.lpv import LinearModel, LinearModels, nu_gaps, stability_margin
from symheli.lpv.stability_margin import Feedback, as_controller, closed_loop
from symheli.records import FlightRecord
from symheli.values.arrays import Array

SHARE_OF_MARGIN = 1 / 3
GAIN = 0.25
BOUND, INSENSITIVITY, CORRELATION = 0.2, 0.1, 0.9
COST = 50.0
INEQUALITY = 0.25

SET = 0.95
"""Share of the distribution of the estimate inside the ellipsoid whose boundary is drawn from."""

KNOWN = 1.1
"""The variance of sensor noise is told from a fifth of a spectrum: to ten percent."""

POINTS = 9
"""Values of one scheduling parameter at which a model is judged unless told otherwise."""

TISCHLER = "Tischler and Remple (2012)"
VINNICOMBE = "Vinnicombe (2001)"
GUIDELINE = "usual guideline"
HERE = "here"

Point = float | tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class FitForControl:
    """What `fit_for_control` found; `str()` is a table, a row a criterion.

    Parameters
    ----------
    criteria : tuple of Criterion
        The rows.
    points : tuple of float, or of tuples of float
        K values of the scheduling.
    margin : array (K,)
        b of the estimate in the loop there, 0 where it is unstable.
    gap : array (K,)
        Largest nu-gap from the estimate to a draw; NaN without a covariance.
    second_gap : array (K,)
        Largest nu-gap to another estimate; NaN without one.
    true_gap : array (K,) or None
        nu-gap from the estimate to the truth, where it was given.

    Examples
    --------
    >>> found = idn.fit_for_control(model, record, {("u", "y"): -0.1}, scales={"y": 1.0, "u": 1.0},
    ...     covariance=idn.uncertainty(model, record).joint, window=8.0, horizon=1.0)
    >>> found["nu-gap over margin"].verdict, found.gap.shape
    ('fit', (9,))
    """

    criteria: tuple[Criterion, ...]
    points: tuple[Point, ...]
    margin: Array
    gap: Array
    second_gap: Array
    true_gap: Array | None = None

    @property
    def verdict(self) -> Verdict:
        """The worst of the rows that decide: one "not fit", then one "not known"."""
        return together(row.verdict for row in self.criteria if row.decides)

    def __getitem__(self, name: str) -> Criterion:
        """The row of this name."""
        for row in self.criteria:
            if row.name == name:
                return row
        raise KeyError(name)

    def __str__(self) -> str:
        head = ("criterion", "value", "at most", "truth", "verdict", "where", "source")
        rows = [
            (
                row.name,
                _number(row.value),
                _number(row.threshold),
                "" if row.truth is None else _number(row.truth),
                row.verdict if row.decides else f"({row.verdict})",
                row.where,
                row.source,
            )
            for row in self.criteria
        ]
        widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
        lines = [
            "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
            for row in (head, *rows)
        ]
        return "\n".join([*lines, f"verdict: {self.verdict}"])


def fit_for_control(
    model: Model,
    record: FlightRecord | Iterable[FlightRecord],
    loop: Feedback | Callable[[Any], Feedback],
    *,
    scales: Mapping[str, float],
    points: Sequence[Point] | None = None,
    covariance: Array | None = None,
    second: Model | Sequence[Model] = (),
    truth: Mapping[Any, LinearModel] | None = None,
    horizon: float = 5.0,
    window: float = 8.0,
    band: tuple[float, float] = (0.3, 20.0),
    draws: int = 200,
    seed: int = 0,
) -> FitForControl:
    """Judge whether a loop may be designed on an identified model: by its frozen plants, by the
    record and by the certainty of its coefficients.

    "fit" where every criterion is met; "not fit" where one is violated by more than noise explains;
    "not known" where the data cannot say: too little coherence, or an uncertainty too large for
    this loop. Every frozen plant of the 95 % set is compared, in feedback, with the estimate:

    - closed loop stable: share of the draws, at the worst point;
    - nu-gap over margin: d/b, d the largest nu-gap from the estimate to a draw or a second one;
    - static gain in the loop, from the inputs to the outputs: what 95 % of the draws stay within,
      as a share of its largest singular value. That of the plant alone stands beside and decides
      nothing: where the plant nearly integrates no record of minutes knows it, and feedback does
      not ask for it;
    - Cramer-Rao bound, insensitivity, correlation: of the stability and control derivatives at each
      point (`identification.judge.derivatives`: coefficients of all lags together, per second), and
      only of those without which the frozen plant would move by more than a third of the margin;
    - J: the frozen responses, averaged along the record as its spectral estimate is, beside that
      estimate; the mean over the pairs that say enough;
    - TIC: of predictions over `horizon`, deviations from the mean, all outputs in their scales.

    Frozen plants say nothing of how fast the scheduling may move.

    Parameters
    ----------
    model : LPVARXModel or KinematicModel
        The estimate.
    record : FlightRecord or iterable of FlightRecord
        What it was fitted to, or better, another flight.
    loop : mapping, LinearModel or callable
        {(input, output): gain}; or a controller from outputs to inputs; or either as a function of
        the scheduling. As in `symheli.lpv.stability_margin`.
    scales : mapping of str to float
        A change of this size counts as 1 in gaps and margins; its signals, those of the model,
        are the plant.
    points : sequence, optional
        Values of the scheduling; default nine over the range of one parameter, or those of `truth`.
    covariance : array (ny, n, ny, n), optional
        Of all coefficients; default that of the model. Without it nothing is said to be fit: give
        `uncertainty(...).joint` only where noise in the regressors cannot have biased the fit.
    second : LPVARXModel, KinematicModel or sequence of them, optional
        Other estimates that ought to agree: fitted to a second flight, or with a richer basis. The
        covariance knows nothing of what the basis cannot hold; a fit with one degree more does.
    truth : mapping, optional
        {point: LinearModel}, continuous or at the sample period. Stands beside and decides nothing.
    horizon : float
        Of the predictions, s.
    window : float
        Of the spectral estimate, s.
    band : (float, float)
        rad/s, of the spectral estimate.
    draws : int
        From the boundary of the 95 % set.
    seed : int
        Of the draws.

    Returns
    -------
    FitForControl
        `.verdict`, the rows, gaps and margins by point.

    Raises
    ------
    InputError
        Scales that are not positive or name no output or no input; points that are missing.
    UnknownNameError
        A signal of the loop that is not in the plant.

    References
    ----------
    Tischler and Remple (2012), Aircraft and Rotorcraft System Identification, ch. 11 to 14;
    Vinnicombe (2001), Uncertainty and Feedback, ch. 3.

    Examples
    --------
    >>> known = idn.uncertainty(model, record)
    >>> found = idn.fit_for_control(model, record, {("u", "y"): -0.1}, scales={"y": 1.0, "u": 1.0},
    ...     points=[-0.5, 0.0, 0.5], covariance=known.joint, window=8.0, horizon=1.0, draws=50)
    >>> found["TIC"].verdict, bool(found["nu-gap over margin"].value < 0.1)
    ('fit', True)
    """
    records = as_records(record)
    for name, size in scales.items():
        if not (np.isfinite(size) and size > 0):
            raise InputError(f"scales: expected sizes greater than 0, got {name} = {size!r}")
    outputs = tuple(str(y) for y in model.outputs if y in scales)
    inputs = tuple(str(u) for u in model.inputs if u in scales)
    if not outputs or not inputs:
        raise InputError(
            "scales: name at least one output and one input of the model"
            f" ({', '.join(model.outputs)}; {', '.join(model.inputs)}), got {', '.join(scales)}"
        )
    chosen = _points(model, points, truth)
    joint = covariance
    if joint is None and isinstance(model, KinematicModel):
        joint = model.coefficient_covariance
    plant = FrozenPlant(model, outputs, inputs)
    thetas = None
    if joint is not None:
        thetas = drawn(model.theta, joint, plant.regression.free, draws, seed, boundary=SET)
    others = tuple(
        FrozenPlant(each, outputs, inputs)
        for each in (second if isinstance(second, Sequence) else (second,))
    )
    at = [
        _AtPoint(plant, p, loop(p) if callable(loop) else loop, scales, thetas, joint, others)
        for p in chosen
    ]
    true = [None if truth is None else _discrete(truth[p], model, outputs, inputs) for p in chosen]
    gap = np.array([a.drawn_gaps.max() for a in at])
    second_gap = np.array([a.second_gap for a in at])
    margin = np.array([a.margin for a in at])
    true_gap = None
    if truth is not None:
        true_gap = np.array([a.gaps_to([t])[0] for a, t in zip(at, true, strict=True)])  # type: ignore[list-item]
    criteria = (
        _stability(at, true),
        _feedback(at, gap, second_gap, margin, true_gap),
        _static_gain(at, true, in_loop=True),
        _static_gain(at, true, in_loop=False),
        *_certainty(at),
        _responses(plant, records, window, band),
        _predictions(plant, records, scales, horizon),
    )
    return FitForControl(
        criteria=criteria,
        points=chosen,
        margin=margin,
        gap=gap,
        second_gap=second_gap,
        true_gap=true_gap,
    )


def _points(
    model: Model, points: Sequence[Point] | None, truth: Mapping[Any, LinearModel] | None
) -> tuple[Point, ...]:
    basis = model.structure.basis
    if points is None and truth is not None:
        points = tuple(truth)
    elif points is None and basis.dimension == 1:
        points = tuple(float(p) for p in np.linspace(*basis.ranges[0], POINTS))
    if points is None or not len(points):
        raise InputError(
            "points: with several scheduling parameters name at least one value of each"
        )
    if truth is not None and any(p not in truth for p in points):
        raise InputError(
            f"truth: expected a model at every point {list(points)}, got {list(truth)}"
        )
    return tuple(points)


def _discrete(
    model: LinearModel, of: Model, outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> LinearModel:
    sampled = model if model.dt is not None else model.discretize(of.dt)
    return sampled.select(inputs=inputs, outputs=outputs)


@dataclass(frozen=True, eq=False)
class _AtPoint:
    """The estimate, its draws and its loop with the scheduling held at `p`."""

    plant: FrozenPlant
    p: Point
    feedback: Feedback
    scales: Mapping[str, float]
    thetas: Array | None
    joint: Array | None
    second: tuple[FrozenPlant, ...]

    @cached_property
    def sizes(self) -> dict[str, Any]:
        return {
            "input_scale": np.array([self.scales[u] for u in self.plant.inputs]),
            "output_scale": np.array([self.scales[y] for y in self.plant.outputs]),
        }

    @cached_property
    def estimate(self) -> LinearModel:
        return self.plant.at(self.p)  # type: ignore[arg-type]

    @cached_property
    def drawn(self) -> LinearModels | None:
        return None if self.thetas is None else self.plant.of_each(self.thetas, self.p)  # type: ignore[arg-type]

    @cached_property
    def margin(self) -> float:
        return stability_margin(self.estimate, self.feedback, **self.sizes)

    def gaps_to(self, others: Sequence[LinearModel]) -> Array:
        """nu-gaps (K,) from the estimate, signals by name."""
        each = [replace_names(other, self.estimate) for other in others]
        return nu_gaps(self.estimate, LinearModels.of(each), **self.sizes)

    @cached_property
    def drawn_gaps(self) -> Array:
        if self.drawn is None:
            return np.array([np.nan])
        return nu_gaps(self.estimate, self.drawn, **self.sizes)

    @cached_property
    def second_gap(self) -> float:
        if not self.second:
            return float("nan")
        return float(self.gaps_to([other.at(self.p) for other in self.second]).max())  # type: ignore[arg-type]

    @cached_property
    def lost(self) -> float:
        """Share of the draws around which the loop is unstable. Those nearer than the margin are
        stable by the theorem, the others are looked at.
        """
        if self.drawn is None:
            return float("nan")
        far = np.flatnonzero(self.drawn_gaps >= self.margin)
        return sum(not self.stable(self.drawn[int(k)]) for k in far) / len(self.drawn)

    def stable(self, plant: LinearModel) -> bool:
        """Whether the loop around another plant is."""
        A = self._closed(plant)[0]
        return bool(np.abs(np.linalg.eigvals(A)).max(initial=0.0) < 1)

    def gain_errors(self, others: Iterable[LinearModel], in_loop: bool) -> Array:
        """Largest singular values (K,) of static gains less that of the estimate, as shares of the
        latter's.
        """
        per = 1 / self.sizes["output_scale"][:, None] * self.sizes["input_scale"]
        mine = self._static(self.estimate, in_loop) * per
        theirs = np.array([self._static(m, in_loop) * per for m in others])
        return np.linalg.norm(theirs - mine, 2, (1, 2)) / np.linalg.norm(mine, 2)

    def _static(self, plant: LinearModel, in_loop: bool) -> Array:
        """Outputs per input at frequency zero, open or with the input added to the feedback."""
        A, B, C, D = plant.A, plant.B, plant.C, plant.D
        if in_loop:
            ny = len(plant.outputs)
            A, B, C, D = self._closed(plant)
            B, C, D = B[:, ny:], C[:ny], D[:ny, ny:]
        return C @ np.linalg.solve(np.eye(len(A)) - A, B) + D

    def _closed(self, plant: LinearModel) -> tuple[Array, Array, Array, Array]:
        return closed_loop(plant, as_controller(self.feedback, plant))


def replace_names(model: LinearModel, like: LinearModel) -> LinearModel:
    """Inputs and outputs in the order of another model."""
    return model.select(inputs=like.inputs, outputs=like.outputs)


def _worst(values: Array, at: Sequence[_AtPoint]) -> tuple[float, str]:
    """The largest value over the points and where it stands; NaN where one is."""
    k = int(np.argmax(values))  # the first NaN, if there is one
    return float(values[k]), f"p = {_text(at[k].p)}"


NO_COVARIANCE = "no covariance"


def _stability(at: Sequence[_AtPoint], true: Sequence[LinearModel | None]) -> Criterion:
    alone = [a.margin > 0 for a in at]
    lost, where = _worst(np.array([a.lost for a in at]), at)
    verdict: Verdict = judged(lost, 0.0, "not known")
    if not all(alone):
        verdict, where = "not fit", f"p = {_text(at[alone.index(False)].p)}: the estimate itself"
    known = [(a, t) for a, t in zip(at, true, strict=True) if t is not None]
    return Criterion(
        name="unstable loops",
        value=max(lost, float(not all(alone))) if not np.isnan(lost) or all(alone) else 1.0,
        threshold=0.0,
        verdict=verdict,
        source=HERE,
        where=NO_COVARIANCE if np.isnan(lost) and all(alone) else where,
        truth=float(np.mean([not a.stable(t) for a, t in known])) if known else None,
    )


def _feedback(
    at: Sequence[_AtPoint], gap: Array, second_gap: Array, margin: Array, true_gap: Array | None
) -> Criterion:
    with np.errstate(divide="ignore"):
        value, where = _worst(np.fmax(gap, second_gap) / margin, at)
        truth = None if true_gap is None else float((true_gap / margin).max())
        apart = np.any(second_gap / margin > SHARE_OF_MARGIN)
    verdict = judged(value, SHARE_OF_MARGIN, "not known")
    if np.isnan(gap).any():
        verdict, where = "not known", NO_COVARIANCE
    elif apart:
        where = f"{where}; another estimate is as far"
    return Criterion(
        name="nu-gap over margin",
        value=value,
        threshold=SHARE_OF_MARGIN,
        verdict=verdict,
        source=VINNICOMBE,
        where=where,
        truth=truth,
    )


def _static_gain(
    at: Sequence[_AtPoint], true: Sequence[LinearModel | None], in_loop: bool
) -> Criterion:
    errors = [
        float("nan")
        if a.drawn is None
        else float(np.quantile(a.gain_errors(a.drawn, in_loop), SET))
        for a in at
    ]
    value, where = _worst(np.array(errors), at)
    known = [a.gain_errors([t], in_loop)[0] for a, t in zip(at, true, strict=True) if t is not None]
    return Criterion(
        name="static gain in the loop" if in_loop else "static gain, open",
        value=value,
        threshold=GAIN,
        verdict=judged(value, GAIN, "not known"),
        source=HERE,
        where=NO_COVARIANCE if np.isnan(value) else where,
        truth=float(max(known)) if known else None,
        decides=in_loop,
    )


def _certainty(at: Sequence[_AtPoint]) -> tuple[Criterion, ...]:
    """Three rows over the derivatives that matter to the loop."""
    worst = {
        "Cramer-Rao bound": (float("nan"), BOUND, NO_COVARIANCE),
        "insensitivity": (float("nan"), INSENSITIVITY, NO_COVARIANCE),
        "correlation": (float("nan"), CORRELATION, NO_COVARIANCE),
    }
    for a in at:
        if a.joint is None:
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
        sure = Certainty.of(all_.value[matter], all_.covariance(a.joint)[np.ix_(matter, matter)])
        pair = np.unravel_index(np.argmax(np.abs(sure.correlation)), sure.correlation.shape)
        for name, values, which in (
            ("Cramer-Rao bound", sure.bound, names[int(np.argmax(sure.bound))]),
            ("insensitivity", sure.insensitivity, names[int(np.argmax(sure.insensitivity))]),
            ("correlation", np.abs(sure.correlation), f"{names[pair[0]]}, {names[pair[1]]}"),
        ):
            before, threshold, _ = worst[name]
            if not values.max() <= before:
                worst[name] = float(values.max()), threshold, f"{which}, p = {_text(a.p)}"
    return tuple(
        Criterion(
            name=name,
            value=value,
            threshold=threshold,
            verdict=judged(value, threshold, "not known"),
            source=GUIDELINE,
            where=where,
        )
        for name, (value, threshold, where) in worst.items()
    )


def _responses(
    plant: FrozenPlant, records: Sequence[FlightRecord], window: float, band: tuple[float, float]
) -> Criterion:
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


def _predictions(
    plant: FrozenPlant, records: Sequence[FlightRecord], scales: Mapping[str, float], horizon: float
) -> Criterion:
    """Pooled over outputs and records; noise of the sensors excuses what it explains."""
    model = plant.model
    steps = max(round(horizon / model.dt), 1)
    columns = [list(map(str, model.outputs)).index(y) for y in plant.outputs]
    size = np.array([scales[y] for y in plant.outputs])
    measured, guessed, noise = [], [], 0.0
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
    value, verdict, where = float("nan"), "not known", "no unbroken stretch so long"
    if measured:
        a, b = np.concatenate(measured), np.concatenate(guessed)
        where = ""
        if not np.isfinite(b).all():
            value, verdict, where = 1.0, "not fit", "predictions diverge"
        else:
            value = theil(a, b).coefficient
            both = np.sqrt(np.mean(a**2)) + np.sqrt(np.mean(b**2))
            rest = np.sqrt(max(np.mean((a - b) ** 2) - KNOWN * noise / len(a), 0.0)) / both
            verdict = judged(value, INEQUALITY, "not fit" if rest > INEQUALITY else "not known")
            if verdict == "not known":
                where = "noise explains it"
    return Criterion(
        name="TIC",
        value=value,
        threshold=INEQUALITY,
        verdict=verdict,  # type: ignore[arg-type]
        source=TISCHLER,
        where=where or f"{horizon:g} s",
    )


def _text(p: Point) -> str:
    return f"{p:.4g}" if np.isscalar(p) else ", ".join(f"{v:.4g}" for v in p)  # type: ignore[union-attr]


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3g}"
