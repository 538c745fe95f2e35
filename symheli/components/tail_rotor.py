"""Tail rotor, geared to the main shaft, in the main-rotor wake."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import pi
from types import SimpleNamespace
from typing import Any

from symheli.components.component import AirMotion, Component, Effect, Flow
from symheli.components.entry import Entry
from symheli.components.rotor import Load, disc, linear_load, load
from symheli.errors import InputError


def evaluate(
    par: SimpleNamespace,
    motion: AirMotion,
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
        "radius": Entry("m", "radius of the disc", "R_{tr}", "length", positive=True),
        "chord": Entry("m", "chord of a blade, mean", "c_{tr}", "chord", positive=True),
        "blades": Entry("1", "number of blades", "b_{tr}", "blades", least=2),
        "lift_slope": Entry(
            "1/rad",
            "lift-curve slope of the blade section, dC_L/dalpha",
            "a_{tr}",
            "lift slope",
            positive=True,
        ),
        "profile_drag": Entry(
            "1",
            "profile drag coefficient C_D0 of the blade section",
            "C_{D0,tr}",
            "drag coefficient",
        ),
        "ct_max": Entry(
            "1",
            "largest thrust coefficient, at blade stall",
            "C_{T max,tr}",
            "thrust coefficient",
            positive=True,
        ),
        "gear_ratio": Entry(
            "1", "tail-rotor speed by main-rotor speed", "n_{tr}", "gear ratio", positive=True
        ),
        "arm": Entry("m", "distance of the hub behind the centre of gravity", "l_{tr}", "distance"),
        "height": Entry("m", "height of the hub above the centre of gravity", "h_{tr}", "distance"),
        "fin_area": Entry("m^2", "area of the fin that blocks the disc", "S_{vf}", "area"),
        "inflow_efficiency": Entry(
            "1",
            "eta_w of momentum theory: 1 ideal, less with losses",
            r"\eta_w",
            "efficiency",
            positive=True,
        ),
        "trim_pitch": Entry(
            "rad",
            "blade pitch in hover; used by the printed option tail_rotor_linear only",
            r"\delta_{ped,trim}",
            "angle",
            optional=True,
        ),
    },
    needs=("w_wake",),
    makes=(
        "V_itr",
        "Y_tr",
        "Q_tr",
    ),
    subscript="tr",
    opposite={"arm": "x", "height": "z"},
)
