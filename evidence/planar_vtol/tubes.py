"""Tubes of the planar VTOL by `synthesis.tubes.tube`, beside the published metric: a table."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np

from evidence.planar_vtol.flights import from_its_border, published_law, worst_position
from evidence.planar_vtol.metric import Metric, proven_positive, refuted
from evidence.planar_vtol.model import ARM, GRAVITY, INERTIA, INPUTS, MASS, STATES, over_ground
from evidence.tables import markdown
from symheli.lpv.riccati import regulator
from synthesis.tubes import Motions, Tube, tube

Array = np.ndarray

SIZES = (0.2, 0.2, 0.2, 0.5, 0.5, 2.0)
"""Half widths of equal weight in the size of a tube: m, rad, m/s, rad/s."""
FLIGHTS, STEPS = 2000, 60
"""Flights from the border of a tube, and steps of each: what leaves it leaves at once."""


@dataclass(frozen=True)
class Case:
    """Motions with a bank within `bank` and turn rate within `turn`, degrees and degrees/s, thrusts
    of (1 +- thrust) times the weight, at any velocity; gusts of `gust` m/s^2; deviations and
    control, N, of equal weight in the regulators.
    """

    motions: str
    bank: float
    turn: float
    thrust: float
    gust: float
    deviations: tuple[float, ...]
    control: float
    nodes: int = 1


HOVER = ((0.1, 0.1, 0.3, 0.5, 0.5, 3.0), 0.4)
MOVING = ((0.118, 0.235, 0.204, 0.436, 1.042, 1.954), 0.582)
CASES = (
    Case("hover", 0.0, 0.0, 0.0, 1.0, *HOVER),
    Case("up and down", 0.0, 0.0, 0.1, 1.0, *MOVING),
    Case("banked", 20.0, 20.0, 0.05, 0.5, *MOVING, nodes=5),
    Case("banked", 60.0, 60.0, 0.1, 0.25, *MOVING, nodes=13),
)


def gain(bank: float, case: Case) -> Array:
    """K (2, 6) at a bank, rad, of the weight as thrust."""
    s, c = np.sin(bank), np.cos(bank)
    A, B = np.zeros((6, 6)), np.zeros((6, 2))
    A[[0, 1, 2], [3, 4, 5]] = 1.0
    A[3:5, 2] = -GRAVITY * c, -GRAVITY * s
    B[3:5] = np.array([[-s], [c]]) / MASS
    B[5] = ARM / INERTIA, -ARM / INERTIA
    Q, R = np.diag(np.array(case.deviations) ** -2.0), np.eye(2) / case.control**2
    return -regulator(A, B, Q, R).K


def motions(case: Case) -> Motions:
    """Every motion of the equations within a case, and the feedback about it."""
    thrusts = [GRAVITY * (1 - case.thrust), GRAVITY * (1 + case.thrust)]
    names = {"states": STATES, "inputs": INPUTS}
    if not case.bank:
        c = casadi.SX.sym("c", 1)
        x, u = casadi.SX.zeros(6), MASS * c / 2 * casadi.SX.ones(2)
        reference = casadi.Function("level", [c], [x, u])
        return Motions(reference, gain(0.0, case), others=[thrusts], **names)
    c, limit = casadi.SX.sym("c", 3), np.radians(case.bank)
    # any position, velocity and torque of the reference: the deviation does not depend on them
    x = casadi.vertcat(0, 0, c[0], 0, 0, c[1])
    u = MASS * c[2] / 2 * casadi.SX.ones(2)
    nodes, rate = np.linspace(-limit, limit, case.nodes), np.radians(case.turn)
    return Motions(
        casadi.Function("banked", [c], [x, u]),
        np.array([gain(bank, case) for bank in nodes]),
        schedule=nodes,
        rate=(-rate, rate),
        others=[thrusts],
        **names,
    )


def proven(case: Case) -> Tube:
    """The tube of a case."""
    return tube(over_ground(), motions(case), gust=case.gust, sizes=SIZES)


def sizes(found: Tube) -> tuple[float, float]:
    """Radius of the position, m, and largest size of the control's deviation, N."""
    inside, K = np.linalg.inv(found.P), found.deviations.reference.gain
    position = np.linalg.eigvalsh(inside[:, :2, :2])[:, -1].max()
    control = np.linalg.eigvalsh(K @ inside @ np.swapaxes(K, 1, 2))[:, -1].max()
    return float(position**0.5), float(control**0.5)


def published(name: str) -> tuple[float, float, float, str]:
    """(tube claimed, tube proven of the same metric, position flown, where the claim fails)."""
    metric = Metric.stored(name)
    lam, mu, size = metric.smallest()
    needed = (metric.positive, metric.position(size), metric.condition(lam, mu))
    holds = all(map(proven_positive, needed))
    place = refuted(metric, metric.tube)
    where = "" if place is None else ", ".join(f"{v:.4g}" for v in place[0])
    found = (size * mu / lam) ** 0.5 if holds else np.inf
    return metric.tube, found, published_law(metric)[0], where


def table() -> str:
    """The table in Markdown."""
    claimed, found, far, where = published("position")
    box = "phi, phi' within pi/3, vx within 2, vz within 1 (actual states)"
    verdict = f"refuted at phi, vx, vz, phi', w = {where}" if where else "not refuted"
    rows = [
        ["published, lambda 1.2", box, "1", f"{claimed:.5f}", "0.5688", verdict, f"{far:.3f}"],
        ["the same metric", box, "1", f"{found:.4f}", "", "proven between the points", ""],
    ]
    for case in CASES:
        made = proven(case)
        limits = f"thrust within {case.thrust:.0%} of the weight"
        if case.bank:
            limits = f"phi within {case.bank:g} deg, phi' within {case.turn:g} deg/s, {limits}"
        row = [f"{case.motions}, regulator", f"{limits} (reference)", f"{case.gust:g}"]
        if made.verified:
            position, control = sizes(made)
            far, border = "", ""
            if not case.bank:
                border = f"; furthest from the border {from_its_border(made, FLIGHTS, STEPS):.3f}"
                far = f"{worst_position(made):.3f}"
            row += [f"{position:.4f}", f"{control:.3f}", f"proven{border}", far]
        else:
            row += ["none", "", made.why, ""]
        rows.append(row)
        print(*row, flush=True)
    head = ["law", "motions", "gusts, m/s^2", "position, m", "control, N", "verdict", "flown, m"]
    return markdown(head, rows)
