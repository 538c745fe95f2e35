"""The definitions that the report uses, as numbered formulas."""

from __future__ import annotations

from studies.report.mathml import (
    SPACE,
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

_rate = dot("p")
_AtP, _PA, _PB = row(sup("A ( p )", "⊤"), "P ( p )"), "P ( p ) A ( p )", "P ( p ) B ( p )"
_slope = row("ρ", fraction("d P", "d p"))
_p_one = matrix(("p I",), ("I",))
_past = matrix(("v ( k − i )",), ("ω ( k − i )",), ("u ( k − i )",))
_energy = {s: total("k = 1", "N", sup(norm(f"{s} ( k )"), 2)) for s in "zw"}

EQUATIONS: dict[str, str] = {
    "lpv": display(
        dot("x"), "= A ( p ) x + B ( p ) u −", sub("x", 0), "′ ( p )", _rate, ",", SPACE, "y = C x"
    ),
    "entries": display("A ( p ) =", total("i = 0", "d", sub("A", "i"), sup("p", "i"))),
    "lft": display(
        "A ( p ) =",
        row(sub("A", 0), "+", sub("B", "Δ"), "p I"),
        sup(row("( I −", sub("D", "Δ"), "p )"), "− 1"),
        sub("C", "Δ"),
    ),
    "arx": display(
        "y ( k ) = −",
        total("i = 1", "n", sub("a", "i"), "( p ) y ( k − i )"),
        "+",
        total("j = 1", "n", sub("b", "j"), "( p ) u ( k − j )"),
        "+",
        row("c ( p ) + d ( p )", _rate),
    ),
    "rls": display(
        row(hat("θ"), "=", words("arg")),
        extremum("min", "θ"),
        total("k = 1", "N", sup("λ", "N − k"), sup(norm("y ( k ) −", sup("θ", "⊤"), "φ ( k )"), 2)),
    ),
    "kinematics": display(
        matrix((dot("v"),), (dot("ω"),)),
        "=",
        matrix(("v × ω + g ( φ , θ )",), (0,)),
        "+",
        total("i = 1", 2, sub("Θ", "i"), "( p )", _past),
    ),
    "fit": display(
        row(words("fit"), "= 100 ( 1 −"),
        fraction(norm("y −", hat("y")), norm("y −", bar("y"))),
        ")",
        words("\N{NO-BREAK SPACE}%"),
    ),
    "gap": display(
        row(sub("δ", "ν"), "( P ,", sub("P", 1), ") < b ( P , K )"),
        row(SPACE, "⟹", SPACE, words("K stabilizes\N{NO-BREAK SPACE}"), sub("P", 1)),
    ),
    "gain": display(
        "γ =",
        extremum("sup", row("w ≠ 0 , |", _rate, "| ≤ ρ")),
        fraction(sub(norm("z"), 2), sub(norm("w"), 2)),
    ),
    "lmi": display(
        matrix(
            (row(_AtP, "+", _PA, "±", _slope), _PB, sup("C ( p )", "⊤")),
            ("⋅", "− γ I", sup("D ( p )", "⊤")),
            ("⋅", "⋅", "− γ I"),
        ),
        row(
            "≺ 0 ,", SPACE, "P ( p ) ≻ 0 ,", SPACE, "p ∈ [ 0 , 13 ]", words("\N{NO-BREAK SPACE}m/s")
        ),
    ),
    "scalings": display(
        row(sup(_p_one, "⊤"), "Π", _p_one, "⪰ 0 , | p | ≤ 1 ,", SPACE),
        row(sub("Π", words("D/G")), "=", matrix(("− D", "G"), (sup("G", "⊤"), "D")), ","),
        row("D ≻ 0 , G +", sup("G", "⊤"), "= 0"),
    ),
    "ratio": display(words("energy ratio"), "=", root(fraction(_energy["z"], _energy["w"]))),
}
"""By name."""
