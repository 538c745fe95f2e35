"""Validation of an identified model, with its noise model, on a flight not used to identify it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from identification.design.criterion import Criterion, concluded, judged, missed
from identification.estimators.filter_error import (
    Noise,
    SmoothedStretch,
    noise_of_flight,
    noise_of_part,
    unbroken,
)
from identification.estimators.residual_power import BANDS, WINDOW, window_powers
from identification.model.kinematic_model import KinematicModel
from identification.structure.kinematic_arx import STATES
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.records.mending import bridged
from symheli.values.arrays import Array

SURE = 3.0
"""Acceptance threshold, in standard deviations of the noise power."""

LEVEL = 0.01
"""Probability that a flight of the same vehicle exceeds what the flights used to identify left in
one of the bands.
"""

FEWEST = 4
"""Least number of windows from which the spread between windows is estimated."""

SHORTEST = 0.25
"""Shortest stretch judged by bands, as a fraction of a window."""


class ResidualBand(NamedTuple):
    """Residual power of one equation between two frequencies (Hz), relative to the most that the
    flights used to identify make likely.

    Examples
    --------
    >>> from identification.judge.unseen_flight import ResidualBand
    >>> print(ResidualBand("w", 0.0, 1.0, 640.0))
    w, 0 to 1 Hz
    """

    equation: str
    low: float
    high: float
    ratio: float

    def __str__(self) -> str:
        return f"{self.equation}, {self.low:g} to {self.high:g} Hz"


@dataclass(frozen=True, kw_only=True)
class UnseenFlight:
    """Residual power of a model on a flight, relative to the power that its noise explains: `power`
    over all whitened equations together, `largest`: acceptance threshold, `samples`: number of
    samples used. `bands`: those above what the flights used to identify make likely, worst first.

    Examples
    --------
    >>> import identification as idn
    >>> from identification.judge.unseen_flight import UnseenFlight
    >>> print(UnseenFlight(power=1.4, largest=1.05, samples=2000))
    criterion       value  threshold     verdict
    residual power  1.4    at most 1.05  violated
    verdict: not fit
    """

    power: float
    largest: float
    samples: int
    bands: tuple[ResidualBand, ...] = ()

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """The residual power, then the bands."""
        bands = (judged(str(band), band.ratio, 1.0) for band in self.bands)
        return judged("residual power", self.power, self.largest), *bands

    @property
    def explained(self) -> bool:
        """Whether the residual power is within the acceptance threshold, in every band too."""
        return not missed(self.criteria)

    def __str__(self) -> str:
        return concluded(self.criteria)

    def require(self) -> None:
        """Raise `InputError` if the model does not explain the flight."""
        if not self.explained:
            raise InputError(
                f"the model does not explain this flight ({'; '.join(missed(self.criteria)[:4])}):"
                " no certificate about it holds for this vehicle as it flew; identify from this"
                " flight too, or find out what has changed"
            )


def validate(model: KinematicModel, record: FlightRecord) -> UnseenFlight:
    """Validate a model on a flight it was not identified from, by the chi-squared statistic of its
    equations, whitened by the covariance of sensor noise, of what the structure leaves out and of
    the errors of the coefficients; and band by band of each equation against windows of 20 s of
    the flights used to identify, as they left it.

    The noise level of the sensors is estimated from the spectrum of this flight, as it was for the
    flights used to identify, unless `FilterError` was given it; both thresholds allow for the error
    of that estimate. The logarithm of the power in a band is taken to be Gaussian over windows: a
    band is above what is likely at Student's quantile for a probability of 1 % in all bands
    together. With fewer than four windows, and for flights shorter than 5 s, bands are not judged.

    Parameters
    ----------
    model : KinematicModel
        Fitted by `FilterError`, which says how large both are.
    record : FlightRecord
        With the signals of the model, at its sample period.

    Returns
    -------
    UnseenFlight
        `.explained`, or `.require()`.

    Raises
    ------
    InputError
        A model of another method, a record of another sample period or without a complete second.

    References
    ----------
    Smith and Doyle (1992), Model validation: a connection between robust control and
    identification, IEEE Trans. Automatic Control 37, for the question; Ljung (1999), sec. 16.6, for
    the test.

    Examples
    --------
    >>> import identification as idn, symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> wrong = symheli.Helicopter.load("xcell_kahn_hudson", governor="ideal")
    >>> ramps = symheli.AirspeedSchedule((6.0, 2.0), (1.5, 1.5), (2.0, 2.0), start=2.0)
    >>> excited = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01))
    >>> flights = [
    ...     symheli.fly(vehicle, ramps, noise_db=30.0, seed=seed, excitation=excited)
    ...     for vehicle, seed in ((heli, 1), (heli, 2), (wrong, 3))]
    >>> kin = idn.KinematicARX(heli.inputs, "airspeed_command", basis=idn.Polynomial(1, 2.0, 6.0))
    >>> method = idn.methods.FilterError(symheli.flight.SimulatedFlight(wrong))
    >>> model = idn.fit(kin, flights[0], method=method)
    >>> [idn.judge.validate(model, flight).explained for flight in flights[1:]]
    [True, False]
    """
    details = model.details
    if "sensor_noise" not in details:
        raise InputError(
            f"method {model.method!r} does not say how large the noise is: fit by FilterError"
        )
    aero = model.structure.aerodynamics
    prepared = aero.prepared(bridged(record, STATES))
    model.aerodynamics.require_same_kind(prepared)
    pooled = np.array([details["sensor_noise"][s] for s in STATES]) ** 2
    given = details.get("sensor_noise_given", ())
    found = noise_of_flight(prepared, {s: details["sensor_noise"][s] for s in given})
    told = np.isfinite(found.variances)
    R = np.where(told, found.variances, pooled)
    left = np.array(details["equation_variances"])[:6]
    air = details["gust"] ** 2, details["gust_remains"]
    noise = Noise.of(R, left, *air)
    covariance = model.covariance
    assert covariance is not None  # noqa: S101  what says its noise says this too
    C = covariance.reshape(model.theta.size, -1)
    power, unknown, spread, count, samples = 0.0, 0.0, 0.0, 0, 0
    residuals = []
    louder = np.zeros(len(R))  # how much less is left where one sensor is louder by its error
    errors = np.where(told, found.errors, 0.0)
    for part in unbroken(aero, prepared):
        s = SmoothedStretch.of(aero, prepared, part)
        equations = s.linearized(model.theta, noise_of_part(noise, aero, prepared, part))
        white = equations.whitened()
        residuals.append(white)
        power += float(np.sum(white**2))
        known = equations.normal()[0] @ C  # what errors of the coefficients add
        unknown, spread = unknown + np.trace(known), spread + np.sum(known * known.T)
        for i in np.flatnonzero(errors):
            other = Noise.of(R * (1 + errors[i] * (np.arange(len(R)) == i)), left, *air)
            other = noise_of_part(other, aero, prepared, part)
            louder[i] += np.sum(white**2) - np.sum(s.linearized(model.theta, other).whitened() ** 2)
        count, samples = count + white.size, samples + len(white)
    if samples * model.dt < 1.0:
        raise InputError("the record is shorter than 1 s; record longer")
    chance = SURE * float(np.sqrt(2 * (count + spread) + np.sum(louder**2)))
    largest = (count + float(unknown) + chance) / count
    return UnseenFlight(
        power=power / count,
        largest=largest,
        samples=samples,
        bands=_unlikely(np.array(details.get("residual_windows", ())), residuals, model.dt, errors),
    )


def _unlikely(
    known: Array, residuals: Sequence[Array], dt: float, errors: Array
) -> tuple[ResidualBand, ...]:
    """Return the bands of residuals (m, 8) above what `known` powers (windows, bands, 8) make
    likely; `errors` (8,): relative ones of the noise variances of this flight.
    """
    length = min(WINDOW, max(map(len, residuals)) * dt)
    if len(known) < FEWEST or length < SHORTEST * WINDOW:
        return ()
    found = np.log(window_powers(residuals, dt, length).mean(axis=0))
    n, before = len(known), np.log(known)
    seconds = sum(map(len, residuals)) * dt
    variance = np.var(before, axis=0, ddof=1) * (WINDOW / length + 1.0 / n)
    variance += errors**2 * (1.0 + seconds / (n * WINDOW))
    limit = before.mean(axis=0) + student.isf(LEVEL / found.size, n - 1) * np.sqrt(variance)
    above = np.exp(found - limit)
    edges = 0.5 / dt * np.array(BANDS)
    return tuple(
        ResidualBand(STATES[i], float(edges[band]), float(edges[band + 1]), float(above[band, i]))
        for band, i in sorted(np.argwhere(above > 1.0).tolist(), key=lambda at: -above[tuple(at)])
    )
