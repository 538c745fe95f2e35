"""What is known of the vehicle while it flies: coefficients by the recursion, which airspeeds and
inputs have been excited, how certain the control powers are, whether 1 s predictions hold.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from identification import KinematicARX, Polynomial, RecursiveLeastSquares
from identification.forgetting import Directional
from identification.model import KinematicModel, LPVARXModel
from identification.model.kinematic_fit import mean_trim
from identification.structure.kinematic_arx import INCREMENTS
from studies.live.stream import Row
from symheli import FlightRecord
from symheli.values.arrays import Array
from symheli.values.kinematics import RIGID_BODY, VELOCITIES
from symheli.values.signal import Signal
from symheli.values.units import per_second

STATES = tuple(map(str, RIGID_BODY))
SLOW_AIRSPEED = Signal("airspeed_slow", "m/s")
"""Airspeed behind a lag, by which coefficients move: one that is measured at each instant would
know u.
"""
LAG = 1.0
"""Time constant of that lag, s."""
BIN = 1.0
"""Width of a cell of airspeed, m/s."""
ENOUGH_SAMPLES = 250
"""Samples of a cell that count as covered: 5 s at 50 Hz."""
ENOUGH_MOTION = 0.02
"""Standard deviation of an input, as a fraction of its largest value, that counts as excitation."""
SLOW = 2.0
"""Time constant over which the mean of an input is taken, s."""
KEPT = 6.0
"""Seconds of samples that are kept for predictions."""
THIN = 0.2
"""Seconds between the samples that the trim of a model is the mean of."""
MOST = 36_000
"""Number of them that is kept: two hours."""
EVERYTHING = "every airspeed is covered"
HORIZON = 1.0
"""Seconds ahead of the predictions."""
POWERS = {"p": "lat", "q": "lon", "w": "col", "r": "ped"}
"""Control power of each axis: the acceleration of this velocity by the input whose name ends so."""
TERM = re.compile(r"(?P<signal>\w+)\(k-(?P<lag>\d+)\)(?: f(?P<function>\d+)\(.*)?$")


class ControlPower(NamedTuple):
    """Acceleration by a control with all velocities held, once a flapping rotor has followed, at an
    airspeed (m/s), with its standard error: in `unit`.
    """

    output: str
    control: str
    airspeed: float
    value: float
    error: float
    unit: str


class Cell(NamedTuple):
    """A cell of airspeed from `low` (m/s): samples learnt there, standard deviation of each input
    about its slow mean.
    """

    low: float
    samples: int
    motion: dict[str, float]

    def missing(self, largest: dict[str, float]) -> list[str]:
        """Return the inputs that have not moved enough there; all where there are few samples."""
        if self.samples < ENOUGH_SAMPLES:
            return list(self.motion)
        return [u for u, sd in self.motion.items() if sd < ENOUGH_MOTION * max(largest[u], 1e-9)]


@dataclass(frozen=True)
class Prediction:
    """1 s predictions over the last seconds: 100 % less their error as a share of what each state
    varies over the flight, and the number of samples.
    """

    fit: dict[str, float]
    samples: int


class LiveIdentifier:
    """Recursive least squares of all axes with known kinematics over the airspeed, sample by
    sample.

    Parameters
    ----------
    inputs : sequence of str
        Controls, as the rows name them.
    low, high : float
        Range of airspeed, m/s; samples outside teach nothing.
    dt : float
        Period of the rows, s.
    degree : int
        Of the coefficients in airspeed.
    forgetting : float
        Factor a sample in the direction of each new regressor, in (0, 1]; 1 forgets nothing.

    Raises
    ------
    InputError
        An option out of range.
    """

    def __init__(
        self,
        inputs: Sequence[str],
        low: float,
        high: float,
        dt: float = 0.02,
        degree: int = 2,
        forgetting: float = 1.0,
    ):
        self._options = (tuple(inputs), low, high, dt, degree, forgetting)
        self.inputs, self.dt, self.low, self.high = tuple(inputs), dt, low, high
        self.structure = KinematicARX(
            self.inputs, str(SLOW_AIRSPEED), basis=Polynomial(degree, low, high)
        )
        way = Directional(forgetting) if forgetting < 1.0 else 1.0
        self.estimator = RecursiveLeastSquares(self.structure, way)
        self.online = self.estimator.online(dt=dt)
        self.signals = (*STATES, *self.inputs, "airspeed")
        self._columns = (*RIGID_BODY, *map(Signal, self.inputs), SLOW_AIRSPEED)
        self.learnt, self.outside = 0, 0
        self.largest = dict.fromkeys(self.inputs, 0.0)
        count = max(math.ceil((high - low) / BIN), 1)
        self._samples = np.zeros(count, int)
        self._squares = np.zeros((count, len(self.inputs)))
        self._slow, self._means = math.nan, np.zeros(len(self.inputs))
        self._time = math.nan
        self._recent: deque[Array] = deque(maxlen=round(KEPT / dt))
        self._every, self._rows = max(round(THIN / dt), 1), 0
        self._flown: deque[Array] = deque(maxlen=MOST)
        self._seen = np.zeros((3, len(STATES)))  # number, sum and sum of squares

    def afresh(self) -> LiveIdentifier:
        """Return one with the same options that knows nothing."""
        return LiveIdentifier(*self._options)

    def take(self, row: Row) -> bool:
        """Take in a row, a start where it is not `dt` after the last; return whether it taught."""
        if not abs(row.time - self._time - self.dt) <= 0.01 * self.dt:
            self.online.forget_past()
            self._recent.clear()
            self._slow = math.nan
            self._rows += 10 * self._every  # a gap in the record of the flight
        self._time, self._rows = row.time, self._rows + 1
        y, u, V = np.split(row.values, [len(STATES), len(STATES) + len(self.inputs)])
        p = self._lagged(float(V[0]))
        inside = self.low <= p <= self.high
        if not np.isfinite(row.values).all():
            y = np.full(len(y), math.nan)
        if not inside:
            self.outside += math.isfinite(p)
            self.online.forget_past()
            self._recent.clear()
            return False
        learnt = self.online.update(y, u, p)
        if learnt:
            self._seen += np.array([np.ones(len(y)), y, y**2])
        self._recent.append(np.array([row.time, *y, *u, p]))
        if self._rows % self._every == 0 and np.isfinite(self._recent[-1]).all():
            self._flown.append(np.array([self._rows * self.dt, *y, *u, p]))
        if learnt:
            self._count(u, p)
        return learnt

    def _lagged(self, V: float) -> float:
        """Airspeed behind its lag; NaN where it is not known."""
        if math.isnan(V) or math.isnan(self._slow):
            self._slow = V
        else:
            self._slow += (1.0 - math.exp(-self.dt / LAG)) * (V - self._slow)
        return self._slow

    def _count(self, u: Array, p: float) -> None:
        if self.learnt == 0:
            self._means = u.copy()
        self.learnt += 1
        self._means += (1.0 - math.exp(-self.dt / SLOW)) * (u - self._means)
        cell = min(int((p - self.low) / BIN), len(self._samples) - 1)
        self._samples[cell] += 1
        self._squares[cell] += (u - self._means) ** 2
        for name, value in zip(self.inputs, np.abs(u), strict=True):
            self.largest[name] = max(self.largest[name], float(value))

    # --- what is known ----------------------------------------------------------------------------

    def coverage(self) -> list[Cell]:
        """Return every cell of airspeed, from the lowest."""
        out = []
        for k, n in enumerate(self._samples):
            sd = np.sqrt(self._squares[k] / max(n, 1))
            motion = dict(zip(self.inputs, map(float, sd), strict=True))
            out.append(Cell(self.low + k * BIN, int(n), motion))
        return out

    def next_to_fly(self) -> str:
        """Return what to fly: the nearest airspeed that is not covered, and the inputs that have
        not moved enough there.
        """
        open_cells = [(cell, cell.missing(self.largest)) for cell in self.coverage()]
        left = [(cell, names) for cell, names in open_cells if names]
        if not left:
            return EVERYTHING
        now = self.low if math.isnan(self._slow) else self._slow
        cell, names = min(left, key=lambda one: abs(one[0].low + 0.5 * BIN - now))
        what = "all inputs" if len(names) == len(self.inputs) else ", ".join(names)
        return f"fly at {cell.low:g} to {cell.low + BIN:g} m/s and move {what}"

    def model(self) -> KinematicModel | None:
        """The model as it is now, the mean flight its trim; None while the data do not determine
        every coefficient, or too little was flown for a trim.
        """
        found = self._predictor()
        if found is None or len(self._flown) < 4 * self.structure.basis.size:
            return None
        rows = np.array(self._flown)
        record = FlightRecord(rows[:, 0], rows[:, 1:], self._columns)
        return replace(found, trim=mean_trim(self.structure, [record]))

    def _predictor(self) -> KinematicModel | None:
        """The model as it is now without its trim, which predictions do not need."""
        state = self.online.state
        if not state.determined:
            return None
        regression = self.structure.aerodynamics
        aerodynamics = LPVARXModel(
            structure=regression,
            theta=state.solve(),
            dt=self.dt,
            outputs=INCREMENTS,
            inputs=tuple(map(Signal, regression.inputs)),
            scheduling=SLOW_AIRSPEED,
            residual_covariance=state.residual_covariance,
            rows_used=state.count,
            rows_dropped=0,
            method="rls",
        )
        trim = np.zeros((self.structure.basis.size, len(STATES)))
        return KinematicModel(structure=self.structure, aerodynamics=aerodynamics, trim=trim)

    def control_powers(self, airspeeds: Sequence[float]) -> list[ControlPower]:
        """Return the control power of each axis at airspeeds (m/s), with standard errors; none
        while the data do not determine every coefficient.
        """
        state = self.online.state
        if not state.determined:
            return []
        regression = self.structure.aerodynamics
        theta, n = state.solve(), regression.n_regressors
        R = state.factor[:n, :n]
        names, moving = regression.regressor_names, regression.inputs[: len(VELOCITIES)]
        out = []
        for velocity, ending in POWERS.items():
            control = next((u for u in self.inputs if u.endswith(ending)), None)
            if control is None:
                continue
            row = moving.index(velocity)
            by = Signal(control).unit
            unit = f"{per_second(Signal(velocity).unit)} per {'unit' if by == '1' else by}"
            for V in airspeeds:
                # z(k-i) = z(k-1) - (i-1) T, so that (I + sum (i-1) A_i) T = sum_j B_j u
                g = self._functional(names, control, V, lambda lag: 1.0 / self.dt)
                older = [self._functional(names, z, V, lambda lag: lag - 1.0) for z in moving]
                N = np.linalg.inv(np.eye(len(moving)) + theta.T @ np.transpose(older))
                power = N @ theta.T @ g
                spread = solve_triangular(R.T, g - power @ older, lower=True)
                noise = math.sqrt(N[row] @ state.residual_covariance @ N[row])
                error = float(np.linalg.norm(spread)) * noise
                out.append(ControlPower(velocity, control, V, float(power[row]), error, unit))
        return out

    def _functional(
        self, names: Sequence[str], signal: str, V: float, weight: Callable[[int], float]
    ) -> Array:
        """Factors of the regressors that sum the lags of a signal, weighted, at an airspeed."""
        values = np.atleast_1d(self.structure.basis(V))
        g = np.zeros(len(names))
        for k, name in enumerate(names):
            found = TERM.match(name)
            if found and found["signal"] == signal:
                g[k] = values[int(found["function"] or 0)] * weight(int(found["lag"]))
        return g

    def prediction(self) -> Prediction | None:
        """How well states are predicted 1 s ahead over the last seconds; None where there are too
        few samples without a gap, or no model yet.
        """
        horizon = round(HORIZON / self.dt)
        rows = np.array(self._recent) if self._recent else np.zeros((0, 1))
        model = self._predictor() if len(rows) > 2 * horizon else None
        if model is None or not np.isfinite(rows).all():
            return None
        time = rows[0, 0] + self.dt * np.arange(len(rows))
        found = model.predict(FlightRecord(time, rows[:, 1:], self._columns), horizon)
        there = np.isfinite(found).all(axis=1)
        if there.sum() < horizon:
            return None
        measured = rows[there, 1 : 1 + len(STATES)]
        miss = np.sqrt(np.mean((measured - found[there]) ** 2, axis=0))
        n, total, squares = self._seen
        varies = np.sqrt(np.maximum(squares / n - (total / n) ** 2, 1e-18))
        fit = dict(zip(STATES, (100.0 * (1.0 - miss / varies)).tolist(), strict=True))
        return Prediction(fit, int(there.sum()))
