"""Common equations of main and tail rotor: disc geometry and profile power."""

from __future__ import annotations

from math import pi
from types import SimpleNamespace
from typing import Any, NamedTuple

from symheli.codegen.symbolic import absolute, clip, sqrt
from symheli.components.component import Flow
from symheli.physics import inflow


class Disc(NamedTuple):
    """A rotor disc: radius (m), tip speed Om R (m/s), solidity sigma = blades c/(pi R)
    (dimensionless) and the force rho (Om R)^2 pi R^2 (N), which is the thrust at C_T = 1.
    """

    radius: Any
    tip_speed: Any
    solidity: Any
    force_scale: Any


def disc(radius: Any, chord: Any, blades: Any, Om: Any, rho: Any, flow: Flow) -> Disc:
    """Return the disc geometry from radius and chord (m), number of blades, and speed Om (rad/s) in
    air of density rho (kg/m^3).
    """
    solidity = flow.name(r"\sigma", blades * chord / (pi * radius))
    tip_speed = flow.name("V_{tip}", Om * radius)
    return Disc(radius, tip_speed, solidity, rho * tip_speed**2 * pi * radius**2)


def profile_torque_coefficient(mu2: Any, profile_drag: Any, solidity: Any) -> Any:
    """(C_D0 sigma/8)(1 + 7/3 mu^2), dimensionless. Source: G15, main rotor torque."""
    return profile_drag * solidity / 8 * (1 + 7 / 3 * mu2)


class Load(NamedTuple):
    """Load of a rotor along and about its shaft: inflow ratio lam0 and C_T (dimensionless),
    thrust (N), torque (N m), and the switching functions of blade stall (thrust limit) and vortex
    ring.
    """

    lam0: Any
    ct: Any
    thrust: Any
    torque: Any
    stall: Any
    vortex_ring: Any


def load(
    disc: Disc, par: SimpleNamespace, ct_max: Any, pitch: Any, mu2: Any, mu_z: Any, flow: Flow
) -> Load:
    """Thrust (limited to +-`ct_max`) and torque of a rotor of collective `pitch` (rad) in flow of
    advance ratio^2 `mu2` and axial ratio `mu_z`.

        C_Q = C_T (lam0 - mu_z) + (C_D0 sigma/8)(1 + 7/3 mu^2),  Q = C_Q rho (Om R)^2 pi R^3

    Source: G15, main rotor thrust and torque; the tail rotor is treated alike.
    """
    c0, c1 = inflow.thrust_line(pitch, mu2, mu_z, par.lift_slope, disc.solidity)
    lam0 = flow.inflow(c0, c1, ct_max, mu2, mu_z, efficiency(par))
    ct = flow.name("C_T", inflow.thrust_coefficient(lam0, c0, c1, ct_max))
    return _load(disc, par, lam0, ct, ct_max - absolute(c0 - c1 * lam0), mu2, mu_z, flow)


def linear_load(
    disc: Disc, par: SimpleNamespace, ct_max: Any, pitch: Any, mu2: Any, mu_z: Any, flow: Flow
) -> Load:
    """As `load`, with thrust linear in pitch and axial flow; the slopes are those at the pitch
    `par.trim_pitch` without axial flow.

        C_T = C_pitch pitch + C_mu_z mu_z, limited
        lam0 = mu_z - 2 [2 C_T/(a sigma) - pitch (1/3 + mu^2/2)]

    The slopes follow from momentum and thrust line at that point by implicit differentiation.
    Source: G15, tail rotor; the printed option "tail_rotor_linear".
    """
    half = par.lift_slope * disc.solidity / 2
    c0, c1 = inflow.thrust_line(par.trim_pitch, mu2, 0.0, par.lift_slope, disc.solidity)
    trim = flow.inflow(c0, c1, ct_max, mu2, 0.0, efficiency(par))
    speed = flow.name("s", sqrt(mu2 + trim**2 + 1e-20))
    rise = flow.name("D", 2 * efficiency(par) * (speed + trim**2 / speed))
    swept = 1 / 3 + 0.5 * mu2
    by_pitch = flow.name(r"C_{\theta}", half * swept / (1 + half / (2 * rise)))
    by_flow = flow.name(
        r"C_{\mu_z}",
        half / 2 * (1 - 2 * efficiency(par) * trim**2 / (speed * rise)) / (1 + half / (2 * rise)),
    )
    free = by_pitch * pitch + by_flow * mu_z
    ct = flow.name("C_T", clip(free, -ct_max, ct_max))
    lam0 = flow.name(r"\lambda", mu_z - 2 * (ct / half - pitch * swept))
    return _load(disc, par, lam0, ct, ct_max - absolute(free), mu2, mu_z, flow)


def efficiency(par: SimpleNamespace) -> Any:
    """eta_w of momentum theory; 1 with the printed option "ideal_inflow"."""
    return 1.0 if "ideal_inflow" in par.printed else par.inflow_efficiency


def _load(
    disc: Disc,
    par: SimpleNamespace,
    lam0: Any,
    ct: Any,
    stall: Any,
    mu2: Any,
    mu_z: Any,
    flow: Flow,
) -> Load:
    cq = flow.name(
        "C_Q", ct * (lam0 - mu_z) + profile_torque_coefficient(mu2, par.profile_drag, disc.solidity)
    )
    hover = sqrt(absolute(ct) / (2 * efficiency(par)) + 1e-20)
    return Load(
        lam0,
        ct,
        flow.name("T", ct * disc.force_scale),
        flow.name("Q", cq * disc.force_scale * disc.radius),
        stall,
        inflow.vortex_ring(hover, mu2, mu_z),
    )
