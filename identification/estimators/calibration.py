"""Calibration: physical parameters of a vehicle from flights, by output error over windows."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular

from identification.model.symmetric_root import symmetric_root
from identification.structure.actuators import CONTROLS, SETTLING, Actuators, pieces
from symheli import Helicopter, trim
from symheli.airframe.written import as_toml
from symheli.errors import (
    ConvergenceWarning,
    DataWarning,
    InputError,
    SymheliError,
)
from symheli.flight import ServoBank
from symheli.helicopter import require
from symheli.integrate import RungeKutta4, Trajectory, simulate, tangent
from symheli.physics.attitude import euler_state, flight_state
from symheli.progress import task
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.kinematics import RIGID_BODY
from symheli.values.numbers import positive, whole
from symheli.values.signal import Signal, indices
from symheli.values.summary import summarized
from symheli.values.whole_files import write_text

PRIOR = 0.5
"""Standard deviation of the logarithm of a parameter for which the vehicle file states none: what
separates two helicopters of one class.
"""

STAGES = ((0.4, 1.2), (0.2, 0.4, 0.8, 1.6))
"""Lengths of the windows before the last ones, s: a wrong vehicle stays near the record only for a
short time. Where the first leave residuals that are no noise, the search begins again by the next:
the equations have kinks, at which a search can end early.
"""

CRAMER_RAO_LIMIT = 0.2
"""Largest relative standard deviation of a parameter that counts as determined (Tischler and Remple
(2012), Aircraft and Rotorcraft System Identification, sec. 12.3.3).
"""

INFORMED = 0.5
"""A parameter counts as determined only if the flights brought its standard deviation below this
fraction of the prior's.
"""

TIED = 0.9
"""Correlation above which two parameters are known only together (ibid.)."""

START_DEVIATION = {"m/s": 10.0, "rad/s": 3.0, "rad": 0.3}
"""Prior standard deviation of an initial state that is not measured, by its unit; another unit: as
much as its trim value, at least 1.
"""

LARGEST_DAMPING = 1e8
"""Damping, relative to the information, above which no step is tried."""

TINY = 1e-24
"""Smallest mean square that is divided by, in SI units."""

DRAWS_TRIED = 50
"""Number of draws tried for each requested one."""

WHITE = 0.3
"""Correlation of residuals from sample to sample above which the model leaves something out."""

SETTLED = 1e-3
"""Newton decrement, the gain in log density that is left, at which the search has converged: every
parameter is then within a twentieth of its standard deviation of the optimum.
"""

ROUNDS = 40
"""Largest number of Gauss-Newton steps at each length of the windows."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration:
    """The vehicle that explains flights best, and how well they determine its parameters.

    Parameters
    ----------
    heli : Helicopter
        With the calibrated parameters.
    start : Helicopter
        From which the search began; its values are the prior's.
    parameters : tuple of Signal
        The k parameters that were free.
    values, deviations : array (k,)
        Calibrated values and their standard deviations, SI.
    prior_deviations : array (k,)
        Those before the flights, SI.
    correlation : array (k, k)
        Of the errors of the values.
    actuators : dict of str to (float, float)
        Value and standard deviation of the "delay" (s) and of the factor of the servos'
        "bandwidth", where they were estimated.
    noise : dict of str to float
        Standard deviation of each output's residual, SI.
    whiteness : dict of str to float
        Correlation of each output's residuals from sample to sample: near 0 where the model leaves
        only white noise.
    windows, window : int, float
        How many windows of how many seconds.
    steps : int
        Gauss-Newton steps.
    converged : bool
        Whether the search ended where its steps were small.
    """

    heli: Helicopter
    start: Helicopter
    parameters: tuple[Signal, ...]
    values: Array
    deviations: Array
    prior_deviations: Array
    correlation: Array
    actuators: dict[str, tuple[float, float]]
    noise: dict[str, float]
    whiteness: dict[str, float]
    windows: int
    window: float
    steps: int
    converged: bool

    __repr__ = summarized
    _repr_html_ = as_table

    @property
    def determined(self) -> Array:
        """Mask (k,) of the parameters that the flights determine: relative standard deviation at
        most 20 %, and less than half of what it was before.
        """
        return (self.deviations <= CRAMER_RAO_LIMIT * np.abs(self.values)) & (
            self.deviations <= INFORMED * self.prior_deviations
        )

    def draws(self, count: int, seed: int = 0) -> list[Helicopter]:
        """`count` helicopters whose parameters are drawn from the distribution of the errors: what
        the truth may be. Logarithms of the parameters are normally distributed; bodies that cannot
        be are left out.
        """
        relative = self.deviations / self.values
        root = relative[:, None] * symmetric_root(self.correlation)
        rng = np.random.default_rng(seed)
        names = [str(p) for p in self.parameters]
        drawn: list[Helicopter] = []
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DataWarning)
            for z in rng.standard_normal((DRAWS_TRIED * whole(count, "count", 1), len(names))):
                values = self.values * np.exp(root @ z)
                try:
                    changes = dict(zip(names, values.tolist(), strict=True))
                    drawn.append(self.heli.with_parameters(changes))
                except InputError:  # no such body, as one with Izz > Ixx + Iyy
                    continue
                if len(drawn) == count:
                    return drawn
        raise InputError(
            "nearly all helicopters within these deviations are impossible: free fewer parameters,"
            " or state deviations in the vehicle file"
        )

    @property
    def coloured(self) -> tuple[str, ...]:
        """Outputs whose residuals are no white noise: something acts that the equations leave out,
        such as wind, servos or a sensor's lag.
        """
        return tuple(name for name, r in self.whiteness.items() if abs(r) > WHITE)

    @property
    def tied(self) -> dict[str, str]:
        """For each parameter that is not determined the one whose error is correlated most with
        its own, where that is above .9: the flights tell the two only together.
        """
        off = np.abs(self.correlation) - np.eye(len(self.parameters))
        return {
            str(p): str(self.parameters[int(off[i].argmax())])
            for i, p in enumerate(self.parameters)
            if not self.determined[i] and off[i].max(initial=0.0) > TIED
        }

    def __str__(self) -> str:
        rows = [("parameter", "before", "calibrated", "deviation", "unit", "")]
        for i, p in enumerate(self.parameters):
            word = "determined" if self.determined[i] else "not determined"
            other = self.tied.get(str(p))
            rows.append(
                (
                    str(p),
                    f"{self.start.parameters[p]:.4g}",
                    f"{self.values[i]:.4g}",
                    f"{self.deviations[i]:.2g}",
                    p.unit,
                    word if other is None else f"{word}, only together with {other}",
                )
            )
        widths = [max(len(row[i]) for row in rows) for i in range(5)]
        lines = [
            "  ".join([*(c.ljust(w) for c, w in zip(row, widths, strict=False)), row[5]]).rstrip()
            for row in rows
        ]
        units = {"delay": " s", "bandwidth": " times the given one"}
        lines += [
            f"{name} of the actuators: {value:.4g} +- {deviation:.2g}{units[name]}"
            for name, (value, deviation) in self.actuators.items()
        ]
        residuals = ", ".join(
            f"{name} {sd:.2g} {Signal(name).unit} ({self.whiteness[name]:+.2f})"
            for name, sd in self.noise.items()
        )
        lines += [
            "",
            f"{self.windows} windows of {self.window:g} s; residuals, with their correlation from"
            f" sample to sample: {residuals}",
        ]
        if self.coloured:
            lines.append(f"{self._doubt[0].upper()}{self._doubt[1:]}.")
        if not self.converged:
            lines.append("The search had not converged: the deviations may be too small.")
        return "\n".join(lines)

    @property
    def _doubt(self) -> str:
        return (
            f"the residuals of {', '.join(self.coloured)} are no white noise: wind (gust=...),"
            " servos, delay or a sensor acts that the equations leave out, and the deviations are"
            " too small"
        )

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the calibrated vehicle file, with the standard deviation of every free parameter;
        `Helicopter.load` reads it, and another calibration takes the deviations as its prior.
        """
        write_text(Path(path), as_toml(self.heli.vehicle))
        return Path(path)


def calibrate(
    heli: Helicopter,
    records: FlightRecord | Sequence[FlightRecord],
    parameters: Sequence[str] | None = None,
    *,
    window: float = 3.0,
    gust: float = 0.0,
    actuators: Actuators | None = None,
    step: float = 0.01,
    rounds: int = ROUNDS,
) -> Calibration:
    """Find the physical parameters of a vehicle with which the nonlinear equations of motion follow
    flights best.

    The record is cut into windows; in each the equations run free from an initial state that is
    estimated too. The parameters, initial states and noise levels of largest posterior density are
    found by Gauss-Newton steps with exact sensitivities; the prior is the vehicle file: its values,
    with their stated deviations, or else a factor of 1.65. What flights do not tell stays at the
    prior. The flight may be in closed loop, as long as the deflections of the controls are
    recorded. With `gust` a wind, constant over each window, is estimated too.

    Parameters
    ----------
    heli : Helicopter
        The vehicle as it is known before, with the governor that flew.
    records : FlightRecord or sequence of them
        With d_lon, d_lat, d_col, d_ped (deflections, rad) and any of u, v, w, p, q, r, phi, theta
        (and Om), sampled evenly; NaN marks a missing measurement.
    parameters : sequence of str, optional
        Names from `heli.parameters` that are free; default all the flight's equations depend on,
        but the density of the air, numbers of blades and limits of the controls.
    window : float
        Length over which the equations run free, s.
    gust : float
        Standard deviation of the wind in each direction, m/s; 0: still air.
    actuators : Actuators, optional
        Delay and servos, known or not quite; the record then holds commands, as d_lon_command, ...
        (or d_lon, ...), in place of deflections.
    step : float
        Of the integration, s.
    rounds : int
        Largest number of Gauss-Newton steps at each length of windows.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError
        An unknown parameter, one that is not positive, a record without inputs or outputs, or
        shorter than a window.
    SymheliError
        The equations leave the range of numbers even over short windows.

    Warns
    -----
    ConvergenceWarning
        The search ended before its steps were small.
    DataWarning
        The residuals are no white noise: the equations leave something out.

    See Also
    --------
    identification.fit : coefficients from records
    symheli.Helicopter : the equations with numbers

    References
    ----------
    Jategaonkar (2015), Flight Vehicle System Identification, ch. 4; multiple shooting: Bock (1983).

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> lqr = symheli.flight.gain_scheduled_lqr(heli, 0.0, 8.0, 0.02)
    >>> schedule = symheli.AirspeedSchedule.transition(0.0, 6.0, acceleration=2.0, hold=1.0)
    >>> shaken = symheli.Excitation({"d_lon": 0.01, "d_lat": 0.01}, "multisine", (0.1, 4.0), seed=1)
    >>> flight = symheli.fly(heli, schedule, controller=lqr, excitation=shaken, noise_db=30.0)
    >>> wrong = heli.with_parameters({"body.Ixx": 0.25, "body.Iyy": 0.25})
    >>> found = idn.calibrate(wrong, flight, ["body.Ixx", "body.Iyy"])
    >>> bool(abs(found.heli.parameters["body.Ixx"] - heli.parameters["body.Ixx"]) < 0.01)
    True
    """
    require(heli, "calibrate(heli, records)")
    flights = [records] if isinstance(records, FlightRecord) else list(records)
    positive(window, "window")
    whole(rounds, "rounds", 1)
    free = _free(heli, parameters)
    outputs = _outputs(heli, flights, actuators)
    if not 0.0 <= gust < np.inf:
        raise InputError(f"gust: expected a standard deviation >= 0 in m/s, got {gust!r}")
    search = _GaussNewton(heli, free, outputs, float(step), float(gust), actuators)
    found, cost = None, np.inf
    for stages in STAGES:
        lengths = [*(s for s in stages if s < window), window]
        theta, steps, converged = np.zeros(search.size), 0, False
        with warnings.catch_warnings(), task("calibrating", len(lengths)) as progress:
            warnings.simplefilter("ignore", DataWarning)  # of vehicles on the way
            for length in lengths:
                search.cut(flights, length, theta)
                theta, used, converged = search.settle(theta, rounds)
                steps += used
                progress.step(f"windows of {length:g} s, {used} steps")
            least = search.cost(theta, [w.start for w in search.windows])[0]
            if least < cost:
                found, cost = search.result(theta, window, steps, converged), least
        if found is not None and found.converged and not found.coloured:
            break
    assert found is not None  # noqa: S101  every search ends at a finite cost, or raises
    if not found.converged:
        warnings.warn(
            f"calibration stopped after {found.steps} Gauss-Newton steps; allow more rounds, free"
            " fewer parameters or fly longer",
            ConvergenceWarning,
            stacklevel=2,
        )
    if found.coloured:
        warnings.warn(found._doubt, DataWarning, stacklevel=2)
    return found


def _free(heli: Helicopter, wanted: Sequence[str] | None) -> tuple[Signal, ...]:
    known = heli.parameters.signals
    if wanted is not None:
        chosen = tuple(known[i] for i in indices(wanted, known, "parameter"))
        for p in chosen:
            if not heli.parameters[p] > 0:
                raise InputError(
                    f"{p} is {heli.parameters[p]:g}: only positive parameters are calibrated; set a"
                    " first guess with with_parameters"
                )
            if p.startswith("controls.") or p == "density":
                raise InputError(f"{p} is not calibrated: it is no parameter of the airframe")
        return chosen
    entries = heli.vehicle.entries

    def counts(name: str) -> bool:
        section, _, entry = name.partition(".")
        return entries[section][entry].least is not None

    return tuple(
        p
        for p in known
        if p != "density"
        and not p.startswith("controls.")
        and heli.parameters[p] > 0
        and not counts(p)
    )


def _inputs(record: FlightRecord, actuators: Actuators | None) -> list[str]:
    """Deflections, or commands where actuators follow."""
    if actuators is None:
        return list(CONTROLS)
    return [f"{u}_command" if f"{u}_command" in record.signals else u for u in CONTROLS]


def _outputs(
    heli: Helicopter, flights: Sequence[FlightRecord], actuators: Actuators | None
) -> tuple[str, ...]:
    if not flights:
        raise InputError("no flights: give at least one FlightRecord")
    if actuators is not None:
        actuators.require(CONTROLS)
    able = [str(s) for s in heli.states if s in RIGID_BODY]
    if heli.governor == "pi":
        able.append("Om")
    for record in flights:
        if missing := [u for u in _inputs(record, actuators) if u not in record.signals]:
            raise InputError(
                f"the record has no {', '.join(missing)}: calibration needs the deflection of every"
                f" control (rad); it has {', '.join(map(str, record.signals))}"
            )
    found = tuple(name for name in able if all(name in r.signals for r in flights))
    if not found:
        raise InputError(f"the records share none of the outputs {', '.join(able)}")
    return found


@dataclass
class _Window:
    """Measured outputs (n+1, ny), which rows of which piece its inputs are, and what is estimated
    of this window alone, with its prior mean: the initial state (nx,) in Euler form, and the wind
    (3,) where it blows.
    """

    y: Array
    piece: int
    rows: slice
    start: Array
    mean: Array


@dataclass(frozen=True)
class _Linearized:
    """A window's least-squares problem with its own unknowns eliminated: information (k, k) and
    score (k,) of the parameters, and what moves its unknowns.
    """

    information: Array
    score: Array
    root: Array
    own: Array
    coupling: Array

    def start_change(self, move: Array) -> Array:
        """Change of the window's own unknowns that goes with a move of the parameters (k,)."""
        return solve_triangular(self.root, self.own - self.coupling @ move)


class _GaussNewton:
    """Gauss-Newton steps in the logarithms of the parameters, in units of their prior deviations,
    and in the unknowns of every window.
    """

    def __init__(
        self,
        heli: Helicopter,
        free: tuple[Signal, ...],
        outputs: tuple[str, ...],
        step: float,
        gust: float,
        actuators: Actuators | None,
    ):
        self.heli, self.free, self.outputs = heli, free, outputs
        self.method = RungeKutta4(step)
        self.at = indices(free, heli.parameters.signals, "parameter")
        self.seen = indices(outputs, heli.states, "state")
        stated = [heli.vehicle.quantities[str(p)] for p in free]
        self.spread = np.array([q.deviation / q.value if q.deviation else PRIOR for q in stated])
        hidden = [s not in outputs for s in heli.states]
        trimmed = self._trimmed(heli, 0.0)
        self.nx = len(heli.states)
        self.winds = 3 if gust else 0
        own = [
            1 / (START_DEVIATION.get(str(s.unit)) or max(abs(x), 1.0)) if h else 0.0
            for s, x, h in zip(heli.states, trimmed.tolist(), hidden, strict=True)
        ]
        self.weight = np.array([*own, *[1 / gust for _ in range(self.winds)]])
        self.actuators = actuators
        self.k = len(free)
        self.size = self.k + len(actuators.unknown if actuators else ())
        self.commands: list[Array] = []
        self.windows: list[_Window] = []
        self.dt = 0.0
        self.noise = np.zeros(0)

    def inputs_at(self, theta: Array) -> list[Array]:
        """Deflections (n, 4) of every piece, at the actuators' part of theta."""
        if self.actuators is None:
            return self.commands
        point = self.actuators.point(theta[self.k :].tolist())
        return [
            self.actuators.deflections(c, self.dt, controls=CONTROLS, **point)
            for c in self.commands
        ]

    def input_changes(self, theta: Array) -> list[Array]:
        """Derivative (n, 4, unknown) of the deflections of every piece: they are smooth in both."""
        changes = []
        for i in range(self.k, self.size):
            step = np.zeros(self.size)
            step[i] = 1e-3
            both = [self.inputs_at(theta + sign * step) for sign in (1, -1)]
            changes.append([(a - b) / 2e-3 for a, b in zip(*both, strict=True)])
        if not changes:
            return [np.zeros((*c.shape, 0)) for c in self.commands]
        return [np.stack(piece, axis=-1) for piece in zip(*changes, strict=True)]

    def at_point(self, theta: Array) -> Helicopter:
        """The helicopter with the parameters theta (k,), and what follows them left out."""
        values = self.heli.parameters.array[self.at] * np.exp(self.spread * theta[: self.k])
        return self.heli.with_parameters(
            dict(zip(map(str, self.free), values.tolist(), strict=True))
        )

    # --- windows ---------------------------------------------------------------------------------

    def cut(self, flights: Sequence[FlightRecord], length: float, theta: Array) -> None:
        """Cut windows of `length` seconds from all unbroken pieces of the flights."""
        periods = {record.dt for record in flights}
        if len(periods) > 1:
            raise InputError(f"the records have sample periods {sorted(periods)} s; resample them")
        self.dt = periods.pop()
        samples = max(round(length / self.dt), 1)
        heli, self.windows, self.commands = self.at_point(theta), [], []
        settled = round(SETTLING / self.dt) if self.actuators else 0
        trims: dict[int, Array] = {}
        for record in flights:
            y = record.columns(self.outputs)
            u = record.columns(_inputs(record, self.actuators))
            for piece in pieces(record, u):
                self.commands.append(self._followed(u[piece.start : piece.stop]))
                for first in range(piece.start + settled, piece.stop - samples, samples):
                    part = y[first : first + samples + 1]
                    if not np.isfinite(part).any(axis=0).all():
                        continue
                    mean = self._start(heli, part, trims)
                    start = mean.copy()
                    known = np.isfinite(part[0])
                    start[np.array(self.seen)[known]] = part[0, known]
                    rows = slice(first - piece.start, first - piece.start + samples)
                    self.windows.append(_Window(part, len(self.commands) - 1, rows, start, mean))
        if not self.windows:
            raise InputError(
                f"no unbroken piece of the records is as long as a window of {length:g} s"
            )

    def _followed(self, commands: Array) -> Array:
        """Commands as servos follow them: limited, quantised, no faster than they are."""
        if self.actuators is None or self.actuators.servos is None:
            return commands
        bank = ServoBank(self.actuators.servos, CONTROLS, self.heli.travel, self.dt)
        return bank.follow(commands)

    def _start(self, heli: Helicopter, y: Array, trims: dict[int, Array]) -> Array:
        """States of level flight near the measured airspeed: where hidden states probably are."""
        ahead = y[:, self.outputs.index("u")] if "u" in self.outputs else np.zeros(1)
        airspeed = max(round(float(np.nanmean(ahead))), 0)
        if airspeed not in trims:
            trims[airspeed] = self._trimmed(heli, airspeed)
        return np.concatenate([trims[airspeed], np.zeros(self.winds)])

    @staticmethod
    def _trimmed(heli: Helicopter, airspeed: float) -> Array:
        found = trim(heli, airspeed=float(airspeed), throw=False).x.array
        return np.where(np.isfinite(found), found, 0.0)

    # --- one window ------------------------------------------------------------------------------

    def _flown(
        self, heli: Helicopter, window: _Window, start: Array, inputs: list[Array]
    ) -> Trajectory:
        wind = start[self.nx :] if self.winds else np.zeros(3)
        x0 = flight_state(start[: self.nx])
        u = inputs[window.piece][window.rows]
        return simulate(heli, x0, u, wind, dt=self.dt, method=self.method)

    def _residuals(self, window: _Window, flown: Trajectory) -> Array:
        """Measured minus computed outputs (n+1, ny), 0 where nothing was measured."""
        r = window.y - euler_state(flown.states)[:, self.seen]
        return np.where(np.isfinite(window.y), r, 0.0)

    def linearized(
        self, heli: Helicopter, window: _Window, inputs: list[Array], changes: list[Array]
    ) -> _Linearized:
        """The window's least-squares problem about its initial state and these parameters."""
        nx, own, k = self.nx, len(window.start), self.size
        flown = self._flown(heli, window, window.start, inputs)
        dx0 = np.zeros((len(heli.flight_states), own + k))
        dx0[:, :nx] = _from_euler(window.start[:nx])
        dwind = np.zeros((len(flown.inputs), 3, own + k))
        dwind[:, : self.winds, nx:own] = np.eye(self.winds)
        dp = np.zeros((len(heli.parameters), own + k))
        dp[self.at, own + np.arange(self.k)] = heli.parameters.array[self.at] * self.spread
        du = np.zeros((len(flown.inputs), 4, own + k))
        du[:, :, own + self.k :] = changes[window.piece][window.rows]
        change = tangent(heli, flown, dx0=dx0, du=du, dwind=dwind, dp=dp)
        seen = _to_euler(flown.states, change)[:, self.seen]
        seen = np.where(np.isfinite(window.y)[:, :, None], seen, 0.0) / self.noise[:, None]
        r = self._residuals(window, flown) / self.noise
        J = seen.reshape(-1, own + k)
        A = np.vstack([J[:, :own], np.diag(self.weight)])
        b = np.concatenate([r.ravel(), self.weight * (window.mean - window.start)])
        Q, R = np.linalg.qr(A)
        P, C, c = J[:, own:], Q[: len(J)].T @ J[:, own:], Q.T @ b
        return _Linearized(P.T @ P - C.T @ C, P.T @ r.ravel() - C.T @ c, R, c, C)

    # --- the search ------------------------------------------------------------------------------

    def settle(self, theta: Array, rounds: int) -> tuple[Array, int, bool]:
        """Levenberg-Marquardt steps until they are small: parameters, number of steps, and whether
        they are.
        """
        damping, starts = 1.0, [w.start for w in self.windows]
        cost, self.noise = self.cost(theta, starts)
        if not np.isfinite(cost):
            raise SymheliError(
                f"the equations of {self.heli.vehicle.title} leave the range of numbers within"
                " short windows of the flights: start from a vehicle nearer to the one flown"
            )
        with task("Gauss-Newton steps") as progress:
            for used in range(1, rounds + 1):
                problems, H, g = self.normal(theta)
                left = 0.5 * float(g @ np.linalg.solve(H, g))
                left += 0.5 * sum(float(problem.own @ problem.own) for problem in problems)
                if left < SETTLED:
                    return theta, used, True
                lower, move, noise = np.inf, np.zeros_like(theta), self.noise
                while not lower < cost:
                    if damping > LARGEST_DAMPING:  # no step of any size is better
                        return theta, used, True
                    move = np.linalg.solve(H + damping * np.eye(len(theta)), g)
                    starts = [
                        window.start + problem.start_change(move) / (1.0 + damping)
                        for window, problem in zip(self.windows, problems, strict=True)
                    ]
                    lower, noise = self.cost(theta + move, starts)
                    damping *= 0.2 if lower < cost else 5.0
                theta, cost, self.noise = theta + move, lower, noise
                for window, start in zip(self.windows, starts, strict=True):
                    window.start = start
                progress.step(f"log density {left:.2g} below its optimum")
        return theta, rounds, False

    def normal(self, theta: Array) -> tuple[list[_Linearized], Array, Array]:
        """The windows' problems, and the information (k, k) and score (k,) of the posterior."""
        heli, inputs = self.at_point(theta), self.inputs_at(theta)
        changes = self.input_changes(theta)
        problems = [self.linearized(heli, window, inputs, changes) for window in self.windows]
        H = np.eye(len(theta)) + sum(problem.information for problem in problems)
        return problems, H, sum(problem.score for problem in problems) - theta

    def cost(self, theta: Array, starts: Sequence[Array]) -> tuple[float, Array]:
        """Minus the logarithm of the posterior density with the likeliest noise levels, and these
        (ny,); infinite where a flight leaves the range of numbers or a parameter is impossible.
        """
        try:
            every = self._every(theta, starts)
        except SymheliError:
            return np.inf, self.noise
        counts, power = self._counts(), sum((r**2).sum(axis=0) for r in every)
        noise = np.sqrt(np.maximum(power / counts, TINY))
        total = float(theta @ theta) + 2.0 * float(counts @ np.log(noise))
        for window, start in zip(self.windows, starts, strict=True):
            total += float(np.sum((self.weight * (start - window.mean)) ** 2))
        return 0.5 * total, noise

    def levels(self, theta: Array) -> tuple[Array, Array]:
        """Standard deviation (ny,) of each output's residual, and its correlation (ny,) from sample
        to sample.
        """
        every = self._every(theta, [w.start for w in self.windows])
        counts = self._counts()
        unknowns = len(theta) + len(self.windows) * len(self.weight)
        left = max(1 - unknowns / counts.sum(), 0.1)
        power = sum((r**2).sum(axis=0) for r in every)
        lagged = sum((r[1:] * r[:-1]).sum(axis=0) for r in every)
        return np.sqrt(np.maximum(power / counts / left, TINY)), lagged / np.maximum(power, TINY)

    def _every(self, theta: Array, starts: Sequence[Array]) -> list[Array]:
        heli, inputs = self.at_point(theta), self.inputs_at(theta)
        return [
            self._residuals(window, self._flown(heli, window, start, inputs))
            for window, start in zip(self.windows, starts, strict=True)
        ]

    def _counts(self) -> Array:
        return np.sum([np.isfinite(w.y).sum(axis=0) for w in self.windows], axis=0)

    def _actuators(self, theta: Array, deviations: Array) -> dict[str, tuple[float, float]]:
        """Value and standard deviation of what is estimated of the actuators."""
        if self.actuators is None:
            return {}
        return self.actuators.found(theta[self.k :].tolist(), deviations[self.k :].tolist())

    def result(self, theta: Array, window: float, steps: int, converged: bool) -> Calibration:
        """The calibrated helicopter and its uncertainty."""
        self.noise, whiteness = self.levels(theta)
        problems, H, _ = self.normal(theta)
        covariance = np.linalg.inv(H)
        scores = np.array([problem.score for problem in problems])
        # errors that are correlated within a window, not between windows
        robust = covariance @ (np.eye(len(theta)) + scores.T @ scores) @ covariance
        every = np.sqrt(np.maximum(np.diag(covariance), np.diag(robust)))
        relative, size = self.spread * every[: self.k], np.sqrt(np.diag(covariance))[: self.k]
        found = self.at_point(theta)
        values = found.parameters.array[self.at]
        names = [str(p) for p in self.free]
        vehicle = self.heli.vehicle.with_values(
            dict(zip(names, values.tolist(), strict=True)),
            f"calibrated from {len(self.windows)} windows of {window:g} s",
            dict(zip(names, (values * relative).tolist(), strict=True)),
        )
        return Calibration(
            heli=replace(self.heli, vehicle=vehicle),
            start=self.heli,
            parameters=self.free,
            values=values,
            deviations=values * relative,
            prior_deviations=self.heli.parameters.array[self.at] * self.spread,
            correlation=covariance[: self.k, : self.k] / np.outer(size, size),
            actuators=self._actuators(theta, every),
            noise=dict(zip(self.outputs, self.noise.tolist(), strict=True)),
            whiteness=dict(zip(self.outputs, whiteness.tolist(), strict=True)),
            windows=len(self.windows),
            window=window,
            steps=steps,
            converged=converged,
        )


def _from_euler(x: Array) -> Array:
    """Derivative (nx + 5, nx) of the quaternion form of a state with respect to its Euler form."""
    out = np.zeros((len(x) + 5, len(x)))
    out[:6, :6] = np.eye(6)
    out[13:, 8:] = np.eye(len(x) - 8)
    for i in (6, 7):  # each component is linear in sine and cosine of half the angle
        turned = x.copy()
        turned[i] += np.pi
        out[6:10, i] = 0.5 * flight_state(turned)[6:10]
    return out


def _to_euler(states: Array, change: Array) -> Array:
    """Changes (n, nx, m) in Euler form of changes (n, nx + 5, m) of states in quaternion form."""
    q0, q1, q2, q3 = (states[:, i, None] for i in range(6, 10))
    d0, d1, d2, d3 = (change[:, i] for i in range(6, 10))
    a, b = 2 * (q0 * q1 + q2 * q3), 1 - 2 * (q1**2 + q2**2)
    da = 2 * (d0 * q1 + q0 * d1 + d2 * q3 + q2 * d3)
    db = -4 * (q1 * d1 + q2 * d2)
    phi = (b * da - a * db) / (a**2 + b**2)
    sine = 2 * (q0 * q2 - q3 * q1)
    theta = 2 * (d0 * q2 + q0 * d2 - d3 * q1 - q3 * d1) / np.sqrt(np.maximum(1 - sine**2, TINY))
    return np.concatenate([change[:, :6], phi[:, None], theta[:, None], change[:, 13:]], axis=1)
