"""Certificates of the lateral loop: gain against permitted acceleration, for baseline and
identified model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import synthesis
from identification.model import LPVARXModel
from studies.loops.exact_lateral import ExactLateral
from studies.loops.lateral import ATTITUDE_HOLD, close
from studies.setup.axes import LATERAL
from studies.setup.bounds import (
    CONSTANT,
    COPIES,
    FORMS,
    LEFT_OUT,
    LFT_TESTS,
    MEMORY,
    PERIOD,
    PLAIN,
    SIZES,
    Bound,
    unit_of,
)
from studies.setup.flights import TOP
from symheli import (
    Helicopter,
    LinearFamily,
    LinearModel,
    LPVStateSpace,
    Scheduling,
    UncertainStateSpace,
)
from symheli.lpv.bases import Polynomial
from synthesis.analysis import LowerBoundSearch
from synthesis.certify.questions.gain_curve import GainCurve
from synthesis.forms import LaggedParameter, Spline
from synthesis.numerics.linear.norm import norm

ESTIMATE, ALLOWED = "identified, the estimate", "identified, every model allowed"
"""One model of the flights, and all that their noise leaves possible."""


MEMORIES = {
    rate: LaggedParameter(lag, segments=8, grading=1.5, across_segments=across, across_degree=3)
    for rate, lag, across in ((3.0, 0.6, 3), (4.5, 0.6, 3), (6.0, 0.5, 4))
}
"""Accelerations (m/s^2) at which a P with a memory is tried, on a coarser mesh than
`evidence.bracket.measured`, which takes minutes.
"""


def scaled(lpv: LPVStateSpace) -> LPVStateSpace:
    """Inputs and outputs measured in `SIZES`."""
    return lpv.scaled(
        {name: SIZES[name] for name in lpv.inputs}, {name: SIZES[name] for name in lpv.outputs}
    )


def gust_loop(family: LinearFamily, degree: int = 3) -> LPVStateSpace:
    """Return the closed loop from a lateral gust v_w (m/s) to r (rad/s) and phi (rad), continuous,
    cubic element-wise fit.
    """
    lateral = family.select(LATERAL.states, ["d_lat", "v_w"])
    return close(lateral.interpolate("polynomial", degree), "gust")


def servo_loop(
    model: LPVStateSpace, gains: Mapping[tuple[str, str], float] = ATTITUDE_HOLD
) -> LPVStateSpace:
    """Return the closed loop from disturbances at d_lat and d_ped to r and phi, each in its size,
    sampled at 50 Hz.
    """
    return scaled(close(model, "inputs", gains))


def servo_loops(
    heli: Helicopter | None, family: LinearFamily, gentle: LPVARXModel, aggressive: LPVARXModel
) -> dict[str, LPVStateSpace]:
    """The servo loop around the exact models (not without `heli`), their interpolation, and the
    models identified on either flight.
    """
    exact = (
        {"exact": scaled(ExactLateral.of(heli, 0.0, TOP).loop("inputs", PERIOD))}
        if heli is not None
        else {}
    )
    return exact | {
        "baseline": servo_loop(sampled_baseline(family)),
        "identified, gentle flight": servo_loop(gentle.to_state_space()),
        "identified, aggressive flight": servo_loop(aggressive.to_state_space()),
    }


def has_lft(loop: LPVStateSpace) -> bool:
    """Whether the LFT tests are applicable: polynomial entries, stable when frozen."""
    return isinstance(loop.basis, Polynomial) and math.isfinite(synthesis.frozen_gain(loop).gain)


def sampled_baseline(family: LinearFamily, degree: int = 3) -> LPVStateSpace:
    """The lateral baseline at 50 Hz with the two lateral inputs."""
    return (
        family.select(LATERAL.states, LATERAL.inputs)
        .interpolate("polynomial", degree)
        .discretize(PERIOD, degree=degree)
    )


def exact_frozen_gain(family: LinearFamily, sampled: bool) -> float:
    """Largest H-infinity norm over the exact models of the family: gust loop, or servo loop at 50
    Hz; inf where one is unstable.
    """

    def closed(model: LinearModel) -> LPVStateSpace:
        one = LPVStateSpace.polynomial(
            [model.A],
            [model.B],
            [model.C],
            [model.D],
            Scheduling("airspeed", "m/s", 0.0, TOP),
            model.dt,
            model.states,
            model.inputs,
            model.outputs,
        )
        return servo_loop(one) if sampled else close(one, "gust")

    lateral = family.select(LATERAL.states, LATERAL.inputs if sampled else ["d_lat", "v_w"])
    loops = [
        closed(lateral[k].discretize(PERIOD) if sampled else lateral[k])
        for k in range(len(lateral))
    ]
    return max(norm(*loop.matrices(0.0), loop.dt)[0] for loop in loops)


Proof = Callable[[], list[Bound]]
"""One question about one loop, to be answered where there is room: a `functools.partial`."""


def bounds(
    name: str,
    channel: str,
    lpv: LPVStateSpace,
    rates: Sequence[float],
    form: Spline,
    search: LowerBoundSearch,
) -> list[Proof]:
    """One gain a rate (m/s^2), and stability where no gain is proven and no growth was found.

    `search` sets how hard the lower bound is looked for; among airspeeds that jump, a search that
    spares nothing is quick.
    """
    return [partial(_bound, name, channel, lpv, rate, form, search) for rate in rates]


def _bound(
    name: str,
    channel: str,
    lpv: LPVStateSpace,
    rate: float,
    spline: Spline,
    search: LowerBoundSearch,
) -> list[Bound]:
    form = CONSTANT if math.isinf(rate) else PLAIN
    thorough = LowerBoundSearch() if math.isinf(rate) else search
    certificate = synthesis.l2_gain(lpv, rate, form=spline, search=thorough)
    found = [Bound(name, channel, rate, form, certificate)]
    if not certificate.verified and math.isfinite(certificate.lower):
        stable = synthesis.stability(lpv, rate, form=spline, search=None)
        found.append(Bound(name, channel, rate, form, stable))
    return found


def answered(proofs: Sequence[Proof]) -> list[Bound]:
    """All answers, here and one after the other."""
    return [bound for proof in proofs for bound in proof()]


def memory_bounds(
    name: str, channel: str, lpv: LPVStateSpace, known: Sequence[float], search: LowerBoundSearch
) -> list[Proof]:
    """Gains by a P with a memory; the lower bound is looked for where it is not `known`."""
    return [
        partial(_memory_bound, name, channel, lpv, rate, None if rate in known else search)
        for rate in MEMORIES
    ]


def _memory_bound(
    name: str, channel: str, lpv: LPVStateSpace, rate: float, search: LowerBoundSearch | None
) -> list[Bound]:
    certificate = synthesis.l2_gain(lpv, rate, form=MEMORIES[rate], search=search)
    return [Bound(name, channel, rate, MEMORY, certificate)]


def lft_bounds(name: str, channel: str, lpv: LPVStateSpace) -> list[Proof]:
    """Gains by the LFT tests, which let the airspeed jump; the lower bound is that of `bounds`."""
    return [partial(_lft_bound, name, channel, lpv, form) for form in LFT_TESTS]


def _lft_bound(name: str, channel: str, lpv: LPVStateSpace, form: str) -> list[Bound]:
    gain = synthesis.lft_gain(lpv.to_lft().reduce(COPIES), LFT_TESTS[form], search=None)
    return [Bound(name, channel, math.inf, form, gain.resting_on((LEFT_OUT,)))]


def allowed_bounds(
    channel: str, loop: UncertainStateSpace, rates: Sequence[float], form: Spline
) -> list[Proof]:
    """Return gains of every model that the flights allow; no lower bound is searched."""
    return [partial(_allowed_bound, channel, loop, rate, form) for rate in rates]


def _allowed_bound(
    channel: str, loop: UncertainStateSpace, rate: float, form: Spline
) -> list[Bound]:
    gain = synthesis.l2_gain(loop, rate, form=form, search=None)
    return [Bound(ALLOWED, channel, rate, PLAIN, gain)]


LOOPS = {
    "gust": "Lateral: gust to yaw rate and roll",
    "longitudinal": "Longitudinal: gusts to pitch rate and pitch",
}
"""Channels whose gain is drawn against acceleration."""


def curves(found: Sequence[Bound]) -> list[GainCurve]:
    """The gain of the baseline in each of `LOOPS` that has bounds."""
    return [
        gain_curve(found, "baseline", c, title)
        for c, title in LOOPS.items()
        if any(b.channel == c for b in found)
    ]


def gain_curve(found: Sequence[Bound], model: str, channel: str, title: str) -> GainCurve:
    """Return the gain curve of the bounds of one loop."""
    own = [
        b for b in found if (b.model, b.channel, b.certificate.kind) == (model, channel, "l2 gain")
    ]
    own.sort(key=lambda b: FORMS.index(b.form))
    return GainCurve.of(((b.form, b.rate, b.certificate) for b in own), title, unit_of(channel))
