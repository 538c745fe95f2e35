"""Frequency responses from records, with the coherence that says how far to believe them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import csd, get_window

from identification.structure.regressors import as_records, units_of
from symheli.errors import ExcitationError, InputError
from symheli.lpv import LinearModel
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.labelled import frame, per
from symheli.values.summary import as_table, summarized

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes


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
    random_error : array (n, ny, nu)
        Normalised standard deviation of |G|.
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
    random_error: Array
    outputs: tuple[Signal, ...]
    inputs: tuple[Signal, ...]

    __repr__ = summarized
    _repr_html_ = as_table

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
    window: float,
    band: tuple[float, float] | None = None,
) -> FrequencyResponse:
    """Return the spectral estimate G = Gyu Guu^-1 from one record or several: Hann windows, half
    overlapping, averaged.

    A long window resolves low frequencies, a short one averages more: about five windows a record
    are the least. Windows that a gap or a missing sample touches are left out. Feedback biases G
    where noise is fed back: excite well.

    Parameters
    ----------
    records : FlightRecord or iterable of FlightRecord
        Of one sample period.
    outputs, inputs : sequence of str
        ny and nu signals.
    window : float
        Length of a window, s.
    band : (float, float), optional
        rad/s; default 2 pi/`window` .. half the sampling frequency.

    Returns
    -------
    FrequencyResponse
        With coherences and random errors.

    Raises
    ------
    InputError
        A window of less than eight samples, a band that holds no frequency of it.
    ExcitationError
        The inputs move together, or too few windows remain.

    References
    ----------
    Bendat and Piersol (2010), Random Data, ch. 7 and 9; Tischler and Remple (2012), Aircraft and
    Rotorcraft System Identification, ch. 7 to 9.

    Examples
    --------
    >>> found = idn.frequency_response(record, ["y"], ["u"], window=10.0, band=(1.0, 5.0))
    >>> found.G.shape == (len(found.omega), 1, 1)
    True
    """
    records = as_records(records)
    outputs, inputs = units_of(outputs, records), units_of(inputs, records)
    if not (outputs and inputs):
        raise InputError("outputs, inputs: name at least one of each")
    omega, pieces = windows(records, (*inputs, *outputs), window, band)
    mean = np.mean([S for S, _ in pieces], axis=0)
    return response_of(omega, mean, len(pieces), outputs, inputs, window)


def response_of(
    omega: Array,
    S: Array,
    count: int,
    outputs: tuple[Signal, ...],
    inputs: tuple[Signal, ...],
    window: float,
) -> FrequencyResponse:
    """From the mean cross spectra S (n, nu + ny, nu + ny) of `count` windows (s), inputs first."""
    nu = len(inputs)
    if count < nu + 1:
        raise ExcitationError(
            f"{count} unbroken windows of {window} s are too few for {nu} inputs; record longer or"
            " shorten the window"
        )
    Suu, Syu, Syy = S[:, :nu, :nu], S[:, nu:, :nu], S[:, nu:, nu:]
    size = np.sqrt(np.einsum("kii->ki", Suu).real)
    if np.any(size == 0) or np.linalg.cond(Suu / (size[:, :, None] * size[:, None, :])).max() > 1e8:
        raise ExcitationError(
            f"the inputs {', '.join(inputs)} move together, or not at all, at some frequency of the"
            " band; excite each by itself"
        )
    G = np.swapaxes(np.linalg.solve(np.swapaxes(Suu, 1, 2), np.swapaxes(Syu, 1, 2)), 1, 2)
    power = np.einsum("kii->ki", Syy).real
    explained = np.einsum("kij,kjl,kil->ki", G, Suu, np.conj(G)).real
    tiny = np.finfo(float).tiny
    multiple = np.clip(explained / np.maximum(power, tiny), 0.0, 1.0)
    # what is left of input j without the others is 1/(Suu^-1)_jj; of the output, what the others do
    # not explain
    alone = 1 / np.einsum("kjj->kj", np.linalg.inv(Suu)).real
    own = np.abs(G) ** 2 * alone[:, None, :]
    noise = np.maximum(power - explained, 0.0)
    coherence = own / np.maximum(own + noise[:, :, None], tiny)
    # half overlapping Hann windows are worth 0.55 of their number as independent averages (Tischler
    # and Remple, sec. 7.5)
    with np.errstate(divide="ignore"):
        random_error = np.sqrt(
            0.55 * (1 - coherence) / np.maximum(coherence, tiny) / (2 * max(independent(count), 1))
        )
    return FrequencyResponse(
        omega=omega,
        G=G,
        coherence=coherence,
        multiple=multiple,
        random_error=random_error,
        outputs=outputs,
        inputs=inputs,
    )


def independent(windows: int) -> float:
    """Number of windows that do not overlap in as much data."""
    return (windows + 1) / 2


def windows(
    records: Sequence[FlightRecord],
    names: Sequence[str],
    window: float,
    band: tuple[float, float] | None,
    also: tuple[str, ...] = (),
) -> tuple[Array, list[tuple[Array, Array]]]:
    """Frequencies (rad/s) of the band, and of each unbroken window (s) the cross spectral densities
    (nf, m, m), S[:, a, b] of a with the conjugate of b, beside the means of the signals `also`.

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
    m, hop, found = len(names), n // 2, []
    taper: Any = np.asarray(get_window("hann", n))
    untouched: Any = False
    for record in records:
        values, others = record.columns(names), record.columns(also)
        for part in record.segments():
            for start in range(part.start, part.stop - n + 1, hop):
                rows = slice(start, start + n)
                piece = values[rows]
                if not (np.isfinite(piece).all() and np.isfinite(others[rows]).all()):
                    continue
                piece = piece - piece.mean(axis=0)
                a, b = np.meshgrid(np.arange(m), np.arange(m), indexing="ij")
                # csd(x, y) averages conj(X) Y
                S = csd(
                    piece.T[b],
                    piece.T[a],
                    fs=1 / record.dt,
                    window=taper,
                    nperseg=n,
                    detrend=untouched,
                    axis=-1,
                )[1]
                found.append((np.moveaxis(S, -1, 0)[keep], others[rows].mean(axis=0)))
    if not found:
        raise ExcitationError(
            f"no unbroken stretch of {n} samples; shorten the window or resample the record"
        )
    return omega[keep], found
