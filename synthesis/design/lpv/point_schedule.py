"""Point designs along the parameter, interpolated into a scheduled controller."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from symheli.errors import SynthesisError
from symheli.lpv.bases import PiecewiseLinear
from symheli.values.arrays import Array
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.fitted import Fitted, controller_from
from synthesis.design.lti.hinf import hinf
from synthesis.design.lti.point_design import PointDesign, design_at
from synthesis.design.plant.plant import Plant


def hinf_at(plant: Plant, p: Sequence[float], back_off: float = 1.01) -> PointDesign:
    """Design the H-infinity controller of a plant frozen at p, one value a parameter; `back_off` as
    in `hinf`.
    """
    return design_at(plant, p, partial(hinf, back_off=back_off))


def hinf_schedule(
    plant: Plant, points: Sequence[float] | Array, back_off: float = 1.01
) -> Controller:
    """Design H-infinity controllers at values of the one parameter of a plant and interpolate their
    entries linearly. This is meaningful because the states of each design estimate those of the
    plant in the same coordinates.

    `back_off` is the factor by which each design may exceed the least norm, as in `hinf`;
    `promised` is the largest of the norms at the points; between them nothing is promised. Raises
    `SynthesisError` where a point has no design.
    """
    found = []
    for p in points:
        one = hinf_at(plant, [float(p)], back_off)
        if one.controller is None:
            (parameter,) = plant.parameters
            at = f"{parameter.name} {p:g} {parameter.unit}"
            raise SynthesisError(f"no H-infinity design at {at}: {'; '.join(one.reasons)}")
        found.append((one.controller, one.hinf_norm))
    models = [model for model, _ in found]
    M = np.stack([np.block([[K.A, K.B], [K.C, K.D]]) for K in models])
    fit = Fitted(PiecewiseLinear(tuple(map(float, points))), M, 0.0)
    method = f"H-infinity at {len(models)} values of the parameter"
    return controller_from(plant, fit, models[0].states, max(norm for _, norm in found), method)
