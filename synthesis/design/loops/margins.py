"""Margins of a feedback loop: the gain, phase and delay, or both at once, that make it unstable."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigvals

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv.linear_model import as_model, feedback_matrix
from symheli.lpv.lower_feedback import PREFIX, apart
from symheli.values.arrays import Array
from symheli.values.signal import indices
from synthesis.numerics.linear.norm import crossings, norm, of_one_size, pace_of, to_continuous


@dataclass(frozen=True)
class Margins:
    """Stability margins of a stable loop: the smallest change that makes it unstable, infinite if
    there is none.

    gain: factors (below 1, above 1) between which the loop gain may be changed. phase (rad) may be
    lost or gained, delay (s) added. disk: radius of the largest balanced disk, alpha, NaN where it
    was not asked for: gain within `disk_gain` and phase within `disk_phase` (rad) may change
    together, at any frequency.
    crossover: frequencies of unit gain (rad/s). A loop that is unstable as it is has `stable` False
    and no margin.
    """

    stable: bool
    gain: tuple[float, float]
    phase: float
    delay: float
    disk: float
    crossover: tuple[float, ...]

    @property
    def disk_gain(self) -> tuple[float, float]:
        """Gain factors inside the disk margin."""
        return max((2 - self.disk) / (2 + self.disk), 0.0), (
            math.inf if self.disk >= 2 else (2 + self.disk) / (2 - self.disk)
        )

    @property
    def disk_phase(self) -> float:
        """Phase (rad) inside the disk margin."""
        return 2 * math.atan(self.disk / 2)

    @property
    def decibels(self) -> tuple[float, float]:
        """Gain factors in dB: negative, by which the gain may fall, and positive."""
        less, more = self.gain
        return decibels(less), decibels(more)

    @property
    def gain_margin(self) -> float:
        """Smallest change of the gain in either direction, dB."""
        less, more = self.decibels
        return min(more, -less)

    @property
    def phase_margin(self) -> float:
        """Phase that may be lost or gained, deg."""
        return math.degrees(self.phase)

    @property
    def highest_crossover(self) -> float:
        """Highest frequency of unit gain, rad/s; 0 where there is none."""
        return max(self.crossover, default=0.0)


def decibels(gain: float) -> float:
    """Return the gain in dB; -inf of 0."""
    return 20 * math.log10(gain) if gain > 0 else -math.inf


UNSTABLE = Margins(False, (1.0, 1.0), 0.0, 0.0, 0.0, ())


def open_loop(
    plant: LinearModel, feedback: Mapping[tuple[str, str], float] | LinearModel, at: str
) -> LinearModel:
    """Return the loop of u = feedback y broken at one input, as L of 1 + L (negative feedback).

    Parameters
    ----------
    plant : LinearModel
        The model, nx states.
    feedback : mapping or LinearModel
        {(input, output): gain} as in `LinearModel.feedback`, gains in units of the input per unit
        of the output; or a controller from outputs of the plant to inputs of it, u = K y.
    at : str
        The input at which the loop is broken; the others stay closed.

    Returns
    -------
    LinearModel
        L, from that input to itself.

    Raises
    ------
    InputError
        Where an output that is fed back has feedthrough, or a controller another sample period.
    UnknownNameError
        For an input that the plant does not have.

    Examples
    --------
    >>> from symheli import LinearModel
    >>> plant = LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ["y"], ["u"], ["y"])  # 1/s
    >>> L = open_loop(plant, {("u", "y"): -2.0}, "u")  # 2/s
    >>> float(L.C[0, 0])
    2.0
    """
    (i,) = indices([at], plant.inputs, "input")
    if isinstance(feedback, LinearModel):
        return _dynamic_loop(plant, feedback, at)
    row = feedback_matrix(
        {pair: gain for pair, gain in feedback.items() if pair[0] == at},
        plant.inputs,
        plant.outputs,
    )[[i]]
    others = plant.feedback({pair: gain for pair, gain in feedback.items() if pair[0] != at})
    if np.abs(row @ plant.D).max(initial=0.0) > 0:
        raise InputError(
            "an output that is fed back depends on an input directly; put an actuator or a delay"
            " between"
        )
    signal = (plant.inputs[i],)
    return LinearModel(
        others.A,
        others.B[:, [i]],
        -row @ others.C,
        np.zeros((1, 1)),
        plant.states,
        signal,
        signal,
        plant.dt,
    )


def _dynamic_loop(plant: LinearModel, controller: LinearModel, at: str) -> LinearModel:
    """L of a loop with dynamics, broken at one output of the controller."""
    controls = controller.outputs
    (k,) = indices([at], controls, "control")
    if plant.dt != controller.dt:
        raise InputError(
            f"the plant has dt = {plant.dt} and the controller dt = {controller.dt}; discretize or"
            " sample one like the other"
        )
    P = plant.select(inputs=controls, outputs=controller.inputs)
    if np.abs(P.D).max(initial=0.0) > 0:
        raise InputError(
            "an output that is fed back depends on an input directly; put an actuator or a delay"
            " between"
        )
    n, m = len(P.A), len(controller.A)
    A = np.block([[P.A, np.zeros((n, m))], [controller.B @ P.C, controller.A]])
    B, C = (
        np.vstack([P.B, np.zeros((m, len(controls)))]),
        np.hstack([controller.D @ P.C, controller.C]),
    )
    others = [j for j in range(len(controls)) if j != k]
    return LinearModel(
        A + B[:, others] @ C[others],
        B[:, [k]],
        -C[[k]],
        np.zeros((1, 1)),
        (*P.states, *apart(controller.states, P.states, PREFIX)),
        (controls[k],),
        (controls[k],),
        plant.dt,
    )


def margins(loop: LinearModel, *, disk: bool = True) -> Margins:
    """Compute gain, phase, delay and disk margins of a scalar loop L under negative feedback.

    Without a frequency grid: unit-gain crossings are eigenvalues of a Hamiltonian matrix, phase
    crossings zeros of L(s) - L(-s), the disk an H-infinity norm. In discrete time delays count in
    whole and broken samples alike (a phase of omega times the delay).

    Parameters
    ----------
    loop : LinearModel
        L, one input and one output.
    disk : bool
        False leaves the disk out (NaN), which is three quarters of the work.

    Returns
    -------
    Margins
        Gain factors, phase (rad), delay (s) and the disk.

    Raises
    ------
    InputError
        For a loop of several channels.

    See Also
    --------
    synthesis.disk_margin : margin of all channels at once
    synthesis.margin_table : margins over the parameters
    synthesis.analysis.open_loop : L opened at an input

    References
    ----------
    Seiler, Packard and Gahinet, "An introduction to disk margins", IEEE Control Systems Magazine 40
    (2020).

    Examples
    --------
    >>> from symheli import LinearModel
    >>> plant = LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ["y"], ["u"], ["y"])  # 1/s
    >>> from synthesis.analysis import open_loop
    >>> found = margins(open_loop(plant, {("u", "y"): -2.0}, "u"))  # 2/s: 90 deg at 2 rad/s
    >>> print(f"{found.phase:.4f} rad, {found.delay:.4f} s")
    1.5708 rad, 0.7854 s
    """
    loop = as_model(loop)
    if len(loop.inputs) != 1 or len(loop.outputs) != 1:
        raise InputError(
            f"margins need a loop of one input and one output, got {len(loop.inputs)} and"
            f" {len(loop.outputs)}; break it with open_loop()"
        )
    closed = _closed(loop)
    if not closed.is_stable():
        return UNSTABLE
    # continuous: time in units in which the fastest pole of the closed loop is about 1
    pace = pace_of(closed.poles()) if loop.dt is None else 0
    B, C = of_one_size(loop.B, loop.C, -pace)
    paced = replace(loop, A=np.ldexp(loop.A, -pace), B=B, C=C)
    A, D = paced.A, paced.D
    if loop.dt is not None:
        A, B, C, D = to_continuous(A, B, C, D)

    def physical(omega: Array) -> Array:
        return np.ldexp(omega, pace) if loop.dt is None else 2 * np.arctan(omega) / loop.dt

    def response(omega: Array) -> Array:
        at = omega if loop.dt is None else physical(omega)
        return paced.frequency_response(at)[:, 0, 0]

    unit = crossings(A, B, C, D, 1.0)
    unit = unit[unit > 0]
    if len(unit):
        unit = unit[
            np.abs(np.abs(response(unit)) - 1) < 1e-4
        ]  # eigenvalues near the axis that are no crossings go
    lag = np.angle(-response(unit)) if len(unit) else unit  # the angle by which L differs from -1
    real = _real_axis(A, B, C)
    values = np.real(response(real)) if len(real) else real
    values = np.concatenate([values, D[0]])
    with np.errstate(over="ignore"):  # beyond the range of numbers is as good as never
        factors = -1 / values[values < 0]
        delays = np.mod(lag, 2 * np.pi) / physical(unit) if len(unit) else np.zeros(0)
    return Margins(
        True,
        (
            float(factors[factors < 1].max(initial=0.0)),
            float(factors[factors > 1].min(initial=math.inf)),
        ),
        float(np.abs(lag).min(initial=math.inf)),
        float(delays.min(initial=math.inf)),
        disk_margin(loop) if disk else math.nan,
        tuple(float(w) for w in physical(unit)),
    )


def disk_margin(loop: LinearModel) -> float:
    """Return alpha of the balanced disk margin, 1/|S - I/2| in the H-infinity norm; 0 for an
    unstable loop.

    For a square loop of several channels all may change at once and independently, and be coupled:
    a lower bound of what a diagonal change needs.

    Parameters
    ----------
    loop : LinearModel
        L, as many inputs as outputs.

    Returns
    -------
    float
        alpha: 2 at most, without unit.

    Raises
    ------
    InputError
        For a loop that is not square.

    See Also
    --------
    synthesis.margins : margins of a scalar loop
    symheli.lpv.stability_margin : distance to the nearest plant that is lost

    References
    ----------
    Seiler, Packard and Gahinet, "An introduction to disk margins", IEEE Control Systems Magazine 40
    (2020).

    Examples
    --------
    >>> from symheli import LinearModel
    >>> plant = LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ["y"], ["u"], ["y"])  # 1/s
    >>> from synthesis.analysis import open_loop
    >>> print(f"{disk_margin(open_loop(plant, {('u', 'y'): -2.0}, 'u')):.3f}")
    2.000
    """
    loop = as_model(loop)
    if len(loop.inputs) != len(loop.outputs):
        raise InputError(
            f"a loop needs as many outputs as inputs, got {len(loop.outputs)} and"
            f" {len(loop.inputs)}"
        )
    S = _closed(loop)
    if not S.is_stable():
        return 0.0
    gain = norm(S.A, S.B, S.C, S.D - 0.5 * np.eye(len(S.inputs)), S.dt)[0]
    return math.inf if gain == 0 else 1 / gain


def _closed(loop: LinearModel) -> LinearModel:
    """Return S = (I + L)^-1."""
    inverse = np.linalg.inv(np.eye(len(loop.inputs)) + loop.D)
    B = loop.B @ inverse
    return replace(loop, A=loop.A - B @ loop.C, B=B, C=-inverse @ loop.C, D=inverse)


def _real_axis(A: Array, B: Array, C: Array) -> Array:
    """Return frequencies >= 0 (rad/s) at which a scalar L is real: imaginary zeros of L(s)
    - L(-s).
    """
    n = len(A)
    pencil = np.zeros((2 * n + 1, 2 * n + 1))
    pencil[:n, :n], pencil[n : 2 * n, n : 2 * n] = A, -A
    pencil[:n, [-1]] = pencil[n : 2 * n, [-1]] = B
    pencil[[-1], :n] = pencil[[-1], n : 2 * n] = C
    mass = np.diag([1.0] * (2 * n) + [0.0])
    zeros = eigvals(pencil, mass)
    zeros = zeros[np.isfinite(zeros)]
    size = np.abs(np.linalg.eigvals(A)).max(initial=1e-12)
    zeros = zeros[np.abs(zeros) < 1e6 * size]
    on_axis = np.abs(np.real(zeros)) <= 1e-6 * (np.abs(zeros) + 1e-3 * size)
    frequencies = np.unique(np.abs(np.imag(zeros[on_axis])))
    poles_at_rest = np.any(np.abs(np.linalg.eigvals(A)) < 1e-9 * size)
    return (
        frequencies[frequencies > 1e-6 * size]
        if poles_at_rest
        else np.unique(np.concatenate([[0.0], frequencies]))
    )
