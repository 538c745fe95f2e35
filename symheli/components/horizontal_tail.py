"""Horizontal tail in the main-rotor wake."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from symheli.codegen.symbolic import absolute, clip
from symheli.components.component import AirMotion, Component, Effect, Flow
from symheli.components.entry import Entry


def evaluate(
    par: SimpleNamespace,
    motion: AirMotion,
    controls: Mapping[str, Any],
    own: Mapping[str, Any],
    flow: Flow,
) -> Effect:
    """Lift Z_ht = -0.5 rho S_ht (C_La |u_a| w_ht + |w_ht| w_ht), limited to 0.5 rho S_ht (u_a^2 +
    w_ht^2); M_ht = Z_ht l_ht.

        w_ht = w_a + l_ht q - K_lam V_imr

    Source: G15, horizontal tail; the sign is the stabilising one, the printed + contradicts the
    text and is the option "horizontal_tail_lift".
    """
    w = flow.name("w_{ht}", motion.w_a + par.arm * motion.q - flow["w_wake"])
    scale = 0.5 * motion.rho * par.area
    free = flow.name("Z_{free}", -scale * (par.lift_slope * absolute(motion.u_a) + absolute(w)) * w)
    limit = flow.name("Z_{max}", scale * (motion.u_a**2 + w**2))
    free = -free if "horizontal_tail_lift" in par.printed else free
    lift = flow.name("Z_{ht}", clip(free, -limit, limit, par.smoothing))
    return Effect(
        force=(0.0, 0.0, lift),
        moment=(0.0, lift * par.arm, 0.0),
        switches={"horizontal tail stalls": limit - absolute(free), "horizontal tail flow": w},
    )


COMPONENT = Component(
    evaluate,
    parameters={
        "area": Entry("m^2", "area of the tail", "S_{ht}", "area"),
        "lift_slope": Entry("1/rad", "lift-curve slope", r"C_{L\alpha,ht}", "lift slope"),
        "arm": Entry("m", "distance behind the centre of gravity", "l_{ht}", "distance"),
    },
    needs=("w_wake",),
    subscript="ht",
    opposite={"arm": "x"},
)
