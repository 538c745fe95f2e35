"""Bounds of deviations by the energy of gusts, while the flight stays in its tube."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.numerics.program.cone_program import Solver
from synthesis.tubes.files import numbers, read_multipliers, written_multipliers
from synthesis.tubes.inequality import Multipliers
from synthesis.tubes.proof import is_above, is_bounded
from synthesis.tubes.search import Enclosed, least_gain

SPARE = 1e-3
"""Spare of the inequality in the search, 1/s, for outputs in units of their half widths."""
ABOVE = 1 + 1e-6
"""Factor on what the search finds, so that the exact check has some spare."""


@dataclass(frozen=True, eq=False)
class LocalGain:
    """A bound of z, the deviations of `outputs`, by the gusts w, for flights within the tube.

    With V = e'Q e, |w| <= gust:

    - energy: integral of |z|^2 <= gamma^2 times that of |w|^2 + bias T + V(0) over T seconds,
    - else |z(T)|^2 <= gamma^2 times the integral of |w|^2 + bias T + V(0).

    Attributes
    ----------
    outputs : tuple of str
        States, together as the root of the sum of squares, SI.
    energy : bool
    gust : float
        m/s, or the size of w; of the tube.
    Q : array (k, n, n)
        At the nodes of the scheduling command, linear between.
    multipliers : tuple of Multipliers
        Of each cell; their `wind` is (gamma gust)^2.
    bias : float
        What the reference misses of the equations, per second.
    states : tuple of str
        Of the model.

    Examples
    --------
    >>> import casadi
    >>> from synthesis.tubes import Motions, tube
    >>> x, u, w, c = (casadi.SX.sym(n, k) for n, k in (("x", 1), ("u", 1), ("w", 1), ("c", 0)))
    >>> model = casadi.Function("cubic", [x, u, w], [u - x**3 + w])
    >>> rest = casadi.Function("rest", [c], [casadi.SX(0), casadi.SX(0)])
    >>> found = tube(model, Motions(rest, [[-1.0]]), gust=0.1, sizes=[0.1]).with_gain(["x0"])
    >>> 1 <= found.gains[0].gamma < 1.02
    True
    """

    outputs: tuple[str, ...]
    energy: bool
    gust: float
    Q: Array
    multipliers: tuple[Multipliers, ...]
    bias: float
    states: tuple[str, ...]

    __repr__ = summarized

    @property
    def gamma(self) -> float:
        """SI unit of the outputs per unit of w, times a second^-1/2 for peaks."""
        return float(max(by.wind[0, 0] for by in self.multipliers) ** 0.5 / self.gust)

    def __str__(self) -> str:
        kind = "energy" if self.energy else "peak"
        return (
            f"{kind} of {', '.join(self.outputs)} by the energy of the gusts: {self.gamma:.4g}"
            f" (and {self.bias:.2g} per second)"
        )

    @property
    def written(self) -> dict[str, Any]:
        """The bound as JSON holds it."""
        return {
            "outputs": list(self.outputs),
            "energy": self.energy,
            "gust": self.gust,
            "Q": self.Q.tolist(),
            "multipliers": [written_multipliers(by) for by in self.multipliers],
            "bias": self.bias,
        }

    @classmethod
    def read(
        cls, given: dict[str, Any], nodes: int, states: tuple[str, ...], moved: int, gust: float
    ) -> LocalGain:
        """The bound so written, for a tube with so many nodes and these states, of which the first
        ones are those of the model, in gusts of this size. Raises `ValueError` for a bound in
        others: the inequality is in units of the tube's gust, and `gamma` divides by it.
        """
        n, own = len(states), float(numbers(given["gust"]))
        if not (own == gust > 0):
            raise ValueError(f"a gain in gusts of {own:g} in a tube in gusts of {gust:g}")
        return cls(
            tuple(map(str, given["outputs"])),
            bool(given["energy"]),
            own,
            numbers(given["Q"], nodes, n, n),
            tuple(read_multipliers(by, moved) for by in given["multipliers"]),
            float(numbers(given["bias"])),
            states,
        )

    @property
    def has_storage(self) -> bool:
        """Whether V is positive, and above |z|^2 where that is bounded, at all nodes; exactly."""
        output = output_matrix(self.states, self.outputs)
        return is_above(self.Q, 0 * output if self.energy else output)

    def holds_in(self, k: int, made: Enclosed, values: Array) -> bool:
        """Whether the inequality holds in cell k, exactly; values (nodes,) of the command."""
        by, nodes = self.multipliers[k], list(made.nodes)
        output = output_matrix(self.states, self.outputs)
        return by.terms.shape == (len(made.over.left),) * 2 and is_bounded(
            self.Q[nodes],
            values[nodes],
            made.cell,
            made.over,
            by,
            output if self.energy else 0 * output,
            self.bias,
        )


def output_matrix(states: Sequence[str], outputs: Sequence[str]) -> Array:
    """(k, n), which takes these states from all."""
    names = [str(name) for name in states]
    if isinstance(outputs, str) or not outputs or not set(outputs) <= set(names):
        raise InputError(f"outputs must be a list of some of {', '.join(names)}; got {outputs!r}")
    return np.eye(len(names))[[names.index(name) for name in outputs]]


def least(
    cells: Sequence[Enclosed],
    P: Array,
    states: Sequence[str],
    outputs: Sequence[str],
    energy: bool,
    gust: float,
    solver: Solver,
) -> LocalGain | None:
    """The least bound found on these cells of a tube P, not yet checked; None: none was."""
    output = output_matrix(states, outputs)
    inside = np.linalg.inv(P)
    size = np.sqrt(np.einsum("ki,nij,kj->n", output, inside, output).max())
    roots = np.linalg.inv(np.swapaxes(np.linalg.cholesky(P), 1, 2))
    found = least_gain(cells, roots, output / size, energy, SPARE, solver)
    if found is None:
        return None
    scale = size**2
    made = [
        Multipliers(
            scale * by.tube, scale * by.gust, scale * by.terms, ABOVE * scale * by.wind, 0.0
        )
        for by in found.multipliers
    ]
    return LocalGain(
        tuple(outputs),
        energy,
        gust,
        scale * found.P,
        tuple(made),
        ABOVE * scale * found.bias,
        tuple(map(str, states)),
    )
