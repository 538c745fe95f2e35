"""A gain for every model within a measured distance of an LPV model: the distance enters as a
disturbance of states and inputs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace
from symheli.values.arrays import Array
from synthesis.analysis.l2_gain import l2_gain
from synthesis.certificate import Certificate
from synthesis.forms import LyapunovForm
from synthesis.worst.frozen import frozen_gain

SAFETY = 2.0
"""What is covered is this many times the largest difference measured."""

ROOMS = (1.001, 1.01, 1.1)
"""The covered gain is sought at these multiples of the gain without a remainder, in turn."""


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


def covering(lpv: LPVStateSpace, rest: Remainder, gain: float) -> LPVStateSpace:
    """A model whose gain g <= 1 proves g `gain` for every model that differs from `lpv` by the
    remainder.

    dx/dt = A x + B u + rows d, z = columns (x, u), d = Delta z, with inputs (gain u, t d) and
    outputs (y, t z). Then
    |y|^2 + t^2 |z|^2 <= g^2 (gain^2 |u|^2 + t^2 |d|^2) and |d| <= |z| give |y| <= g gain |u|. The
    scale t balances d to y with u to z.
    """
    nx, nu, ny = len(lpv.states), len(lpv.inputs), len(lpv.outputs)
    one = lpv.basis.constant()
    noise, seen = (
        np.multiply.outer(one, np.diag(rest.rows)),
        np.multiply.outer(one, np.diag(rest.columns)),
    )
    d, z = tuple(f"d_{s}" for s in lpv.states), tuple(f"z_{s}" for s in (*lpv.states, *lpv.inputs))
    plain = replace(lpv, trim=None, residuals=None)
    heard = replace(plain, B=noise, D=np.zeros((len(one), ny, nx)), inputs=d)
    felt = replace(plain, C=seen[:, :, :nx], D=seen[:, :, nx:], outputs=z)
    t = math.sqrt(gain * frozen_gain(heard).gamma / frozen_gain(felt).gamma)
    above = np.concatenate([lpv.D / gain, heard.D / t], axis=2)
    below = np.concatenate([t * felt.D / gain, np.zeros((len(one), nx + nu, nx))], axis=2)
    return replace(
        plain,
        B=np.concatenate([lpv.B / gain, noise / t], axis=2),
        C=np.concatenate([lpv.C, t * felt.C], axis=1),
        D=np.concatenate([above, below], axis=1),
        inputs=(*lpv.inputs, *d),
        outputs=(*lpv.outputs, *z),
    )


def covered_gain(
    lpv: LPVStateSpace, rest: Remainder, rate: float, form: LyapunovForm, gain: float
) -> tuple[float, Certificate | None]:
    """A gain proven for a model and for every model within a measured distance of it.

    The distance enters as a disturbance of the states that states and inputs cause; see `covering`.

    Parameters
    ----------
    lpv : LPVStateSpace
        The model, nx states and nu inputs.
    rest : Remainder
        How far [A B] of the others may be from its own, as `Remainder.of` makes it of differences
        (K, nx, nx + nu).
    rate : float
        Limit on the rate of the scheduling parameter, per second.
    form : Spline, Memory or HigherOrder
        Of the Lyapunov function.
    gain : float
        A gain proven of `lpv` alone, near which the covered one is sought.

    Returns
    -------
    (float, Certificate or None)
        The gain and the certificate of the covering model; (inf, None) where nothing is proven.

    Raises
    ------
    InputError
        Where the remainder is of another size than the model, or the gain is not finite.

    Examples
    --------
    >>> import numpy as np, symheli, synthesis
    >>> from synthesis.cover import Remainder, covered_gain
    >>> lag = symheli.LPVStateSpace.polynomial(
    ...     [[[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], symheli.Scheduling("p", "1", 0.0, 1.0))
    >>> rest = Remainder.of(np.array([[[0.0025, 0.0]]]))
    >>> gain, _ = covered_gain(lag, rest, 0.0, synthesis.Spline(degree=0), 1.0)
    >>> bool(1 / (1 - 0.005) <= gain < 1.02)
    True
    """
    nx, nu = len(lpv.states), len(lpv.inputs)
    if rest.rows.shape != (nx,) or rest.columns.shape != (nx + nu,):
        raise InputError(
            f"rest: expected the remainder of {nx} states and {nu} inputs, got rows"
            f" {rest.rows.shape} and columns {rest.columns.shape}"
        )
    if not 0 < gain < math.inf:
        raise InputError(f"gain: expected one that is proven of the model alone, got {gain:g}")
    for room in ROOMS:
        certificate = l2_gain(covering(lpv, rest, room * gain), rate, form=form, search=None)
        if certificate.gamma <= 1:
            return room * gain * certificate.gamma, certificate
    return math.inf, None
