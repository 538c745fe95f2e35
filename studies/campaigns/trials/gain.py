"""The proven gain of the lateral loop, of equations that scatter."""

from __future__ import annotations

import synthesis
from studies.campaigns.trial import Trial
from studies.campaigns.trials.vehicle import scattered
from studies.loops.lateral import ATTITUDE_HOLD, HOLD, INPUTS, close
from studies.setup.axes import LATERAL
from symheli import sweep

POINTS = 27


def gain(
    *,
    vehicle: str = "xcell60",
    degree: int = 3,
    segments: int = 16,
    rate: float = 1.0,
    low: float = 0.0,
    high: float = 13.0,
    hold: float = HOLD,
    mass: float = 1.0,
    inertia: float = 1.0,
) -> dict[str, float]:
    """Lateral gust to yaw rate and roll, proven for accelerations up to `rate` (m/s^2) with a
    Lyapunov spline of `segments`, beside the largest gain of the frozen loop; models interpolated
    by polynomials of `degree`. `hold`: the attitude hold; `mass`, `inertia`: factors.
    """
    heli = scattered(vehicle, mass, inertia)
    speeds = [low + (high - low) * k / (POINTS - 1) for k in range(POINTS)]
    family = sweep(heli, speeds, inputs=INPUTS).select(LATERAL.states, INPUTS)
    gains = {name: hold for name in ATTITUDE_HOLD}
    loop = close(family.interpolate("polynomial", degree), "gust", gains)
    form = synthesis.forms.Spline(segments=segments)
    found = synthesis.l2_gain(loop, rate=rate, form=form, search=None)
    return {"proven gain": found.gamma, "frozen gain": synthesis.frozen_gain(loop).gain}


TRIAL = Trial(gain, {"proven gain": "1", "frozen gain": "1"})
