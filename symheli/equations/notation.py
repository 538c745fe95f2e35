"""Names of the code and SymPy expressions as LaTeX symbols that papers, GitHub and matplotlib can
all set.
"""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

import sympy
from sympy.printing.latex import LatexPrinter

_GREEK = {
    "d": r"\delta",
    "Om": r"\Omega",
    "om": r"\omega",
    "lam": r"\lambda",
    **{name: rf"\{name}" for name in ("phi", "theta", "psi", "rho", "mu")},
}


def symbol_of(name: str) -> str:
    r"""Return the LaTeX of a name of the code: head and subscript, Greek letters by name: d_col is
    \\delta_{col}, a1_aft is a_{1,aft}.
    """
    match = re.fullmatch(r"([A-Za-z]+?)(\d*)(?:_(\w+))?", name)
    if not match:
        return rf"\mathrm{{{name}}}".replace("_", r"\_")
    head, *tails = match.groups(default="")
    subscript = ",".join(word for tail in tails for word in tail.split("_") if word)
    return _GREEK.get(head, head) + (f"_{{{subscript}}}" if subscript else "")


def real(latex: str) -> sympy.Symbol:
    """A real SymPy symbol that prints as `latex`."""
    return sympy.Symbol(latex, real=True)


def dot(latex: str) -> str:
    """LaTeX of the time derivative of a symbol."""
    head, underscore, subscript = latex.partition("_")
    return rf"\dot{{{head}}}{underscore}{subscript}"


def upright(latex: str) -> str:
    """Words in subscripts stand upright: V_{tip} as V_{\\mathrm{tip}}, but not the T and x of C_T
    and S_x.
    """

    def words(match: re.Match[str]) -> str:
        return (
            "_{"
            + re.sub(
                r"(?<!\\)\b(?!xx|yy|zz)[a-z]{2,}\b", lambda word: rf"\mathrm{{{word[0]}}}", match[1]
            )
            + "}"
        )

    return re.sub(r"_\{([^{}]*)\}", words, latex)


def printed(expression: Any) -> str:
    """Return the LaTeX of an expression whose symbols are named in LaTeX; floats that represent
    fractions or multiples of pi print as those.
    """
    expression = sympy.sympify(expression)
    return _Printer().doprint(
        expression.xreplace({number: _exact(number) for number in expression.atoms(sympy.Float)})
    )


def _exact(number: sympy.Float) -> sympy.Expr:
    """Return the small fraction, or fraction of pi, that a float represents, to rounding; the float
    itself where there is none.
    """
    for unit in (sympy.Integer(1), sympy.pi, 1 / sympy.pi):
        value = float(number / unit)
        fraction = Fraction(value).limit_denominator(16)
        if fraction != 0 and abs(float(fraction) / value - 1) < 1e-14:  # a few roundings of a float
            return sympy.Rational(fraction.numerator, fraction.denominator) * unit
    return number


class _Printer(LatexPrinter):
    """SymPy's LaTeX without environments: branches on one line, limits as min and max, no symbol
    taken apart.
    """

    def _print_Symbol(self, expr: sympy.Symbol, style: str = "plain") -> str:
        return upright(expr.name)

    def _print_Float(self, expr: sympy.Float) -> str:
        mantissa, _, exponent = f"{float(expr):.10g}".partition("e")
        if not exponent:
            return mantissa
        return (rf"{mantissa} \cdot " if mantissa != "1" else "") + f"10^{{{int(exponent)}}}"

    def _print_Piecewise(self, expr: sympy.Piecewise) -> str:
        *branches, last = ([self._print(part) for part in pair.args] for pair in expr.args)
        cases = [rf"{value} \quad \mathrm{{if}} \quad {condition}" for value, condition in branches]
        return (
            r"\left\lbrace "
            + r" ; \quad ".join([*cases, rf"{last[0]} \quad \mathrm{{otherwise}}"])
            + r" \right\rbrace"
        )

    def _limits(self, name: str, expr: sympy.Expr) -> str:
        return (
            rf"\{name}\left("
            + ", ".join(
                self._print(argument)
                for argument in sorted(expr.args, key=sympy.count_ops, reverse=True)
            )
            + r"\right)"
        )

    def _print_Min(self, expr: sympy.Min, exp: Any = None) -> str:
        return self._limits("min", expr)

    def _print_Max(self, expr: sympy.Max, exp: Any = None) -> str:
        return self._limits("max", expr)
