"""How far the uncertainty of the coefficients moves the frozen frequency response."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from identification.model.lpvarx_model import LPVARXModel
from identification.model.realization import one_value
from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.summary import summarized


class ResponseBand(NamedTuple):
    """A frozen response and its standard error: the root mean square of |G - truth|, to first order
    in the errors of the coefficients.

    Parameters
    ----------
    omega : array (k,)
        rad/s.
    G : complex array (k, ny, nu)
        Output per input.
    standard_error : array (k, ny, nu)
        In the units of G.

    Examples
    --------
    >>> band = idn.uncertainty(model, record).frequency_response(0.0, [0.1, 1.0])
    >>> print(np.abs(band.G[:, 0, 0]).round(1), bool(band.standard_error.max() < 0.05))
    [2. 2.] True
    """

    omega: Array
    G: Array
    standard_error: Array

    __repr__ = summarized


def response_band(model: LPVARXModel, joint: Array, p: object, omega: object) -> ResponseBand:
    """The response with the scheduling held at p, and its error from the covariance `joint` (ny, n,
    ny, n) of the coefficients.

    With M = I + sum_i A_i z^-i and M G = sum_j B_j z^-j, coefficients that change move G by M^-1
    (sum_j dB_j z^-j - sum_i dA_i z^-i G). Raises `InputError` for p outside the basis.
    """
    arx = model.structure
    omega = np.atleast_1d(frozen(omega, "omega"))
    if omega.ndim != 1:
        raise InputError(f"omega: expected (k,) rad/s, got shape {omega.shape}")
    f = arx.basis(one_value(p, arx.basis))
    size, ny, count = arx.basis.size, arx.ny, len(arx.entries)
    entries = np.einsum(
        "yeazfb,a,b->yezf", joint.reshape(ny, count, size, ny, count, size), f, f
    ).reshape(ny * count, ny * count)
    theta = np.einsum("eby,b->ey", model.theta.reshape(count, size, ny), f)
    G, error = np.zeros((len(omega), ny, arx.nu), complex), np.zeros((len(omega), ny, arx.nu))
    for k, z in enumerate(np.exp(1j * omega * model.dt)):
        M, N = np.eye(ny, dtype=complex), np.zeros((ny, arx.nu), complex)
        for e, entry in enumerate(arx.entries):
            if entry.kind == "output":
                M[:, entry.channel] += theta[e] * z**-entry.lag
            elif entry.kind == "input":
                N[:, entry.channel] += theta[e] * z**-entry.lag
        inverse = np.linalg.inv(M)
        G[k] = inverse @ N
        moved = np.zeros(
            (count, arx.nu), complex
        )  # what a change of an entry's coefficient does to M G
        for e, entry in enumerate(arx.entries):
            if entry.kind == "output":
                moved[e] = -G[k, entry.channel] * z**-entry.lag
            elif entry.kind == "input":
                moved[e, entry.channel] = z**-entry.lag
        J = np.einsum("oy,eu->ouye", inverse, moved).reshape(ny, arx.nu, ny * count)
        error[k] = np.sqrt(np.maximum(np.einsum("oui,ij,ouj->ou", J, entries, J.conj()).real, 0.0))
    return ResponseBand(omega, G, error)
