"""Identified models beside a baseline made from equations: both predict a flight neither has seen,
from the same samples on.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identification.judge.scores import HORIZON, Identified, Scores, predicted, steps
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period
from symheli.values.summary import summarized


@dataclass(frozen=True, kw_only=True)
class BaselineModel:
    """An LPV model that predicts from the full state of a record, and the signals of the record
    that drive it.

    Parameters
    ----------
    model : LPVStateSpace
        Continuous or sampled, of any number of scheduling parameters.
    scheduling : str or sequence of str, optional
        The signals that the parameters are, in their order (default: their own names). A parameter
        that is the rate of another and that the record lacks is that one's derivative.
    inputs : sequence of str, optional
        Those of the model's inputs that the record holds (default: all); the others stay at their
        trim.
    drift : bool
        Without it what the motion of the trim adds, -x0'(p) dp/dt, is left out.

    Examples
    --------
    >>> import identification as idn, symheli
    >>> lag = symheli.LPVStateSpace.polynomial(
    ...     A=[[[-2.0]]], B=[[[1.0]]], C=[[[1.0]]], D=[[[0.0]]],
    ...     scheduling=symheli.Scheduling("speed", "m/s", 0.0, 1.0))
    >>> idn.judge.BaselineModel(model=lag, scheduling="airspeed").drift
    True
    """

    model: LPVStateSpace
    scheduling: str | Sequence[str] | None = None
    inputs: tuple[str, ...] | None = None
    drift: bool = True

    __repr__ = summarized

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
    held until the next; a sampled model goes from sample to sample: see `symheli.lpv.prediction`.
    A model without trim has x0 = 0 and u0 = 0.

    Parameters
    ----------
    lpv : LPVStateSpace
        The model.
    record : FlightRecord
        Signals in SI.
    scheduling, inputs, drift
        As of `BaselineModel`.

    Raises
    ------
    UnknownNameError
        A state, input or scheduling that is not in the record.
    InputError
        A sampled model with another sample period, a range that p never enters.

    Examples
    --------
    >>> import numpy as np, identification as idn, symheli
    >>> lag = symheli.LPVStateSpace.polynomial(
    ...     A=[[[-2.0]]], B=[[[1.0]]], C=[[[1.0]]], D=[[[0.0]]], states=["x"], inputs=["u"],
    ...     outputs=["x"], scheduling=symheli.Scheduling("p", "1", 0.0, 1.0))
    >>> zero, t = np.zeros(50), 0.1 * np.arange(50)
    >>> record = symheli.FlightRecord.from_arrays(
    ...     t, dict.fromkeys("xup", "1"), x=np.exp(-2 * t), u=zero, p=zero)
    >>> along = idn.judge.BaselinePredictor(lag, record)
    >>> bool(np.allclose(along.predict(["x"], 10)[10:, 0], record["x"][10:]))
    True
    """

    def __init__(
        self,
        lpv: LPVStateSpace,
        record: FlightRecord,
        *,
        scheduling: str | Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        drift: bool = True,
    ):
        driven = tuple(map(str, lpv.inputs if inputs is None else inputs))
        for signal in (*driven, *map(str, lpv.states)):
            if signal not in record.signals:
                raise UnknownNameError("signal of the record", signal, map(str, record.signals))
        if lpv.dt is not None and not same_period(lpv.dt, record.dt):
            raise InputError(
                f"the baseline is sampled at {lpv.dt:g} s, the record at {record.dt:g} s; resample"
                " one of them"
            )
        self.lpv = lpv.select(inputs=driven)
        self.p = _scheduled(lpv.parameters, record, scheduling)
        self.u = record.columns(driven)
        x = record.columns(self.lpv.states)
        # p moves within a segment, not across a gap
        moving = record.slope(self.p) if self.lpv.dt is None else None
        self._flight = self.lpv.predict(
            self.p, self.u, x, dt=record.dt, rate=moving if drift else 0.0
        )

    def predict(self, outputs: Sequence[str], horizon: int) -> Array:
        """Outputs (n, ny) `horizon` samples ahead from every sample, NaN for the first `horizon`
        and where a state so long before is missing.

        Raises `InputError` for a horizon that is no number of samples within the record,
        `UnknownNameError` for an output that is neither a state nor an output of the model.
        """
        return self._seen(outputs, self._flight.ahead(horizon))

    def simulate(self, outputs: Sequence[str], start: int = 0) -> Array:
        """Free run (n, ny) from the state at sample `start`, NaN up to it."""
        return self._seen(outputs, self._flight.free_run(start))

    def _seen(self, outputs: Sequence[str], x: Array) -> Array:
        """Columns of the states (n, nx), and y = C(p) x + D(p) u of outputs that are no states."""
        states, names = list(map(str, self.lpv.states)), list(map(str, self.lpv.outputs))
        columns = []
        if not outputs:
            raise InputError("outputs: name at least one")
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


def _scheduled(
    parameters: Sequence[Scheduling], record: FlightRecord, scheduling: str | Sequence[str] | None
) -> Array:
    """p (n,) or (n, d) along the record, within the ranges of the model."""
    own = [s.name for s in parameters]
    given = [scheduling] if isinstance(scheduling, str) else list(scheduling or own)
    if len(given) > len(own):
        raise InputError(f"scheduling: expected a signal for each of {', '.join(own)}, got {given}")
    names = [*given, *own[len(given) :]]
    columns = []
    for s, name in zip(parameters, names, strict=True):
        faster = next((i for i, other in enumerate(parameters) if other.rate == s.name), None)
        if name in record.signals:
            values = record[name]
        elif faster is not None and names[faster] in record.signals:
            values = record.derivative(names[faster])
        else:
            raise UnknownNameError("signal of the record", name, map(str, record.signals))
        inside = np.clip(values, s.low, s.high)
        if not np.any(inside == values):
            raise InputError(
                f"{name} never lies within the baseline's range {s.low:g} to {s.high:g}; name the"
                " signal that schedules it: scheduling=..."
            )
        columns.append(inside)
    return columns[0] if len(columns) == 1 else np.stack(columns, axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """The achievement of one model on the unseen flight: its scores, and its prediction
    `Scores.horizon` seconds ahead (n, ny) for a figure, NaN where its past is incomplete.
    """

    name: str
    identified: bool
    scores: Scores
    ahead: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class BesideBaseline:
    """Predictions of the same unseen flight by all models: the result of `compare_baseline`.

    Examples
    --------
    >>> import numpy as np, identification as idn, symheli
    >>> lag = symheli.LPVStateSpace.polynomial(
    ...     A=[[[-2.0]]], B=[[[1.0]]], C=[[[1.0]]], D=[[[0.0]]], states=["x"], inputs=["u"],
    ...     outputs=["x"], scheduling=symheli.Scheduling("p", "1", 0.0, 1.0))
    >>> zero, t = np.zeros(50), 0.1 * np.arange(50)
    >>> record = symheli.FlightRecord.from_arrays(
    ...     t, dict.fromkeys("xup", "1"), x=np.exp(-2 * t), u=zero, p=zero)
    >>> known = idn.judge.BaselineModel(model=lag)
    >>> found = idn.judge.compare_baseline({}, {"lag": known}, record, ["x"])
    >>> found.best("x").name
    'lag'
    """

    outputs: tuple[str, ...]
    record: FlightRecord
    predictions: tuple[Prediction, ...]

    __repr__ = summarized

    def best(self, output: str, names: Collection[str] | None = None) -> Prediction:
        """The one that predicts `output` best `Scores.horizon` seconds ahead, of those called
        `names` (default: of all).
        """
        among = [p for p in self.predictions if names is None or p.name in names]
        if output not in self.outputs or not among:
            known = [*self.outputs, *(p.name for p in self.predictions)]
            raise InputError(f"expected an output and names among {', '.join(known)}")
        return max(among, key=lambda p: p.scores.ahead[output])


def compare_baseline(
    identified: Mapping[str, Identified],
    baselines: Mapping[str, BaselineModel],
    record: FlightRecord,
    outputs: Sequence[str],
    *,
    horizon: float = HORIZON,
) -> BesideBaseline:
    """Predict one flight by identified models and by baselines from the same information.

    Identified models start from their last samples of outputs and inputs, baselines from the full
    state of the record; free runs of the baselines start where those of the identified models do.
    Airframe, inputs and outputs are whatever the models have.

    Parameters
    ----------
    identified : mapping of str to LPVARXModel or KinematicModel
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
    >>> arx = idn.LPVARX(
    ...     "p", "aileron", "speed", na=1, nb=1, delay=1, basis=idn.Polynomial(1, 0.0, 10.0))
    >>> found = idn.judge.compare_baseline(
    ...     {"identified": idn.fit(arx, record)},
    ...     {"equations": idn.judge.BaselineModel(model=roll)}, record, ["p"])
    >>> [(one.name, round(one.scores.ahead["p"], 1)) for one in found.predictions]
    [('identified', 100.0), ('equations', 100.0)]
    """
    if not identified and not baselines:
        raise InputError("nothing to compare: give identified models or baselines")
    outputs = tuple(map(str, outputs))
    measured, samples = record.columns(outputs), steps(record.dt, horizon).values()

    def judged(name: str, own: bool, guesses: Iterable[Array]) -> Prediction:
        one, far, free = guesses
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
        guesses = (predicted(model, record, n)[:, columns] for n in samples)
        predictions.append(judged(name, True, guesses))
    start = max((model.structure.memory for model in identified.values()), default=0)
    for name, baseline in baselines.items():
        along = baseline.on(record)
        guesses = (
            along.simulate(outputs, start) if n is None else along.predict(outputs, n)
            for n in samples
        )
        predictions.append(judged(name, False, guesses))
    return BesideBaseline(outputs=outputs, record=record, predictions=tuple(predictions))
