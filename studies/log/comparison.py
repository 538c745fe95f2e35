"""An LPV-ARX model beside the LTI one of the same order, in sample and held out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identification import LPVARX, LPVARXModel, fit
from symheli.errors import InputError
from symheli.lpv import FlightRecord

PAYS = 1.0
"""Scheduling pays where it adds more than this many points of held-out fit 1 s ahead, and loses no more in free run."""

STILL = 1e-6
"""A scheduling signal that moves by less than this part of its size stays where it is."""

HORIZONS = ("one step", "1 s", "free run")


@dataclass(frozen=True)
class Scored:
    """A model and its fit in percent: {horizon: {output: percent}} on the samples it was fitted to and on those held out."""

    label: str
    model: LPVARXModel
    in_sample: dict[str, dict[str, float]]
    held_out: dict[str, dict[str, float]] | None


@dataclass(frozen=True)
class Comparison:
    """The models fitted to one record, the scheduled one first where there are two."""

    models: tuple[Scored, ...]
    training: FlightRecord
    test: FlightRecord | None

    @property
    def scheduled(self) -> LPVARXModel:
        """The first model: the scheduled one where there are two."""
        return next(iter(self.models)).model

    @property
    def low_high(self) -> tuple[float, float]:
        """Range of the scheduling the basis covers."""
        return self.scheduled.structure.basis.ranges[0]

    def verdict(self) -> list[str]:
        """Where scheduling pays and where it does not, in sentences."""
        if len(self.models) < 2:
            return []
        if self.test is None:
            return ["nothing was held out: these numbers cannot tell whether scheduling pays"]
        return [self._sentence(str(y)) for y in self.scheduled.outputs]

    def pays(self, output: str) -> bool:
        """Whether scheduling improves the held-out fit of `output`; see `PAYS`."""
        lpv, lti = (m.held_out or {} for m in self.models)
        second, free = (lpv[h][output] - lti[h][output] for h in HORIZONS[1:])
        lost = np.isfinite(lti["free run"][output]) and not free >= -PAYS
        return bool(second > PAYS and not lost)

    def _sentence(self, output: str) -> str:
        lpv, lti = ([(m.held_out or {})[h][output] for h in HORIZONS[1:]] for m in self.models)
        numbers = f"{percent(lpv[0])} against {percent(lti[0])} % 1 s ahead, {percent(lpv[1])} against {percent(lti[1])} % in free run"
        useless = "; neither predicts better than the mean of the record in free run" if not max(lpv[1], lti[1]) > 0 else ""
        return f"{output}: scheduling {'pays' if self.pays(output) else 'does NOT pay'} on held-out data, {numbers}{useless}"


def compare(structure: LPVARX, training: FlightRecord, test: FlightRecord | None) -> Comparison:
    """Fit `structure`, and the same with constant coefficients where it has moving ones, by least squares."""
    basis = structure.basis
    structures = {f"LPV, degree {basis.size - 1}": structure} if basis.size > 1 else {}
    structures["LTI"] = structure.lti()
    return Comparison(tuple(_scored(label, arx, training, test) for label, arx in structures.items()), training, test)


def scheduling_range(values: np.ndarray, degree: int) -> tuple[float, float]:
    """The range of the record the basis is declared on. Raises `InputError` where it does not move and `degree` is not 0."""
    known = values[np.isfinite(values)]
    if not len(known):
        raise InputError("the scheduling signal has no sample that is a number")
    low, high = float(known.min()), float(known.max())
    if high - low > STILL * max(abs(low), abs(high)):
        return low, high
    if degree > 0:
        raise InputError(f"the scheduling signal stays at {low:g}: a model scheduled by it cannot be told; --degree 0 fits an LTI model")
    return low - 0.5, high + 0.5


def steps(dt: float) -> dict[str, int | None]:
    """Each of `HORIZONS` in samples of `dt` (s); None is a free run."""
    return dict(zip(HORIZONS, (1, max(round(1.0 / dt), 1), None), strict=True))


def percent(value: float) -> str:
    """A fit in words where it is no number."""
    return "diverges" if np.isneginf(value) else "no data" if np.isnan(value) else f"{value:.1f}" if value > -1e4 else f"{value:.1e}"


def coefficients(model: LPVARXModel) -> dict[str, Any]:
    """Coefficients of 1, p, p^2, ... by lag, as `identification.Coefficients.monomial` arranges them."""
    values = model.coefficients.monomial()
    return {**values._asdict(), "output_lags": list(model.structure.output_lags), "input_lags": list(model.structure.input_lags)}


def _scored(label: str, arx: LPVARX, training: FlightRecord, test: FlightRecord | None) -> Scored:
    model = fit(arx, training)
    return Scored(label, model, _scores(model, training), None if test is None else _scores(model, test))


def _scores(model: LPVARXModel, record: FlightRecord) -> dict[str, dict[str, float]]:
    return {
        horizon: {str(name): float(value) for name, value in model.score(record, step).items()} for horizon, step in steps(model.dt).items()
    }
