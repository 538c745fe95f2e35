"""The definitions that the report uses, as numbered formulas."""

from __future__ import annotations

from studies.report.mathml import (
    bar,
    display,
    dot,
    extremum,
    fraction,
    hat,
    matrix,
    norm,
    root,
    row,
    sub,
    sup,
    total,
    words,
)

_dp = dot("p")
_Ap, _Bp, _Cp, _Dp, _Pp = (row(name, "(", "p", ")") for name in "ABCDP")


def _at(signal: str, lag: str = "") -> str:
    """A signal at sample k, or lag samples before."""
    return row(signal, "(", "k", *(("−", lag) if lag else ()), ")")


EQUATIONS: dict[str, str] = {
    "lpv": display(
        dot("x"), "=", _Ap, "x", "+", _Bp, "u", "−", sub("x", 0), "′", "(", "p", ")", _dp,
        ",", "   ", "y", "=", "C", "x",
    ),
    "entries": display(
        _Ap, "=", total(row("i", "=", 0), "d", sub("A", "i"), sup("p", "i")),
    ),
    "lft": display(
        _Ap, "=", sub("A", 0), "+", sub("B", "Δ"), "p", "I",
        sup(row("(", "I", "−", sub("D", "Δ"), "p", ")"), row("−", 1)), sub("C", "Δ"),
    ),
    "arx": display(
        _at("y"), "=", "−", total(row("i", "=", 1), "n", sub("a", "i"), "(", "p", ")", _at("y", "i")),
        "+", total(row("j", "=", 1), "n", sub("b", "j"), "(", "p", ")", _at("u", "j")),
        "+", "c", "(", "p", ")", "+", "d", "(", "p", ")", _dp,
    ),
    "rls": display(
        hat("θ"), "=", words("arg"),
        extremum(
            "min", "θ",
            total(row("k", "=", 1), "N", sup("λ", row("N", "−", "k")),
                  sup(norm(_at("y"), "−", sup("θ", "⊤"), _at("φ")), 2)),
        ),
    ),
    "kinematics": display(
        matrix((dot("v"),), (dot("ω"),)), "=",
        matrix((row("v", "×", "ω", "+", "g", "(", "φ", ",", "θ", ")"),), (0,)), "+",
        total(row("i", "=", 1), 2, sub("Θ", "i"), "(", "p", ")",
              matrix((row("v", "(", "k", "−", "i", ")"),), (row("ω", "(", "k", "−", "i", ")"),),
                     (row("u", "(", "k", "−", "i", ")"),))),
    ),
    "fit": display(
        words("fit"), "=", 100, "(", 1, "−",
        fraction(norm("y", "−", hat("y")), norm("y", "−", bar("y"))),
        ")", " ", "%",
    ),
    "gap": display(
        sub("δ", "ν"), "(", "P", ",", sub("P", 1), ")", "<", "b", "(", "P", ",", "K", ")",
        "   ", "⟹", "   ", words("K stabilizes\N{NO-BREAK SPACE}"), sub("P", 1),
    ),
    "gain": display(
        "γ", "=", extremum("sup", row("w", "≠", 0, ",", " ", row("|", _dp, "|"), "≤", "ρ"),
                           fraction(sub(norm("z"), 2), sub(norm("w"), 2))),
    ),
    "lmi": display(
        matrix(
            (row(sup(_Ap, "⊤"), _Pp, "+", _Pp, _Ap, "±", "ρ", fraction(row("d", "P"), row("d", "p"))),
             row(_Pp, _Bp), sup(_Cp, "⊤")),
            ("⋅", row("−", "γ", "I"), sup(_Dp, "⊤")),
            ("⋅", "⋅", row("−", "γ", "I")),
        ),
        "≺", 0, ",", "   ", _Pp, "≻", 0, "   ", words("for every p in [0, 13] m/s"),
    ),
    "scalings": display(
        sup(matrix((row("p", "I"),), ("I",)), "⊤"), "Π", matrix((row("p", "I"),), ("I",)), "⪰", 0,
        " ", words("for\N{NO-BREAK SPACE}"), row("|", "p", "|"), "≤", 1, ",", "   ", sub("Π", words("D/G")), "=",
        matrix((row("−", "D"), "G"), (sup("G", "⊤"), "D")), ",", " ", "D", "≻", 0, ",", " ",
        "G", "+", sup("G", "⊤"), "=", 0,
    ),
    "ratio": display(
        words("energy ratio"), "=",
        root(fraction(total("k", "N", sup(norm(_at("z")), 2)), total("k", "N", sup(norm(_at("w")), 2)))),
    ),
}  # fmt: off
"""By name."""
