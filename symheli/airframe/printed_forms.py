"""Printed forms of equations that are ambiguous or wrong in the source; each is an option
by name.
"""

from __future__ import annotations

from collections.abc import Mapping

PRINTED: Mapping[str, str] = {
    "lateral_flapping": "db1/dmu_v = -da1/dmu: the disc leans into a sideward motion",
    "flapping_sign": (
        "mu^2 sign(mu) with mu >= 0 in da1/dmu_z, so that rearward flight flaps like forward flight"
    ),
    "fuselage_downwash": "w_a + V_imr at the fuselage: the downwash lifts it",
    "rotor_reaction": "Om' = +r' + ...: body and rotor together gain angular momentum",
    "horizontal_tail_lift": "Z_ht with +: the tail destabilises",
    "tail_advance_ratio": "mu_tr without its square root",
    "tail_rotor_linear": (
        "C_T of the tail rotor linear in pitch and side flow, with slopes at the trim pitch of the"
        " vehicle file"
    ),
    "thrust_limit": "T_max = 2.5 m g of the text in place of the table's C_Tmax (main rotor)",
    "ideal_inflow": "eta_w = 1: the printed hover torque and induced velocity belong to it",
    "relaxed_inflow": (
        "Newton's method relaxed by 0.6 in place of the bounded third-order iteration: the same"
        " root, more slowly"
    ),
}
"""{option: what it brings back}; see docs/model.md for the reasons."""
