"""Engine, governor and rotor speed (G15, engine and rotor speed dynamics)."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

from symheli.codegen.symbolic import clip, maximum, minimum, where
from symheli.components import unnamed


class Drive(NamedTuple):
    """Engine torque reaction on the body and rotor-speed dynamics.

    The body yaws by (Izz + `added_inertia`) r' = ... - `torque` (N m). `rates` gives Om' without
    the -r' of the body (added by the helicopter where `speed_follows_yaw` is +-1) and om_i'.
    """

    torque: Any
    added_inertia: float
    rates: dict[str, Any]
    speed_follows_yaw: float = 0.0


def pi_governor(
    par: SimpleNamespace,
    shaft_torque: Any,
    Om: Any,
    om_i: Any,
    name: Callable[[str, Any], Any] = unnamed,
) -> Drive:
    """Throttle d_t = K_p (Om_c - Om) + K_i om_i in [0, 1], Q_e = P_max d_t/Om, Om' = -r' + (Q_e -
    shaft torque)/I_rot.

    `shaft_torque` = Q_mr + n_tr Q_tr (N m). The integrator om_i (rad) stops while the throttle is
    on a stop and pushed further. Conservation of Izz r' + I_rot (Om' + r') requires -r'; the
    printed + is the option "rotor_reaction".
    """
    error = name("e", par.nominal_speed - Om)
    wanted = name(r"\delta_w", par.governor_kp * error + par.governor_ki * om_i)
    throttle = name(r"\delta_t", clip(wanted, 0.0, 1.0))
    torque = name("Q_e", par.max_power * throttle / Om)
    # stops while pushed further; decided by `wanted` alone, so that bounds over a set decide it too
    integral = where(wanted > 1, minimum(error, 0.0), where(wanted < 0, maximum(error, 0.0), error))
    sign = 1.0 if "rotor_reaction" in par.printed else -1.0
    return Drive(
        torque,
        0.0,
        {"Om": (torque - shaft_torque) / par.inertia, "om_i": integral},
        sign,
    )


def ideal_governor(par: SimpleNamespace, shaft_torque: Any) -> Drive:
    """Om held exactly: Q_e = Q_mr + n_tr Q_tr + I_rot r', so the rotor's inertia joins the body's
    in yaw.
    """
    sign = -1.0 if "rotor_reaction" in par.printed else 1.0
    return Drive(shaft_torque, sign * par.inertia, {})
