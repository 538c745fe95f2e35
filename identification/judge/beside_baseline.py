"""Identified models beside a baseline made from equations: both predict a flight neither has seen,
from the same samples on.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identification.judge.scores import HORIZON, Scores, steps
from identification.model.lpvarx_model import LPVARXModel
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import LPVStateSpace
from symheli.lpv.exponential import expm
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period


@dataclass(frozen=True, kw_only=True)
class BaselineModel:
    """An LPV model that predicts from the full state of a record, and what of the record drives it.

    `scheduling` names the signal that p is (default: the model's own name for it), `inputs` those
    of the model's inputs that the record holds (default: all; the others stay at their trim).
    Without `drift` the motion of the trim, -x0'(p) dp/dt, is left out.
    """

    model: LPVStateSpace
    scheduling: str | None = None
    inputs: tuple[str, ...] | None = None
    drift: bool = True

    def on(self, record: FlightRecord) -> BaselinePredictor:
        """The model along a record."""
        return BaselinePredictor(
            self.model,
            record,
            scheduling=self.scheduling,
            inputs=self.inputs,
            drift=self.drift,
        )


class BaselinePredictor:
    """Predictions of a record by an LPV model from its full state, about its moving trim.

    dx/dt = A(p) (x - x0(p)) + B(p) (u - u0(p)) - x0'(p) dp/dt in deviations, every sample's p and u
    held until the next; a sampled model goes from sample to sample as it is. A model without trim
    has x0 = 0 and u0 = 0. Signals are those of the record, SI; the arguments are those of
    `BaselineModel`.

    Raises `UnknownNameError` for a state, input or scheduling that is not in the record, and
    `InputError` for a sampled model with another sample period and a range that p never enters.
    """

    def __init__(
        self,
        lpv: LPVStateSpace,
        record: FlightRecord,
        *,
        scheduling: str | None = None,
        inputs: Sequence[str] | None = None,
        drift: bool = True,
    ):
        driven = tuple(map(str, lpv.inputs if inputs is None else inputs))
        name = str(lpv.scheduling.name if scheduling is None else scheduling)
        for signal in (name, *driven, *map(str, lpv.states)):
            if signal not in record.signals:
                raise UnknownNameError("signal of the record", signal, map(str, record.signals))
        if lpv.dt is not None and not same_period(lpv.dt, record.dt):
            raise InputError(
                f"the baseline is sampled at {lpv.dt:g} s, the record at {record.dt:g} s; resample"
                " one of them"
            )
        self.lpv = lpv.select(inputs=driven)
        low, high = self.lpv.scheduling.low, self.lpv.scheduling.high
        self.p = np.clip(record[name], low, high)
        if not np.any(self.p == record[name]):
            raise InputError(
                f"{name} is nowhere within the baseline's {low:g} to {high:g}; name the signal that"
                " schedules it: scheduling=..."
            )
        self.x, self.u = record.columns(self.lpv.states), record.columns(driven)
        trim = self.lpv.trim
        self.x0 = np.zeros_like(self.x) if trim is None else trim.state(self.p)
        u0 = np.zeros_like(self.u) if trim is None else trim.input(self.p)
        step = self._sampled(record) if self.lpv.dt is None else self._given()
        self.A, B, moved = step
        self.push = np.einsum("kij,kj->ki", B, self.u - u0)
        if drift and trim is not None:
            self.push += moved

    def _sampled(self, record: FlightRecord) -> tuple[Array, Array, Array]:
        """A and B over one sample, and what the drift of the trim adds to the deviations in it."""
        A, B, *_ = self.lpv.matrices(self.p)
        n, nx, nu = *B.shape[:2], B.shape[2]
        stacked = np.zeros((n, 2 * nx + nu, 2 * nx + nu))
        stacked[:, :nx, :nx], stacked[:, :nx, nx : nx + nu] = A, B
        stacked[:, :nx, nx + nu :] = np.eye(nx)
        step = expm(stacked * record.dt)
        drift = np.zeros((n, nx))
        if self.lpv.trim is not None:
            speed = np.gradient(self.p, record.time)
            drift = -self.lpv.trim.state(self.p, 1) * speed[:, None]
        moved = np.einsum("kij,kj->ki", step[:, :nx, nx + nu :], drift)
        return step[:, :nx, :nx], step[:, :nx, nx : nx + nu], moved

    def _given(self) -> tuple[Array, Array, Array]:
        """The same of a sampled model, whose trim moves by what it is at the next sample."""
        A, B, *_ = self.lpv.matrices(self.p)
        return A, B, -np.diff(self.x0, axis=0, append=self.x0[-1:])

    def predict(self, outputs: Sequence[str], horizon: int) -> Array:
        """Outputs (n, ny) `horizon` samples ahead from every sample, NaN for the first
        `horizon`.
        """
        n = len(self.x)
        z = (self.x - self.x0)[: n - horizon]
        for h in range(horizon):
            window = slice(h, n - horizon + h)
            z = np.einsum("kij,kj->ki", self.A[window], z) + self.push[window]
        x = np.full_like(self.x, np.nan)
        x[horizon:] = z + self.x0[horizon:]
        return self._seen(outputs, x)

    def simulate(self, outputs: Sequence[str], start: int = 0) -> Array:
        """Free run (n, ny) from the state at sample `start`, NaN up to it."""
        z, x = (self.x - self.x0)[start], np.full_like(self.x, np.nan)
        for k in range(start, len(self.x)):
            if k > start:
                x[k] = z + self.x0[k]
            z = self.A[k] @ z + self.push[k]
        return self._seen(outputs, x)

    def _seen(self, outputs: Sequence[str], x: Array) -> Array:
        """Columns of the states (n, nx), and y = C(p) x + D(p) u of outputs that are no states."""
        states, names = list(map(str, self.lpv.states)), list(map(str, self.lpv.outputs))
        columns = []
        for y in map(str, outputs):
            if y in states:
                columns.append(x[:, states.index(y)])
            elif y in names:
                _, _, C, D = self.lpv.select(outputs=[y]).matrices(self.p)
                columns.append(
                    np.einsum("kj,kj->k", C[:, 0], x) + np.einsum("kj,kj->k", D[:, 0], self.u)
                )
            else:
                raise UnknownNameError("output", y, dict.fromkeys([*states, *names]))
        return np.stack(columns, axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """What one model achieved on the unseen flight: its scores, and its prediction `Scores.horizon`
    seconds ahead (n, ny) for a figure.
    """

    name: str
    identified: bool
    scores: Scores
    ahead: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class BesideBaseline:
    """All models on the same unseen flight."""

    outputs: tuple[str, ...]
    record: FlightRecord
    predictions: tuple[Prediction, ...]

    def best(self, output: str, names: Collection[str] | None = None) -> Prediction:
        """The one that predicts `output` best `Scores.horizon` seconds ahead, of those called
        `names` (default: of all).
        """
        among = [p for p in self.predictions if names is None or p.name in names]
        if output not in self.outputs or not among:
            known = [*self.outputs, *(p.name for p in self.predictions)]
            raise InputError(f"expected an output and names among {', '.join(known)}")
        return max(among, key=lambda p: p.scores.ahead[output])


def beside_baseline(
    identified: Mapping[str, LPVARXModel],
    baselines: Mapping[str, BaselineModel],
    record: FlightRecord,
    outputs: Sequence[str],
    *,
    horizon: float = HORIZON,
) -> BesideBaseline:
    """Predict one flight by identified models and by baselines, on equal terms.

    Identified models start from their last samples of outputs and inputs, baselines from the full
    state of the record; free runs of the baselines start where those of the identified models do.
    Airframe, inputs and outputs are whatever the models have.

    Parameters
    ----------
    identified : mapping of str to LPVARXModel
        By name; each has all of `outputs` among its own.
    baselines : mapping of str to BaselineModel
        By name, with what of the record drives them.
    record : FlightRecord
        A flight that no model has been fitted to.
    outputs : sequence of str
        What is compared.
    horizon : float
        Seconds ahead, beside one step and free run.

    Returns
    -------
    BesideBaseline
        Scores in percent and predictions by model.

    Raises
    ------
    UnknownNameError
        For an output that a model does not have, and a signal that is not in the record.
    InputError
        Where nothing is given to compare, and as `LPVARXModel.predict`.

    Examples
    --------
    >>> import numpy as np, identification as idn, symheli
    >>> roll = symheli.LPVStateSpace.polynomial(
    ...     A=[[[-4.0]], [[-0.2]]], B=[[[30.0]]], C=[[[1.0]]], D=[[[0.0]]],
    ...     scheduling=symheli.Scheduling("speed", "m/s", 0.0, 10.0),
    ...     states=["p"], inputs=["aileron"], outputs=["p"])
    >>> rng, n = np.random.default_rng(0), 400
    >>> speed, aileron = 5 + 5 * np.sin(0.02 * np.arange(n)), 0.1 * rng.standard_normal(n)
    >>> p = np.zeros(n)
    >>> for k in range(1, n):
    ...     a = np.exp((-4 - 0.2 * speed[k - 1]) * 0.02)
    ...     p[k] = a * p[k - 1] + (1 - a) * 30 / (4 + 0.2 * speed[k - 1]) * aileron[k - 1]
    >>> record = symheli.FlightRecord.from_arrays(
    ...     0.02 * np.arange(n), {"p": "rad/s", "aileron": "rad", "speed": "m/s"},
    ...     p=p, aileron=aileron, speed=speed)
    >>> arx = idn.LPVARX("p", "aileron", "speed", 1, 1, 1, idn.Polynomial(1, 0.0, 10.0))
    >>> found = idn.beside_baseline(
    ...     {"identified": idn.fit(arx, record)},
    ...     {"equations": idn.BaselineModel(model=roll)}, record, ["p"])
    >>> [(one.name, round(one.scores.ahead["p"], 1)) for one in found.predictions]
    [('identified', 100.0), ('equations', 100.0)]
    """
    if not identified and not baselines:
        raise InputError("nothing to compare: give identified models or baselines")
    outputs = tuple(map(str, outputs))
    measured, ahead = record.columns(outputs), list(steps(record.dt, horizon).values())[1]
    assert ahead is not None  # noqa: S101  (only the free run has no horizon)

    def judged(name: str, own: bool, one: Array, far: Array, free: Array) -> Prediction:
        found = Scores.of(
            measured, outputs, one_step=one, ahead=far, free_run=free, horizon=horizon
        )
        return Prediction(name=name, identified=own, scores=found, ahead=far)

    predictions = []
    for name, model in identified.items():
        for y in outputs:
            if y not in model.outputs:
                raise UnknownNameError(f"output of {name}", y, map(str, model.outputs))
        columns = [model.outputs.index(y) for y in outputs]  # type: ignore[arg-type]
        guesses = model.predict(record, 1), model.predict(record, ahead), model.simulate(record)
        predictions.append(judged(name, True, *(guess[:, columns] for guess in guesses)))
    start = max((model.structure.memory for model in identified.values()), default=0)
    for name, baseline in baselines.items():
        along = baseline.on(record)
        guesses = (
            along.predict(outputs, 1),
            along.predict(outputs, ahead),
            along.simulate(outputs, start),
        )
        predictions.append(judged(name, False, *guesses))
    return BesideBaseline(outputs=outputs, record=record, predictions=tuple(predictions))
