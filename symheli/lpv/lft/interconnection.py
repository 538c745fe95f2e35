"""Systems connected by the names of their signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.lft.algebra import append, close
from symheli.lpv.lft.model import LFT
from symheli.lpv.lft.systems import System, as_lft
from symheli.values.signal import Signal


def connect(
    *systems: System,
    inputs: Sequence[str],
    outputs: Sequence[str],
    sums: Mapping[str, Mapping[str, float]] | None = None,
) -> LFT:
    """Connect several systems into one: an input takes the output, or the external input, that has
    its name.

    Parameters
    ----------
    *systems : LFT, LPVStateSpace, LinearModel or a system of python-control
        Units of connected signals must agree.
    inputs : sequence of str
        The external ones.
    outputs : sequence of str
        Outputs of the systems.
    sums : mapping, optional
        Gives an input another source, {input: {signal: gain, ...}} with outputs and external
        inputs as signals.

    Returns
    -------
    LFT
        From `inputs` to `outputs`.

    Raises
    ------
    InputError
        An input is left open, an output name is used twice, or a loop is singular.

    Examples
    --------
    >>> loop = lpv.connect(
    ...     spring, inputs=["r"], outputs=["y1"], sums={"u1": {"r": 1.0, "y1": -2.0}}
    ... )
    >>> loop.at(0.0).A.round(6) + 0.0
    array([[ 0.,  1.],
           [-4., -1.]])
    """
    lfts = [as_lft(s, by_name=True) for s in systems]
    whole = append(*lfts)
    given_inputs = list(chain(*(s.inputs for s in lfts)))
    given_outputs = list(chain(*(s.outputs for s in lfts)))
    twice = sorted({str(y) for y in given_outputs if given_outputs.count(y) > 1})
    if twice:
        raise InputError(
            f"several systems have an output called {', '.join(twice)}; rename all but one"
        )
    sums = dict(sums or {})
    for name in sums:
        if name not in given_inputs:
            raise UnknownNameError("input", name, sorted(set(map(str, given_inputs))))
    external = [_external(name, given_inputs) for name in inputs]
    known = [*given_outputs, *external]
    K, E = (
        np.zeros((len(given_inputs), len(given_outputs))),
        np.zeros((len(given_inputs), len(external))),
    )
    for i, u in enumerate(given_inputs):
        if u not in sums and u not in known:
            raise InputError(
                f"nothing feeds the input {u!s}: no output or external input has that name, nor"
                " does sums mention it"
            )
        both = [name for name in (u,) if u not in sums and u in given_outputs and u in external]
        if both:
            raise InputError(
                f"the input {u!s} could be fed by an output or by an external input of that name;"
                " say which in sums"
            )
        for name, gain in sums.get(str(u), {str(u): 1.0}).items():
            if name not in known:
                raise UnknownNameError("output or external input", name, sorted(map(str, known)))
            if name in given_outputs:
                j = given_outputs.index(name)  # type: ignore[arg-type]
                K[i, j] += gain
                if str(u) not in sums:
                    _same_unit(u, given_outputs[j])
            else:
                E[i, external.index(name)] += gain  # type: ignore[arg-type]
    F = np.zeros((len(outputs), len(given_outputs)))
    for row, name in enumerate(outputs):
        if name not in given_outputs:
            raise UnknownNameError("output", name, sorted(map(str, given_outputs)))
        F[row, given_outputs.index(Signal(name))] = 1.0
    kept = [given_outputs[given_outputs.index(Signal(name))] for name in outputs]
    return close(whole, K, E, F, external, kept)


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
