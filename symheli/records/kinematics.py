"""The kinematics every rigid aircraft obeys, as channels of a flight-path reconstruction.

Sensors that are integrated read scale * true + bias; their parameters are 1/scale and bias/scale,
in which the channels are linear.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from symheli.records.flight_path import Channel, Kinematics, Windows
from symheli.values.arrays import Array
from symheli.values.kinematics import kinematic_rates
from symheli.values.signal import Signal

RATES = ("p", "q", "r")
ANGLES = ("phi", "theta", "psi")
VELOCITIES = ("u", "v", "w")
FORCES = ("ax", "ay", "az")
"""Specific forces, what accelerometers read: 0 0 -g in level hover; m/s^2."""

COMPARED = (*RATES, *ANGLES, *VELOCITIES, *FORCES)
UNIT = {
    **dict.fromkeys(RATES, "rad/s"),
    **dict.fromkeys(ANGLES, "rad"),
    **dict.fromkeys(VELOCITIES, "m/s"),
    **dict.fromkeys(FORCES, "m/s^2"),
}


def comparable(signals: Sequence[Signal]) -> list[str]:
    """Return the signals of these kinematics that are recorded, in their unit."""
    units = {str(signal): signal.unit for signal in signals}
    return [name for name in COMPARED if units.get(name) == UNIT[name]]


def lacking(signals: Sequence[Signal]) -> list[str]:
    """Return the missing signals without which nothing can be compared."""
    there = comparable(signals)
    return [name for name in (*RATES, *ANGLES[:2]) if name not in there]


def attitude(windows: Windows, signals: Mapping[str, Array]) -> Kinematics:
    """Return phi, theta, and psi where it is among the signals, driven by p q r: Euler's equations.

    The parameters (8,) are those of p q r and the biases of phi and theta, to first order.
    Source: Klein and Morelli (2006), ch. 10.
    """
    angles = np.column_stack([signals["phi"], signals["theta"]])
    p, q, r = rates = [signals[name] for name in RATES]
    zero, one = np.zeros(len(p)), np.ones(len(p))

    def at(delays: Array) -> list[Channel]:
        phi, theta = (windows.advanced(angles[:, [i]], delays[i])[:, 0] for i in (0, 1))
        s, c, t, sec = np.sin(phi), np.cos(phi), np.tan(theta), 1 / np.cos(theta)
        turn, nod = q * s + r * c, q * c - r * s
        rows = {  # of p q r; of the biases of phi and theta
            "phi": ((one, t * s, t * c), (-t * nod, -(sec**2) * turn)),
            "theta": ((zero, c, -s), (turn, zero)),
            "psi": ((zero, sec * s, sec * c), (-sec * nod, -sec * t * turn)),
        }
        out = []
        for name in (name for name in ANGLES if name in signals):
            euler, tilt = (np.column_stack(part) for part in rows[name])
            columns = np.column_stack([euler * np.column_stack(rates), -euler, tilt])
            out.append(Channel(name, signals[name], zero, columns))
        return out

    return Kinematics(RATES, np.repeat([1.0, 0.0], [3, 5]), at)


def motion(windows: Windows, signals: Mapping[str, Array]) -> Kinematics:
    """u, v, w driven by specific forces: V' = -omega x V + g + a.

    The parameters (6,) are those of ax ay az; rates and angles are taken as they are.
    Source: Klein and Morelli (2006), ch. 10.
    """
    velocities = np.column_stack([signals[name] for name in VELOCITIES])
    turning = np.column_stack([signals[name] for name in (*RATES, *ANGLES[:2])])

    def at(delays: Array) -> list[Channel]:
        moving = [windows.advanced(velocities[:, [i]], delays[i]) for i in range(3)]
        known = kinematic_rates(np.column_stack([*moving, turning]))
        out = []
        for i, (name, force) in enumerate(zip(VELOCITIES, FORCES, strict=True)):
            columns = np.zeros((len(turning), 6))
            columns[:, i], columns[:, 3 + i] = signals[force], -1.0
            out.append(Channel(name, velocities[:, i], known[:, i], columns))
        return out

    return Kinematics(FORCES, np.repeat([1.0, 0.0], 3), at)


def axis(signals: Mapping[str, Array], rate: str, angle: str) -> Kinematics:
    """An angle that follows one rate, as small angles do."""
    columns = np.column_stack([signals[rate], -np.ones(len(signals[rate]))])
    channel = Channel(angle, signals[angle], np.zeros(len(columns)), columns)
    return Kinematics((rate,), np.array([1.0, 0.0]), lambda delays: [channel])


def continuous(angle: Array, stretches: Sequence[slice]) -> Array:
    """An angle (n,) without jumps by a whole turn, of radians or of degrees."""
    out = angle.copy()
    turn = 2 * np.pi if np.nanmax(angle) - np.nanmin(angle) < 2.2 * np.pi else 360.0
    for part in stretches:
        out[part] = np.unwrap(angle[part], discont=0.75 * turn, period=turn)
    return out
