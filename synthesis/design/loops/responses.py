"""Responses of a closed loop: to a command, to a disturbance, to a step, each as a number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from symheli import LinearModel
from symheli.values.arrays import Array
from symheli.values.signal import indices

LOWEST = 0.1
"""Frequency, rad/s, from which responses are searched: slower motion is the pilot's."""

HALF_POWER = 1 / np.sqrt(2.0)
"""-3 dB."""

POINTS = 600
"""Frequencies at which responses are computed; straight lines between them, in logarithms, are
within 1e-4 for a lag.
"""

DURATION = 10.0
"""Length of the step response, s: settling takes at most this."""

SETTLED = 0.05
"""Part of the step within which the response has settled."""


class Responses(NamedTuple):
    """Numbers of one closed loop: `bandwidth_3db` (rad/s), up to which the response to the command
    follows within -3 dB, and its `peak` (dB); `rejection` (rad/s), up to which the output's
    sensitivity to a disturbance of it is below -3 dB, and `rejection_peak`, the largest sensitivity
    (dB); `overshoot` (% of the command), `rise` from 10 to 90 % and `settling` to 5 % (s) after a
    step.
    """

    bandwidth_3db: float
    peak: float
    rejection: float
    rejection_peak: float
    overshoot: float
    rise: float
    settling: float


def responses(
    closed: LinearModel, loops: Mapping[str, tuple[str, str, str]]
) -> dict[str, Responses]:
    """Return the responses of a stable closed model by {name: (output, its command, a disturbance
    that is added to the output where it is measured)}.
    """
    top = 100.0 if closed.dt is None else 0.999 * np.pi / closed.dt
    omega = np.geomspace(LOWEST, top, POINTS)
    G = np.abs(closed.frequency_response(omega) + _passed(closed, loops))
    step = closed.step_response(DURATION)
    found = {}
    for name, (output, command, disturbance) in loops.items():
        (y,) = indices([output], closed.outputs, "output")
        u, d = indices([command, disturbance], closed.inputs, "input")
        overshoot, rise, settling = _of_step(step.time, step.values[:, y, u])
        found[name] = Responses(
            _bandwidth(omega, G[:, y, u]),
            float(20 * np.log10(G[:, y, u].max())),
            _passing(omega, G[:, y, d], HALF_POWER),
            float(20 * np.log10(G[:, y, d].max())),
            overshoot,
            rise,
            settling,
        )
    return found


def _passed(closed: LinearModel, loops: Mapping[str, tuple[str, str, str]]) -> Array:
    """(ny, nu): 1 where a disturbance is a part of the disturbed output."""
    passed = np.zeros((len(closed.outputs), len(closed.inputs)))
    for output, _, disturbance in loops.values():
        row, column = closed.outputs.index(output), closed.inputs.index(disturbance)  # type: ignore[arg-type]
        passed[row, column] = 1.0
    return passed


def _bandwidth(omega: Array, size: Array) -> float:
    """Where a response that has reached -3 dB falls below it; the lowest frequency where it never
    reaches that.
    """
    followed = size >= HALF_POWER
    if not followed.any():
        return float(omega[0])
    k = int(followed.argmax())
    return _passing(omega[k:], -size[k:], -HALF_POWER)


def _passing(omega: Array, size: Array, level: float) -> float:
    """The lowest frequency at which `size` rises to `level`: the ends of `omega` where it is above
    from the beginning, or nowhere.
    """
    above = size >= level
    if above[0] or not above.any():
        return float(omega[0] if above[0] else omega[-1])
    k = int(above.argmax())
    x, y = np.log(omega[k - 1 : k + 1]), np.log(np.abs(size[k - 1 : k + 1]))
    part = (np.log(abs(level)) - y[0]) / (y[1] - y[0])
    return float(np.exp(x[0] + part * (x[1] - x[0])))


def _of_step(time: Array, y: Array) -> tuple[float, float, float]:
    """Overshoot (%), rise and settling time (s) of the response to a unit step."""

    def first(level: float) -> float:
        if not (y >= level).any():
            return DURATION
        k = int((y >= level).argmax())
        if k == 0:
            return float(time[0])
        return float(np.interp(level, y[k - 1 : k + 1], time[k - 1 : k + 1]))

    outside = np.abs(y - 1.0) > SETTLED
    last = len(y) - 1 - int(outside[::-1].argmax()) if outside.any() else -1
    settling = DURATION
    if last < len(y) - 1:
        settling = 0.0
        if last >= 0:  # straight from the last sample outside to the first within
            off = np.abs(y[last : last + 2] - 1.0)
            settling = float(np.interp(-SETTLED, -off, time[last : last + 2]))
    rise = first(0.9) - first(0.1) if y.max() >= 0.9 else DURATION
    return 100.0 * max(float(y.max()) - 1.0, 0.0), rise, settling
