"""Main-rotor wake over the tail."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from symheli.codegen.symbolic import clip, maximum, minimum, where
from symheli.components.component import AirMotion, Component, Effect, Flow
from symheli.components.entry import Entry


def evaluate(
    par: SimpleNamespace,
    motion: AirMotion,
    controls: Mapping[str, Any],
    own: Mapping[str, Any],
    flow: Flow,
) -> Effect:
    """Downwash at the tail `w_wake` = K_lam V_imr (m/s).

        g_i = (l_tr - R_mr - R_tr)/h_tr, g_f = (l_tr - R_mr + R_tr)/h_tr, chi = u_a/(V_imr - w_a)
        K_lam = 0 where V_imr <= w_a or chi <= g_i, 1.5 where chi >= g_f,
                else 1.5 (chi - g_i)/(g_f - g_i)

    Without smoothing 1.5 (chi - g_i)/(g_f - g_i) V_imr is written w_p, with chi V_imr = u_a (1 +
    w_a/(V_imr - w_a)): a product of chi and V_imr, which vary against each other, would widen
    bounds of it over a set of flights (`synthesis.tubes.enclosure`).

    Source: G15, wake intensity factor. `smoothing` rounds both corners (in units of K_lam).
    """
    g_i = flow.name("g_i", (par.tail_arm - par.rotor_radius - par.tail_radius) / par.tail_height)
    g_f = flow.name("g_f", (par.tail_arm - par.rotor_radius + par.tail_radius) / par.tail_height)
    down = motion.w_a - flow["V_imr"]
    # guarded: where the flow goes up through the disc the wake is above the tail
    through = maximum(-down, 1e-3)
    chi = flow.name(r"\chi", motion.u_a / through)
    share = flow.name(r"\kappa", 1.5 * (chi - g_i) / (g_f - g_i))
    k_lam = flow.name(r"K_\lambda", where(down < 0, clip(share, 0.0, 1.5, par.smoothing), 0.0))
    w_wake = k_lam * flow["V_imr"]
    if par.smoothing == 0.0:
        most = 1.5 * flow["V_imr"]
        back = motion.u_a * (1 + minimum(motion.w_a, flow["V_imr"] - 1e-3) / through)
        partly = flow.name("w_p", 1.5 * (back - g_i * flow["V_imr"]) / (g_f - g_i))
        w_wake = where(down < 0, clip(partly, minimum(most, 0.0), maximum(most, 0.0)), 0.0)
    return Effect(
        flow={"w_wake": w_wake, "K_lam": k_lam},
        switches={
            "wake reaches the tail": chi - g_i,
            "tail fully in the wake": chi - g_f,
            "jump as the flow turns at the disc": -down,
        },
    )


COMPONENT = Component(
    evaluate,
    parameters={
        "rotor_radius": Entry(
            "m",
            "radius of the main rotor, whose wake it is",
            "R_{mr}",
            "rotor radius",
            positive=True,
        ),
        "tail_radius": Entry(
            "m",
            "radius of the tail rotor, over which the wake's edge passes",
            "R_{tr}",
            "length",
            positive=True,
        ),
        "tail_arm": Entry(
            "m", "distance of the tail behind the centre of gravity", "l_{tr}", "distance"
        ),
        "tail_height": Entry(
            "m", "height of the tail above the centre of gravity", "h_{tr}", "length", positive=True
        ),
    },
    needs=("V_imr",),
    makes=(
        "w_wake",
        "K_lam",
    ),
    opposite={"tail_arm": "x", "tail_height": "z"},
)
