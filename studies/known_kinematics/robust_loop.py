"""The lateral loop around every model that the flight data allow, and what a certificate of it is
worth beside the exact model.
"""

from __future__ import annotations

import math
from typing import Literal

from identification.model import KinematicModel
from studies.loops.lateral import OUTPUTS
from studies.loops.robust_lateral import FEEDBACK
from studies.setup.axes import LATERAL
from studies.setup.bounds import SIZES
from symheli import UncertainStateSpace
from synthesis.forms import Spline

PROBABILITY = 0.95
DRAWS = 20_000
"""Draws of the radius of the ellipsoid: see `identification.model.matrix_ellipsoid`."""

DEGREE = 4
"""Degree of the loop in airspeed: what it leaves of any entry is below 1e-4 of the largest."""

FORM = Spline(degree=1, segments=4)
"""Form of the certificates of sets: quadratics on 6 segments prove gains 0.05 % smaller in three
times the time.
"""

Verdict = Literal["holds", "fails", "undecided", "no certificate"]


def robust_loop(
    model: KinematicModel,
    other: KinematicModel | None = None,
    head_wind: tuple[float, float] = (0.0, 0.0),
) -> UncertainStateSpace:
    """The loop with a margin around every lateral model of the set, disturbances at the inputs to
    r and phi, in their sizes; `other` and `head_wind` (m/s) as of `KinematicModel.uncertain`.
    """
    wide = _loop(model, other, head_wind, None)
    return _loop(model, other, head_wind, wide)


def _loop(
    model: KinematicModel,
    other: KinematicModel | None,
    head_wind: tuple[float, float],
    tight_for: UncertainStateSpace | None,
) -> UncertainStateSpace:
    """The loop around a set, tight where another loop around it has its errors."""
    held = {"acceleration_command": 0.0} if len(model.parameters) == 2 else None
    every = model.uncertain(
        PROBABILITY,
        LATERAL.outputs,
        LATERAL.inputs,
        held=held,
        degree=DEGREE,
        draws=DRAWS,
        other=other,
        head_wind=head_wind,
        tight_for=tight_for,
    )
    loop = every.feedback(FEEDBACK).select(inputs=LATERAL.inputs, outputs=OUTPUTS)
    return loop.scaled({u: SIZES[u] for u in LATERAL.inputs}, {y: SIZES[y] for y in OUTPUTS})


def verdict(proven: float, exact: float, flown: float) -> Verdict:
    """Compare with the exact model: its proven gain is at most the certificate's, its lower bound
    above it, or neither.
    """
    if math.isinf(proven):
        return "no certificate"
    if exact <= proven:
        return "holds"
    return "fails" if flown > proven else "undecided"
