"""Fuselage drag in the main-rotor downwash."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from symheli.codegen.symbolic import sqrt
from symheli.components.component import AirMotion, Component, Effect, Flow
from symheli.components.entry import Entry


def evaluate(
    par: SimpleNamespace,
    motion: AirMotion,
    controls: Mapping[str, Any],
    own: Mapping[str, Any],
    flow: Flow,
) -> Effect:
    """X_fus = -0.5 rho S_x u_a V_inf and likewise Y, Z with w_a - V_imr; no moments (centre of
    pressure at the c.g.).

    V_inf = sqrt(u_a^2 + v_a^2 + (w_a - V_imr)^2). Source: G15, fuselage forces. The downwash pushes
    the body down; the printed + V_imr is the option "fuselage_downwash".
    """
    downwash = flow["V_imr"] if "fuselage_downwash" in par.printed else -flow["V_imr"]
    w = flow.name("w_{fus}", motion.w_a + downwash)
    speed = flow.name(r"V_\infty", sqrt(motion.u_a**2 + motion.v_a**2 + w**2 + 1e-12))
    scale = -0.5 * motion.rho * speed
    return Effect(
        force=(
            scale * par.area_x * motion.u_a,
            scale * par.area_y * motion.v_a,
            scale * par.area_z * w,
        )
    )


COMPONENT = Component(
    evaluate,
    parameters={
        "area_x": Entry(
            "m^2", "drag area (drag by dynamic pressure) in flow from ahead", "S_x", "area"
        ),
        "area_y": Entry("m^2", "drag area in flow from the side", "S_y", "area"),
        "area_z": Entry(
            "m^2", "drag area in flow from above, the main rotor's downwash", "S_z", "area"
        ),
    },
    needs=("V_imr",),
    subscript="fus",
)
