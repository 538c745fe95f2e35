"""Is an identified model fit for control? Every criterion with its threshold, and one verdict; the
model to design on, if it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification.design.criterion import Criterion, Verdict, concluded, missed, verdict_of
from identification.judge.coefficient_covariance import drawn
from identification.judge.criteria import (
    SET,
    SHARE_OF_MARGIN,
    certainty,
    feedback,
    predictions,
    residual_power,
    responses,
    stability,
    static_gain,
)
from identification.judge.frozen_plant import AtPoint, FrozenPlant, Model, Point
from identification.judge.response_regions import StructureBias, with_neighbours
from identification.model.kinematic_model import KinematicModel
from identification.model.state_space_model import StateSpaceModel
from identification.structure.regressors import as_records
from symheli import LinearModel, LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError, NotFitError
from symheli.lpv.stability_margin import Feedback
from symheli.records import FlightRecord
from symheli.values.arrays import Array, frozen
from symheli.values.summary import summarized

HORIZON, WINDOW = 5.0, 8.0
"""Seconds that a model is judged over, and windows of its spectra, unless told otherwise."""

CORRELATION = 0.5
"""Correlation with which the nu-gaps by noise and by the structure add: 1 is the triangle
inequality, 0 independent errors.
"""

POINTS = 9
"""Values of one scheduling parameter at which a model is judged unless told otherwise."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FitForControl:
    """The result of `fit_for_control`; `str()` is a table with one row per criterion.

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
    structure_gap : array (K,) or None
        nu-gap that the structure leaves in a simulator, where a bias was given.
    true_gap : array (K,) or None
        nu-gap from the estimate to the truth, where it was given.

    Examples
    --------
    >>> found = idn.fit_for_control(model, record, {("u", "y"): -0.1}, scales={"y": 1.0, "u": 1.0},
    ...     covariance=idn.uncertainty(model, record).covariance, window=8.0, horizon=1.0)
    >>> found["nu-gap over margin"].verdict, found.bound.shape
    ('fit', (9,))
    """

    criteria: tuple[Criterion, ...]
    points: tuple[Point, ...]
    margin: Array
    gap: Array
    second_gap: Array
    structure_gap: Array | None = None
    true_gap: Array | None = None

    __repr__ = summarized

    @property
    def bound(self) -> Array:
        """Upper bound (K,) of the nu-gap to the truth, in [0, 1]: see `fit_for_control`."""
        within = np.fmax(self.gap, self.second_gap)
        if self.structure_gap is None:
            return within
        return added(within, self.structure_gap)

    @property
    def verdict(self) -> Verdict:
        """The worst of the rows that decide: one "not fit", then one "not known"."""
        return verdict_of(self.criteria)

    def __getitem__(self, name: str) -> Criterion:
        """The row of this name."""
        for row in self.criteria:
            if row.name == name:
                return row
        raise KeyError(name)

    def __str__(self) -> str:
        return concluded(self.criteria)


def added(noise: Array, structure: Array, correlation: float = CORRELATION) -> Array:
    """Return the nu-gaps (K,) by noise and by the structure together, at most 1; of the structure
    the root mean square over neighbouring points counts.
    """
    s = np.sqrt(with_neighbours(structure**2, 0))
    return np.minimum(np.sqrt(noise**2 + s**2 + 2.0 * correlation * noise * s), 1.0)


def fit_for_control(
    model: Model,
    record: FlightRecord | Iterable[FlightRecord],
    loop: Feedback | Callable[[Any], Feedback],
    *,
    scales: Mapping[str, float],
    points: Sequence[Point] | None = None,
    covariance: Array | None = None,
    second: Model | Sequence[Model] = (),
    bias: StructureBias | None = None,
    truth: Mapping[Any, LinearModel] | None = None,
    horizon: float | None = None,
    window: float | None = None,
    band: tuple[float, float] = (0.3, 20.0),
    draws: int = 200,
    seed: int = 0,
) -> FitForControl:
    """Judge whether a loop may be designed on an identified model: by its frozen plants, by the
    record and by the uncertainty of its coefficients.

    "fit" where every criterion is met; "not fit" where one is violated by more than noise explains;
    "not known" where the data cannot say: too little coherence, or an uncertainty too large for
    this loop. Every frozen plant of the 95 % set is compared, in feedback, with the estimate:

    - closed loop stable: share of the draws, at the worst point;
    - nu-gap over margin: d/b, d the largest nu-gap from the estimate to a draw or a second one,
      at most a third; with `bias` an upper bound of the nu-gap to the truth, at most 1;
    - static gain in the loop, from the inputs to the outputs: what 95 % of the draws stay within,
      as a share of its largest singular value. That of the plant alone stands beside and decides
      nothing: where the plant nearly integrates no record of minutes knows it, and feedback does
      not ask for it;
    - Cramer-Rao bound, insensitivity, correlation: of the stability and control derivatives at each
      point (`identification.judge.derivatives`: coefficients of all lags together, per second), and
      only of those without which the frozen plant would move by more than a third of the margin;
    - J: the frozen responses, averaged along the record as its spectral estimate is, beside that
      estimate; the mean over the pairs that say enough. Frequencies at which noise of the sensors,
      fed back to the inputs, has moved the estimate and not the plant are left out;
    - TIC: of predictions over `horizon`, deviations from the mean, all outputs in their scales;
      where it exceeds the threshold, without what noise of the sensors makes of the measurements
      and of the starts of the predictions.

    The upper bound: between the estimate and the truth lies what the structure would make of this
    vehicle without noise. From the estimate to that it is the gap d of the 95 % set; from that to
    the truth it is what the simulator shows of the structure, s, in these `scales`, its unstable
    poles counted as the nu-gap counts them, the root mean square of neighbouring points. They add
    as errors of correlation one half, sqrt(d^2 + d s + s^2): by the triangle inequality alone, d +
    s, they would have to point the same way everywhere. That the size of s carries over from one
    vehicle to the other is assumed. With `bias` there are no rows of static gain and derivatives:
    what they are about is in the bound. For a model by `FilterError` there is one of the residual
    power instead, as a share of what noise of the sensors explains, at most 1: what the simulator
    does not show, such as a delay that nobody mentioned, is in it.

    Frozen plants say nothing of how fast the scheduling may move.

    Parameters
    ----------
    model : LPVARXModel, KinematicModel or StateSpaceModel
        The estimate. Of states there are no rows of derivatives: their entries are no derivatives,
        and the nu-gap counts them in any coordinates.
    record : FlightRecord or iterable of FlightRecord
        What it was fitted to, or better, another flight.
    loop : mapping, LinearModel or callable
        {(input, output): gain}; or a controller from outputs to inputs; or either as a function of
        the scheduling. As in `symheli.lpv.stability_margin`.
    scales : mapping of str to float
        A change of this size counts as 1 in gaps and margins; its signals, those of the model,
        are the plant.
    points : sequence, optional
        Values of the scheduling; default those of `truth` or `bias`, or nine over the range of one
        parameter.
    covariance : array (ny, n, ny, n), optional
        Of all coefficients together; default that of the model, but not that of least squares,
        which says nothing of the bias by noise in the regressors. Without it nothing is said to be
        fit: give `uncertainty(...).covariance` only where there is no such noise.
    second : model or sequence of them, optional
        Other estimates that ought to agree: fitted to a second flight, or with a richer basis. The
        covariance knows nothing of what the basis cannot hold; a fit with one degree more does.
    bias : StructureBias, optional
        From `structure_bias`, with exact models of the plant in the simulator at every point.
    truth : mapping, optional
        {point: LinearModel}, continuous or at the sample period. Stands beside and decides nothing.
    horizon : float, optional
        Of the predictions, s; default 5 s, or what a shorter record has.
    window : float, optional
        Of the spectral estimate, s; default 8 s, or what a shorter record has.
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
        Scales that are not positive or name no output or no input; points that are missing, of the
        bias and the truth too; a horizon or a window that is not positive or longer than every
        record; a covariance of another shape.
    UnknownNameError
        A signal of the loop that is not in the plant.

    See Also
    --------
    identification.judge.validate : the verdict on flights not identified
    identification.uncertainty : covariance that coloured residuals allow
    identification.compare_frozen : poles and nu-gaps beside exact models

    References
    ----------
    Tischler and Remple (2012), Aircraft and Rotorcraft System Identification, ch. 11 to 14;
    Vinnicombe (2001), Uncertainty and Feedback, ch. 3.

    Examples
    --------
    >>> known = idn.uncertainty(model, record)
    >>> found = idn.fit_for_control(model, record, {("u", "y"): -0.1}, scales={"y": 1.0, "u": 1.0},
    ...     points=[-0.5, 0.0, 0.5], covariance=known.covariance, window=8.0, horizon=1.0, draws=50)
    >>> found["TIC"].verdict, bool(found["nu-gap over margin"].value < 0.1)
    ('fit', True)
    """
    records = as_records(record)
    for name, size in scales.items():
        if not (np.isfinite(size) and size > 0):
            raise InputError(f"scales: expected sizes greater than 0, got {name} = {size!r}")
    longest = (max(map(len, records)) - 1) * model.dt
    horizon = min(HORIZON, longest) if horizon is None else horizon
    window = min(WINDOW, longest) if window is None else window
    for name, seconds in (("horizon", horizon), ("window", window)):
        if not 0 < seconds <= longest:
            raise InputError(
                f"{name}: expected seconds greater than 0, up to {longest:g} of the longest"
                f" record, got {seconds}"
            )
    outputs = tuple(str(y) for y in model.outputs if y in scales)
    inputs = tuple(str(u) for u in model.inputs if u in scales)
    if not outputs or not inputs:
        raise InputError(
            "scales: name at least one output and one input of the model"
            f" ({', '.join(model.outputs)}; {', '.join(model.inputs)}), got {', '.join(scales)}"
        )
    known = {"truth": truth, "bias": None if bias is None else bias.exact}
    chosen = _points(model, points, {k: v for k, v in known.items() if v is not None})
    if covariance is None and not model.least_squares:
        covariance = model.covariance
    if covariance is not None:
        covariance = frozen(covariance, "covariance", 2 * model.theta.shape[::-1])
    plant = FrozenPlant(model, outputs, inputs)
    thetas = None
    if covariance is not None:
        thetas = drawn(model.theta, covariance, plant.free, draws, seed, boundary=SET)
    others = tuple(
        FrozenPlant(each, outputs, inputs)
        for each in (second if isinstance(second, Sequence) else (second,))
    )
    at = [AtPoint(plant, p, _loop_at(loop, p), scales, thetas, covariance, others) for p in chosen]
    true = [None if truth is None else _discrete(truth[p], plant) for p in chosen]
    gap = np.array([a.drawn_gaps.max() for a in at])
    second_gap = np.array([a.second_gap for a in at])
    margin = np.array([a.margin for a in at])
    true_gap = None
    if truth is not None:
        true_gap = np.array([a.gaps_to([t])[0] for a, t in zip(at, true, strict=True)])  # type: ignore[list-item]
    found = FitForControl(
        criteria=(),
        points=chosen,
        margin=margin,
        gap=gap,
        second_gap=second_gap,
        structure_gap=None if bias is None else _structure_gap(bias, at),
        true_gap=true_gap,
    )
    whole = bias is not None
    criteria = (
        stability(at, true),
        feedback(at, found.bound, second_gap, true_gap, 1.0 if whole else SHARE_OF_MARGIN),
        *(() if whole else (static_gain(at, true, in_loop) for in_loop in (True, False))),
        *(() if whole or isinstance(model, StateSpaceModel) else certainty(at)),
        *(residual_power(model, records) if whole else ()),
        responses(plant, records, window, band),
        predictions(plant, records, scales, horizon),
    )
    return replace(found, criteria=criteria)


def _structure_gap(bias: StructureBias, at: Sequence[AtPoint]) -> Array:
    """nu-gaps (K,) in the simulator."""
    plant = replace(at[0].plant, model=bias.model)
    return np.array(
        [replace(a, plant=plant).gaps_to([_discrete(bias.exact[a.p], plant)])[0] for a in at]
    )


def _points(
    model: Model,
    points: Sequence[Point] | None,
    exact: Mapping[str, Mapping[Any, LinearModel]],
) -> tuple[Point, ...]:
    basis = model.structure.basis
    if points is None and exact:
        points = tuple(next(iter(exact.values())))
    elif points is None and basis.dimension == 1:
        points = tuple(float(p) for p in np.linspace(*basis.ranges[0], POINTS))
    if points is None or not len(points):
        raise InputError(
            "points: with several scheduling parameters name at least one value of each"
        )
    for name, models in exact.items():
        if any(p not in models for p in points):
            raise InputError(
                f"{name}: expected a model at every point {list(points)}, got {list(models)}"
            )
    return tuple(points)


def _loop_at(loop: Feedback | Callable[[Any], Feedback], p: Any) -> Feedback:
    """The loop at p: the same everywhere, or a function of p."""
    # a LinearModel can be called too, for its transfer matrix
    return loop if isinstance(loop, LinearModel | Mapping) or not callable(loop) else loop(p)


def _discrete(model: LinearModel, plant: FrozenPlant) -> LinearModel:
    sampled = model if model.dt is not None else model.discretize(plant.model.dt)
    return sampled.select(inputs=plant.inputs, outputs=plant.outputs)


def design_model(
    model: KinematicModel,
    judged: FitForControl,
    *,
    probability: float | None = None,
    force: bool = False,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    held: Mapping[str, float] | None = None,
    degree: int | None = None,
) -> LPVStateSpace | UncertainStateSpace:
    """Return the state space of a model that was judged fit for control.

    Parameters
    ----------
    model : KinematicModel
        The estimate.
    judged : FitForControl
        What `fit_for_control` found of it.
    probability : float, optional
        Of the set of models; None: the estimate alone.
    force : bool
        Hand it out whatever was found: to see a design fail.
    outputs, inputs, held, degree
        As of `KinematicModel.to_state_space`.

    Returns
    -------
    LPVStateSpace or UncertainStateSpace
        For `synthesis.Plant`; sampled, as the model is.

    Raises
    ------
    NotFitError
        The verdict is not "fit"; `reasons` are the criteria that decide it.
    InputError
        Something else was judged.

    Examples
    --------
    >>> from symheli.errors import NotFitError
    >>> poor = idn.judge.fit_for_control.FitForControl(
    ...     criteria=(idn.judge.Criterion(name="nu-gap over margin", value=1.4, threshold=1.0,
    ...                             verdict="not fit", source="here", where="hover"),),
    ...     points=(0.0,), margin=np.array([0.1]), gap=np.array([0.14]),
    ...     second_gap=np.array([np.nan]))
    >>> try:
    ...     idn.design.design_model(None, poor)
    ... except NotFitError as error:
    ...     print(error.reasons[0])
    nu-gap over margin is 1.4, at most 1 (hover): violated
    """
    if not isinstance(judged, FitForControl):
        raise InputError(
            f"judged: expected what fit_for_control found, got {type(judged).__name__}"
        )
    if judged.verdict != "fit" and not force:
        known = "not known to be" if judged.verdict == "not known" else "not"
        raise NotFitError(f"the model is {known} fit for control", missed(judged.criteria))
    if probability is None:
        return model.to_state_space(outputs, inputs, held=held, degree=degree)
    return model.uncertain(probability, outputs, inputs, held=held, degree=degree)
