"""Designed excitation, added to stabilised inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.signal import chirp

from symheli.errors import InputError, UnknownNameError
from symheli.values.arrays import frozen
from symheli.values.numbers import by_name, finite, whole

Kind = Literal["multisine", "prbs", "chirp", "sweep"]

FADE_IN, FADE_OUT = 0.1, 0.04
"""Parts of a sweep in which it swells and fades."""


@dataclass(frozen=True)
class Excitation:
    """An excitation adds a test signal to each of the named inputs.

    Parameters
    ----------
    amplitude : mapping of str to float
        {input: rad}.
    kind : {"multisine", "prbs", "chirp", "sweep"}
        "multisine": harmonics of the record length with random phases, interleaved between inputs
        (orthogonal over the record), root mean square = amplitude/sqrt(2); "prbs": +-amplitude,
        switched at random multiples of 1/(2 high) s; "chirp": linear frequency sweeps over the
        band, shifted in time between inputs; "sweep": one exponential sweep of each input after
        the other, as ArduPilot's SystemID mode flies it: two cycles at the low frequency, then up
        to the high one, faded in over a tenth of the period and out over a twenty-fifth.
    band : (float, float)
        Low and high, Hz.
    seed : int
        Fixes the phases.
    period : float
        Of a chirp or sweep, s.

    Raises
    ------
    InputError
        Another kind, an empty band, an amplitude that is not positive.

    See Also
    --------
    symheli.fly : one closed-loop flight
    identification.choose_experiments : the most informative flights

    References
    ----------
    Morelli (2012), Flight test maneuvers for efficient aerodynamic modeling, J. Aircraft 49
    (multisines); Tischler and Remple (2012), ch. 5 (sweeps);
    ardupilot.org/copter/docs/systemid-mode.html (SystemID mode).

    Examples
    --------
    >>> signals = symheli.Excitation({"d_lon": 0.01, "d_col": 0.02})(np.arange(0.0, 20.0, 0.02))
    >>> {name: round(float(np.std(signal)), 4) for name, signal in signals.items()}
    {'d_lon': 0.0071, 'd_col': 0.0141}
    """

    amplitude: Mapping[str, float]
    kind: Kind = "multisine"
    band: tuple[float, float] = (0.1, 5.0)
    seed: int = 0
    period: float = 20.0

    def __post_init__(self) -> None:
        if self.kind not in (known := get_args(Kind)):
            raise UnknownNameError("excitation", self.kind, known)
        whole(self.seed, "seed")
        if not 0 < self.period < np.inf:
            raise InputError(f"period: expected seconds > 0, got {self.period}")
        if len(self.band) != 2 or not 0 < self.band[0] < self.band[1]:
            raise InputError(f"band must be 0 < low < high in Hz, got {self.band}")
        if self.kind == "sweep" and not self.period > 2 / self.band[0]:
            raise InputError(
                f"period: a sweep holds its lowest frequency for two cycles,"
                f" {2 / self.band[0]:.3g} s, and must be longer, got {self.period:g} s"
            )
        by_name(self.amplitude, "amplitude", "{input: rad}, such as {'d_lon': 0.01}")
        for name, size in self.amplitude.items():
            finite(size, f"amplitude of {name}", "rad")
        if not all(a >= 0 for a in self.amplitude.values()):
            raise InputError(f"amplitudes must be >= 0 rad, got {dict(self.amplitude)}")

    def __call__(self, time: np.ndarray) -> dict[str, np.ndarray]:
        """{input: signal (n,) in rad} at uniformly sampled `time` (n,) s."""
        time = frozen(time, "time", (None,))
        if len(time) < 2 or np.any(np.diff(time) <= 0):
            raise InputError(f"time: expected increasing seconds (n,), n >= 2, got {len(time)}")
        dt = float(time[1] - time[0])
        if self.band[1] > 0.5 / dt:
            raise InputError(
                f"the band reaches {self.band[1]} Hz but {dt} s samples carry at most"
                f" {0.5 / dt:.3g} Hz"
            )
        rng = np.random.default_rng(self.seed)
        shape = {
            "multisine": self._multisine,
            "prbs": self._prbs,
            "chirp": self._chirp,
            "sweep": self._sweep,
        }[self.kind]
        sizes = np.array(list(self.amplitude.values()))
        return dict(zip(self.amplitude, sizes[:, None] * shape(time, rng), strict=True))

    def _multisine(self, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        n, count = len(time), len(self.amplitude)
        length = n * float(time[1] - time[0])
        harmonics = np.arange(np.ceil(self.band[0] * length), np.floor(self.band[1] * length) + 1)
        spectrum = np.zeros((count, n // 2 + 1), complex)
        for i in range(count):
            own = harmonics[i::count].astype(int)
            phases = rng.uniform(0, 2 * np.pi, len(own))
            spectrum[i, own] = np.exp(1j * phases) * (n / 2 * np.sqrt(1 / max(len(own), 1)))
        return np.fft.irfft(spectrum, n)

    def _prbs(self, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        cell = np.floor((time - time[0]) * 2 * self.band[1]).astype(int)
        return rng.choice([-1.0, 1.0], size=(len(self.amplitude), cell[-1] + 1))[:, cell]

    def _chirp(self, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:

        late = self.period / max(len(self.amplitude), 1) * np.arange(len(self.amplitude))
        shifted = np.mod(time + late[:, None], self.period)
        return np.asarray(chirp(shifted, self.band[0], self.period, self.band[1], phi=-90))

    def _sweep(self, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        low, high = 2 * np.pi * np.array(self.band)
        length, growth = self.period - 4 * np.pi / low, np.log(high / low)
        turn = self.period * np.arange(len(self.amplitude))
        t = time - time[0] - turn[:, None]
        swept = np.clip(t - 4 * np.pi / low, 0.0, length)
        held = low * np.minimum(t - 4 * np.pi / low, 0.0)
        phase = held + low * length / growth * np.expm1(growth * swept / length)
        up = np.clip(t / (FADE_IN * self.period), 0.0, 1.0)
        down = np.clip((self.period - t) / (FADE_OUT * self.period), 0.0, 1.0)
        window = (0.5 - 0.5 * np.cos(np.pi * up)) * (0.5 - 0.5 * np.cos(np.pi * down))
        return np.asarray(window * np.sin(phase))
