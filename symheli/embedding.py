"""Exact quasi-LPV models of nonlinear equations, x' = x0' + A(p) (x - x0) + B(p) (u - u0).

By the mean value theorem in integral form f(z) - f(z0) is the Jacobian averaged over the straight
line from z0 to z, times z - z0. Where f is affine in some of the variables the line moves in the
others alone, and the average depends on these alone. The average is a Gauss-Legendre sum, exact for
polynomials and to rounding for smooth functions. Source: Koelewijn and Toth, "Automatic grid-based
LPV embedding of nonlinear systems" (2021); `nlss2lpvss` of LPVcore.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import casadi
import numpy as np
from scipy.linalg import qr

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.bases.polynomials import polynomials
from symheli.lpv.bases.product import Product
from symheli.lpv.entries import entries
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.named_vector import NamedVector
from symheli.values.signal import Signal, signals
from symheli.values.summary import summarized

NODES = (2, 4, 8, 16, 32, 64)
"""Numbers of nodes of the Gauss-Legendre quadrature, tried in turn."""
SAMPLES = 500
"""Number of random states at which the quadrature, the parameters and their ranges are checked."""
MAX_CORNERS = 4096
"""Largest number of corners of the variables' ranges that are checked in addition."""
CONSTANT_ENTRY = 1e-11
"""An entry that changes over the samples by less than this fraction of its size is constant."""
MIN_PIVOT = 1e-10
"""Fraction of the first pivot below which an entry is an affine function of the preceding ones."""
MAX_OPEN = 12
"""Largest number of variables, in products with others only, of which the fewest are looked for by
trying all sets of them; of more all are taken.
"""
RANGE_MARGIN = 0.02
"""The ranges of the parameters are those of the samples, widened by this fraction at both ends."""

KINKS = {
    casadi.OP_FABS: "fabs",
    casadi.OP_SIGN: "sign",
    casadi.OP_FMIN: "fmin",
    casadi.OP_FMAX: "fmax",
    casadi.OP_LT: "<",
    casadi.OP_LE: "<=",
    casadi.OP_IF_ELSE_ZERO: "if_else",
    casadi.OP_FLOOR: "floor",
    casadi.OP_CEIL: "ceil",
}


@dataclass(frozen=True, eq=False)
class Embedding:
    """A quasi-LPV model with the functions from states and inputs to its parameters.

    x' = offset + A(p) (x - x0) + B(p) (u - u0), and y = y0 + C(p) (x - x0) + D(p) (u - u0), at
    p = parameters(x, u), for every x and u: `error` is the largest relative misfit at random states
    within the ranges, rounding.

    Parameters
    ----------
    model : LPVStateSpace
        A, B, C, D, affine in p, in deviations from `x0` and `u0`.
    function : casadi.Function
        (x, u) to p.
    x0, u0 : NamedVector
        The point of the embedding.
    offset, y0 : array
        f(x0, u0), zero in a trim; the outputs there.
    error : float
        Largest misfit over the largest value of its row.
    """

    model: LPVStateSpace
    function: casadi.Function
    x0: NamedVector
    u0: NamedVector
    offset: Array
    y0: Array
    error: float

    __repr__ = summarized
    _repr_html_ = as_table

    def __str__(self) -> str:
        many = self.model.parameters
        rows = [f"{len(many)} scheduling parameter{'' if len(many) == 1 else 's'}"]
        rows += [f"  {s.name} in [{s.low:.4g}, {s.high:.4g}]" for s in many]
        return "\n".join([*rows, f"largest relative misfit at random states: {self.error:.1e}"])

    def parameters(self, x: object, u: object) -> Array:
        """p (d,) at a state and input (nx,), (nu,), or (n, d) along (n, nx), (n, nu)."""
        x, u = frozen(x, "x"), frozen(u, "u")
        values = np.array(self.function(np.atleast_2d(x).T, np.atleast_2d(u).T)).T
        return values[0] if x.ndim == 1 else values

    def derivative(self, x: object, u: object) -> Array:
        """x' (nx,) that the quasi-LPV model gives."""
        x, u = frozen(x, "x", (len(self.x0),)), frozen(u, "u", (len(self.u0),))
        frozen_model = self.model.at(*self.parameters(x, u))
        return (
            self.offset
            + frozen_model.A @ (x - self.x0.array)
            + frozen_model.B @ (u - self.u0.array)
        )


def embed(
    f: casadi.Function,
    states: Mapping[str, tuple[float, float]],
    inputs: Mapping[str, tuple[float, float]],
    *,
    outputs: Sequence[str] = (),
    at: Mapping[str, float] | None = None,
    scheduled_by: Sequence[str] | None = None,
    tolerance: float = 1e-12,
) -> Embedding:
    """Embed a nonlinear model x' = f(x, u), y = h(x, u) exactly in an LPV model whose parameters
    depend on x and u.

    Parameters
    ----------
    f : casadi.Function
        (x, u) to x', or to (x', y).
    states, inputs : mapping
        {name: (low, high)} in the order of x and u: where the model is to hold.
    outputs : sequence of str, optional
        Names of y; without y the outputs are the states.
    at : mapping, optional
        {name: value} of x0 and u0, the point from which deviations are measured, such as a trim;
        zero where not given.
    scheduled_by : sequence of str, optional
        The only states and inputs on which the parameters may depend; f must be affine in the
        others. Default: the fewest, states rather than inputs.
    tolerance : float
        Largest relative misfit that is taken.

    Returns
    -------
    Embedding
        Prints the number and the ranges of its parameters. Ranges are those of random states and
        corners within `states` and `inputs`, a little wider; rates are not known: `with_rate`.

    Raises
    ------
    InputError
        A function of other sizes, one that is not affine in the rest where `scheduled_by` says so,
        one with kinks within the ranges, named, or that is not finite there.
    UnknownNameError
        A name in `at` or `scheduled_by` that is neither state nor input.

    Examples
    --------
    A pendulum: sin(a) = (sin(a)/a) a, also at a = 0.

    >>> import casadi
    >>> a, w, torque = casadi.SX.sym("a"), casadi.SX.sym("w"), casadi.SX.sym("torque")
    >>> f = casadi.Function("f", [casadi.vertcat(a, w), torque],
    ...                     [casadi.vertcat(w, -9.81 * casadi.sin(a) - 0.1 * w + torque)])
    >>> found = symheli.embedding.embed(
    ...     f, {"a": (-3.0, 3.0), "w": (-5.0, 5.0)}, {"torque": (-1.0, 1.0)})
    >>> [s.name for s in found.model.parameters], bool(found.error < 1e-12)
    (['A[w, a]'], True)
    >>> round(float(found.parameters([0.5, 0.0], [0.0])[0]), 4)  # -9.81 sin(0.5)/0.5
    -9.4063
    """
    named = isinstance(states, Mapping) and isinstance(inputs, Mapping)
    pairs = [*states.values(), *inputs.values()] if named else []
    if not named or any(np.shape(pair) != (2,) for pair in pairs):
        raise InputError("states and inputs: expected {name: (low, high)}, two numbers a name")
    x_names, u_names = signals(states), signals(inputs)
    names = (*x_names, *u_names)
    ranges = np.array(pairs, float).reshape(-1, 2)
    if np.any(ranges[:, 0] >= ranges[:, 1]) or not np.all(np.isfinite(ranges)):
        raise InputError("states and inputs: expected {name: (low, high)} with low < high, finite")
    whole = _whole(f, len(x_names), len(u_names))
    ny = whole.size1_out(0) - len(x_names)
    if len(outputs) != ny:
        raise InputError(f"outputs: f returns {ny} besides x', got {len(outputs)} names")
    y_names = signals(outputs)
    z0 = np.zeros(len(names))
    for name, value in (at or {}).items():
        z0[_index(name, names)] = value
    rng = np.random.default_rng(0)
    samples = ranges[:, :1] + rng.random((len(names), SAMPLES)) * np.ptp(ranges, axis=1)[:, None]
    rows = (*x_names, *y_names)
    moving = _moving(whole, names, rows, len(x_names), scheduled_by, samples)
    average = _averaged(whole, names, rows, moving, samples, z0, tolerance)
    corners = (
        np.array(list(product(*ranges))).T if 2 ** len(names) <= MAX_CORNERS else samples[:, :0]
    )
    M = np.array([np.array(average(z)) for z in np.hstack([samples, corners]).T])
    if not np.all(np.isfinite(M)):
        raise InputError("the model is not finite everywhere within the ranges")
    names_of = (x_names, u_names, y_names or x_names)
    return _embedded(whole, average, M, samples, z0, names_of)


def _whole(f: casadi.Function, nx: int, nu: int) -> casadi.Function:
    """z = (x, u) to (x', y), in scalars."""
    if not isinstance(f, casadi.Function) or f.n_in() != 2 or f.n_out() not in (1, 2):
        raise InputError("f: expected a casadi.Function of (x, u) that returns x' or (x', y)")
    sizes = f.numel_in(0), f.numel_in(1), f.numel_out(0)
    if sizes != (nx, nu, nx):
        raise InputError(
            f"f: expected {nx} states and {nu} inputs as named, got a function of {sizes[0]} and"
            f" {sizes[1]} that returns {sizes[2]} derivatives"
        )
    z = casadi.SX.sym("z", nx + nu)  # type: ignore[arg-type]
    found = f.expand()(casadi.reshape(z[:nx], f.size_in(0)), casadi.reshape(z[nx:], f.size_in(1)))
    parts = found if isinstance(found, tuple | list) else [found]
    return casadi.Function("whole", [z], [casadi.vertcat(*map(casadi.vec, parts))])


def _index(name: str, names: Sequence[Signal]) -> int:
    if name not in names:
        raise UnknownNameError("state or input", name, list(map(str, names)))
    return names.index(Signal(name))


def _moving(
    whole: casadi.Function,
    names: Sequence[Signal],
    rows: Sequence[Signal],
    nx: int,
    wanted: Sequence[str] | None,
    samples: Array,
) -> list[int]:
    """The variables in which the line moves: f is affine in the others."""
    z = casadi.SX.sym("z", len(names))  # type: ignore[arg-type]
    J = casadi.jacobian(whole(z), z)
    if wanted is None:
        depends = np.array(casadi.DM(casadi.jacobian_sparsity(J, z), 1.0), bool)
        curved = depends.reshape(len(names), len(rows), len(names)).any(axis=1)
        return _fewest(np.array(curved | curved.T), nx)
    allowed = sorted({_index(name, names) for name in wanted})
    others = [j for j in range(len(names)) if j not in allowed]
    if others:
        second = casadi.jacobian(casadi.vec(J[:, others]), z[others])
        evaluated = casadi.Function("second", [z], [casadi.densify(second)]).map(samples.shape[1])
        bends = np.abs(np.array(evaluated(samples)))
        if np.any(bends > CONSTANT_ENTRY):
            place, column = np.argwhere(bends > CONSTANT_ENTRY)[0].tolist()
            pair = names[others[place // len(rows)]], names[others[column % len(others)]]
            raise InputError(
                f"{rows[place % len(rows)]} cannot be factored: it is not affine in"
                f" {' and '.join(dict.fromkeys(map(str, pair)))}, on which the parameters may not"
                " depend; name one of them in scheduled_by too"
            )
    return allowed


def _fewest(curved: Array, nx: int) -> list[int]:
    """Return the smallest set of variables without which no second derivative `curved` (nz, nz) is
    left; of equal ones that with the fewest inputs, the variables from `nx` on.
    """
    alone = np.diag(curved)
    chosen = np.flatnonzero(alone).tolist()
    open_ = curved & ~alone & ~alone[:, None]
    rest = np.flatnonzero(open_.any(axis=0)).tolist()
    if len(rest) > MAX_OPEN:
        return sorted([*chosen, *rest])

    def cost(some: tuple[int, ...]) -> tuple[int, int]:
        left = np.array([j for j in rest if j not in some], dtype=int)
        uncovered = open_[np.ix_(left, left)].any()
        return (len(some) if not uncovered else len(rest) + 1, sum(j >= nx for j in some))

    sets = (some for n in range(len(rest) + 1) for some in combinations(rest, n))
    return sorted([*chosen, *min(sets, key=cost)])


def _averaged(
    whole: casadi.Function,
    names: Sequence[Signal],
    rows: Sequence[Signal],
    moving: Sequence[int],
    samples: Array,
    z0: Array,
    tolerance: float,
) -> casadi.Function:
    """Return the function from z to the matrix M with f(z) - f(z0) = M (z - z0)."""
    z = casadi.SX.sym("z", len(names))  # type: ignore[arg-type]
    J = casadi.Function("J", [z], [casadi.jacobian(whole(z), z)])
    here = casadi.DM(z0)
    mask = np.zeros(len(names))
    mask[list(moving)] = 1.0
    # the others stand at z0 while the line moves; their columns are taken at its end
    end = here + mask * (z - here)
    columns = casadi.DM(np.tile(mask, (len(rows), 1)))
    f0 = np.array(whole(z0)).ravel()
    exact = np.array(whole.map(samples.shape[1])(samples)).T - f0
    size = np.abs(exact).max(axis=0) + np.abs(f0)
    found = None
    for count in NODES:
        t, weight = np.polynomial.legendre.leggauss(count)
        total = (1 - columns) * J(end)
        for place, share in zip(0.5 + 0.5 * t, 0.5 * weight, strict=True):
            total += share * columns * J(here + place * (end - here))
        found = casadi.Function("average", [z], [casadi.densify(total)])
        M = np.array(found.map(samples.shape[1])(samples))
        M = M.reshape(len(rows), samples.shape[1], len(names)).transpose(1, 0, 2)
        missed = np.abs(np.einsum("kij,kj->ki", M, (samples.T - z0)) - exact).max(axis=0)
        if np.all(missed <= tolerance * np.where(size > 0, size, 1.0)):
            return found
    worst = int(np.argmax(missed / np.where(size > 0, size, 1.0)))
    raise InputError(
        f"{rows[worst]} is not smooth enough for an exact embedding: with {NODES[-1]} nodes it is"
        f" missed by {missed[worst]:.1e}{_kinks(whole)}; narrow the ranges to one side of a kink"
    )


def _kinks(whole: casadi.Function) -> str:
    used = {whole.instruction_id(k) for k in range(whole.n_instructions())}
    names = sorted(word for op, word in KINKS.items() if op in used)
    return f"; it has kinks ({', '.join(names)})" if names else ""


def _embedded(
    whole: casadi.Function,
    average: casadi.Function,
    M: Array,
    samples: Array,
    z0: Array,
    names: tuple[tuple[Signal, ...], tuple[Signal, ...], tuple[Signal, ...]],
) -> Embedding:
    """The model whose parameters are entries of the matrices M (K, rows, nz) at the samples."""
    x_names, u_names, y_names = names
    (rows, nz), nx = M.shape[1:], len(x_names)
    chosen, T = _independent(M.reshape(len(M), -1))

    def split(values: Array) -> Matrices:
        whole_matrix = values.reshape(len(values), rows, nz)
        state = np.broadcast_to(np.eye(nx, nz), (len(values), nx, nz))  # where no y is given
        below = whole_matrix[:, nx:] if rows > nx else state
        upper = whole_matrix[:, :nx]
        return Matrices(upper[..., :nx], upper[..., nx:], below[..., :nx], below[..., nx:])

    given = _scheduling(M, chosen, names, split)
    basis = polynomials([1] * len(given), [(s.low, s.high) for s in given])
    if isinstance(basis, Product):
        basis = Product(basis.factors, total_degree=1)
    centre = np.array([s.middle for s in given])
    points = np.vstack([centre, centre + np.diag([s.radius for s in given])])
    at_points = split(np.column_stack([np.ones(len(points)), points]) @ T)
    where = points[:, 0] if len(given) == 1 else points
    A, B, C, D = (basis.fit(where, each) for each in at_points)
    model = LPVStateSpace(basis, A, B, C, D, given, x_names, u_names, y_names)
    z = casadi.SX.sym("z", nz)  # type: ignore[arg-type]
    entries_of_M = casadi.vec(average(z).T)[chosen.tolist()]
    p = casadi.Function("p", [z[:nx], z[nx:]], [entries_of_M], ["x", "u"], ["p"])
    f0 = np.array(whole(z0)).ravel()
    x0, u0 = NamedVector(x_names, z0[:nx]), NamedVector(u_names, z0[nx:])
    y0 = f0[nx:] if rows > nx else z0[:nx]
    made = Embedding(model, p, x0, u0, f0[:nx], y0, 0.0)
    exact = np.array(whole.map(samples.shape[1])(samples)).T[:, :nx]
    found = np.array([made.derivative(one[:nx], one[nx:]) for one in samples.T])
    scale = np.abs(exact).max(axis=0)
    missed = np.abs(found - exact).max(axis=0) / np.where(scale > 0, scale, 1.0)
    return replace(made, error=float(missed.max()))


def _independent(flat: Array) -> tuple[Array, Array]:
    """Entries (d,) that vary independently over the samples (K, m), and T (d + 1, m): all entries
    are (1, those) T.
    """
    varies = np.flatnonzero(np.ptp(flat, axis=0) > CONSTANT_ENTRY * np.abs(flat).max(axis=0))
    if not len(varies):
        raise InputError("the model is linear: linearize it, no parameter is needed")
    moved = flat[:, varies] - flat[:, varies].mean(axis=0)
    _, R, order = qr(moved / np.abs(moved).max(axis=0), mode="economic", pivoting=True)  # type: ignore[assignment]
    diagonal = np.abs(np.diag(R))
    chosen = np.sort(varies[order[: int(np.sum(diagonal > MIN_PIVOT * diagonal[0]))]])
    functions = np.column_stack([np.ones(len(flat)), flat[:, chosen]])
    size = np.abs(functions).max(axis=0)
    T = np.zeros((len(size), flat.shape[1]))
    T[0] = flat[0]  # what is constant
    T[:, varies] = np.linalg.lstsq(functions / size, flat[:, varies])[0] / size[:, None]
    T[:, chosen] = np.eye(len(size))[:, 1:]
    return chosen, T


def _scheduling(
    M: Array,
    chosen: Array,
    names: tuple[tuple[Signal, ...], tuple[Signal, ...], tuple[Signal, ...]],
    split: Callable[[Array], Matrices],
) -> tuple[Scheduling, ...]:
    """Return the chosen entries as parameters, with the names and units of entries of A, B,
    C or D.
    """
    flat = M.reshape(len(M), -1)
    order = split(np.arange(flat.shape[1], dtype=float)[None])
    label = {
        int(entry.values[0]): entry.name
        for entry in entries(_Labels(*names), order)
        if len(names[2]) + len(names[0]) == M.shape[1] or str(entry.name)[0] in "AB"
    }
    low, high = flat[:, chosen].min(axis=0), flat[:, chosen].max(axis=0)
    slack = RANGE_MARGIN * (high - low)
    return tuple(
        Scheduling(str(label[k]), label[k].unit, float(a), float(b))
        for k, a, b in zip(chosen.tolist(), low - slack, high + slack, strict=True)
    )


@dataclass(frozen=True)
class _Labels:
    """Names of rows and columns, as `entries` reads them."""

    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float | None = None
