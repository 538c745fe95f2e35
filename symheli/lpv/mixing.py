"""Inputs and outputs of an LPV model as constant combinations of others, exact in every basis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.lpv_matrices import Matrices
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.values.arrays import Array
from symheli.values.signal import Signal, indices

Sum = Mapping[Any, float]
"""{signal: gain}."""
ERROR = "_error"
"""Suffix of the name of a signal that is reference minus measured."""


def mixed(
    lpv: LPVStateSpace,
    inputs: Mapping[Signal, Sum],
    outputs: Mapping[Signal, Sum],
    across: Mapping[Signal, Sum] | None = None,
) -> LPVStateSpace:
    """The model with new inputs and outputs, in this order; the trim is left out.

    `inputs` {new: {old: gain}} says what each drives, `outputs` {new: {old: gain}} of which it is
    the sum, `across` {new output: {new input: gain}} what goes straight from the new inputs to the
    new outputs. Raises `UnknownNameError`.
    """
    into = _matrix(inputs, lpv.inputs, "input").T
    out = _matrix(outputs, lpv.outputs, "output")
    straight = {name: (across or {}).get(name, {}) for name in outputs}
    through = _matrix(straight, list(inputs), "input")

    return combined(lpv, into, out, through, tuple(inputs), tuple(outputs))


def combined(
    lpv: LPVStateSpace,
    E: Array,
    F: Array,
    G: Array,
    inputs: Sequence[Signal],
    outputs: Sequence[Signal],
) -> LPVStateSpace:
    """The model with its inputs E r and the outputs F y + G r, called `inputs` (r) and
    `outputs`.
    """

    def between(A: Array, B: Array, C: Array, D: Array) -> Matrices:
        return Matrices(A, B @ E, F @ C, F @ D @ E)

    A, B, C, D = between(lpv.A, lpv.B, lpv.C, lpv.D)
    if np.any(G):
        D = D + np.multiply.outer(lpv.basis.constant(), G)
    names = {"inputs": tuple(inputs), "outputs": tuple(outputs)}
    model = replace(lpv, A=A, B=B, C=C, D=D, trim=None, residuals=None, **names)
    if (origin := lpv.fitted_to) is None:
        return model
    exact = between(*origin.matrices)
    return model.with_residuals(origin.nodes, exact._replace(D=exact.D + G))


def turned(model: LPVStateSpace, names: Mapping[str, str]) -> LPVStateSpace:
    """The model with these inputs {name: other name} read with the other sign."""
    own = {str(y): str(names[y]) for y in model.inputs if y in names and names[y] != y}
    if not own:
        return model
    inputs = {
        Signal(own[y], y.unit) if y in own else y: {y: -1.0 if y in own else 1.0}
        for y in model.inputs
    }
    if len(inputs) < len(model.inputs):
        raise InputError(
            f"the controller reads {', '.join(own.values())} and {', '.join(own)}: give it one of"
            " the two"
        )
    return mixed(model, inputs, itself(model.outputs))


def itself(names: Iterable[Signal]) -> dict[Signal, Sum]:
    """Every signal as it is, for `mixed`."""
    return {name: {name: 1.0} for name in names}


def _matrix(sums: Mapping[Signal, Sum], known: Sequence[str], kind: str) -> Array:
    """One row a sum, one column a known name."""
    out = np.zeros((len(sums), len(known)))
    for row, terms in zip(out, sums.values(), strict=True):
        row[indices(terms, known, kind)] = list(terms.values())
    return out
