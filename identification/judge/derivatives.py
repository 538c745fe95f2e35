"""Stability and control derivatives of identified models, with the certainty of the coefficients
they are sums of.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.judge.frozen_plant import FrozenPlant
from identification.model.kinematic_model import KinematicModel
from identification.structure.kinematic_arx import MOVING
from symheli.values.arrays import Array

LEFT = 1e-3
"""Share of a derivative that is left out: without any damping a plant may integrate, and a pole on
the unit circle has no nu-gap.
"""


@dataclass(frozen=True, eq=False)
class Derivatives:
    """The amount that a steady change of a signal adds to the rate of an output, at one value of
    the scheduling: per second, the coefficients of all lags of the signal together,

        D(p) = sum_i f(p)' theta_i / dt        (lagged outputs of an ARX: -(1 + sum_i a_i(p)) / dt).

    Single coefficients of neighbouring lags are hardly told from each other; their sum is what the
    classical derivative of air loads is, and what feedback at low frequency sees.

    Parameters
    ----------
    names : tuple of str
        "output from signal", m of them.
    value : array (m,)
        Units of the output per that of the signal, per second.
    rows : array (m, ny, n)
        D changes by sum rows * theta.T.
    without : array (m, n, ny)
        What added to theta leaves a thousandth of each of them, by the first lag alone.
    """

    names: tuple[str, ...]
    value: Array
    rows: Array
    without: Array

    @classmethod
    def of(cls, plant: FrozenPlant, theta: Array, p: object) -> Derivatives:
        """The derivatives among the signals of the plant."""
        arx, model = plant.regression, plant.model
        f, dt = np.asarray(arx.basis(p), float).reshape(-1), model.dt
        kinematic = isinstance(model, KinematicModel)
        equations = MOVING if kinematic else arx.outputs
        signals = {("input", i): name for i, name in enumerate(arx.inputs)}
        signals |= {} if kinematic else {("output", i): y for i, y in enumerate(arx.outputs)}
        names, values, rows, without = [], [], [], []
        for o, output in enumerate(equations):
            for key, signal in signals.items():
                entries = [
                    e for e, entry in enumerate(arx.entries) if (entry.kind, entry.channel) == key
                ]
                blocks = [slice(e * len(f), (e + 1) * len(f)) for e in entries]
                blocks = [b for b in blocks if arx.free[b, o].any()]
                if (
                    output not in plant.outputs
                    or signal not in (*plant.outputs, *plant.inputs)
                    or not blocks
                ):
                    continue
                sign = -1.0 if key[0] == "output" else 1.0
                row = np.zeros(theta.T.shape)
                for block in blocks:
                    row[o, block] = sign * f / dt
                own = -1.0 / dt if key == ("output", o) else 0.0
                value = float(np.sum(row * theta.T)) + own
                gone = np.zeros(theta.shape)
                gone[blocks[0], o] = -sign * (1 - LEFT) * value * dt * f / (f @ f)
                names.append(f"{output} from {signal}")
                values.append(value)
                rows.append(row)
                without.append(gone)
        return cls(tuple(names), np.array(values), np.array(rows), np.array(without))

    def covariance(self, joint: Array) -> Array:
        """(m, m) from that of the coefficients, (ny, n, ny, n)."""
        return np.einsum("ayi,yizj,bzj->ab", self.rows, joint, self.rows, optimize=True)


@dataclass(frozen=True, eq=False)
class Certainty:
    """Cramer-Rao bounds, insensitivities (both as shares of the values) and correlations of m
    parameters.

    With the information F = covariance^-1: the bound is sqrt((F^-1)_ii), the insensitivity
    1/sqrt(F_ii): what the parameter alone may change before it is seen.
    """

    bound: Array
    insensitivity: Array
    correlation: Array

    @classmethod
    def of(cls, value: Array, covariance: Array) -> Certainty:
        """From values (m,) and their covariance (m, m)."""
        scale = np.sqrt(np.diagonal(covariance))
        safe = np.where(scale > 0, scale, 1.0)
        correlation = covariance / np.outer(safe, safe)
        information = np.linalg.pinv(correlation, rcond=1e-12, hermitian=True)
        alone = scale / np.sqrt(np.maximum(np.diagonal(information), 1.0))
        size = np.maximum(np.abs(value), np.finfo(float).tiny)
        return cls(scale / size, alone / size, correlation - np.eye(len(value)))
