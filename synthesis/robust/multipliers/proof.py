"""The numbers that prove a gain by multipliers, and their exact check."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.numerics.polynomial.exact import matmul, positive_definite
from synthesis.numerics.polynomial.transfer import Transfer, inverse, rationals
from synthesis.robust.multipliers import inequality
from synthesis.robust.multipliers.boxes import BoxMultipliers
from synthesis.robust.multipliers.classes import (
    DynamicMultipliers,
    Filter,
    Lags,
    Multipliers,
    OwnMultipliers,
    ParameterMultipliers,
)
from synthesis.robust.multipliers.delays import DelayMultipliers
from synthesis.robust.multipliers.loop import Plant, Wired, extended, fractions
from synthesis.robust.multipliers.static import StaticMultipliers

TYPES: dict[str, type[Multipliers]] = {
    "static": StaticMultipliers,
    "delay": DelayMultipliers,
    "parameter": ParameterMultipliers,
    "dynamics": DynamicMultipliers,
    "own": OwnMultipliers,
    "box": BoxMultipliers,
}
"""Classes by their names in files."""
NAMES = {kind: name for name, kind in TYPES.items()}
NOMINAL = "the nominal loop is not stable"


class GainProof(NamedTuple):
    """A model with its blocks, P and the coefficients of the multipliers, for one gain."""

    plant: Plant
    dt: float | None
    blocks: tuple[Wired, ...]
    P: Array
    coefficients: tuple[Array, ...]
    gain: float

    def fault(self) -> str:
        """Return why nothing is proven; empty where the gain is, in exact arithmetic."""
        return self.fault_of_blocks() or self._fault_of_inequality()

    def fault_of_blocks(self) -> str:
        """Return why the blocks and this loop do not fit; empty where they do."""
        plant, exact = self.plant, self.plant.exact()
        wrong = fault_of_channels(plant, self.blocks)
        if wrong:
            return wrong
        N = np.zeros((plant.B.shape[1], len(plant.C)), dtype=object) + Fraction(0)
        for kind, into, out in self.blocks:
            if len(into) == len(out):
                N[list(into), list(out)] = kind.nominal(Fraction)
        if np.any(matmul(exact.D, N)):
            loop = inverse(rationals(np.eye(len(exact.C))) - matmul(exact.D, N))
            N = matmul(N, loop)
        A = exact.A + matmul(matmul(exact.B, N), exact.C)
        none = np.zeros((len(A), 0)), np.zeros((0, len(A))), np.zeros((0, 0))
        if not Transfer.of(A, *none, plant.sampled).stable:
            return NOMINAL
        return ""

    def _fault_of_inequality(self) -> str:
        coefficients = [fractions(c) for c in self.coefficients]
        for (kind, _, _), c in zip(self.blocks, coefficients, strict=True):
            wrong = kind.fault_of(c)
            if wrong:
                return wrong
        if np.any(self.P != self.P.T) or not 0 <= self.gain < math.inf:
            return "P is not symmetric, or the gain no number"
        loop = extended(self.plant.exact(), self.blocks, Fraction)
        forms = [b.kind.form(c, Fraction) for b, c in zip(self.blocks, coefficients, strict=True)]
        g = Fraction(self.gain) ** 2
        F = inequality.left_side(
            loop, fractions(self.P), forms, self.plant.into, g, self.plant.sampled
        )
        return "" if positive_definite(-F) else "the inequality of the gain does not hold"

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file."""
        return written(self)

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> GainProof:
        """Return the proof of a file; raise `InputError` for shapes that do not fit."""
        return cls(*read(content))


def written(proof: Any) -> dict[str, Any]:
    """Return model, blocks, P and gain of a proof as a file holds them."""
    plant = proof.plant
    return {
        **{name: encoded(np.asarray(getattr(plant, name), float)) for name in "ABCD"},
        "dt": proof.dt,
        "into": list(plant.into),
        "out": list(plant.out),
        "P": encoded(proof.P),
        "gain": float(proof.gain),
        "blocks": [_written(b, c) for b, c in zip(proof.blocks, proof.coefficients, strict=True)],
    }


Read = tuple[Plant, float | None, tuple[Wired, ...], Array, tuple[Array, ...], float]


def read(content: Mapping[str, Any]) -> Read:
    """Return model, period, blocks, P, coefficients and gain of a file."""
    dt = None if content["dt"] is None else float(content["dt"])
    A, B, C, D = (np.asarray(decoded(content[name]), float) for name in "ABCD")
    n, m, p = len(A), B.shape[1], len(C)
    shapes = ((A, "A", (n, n)), (B, "B", (n, m)), (C, "C", (p, n)), (D, "D", (p, m)))
    for M, name, shape in shapes:
        frozen(M, name, shape)
    into, out = (_numbers(content[name], size) for name, size in (("into", m), ("out", p)))
    plant = Plant(A, B, C, D, into, out, dt is not None)
    both = [_read(each, m, p) for each in content["blocks"]]
    blocks = tuple(block for block, _ in both)
    size = len(extended(plant, blocks, float).A)
    P = frozen(decoded(content["P"]), "P", (size, size))
    return plant, dt, blocks, P, tuple(c for _, c in both), float(content["gain"])


def fault_of_channels(plant: Plant, blocks: Sequence[Wired]) -> str:
    """Return why channels or numbers of the blocks do not fit; empty where they do."""
    inputs = [i for b in blocks for i in b.inputs]
    outputs = [j for b in blocks for j in b.outputs]
    if len({*inputs, *plant.into}) < len(inputs) + len(plant.into):
        return "an input belongs to two blocks, or to one and to the outside"
    if sorted([*inputs, *plant.into]) != list(range(plant.B.shape[1])):
        return "an input belongs to no block and is not outside"
    direct = np.any(plant.D[np.ix_(outputs, inputs)])
    if direct and any(_needs_time(b.kind) for b in blocks):
        return (
            "an output of a block depends on an input of one at the same instant: put a lag between"
        )
    for kind, _, own in blocks:
        if kind.moving and (plant.sampled or np.any(plant.D[list(own)])):
            return "Popov's term is for outputs without feedthrough, in continuous time"
        if isinstance(kind, DelayMultipliers) and plant.sampled:
            return "multipliers of a delay are for continuous time"
        wrong = kind.fault(plant.sampled)
        if wrong:
            return wrong
    return ""


def _needs_time(kind: Multipliers) -> bool:
    """Whether a path without delay around the block is refused."""
    return not isinstance(kind, ParameterMultipliers | DynamicMultipliers | BoxMultipliers)


def _written(block: Wired, c: Array) -> dict[str, Any]:
    kind = block.kind
    own: dict[str, Any] = {"type": NAMES[type(kind)]}
    own |= {"inputs": list(block.inputs), "outputs": list(block.outputs)}
    for name in kind.fields:
        value = getattr(kind, name)
        own[name] = value
    if isinstance(kind, OwnMultipliers):
        own["filter"] = [encoded(np.asarray(M, float)) for M in kind.given]
        own["forms"] = [encoded(np.asarray(M, float)) for M in kind.forms]
    own |= {"poles": [float(v) for v in kind.lags.poles], "order": kind.lags.order}
    return {**own, "coefficients": encoded(np.asarray(c, float))}


def _read(content: Mapping[str, Any], inputs: int, outputs: int) -> tuple[Wired, Array]:
    kind = TYPES.get(content["type"])
    if kind is None:
        raise InputError(f"a block of the type {content['type']!r:.40} is not known")
    into, out = _numbers(content["inputs"], inputs), _numbers(content["outputs"], outputs)
    poles, order = tuple(float(v) for v in content["poles"]), content["order"]
    if isinstance(order, bool) or not isinstance(order, int) or not 0 <= order <= 60:
        raise InputError(f"order: expected an integer from 0 to 60, got {order!r:.40}")
    lags = Lags(poles, order)
    own = {name: kind.fields[name](content[name]) for name in kind.fields}
    if kind is OwnMultipliers:
        given = Filter(*(np.asarray(decoded(M), float) for M in content["filter"]))
        forms = tuple(np.asarray(decoded(M), float) for M in content["forms"])
        made: Any = OwnMultipliers(len(into), given, forms, Lags((), 0))
    else:
        make: Any = kind
        made = make(channels=len(into), lags=lags, **own)
    if isinstance(made, DynamicMultipliers) and made.measured != len(out):
        raise InputError("a block has other channels than its multipliers")
    if not isinstance(made, DynamicMultipliers | OwnMultipliers) and len(into) != len(out):
        raise InputError("a block has other inputs than outputs")
    c = frozen(decoded(content["coefficients"]), "coefficients", (made.count,))
    return Wired(made, into, out), c


def _numbers(values: Any, size: int) -> tuple[int, ...]:
    found = tuple(values)
    good = all(isinstance(v, int) and not isinstance(v, bool) and 0 <= v < size for v in found)
    if not good or len(set(found)) < len(found):
        raise InputError(f"expected different numbers of channels below {size}, got {found!r:.60}")
    return found
