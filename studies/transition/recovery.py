"""Exact recovery: on data of a discrete polynomial LPV system the order-1 model gives A(p), B(p)
back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification import LPVARX, Polynomial, fit
from studies.setup.axes import LONGITUDINAL
from studies.setup.flights import TOP
from symheli import FlightRecord, LinearFamily
from symheli.lpv.tools import simulate
from symheli.values.signal import UNITS

STATES, INPUTS = LONGITUDINAL.states, LONGITUDINAL.inputs


@dataclass(frozen=True)
class Recovery:
    """Largest error of any entry of A(p) and B(p) over the range; the misfit of the discrete fit is
    no error of the identification.
    """

    period: float
    degree: int
    A_error: float
    B_error: float
    discretization_misfit: float


@dataclass(frozen=True, kw_only=True)
class Recoveries:
    """One recovery a sample period."""

    runs: tuple[Recovery, ...]


def recover_at(family: LinearFamily, periods: Sequence[float], seed: int = 0) -> Recoveries:
    """At each sample period (s)."""
    return Recoveries(runs=tuple(recover(family, period, seed=seed) for period in periods))


def recover(
    family: LinearFamily, period: float = 0.02, degree: int = 3, samples: int = 1500, seed: int = 0
) -> Recovery:
    """Discretize at nodes, fit element-wise, fly with random p and inputs, identify, compare at 50
    airspeeds.
    """
    plant = replace(
        family.select(STATES, INPUTS).interpolate("polynomial", degree), residuals=None
    ).discretize(period, degree=degree)
    rng = np.random.default_rng(seed)
    p, u = rng.uniform(0.0, TOP, samples), 0.02 * rng.standard_normal((samples, len(INPUTS)))
    x, _ = simulate(plant, p, u)
    columns: dict[str, Any] = (
        {name: x[:, i] for i, name in enumerate(STATES)}
        | {name: u[:, i] for i, name in enumerate(INPUTS)}
        | {"airspeed": p}
    )
    record = FlightRecord.from_arrays(
        period * np.arange(samples), {n: UNITS[n] for n in columns}, **columns
    )
    arx = LPVARX(
        STATES,
        INPUTS,
        "airspeed",
        na=1,
        nb=1,
        delay=1,
        basis=Polynomial(degree, 0.0, TOP),
        scheduling_at="lag",
    )
    found = fit(arx, record, method="rls").to_state_space()
    speeds = np.linspace(0.0, TOP, 50)
    (A, B, *_), (Ah, Bh, *_) = plant.matrices(speeds), found.matrices(speeds)
    misfit = plant.residuals
    assert misfit is not None  # noqa: S101  (discretize always says how well it fitted)
    return Recovery(
        period,
        degree,
        float(np.abs(A - Ah).max()),
        float(np.abs(B - Bh).max()),
        float(max(np.abs(misfit.A).max(), np.abs(misfit.B).max())),
    )
