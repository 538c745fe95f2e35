"""Main rotor with stabiliser bar: thrust, torque, inflow, tip-path-plane flapping."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from symheli.codegen.symbolic import absolute, sqrt
from symheli.components.component import Component, Effect, Flow, Motion
from symheli.components.rotor import disc, load
from symheli.values.signal import Signal


def flapping_slopes(
    mu2: Any,
    mu: Any,
    mu_x: Any,
    lam0: Any,
    d_col: Any,
    *,
    k_mu: Any,
    lift_slope: Any,
    solidity: Any,
) -> tuple[Any, Any]:
    """(da1/dmu, da1/dmu_z), dimensionless.

        da1/dmu   = 2 K_mu (4 d_col/3 - lam0)
        da1/dmu_z = K_mu 16 mu^2 sign(mu) / [ (1 - mu^2/2)(8 |mu| + a sigma) ]

    mu^2 sign(mu) is taken as mu mu_x with mu_x = u_a/(Om R): it has the sign of the forward speed
    and is smooth, and 0, in hover. d_col in rad. Source: G15, flapping dynamics.
    """
    da1_dmu = 2 * k_mu * (4 * d_col / 3 - lam0)
    da1_dmu_z = k_mu * 16 * mu * mu_x / ((1 - mu2 / 2) * (8 * absolute(mu) + lift_slope * solidity))
    return da1_dmu, da1_dmu_z


def evaluate(
    par: SimpleNamespace,
    motion: Motion,
    controls: Mapping[str, Any],
    own: Mapping[str, Any],
    flow: Flow,
) -> Effect:
    """Forces and moments of the tilted thrust, flapping dynamics, shaft torque, induced velocity
    `V_imr` (m/s).

    Source: G15, main rotor thrust, torque, flapping, forces and moments. The sign of db1/dmu_v is +
    (a hovering rotor looks the same after a turn about its shaft); the printed - is the option
    "lateral_flapping". The options "flapping_sign" (mu^2 sign(mu) is mu^2) and "thrust_limit" (2.5
    m g) are printed forms too.
    """
    plane = disc(par.radius, par.chord, par.blades, motion.Om, motion.rho, flow)
    mu_x = flow.name(r"\mu_x", motion.u_a / plane.tip_speed)
    mu_y = flow.name(r"\mu_y", motion.v_a / plane.tip_speed)
    mu_z = flow.name(r"\mu_z", motion.w_a / plane.tip_speed)
    mu2 = flow.name(r"\mu^2", mu_x**2 + mu_y**2)
    mu = flow.name(r"\mu", sqrt(mu2 + 1e-20))
    d_col = controls["d_col"]

    ct_max = 2.5 * par.weight / plane.force_scale if "thrust_limit" in par.printed else par.ct_max
    lam0, ct, thrust, torque, stall, ring = load(plane, par, ct_max, d_col, mu2, mu_z, flow)

    a1, b1 = own["a1"], own["b1"]
    tau = flow.name(r"\tau_e", 16 / (par.bar_lock_number * motion.Om))
    speed_ratio2 = (motion.Om / par.nominal_speed) ** 2
    da1_dmu, da1_dmu_z = flapping_slopes(
        mu2,
        mu,
        mu if "flapping_sign" in par.printed else mu_x,
        lam0,
        d_col,
        k_mu=par.flapping_fraction,
        lift_slope=par.lift_slope,
        solidity=plane.solidity,
    )
    da1_dmu, da1_dmu_z = flow.name(r"a_{1\mu}", da1_dmu), flow.name(r"a_{1\mu_z}", da1_dmu_z)
    db1_dmu_v = flow.name(r"b_{1\mu}", -da1_dmu if "lateral_flapping" in par.printed else da1_dmu)
    rates = {
        "a1": (
            -motion.q
            + (
                -a1
                + da1_dmu * mu_x
                + da1_dmu_z * mu_z
                + par.longitudinal_gain * speed_ratio2 * controls["d_lon"]
            )
            / tau
        ),
        "b1": (
            -motion.p
            + (-b1 - db1_dmu_v * mu_y + par.lateral_gain * speed_ratio2 * controls["d_lat"]) / tau
        ),
    }
    stiffness = flow.name("K", par.hub_stiffness + thrust * par.hub_height)
    return Effect(
        force=(-thrust * a1, thrust * b1, -thrust),
        moment=(stiffness * b1, stiffness * a1, 0.0),
        rates=rates,
        shaft_torque=torque,
        flow={
            "V_imr": lam0 * plane.tip_speed,
            "lam0": lam0,
            "C_T": ct,
            "T_mr": thrust,
            "Q_mr": torque,
        },
        switches={"main rotor stall": stall, "vortex_ring": ring},
    )


COMPONENT = Component(
    evaluate,
    parameters={
        "radius": "m",
        "chord": "m",
        "blades": "1",
        "lift_slope": "1/rad",
        "profile_drag": "1",
        "ct_max": "1",
        "hub_height": "m",
        "hub_stiffness": "N m/rad",
        "bar_lock_number": "1",
        "lateral_gain": "rad/rad",
        "longitudinal_gain": "rad/rad",
        "flapping_fraction": "1",
        "nominal_speed": "rad/s",
        "inflow_efficiency": "1",
    },
    states=(Signal("a1"), Signal("b1")),
    makes=("V_imr", "lam0", "C_T", "T_mr", "Q_mr"),
    positive=(
        "radius",
        "chord",
        "lift_slope",
        "ct_max",
        "bar_lock_number",
        "nominal_speed",
        "inflow_efficiency",
    ),
    counts={"blades": 2},
    subscript="mr",
    symbols={
        "radius": "R_{mr}",
        "chord": "c_{mr}",
        "blades": "b_{mr}",
        "lift_slope": "a_{mr}",
        "profile_drag": "C_{D0,mr}",
        "ct_max": "C_{T max,mr}",
        "hub_height": "h_{mr}",
        "hub_stiffness": r"K_\beta",
        "bar_lock_number": r"\gamma_{fb}",
        "lateral_gain": "B_{nom}",
        "longitudinal_gain": "A_{nom}",
        "flapping_fraction": r"K_\mu",
        "nominal_speed": r"\Omega_{nom}",
        "inflow_efficiency": r"\eta_w",
    },
)
