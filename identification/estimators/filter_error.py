"""Filter error method: maximum likelihood for a rigid vehicle with noise on every sensor, by
smoothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpotri  # type: ignore[attr-defined]
from scipy.signal import lfilter

from identification.estimators.block_banded import WhitenedRegressors, Whitening
from identification.estimators.instrumental_variables import instrumental_variables
from identification.estimators.instruments import FlightSource, flown_rows
from identification.estimators.least_squares import least_squares
from identification.estimators.method import Estimate, Method, not_settled
from identification.estimators.newey_west import long_run_covariance
from identification.estimators.residual_power import window_powers
from identification.estimators.simulator_prior import Simulated, SimulatorPrior
from identification.structure.kinematic_arx import STATES, Aerodynamics, increments
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression, Samples, regressor_rows, stacked
from symheli.errors import DataWarning, ExcitationError, InputError, UnknownNameError
from symheli.progress import tracked
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.kinematics import VELOCITIES, kinematic_jacobian
from symheli.values.numbers import positive, whole
from symheli.values.runs import runs

MISFIT = 30.0
"""What the structure leaves unexplained of the simulated flight is slow against a sample: white
noise with this many times its variance has as much power where models are used. Chosen on the
seeds 1000 to 1004 of the study's flights; 10 to 100 differ little.
"""

MODEL_ERROR = 1e-9
"""Error variance of the Euler equations, as a fraction of that of the attitude sensors."""

NOISE_BAND = 0.8
"""Fraction of the Nyquist frequency above which a signal is taken to be noise."""

HOLE = 5
"""Longest hole of a signal across which its noise is looked at, samples."""

LINES_PER_ESTIMATE = 1.0 + 2 * (2 / 3) ** 2 + 2 * (1 / 6) ** 2
"""Number of lines of a Hann window's spectrum that count as one: neighbouring lines are
correlated.
"""

_TOO_SHORT = (
    "no stretch of the records in which everything was measured is long enough: look at what"
    " record.mended() says of them, decimate to the slowest sensor, or fly again"
)

ADVICE = "allow more steps, excite more, or lower the degree of the basis"

LAGS, CHUNK = 25, 256
"""Number of samples over which scores are taken to be correlated, and of those summed at a time."""

SLOWER = 4
"""Factor of the number of steps where a delay or a wind is sought too: they start far off."""

DIFFERENCE = 1e-3
"""Step of central differences by an unknown of actuators or wind, in its prior deviation."""

WIND_DETERMINED = 0.5
"""Largest standard deviation of a wind that counts as determined by the flights, m/s."""

FILLED, FILLED_INPUT = 1e2, 4.0
"""Variance of a bridged sample, as a multiple of the sensor's, and of equations with a bridged
input. Chosen on the seeds 1000 to 1005 of the study's flights, 5 % of their rows lost.
"""

FARTHEST = 4.0
"""Largest move of late sensors, in their prior deviation."""


@dataclass(frozen=True)
class FilterError(Method):
    """Filter-error method: maximum likelihood with white measurement noise on every state and a
    small white error of the aerodynamics that a `KinematicARX` describes.

    y = x + v with variances R, and the structure's equations hold for x up to w with variances Q.
    For given coefficients the best x is a smoother's; the equations linearized there are linear in
    v and in the coefficients at once, so that a step is a generalized least squares with the
    banded covariance of (their error as measured). Starts from instruments flown in a simulator
    (`InstrumentalVariables`), and learns from the same flight what the structure leaves out. `fit`
    fills holes up to half a second by that flight, and they count as badly measured here.

    Parameters
    ----------
    simulator : FlightSource
        `symheli.flight.SimulatedFlight(heli)`: the flight again without noise. It may be wrong.
    noise : mapping of str to float, optional
        Standard deviation of the sensor of each of u v w p q r phi theta, in its unit; default of
        each record from its spectrum above 0.8 of the Nyquist frequency.
    misfit : float
        Q as a multiple of the variance the structure leaves unexplained in the simulated flight.
    gust : float
        Standard deviation of gusts that nothing measures, m/s along each body axis; 0: still air.
        They enter where the velocities do, as hidden states with the time constant `gust_time`: no
        new coefficient.
    gust_time : float
        s; of the longitudinal Dryden spectrum its length scale over the airspeed.
    prior : bool
        Whether coefficients are taken to lie about those of the simulated flight, as near, signal
        by signal and equation by equation, as the flights say (`SimulatorPrior`): for much noise
        and short flights. The covariance is then that of the posterior, and modes that the flights
        do not tell are the simulator's.
    steps : int
        Gauss-Newton steps at most.

    Raises
    ------
    InputError
        Another source, a number that is not positive, a structure without kinematics.

    References
    ----------
    Jategaonkar (2015), Flight Vehicle System Identification, ch. 5; Klein and Morelli (2006),
    Aircraft System Identification, ch. 6. As generalized least squares on smoothed states: here.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> ramps = symheli.AirspeedSchedule((6.0, 2.0), (1.5, 1.5), (2.0, 2.0), start=2.0)
    >>> flight = symheli.fly(heli, ramps, noise_db=30.0,
    ...     excitation=symheli.Excitation(dict.fromkeys(heli.inputs, 0.01)))
    >>> kin = idn.KinematicARX(heli.inputs, "airspeed_command", nb=1,
    ...     basis=idn.Polynomial(1, 2.0, 6.0))
    >>> wrong = symheli.Helicopter.load("xcell_kahn_hudson", governor="ideal")
    >>> method = idn.methods.FilterError(symheli.flight.SimulatedFlight(wrong))
    >>> found = idn.fit(kin, flight, method=method)
    >>> found.method, found.covariance.shape
    ('filter error', (6, 28, 6, 28))
    """

    simulator: FlightSource
    noise: Mapping[str, float] | None = None
    misfit: float = MISFIT
    gust: float = 0.0
    gust_time: float = 20.0
    prior: bool = False
    steps: int = 3
    shorthand: ClassVar[str] = "filter error"

    def __post_init__(self) -> None:
        if not isinstance(self.simulator, FlightSource):
            raise InputError(
                "simulator: expected a source of flights such as SimulatedFlight(heli), got"
                f" {self.simulator!r:.80}"
            )
        for name, deviation in (self.noise or {}).items():
            if name not in STATES:
                raise UnknownNameError("sensor in noise", name, STATES)
            positive(deviation, f"noise of {name}")
        positive(self.misfit, "misfit")
        positive(self.gust_time, "gust_time, s")
        positive(self.gust, "gust, standard deviation in m/s", or_zero=True)
        whole(self.steps, "steps", 1)
        if not isinstance(self.prior, bool):
            raise InputError(f"prior: expected True or False, got {self.prior!r:.80}")

    @classmethod
    def default(cls) -> Method:
        """There is none: it needs a simulator. Raises `InputError`."""
        raise InputError(
            'method "filter error" needs a simulator:'
            " FilterError(SimulatedFlight(Helicopter.load(...)))"
        )

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Estimate the coefficients, with the noise in the details, and the joint covariance of all
        coefficients.
        """
        if not isinstance(arx, Aerodynamics):
            raise InputError(
                "the filter error method needs known kinematics: fit a KinematicARX, or choose"
                " another method for an LPVARX"
            )
        found, z = self._from(arx, records, data, np.zeros(arx.unknown))
        if any(part.unknown for part in (arx.wind, arx.sensors) if part):  # they moved the start
            found, _ = self._from(arx, records, data, z)
        return found

    def _from(
        self, arx: Aerodynamics, records: Sequence[FlightRecord], data: Regression, z: Array
    ) -> tuple[Estimate, Array]:
        """Estimate from a start by instruments with the unknowns of actuators and wind at `z`;
        these too.
        """
        unknown, there, moved = arx.unknown, arx, records
        if z.any():
            there = arx.moved(z.tolist())
            moved = [there.again(record, arx) for record in records]
            data = stacked(there, moved)
        theta, *_ = instrumental_variables(there, moved, data, self.simulator)
        simulated, left = self._simulated(there, moved)
        left = self.misfit * left
        air = self.gust**2, float(np.exp(-records[0].dt / self.gust_time))
        flights = []
        for record, R in zip(records, self._variances(records), strict=True):
            noise = Noise.of(R, left, *air)
            flights += [
                (SmoothedStretch.of(arx, record, part), noise_of_part(noise, arx, record, part))
                for part in unbroken(arx, record)
            ]
        if not flights:
            raise ExcitationError(_TOO_SHORT)
        weights = [len(s.y) for s, _ in flights]
        R = np.average(
            [np.atleast_2d(noise.R).min(axis=0) for _, noise in flights], axis=0, weights=weights
        )
        count, settled, n = 0, False, arx.n_regressors
        prior = SimulatorPrior.of(arx, simulated, unknown, believed=self.prior)
        steps = self.steps * (SLOWER if unknown else 1)
        for _ in tracked("filter error", range(steps)):
            count += 1
            for s, _ in flights:
                s.follow(z)
            each = [s.linearized(theta, noise) for s, noise in flights]
            parts = [equations.normal() for equations in each]
            normal, right = map(sum, zip(*parts, strict=True))
            at = np.append(theta.T.reshape(-1), z)
            prior.learn(normal, right, at)  # type: ignore[arg-type]
            known = prior.precision()
            step, inverse = _solved(normal + np.diag(known), right + known * (prior.mean - at))  # type: ignore[operator]
            change, later = step[: 6 * n].reshape(6, -1).T, step[6 * n :]
            for (s, noise), equations in zip(flights, each, strict=True):
                s.smooth(equations, change, later, noise)
            theta, z = theta + change, z + later
            spread = np.sqrt(np.diag(inverse))
            settled = bool(np.all(np.abs(step) < 0.1 * spread))
            if settled:
                break
        each = [s.linearized(theta, noise) for s, noise in flights]
        scores = sum(equations.scores() for equations in each) + np.diag(known)
        covariance = inverse @ scores @ inverse  # type: ignore[operator]
        covariance = 0.5 * (covariance + covariance.T)
        if self.prior:  # nor less than the posterior where noise is white: what fits is not scored
            grown = np.sqrt(np.maximum(np.diag(inverse) / np.diag(covariance), 1.0))
            covariance = covariance * np.outer(grown, grown)
        beside = arx.found(z.tolist(), np.sqrt(np.diag(covariance)[6 * n :]).tolist())
        residual = np.average([s.residual(theta) for s, _ in flights], axis=0, weights=weights)
        estimate = Estimate(
            theta=theta,
            details={
                "steps": count,
                "sensor_noise": dict(zip(STATES, np.sqrt(R).tolist(), strict=True)),
                "sensor_noise_given": list(self.noise or {}),
                "process_noise": dict(
                    zip(map(str, VELOCITIES), np.sqrt(left).tolist(), strict=True)
                ),
                "equation_variances": Noise.of(R, left, *air).Q.tolist(),
                "gust": self.gust,
                "gust_remains": air[1],
                "residual_windows": window_powers(
                    [equations.whitened() for equations in each], records[0].dt
                ).tolist(),
            }
            | beside,
            remarks=(
                *_unknown_wind(beside.get("wind", {})),
                *(() if settled or steps == 1 else (not_settled(self, ADVICE),)),
            ),
            residual_covariance=residual,
            covariance=covariance[: 6 * n, : 6 * n].reshape(6, n, 6, n),
        )
        return estimate, z

    def _variances(self, records: Sequence[FlightRecord]) -> list[Array]:
        """Return the variances of the sensors (8,) in each record; where one is too short, those of
        the others.
        """
        found = np.array([noise_of_flight(r, self.noise or {}).variances for r in records])
        known = np.isfinite(found)
        weights = known * np.array([len(r) for r in records], float)[:, None]
        pooled = np.sum(np.where(known, found, 0.0) * weights, axis=0) / np.maximum(
            weights.sum(axis=0), 1.0
        )
        largest = np.max([np.nanvar(r.columns(STATES), axis=0) for r in records], axis=0)
        least = 1e-12 * largest + np.finfo(float).tiny
        return list(np.maximum(np.where(known, found, pooled), least))

    def _simulated(
        self, arx: Aerodynamics, records: Sequence[FlightRecord]
    ) -> tuple[Simulated, Array]:
        """The simulated flights in the structure, by least squares, and the variance (6,) left."""
        phi, y = [], []
        for record in records:
            rows = flown_rows(arx, record, self.simulator)
            left = arx.simulated.prepared(self.simulator.flown(record)).columns(arx.outputs)
            known = np.isfinite(rows).all(axis=1) & np.isfinite(left).all(axis=1)
            phi.append(rows[known])
            y.append(left[known])
        F, T = np.vstack(phi), np.vstack(y)
        theta = least_squares(F, T)
        left = np.var(T - F @ theta, axis=0) + 1e-14 * np.var(T, axis=0)
        return Simulated(theta, np.sqrt(np.mean(F**2, axis=0)), np.std(T, axis=0)), left


class FlightNoise(NamedTuple):
    """Variances (8,) of the sensors' noise in one flight, NaN where it is too short, and the
    relative standard error (8,) of each, 0 for given variances.
    """

    variances: Array
    errors: Array


def noise_of_flight(record: FlightRecord, given: Mapping[str, float]) -> FlightNoise:
    """Return the noise of the sensors of u v w p q r phi theta: from the given standard deviations,
    else from the spectrum of the record.
    """
    segments = record.segments()
    found = [
        (given[name] ** 2, 0.0) if name in given else noise_level(_measured(record, name), segments)
        for name in STATES
    ]
    variances, errors = np.array(found).T
    return FlightNoise(variances, errors)


def _measured(record: FlightRecord, name: str) -> Array:
    """Return a signal, NaN where it was bridged."""
    mask = record.meta.get("filled", {}).get(name)
    return record[name] if mask is None else np.where(mask, np.nan, record[name])


def noise_of_part(noise: Noise, arx: Aerodynamics, record: FlightRecord, part: slice) -> Noise:
    """The noise in a part of a record: larger variances (n, 8) of sensors where a sample was
    bridged, and of equations that an input that was bridged enters.
    """
    filled = record.meta.get("filled")
    if filled is None:
        return noise
    R, Q = (np.tile(variances, (len(record), 1)) for variances in (noise.R, noise.Q))
    for i, name in enumerate(STATES):
        if name in filled:
            R[filled[name], i] *= FILLED
    inputs = [filled[name] for name in arx.commands if name in filled]
    for k in np.flatnonzero(np.any(inputs, axis=0)) if inputs else ():
        Q[k : k + arx.memory + 1] = FILLED_INPUT * noise.Q
    return noise._replace(R=R[part], Q=Q[part])


def noise_variance(signal: Array, segments: Sequence[slice]) -> float:
    """Return the variance of white noise with the power that a signal has above 0.8 of the Nyquist
    frequency; 0 where no segment is long enough.
    """
    found, _ = noise_level(signal, segments)
    return found if np.isfinite(found) else 0.0


def noise_level(signal: Array, segments: Sequence[slice]) -> tuple[float, float]:
    """Return the same with its relative standard error; NaN and infinity where no segment is long
    enough.
    """
    power, weight, spread = 0.0, 0.0, 0.0
    for x in _between_holes(signal, segments):
        if len(x) < 32:
            continue
        window = np.hanning(len(x))
        line = np.linspace(x[0], x[-1], len(x))
        spectrum = np.abs(np.fft.rfft((x - line) * window)) ** 2
        high = spectrum[int(NOISE_BAND * len(spectrum)) :]
        power += len(x) * float(np.mean(high)) / float(np.sum(window**2))
        weight += len(x)
        spread += len(x) ** 2 * LINES_PER_ESTIMATE / len(high)
    return (power / weight, float(np.sqrt(spread)) / weight) if weight else (np.nan, np.inf)


def _between_holes(signal: Array, segments: Sequence[slice]) -> Iterator[Array]:
    """Yield what is known of a signal between holes of more than `HOLE` samples. Shorter ones are
    closed, as those of a slower sensor.
    """
    for part in segments:
        rows = part.start + np.flatnonzero(np.isfinite(signal[part]))
        yield from np.split(signal[rows], np.flatnonzero(np.diff(rows) > HOLE + 1) + 1)


def unbroken(arx: Aerodynamics, record: FlightRecord) -> list[slice]:
    """Return stretches in which everything was measured, of sufficient length."""
    names = (*STATES, *arx.inputs, *arx.parameters)
    known = np.isfinite(record.columns(dict.fromkeys(names))).all(axis=1)
    out = []
    for part in record.segments():
        out += [slice(part.start + a, part.start + b) for a, b in runs(np.asarray(known)[part])]
    edge = _edge(arx, record.dt)
    out = [slice(s.start + edge, s.stop - edge) for s in out]
    return [s for s in out if s.stop - s.start > 2 * arx.memory + 1]


def _edge(arx: Aerodynamics, dt: float) -> int:
    """Number of samples at both ends of a stretch that late sensors may move beyond it."""
    late = arx.sensors
    return 0 if late is None else int(np.ceil((abs(late.delay) + FARTHEST * late.deviation) / dt))


class Noise(NamedTuple):
    """Variances of the sensors R (8,) and of the equations Q (8,), of the gust, and what is left of
    a gust after a sample.
    """

    R: Array
    Q: Array
    gust: float
    remains: float

    @classmethod
    def of(cls, R: Array, left: Array, gust: float, remains: float) -> Noise:
        """Of sensors R, equations that leave (6,) and Euler's, which are exact."""
        return cls(R, np.append(left, MODEL_ERROR * R[6:]), gust, remains)

    def driving(self, count: int) -> Array:
        """Variances (count, 3) of what is new in the gust at each sample: at first all of it."""
        out = np.full((count, 3), self.gust * (1 - self.remains**2))
        out[:1] = self.gust
        return out


class Linearized(NamedTuple):
    """The equations at the smoothed states: regressors F (m, n) of the coefficients and D (m, 8, a)
    of the unknowns of actuators, wind and sensors, what is left (m, 8), how it answers errors of
    y(k-i), L_i (m, 8, 8), and of the gust, H (m, 8, 3), and the whitening of it all.
    """

    F: Array
    D: Array
    left: Array
    L: list[Array]
    H: Array
    white: Whitening

    def whitened(self) -> Array:
        """Return the residuals (m, 8), white and of variance 1 if the noise is their only cause."""
        return self.white.whitened(self.left)

    @property
    def regressors(self) -> WhitenedRegressors:
        """The whitened regressors X: those of each equation, of the unknowns, and the residuals as
        the last column.
        """
        return WhitenedRegressors(
            self.white, self.F, np.concatenate([self.D, self.left[:, :, None]], axis=2), 6
        )

    def normal(self) -> tuple[Array, Array]:
        """X' X and X' e of the whitened regressors X (.., 6 n + a), equation by equation, those of
        the unknowns last.
        """
        whole = self.regressors.gram()
        return whole[:-1, :-1], whole[:-1, -1]

    def scores(self) -> Array:
        """Covariance (6 n + a, 6 n + a) of X' e, e correlated over `LAGS` samples (Newey and
        West).
        """
        each = self.regressors.products(self.whitened())[:, :-1]
        parts = (each[start : start + CHUNK] for start in range(0, len(each), CHUNK))
        return long_run_covariance(parts, LAGS)


class Signals(NamedTuple):
    """What acts on a stretch besides its states: inputs behind the velocities u (n, nu - 6), wind
    in the axes of the body (n, 3), p, the basis f (n, size), and how far ahead each state is read
    (8,), s.
    """

    u: Array
    air: Array
    p: Array
    f: Array
    ahead: Array

    @classmethod
    def of(cls, arx: Aerodynamics, record: FlightRecord, part: slice) -> Signals:
        """Signals of the samples of `part` of a record."""
        late = arx.sensors
        ahead = np.array([late.delay if late and name in late.signals else 0.0 for name in STATES])
        s, first = Samples.of(arx, record), len(VELOCITIES)
        air = record.columns(STATES)[part, :3] - s.u[part, :3]
        return cls(s.u[part, first:], air, s.p[part], s.f[part], ahead)


@dataclass(eq=False)
class SmoothedStretch:
    """Measured samples y (n, 8) without a gap, and the states `x` (n, 8) and the gust (n, 3)
    smoothed so far; the other signals `now`, and to both `sides` of each unknown of actuators and
    wind.
    """

    arx: Aerodynamics
    record: FlightRecord
    part: slice
    y: Array
    dt: float
    x: Array
    gust: Array
    now: Signals
    sides: list[tuple[Signals, Signals]]

    @classmethod
    def of(cls, arx: Aerodynamics, record: FlightRecord, part: slice) -> SmoothedStretch:
        """The samples of `part` of a record."""
        y = record.columns(STATES)[part]
        now = Signals.of(arx, record, part)
        return cls(arx, record, part, y, record.dt, y.copy(), np.zeros((len(y), 3)), now, [])

    def follow(self, z: Array) -> None:
        """Let what is measured, and what acts, be that of the unknowns at `z`, in their prior
        deviations.
        """
        if not len(z):
            return
        before = self.now.ahead
        self.now, self.y = self._at(z)
        self.x = _ahead(self.x, self.now.ahead - before, self.dt)
        steps = DIFFERENCE * np.eye(len(z))
        self.sides = [(self._at(z + step)[0], self._at(z - step)[0]) for step in steps]

    def _at(self, z: Array) -> tuple[Signals, Array]:
        """What acts, and the measured states (n, 8), with the unknowns at `z`."""
        there = self.arx.moved(z.tolist())
        record = there.again(self.record, self.arx)
        return Signals.of(there, record, self.part), record.columns(STATES)[self.part]

    def _rows(self, signals: Signals, x: Array) -> Array:
        """Regressors (m, n) at states x (n, 8)."""
        z = x[:, :6].copy()
        z[:, :3] -= signals.air
        u = np.hstack([z, signals.u])
        return regressor_rows(self.arx, z, u, signals.p, signals.f)

    def _equations(self, theta: Array) -> tuple[Array, Array]:
        """Regressors (m, n) at the smoothed states, and what they leave (m, 8)."""
        F = self._rows(self.now, self.x)
        return F, self._left(F, self.x, theta)

    def _left(self, F: Array, x: Array, theta: Array) -> Array:
        """What regressors leave (m, 8) of the increments of states x."""
        left = increments(x, self.dt)[self.arx.memory :]
        left[:, :6] -= F @ theta
        return left

    def _by_unknowns(self, theta: Array) -> Array:
        """D (m, 8, a): what the equations lose by each unknown of actuators, wind and sensors."""
        out = np.zeros((len(self.y) - self.arx.memory, 8, len(self.sides)))
        rate = np.gradient(self.x, self.dt, axis=0)
        for i, (above, below) in enumerate(self.sides):
            sides = []
            for side in (above, below):
                x = self.x + (side.ahead - self.now.ahead) * rate
                sides.append(self._left(self._rows(side, x), x, theta))
            out[:, :, i] = (sides[1] - sides[0]) / (2 * DIFFERENCE)
        return out

    def _sensitivity(self, theta: Array) -> list[Array]:
        """L_i (m, 8, 8): how the error of the equations at k answers an error of y(k-i)."""
        m, first = len(self.y) - self.arx.memory, self.arx.memory
        J, size = kinematic_jacobian(self.x), self.arx.basis.size
        entries = [(row, e) for row, e in enumerate(self.arx.entries) if e.kind == "input"]
        reach = max(e.lag for _, e in entries if e.channel < 6)
        L = [np.zeros((m, 8, 8)) for _ in range(reach + 1)]
        half = 0.5 * self.dt
        L[0] += np.eye(8) - half * J[first:]
        L[1] -= np.eye(8) + half * J[first - 1 : -1]
        f = self.now.f[first:]
        for row, e in entries:
            if e.channel < 6:
                L[e.lag][:, :6, e.channel] -= f @ theta[row * size : (row + 1) * size]
        return L

    def linearized(self, theta: Array, noise: Noise) -> Linearized:
        """With a gust every equation but the first less what remains of the one before: what is
        left of the gust in that is white. The first has the whole gust: without it the balance of
        all samples would count for nothing.
        """
        F, left = self._equations(theta)
        D = self._by_unknowns(theta)
        L, first, n = self._sensitivity(theta), self.arx.memory, len(self.y)
        apart = self.y - self.x
        for i, block in enumerate(L):
            left += np.einsum("kij,kj->ki", block, apart[first - i : n - i])
        own = [np.broadcast_to(np.eye(8), L[0].shape)]
        H = np.zeros((len(F), 8, 3))
        if noise.gust:
            a, size, f = noise.remains, self.arx.basis.size, self.now.f[first:]
            for row, e in enumerate(self.arx.entries):
                if e.kind == "input" and e.channel < 3 and e.lag == 1:
                    H[:, :6, e.channel] -= f @ theta[row * size : (row + 1) * size]
            none = np.zeros_like(L[0])
            L = [_less(now, a * before) for now, before in zip([*L, none], [none, *L], strict=True)]
            F, D, left = _less(F, a * F), _less(D, a * D), _less(left, a * left)
            own = [own[0], _less(none, a * own[0])]
        R = noise.R if noise.R.ndim == 1 else np.vstack([noise.R[:1], noise.R])
        terms: list[tuple[list[Array], Array]] = [(L, R), (own, noise.Q)]
        if noise.gust:
            terms.append(([H], noise.driving(len(F))))
        return Linearized(F, D, left, L, H, Whitening.of(terms))

    def smooth(self, found: Linearized, change: Array, later: Array, noise: Noise) -> None:
        """Adjust the states, and the gust, to fit the equations best with their coefficients moved
        by `change`, and the unknowns by `later`.
        """
        F, D, left, L, H, white = found
        left = left.copy()
        left[:, :6] -= F @ change
        left -= D @ later
        pull = white.adjoint(white.whitened(left))
        moved, n = np.zeros_like(self.y), len(self.y)
        first = n - len(F)
        for i, block in enumerate(L):
            row = max(i - first, 0)  # a lag that the first equation does not have
            moved[first - i + row : n - i] += np.einsum("kij,ki->kj", block[row:], pull[row:])
        self.x = self.y - moved * noise.R
        if noise.gust:
            drive = np.einsum("kij,ki->kj", H, pull) * noise.driving(len(H))
            self.gust[first - 1 : -1] = lfilter([1.0], [1.0, -noise.remains], drive, axis=0)

    def residual(self, theta: Array) -> Array:
        """Covariance (6, 6) of what one step leaves, measured to measured."""
        u = np.hstack([self.y[:, :6], self.now.u])
        u[:, :3] -= self.now.air
        F = regressor_rows(self.arx, u, u, self.now.p, self.now.f)
        e = increments(self.y, self.dt)[self.arx.memory :, :6] - F @ theta
        return e.T @ e / max(len(e) - F.shape[1], 1)


def _unknown_wind(wind: Mapping[str, tuple[float, float]]) -> tuple[Warning, ...]:
    """The remark on a wind that the flights do not tell."""
    wide = [f"{name} {value:.1f} +- {size:.1f}" for name, (value, size) in wind.items()]
    if all(size <= WIND_DETERMINED for _, size in wind.values()):
        return ()
    return (
        DataWarning(
            f"the flights do not tell the wind (m/s: {', '.join(wide)}), and with it not at which"
            " airspeed a coefficient holds: fly a second heading, or measure the airspeed"
        ),
    )


def _less(now: Array, before: Array) -> Array:
    """Rows (m, ...) of `now`, each but the first less the row of `before` in front of it."""
    return np.concatenate([now[:1], now[1:] - before[:-1]])


def _ahead(x: Array, by: Array, dt: float) -> Array:
    """Return states (n, 8) as they are later, each `by` (8,) seconds, held at the ends."""
    if not by.any():
        return x
    time = dt * np.arange(len(x))
    later = [np.clip(time + late, time[0], time[-1]) for late in by]
    return np.column_stack([CubicSpline(time, c)(at) for c, at in zip(x.T, later, strict=True)])


def _solved(normal: Array, right: Array) -> tuple[Array, Array]:
    """Return solution and inverse of normal equations, scaled to a unit diagonal."""
    scale = np.sqrt(np.diag(normal))
    scale = np.where(scale > 0, scale, 1.0)
    factor = cho_factor(normal / np.outer(scale, scale), lower=True)
    lower = np.tril(dpotri(*factor)[0])
    inverse = (lower + np.tril(lower, -1).T) / np.outer(scale, scale)
    return cho_solve(factor, right / scale) / scale, inverse
