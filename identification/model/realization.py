"""State-space forms of a difference equation whose coefficients move with p: the two that are
exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.model.coefficients import Coefficients
from identification.structure.lpvarx import LPVARX
from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import Product
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.bases.polynomials import interpolation_points, polynomials
from symheli.lpv.tools import Matrices
from symheli.values import Signal
from symheli.values.arrays import Array, frozen

ROUTES = {"shifted": "lag", "direct": "now"}
"""Which realization is exact for which `scheduling_at`."""


def route_for(arx: LPVARX, route: str | None) -> str:
    """Return the exact realization of a structure; raise `InputError` where another one is
    requested.
    """
    exact = next(name for name, at in ROUTES.items() if at == arx.scheduling_at)
    if route is None or route == exact:
        return exact
    if route not in ROUTES:
        raise InputError(f'route: expected "shifted", "direct" or None, got {route!r}')
    raise InputError(
        f'the "{route}" route is wrong for coefficients at "{arx.scheduling_at}" when p moves; '
        f'use "{exact}", which is exact, or identify with scheduling_at="{ROUTES[route]}"'
    )


def shifted(
    coefficients: Coefficients,
    parameters: tuple[Scheduling, ...],
    outputs: tuple[Signal, ...],
    inputs: tuple[Signal, ...],
    dt: float,
) -> LPVStateSpace:
    """Observer form of coefficients taken at the lag; exact for any p(k), order ny max(na, largest
    input lag).

        y(k) = x_1(k) + B_0 u(k),   x_i(k+1) = x_{i+1}(k) - A_i y(k) + B_i u(k),

    all at p(k), B_i the coefficient at lag i.

    With feedthrough A_i B_0 is a product of two functions of p: it needs a polynomial basis, whose
    degree doubles.
    """
    basis, model = coefficients.basis, coefficients
    if coefficients.input_lags[:1] == (0,) and coefficients.A.size:
        basis, model = _doubled(coefficients)
    one = basis.constant()
    stack = [_observer(model, j, c) for j, c in enumerate(one)]
    if basis is not coefficients.basis:
        stack = _with_feedthrough(coefficients, basis, stack)
    A, B, C, D = (np.stack(parts) for parts in zip(*stack, strict=True))
    return LPVStateSpace(
        basis,
        A,
        B,
        C,
        D,
        parameters,
        _state_names(outputs, A.shape[1] // len(outputs)),
        inputs,
        outputs,
        dt,
    )


def direct(
    coefficients: Coefficients,
    parameters: tuple[Scheduling, ...],
    outputs: tuple[Signal, ...],
    inputs: tuple[Signal, ...],
    dt: float,
) -> LPVStateSpace:
    """Return the realization with past outputs and inputs as the state, for coefficients at p(k);
    exact for any p(k), not minimal.

    x(k) = [y(k-1) .. y(k-na), u(k-1) .. u(k-L)], L the largest input lag.
    """
    basis, lags = coefficients.basis, coefficients.input_lags
    na, n, ny, nu = *coefficients.A.shape[:3], len(inputs)
    L = max(lags, default=0)
    one, nx = basis.constant(), na * ny + L * nu
    A, B = np.zeros((n, nx, nx)), np.zeros((n, nx, nu))
    C, D = np.zeros((n, ny, nx)), np.zeros((n, ny, nu))
    for i in range(na):
        C[:, :, i * ny : (i + 1) * ny] = -coefficients.A[i]
    for lag, coefficient in zip(lags, coefficients.B, strict=True):
        if lag:
            C[:, :, na * ny + (lag - 1) * nu : na * ny + lag * nu] = coefficient
        else:
            D[:] = coefficient
    if na:
        A[:, :ny], B[:, :ny] = C, D
    for row, column in [*_chain(0, na, ny), *_chain(na * ny, L, nu)]:
        A[:, row, column] = one
    for i in range(nu if L else 0):
        B[:, na * ny + i, i] = one
    states = [_lagged(s, i) for i in range(1, na + 1) for s in outputs] + [
        _lagged(s, i) for i in range(1, L + 1) for s in inputs
    ]
    return LPVStateSpace(basis, A, B, C, D, parameters, tuple(states), inputs, outputs, dt)


def held_value(p: Sequence[Any] | Array, basis: FunctionSpace) -> Any:
    """The value of one parameter, or those of several, as `at(*p)` takes them: none where all
    functions are constant.
    """
    if len(p) == 0 and not any(basis.degrees or (1,)):
        p = [low for low, _ in basis.ranges]
    return p[0] if len(p) == 1 else p


def one_value(p: object, basis: FunctionSpace) -> Array:
    """p as it is; raises `InputError` unless it is one number, or one of each of several
    parameters.
    """
    values = frozen(p, "scheduling parameter")
    if values.ndim > (basis.dimension > 1):
        raise InputError(f"at: expected one value of p, got {p!r:.80}")
    return values


def at(
    coefficients: Coefficients,
    p: object,
    outputs: tuple[Signal, ...],
    inputs: tuple[Signal, ...],
    dt: float,
) -> LinearModel:
    """The model with p held (both structures agree then), in observer form."""
    A, B, _, _ = coefficients.at(one_value(p, coefficients.basis))
    D = B[0] if coefficients.input_lags[:1] == (0,) else np.zeros((len(outputs), len(inputs)))
    matrices = _companion(A, _by_lag(B, coefficients.input_lags), 1.0, D)
    return LinearModel(
        *matrices, _state_names(outputs, len(matrices.A) // len(outputs)), inputs, outputs, dt=dt
    )


def _companion(A: Array, B: dict[int, Array], one: float, D: Array) -> Matrices:
    """Return the observer form of A (na, ny, ny), B by lag; `one` is the entry of the shifts; D
    only for its products with A.
    """
    ny, nu = D.shape
    order = max(len(A), max(B, default=0))
    F, G, H = (
        np.zeros((order * ny, order * ny)),
        np.zeros((order * ny, nu)),
        np.zeros((ny, order * ny)),
    )
    for i in range(order):
        rows = slice(i * ny, (i + 1) * ny)
        if i < len(A):
            F[rows, :ny] = -A[i]
            G[rows] -= A[i] @ D
        if i + 1 in B:
            G[rows] += B[i + 1]
        if i + 1 < order:
            F[rows, (i + 1) * ny : (i + 2) * ny] = one * np.eye(ny)
    if order:
        H[:, :ny] = one * np.eye(ny)
    return Matrices(F, G, H, D)


def _by_lag(B: Array, lags: tuple[int, ...]) -> dict[int, Array]:
    return {lag: block for lag, block in zip(lags, B, strict=True) if lag}


def _observer(coefficients: Coefficients, j: int, one: float) -> Matrices:
    """The observer form of the j-th basis coefficients, without the products of A and B_0."""
    lags, (ny, nu) = coefficients.input_lags, coefficients.B.shape[2:]
    bare = _companion(
        coefficients.A[:, j], _by_lag(coefficients.B[:, j], lags), one, np.zeros((ny, nu))
    )
    return bare._replace(D=coefficients.B[0, j]) if lags[:1] == (0,) else bare


def _doubled(coefficients: Coefficients) -> tuple[FunctionSpace, Coefficients]:
    """Return the same coefficients in polynomials of twice the degrees."""
    old, c = coefficients.basis, coefficients
    if old.degrees is None:
        raise InputError(
            "feedthrough (delay=0) with past outputs needs a polynomial basis to be realized, got"
            f" {type(old).__name__}"
        )
    new = polynomials([2 * d for d in old.degrees], old.ranges)
    # the Legendre functions of the smaller basis are among those of the larger
    place = [_functions(new).index(f) for f in _functions(old)]

    def padded(values: Array, axis: int) -> Array:
        out = np.zeros((*values.shape[:axis], new.size, *values.shape[axis + 1 :]))
        out[(slice(None),) * axis + (place,)] = values
        return out

    return new, Coefficients(
        basis=new,
        input_lags=c.input_lags,
        A=padded(c.A, 1),
        B=padded(c.B, 1),
        c=padded(c.c, 0),
        d=padded(c.d, 0),
    )


def _functions(basis: FunctionSpace) -> list[tuple[int, ...]]:
    """Degree of every function in every parameter."""
    return list(basis.indices) if isinstance(basis, Product) else [(i,) for i in range(basis.size)]


def _with_feedthrough(
    coefficients: Coefficients, basis: FunctionSpace, stack: list[Matrices]
) -> list[Matrices]:
    """Add -A_i(p) B_0(p), interpolated exactly at as many nodes as the larger basis has
    functions.
    """
    nodes = interpolation_points(basis.degrees or (), basis.ranges)
    A, B, _, _ = coefficients.at(nodes)
    products = basis.fit(nodes, -np.einsum("kiyz,kzu->kiyu", A, B[:, 0]))
    out = []
    for matrices, product in zip(stack, products, strict=True):
        G = matrices.B.copy()
        G[: A.shape[1] * A.shape[2]] += product.reshape(-1, B.shape[-1])
        out.append(matrices._replace(B=G))
    return out


def _chain(start: int, lags: int, width: int) -> list[tuple[int, int]]:
    """(row, column) of the ones that move each sample of a delay chain one lag down."""
    return [(start + i, start + i - width) for i in range(width, lags * width)]


def _state_names(outputs: tuple[Signal, ...], order: int) -> tuple[Signal, ...]:
    return tuple(
        s if i == 1 else Signal(f"{s}_x{i}", s.unit) for i in range(1, order + 1) for s in outputs
    )


def _lagged(signal: Signal, lag: int) -> Signal:
    return Signal(f"{signal}_lag{lag}", signal.unit)
