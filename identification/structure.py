"""What is to be identified: which signals, which lags, which functions of the scheduling parameter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

from symheli.errors import InputError
from symheli.lpv import Basis


class Term(NamedTuple):
    """One group of regressors: signals of one kind at one lag (samples), times the basis at p(k - p_lag)."""

    kind: Literal["output", "input", "offset", "increment"]
    lag: int
    p_lag: int


@dataclass(frozen=True)
class LPVARX:
    """Linear difference equation whose coefficients are functions of a scheduling parameter p, any number of inputs and outputs.

        y(k) = -sum_{i=1..na} A_i(p) y(k-i) + sum_{j=0..nb-1} B_j(p) u(k-delay-j) + c(p) + d(p) (p(k) - p(k-1))

    y (ny,) are the signals `outputs`, u (nu,) the signals `inputs`, in their own units; A_i (ny, ny), B_j (ny, nu),
    c and d (ny,) are combinations of the functions of `basis`. `delay` 0 is direct feedthrough. One formulation covers
    one or many inputs and outputs; independent single-output models are independent fits.

    `scheduling_at="lag"` (default): each coefficient is taken at p(k - lag of its term), c and d at p(k-1): the form
    that has a minimal state-space realization with static dependence. "now": every coefficient at p(k), as in Budiyono
    and Sutarto, eqs 9-14.

    `offset` adds c(p), the moving trim. `offset_rate` adds d(p) times the change of p over the step that leads to y(k):
    causal, so that batch and recursive estimates see the same number, and free of the sample period. For whole outputs
    that move about a trim x0(p), d(p) is x0'(p) to first order in the step; d(p) dt multiplies dp/dt.

    Raises `InputError` for repeated or missing names, negative orders or an unknown `scheduling_at`.
    Source: Bamieh and Giarre (2002), Identification of linear parameter varying models.
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    scheduling: str
    na: int
    nb: int
    delay: int
    basis: Basis
    scheduling_at: Literal["lag", "now"] = "lag"
    offset: bool = False
    offset_rate: bool = False

    def __post_init__(self) -> None:
        for group in ("outputs", "inputs"):
            object.__setattr__(self, group, _names(getattr(self, group), group))
        for name in ("na", "nb", "delay"):
            object.__setattr__(self, name, _order(getattr(self, name), name))
        if not self.outputs:
            raise InputError("outputs: name at least one signal to predict")
        both = sorted(set(self.outputs) & set(self.inputs))
        if both:
            raise InputError(f"a signal is either an output or an input; both: {', '.join(both)}")
        if not isinstance(self.scheduling, str):
            raise InputError(f"scheduling: expected the name of one signal, got {self.scheduling!r}")
        if not isinstance(self.basis, Basis):
            raise InputError(f"basis: expected a basis such as Polynomial(degree=2, low=0, high=13), got {self.basis!r}")
        if self.scheduling_at not in ("lag", "now"):
            raise InputError(f'scheduling_at: expected "lag" or "now", got {self.scheduling_at!r}')
        if not self.terms:
            raise InputError("nothing to identify: give na >= 1, or nb >= 1 with inputs, or offset=True")

    @property
    def ny(self) -> int:
        """Number of outputs."""
        return len(self.outputs)

    @property
    def nu(self) -> int:
        """Number of inputs."""
        return len(self.inputs)

    @property
    def output_lags(self) -> range:
        """1 .. na."""
        return range(1, self.na + 1)

    @property
    def input_lags(self) -> range:
        """delay .. delay + nb - 1; empty without inputs."""
        return range(self.delay, self.delay + self.nb) if self.inputs else range(0)

    @property
    def memory(self) -> int:
        """How many samples before k the regressor of y(k) reaches back."""
        return max((max(t.lag, t.p_lag) for t in self.terms), default=0)

    @property
    def terms(self) -> tuple[Term, ...]:
        """The groups of regressors in their order: outputs, inputs, offset, increment of p."""
        return tuple(self._terms())

    def _terms(self) -> Iterator[Term]:
        at_lag = self.scheduling_at == "lag"
        for i in self.output_lags:
            yield Term("output", i, i if at_lag else 0)
        for i in self.input_lags:
            yield Term("input", i, i if at_lag else 0)
        if self.offset:
            yield Term("offset", 0, int(at_lag))
        if self.offset_rate:
            yield Term("increment", 1, int(at_lag))

    def channels(self, term: Term) -> tuple[str, ...]:
        """Names of the signals of a term."""
        match term.kind:
            case "output":
                return self.outputs
            case "input":
                return self.inputs
            case "offset":
                return ("1",)
            case "increment":
                return (f"change of {self.scheduling}",)

    @property
    def n_regressors(self) -> int:
        """Length of the regressor: unknown coefficients of each output."""
        return self.basis.size * sum(len(self.channels(t)) for t in self.terms)

    @property
    def regressor_names(self) -> tuple[str, ...]:
        """One name a regressor, such as "theta(k-1) f2(airspeed(k-1))"."""
        p = self.scheduling
        return tuple(
            f"{name}{_at(t.lag) if t.kind in ('output', 'input') else ''} f{j}({p}{_at(t.p_lag)})"
            for t in self.terms
            for name in self.channels(t)
            for j in range(self.basis.size)
        )


def _at(lag: int) -> str:
    return f"(k-{lag})" if lag else "(k)"


def _names(value: object, group: str) -> tuple[str, ...]:
    names = (value,) if isinstance(value, str) else tuple(value)  # type: ignore[arg-type]
    if not all(isinstance(n, str) for n in names):
        raise InputError(f"{group}: expected names of signals, got {value!r}")
    if len(set(names)) != len(names):
        raise InputError(f"{group}: names must differ, got {', '.join(names)}")
    return names


def _order(value: object, name: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise InputError(f"{name}: expected an integer >= 0, got {value!r}")
    return value
