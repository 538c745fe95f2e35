"""Main rotor with stabiliser bar: thrust, torque, inflow, tip-path-plane flapping."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from symheli.codegen.symbolic import absolute, sqrt
from symheli.components.component import AirMotion, Component, Effect, Flow
from symheli.components.entry import Entry
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
    motion: AirMotion,
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
        "radius": Entry("m", "radius of the disc", "R_{mr}", "rotor radius", positive=True),
        "chord": Entry("m", "chord of a blade, mean", "c_{mr}", "chord", positive=True),
        "blades": Entry("1", "number of blades", "b_{mr}", "blades", least=2),
        "lift_slope": Entry(
            "1/rad",
            "lift-curve slope of the blade section, dC_L/dalpha",
            "a_{mr}",
            "lift slope",
            positive=True,
        ),
        "profile_drag": Entry(
            "1",
            "profile drag coefficient C_D0 of the blade section",
            "C_{D0,mr}",
            "drag coefficient",
        ),
        "ct_max": Entry(
            "1",
            "largest thrust coefficient T/(rho (Om R)^2 pi R^2), at blade stall",
            "C_{T max,mr}",
            "thrust coefficient",
            positive=True,
        ),
        "hub_height": Entry(
            "m", "height of the hub above the centre of gravity", "h_{mr}", "distance"
        ),
        "hub_stiffness": Entry(
            "N m/rad",
            "torsional stiffness of the hub, moment by flapping angle; 0: teetering",
            r"K_\beta",
            "hub stiffness",
        ),
        "bar_lock_number": Entry(
            "1",
            "Lock number of the stabiliser bar: flapping takes 16/(gamma Om) seconds",
            r"\gamma_{fb}",
            "Lock number",
            positive=True,
        ),
        "lateral_gain": Entry(
            "rad/rad",
            "steady lateral flapping by lateral cyclic at nominal speed",
            "B_{nom}",
            "flapping gain",
        ),
        "longitudinal_gain": Entry(
            "rad/rad",
            "steady longitudinal flapping by longitudinal cyclic at nominal speed",
            "A_{nom}",
            "flapping gain",
        ),
        "flapping_fraction": Entry(
            "1",
            "share of the rotor's own flapping with flight speed that the hub leaves, K_mu",
            r"K_\mu",
            "fraction",
        ),
        "nominal_speed": Entry(
            "rad/s",
            "rotor speed at which the flapping gains hold",
            r"\Omega_{nom}",
            "rotor speed",
            positive=True,
        ),
        "inflow_efficiency": Entry(
            "1",
            "eta_w of momentum theory: 1 ideal, less with losses",
            r"\eta_w",
            "efficiency",
            positive=True,
        ),
    },
    states=(Signal("a1"), Signal("b1")),
    makes=(
        "V_imr",
        "lam0",
        "C_T",
        "T_mr",
        "Q_mr",
    ),
    subscript="mr",
    opposite={"hub_height": "z"},
)
