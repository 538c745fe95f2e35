"""One table of the nu-gaps that the pages of tables have in full: median and worst, by flight.

python -m evidence.marks.summary            the table
python -m evidence.marks.summary --write    kept in docs/identified.md
"""

from __future__ import annotations

import argparse

from evidence.tables import DOCS, keep, kept_rows, markdown, parsed

PAGE = DOCS / "identified.md"
SECTION = "nu-gaps"
FLIGHTS = {
    "xcell60": "Gavrilets' X-Cell, one flight of 145 s",
    "xcell60, two flights": "the same, and a gentle flight of 230 s",
    "xcell_kahn_hudson": "Kahn and Hudson's X-Cell, one flight",
    "xcell_kahn_hudson, two flights": "the same, and a gentle flight",
}
"""Sections of the page of tables, in words."""
AXES = ("lateral", "longitudinal", "all axes")


def table() -> str:
    """The worst nu-gap over airspeed, median over the seeds with the worst seed in brackets, and
    its mark.
    """
    rows = []
    for section, words in FLIGHTS.items():
        found = {cells[0]: cells[1:4] for cells in kept_rows(PAGE, section)}
        cells = []
        for axis in AXES:
            mark, median, worst = found[f"worst nu-gap, {axis}"]
            cells.append(f"{median} ({worst.split()[0]}; {mark})")
        rows.append([words, *cells])
    head = ["worst nu-gap over airspeed: median (worst seed; mark)", *AXES]
    return markdown(head, rows)


def main() -> None:
    """Print the table, or keep it."""
    options = parsed(argparse.ArgumentParser(description=__doc__), PAGE.name, timed=False)
    text = table()
    print(text)
    if options.write:
        keep(PAGE, SECTION, text)


if __name__ == "__main__":
    main()
