"""Peaks and margins of a specification sheet, proven for every value of the parameter between two
ends, at a given rate.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.tools import Actuation
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.questions.questions import l2_gain
from synthesis.design.loops.margins import Margins, decibels
from synthesis.design.plant.parts import DISTURBANCE
from synthesis.design.plant.plant import Plant
from synthesis.sheet.sheet import ControlAxis, Sheet, Specification

PROVABLE = {
    "input_peak": ("control", 1.0),
    "disk_gain": ("control", 0.5),
    "disk_phase": ("control", 0.5),
    "rejection_peak": ("response", 1.0),
}
"""Of a measure: where a disturbance is added, and the D that is added to the loop from there to
there so that its gain is the peak: S = 1 - T; the disk is 1 / |S - 1/2|.
"""


@dataclass(frozen=True, eq=False)
class Proven:
    """One specification as it is proven, by the `certificate` of its peak, for every motion of the
    parameter at its rate; `seconds`: the computing time.
    """

    specification: Specification
    certificate: Certificate
    seconds: float

    __repr__ = summarized

    @property
    def value(self) -> float:
        """In the unit of the specification; NaN where nothing is proven."""
        proven = self.certificate.verified
        return in_unit(self.specification.measure, self.certificate.gamma) if proven else math.nan

    @property
    def frozen(self) -> float:
        """Value of the worst frozen model of the same fit; NaN where one is unstable."""
        frozen = self.certificate.frozen
        return in_unit(self.specification.measure, frozen) if math.isfinite(frozen) else math.nan

    @property
    def margin(self) -> float:
        """Design margin, percent; NaN where nothing is proven."""
        return self.specification.design_margin(self.value)


def provable(sheet: Sheet) -> list[Specification]:
    """Return the specifications that are H-infinity norms of the loop."""
    return [s for s in sheet.specifications if s.kind == "frozen" and s.measure in PROVABLE]


def peak_loop(
    plant: LPVStateSpace,
    controller: LPVStateSpace | LinearModel,
    axis: ControlAxis,
    measure: str,
    *,
    servos: Mapping[str, object] | Actuation | None = None,
    delay: float = 0.0,
    degree: int = 3,
) -> LPVStateSpace:
    """Return the loop of one input and output whose gain is the peak that a measure is made of.

    A continuous plant is put behind the servos and sampled as the controller is, by polynomials of
    `degree`; its misfit is in `.residuals`. Raises `InputError` for a measure that is no peak.
    """
    if measure not in PROVABLE:
        raise InputError(f"expected one of {', '.join(PROVABLE)}, got {measure!r}")
    where, through = PROVABLE[measure]
    shown = axis.control if where == "control" else axis.response
    whole = Plant(
        plant,
        performance=(shown,),  # type: ignore[arg-type]
        controls=controller.outputs,
        measurements=controller.inputs,
    )
    actuation = Actuation.of(servos, delay, controller.dt).select(controller.outputs)
    whole = whole.behind(actuation, degree)
    if where == "control":
        whole = whole.with_input_disturbance([axis.control])
        assert whole.disturbances == (f"{axis.control}{DISTURBANCE}",)  # noqa: S101
    else:
        whole = whole.with_noise({axis.response: 1.0})
    loop = whole.close(controller)
    assert isinstance(loop, LPVStateSpace)  # noqa: S101
    one = np.asarray(loop.basis.constant())[:, None, None]
    return replace(loop, D=loop.D + through * one)


def in_unit(measure: str, gain: float) -> float:
    """Return the value of a measure, in dB or deg, from the gain of its `peak_loop`."""
    if PROVABLE[measure][1] == 1.0:
        return decibels(gain)
    disk = Margins(True, (0.0, math.inf), math.inf, math.inf, 1 / gain, ())
    return math.degrees(disk.disk_phase) if measure == "disk_phase" else decibels(disk.disk_gain[1])


def prove(
    plant: LPVStateSpace,
    controller: LPVStateSpace | LinearModel,
    specification: Specification,
    axis: ControlAxis,
    rate: float = 0.0,
    *,
    servos: Mapping[str, object] | Actuation | None = None,
    delay: float = 0.0,
    degree: int = 3,
    **options: Any,
) -> Proven:
    """Prove a peak or a disk margin with `l2_gain`: at `rate` 0 of every frozen model between the
    ends of the range, otherwise of every motion of the parameter at most that fast, per second.

    The statement is about the fit of the plant that `peak_loop` makes. `options` are of `l2_gain`.

    Examples
    --------
    >>> import symheli
    >>> from synthesis.sheet.proven import prove
    >>> from synthesis.sheet.sheet import ControlAxis, Specification
    >>> p = symheli.Scheduling("p", "1", 0.0, 1.0)
    >>> cart = symheli.LPVStateSpace.polynomial(
    ...     [[[0.0]]], [[[1.0]], [[1.0]]], [[[1.0]]], [[[0.0]]], p, inputs=("f",), outputs=("v",))
    >>> axis = ControlAxis(name="speed", control="f", response="v")
    >>> disk = Specification(
    ...     name="disk", axis="speed", measure="disk_phase", unit="deg", sense="at least",
    ...     level_1=40.0, level_2=20.0, source="project target", length=1.0)
    >>> gain = symheli.LinearModel.gain([[-3.0]], ("v",), ("f",))
    >>> print(f"{prove(cart, gain, disk, axis).value:.0f} deg")  # of 3 (1 + p) / s
    90 deg
    """
    begin = time.perf_counter()
    loop = peak_loop(
        plant,
        controller,
        axis,
        specification.measure,
        servos=servos,
        delay=delay,
        degree=degree,
    )
    certificate = l2_gain(loop, rate, **{"search": None, **options})
    return Proven(specification, certificate, time.perf_counter() - begin)
