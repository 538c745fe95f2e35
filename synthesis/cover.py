"""Every model within a measured distance of an LPV model, as an uncertain one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace, UncertainStateSpace
from symheli.values.arrays import Array
from symheli.values.signal import signals

SAFETY = 2.0
"""What is covered is this many times the largest difference measured."""


@dataclass(frozen=True)
class Remainder:
    """[A B] of every covered model is that of the LPV model plus diag(rows) Delta diag(columns),
    |Delta| <= 1.

    rows (nx,), columns (nx + nu,); `largest` is the largest entry measured.
    """

    rows: Array
    columns: Array
    largest: float

    @classmethod
    def of(cls, missed: Array) -> Remainder:
        """`SAFETY` times what was measured, `missed` (K, nx, nx + nu)."""
        size = np.abs(missed).max(axis=0)
        floor = (
            1e-6 * size.max() or 1e-300
        )  # every row and column is covered, if only by a millionth
        rows, columns = np.ones(size.shape[0]), np.ones(size.shape[1])
        for _ in range(10):  # rows columns' >= size; settles in a few rounds
            rows = np.sqrt(rows * np.maximum((size / columns).max(axis=1), floor))
            columns = np.sqrt(columns * np.maximum((size / rows[:, None]).max(axis=0), floor))
        norm = np.linalg.norm(missed / (rows[:, None] * columns), 2, axis=(1, 2)).max()
        return cls(SAFETY * norm * rows, columns, float(size.max()))


def covering(lpv: LPVStateSpace, rest: Remainder) -> UncertainStateSpace:
    """The set of all models that differ from an LPV model by a remainder, for `l2_gain` and
    `stability`.

    dx/dt = A x + B u + rows d, v = columns (x, u), d = Delta v, |Delta| <= 1.

    Parameters
    ----------
    lpv : LPVStateSpace
        The model, nx states and nu inputs.
    rest : Remainder
        How far [A B] of the others may be from its own, as `Remainder.of` makes it of differences
        (K, nx, nx + nu).

    Returns
    -------
    UncertainStateSpace
        With the perturbation inputs d_<state> and outputs z_<state>, z_<input>.

    Raises
    ------
    InputError
        Where the remainder is of another size than the model.

    Examples
    --------
    >>> import numpy as np, symheli, synthesis
    >>> from synthesis.cover import Remainder, covering
    >>> lag = symheli.LPVStateSpace.polynomial(
    ...     [[[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], symheli.Scheduling("p", "1", 0.0, 1.0))
    >>> rest = Remainder.of(np.array([[[0.0025, 0.0]]]))
    >>> cert = synthesis.l2_gain(covering(lag, rest), 0.0, form=synthesis.Spline(degree=0))
    >>> bool(1 / (1 - 0.005) <= cert.gamma < 1.006)
    True
    """
    nx, nu, ny = len(lpv.states), len(lpv.inputs), len(lpv.outputs)
    if rest.rows.shape != (nx,) or rest.columns.shape != (nx + nu,):
        raise InputError(
            f"rest: expected the remainder of {nx} states and {nu} inputs, got rows"
            f" {rest.rows.shape} and columns {rest.columns.shape}"
        )
    one = lpv.basis.constant()
    noise = np.multiply.outer(one, np.diag(rest.rows))
    seen = np.multiply.outer(one, np.diag(rest.columns))
    d, v = tuple(f"d_{s}" for s in lpv.states), tuple(f"z_{s}" for s in (*lpv.states, *lpv.inputs))
    apart = np.zeros((len(one), ny + nx + nu, nx))
    model = replace(
        lpv,
        B=np.concatenate([lpv.B, noise], axis=2),
        C=np.concatenate([lpv.C, seen[:, :, :nx]], axis=1),
        D=np.concatenate([np.concatenate([lpv.D, seen[:, :, nx:]], axis=1), apart], axis=2),
        inputs=(*lpv.inputs, *d),
        outputs=(*lpv.outputs, *v),
        trim=None,
        residuals=None,
    )
    source = f"{SAFETY:g} times the largest difference measured of the models that are covered"
    return UncertainStateSpace(model, signals(d), signals(v), 1.0, 1.0, source)
