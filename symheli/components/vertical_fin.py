"""Vertical fin in the flow of main and tail rotor."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from symheli.codegen.symbolic import absolute, clip, sqrt
from symheli.components.component import AirMotion, Component, Effect, Flow
from symheli.components.entry import Entry


def evaluate(
    par: SimpleNamespace,
    motion: AirMotion,
    controls: Mapping[str, Any],
    own: Mapping[str, Any],
    flow: Flow,
) -> Effect:
    """Side force Y_vf = -0.5 rho S_vf (C_La V_inf_tr + |v_vf|) v_vf, limited to 0.5 rho S_vf
    (V_inf_tr^2 + v_vf^2).

        v_vf = v_a - eps_vf V_itr - l_tr r,  w_tr = w_a + l_tr q - K_lam V_imr
        V_inf_tr = sqrt(u_a^2 + w_tr^2)
        N_vf = -Y_vf l_tr,  L_vf = Y_vf h_tr

    Source: G15, vertical fin.
    """
    w_tr = flow.name("w_{tr}", motion.w_a + par.arm * motion.q - flow["w_wake"])
    speed2 = flow.name(r"V_{\infty,tr}^2", motion.u_a**2 + w_tr**2)
    speed = flow.name(r"V_{\infty,tr}", sqrt(speed2 + 1e-12))
    v = flow.name("v_{vf}", motion.v_a - par.tail_rotor_wash * flow["V_itr"] - par.arm * motion.r)
    scale = 0.5 * motion.rho * par.area
    free = flow.name("Y_{free}", -scale * (par.lift_slope * speed + absolute(v)) * v)
    limit = flow.name("Y_{max}", scale * (speed2 + v**2))
    side = flow.name("Y_{vf}", clip(free, -limit, limit, par.smoothing))
    return Effect(
        force=(0.0, side, 0.0),
        moment=(side * par.height, 0.0, -side * par.arm),
        switches={"fin stalls": limit - absolute(free), "fin side flow": v},
    )


COMPONENT = Component(
    evaluate,
    parameters={
        "area": Entry("m^2", "area of the fin", "S_{vf}", "area"),
        "lift_slope": Entry("1/rad", "lift-curve slope", r"C_{L\alpha,vf}", "lift slope"),
        "tail_rotor_wash": Entry(
            "1",
            "share of the tail rotor's induced velocity that the fin feels",
            r"\epsilon_{vf}",
            "fraction",
        ),
        "arm": Entry("m", "distance behind the centre of gravity", "l_{tr}", "distance"),
        "height": Entry("m", "height above the centre of gravity", "h_{tr}", "distance"),
    },
    needs=(
        "w_wake",
        "V_itr",
    ),
    subscript="vf",
    opposite={"arm": "x", "height": "z"},
)
