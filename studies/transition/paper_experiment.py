"""The paper's own experiment: pitch cyclic to pitch, vertical and forward velocity by recursive
least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification import LPVARX, Polynomial, RecursiveLeastSquares, excitation_report
from identification.model import LPVARXModel
from studies.setup.axes import LONGITUDINAL
from studies.setup.flights import TOP
from symheli import FlightRecord, LinearFamily, LPVStateSpace
from symheli.errors import ExcitationError
from symheli.lpv.riccati import regulator

PERIOD = 0.11408
"""Sample period, s (Budiyono & Sutarto)."""
SAMPLES = 600
OUTPUTS = ("theta", "w", "u")
UNITS = {
    "theta": "rad",
    "w": "m/s",
    "u": "m/s",
    "d_lon": "rad",
    "e_d_lon": "rad",
    "airspeed": "m/s",
}


@dataclass(frozen=True)
class OutputResult:
    """One output of the experiment: how its 12 parameters converged and how the model follows the
    system.
    """

    output: str
    model: LPVARXModel
    time: np.ndarray
    parameters: np.ndarray
    """Monomial coefficients over time (n, 12): a_1, a_2, a_3, b_2, each 1 p p^2."""
    parameter_names: tuple[str, ...]
    settled_after: float
    """Time (s) after which every parameter stays within 5 % (of its largest coefficient function)
    of its final value.
    """
    fits: dict[str, float]
    spikes: tuple[tuple[float, float], ...]
    """(time s, |one-step error| in standard deviations of the error) of the largest errors on the
    fresh record.
    """
    spike_airspeed: float
    """p (m/s) where the largest error is."""
    spike_input: float
    """|d_lon| one or two samples before it, the larger, in standard deviations of d_lon."""


@dataclass(frozen=True)
class PaperExperiment:
    """Open or closed loop, with the record it was judged on and the reason why a cubic basis is
    refused.
    """

    loop: str
    training: FlightRecord
    test: FlightRecord
    channels: tuple[OutputResult, ...]
    cubic_refused: str
    excitation: str


@dataclass(frozen=True, kw_only=True)
class PaperExperiments:
    """The experiment in open loop, as in the paper, and in closed loop."""

    runs: tuple[PaperExperiment, ...]


def run_experiments(family: LinearFamily, seed: int = 0) -> PaperExperiments:
    """Open loop, then closed."""
    runs = tuple(run_experiment(family, closed, seed) for closed in (False, True))
    return PaperExperiments(runs=runs)


def discretized_baseline(family: LinearFamily, degree: int = 2) -> LPVStateSpace:
    """Longitudinal baseline from pitch cyclic, quadratic in airspeed, discretized at the paper's
    period.
    """
    return (
        family.select(LONGITUDINAL.states, ["d_lon"], OUTPUTS)
        .interpolate("polynomial", degree)
        .discretize(PERIOD, degree=degree)
    )


def fly_baseline(plant: LPVStateSpace, closed: bool, seed: int) -> FlightRecord:
    """p(k) = 6.5 (1 + sin(pi k/3)) m/s and white d_lon of 0.01 rad on the discretized baseline,
    stabilised or not.
    """
    k = np.arange(SAMPLES)
    p = 0.5 * TOP * (1 + np.sin(np.pi * k / 3))
    e = 0.01 * np.random.default_rng(seed).standard_normal(SAMPLES)
    A, B, C, _ = plant.matrices(p)
    middle = plant.at(0.5 * TOP)
    gain = np.zeros((1, len(plant.states)))
    if closed:
        Q = np.diag([0.02, 0.02, 0.1, 1.0, 0.0])
        gain = regulator(middle.A, middle.B, Q, np.eye(1), dt=PERIOD).K
    x, y, u = np.zeros(len(plant.states)), np.empty((SAMPLES, 3)), np.empty(SAMPLES)
    for i in range(SAMPLES):
        u[i] = e[i] - (gain @ x)[0]
        y[i] = C[i] @ x
        x = A[i] @ x + B[i, :, 0] * u[i]
    columns = {name: y[:, j] for j, name in enumerate(OUTPUTS)} | {
        "d_lon": u,
        "e_d_lon": e,
        "airspeed": p,
    }
    return FlightRecord.from_arrays(
        PERIOD * k,
        UNITS,
        f"discretized baseline, {'closed' if closed else 'open'} loop, seed {seed}",
        **columns,
    )


def structure(output: str, degree: int = 2) -> LPVARX:
    """Budiyono & Sutarto eqs 13-14: na = 3, one input coefficient at delay 2, polynomial in p,
    coefficients at p(k).
    """
    return LPVARX(
        (output,),
        ("d_lon",),
        "airspeed",
        na=3,
        nb=1,
        delay=2,
        basis=Polynomial(degree, 0.0, TOP),
        scheduling_at="now",
    )


def run_experiment(family: LinearFamily, closed: bool, seed: int = 0) -> PaperExperiment:
    """Identify on one record, judge on a fresh one with another input."""
    plant = discretized_baseline(family)
    training, test = fly_baseline(plant, closed, seed), fly_baseline(plant, closed, seed + 500)
    channels = tuple(_channel(output, training, test) for output in OUTPUTS)
    try:
        excitation_report(structure("theta", 3), training).require()
        refused = ""
    except ExcitationError as error:
        refused = str(error)
    return PaperExperiment(
        "closed" if closed else "open",
        training,
        test,
        channels,
        refused,
        str(excitation_report(structure("theta"), training)),
    )


def _channel(output: str, training: FlightRecord, test: FlightRecord) -> OutputResult:
    arx = structure(output)
    history = RecursiveLeastSquares(arx).run(training)
    model = history.model
    T = arx.basis.monomial  # type: ignore[attr-defined]
    theta = history.coefficients[:, :, 0].reshape(len(history.time), 4, 3)
    parameters = (theta @ T).reshape(len(history.time), 12)
    names = tuple(
        f"{c}{'' if j == 0 else ' p' if j == 1 else ' p^2'}"
        for c in ("a1", "a2", "a3", "b2")
        for j in range(3)
    )
    fits = {
        "one step": float(model.score(test, 1)[output]),
        "1 s": float(model.score(test, round(1 / PERIOD))[output]),
        "free run": float(model.score(test)[output]),
    }
    error = np.abs(test[output] - model.predict(test, 1)[:, 0])
    sigma = float(np.sqrt(np.nanmean(error**2)))
    largest = np.argsort(np.where(np.isfinite(error), error, -1))[::-1][:3]
    spikes = tuple((float(test.time[i]), float(error[i] / sigma)) for i in largest)
    k = int(largest[0])
    push = float(np.abs(test["d_lon"][max(k - 2, 0) : k]).max() / test["d_lon"].std())
    settled = _settling(history.time, theta)
    return OutputResult(
        output,
        model,
        history.time,
        parameters,
        names,
        settled,
        fits,
        spikes,
        float(test["airspeed"][k]),
        push,
    )


def _settling(time: np.ndarray, theta: np.ndarray) -> float:
    final = theta[-1]
    size = np.abs(final).max(axis=1, keepdims=True)
    inside = np.all(np.abs(theta - final) <= 0.05 * size, axis=(1, 2))
    outside = np.flatnonzero(~inside)
    return float(time[min(outside[-1] + 1, len(time) - 1)]) if len(outside) else float(time[0])
