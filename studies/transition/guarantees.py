"""What can be proven about the lateral loop: gain against permitted acceleration, for baseline and identified model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

import synthesis
from studies.lateral_loop import STATES, close
from studies.transition.flights import TOP
from symheli import LinearFamily, LinearModel, LPVStateSpace, Scheduling
from synthesis import Certificate, Relaxation, Search

SIZES = {"d_lat": 0.01, "d_ped": 0.02, "r": 0.1, "phi": 0.1}
"""A disturbance of this size (rad) and an output of this size (rad/s, rad) count as 1 on the servo channel; the gust channel is in SI."""

PERIOD = 0.02


@dataclass(frozen=True)
class Bound:
    """One certificate: which model, which channel, permitted acceleration (m/s^2)."""

    model: str
    channel: str
    rate: float
    certificate: Certificate


def scaled(lpv: LPVStateSpace) -> LPVStateSpace:
    """Inputs and outputs measured in `SIZES`."""
    inputs, outputs = np.array([SIZES[i] for i in lpv.inputs]), np.array([SIZES[y] for y in lpv.outputs])
    return replace(lpv, B=lpv.B * inputs, C=lpv.C / outputs[:, None], D=lpv.D * inputs / outputs[:, None], residuals=None, trim=None)


def gust_loop(family: LinearFamily, degree: int = 3) -> LPVStateSpace:
    """Closed loop from a lateral gust v_w (m/s) to r (rad/s) and phi (rad), continuous, cubic element-wise fit."""
    return close(family.select(STATES, ["d_lat", "v_w"]).interpolate("polynomial", degree), "gust")


def servo_loop(model: LPVStateSpace) -> LPVStateSpace:
    """Closed loop from disturbances at d_lat and d_ped to r and phi, each in its size, sampled at 50 Hz."""
    return scaled(close(model, "inputs"))


def sampled_baseline(family: LinearFamily, degree: int = 3) -> LPVStateSpace:
    """The lateral baseline at 50 Hz with the two lateral inputs."""
    return family.select(STATES, ["d_lat", "d_ped"]).interpolate("polynomial", degree).discretize(PERIOD, degree=degree)


def exact_frozen_gain(family: LinearFamily, sampled: bool) -> float:
    """Largest H-infinity norm over the exact models of the family, by python-control: gust loop, or servo loop at 50 Hz."""
    import control

    def norm(model: LinearModel) -> float:
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
        return float(control.system_norm((servo_loop(one) if sampled else close(one, "gust")).at(0.0).to_control(), p="inf"))  # type: ignore[arg-type]

    lateral = family.select(STATES, ["d_lat", "d_ped"] if sampled else ["d_lat", "v_w"])
    return max(norm(lateral[k].discretize(PERIOD) if sampled else lateral[k]) for k in range(len(lateral)))


def bounds(
    name: str, channel: str, lpv: LPVStateSpace, rates: Sequence[float], segments: tuple[int, ...], search: Search
) -> Iterator[Bound]:
    """One certificate a rate (m/s^2), computed when asked for; `search` sets how hard the lower bound is looked for."""
    for rate in rates:
        certificate = synthesis.l2_gain(lpv, rate=rate, relaxation=Relaxation(segments=segments), search=search)
        yield Bound(name, channel, rate, certificate)


def stability_bounds(name: str, channel: str, lpv: LPVStateSpace, rates: Sequence[float], segments: tuple[int, ...]) -> Iterator[Bound]:
    """Stability alone, one certificate a rate (m/s^2)."""
    for rate in rates:
        certificate = synthesis.stability(lpv, rate=rate, relaxation=Relaxation(segments=segments))
        yield Bound(name, channel, rate, certificate)


def rate_text(rate: float) -> str:
    """The rate as a reader would say it."""
    return "frozen" if rate == 0 else "as fast as it likes" if math.isinf(rate) else f"{rate:g} m/s^2"
