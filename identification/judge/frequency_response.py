"""Frequency responses from records, with the coherence that says how far to believe them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import get_window
from scipy.stats import f as fisher

from identification.structure.regressors import as_records, units_of
from symheli import LinearModel
from symheli.errors import ExcitationError, InputError
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.labelled import frame, per
from symheli.values.summary import summarized

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes


PERIODS = 16.0
"""Periods that the shortest window chosen for a frequency holds, where several are given: its
resolution is then an eighth of the frequency, less than the width of a mode of damping .15.
"""

USABLE = 0.2
"""Largest normalised standard deviation of |G| at which a response is used (Tischler and Remple
(2012), sec. 7.5).
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class FrequencyResponse:
    """Response of outputs to inputs at n frequencies, with the effect of the other inputs removed.

    Parameters
    ----------
    omega : array (n,)
        rad/s.
    G : complex array (n, ny, nu)
        Output per input.
    coherence : array (n, ny, nu)
        Partial coherence in [0, 1], the share of what is left of an output that goes with what is
        left of an input.
    multiple : array (n, ny)
        Share of each output that all inputs explain.
    deviation : array (n, ny, nu)
        Standard deviation of the complex G, the root of the mean square of its error's modulus.
    freedom : array (n,)
        Degrees of freedom of the noise level that `deviation` rests on.
    outputs, inputs : tuple of Signal
        ny and nu of them.

    Examples
    --------
    >>> still = record.with_signals({"y": "1"}, y=np.r_[0.0, 2.0 * record["u"][:-1]])
    >>> found = idn.frequency_response(still, ["y"], ["u"], window=10.0, band=(1.0, 5.0))
    >>> print(np.abs(found.G[0]).round(1), bool(found.coherence.min() > 0.9))
    [[2.]] True
    """

    omega: Array
    G: Array
    coherence: Array
    multiple: Array
    deviation: Array
    freedom: Array
    outputs: tuple[Signal, ...]
    inputs: tuple[Signal, ...]

    __repr__ = summarized
    _repr_html_ = as_table

    @property
    def random_error(self) -> Array:
        """Normalised standard deviation (n, ny, nu) of |G|."""
        size = np.maximum(np.abs(self.G), np.finfo(float).tiny)
        return self.deviation / (np.sqrt(2.0) * size)

    @property
    def usable(self) -> Array:
        """Mask (n, ny, nu) of the responses whose random error is at most .2."""
        return self.random_error <= USABLE

    def radius(self, probability: float = 0.95) -> Array:
        """Radius (n, ny, nu) of the disk about G in the complex plane that holds the response with
        this probability, each by itself.
        """
        if not 0.0 < probability < 1.0:
            raise InputError(f"probability: expected a number in (0, 1), got {probability!r}")
        quantile = fisher.ppf(probability, 2, 2 * self.freedom)
        return self.deviation * np.sqrt(quantile)[:, None, None]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Magnitude of every response over frequency (rad/s), shaded by its random error; returns
        the axes.
        """
        from identification.judge.plots import plot_response

        return plot_response(self, ax)

    def to_frame(self) -> pandas.DataFrame:
        """Over frequency (rad/s), columns "y from u" (complex) and "coherence of y from u"; units
        in attrs["units"]. Raises `InputError` without pandas.
        """
        pairs = [
            (i, y, j, u) for j, u in enumerate(self.inputs) for i, y in enumerate(self.outputs)
        ]
        columns = [
            (Signal(f"{y} from {u}", per(y.unit, u.unit)), self.G[:, i, j]) for i, y, j, u in pairs
        ]
        columns += [
            (Signal(f"coherence of {y} from {u}"), self.coherence[:, i, j]) for i, y, j, u in pairs
        ]
        return frame([(Signal("omega", "rad/s"), self.omega)], columns)

    def mismatch(self, model: LinearModel, coherence: float = 0.6) -> Array:
        """Mean squared mismatch cost J (ny, nu) of a model's response; below 100 is a good, below
        50 an excellent match.

        J = 20/n sum W [ (dB error)^2 + 0.01745 (degree error)^2 ], W = (1.58 (1 -
        exp(-coherence)))^2, over the frequencies where the coherence exceeds the threshold; NaN
        where there are none. `coherence` is gamma^2 itself, a share of power: W(0.6) = 0.51.
        Source: Tischler and Remple (2012), Aircraft and Rotorcraft System Identification, eq. 11.4.
        """
        H = model.select(inputs=self.inputs, outputs=self.outputs).frequency_response(self.omega)
        return mismatch_cost(self.G, H, self.coherence, self.coherence > coherence)


def mismatch_cost(G: Array, H: Array, coherence: Array, good: Array) -> Array:
    """J (ny, nu) of H beside the measured G (n, ny, nu) over the `good` frequencies, see
    `FrequencyResponse.mismatch`; NaN where there are none.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = G / H
        error = (20 * np.log10(np.abs(ratio))) ** 2 + 0.01745 * np.degrees(np.angle(ratio)) ** 2
    weight = (1.58 * (1 - np.exp(-coherence))) ** 2
    good = good & np.isfinite(error)
    count = good.sum(axis=0)
    total = np.sum(np.where(good, weight * error, 0.0), axis=0)
    return np.where(count > 0, 20 * total / np.maximum(count, 1), np.nan)


def frequency_response(
    records: FlightRecord | Iterable[FlightRecord],
    outputs: Sequence[str],
    inputs: Sequence[str],
    *,
    window: float | Sequence[float],
    band: tuple[float, float] | None = None,
    references: Sequence[str] = (),
) -> FrequencyResponse:
    """Return the response of outputs to inputs, each with the effect of the other inputs removed,
    from one record or several: Hann windows, half overlapping, averaged.

    A long window resolves low frequencies, a short one averages more: about five windows a record
    are the least. Of several windows the shortest that holds sixteen periods is taken at each
    frequency (composite windows). Windows that a gap or a missing sample touches are left out.

    With a controller on, noise is fed back to the inputs and biases G = Gyu Guu^-1. `references`
    are signals that the noise does not reach, such as the recorded excitation or the pilot's
    commands, at least as many as inputs: then G = Gyr Gur^-1 is free of that bias.

    Parameters
    ----------
    records : FlightRecord or iterable of FlightRecord
        Of one sample period.
    outputs, inputs : sequence of str
        ny and nu signals.
    window : float or sequence of float
        Length of a window, s.
    band : (float, float), optional
        rad/s; default 2 pi/`window` .. half the sampling frequency.
    references : sequence of str
        Instruments for flights in closed loop; none: the inputs themselves.

    Returns
    -------
    FrequencyResponse
        With coherences and standard deviations.

    Raises
    ------
    InputError
        A window of less than eight samples, a band that holds no frequency of it, fewer references
        than inputs.
    ExcitationError
        The inputs or references move together, or too few windows remain.

    See Also
    --------
    identification.judge.response_regions : regions of frequency responses
    identification.fit : coefficients from records

    References
    ----------
    Bendat and Piersol (2010), Random Data, ch. 7 and 9; Tischler and Remple (2012), Aircraft and
    Rotorcraft System Identification, ch. 7 to 10; references: Wellstead (1981), Automatica 17.

    Examples
    --------
    >>> found = idn.frequency_response(record, ["y"], ["u"], window=10.0, band=(1.0, 5.0))
    >>> found.G.shape == (len(found.omega), 1, 1)
    True
    """
    records = as_records(records)
    outputs, inputs = units_of(outputs, records), units_of(inputs, records)
    references = units_of(references, records)
    if not (outputs and inputs):
        raise InputError("outputs, inputs: name at least one of each")
    if references and len(references) < len(inputs):
        raise InputError(
            f"references: {len(references)} are too few for {len(inputs)} inputs; give as many at"
            " least, each moving by itself"
        )
    names = (*inputs, *outputs, *references)
    parts = []
    for length, part in _bands(window, band, records[0].dt):
        found = windows(records, names, length, part)
        parts.append(response_of(found, outputs, inputs, length))
    stacked = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("omega", "G", "coherence", "multiple", "deviation", "freedom")
    }
    return FrequencyResponse(**stacked, outputs=outputs, inputs=inputs)


def _bands(
    window: float | Sequence[float], band: tuple[float, float] | None, dt: float
) -> list[tuple[float, tuple[float, float] | None]]:
    """Each window (s) with the frequencies (rad/s) it is for."""
    if isinstance(window, int | float):
        return [(float(window), band)]
    lengths = sorted({float(length) for length in window}, reverse=True)
    if not lengths:
        raise InputError("window: give at least one length (s)")
    low, high = band or (2 * np.pi / lengths[0], np.pi / dt)
    edges = [low, *(max(low, 2 * np.pi * PERIODS / length) for length in lengths[1:]), high]
    return [
        (length, (first, last if last == high else last * (1 - 1e-6)))
        for length, (first, last) in zip(lengths, pairwise(edges), strict=True)
        if first < min(last, high) and (last - first) * length > 2 * np.pi
    ]


def response_of(
    found: WindowTransforms, outputs: tuple[Signal, ...], inputs: tuple[Signal, ...], window: float
) -> FrequencyResponse:
    """From windows (s) of the signals (inputs, outputs, references); without references the inputs
    are their own.
    """
    nu, ny = len(inputs), len(outputs)
    count = len(found.transforms)
    if count < nu + 1:
        raise ExcitationError(
            f"{count} unbroken windows of {window} s are too few for {nu} inputs; record longer or"
            " shorten the window"
        )
    U, Y, R = np.split(found.transforms, [nu, nu + ny], axis=2)
    R = R if R.shape[2] else U

    def crossed(a: Array, b: Array) -> Array:
        return np.einsum("kfi,kfj->fij", a, np.conj(b)) / count

    Srr, Sur, Syr = crossed(R, R), crossed(U, R), crossed(Y, R)
    _refuse_dependent(Srr, inputs if R is U else "references")
    # inputs as far as the references explain them: U itself where they are their own
    solved = np.linalg.solve(Srr, np.swapaxes(np.conj(Sur), 1, 2))  # (f, r, u)
    Suu, Syu = Sur @ solved, Syr @ solved
    _refuse_dependent(Suu, inputs)
    inverse = np.linalg.inv(Suu)
    G = Syu @ inverse
    left = Y - np.einsum("fij,kfj->kfi", G, U)
    power = np.mean(np.abs(Y) ** 2, axis=0)
    noise = np.mean(np.abs(left) ** 2, axis=0)
    independent = count**2 / np.sum(found.overlap**2)
    freedom = max(independent - nu, 1.0)
    tiny = np.finfo(float).tiny
    own = np.abs(G) ** 2 / np.maximum(np.einsum("fjj->fj", inverse).real, tiny)[:, None, :]
    coherence = own / np.maximum(own + noise[:, :, None], tiny)
    # the error of G is sum_k left_k Z_k^H, and neighbouring windows share noise by their overlap
    Z = np.einsum("kfr,fru->kfu", np.conj(R), solved @ inverse) / count
    shared = np.einsum("kfu,kl,lfu->fu", np.conj(Z), found.overlap, Z).real
    level = noise * independent / freedom
    return FrequencyResponse(
        omega=found.omega,
        G=G,
        coherence=coherence,
        multiple=np.clip(1.0 - noise / np.maximum(power, tiny), 0.0, 1.0),
        deviation=np.sqrt(level[:, :, None] * np.maximum(shared, 0.0)[:, None, :]),
        freedom=np.full(len(found.omega), freedom),
        outputs=outputs,
        inputs=inputs,
    )


def _refuse_dependent(S: Array, names: tuple[Signal, ...] | str) -> None:
    size = np.sqrt(np.maximum(np.einsum("kii->ki", S).real, 0.0))
    if np.any(size == 0) or np.linalg.cond(S / (size[:, :, None] * size[:, None, :])).max() > 1e8:
        listed = names if isinstance(names, str) else f"inputs {', '.join(names)}"
        raise ExcitationError(
            f"the {listed} move together, or not at all, at some frequency of the band; excite each"
            " by itself"
        )


def independent(windows: int) -> float:
    """Number of windows that do not overlap in as much data."""
    return (windows + 1) / 2


@dataclass(frozen=True, eq=False)
class WindowTransforms:
    """Fourier transforms (K, n, m) of m signals in K windows at `omega` (n,; rad/s), scaled so that
    their squares are one-sided densities; means (K, others) of further signals; and how much of
    its data each window shares with each other, `overlap` (K, K), 1 on the diagonal.
    """

    omega: Array
    transforms: Array
    means: Array
    overlap: Array

    @property
    def spectra(self) -> Array:
        """Cross spectral densities (K, n, m, m), [..., a, b] of a with the conjugate of b."""
        return self.transforms[..., :, None] * np.conj(self.transforms)[..., None, :]


def windows(
    records: Sequence[FlightRecord],
    names: Sequence[str],
    window: float,
    band: tuple[float, float] | None,
    also: tuple[str, ...] = (),
) -> WindowTransforms:
    """Return every unbroken window (s) of the records, half overlapping, with the means of the
    signals `also`.

    Raises `InputError` for a window or a band that holds nothing, `ExcitationError` where no window
    is unbroken.
    """
    if band is not None and len(band) != 2:
        raise InputError(f"band: expected (low, high) in rad/s, got {band!r:.80}")
    dt = records[0].dt
    if not 7.5 * dt < window < np.inf:
        raise InputError(f"window: expected at least eight samples, {8 * dt:.3g} s, got {window} s")
    longest = max(map(len, records))
    if window > (longest + 0.5) * dt:
        raise ExcitationError(
            f"a window of {window} s is longer than every record; the longest lasts"
            f" {longest * dt:.4g} s; shorten the window or record longer"
        )
    n = round(window / dt)
    omega = 2 * np.pi * np.fft.rfftfreq(n, dt)
    low, high = band or (2 * np.pi / window, np.pi / dt)
    keep = (omega >= low * (1 - 1e-9)) & (omega <= high * (1 + 1e-9)) & (omega > 0)
    if not keep.any():
        raise InputError(
            f"band: no frequency of a {window} s window lies between {low} and {high} rad/s"
        )
    taper: Any = np.asarray(get_window("hann", n))
    scale = np.sqrt(2.0 * dt / np.sum(taper**2))
    transforms, means, places = [], [], []
    for number, record in enumerate(records):
        values, others = record.columns(names), record.columns(also)
        for part in record.segments():
            for start in range(part.start, part.stop - n + 1, n // 2):
                rows = slice(start, start + n)
                piece = values[rows]
                if not (np.isfinite(piece).all() and np.isfinite(others[rows]).all()):
                    continue
                piece = (piece - piece.mean(axis=0)) * taper[:, None]
                # phases from the start of the record: overlapping windows see the same noise
                turned = np.exp(-1j * omega[keep] * dt * start)[:, None]
                transforms.append(scale * np.fft.rfft(piece, axis=0)[keep] * turned)
                means.append(others[rows].mean(axis=0))
                places.append((number, start))
    if not transforms:
        raise ExcitationError(
            f"no unbroken stretch of {n} samples; shorten the window or resample the record"
        )
    number, start = np.array(places).T
    apart = np.where(number[:, None] == number, np.minimum(np.abs(start[:, None] - start), n), n)
    shared = np.array([taper[d:] @ taper[: n - d] for d in range(n)] + [0.0]) / (taper @ taper)
    return WindowTransforms(omega[keep], np.array(transforms), np.array(means), shared[apart])
