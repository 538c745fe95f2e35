"""Tail rotor, geared to the main shaft, in the main-rotor wake."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import pi
from types import SimpleNamespace
from typing import Any

from symheli.components.component import Component, Effect, Flow, Motion
from symheli.components.rotor import Load, disc, linear_load, load
from symheli.errors import InputError


def evaluate(
    par: SimpleNamespace,
    motion: Motion,
    controls: Mapping[str, Any],
    own: Mapping[str, Any],
    flow: Flow,
) -> Effect:
    """Side force Y_tr = -f_t rho (Om_tr R_tr)^2 pi R_tr^2 C_T(d_ped, mu_tr, mu_z_tr), its moments,
    shaft torque and wash `V_itr`.

        v_tr = v_a - l_tr r + h_tr p,  w_tr = w_a + l_tr q - K_lam V_imr
        f_t = 1 - (3/4) S_vf/(pi R_tr^2)

    Source: G15, tail rotor, with the full inflow solution in place of its linearization about a
    trim pitch (option "tail_rotor_linear") and mu_tr = sqrt(u_a^2 + w_tr^2)/(Om_tr R_tr) (printed
    without the root: option "tail_advance_ratio"). `d_ped` is the total blade pitch (rad).
    """
    plane = disc(par.radius, par.chord, par.blades, par.gear_ratio * motion.Om, motion.rho, flow)
    v_tr = flow.name("v_{tr}", motion.v_a - par.arm * motion.r + par.height * motion.p)
    w_tr = flow.name("w_{tr}", motion.w_a + par.arm * motion.q - flow["w_wake"])
    speed2 = motion.u_a**2 + w_tr**2
    mu2 = flow.name(
        r"\mu^2",
        (speed2**2 if "tail_advance_ratio" in par.printed else speed2) / plane.tip_speed**2,
    )
    mu_z = flow.name(r"\mu_z", v_tr / plane.tip_speed)
    blockage = flow.name("f_t", 1 - 0.75 * par.fin_area / (pi * par.radius**2))

    lam0, _, thrust, torque, stall, ring = _thrust_law(par)(
        plane, par, par.ct_max, controls["d_ped"], mu2, mu_z, flow
    )
    side = flow.name("Y_{tr}", -blockage * thrust)
    return Effect(
        force=(0.0, side, 0.0),
        moment=(side * par.height, 0.0, -side * par.arm),
        shaft_torque=par.gear_ratio * torque,
        flow={"V_itr": lam0 * plane.tip_speed, "Y_tr": side, "Q_tr": torque},
        switches={"tail rotor stall": stall, "tail rotor vortex_ring": ring},
    )


def _thrust_law(par: SimpleNamespace) -> Callable[..., Load]:
    if "tail_rotor_linear" not in par.printed:
        return load
    if not hasattr(par, "trim_pitch"):
        raise InputError(
            "the printed option tail_rotor_linear needs the entry trim_pitch (rad) of the tail"
            " rotor in the vehicle file"
        )
    return linear_load


COMPONENT = Component(
    evaluate,
    parameters={
        "radius": "m",
        "chord": "m",
        "blades": "1",
        "lift_slope": "1/rad",
        "profile_drag": "1",
        "ct_max": "1",
        "gear_ratio": "1",
        "arm": "m",
        "height": "m",
        "fin_area": "m^2",
        "inflow_efficiency": "1",
    },
    optional={"trim_pitch": "rad"},
    needs=("w_wake",),
    makes=("V_itr", "Y_tr", "Q_tr"),
    positive=("radius", "chord", "lift_slope", "ct_max", "gear_ratio", "inflow_efficiency"),
    counts={"blades": 2},
    subscript="tr",
    symbols={
        "radius": "R_{tr}",
        "chord": "c_{tr}",
        "blades": "b_{tr}",
        "lift_slope": "a_{tr}",
        "profile_drag": "C_{D0,tr}",
        "ct_max": "C_{T max,tr}",
        "gear_ratio": "n_{tr}",
        "arm": "l_{tr}",
        "height": "h_{tr}",
        "fin_area": "S_{vf}",
        "inflow_efficiency": r"\eta_w",
        "trim_pitch": r"\delta_{ped,trim}",
    },
)
