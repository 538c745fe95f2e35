"""Ratios with their goals, as text, as JSON, and kept in docs/benchmarks.md."""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import evidence.tables
from studies.report.provenance import processor

DOCUMENT = evidence.tables.DOCS / "benchmarks.md"


@dataclass(frozen=True)
class Ratio:
    """`value` against `goal`: at least that, or with `at_most` no more. Without a goal it is there
    for orientation.
    """

    name: str
    value: float
    goal: float | None = None
    at_most: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None without one."""
        if self.goal is None:
            return None
        return self.value <= self.goal if self.at_most else self.value >= self.goal

    @property
    def verdict(self) -> str:
        """The goal and whether it is met."""
        if self.goal is None:
            return ""
        return (
            f"{'at most' if self.at_most else 'at least'} {self.goal:g} x:"
            f" {'met' if self.met else 'MISSED'}"
        )


def present(
    section: str,
    options: argparse.Namespace,
    tables: list[str],
    ratios: list[Ratio],
    notes: list[str],
) -> None:
    """Print the tables and the ratios with their goals, or the ratios as JSON; keep them where
    --write asks for it.
    """
    rows = [(r.name, f"{r.value:.3g}", r.verdict) for r in ratios]
    compared = [table("### Ratios", rows, ("", "x", "goal"))] if rows else []
    text = "\n\n".join([*tables, *compared, *(f"- {note}" for note in notes)])
    print(json.dumps({r.name: r.value for r in ratios}, indent=1) if options.json else text)
    if getattr(options, "write", False):
        keep(section, text)


def readable(seconds: float) -> str:
    """A time in the unit that suits it."""
    unit, size = next(((u, s) for u, s in (("s", 1.0), ("ms", 1e-3)) if seconds >= s), ("us", 1e-6))
    return f"{seconds / size:.3g} {unit}"


def table(title: str, rows: list[tuple[str, ...]], head: tuple[str, ...]) -> str:
    """Columns in Markdown, aligned to be read as they are."""
    lines = [head, *rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(head))]

    def text(line: tuple[str, ...]) -> str:
        return "| " + " | ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)) + " |"

    return "\n".join(
        [
            title,
            "",
            text(head),
            "|" + "|".join("-" * (w + 2) for w in widths) + "|",
            *map(text, rows),
        ]
    )


def machine() -> str:
    """Processor, system, compiler and library versions of this run."""
    try:
        compiler = subprocess.run(
            ["cc", "--version"], capture_output=True, text=True, check=True
        ).stdout.splitlines()[0]
    except (OSError, subprocess.CalledProcessError):
        compiler = "no C compiler"
    libraries = []
    for name in ("numpy", "scipy", "casadi", "numba", "control"):
        try:
            libraries.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            libraries.append(f"no {name}")
    return (
        f"{processor()}, {platform.system()}; {compiler}; Python"
        f" {platform.python_version()}, {', '.join(libraries)}"
    )


def keep(section: str, text: str) -> None:
    """Put `text` between the marks of `section` in docs/benchmarks.md, stamped."""
    evidence.tables.keep(DOCUMENT, section, text, machine())
