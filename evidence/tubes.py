"""`python -m evidence.tubes`: the largest gusts for which a tube is proven at held airspeeds, tubes
along ranges of airspeed, beside the worst gusts found, of the packaged helicopters; gains on
tubes; the planar VTOL.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import product

import numpy as np

from evidence import tube_gains, tube_loops
from evidence.planar_vtol import tubes as planar_vtol
from evidence.tables import DOCS, chosen, keep, kept_rows, markdown, renewed
from evidence.tube_flights import WIDTHS, from_its_border, widths, worst
from symheli import Helicopter, trim
from symheli.errors import InputError
from synthesis import Tube, tube
from synthesis.tubes.controllers import Choice
from synthesis.tubes.deviations import CommandCell, Deviations
from synthesis.tubes.reference import TUBE_SIZES, moving

Array = np.ndarray

VEHICLES = ("xcell60", "xcell_kahn_hudson", "yamaha_r50")
AIRSPEEDS = (0.0, 3.0, 6.0, 8.0, 10.0, 13.0)
QUICK = ("xcell60, 0", "xcell60, 8")
GUSTS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0, 1.25, 1.5)
"""Amplitudes that are tried, m/s."""
TRANSITIONS = (
    ("xcell60", 0.0, 13.0, 0.25, 1.0, 1.0, 1.0),
    ("xcell60", 0.0, 7.0, 0.5, 1.0, 1.0, 1.0),
    ("xcell_kahn_hudson", 0.0, 13.0, 0.25, 1.0, 1.0, 1.0),
    ("yamaha_r50", 0.0, 13.0, 0.25, 1.0, 1.0, 1.0),
)
"""Helicopter, range, m/s; gusts, m/s; largest acceleration, jerk and snap, m/s^2, m/s^3, m/s^4."""
FLIGHTS, SECONDS = 10_000, 0.25
"""From the border of a tube, and how long each lasts: what leaves it leaves at once."""
INTERVALS = (3.0, 5.0, 7.0, 8.0, 9.0, 10.0, 12.0)
"""Where remainders are shown, m/s."""
SMALL_TUBE = 0.1
"""Its half widths, in units of `TUBE_SIZES`."""


def largest(heli: Helicopter, airspeed: float) -> tuple[float, Tube | None]:
    """The largest amplitude of `GUSTS` for which a tube is proven, by bisection, with the tube."""
    low, high, found = -1, len(GUSTS), None
    while high - low > 1:
        middle = (low + high) // 2
        trial = tube(heli, airspeed, gust=GUSTS[middle])
        low, high, found = (middle, high, trial) if trial.proven else (low, middle, found)
    return (GUSTS[low] if found else 0.0), found


def amplitudes(asked: Sequence[str], shown: Sequence[Sequence[str]]) -> str:
    """The table of the largest gusts at held airspeeds in Markdown; rows asked for are found now,
    of the others those `shown` before stay.
    """
    cases = list(product(VEHICLES, AIRSPEEDS))
    names = [[name, f"{airspeed:g}"] for name, airspeed in cases]

    def row(k: int) -> list[str]:
        gust, found = largest(Helicopter.load(cases[k][0], governor="ideal"), cases[k][1])
        if found is None:
            return ["none", "", "", ""]
        return [f"{gust:g}", *widths(found), f"{worst(found):.2f}"]

    head = ["helicopter", "airspeed, m/s", "gusts, m/s", *WIDTHS, "worst gust found", "of"]
    return markdown(head, renewed(names, row, chosen(asked, names), shown))


def transitions(asked: Sequence[str], shown: Sequence[Sequence[str]]) -> str:
    """The table of tubes along ranges of airspeed in Markdown, as `amplitudes`."""
    names = [
        [name, f"{low:g} to {high:g}", f"{gust:g}", ", ".join(f"{limit:g}" for limit in limits)]
        for name, low, high, gust, *limits in TRANSITIONS
    ]

    def row(k: int) -> list[str]:
        name, low, high, gust, acceleration, jerk, snap = TRANSITIONS[k]
        heli = Helicopter.load(name, governor="ideal")
        found = tube(heli, (low, high), gust=gust, acceleration=acceleration, jerk=jerk, snap=snap)
        if not found.proven:
            return [f"none: {found.why}", "", "", ""]
        share = max(worst(found, p) for p in (low, high))
        return [*widths(found), f"{share:.2f}", f"{from_its_border(found, FLIGHTS, SECONDS):.3f}"]

    head = ["helicopter", "airspeed, m/s", "gusts, m/s", "limits, m/s^2, m/s^3, m/s^4", *WIDTHS]
    rows = renewed(names, row, chosen(asked, [name[:3] for name in names]), shown)
    return markdown([*head, "worst gust found", "furthest flight", "of"], rows)


def remainders(intervals: Sequence[float]) -> str:
    """What keeps tubes from being proven, in Markdown: for cells of 1 m/s, and accelerations from 0
    to 1 m/s^2, the rates (1/s) at which terms of the Jacobian that are bounded in size alone may
    move the deviations, on a small tube; with the feedback of a range of airspeeds, and with that
    of a held one.
    """
    heli = Helicopter.load(VEHICLES[0], governor="ideal")
    rows = []
    for low in intervals:
        nodes = np.array([low, low + 1])
        steady = [trim(heli, airspeed=p) for p in nodes]
        alike = [Choice().regulator(heli, np.array(at.x), np.array(at.u)) for at in steady]
        cells = [_rates(heli, nodes, choice) for choice in (Choice(), Choice(alike))]
        rows.append([f"{low:g} to {low + 1:g}", *cells[0], *cells[1]])
    head = ["largest kink, 1/s", "remainder of p q r, 1/s"]
    alike_head = [f"{name}, all controls of equal weight" for name in head]
    return markdown(["airspeed, m/s", *head, *alike_head], rows)


def _rates(heli: Helicopter, nodes: Array, choice: Choice) -> list[str]:
    """Rates (1/s) of the largest kink, and of the remainders of p, q and r, as two cells."""
    sizes = np.array(TUBE_SIZES[:10])
    units = np.concatenate([SMALL_TUBE * sizes, np.ones(4)])
    loop = Deviations(heli, moving(heli, nodes, (1.0, 1.0, 1.0), choice), 0.0)
    cell = CommandCell(0, (0.0, 1.0), (0.0, 1.0))
    (over,) = loop.enclosed([cell], np.diag(units[:10])[None], loop.drifts([cell]))
    if over is None:
        raise InputError(f"no bounds from {nodes[0]:g} to {nodes[1]:g} m/s")
    across = np.sqrt(np.einsum("kii,i->k", over.weights[:, :-1, :-1], units[:-1] ** 2))
    rates = across * np.abs(over.left / units[:10]).max(axis=1)
    single = (over.left != 0).sum(axis=1) == 1
    row = dict(zip(np.abs(over.left[single]).argmax(axis=1), rates[single], strict=True))
    kinks = max(rates[~single], default=0.0)
    return [f"{kinks:.2g}", " ".join(f"{row.get(i, 0.0):.2g}" for i in (3, 4, 5))]


def main() -> None:
    """Print the tables, or keep them in docs/tubes.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="keep the tables in docs/tubes.md")
    parser.add_argument("--quick", action="store_true", help="one helicopter at 0 and 8 m/s")
    parser.add_argument(
        "--only",
        choices=("amplitudes", "transitions", "remainders", "gains", "loops", "governed", "vtol"),
        help="one of the tables",
    )
    parser.add_argument(
        "--rows",
        nargs="+",
        default=[],
        metavar="ROW",
        help='of amplitudes, "helicopter, airspeed", transitions, "helicopter, low to high, gust",'
        ' or loops, "helicopter, governor, parts"; the page keeps the others',
    )
    given = parser.parse_args()
    if given.rows and given.only not in ("amplitudes", "transitions", "loops"):
        parser.error("--rows names rows of --only amplitudes, transitions or loops")
    if given.write and given.quick:
        parser.error("--write keeps whole tables: leave out --quick")
    page = DOCS / "tubes.md"
    makers = {
        "amplitudes": lambda: amplitudes(given.rows, kept_rows(page, "amplitudes")),
        "transitions": lambda: transitions(given.rows, kept_rows(page, "transitions")),
        "remainders": lambda: remainders(INTERVALS),
        "gains": tube_gains.table,
        "loops": lambda: tube_loops.table(tube_loops.CASES, given.rows, kept_rows(page, "loops")),
        "governed": lambda: tube_loops.table(tube_loops.GOVERNED, given.rows, []),
        "vtol": planar_vtol.table,
    }
    if given.quick:
        makers = {"amplitudes": lambda: amplitudes(QUICK, [])}
    for name in [given.only] if given.only else makers:
        text = makers[name]()
        if given.write:
            keep(DOCS / "tubes.md", name, text)
        else:
            print(text)


if __name__ == "__main__":
    main()
