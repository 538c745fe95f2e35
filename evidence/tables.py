"""Tables of the documentation as the command that stands above them wrote them: with its options,
the date and the machine.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import sys
import time
from collections.abc import Callable, Collection, Iterable, Sequence
from datetime import date
from pathlib import Path

from studies.report.provenance import processor
from symheli.errors import InputError

DOCS = Path(__file__).resolve().parents[1] / "docs"
APPENDIX = "appendix"
"""Folder of the long tables, beside the pages that refer to them."""
QUIET = 0.2
"""Processors that other programs may keep busy while a table is measured for keeping."""


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [f"| {' | '.join(line)} |" for line in (head, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])


def four_digits(value: float) -> str:
    """A number to four significant digits, zeros kept."""
    return f"{value:#.4g}".rstrip(".")


def marks(section: str) -> tuple[str, str]:
    """Return the lines between which the tables of a section stand."""
    return f"<!-- {section}: written by its command -->", f"<!-- {section}: end -->"


def marked(page: Path, section: str) -> tuple[Path, str]:
    """Return the page that has the marks of a section, and its text: the page itself, or the one of
    the same name in the folder `appendix` beside it, which has the long tables.
    """
    begin, _ = marks(section)
    for one in (page, page.parent / APPENDIX / page.name):
        text = one.read_text(encoding="utf-8") if one.is_file() else ""
        if begin in text:
            return one, text
    return page, ""


def keep(page: Path, section: str, text: str, machine: str = "", command: str = "") -> None:
    """Put `text` between the marks of `section` on the page, or on its page of tables, under
    `command` (default: this process's), date and `machine` (default: its processor).

    Raises `InputError` where the page or its marks are not there.
    """
    begin, end = marks(section)
    page, document = marked(page, section)
    if begin not in document or end not in document:
        raise InputError(
            f"{page} does not exist, or lacks the marks {begin} ... {end}: tables are kept in a"
            " clone, where its docs are"
        )
    before, rest = document.split(begin, 1)
    stamp = f"`{command or own_command()}`, {date.today():%d %B %Y}: {machine or processor()}."
    page.write_text(
        f"{before}{begin}\n\n{stamp}\n\n{text}\n\n{end}{rest.split(end, 1)[1]}", encoding="utf-8"
    )


def kept_rows(page: Path, section: str) -> list[list[str]]:
    """The cells of each row of the table that stands between the marks of `section`, without its
    head; none where there is no table.
    """
    begin, end = marks(section)
    _, document = marked(page, section)
    _, _, rest = document.partition(begin)
    lines = [line for line in rest.partition(end)[0].splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines[2:]]


def renewed(
    names: Sequence[Sequence[str]],
    row: Callable[[int], list[str]],
    chosen: Collection[int],
    shown: Sequence[Sequence[str]],
) -> list[list[str]]:
    """A row for each of these cases: of those chosen the one found now, after the cells that name
    the case and before the date; of the others the one `shown` before, where there is one.
    """
    rows, count = [], len(names[0])
    old = {tuple(cells[:count]): list(cells) for cells in shown}
    for k, name in enumerate(names):
        if k in chosen:
            rows.append([*name, *row(k), f"{date.today():%d %B %Y}"])
            print(*rows[-1], flush=True)
        elif tuple(name) in old:
            rows.append(old[tuple(name)])
    return rows


def chosen(asked: Sequence[str], names: Sequence[Sequence[str]]) -> set[int]:
    """The cases whose names are asked for, "helicopter, airspeed, ..."; all without any."""
    words = [", ".join(name) for name in names]
    unknown = [row for row in asked if row not in words]
    if unknown:
        raise InputError(f"no row {unknown[0]!r}; rows are {', '.join(map(repr, words))}")
    return {k for k, name in enumerate(words) if not asked or name in asked}


def own_command() -> str:
    """What started this process, as one would type it in a clone; without --out DIR and --processes
    N, which decide where results are kept and how fast, not what they are.
    """
    specification = getattr(sys.modules["__main__"], "__spec__", None)
    script = (
        f"-m {specification.name.removesuffix('.__main__')}"
        if specification
        else f"{Path(sys.argv[0]).parent.name}/{Path(sys.argv[0]).name}"
    )
    typed = f"python {script} {shlex.join(sys.argv[1:])}".strip()
    return re.sub(r" --(out|processes)[ =]\S+", "", typed)


def parsed(parser: argparse.ArgumentParser, page: str, *, timed: bool = True) -> argparse.Namespace:
    """The arguments, with --write for tables of docs/`page`: refused, with the load, where other
    programs are at work, unless nothing in them depends on time (`timed` False).
    """
    parser.add_argument(
        "--write",
        action="store_true",
        help=f"keep the tables of docs/{page}" + ("; refused on a busy machine" if timed else ""),
    )
    options = parser.parse_args()
    if options.write and timed:
        try:
            refuse_on_a_busy_machine()
        except InputError as error:
            parser.error(str(error))
    return options


def refuse_on_a_busy_machine(seconds: float = 2.0) -> None:
    """Raises `InputError` with the load where other programs are at work: to be called before one's
    own work begins.
    """
    load = busy_processors(seconds)
    if load > QUIET:
        raise InputError(
            "--write keeps what is measured on a quiet machine; here other programs keep"
            f" {load:.1f} of {os.cpu_count()} processors busy, at most {QUIET:g} is quiet: end"
            " them, or run without --write"
        )


def busy_processors(seconds: float) -> float:
    """Processors at work while this process sleeps; the load average of the last minute where the
    system does not say.
    """
    before = _ticks()
    if before is None:
        return os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    time.sleep(seconds)
    after = _ticks() or before
    idle, total = (b - a for a, b in zip(before, after, strict=True))
    return (os.cpu_count() or 1) * (1.0 - idle / max(total, 1))


def _ticks() -> tuple[int, int] | None:
    """(idle, all) ticks of the processors since the system began."""
    try:
        fields = [
            int(field) for field in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]
        ]
    except (OSError, ValueError, IndexError):
        return None
    return fields[3] + fields[4], sum(fields)
