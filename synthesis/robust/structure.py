"""The loop of a model and its uncertain blocks, each normalised to one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LFT, LPVStateSpace
from symheli.lpv.lft.model import parts
from symheli.values.signal import indices
from synthesis.program.scaling import balance
from synthesis.worst.frozen import stable, to_continuous

Array = np.ndarray


class DynamicBlock(NamedTuple):
    """Unknown stable linear dynamics from `outputs` of a model back to its `inputs`, of gain at
    most `bound` at every frequency, in units of the inputs per unit of the outputs.

    Examples
    --------
    >>> DynamicBlock(["d"], ["v"], 0.5).bound
    0.5
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    bound: float = 1.0


class Part(NamedTuple):
    """A block of the loop: `rows` of z and `columns` of w; `real`: the same number at each."""

    rows: slice
    columns: slice
    real: bool


class Loop(NamedTuple):
    """x' = A x + B w, z = C x + D w, w = Delta z with one block of norm <= 1 a part; the last part
    may be the performance. Sampled models stand as continuous ones of the same norms. `sizes` (nz,)
    of the outputs of full blocks in units of the model, `middles` and `radii` of the parameters, 0
    of those that the model does not depend on.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    parts: tuple[Part, ...]
    dt: float | None
    sizes: Array
    middles: Array
    radii: Array

    @property
    def reals(self) -> int:
        """Number of real parts; they come first."""
        return sum(part.real for part in self.parts)

    def physical(self, delta: Array) -> float | tuple[float, ...]:
        """Return the parameters of normalised ones; of one a number."""
        p = self.middles.copy()
        p[self.radii > 0] += self.radii[self.radii > 0] * delta
        found = tuple(map(float, p))
        return found[0] if len(found) == 1 else found

    def unscaled(self, delta: Array) -> Array:
        """Return full blocks (nw, nz) in units of the model."""
        return delta * self.sizes

    def response(self, omega: float) -> Array:
        """Return the matrix from w to z at a frequency of the continuous model; inf: D."""
        return self.responses(np.array([omega]))[0]

    def responses(self, omega: Array) -> Array:
        """Return the matrices (K, nz, nw) at frequencies (K,)."""
        finite = np.where(np.isinf(omega), 0.0, omega)
        pencil = 1j * finite[:, None, None] * np.eye(len(self.A)) - self.A
        passed = self.C @ np.linalg.solve(
            pencil, np.broadcast_to(self.B, (len(omega), *self.B.shape))
        )
        return self.D + np.where(np.isinf(omega)[:, None, None], 0.0, passed)

    def frequency(self, omega: float) -> float:
        """Return the frequency of the model itself, rad/s."""
        return omega if self.dt is None else 2 * math.atan(omega) / self.dt

    def closed(self, delta: Array) -> Loop:
        """Return the loop with its real parts at these values: those parts are gone."""
        real = [p for p in self.parts if p.real]
        n = real[-1].rows.stop if real else 0
        values = np.concatenate(
            [np.full(p.rows.stop - p.rows.start, v) for p, v in zip(real, delta, strict=True)]
            or [np.zeros(0)]
        )
        gain = values[:, None] * np.linalg.inv(np.eye(n) - self.D[:n, :n] * values)
        B, C, D = self.B, self.C, self.D
        rest = tuple(
            Part(_shifted(p.rows, n), _shifted(p.columns, n), False)
            for p in self.parts
            if not p.real
        )
        return Loop(
            self.A + B[:, :n] @ gain @ C[:n],
            B[:, n:] + B[:, :n] @ gain @ D[:n, n:],
            C[n:] + D[n:, :n] @ gain @ C[:n],
            D[n:, n:] + D[n:, :n] @ gain @ D[:n, n:],
            rest,
            *self[5:],
        )

    def in_units(self, level: float, performance: bool) -> Loop:
        """Return the loop with z in units of the level, of the last part alone where that is the
        performance, balanced between its parts at the middle of its frequencies.
        """
        rows, columns = np.ones(len(self.C)), np.ones(self.B.shape[1])
        for part in self.parts[-1:] if performance else self.parts:
            rows[part.rows] /= level
        paces = self.paces
        omega = math.exp(np.log(paces).mean()) if len(paces) else 0.0
        M = self.response(omega) * rows[:, None]
        size = np.array(
            [[np.linalg.norm(M[a.rows, b.columns]) for b in self.parts] for a in self.parts]
        )
        d = balance(size, np.zeros((len(size), 1)), np.zeros((1, len(size))))
        for part, own in zip(self.parts, d, strict=True):
            rows[part.rows] /= own
            columns[part.columns] *= own
        B, C = self.B * columns, rows[:, None] * self.C
        return self._replace(B=B, C=C, D=rows[:, None] * self.D * columns)

    @property
    def stable(self) -> bool:
        """Whether it is stable without its blocks."""
        return bool(stable(np.linalg.eigvals(self.A), None))

    @property
    def paces(self) -> Array:
        """Frequencies of the poles, > 0."""
        poles = np.abs(np.linalg.eigvals(self.A))
        return np.unique(poles[poles > 0])


def loop_of(
    model: LFT | LPVStateSpace, blocks: Sequence[DynamicBlock], performance: bool = False
) -> Loop:
    """Return the loop of a model whose parameters are constant and whose channels are closed by
    these blocks; with the other channels as the last part where `performance` is asked.

    Raises `InputError` for another model, a bound that is no finite number > 0, a signal of two
    blocks, or nothing uncertain; `UnknownNameError` for a signal that the model does not have.
    """
    if isinstance(model, LPVStateSpace):
        model = model.to_lft().reduce()
    if not isinstance(model, LFT):
        raise InputError(
            f"model: expected an LFT, or an LPVStateSpace that is polynomial, got"
            f" {type(model).__name__}"
        )
    into, out, sizes, columns, rows = [], [], [], [], []
    for each in blocks:
        if not isinstance(each, DynamicBlock) or not 0 < float(each.bound) < math.inf:
            raise InputError(
                "blocks: expected DynamicBlock(inputs, outputs, bound) with a finite bound > 0, got"
                f" {each!r:.80}"
            )
        columns.append(indices(_names(each.inputs), model.inputs, "input"))
        rows.append(indices(_names(each.outputs), model.outputs, "output"))
        into, out = [*into, *columns[-1]], [*out, *rows[-1]]
        sizes += [each.bound] * len(rows[-1])
    if len({*into}) < len(into) or len({*out}) < len(out):
        raise InputError("blocks: an input or an output belongs to one block only")
    if performance:
        columns.append([i for i in range(len(model.inputs)) if i not in into])
        rows.append([i for i in range(len(model.outputs)) if i not in out])
        into, out = [*into, *columns[-1]], [*out, *rows[-1]]
        sizes += [1.0] * len(rows[-1])
        if not (columns[-1] and rows[-1]):
            raise InputError("a gain needs an input and an output that belong to no block")
    if not (model.order or blocks):
        raise InputError("nothing is uncertain: the model has no parameter and there is no block")
    n, x, units = model.order, len(model.states), np.array(sizes).reshape(-1, 1)
    B = np.hstack([model.M21[:x], model.M22[:x, x:][:, into]])
    C = np.vstack([model.M12[:, :x], units * model.M22[x:, :x][out]])
    D = np.block(
        [
            [model.M11, model.M12[:, x:][:, into]],
            [units * model.M21[x:][out], units * model.M22[x:, x:][np.ix_(out, into)]],
        ]
    )
    real = [Part(part, part, True) for part in parts(model.sizes) if part.stop > part.start]
    full = [
        Part(slice(n + a.start, n + a.stop), slice(n + b.start, n + b.stop), False)
        for a, b in zip(parts([*map(len, rows)]), parts([*map(len, columns)]), strict=True)
    ]
    A = model.M22[:x, :x]
    if model.dt is not None:
        A, B, C, D = to_continuous(A, B, C, D)
    box = np.array([(s.middle, s.radius * (size > 0)) for s, size in model.blocks])
    return Loop(A, B, C, D, (*real, *full), model.dt, units[:, 0], *box.reshape(-1, 2).T)


def _shifted(part: slice, by: int) -> slice:
    return slice(part.start - by, part.stop - by)


def _names(given: str | Sequence[str]) -> Sequence[str]:
    return (given,) if isinstance(given, str) else given
