"""A controller structure: a fixed linear system with named gains between some of its signals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.tools import lower_feedback
from symheli.values.arrays import Array
from symheli.values.numbers import positive, whole
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized

if TYPE_CHECKING:
    from synthesis.design.plant.plant import Plant

TERMS = "PID"
"""Proportional, integral and derivative part of a path."""


@dataclass(frozen=True)
class TunableGain:
    """A number of a structure, or a function of the scheduling parameters.

    Parameters
    ----------
    name : str
        An input and an output of the frame: the input is the output times the gain.
    low, high : float
        Bounds, at every value of the parameters.
    scheduled : bool
        Whether it is a function in the basis of the structure, if that has one; False: one number.

    Raises
    ------
    InputError
        Bounds in the wrong order.

    Examples
    --------
    >>> synthesis.structures.TunableGain("damping", low=0.0).high
    inf
    """

    name: str
    low: float = -math.inf
    high: float = math.inf
    scheduled: bool = True

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InputError(
                f"gain {self.name}: expected low < high, got {self.low:g} and {self.high:g}"
            )

    @property
    def inside(self) -> float:
        """A value within the bounds: their middle, or 1 from the only one; 0 without any."""
        if math.isfinite(self.low) and math.isfinite(self.high):
            return 0.5 * (self.low + self.high)
        if math.isfinite(self.low):
            return self.low + 1.0
        return self.high - 1.0 if math.isfinite(self.high) else 0.0


@dataclass(frozen=True, eq=False)
class TunableController:
    """u = K y of which only named gains are free.

    Parameters
    ----------
    frame : LinearModel
        From the measurements and the gains to the controls and the gains: everything of the
        controller but the gains. Gains in parallel make K affine in them, in series (an attitude
        gain before a rate gain) polynomial.
    gains : sequence of Gain
        With the names of the inputs and outputs that they connect.
    basis : FunctionSpace, optional
        Functions of the scheduling parameters of the plant, any of `symheli.lpv`: a scheduled gain
        is their weighted sum. None: every gain is one number.

    Raises
    ------
    InputError
        A frame without measurements, controls or gains.
    UnknownNameError
        A gain that is not both an input and an output of the frame.

    Examples
    --------
    A gain on the attitude in front of one on the rate, u = rate (p + attitude phi):

    >>> import symheli, synthesis
    >>> cascade = synthesis.structures.TunableController(
    ...     symheli.LinearModel.gain(
    ...         [[0, 0, 0, 1], [0, 1, 0, 0], [1, 0, 1, 0]],
    ...         ["p", "phi", "attitude", "rate"], ["d_lat", "attitude", "rate"]),
    ...     [synthesis.structures.TunableGain(name) for name in ("attitude", "rate")])
    >>> cascade.numbers
    2
    >>> roll = [symheli.Scheduling("airspeed", "m/s", 0.0, 13.0)]
    >>> K = cascade.controller({"attitude": 5.0, "rate": -0.02}, roll).at(6.0)
    >>> print(K.inputs, K.D)
    ('p', 'phi') [[-0.02 -0.1 ]]
    """

    frame: LinearModel
    gains: tuple[TunableGain, ...]
    basis: FunctionSpace | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "gains", tuple(self.gains))
        names = signals(gain.name for gain in self.gains)
        if not names:
            raise InputError("structure: expected one or more gains, got none")
        for group, known in (("input", self.frame.inputs), ("output", self.frame.outputs)):
            indices(names, known, group)
        if not (self.measurements and self.controls):
            raise InputError(
                "structure: the frame has no measurements or no controls besides the gains"
                f" {', '.join(names)}"
            )

    # --- by their usual names --------------------------------------------------------------------

    @classmethod
    def pid(
        cls,
        plant: Plant,
        paths: Mapping[tuple[str, str], str] | None = None,
        *,
        corner: float | Mapping[str, float] | None = None,
        basis: FunctionSpace | None = None,
        bounds: Mapping[str, tuple[float, float]] | None = None,
    ) -> TunableController:
        """Paths from measurements to controls, each with some of a proportional, an integral and a
        derivative part.

        "P" from every measurement to every control is static output feedback; "PI" from an
        attitude with "P" from its rate is an attitude-rate cascade, its gains multiplied out. The
        gain of a part is called `<control>_<measurement>_P`, `_I` or `_D`. A measurement has one
        integrator and one filter, whatever the number of its paths. On a sampled plant they are
        sampled by backward differences.

        Parameters
        ----------
        plant : Plant
            Whose signals and sample period the structure takes.
        paths : mapping, optional
            {(control, measurement): "P", "PI", "PD", "PID", ...}; by default "P" everywhere.
        corner : float or mapping, optional
            Corner frequency (rad/s) of the filter in the derivative of every measurement, or by
            measurement; needed where there is a "D".
        basis : FunctionSpace, optional
            Of all gains, see `Structure`.
        bounds : mapping, optional
            {gain: (low, high)}, or by the end of its name, "_P".

        Raises
        ------
        InputError
            Other letters, a derivative without corner frequency, a plant without controls.
        UnknownNameError
            A signal that the plant does not have, a bound of a gain that is not there.

        Examples
        --------
        >>> pi = synthesis.structures.TunableController.pid(
        ...     plant, {("u", "y"): "PI"}, bounds={"_I": (-9.0, 0.0)})
        >>> print([gain.name for gain in pi.gains], pi.order)
        ['u_y_P', 'u_y_I'] 1
        """
        given = paths or {(u, y): "P" for u in plant.controls for y in plant.measurements}
        if not given:
            raise InputError("the plant has no controls or no measurements: name them")
        controls = _known([u for u, _ in given], plant.controls, "control")
        measured = _known([y for _, y in given], plant.measurements, "measurement")
        for path, terms in given.items():
            if not terms or set(terms) - set(TERMS) or len(set(terms)) < len(terms):
                raise InputError(
                    f"{path[0]} from {path[1]}: expected some of the letters P, I, D, got {terms!r}"
                )
        with_I = [y for y in measured if any("I" in given.get((u, y), "") for u in controls)]
        with_D = [y for y in measured if any("D" in given.get((u, y), "") for u in controls)]
        corners = _corners(corner, with_D)
        names = [f"{u}_{y}_{term}" for (u, y), terms in given.items() for term in terms]
        nx, ny, ng = len(with_I) + len(with_D), len(measured), len(names)
        # rows over (states, measurements)
        A, parts = np.zeros((nx, nx + ny)), {}
        for k, y in enumerate((*with_I, *with_D)):
            own, now = np.eye(nx + ny)[k], np.eye(nx + ny)[nx + measured.index(y)]
            integral = k < len(with_I)
            if plant.dt is None:
                A[k] = now if integral else corners[y] * (now - own)
                parts[y, "I" if integral else "D"] = own if integral else A[k]
            elif integral:
                A[k] = parts[y, "I"] = own + plant.dt * now
            else:
                passed = plant.dt * corners[y] / (1 + plant.dt * corners[y]) * (now - own)
                A[k], parts[y, "D"] = own + passed, passed / plant.dt
        for i, y in enumerate(measured):
            parts[y, "P"] = np.eye(nx + ny)[nx + i]
        reads = np.array([parts[y, term] for (_, y), terms in given.items() for term in terms])
        drives = np.array(
            [[float(u == to) for (to, _), terms in given.items() for _ in terms] for u in controls]
        )
        frame = LinearModel(
            A[:, :nx],
            np.hstack([A[:, nx:], np.zeros((nx, ng))]),
            np.vstack([np.zeros((len(controls), nx)), reads[:, :nx]]),
            np.block(
                [
                    [np.zeros((len(controls), ny)), drives],
                    [reads[:, nx:], np.zeros((ng, ng))],
                ]
            ),
            signals([*(f"{y}_integral" for y in with_I), *(f"{y}_filter" for y in with_D)]),
            (*measured, *signals(names)),
            (*controls, *signals(names)),
            plant.dt,
        )
        limits = {n: (-math.inf, math.inf) for n in names} | _limits(bounds or {}, names)
        return cls(frame, tuple(TunableGain(n, *limits[n]) for n in names), basis)

    @classmethod
    def of_order(cls, plant: Plant, order: int) -> TunableController:
        """A controller of so many states of which every entry is a gain, one number each.

        The gains are called `A_1_2`, `B_1_<measurement>`, `C_<control>_1`,
        `D_<control>_<measurement>`. Start it from several random `starts`: states that are driven
        and read by nothing have no slope.

        Raises `InputError` for an order below 0 and a plant without controls or measurements.

        Examples
        --------
        >>> free = synthesis.structures.TunableController.of_order(plant, 1)
        >>> print([gain.name for gain in free.gains])
        ['A_1_1', 'B_1_y', 'C_u_1', 'D_u_y']
        """
        k, (u, y) = whole(order, "order", 0), (plant.controls, plant.measurements)
        if not (u and y):
            raise InputError("the plant has no controls or no measurements: name them")
        each = [
            *((f"A_{i + 1}", f"B_{i + 1}") for i in range(k)),
            *((f"C_{s}", f"D_{s}") for s in u),
        ]
        names = [
            f"{own}_{j + 1}" if j < k else f"{other}_{y[j - k]}"
            for own, other in each
            for j in range(k + len(y))
        ]
        rows = np.repeat(np.eye(k + len(u)), k + len(y), axis=1)
        reads = np.tile(np.eye(k + len(y)), (k + len(u), 1))
        g = len(names)
        frame = LinearModel(
            np.zeros((k, k)),
            np.hstack([np.zeros((k, len(y))), rows[:k]]),
            np.vstack([np.zeros((len(u), k)), reads[:, :k]]),
            np.block([[np.zeros((len(u), len(y))), rows[k:]], [reads[:, k:], np.zeros((g, g))]]),
            signals(f"controller_{i + 1}" for i in range(k)),
            (*y, *signals(names)),
            (*u, *signals(names)),
            plant.dt,
        )
        return cls(frame, tuple(TunableGain(name) for name in names))

    # --- what it is ------------------------------------------------------------------------------

    @property
    def measurements(self) -> tuple[Signal, ...]:
        """Signals that the controller reads."""
        return tuple(s for s in self.frame.inputs if s not in self._names)

    @property
    def controls(self) -> tuple[Signal, ...]:
        """Signals that the controller commands."""
        return tuple(s for s in self.frame.outputs if s not in self._names)

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.frame.states)

    @property
    def numbers(self) -> int:
        """How many numbers the gains are in all."""
        return sum(self.numbers_of(gain) for gain in self.gains)

    def numbers_of(self, gain: TunableGain) -> int:
        """How many numbers this gain is: the size of the basis, or 1."""
        return 1 if self.basis is None or not gain.scheduled else self.basis.size

    def controller(
        self, gains: Mapping[str, float | Array], parameters: Sequence[Scheduling]
    ) -> LPVStateSpace:
        """Return u = K(p) y for {gain: number, or its coefficients in the basis}, exactly.

        Raises `UnknownNameError` for a gain that is missing or not there, `InputError` for another
        number of coefficients.
        """
        found = self.coefficients(gains)
        names = signals(self._names)
        size = 1 if self.basis is None else self.basis.size
        D = np.zeros((size, len(names), len(names)))
        one = np.ones(1) if self.basis is None else self.basis.constant()
        for j, gain in enumerate(self.gains):
            own = found[gain.name]
            D[:, j, j] = own if len(own) == size and gain.scheduled else own[0] * one
        empty = np.zeros((size, 0, 0)), np.zeros((size, 0, len(names)))
        if self.basis is None:
            static = LinearModel.gain(D[0], names, names)
            diagonal = LPVStateSpace.constant(static, tuple(parameters))
        else:
            diagonal = LPVStateSpace(
                self.basis,
                *empty,
                np.zeros((size, len(names), 0)),
                D,
                tuple(parameters),
                (),
                names,
                names,
            )
        model = LPVStateSpace.constant(self.frame, tuple(parameters))
        model = lower_feedback(model, diagonal, inputs=self.measurements, outputs=self.controls)
        assert isinstance(model, LPVStateSpace)  # noqa: S101 - nothing is uncertain
        return model

    def coefficients(self, gains: Mapping[str, float | Array]) -> dict[str, Array]:
        """Return {gain: coefficients (numbers,)} in order; a number is the constant function."""
        for name in gains:
            if name not in self._names:
                raise UnknownNameError("gain", name, self._names)
        out = {}
        for gain in self.gains:
            if gain.name not in gains:
                raise InputError(f"gains: {gain.name} is missing; the structure has it free")
            own, size = np.asarray(gains[gain.name], float), self.numbers_of(gain)
            if own.ndim == 0 and size > 1:
                assert self.basis is not None  # noqa: S101 - it has several numbers
                own = own * self.basis.constant()
            own = np.atleast_1d(own)
            if own.shape != (size,) or not np.isfinite(own).all():
                raise InputError(
                    f"{gain.name}: expected a number, or {size} finite coefficients, got"
                    f" {gains[gain.name]!r:.80}"
                )
            out[gain.name] = own
        return out

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(gain.name for gain in self.gains)


def _known(given: Sequence[str], known: Sequence[Signal], kind: str) -> tuple[Signal, ...]:
    """Return the signals that are given, each once, in the order of the known ones."""
    indices(dict.fromkeys(given), known, kind)
    return tuple(s for s in known if s in given)


def _corners(
    given: float | Mapping[str, float] | None, measured: Sequence[str]
) -> dict[str, float]:
    out = {}
    for y in measured:
        corner = given.get(y) if isinstance(given, Mapping) else given
        if corner is None:
            raise InputError(
                f"corner: the derivative of {y} needs a filter; give its corner frequency in rad/s"
            )
        out[y] = positive(corner, f"the corner frequency of {y}")
    return out


def _limits(
    bounds: Mapping[str, tuple[float, float]], names: Sequence[str]
) -> dict[str, tuple[float, float]]:
    """Return the bounds by full name; those of a full name take precedence over those of an
    ending.
    """
    out: dict[str, tuple[float, float]] = {}
    for ending in sorted(bounds, key=len):
        own = [n for n in names if n.endswith(ending)]
        if not own:
            raise UnknownNameError("gain", ending, names)
        low, high = bounds[ending]
        out |= dict.fromkeys(own, (float(low), float(high)))
    return out
