"""What was printed about the X-Cell, beside what its equations give.

Printed: V. Gavrilets, "Dynamic Model for a Miniature Aerobatic Helicopter", Handbook of Unmanned
Aerial Vehicles, Springer 2015, text, Table 15.1 and figures 15.8, 15.9. A number the printed
equations and parameters determine must come out; the others are shown with their miss, and nothing
is fitted to meet them.
"""

from __future__ import annotations

import math
import warnings
from typing import NamedTuple

import numpy as np
from scipy.optimize import root

import symheli
from evidence.tables import markdown
from symheli import Helicopter
from symheli.errors import SymheliError, ValidityWarning
from symheli.values.kinematics import GRAVITY

SPEEDS = (0.0, 3.0, 5.0, 10.0, 15.0, 20.0, 25.0)
Y_V = (-0.038, -0.047, -0.0485, -0.060, -0.072, -0.0805, -0.086)
Y_DPED = (-5.15, -4.87, -4.80, -4.80, -5.25, -5.80, -6.35)

HEAD = (
    *("quantity", "unit", "printed", "reading error", "computed", "miss"),
    *("determined by the equations", "met"),
)


class PublishedNumber(NamedTuple):
    """`printed` within `reading_error` (both in `unit`) beside `computed`; `determined` by the
    printed equations and parameters or not.
    """

    quantity: str
    printed: float
    computed: float
    unit: str
    reading_error: float
    determined: bool

    @property
    def miss(self) -> float:
        """computed - printed, in `unit`."""
        return self.computed - self.printed

    @property
    def met(self) -> bool:
        """Whether the miss is inside the reading error."""
        return abs(self.miss) <= self.reading_error


def published_numbers() -> tuple[PublishedNumber, ...]:
    """Every number, computed now."""
    heli = Helicopter.load("xcell60", governor="ideal")
    return (*hover(heli), *settling(heli), *governor(heli), *trims(heli), *tail_derivatives(heli))


def hover(heli: Helicopter) -> tuple[PublishedNumber, ...]:
    """Momentum theory in hover, T = m g."""
    body, rotor = heli.vehicle.values("body"), heli.vehicle.values("main_rotor")
    tip = rotor["nominal_speed"] * rotor["radius"]
    area = math.pi * rotor["radius"] ** 2
    ct = body["mass"] * GRAVITY / (heli.density * tip**2 * area)
    ideal, lossy = math.sqrt(ct / 2), math.sqrt(ct / (2 * rotor["inflow_efficiency"]))
    solidity = rotor["blades"] * rotor["chord"] / (math.pi * rotor["radius"])

    def torque(lam: float) -> float:
        return (
            (ct * lam + rotor["profile_drag"] * solidity / 8)
            * heli.density
            * tip**2
            * area
            * rotor["radius"]
        )

    return (
        PublishedNumber("tip speed", 125.7, tip, "m/s", 0.05, False),
        PublishedNumber(
            "largest thrust, of the weight", 2.5, rotor["ct_max"] / ct, "1", 0.05, False
        ),
        PublishedNumber(
            "induced velocity in hover, ideal inflow", 4.2, ideal * tip, "m/s", 0.05, True
        ),
        PublishedNumber(
            "induced velocity in hover, eta_w = 0.9 (fuselage section)",
            4.5,
            lossy * tip,
            "m/s",
            0.15,
            True,
        ),
        PublishedNumber("inflow ratio in hover, ideal inflow", 0.033, ideal, "1", 0.001, True),
        PublishedNumber(
            "rotor torque in hover, ideal inflow", 6.3, torque(ideal), "N m", 0.05, True
        ),
        PublishedNumber(
            "rotor torque in hover, eta_w = 0.9", 6.3, torque(lossy), "N m", 0.05, False
        ),
    )


def settling(heli: Helicopter) -> tuple[PublishedNumber, ...]:
    """Lock number, and the time the flapping takes to settle, 24/(gamma Om): rotor alone,
    stabiliser bar.
    """
    rotor = heli.vehicle.values("main_rotor")
    inertia = heli.vehicle.values("drivetrain")["inertia"] / 2.5  # I_rot is about 2.5 I_beta
    lock = heli.density * rotor["lift_slope"] * rotor["chord"] * rotor["radius"] ** 4 / inertia
    speed = rotor["nominal_speed"]
    return (
        PublishedNumber("Lock number of the main rotor", 3.7, lock, "1", 0.05, True),
        PublishedNumber(
            "settling of the rotor's flapping", 0.039, 24 / (lock * speed), "s", 0.0005, True
        ),
        PublishedNumber(
            "settling of the stabiliser bar",
            0.144,
            24 / (rotor["bar_lock_number"] * speed),
            "s",
            0.0005,
            False,
        ),
        PublishedNumber(
            "time constant of the flapping, tau_e",
            0.1,
            16 / (rotor["bar_lock_number"] * speed),
            "s",
            0.005,
            False,
        ),
    )


def governor(heli: Helicopter) -> tuple[PublishedNumber, ...]:
    """Rotor speed in hover with the body held: om_i'' = a11 om_i' - a12 om_i; Q0 with ideal inflow,
    as the text has it.
    """
    drive = heli.vehicle.values("drivetrain")
    momentum = drive["nominal_speed"] * drive["inertia"]
    frequency = math.sqrt(drive["max_power"] * drive["governor_ki"] / momentum)
    torque = next(
        row.computed for row in hover(heli) if row.quantity == "rotor torque in hover, ideal inflow"
    )
    damping = (3 * torque + drive["max_power"] * drive["governor_kp"]) / momentum / (2 * frequency)
    return (
        PublishedNumber(
            "natural frequency of the governor in hover", 1.3, frequency, "rad/s", 0.05, False
        ),
        PublishedNumber("damping ratio of the governor in hover", 0.63, damping, "1", 0.005, False),
    )


def trims(heli: Helicopter) -> tuple[PublishedNumber, ...]:
    """The attitude of fast forward flight, the tail's lift as decided and as printed (upside down);
    the roll rate at full cyclic.
    """
    printed = Helicopter.load("xcell60", governor="ideal", printed=["horizontal_tail_lift"])
    theta, theta_printed = (math.degrees(symheli.trim(h, 14.5).x["theta"]) for h in (heli, printed))
    upright, inverted = (
        np.mean([abs(_roll_rate(heli, side, way)) for side in (1, -1)]) for way in (1, -1)
    )
    return (
        PublishedNumber("pitch in forward flight at 14.5 m/s", -10.0, theta, "deg", 1.0, False),
        PublishedNumber(
            "pitch at 14.5 m/s, horizontal tail as printed", -10.0, theta_printed, "deg", 1.0, False
        ),
        PublishedNumber(
            "loss of steady roll rate when inverted",
            15.0,
            float(100 * (1 - inverted / upright)),
            "%",
            5.0,
            False,
        ),
    )


def _roll_rate(heli: Helicopter, side: int, way: int) -> float:
    """Steady roll rate (rad/s) about the c.g. at rest with full lateral cyclic to one `side` (+-1),
    thrust equal to the weight (`way` 1) or to its opposite (-1), the nose held by the pedal.
    """
    weight = heli.vehicle.values("body")["mass"] * GRAVITY
    p, r, a1, b1 = (heli.states.index(name) for name in ("p", "r", "a1", "b1"))  # type: ignore[arg-type]
    at = heli.diagnostics.name_out().index("T_mr")
    cyclic = side * heli.travel[heli.inputs.index("d_lat")]  # type: ignore[arg-type]

    def balance(z: np.ndarray) -> list[float]:
        x, u = np.zeros(len(heli.states)), np.array([0.0, cyclic, z[3], z[4]])
        x[[p, a1, b1]] = z[:3]
        xdot = heli.numeric("rhs")(x, u, 0.0)[0]
        return [
            xdot[p],
            xdot[a1],
            xdot[b1],
            heli.numeric("diagnostics")(x, u, 0.0)[at][0] / weight - way,
            xdot[r],
        ]

    found = root(balance, [3.0 * side, 0.0, 0.0, 0.1 * way, 0.25], tol=1e-10)
    if not found.success:
        raise SymheliError(
            f"no steady roll to the {'right' if side > 0 else 'left'}: {found.message}"
        )
    return float(found.x[0])


def tail_derivatives(heli: Helicopter) -> tuple[PublishedNumber, ...]:
    """Y_v and Y_dped of the tail rotor at trim, read off figures 15.8 and 15.9."""
    rows = []
    point = None
    for speed, y_v, y_dped in zip(SPEEDS, Y_V, Y_DPED, strict=True):
        with warnings.catch_warnings():  # the figures go on to 25 m/s
            warnings.simplefilter("ignore", ValidityWarning)
            point = symheli.trim(heli, speed, start=point)
        by_v, by_pedal = (_side_slope(heli, point, what) for what in ("v", "d_ped"))
        rows.append(
            PublishedNumber(
                f"Y_v of the tail rotor at {speed:g} m/s", y_v, by_v, "1/s", 0.002, speed == 0
            )
        )
        rows.append(
            PublishedNumber(
                f"Y_dped of the tail rotor at {speed:g} m/s",
                y_dped,
                by_pedal,
                "m/s^2/rad",
                0.05,
                speed == 0,
            )
        )
    return tuple(sorted(rows, key=lambda row: row.quantity.split(" at ")[0], reverse=True))


def _side_slope(
    heli: Helicopter, point: symheli.steady.TrimPoint, what: str, step: float = 1e-4
) -> float:
    """Change of the tail rotor's side acceleration Y_tr/m with v (m/s) or d_ped (rad), by central
    differences.
    """

    def side(change: float) -> float:
        x, u = point.x.array.copy(), point.u.array.copy()
        if what == "v":
            x[heli.states.index("v")] += change  # type: ignore[arg-type]
        else:
            u[heli.inputs.index(what)] += change  # type: ignore[arg-type]
        values = heli.numeric("diagnostics")(x, u, np.zeros(3))
        return (
            float(values[heli.diagnostics.name_out().index("Y_tr")][0])
            / heli.vehicle.values("body")["mass"]
        )

    return (side(step) - side(-step)) / (2 * step)


def table() -> str:
    """The numbers as a Markdown table."""
    rows = [
        [
            row.quantity,
            row.unit,
            f"{row.printed:g}",
            f"{row.reading_error:g}",
            f"{row.computed:.4g}",
            f"{row.miss:+.2g}",
            _yes(row.determined),
            _yes(row.met),
        ]
        for row in published_numbers()
    ]
    return markdown(HEAD, rows)


def _yes(answer: bool) -> str:
    return "yes" if answer else "no"


if __name__ == "__main__":
    print(table())
