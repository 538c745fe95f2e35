"""An LPV-ARX model beside the LTI one of the same order, in sample and held out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from identification import LPVARX, LPVARXModel, Method, fit, fit_percent
from identification.design.leakage import MADE_OF_OUTPUTS, share_from_outputs
from symheli.errors import ExcitationError, InputError
from symheli.records import FlightRecord

PAYS = 1.0
"""Points of held-out fit by which one model must beat another to be called better; what is printed
(one digit) is what is compared.
"""

STILL = 1e-6
"""A scheduling signal that moves by less than this part of its size stays where it is."""

LEAST = -100.0
"""A fit below this counts as this, where fits are averaged: what is useless can be no worse."""

HORIZONS = ("one step", "1 s", "free run")

Trim = Literal["auto", "moving", "still"]
"""Whether the models have d(p) times the change of p (`offset_rate`): "auto" tries both."""


@dataclass(frozen=True)
class Scored:
    """A model and its fit in percent: {horizon: {output: percent}} on the samples it was fitted to
    and on those held out.
    """

    label: str
    model: LPVARXModel
    in_sample: dict[str, dict[str, float]]
    held_out: dict[str, dict[str, float]] | None


@dataclass(frozen=True)
class Comparison:
    """The models fitted to one record: the one that is judged, the LTI one it is judged against
    (where there are two), then rivals.

    `hold_p`: one step and 1 s hold p from the start of each prediction, because it is measured.
    `leak`: share of what is new in p that the outputs of the same instant explain; beyond a half
    free runs, which follow p, are told what they predict. `trim_note`: why the trim moves in the
    model that is judged, or not.
    """

    models: tuple[Scored, ...]
    training: FlightRecord
    test: FlightRecord | None
    hold_p: bool = False
    leak: float = 0.0
    trim_note: str = ""

    @property
    def scheduled(self) -> LPVARXModel:
        """The first model: the scheduled one where there are two."""
        return next(iter(self.models)).model

    @property
    def judged(self) -> tuple[Scored, ...]:
        """The first model and the LTI one beside it."""
        return self.models[: 1 + (self.scheduled.structure.basis.size > 1)]

    @property
    def low_high(self) -> tuple[float, float]:
        """Range of the scheduling the basis covers."""
        return self.scheduled.structure.basis.ranges[0]

    @property
    def told(self) -> bool:
        """Whether a free run is told by p what it has to predict."""
        return self.hold_p and self.leak > MADE_OF_OUTPUTS

    def verdict(self) -> list[str]:
        """Where scheduling pays and where it does not, in sentences."""
        if len(self.judged) < 2:
            return []
        if self.test is None:
            return ["nothing was held out: these numbers cannot tell whether scheduling pays"]
        sentences = [self._sentence(str(y)) for y in self.scheduled.outputs]
        rivals = self.models[len(self.judged) :]
        if rivals:
            other = replace(self, models=rivals)
            turned = [
                str(y) for y in self.scheduled.outputs if self.pays(str(y)) != other.pays(str(y))
            ]
            sentences += [
                f"{rivals[0].label} beside {rivals[1].label} would say otherwise:"
                f" {other._sentence(y)}"
                for y in turned
            ]
        return sentences

    def pays(self, output: str) -> bool:
        """Whether scheduling is better 1 s ahead or in free run on held-out data, and worse in
        neither; see `PAYS`.
        """
        found = self._differences(output).values()
        return "better" in found and "worse" not in found

    def _differences(self, output: str) -> dict[str, str]:
        """{horizon: better, worse or no different}; free runs that are told their answer, or of no
        use either way, are no different.
        """
        lpv, lti = (m.held_out or {} for m in self.judged)
        out = {h: difference(lpv[h][output], lti[h][output]) for h in HORIZONS[1:]}
        return {**out, "free run": "not counted"} if self.told else out

    def _sentence(self, output: str) -> str:
        lpv, lti = (m.held_out or {} for m in self.judged)
        found = self._differences(output)
        verdict = "pays" if self.pays(output) else "does NOT pay"
        if {"better", "worse"} <= set(found.values()):
            verdict = "does NOT pay throughout"
        numbers = (
            f"{percent(lpv[h][output])} against {percent(lti[h][output])} % {where} ({found[h]})"
            for h, where in zip(HORIZONS[1:], ("1 s ahead", "in free run"), strict=True)
        )
        return f"{output}: scheduling {verdict} on held-out data: {', '.join(numbers)}"


def difference(one: float, other: float) -> str:
    """What a fit of `one` percent is beside one of `other`, as printed: "better", "worse", "no
    different", or of no use either way.
    """
    if np.isnan(one) or np.isnan(other):
        return "no data to compare"
    if max(one, other) <= 0:
        return "neither better than the mean of the record"
    points = round(one, 1) - round(other, 1)  # one that diverges is infinitely far off
    return (
        "better"
        if round(points, 1) > PAYS
        else "worse"
        if round(points, 1) < -PAYS
        else "no different"
    )


def compare(
    structure: LPVARX,
    training: FlightRecord,
    test: FlightRecord | None,
    *,
    trim: Trim = "still",
    hold_p: bool = False,
    method: Method | str = "ls",
) -> Comparison:
    """Fit `structure`, and the same with constant coefficients where it has moving ones, by
    `method`.

    `trim` "auto" fits both once more with `offset_rate` where p moves and is not made of the
    outputs, and judges those that predict 1 s better in sample (as well: those that run free
    better). `hold_p` as in `LPVARXModel.predict`.
    """

    def pair(moving: bool) -> list[Scored]:
        arx = replace(structure, offset_rate=moving)
        suffix = ", moving trim" if moving else ""
        structures = (
            {f"LPV, degree {arx.basis.size - 1}{suffix}": arx} if arx.basis.size > 1 else {}
        )
        structures[f"LTI{suffix}"] = arx.lti()
        return [
            _scored(label, s, training, test, hold_p, method) for label, s in structures.items()
        ]

    leak = float(np.max(share_from_outputs(structure, training)))
    first, note = pair(trim == "moving"), ""
    if trim == "auto" and structure.basis.size > 1:
        if leak > MADE_OF_OUTPUTS:
            told = (
                f"{100 * leak:.0f} % of what is new in {structure.scheduling} is in the outputs of"
                " the same instant"
            )
            note = f"offset_rate is not tried: {told}"
        else:
            try:
                second = pair(True)
            except (ExcitationError, InputError) as error:
                note = f"offset_rate is not tried: {error}"
            else:
                without, with_it = (_mean_fits(models[0].in_sample) for models in (first, second))
                first, second = (second, first) if with_it > without else (first, second)
                numbers = (
                    f"{one:.1f} % 1 s ahead and {free:.1f} % in free run {how}"
                    for (one, free), how in ((with_it, "with it"), (without, "without"))
                )
                note = (
                    f"offset_rate, the moving trim, in sample: {', '.join(numbers)} (means of the"
                    f" outputs, none below {LEAST:g}); judged is the model"
                    f" {'with' if with_it > without else 'without'}"
                )
                first = [*first, *second]
    return Comparison(tuple(first), training, test, hold_p, leak, note)


def _mean_fits(scores: dict[str, dict[str, float]]) -> tuple[float, float]:
    """Means over the outputs of the fits 1 s ahead and in free run, as printed; the first decides,
    the second where it is the same.
    """
    one, free = (
        round(float(np.mean([max(v, LEAST) for v in scores[h].values()])), 1) for h in HORIZONS[1:]
    )
    return one, free


def scheduling_range(values: np.ndarray, degree: int) -> tuple[float, float]:
    """The range of the record the basis is declared on. Raises `InputError` where it does not move
    and `degree` is not 0.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        raise InputError("the scheduling signal has no sample that is a number")
    low, high = float(known.min()), float(known.max())
    if high - low > STILL * max(abs(low), abs(high)):
        return low, high
    if degree > 0:
        raise InputError(
            f"the scheduling signal stays at {low:g}: a model scheduled by it cannot be told;"
            " --degree 0 fits an LTI model"
        )
    return low - 0.5, high + 0.5


def steps(dt: float) -> dict[str, int | None]:
    """Each of `HORIZONS` in samples of `dt` (s); None is a free run."""
    return dict(zip(HORIZONS, (1, max(round(1.0 / dt), 1), None), strict=True))


def ahead(
    model: LPVARXModel, record: FlightRecord, horizon: int | None, hold_p: bool
) -> np.ndarray:
    """What is scored and drawn: the prediction `horizon` samples ahead, or the free run."""
    return (
        model.simulate(record) if horizon is None else model.predict(record, horizon, hold_p=hold_p)
    )


def percent(value: float) -> str:
    """A fit in words where it is no number."""
    return (
        "diverges"
        if np.isneginf(value)
        else "no data"
        if np.isnan(value)
        else f"{value:.1f}"
        if value > -1e4
        else f"{value:.1e}"
    )


def coefficients(model: LPVARXModel) -> dict[str, Any]:
    """Coefficients of 1, p, p^2, ... by lag, as `identification.Coefficients.monomial` arranges
    them.
    """
    values = model.coefficients.monomial()
    return {
        **values._asdict(),
        "output_lags": list(model.structure.output_lags),
        "input_lags": list(model.structure.input_lags),
    }


def _scored(
    label: str,
    arx: LPVARX,
    training: FlightRecord,
    test: FlightRecord | None,
    hold_p: bool,
    method: Method | str,
) -> Scored:
    model = fit(arx, training, method)
    return Scored(
        label,
        model,
        _scores(model, training, hold_p),
        None if test is None else _scores(model, test, hold_p),
    )


def _scores(model: LPVARXModel, record: FlightRecord, hold_p: bool) -> dict[str, dict[str, float]]:
    return {
        horizon: dict(zip(model.structure.outputs, _fit(model, record, step, hold_p), strict=True))
        for horizon, step in steps(model.dt).items()
    }


def _fit(
    model: LPVARXModel, record: FlightRecord, horizon: int | None, hold_p: bool
) -> list[float]:
    return fit_percent(
        record.columns(model.outputs), ahead(model, record, horizon, hold_p)
    ).tolist()
