"""Systems connected: side by side, in series, in parallel, in feedback, and by the names of their
signals.

Systems of different kinds may be connected, and the result is of the most general kind among them:
linear models and gains give a `LinearModel`, with an `LPVStateSpace` of any basis they give an
`LPVStateSpace`, with an `LFT` an `LFT`, with an `UncertainStateSpace` (one) that. The result is
exact. Every connection is one constant closure u = K y + E r of the systems side by side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import chain
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.lft.algebra import append_lfts, common_period
from symheli.lpv.lft.algebra import close as close_lft
from symheli.lpv.lft.model import LFT
from symheli.lpv.linear_model import LinearModel, is_control_system
from symheli.lpv.lower_feedback import append_lpv, close_static
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.mixing import combined
from symheli.lpv.uncertain_state_space import UncertainStateSpace
from symheli.values.arrays import Array, frozen
from symheli.values.signal import Signal, distinct

System = Any
"""A LinearModel, an LPVStateSpace, an LFT, one UncertainStateSpace or a system of python-control; a
number or a matrix, a static gain, where signals go by order and not by name. What has no states
goes with any sample period.
"""


def append(*systems: System) -> Any:
    """Stack systems: states, inputs and outputs one after the other; a parameter that several of
    them share is one parameter.

    Parameters
    ----------
    *systems : LinearModel, LPVStateSpace, LFT, UncertainStateSpace, python-control system or gain
        A name that comes again gets the number of its system: phi, phi_2.

    Returns
    -------
    LinearModel, LPVStateSpace, LFT or UncertainStateSpace
        Of the most general kind among them.

    Raises
    ------
    InputError
        Sample periods that differ; ranges, units or rates of a shared parameter that do not agree.

    See Also
    --------
    symheli.lpv.connect : several systems, by names
    symheli.lpv.series : one system after the other
    symheli.lpv.parallel : sum of two systems

    Examples
    --------
    >>> two = lpv.append(spring, spring)
    >>> [str(s) for s in two.outputs], two.at(0.5).A.shape
    (['y1', 'y1_2'], (4, 4))
    """
    both = _Together.of(systems)
    u, y = (distinct([group[side] for group in both.groups]) for side in (0, 1))
    return both.closed(np.zeros((len(u), len(y))), np.eye(len(u)), np.eye(len(y)), u, y)


def series(first: System, second: System) -> Any:
    """Connect two systems in series, y = second(first(u)): the outputs of `first` feed the inputs
    of `second` in their order.

    Parameters
    ----------
    first, second : as in `append`
        With as many outputs as inputs between them.

    Returns
    -------
    LinearModel, LPVStateSpace, LFT or UncertainStateSpace
        From the inputs of `first` to the outputs of `second`.

    Raises
    ------
    InputError
        Numbers of signals or sample periods that differ.

    See Also
    --------
    symheli.lpv.parallel : sum of two systems
    symheli.lpv.feedback : a loop of two systems

    Examples
    --------
    >>> delayed = lpv.series(lpv.tools.pade_delay("u1", 0.02, order=2), spring)
    >>> len(delayed.states), [str(s) for s in delayed.inputs]
    (4, ['u1_command'])
    """
    both = _Together.of((first, second))
    (nu, ny), (mu, my) = both.sizes
    if mu != ny:
        raise InputError(
            f"series connection needs as many inputs ({mu}) as outputs of the other ({ny});"
            f" {_listed('inputs', both.groups[1][0])}, {_listed('outputs', both.groups[0][1])}:"
            " choose some with P[outputs, inputs], or connect by names with lpv.connect"
        )
    K, E = np.zeros((nu + mu, ny + my)), np.eye(nu + mu)[:, :nu]
    K[nu:, :ny] = np.eye(ny)
    own, other = both.groups
    return both.closed(K, E, np.eye(ny + my)[ny:], own[0], other[1])


def parallel(first: System, second: System) -> Any:
    """Connect two systems in parallel, y = first(u) + second(u); the signals keep the names of
    `first`.

    Parameters
    ----------
    first, second : as in `append`
        With as many inputs and outputs.

    Returns
    -------
    LinearModel, LPVStateSpace, LFT or UncertainStateSpace
        The sum.

    Raises
    ------
    InputError
        Numbers of signals or sample periods that differ.

    See Also
    --------
    symheli.lpv.series : one system after the other
    symheli.lpv.append : systems side by side

    Examples
    --------
    >>> twice = lpv.parallel(spring, spring).at(0.0)
    >>> gains = [m.frequency_response([0.0])[0].real for m in (twice, spring.at(0.0))]
    >>> print((gains[0] / gains[1]).round(6))
    [[2.]]
    """
    both = _Together.of((first, second))
    (nu, ny), other = both.sizes
    if other != (nu, ny):
        raise InputError(
            f"parallel connection needs equal numbers of inputs and outputs, got {nu}, {ny} and"
            f" {other[0]}, {other[1]}; {_channels(both.groups[0])} beside"
            f" {_channels(both.groups[1])}: choose some with P[outputs, inputs]"
        )
    E, F = np.vstack([np.eye(nu), np.eye(nu)]), np.hstack([np.eye(ny), np.eye(ny)])
    return both.closed(np.zeros((2 * nu, 2 * ny)), E, F, *both.groups[0])


def feedback(plant: System, controller: System, sign: int | None = None) -> Any:
    """Close the loop y = plant(u + sign controller(y)), all outputs to all inputs, in their order.

    The sign has no default, because conventions differ. `feedback(P, K, sign=+1)` closes u = +K y,
    as every method `.feedback(...)` of this package does. `feedback(P, K, sign=-1)` closes u = -K
    y: `control.feedback(P, K)` of python-control, and `feedback(P, K)` of MATLAB.

    Parameters
    ----------
    plant, controller : as in `append`
        The outputs of each as many as the inputs of the other.
    sign : +1 or -1
        Of the controller's output where it is added to the input.

    Returns
    -------
    LinearModel, LPVStateSpace, LFT or UncertainStateSpace
        From the inputs of the plant to its outputs.

    Raises
    ------
    InputError
        No sign, numbers of signals or sample periods that differ, a singular loop, or one of an
        `LPVStateSpace` through feedthrough that depends on the parameters: `.to_lft()` of one of
        the two closes that exactly.

    Examples
    --------
    A gain of 2 in a negative loop stiffens the spring:

    >>> lpv.feedback(spring, 2.0, sign=-1).at(0.0).A.round(6) + 0.0
    array([[ 0.,  1.],
           [-4., -1.]])

    See Also
    --------
    symheli.LPVStateSpace.feedback : constant gains by name
    symheli.lpv.tools.lower_feedback : loops by names, other channels kept
    symheli.lpv.connect : several systems, by names
    """
    if sign not in (1, -1):
        raise InputError(
            f"sign: expected +1 or -1, got {sign!r:.40}; feedback(P, K, sign=+1) closes u = +K y,"
            " this project's convention, and feedback(P, K, sign=-1) closes u = -K y, as"
            " control.feedback(P, K) does"
        )
    both = _Together.of((plant, controller))
    (nu, ny), other = both.sizes
    if other != (ny, nu):
        raise InputError(
            f"expected a controller with {ny} input(s) and {nu} output(s), got {other[0]} and"
            f" {other[1]}; {_channels(both.groups[1])} around {_channels(both.groups[0])}: choose"
            " some with P[outputs, inputs], or connect by names with lpv.lower_feedback"
        )
    K = np.zeros((nu + ny, ny + nu))
    K[:nu, ny:], K[nu:, :ny] = sign * np.eye(nu), np.eye(ny)
    return both.closed(K, np.eye(nu + ny)[:, :nu], np.eye(ny + nu)[:ny], *both.groups[0])


def connect(
    *systems: System,
    inputs: Sequence[str],
    outputs: Sequence[str],
    sums: Mapping[str, Mapping[str, float]] | None = None,
) -> Any:
    """Connect several systems into one: an input takes the output, the sum or the external input
    that has its name.

    Parameters
    ----------
    *systems : LinearModel, LPVStateSpace, LFT, UncertainStateSpace, python-control system or dict
        {(inputs, outputs): system} gives names, one or a sequence of them, to systems, transfer
        functions, numbers and matrices. Units of connected signals must agree; transfer functions
        and gains take those of the signals with their names.
    inputs : sequence of str
        The external ones.
    outputs : sequence of str
        Outputs of the systems, sums and external inputs.
    sums : mapping, optional
        {name: {signal: gain, ...}} with outputs, external inputs and other sums as signals. Under
        the name of an input it is the source of that input; under any other name it is a signal of
        its own, for inputs, outputs and other sums.

    Returns
    -------
    LinearModel, LPVStateSpace, LFT or UncertainStateSpace
        From `inputs` to `outputs`, of the most general kind among the systems.

    Raises
    ------
    InputError
        An input is left open, an output name is used twice, sums that need each other, or a
        singular loop.

    See Also
    --------
    symheli.lpv.feedback : a loop of two systems
    symheli.lpv.series : one system after the other
    symheli.lpv.append : systems side by side

    Examples
    --------
    >>> loop = lpv.connect(
    ...     spring,
    ...     inputs=["r"],
    ...     outputs=["y1", "error"],
    ...     sums={"error": {"r": 1.0, "y1": -1.0}, "u1": {"error": 2.0}},
    ... )
    >>> loop.at(0.0).A.round(6) + 0.0
    array([[ 0.,  1.],
           [-4., -1.]])

    The same with the controller as a block:

    >>> same = lpv.connect(
    ...     spring,
    ...     {("error", "u1"): 2.0},
    ...     inputs=["r"],
    ...     outputs=["y1", "error"],
    ...     sums={"error": {"r": 1.0, "y1": -1.0}},
    ... )
    >>> np.allclose(same.at(0.0).A, loop.at(0.0).A)
    True
    """
    both = _Together.of(_blocks(systems), by_name=True)
    fed, given = (list(chain(*(group[side] for group in both.groups))) for side in (0, 1))
    if twice := sorted({str(y) for y in given if given.count(y) > 1}):
        raise InputError(
            f"several systems have an output called {', '.join(twice)}; rename all but one"
        )
    external, sums = [_external(name, fed) for name in inputs], dict(sums or {})
    known = [*given, *external]
    single = {str(s): row for s, row in reversed(list(zip(known, np.eye(len(known)), strict=True)))}
    used = {*map(str, fed), *outputs, *chain(*sums.values())}
    for name in sums:
        if name not in used:
            raise UnknownNameError("input", name, sorted(set(map(str, fed))))
        if name in single and name not in fed:
            raise InputError(f"sums: {name!r} is the name of an output or an external input")

    def row(name: str, above: tuple[str, ...] = ()) -> Array:
        """Row of a signal in terms of the outputs and the external inputs."""
        if name in single:
            return single[name]
        if name in above:
            raise InputError(f"sums: {' needs '.join((*above, name))}, and never ends")
        if name not in sums:
            raise UnknownNameError("output, external input or sum", name, sorted({*single, *sums}))
        return total(name, (*above, name))

    def total(name: str, above: tuple[str, ...] = ()) -> Array:
        terms = (gain * row(str(signal), above) for signal, gain in sums[name].items())
        return np.sum([np.zeros(len(known)), *terms], axis=0)

    def source(u: Signal) -> Array:
        """Source of an input of a system."""
        if str(u) in sums:
            return total(str(u), (str(u),) if u not in known else ())
        if u in given and u in external:
            raise InputError(
                f"the input {u!s} could be fed by an output or by an external input of that name;"
                " say which in sums"
            )
        if u not in known:
            raise InputError(
                f"nothing feeds the input {u!s}: no output or external input has that name, nor"
                " does sums mention it"
            )
        _same_unit(u, known[known.index(u)])
        return row(str(u))

    into = np.reshape([source(u) for u in fed], (len(fed), len(known)))
    seen = np.reshape([row(str(y)) for y in outputs], (len(outputs), len(known)))
    K, E, F, G = (M for rows in (into, seen) for M in np.split(rows, [len(given)], axis=1))
    kept = [known[known.index(y)] if y in known else Signal(y) for y in map(Signal, outputs)]
    return both.closed(K, E, F, external, kept, G)


def multiplied(system: System, factor: float) -> Any:
    """Return the system with its outputs times a number, under its names; exact."""
    alone = _Together.of((system,))
    ((nu, ny),) = alone.sizes
    return alone.closed(np.zeros((nu, ny)), np.eye(nu), factor * np.eye(ny), *alone.groups[0])


def star(upper: LFT, lower: System, outputs: int, inputs: int | None) -> Any:
    """See `LFT.star`."""
    both = _Together.of((upper, lower))
    (own_u, own_y), (other_u, other_y) = both.groups
    inputs = len(other_y) if inputs is None else inputs
    nu, ny, mu, my = len(own_u), len(own_y), len(other_u), len(other_y)
    if not (0 <= outputs <= min(ny, mu) and 0 <= inputs <= min(nu, my)):
        raise InputError(
            f"star product: {outputs} of {ny} outputs cannot feed {mu} inputs, or"
            f" {inputs} of {my} outputs of the other cannot feed {nu} inputs; a"
            " series connection needs as many inputs as outputs of the other"
        )
    if outputs == 0 and inputs != nu:
        raise InputError(
            f"series connection needs as many inputs ({nu}) as outputs of the other ({inputs})"
        )
    K = np.zeros((nu + mu, ny + my))
    K[nu : nu + outputs, ny - outputs : ny] = np.eye(outputs)
    K[nu - inputs : nu, ny : ny + inputs] = np.eye(inputs)
    E = np.eye(nu + mu)[:, [*range(nu - inputs), *range(nu + outputs, nu + mu)]]
    F = np.eye(ny + my)[[*range(ny - outputs), *range(ny + inputs, ny + my)]]
    free = distinct([own_u[: nu - inputs], other_u[outputs:]])
    return both.closed(K, E, F, free, distinct([own_y[: ny - outputs], other_y[inputs:]]))


NAMES = ("states", "inputs", "outputs")


@dataclass(frozen=True)
class _Together:
    """Systems side by side as one `model` of their common `kind`, and the positions `into` and
    `out` of the inputs and outputs of each in that model, which has the channels of an uncertain
    system first.
    """

    model: LPVStateSpace | LFT
    kind: type
    groups: tuple[tuple[tuple[Signal, ...], tuple[Signal, ...]], ...]
    into: Array
    out: Array
    uncertain: UncertainStateSpace | None

    @classmethod
    def of(cls, systems: Sequence[System], *, by_name: bool = False) -> _Together:
        """Raises `InputError` for no system, two uncertain ones, one that is none."""
        if not systems:
            raise InputError("append needs at least one system")
        given = [_system(s, by_name=by_name) for s in systems]
        uncertain = [s for s in given if isinstance(s, UncertainStateSpace)]
        groups = tuple((s.inputs, s.outputs) for s in given)
        plain = [_open(s) if isinstance(s, UncertainStateSpace) else s for s in given]
        into, out = (
            np.array(
                [
                    name in own[side]
                    for s, own in zip(plain, groups, strict=True)
                    for name in (s.inputs, s.outputs)[side]
                ],
                dtype=bool,
            )
            for side in (0, 1)
        )
        if len(uncertain) > 1 or (uncertain and any(isinstance(s, LFT) for s in plain)):
            raise InputError(
                f"got {len(uncertain)} uncertain system(s) and"
                f" {sum(isinstance(s, LFT) for s in plain)} LFT(s): a set of models with several"
                " blocks is no UncertainStateSpace"
            )
        linear = all(isinstance(s, LinearModel) for s in plain)
        if linear or any(isinstance(s, LFT) for s in plain):
            model: LPVStateSpace | LFT = append_lfts(*map(_as_lft, plain))
            return cls(model, LinearModel if linear else LFT, groups, into, out, None)
        period = common_period(plain)
        models = (
            LPVStateSpace.constant(s) if isinstance(s, LinearModel) else s
            for s in (replace(s, dt=period) for s in plain)
        )
        names = [distinct([getattr(s, group) for s in plain]) for group in NAMES]
        model = replace(reduce(append_lpv, models), **dict(zip(NAMES, names, strict=True)))
        return cls(model, LPVStateSpace, groups, into, out, uncertain[0] if uncertain else None)

    @property
    def sizes(self) -> list[tuple[int, int]]:
        """Numbers of inputs and outputs of each system."""
        return [(len(u), len(y)) for u, y in self.groups]

    def closed(
        self,
        K: Array,
        E: Array,
        F: Array,
        inputs: Sequence[Signal],
        outputs: Sequence[Signal],
        G: Array | None = None,
    ) -> Any:
        """u = K y + E r, outputs F y + G r, under these names."""
        d, v = np.flatnonzero(~self.into), np.flatnonzero(~self.out)
        into, out = np.flatnonzero(self.into)[:, None], np.flatnonzero(self.out)
        (nr, nz), (nu, ny) = (len(inputs), len(outputs)), (len(self.into), len(self.out))
        whole_K, whole_E = np.zeros((nu, ny)), np.zeros((nu, nr + len(d)))
        whole_F, whole_G = np.zeros((nz + len(v), ny)), np.zeros((nz + len(v), nr + len(d)))
        whole_K[into, out], whole_E[into[:, 0], :nr], whole_F[:nz, out] = K, E, F
        whole_E[d, nr + np.arange(len(d))] = 1.0  # the block stays open
        whole_F[nz + np.arange(len(v)), v] = 1.0
        if G is not None:
            whole_G[:nz, :nr] = G
        r, z = (
            (*inputs, *(self.model.inputs[i] for i in d)),
            (*outputs, *(self.model.outputs[i] for i in v)),
        )
        if isinstance(self.model, LFT):
            found = close_lft(self.model, whole_K, whole_E, whole_F, r, z, whole_G)
            return found if self.kind is LFT else found.at()
        found = combined(close_static(self.model, whole_K), whole_E, whole_F, whole_G, r, z)
        if self.uncertain is None:
            return found
        block = {"perturbation_inputs": r[nr:], "perturbation_outputs": z[nz:]}
        return replace(self.uncertain, model=found, **block)


def _as_lft(system: LinearModel | LPVStateSpace | LFT) -> LFT:
    if isinstance(system, LFT):
        return system
    return LFT.constant(system) if isinstance(system, LinearModel) else system.to_lft()


def _open(unc: UncertainStateSpace) -> LPVStateSpace:
    """The model with the channels of the block last."""
    inputs = (*unc.inputs, *unc.perturbation_inputs)
    return unc.model.select(inputs=inputs, outputs=(*unc.outputs, *unc.perturbation_outputs))


def _blocks(systems: Sequence[System]) -> list[System]:
    """The systems, those of a dictionary under the names that it gives; what has no units gets
    those of the signals that have its names.
    """
    plain = [s for s in systems if not isinstance(s, Mapping) and not is_control_system(s)]
    units = {
        str(name): name.unit
        for s in plain
        for name in (*getattr(s, "inputs", ()), *getattr(s, "outputs", ()))
        if isinstance(name, Signal)
    }
    found = []
    for given in systems:
        for key, block in (given if isinstance(given, Mapping) else {None: given}).items():
            if key is not None and not (isinstance(key, tuple) and len(key) == 2):
                raise InputError(f"expected {{(inputs, outputs): system}}, got the key {key!r}")
            if key is None and not is_control_system(block):
                found.append(block)
                continue
            model = _system(block, by_name=False)
            own = model is block
            u, y = (
                tuple(
                    Signal(new, old.unit if own else units.get(new))
                    for new, old in zip(_as_many(names, known), known, strict=True)
                )
                for names, known in zip(
                    key or (model.inputs, model.outputs), (model.inputs, model.outputs), strict=True
                )
            )
            found.append(replace(model, inputs=u, outputs=y))
    return found


def _as_many(names: str | Sequence[str], known: Sequence[Signal]) -> Sequence[str]:
    given = [names] if isinstance(names, str) else list(names)
    if len(given) != len(known):
        raise InputError(
            f"expected {len(known)} name(s), for {', '.join(known) or 'nothing'}, got"
            f" {', '.join(given)}"
        )
    return given


def _system(given: System, *, by_name: bool) -> Any:
    """A value of this package: a gain and a system of python-control as a `LinearModel`."""
    if isinstance(given, LinearModel | LPVStateSpace | LFT | UncertainStateSpace):
        return given
    if is_control_system(given):
        return LinearModel.from_control(given)
    if not isinstance(given, int | float | np.number | np.ndarray | list):
        raise InputError(
            "expected an LFT, a LinearModel, an LPVStateSpace, a system of python-control, a real"
            f" number or a matrix to connect, got {type(given).__name__}"
        )
    if by_name:
        raise InputError(
            "a bare gain has no names to connect it by: write it into sums={input: {signal: gain}},"
            " or give names to its signals, {(inputs, outputs): gain}"
        )
    gain = np.atleast_2d(frozen(given, "gain"))
    ny, nu = gain.shape
    return LinearModel.gain(
        gain, [f"u{i + 1}" for i in range(nu)], [f"y{i + 1}" for i in range(ny)]
    )


def _listed(kind: str, names: Sequence[Signal]) -> str:
    return f"{kind} {', '.join(names) or 'none'}"


def _channels(group: tuple[Sequence[Signal], Sequence[Signal]]) -> str:
    """The names of the inputs and outputs of a system."""
    return f"({_listed('inputs', group[0])}; {_listed('outputs', group[1])})"


def _external(name: str, inputs: Sequence[Signal]) -> Signal:
    """The external signal, with the unit of the inputs it feeds."""
    fed = [u for u in inputs if u == name]
    for u in fed[1:]:
        _same_unit(u, fed[0])
    return Signal(name, fed[0].unit) if fed else Signal(name)


def _same_unit(one: Signal, other: Signal) -> None:
    if one.unit != other.unit:
        raise InputError(
            f"{one!s} is in {one.unit} on one side and in {other.unit} on the other; convert with a"
            " gain in sums"
        )
