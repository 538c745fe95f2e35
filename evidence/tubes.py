"""`python -m evidence.tubes`: the largest gusts for which a tube is proven at held airspeeds, tubes
along ranges of airspeed, beside the worst gusts found, of the packaged helicopters; what keeps
tubes from being proven; gains on tubes; the planar VTOL.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from itertools import product

from evidence import tube_gains, tube_loops
from evidence.planar_vtol import tubes as planar_vtol
from evidence.tables import DOCS, chosen, keep, kept_rows, markdown, renewed
from evidence.tube_flights import WIDTHS, cells_of, widths, worst
from evidence.tube_terms import HELD_AGAINST, INTERVALS, held_against, remainders
from symheli import Helicopter
from synthesis.tubes import Tube, tube

VEHICLES = ("xcell60", "xcell_kahn_hudson", "yamaha_r50")
AIRSPEEDS = (0.0, 3.0, 6.0, 8.0, 10.0, 13.0)
QUICK = ("xcell60, 0", "xcell60, 8")
GUSTS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0, 1.25, 1.5)
"""Amplitudes that are tried, m/s."""
TRANSITIONS = (
    ("xcell60", 0.0, 13.0, 0.25, 1.0, 1.0, 1.0),
    ("xcell60", 0.0, 5.0, 0.5, 1.0, 1.0, 1.0),
    ("xcell_kahn_hudson", 3.0, 4.0, 0.25, 1.0, 1.0, 1.0),
    ("xcell_kahn_hudson", 0.0, 13.0, 0.25, 1.0, 1.0, 1.0),
    ("yamaha_r50", 0.0, 13.0, 0.25, 1.0, 1.0, 1.0),
)
"""Helicopter, range, m/s; gusts, m/s; largest acceleration, jerk and snap, m/s^2, m/s^3, m/s^4."""
FLIGHTS, SECONDS = 10_000, 0.25
"""From the border of a tube, and how long each lasts: what leaves it leaves at once."""


def largest(heli: Helicopter, airspeed: float) -> tuple[float, Tube | None]:
    """The largest amplitude of `GUSTS` for which a tube is proven, by bisection, with the tube."""
    low, high, found = -1, len(GUSTS), None
    while high - low > 1:
        middle = (low + high) // 2
        trial = tube(heli, airspeed, gust=GUSTS[middle])
        low, high, found = (middle, high, trial) if trial.verified else (low, middle, found)
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
        return cells_of(found, FLIGHTS, SECONDS)

    head = ["helicopter", "airspeed, m/s", "gusts, m/s", "limits, m/s^2, m/s^3, m/s^4", *WIDTHS]
    rows = renewed(names, row, chosen(asked, [name[:3] for name in names]), shown)
    return markdown([*head, "worst gust found", "furthest flight", "of"], rows)


def _tables(rows: Sequence[str]) -> dict[str, Callable[[], str]]:
    """What makes each table of the page; rows: those asked for."""
    page = DOCS / "tubes.md"
    return {
        "amplitudes": lambda: amplitudes(rows, kept_rows(page, "amplitudes")),
        "transitions": lambda: transitions(rows, kept_rows(page, "transitions")),
        "remainders": lambda: remainders(VEHICLES[0], INTERVALS),
        "terms": lambda: held_against(VEHICLES[0], HELD_AGAINST),
        "gains": tube_gains.table,
        "loops": lambda: tube_loops.table(tube_loops.CASES, rows, kept_rows(page, "loops")),
        "governed": lambda: tube_loops.table(tube_loops.GOVERNED, rows, []),
        "vtol": planar_vtol.table,
    }


def main() -> None:
    """Print the tables, or keep them in docs/tubes.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="keep the tables in docs/tubes.md")
    parser.add_argument("--quick", action="store_true", help="one helicopter at 0 and 8 m/s")
    parser.add_argument("--only", choices=tuple(_tables([])), help="one of the tables")
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
    makers = _tables(given.rows)
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
