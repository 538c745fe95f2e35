"""`python -m evidence.r50`: the guessed R-50 in hover beside the model identified from flight."""

from __future__ import annotations

import argparse

import numpy as np

from evidence.tables import DOCS, four_digits, keep, markdown
from symheli import Helicopter, LinearModel, linearize, trim
from symheli.airframe import identified_model

ENTRIES = (
    ("L_b", "1/s^2", ("p", "b", "b1"), "made to, by the hub stiffness"),
    ("M_a", "1/s^2", ("q", "a", "a1"), "made to, by the inertia in pitch"),
    ("Z_w", "1/s", ("w", "w", "w"), "no: mass, lift slope and chord are guesses"),
    ("N_r", "1/s", ("r", "r", "r"), "no: flown with a yaw damper, which N_r shares work with"),
    ("X_u", "1/s", ("u", "u", "u"), "no: drag in the downwash is a guess"),
    ("Y_v", "1/s", ("v", "v", "v"), "no: drag in the downwash is a guess"),
)
"""Derivatives: unit, the states of A, the second in either model, and whether they agree."""
STEADY = (
    ("M_u", "rad/(m s)", ("q", "u", "u"), "no: a rotor that flaps back in flight has this sign"),
    ("L_v", "rad/(m s)", ("p", "v", "v"), "no: a rotor that flaps back in flight has this sign"),
)
"""Derivatives with flapping and bar in their steady state."""
FLAPPING = (("a", "b", "c", "d", "r_fb"), ("a1", "b1"))


def models() -> tuple[LinearModel, LinearModel]:
    """The identified model and the linearization of the vehicle in hover."""
    heli = Helicopter.load("yamaha_r50", governor="ideal")
    return identified_model("r50_hover"), linearize(heli, trim(heli, airspeed=0.0))


def mode(model: LinearModel, rate: str) -> complex:
    """The pole of the lightly damped oscillation in which this rate, p or q, is largest, 1/s."""
    poles, shapes = np.linalg.eig(model.A)
    share = np.abs(shapes[model.states.index(rate)]) / np.linalg.norm(shapes, axis=0)
    return complex(poles[np.argmax(share * (np.imag(poles) > 2 * np.abs(np.real(poles))))])


def table() -> str:
    """Derivatives and modes in Markdown."""
    both = models()
    steady = [m.residualize(list(names)) for m, names in zip(both, FLAPPING, strict=True)]
    rows = []
    for of, entries in ((both, ENTRIES), (steady, STEADY)):
        for name, unit, (row, *columns), agrees in entries:
            values = [
                m.A[m.states.index(row), m.states.index(column)]
                for m, column in zip(of, columns, strict=True)
            ]
            rows.append([name, unit, *map(four_digits, values), agrees])
    for words, rate in (("roll and flapping", "p"), ("pitch and flapping", "q")):
        poles = [mode(m, rate) for m in both]
        shown = [f"{pole.real:.2f} +- {pole.imag:.2f}i" for pole in poles]
        rows.append([words, "1/s", *shown, "nearly: rotor and bar are one lag, of one time"])
    return markdown(["", "unit", "identified", "yamaha_r50", "agrees"], rows)


def main() -> None:
    """Print the table, or keep it in docs/vehicles.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="keep the table in docs/vehicles.md")
    if parser.parse_args().write:
        keep(DOCS / "vehicles.md", "r50", table())
    else:
        print(table())


if __name__ == "__main__":
    main()
