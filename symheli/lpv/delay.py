"""A pure delay as a linear model: Pade's in continuous time, exact in whole samples."""

from __future__ import annotations

import math

import numpy as np

from symheli.errors import InputError
from symheli.lpv.linear_model import LinearModel
from symheli.values.numbers import positive, whole
from symheli.values.sample_period import SAME
from symheli.values.signal import Signal


def pade_delay(name: str, seconds: float, order: int = 4) -> LinearModel:
    """Return the Pade all-pass approximation of exp(-s T) from `<name>_command` to `name`, in
    observer form.

    The phase is right to 1e-3 rad up to omega T of about `order` (4: up to 200 rad/s for 20 ms).

    Parameters
    ----------
    name : str
        Of the delayed signal.
    seconds : float
        T.
    order : int
        Number of states.

    Returns
    -------
    LinearModel
        One input, one output.

    Raises
    ------
    InputError
        A delay or an order that is not positive.

    References
    ----------
    Golub and Van Loan (2013), Matrix Computations, sec. 9.3 (Pade's approximation of exp).

    Examples
    --------
    >>> delay = lpv.tools.pade_delay("d_lat", 0.02)
    >>> round(float(np.angle(delay.frequency_response([50.0])[0, 0, 0])), 6)
    -1.0
    """
    order = whole(order, "order", 1)
    if not (math.isfinite(seconds) and seconds > 0) or order > 10:
        raise InputError(
            f"expected a delay > 0 s and an order from 1 to 10, got {seconds} s and {order}"
        )
    # sum of c_k (sT)^k, c_k = (2n-k)! n! / ((2n)! k! (n-k)!), in scaled time s T
    c = [
        math.comb(order, k) * math.factorial(2 * order - k) / math.factorial(2 * order)
        for k in range(order + 1)
    ]
    denominator = np.array(c) / c[-1]
    numerator = denominator * (-1.0) ** np.arange(order + 1)
    direct = numerator[-1]
    A = np.eye(order, k=1)
    A[:, 0] = -denominator[:-1][::-1]
    B = (numerator[:-1] - direct * denominator[:-1])[::-1, None]
    C = np.eye(1, order)
    states = tuple(Signal(f"{name}_delay{i + 1}") for i in range(order))
    model_in = Signal(f"{name}_command", Signal(name).unit)
    return LinearModel(
        A / seconds, B / seconds, C, np.full((1, 1), direct), states, (model_in,), (Signal(name),)
    )


def sample_delay(name: str, samples: int, dt: float) -> LinearModel:
    """Return the exact delay z^-samples from `<name>_command` to `name`, a shift register.

    Parameters
    ----------
    name : str
        Of the delayed signal.
    samples : int
        Number of states, >= 1.
    dt : float
        Sample period, s.

    Returns
    -------
    LinearModel
        One input, one output.

    Raises
    ------
    InputError
        A number that is not positive.

    Examples
    --------
    >>> late = lpv.tools.sample_delay("d_lat", 2, dt=0.02)
    >>> s = np.exp(0.02j * 5.0)
    >>> bool(np.isclose(late.frequency_response([5.0])[0, 0, 0], s**-2))
    True
    """
    n, unit = whole(samples, "samples", 1), Signal(name).unit
    return LinearModel(
        np.eye(n, k=1),
        np.eye(n)[:, [-1]],
        np.eye(1, n),
        np.zeros((1, 1)),
        tuple(Signal(f"{name}_delay{i + 1}", unit) for i in range(n)),
        (Signal(f"{name}_command", unit),),
        (Signal(name, unit),),
        dt,
    )


def delay_of(name: str, seconds: float, dt: float | None, order: int = 4) -> LinearModel:
    """Return the delay of a signal of a model: whole samples of `dt` s where it is sampled, else
    Pade's approximation of `order` states.
    """
    if dt is None:
        return pade_delay(name, seconds, order)
    return sample_delay(name, whole_samples(seconds, dt), dt)


def whole_samples(seconds: float, dt: float) -> int:
    """Return the samples of `dt` s in a delay > 0; raise `InputError` where they are not whole."""
    samples = (seconds := positive(seconds, "the delay")) / dt
    count = round(samples)
    if count < 1 or abs(samples - count) > SAME * samples:
        below = math.floor(samples)
        near = [f"{n * dt:.6g} s" for n in (below, below + 1) if n > 0]
        raise InputError(
            f"a delay of {seconds:g} s is no whole number of samples of {dt:g} s; the nearest are"
            f" {' and '.join(near)}"
        )
    return count
