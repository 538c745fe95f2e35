"""Baseline and identified model on equal terms: predictions of a flight neither has seen, and
frozen comparisons.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import symheli
from identification import LPVARXModel, fit_percent
from studies.transition.axes import HORIZON, SCHEDULING, Axis, rotor_mode
from symheli import FlightRecord, Helicopter, LPVStateSpace
from symheli.lpv import chordal_distance, nu_gap
from symheli.lpv.exponential import expm
from symheli.values.arrays import Array

SCALES = {
    "d_lon": 0.05,
    "d_lat": 0.05,
    "d_col": 0.05,
    "d_ped": 0.1,
    "u": 2.0,
    "v": 2.0,
    "w": 2.0,
    "p": 1.0,
    "q": 1.0,
    "r": 1.0,
    "phi": 0.3,
    "theta": 0.3,
}
"""Sizes (SI) by which channels are scaled before a nu-gap is taken."""


FAST = 3.0
"""Frequency (rad/s) above which the fast modes are compared on their own: the slow modes lie below
1 rad/s.
"""


class BaselinePredictor:
    """Full-state prediction with an interpolated LPV model about its moving trim.

    dx/dt = A(p) (x - x0(p)) + B(p) (u - u0(p)) - x0'(p) dp/dt in deviations; p is the commanded
    airspeed, as for the identified model; flapping angles are known from the record. Without
    `drift` the last term is left out.
    """

    def __init__(self, lpv: LPVStateSpace, record: FlightRecord, drift: bool = True):
        assert lpv.trim is not None  # noqa: S101  (interpolate always keeps the trim)
        nx, nu, dt = len(lpv.states), 4, record.dt
        inputs = [i for i in lpv.inputs if i.startswith("d_")]
        lpv = lpv.select(inputs=inputs)
        p = np.clip(record[SCHEDULING], lpv.scheduling.low, lpv.scheduling.high)
        x0, u0 = lpv.trim.state(p), lpv.trim.input(p)  # type: ignore[union-attr]
        speed = np.gradient(p, record.time)
        w = -lpv.trim.state(p, 1) * speed[:, None] if drift else np.zeros_like(x0)  # type: ignore[union-attr]
        A, B, *_ = lpv.matrices(p)
        stacked = np.zeros((len(p), 2 * nx + nu, 2 * nx + nu))
        stacked[:, :nx, :nx], stacked[:, :nx, nx : nx + nu], stacked[:, :nx, nx + nu :] = (
            A,
            B,
            np.eye(nx),
        )
        step = expm(stacked * dt)
        self.A, self.x0 = step[:, :nx, :nx], x0
        deviation = record.columns(inputs) - u0
        self.push = np.einsum("kij,kj->ki", step[:, :nx, nx : nx + nu], deviation) + np.einsum(
            "kij,kj->ki", step[:, :nx, nx + nu :], w
        )
        self.states, self.x = lpv.states, record.columns(lpv.states)

    def predict(self, outputs: Sequence[str], horizon: int) -> Array:
        """Outputs (n, ny) `horizon` samples ahead from every sample, NaN for the first
        `horizon`.
        """
        n = len(self.x)
        z = (self.x - self.x0)[: n - horizon]
        for h in range(horizon):
            window = slice(h, n - horizon + h)
            z = np.einsum("kij,kj->ki", self.A[window], z) + self.push[window]
        out = np.full((n, len(outputs)), np.nan)
        out[horizon:] = (z + self.x0[horizon:])[:, [self.states.index(y) for y in outputs]]  # type: ignore[arg-type]
        return out

    def simulate(self, outputs: Sequence[str], start: int) -> Array:
        """Free run (n, ny) from sample `start`, NaN before."""
        z, out = (self.x - self.x0)[start], np.full((len(self.x), len(outputs)), np.nan)
        columns = [self.states.index(y) for y in outputs]  # type: ignore[arg-type]
        for k in range(start, len(self.x)):
            if k > start:
                out[k] = (z + self.x0[k])[columns]
            z = self.A[k] @ z + self.push[k]
        return out


@dataclass(frozen=True)
class Predictor:
    """What one predictor achieved on the unseen flight: fits in percent by output, and the
    predictions for the figures.
    """

    name: str
    one_step: dict[str, float]
    one_second: dict[str, float]
    free_run: dict[str, float]
    one_second_series: Array


@dataclass(frozen=True)
class Comparison:
    """All predictors of one axis on the same unseen flight."""

    axis: Axis
    record: FlightRecord
    predictors: tuple[Predictor, ...]


def compare(
    axis: Axis,
    identified: dict[str, LPVARXModel],
    baselines: dict[str, tuple[LPVStateSpace, bool]],
    test: FlightRecord,
) -> Comparison:
    """`identified` and `baselines` ({name: (model, with drift)}) predict the outputs of `axis` from
    the same samples on.
    """
    truth, horizon = test.columns(axis.outputs), round(HORIZON / test.dt)

    def judged(name: str, one: Array, ahead: Array, free: Array) -> Predictor:
        def fits(guess: Array) -> dict[str, float]:
            return dict(
                zip(axis.outputs, (float(v) for v in fit_percent(truth, guess)), strict=True)
            )

        return Predictor(name, fits(one), fits(ahead), fits(free), ahead)

    predictors = []
    for name, model in identified.items():
        columns = [model.outputs.index(y) for y in axis.outputs]  # type: ignore[arg-type]
        one, ahead, free = (
            model.predict(test, 1),
            model.predict(test, horizon),
            model.simulate(test),
        )
        predictors.append(judged(name, one[:, columns], ahead[:, columns], free[:, columns]))
    start = max((model.structure.memory for model in identified.values()), default=0)
    for name, (lpv, drift) in baselines.items():
        model = BaselinePredictor(lpv, test, drift)
        predictors.append(
            judged(
                name,
                model.predict(axis.outputs, 1),
                model.predict(axis.outputs, horizon),
                model.simulate(axis.outputs, start),
            )
        )
    return Comparison(axis, test, tuple(predictors))


@dataclass(frozen=True)
class FrozenComparison:
    """Exact, interpolated and identified model with airspeed held: poles (rad/s), responses and
    nu-gaps to the exact one.
    """

    axis: Axis
    airspeeds: Array
    exact_poles: tuple[Array, ...]
    baseline_poles: tuple[Array, ...]
    identified_poles: tuple[Array, ...]
    mode_miss_baseline: Array
    mode_miss_identified: Array
    gap_baseline: Array
    gap_identified: Array
    fast_baseline: Array
    fast_identified: Array
    """Largest chordal distance above `FAST` rad/s, where the slow modes do not decide."""
    omega: Array
    responses: dict[str, Array]
    """|G| (n,) of the first rate output from the first input at 7 m/s: exact, baseline,
    identified.
    """


def compare_frozen(
    heli: Helicopter, axis: Axis, model: LPVARXModel, lpv: LPVStateSpace, airspeeds: Sequence[float]
) -> FrozenComparison:
    """Everything at sample period of the identified model, zero-order hold, inputs and outputs of
    `axis`.
    """
    poles: dict[str, list[Array]] = {"exact": [], "baseline": [], "identified": []}
    gaps, fast, misses = ({"baseline": [], "identified": []} for _ in range(3))
    rate = {"longitudinal-vertical": ("q", "d_lon")}.get(axis.name, ("p", "d_lat"))
    omega, responses = np.geomspace(0.3, 0.8 * np.pi / model.dt, 200), {}
    for speed in airspeeds:
        exact = symheli.linearize(heli, symheli.trim(heli, speed))
        at = {
            "exact": exact.discretize(model.dt).select(inputs=axis.inputs, outputs=axis.outputs),
            "baseline": (
                lpv.at(speed).discretize(model.dt).select(inputs=axis.inputs, outputs=axis.outputs)
            ),
            "identified": model.at(speed).select(inputs=axis.inputs, outputs=axis.outputs),
        }
        mode = rotor_mode(exact, axis.mode)
        for name, frozen in at.items():
            z = frozen.poles().astype(complex)
            s = np.log(z[np.abs(z) > 1e-12]) / model.dt
            poles[name].append(s)
            if name != "exact":
                misses[name].append(100 * np.abs(s - mode).min() / abs(mode))
                sizes = [SCALES[i] for i in axis.inputs], [SCALES[y] for y in axis.outputs]
                gaps[name].append(
                    nu_gap(at["exact"], frozen, input_scale=sizes[0], output_scale=sizes[1])
                )
                fast[name].append(
                    chordal_distance(
                        at["exact"],
                        frozen,
                        omega[omega >= FAST],
                        input_scale=sizes[0],
                        output_scale=sizes[1],
                    ).max()
                )
            if abs(speed - 7.0) < 0.26:
                responses[name] = np.abs(
                    frozen.select(inputs=[rate[1]], outputs=[rate[0]]).frequency_response(omega)[
                        :, 0, 0
                    ]
                )
    return FrozenComparison(
        axis,
        np.asarray(airspeeds, float),
        tuple(poles["exact"]),
        tuple(poles["baseline"]),
        tuple(poles["identified"]),
        np.array(misses["baseline"]),
        np.array(misses["identified"]),
        np.array(gaps["baseline"]),
        np.array(gaps["identified"]),
        np.array(fast["baseline"]),
        np.array(fast["identified"]),
        omega,
        responses,
    )
