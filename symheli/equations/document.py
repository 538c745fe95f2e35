"""The equations as a document: LaTeX, or Markdown with the mathematics GitHub sets."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from symheli.equations.listing import Parameter, Section, listing

if TYPE_CHECKING:
    from symheli.equations.described import Described

_REMARK = (
    "Printed from the code that computes them: each component is evaluated with symbols. SI units"
    " and radians. Symbols such as mu, C_T or T without a subscript belong to the part under whose"
    " heading they stand; powers of ten under a root keep derivatives finite. Where the inflow"
    " ratio lambda_0 appears on both sides it is the root that continues from hover. G15: V."
    ' Gavrilets, "Dynamic Model for a Miniature Aerobatic Helicopter", Handbook of Unmanned Aerial'
    " Vehicles, Springer 2015."
)


def latex(heli: Described, standalone: bool = False) -> str:
    """A section for every part: its equations and a table of its parameters. `standalone` adds
    preamble and title.
    """
    body = "\n\n".join(_latex_section(section) for section in listing(heli))
    if not standalone:
        return body
    preamble = (
        r"\documentclass{article}"
        "\n"
        r"\usepackage[a4paper,margin=20mm]{geometry}"
        "\n"
        r"\usepackage{amsmath}"
    )
    title = rf"\title{{{_text(heading(heli))}}}" "\n" r"\date{}"
    return "\n".join(
        (
            preamble,
            title,
            r"\begin{document}",
            r"\maketitle",
            _text(_REMARK),
            "",
            body,
            r"\end{document}",
            "",
        )
    )


def markdown(heli: Described) -> str:
    """Return the document as one page of Markdown, each equation in dollars."""
    parts = [f"# {heading(heli)}", _REMARK.replace("_", r"\_")]
    for section in listing(heli):
        parts += [f"## {section.title}", section.text.replace("_", r"\_")]
        parts += [f"$$\n{equation}\n$$" for equation in section.equations]
        if section.parameters:
            rows = [
                f"| ${p.symbol}$ | `{p.entry}` | {p.value:g} | {p.unit} | {p.source} |"
                for p in section.parameters
            ]
            parts.append(
                "\n".join(
                    ["| symbol | entry | value | unit | source |", "|---|---|---|---|---|", *rows]
                )
            )
    return "\n\n".join(parts) + "\n"


def heading(heli: Described) -> str:
    """Return the subject of the document."""
    options = f", as printed: {', '.join(sorted(heli.printed))}" if heli.printed else ""
    return f"Equations of motion: {heli.vehicle.title}, {heli.governor} governor{options}"


def _latex_section(section: Section) -> str:
    equations = "\n".join(rf"\[ {equation} \]" for equation in section.equations)
    parts = [rf"\section{{{_text(section.title)}}}", _text(section.text), equations]
    if section.parameters:
        head = (
            r"\begin{center}\small\begin{tabular}{llrlp{70mm}}",
            r"symbol & entry & value & unit & source \\ \hline",
        )
        rows = [_latex_row(p) for p in section.parameters]
        parts.append("\n".join((*head, *rows, r"\end{tabular}\end{center}")))
    return "\n".join(parts)


def _latex_row(p: Parameter) -> str:
    return (
        rf"${p.symbol}$ & \texttt{{{_text(p.entry)}}} & {p.value:g} & {_text(p.unit)} &"
        rf" {_text(p.source)} \\"
    )


def _text(plain: str) -> str:
    """Plain text with LaTeX's own characters escaped."""
    escaped = re.sub(r"([_%&#$])", r"\\\1", plain).replace("^", r"\textasciicircum{}")
    return re.sub(r'"([^"]*)"', r"``\1''", escaped)
