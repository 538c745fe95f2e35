"""Structure of an LPV-ARX model: its signals, lags and functions of the scheduling parameters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from identification.structure.orders import Orders, Table, compact, table
from symheli.errors import InputError
from symheli.lpv import Polynomial, Product
from symheli.lpv.bases import Basis, FunctionSpace
from symheli.records import FlightRecord
from symheli.values.arrays import Array


class Term(NamedTuple):
    """One block of regressors: signals of one kind at one lag, each times the basis at p(k -
    p_lag).

    Parameters
    ----------
    kind : {"output", "input", "offset", "increment"}
        What is multiplied; "increment" is the change of p.
    lag, p_lag : int
        Of the signals and of p, in samples.
    signals : tuple of int
        Positions among the outputs, the inputs or the scheduling parameters.

    Examples
    --------
    >>> arx.terms[0]
    Term(kind='output', lag=1, p_lag=1, signals=(0,))
    """

    kind: Literal["output", "input", "offset", "increment"]
    lag: int
    p_lag: int
    signals: tuple[int, ...]


class TermSignal(NamedTuple):
    """One signal of a term; it takes one regressor for each function of the basis.

    Parameters
    ----------
    kind : {"output", "input", "offset", "increment"}
        As in `Term`.
    channel : int
        Position of the signal among those of its kind.
    lag, p_lag : int
        Of the signal and of p, in samples.

    Examples
    --------
    >>> arx.entries[-1]
    TermSignal(kind='input', channel=0, lag=1, p_lag=1)
    """

    kind: Literal["output", "input", "offset", "increment"]
    channel: int
    lag: int
    p_lag: int


class EquationGroup(NamedTuple):
    """Outputs whose equations have the same regressors.

    Parameters
    ----------
    outputs, entries : tuple of int
        Positions in `LPVARX.outputs` and in `LPVARX.entries`, ascending.

    Examples
    --------
    >>> arx.groups
    (EquationGroup(outputs=(0,), entries=(0, 1)),)
    """

    outputs: tuple[int, ...]
    entries: tuple[int, ...]


UNSCHEDULED = "none"
"""Name of the parameter on which the coefficients of a plant that nothing schedules do not
depend.
"""

CONSTANT = Polynomial(0, 0.0, 1.0)
"""Its functions: the constant."""


@dataclass(frozen=True)
class LPVARX:
    """An LPV-ARX structure is a linear difference equation whose coefficients are functions of
    scheduling parameters p, with any number of inputs and outputs.

        y(k) = -sum_{i=1..na} A_i(p) y(k-i) + sum_{j=0..nb-1} B_j(p) u(k-delay-j)
               + c(p) + d(p) (p(k) - p(k-1))

    y (ny,) are the signals `outputs`, u (nu,) the signals `inputs`, in their own units; A_i (ny,
    ny), B_j (ny, nu), c (ny,) and d (ny, parameters) are combinations of the functions of `basis`.
    One formulation covers one or many inputs and outputs.

    Parameters
    ----------
    outputs, inputs : str or sequence of str
        Signals of the record, no name twice; inputs may be none.
    scheduling : str or sequence of str, optional
        One parameter, or several: then `basis` is a `Product`. Default, with `basis`: none, the
        coefficients are constant. A scheduling parameter may be an output or an input too. For an
        output only "lag" without `offset_rate` is causal then, and the offset's functions of p
        repeat some of the output's.
    na, nb, delay : int or tables
        Numbers for all signals, or tables: {output: number} says it for the equation of each
        output, {input: number} (nb, delay) for each input in all equations, {output: {signal:
        number}} for each signal in each equation; rows of numbers, one an output, say the same.
        Order 0 leaves a signal out of an equation; delay 0 is direct feedthrough.
    basis : FunctionSpace, optional
        The functions of p, on the range they are declared on. Of constants alone, records need no
        scheduling signal (unless `offset_rate`).
    scheduling_at : {"lag", "now"}
        "lag": each coefficient is taken at p(k - lag of its term), c and d at p(k-1): the form that
        has a minimal state-space realization with static dependence. "now": every coefficient at
        p(k), as in Budiyono and Sutarto, eqs 9-14.
    offset : bool
        Adds c(p), the moving trim.
    offset_rate : bool
        Adds d(p) times the change of p over the step that leads to y(k): causal, so that batch and
        recursive estimates see the same number, and free of the sample period. For whole outputs
        that move about a trim x0(p), d(p) is x0'(p) to first order in the step; d(p) dt multiplies
        dp/dt.

    Raises
    ------
    InputError
        Repeated or missing names, negative orders, a basis of another number of parameters, an
        unknown `scheduling_at`, or an output that would predict itself.

    See Also
    --------
    identification.fit : coefficients from records
    identification.KinematicARX : a structure with known kinematics
    identification.StateSpace : a structure with states

    References
    ----------
    Bamieh and Giarre (2002), Identification of linear parameter varying models, Int. J. Robust and
    Nonlinear Control 12.

    Examples
    --------
    >>> arx = idn.LPVARX(
    ...     outputs=("q", "theta"),
    ...     inputs="d_lon",
    ...     scheduling="airspeed",
    ...     na=2,
    ...     nb={"d_lon": 1},
    ...     delay=1,
    ...     basis=idn.Polynomial(1, low=0.0, high=13.0),
    ... )
    >>> arx.n_regressors, arx.memory
    (10, 2)
    >>> arx.regressor_names[0]
    'q(k-1) f0(airspeed(k-1))'

    With constant coefficients, the mean of those that move with p:

    >>> print(idn.fit(idn.LPVARX("y", "u", na=1, nb=1, delay=1), record).at().poles().round(1))
    [0.6]
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    scheduling: str | tuple[str, ...] = UNSCHEDULED
    _: KW_ONLY
    na: Orders
    nb: Orders
    delay: Orders = 1
    basis: FunctionSpace = CONSTANT
    scheduling_at: Literal["lag", "now"] = "lag"
    offset: bool = False
    offset_rate: bool = False

    if TYPE_CHECKING:  # one name, or several

        def __init__(
            self,
            outputs: str | Sequence[str],
            inputs: str | Sequence[str],
            scheduling: str | Sequence[str] = UNSCHEDULED,
            *,
            na: Orders,
            nb: Orders,
            delay: Orders = 1,
            basis: FunctionSpace = CONSTANT,
            scheduling_at: Literal["lag", "now"] = "lag",
            offset: bool = False,
            offset_rate: bool = False,
        ) -> None: ...

    def __post_init__(self) -> None:
        for group in ("outputs", "inputs"):
            object.__setattr__(self, group, _names(getattr(self, group), group))
        if not self.outputs:
            raise InputError("outputs: name at least one signal to predict")
        both = sorted(set(self.outputs) & set(self.inputs))
        if both:
            raise InputError(f"a signal is either an output or an input; both: {', '.join(both)}")
        for name, signals in (("na", self.outputs), ("nb", self.inputs), ("delay", self.inputs)):
            object.__setattr__(
                self, name, compact(getattr(self, name), name, self.outputs, signals)
            )
        parameters = _names(self.scheduling, "scheduling")
        object.__setattr__(
            self, "scheduling", parameters[0] if len(parameters) == 1 else parameters
        )
        if not isinstance(self.basis, FunctionSpace):
            raise InputError(
                "basis: expected a basis such as Polynomial(degree=2, low=0, high=13), got"
                f" {self.basis!r}"
            )
        if self.basis.dimension != len(parameters):
            raise InputError(
                f"scheduling names {len(parameters)} parameters ({', '.join(parameters)}) and the"
                f" basis has {self.basis.dimension}; bases of several parameters are products:"
                " Product((Polynomial(...), Polynomial(...)))"
            )
        if parameters == (UNSCHEDULED,) and (self.offset_rate or any(self.basis.degrees or (1,))):
            raise InputError(
                "scheduling: name the signal that the basis, or offset_rate, is a function of; a"
                " model without one is constant"
            )
        if self.scheduling_at not in ("lag", "now"):
            raise InputError(f'scheduling_at: expected "lag" or "now", got {self.scheduling_at!r}')
        known = sorted(set(self.outputs) & set(parameters))
        if known and (self.offset_rate or self.scheduling_at == "now"):
            what = "offset_rate" if self.offset_rate else 'scheduling_at="now"'
            raise InputError(
                f"{known[0]} is an output and schedules the coefficients: with {what} its own value"
                " at k would predict it; "
                f'leave offset_rate out and take scheduling_at="lag", or schedule on a command'
            )
        for flag in ("offset", "offset_rate"):
            if not isinstance(getattr(self, flag), bool):
                raise InputError(f"{flag}: expected True or False, got {getattr(self, flag)!r}")
        empty = [y for y, used in zip(self.outputs, self.free.T, strict=True) if not used.any()]
        if empty:
            raise InputError(
                f"nothing to identify for {', '.join(empty)}: give na >= 1, or nb >= 1 with inputs,"
                " or offset=True"
            )

    @property
    def ny(self) -> int:
        """Number of outputs."""
        return len(self.outputs)

    @property
    def nu(self) -> int:
        """Number of inputs."""
        return len(self.inputs)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the scheduling parameters, also where there is one."""
        return (self.scheduling,) if isinstance(self.scheduling, str) else self.scheduling

    @cached_property
    def output_orders(self) -> Table:
        """`na` in full: the order of each output (column) in the equation of each output (row)."""
        return table(self.na, "na", self.outputs, self.outputs)

    @cached_property
    def input_lag_ranges(self) -> tuple[tuple[range, ...], ...]:
        """The lags of each input (column) in the equation of each output (row): delay .. delay + nb
        - 1.
        """
        orders, delays = (table(v, "nb", self.outputs, self.inputs) for v in (self.nb, self.delay))
        return tuple(
            tuple(range(d, d + n) for n, d in zip(*rows, strict=True))
            for rows in zip(orders, delays, strict=True)
        )

    @cached_property
    def output_lags(self) -> range:
        """1 to the largest order of an output."""
        return range(1, max((n for row in self.output_orders for n in row), default=0) + 1)

    @cached_property
    def input_lags(self) -> range:
        """The smallest to the largest lag of an input; empty without inputs."""
        lags = [lag for row in self.input_lag_ranges for lags in row for lag in lags]
        return range(min(lags), max(lags) + 1) if lags else range(0)

    @cached_property
    def memory(self) -> int:
        """Number of samples before k to which the regressor of y(k) reaches back."""
        return max((max(t.lag, t.p_lag) for t in self.terms), default=0)

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """The blocks of regressors in their order: outputs, inputs, offset, increment of p; those
        some equation has.
        """
        return tuple(self._terms())

    def _terms(self) -> Iterator[Term]:
        at_lag = self.scheduling_at == "lag"
        for kind, lags, count in (
            ("output", self.output_lags, self.ny),
            ("input", self.input_lags, self.nu),
        ):
            for lag in lags:
                signals = tuple(
                    s
                    for s in range(count)
                    if any(self._has(kind, lag, s, y) for y in range(self.ny))
                )
                if signals:
                    yield Term(kind, lag, lag if at_lag else 0, signals)  # type: ignore[arg-type]
        if self.offset:
            yield Term("offset", 0, int(at_lag), (0,))
        if self.offset_rate:
            yield Term("increment", 1, int(at_lag), tuple(range(len(self.parameters))))

    def _has(self, kind: str, lag: int, signal: int, output: int) -> bool:
        """Whether the equation of an output contains a signal at a lag."""
        match kind:
            case "output":
                return lag <= self.output_orders[output][signal]
            case "input":
                return lag in self.input_lag_ranges[output][signal]
        return True

    @cached_property
    def entries(self) -> tuple[TermSignal, ...]:
        """Every signal of every term, in the order of the regressors."""
        return tuple(TermSignal(t.kind, s, t.lag, t.p_lag) for t in self.terms for s in t.signals)

    @cached_property
    def groups(self) -> tuple[EquationGroup, ...]:
        """Groups of outputs with the same regressors: all of them, unless orders or delays differ
        between equations.
        """
        members: dict[tuple[int, ...], list[int]] = {}
        for y in range(self.ny):
            used = tuple(
                i for i, e in enumerate(self.entries) if self._has(e.kind, e.lag, e.channel, y)
            )
            members.setdefault(used, []).append(y)
        return tuple(EquationGroup(tuple(outputs), entries) for entries, outputs in members.items())

    def regressors(self, group: EquationGroup) -> Array:
        """Positions (n,) of the regressors of a group among all of them."""
        size = self.basis.size
        return (np.array(group.entries, dtype=int)[:, None] * size + np.arange(size)).reshape(-1)

    @cached_property
    def free(self) -> Array:
        """(n_regressors, ny), true where the equation of the output (column) has the regressor
        (row).
        """
        out = np.zeros((self.n_regressors, self.ny), dtype=bool)
        for group in self.groups:
            out[self.regressors(group)[:, None], group.outputs] = True
        return out

    def channels(self, term: Term) -> tuple[str, ...]:
        """Names of the signals of a term."""
        match term.kind:
            case "output":
                return tuple(self.outputs[s] for s in term.signals)
            case "input":
                return tuple(self.inputs[s] for s in term.signals)
            case "offset":
                return ("1",)
            case "increment":
                return tuple(f"change of {p}" for p in self.parameters)

    @cached_property
    def n_regressors(self) -> int:
        """Length of the regressor: unknown coefficients of each output, where all outputs have the
        same.
        """
        return self.basis.size * len(self.entries)

    @cached_property
    def regressor_names(self) -> tuple[str, ...]:
        """One name a regressor, such as "theta(k-1) f2(airspeed(k-1))"."""
        return tuple(
            f"{name}{_at(t.lag) if t.kind in ('output', 'input') else ''}"
            + f" f{j}({', '.join(p + _at(t.p_lag) for p in self.parameters)})" * (not self.constant)
            for t in self.terms
            for name in self.channels(t)
            for j in range(self.basis.size)
        )

    @cached_property
    def constant(self) -> bool:
        """Whether nothing depends on the scheduling parameters."""
        return not self.offset_rate and not any(self.basis.degrees or (1,))

    def prepared(self, record: FlightRecord) -> FlightRecord:
        """The record with every signal the structure needs: where it does not depend on the
        scheduling parameters, those that the record lacks are in the middle of their ranges.
        """
        if not self.constant:
            return record
        middle = zip(self.parameters, self.basis.ranges, strict=True)
        lacking = {
            p: np.full(len(record), 0.5 * (low + high))
            for p, (low, high) in middle
            if p not in record.signals
        }
        return record.with_signals(dict.fromkeys(lacking, "1"), **lacking)

    @property
    def simulated(self) -> LPVARX:
        """The structure for a simulated flight: the same, unless sensors come late."""
        return self

    def lti(self) -> LPVARX:
        """Return the same signals, orders and delays with constant coefficients: the baseline for
        scheduling.
        """
        constants: list[Basis] = [Polynomial(0, low, high) for low, high in self.basis.ranges]
        return replace(
            self, basis=constants[0] if len(constants) == 1 else Product(tuple(constants))
        )


def _at(lag: int) -> str:
    return f"(k-{lag})" if lag else "(k)"


def require_structure(value: object) -> None:
    """Raises `InputError` for anything but a structure."""
    if not isinstance(value, LPVARX):
        raise InputError(
            "structure: expected LPVARX(outputs=..., inputs=..., scheduling=..., ...), got"
            f" {value!r:.80}"
        )


def _names(value: object, group: str) -> tuple[str, ...]:
    names: tuple[Any, ...] = (
        (value,) if isinstance(value, str) or not isinstance(value, Iterable) else tuple(value)
    )
    if not all(isinstance(n, str) for n in names):
        raise InputError(f"{group}: expected names of signals, got {value!r}")
    if len(set(names)) != len(names):
        raise InputError(f"{group}: names must differ, got {', '.join(names)}")
    return names
