"""Structure of an LPV state-space model."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import cached_property

from identification.structure.lpvarx import CONSTANT, LPVARX, UNSCHEDULED
from symheli.errors import InputError
from symheli.lpv.bases import FunctionSpace
from symheli.values.numbers import whole


@dataclass(frozen=True)
class StateSpace:
    """An LPV state-space structure has linear states whose matrices are functions of scheduling
    parameters p,

        x(k+1) = A(p(k)) x(k) + B(p(k)) u(k),   y(k) = C x(k) + D u(k),

    with A and B in the functions of `basis`, C and D constant. `Innovations` adds K(p) e to the
    next state and e to the outputs, e white.

    Parameters
    ----------
    outputs, inputs : str or sequence of str
        Signals of the record, in their own units.
    scheduling : str or sequence of str, optional
        As of `LPVARX`; default none: a linear model.
    order : int
        Number of states.
    basis : FunctionSpace, optional
        The functions of p, on the range they are declared on.
    feedthrough : bool
        Whether there is D.
    offset : bool
        Adds c(p) to the next state: signals are whole values about a trim that moves with p.
    own_scheduling : bool
        Quasi-LPV: `scheduling` is an output, and p that of the model's own free run, held at the
        ends of the range of the basis; False: p as measured, which a free run then follows.

    Raises
    ------
    InputError
        As `LPVARX`, an order below 1, or a schedule of its own that is no single output.

    See Also
    --------
    identification.LPVARX : a difference equation over parameters
    identification.fit : coefficients from records

    References
    ----------
    Toth (2010), Modeling and Identification of Linear Parameter-Varying Systems, ch. 3.

    Examples
    --------
    >>> structure = idn.StateSpace("y", "u", "p", order=1, basis=idn.Polynomial(1, -1.0, 1.0))
    >>> found = idn.fit(structure, record)
    >>> print(found.state_space.at(0.0).poles().round(1), round(float(found.score(record)["y"])))
    [0.5] 98
    """

    outputs: str | tuple[str, ...]
    inputs: str | tuple[str, ...]
    scheduling: str | tuple[str, ...] = UNSCHEDULED
    _: KW_ONLY
    order: int
    basis: FunctionSpace = CONSTANT
    feedthrough: bool = False
    offset: bool = False
    own_scheduling: bool = False

    def __post_init__(self) -> None:
        whole(self.order, "order", 1)
        arx = self.regression  # raises for signals and bases that do not fit
        for name in ("outputs", "inputs", "scheduling"):
            object.__setattr__(self, name, getattr(arx, name))
        if not arx.inputs:
            raise InputError("inputs: name at least one signal")
        if self.own_scheduling and not {self.scheduling} & {*self.outputs}:
            raise InputError(
                "own_scheduling: the schedule must be one of the outputs, got"
                f" {', '.join(arx.parameters)}"
            )

    @cached_property
    def regression(self) -> LPVARX:
        """The difference equation in the same signals with at least as many states."""
        ny = 1 if isinstance(self.outputs, str) else len(self.outputs)
        lags = -(-self.order // ny)
        return LPVARX(
            self.outputs,  # type: ignore[arg-type]
            self.inputs,  # type: ignore[arg-type]
            self.scheduling,
            na=lags,
            nb=lags,
            delay=1,
            basis=self.basis,
            offset=self.offset,
        )

    @property
    def memory(self) -> int:
        """Samples before the first prediction: none, the state it starts from is estimated."""
        return 0
